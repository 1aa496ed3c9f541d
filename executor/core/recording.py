"""Recorded flights: what readers of logs yield, and what they could not use."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from executor.core.messages import FlightMessage

Record = tuple[int, int, FlightMessage | None]
"""Microseconds on the log's own clock, the system that speaks (0 for the link as a whole), and what it says; None is
time that passes. A tuple, because a log has millions."""


@dataclass(slots=True)
class Skipped:
    """Counts of what could not be read, or not used."""

    garbage_runs: int = 0
    """Stretches of bytes that are no record."""
    bad_checksums: int = 0
    truncated: int = 0
    """Records that the end of the file cuts off."""
    unreadable: int = 0
    """Records of a known kind whose fields do not fit."""
    impossible: int = 0
    """Values that cannot be true: a place at 0, 0."""
    time_back: int = 0
    """How often the log's clock jumped back."""
    not_followed: int = 0
    """Messages of systems that are no known autopilot."""

    def __bool__(self) -> bool:
        """Return whether there was anything."""
        return any(self.counts().values())

    def counts(self) -> dict[str, int]:
        """Return the counts by their names."""
        return {name: getattr(self, name) for name in self.__slots__}


class RecordedFile(Protocol):
    """One log."""

    skipped: Skipped
    stations: set[int]
    """Systems that sent a ground station's HEARTBEAT."""
    heard: dict[int, int]
    """When anything of a system came last, in the log's microseconds, whether or not it was worth a record."""

    def records(self) -> Iterator[Record]:
        """Yield what it says, in its order."""
        ...
