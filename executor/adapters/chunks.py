"""Read files that do not fit into memory in pieces."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TypeVar

Found = TypeVar("Found")

PIECE = 1 << 18
"""Bytes read at a time."""


def read_in_chunks(path: Path, read: Callable[[bytes, bool], Generator[Found, None, int]]) -> Iterator[Found]:
    """Yield the results from a file's pieces; each piece begins with the unread rest of the one before.

    Args:
        path: The file.
        read: Yields the results of a piece and returns where its rest begins; the flag marks the last piece.
    """
    with path.open("rb") as file:
        buffer, rest = b"", 0
        while True:
            more = file.read(PIECE)
            buffer = buffer[rest:] + more
            rest = yield from read(buffer, not more)
            if not more:
                return
