"""What came of a network file, and as GeoJSON that is read back to the same network, whatever file it came from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from missions.network import Network, Pylon
from missions.readers.geojson import FLAT
from missions.readers.network_build import MendingLimits
from missions.readers.raw_network import Remark
from missions.readers.read_options import Comparison


@dataclass(frozen=True, slots=True)
class Selection:
    """What of a file is wanted, and how far it may be mended."""

    layers: tuple[str, ...] = ()
    where: tuple[Comparison, ...] = ()
    crs: str | None = None
    """Of a file that does not say its own; of a graph file the map grid of its metres."""
    mending: MendingLimits = field(default_factory=MendingLimits)
    encoding: str | None = None
    """Of a table in text that is not UTF-8; None to try."""


@dataclass(frozen=True, slots=True)
class NetworkImport:
    """A network, and how it came out of its file."""

    network: Network
    format: str
    crs: str
    has_depot: bool
    """Whether the depot is known; otherwise the network's is the middle of its poles."""
    lines: Mapping[str, str]
    """The line of each segment, by the segment's label; empty where there is none."""
    found: tuple[Remark, ...]
    """What was mended or left out, and what is worth a look."""


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
