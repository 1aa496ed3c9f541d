"""The command that shows what was understood of a network's file: network."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

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
from executor.cli.options import JsonOption
from executor.cli.plan_inputs import check_can_draw, check_can_write, write_named_file
from executor.core import formatting
from executor.site import site_model
from missions import (
    SNAP_M,
    MendingLimits,
    NetworkImport,
    Pylon,
    Remark,
    RemarkTopic,
    build_network_document,
    default_network_path,
    import_network,
)
from missions.files import json_text, write_whole

SHOWN = 5
"""Findings of one matter on the screen; the JSON has all."""
MOST_LINES = 40
WIDTH = 100
"""Letters of a table where nobody looks at a terminal."""


@dataclass(frozen=True, slots=True)
class LineRow:
    """One line of a network, as it was understood."""

    name: str
    spans: int
    length_m: float
    shortest_m: float
    longest_m: float
    poles: int
    elevations_known: int
    """Poles of which the ground is known."""
    heights_known: int
    """Poles of which the structure's height is known."""


def network(
    file: Annotated[str, typer.Argument(metavar="FILE", help="The network's file; 'default' is faultline's own.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="GEOJSON", help="Write what was understood as GeoJSON.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw what was understood on a map.")] = None,
    layer: LayersOption = None,
    where: WhereOption = None,
    crs: CrsOption = None,
    encoding: EncodingOption = None,
    depot: DepotOption = None,
    radius: RadiusOption = None,
    snap: SnapOption = SNAP_M,
    max_span: MaxSpanOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show how a network file is read, what was repaired and what to check; needs no depot."""
    check_can_write(output)
    check_can_draw("--picture", picture)
    path = default_network_path() if file == site_model.DEFAULT_NETWORK else Path(file)
    place = None if depot is None else parse_depot(depot)
    understood = import_network(
        path,
        parse_selection(layer, where, crs, MendingLimits(snap, max_span), encoding),
        depot=place,
        radius_m=radius,
        anywhere=True,
    )
    if output is not None:
        text = json.dumps(build_network_document(understood), ensure_ascii=False, indent=1, allow_nan=False)
        write_named_file(output, lambda: write_whole(output, f"{text}\n".encode()))
    if picture is not None:
        from executor.analysis.pictures import draw_network_figure, save_figure

        write_named_file(picture, lambda: save_figure(draw_network_figure(understood), picture))
    if as_json:
        print(json_text(_build_document(understood)))
    else:
        _show(understood)


def build_line_rows(understood: NetworkImport) -> list[LineRow]:
    """Return the lines of a network in the order of its file; spans without a line's name are one."""
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


def _build_line_row(name: str, lengths_m: Sequence[float], poles: Sequence[Pylon]) -> LineRow:
    return LineRow(name, len(lengths_m), sum(lengths_m), min(lengths_m), max(lengths_m), len(poles),
        _count_known(poles, "elevation_m"), _count_known(poles, "height_m"))  # fmt: skip


def _count_known(poles: Iterable[Pylon], key: str) -> int:
    return sum(getattr(pole, key) is not None for pole in poles)


def _build_document(understood: NetworkImport) -> dict[str, object]:
    network = understood.network
    lat_deg, lon_deg, alt_m = network.depot
    return {
        "file": network.source,
        "format": understood.format,
        "crs": understood.crs,
        "depot": {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m} if understood.has_depot else None,
        "lines": [{key: getattr(row, key) for key in LineRow.__slots__} for row in build_line_rows(understood)],
        "segments": len(network.segments),
        "pylons": len(network.pylons),
        "length_m": float(network.lengths_m.sum()),
        "elevations_known": _count_known(network.pylons, "elevation_m"),
        "heights_known": _count_known(network.pylons, "height_m"),
        "findings": [{"matter": one.matter.value, "asset": one.asset, "text": one.text} for one in understood.found],
    }


def _show(understood: NetworkImport) -> None:
    network, console = understood.network, Console(highlight=False, soft_wrap=True)
    rows = build_line_rows(understood)
    console.print(Text(formatting.escape_controls(f"{network.source}: {understood.format}, {understood.crs}")))
    first = [one for one in understood.found if one.matter in {RemarkTopic.WHOLE, RemarkTopic.FILTER}]
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


def _describe_findings(found: Sequence[Remark]) -> Iterator[str]:
    by_matter: dict[str, list[Remark]] = {}
    for finding in found:
        by_matter.setdefault(finding.matter.value, []).append(finding)
    for matter, own in by_matter.items():
        yield f"{matter} ({len(own)}):"
        yield from (f"  {finding.words}" for finding in own[:SHOWN])
        if len(own) > SHOWN:
            yield f"  {len(own) - SHOWN} more; --json has all"
