#!/usr/bin/env python3
"""Check one solution of one instance of the line inspection benchmark: `python checker.py instance.json solution.json`.

It needs Python 3.11 and nothing else, and shares no code with any solver. README.md beside it explains both formats.

Exit codes: 0 the solution is valid, its values are printed; 1 it is not, every violation is a line; 2 a file cannot be
read as an instance or a solution.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

INSTANCE_FORMAT = "line-inspection-instance/1"
SOLUTION_FORMAT = "line-inspection-solution/1"
OBJECTIVES = ("minmax", "minsum", "mincomb", "window")
BUDGET_TOLERANCE_PCT = 1e-6
"""A route exceeds its budget only by more than this: sums depend on the order of addition."""
SAME_TIME_S = 1e-6
"""Times nearer than this are one event, and a visit that ends this soon after a loss has ended before it."""
SAME_VALUE = 1e-4
"""A claimed value may differ by this much from the computed one: files hold rounded numbers."""

Place = tuple[float, float]
Routes = tuple[tuple[int, ...], ...]


class BadFileError(Exception):
    """A file that is no instance or no solution: one line with the key and what was expected."""


@dataclass(frozen=True, slots=True)
class Instance:
    """Segments, a fleet that starts and lands at one depot, and what time and energy its moves take."""

    name: str
    segments_m: tuple[tuple[Place, Place], ...]
    """End points a and b of each segment, east and north in metres."""
    depot_m: Place
    vehicles: int
    budget_pct: float
    """Limit of each vehicle's energy, in percent of a full battery."""
    transit_m_s: float
    inspection_m_s: float
    transit_pct_per_s: float
    inspection_pct_per_s: float
    longest_s: float | None
    """Limit of the longest route of a solution for the window; None if the instance has none."""


@dataclass(frozen=True, slots=True)
class Repair:
    """The routes by which the survivors finish everything after a loss."""

    lost: int
    """Number of the lost vehicle, from 0."""
    from_s: float
    """Begin of the interval between two events in which it is lost."""
    routes: Mapping[int, tuple[int, ...]]
    """For each survivor what it visits after the visit that it was on or flying to."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Routes, and the value that they are said to have."""

    instance: str
    objective: str
    value: float | None
    routes: Routes
    """For each vehicle its visits: segment number s from 1, s flown from a to b, -s from b to a."""
    repairs: tuple[Repair, ...]


@dataclass(frozen=True, slots=True)
class SolutionFigures:
    """All values of a solution."""

    minmax: float
    """Energy of the most expensive route, in percent of a full battery."""
    minsum: float
    """Energy of all routes, in percent; the same as c-MinSum, as no valid route exceeds its budget."""
    mincomb: float
    """minsum plus minmax divided by the number of vehicles."""
    longest_s: float
    window: float | None
    """t*: the begin of the interval from which every loss has a repair; None if the solution has no repairs."""

    def value(self, objective: str) -> float | None:
        """Return the value of one objective."""
        return {"minmax": self.minmax, "minsum": self.minsum, "mincomb": self.mincomb}.get(objective, self.window)


def read_instance(content: object) -> Instance:
    """Return the instance of a JSON value.

    Raises:
        BadFileError: a key is missing or has another kind of value.
    """
    of = _dictionary(content, "the instance")
    _expect_format(of, INSTANCE_FORMAT)
    speeds, power = _dictionary(of.get("speeds_m_s"), "speeds_m_s"), _dictionary(of.get("pct_per_s"), "pct_per_s")
    segments = of.get("segments_m")
    if not isinstance(segments, list) or not segments:
        raise BadFileError("segments_m: expected a list of one segment or more")
    longest_s = of.get("longest_s")
    return Instance(
        name=_text(of, "name"),
        segments_m=tuple(_segment(one, f"segments_m[{number}]") for number, one in enumerate(segments)),
        depot_m=_place(of.get("depot_m"), "depot_m"),
        vehicles=_whole(of.get("vehicles"), "vehicles", least=1),
        budget_pct=_positive(of.get("budget_pct"), "budget_pct"),
        transit_m_s=_positive(speeds.get("transit"), "speeds_m_s.transit"),
        inspection_m_s=_positive(speeds.get("inspection"), "speeds_m_s.inspection"),
        transit_pct_per_s=_positive(power.get("transit"), "pct_per_s.transit"),
        inspection_pct_per_s=_positive(power.get("inspection"), "pct_per_s.inspection"),
        longest_s=None if longest_s is None else _positive(longest_s, "longest_s"),
    )


