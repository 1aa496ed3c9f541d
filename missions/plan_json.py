"""The plan file on disk: JSON, ``faultline-plan/1``, as the models below have it.

Figures are written as Python prints a float, so reading a file gives back exactly what was written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from operator import not_
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from missions.areas import Area, AreaKind, AreaRestriction, Unreachable
from missions.errors import PlanFileError, SafetyError
from missions.files import read_text, to_printable, write_document
from missions.flight_model import Base, FlightModel
from missions.geo import MAX_LATITUDE_DEG, LocalFrame
from missions.grids import Grid
from missions.pace import AS_MODELLED, Pace
from missions.performance import Performance
from missions.plan_file import WINDOW_COST, PlanFence, PlanFile, PlanSegment, PlanTerrain, SolverRecord, Window
from missions.pricing import Pricing
from missions.relief import Relief
from missions.setup import MOST, Inspection
from missions.validation import Figure, Flag, Id, Pair, Place, Text, format_first_error, is_none
from planner import (
    Cost,
    Dynamics,
    InstanceError,
    Plan,
    PlanError,
    Route,
    SteadyWind,
    Travel,
    Vehicle,
    is_reversed,
    segment_of,
    visit_of,
)

AREA_FIGURES = ("name", "margin_m", "width_m", "eased_m", "max_agl_m", "max_amsl_m")
"""What an area's part has as the area itself has it."""


def _is_nowhere(along_m: Pair) -> bool:
    return along_m == (0, 0)


def _is_modelled(value: Pace) -> bool:
    return value == AS_MODELLED


Above0 = Annotated[Figure, Field(gt=0)]
Speed = Annotated[Figure, Field(ge=0.001)]
Size = Annotated[float, Field(strict=True, gt=0, le=MOST)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, serialize_by_alias=True)


class DepotPart(_Part):
    """Where the vehicles start and land, WGS 84; the local metres of this file begin there."""

    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    alt_m: Figure
    """Above mean sea level."""


class DynamicsPart(_Part):
    """What turns and stops take."""

    acceleration_m_s2: Above0
    yaw_rate_rad_s: Above0


class WindPart(_Part):
    """Steady wind, and what flying at an air speed uses."""

    east_m_s: Figure
    """Where the air moves to."""
    north_m_s: Figure
    airspeed_m_s: tuple[Figure, ...]
    """Ascending from 0."""
    pct_per_s: tuple[Figure, ...]
    """At each of those air speeds, for a consumption of 1; straight lines between them."""


class TravelPart(_Part):
    """How fast a vehicle moves, and what a second of it uses in percent of a full battery."""

    transit_speed_m_s: Speed
    """Between segments."""
    inspection_speed_m_s: Speed
    """Along a segment."""
    transit_pct_per_s: Above0
    inspection_pct_per_s: Above0
    dynamics: DynamicsPart | None = None
    wind: WindPart | None = None


class VehiclePart(_Part):
    """A vehicle as the planner sees it."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
    """As in the site file; files are named after it."""
    start: Pair
    """Where its route starts: metres east and north of the depot."""
    budget_pct: Figure
    """What it may spend from its start until it is home, in percent of a full battery."""
    consumption: Figure | None = None
    """What it uses relative to the energy model; without it 1."""
    airborne: Flag = False
    """Whether it flies already, and so pays its way home in any case."""
    start_up_m: Annotated[Figure, Field(exclude_if=not_)] = 0.0
    """In the air: its height there, as `model` counts heights."""
    facing_m: Annotated[Pair, Field(exclude_if=_is_nowhere)] = (0.0, 0.0)
    """In the air: along which it arrived there, metres east and north; without it nobody knows."""
    autopilot: Annotated[Literal["ardupilot", "px4"] | None, Field(exclude_if=is_none)] = None
    """Whose dialect its mission is in; older files do not say it."""


class VisitPart(_Part):
    """One segment of a route."""

    segment: Id
    """Its id."""
    reversed: Flag
    """Whether it is flown from b to a."""
    inspected_at_m: Annotated[Figure | None, Field(exclude_if=is_none)] = None
    """How high over the pylon tops, or over the depot's ground, where vehicles inspect as asked if they can."""


class RoutePart(_Part):
    """What one vehicle flies, from its start to the depot."""

    vehicle: str
    visits: tuple[VisitPart, ...]
    """In the order of flight."""
    duration_s: Figure
    energy_pct: Figure
    """Of a full battery."""


class CostPart(_Part):
    """What the plan was chosen by."""

    name: Literal["minmax", "minsum", "mincomb", "window"]
    value: Figure
    """In percent of a full battery; of a window, its ``earliest_s``."""


