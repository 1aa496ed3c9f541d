"""The plan file on disk: JSON, ``faultline-plan/2``, one document for a single flight and for days of many sorties.

What a plan says of its depot, speeds, heights, ground and pricing is written by the types that hold it; only numbers of
segments, vehicles and bases become ids and names. Figures are written as Python prints a float, so reading a file gives
back exactly what was written. Files of version 1 are read as well (``plan_json_v1``).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import not_
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from missions.areas import Unreachable
from missions.autopilots.dialect import AUTOPILOTS
from missions.errors import PlanFileError, SafetyError
from missions.files import read_text, write_document
from missions.flight_model import Base
from missions.geo import LocalFrame
from missions.inspection_defaults import Inspection
from missions.plan_file import (
    WINDOW_COST,
    BasePlace,
    DayPlanFile,
    PlanFence,
    PlanFile,
    PlanSegment,
    PlanTerrain,
    SolverRecord,
    Window,
)
from missions.plan_json_v1 import upgrade_plan
from missions.pricing import Pricing
from missions.validation import Above0, Figure, Flag, From0, Id, Name, Pair, Printable, Text, format_first_error, one_of
from planner import Cost, InstanceError, Plan, PlanError, Route, Travel, Vehicle, is_reversed, segment_of, visit_of
from planner.sorties import LossWindow, Objective, Sortie, SortieEvaluation, SortiePlan, SortieVehicle

FORMAT = "faultline-plan/2"
DEPOT = "depot"
"""The only base of a single flight."""
SOLVER_KEYS = ("seed", "solver", "seconds")
FLIGHT_KEYS = ("travel", "window", "inspection", "fly_again", "fence")
DAY_KEYS = ("bases", "days", "stagger_s")
"""What a document has as the plan itself has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehiclePart:
    """A vehicle as the planner sees it."""

    name: Name
    """As in the site file; files are named after it."""
    start: Pair
    """Where its first route starts: metres east and north of the depot."""
    budget_pct: Figure
    """What it may spend from a start until it is home, in percent of a full battery."""
    consumption: Above0 = 1.0
    """What it uses relative to the energy model."""
    autopilot: Annotated[str, one_of(one.name for one in AUTOPILOTS)] | None = None
    """Whose dialect its missions are in; files of version 1 may not say it."""
    airborne: Flag = False
    """Whether it flies already, and so pays its way home in any case."""
    start_up_m: Figure = 0.0
    """In the air: its height there, as `model` counts heights."""
    facing_m: Pair = (0.0, 0.0)
    """In the air: along which it arrived there, metres east and north; of no length where nobody knows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DayVehiclePart(VehiclePart):
    """A vehicle of days: its start is its pad at its base, its budget what a sortie may use of a full pack."""

    base: Text
    """Where it stands in the morning of the first day."""
    lands: tuple[Text, ...]
    """Bases where it may land and take off."""
    hours: tuple[Pair, ...]
    """When it may fly, in seconds from the first midnight."""
    pads: tuple[Base, ...]
    """At each of the bases."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VisitPart:
    """One segment of a route."""

    segment: Id
    """Its id."""
    reversed: Flag
    """Whether it is flown from b to a."""
    inspected_at_m: Figure | None = None
    """How high over the pylon tops, or over the depot's ground, where vehicles inspect as asked if they can."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoutePart:
    """One sortie: what one vehicle flies on one pack, from its start to a base."""

    vehicle: str
    visits: tuple[VisitPart, ...]
    """In the order of flight."""
    duration_s: Figure
    energy_pct: Figure
    """Of a full battery."""
    base: Text = DEPOT
    """Where it begins."""
    lands: Text = DEPOT
    """Where it ends."""
    start_s: Figure = 0.0
    """Of days: seconds from the first midnight."""
    day: Annotated[int, Field(ge=1)] = 1


@dataclass(frozen=True, slots=True)
class CostPart:
    """What the plan was chosen by."""

    name: Annotated[str, one_of([*(cost.value for cost in Cost), WINDOW_COST])]
    value: Figure
    """In percent of a full battery; of a window, its ``earliest_s``."""


@dataclass(frozen=True, slots=True)
class DayCostPart:
    """What a plan of days was chosen by."""

    name: Annotated[str, one_of(objective.value for objective in Objective)]
    """When the last sortie lands, the time in the air, or the number of sorties."""
    value: Figure
    """In seconds, or sorties."""


@dataclass(frozen=True, slots=True)
class DayLossPart:
    """From when on a vehicle may be lost for good, and everything is still inspected by the end of the last day."""

    vehicle: Name
    from_s: Figure
    """Seconds from the first midnight; 0 if at any time."""
    breaks: Id | None = None
    """Its last sortie, counted from 0, whose loss no re-plan was found for."""


class _Document(BaseModel):
    """What plans of a single flight and of days have in common."""

    # Strict and finite in the planner's types too, which say nothing of documents.
    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False, serialize_by_alias=True)

    format: Literal["faultline-plan/2"]
    depot: LocalFrame
    """WGS 84; the local metres of this file begin there."""
    bases: Annotated[tuple[BasePlace, ...], Field(min_length=1)]
    """Where vehicles take off and land; the depot alone in a single flight."""
    vehicles: tuple[VehiclePart, ...]
    routes: tuple[RoutePart, ...]
    """Of a single flight one for each vehicle, in their order; of days each vehicle's sorties in the order of time."""
    uncovered: tuple[Id, ...]
    """Ids of the segments that nobody flies."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)]
    """The solver's."""
    solver: Printable
    """Its name."""
    seconds: Figure
    """What it took."""
    model: Pricing | None
    unreachable: Annotated[tuple[Unreachable, ...], Field(exclude_if=not_)] = ()
    """What was asked for and is not planned, because it lies in an area or behind one."""
    terrain: PlanTerrain | None = None
    """The ground that it was made over, where a raster knows it."""
    cameras: Annotated[tuple[Printable, ...], Field(exclude_if=not_)] = ()
    """Names of the cameras that its missions trigger or point; how is said by its site."""
    segments: tuple[PlanSegment, ...]

    @cached_property
    def positions(self) -> dict[int, int]:
        """Positions in `segments`, by id."""
        return {segment.id: index for index, segment in enumerate(self.segments)}

    @property
    def names(self) -> list[str]:
        """Of the vehicles."""
        return [vehicle.name for vehicle in self.vehicles]

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        ids, bases = [segment.id for segment in self.segments], [base.name for base in self.bases]
        for key, own in (("segments[{}].id", ids), ("vehicles[{}].name", self.names), ("bases[{}].name", bases)):
            if len(set(own)) < len(own):
                index, name = next((index, name) for index, name in enumerate(own) if name in own[:index])
                raise ValueError(f"{key.format(index)}: expected one of its own, got {name}, which another has")
        known = {"vehicle": self.names, "base": bases, "lands": bases}
        for key, name in self._list_names():
            if isinstance(name, str) and name not in (own := known[key.rpartition(".")[2]]):
                raise ValueError(f"{key}: expected one of {', '.join(own)}, got {name}")
            if isinstance(name, int) and name not in self.positions:
                raise ValueError(f"{key}: expected the id of a segment, got {name}")
        return self

    def _list_names(self) -> Iterator[tuple[str, int | str]]:
        """Yield each place that names a vehicle, a base or a segment, and what it names."""
        for row, route in enumerate(self.routes):
            yield from ((f"routes[{row}].{key}", getattr(route, key)) for key in ("vehicle", "base", "lands"))
            for index, visit in enumerate(route.visits):
                yield f"routes[{row}].visits[{index}].segment", visit.segment
        yield from (("uncovered", segment) for segment in self.uncovered)

    @model_validator(mode="after")
    def _check_model(self) -> Self:
        model, count = self.model, len(self.segments)
        if model is not None and len(model.tracks_m) != count:
            raise ValueError(f"model.tracks_m: expected {count}, got {len(model.tracks_m)}")
        if model is not None and not set(model.bases) == set(model.models) == set(self.names):
            raise ValueError(f"model: expected bases and models of {', '.join(self.names)}")
        return self


