"""The day plan on disk: JSON, ``faultline-dayplan/1``, as the models below have it."""

from __future__ import annotations

import math
from dataclasses import replace
from operator import not_
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field, ValidationError, model_validator

from missions.areas import Unreachable
from missions.day_plan import BasePlace, DayPlanFile
from missions.errors import PlanFileError, SafetyError
from missions.files import read_text, to_printable, write_document
from missions.flight_model import Base, FlightModel, Speed
from missions.geo import MAX_LATITUDE_DEG, LocalFrame
from missions.pace import AS_MODELLED, Pace
from missions.performance import Performance
from missions.plan_file import PlanSegment, PlanTerrain, SolverRecord
from missions.plan_json import DepotPart, UnreachablePart, VisitPart, WaysPart, WindPart, add_ways, build_ways
from missions.pricing import Pricing
from missions.validation import Figure, Id, Place, Text, format_first_error, is_none
from planner import PlanError, SteadyWind, is_reversed, segment_of, visit_of
from planner.sorties import (
    LossWindow,
    Objective,
    Sortie,
    SortieBase,
    SortieEvaluation,
    SortiePlan,
    SortieVehicle,
)

FORMAT = "faultline-dayplan/1"
From0 = Annotated[Figure, Field(ge=0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]


class DayBasePart(BaseModel):
    """A place where vehicles take off and land."""

    name: Text
    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    alt_m: Figure
    """Ground above mean sea level."""
    packs: Annotated[Id | None, Field(exclude_if=is_none)] = None
    """Charged in the morning; without it there are always enough."""
    turnaround_s: From0
    """From a landing to the vehicle's next take-off."""
    recharge_s: Annotated[From0 | None, Field(exclude_if=is_none)] = None
    """From a landing until the pack is charged; without it overnight."""


class DayVehiclePart(BaseModel):
    """A vehicle, and how it flies."""

    name: Name
    base: Text
    """Where it stands in the morning of the first day."""
    lands: tuple[Text, ...]
    """Bases where it may land and take off."""
    budget_pct: Figure
    """What a sortie may use, in percent of a full pack."""
    consumption: Annotated[Figure, Field(gt=0)]
    """What it uses relative to the energy model."""
    windows: tuple[tuple[Figure, Figure], ...]
    """When it may fly, in seconds from the first midnight."""
    pads: tuple[Base, ...]
    """At each of the bases."""
    performance: Performance
    pace: Pace = AS_MODELLED
    speed_m_s: Speed
    """Along a segment."""
    transit_speed_m_s: Speed
    segments: Annotated[tuple[Id, ...] | None, Field(exclude_if=is_none)] = None
    """Ids of the only segments that it may inspect; without it all."""
    step_m: Annotated[Figure, Field(ge=0, exclude_if=not_)] = 0.0
    """How far it comes down from its layer to a line; without it it inspects in its layer."""


class SortiePart(BaseModel):
    """One flight on one pack."""

    vehicle: Name
    day: Annotated[int, Field(strict=True, ge=1)]
    """From 1."""
    base: Text
    lands: Text
    """The base where it ends."""
    start_s: Figure
    """Seconds from the first midnight."""
    duration_s: Figure
    energy_pct: Figure
    """Of a full pack."""
    visits: Annotated[tuple[VisitPart, ...], Field(min_length=1)]
    """In the order of flight."""


class DayLossPart(BaseModel):
    """From when on a vehicle may be lost for good, and everything is still inspected by the end of the last day."""

    vehicle: Name
    from_s: Figure
    """Seconds from the first midnight; 0 if at any time."""
    breaks: Annotated[Id | None, Field(exclude_if=is_none)] = None
    """Its last sortie, counted from 0, whose loss no re-plan was found for."""


class DayPart(BaseModel):
    """A working day."""

    begin_s: Figure
    """Seconds from the first midnight."""
    end_s: Figure


class DayPlanDocument(BaseModel):
    """Days of many sorties, with all that is needed to check them."""

    format: Literal["faultline-dayplan/1"]
    depot: DepotPart
    days: Annotated[tuple[DayPart, ...], Field(min_length=1)]
    stagger_s: From0
    """Least time between two take-offs from a base."""
    bases: Annotated[tuple[DayBasePart, ...], Field(min_length=1)]
    transfers_s: tuple[tuple[From0 | None, ...], ...]
    """To drive a vehicle from base to base; null where it is not done."""
    power: WindPart
    vehicles: Annotated[tuple[DayVehiclePart, ...], Field(min_length=1)]
    objective: Literal["finish", "flight", "swaps"]
    """What the plan was chosen by."""
    finish_s: Figure
    """When the last sortie lands, in seconds from the first midnight."""
    flight_s: Figure
    """The time in the air of all sorties."""
    seed: Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
    solver: Text
    seconds: Figure
    """What planning took."""
    sorties: tuple[SortiePart, ...]
    """Each vehicle's in the order of time."""
    uncovered: tuple[Id, ...]
    """Ids of the segments that nobody flies."""
    windows: tuple[DayLossPart, ...] = ()
    """Until when each vehicle must not be lost, where that was looked at."""
    ways: WaysPart = WaysPart()
    unreachable: Annotated[tuple[UnreachablePart, ...], Field(exclude_if=not_)] = ()
    """What was asked for and is not planned, because it lies in an area or behind one."""
    terrain: Annotated[PlanTerrain | None, Field(exclude_if=is_none)] = None
    """The ground that it was made over, where a raster knows it."""
    tracks: tuple[tuple[Place, Place], ...]
    """As in a plan file."""
    segments: tuple[PlanSegment, ...]
    """Last, for it is by far the longest."""

    @model_validator(mode="after")
    def _check_consistency(self) -> DayPlanDocument:
        bases, names = [base.name for base in self.bases], [vehicle.name for vehicle in self.vehicles]
        for key, own in (("bases", bases), ("vehicles", names), ("segments", [one.id for one in self.segments])):
            if len(set(own)) < len(own):
                raise ValueError(f"{key}: expected each once")
        if len(self.tracks) != len(self.segments):
            raise ValueError(f"tracks: expected {len(self.segments)}, got {len(self.tracks)}")
        if len(self.transfers_s) != len(bases) or any(len(row) != len(bases) for row in self.transfers_s):
            raise ValueError(f"transfers_s: expected {len(bases)} rows of {len(bases)}")
        return self

    @model_validator(mode="after")
    def _check_vehicles(self) -> DayPlanDocument:
        bases = [base.name for base in self.bases]
        for index, vehicle in enumerate(self.vehicles):
            for base in (vehicle.base, *vehicle.lands):
                _check_known(f"vehicles[{index}]", base, bases)
            if len(vehicle.pads) != len(bases):
                raise ValueError(f"vehicles[{index}].pads: expected {len(bases)}, got {len(vehicle.pads)}")
        return self

    @model_validator(mode="after")
    def _check_sorties(self) -> DayPlanDocument:
        known = {segment.id for segment in self.segments}
        bases, names = [base.name for base in self.bases], [vehicle.name for vehicle in self.vehicles]
        for index, one in enumerate(self.sorties):
            _check_known(f"sorties[{index}].vehicle", one.vehicle, names)
            for base in (one.base, one.lands):
                _check_known(f"sorties[{index}]", base, bases)
            for visit in one.visits:
                if visit.segment not in known:
                    raise ValueError(f"sorties[{index}].visits: expected ids of segments, got unknown {visit.segment}")
        for segment in self.uncovered:
            if segment not in known:
                raise ValueError(f"uncovered: expected ids of segments, got unknown {segment}")
        for index, window in enumerate(self.windows):
            _check_known(f"windows[{index}].vehicle", window.vehicle, names)
        return self


def _check_known(key: str, name: str, known: list[str]) -> None:
    if name not in known:
        raise ValueError(f"{key}: expected one of {', '.join(known)}, got {name}")


def is_day_plan(path: Path | str) -> bool:
    """Return whether a file calls itself a day plan."""
    try:
        with Path(path).open("rb") as file:
            return FORMAT.encode() in file.read(200)
    except OSError:
        return False  # whoever reads it says why


def write_day_plan(path: Path | str, content: DayPlanFile) -> None:
    """Write a day plan, as a whole or not at all.

    Raises:
        PlanFileError: a figure is NaN or infinite.
        OSError: the file cannot be written.
    """
    path = Path(path)
    document = build_day_plan_document(replace(content, source=str(path)))
    write_document(path, document)


def read_day_plan(path: Path | str) -> DayPlanFile:
    """Read a day plan.

    Raises:
        PlanFileError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    text = read_text(path, "day plan", PlanFileError)
    try:
        return _read_content(DayPlanDocument.model_validate_json(text), str(path))
    except ValidationError as error:
        raise PlanFileError(f"{path}: {format_first_error(error)}") from error
    except SafetyError as error:
        raise PlanFileError(f"{path}: ways.areas: {error}") from error
    except PlanError as error:
        raise PlanFileError(f"{path}: sorties: {error}") from error


def build_day_plan_document(content: DayPlanFile) -> dict[str, object]:
    """Return what a day plan says, as JSON has it.

    Raises:
        PlanFileError: a figure is NaN or infinite.
    """
    ids, names = [segment.id for segment in content.segments], [base.name for base in content.bases]
    models = [content.pricing.models[own.name] for own in content.vehicles]
    document = {
        "format": FORMAT,
        "depot": content.frame,
        "days": [{"begin_s": begin, "end_s": end} for begin, end in content.days],
        "stagger_s": content.stagger_s,
        "bases": [
            {
                "name": place.name, "lat_deg": place.lat_deg, "lon_deg": place.lon_deg, "alt_m": place.alt_m,
                "packs": base.packs, "turnaround_s": base.turnaround_s, "recharge_s": base.recharge_s,
            }
            for place, base in zip(content.places, content.bases, strict=True)
        ],
        "transfers_s": [[value if math.isfinite(value) else None for value in row]
                        for row in content.transfer_s.tolist()],
        "power": models[0].power,
        "vehicles": [
            {
                "name": own.name, "base": names[own.base], "lands": [names[base] for base in own.lands],
                "budget_pct": own.budget_pct, "consumption": own.consumption, "windows": own.windows,
                "pads": content.pads[row], "performance": models[row].performance, "pace": models[row].pace,
                "speed_m_s": models[row].inspection_speed_m_s,
                "transit_speed_m_s": models[row].transit_speed_m_s,
                "segments": _list_allowed_ids(content, own.name, ids),
                "step_m": content.pricing.steps_m.get(own.name, 0.0),
            }
            for row, own in enumerate(content.vehicles)
        ],
        "objective": content.objective.value,
        "finish_s": content.evaluation.finish_s,
        "flight_s": content.evaluation.flight_s,
        "seed": content.solved.seed, "solver": content.solved.solver, "seconds": content.solved.seconds,
        "sorties": _build_sorties(content, ids),
        "uncovered": [ids[segment] for segment in content.plan.uncovered],
        "windows": [
            {"vehicle": content.vehicles[one.vehicle].name, "from_s": one.from_s, "breaks": one.breaks}
            for one in content.windows
        ],
        "ways": build_ways(content.pricing),
        "unreachable": [
            {"segment": one.segment, "name": name, "why": one.why}
            for one, name in zip(content.unreachable, content.unreachable_names, strict=True)
        ],
        "terrain": content.terrain,
        "tracks": content.pricing.tracks_m.tolist(),
        "segments": content.segments,
    }  # fmt: skip
    try:
        return DayPlanDocument.model_validate(document, from_attributes=True).model_dump(mode="json", by_alias=True)
    except ValidationError as error:
        raise PlanFileError(f"{content.source}: {format_first_error(error)}") from error


def _build_sorties(content: DayPlanFile, ids: list[int]) -> list[dict[str, object]]:
    names = [base.name for base in content.bases]
    return [
        {
            "vehicle": own.name, "day": _day_of(content, one.start_s), "base": names[one.base],
            "lands": names[one.lands], "start_s": one.start_s,
            "duration_s": content.evaluation.lasts_s[row][number],
            "energy_pct": content.evaluation.energies_pct[row][number],
            "visits": [{"segment": ids[segment_of(visit)], "reversed": is_reversed(visit)}
                       for visit in one.visits],
        }
        for row, own in enumerate(content.vehicles) for number, one in enumerate(content.plan.sorties[row])
    ]  # fmt: skip


def _list_allowed_ids(content: DayPlanFile, vehicle: str, ids: list[int]) -> list[int] | None:
    barred = content.pricing.barred.get(vehicle)
    return None if not barred else [one for number, one in enumerate(ids) if number not in barred]


def _day_of(content: DayPlanFile, start_s: float) -> int:
    return next((day for day, (_, end) in enumerate(content.days, 1) if start_s < end), len(content.days))


def _read_content(document: DayPlanDocument, source: str) -> DayPlanFile:
    position = {segment.id: index for index, segment in enumerate(document.segments)}
    bases, names = [base.name for base in document.bases], [own.name for own in document.vehicles]
    power = SteadyWind(**dict(document.power))
    rows = [[one for one in document.sorties if one.vehicle == name] for name in names]
    pricing = Pricing(
        np.array(document.tracks, dtype=np.float64).reshape(-1, 2, 3),
        {own.name: own.pads[bases.index(own.base)] for own in document.vehicles},
        {own.name: FlightModel(own.performance, power, own.transit_speed_m_s, own.speed_m_s, own.pace)
         for own in document.vehicles},
        barred={own.name: frozenset(number for one, number in position.items() if one not in own.segments)
                for own in document.vehicles if own.segments is not None},
        steps_m={own.name: own.step_m for own in document.vehicles if own.step_m},
    )  # fmt: skip
    return DayPlanFile(
        frame=LocalFrame(**dict(document.depot)),
        segments=document.segments,
        pricing=add_ways(pricing, document.ways),
        places=tuple(BasePlace(base.name, base.lat_deg, base.lon_deg, base.alt_m) for base in document.bases),
        bases=tuple(
            SortieBase(base.name, base.turnaround_s, base.packs, base.recharge_s) for base in document.bases
        ),
        vehicles=tuple(
            SortieVehicle(
                own.name, bases.index(own.base), own.budget_pct, own.windows,
                tuple(bases.index(base) for base in own.lands), 0, own.consumption,
                document.days[0].begin_s,
            )
            for own in document.vehicles
        ),
        pads=tuple(own.pads for own in document.vehicles),
        days=tuple((day.begin_s, day.end_s) for day in document.days),
        transfer_s=np.array([[math.inf if value is None else value for value in row] for row in document.transfers_s]),
        stagger_s=document.stagger_s,
        plan=_read_sortie_plan(document, rows, position, bases),
        evaluation=SortieEvaluation(
            document.finish_s, document.flight_s, len(document.sorties),
            tuple(tuple(one.duration_s for one in own) for own in rows),
            tuple(tuple(one.energy_pct for one in own) for own in rows), (),
        ),
        objective=Objective(document.objective),
        solved=SolverRecord(to_printable(document.solver), document.seed, document.seconds),
        windows=tuple(LossWindow(names.index(one.vehicle), one.from_s, one.breaks) for one in document.windows),
        unreachable=tuple(Unreachable(one.segment, to_printable(one.why)) for one in document.unreachable),
        unreachable_names=tuple(to_printable(one.name) for one in document.unreachable),
        terrain=document.terrain,
        source=source,
    )  # fmt: skip


def _read_sortie_plan(
    document: DayPlanDocument, rows: list[list[SortiePart]], position: dict[int, int], bases: list[str]
) -> SortiePlan:
    def sortie(one: SortiePart) -> Sortie:
        visits = tuple(visit_of(position[visit.segment], visit.reversed) for visit in one.visits)
        return Sortie(bases.index(one.base), visits, bases.index(one.lands), one.start_s)

    uncovered = tuple(position[segment] for segment in document.uncovered)
    return SortiePlan(tuple(tuple(map(sortie, own)) for own in rows), uncovered)