class InspectionPart(_Part):
    """How segments are flown; the same figures as the site file's table of this name."""

    height_m: Size
    standoff_m: Annotated[float, Field(strict=True, ge=0, le=MOST)]
    speed_m_s: Size
    transit_speed_m_s: Size
    layer_m: Size
    ceiling_m: Size | None = None
    return_ceiling_m: Size | None = None
    same_distance: Annotated[bool, Field(strict=True, exclude_if=not_)] = False
    """Whether vehicles inspect at `height_m`, and not in their layers, wherever no other can meet them there."""
    heights: Literal["flat", "known"] = "known"
    """`flat`: the ground is claimed to be as high as the depot's everywhere."""


class VehicleModelPart(_Part):
    """How one vehicle flies."""

    base: Base
    performance: Performance
    pace: Annotated[Pace, Field(exclude_if=_is_modelled)] = AS_MODELLED
    """What was learned of it in flight: factors on the times and energies of its legs."""
    barred: Annotated[tuple[Id, ...], Field(exclude_if=not_)] = ()
    """Positions in `segments` of those that it cannot be given, for it lacks a camera that they ask for."""
    step_m: Annotated[Figure, Field(ge=0, exclude_if=not_)] = 0.0
    """How far it comes down from its layer to a line; without it it inspects in its layer."""
    layered: Annotated[tuple[Id, ...], Field(exclude_if=not_)] = ()
    """Positions in `segments` of those that it inspects in its layer all the same, for another could meet it there."""
    low_start: Annotated[bool, Field(strict=True, exclude_if=not_)] = False
    """In the air: whether it starts below its layer."""


class AreaPart(_Part):
    """An area that ways lead around."""

    name: Text
    kind: Literal["no-fly", "corridor", "height-limit"]
    rings: tuple[tuple[Pair, ...], ...]
    """Its outline, and after it those of holes, or the middle of a corridor: metres east and north of the depot."""
    margin_m: Above0
    """How far flights keep from it."""
    width_m: Annotated[Figure, Field(ge=0, exclude_if=not_)] = 0.0
    """Of a corridor."""
    eased_m: Annotated[Figure, Field(ge=0, exclude_if=not_)] = 0.0
    """How much more flights keep from it, because its outline is simplified."""
    max_agl_m: Annotated[Figure | None, Field(exclude_if=is_none)] = None
    """Of a height limit: over the ground."""
    max_amsl_m: Annotated[Figure | None, Field(exclude_if=is_none)] = None
    """Of a height limit: above mean sea level."""
    vehicles: tuple[str, ...]
    """Who must keep out of it; of a height limit those whose layers are above it."""
    highest_m: Annotated[Figure | None, Field(exclude_if=is_none)] = None
    """Of a height limit: how high the highest of them would be."""


class UnreachablePart(_Part):
    """A segment that was asked for, and that no flight can inspect."""

    segment: Id
    """Its id in the network; it is none of `segments`."""
    name: Text
    why: Text


class ReliefPart(_Part):
    """How high the lowest layer is over the depot's ground, on a regular grid; transits rise and fall with it."""

    east_m: Figure
    """Of the first node, over the ground from the depot."""
    north_m: Figure
    step_m: Above0
    """Between nodes."""
    heights_m: Annotated[tuple[Annotated[tuple[Figure, ...], Field(min_length=2)], ...], Field(min_length=2)]
    """For each easting from west to east, those from south to north."""

    @model_validator(mode="after")
    def _check_rectangular(self) -> ReliefPart:
        if len({len(column) for column in self.heights_m}) != 1:
            raise ValueError("heights_m: expected as many heights for each easting")
        return self


class WaysPart(_Part):
    """What ways lead around and over, and which segments take longer than their tracks."""

    pads: tuple[tuple[Figure, Figure], ...] = ()
    """East and north of the depot in metres: ways lead around the columns above others' pads."""
    column_m: Annotated[Figure, Field(ge=0)] = 0.0
    """Radius of these columns; 0 where every way is straight."""
    areas: Annotated[tuple[AreaPart, ...], Field(exclude_if=not_)] = ()
    """That ways lead around."""
    relief: Annotated[ReliefPart | None, Field(exclude_if=is_none)] = None
    """Where a raster knows the ground; without it ways rise and fall evenly."""
    besides_s: Annotated[tuple[tuple[Id, Figure], ...], Field(exclude_if=not_)] = ()
    """Positions in `segments` of those that take longer than their tracks, and by how much."""
    in_layer_s: Annotated[tuple[tuple[Id, Figure], ...], Field(exclude_if=not_)] = ()
    """The same of pylons with viewpoints below the surface, for who looks at them from its layer."""
    deep_m: Annotated[tuple[tuple[Id, Figure], ...], Field(exclude_if=not_)] = ()
    """How far below the surface the lowest of these viewpoints lies."""


