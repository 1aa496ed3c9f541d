"""What flights say of packs, over several logs."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.cli import main
from executor.core.battery.resting import Chemistry
from executor.core.recording import Skipped
from executor.errors import LogError
from executor.replay.packs import PackFlight, capacity_ah
from executor.replay.packs_file import pack_lines, packs_of, read_packs
from executor.replay.result import LogReplay, VehicleReplay
from tests.recorded import real_logs

FLIGHT = PackFlight(10.0, 400.0, 1, 3, 4.18, 3.68, 100.0, 76.0, 0.12, 0.012, 0.001, 2.4, 10.0, None)


def replayed(name: str, *flights: PackFlight) -> LogReplay:
    vehicle = VehicleReplay(1, "uav1", "ardupilot", (), (), 390.0, (), packs=flights)
    return LogReplay(Path(name), (vehicle,), Skipped(), 1_000_000, 500.0)


def test_a_capacity_is_what_was_counted_by_what_the_voltage_says_was_used() -> None:
    assert capacity_ah(FLIGHT, Chemistry.LI_ION) == pytest.approx((4.8, 4.8), rel=0.01)
    least_ah, most_ah = capacity_ah(FLIGHT, None) or (0.0, 0.0)
    assert least_ah < 3.0
    assert most_ah == pytest.approx(4.8, rel=0.01)


def test_further_logs_add_to_what_is_known(tmp_path: Path) -> None:
    path = tmp_path / "packs.json"
    packs_of([replayed("a.tlog", FLIGHT)]).write(path)
    both = packs_of([replayed("b.tlog", FLIGHT), replayed("a.tlog", FLIGHT)], read_packs(path))
    assert [one.log for one in both.flights] == ["a.tlog", "b.tlog"]
    assert both.flights[0].minutes == 6.5
    assert both.flights[0].began_usec == 11_000_000
    assert sum("uav1" in line for line in pack_lines(both)) == 2


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "packs.json"
    path.write_text('{"format": "faultline-learned/1", "flights": []}')
    with pytest.raises(LogError, match=r"packs\.json: .*format"):
        read_packs(path)


def test_a_recorded_flights_pack(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """ArduPilot's simulated pack of 10 Ah, and its 10 mOhm."""
    path = tmp_path / "packs.json"
    with pytest.raises(SystemExit) as left:
        main.main(["replay", str(real_logs() / "nominal.tlog"), "--packs", str(path)])
    assert left.value.code == 0
    assert "by voltage Ah" in capsys.readouterr().out
    [flight] = read_packs(path).flights
    assert flight.cells == 3
    assert flight.ohm == pytest.approx(0.0105, abs=0.003)
    assert flight.least_ah is not None
    assert flight.most_ah is not None
    assert flight.least_ah - 0.5 <= 10.0 <= flight.most_ah * 1.6