class PlanDocument(_Document):
    """A plan, with all that is needed to check and to fly it."""

    travel: Travel
    vehicles: Annotated[tuple[VehiclePart, ...], Field(min_length=1)]
    cost: CostPart
    window: Window | None = None
    inspection: Inspection | None = None
    """Without it the plan can be checked, but not flown."""
    model: Pricing | None = None
    """From which times and energies follow; without it from `travel` and the straight lines between pylons, as the
    paper has it. Segments are named by their positions in `segments`."""
    fly_again: Flag = True
    """False: vehicles that have landed do not fly again after a loss, which the window reckons with."""
    fence: PlanFence | None = None
    """What vehicles are given as fences; without it none."""

    @model_validator(mode="after")
    def _check_flight(self) -> PlanDocument:
        if [route.vehicle for route in self.routes] != self.names:
            raise ValueError(f"routes: expected one each for {', '.join(self.names)}, in that order")
        if self.cost.name == WINDOW_COST and self.window is None:
            raise ValueError("window: expected the window that the plan was chosen by")
        return self


class DayPlanDocument(_Document):
    """Days of many sorties, with all that is needed to check and to fly them."""

    days: Annotated[tuple[Pair, ...], Field(min_length=1)]
    """Begin and end of each, in seconds from the first midnight."""
    stagger_s: From0
    """Least time between two take-offs from a base."""
    transfers_s: tuple[tuple[From0 | None, ...], ...]
    """To drive a vehicle from base to base; null where it is not done."""
    vehicles: Annotated[tuple[DayVehiclePart, ...], Field(min_length=1)]
    cost: DayCostPart
    finish_s: Figure
    """When the last sortie lands, in seconds from the first midnight."""
    flight_s: Figure
    """The time in the air of all sorties."""
    model: Pricing
    """From which times and energies follow."""
    windows: tuple[DayLossPart, ...] = ()
    """Until when each vehicle must not be lost, where that was looked at."""
    part_of: Text | None = None
    """Names the plan that this is what was left of one day of."""

    def _list_names(self) -> Iterator[tuple[str, int | str]]:
        yield from super()._list_names()
        for row, vehicle in enumerate(self.vehicles):
            yield f"vehicles[{row}].base", vehicle.base
            yield from ((f"vehicles[{row}].lands", base) for base in vehicle.lands)
        yield from ((f"windows[{row}].vehicle", one.vehicle) for row, one in enumerate(self.windows))

    @model_validator(mode="after")
    def _check_counts(self) -> DayPlanDocument:
        bases = len(self.bases)
        if [len(row) for row in self.transfers_s] != [bases] * bases:
            raise ValueError(f"transfers_s: expected {bases} rows of {bases}")
        for index, vehicle in enumerate(self.vehicles):
            if len(vehicle.pads) != bases:
                raise ValueError(f"vehicles[{index}].pads: expected {bases}, got {len(vehicle.pads)}")
        for index, route in enumerate(self.routes):
            if not route.visits:
                raise ValueError(f"routes[{index}].visits: expected at least one visit")
        return self


