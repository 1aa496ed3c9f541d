"""The run directory: everything that one flight leaves."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

import tomli_w

from executor.errors import LogError


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
    (path / "site.toml").write_text(tomli_w.dumps(content), encoding="utf-8")


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file whole or not at all."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    draft.replace(path)