class ModelPart(WaysPart):
    """From which the times and energies of this file follow."""

    name: Literal["flight"]
    power: WindPart
    vehicles: tuple[VehicleModelPart, ...]
    """In the order of `vehicles`."""
    tracks: tuple[tuple[Place, Place], ...]
    """Where the inspection of each segment, in the order of `segments`, is flown from a to b: metres east, north and up
    of the depot, in the lowest layer."""
    answer_s: Annotated[Figure, Field(ge=0)] = 0.0
    """How long after a loss everybody flies on as planned: until it is known, a re-plan is found and is on board."""


class PlanDocument(_Part):
    """A plan, with all that is needed to check and to fly it."""

    format: Literal["faultline-plan/1"]
    depot: DepotPart
    travel: TravelPart
    vehicles: Annotated[tuple[VehiclePart, ...], Field(min_length=1)]
    routes: tuple[RoutePart, ...]
    """One for each vehicle, in their order."""
    uncovered: tuple[Id, ...]
    """Ids of the segments that nobody flies."""
    cost: CostPart
    seed: Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
    """The solver's."""
    solver: Text
    """Its name."""
    seconds: Figure
    """What it took."""
    window: Annotated[Window | None, Field(exclude_if=is_none)] = None
    inspection: Annotated[InspectionPart | None, Field(exclude_if=is_none)] = None
    """Without it the plan can be checked, but not flown."""
    model: Annotated[ModelPart | None, Field(exclude_if=is_none)] = None
    """Without it times and energies follow from `travel` and the straight lines between pylons, as the paper has it."""
    fly_again: Annotated[bool, Field(strict=True, exclude_if=bool)] = True
    """False: vehicles that have landed do not fly again after a loss, which the window reckons with."""
    unreachable: Annotated[tuple[UnreachablePart, ...], Field(exclude_if=not_)] = ()
    """What was asked for and is not planned, because it lies in an area or behind one."""
    terrain: Annotated[PlanTerrain | None, Field(exclude_if=is_none)] = None
    """The ground that it was made over, where a raster knows it."""
    fence: Annotated[PlanFence | None, Field(exclude_if=is_none)] = None
    """What vehicles are given as fences; without it none."""
    segments: tuple[PlanSegment, ...]
    """Last, for it is by far the longest."""

    @model_validator(mode="after")
    def _check_distinct(self) -> PlanDocument:
        for key, names in (
            ("segments[{}].id", [segment.id for segment in self.segments]),
            ("vehicles[{}].name", [vehicle.name for vehicle in self.vehicles]),
        ):
            if len(set(names)) < len(names):
                index, name = next((index, name) for index, name in enumerate(names) if name in names[:index])
                raise ValueError(f"{key.format(index)}: expected one of its own, got {name}, which another has")
        return self

    @model_validator(mode="after")
    def _check_consistency(self) -> PlanDocument:
        known = {segment.id for segment in self.segments}
        names = [vehicle.name for vehicle in self.vehicles]
        if [route.vehicle for route in self.routes] != names:
            raise ValueError(f"routes: expected one each for {', '.join(names)}, in that order")
        for row, route in enumerate(self.routes):
            for index, visit in enumerate(route.visits):
                if visit.segment not in known:
                    place = f"routes[{row}].visits[{index}].segment"
                    raise ValueError(f"{place}: expected the id of a segment, got {visit.segment}")
        unknown = [segment for segment in self.uncovered if segment not in known]
        if unknown:
            raise ValueError(f"uncovered: expected ids of segments, got unknown {unknown[0]}")
        for key, count in (("vehicles", len(self.vehicles)), ("tracks", len(self.segments))):
            if self.model is not None and len(getattr(self.model, key)) != count:
                raise ValueError(f"model.{key}: expected {count}, got {len(getattr(self.model, key))}")
        if self.cost.name == WINDOW_COST and self.window is None:
            raise ValueError("window: expected the window that the plan was chosen by")
        return self


def write_plan(path: Path | str, plan_file: PlanFile) -> None:
    """Write a plan file, as a whole or not at all: a reader never sees half of one.

    Raises:
        PlanFileError: a figure is NaN or infinite.
        OSError: the file cannot be written.
    """
    path = Path(path)
    document = build_plan_document(replace(plan_file, source=str(path)))
    write_document(path, document)