def write_plan(path: Path | str, content: PlanFile | DayPlanFile) -> None:
    """Write a plan file, as a whole or not at all: a reader never sees half of one.

    Raises:
        PlanFileError: a figure is NaN or infinite.
        OSError: the file cannot be written.
    """
    path = Path(path)
    write_document(path, build_plan_document(content, str(path)))


def build_plan_document(content: PlanFile | DayPlanFile, source: str | None = None) -> dict[str, object]:
    """Return what a plan file says, as JSON has it; an error names where the plan was read, or another source.

    Raises:
        PlanFileError: a figure is NaN or infinite.
    """
    document = _describe_flight(content) if isinstance(content, PlanFile) else _describe_days(content)
    plain = document.model_dump(mode="json", exclude_none=True)
    plain["segments"] = plain.pop("segments")  # last, for they are by far the longest
    try:
        type(document).model_validate_json(json.dumps(plain))
    except ValidationError as error:
        raise PlanFileError(f"{source or content.source}: {format_first_error(error)}") from error
    return plain


def read_any_plan(path: Path | str) -> PlanFile | DayPlanFile:
    """Read a plan file, of a single flight or of days.

    Raises:
        PlanFileError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    text = upgrade_plan(read_text(path, "plan file", PlanFileError), str(path))
    try:
        if _is_of_days(text):
            return _read_days(DayPlanDocument.model_validate_json(text), str(path))
        return _read_flight(PlanDocument.model_validate_json(text), str(path))
    except ValidationError as error:
        raise PlanFileError(f"{path}: {format_first_error(error)}") from error
    except InstanceError as error:
        raise PlanFileError(f"{path}: travel.{error}") from error
    except SafetyError as error:
        raise PlanFileError(f"{path}: model.kept_out: {error}") from error
    except PlanError as error:
        raise PlanFileError(f"{path}: routes: expected every segment at most once: {error}") from error


def read_plan(path: Path | str) -> PlanFile:
    """Read the plan file of a single flight.

    Raises:
        PlanFileError: as `read_any_plan`, or it is of days.
    """
    content = read_any_plan(path)
    if isinstance(content, DayPlanFile):
        raise PlanFileError(f"{path}: days: expected the plan of a single flight, got one of days")
    return content


def read_day_plan(path: Path | str) -> DayPlanFile:
    """Read the plan file of days.

    Raises:
        PlanFileError: as `read_any_plan`, or it is of a single flight.
    """
    content = read_any_plan(path)
    if isinstance(content, PlanFile):
        raise PlanFileError(f"{path}: days: expected a plan of days, got that of a single flight")
    return content


def is_day_plan(path: Path | str) -> bool:
    """Return whether a file is a plan of days."""
    try:
        return _is_of_days(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False  # whoever reads it says why


def _is_of_days(text: str) -> bool:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "days" in content


def _describe_common(content: PlanFile | DayPlanFile) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "depot": content.frame,
        "uncovered": tuple(content.segments[number].id for number in content.plan.uncovered),
        **{key: getattr(content.solved, key) for key in SOLVER_KEYS},
        "model": content.pricing,
        **{key: getattr(content, key) for key in ("unreachable", "terrain", "cameras", "segments")},
    }


def _read_common(document: _Document, source: str) -> dict[str, Any]:
    return {
        "frame": document.depot,
        "solved": SolverRecord(**{key: getattr(document, key) for key in SOLVER_KEYS}),
        "pricing": document.model,
        "autopilots": {one.name: one.autopilot for one in document.vehicles if one.autopilot is not None},
        "source": source,
        **{key: getattr(document, key) for key in ("unreachable", "terrain", "cameras", "segments")},
    }


def _describe_visits(content: PlanFile | DayPlanFile, vehicle: str, visits: Sequence[int]) -> tuple[VisitPart, ...]:
    height_of = content.inspection_height_m if isinstance(content, PlanFile) else lambda *_: None
    numbers = [segment_of(visit) for visit in visits]
    return tuple(
        VisitPart(
            segment=content.segments[number].id, reversed=is_reversed(visit), inspected_at_m=height_of(vehicle, number)
        )
        for visit, number in zip(visits, numbers, strict=True)
    )


def _read_visits(document: _Document, route: RoutePart) -> tuple[int, ...]:
    return tuple(visit_of(document.positions[visit.segment], visit.reversed) for visit in route.visits)


def _read_uncovered(document: _Document) -> tuple[int, ...]:
    return tuple(document.positions[segment] for segment in document.uncovered)


def _describe_flight(content: PlanFile) -> PlanDocument:
    frame = content.frame
    vehicles = (
        VehiclePart(
            name=one.name, start=one.start_m, budget_pct=one.budget_pct, consumption=one.consumption,
            airborne=one.airborne, start_up_m=one.start_up_m, facing_m=one.facing_m,
            autopilot=content.autopilots.get(one.name),
        )
        for one in content.vehicles
    )  # fmt: skip
    routes = (
        RoutePart(
            vehicle=own.name, visits=_describe_visits(content, own.name, route.visits), duration_s=duration_s,
            energy_pct=energy_pct,
        )
        for own, route, duration_s, energy_pct in zip(
            content.vehicles, content.plan.routes, content.durations_s, content.energies_pct, strict=True
        )
    )  # fmt: skip
    return PlanDocument.model_construct(
        **_describe_common(content),
        **{key: getattr(content, key) for key in FLIGHT_KEYS},
        bases=(BasePlace(DEPOT, frame.lat_deg, frame.lon_deg, frame.alt_m),),
        vehicles=tuple(vehicles),
        routes=tuple(routes),
        cost=CostPart(content.cost_name, content.cost_value),
    )


def _read_flight(document: PlanDocument, source: str) -> PlanFile:
    asked = document.inspection is not None and document.inspection.same_distance
    visits = (visit for route in document.routes for visit in route.visits)
    routes = (Route(number, _read_visits(document, route)) for number, route in enumerate(document.routes))
    return PlanFile(
        **_read_common(document, source),
        **{key: getattr(document, key) for key in FLIGHT_KEYS},
        vehicles=tuple(
            Vehicle(one.name, one.start, one.budget_pct, one.consumption, one.airborne, one.start_up_m, one.facing_m)
            for one in document.vehicles
        ),
        plan=Plan(tuple(routes), _read_uncovered(document)),
        durations_s=tuple(route.duration_s for route in document.routes),
        energies_pct=tuple(route.energy_pct for route in document.routes),
        cost=None if document.cost.name == WINDOW_COST else Cost(document.cost.name),
        cost_value=document.cost.value,
        says_distances=not asked or all(visit.inspected_at_m is not None for visit in visits),
    )


def _describe_days(content: DayPlanFile) -> DayPlanDocument:
    names, figures, ends_s = [base.name for base in content.bases], content.evaluation, [end for _, end in content.days]
    vehicles = (
        DayVehiclePart(
            name=own.name, start=pads[own.base].place_m[:2], budget_pct=own.budget_pct, consumption=own.consumption,
            autopilot=content.autopilots.get(own.name), base=names[own.base],
            lands=tuple(names[base] for base in own.lands), hours=own.windows, pads=pads,
        )
        for own, pads in zip(content.vehicles, content.pads, strict=True)
    )  # fmt: skip
    routes = (
        RoutePart(
            vehicle=own.name, visits=_describe_visits(content, own.name, one.visits),
            duration_s=figures.lasts_s[row][number], energy_pct=figures.energies_pct[row][number],
            base=names[one.base], lands=names[one.lands], start_s=one.start_s,
            day=next((day for day, end_s in enumerate(ends_s, 1) if one.start_s < end_s), len(ends_s)),
        )
        for row, own in enumerate(content.vehicles) for number, one in enumerate(content.plan.sorties[row])
    )  # fmt: skip
    losses = (DayLossPart(content.vehicles[one.vehicle].name, one.from_s, one.breaks) for one in content.windows)
    return DayPlanDocument.model_construct(
        **_describe_common(content),
        **{key: getattr(content, key) for key in DAY_KEYS},
        transfers_s=tuple(
            tuple(one if math.isfinite(one) else None for one in row) for row in content.transfer_s.tolist()
        ),
        vehicles=tuple(vehicles),
        routes=tuple(routes),
        cost=DayCostPart(content.objective.value, content.cost_value),
        finish_s=figures.finish_s,
        flight_s=figures.flight_s,
        windows=tuple(losses),
        part_of=content.part_of,
    )


def _read_days(document: DayPlanDocument, source: str) -> DayPlanFile:
    base = {one.name: index for index, one in enumerate(document.bases)}
    rows = [[route for route in document.routes if route.vehicle == name] for name in document.names]
    vehicles = (
        SortieVehicle(
            one.name, base[one.base], one.budget_pct, one.hours, tuple(base[name] for name in one.lands),
            consumption=one.consumption, ready_s=document.days[0][0],
        )
        for one in document.vehicles
    )  # fmt: skip
    sorties = (
        tuple(Sortie(base[one.base], _read_visits(document, one), base[one.lands], one.start_s) for one in own)
        for own in rows
    )
    lasts_s, energies_pct = (
        tuple(tuple(getattr(one, key) for one in own) for own in rows) for key in ("duration_s", "energy_pct")
    )
    return DayPlanFile(
        **_read_common(document, source),
        **{key: getattr(document, key) for key in DAY_KEYS},
        vehicles=tuple(vehicles),
        pads=tuple(one.pads for one in document.vehicles),
        transfer_s=np.array([[math.inf if one is None else one for one in row] for row in document.transfers_s]),
        plan=SortiePlan(tuple(sorties), _read_uncovered(document)),
        evaluation=SortieEvaluation(
            document.finish_s, document.flight_s, len(document.routes), lasts_s, energies_pct, ()
        ),
        objective=Objective(document.cost.name),
        windows=tuple(
            LossWindow(document.names.index(one.vehicle), one.from_s, one.breaks) for one in document.windows
        ),
        part_of=document.part_of,
    )
