"""The parts of the measurements: what their pages say of small results, and how they go about missing data."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.all_parts import WORK, make_parts
from benchmarks.parts import bounds, exact, mtsp, onboard, replan, scale, start
from benchmarks.parts.names import PartName
from benchmarks.parts.setting import Setting
from benchmarks.peer import pyvrp_installed, solve_pyvrp
from benchmarks.problems import PAPER_S, line_instance
from benchmarks.store import Store
from planner import Cost, Iterations, Plan, Route, build_remaining_problem, evaluate, solve


def test_every_part_has_its_work() -> None:
    assert set(WORK) == set(PartName)


def test_without_data_a_part_that_needs_it_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_parts([PartName.MTSP], None, tmp_path, seed=1, quick=True, fresh=False)
    assert "mtsp is left out" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_gap_is_over_the_best_known() -> None:
    row = {"instance": "eil51", "vehicles": 2, "best_known": 200.0, "source": "made up", "value": 201.0,
           "farthest": 90.0}  # fmt: skip
    text = mtsp.report({"rows": [row, {**row, "value": 200.0}]})
    assert "| eil51 | 2 | 201.00 | 200.00 | +0.50 % | 90.00 | made up |" in text
    assert "Mean gap 0.250 %, largest 0.500 %" in text


def test_start_times_are_distinguished() -> None:
    text = start.report({"python_s": 0.1, "import_s": 0.25, "cold_s": 9.0, "warm_s": 1.2, "starts": 5})
    assert "| import planner, less Python alone | 0.15 |" in text


def test_losses_are_all_vehicles_in_flight_at_each_completion() -> None:
    ends = [[[100.0 * n, 50.0], [100.0 * n + 90.0, 50.0]] for n in range(4)]
    instance = line_instance(ends, 2, PAPER_S)
    plan = solve(instance, cost=Cost.MINMAX, stop=Iterations(200), all_vehicles=True).plan
    losses = list(replan._losses(instance, plan))
    assert losses[:2] == [(0, 0.0), (1, 0.0)]
    assert len(losses) == len(set(losses))
    for lost, at_s in losses:
        assert build_remaining_problem(instance, plan, lost, at_s).open_segments or at_s > 0


def test_the_page_of_re_plans_says_what_was_missed() -> None:
    times = {"count": 90, "p50_ms": 1.0, "p90_ms": 2.0, "p99_ms": 3.0, "max_ms": 4.0}
    row = {"case": "real", "tightness": 0.8, "segments": 81, "vehicles": 4, "losses": 100, "tried": 100,
           "feasible": times, "given_up": [[0, 0.0, True]] * 10, "certain": 10, "given_up_s": None}  # fmt: skip
    peer = {"given_up": 10, "asked": 10, "certain": 4, "solved": [{}]}
    text = replan.report({"rows": [row], "peer": peer})
    assert "| 81 | 4 | 0.8 | 100 | 100 | 90 | 1.0 | 2.0 | 3.0 | 4.0 | 10 | 10 | - | - |" in text
    assert "it found a re-plan for 1. 4 of those asked" in text


def test_agents_start_in_the_field_and_tasks_take_their_time() -> None:
    scenario = onboard.OnboardCase((0, 0), ((3, 4), (0, 10)), ((3, 0), (0, 4)), (2.0, 5.0))
    instance = onboard.build_scenario(scenario)
    plan = Plan((Route(0, (0, 2)), Route(1, ())))
    figures = evaluate(instance, plan, Cost.MINMAX)
    assert figures.durations_s == pytest.approx((4 + 2 + 5 + 5 + 4, 10))
    assert figures.violations == ()
    assert onboard.draw_scenario(4, 1) == onboard.draw_scenario(4, 1)
    assert len(onboard.draw_scenario(4, 1).places) == 4 * onboard.PARTS


def test_the_page_of_small_re_plans_says_how_many_were_optimal() -> None:
    one = {"equal": 290, "within": 300, "mean": 0.001, "worst": 0.04, "seconds": 0.002}
    text = onboard.report({"rows": [{"tasks": 4, "parts": 8, "programs": {"search": one}}], "cases": 300})
    assert "| 4 (8) | search | 290 of 300 | 100.0 | 0.10 | 4.00 | 2.00 |" in text
    assert "LKH-3 was not run: FAULTLINE_LKH names its program." in text


def test_the_page_of_bounds_gives_gaps_and_counts_verdicts() -> None:
    cost = {"radius_m": 500.0, "segments": 18, "cost": "minsum", "value": 200.0, "bound": 199.0, "processor_s": 1.25}
    window = {"radius_m": 500.0, "tightness": 0.9, "earliest_s": 800.0, "bound_s": 600.0, "processor_s": 2.0}
    losses = [("feasible", "search"), ("feasible", "columns"), ("impossible", "columns"), ("open", "columns")]
    rows = [{"verdict": verdict, "how": how, "processor_s": 3.0} for verdict, how in losses]
    text = bounds.report({"costs": [cost], "windows": [window], "losses": [{"radius_m": 1000.0, "rows": rows}]})
    assert "| 500 | 18 | minsum | 200.0000 | 199.0000 | 0.500 | 1.2 |" in text
    assert "| 500 | 0.90 | 800 | 600 | 25.0 | 2.0 |" in text
    assert "| 1000 | 4 | 1 | 1 | 0 | 1 | 1 | 3.0 |" in text


def test_values_over_time_are_of_complete_plans() -> None:
    seen = [(1.0, 50.0, True), (3.0, 40.0, True)]
    assert [scale._value_at(seen, at_s) for at_s in (0.5, 1.0, 2.9, 3.0)] == [None, 50.0, 50.0, 40.0]


def test_random_instances_can_just_be_covered() -> None:
    instance = exact.random_line(5, 2, seed=3)
    assert solve(instance, cost=Cost.MINCOMB, stop=Iterations(2000)).feasible


def test_a_setting_without_data_says_what_is_missing(tmp_path: Path) -> None:
    setting = Setting(None, Store(tmp_path), lambda *_: None, quick=True)
    with pytest.raises(Exception, match="--data DIR"):
        setting.nechranice(500)
    assert setting.seconds(10.0) == pytest.approx(1.0)


@pytest.mark.skipif(not pyvrp_installed(), reason="PyVRP is not installed")
def test_pyvrp_solves_the_same_problem_as_we_do() -> None:
    instance = exact.random_line(6, 2, seed=1)
    ours = solve(instance, cost=Cost.MINSUM, stop=Iterations(4000))
    theirs = solve_pyvrp(instance, seconds=0.3, seed=1)
    assert theirs.value == pytest.approx(ours.evaluation.value, rel=1e-3)
    left = build_remaining_problem(instance, ours.plan, 0, 100.0).instance
    again = solve_pyvrp(left, seconds=0.3, seed=1)
    assert (again.plan is not None) == solve(left, cost=Cost.MINSUM, stop=Iterations(4000)).feasible
