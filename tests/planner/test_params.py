"""Tuning parameters of a search: bad values are refused, and searches obey them."""

from __future__ import annotations

import pytest

from planner import Cost, Iterations, Progress, SearchParams, solve, solve_window
from planner.params import AnnealingParams, LargeParams, WindowSearchParams
from tests.planner.builders import fleet, random_instance

INSTANCE = random_instance(5, 20, fleet(40.0, 40.0, 40.0))


def asked(params: SearchParams, *, iterations: int = 2_000, window: bool = False) -> list[Progress]:
    """Return what the stop rule of a search is asked with."""
    seen: list[Progress] = []
    stop = Iterations(iterations)
    if window:
        solve_window(INSTANCE, stretch=0.1, stop=stop, params=params, on_progress=seen.append)
    else:
        solve(INSTANCE, cost=Cost.MINMAX, stop=stop, params=params, on_progress=seen.append)
    return seen


def test_an_error_names_the_field_for_code_too() -> None:
    with pytest.raises(ValueError, match=r"region\n.*greater than or equal to 1"):
        LargeParams(region=-3)


def test_batches_have_the_given_length_and_change_no_plan() -> None:
    short = SearchParams(annealing=AnnealingParams(batch=100))
    assert [progress.iterations for progress in asked(short)] == list(range(0, 2_001, 100))
    stop = Iterations(2_000)
    usual = solve(INSTANCE, cost=Cost.MINMAX, stop=stop)
    assert solve(INSTANCE, cost=Cost.MINMAX, stop=stop, params=short).plan == usual.plan


def test_a_search_starts_at_the_given_temperature() -> None:
    cold = SearchParams(annealing=AnnealingParams(hot=0.01))
    values = [solve(INSTANCE, cost=Cost.MINSUM, stop=Iterations(3_000), params=params) for params in (cold, cold)]
    usual = solve(INSTANCE, cost=Cost.MINSUM, stop=Iterations(3_000))
    assert values[0].plan == values[1].plan != usual.plan


def test_regions_are_searched_in_the_given_spells() -> None:
    """Region by region the stop rule is asked once in a spell."""
    params = SearchParams(large=LargeParams(above=10, spell=700))
    assert [progress.iterations for progress in asked(params)] == [0, 700, 1_400, 2_000]


@pytest.mark.parametrize("searches", [1, 2])
def test_a_search_for_the_window_makes_the_given_number_of_plans(searches: int) -> None:
    window = WindowSearchParams(
        minmax_searches=searches, minmax_iterations=500, other_searches=0, full_effort_from=1, batch=200
    )
    walked = [progress.iterations for progress in asked(SearchParams(window=window), window=True)]
    # Each search asks at its begin and at its end, then the walk before each of its batches.
    plans = {1: [0, 500], 2: [0, 500, 500, 1_000]}[searches]
    assert walked == plans + list(range(500 * searches, 2_000, 200)) + [2_000]
