"""Build areas, places, bases and cameras of missions from a site's tables."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydantic import TypeAdapter, ValidationError

from executor.errors import SiteError
from executor.site.flight_keys import BaseTable
from executor.site.site_file import Site
from executor.site.site_keys import AreaTable, LookTable, Margin, OverGround, OverSea, Width
from missions import BasePlace, FlightSetup, LocalFrame, Network, Pad, SafetyError, parse_where, place_pads
from missions.cameras import NO_LOOKS, Camera, CameraTasks, PylonCameraTask, SpanCameraTask, Trigger
from missions.errors import AreaError
from missions.no_fly_areas import (
    Area,
    AreaKind,
    Ring,
    area_inside_m2,
    clip_outline,
    is_self_crossing,
    remove_double_corners,
    simplify_outline,
)
from missions.readers.area_files import FIGURES, FileArea, check_outline, read_areas
from missions.setup import put_pads_on_ground
from missions.terrain import Terrain
from missions.viewpoints import ViewpointRequest

NEAR_M = 20_000.0
"""Greatest distance of routes from lines and pads; areas are clipped there."""
BEYOND_M = 3000.0
"""Clipping margin: more than the largest area margin and half the widest corridor."""
MOST_CORNERS = 400
"""Most corners of all areas together; their route graph then takes a second."""
EASED_M = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Tolerances for simplifying outlines, smallest sufficient first; the margin grows by the one used."""
LEAST_M2 = 1.0
_RANGES = {
    "margin_m": TypeAdapter(Margin), "width_m": TypeAdapter(Width), "max_agl_m": TypeAdapter(OverGround),
    "max_amsl_m": TypeAdapter(OverSea),
}  # fmt: skip


def load_areas(site: Site, base: Path, network: Network) -> tuple[tuple[Area, ...], tuple[str, ...]]:
    """Return the areas near a site's lines, and in words which were left out or simplified.

    Raises:
        AreaError: one line that names the file, the feature and what was expected.
    """
    if not site.area:
        return (), ()
    stands_m = [network.frame.to_local_m(place.lat_deg, place.lon_deg) for place in site.place]
    known = np.concatenate((network.positions_m, np.array([(0.0, 0.0), *stands_m])))
    (west, south), (east, north) = known.min(axis=0) - NEAR_M, known.max(axis=0) + NEAR_M
    low, high = (float(west), float(south)), (float(east), float(north))
    near: list[Area] = []
    remarks: list[str] = []
    for index, table in enumerate(site.area):
        found = list(_read(table, index, base))
        placed = [area for one in found for area in _select_near_area(table, one, network.frame, low, high)]
        if not placed:
            remarks.append(
                f"areas: none of {_name_source(table, index)} is within {NEAR_M / 1000:g} km of the lines; are "
                "latitude and longitude swapped?"
            )
        near += placed
    tolerance_m = next((one for one in EASED_M if _count_corners(near, one) <= MOST_CORNERS), None)
    if tolerance_m is None:
        raise AreaError(
            f"area: expected at most {MOST_CORNERS} corners within {NEAR_M / 1000:g} km of the lines, found "
            f"{_count_corners(near, 0.0)}, and {_count_corners(near, EASED_M[-1])} when simplified by {EASED_M[-1]:g} "
            "m; where, layer, or a cut of the file choose which are needed"
        )
    if tolerance_m > 0:
        remarks.append(
            f"areas: {_count_corners(near, 0.0)} corners are simplified to {_count_corners(near, tolerance_m)}; "
            f"flights keep {tolerance_m:g} m more from them"
        )
    return tuple(_simplify_area(area, tolerance_m) for area in near), tuple(remarks)


def build_places(site: Site, frame: LocalFrame) -> tuple[tuple[Pad, ...], tuple[str, ...]]:
    """Return the pads of vehicles with a stated place, and the names of the alternates."""
    named = {place.name: place for place in site.place}
    pads = []
    for vehicle in site.vehicle:
        if vehicle.pad is not None:
            place = named[vehicle.pad]
            at_m = frame.to_local_m(place.lat_deg, place.lon_deg)
            pads.append(Pad(vehicle.name, *at_m, frame.alt_m if place.alt_m is None else place.alt_m))
    return tuple(pads), tuple(one.name for one in site.place if one.kind == "alternate")


def _read(table: AreaTable, index: int, base: Path) -> Iterator[FileArea]:
    if table.file is not None:
        layers = (table.layer,) if isinstance(table.layer, str) else table.layer
        where = () if table.where is None else parse_where(table.where)
        yield from read_areas(base / table.file, layers=layers, where=where)
        return
    place = _name_source(table, index)
    ring = table.polygon or table.line or ()
    if table.polygon is not None and ring[0] == ring[-1]:
        ring = ring[:-1]
    check_outline([ring], place, is_line=table.line is not None)
    yield FileArea(place, table.name or "", (ring,), table.line is not None, {})


