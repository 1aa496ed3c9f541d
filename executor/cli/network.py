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
    depot_of,
    wanted,
)
from executor.cli.options import JsonOption
from executor.cli.planning import can_be_drawn, can_be_written, writable
from executor.core import words
from executor.site import assembly
from missions import (
    SNAP_M,
    Matter,
    Mending,
    Pylon,
    Remark,
    Understood,
    default_network_path,
    network_document,
    understand,
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
    can_be_written(output)
    can_be_drawn("--picture", picture)
    path = default_network_path() if file == assembly.DEFAULT_NETWORK else Path(file)
    place = None if depot is None else depot_of(depot)
    understood = understand(
        path,
        wanted(layer, where, crs, Mending(snap, max_span), encoding),
        depot=place,
        radius_m=radius,
        anywhere=True,
    )
    if output is not None:
        text = json.dumps(network_document(understood), ensure_ascii=False, indent=1, allow_nan=False)
        writable(output, lambda: write_whole(output, f"{text}\n".encode()))
    if picture is not None:
        from executor.analysis.pictures import network_figure, save

        writable(picture, lambda: save(network_figure(understood), picture))
    if as_json:
        print(json_text(_document(understood)))
    else:
        _show(understood)


def line_rows(understood: Understood) -> list[LineRow]:
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
        rows.append(LineRow(name, len(own), sum(lengths_m), min(lengths_m), max(lengths_m), len(poles),
            _known(poles, "elevation_m"), _known(poles, "height_m")))  # fmt: skip
    return rows


def _known(poles: Iterable[Pylon], key: str) -> int:
    return sum(getattr(pole, key) is not None for pole in poles)


def _document(understood: Understood) -> dict[str, object]:
    network = understood.network
    lat_deg, lon_deg, alt_m = network.depot
    return {
        "file": network.source,
        "format": understood.format,
        "crs": understood.crs,
        "depot": {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m} if understood.has_depot else None,
        "lines": [{key: getattr(row, key) for key in LineRow.__slots__} for row in line_rows(understood)],
        "segments": len(network.segments),
        "pylons": len(network.pylons),
        "length_m": float(network.lengths_m.sum()),
        "elevations_known": _known(network.pylons, "elevation_m"),
        "heights_known": _known(network.pylons, "height_m"),
        "findings": [{"matter": one.matter.value, "asset": one.asset, "text": one.text} for one in understood.found],
    }


def _show(understood: Understood) -> None:
    network, console = understood.network, Console(highlight=False, soft_wrap=True)
    rows = line_rows(understood)
    console.print(Text(words.shown(f"{network.source}: {understood.format}, {understood.crs}")))
    first = [one for one in understood.found if one.matter in {Matter.WHOLE, Matter.FILTER}]
    for line in _finding_lines(first):
        print(words.shown(line))
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    for column in ("line", "spans", "length", "shortest", "longest", "poles", "ground of", "height of"):
        table.add_column(column, justify="left" if column == "line" else "right", overflow="fold")
    for row in rows[:MOST_LINES]:
        table.add_row(*_cells(row))
    if len(rows) > MOST_LINES:
        table.add_row(f"{len(rows) - MOST_LINES} more")
    total = LineRow("all", len(network.segments), float(network.lengths_m.sum()), float(network.lengths_m.min()),
        float(network.lengths_m.max()), len(network.pylons), _known(network.pylons, "elevation_m"),
        _known(network.pylons, "height_m"))  # fmt: skip
    table.add_row(*_cells(total))
    Console(highlight=False, width=None if console.is_terminal else WIDTH).print(table)
    lat_deg, lon_deg, alt_m = network.depot
    depot = f"depot {words.place(lat_deg, lon_deg)}, {alt_m:g} m" if understood.has_depot else "no depot in the file"
    print(f"{depot}; lines {len(rows)}")
    for line in _finding_lines([one for one in understood.found if one not in first]):
        print(words.shown(line))


def _cells(row: LineRow) -> tuple[Text, ...]:
    known = (f"{count} of {row.poles}" for count in (row.elevations_known, row.heights_known))
    lengths = (f"{row.length_m / 1000:.2f} km", f"{row.shortest_m:.1f} m", f"{row.longest_m:.1f} m")
    cells = (words.shown(row.name) or "-", str(row.spans), *lengths, str(row.poles), *known)
    return tuple(Text(cell) for cell in cells)


def _finding_lines(found: Sequence[Remark]) -> Iterator[str]:
    by_matter: dict[str, list[Remark]] = {}
    for finding in found:
        by_matter.setdefault(finding.matter.value, []).append(finding)
    for matter, own in by_matter.items():
        yield f"{matter} ({len(own)}):"
        yield from (f"  {finding.words}" for finding in own[:SHOWN])
        if len(own) > SHOWN:
            yield f"  {len(own) - SHOWN} more; --json has all"
