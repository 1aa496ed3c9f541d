"""Output of `faultline bench window`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.report import Report, Table
from benchmarks.store import Json
from benchmarks.window import WindowSettings

TITLE = "The re-plan window, flown"
INTRODUCTION = (
    "`{command}`: {vehicles} vehicles ({autopilot}) with budgets of {budget_pct:g} % of a battery that is so large "
    "that the dearest route of the best MinMax plan takes the given share of it, the tightness. A plan chosen for its "
    "window claims that any single vehicle may be lost from a time on. Each loss (a crash, or a link that is silent "
    "for good) is a flight of its own in virtual time, at a random time, of a random vehicle that still flies then. It "
    "is finished if everything was inspected and everybody else stands on its pad above its reserve, by the "
    "simulator's own battery."
)


def window_document(settings: WindowSettings, command: str, found: Json) -> Json:
    """Return the content of window.json."""
    return {
        **head("window/2", command),
        "seed": settings.seed,
        "network": "default" if settings.network is None else settings.network.name,
        "vehicles": settings.vehicles,
        "autopilot": settings.autopilot,
        "budget_pct": settings.budget_pct,
        **found,
    }


LOSSES = ("losses", "flown", "finished", "what is left is named")
PLANS = ("segments", "tightness", "claimed from (s)", "longest route (s)", "finished after it", "finished before it")
BROKEN = ("segments", "loss", "when", "why not", "left over")


def _losses(content: Mapping[str, Any]) -> Rows:
    rows: Rows = [("after the claimed time", str(content["losses_after"]), str(content["finished_after"]), "")]
    if content["losses_before"]:
        missed = content["losses_before"] - content["finished_before"]
        named = f"in {missed - content['unnamed_before']} of {missed}"
        rows.append(("before it", str(content["losses_before"]), str(content["finished_before"]), named))
    return rows


def _plans(content: Mapping[str, Any]) -> Rows:
    return [
        (
            str(plan["segments"]), f"{plan['tightness']:.0%}", f"{plan['claimed_earliest_s']:.0f}",
            f"{plan['longest_route_s']:.0f}", _share(plan["losses"], after=True), _share(plan["losses"], after=False),
        )
        for plan in content["plans"]
    ]  # fmt: skip


def _share(losses: Sequence[Mapping[str, Any]], *, after: bool) -> str:
    those = [one for one in losses if one["after"] == after]
    return f"{sum(one['finished'] for one in those)} of {len(those)}" if those else ""


def _broken(content: Mapping[str, Any]) -> Rows:
    return [
        (str(plan["segments"]), one["loss"], "after" if one["after"] else "before", "; ".join(one["wrong"]),
         ", ".join(map(str, one["uncovered"])) or "nothing")
        for plan in content["plans"] for one in plan["losses"] if not one["finished"]
    ]  # fmt: skip


def report_window(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    broken, least = _broken(content), content["least_pct_after"]
    parts = (
        machine_line(content["machine"]),
        INTRODUCTION.format_map(content),
        Table(LOSSES, _losses(content), TITLE),
        ""
        if least is None
        else f"The least that a survivor landed with after a loss in the window: {figure(least)} %.",
        Table(PLANS, _plans(content), "By plan"),
        *(("## Not finished", Table(BROKEN, broken, "Not finished")) if broken else ()),
        f"The flights lasted {figure(content['flown_s'] / 3600)} hours together.",
    )
    return Report("window", TITLE, content, parts)
