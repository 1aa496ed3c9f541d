"""Build the page's view of a site: its network, its surroundings, and its problems.

All places are latitude and longitude. This runs in a worker: a network of thousands of spans takes seconds.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

import missions
from executor.errors import ExecutorError, SiteError
from executor.plan_page.site_problems import SiteProblem, check_text, describe_error, describe_problem
from executor.site import site_model, site_parts
from executor.site.ground_view import encode_ground, view_for
from executor.site.site_file import Site
from executor.site.site_keys import DepotTable, NetworkTable
from executor.site.site_model import SiteModel
from missions import LocalFrame, MissionsError
from missions.files import json_text, stamp_file
from missions.geo import FloatArray
from missions.no_fly_areas import Area

Place = tuple[float, float]
"""Latitude and longitude in degrees."""
FIGURES = 7
"""Decimals of a degree: one centimetre."""
MOST_FOOTPRINTS = 2000


@dataclass(frozen=True, slots=True)
class SiteView:
    """View of a site for the page."""

    problems: list[SiteProblem]
    network: bytes | None = None
    """JSON; None if the file cannot be read."""
    digest: str = ""
    """Fingerprint of the network."""
    segments: int = 0
    ground: bytes = b"{}"
    """JSON."""
    background: Mapping[str, bytes] = field(default_factory=dict)
    """Files by name."""


def understand_site(text: str, folder: Path) -> tuple[SiteView, SiteModel | None]:
    """Return the page's view of a site, and the site if it can be planned.

    Args:
        text: The site file.
        folder: Folder that its paths are relative to.
    """
    values, site, problems = check_text(text)
    ground: SiteModel | None = None
    understood, found = _import_network(values, folder)
    if site is not None and understood is not None:
        try:
            ground = site_model.load_site_model(site, folder, understood=understood)
        except (MissionsError, ExecutorError) as error:
            found = [describe_error(error, values)]
    problems = [*problems, *found]
    if understood is None:
        return SiteView(_name_files(problems, folder)), ground
    network = json_text(_describe_network(understood, ground), (",", ":")).encode()
    frame = understood.network.frame if ground is None else ground.network.frame
    has_depot = understood.has_depot or ground is not None
    around = json_text(_describe_ground(values, site, ground, frame, folder, has_depot=has_depot), (",", ":")).encode()
    background: Mapping[str, bytes] = {}
    if ground is not None:
        try:
            background = _encode_background_once(ground, folder)
        except (MissionsError, ExecutorError) as error:
            problems.append(describe_error(error, values))
    digest = sha256(network).hexdigest()[:16]
    network = b'{"digest":"' + digest.encode() + b'",' + network[1:]
    problems = _name_files(problems, folder)
    return SiteView(problems, network, digest, len(understood.network.segments), around, background), ground


def _name_files(problems: Sequence[SiteProblem], folder: Path) -> list[SiteProblem]:
    """Return problems with file names as in the site file."""
    return [SiteProblem(path=one["path"], message=one["message"].replace(f"{folder}{os.sep}", "")) for one in problems]


_backgrounds: dict[bytes, Mapping[str, bytes]] = {}
"""Cache of the last background: encoding takes seconds, and most edits do not change it."""


def _encode_background_once(ground: SiteModel, folder: Path) -> Mapping[str, bytes]:
    stated = ground.site.map
    file = None if stated is None or stated.background is None else folder / stated.background
    heights = None if ground.terrain is None else ground.terrain.elevation.digest
    pads = [(pad.east_m, pad.north_m) for pad in ground.setup.pads]
    told = repr((stated, file, file and stamp_file(file), heights, pads, ground.network.frame))
    key = sha256(told.encode() + ground.network.positions_m.tobytes()).digest()
    if key not in _backgrounds:
        made = encode_ground(view_for(ground, folder), ground.network.frame)
        _backgrounds.clear()
        _backgrounds[key] = made
    return _backgrounds[key]


def _import_network(values: Mapping[str, Any], folder: Path) -> tuple[missions.NetworkImport | None, list[SiteProblem]]:
    """Return the network if its own tables can be used, whatever is wrong with the others."""
    try:
        table = NetworkTable.model_validate(values.get("network"))
        depot = None if "depot" not in values else DepotTable.model_validate(values["depot"])
    except ValidationError:
        return None, []  # reported for the whole site
    try:
        return import_network_once(table, depot, folder), []
    except MissionsError as error:
        return None, [describe_error(error, values)]


def import_network_once(table: NetworkTable, depot: DepotTable | None, folder: Path) -> missions.NetworkImport:
    """Return a site's network, with or without a known depot; read again only when it has changed.

    Raises:
        NetworkError: it cannot be used.
    """
    read = table.model_copy(update={"only": (), "leave_out": (), "tallest_m": None, "pylon_height_m": None})
    return _import_once(read, depot, folder, stamp_file(folder / table.file))


@lru_cache(maxsize=2)
def _import_once(
    table: NetworkTable, depot: DepotTable | None, folder: Path, _: tuple[int, int] | None
) -> missions.NetworkImport:
    return site_model.import_site_network(table, depot, folder, anywhere=True)


def _describe_network(understood: missions.NetworkImport, ground: SiteModel | None) -> dict[str, object]:
    network = understood.network if ground is None else ground.network
    why = {} if ground is None else {network.segment_name(one.segment): one.why for one in ground.setup.unreachable}
    left_out = frozenset[int]() if ground is None else ground.left_out
    places = [_round_place((pylon.lat_deg, pylon.lon_deg)) for pylon in network.pylons]
    lengths_m = network.lengths_m.tolist()
    lat_deg, lon_deg, alt_m = network.depot
    remarks = site_model.describe_remarks(understood.found) if ground is None else ground.worth_a_look
    return {
        "source": understood.network.source,
        "format": understood.format,
        "crs": understood.crs,
        "has_depot": understood.has_depot or ground is not None,
        "frame": {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m},
        "segments": [
            {
                "id": one.id, "name": (name := network.segment_name(one.id)), "a": places[one.a], "b": places[one.b],
                "line": understood.lines.get(one.label, ""), "length_m": round(lengths_m[one.id], 1),
                "left_out": one.id in left_out, "unreachable": why.get(name),
            }
            for one in network.segments
        ],
        "pylons": [
            {"name": pylon.id, "place": place, "height_m": pylon.height_m, "elevation_m": pylon.elevation_m}
            for pylon, place in zip(network.pylons, places, strict=True)
        ],
        "remarks": list(remarks),
    }  # fmt: skip


def _describe_ground(
    values: Mapping[str, Any], site: Site | None, ground: SiteModel | None, frame: LocalFrame, folder: Path,
    *, has_depot: bool,
) -> dict[str, object]:  # fmt: skip
    pads = () if ground is None else ground.setup.pads
    places = [] if site is None else [
        {"name": one.name, "kind": one.kind, "place": _round_place((one.lat_deg, one.lon_deg))} for one in site.place
    ]  # fmt: skip
    return {
        "depot": _round_place((frame.lat_deg, frame.lon_deg)) if has_depot else None,
        "pads": [{"vehicle": one.vehicle, "place": to_place(frame, (one.east_m, one.north_m))} for one in pads],
        "bases": [] if site is None else [
            {"name": one.name, "place": _round_place((one.lat_deg, one.lon_deg)), "vehicles": one.vehicles}
            for one in site.base
        ],
        "places": places,
        "alternates": [one for one in places if one["kind"] == "alternate"],
        "areas": list(_describe_areas(values) if ground is None else _describe_site_areas(ground, folder)),
        "footprints": [] if ground is None else list(_describe_footprints(ground)),
    }  # fmt: skip


def _describe_site_areas(ground: SiteModel, folder: Path) -> Iterator[dict[str, object]]:
    """Yield the areas of each table, as read."""
    for index, table in enumerate(ground.site.area):
        one = ground.site.model_copy(update={"area": (table,)})
        for area in site_parts.load_areas(one, folder, ground.network)[0]:
            rings = _list_rings(area, ground.network.frame)
            yield {
                "index": index, "name": area.name, "kind": area.kind.value, "rings": rings,
                "margin_m": area.margin_m, "from_file": table.file is not None,
            }  # fmt: skip


def _list_rings(area: Area, frame: LocalFrame) -> list[list[Place]]:
    rings = area.polygons_m() if area.is_line else area.rings_m
    return [to_places(frame, np.array(ring)) for ring in rings]


def _describe_areas(values: Mapping[str, Any]) -> Iterator[dict[str, object]]:
    """Yield the areas written in a site file that cannot be used yet."""
    for index, table in enumerate(values.get("area", ())):
        for key in ("polygon", "line"):
            ring = table.get(key) if isinstance(table, dict) else None
            if isinstance(ring, list) and all(isinstance(one, list) and len(one) == 2 for one in ring):
                yield {
                    "index": index, "name": table.get("name"), "kind": "no-fly" if key == "polygon" else "corridor",
                    "rings": [ring], "margin_m": table.get("margin_m"), "from_file": False,
                }  # fmt: skip


def _describe_footprints(ground: SiteModel) -> Iterator[dict[str, object]]:
    """Yield the footprint of one picture in the middle of each span, if its camera is specified."""
    inspection, frame = ground.inspection, ground.setup.frame
    distance_m = math.hypot(inspection.standoff_m, inspection.height_m)
    for segment, looks in list(ground.setup.looks.spans.items())[:MOST_FOOTPRINTS]:
        for look in looks:
            camera = ground.setup.looks.cameras[look.camera]
            if camera.focal_mm is None or camera.sensor_mm is None:
                continue
            across_m, along_m = camera.footprint_m(distance_m)
            begin, end = ground.network.ends_m[segment]
            along = (end - begin) / max(1e-9, float(np.hypot(*(end - begin))))
            across = np.array([-along[1], along[0]])
            sides = ((1, 1), (1, -1), (-1, -1), (-1, 1))
            ring = [
                (begin + end) / 2 + along * along_m / 2 * one + across * across_m / 2 * other for one, other in sides
            ]
            yield {
                "segment": segment, "camera": camera.name, "every_m": look.every_m,
                "ring": to_places(frame, np.array(ring)),
            }  # fmt: skip


def to_place(frame: LocalFrame, at_m: Sequence[float]) -> Place:
    """Return the latitude and longitude of a place in local metres."""
    return _round_place(frame.to_wgs84_deg(at_m[0], at_m[1]))


def to_places(frame: LocalFrame, at_m: FloatArray) -> list[Place]:
    """Return the latitudes and longitudes of (n, 2) places in local metres."""
    return [_round_place((lat_deg, lon_deg)) for lat_deg, lon_deg in frame.many_to_wgs84_deg(at_m).tolist()]


def _round_place(place: Place) -> Place:
    return round(place[0], FIGURES), round(place[1], FIGURES)


def stamp_files(values: Mapping[str, Any], folder: Path) -> Sequence[object]:
    """Return a fingerprint of the files that a site names."""
    named: list[object] = []
    for table, key in (("network", "file"), ("terrain", "files"), ("map", "background"), ("area", "file")):
        tables = values.get(table)
        for one in tables if isinstance(tables, list) else [tables]:
            files = one.get(key) if isinstance(one, dict) else None
            named += files if isinstance(files, list) else [files]
    known = [one for one in named if isinstance(one, str)]
    return [part for one in known if (stamp := stamp_file(folder / one)) is not None for part in (one, *stamp)]


SiteKey = tuple[str, Path, tuple[object, ...]]
"""Text of the site file, its folder, and the times of the files that it names."""
_known: dict[SiteKey, SiteModel] = {}
"""The last usable site."""


def read_site_view(text: str, folder: Path) -> SiteView:
    """Return the page's view of a site, and cache the site for later questions."""
    key = find_site_key(text, folder)
    view, ground = understand_site(text, folder)
    _known.clear()
    if ground is not None:
        _known[key] = ground
    return view


def find_site_key(text: str, folder: Path) -> SiteKey:
    """Return a key that changes whenever the site may have changed."""
    return text, folder, tuple(stamp_files(check_text(text)[0], folder))


def read_site_model(text: str, folder: Path) -> SiteModel:
    """Return a site to plan for.

    Raises:
        SiteError: it cannot be used; reports the first of its problems.
    """
    key = find_site_key(text, folder)
    if key not in _known:
        view = read_site_view(text, folder)
        if key not in _known:
            raise SiteError(describe_problem(view.problems[0]))
    return _known[key]
