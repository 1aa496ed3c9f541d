"""Flights of a known vehicle, written as telemetry logs: what is learned of them is what it is."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mav

from executor.cli import main
from executor.site.site_file import read_site
from executor.site.site_model import drone_of
from planner import CLIMB_SHARE_PER_M_S, PRESETS, pct_per_s, power_w
from simulator.battery import Battery as Pack
from tests.recorded import LOGS, Writer, heartbeat, station

DRONE = replace(PRESETS["mavic3"], capacity_ah=4.4)
CONSUMPTION = 1.15
LOSS = 0.08
SWITCH = 6
SPEEDS = (0.0, 3.0, 5.0, 8.0)
SURE = 3.0
"""Deviations within which the truth has to lie."""


def status(volts: float, amperes: float, percent: float) -> Any:
    return mav.MAVLink_sys_status_message(
        0, 0, 0, 0, round(1000 * volts), round(100 * amperes), round(percent), 0, 0, 0, 0, 0, 0
    )


def position(at_s: float, speed_m_s: float, height_m: float, climb_m_s: float) -> Any:
    return mav.MAVLink_global_position_int_message(
        round(1000 * at_s), 503000000, 133000000, 300000, round(1000 * height_m), round(100 * speed_m_s), 0,
        round(-100 * climb_m_s), 0,
    )  # fmt: skip


def channels(value: int) -> Any:
    return mav.MAVLink_rc_channels_raw_message(0, 0, 1500, 1500, 1100, 1500, 1000, value, 1000, 1000, 255)


def fly(folder: Path, number: int, *, lossy: bool = True) -> Pack:
    """Write one flight: every speed for a minute, climbs between them, the mode switch moved now and then."""
    rng = np.random.default_rng(number)
    pack = Pack(DRONE, charge_pct=98.0, health=1.0, consumption=CONSUMPTION)
    writer = Writer()
    legs = [leg for speed in SPEEDS for leg in ((60, speed, 0.0), (14, speed, 2.0), (8, speed, 6.0), (24, speed, -1.0))]
    at_s, height_m, mode = 3.0, 20.0, 3
    writer.say(0.5, 1, heartbeat(armed=False))
    writer.say(0.6, 1, status(pack.voltage_v, 0.3, 98))
    for lasts_s, speed, climb in legs:
        mode = 8 - mode
        switch = 1300 if mode == 5 else 1700
        for half in range(2 * lasts_s):
            pack.step(0.5, motors=True, speed_m_s=speed, climb_m_s=climb)
            height_m += 0.5 * climb
            amperes = pack.current_a * (1 + 0.02 * rng.normal())
            said = [
                position(at_s, speed + 0.1 * rng.normal(), height_m, climb),
                status(pack.voltage_v * (1 + 0.001 * rng.normal()), amperes, pack.charge_pct),
                channels(switch),
                *([heartbeat(mode=mode)] if half % 2 == 0 else []),
            ]
            for index, message in enumerate(said):
                packed = writer.frame(1, message)
                if not lossy or rng.random() >= LOSS:
                    writer.records.append((at_s + 0.01 * index, packed))
            if half % 4 == 0:
                writer.say(at_s + 0.2, 255, station())
            at_s += 0.5
    writer.say(at_s + 1.0, 1, heartbeat(armed=False))
    writer.write(folder / f"{number}.tlog")
    return pack


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main.main(["replay", *arguments])
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Pack]:
    folder = tmp_path_factory.mktemp("logs")
    return folder, [fly(folder, number) for number in range(3)][-1]


def test_what_is_learned_is_what_the_vehicle_is(
    logs: tuple[Path, Pack], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = logs
    out = tmp_path / "vehicle.toml"
    assert called(str(folder), "--learn", "-o", str(out)) == 0
    assert "mode switch   channel 6 (seen)" in capsys.readouterr().out
    found = tomllib.loads(out.read_text())["learned"]

    def close(figure: dict[str, float], truth: float, least: float) -> None:
        assert figure["samples"] >= least
        assert figure["mean"] == pytest.approx(truth, abs=SURE * figure["sd"]), figure
        assert figure["sd"] < 0.15 * abs(truth) + 0.02, "so unsure it says nothing"

    still = pct_per_s(DRONE, 0.0) * CONSUMPTION
    close(found["hover_a"], 36.0 * still * DRONE.capacity_ah, 20)
    close(found["capacity_ah"], DRONE.capacity_ah, 3)
    close(found["climb_share"], CLIMB_SHARE_PER_M_S, 10)
    close(found["link_loss_pct"], 100 * LOSS, 10)
    volts = 3.7 * DRONE.cells
    sag = 0.03 * volts**2 / power_w(DRONE, 0.0)
    close(found["resistance_ohm"], sag, 10)
    speeds = [row["speed_m_s"] for row in found["level"]]
    assert speeds == pytest.approx(SPEEDS, abs=0.2)
    for row in found["level"]:
        close(row["pct_per_min"], 60 * CONSUMPTION * pct_per_s(DRONE, round(row["speed_m_s"])), 20)
    assert found["mode_switch"]["channel"] == SWITCH
    assert found["mode_switch"]["moved"] >= 0.9 * found["mode_switch"]["changes"] > 0
    assert found["logs"] == 3


def test_a_site_flies_by_what_was_learned(logs: tuple[Path, Pack], tmp_path: Path) -> None:
    folder, _ = logs
    out = tmp_path / "vehicle.toml"
    assert called(str(folder), "--learn", "-o", str(out)) == 0
    head = '[network]\nfile = "default"\n[[vehicle]]\nname = "uav1"\nconnection = "udpin://0.0.0.0:14550"\nsysid = 1\n'
    site = tmp_path / "site.toml"
    site.write_text(head + 'autopilot = "ardupilot"\n' + out.read_text())
    read = read_site(site)
    drone = drone_of(read)
    assert read.learned is not None
    assert drone.capacity_ah == pytest.approx(DRONE.capacity_ah, rel=0.03)
    for speed in SPEEDS:
        assert pct_per_s(drone, speed) == pytest.approx(CONSUMPTION * pct_per_s(DRONE, speed), rel=0.06)


def test_a_table_with_impossible_values_is_refused(tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(
        '[network]\nfile = "default"\n'
        "[learned]\nlogs = 1\nminutes = 2.0\nhover_a = { mean = 9.0, sd = -1.0, samples = 3 }\n"
        '[[vehicle]]\nname = "uav1"\nconnection = "udpin://0.0.0.0:14550"\nsysid = 1\nautopilot = "px4"\n'
    )
    with pytest.raises(Exception, match=r"learned\.hover_a\.sd"):
        read_site(site)


def test_logs_without_a_flight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = Writer()
    for second in range(60):
        writer.say(second, 1, heartbeat(armed=False))
    writer.write(tmp_path / "a.tlog")
    assert called(str(tmp_path / "a.tlog"), "--learn") == 2
    assert "expected logs in which a vehicle flies" in capsys.readouterr().err


def test_of_many_logs_one_that_is_none_costs_nothing(
    logs: tuple[Path, Pack], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "a.BIN"
    broken.write_bytes(b"\xa3\x95 is no record of anything" * 20)
    assert called(str(broken), str(logs[0] / "0.tlog"), "--learn", "--json") == 0
    assert json.loads(capsys.readouterr().out)["learned"]["logs"] == 1
    assert called(str(broken), "--learn") == 2
    assert f"{broken}: expected a DataFlash log" in capsys.readouterr().err


def test_a_quadcopter_that_was_built_for_schools(capsys: pytest.CaptureFixture[str]) -> None:
    """An Iris+ weighs 1.3 to 1.5 kg, hovers on about 170 W, and carries 5.1 Ah."""
    folder = LOGS / "real"
    if not folder.is_dir():
        pytest.skip("the recorded flights are not beside the project (../shared/logs)")
    logs = sorted(map(str, folder.glob("kevinaangstadt*2016-07-21*")))
    assert called(*logs, "--learn", "--json") == 0
    found = json.loads(capsys.readouterr().out)["learned"]
    assert 13.0 < found["hover_a"]["mean"] < 19.0
    assert 140.0 < found["hover_w"]["mean"] < 220.0
    assert 4.9 < found["capacity_ah"]["mean"] < 5.3
    assert found["mode_switch"]["channel"] == 5
