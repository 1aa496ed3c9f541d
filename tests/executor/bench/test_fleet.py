"""The measurement of fleets, on a small one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executor import build
from executor.bench.cli import cli
from executor.bench.fleet import Flown, report_of
from executor.bench.fleetsite import site_of, write_network
from executor.config import check_site


def test_the_network_keeps_everybody_busy(tmp_path: Path) -> None:
    write_network(tmp_path / "network.graph", vehicles=3, minutes=10.0, seed=1)
    ground = build.ground_of(check_site(site_of("network.graph", 3, 2.0), "fleet"), tmp_path)
    inspected_m = float(ground.network.lengths_m.sum())
    assert inspected_m / ground.inspection.speed_m_s >= 3 * 600.0
    assert len({vehicle.connection for vehicle in ground.site.vehicle}) == 3


def test_a_fleet_is_flown_and_measured(tmp_path: Path) -> None:
    case = ["fleet", "--vehicles", "2", "--minutes", "1", "--speedup", "10", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(cli, case)
    assert done.exit_code == 0, done.output
    [row] = json.loads((tmp_path / "fleet.json").read_text())["rows"]
    assert row["vehicles"] == 2
    assert row["minutes"] >= 1.0
    assert row["faults"] == 0
    assert row["events"] > row["frames"] / 4 > 0
    assert row["cpu_s"] > row["codec_s"] > 0.0
    assert len(row["memory_mib"]) > 2
    assert "| 2 |" in (tmp_path / "fleet.md").read_text()


def test_growth_is_counted_from_the_first_quarter() -> None:
    memory_mib = (100.0, 110.0, 120.0, 121.0, 121.0, 121.5, 121.5, 122.0)
    flown = Flown(50, 60.0, 2.0, 9_000, 0, 10_000, 0, 0, 1800.0, 300.0, (1.0, 2.0, 3.0), memory_mib)
    assert flown.growth_mib == pytest.approx(2.0)
    assert flown.cpu_ms == pytest.approx(10.0)
    row = next(line for line in report_of([flown], {"cores": 2, "processor": "x", "commit": "y"}).splitlines()
               if line.startswith("| 50 |"))  # fmt: skip
    assert [cell.strip() for cell in row.strip("|").split("|")][7:10] == ["10.00", "6.0", "50.0"]
