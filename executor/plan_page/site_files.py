"""Manage the page's folder: list files to open, receive uploads, and write a new site for a network."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Literal

import missions
from executor.adapters.run_directory import lock_file
from executor.errors import SiteError
from executor.plan_page.site_store import WORK_FOLDER
from executor.plan_page.site_view import import_network_once
from executor.site.new_site import render_site_template
from executor.site.site_keys import NetworkTable
from executor.site.site_model import DEFAULT_NETWORK
from missions.files import write_whole

MOST_UPLOAD = 100_000_000
"""Most bytes of an uploaded file."""
MOST_NAME = 120
MOST_SHOWN = 500
NETWORKS = frozenset((
    ".csv", ".geojson", ".gpkg", ".gpx", ".json", ".kml", ".kmz", ".osm", ".pbf", ".shp", ".txt", ".xlsx", ".zip",
))  # fmt: skip
"""Suffixes of network files in a folder listing; a file opened by name may have any."""
HEAD = 4096
VEHICLES = 3
DRAFT = ".faultline-part"
"""Suffix of a file that is still being received; its name begins with a dot."""
FileKind = Literal["site", "network", "plan"]


def find_inside(root: Path, name: str) -> Path:
    """Return a file below a folder.

    Raises:
        SiteError: it lies elsewhere, also by a symbolic link, or does not exist.
    """
    if "\0" in name:
        raise SiteError("path: expected a file's name")
    path = (root / name).resolve()
    if not path.is_relative_to(root.resolve()) or WORK_FOLDER in path.parts:
        raise SiteError(f"path: expected a file below {root}, where this page was started, got {name[:MOST_NAME]!r}")
    if not path.is_file():
        raise SiteError(f"path: expected a file, there is none at {name[:MOST_NAME]!r}")
    return path


def find_kind(path: Path) -> FileKind:
    """Return the kind of a file by its name, or if unclear by its first bytes."""
    if path.suffix.lower() == ".toml":
        return "site"
    if path.suffix.lower() == ".json":
        with path.open("rb") as file:
            head = file.read(HEAD).decode("utf-8", "replace")
        if '"faultline-plan/' in head or '"faultline-dayplan/' in head:
            return "plan"
    return "network"


def list_files(root: Path) -> Iterator[tuple[str, FileKind]]:
    """Yield the files that could be opened in a folder and its direct subfolders, each with its kind."""
    count = 0
    for folder, below, names in os.walk(root):
        here = Path(folder)
        below[:] = sorted(one for one in below if not one.startswith(".") and here == root)
        for name in sorted(names):
            path = here / name
            if name.startswith(".") or path.suffix.lower() not in NETWORKS | {".toml"} or not path.is_file():
                continue
            count += 1
            if count > MOST_SHOWN:
                return
            yield path.relative_to(root).as_posix(), find_kind(path)


def check_upload_name(name: str) -> str:
    """Return the name of an uploaded file.

    Raises:
        SiteError: it is no file name, or would be a path.
    """
    plain = name == PurePath(name).name and "\\" not in name and name.isprintable() and len(name) <= MOST_NAME
    if not plain or not name or name.startswith(".") or name.endswith((".toml", ".part")):
        raise SiteError(
            f"name: expected the plain name of a network, area, ground or picture, got {name[:MOST_NAME]!r}"
        )
    return name


async def receive_file(folder: Path, name: str, content: AsyncIterator[bytes]) -> Path:
    """Write an uploaded file as it arrives, under its name or, if that is taken, a similar one.

    Raises:
        SiteError: it is too long, or cannot be written.
    """
    path = find_free_name(folder / check_upload_name(name))
    draft, length = _draft_of(path), 0
    try:
        with draft.open("xb") as file:
            with suppress(ImportError):  # a system without locks
                lock_file(file)
            async for chunk in content:
                length += len(chunk)
                if length > MOST_UPLOAD:
                    raise SiteError(f"{name}: expected at most {MOST_UPLOAD} bytes")
                file.write(chunk)
        draft.replace(path)
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        draft.unlink(missing_ok=True)
    return path


def remove_drafts(folder: Path) -> None:
    """Remove partial uploads of a server that was killed; those of another running server stay."""
    for draft in folder.glob(f".*{DRAFT}"):
        with suppress(OSError, ImportError), draft.open("rb") as file:
            lock_file(file)
            draft.unlink()


def _draft_of(path: Path) -> Path:
    return path.with_name(f".{path.name}{DRAFT}")


def find_free_name(path: Path) -> Path:
    """Return an unused name: the requested one, or one with a number."""
    number, free = 1, path
    while free.exists() or _draft_of(free).exists():
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free


def make_site(folder: Path, network: Path | None) -> Path:
    """Write a site file for a network, as `init` does; None for the bundled network.

    Raises:
        NetworkError: the network cannot be used.
        SiteError: the site cannot be written.
    """
    file = DEFAULT_NETWORK if network is None else Path(os.path.relpath(network, folder)).as_posix()
    known = import_network_once(NetworkTable(file=file), None, folder)
    text = render_site_template(
        VEHICLES, missions.AUTOPILOTS[0].name, file=file, has_heights=known.network.has_heights, depot=None,
        has_depot=known.has_depot, radius_m=None, choice={},
    )  # fmt: skip
    named = folder / "site.toml"
    path = find_free_name(named if not named.exists() or network is None else folder / f"{network.stem}.toml")
    try:
        write_whole(path, text.encode())
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error
    return path


def find_site_of_plan(plan: Path) -> Path:
    """Return the site file next to a plan.

    Raises:
        SiteError: there is none, or more than one.
    """
    beside = sorted(plan.parent.glob("*.toml"))
    named = [one for one in beside if one.name == "site.toml" or one.stem == plan.stem] or beside
    if len(named) != 1:
        raise SiteError(f"{plan}: expected its site file next to it, found {len(named)}; open that one instead")
    return named[0]
