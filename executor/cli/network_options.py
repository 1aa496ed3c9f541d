"""What the commands that read a network's file ask of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.options import require_finite
from executor.errors import SiteError
from missions import MendingLimits, Selection, parse_where, read_station_points

LayersOption = Annotated[
    list[str] | None,
    typer.Option("--layer", metavar="NAME", help="The layer, sheet or folder to read; may be repeated."),
]
WhereOption = Annotated[
    str | None,
    typer.Option(metavar="FILTER", help='Read only lines that match, such as "voltage >= 110000".'),
]
CrsOption = Annotated[
    str | None, typer.Option(metavar="CRS", help="The reference system of a file that does not say its own.")
]
EncodingOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="The encoding of a CSV file or a shapefile's names, such as cp1250; tried without."
    ),
]
SnapOption = Annotated[
    float,
    typer.Option(
        "--snap",
        min=0.01,
        max=50,
        callback=require_finite,
        metavar="M",
        help="Join ends of lines that are nearer than M metres.",
    ),
]
MaxSpanOption = Annotated[
    float | None,
    typer.Option(
        "--max-span",
        min=5,
        max=20_000,
        callback=require_finite,
        metavar="M",
        help="Divide longer spans, where there are no poles.",
    ),
]
RadiusOption = Annotated[
    float | None,
    typer.Option(min=1, callback=require_finite, metavar="M", help="Only segments within M metres of the depot."),
]
DepotOption = Annotated[
    str | None,
    typer.Option(
        metavar="LAT,LON,ALT",
        help="The depot, where the network's file does not give it; or a file with it, FILE#NAME.",
    ),
]


def parse_selection(
    layer: Sequence[str] | None,
    where: str | None,
    crs: str | None,
    mending: MendingLimits | None = None,
    encoding: str | None = None,
) -> Selection:
    """Return what options ask of a network's file.

    Raises:
        SiteError: the filter is none.
    """
    try:
        terms = () if where is None else parse_where(where)
    except ValueError as error:
        raise SiteError(f"--where: {error}, got {where!r}") from error
    return Selection(tuple(layer or ()), terms, crs, mending or MendingLimits(), encoding)


def parse_depot(text: str) -> tuple[float, float, float | None]:
    """Return where a depot is: by its figures, or as a point of a file by its name.

    Raises:
        SiteError: it is neither.
        NetworkError: the file cannot be read.
    """
    try:
        lat_deg, lon_deg, *rest = (float(word) for word in text.split(","))
    except ValueError:
        return _read_depot_point(text)
    if len(rest) > 1 or not (abs(lat_deg) <= 89 and abs(lon_deg) <= 180 and all(-500 <= up <= 9000 for up in rest)):
        raise _make_depot_error(text)
    return lat_deg, lon_deg, rest[0] if rest else None


def _read_depot_point(text: str) -> tuple[float, float, float | None]:
    name, _, point = text.partition("#")
    if not Path(name).is_file():
        raise _make_depot_error(text)
    found = read_station_points(name)
    if point in found or (len(found) == 1 and not point):
        return found[point] if point else next(iter(found.values()))
    known = ", ".join(f"#{one}" for one in list(found)[:12]) or "none"
    raise SiteError(f"--depot: expected the name of a point in {name}, of {known}, got {text!r}")


def _make_depot_error(text: str) -> SiteError:
    return SiteError(
        "--depot: expected latitude and longitude in degrees and the ground's height in metres, such as "
        f"49.5985,15.6137,462, or FILE#NAME, got '{text}'"
    )
