"""Stop rules are plain functions of where a search stands."""

from __future__ import annotations

from dataclasses import replace

from planner import (
    Cancelled,
    FirstFeasible,
    Iterations,
    NoImprovement,
    Progress,
    Seconds,
    Stopwatch,
    combine_stop_rules,
)

EARLY = Progress(
    iterations=100, since_improvement=40, seconds=1.0, value=5.0, uncovered=2, feasible=False, impossible=False
)


def test_seconds() -> None:
    assert Seconds(1.5)(EARLY).allowed > 10**9
    assert Seconds(1.0)(EARLY).allowed == 0


def test_iterations_are_exact() -> None:
    assert Iterations(130)(EARLY).allowed == 30
    assert Iterations(100)(EARLY).allowed == 0
    assert Iterations(20)(EARLY).allowed == 0


def test_no_improvement_counts_from_the_last_one() -> None:
    assert NoImprovement(50)(EARLY).allowed == 10
    assert NoImprovement(40)(EARLY).allowed == 0


def test_first_feasible_also_stops_where_nothing_is() -> None:
    assert FirstFeasible()(EARLY).allowed > 10**9
    assert FirstFeasible()(replace(EARLY, feasible=True)).allowed == 0
    hopeless = FirstFeasible()(replace(EARLY, impossible=True))
    assert (hopeless.allowed, hopeless.reason) == (0, "no feasible plan exists")


def test_another_thread_can_stop_it() -> None:
    orders = iter([False, True])
    rule = Cancelled(lambda: next(orders))
    assert rule(EARLY).allowed > 10**9
    assert rule(EARLY).allowed == 0


def test_the_strictest_rule_decides_and_gives_the_reason() -> None:
    verdict = combine_stop_rules(Seconds(9.0), Iterations(130), NoImprovement(50))(EARLY)
    assert (verdict.allowed, verdict.reason) == (10, "no improvement")
    assert combine_stop_rules()(EARLY).allowed > 10**9


def test_the_watch_runs_forward() -> None:
    watch = Stopwatch()
    first = watch.seconds
    assert 0 <= first <= watch.seconds
