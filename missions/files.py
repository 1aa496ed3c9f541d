"""Read files that people edited or that were damaged; every defect is reported in one line."""

from __future__ import annotations

import json
import math
import os
import stat
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

MOST_FIGURE = 1e12
"""Largest number accepted; sums and squares of larger ones overflow."""


def read_text(path: Path, what: str, error: type[Exception]) -> str:
    """Return the UTF-8 text of a file, without the byte order mark that some editors add.

    Args:
        path: The file.
        what: The expected content, e.g. 'plan file'.
        error: Type to raise.
    """
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise error(f"{path}: file: expected a readable {what}: {reason.strerror}") from reason
    return decode_text(content, str(path), error)


def decode_text(content: bytes, source: str, error: type[Exception]) -> str:
    """Return bytes decoded as UTF-8, without a byte order mark."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise error(f"{source}: encoding: expected UTF-8 text, found other bytes at {reason.start}") from reason


def parse_json(text: str, source: str, error: type[Exception]) -> object:
    """Return the content of a JSON text.

    Args:
        text: Without a byte order mark.
        source: Its source, for messages.
        error: Type to raise.
    """
    try:
        content: object = json.loads(text)
    except json.JSONDecodeError as reason:
        raise error(f"{source}: line {reason.lineno}: expected JSON: {reason.msg}") from reason
    except RecursionError:
        raise error(f"{source}: content: {NESTED}") from None
    except ValueError as reason:  # Python does not parse integers of more than 4300 digits
        raise error(f"{source}: content: expected numbers of a usual size") from reason
    return content


def find_object(text: str) -> dict[str, Any]:
    """Return the JSON object in a text; empty if there is none, since the reader of the whole file reports why."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


NESTED = "expected lists and objects that are not nested hundreds deep"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically, also across a power loss or on a full disk.

    A symbolic link is kept and its target replaced; a non-regular file, e.g. a pipe, is written directly.

    Raises:
        OSError: it cannot be written; the previous content is unchanged.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    draft = path.with_name(path.name + ".part")
    try:
        with draft.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            draft.chmod(stat.S_IMODE(path.stat().st_mode))
        draft.replace(path)
    except OSError:
        draft.unlink(missing_ok=True)
        raise
    if sys.platform == "win32":
        return  # Windows cannot open folders
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name
    finally:
        os.close(folder)


def stamp_file(path: Path) -> tuple[int, int] | None:
    """Return a file's or folder's modification time and size, to detect changes; None if there is none."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size


def is_number(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a finite number; booleans and numbers beyond float are not."""
    most = sys.float_info.max
    return isinstance(value, int | float) and not isinstance(value, bool) and -most <= value <= most


def is_figure(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a plausible number for a place, a time or a share."""
    return is_number(value) and abs(value) <= MOST_FIGURE


def to_printable(text: str) -> str:
    """Return a name for display: on one line, without non-printable characters."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def json_text(content: object, separators: tuple[str, str] | None = None) -> str:
    """Return JSON on one line, with null for NaN and infinity, which JSON lacks."""
    try:
        return json.dumps(content, separators=separators, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(content), separators=separators, allow_nan=False)


def _finite(value: object) -> object:
    match value:
        case float():
            return value if math.isfinite(value) else None
        case dict():
            return {key: _finite(one) for key, one in value.items()}
        case list() | tuple():
            return [_finite(one) for one in value]
        case _:
            return value


def write_document(path: Path, document: Mapping[str, object]) -> None:
    """Write a JSON document atomically.

    Raises:
        OSError: it cannot be written.
        ValueError: a figure is NaN or infinite.
    """
    write_whole(path, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
