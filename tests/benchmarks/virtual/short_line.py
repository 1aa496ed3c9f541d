"""A short line to fly: ten spans of 40 m in a file, over ground that rises a little."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.virtual_site import build_virtual_site
from executor.site.site_model import SiteModel
from missions import PlanFile
from tests.missions.builders import FRAME

SPAN_M = 40.0


def write_line(path: Path, pylons: int = 11) -> Path:
    """Write it as GeoJSON."""
    places = [FRAME.to_wgs84_deg(SPAN_M * number, 30.0) for number in range(1, pylons + 1)]
    points = [[round(lon, 7), round(lat, 7)] for lat, lon in places]
    depot = {"role": "depot", "elevation_m": FRAME.alt_m}
    features = [_feature("Point", [FRAME.lon_deg, FRAME.lat_deg], depot)]
    for number, point in enumerate(points):
        features.append(_feature("Point", point, {"id": f"p{number}", "elevation_m": 450.0 + number, "height_m": 10.0}))
    features.append(_feature("LineString", points, {"id": "line"}))
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return path


def _feature(kind: str, places: object, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": places}, "properties": properties}


def short_ground(folder: Path, vehicles: int, autopilot: str) -> SiteModel:
    """Return a site over it."""
    return build_virtual_site(write_line(folder / "line.geojson"), None, vehicles, autopilot)


def shared(ground: SiteModel) -> PlanFile:
    """Return a plan in which every vehicle has a run of two segments."""
    from benchmarks.prediction import plan_with

    return plan_with(ground, {name: (4 * number, 4 * number + 2) for number, name in enumerate(ground.names)})
