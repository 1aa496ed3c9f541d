"""The plan file on disk: JSON, ``faultline-plan/1``.

Figures are written as Python prints a float, so reading a file gives back exactly what was written.
"""

from __future__ import annotations

import errno
import json
import os
import re
from dataclasses import replace
from pathlib import Path

from missions.errors import PlanFileError, SafetyError
from missions.fields import Fields, printable
from missions.files import NESTED, parse_json, read_text, write_whole
from missions.geo import LocalFrame
from missions.planfile import WINDOW_COST, PlanFile, PlanSegment, Solved, Window
from missions.setup import Inspection
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

FORMAT = "faultline-plan/1"

MOST_SEED = 2**31 - 1
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
"""Of a vehicle, as in a site file; files are named after it."""
SLOWEST_M_S = 0.001
_INSPECTION_KEYS = ("height_m", "standoff_m", "speed_m_s", "transit_speed_m_s", "layer_m")
_CEILINGS = ("ceiling_m", "return_ceiling_m")
FLAT, KNOWN = "flat", "known"
"""What ``inspection.heights`` may say."""


def write_plan(path: Path | str, plan_file: PlanFile) -> None:
    """Write a plan file, as a whole or not at all: a reader never sees half of one.

    Raises:
        PlanFileError: a figure is NaN or infinite.
        OSError: the file cannot be written.
    """
    path = Path(path)
    try:
        text = json.dumps(plan_document(plan_file), indent=1, allow_nan=False) + "\n"
    except ValueError as error:
        raise PlanFileError(f"{path}: expected finite figures only: {error}") from error
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    write_whole(path, text.encode())


