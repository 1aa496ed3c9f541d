"""A file of search parameters sets what it names, and a wrong one is refused by name."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from executor.errors import SiteError
from executor.site.site_planning import read_search_params
from planner import DEFAULT_PARAMS, SearchParams
from planner.params import AnnealingParams, WindowSearchParams


def loaded(folder: Path, text: str) -> SearchParams:
    path = folder / "search.toml"
    path.write_text(text, encoding="utf-8")
    return read_search_params(path)


def test_a_file_sets_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    params = loaded(tmp_path, "[annealing]\nhot = 8\npowers = [4, 8.0]\n\n[window]\nways = [[0, 1]]\nprobes = 4\n")
    assert params == SearchParams(
        annealing=AnnealingParams(hot=8.0, powers=(4.0, 8.0)), window=WindowSearchParams(ways=((0.0, 1.0),), probes=4)
    )
    assert loaded(tmp_path, "") == DEFAULT_PARAMS


def test_all_that_there_is_can_be_set() -> None:
    assert TypeAdapter(SearchParams).validate_python(asdict(DEFAULT_PARAMS)) == DEFAULT_PARAMS


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("hot = 3", "hot: not known; expected one of annealing, large, exact, window"),
        ("[window]\nheat = 3", "window.heat: not known; expected one of minmax_searches, "),
        ("window = 3", "window: expected keys with values, got 3"),
        ("[annealing]\nbatch = 0", "annealing.batch: expected greater than or equal to 1, got 0"),
        ("[annealing]\nbatch = true", "annealing.batch: expected a whole number, got True"),
        ("[annealing]\nbatch = 5.5", "annealing.batch: expected a whole number, got 5.5"),
        ("[annealing]\nhot = nan", "annealing.hot: expected a finite number, got nan"),
        ("[annealing]\nhot = 'much'", "annealing.hot: expected a number, got 'much'"),
        ("[annealing]\nslack = 1.5", "annealing.slack: expected less than or equal to 1, got 1.5"),
        ("[annealing]\npowers = [8, 'x']", "annealing.powers[1]: expected a number, got 'x'"),
        ("[annealing]\ncold = 7", "annealing.cold: expected at most hot, 6.0, got 7.0"),
        ("[window]\nways = [[0.5]]", "window.ways[0][1]: expected one more value"),
        ("[window]\nways = []", "window.ways: expected at least one way"),
        ("[window]\nmost_flipped = 40", "window.most_flipped: expected less than or equal to 16, got 40"),
        ("[window]\nlast_step = 0.5", "window.last_step: expected at most first_step, 0.06, got 0.5"),
        ("[window]\nlongest_cycle = 10", "window.cycle: expected at most longest_cycle, 10, got 4000"),
        ("[large]\nhot = 0.001", "large.hot: expected at least annealing.cold, 0.01, got 0.001"),
        (f"[annealing]\nbatch = '{'x' * 5000}'", "annealing.batch: expected a whole number, got 'xxx"),
        ("[annealing", "not TOML: "),
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_one_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(SiteError) as refused:
        loaded(tmp_path, text)
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'search.toml'}: {line}")
    assert "\n" not in said
    assert len(said) < len(str(tmp_path)) + 1_000


def test_a_file_that_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(SiteError, match=r"nowhere\.toml: no such file"):
        read_search_params(tmp_path / "nowhere.toml")
