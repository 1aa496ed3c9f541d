"""Check a plan file: recompute every value from its own content."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from missions.plan_file import DayPlanFile, PlanContent, PlanFile
from missions.plan_parts import COVERAGE_COST, WINDOW_COST, CoverageChance, PlanRoute, Window
from missions.shortest_ways import build_area_graph
from planner import Cost, PlanError, estimate_coverage, evaluate, replan_window
from planner.sorties import Objective, evaluate_sorties

PLACE_TOLERANCE_M = 0.05
"""Tolerance between local metres and latitude/longitude; 1e-7 degrees are 1 cm."""
FIGURE_TOLERANCE = 1e-6
"""Tolerance of recomputed values, relative to the larger of the value and 1; sums depend on their order."""


def check_plan(content: PlanFile | DayPlanFile, *, search_window: bool = True) -> list[str]:
    """Return messages on every figure of a plan file that does not match its own content; empty if there are none.

    Recomputed are the segments' places and lengths, every route's duration and energy, the cost, coverage, budgets and
    the re-plan window; for days packs, hours and take-offs too, but no window after losses. Areas and locks are
    checked.

    Args:
        content: The file.
        search_window: Whether to search for the window again: a second or two for a hundred segments; the flights of
            its probability of coverage take longer. Otherwise only its percentage and longest route are recomputed.

    Raises:
        PlanFileError: its vehicles or coordinates do not form a valid planning problem.
    """
    findings = [*_check_places(content), *_check_areas(content), *_check_locks(content)]
    if isinstance(content, DayPlanFile):
        return [*findings, *_check_days(content)]
    findings += _check_flight(content)
    if search_window and content.window is not None and not findings:
        findings.extend(_check_window(content, content.window))
    if search_window and content.coverage is not None and not findings:
        findings.extend(_check_coverage(content, content.coverage))
    return findings


def _check_window(content: PlanFile, written: Window) -> Iterator[str]:
    try:
        found = replan_window(
            content.build_instance(), content.plan, fly_again=content.fly_again, losses=written.losses or 1
        )
    except PlanError as error:
        yield f"window: {error}"
        return
    yield from _describe_wrong_figures([("window.earliest_s", written.earliest_s, found.earliest_s)])


def _check_coverage(content: PlanFile, written: CoverageChance) -> Iterator[str]:
    try:
        found = estimate_coverage(
            content.build_instance(), content.plan, written.mtbf_h, flights=written.flights, seed=written.seed,
            fly_again=content.fly_again,
        )  # fmt: skip
    except PlanError as error:
        yield f"coverage: {error}"
        return
    chance = found.finished[-1]
    yield from _describe_wrong_figures([
        ("coverage.probability", written.probability, chance.estimate),
        ("coverage.low_95", written.low_95, chance.low), ("coverage.high_95", written.high_95, chance.high),
        ("coverage.uninspected_m", written.uninspected_m, found.undone_m[-1]),
    ])  # fmt: skip


def _check_flight(content: PlanFile) -> Iterator[str]:
    cost, window, coverage = content.cost, content.window, content.coverage
    measured = cost.name in {WINDOW_COST, COVERAGE_COST}
    evaluation = evaluate(content.build_instance(), content.plan, Cost.MINMAX if measured else Cost(cost.name))
    yield from _describe_wrong_routes(
        ((f"route of {route.vehicle}", route) for route in content.routes),
        evaluation.durations_s, evaluation.energies_pct,
    )  # fmt: skip
    figures = []
    if not measured:
        figures.append((f"cost.value ({cost.name})", cost.value, evaluation.value))
    elif cost.name == COVERAGE_COST and coverage is not None:
        figures.append((f"cost.value ({cost.name})", cost.value, coverage.probability))
    elif window is not None:
        figures.append((f"cost.value ({cost.name})", cost.value, window.earliest_s))
    if window is not None:
        longest_s = evaluation.longest_route_s
        window_pct = 100.0 * ((longest_s - window.earliest_s) / longest_s) if longest_s > 0 else 100.0
        figures.append(("window.longest_route_s", window.longest_route_s, longest_s))
        figures.append(("window.window_pct", window.window_pct, window_pct))
    yield from _describe_wrong_figures(figures)
    accounted = {*content.uncovered, *(visit.segment for route in content.routes for visit in route.visits)}
    for segment in content.segments:
        if segment.id not in accounted:
            yield f"{segment.display_name} is neither visited nor named as uncovered"
    for vehicle, energy_pct in zip(content.vehicles, evaluation.energies_pct, strict=True):
        if energy_pct > vehicle.budget_pct + FIGURE_TOLERANCE:
            yield f"route of {vehicle.name}: spends {energy_pct:.3f} %, its budget is {vehicle.budget_pct:.3f} %"


def _check_days(content: DayPlanFile) -> Iterator[str]:
    computed = evaluate_sorties(content.build_instance(), content.plan)
    yield from _describe_wrong_routes(
        (
            (f"sortie {index} of {name}", route)
            for name in content.names for index, route in enumerate(content.routes_of(name), 1)
        ),
        computed.durations_s, computed.energies_pct,
    )  # fmt: skip
    yield from _describe_wrong_figures(
        [
            ("finish_s", content.finish_s, computed.finish_s),
            ("flight_s", content.flight_s, computed.flight_s),
            (f"cost.value ({content.cost.name})", content.cost.value, computed.value_of(Objective(content.cost.name))),
        ]
    )
    yield from computed.violations


def _describe_wrong_routes(
    named: Iterable[tuple[str, PlanRoute]], durations_s: Sequence[float], energies_pct: Sequence[float]
) -> Iterator[str]:
    """Yield messages on routes whose figures, by name, differ from the recomputed ones."""
    for (name, route), duration_s, energy_pct in zip(named, durations_s, energies_pct, strict=True):
        yield from _describe_wrong_figures([
            (f"{name}: duration_s", route.duration_s, duration_s), (f"{name}: energy_pct", route.energy_pct, energy_pct)
        ])  # fmt: skip


def _check_places(content: PlanContent) -> Iterator[str]:
    for segment in content.segments:
        for key, enu_m, lat_lon_deg in (
            ("a", segment.a_enu_m, segment.a_lat_lon_deg),
            ("b", segment.b_enu_m, segment.b_lat_lon_deg),
        ):
            apart_m = math.dist(enu_m[:2], content.frame.to_local_m(*lat_lon_deg))
            if not apart_m <= PLACE_TOLERANCE_M:
                yield f"{segment.display_name}: {key} and {key}_lat_lon_deg are {apart_m:.2f} m apart"
        length_m = math.dist(segment.a_enu_m[:2], segment.b_enu_m[:2])
        if not _is_same_figure(segment.length_m, length_m):
            yield f"{segment.display_name}: length_m is {segment.length_m:.6g}, its ends are {length_m:.6g} m apart"


def _check_areas(content: PlanFile | DayPlanFile) -> Iterator[str]:
    """Yield messages on flown inspection legs and vehicles' pads that lie in an area."""
    if (pricing := content.pricing) is None:
        return
    pads = content.pads if isinstance(content, DayPlanFile) else [*pricing.bases.items()]
    flown = sorted({content.positions[visit.segment] for route in content.routes for visit in route.visits})
    tracks_m = pricing.tracks_m[flown, :, :2]
    for one in pricing.kept_out:
        graph = build_area_graph(one.area)
        for number in np.flatnonzero(graph.is_met(tracks_m[:, 0], tracks_m[:, 1])).tolist():
            yield f"{content.segments[flown[number]].display_name} is flown, and lies in area {one.area.name!r}"
        for name, pad in pads:
            if name in one.vehicles and graph.is_inside(np.array([pad.place_m[:2]]))[0]:
                yield f"the pad of {name} lies in area {one.area.name!r}"


def _check_locks(content: PlanContent) -> Iterator[str]:
    """Yield messages on segments flown by another vehicle, or in another direction, than the plan's locks require."""
    if (pricing := content.pricing) is None:
        return
    for route in content.routes:
        for visit in route.visits:
            number = content.positions[visit.segment]
            segment, keeper = content.segments[number], pricing.locked.get(number, route.vehicle)
            if keeper != route.vehicle:
                yield f"{segment.display_name} is flown by {route.vehicle}, and locked to {keeper}"
            if pricing.directions.get(number, visit.reversed) != visit.reversed:
                begins, other = segment.pylons[visit.reversed], segment.pylons[not visit.reversed]
                yield f"{segment.display_name} is flown from {begins}, and locked to begin at {other}"


def _describe_wrong_figures(figures: Iterable[tuple[str, float, float]]) -> Iterator[str]:
    """Yield the named figures that differ from the recomputed ones."""
    for name, written, computed in figures:
        if not _is_same_figure(written, computed):
            yield f"{name} is {written:.6g}, its content gives {computed:.6g}"


def _is_same_figure(written: float, computed: float) -> bool:
    return abs(written - computed) <= FIGURE_TOLERANCE * max(1.0, abs(computed))