def _name_source(table: AreaTable, index: int) -> str:
    return table.file if table.file is not None else f"area[{index}] {table.name!r}"


def _select_near_area(
    table: AreaTable, read: FileArea, frame: LocalFrame, low: tuple[float, float], high: tuple[float, float]
) -> Iterator[Area]:
    """Yield the nearby part of an area; for a corridor each nearby part of its line."""
    figures = {key: _read_figure(read, key, getattr(table, key)) for key in FIGURES}
    limited = figures["max_agl_m"] is not None or figures["max_amsl_m"] is not None
    rings = _to_rings_m(read, frame)
    name, margin_m = read.name or table.name or read.place.rsplit(": ", 1)[-1], figures["margin_m"] or 0.0
    if read.is_line:
        if figures["width_m"] is None or limited:
            raise AreaError(
                f"{read.place}: expected width_m and no height limit for a line, which is a corridor, in the site's "
                "[[area]] or the feature"
            )
        for part in _cut_near_parts(rings[0], low, high):
            yield Area(name, AreaKind.CORRIDOR, (part,), margin_m, figures["width_m"])
        return
    cut = [clip_outline(ring, low, high) for ring in rings]
    if len(cut[0]) >= 3:
        kept = (cut[0], *(ring for ring in cut[1:] if len(ring) >= 3))
        kind = AreaKind.HEIGHT_LIMIT if limited else AreaKind.NO_FLY
        yield Area(
            name, kind, kept, margin_m, max_agl_m=figures["max_agl_m"], max_amsl_m=figures["max_amsl_m"]
        )  # fmt: skip


def _to_rings_m(read: FileArea, frame: LocalFrame) -> list[Ring]:
    rings = []
    for ring_deg in read.rings_deg:
        corners = frame.many_to_local_m(np.array(ring_deg))
        if not np.isfinite(corners).all():
            raise AreaError(f"{read.place}: expected places on this side of the earth")
        ring: Ring = tuple((float(east_m), float(north_m)) for east_m, north_m in corners)
        ring = remove_double_corners(ring, closed=not read.is_line)
        if read.is_line and len(ring) < 2:
            raise AreaError(f"{read.place}: expected a line of at least 2 places, got one")
        if not read.is_line and (len(ring) < 3 or area_inside_m2(ring) < LEAST_M2):
            raise AreaError(f"{read.place}: expected an outline that encloses {LEAST_M2:g} m2 or more, got less")
        if not read.is_line and is_self_crossing(ring):
            raise AreaError(f"{read.place}: expected an outline that does not cross itself, got one that does")
        rings.append(ring)
    return rings


def _read_figure(read: FileArea, key: str, table_s: float | None) -> float | None:
    own = read.figures.get(key)
    if own is None:
        return table_s
    try:
        _RANGES[key].validate_python(own)
    except ValidationError as error:
        reason = error.errors(include_url=False)[0]["msg"].removeprefix("Input should be ")
        raise AreaError(f"{read.place}: {key}: expected {reason}, got {own:g}") from error
    return own


def _cut_near_parts(line: Ring, low: tuple[float, float], high: tuple[float, float]) -> Iterator[Ring]:
    part: list[tuple[float, float]] = []
    for begin, end in itertools.pairwise(line):
        near = all(
            min(begin[axis], end[axis]) <= high[axis] + BEYOND_M and max(begin[axis], end[axis]) >= low[axis] - BEYOND_M
            for axis in (0, 1)
        )
        if near:
            part = [*part, end] if part else [begin, end]
        elif part:
            yield tuple(part)
            part = []
    if part:
        yield tuple(part)


def _simplify_area(area: Area, tolerance_m: float) -> Area:
    rings = tuple(simplify_outline(ring, tolerance_m, closed=not area.is_line) for ring in area.rings_m)
    return replace(area, rings_m=rings, eased_m=tolerance_m if rings != area.rings_m else 0.0)


def _count_corners(areas: list[Area], tolerance_m: float) -> int:
    return sum(len(ring) for area in areas for ring in _simplify_area(area, tolerance_m).rings_m)


DEPOT = "depot"
"""Name of the single base of a site that names none."""
AT_DEPOT_M = 50.0
"""Distance within which a base is the depot."""


