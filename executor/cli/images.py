"""Define the command that finds the files of a flight's pictures."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from executor.adapters.extras import Extra, require_extra
from executor.adapters.run_directory import RunDirectory
from executor.cli.options import JsonOption, QuietOption
from executor.cli.plan_inputs import print_result
from executor.errors import LogError
from executor.images import matching
from executor.images.index_files import read_index, write_file_matches

SHOWN = 5
"""Most names of one kind to print; images-files.csv lists all."""
COLUMNS = ("path", "asset", "viewpoint", "vehicle", "camera", "sequence", "state", "clock_ahead_s")


class PlaceDestination(StrEnum):
    """Destination of a place that a file lacks."""

    NONE = "none"
    XMP = "xmp"
    EXIF = "exif"


def images(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with the files of the cards, in any subfolders.")
    ],
    run: Annotated[Path, typer.Option("--run", metavar="DIR", help="The run directory of the flight.")],
    write: Annotated[
        PlaceDestination,
        typer.Option(
            "--write",
            help="Where to write a place that a file lacks: an .xmp file next to it, its own EXIF, or nowhere.",
        ),
    ] = PlaceDestination.XMP,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Match camera files to the pictures of a flight by time and place, and list what is missing."""
    require_extra(Extra.IMAGES, "faultline images")

    if not folder.is_dir():
        raise LogError(f"{folder}: no such folder; expected one with the files of cameras")
    index = read_index(run)
    found = matching.match_files(index, list(matching.find_picture_files(folder)), folder)
    placed = _write_places(found.matches, write)
    write_file_matches(run, COLUMNS, _build_rows(found))
    matching.write_assets_page(RunDirectory(run).assets, index, found)
    matching.add_pictures_to_report(RunDirectory(run).page, index, found)
    lines = () if quiet else _describe_matching(found, placed, len(index.images))
    print_result(lambda: _build_document(found, placed), lines, as_json=as_json, answer_is_no=not found.is_complete)


def _write_places(matches: Sequence[matching.FileMatch], write: PlaceDestination) -> int:
    """Write the places that files lack; return their number."""
    without = [match for match in matches if match.file.lat_deg is None or match.file.lon_deg is None]
    if write is PlaceDestination.NONE:
        return 0
    for match in without:
        place = (match.image.lat_deg, match.image.lon_deg, match.image.alt_msl_m)
        if write is PlaceDestination.XMP:
            matching.write_place_xmp(match.file.path, *place)
        else:
            matching.write_place_exif(match.file.path, *place)
    return len(without)


def _build_rows(found: matching.Matching) -> list[tuple[object, ...]]:
    blurred = {match.file.path for match in found.blurred}
    rows: list[tuple[object, ...]] = []
    for match in found.matches:
        image = match.image
        state = image.flaw or ("blurred" if match.file.path in blurred else "matched")
        rows.append((
            str(match.file.path), image.asset, image.viewpoint, image.vehicle, image.camera, image.sequence, state,
            round(match.ahead_s, 2),
        ))  # fmt: skip
    nobody = ("", "", "", "", "")
    rows += [
        ("", row.asset, row.viewpoint, row.vehicle, row.camera, row.sequence, "missing", "") for row in found.missing
    ]
    rows += [(str(copy), *nobody, f"a copy of {first}", "") for first, copy in found.doubled]
    rows += [(str(path), *nobody, "of no picture of this flight", "") for path in found.strange]
    rows += [(str(path), *nobody, why, "") for path, why in found.unreadable]
    return rows


def _describe_matching(found: matching.Matching, placed: int, pictures: int) -> list[str]:
    lines = [f"{len(found.matches)} of {pictures} pictures have a file"]
    for card in found.cards:
        if card.key is None or card.offset is None:
            lines.append(f"{card.name}: {len(card.files)} files, of no camera of this flight")
            continue
        ahead_s = card.offset.ahead_s
        clock = f"its clock is {abs(ahead_s):.1f} s {'ahead' if ahead_s > 0 else 'behind'}"
        lines.append(f"{card.name}: {len(card.files)} files of {card.key[0]}, camera {card.key[1]}; {clock}")
    if placed:
        lines.append(f"{placed} files had no position; position written")
    lines += _list_some(
        "missing", [f"{row.vehicle} {row.camera} {row.sequence} ({row.asset or 'of no span'})" for row in found.missing]
    )
    lines += _list_some("doubled", [f"{copy} is {first}" for first, copy in found.doubled])
    lines += _list_some("of no picture of this flight", [str(path) for path in found.strange])
    lines += _list_some("unreadable", [f"{path}: {why}" for path, why in found.unreadable])
    lines += _list_some("blurred by speed", [str(match.file.path) for match in found.blurred])
    lines += _list_some(
        "do not count", [f"{row.vehicle} {row.camera} {row.sequence}: {row.flaw}" for row in found.misaimed]
    )
    lines += _list_some("not seen", [f"{row.asset}: {row.missing or row.state}" for row in found.unseen])
    return lines


def _list_some(what: str, names: Sequence[str]) -> list[str]:
    if not names:
        return []
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return [f"{what}, {len(names)}: {', '.join(names[:SHOWN])}{more}"]


def _build_document(found: matching.Matching, placed: int) -> dict[str, object]:
    return {
        "matched": len(found.matches),
        "missing": [[row.vehicle, row.camera, row.sequence] for row in found.missing],
        "doubled": [[str(first), str(copy)] for first, copy in found.doubled],
        "strange": [str(path) for path in found.strange],
        "unreadable": [[str(path), why] for path, why in found.unreadable],
        "blurred": [str(match.file.path) for match in found.blurred],
        "misaimed": [[row.vehicle, row.camera, row.sequence, row.flaw] for row in found.misaimed],
        "unseen": [[row.asset, row.camera, row.missing or row.state] for row in found.unseen],
        "cards": [
            {
                "name": card.name,
                "files": len(card.files),
                "vehicle": None if card.key is None else card.key[0],
                "camera": None if card.key is None else card.key[1],
                "clock_ahead_s": None if card.offset is None else round(card.offset.ahead_s, 2),
            }
            for card in found.cards
        ],
        "placed": placed,
        "complete": found.is_complete,
    }
