"""The campaign: the same seed gives the same flights, and a few of them already show what is detected."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.detection import KINDS, Pair, campaign, detection_summary, poisson_interval
from benchmarks.detectionpage import detection_document, judge_recorded_flights, markdown, print_recorded, print_summary
from benchmarks.store import keep_result
from tests.recorded import BEGAN_USEC, Writer, flight


@pytest.fixture(scope="module")
def few() -> list[Pair]:
    return campaign(4, 2, seed=3, jobs=1)


def test_the_same_seed_gives_the_same_outcomes() -> None:
    one, again, other = (campaign(1, 1, seed=seed, jobs=1) for seed in (3, 3, 4))
    assert again == one
    assert other != one


def test_what_a_small_campaign_shows(few: list[Pair], capsys: pytest.CaptureFixture[str]) -> None:
    figures = detection_summary([pair.watchpoints for pair in few])
    assert figures["flights"] == 4 + 2 * len(KINDS)
    assert figures["false_alarms"] == 0
    kinds = figures["kinds"]
    assert isinstance(kinds, dict)
    assert kinds["step"]["declared"] == kinds["step"]["due"] == 2
    assert kinds["cell"]["declared"] == 2
    print_summary("watchpoints", figures)
    assert "false alarms: 0" in capsys.readouterr().out


def test_the_few_lines_are_measured_on_the_same_flights(few: list[Pair]) -> None:
    assert all(pair.few_lines.injected == pair.watchpoints.injected for pair in few)
    assert any(pair.few_lines.declared != pair.watchpoints.declared for pair in few)


def test_the_page(few: list[Pair], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    silent = Writer()
    flight(silent, 3, range(120), silent=range(60, 80))
    silent.write(tmp_path / "silent.tlog")
    gone = {"from_usec": BEGAN_USEC + 59_500_000, "to_usec": BEGAN_USEC + 80_100_000}
    truth = {"kind": "link loss", "events": [], "vehicle_silent": [gone]}
    (tmp_path / "all_truth.json").write_text(json.dumps({"logs": {"silent.tlog": truth}}))
    figures = {name: detection_summary([getattr(pair, name) for pair in few]) for name in ("watchpoints", "few_lines")}
    [row] = judge_recorded_flights(tmp_path)
    content = detection_document(4, 2, 3, figures, [row])
    keep_result("detection", content, markdown(content), tmp_path / "out")
    assert json.loads((tmp_path / "out" / "detection.json").read_text())["seed"] == 3
    text = (tmp_path / "out" / "detection.md").read_text()
    assert "| silent.tlog |" in text
    assert "link" in text
    assert row["watchpoints"]["after_s"] < row["few_lines"]["after_s"] < 10.0
    print_recorded(content)
    assert "silent.tlog: link" in capsys.readouterr().out


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.025, 5.572), (10, 4.795, 18.390)])
def test_the_interval_of_a_count_is_garwoods(count: int, low: float, high: float) -> None:
    assert poisson_interval(count) == pytest.approx((low, high), abs=0.001)


def test_of_nothing_any_share_is_possible() -> None:
    assert detection_summary([])["would_break_reserve"] == {"of": 0, "in_time": 0, "rate": 0.0, "rate_95": [0.0, 1.0]}
