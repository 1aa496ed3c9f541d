"""Define the commands that read a network file: `network` shows it as read, `init` writes a site for it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table
from rich.text import Text

import missions
from executor.cli.options import FIRST_AUTOPILOT, AutopilotName, JsonOption, flatten_options, number_option
from executor.cli.plan_inputs import check_can_draw, check_can_write, draw_named_file, refuse_options, write_named_file
from executor.core import formatting
from executor.core.formatting import command_line
from executor.errors import SiteError
from executor.site import site_model
from executor.site.new_site import render_site_template
from executor.site.plan_summary import describe_site_choices
from executor.site.site_file import read_site
from executor.site.site_keys import DepotTable
from missions.files import json_text, write_whole


@dataclass(frozen=True, slots=True)
class NetworkOptions:
    """Options for reading a network file, shared by `network` and `init`."""

    layer: Annotated[
        list[str] | None,
        typer.Option("--layer", metavar="NAME", help="The layer, sheet or folder to read; may be repeated."),
    ] = None
    where: Annotated[
        str | None, typer.Option(metavar="FILTER", help='Read only lines that match, such as "voltage >= 110000".')
    ] = None
    crs: Annotated[
        str | None, typer.Option(metavar="CRS", help="The reference system, for a file that does not state one.")
    ] = None
    encoding: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The encoding of a CSV file or a shapefile's names, such as cp1250; by default detected.",
        ),
    ] = None
    depot: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,ALT",
            help="The depot, if the network's file has none; or a point of another file, FILE#NAME.",
        ),
    ] = None
    radius: Annotated[float | None, number_option("Only segments within M metres of the depot.", 1, metavar="M")] = None
    snap: Annotated[
        float, number_option("Join ends of lines that are nearer than M metres.", 0.01, 50, metavar="M")
    ] = missions.SNAP_M
    max_span: Annotated[
        float | None, number_option("Divide longer spans, where there are no poles.", 5, 20_000, metavar="M")
    ] = None

    @property
    def place(self) -> tuple[float, float, float | None] | None:
        """Place of the depot.

        Raises:
            SiteError: the option is no place.
            NetworkError: the file with it cannot be read.
        """
        return None if self.depot is None else parse_depot(self.depot)

    def build_selection(self) -> missions.Selection:
        """Return the selection of the file.

        Raises:
            SiteError: the filter is invalid.
        """
        try:
            terms = () if self.where is None else missions.parse_where(self.where)
        except ValueError as error:
            raise SiteError(f"--where: {error}, got {self.where!r}") from error
        limits = missions.MendingLimits(self.snap, self.max_span)
        return missions.Selection(tuple(self.layer or ()), terms, self.crs, limits, self.encoding)


def parse_depot(text: str) -> tuple[float, float, float | None]:
    """Return the place of a depot: given as figures, or as a named point of a file.

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
    found = missions.read_station_points(name)
    if point in found or (len(found) == 1 and not point):
        return found[point] if point else next(iter(found.values()))
    known = ", ".join(f"#{one}" for one in list(found)[:12]) or "none"
    raise SiteError(f"--depot: expected the name of a point in {name}, of {known}, got {text!r}")


def _make_depot_error(text: str) -> SiteError:
    return SiteError(
        "--depot: expected latitude and longitude in degrees and the ground's height in metres, such as "
        f"49.5985,15.6137,462, or FILE#NAME, got '{text}'"
    )


SHOWN = 5
"""Most findings of one kind on the screen; the JSON lists all."""
MOST_LINES = 40
WIDTH = 100
"""Table width in characters if the output is no terminal."""


@dataclass(frozen=True, slots=True)
class LineRow:
    """One line of a network, as read."""

    name: str
    spans: int
    length_m: float
    shortest_m: float
    longest_m: float
    poles: int
    elevations_known: int
    """Number of poles with known ground height."""
    heights_known: int
    """Number of poles with known structure height."""


