"""The command that a site begins with: init."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from executor.cli.network_options import (
    CrsOption,
    DepotOption,
    EncodingOption,
    LayersOption,
    MaxSpanOption,
    RadiusOption,
    SnapOption,
    WhereOption,
    parse_depot,
    parse_selection,
)
from executor.cli.options import FIRST_AUTOPILOT, AutopilotName
from executor.cli.plan_inputs import check_can_write, write_named_file
from executor.core.formatting import command_line
from executor.errors import SiteError
from executor.site import site_model, template
from executor.site.tables.ground import DepotTable
from missions import SNAP_M, MendingLimits, Network, NetworkError, Selection, default_network_path, import_network
from missions.files import write_whole


def init(
    network: Annotated[
        str,
        typer.Argument(
            metavar="NETWORK", help="The network's file, of any format; 'default' is faultline's own network."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="SITE", help="Write the site file there; it must not exist yet."),
    ] = None,
    depot: DepotOption = None,
    radius: RadiusOption = None,
    vehicles: Annotated[int, typer.Option(min=1, max=50, help="Number of vehicles.")] = 3,
    autopilot: Annotated[AutopilotName, typer.Option(help="Autopilot of all vehicles.")] = FIRST_AUTOPILOT,
    layer: LayersOption = None,
    where: WhereOption = None,
    crs: CrsOption = None,
    encoding: EncodingOption = None,
    snap: SnapOption = SNAP_M,
    max_span: MaxSpanOption = None,
) -> None:
    """Write a commented site file to start from."""
    check_can_write(output)
    if output is not None and output.exists():
        raise SiteError(f"{output}: expected a new file, this one exists already")
    place = None if depot is None else parse_depot(depot)
    chosen = parse_selection(layer, where, crs, MendingLimits(snap, max_span), encoding)
    known = _read_network(network, chosen, place, radius)
    file = network
    if network != site_model.DEFAULT_NETWORK:
        file = Path(os.path.relpath(network, output.parent if output is not None else Path())).as_posix()
    table = None if place is None else _build_depot_table(place)
    choice = {"layer": layer, "where": where, "crs": crs, "encoding": encoding,
              "snap_m": None if snap == SNAP_M else snap, "max_span_m": max_span}  # fmt: skip
    text = template.render_site_template(
        template.SiteTemplate(file, known.has_heights, table, radius, vehicles, autopilot.value, choice)
    )
    if output is None:
        print(text, end="")
        return
    write_named_file(output, lambda: write_whole(output, text.encode()))
    print(f"{output}: {len(known.segments)} segments, {vehicles} vehicles; next: {command_line('plan', output)}")


def _read_network(
    file: str, chosen: Selection, depot: tuple[float, float, float | None] | None, radius_m: float | None
) -> Network:
    path = default_network_path() if file == site_model.DEFAULT_NETWORK else Path(file)
    try:
        return import_network(path, chosen, depot=depot, radius_m=radius_m).network
    except NetworkError as error:
        if depot is None and ": depot: " in str(error):
            raise SiteError(f"{error}; --depot LAT,LON,ALT says where it is") from error
        raise


def _build_depot_table(place: tuple[float, float, float | None]) -> DepotTable:
    try:
        return DepotTable(lat_deg=place[0], lon_deg=place[1], alt_m=place[2])
    except ValidationError as error:
        raise SiteError(f"--depot: expected a place on the Earth, got {place}") from error