def read_solution(content: object) -> Solution:
    """Return the solution of a JSON value; whether it is valid is not asked.

    Raises:
        BadFileError: a key is missing or has another kind of value.
    """
    of = _dictionary(content, "the solution")
    _expect_format(of, SOLUTION_FORMAT)
    objective, routes, repairs = of.get("objective"), of.get("routes"), of.get("repairs", [])
    if objective not in OBJECTIVES:
        raise BadFileError(f"objective: expected one of {', '.join(OBJECTIVES)}, got {objective!r}")
    if not isinstance(routes, list):
        raise BadFileError("routes: expected a list with a list of visits for each vehicle")
    if not isinstance(repairs, list):
        raise BadFileError("repairs: expected a list")
    value = of.get("value")
    return Solution(
        instance=_text(of, "instance"),
        objective=objective,
        value=None if value is None else _number(value, "value"),
        routes=tuple(_visits(one, f"routes[{number}]") for number, one in enumerate(routes)),
        repairs=tuple(_repair(one, f"repairs[{number}]") for number, one in enumerate(repairs)),
    )


def check(instance: Instance, solution: Solution) -> tuple[SolutionFigures | None, list[str]]:
    """Return a solution's values and its violations in words; no values if routes visit what does not exist."""
    wrong = list(_find_wrong_visits(instance, solution))
    if wrong:
        return None, wrong
    legs = [_compute_legs(instance, route) for route in solution.routes]
    energies = [_compute_pct(instance, route) for route in solution.routes]
    durations = [sum(seconds for seconds, _ in one) for one in legs]
    wrong += [
        f"routes[{number}]: takes {energy:.6f} % of the budget of {instance.budget_pct:.6f} %"
        for number, energy in enumerate(energies)
        if energy > instance.budget_pct + BUDGET_TOLERANCE_PCT
    ]
    earliest_s = None
    if solution.objective == "window":
        if instance.longest_s is None:
            wrong.append("objective: the instance has no longest_s, so no window can be compared")
        elif max(durations) > instance.longest_s + SAME_VALUE:
            wrong.append(f"routes: the longest takes {max(durations):.3f} s, longest_s is {instance.longest_s:.3f} s")
        if instance.vehicles == 1:
            wrong.append("objective: nobody is left after the loss of the only vehicle")
        elif not wrong:
            earliest_s, broken = _find_window(instance, solution, durations)
            wrong += broken
    figures = SolutionFigures(
        minmax=max(energies),
        minsum=sum(energies),
        mincomb=sum(energies) + max(energies) / instance.vehicles,
        longest_s=max(durations),
        window=earliest_s,
    )
    found = figures.value(solution.objective)
    if not wrong and solution.value is not None and found is not None and abs(found - solution.value) > SAME_VALUE:
        wrong.append(f"value: is {solution.value:.6f}, the routes have {found:.6f}")
    return figures, wrong


def bound_minsum(instance: Instance) -> float:
    """Return a lower bound of minsum in percent: all inspections, and the least transit that joins them to tours.

    Tours leave every place as often as they come to it. So where an odd number of segments ends, a transit ends too
    (the depot counts as a place without segments unless some end there), and the transits contain paths that join
    these places in pairs. Each path is at least as long as the way to the nearest other one. Some vehicle also flies
    from the depot to the line and back.
    """
    degree: dict[Place, int] = {}
    for ends in instance.segments_m:
        for place in ends:
            degree[place] = degree.get(place, 0) + 1
    odd = [place for place, number in degree.items() if number % 2]
    pairing_m = sum(min(math.dist(place, other) for other in odd if other != place) for place in odd) / 2
    there_and_back_m = 2 * min(math.dist(instance.depot_m, place) for place in degree)
    inspection_s = sum(math.dist(*ends) for ends in instance.segments_m) / instance.inspection_m_s
    transit_s = max(pairing_m, there_and_back_m) / instance.transit_m_s
    return inspection_s * instance.inspection_pct_per_s + transit_s * instance.transit_pct_per_s


def bound_minmax(instance: Instance) -> float:
    """Return a lower bound of minmax in percent: an equal share of minsum's, or the segment that costs most alone."""
    farthest = max(
        min(_compute_pct(instance, (visit,)) for visit in (segment, -segment))
        for segment in range(1, len(instance.segments_m) + 1)
    )
    return max(farthest, bound_minsum(instance) / instance.vehicles)


