"""The command that a site begins with: init."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.options import FIRST_AUTOPILOT, AutopilotName, finite
from executor.cli.planning import can_be_written, writable
from executor.errors import SiteError
from executor.site import assembly, template
from executor.site.config import DepotTable
from missions import Network, NetworkError, default_network_path, read_network


def init(
    network: Annotated[
        str, typer.Argument(metavar="NETWORK", help="GeoJSON or a graph file; 'default' is faultline's own network.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="SITE", help="Write the site file there; it must not exist yet."),
    ] = None,
    depot: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON,ALT", help="The depot, where the network's file does not give it."),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(min=1, callback=finite, metavar="M", help="Only segments within M metres of the depot."),
    ] = None,
    vehicles: Annotated[int, typer.Option(min=1, max=50, help="Number of vehicles.")] = 3,
    autopilot: Annotated[AutopilotName, typer.Option(help="Autopilot of all vehicles.")] = FIRST_AUTOPILOT,
) -> None:
    """Write a commented site file to start from."""
    can_be_written(output)
    if output is not None and output.exists():
        raise SiteError(f"{output}: expected a new file, this one exists already")
    where = None if depot is None else _depot(depot)
    known = _network(network, where, radius)
    file = network
    if network != assembly.DEFAULT_NETWORK:
        file = Path(os.path.relpath(network, output.parent if output is not None else Path())).as_posix()
    text = template.starter(template.Wish(file, known.has_heights, where, radius, vehicles, autopilot.value))
    if output is None:
        print(text, end="")
        return
    writable(output, lambda: output.write_text(text, encoding="utf-8"))
    print(f"{output}: {len(known.segments)} segments, {vehicles} vehicles; next: faultline plan {output}")


def _network(file: str, depot: DepotTable | None, radius_m: float | None) -> Network:
    path = default_network_path() if file == assembly.DEFAULT_NETWORK else Path(file)
    place = None if depot is None else (depot.lat_deg, depot.lon_deg, depot.alt_m)
    try:
        return read_network(path, depot=place, radius_m=radius_m)
    except NetworkError as error:
        if depot is None and ": depot: " in str(error):
            raise SiteError(f"{error}; --depot LAT,LON,ALT says where it is") from error
        raise


def _depot(text: str) -> DepotTable:
    try:
        lat_deg, lon_deg, alt_m = (float(word) for word in text.split(","))
        return DepotTable(lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m)
    except ValueError as error:
        raise SiteError(
            f"--depot: expected latitude and longitude in degrees and the ground's height in metres, "
            f"such as 49.5985,15.6137,462, got '{text}'"
        ) from error
