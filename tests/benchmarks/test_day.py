"""`bench day`: what it measures, on a part of it, and its page."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import day
from benchmarks.daypage import day_document, report_day
from executor.cli.main import main

GRAPH = (
    'pylons_position = "' + " ".join(f"{300 * number} 500 0;" for number in range(9)) + '"\n'
    'connections_indexes = "2; ' + " ".join(f"{number} {number + 2};" for number in range(1, 8)) + ' 8;"\n'
)
"""A line of eight segments beside the depot, as the paper's network is written."""


def test_small_days_are_proven_and_a_network_is_planned_to_its_last_segment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(day, "SMALL", 2)
    monkeypatch.setattr(day, "SEGMENTS", 5)
    monkeypatch.setattr(day, "MTBF_H", (5.0,))
    monkeypatch.setattr(day, "SPARES", 0)
    told: list[tuple[str, int, int]] = []
    graph = tmp_path / "line.yaml"
    graph.write_text(GRAPH, encoding="utf-8")
    content = day.day_figures(graph, seconds=2.0, samples=3, seed=3, told=lambda *one: told.append(one))
    assert [row["same"] for row in content["exact"]] == [True, True]
    whole = content["network"]
    assert (whole["segments"], whole["uncovered"], whole["wrong"]) == (8, 0, [])
    assert {one[0] for one in told} == {"proven optima", "the whole network", "fleets"}
    report_day(day_document(content, "faultline bench day", 3)).keep(tmp_path)
    page = (tmp_path / "day.md").read_text()
    assert "All 8 segments" in page
    assert "Of 2 instances 2 are the same" in page


def test_without_the_papers_network_nothing_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "day", "--data", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
