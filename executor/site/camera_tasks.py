"""From the site file's cameras and looks to what every segment asks for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from fnmatch import fnmatchcase
from types import MappingProxyType

from executor.errors import SiteError
from executor.site.site_file import Site
from executor.site.site_tables import LookTable
from missions import SafetyError
from missions.cameras import NO_LOOKS, Camera, CameraTasks, PylonCameraTask, SpanCameraTask, Trigger
from missions.network import Network
from missions.viewpoints import ViewpointRequest

SHORTEST_M = 0.5
"""Pictures nearer to each other than this are a mistake in the figures."""


def build_pylon_wishes(site: Site, network: Network) -> list[ViewpointRequest]:
    """Return from where pylons are to be seen.

    Raises:
        SiteError: a look is for no pylon, or asks for heights at which nobody would come down.
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
    """Return what is to be seen, and who has the cameras for it.

    Args:
        site: The site file's tables.
        network: With an asset for each pylon that is to be seen.
        pylons: These, by their segment.

    Raises:
        SiteError: a look that no vehicle, camera or speed can give, or that is for nothing.
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
