"""What a search is tuned by: a file sets what it names, a wrong one is refused by name, searches obey."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest

from planner import (
    DEFAULT_PARAMS,
    AnnealingParams,
    Cost,
    Iterations,
    LargeParams,
    ParamsError,
    Progress,
    SearchParams,
    WindowSearchParams,
    solve,
    solve_window,
)
from tests.planner.builders import fleet, random_instance

INSTANCE = random_instance(5, 20, fleet(40.0, 40.0, 40.0))


def loaded(folder: Path, text: str) -> SearchParams:
    path = folder / "search.toml"
    path.write_text(text, encoding="utf-8")
    return SearchParams.load(path)


def asked(params: SearchParams, *, iterations: int = 2_000, window: bool = False) -> list[Progress]:
    """Return what the stop rule of a search is asked with."""
    seen: list[Progress] = []
    stop = Iterations(iterations)
    if window:
        solve_window(INSTANCE, stretch=0.1, stop=stop, params=params, on_progress=seen.append)
    else:
        solve(INSTANCE, cost=Cost.MINMAX, stop=stop, params=params, on_progress=seen.append)
    return seen


def test_a_file_sets_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    params = loaded(tmp_path, "[annealing]\nhot = 8\npowers = [4, 8.0]\n\n[window]\nways = [[0, 1]]\nprobes = 4\n")
    assert params == SearchParams(
        annealing=AnnealingParams(hot=8.0, powers=(4.0, 8.0)), window=WindowSearchParams(ways=((0.0, 1.0),), probes=4)
    )
    assert loaded(tmp_path, "") == DEFAULT_PARAMS


def test_all_that_there_is_can_be_set() -> None:
    assert SearchParams.from_mapping(asdict(DEFAULT_PARAMS)) == DEFAULT_PARAMS


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("hot = 3", "hot: not known; expected one of annealing, large, exact, window"),
        ("[window]\nheat = 3", "window.heat: not known; expected one of minmax_searches, "),
        ("window = 3", "window: expected a table, got 3"),
        ("[annealing]\nbatch = 0", "annealing.batch: expected a whole number, 1 or more, got 0"),
        ("[annealing]\nbatch = true", "annealing.batch: expected a whole number, 1 or more, got True"),
        ("[annealing]\nbatch = 5.5", "annealing.batch: expected a whole number, 1 or more, got 5.5"),
        ("[annealing]\nhot = nan", "annealing.hot: expected a number above 0, got nan"),
        ("[annealing]\nhot = 'much'", "annealing.hot: expected a number above 0, got 'much'"),
        ("[annealing]\nslack = 1.5", "annealing.slack: expected a number 0 or more, 1 at most, got 1.5"),
        ("[annealing]\npowers = [8, 'x']", "annealing.powers: expected a list of numbers from 1 to 1000, got [8, 'x']"),
        ("[annealing]\ncold = 7", "annealing.cold: expected at most hot, 6.0, got 7.0"),
        ("[window]\nways = [[0.5]]", "window.ways: expected a list of pairs of shares from 0 to 1, got [[0.5]]"),
        ("[window]\nways = []", "window.ways: expected a list of pairs of shares from 0 to 1, got []"),
        ("[window]\nmost_flipped = 40", "window.most_flipped: expected a whole number, from 0 to 16, got 40"),
        ("[window]\nlast_step = 0.5", "window.last_step: expected at most first_step, 0.06, got 0.5"),
        ("[window]\nlongest_cycle = 10", "window.cycle: expected at most longest_cycle, 10, got 4000"),
        ("[large]\nhot = 0.001", "large.hot: expected at least annealing.cold, 0.01, got 0.001"),
        (f"[annealing]\nbatch = '{'x' * 5000}'", "annealing.batch: expected a whole number, 1 or more, got 'xxx"),
        ("[annealing", "not TOML: "),
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_one_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(ParamsError) as refused:
        loaded(tmp_path, text)
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'search.toml'}: {line}")
    assert "\n" not in said
    assert len(said) < len(str(tmp_path)) + 1_000


def test_a_file_that_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ParamsError, match=r"nowhere\.toml: no such file"):
        SearchParams.load(tmp_path / "nowhere.toml")


def test_code_is_told_the_field_too() -> None:
    with pytest.raises(ValueError, match=r"^region: expected a whole number, 1 or more, got -3$"):
        LargeParams(region=-3)


def test_batches_are_as_long_as_they_are_told_and_change_no_plan() -> None:
    short = SearchParams(annealing=AnnealingParams(batch=100))
    assert [progress.iterations for progress in asked(short)] == list(range(0, 2_001, 100))
    stop = Iterations(2_000)
    usual = solve(INSTANCE, cost=Cost.MINMAX, stop=stop)
    assert solve(INSTANCE, cost=Cost.MINMAX, stop=stop, params=short).plan == usual.plan


def test_a_search_is_as_hot_as_it_is_told() -> None:
    cold = SearchParams(annealing=AnnealingParams(hot=0.01))
    values = [solve(INSTANCE, cost=Cost.MINSUM, stop=Iterations(3_000), params=params) for params in (cold, cold)]
    usual = solve(INSTANCE, cost=Cost.MINSUM, stop=Iterations(3_000))
    assert values[0].plan == values[1].plan != usual.plan


def test_regions_begin_where_they_are_told() -> None:
    """Region by region the stop rule is asked once in a spell."""
    params = SearchParams(large=LargeParams(above=10, spell=700))
    assert [progress.iterations for progress in asked(params)] == [0, 700, 1_400, 2_000]


@pytest.mark.parametrize("searches", [1, 2])
def test_a_search_for_the_window_makes_the_plans_that_it_is_told(searches: int) -> None:
    window = WindowSearchParams(
        minmax_searches=searches, minmax_iterations=500, other_searches=0, full_effort_from=1, batch=200
    )
    walked = [progress.iterations for progress in asked(SearchParams(window=window), window=True)]
    # Each search asks at its begin and at its end, then the walk before each of its batches.
    plans = {1: [0, 500], 2: [0, 500, 500, 1_000]}[searches]
    assert walked == plans + list(range(500 * searches, 2_000, 200)) + [2_000]
