"""A network as GeoJSON that is read back to the same network, whatever file it came from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from missions.network import Pylon
from missions.readers.geojson import FLAT
from missions.readers.network_import import NetworkImport


def build_network_document(understood: NetworkImport) -> dict[str, object]:
    """Return a FeatureCollection of the depot, where there is one, all pylons and all segments.

    A segment is a LineString with the ids of its pylons, so that it stays one whatever it passes.
    """
    document: dict[str, object] = {"type": "FeatureCollection", "features": list(_build_features(understood))}
    # The site may claim so as well; what is known by the file's format would be lost.
    return {**document, FLAT: True} if understood.network.flat else document


def _build_features(understood: NetworkImport) -> Iterator[dict[str, object]]:
    network = understood.network
    if understood.has_depot:
        lat_deg, lon_deg, alt_m = network.depot
        known = alt_m or any(pylon.elevation_m is not None for pylon in network.pylons)
        heights = {"elevation_m": alt_m} if known else {}
        yield _build_feature("Point", [lon_deg, lat_deg], {"role": "depot", **heights})
    for pylon in network.pylons:
        figures = {"elevation_m": pylon.elevation_m, "height_m": pylon.height_m}
        heights = {key: value for key, value in figures.items() if value is not None}
        yield _build_feature("Point", _to_coordinates(pylon), {"id": pylon.id, **heights})
    for segment in network.segments:
        a, b = network.pylons[segment.a], network.pylons[segment.b]
        line = understood.lines.get(segment.label, "")
        named = {"name": segment.label, "a": a.id, "b": b.id, **({"line": line} if line else {})}
        yield _build_feature("LineString", [_to_coordinates(a), _to_coordinates(b)], named)


def _to_coordinates(pylon: Pylon) -> list[float]:
    return [pylon.lon_deg, pylon.lat_deg, *([] if pylon.third_m is None else [pylon.third_m])]


def _build_feature(kind: str, coordinates: object, properties: Mapping[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
