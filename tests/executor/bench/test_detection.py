"""The campaign: the same seed gives the same flights, and a few of them already show what is detected."""

from __future__ import annotations

import pytest

from executor.bench.detection import KINDS, Share, campaign, poisson_interval, print_summary, summary


@pytest.fixture(scope="module")
def few() -> object:
    return campaign(4, 2, seed=3, jobs=1)


def test_the_same_seed_gives_the_same_outcomes(few: object) -> None:
    assert campaign(4, 2, seed=3, jobs=1) == few
    assert campaign(4, 2, seed=4, jobs=1) != few


def test_what_a_small_campaign_shows(few: list, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[type-arg]
    figures = summary(few)
    assert figures["flights"] == 4 + 2 * len(KINDS)
    assert figures["false_alarms"] == 0
    kinds = figures["kinds"]
    assert isinstance(kinds, dict)
    assert kinds["step"]["declared"] == kinds["step"]["due"] == 2
    assert kinds["cell"]["declared"] == 2
    print_summary("watchpoints", figures)
    assert "false alarms: 0" in capsys.readouterr().out


def test_the_few_lines_are_measured_on_the_same_flights(few: list) -> None:  # type: ignore[type-arg]
    simple = campaign(4, 2, seed=3, jobs=1, few_lines=True)
    assert [one.injected for one in simple] == [one.injected for one in few]
    assert [one.lasted_s for one in simple] == [one.lasted_s for one in few]


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.025, 5.572), (10, 4.795, 18.390)])
def test_the_interval_of_a_count_is_garwoods(count: int, low: float, high: float) -> None:
    assert poisson_interval(count) == pytest.approx((low, high), abs=0.001)


def test_the_interval_of_a_share_is_wilsons() -> None:
    assert Share(9, 10).interval == pytest.approx((0.596, 0.982), abs=0.001)
    assert Share(0, 0).interval == (0.0, 1.0)
