"""Read files that people wrote or that were damaged; every defect is one line."""

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
    """Return the text of a file in UTF-8, without the byte order mark that some editors put in front.

    Args:
        path: The file.
        what: What is expected there, such as 'plan file'.
        error: What to raise.
    """
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise error(f"{path}: file: expected a readable {what}: {reason.strerror}") from reason
    return decode_text(content, str(path), error)


def decode_text(content: bytes, source: str, error: type[Exception]) -> str:
    """Return the text that bytes are in UTF-8, without a byte order mark."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise error(f"{source}: encoding: expected UTF-8 text, found other bytes at {reason.start}") from reason


def parse_json(text: str, source: str, error: type[Exception]) -> object:
    """Return what a JSON text says.

    Args:
        text: Without a byte order mark.
        source: Where it comes from, for messages.
        error: What to raise.
    """
    try:
        content: object = json.loads(text)
    except json.JSONDecodeError as reason:
        raise error(f"{source}: line {reason.lineno}: expected JSON: {reason.msg}") from reason
    except RecursionError:
        raise error(f"{source}: content: {NESTED}") from None
    except ValueError as reason:  # Python does not read whole numbers of more than 4300 digits
        raise error(f"{source}: content: expected numbers of a usual size") from reason
    return content


def find_object(text: str) -> dict[str, Any]:
    """Return the JSON object that a text is; an empty one where it is none, as a reader of the whole file explains."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


NESTED = "expected lists and objects that are not nested hundreds deep"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all, after a power loss or on a full disk too.

    A link stays one, and its file is replaced; what is no file, such as a pipe, is written to as it is.

    Raises:
        OSError: it cannot be written; what was there before is untouched.
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
        return  # which opens no folder
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name
    finally:
        os.close(folder)


def stamp_file(path: Path) -> tuple[int, int] | None:
    """Return when a file or folder was written, and its size: another one whenever it is; None where there is none."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size


def is_number(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a finite number; a boolean is none, nor is what no float can hold."""
    most = sys.float_info.max
    return isinstance(value, int | float) and not isinstance(value, bool) and -most <= value <= most


def is_figure(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a number that a place, a time or a share can have."""
    return is_number(value) and abs(value) <= MOST_FIGURE


def to_printable(text: str) -> str:
    """Return a name for people: on one line, without what a terminal would not show."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def json_text(content: object, separators: tuple[str, str] | None = None) -> str:
    """Return JSON on one line, in which a number that is not finite is null: JSON has no word for it."""
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
    """Write a JSON document, as a whole or not at all.

    Raises:
        OSError: it cannot be written.
        ValueError: a figure is NaN or infinite.
    """
    write_whole(path, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
