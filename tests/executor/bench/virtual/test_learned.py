"""What one flight teaches makes the prediction of the next one better: slow and thirsty vehicles, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executor.adapters.run_directory import RunDirectory
from executor.analysis.learned import learned_of, read_learned
from executor.bench.prediction import plan_with
from executor.bench.virtual.flight import VirtualFlight, fly_virtual
from executor.errors import LogError
from executor.simulator.config import SimVehicle
from executor.site.assembly import Ground
from missions import PlanFile, check_plan, read_plan, write_plan
from tests.executor.bench.virtual.short_line import short_ground


def planned(ground: Ground) -> PlanFile:
    return plan_with(ground, {"uav1": tuple(range(0, 20, 2))})


def thirsty(vehicle: SimVehicle) -> SimVehicle:
    return replace(vehicle, consumption=1.15)


def flown(ground: Ground) -> VirtualFlight:
    return fly_virtual(ground, planned(ground), seed=1, craft=thirsty)


def test_the_next_flight_is_predicted_better(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 1, "ardupilot")
    first = flown(ground)
    learned_of(first.context, first.state, {}, "2026-01-02").write(RunDirectory(tmp_path).learned)
    document = read_learned(RunDirectory(tmp_path).learned)
    [row] = document.vehicles
    assert row.consumption.mean == pytest.approx(1.15, abs=0.06)
    assert row.inspect.legs == 10
    known = replace(ground, learned=document.known)
    second = flown(known)
    [before], [after] = first.report.routes, second.report.routes
    assert before.energy_error_pct is not None
    assert after.energy_error_pct is not None
    assert abs(after.energy_error_pct) < 0.5 * abs(before.energy_error_pct)
    path = tmp_path / "plan.json"
    write_plan(path, planned(known))
    again = read_plan(path)
    assert again.vehicles[0].consumption == row.consumption.mean
    assert again.pricing is not None
    assert again.pricing.models["uav1"].pace == known.learned["uav1"].pace
    assert check_plan(again, search_window=False) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [('"mean": ', '"mean": -', "mean"), ("faultline-learned/1", "faultline-learned/9", "format"), ("{", "[", "JSON")],
)
def test_a_wrong_file_is_named_with_its_key(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "learned.json"
    pace = '{"mean": 1.0, "sd": 0.1, "legs": 1}'
    path.write_text(
        '{"format": "faultline-learned/1", "date": "2026-01-02", "vehicles": [{"name": "a", "autopilot": "px4", '
        f'"drone": "x", "inspect": {pace}, "transit": {pace}, '
        '"consumption": {"mean": 1.0, "sd": 0.1, "minutes": 1.0}}]}',
        encoding="utf-8",
    )
    assert read_learned(path).known["a"].inspect.legs == 1
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(LogError, match=said) as error:
        read_learned(path)
    assert str(error.value).startswith(str(path))
    with pytest.raises(LogError, match="cannot be read"):
        read_learned(tmp_path / "none.json")