def base_tables(site: Site, frame: LocalFrame) -> tuple[BaseTable, ...]:
    """Return the bases of a site; the depot if it names none."""
    everybody = tuple(one.name for one in site.vehicle)
    depot = BaseTable(
        name=DEPOT, lat_deg=frame.lat_deg, lon_deg=frame.lon_deg, alt_m=frame.alt_m, vehicles=everybody
    )  # fmt: skip
    return site.base or (depot,)


def base_place(network: Network, base: BaseTable, terrain: Terrain | None = None) -> BasePlace:
    """Return a base in the form of plan files; a missing height comes from the raster, or the nearest pylon."""
    alt_m, at_m = base.alt_m, np.array(network.frame.to_local_m(base.lat_deg, base.lon_deg))
    if terrain is not None:
        alt_m = float(terrain.elevation.interpolate_m(at_m[np.newaxis])[0].round(1))
    elif alt_m is None:
        ends_m = network.ends_m.reshape(-1, 2)
        nearest = int(np.hypot(*(ends_m - at_m).T).argmin())
        segment = network.segments[nearest // 2]
        elevation_m = network.pylons[segment.b if nearest % 2 else segment.a].elevation_m
        alt_m = network.frame.alt_m if elevation_m is None else elevation_m
    return BasePlace(base.name, base.lat_deg, base.lon_deg, alt_m, base.turnaround_s, base.packs, base.recharge_s)


def base_places_m(site: Site, frame: LocalFrame) -> dict[str, tuple[float, float]]:
    """Return each vehicle's base, local east and north, by vehicle name; empty without bases."""
    return {name: frame.to_local_m(base.lat_deg, base.lon_deg) for base in site.base for name in base.vehicles}


def find_base_pads(site: Site, network: Network) -> dict[str, Pad]:
    """Return the centre of their pads for vehicles whose base is not the depot, by name."""
    return {
        name: Pad(name, *at_m, base_place(network, base).alt_m)
        for base in site.base
        if math.hypot(*(at_m := network.frame.to_local_m(base.lat_deg, base.lon_deg))) > AT_DEPOT_M
        for name in base.vehicles
    }


def place_day_pads(site: Site, setup: FlightSetup, areas: Sequence[Area]) -> dict[str, dict[str, Pad]]:
    """Return the pads of vehicles at bases other than their own, by vehicle and base name.

    Each has its own pad at each base: no two vehicles share one.

    Raises:
        SafetyError: there is no room for them around a base.
    """
    if site.day is None or site.day.lands == "own":
        return {}
    network, stands = setup.network, list(setup.pads)
    found: dict[str, dict[str, Pad]] = {}
    for base in site.base:
        names = {f"{one.name} {base.name}": one.name for one in site.vehicle if one.name not in base.vehicles}
        at_m = network.frame.to_local_m(base.lat_deg, base.lon_deg)
        place = Pad(base.name, *at_m, base_place(network, base, setup.terrain).alt_m)
        pads = place_pads(
            tuple(names), setup.tracks_m, layer_m=setup.layers.layer_m, alt_m=place.alt_m, stated=stands, areas=areas,
            bases=dict.fromkeys(names, place),
        )  # fmt: skip
        pads = pads if setup.terrain is None else put_pads_on_ground(pads, setup.terrain)
        stands += pads
        for pad in pads:
            found.setdefault(names[pad.vehicle], {})[base.name] = replace(pad, vehicle=names[pad.vehicle])
    return found


SHORTEST_M = 0.5
"""Least spacing of pictures; less is an input error."""


def build_viewpoint_requests(site: Site, network: Network) -> list[ViewpointRequest]:
    """Return the requested viewpoints around pylons.

    Raises:
        SiteError: a look is for no pylon, or asks for heights at which no vehicle would descend.
    """
    wishes = []
    for index, table in enumerate(site.look):
        if table.of != "pylons":
            continue
        _check_heights(site, index, table)
        sides = [table.bearings_deg] + ([tuple(-one for one in table.bearings_deg[::-1])] if table.both_sides else [])
        asked = table.model_dump(include={one.name for one in fields(ViewpointRequest)})
        asked["bearings_deg"] = tuple(one for side in sides for one in side)
        known = [
            ViewpointRequest(pylon=number, **asked)
            for number, pylon in enumerate(network.pylons)
            if any(fnmatchcase(pylon.id, pattern) for pattern in table.pylons)
        ]
        if not known:
            raise SiteError(f"look[{index}].pylons: expected names of pylons, nothing is called {table.pylons[0]!r}")
        wishes += known
    return wishes


def _check_heights(site: Site, index: int, table: LookTable) -> None:
    if table.heights_m and not site.inspection.same_distance:
        raise SiteError(
            f"look[{index}].heights_m: expected inspection.same_distance = true, or vehicles never leave their layers"
        )
    highest_m = max(table.heights_m, default=0.0)
    if highest_m > site.inspection.height_m:
        raise SiteError(
            f"look[{index}].heights_m: expected at most inspection.height_m, {site.inspection.height_m:g}, got "
            f"{highest_m:g}"
        )


def build_looks(
    site: Site, network: Network, pylons: Mapping[int, PylonCameraTask] = MappingProxyType({})
) -> CameraTasks:
    """Return the camera tasks, and which vehicles carry the cameras for them.

    Args:
        site: Tables of the site file.
        network: Network with an asset for each pylon with viewpoints.
        pylons: These pylons, by segment.

    Raises:
        SiteError: no vehicle, camera or speed can do a look, or it applies to nothing.
    """
    if not site.look:
        return NO_LOOKS
    cameras = {table.name: Camera(**table.model_dump(exclude={"vehicles"})) for table in site.camera}
    names = [vehicle.name for vehicle in site.vehicle]
    carriers = {
        name: frozenset(table.name for table in site.camera if not table.vehicles or name in table.vehicles)
        for name in names
    }
    spans: dict[int, list[SpanCameraTask]] = {}
    for index, table in enumerate(site.look):
        if table.of == "pylons":
            continue
        look = _build_look(site, index, table, cameras[table.camera])
        wanted = [
            one.id
            for one in network.segments
            if one.id not in pylons
            and any(fnmatchcase(network.segment_name(one.id), pattern) for pattern in table.segments)
        ]
        if not wanted:
            raise SiteError(f"look[{index}].segments: expected names of spans, nothing is called {table.segments[0]!r}")
        for segment in wanted:
            spans.setdefault(segment, []).append(look)
    looks = CameraTasks(cameras, carriers, {segment: tuple(own) for segment, own in sorted(spans.items())}, pylons)
    _check_looks(looks, names, network)
    return looks


def _build_look(site: Site, index: int, table: LookTable, camera: Camera) -> SpanCameraTask:
    inspection = site.inspection
    layers_m = inspection.layer_m * (len(site.vehicle) - 1)
    nearest_m, farthest_m = (
        math.hypot(inspection.standoff_m, inspection.height_m + more_m) for more_m in (0.0, layers_m)
    )
    try:
        if table.sample_mm is not None:
            sample_mm = 1000.0 * camera.ground_sample_m(farthest_m)
            if sample_mm > table.sample_mm:
                raise SiteError(
                    f"look[{index}].sample_mm: expected {sample_mm:.1f} or more, what camera '{camera.name}' shows of "
                    f"the line in a pixel from the highest layer, {farthest_m:.0f} m away, got {table.sample_mm:g}"
                )
        if table.take == "video":
            return SpanCameraTask(camera.name, Trigger.VIDEO, 0.0, table.pitch_deg, table.aim_deg)
        every_m = table.every_m
        if every_m is None:
            every_m = camera.footprint_m(nearest_m)[1] * (1.0 - (table.overlap_pct or 0.0) / 100.0)
    except SafetyError as error:
        raise SiteError(f"look[{index}]: {error}") from error
    every_m = round(every_m, 1)
    if every_m < SHORTEST_M:
        raise SiteError(f"look[{index}]: expected pictures {SHORTEST_M:g} m apart or more, got {every_m:g} m")
    fastest_m_s = every_m / camera.least_interval_s
    if inspection.speed_m_s > fastest_m_s:
        raise SiteError(
            f"inspection.speed_m_s: expected at most {fastest_m_s:.1f}, at which camera '{camera.name}' takes a "
            f"picture every {every_m:g} m (look[{index}]), got {inspection.speed_m_s:g}"
        )
    return SpanCameraTask(camera.name, Trigger(table.trigger), every_m, table.pitch_deg, table.aim_deg)


def _check_looks(looks: CameraTasks, names: list[str], network: Network) -> None:
    barred = [looks.find_barred_segments(name) for name in names]
    for segment in (*looks.spans, *looks.pylons):
        name, own = network.segment_name(segment), looks.spans.get(segment, ())
        if all(segment in one for one in barred):
            wanted = " and ".join(f"'{camera}'" for camera in sorted(looks.cameras_for(segment)))
            raise SiteError(f"look: {name}: expected a vehicle that carries camera {wanted}, none does")
        spaces = {look.every_m for look in own if look.trigger is Trigger.DISTANCE}
        if len(spaces) > 1:
            given = " and ".join(f"{space_m:g}" for space_m in sorted(spaces))
            raise SiteError(
                f"look: {name}: expected one distance between pictures, got {given} m: an autopilot triggers all of "
                "its cameras at once"
            )
