"""A whole flight over a serial radio that is unplugged while both vehicles are in the air."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.e2e.flights import called, ended, notes, said_in, site_file
from tests.serial_radio import SerialRadio

pytestmark = pytest.mark.asyncio

SPEEDUP = 5.0
UNPLUGGED_S = 5
"""In the vehicles' time."""


async def test_a_radio_that_is_unplugged_in_the_air_and_plugged_in_again(tmp_path: Path) -> None:
    site, ports = site_file(tmp_path, pylons=6, vehicles=2, speedup=SPEEDUP)
    radio, over_radio = SerialRadio(tmp_path / "ttyUSB0"), tmp_path / "radio.toml"
    text = site.read_text(encoding="utf-8")
    for port in ports:
        text = text.replace(f"udpin://127.0.0.1:{port}", f"serial://{radio.device}:57600")
    over_radio.write_text(text, encoding="utf-8")
    run = tmp_path / "run"
    with radio.beside(ports):
        async with called("simulate", str(site)), called("fly", str(over_radio), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
            radio.unplug()
            await radio.missed(UNPLUGGED_S * len(ports))
            radio.plug()
            _, err = await ended(flight)
    assert flight.returncode == 0, err
    said = [note["said"] for note in notes(run)]
    assert [line for line in said if "no message for 3" in line], "it was unplugged"
    assert not [line for line in said if line.startswith("re-plan")], "nobody was lost"
    report = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert report["segments_inspected"] == report["segments_total"] == 5
    assert report["faults"] == report["replans"] == []
