"""The public failure scenarios: a fleet's day as JSON, its losses, and the rules for a solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from benchmarks.errors import BenchError
from benchmarks.scenarios import Day, TimedTrip, Timeline
from benchmarks.scenarios.road_graph import build_road_graph
from benchmarks.store import Json
from missions import format_first_error
from missions.files import MOST_FIGURE, parse_json, read_text

SAME_S = 1e-6
"""Values closer to each other than this are equal."""
MOST_PLACES = 5_000
"""Limit of places, for the travel time table."""

Seconds = Annotated[float, Field(strict=True, ge=0, le=MOST_FIGURE, allow_inf_nan=False)]
Place = Annotated[int, Field(strict=True)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True)


class Failure(_Part):
    """Loss of one vehicle."""

    vehicle: Annotated[int, Field(strict=True, ge=1)]
    """Number from 1."""
    at: Seconds


class Published(_Part):
    """Figures reported by the authors: last trip's end before and after the losses, and their re-planning time."""

    before: float | None = None
    after: float | None = None
    seconds: float | None = None


class Scenario(_Part):
    """One scenario as in its file; unknown keys are ignored."""

    name: Annotated[str, Field(min_length=1)]
    depots: Annotated[tuple[Place, ...], Field(min_length=1)]
    capacity: Seconds
    recharge: Seconds
    edges: tuple[tuple[Place, Place, Seconds, Annotated[int, Field(strict=True, ge=0, le=1)]], ...]
    """Two places, the time between them, and whether it is required."""
    start: Annotated[tuple[Place, ...], Field(min_length=1)]
    failures: tuple[Failure, ...]
    initial: tuple[tuple[Annotated[tuple[Place, ...], Field(min_length=1)], ...], ...]
    """The trips of each vehicle, as places."""
    published: Published = Published()

    @model_validator(mode="after")
    def _check_consistency(self) -> Scenario:
        """Check constraints across keys."""
        for reason in (*self._list_misplaced(), *self._unfit_fleet(), *self._off_edges()):
            raise ValueError(reason)
        return self

    def _list_misplaced(self) -> Iterator[str]:
        known = self.places
        if len(known) > MOST_PLACES:
            yield f"edges: expected {MOST_PLACES} places at most, got {len(known)}"
        for number, edge in enumerate(self.edges):
            if edge[0] == edge[1]:
                yield f"edges[{number}]: expected two places, got {edge[0]} twice"
        for key, places in (("depots", self.depots), ("start", self.start)):
            for number, place in enumerate(places):
                if place not in known:
                    yield f"{key}[{number}]: expected a place of an edge, got {place}"

    def _unfit_fleet(self) -> Iterator[str]:
        fleet = len(self.start)
        if len(self.initial) != fleet:
            yield f"initial: expected the trips of {fleet} vehicles, got {len(self.initial)}"
        lost = [failure.vehicle for failure in self.failures]
        for number, vehicle in enumerate(lost):
            if vehicle > fleet or vehicle in lost[:number]:
                yield f"failures[{number}].vehicle: expected one of {fleet}, each once, got {vehicle}"

    def _off_edges(self) -> Iterator[str]:
        known, steps = self.places, {frozenset(edge[:2]) for edge in self.edges}
        for vehicle, trips in enumerate(self.initial):
            for trip, nodes in enumerate(trips):
                if nodes[0] not in known or any(frozenset(step) not in steps for step in pairwise(nodes)):
                    yield f"initial[{vehicle}][{trip}]: expected places along edges, got {list(nodes)[:8]}"

    @property
    def places(self) -> dict[int, int]:
        """All places, and their number in the planner."""
        names = sorted({place for edge in self.edges for place in edge[:2]})
        return {place: number for number, place in enumerate(names)}

    @property
    def losses(self) -> tuple[Failure, ...]:
        """Failures in order of time."""
        return tuple(sorted(self.failures, key=lambda failure: failure.at))


