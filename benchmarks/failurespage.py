"""Output of `faultline bench failures`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.failures import families
from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows, figure, percent_over
from benchmarks.report import Report, Table, list_lines
from benchmarks.store import Json

TITLE = "Vehicles lost one after another"
INTRODUCTION = (
    "`{command}`: public scenarios with several depots, several trips for each vehicle, recharging between them and "
    "vehicles lost one after another (Eashwar-S/peer_auction, MIT; Sathyamurthy, Herrmann, Azarm, arXiv 2411.04073). "
    "The initial routes are those of the scenarios. At each loss the rest of the day is re-planned from what is known "
    "then: a trip under way is flown to its end, data still on board a lost vehicle is lost with it. The value is the "
    "end of the last trip, in the scenarios' unit of time; the published values are those of the authors' centralised "
    "auction on the same routes. Each search ends after {seconds:g} s, or when {steady} iterations have found nothing "
    "better; a re-plan's time counts from the loss until all vehicles have new trips."
)
PROVEN = (
    "Proven by HiGHS, for {prove_s:g} s at most for each scenario: a lower bound for the value of any answer, even if "
    "it knew all later losses at the first one. The routes until the first loss are given, and so are the trips under "
    "way at that time. Where a value equals its bound, no choice among the plans after a loss, and no foresight, makes "
    "it less."
)
BOUNDS = ("family", "scenarios", "values that equal their bound", "sum of values", "sum of bounds", "published",
          "least possible difference")  # fmt: skip
FAMILY = ("family", "scenarios", "valid", "not longer than published", "sum of values", "published", "difference",
          "re-plan, median s", "longest s", "published, median s", "longest s")  # fmt: skip
SCENARIO = ("scenario", "losses", "value", "published", "difference", "longest re-plan s", "published s",
            "left over", "bound")  # fmt: skip
SHOWN = 9
"""Columns of a family that fit on a terminal."""


def failures_document(
    rows: list[Json], command: str, seconds: float, steady: int, seed: int, prove_s: float | None = None
) -> Json:
    """Return the content of failures.json."""
    return {
        **head("failures/1", command),
        "seconds": seconds,
        "steady": steady,
        "seed": seed,
        "prove_s": prove_s,
        "families": families(rows),
        "rows": rows,
    }


def _family_rows(content: Mapping[str, Any]) -> Rows:
    return [
        (
            row["family"], str(row["scenarios"]), str(row["valid"]), f"{row['not_longer']} of {row['compared']}",
            figure(row["sum"], 0), figure(row["published_sum"], 0), percent_over(row["sum"], row["published_sum"], 1),
            figure(row["replan_median_s"], 2), figure(row["replan_max_s"], 2),
            figure(row["published_median_s"], 3), figure(row["published_max_s"], 2),
        )
        for row in content["families"]
    ]  # fmt: skip


def _scenario_rows(content: Mapping[str, Any]) -> Rows:
    return [
        (
            row["name"], str(row["losses"]), figure(row["value"], 0), figure(row["published"], 0),
            percent_over(row["value"], row["published"], 1), figure(max(row["replan_s"], default=None), 2),
            figure(row["published_s"], 3), str(row["left"]), figure(row["least"], 0),
        )
        for row in content["rows"]
    ]  # fmt: skip


def _bound_rows(content: Mapping[str, Any]) -> Rows:
    return [
        (
            row["family"], str(row["proven"]), f"{row['least_possible']} of {row['proven']}", figure(row["sum"], 0),
            figure(row["least_sum"], 0), figure(row["published_sum"], 0),
            percent_over(row["least_sum"], row["published_sum"], 1),
        )
        for row in content["families"]
    ]  # fmt: skip


def _bounds(content: Mapping[str, Any]) -> tuple[str | Table, ...]:
    return f"## Lower bounds\n\n{PROVEN.format_map(content)}", Table(BOUNDS, _bound_rows(content))


def report_failures(content: Mapping[str, Any]) -> Report:
    """Return the report; on a terminal the families, without the published times."""
    wrong = [f"{row['name']}: {reason}" for row in content["rows"] for reason in row["wrong"]]
    parts = (
        machine_line(content["machine"]),
        INTRODUCTION.format_map(content),
        Table(FAMILY, _family_rows(content), TITLE, SHOWN),
        *(() if content["prove_s"] is None else _bounds(content)),
        *list_lines("## Not valid", wrong),
        "## Every scenario",
        Table(SCENARIO, _scenario_rows(content)),
    )
    return Report("failures", TITLE, content, parts)
