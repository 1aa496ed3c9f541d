"""Read files that do not fit into memory, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TypeVar

Found = TypeVar("Found")

PIECE = 1 << 18
"""Bytes read at a time."""


def read_in_chunks(path: Path, read: Callable[[bytes, bool], Generator[Found, None, int]]) -> Iterator[Found]:
    """Yield what is found in a file's pieces, each of which begins with what the one before left over.

    Args:
        path: The file.
        read: Yields what is in a piece and returns where the rest begins; the flag says that nothing follows.
    """
    with path.open("rb") as file:
        buffer, rest = b"", 0
        while True:
            more = file.read(PIECE)
            buffer = buffer[rest:] + more
            rest = yield from read(buffer, not more)
            if not more:
                return
