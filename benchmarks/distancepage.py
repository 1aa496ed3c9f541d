"""Output of `faultline bench distance`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.distance import (
    BUDGET_PCT,
    OFF_M,
    RADII_M,
    SECOND,
    SLOWER,
    USES_PCT,
    VEHICLES,
    WIND_M_S,
    DistanceFlight,
    distance_results,
)
from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.report import Report, Table, list_lines
from benchmarks.store import Json

TITLE = "All vehicles at the requested distance"
INTRODUCTION = (
    "`{command}`: {flights} flights with `same_distance` in virtual time, of {least} to {most} vehicles over the "
    "segments of faultline's own network within {near:g} to {far:g} m of the depot, the dialects alternating. The air "
    "moves with up to {wind:g} m/s; three vehicles of ten are up to {slower:.0%} slower than commanded. One vehicle, "
    "and in {second:.0%} of the flights two, crash, lose their link for good or for 30 s, are flown home by a pilot, "
    "or use four times the energy, at a random part of their routes; in other flights nothing happens. The true "
    "positions of all vehicles are checked ten times a second. The most expensive route of a plan uses {uses_pct:g}% "
    "of a battery, of which {budget:g}% may be used."
)
TOLD = (
    "Inspected at the requested distance are {planned_asked} of {segments} segments as planned, and {counted_asked} of "
    "the {counted} that counted at the end, {replans} re-plans later; the others are inspected from their vehicle's "
    "layer, which is reported. More than {off_m:g} m off the reported distance: {off_count}. The nearest two vehicles "
    "in the air were {nearest_m} m apart, where {promised_m:g} m are promised; nearer than that in {near_count} "
    "flights. A crashed vehicle is not counted while it falls."
)
FLEETS = (
    "vehicles", "flights", "planned at the requested distance", "inspected at it", "nearest two (m)",
    "longest route, more than in layers (%)",
)  # fmt: skip


def distance_document(flights: Sequence[DistanceFlight], command: str, seed: int, uses_pct: float = USES_PCT) -> Json:
    """Return the content of distance.json."""
    return {**head("distance/1", command), "seed": seed, "uses_pct": uses_pct, **distance_results(flights)}


def _fleets(content: Mapping[str, Any]) -> Rows:
    return [
        (
            str(row["vehicles"]), str(row["flights"]), f"{row['planned_asked']:.1%}", f"{row['counted_asked']:.1%}",
            figure(row["nearest_m"], 2), figure(row["longer_pct"], 2),
        )
        for row in content["by_vehicles"]
    ]  # fmt: skip


def _summarize_flights(content: Mapping[str, Any]) -> str:
    return TOLD.format(**content, off_m=OFF_M, off_count=len(content["off"]), near_count=len(content["too_near"]))


def _describe_duration(calm: Mapping[str, Any]) -> str:
    """Return how much longer than planned flights without faults last, as parts are flown again."""
    if not calm["flights"]:
        return ""
    longer = figure(calm["lasted_longer_pct"])
    return (
        f"The {calm['flights']} flights without any fault lasted, from the launch to the last landing, {longer} % "
        "longer in the median than their longest route is planned for."
    )


def _list_failures(content: Mapping[str, Any]) -> list[str]:
    """Return the failures, line by line."""
    return [*content["too_near"], *content["off"], *(f"not flown: {line}" for line in content["not_flown"])]


def report_distance(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    about = INTRODUCTION.format(
        **content, least=VEHICLES[0], most=VEHICLES[1], near=RADII_M[0], far=RADII_M[-1], wind=WIND_M_S, slower=SLOWER,
        second=SECOND, budget=BUDGET_PCT,
    )  # fmt: skip
    summary, failures, longer = _summarize_flights(content), _list_failures(content), content["longer_pct"]
    parts = (
        machine_line(content["machine"]),
        about,
        summary,
        f"The longest route is {figure(longer['median'])} % longer in the median than with all vehicles in their "
        "layers, "
        f"{figure(longer['most'])} % at most. {_describe_duration(content['undisturbed'])}".rstrip(),
        Table(FLEETS, _fleets(content), TITLE),
        Table(("faults", "times"), [(kind, str(n)) for kind, n in content["faults"].items()]),
        *list_lines("## By name", failures),
        f"The flights lasted {figure(content['flown_s'] / 3600)} hours together.",
    )
    return Report("distance", TITLE, content, parts, (summary, *failures))
