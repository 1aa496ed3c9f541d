"""The measurement of fleets, on a small one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks.browser import oldest_shown_s
from benchmarks.commands import cli
from benchmarks.fleet import FleetFlight, fleet_report
from benchmarks.fleetsite import site_of, write_network
from benchmarks.garbage import STRANGER, datagrams
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.site import site_model
from executor.site.site_file import check_site


def test_the_network_keeps_every_vehicle_busy(tmp_path: Path) -> None:
    write_network(tmp_path / "network.graph", vehicles=3, minutes=10.0, seed=1)
    ground = site_model.load_site_model(check_site(site_of("network.graph", 3, 2.0), "fleet"), tmp_path)
    inspected_m = float(ground.network.lengths_m.sum())
    assert inspected_m / ground.inspection.speed_m_s >= 3 * 600.0
    assert len({vehicle.connection for vehicle in ground.site.vehicle}) == 3


def test_a_fleet_is_flown_and_measured(tmp_path: Path) -> None:
    case = ["fleet", "--vehicles", "2", "--minutes", "1", "--speedup", "10", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(cli, [*case, "--garbage", "5", "--browsers", "1"])
    assert done.exit_code == 0, done.output
    [row] = json.loads((tmp_path / "fleet.json").read_text())["rows"]
    assert row["vehicles"] == 2
    assert row["minutes"] >= 1.0
    assert row["faults"] == 0
    assert row["events"] > row["frames"] / 4 > 0
    assert row["cpu_s"] > row["codec_s"] > 0.0
    assert len(row["memory_mib"]) > 2
    assert row["garbage"] > 2 * row["frames"]
    assert 0.0 < row["shown_s"] < float("inf")
    assert "| 2 |" in (tmp_path / "fleet.md").read_text()


def test_growth_is_counted_from_the_first_quarter() -> None:
    memory_mib = (100.0, 110.0, 120.0, 121.0, 121.0, 121.5, 121.5, 122.0)
    flown = FleetFlight(50, 60.0, 2.0, 9_000, 0, 10_000, 0, 0, 1800.0, 300.0, (1.0, 2.0, 3.0), memory_mib)
    assert flown.growth_mib == pytest.approx(2.0)
    assert flown.cpu_ms == pytest.approx(10.0)
    row = next(line for line in fleet_report([flown], {"cores": 2, "processor": "x", "commit": "y"}).splitlines()
               if line.startswith("| 50 |"))  # fmt: skip
    assert [cell.strip() for cell in row.strip("|").split("|")][7:10] == ["10.00", "6.0", "50.0"]


def test_garbage_is_noise_damage_and_strangers_in_equal_parts() -> None:
    kinds = datagrams(seed=1)
    assert kinds == datagrams(seed=1)
    frames = [list(MavlinkCodec().decode(data)) for data in kinds]
    assert all(len(found) == 1 and found[0].sysid == STRANGER for found in frames[2::3])
    assert not any(found for found in frames[1::3])
    assert {type(one[0].message).__name__ for one in frames[2::3]} == {
        "Heartbeat", "Attitude", "Position", "StatusText"
    }  # fmt: skip


def test_a_state_grows_old_until_the_next_one_comes() -> None:
    seen = [(1000.1, 0.0), (1002.0, 3.0), (1002.6, 5.0), (1009.0, 6.0)]
    # At twice real time: made at 1001.5 and 1002.5, and what was before the take-off does not count.
    assert oldest_shown_s(seen[:3], began_unix_s=1000.0, speedup=2.0, since_s=1.0) == pytest.approx(1.1)
    assert oldest_shown_s(seen, began_unix_s=1000.0, speedup=2.0, since_s=1.0) == pytest.approx(6.5)
    assert oldest_shown_s(seen, began_unix_s=1000.0, speedup=2.0, since_s=9.0) == float("inf")