@flatten_options
def network(
    asked: typer.Context,
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="The network's file; 'default' is faultline's own. For a site file, its network with the segments "
            "that it leaves out and locks.",
        ),
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="GEOJSON", help="Write the network as it was read, as GeoJSON."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Draw the network as it was read on a map.")
    ] = None,
    options: NetworkOptions,
    as_json: JsonOption = False,
) -> None:
    """Show how a network file is read, what was repaired and what to check; needs no depot."""
    check_can_write(output)
    check_can_draw("--picture", picture)
    ground = None
    if Path(file).suffix == ".toml":
        path, names = Path(file), (one.name for one in fields(NetworkOptions))
        refuse_options(asked, names, f"none with {path}, which states how it is read")
        ground = site_model.load_site_model(read_site(path), path.parent)
        understood = site_model.import_site_network(ground.site.network, ground.site.depot, path.parent)
    else:
        path = missions.default_network_path() if file == site_model.DEFAULT_NETWORK else Path(file)
        understood = missions.import_network(
            path, options.build_selection(), depot=options.place, radius_m=options.radius, anywhere=True
        )
    document = missions.build_network_document(understood, None if ground is None else _collect_choices(ground))
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)
    write_named_file(output, lambda path: write_whole(path, f"{text}\n".encode()))
    draw_named_file(picture, lambda pictures: pictures.draw_network_figure(understood))
    if as_json:
        print(json_text(_build_document(understood) | ({} if ground is None else _build_choices(ground))))
    else:
        _show(understood)
        for line in () if ground is None else describe_site_choices(ground):
            print(formatting.escape_controls(line))


def _collect_choices(ground: site_model.SiteModel) -> dict[int, dict[str, object]]:
    """Return a site's settings for segments, by segment number."""
    found = dict[int, dict[str, object]]()
    for segment in ground.left_out:
        found[segment] = {"left_out": True}
    for segment, keeper in ground.locked.items():
        found.setdefault(segment, {})["locked"] = keeper
    for segment, is_turned in ground.directions.items():
        found.setdefault(segment, {})["reversed"] = is_turned
    return found


def _build_choices(ground: site_model.SiteModel) -> dict[str, object]:
    chosen = _collect_choices(ground)
    return {"chosen": [{"name": ground.network.segment_name(one), **chosen[one]} for one in sorted(chosen)]}


def build_line_rows(understood: missions.NetworkImport) -> list[LineRow]:
    """Return the lines of a network in the order of its file; spans without a line's name form one."""
    network = understood.network
    spans: dict[str, list[int]] = {}
    for segment in network.segments:
        spans.setdefault(understood.lines.get(segment.label, ""), []).append(segment.id)
    rows = []
    for name, own in spans.items():
        lengths_m = network.lengths_m[own].tolist()
        ends = {end for span in own for end in (network.segments[span].a, network.segments[span].b)}
        poles = [network.pylons[end] for end in ends]
        rows.append(_build_line_row(name, lengths_m, poles))
    return rows


def _build_line_row(name: str, lengths_m: Sequence[float], poles: Sequence[missions.Pylon]) -> LineRow:
    return LineRow(name, len(lengths_m), sum(lengths_m), min(lengths_m), max(lengths_m), len(poles),
        _count_known(poles, "elevation_m"), _count_known(poles, "height_m"))  # fmt: skip


def _count_known(poles: Iterable[missions.Pylon], key: str) -> int:
    return sum(getattr(pole, key) is not None for pole in poles)


def _build_document(understood: missions.NetworkImport) -> dict[str, object]:
    network = understood.network
    lat_deg, lon_deg, alt_m = network.depot
    return {
        "file": network.source,
        "format": understood.format,
        "crs": understood.crs,
        "depot": {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m} if understood.has_depot else None,
        "lines": [asdict(row) for row in build_line_rows(understood)],
        "segments": len(network.segments),
        "pylons": len(network.pylons),
        "length_m": float(network.lengths_m.sum()),
        "elevations_known": _count_known(network.pylons, "elevation_m"),
        "heights_known": _count_known(network.pylons, "height_m"),
        "findings": [{"matter": one.matter.value, "asset": one.asset, "text": one.text} for one in understood.found],
    }