def read_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises:
        BenchError: one line that names the file, the key and what was expected.
    """
    content = parse_json(read_text(path, "failure scenario (JSON)", BenchError), str(path), BenchError)
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        raise BenchError(f"{path}: {format_first_error(error)}") from None


def day_of(scenario: Scenario) -> Day:
    """Return a scenario's day for the planner."""
    number = scenario.places
    ways = build_road_graph(len(number), ((number[a], number[b], seconds) for a, b, seconds, _ in scenario.edges))
    wanted = sorted({(min(pair), max(pair)) for pair in _list_required_edges(scenario)})
    return Day(
        streets=ways,
        tasks=tuple((number[a], number[b]) for a, b in wanted),
        depots=tuple(number[place] for place in scenario.depots),
        starts=tuple(number[place] for place in scenario.start),
        capacity_s=scenario.capacity,
        turnaround_s=scenario.recharge,
    )


def _list_required_edges(scenario: Scenario) -> Iterator[tuple[int, int]]:
    return ((a, b) for a, b, _, required in scenario.edges if required)


def initial_timelines(scenario: Scenario, day: Day) -> tuple[Timeline, ...]:
    """Return the scenario's own plan, begun at 0 without pauses."""
    number = scenario.places
    return tuple(day.time_walks([number[place] for place in nodes] for nodes in trips) for trips in scenario.initial)


def solution_of(scenario: Scenario, history: Sequence[Sequence[Timeline]]) -> Json:
    """Return a solution as in its file: all vehicles' trips at the start and after each loss."""
    names = list(scenario.places)

    def trip(one: TimedTrip) -> Json:
        return {"start": one.start_s, "nodes": [names[place] for place in one.places]}

    times = [0.0, *(failure.at for failure in scenario.losses)]
    return {
        "history": [
            {"at": at_s, "trips": [[trip(one) for one in own] for own in entry]}
            for at_s, entry in zip(times, history, strict=True)
        ]
    }


def wrong_with(scenario: Scenario, day: Day, history: Sequence[Sequence[Timeline]]) -> Iterator[str]:
    """Yield a solution's violations, apart from open tasks: rules of time and of information."""
    lost: set[int] = set()
    for failure, before, after in zip(scenario.losses, history, history[1:], strict=False):
        vehicle = failure.vehicle - 1
        for number, (old, new) in enumerate(zip(before, after, strict=True)):
            said = f"at {failure.at:g} s, vehicle {number + 1}"
            if number in lost:
                kept = old
            elif number == vehicle:
                kept = tuple(trip for trip in old if trip.end_s + day.turnaround_s < failure.at - SAME_S)
            else:
                kept = tuple(trip for trip in old if trip.start_s < failure.at - SAME_S)
            if new[: len(kept)] != kept:
                yield f"{said}: what had begun was changed"
            if number in lost | {vehicle} and len(new) > len(kept):
                yield f"{said}: is lost and flies on"
            yield from (f"{said}: {reason}" for reason in _untimely(day, number, new, len(kept), failure.at))
        lost.add(vehicle)


def _untimely(day: Day, vehicle: int, trips: Timeline, kept: int, at_s: float) -> Iterator[str]:
    place, ready_s = day.starts[vehicle], 0.0
    for number, trip in enumerate(trips):
        lasts_s = sum(float(day.streets.along_s[step]) for step in pairwise(trip.places))
        if trip.places[0] != place or trip.places[-1] not in day.depots:
            yield f"trip {number + 1} does not lead from where the vehicle is to a depot"
        if not lasts_s <= day.capacity_s + SAME_S or abs(lasts_s - trip.lasts_s) > SAME_S:
            yield f"trip {number + 1} takes {lasts_s:g} s of {day.capacity_s:g} s"
        if trip.start_s < ready_s - SAME_S or (number >= kept and trip.start_s < at_s - SAME_S):
            yield f"trip {number + 1} begins too early"
        place, ready_s = trip.places[-1], trip.end_s + day.turnaround_s
