"""Results on disk, each written as soon as it exists, so that an interrupted run can continue."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.errors import BenchError
from missions.files import write_whole

Json = dict[str, Any]
"""A JSON object."""


class Store:
    """A directory with a JSON file for each result, stored with its settings."""

    def __init__(self, directory: Path, *, fresh: bool = False) -> None:
        """Open or make the directory; ``fresh`` deletes its contents.

        Raises:
            BenchError: it cannot be written.
        """
        self._directory = directory
        try:
            directory.mkdir(parents=True, exist_ok=True)
            for path in directory.glob("*.json") if fresh else ():
                path.unlink()
        except OSError as error:
            raise BenchError(f"{directory}: expected a directory to write to: {error.strerror}") from error

    def find_result(self, key: str, settings: Mapping[str, object]) -> Json | None:
        """Return an existing result with these settings."""
        try:
            content = json.loads(self._path(key).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None  # none yet, or a partial file of a killed run: it is made again
        same = isinstance(content, dict) and content.get("settings") == json.loads(json.dumps(settings))
        return content["result"] if same else None

    def keep(self, key: str, settings: Mapping[str, object], result: Json) -> Json:
        """Write a result and return it as it will be read."""
        write_result(self._path(key), {"settings": settings, "result": result})
        return json.loads(json.dumps(result))  # type: ignore[no-any-return]  # a JSON object stays one

    def find_or_make(self, key: str, settings: Mapping[str, object], make: Callable[[], Json]) -> Json:
        """Return an existing result, or make and keep it."""
        result = self.find_result(key, settings)
        return self.keep(key, settings, make()) if result is None else result

    def _path(self, key: str) -> Path:
        return self._directory / f"{key}.json"


def write_result(path: Path, content: object) -> None:
    """Write a file atomically: complete or not at all."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a file atomically: complete or not at all.

    Raises:
        BenchError: it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode())
    except OSError as error:
        raise BenchError(f"{path}: cannot be written: {error.strerror}") from error


def keep_result(name: str, content: Mapping[str, Any], page: str, folder: Path) -> None:
    """Write the JSON of a measurement and its page, NAME.json and NAME.md.

    Raises:
        BenchError: one cannot be written.
    """
    write_result(folder / f"{name}.json", content)
    write_text(folder / f"{name}.md", page)