def read_plan(path: Path | str) -> PlanFile:
    """Read a plan file.

    Raises:
        PlanFileError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    text = read_text(path, "plan file", PlanFileError)
    try:
        return _read_content(PlanDocument.model_validate_json(text), str(path))
    except ValidationError as error:
        raise PlanFileError(f"{path}: {format_first_error(error)}") from error
    except InstanceError as error:
        raise PlanFileError(f"{path}: travel.{error}") from error
    except SafetyError as error:
        raise PlanFileError(f"{path}: model.areas: {error}") from error
    except PlanError as error:
        raise PlanFileError(f"{path}: routes: expected every segment at most once: {error}") from error


def build_plan_document(content: PlanFile) -> dict[str, object]:
    """Return what a plan file says, as JSON has it.

    Raises:
        PlanFileError: a figure is NaN or infinite.
    """
    ids = [segment.id for segment in content.segments]
    inspection, rows = content.inspection, zip(
        content.plan.routes, content.durations_s, content.energies_pct, strict=True
    )  # fmt: skip
    document = {
        "format": "faultline-plan/1",
        "depot": content.frame,
        "travel": content.travel,
        "vehicles": [
            {**asdict(vehicle), "start": vehicle.start_m, "autopilot": content.autopilots.get(vehicle.name)}
            for vehicle in content.vehicles
        ],
        "routes": [
            {
                "vehicle": content.vehicles[route.vehicle].name,
                "visits": [
                    {
                        "segment": ids[segment_of(visit)],
                        "reversed": is_reversed(visit),
                        "inspected_at_m": content.inspection_height_m(
                            content.vehicles[route.vehicle].name, segment_of(visit)
                        ),
                    }
                    for visit in route.visits
                ],
                "duration_s": duration_s,
                "energy_pct": energy_pct,
            }
            for route, duration_s, energy_pct in rows
        ],
        "uncovered": [ids[segment] for segment in content.plan.uncovered],
        "cost": {"name": content.cost_name, "value": content.cost_value},
        **asdict(content.solved),
        "window": content.window,
        "inspection": inspection and {**asdict(inspection), "heights": "flat" if inspection.flat else "known"},
        "model": content.pricing and _build_model(content.pricing, content.vehicles),
        "fly_again": content.fly_again,
        "unreachable": [
            {"segment": one.segment, "name": name, "why": one.why}
            for one, name in zip(content.unreachable, content.unreachable_names, strict=True)
        ],
        "terrain": content.terrain,
        "fence": content.fence,
        "segments": content.segments,
    }
    try:
        return PlanDocument.model_validate(document, from_attributes=True).model_dump(mode="json")
    except ValidationError as error:
        raise PlanFileError(f"{content.source}: {format_first_error(error)}") from error


def _read_content(document: PlanDocument, source: str) -> PlanFile:
    position = {segment.id: index for index, segment in enumerate(document.segments)}
    travel, inspection = document.travel, document.inspection
    return PlanFile(
        frame=LocalFrame(**dict(document.depot)),
        segments=document.segments,
        vehicles=tuple(
            Vehicle(
                vehicle.name,
                vehicle.start,
                vehicle.budget_pct,
                1.0 if vehicle.consumption is None else vehicle.consumption,
                vehicle.airborne,
                vehicle.start_up_m,
                vehicle.facing_m,
            )
            for vehicle in document.vehicles
        ),
        travel=replace(
            Travel(**travel.model_dump(exclude={"dynamics", "wind"})),
            dynamics=None if travel.dynamics is None else Dynamics(**dict(travel.dynamics)),
            wind=None if travel.wind is None else SteadyWind(**dict(travel.wind)),
        ),
        plan=Plan(
            tuple(
                Route(number, tuple(visit_of(position[visit.segment], visit.reversed) for visit in route.visits))
                for number, route in enumerate(document.routes)
            ),
            tuple(position[segment] for segment in document.uncovered),
        ),
        durations_s=tuple(route.duration_s for route in document.routes),
        energies_pct=tuple(route.energy_pct for route in document.routes),
        cost=None if document.cost.name == WINDOW_COST else Cost(document.cost.name),
        cost_value=document.cost.value,
        solved=SolverRecord(to_printable(document.solver), document.seed, document.seconds),
        window=document.window,
        inspection=None if inspection is None else Inspection(
            **inspection.model_dump(exclude={"heights"}, exclude_none=True), flat=inspection.heights == "flat"
        ),
        pricing=_read_pricing(document),
        fly_again=document.fly_again,
        unreachable=tuple(Unreachable(one.segment, to_printable(one.why)) for one in document.unreachable),
        unreachable_names=tuple(to_printable(one.name) for one in document.unreachable),
        terrain=document.terrain,
        autopilots={one.name: one.autopilot for one in document.vehicles if one.autopilot is not None},
        fence=document.fence,
        says_distances=all(visit.inspected_at_m is not None for route in document.routes for visit in route.visits)
        or inspection is None
        or not inspection.same_distance,
        source=source,
    )  # fmt: skip


def _build_model(pricing: Pricing, vehicles: Sequence[Vehicle]) -> dict[str, object]:
    models = [pricing.models[vehicle.name] for vehicle in vehicles]
    return {
        "name": "flight",
        "power": models[0].power,
        "vehicles": [
            {
                "base": pricing.bases[vehicle.name],
                "performance": model.performance,
                "pace": model.pace,
                "barred": sorted(pricing.barred.get(vehicle.name, ())),
                "step_m": pricing.steps_m.get(vehicle.name, 0.0),
                "layered": sorted(pricing.layered.get(vehicle.name, ())),
                "low_start": vehicle.name in pricing.low_starts,
            }
            for vehicle, model in zip(vehicles, models, strict=True)
        ],
        "tracks": pricing.tracks_m.tolist(),
        "answer_s": pricing.answer_s,
        **build_ways(pricing),
    }


def build_ways(pricing: Pricing) -> dict[str, object]:
    """Return what a plan's ways lead around and over, as `WaysPart` has it."""
    return {
        "pads": pricing.pads_m,
        "column_m": pricing.column_m,
        "areas": [
            {
                **{key: getattr(one.area, key) for key in AREA_FIGURES},
                "kind": one.area.kind.value,
                "rings": one.area.rings_m,
                "vehicles": one.vehicles,
                "highest_m": one.highest_m,
            }
            for one in pricing.kept_out
        ],
        "relief": pricing.relief and _build_relief(pricing.relief.grid),
        "besides_s": sorted(pricing.besides_s.items()),
        "in_layer_s": sorted(pricing.in_layer_s.items()),
        "deep_m": sorted(pricing.deep_m.items()),
    }


