"""What flights say of packs, over several logs."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.cli import main
from executor.core.battery.voltage import Chemistry
from executor.core.interface.messages import Heartbeat
from executor.core.interface.recorded_log import SkippedRecords
from executor.errors import LogError
from executor.replay.replay_result import (
    LogReplay,
    VehicleReplay,
    capacity_ah,
    format_pack_lines,
    merge_packs,
)
from executor.site.learned_files import PackEntry, PacksDocument
from tests.recorded import real_logs

FLIGHT = PackEntry(
    log="", vehicle="", pack=1, began_usec=10_000_000, minutes=6.5, cells=3, rest_cell_v=4.18, end_cell_v=3.68,
    began_pct=100.0, ended_pct=76.0, sag_cell_v=0.12, ohm=0.012, ohm_sd=0.001, counted_ah=2.4, set_ah=10.0,
)  # fmt: skip


def replayed(name: str, *flights: PackEntry) -> LogReplay:
    vehicle = VehicleReplay(1, "uav1", "ardupilot", (), (), 390.0, (), packs=flights)
    return LogReplay(Path(name), (vehicle,), SkippedRecords(), 1_000_000, 500.0)


def test_a_capacity_is_what_was_counted_by_what_the_voltage_says_was_used() -> None:
    assert capacity_ah(FLIGHT, Chemistry.LI_ION) == pytest.approx((4.8, 4.8), rel=0.01)
    least_ah, most_ah = capacity_ah(FLIGHT, None) or (0.0, 0.0)
    assert least_ah < 3.0
    assert most_ah == pytest.approx(4.8, rel=0.01)


def test_further_logs_add_to_what_is_known(tmp_path: Path) -> None:
    path = tmp_path / "packs.json"
    merge_packs([replayed("a.tlog", FLIGHT)]).write(path)
    both = merge_packs([replayed("b.tlog", FLIGHT), replayed("a.tlog", FLIGHT)], PacksDocument.read(path))
    assert [one.log for one in both.flights] == ["a.tlog", "b.tlog"]
    assert both.flights[0].minutes == 6.5
    assert both.flights[0].began_usec == 11_000_000
    assert sum("uav1" in line for line in format_pack_lines(both)) == 2


def test_flights_are_known_by_the_label_of_their_pack(tmp_path: Path) -> None:
    path, two = tmp_path / "packs.json", FLIGHT.model_copy(update={"began_usec": 600_000_000, "pack": 2})
    merge_packs([replayed("a.tlog", FLIGHT), replayed("b.tlog", FLIGHT, two)], None, {1: "A7", 2: "B1"}).write(path)
    known = PacksDocument.read(path)
    # Which of two packs has the label, nobody said.
    assert [(one.log, one.label) for one in known.flights] == [("a.tlog", "A7"), ("b.tlog", None), ("b.tlog", None)]
    again = merge_packs([replayed("a.tlog", FLIGHT)], known)
    assert again.flights[0].label == "A7", "what was written down stays"


def test_the_label_is_that_of_the_site_it_is_replayed_with(tmp_path: Path) -> None:
    site, path = tmp_path / "site.toml", tmp_path / "packs.json"
    site.write_text(
        '[network]\nfile = "default"\n[[vehicle]]\nname = "uav1"\nconnection = "udpin://127.0.0.1:14551"\nsysid = 41\n'
        'autopilot = "ardupilot"\npack = "A7"\n'
    )
    log = real_logs() / "nominal.tlog"
    system = next(system for _, system, said in TelemetryFile(log).read_records() if isinstance(said, Heartbeat))
    site.write_text(site.read_text().replace("sysid = 41", f"sysid = {system}"))
    with pytest.raises(SystemExit):
        main.main(["replay", str(log), "--packs", str(path), "--site", str(site)])
    assert [one.label for one in PacksDocument.read(path).flights] == ["A7"]


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "packs.json"
    path.write_text('{"format": "faultline-learned/1", "flights": []}')
    with pytest.raises(LogError, match=r"packs\.json: .*format"):
        PacksDocument.read(path)


def test_a_recorded_flights_pack(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """ArduPilot's simulated pack of 10 Ah, and its 10 mOhm."""
    path = tmp_path / "packs.json"
    with pytest.raises(SystemExit) as left:
        main.main(["replay", str(real_logs() / "nominal.tlog"), "--packs", str(path)])
    assert left.value.code == 0
    assert "by voltage Ah" in capsys.readouterr().out
    [flight] = PacksDocument.read(path).flights
    assert flight.cells == 3
    assert flight.ohm == pytest.approx(0.0105, abs=0.003)
    assert flight.least_ah is not None
    assert flight.most_ah is not None
    assert flight.least_ah - 0.5 <= 10.0 <= flight.most_ah * 1.6