def _show(understood: missions.NetworkImport) -> None:
    network, console = understood.network, Console(highlight=False, soft_wrap=True)
    rows = build_line_rows(understood)
    console.print(Text(formatting.escape_controls(f"{network.source}: {understood.format}, {understood.crs}")))
    first = [one for one in understood.found if one.matter in {missions.RemarkTopic.WHOLE, missions.RemarkTopic.FILTER}]
    for line in _describe_findings(first):
        print(formatting.escape_controls(line))
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    for column in ("line", "spans", "length", "shortest", "longest", "poles", "ground of", "height of"):
        table.add_column(column, justify="left" if column == "line" else "right", overflow="fold")
    for row in rows[:MOST_LINES]:
        table.add_row(*_build_cells(row))
    if len(rows) > MOST_LINES:
        table.add_row(f"{len(rows) - MOST_LINES} more")
    table.add_row(*_build_cells(_build_line_row("all", network.lengths_m.tolist(), network.pylons)))
    Console(highlight=False, width=None if console.is_terminal else WIDTH).print(table)
    lat_deg, lon_deg, alt_m = network.depot
    depot = (
        f"depot {formatting.format_lat_lon(lat_deg, lon_deg)}, {alt_m:g} m"
        if understood.has_depot
        else "no depot in the file"
    )
    print(f"{depot}; lines {len(rows)}")
    for line in _describe_findings([one for one in understood.found if one not in first]):
        print(formatting.escape_controls(line))


def _build_cells(row: LineRow) -> tuple[Text, ...]:
    known = (f"{count} of {row.poles}" for count in (row.elevations_known, row.heights_known))
    lengths = (f"{row.length_m / 1000:.2f} km", f"{row.shortest_m:.1f} m", f"{row.longest_m:.1f} m")
    cells = (formatting.escape_controls(row.name) or "-", str(row.spans), *lengths, str(row.poles), *known)
    return tuple(Text(cell) for cell in cells)


def _describe_findings(found: Sequence[missions.Remark]) -> Iterator[str]:
    for matter in dict.fromkeys(one.matter.value for one in found):
        own = [one for one in found if one.matter.value == matter]
        yield f"{matter} ({len(own)}):"
        yield from (f"  {finding.words}" for finding in own[:SHOWN])
        if len(own) > SHOWN:
            yield f"  {len(own) - SHOWN} more; --json has all"


@flatten_options
def init(
    network: Annotated[
        str,
        typer.Argument(
            metavar="NETWORK", help="The network's file, of any format; 'default' is faultline's own network."
        ),
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="SITE", help="Write the site file there; it must not exist yet."),
    ] = None,
    vehicles: Annotated[int, typer.Option(min=1, max=50, help="Number of vehicles.")] = 3,
    autopilot: Annotated[AutopilotName, typer.Option(help="Autopilot of all vehicles.")] = FIRST_AUTOPILOT,
    options: NetworkOptions,
) -> None:
    """Write a commented site file to start from."""
    check_can_write(output)
    if output is not None and output.exists():
        raise SiteError(f"{output}: expected a new file, this one exists already")
    place, radius = options.place, options.radius
    known = _read_network(network, options.build_selection(), place, radius)
    file = network
    if network != site_model.DEFAULT_NETWORK:
        file = Path(os.path.relpath(network, output.parent if output is not None else Path())).as_posix()
    table = None if place is None else _build_depot_table(place)
    choice = {key: getattr(options, key) for key in ("layer", "where", "crs", "encoding")}
    choice |= {"snap_m": None if options.snap == missions.SNAP_M else options.snap, "max_span_m": options.max_span}
    text = render_site_template(
        vehicles, autopilot.value, file=file, has_heights=known.has_heights, depot=table, radius_m=radius, choice=choice
    )
    if output is None:
        print(text, end="")
        return
    write_named_file(output, lambda path: write_whole(path, text.encode()))
    print(f"{output}: {len(known.segments)} segments, {vehicles} vehicles; next: {command_line('plan', output)}")


def _read_network(
    file: str, chosen: missions.Selection, depot: tuple[float, float, float | None] | None, radius_m: float | None
) -> missions.Network:
    path = missions.default_network_path() if file == site_model.DEFAULT_NETWORK else Path(file)
    try:
        return missions.import_network(path, chosen, depot=depot, radius_m=radius_m).network
    except missions.NetworkError as error:
        if depot is None and ": depot: " in str(error):
            raise SiteError(f"{error}; --depot LAT,LON,ALT says where it is") from error
        raise


def _build_depot_table(place: tuple[float, float, float | None]) -> DepotTable:
    try:
        return DepotTable(lat_deg=place[0], lon_deg=place[1], alt_m=place[2])
    except ValidationError as error:
        raise SiteError(f"--depot: expected a place on the Earth, got {place}") from error