def _find_wrong_visits(instance: Instance, solution: Solution) -> Iterator[str]:
    if solution.instance != instance.name:
        yield f"instance: is {solution.instance!r}, the instance's name is {instance.name!r}"
    if len(solution.routes) != instance.vehicles:
        yield f"routes: expected {instance.vehicles}, one for each vehicle, got {len(solution.routes)}"
    seen: dict[int, str] = {}
    for number, route in enumerate(solution.routes):
        for visit in route:
            place = f"routes[{number}]"
            if not 1 <= abs(visit) <= len(instance.segments_m):
                yield f"{place}: visit {visit} is no segment of 1 to {len(instance.segments_m)}"
            elif abs(visit) in seen:
                yield f"{place}: segment {abs(visit)} is already in {seen[abs(visit)]}"
            seen[abs(visit)] = place
    for segment in range(1, len(instance.segments_m) + 1):
        if segment not in seen:
            yield f"routes: no route visits segment {segment}"


def _find_window(instance: Instance, solution: Solution, durations: Sequence[float]) -> tuple[float, list[str]]:
    """Return t*, and why the repairs do not show the window that the solution claims.

    Without a claimed value the window begins as early as the repairs reach.
    """
    ends = [list(accumulate(seconds for seconds, _ in _compute_legs(instance, route))) for route in solution.routes]
    events = _merge_times(time_s for one in ends for time_s in one)
    given: dict[int, list[Repair]] = {}
    for repair in solution.repairs:
        given.setdefault(repair.lost, []).append(repair)
    earliest_s = events[-1]
    claimed_s = 0.0 if solution.value is None else solution.value
    for from_s in reversed(events[:-1]):
        for lost, duration_s in enumerate(durations):
            if duration_s <= from_s + SAME_TIME_S:
                continue
            why = _explain_no_repair(instance, solution, lost, from_s, given.get(lost, []))
            if why is not None:
                late = solution.value is not None and earliest_s > claimed_s + SAME_VALUE
                return earliest_s, [why] if late else []
        earliest_s = from_s
    return earliest_s, []


def _merge_times(times_s: Iterator[float]) -> list[float]:
    events = [0.0]
    for time_s in sorted(times_s):
        if time_s > events[-1] + SAME_TIME_S:
            events.append(time_s)
    return events


def _explain_no_repair(
    instance: Instance, solution: Solution, lost: int, from_s: float, given: Sequence[Repair]
) -> str | None:
    """Return why a loss is not repaired; None if one of the given repairs does it.

    A survivor finishes the visit that it is on or flying to, then flies its new route with what its budget has left.
    One that has flown all its visits, also when it is still returning, lands first and may take off again.
    """
    place = f"loss of vehicle {lost + 1} from {from_s:.3f} s"
    near = [one for one in given if abs(one.from_s - from_s) <= SAME_VALUE]
    if not near:
        return f"repairs: no repair for the {place}"
    survivors = [number for number in range(instance.vehicles) if number != lost]
    settled = {
        abs(visit) for number in survivors for visit in _list_fixed_visits(instance, solution.routes[number], from_s)
    }
    settled |= {abs(visit) for visit in _list_ended_visits(instance, solution.routes[lost], from_s)}
    still_open = set(range(1, len(instance.segments_m) + 1)) - settled
    reasons = []
    for repair in near:
        flown = [abs(visit) for route in repair.routes.values() for visit in route]
        if set(repair.routes) - set(survivors):
            reasons.append(f"repairs: the {place} has a route of a vehicle that does not survive")
        elif sorted(flown) != sorted(still_open):
            reasons.append(f"repairs: the {place} leaves {len(still_open)} segments open, its routes visit others")
        else:
            over = [
                number + 1
                for number in survivors
                if _compute_repaired_pct(instance, solution.routes[number], from_s, repair.routes.get(number, ()))
                > instance.budget_pct + BUDGET_TOLERANCE_PCT
            ]
            if not over:
                return None
            reasons.append(f"repairs: after the {place} vehicle {over[0]} exceeds its budget")
    return reasons[0]


def _list_ended_visits(instance: Instance, route: Sequence[int], at_s: float) -> tuple[int, ...]:
    """Return the visits that have ended."""
    ends_s = accumulate(seconds for seconds, _ in _compute_legs(instance, route)[:-1])
    return tuple(visit for visit, end_s in zip(route, ends_s, strict=False) if end_s <= at_s + SAME_TIME_S)


def _list_fixed_visits(instance: Instance, route: Sequence[int], at_s: float) -> tuple[int, ...]:
    """Return the visits that a survivor has ended, and the one that it is on or flying to."""
    return tuple(route[: len(_list_ended_visits(instance, route, at_s)) + 1])


def _compute_repaired_pct(instance: Instance, route: Sequence[int], at_s: float, after: Sequence[int]) -> float:
    """Return a survivor's energy from its first take-off to its last landing."""
    if len(_list_ended_visits(instance, route, at_s)) == len(route):
        return _compute_pct(instance, route) + _compute_pct(instance, after)
    return _compute_pct(instance, [*_list_fixed_visits(instance, route, at_s), *after])


