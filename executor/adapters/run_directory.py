"""The run directory: everything that one flight leaves."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

import tomli_w

from executor.errors import LogError

LOCK = ".lock"


def new_run_directory(wanted: Path | None) -> Path:
    """Make the directory of a run; by default a dated one under runs/ in the working directory.

    Raises:
        LogError: it holds a run already, or cannot be made.
    """
    path = wanted if wanted is not None else Path("runs") / f"{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    try:
        if (path / "events.jsonl").exists():
            raise LogError(f"{path}: --run: expected a new directory, this one holds a run already")
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{path}: --run: cannot be made: {error.strerror}") from error
    return path


def keep_site(path: Path, site: Mapping[str, object], files: Mapping[tuple[str, str], Path]) -> None:
    """Write site.toml so that the directory can be carried elsewhere: the files that it names lie beside it.

    Args:
        path: The run directory.
        site: The content of the site file.
        files: Its files by table and key; one that comes with the program is not among them.
    """
    content = dict(site)
    for (name, key), file in files.items():
        table = content[name]
        if not isinstance(table, Mapping):
            raise TypeError(f"the site's {name} is a table")
        kept = f"{name}{file.suffix}"
        shutil.copyfile(file, path / kept)
        content[name] = {**table, key: kept}
    write_whole(path / "site.toml", tomli_w.dumps(content).encode())


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file whole or not at all."""
    write_whole(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all, after a power loss too."""
    draft = path.with_name(path.name + ".part")
    with draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name
    finally:
        os.close(folder)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a run directory: of all processes on this computer one flies it.

    The lock is the system's, and ends with the process however it dies; a copy of the directory is not locked.

    Raises:
        LogError: another process holds it.
    """
    with (path / LOCK).open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            holder = file.read().strip()
            raise LogError(f"{path}: another faultline flies this directory already (process {holder})") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield
