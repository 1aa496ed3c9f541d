"""Network files: which reader takes which file."""

from __future__ import annotations

from pathlib import Path

from missions.errors import NetworkError
from missions.files import NESTED, read_text
from missions.geo import LocalFrame
from missions.network import Network
from missions.readers.geojson import parse_geojson
from missions.readers.graph import parse_graph

__all__ = ["default_network_path", "read_network"]


def default_network_path() -> Path:
    """Return the path of the project's own network: a fictitious substation in open farmland with five lines."""
    return Path(__file__).resolve().parent.parent / "data" / "default_network.geojson"


def read_network(
    path: Path | str,
    *,
    depot: tuple[float, float, float | None] | None = None,
    crs: str | None = None,
    radius_m: float | None = None,
) -> Network:
    """Read a network file; its content decides the format: GeoJSON, or a libconfig graph.

    Args:
        path: The file.
        depot: Latitude and longitude in degrees and height above mean sea level in metres. Graph files need it;
            for a GeoJSON file it wins over the file's own depot. Without a height the file's own depot gives it; a file
            of flat ground needs none.
        crs: For graph files whose offsets are metres of a map grid, e.g. ``EPSG:32633``; otherwise they are metres
            east and north of the depot.
        radius_m: Keep only segments with both pylons nearer than this to the depot.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    path = Path(path)
    text = read_text(path, "network file", NetworkError)
    frame = _frame_of(path, depot)
    try:
        network = _parsed(path, text, frame, crs, alt_known=depot is None or depot[2] is not None)
    except RecursionError:
        raise NetworkError(f"{path}: content: {NESTED}") from None
    return network if radius_m is None else network.within(radius_m)


def _parsed(path: Path, text: str, frame: LocalFrame | None, crs: str | None, *, alt_known: bool) -> Network:
    head = text.lstrip("\ufeff \t\r\n")
    if head.startswith("{"):
        if crs is not None:
            raise NetworkError(f"{path}: crs: expected none for GeoJSON, which is always WGS 84; got {crs!r}")
        return parse_geojson(head, source=str(path), frame=frame, alt_known=alt_known)
    if "pylons_position" in text:
        if frame is None:
            raise NetworkError(
                f"{path}: depot: expected lat_deg, lon_deg and alt_m, for a graph file holds offsets only"
            )
        return parse_graph(text, source=str(path), frame=frame, crs=crs)
    raise NetworkError(f"{path}: content: expected GeoJSON, or a graph file with pylons_position; found neither")


def _frame_of(path: Path, depot: tuple[float, float, float | None] | None) -> LocalFrame | None:
    if depot is None:
        return None
    try:
        return LocalFrame(depot[0], depot[1], depot[2] or 0.0)
    except ValueError as error:
        raise NetworkError(f"{path}: depot: {error}") from error