def _compute_pct(instance: Instance, route: Sequence[int]) -> float:
    return sum(pct for _, pct in _compute_legs(instance, route))


def _compute_legs(instance: Instance, route: Sequence[int]) -> list[tuple[float, float]]:
    """Return seconds and percent to the end of each visit, then of the return; nothing for an empty route."""
    legs, here = [], instance.depot_m
    for visit in route:
        first, last = instance.segments_m[abs(visit) - 1][:: 1 if visit > 0 else -1]
        transit_s, inspection_s = (
            math.dist(here, first) / instance.transit_m_s,
            math.dist(first, last) / instance.inspection_m_s,
        )
        energy = transit_s * instance.transit_pct_per_s + inspection_s * instance.inspection_pct_per_s
        legs.append((transit_s + inspection_s, energy))
        here = last
    back_s = math.dist(here, instance.depot_m) / instance.transit_m_s
    return [*legs, (back_s, back_s * instance.transit_pct_per_s)] if route else []


def _dictionary(value: object, place: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadFileError(f"{place}: expected an object with keys")
    return value


def _expect_format(of: Mapping[str, Any], expected: str) -> None:
    if of.get("format") != expected:
        raise BadFileError(f"format: expected {expected!r}, got {of.get('format')!r}")


def _text(of: Mapping[str, Any], key: str) -> str:
    value = of.get(key)
    if not isinstance(value, str) or not value:
        raise BadFileError(f"{key}: expected a text")
    return value


def _number(value: object, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadFileError(f"{place}: expected a number, got {value!r}")
    return float(value)


def _positive(value: object, place: str) -> float:
    number = _number(value, place)
    if number <= 0:
        raise BadFileError(f"{place}: expected more than 0, got {value!r}")
    return number


def _whole(value: object, place: str, *, least: int | None = None) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or (least is not None and value < least):
        raise BadFileError(f"{place}: expected a whole number{f' from {least}' if least else ''}, got {value!r}")
    return value


def _place(value: object, place: str) -> Place:
    if not isinstance(value, list) or len(value) != 2:
        raise BadFileError(f"{place}: expected two numbers, east and north in metres")
    return _number(value[0], place), _number(value[1], place)


def _segment(value: object, place: str) -> tuple[Place, Place]:
    if not isinstance(value, list) or len(value) != 2:
        raise BadFileError(f"{place}: expected two places")
    return _place(value[0], place), _place(value[1], place)


def _visits(value: object, place: str) -> tuple[int, ...]:
    if not isinstance(value, list):
        raise BadFileError(f"{place}: expected a list of visits")
    return tuple(_whole(visit, place) for visit in value)


def _repair(value: object, place: str) -> Repair:
    of = _dictionary(value, place)
    routes = _dictionary(of.get("routes"), f"{place}.routes")
    if not all(number.isdecimal() for number in routes):
        raise BadFileError(f"{place}.routes: expected the numbers of vehicles as keys")
    return Repair(
        lost=_whole(of.get("lost"), f"{place}.lost", least=1) - 1,
        from_s=_number(of.get("from_s"), f"{place}.from_s"),
        routes={int(number) - 1: _visits(one, f"{place}.routes.{number}") for number, one in routes.items()},
    )


def read_json(path: Path) -> object:
    """Return the content of a JSON file.

    Raises:
        BadFileError: it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BadFileError(f"expected a readable JSON file: {error}") from error


def main(arguments: Sequence[str]) -> int:
    """Check the files of the command line; return the exit code."""
    if len(arguments) != 2:
        print("usage: python checker.py instance.json solution.json", file=sys.stderr)
        return 2
    path = Path(arguments[0])
    try:
        instance = read_instance(read_json(path))
        path = Path(arguments[1])
        solution = read_solution(read_json(path))
    except BadFileError as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 2
    figures, wrong = check(instance, solution)
    for line in wrong:
        print(f"invalid: {path}: {line}")
    if wrong or figures is None:
        return 1
    print(f"valid: {instance.name}, {solution.objective} {figures.value(solution.objective):.6f}")
    print(f"minmax {figures.minmax:.6f} %, minsum {figures.minsum:.6f} %, mincomb {figures.mincomb:.6f} %")
    print(f"lower bounds: minmax {bound_minmax(instance):.6f} %, minsum {bound_minsum(instance):.6f} %")
    print(f"longest route {figures.longest_s:.3f} s", end="")
    print("" if figures.window is None else f", every loss from {figures.window:.3f} s is repaired")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