def read_plan(path: Path | str) -> PlanFile:
    """Read a plan file.

    Raises:
        PlanFileError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    document = parse_json(read_text(path, "plan file", PlanFileError), str(path), PlanFileError)
    if not isinstance(document, dict):
        raise PlanFileError(f"{path}: content: expected a JSON object")
    try:
        return _parsed(Fields(document, str(path), PlanFileError))
    except RecursionError:
        raise PlanFileError(f"{path}: content: {NESTED}") from None


def plan_document(content: PlanFile) -> dict[str, object]:
    """Return what a plan file says, as JSON has it."""
    ids = [segment.id for segment in content.segments]
    document: dict[str, object] = {
        "format": FORMAT,
        "depot": {"lat_deg": content.frame.lat_deg, "lon_deg": content.frame.lon_deg, "alt_m": content.frame.alt_m},
        "travel": {
            "transit_speed_m_s": content.travel.transit_speed_m_s,
            "inspection_speed_m_s": content.travel.inspection_speed_m_s,
            "transit_pct_per_s": content.travel.transit_pct_per_s,
            "inspection_pct_per_s": content.travel.inspection_pct_per_s,
            "dynamics": None if content.travel.dynamics is None else {
                "acceleration_m_s2": content.travel.dynamics.acceleration_m_s2,
                "yaw_rate_rad_s": content.travel.dynamics.yaw_rate_rad_s,
            },
            "wind": None if content.travel.wind is None else {
                "east_m_s": content.travel.wind.east_m_s,
                "north_m_s": content.travel.wind.north_m_s,
                "airspeed_m_s": list(content.travel.wind.airspeed_m_s),
                "pct_per_s": list(content.travel.wind.pct_per_s),
            },
        },
        "vehicles": [
            {
                "name": vehicle.name, "start": list(vehicle.start_m), "budget_pct": vehicle.budget_pct,
                "consumption": vehicle.consumption, "airborne": vehicle.airborne,
            }
            for vehicle in content.vehicles
        ],
        "routes": [
            {
                "vehicle": content.vehicles[route.vehicle].name,
                "visits": [
                    {"segment": ids[segment_of(visit)], "reversed": is_reversed(visit)} for visit in route.visits
                ],
                "duration_s": duration_s,
                "energy_pct": energy_pct,
            }
            for route, duration_s, energy_pct in zip(
                content.plan.routes, content.durations_s, content.energies_pct, strict=True
            )
        ],
        "uncovered": [ids[segment] for segment in content.plan.uncovered],
        "cost": {"name": content.cost_name, "value": content.cost_value},
        "seed": content.solved.seed,
        "solver": content.solved.solver,
        "seconds": content.solved.seconds,
    }  # fmt: skip
    if content.window is not None:
        document["window"] = {
            "window_pct": content.window.window_pct,
            "earliest_s": content.window.earliest_s,
            "longest_route_s": content.window.longest_route_s,
        }
    if content.inspection is not None:
        document["inspection"] = _inspection_document(content.inspection)
    # Last, for it is by far the longest.
    document["segments"] = [_segment_document(segment) for segment in content.segments]
    return document


def _inspection_document(inspection: Inspection) -> dict[str, object]:
    figures = {key: getattr(inspection, key) for key in (*_INSPECTION_KEYS, *_CEILINGS)}
    return {**figures, "heights": FLAT if inspection.flat else KNOWN}


def _segment_document(segment: PlanSegment) -> dict[str, object]:
    return {
        "id": segment.id,
        **({"name": segment.name} if segment.name else {}),
        "a": list(segment.a_enu_m),
        "b": list(segment.b_enu_m),
        "a_lat_lon_deg": list(segment.a_lat_lon_deg),
        "b_lat_lon_deg": list(segment.b_lat_lon_deg),
        "pylons": list(segment.pylons),
        "length_m": segment.length_m,
        "elevation_m": list(segment.elevation_m),
        "height_m": list(segment.height_m),
    }


def _parsed(fields: Fields) -> PlanFile:
    if fields.content.get("format") != FORMAT:
        raise fields.fail("format", repr(FORMAT))
    segments = tuple(_parsed_segment(entry) for entry in fields.each("segments"))
    position: dict[int, int] = {}
    for index, segment in enumerate(segments):
        if position.setdefault(segment.id, index) != index:
            raise PlanFileError(f"{fields.source}: segments[{index}].id: expected an id of its own, got {segment.id}")
    vehicles = _parsed_vehicles(fields)
    routes, durations_s, energies_pct = _parsed_routes(fields, vehicles, position)
    uncovered = fields.integers("uncovered")
    unknown = [segment for segment in uncovered if segment not in position]
    if unknown:
        raise PlanFileError(f"{fields.source}: uncovered: expected ids of segments, got unknown {unknown[0]}")
    cost = fields.inner("cost")
    names = [*(known.value for known in Cost), WINDOW_COST]
    if cost.content.get("name") not in names:
        raise cost.fail("name", f"one of {', '.join(names)}")
    window = _parsed_window(fields.optional_inner("window"))
    if cost.text("name") == WINDOW_COST and window is None:
        raise fields.fail("window", "the window that the plan was chosen by")
    try:
        plan = Plan(routes, tuple(position[segment] for segment in uncovered))
    except PlanError as error:
        raise PlanFileError(f"{fields.source}: routes: expected every segment at most once: {error}") from error
    return PlanFile(
        frame=_parsed_frame(fields.inner("depot")),
        segments=segments,
        vehicles=vehicles,
        travel=_parsed_travel(fields.inner("travel")),
        plan=plan,
        durations_s=durations_s,
        energies_pct=energies_pct,
        cost=None if cost.text("name") == WINDOW_COST else Cost(cost.text("name")),
        cost_value=cost.number("value"),
        solved=Solved(printable(fields.text("solver")), _parsed_seed(fields), fields.number("seconds")),
        window=window,
        inspection=_parsed_inspection(fields.optional_inner("inspection")),
        source=fields.source,
    )


def _parsed_seed(fields: Fields) -> int:
    seed = fields.integer("seed")
    if not 0 <= seed <= MOST_SEED:
        raise fields.fail("seed", f"0 to {MOST_SEED}")
    return seed


def _parsed_segment(fields: Fields) -> PlanSegment:
    a_m, b_m = fields.numbers("a", 3), fields.numbers("b", 3)
    a_deg, b_deg = fields.numbers("a_lat_lon_deg", 2), fields.numbers("b_lat_lon_deg", 2)
    pylons = fields.texts("pylons", 2)
    number = fields.integer("id")
    if number < 0:
        raise fields.fail("id", "0 or a greater number")
    elevation_m, height_m = fields.optional_numbers("elevation_m", 2), fields.optional_numbers("height_m", 2)
    return PlanSegment(
        id=number,
        name="" if fields.content.get("name") is None else fields.text("name"),
        a_enu_m=(a_m[0], a_m[1], a_m[2]),
        b_enu_m=(b_m[0], b_m[1], b_m[2]),
        a_lat_lon_deg=(a_deg[0], a_deg[1]),
        b_lat_lon_deg=(b_deg[0], b_deg[1]),
        pylons=(pylons[0], pylons[1]),
        length_m=fields.number("length_m"),
        elevation_m=(elevation_m[0], elevation_m[1]),
        height_m=(height_m[0], height_m[1]),
    )


def _parsed_vehicles(fields: Fields) -> tuple[Vehicle, ...]:
    vehicles: list[Vehicle] = []
    for entry in fields.each("vehicles"):
        name = entry.text("name")
        if not NAME.fullmatch(name):
            raise entry.fail("name", "a letter, then letters, digits, - and _ only, 32 at most")
        if name in [vehicle.name for vehicle in vehicles]:
            raise entry.fail("name", "a name that no other vehicle has")
        east_m, north_m = entry.numbers("start", 2)
        consumption = entry.optional_number("consumption")
        vehicles.append(
            Vehicle(
                name=name,
                start_m=(east_m, north_m),
                budget_pct=entry.number("budget_pct"),
                consumption=1.0 if consumption is None else consumption,
                airborne=entry.flag("airborne", default=False),
            )
        )
    if not vehicles:
        raise fields.fail("vehicles", "at least one vehicle")
    return tuple(vehicles)


def _parsed_routes(
    fields: Fields, vehicles: tuple[Vehicle, ...], position: dict[int, int]
) -> tuple[tuple[Route, ...], tuple[float, ...], tuple[float, ...]]:
    entries = list(fields.each("routes"))
    names = [entry.text("vehicle") for entry in entries]
    if names != [vehicle.name for vehicle in vehicles]:
        expected = ", ".join(vehicle.name for vehicle in vehicles)
        raise PlanFileError(f"{fields.source}: routes: expected one each for {expected}, in that order")
    routes = tuple(Route(number, _parsed_visits(entry, position)) for number, entry in enumerate(entries))
    durations_s = tuple(entry.number("duration_s") for entry in entries)
    return routes, durations_s, tuple(entry.number("energy_pct") for entry in entries)


def _parsed_visits(fields: Fields, position: dict[int, int]) -> tuple[int, ...]:
    visits: list[int] = []
    for entry in fields.each("visits"):
        segment = entry.integer("segment")
        if segment not in position:
            raise entry.fail("segment", "the id of a segment")
        visits.append(visit_of(position[segment], entry.flag("reversed")))
    return tuple(visits)


def _parsed_frame(fields: Fields) -> LocalFrame:
    try:
        return LocalFrame(fields.number("lat_deg"), fields.number("lon_deg"), fields.number("alt_m"))
    except ValueError as error:
        raise PlanFileError(f"{fields.source}: depot: {error}") from error


def _parsed_travel(fields: Fields) -> Travel:
    for key in ("transit_speed_m_s", "inspection_speed_m_s"):
        if fields.number(key) < SLOWEST_M_S:
            raise fields.fail(key, f"{SLOWEST_M_S:g} m/s or more")
    dynamics, wind = fields.optional_inner("dynamics"), fields.optional_inner("wind")
    try:
        return Travel(
            fields.number("transit_speed_m_s"),
            fields.number("inspection_speed_m_s"),
            fields.number("transit_pct_per_s"),
            fields.number("inspection_pct_per_s"),
            None if dynamics is None else Dynamics(
                dynamics.number("acceleration_m_s2"), dynamics.number("yaw_rate_rad_s")
            ),
            None if wind is None else SteadyWind(
                wind.number("east_m_s"), wind.number("north_m_s"),
                wind.numbers("airspeed_m_s"), wind.numbers("pct_per_s"),
            ),
        )  # fmt: skip
    except InstanceError as error:
        raise PlanFileError(f"{fields.source}: travel: {error}") from error


def _parsed_window(fields: Fields | None) -> Window | None:
    if fields is None:
        return None
    return Window(fields.number("window_pct"), fields.number("earliest_s"), fields.number("longest_route_s"))


def _parsed_inspection(fields: Fields | None) -> Inspection | None:
    if fields is None:
        return None
    heights = fields.content.get("heights", KNOWN)
    if heights not in {FLAT, KNOWN}:
        raise fields.fail("heights", f"{FLAT!r} or {KNOWN!r}")
    figures = {key: fields.number(key) for key in _INSPECTION_KEYS}
    ceilings = {key: fields.number(key) for key in _CEILINGS if fields.content.get(key) is not None}
    try:
        return replace(Inspection(**figures, flat=heights == FLAT), **ceilings)  # type: ignore[arg-type]
    except SafetyError as error:
        raise PlanFileError(f"{fields.source}: {error}") from error