def _build_relief(grid: Grid) -> dict[str, object]:
    east_m, north_m = grid.low_m
    return {"east_m": east_m, "north_m": north_m, "step_m": grid.step_m, "heights_m": grid.heights_m.tolist()}


def _read_pricing(document: PlanDocument) -> Pricing | None:
    if document.model is None:
        return None
    travel, model = document.travel, document.model
    power = SteadyWind(**dict(model.power))
    named = {vehicle.name: own for vehicle, own in zip(document.vehicles, model.vehicles, strict=True)}
    pricing = Pricing(
        np.array(model.tracks, dtype=np.float64).reshape(-1, 2, 3),
        {name: own.base for name, own in named.items()},
        {
            name: FlightModel(own.performance, power, travel.transit_speed_m_s, travel.inspection_speed_m_s, own.pace)
            for name, own in named.items()
        },
        answer_s=model.answer_s,
        barred={name: frozenset(own.barred) for name, own in named.items() if own.barred},
        steps_m={name: own.step_m for name, own in named.items() if own.step_m},
        layered={name: frozenset(own.layered) for name, own in named.items() if own.layered},
        low_starts=frozenset(name for name, own in named.items() if own.low_start),
    )
    return add_ways(pricing, model)


def add_ways(pricing: Pricing, ways: WaysPart) -> Pricing:
    """Return a pricing with what ways lead around and over.

    Raises:
        SafetyError: an area's figures do not make one.
    """
    relief = ways.relief
    return replace(
        pricing,
        pads_m=ways.pads,
        column_m=ways.column_m,
        kept_out=tuple(map(_read_restriction, ways.areas)),
        relief=None
        if relief is None
        else Relief(Grid((relief.east_m, relief.north_m), relief.step_m, np.array(relief.heights_m))),
        besides_s=dict(ways.besides_s),
        in_layer_s=dict(ways.in_layer_s),
        deep_m=dict(ways.deep_m),
    )


def _read_restriction(part: AreaPart) -> AreaRestriction:
    figures = {key: getattr(part, key) for key in AREA_FIGURES}
    return AreaRestriction(Area(kind=AreaKind(part.kind), rings_m=part.rings, **figures), part.vehicles, part.highest_m)
