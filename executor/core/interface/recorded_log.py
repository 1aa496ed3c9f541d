"""Recorded flights: what readers of logs yield, and what they could not use."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from executor.core.interface.messages import FlightMessage

Record = tuple[int, int, FlightMessage | None]
"""Microseconds on the log's own clock, the system that speaks (0 for the link as a whole), and what it says; None is
time that passes. A tuple, because a log has millions."""


@dataclass(slots=True)
class SkippedRecords:
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
    gaps: int = 0
    """How often nothing at all was recorded for minutes, or by a vehicle's own log for seconds."""
    dropouts: int = 0
    """How often the autopilot could not write its own log."""
    before_heartbeat: int = 0
    """Messages of a system before it said what it is."""
    not_followed: int = 0
    """Messages of systems that are no known autopilot."""

    def __bool__(self) -> bool:
        return any(self.counts().values())

    def counts(self) -> dict[str, int]:
        """Return the counts by their names."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(slots=True)
class RecordedFile(ABC):
    """One log, read once from its beginning to its end."""

    on_board: ClassVar[bool] = True
    """Whether the vehicle itself wrote it: then its link cannot be judged."""
    path: Path
    every_record: bool = field(default=False, kw_only=True)
    """Whether all that it says is wanted; else each kind only as often as some watchpoint needs it."""
    skipped: SkippedRecords = field(default_factory=SkippedRecords, kw_only=True)
    stations: set[int] = field(default_factory=set, kw_only=True)
    """Systems that sent a ground station's HEARTBEAT."""
    heard: dict[int, int] = field(default_factory=dict, kw_only=True)
    """When anything of a system came last, in the log's microseconds, whether or not it was worth a record."""

    notes: list[str] = field(default_factory=list, kw_only=True)
    """What is odd about it, in words; complete once it was read."""

    @abstractmethod
    def read_records(self) -> Iterator[Record]:
        """Yield what it says, in its order."""


MODE_COMMANDS = frozenset({16, 17, 18, 19, 20, 21, 22, 176, 185, 192, 193, 252, 300, 400})
"""MAV_CMD that a ground station changes a mode with, or what the vehicle does in it."""
_SETTINGS = re.compile(
    r"(BATT\d*|BAT\d*|FLTMODE\d*|MODE|FS|RC_MAP|COM|NAV|GF|FENCE|CBRK)_|FLTMODE\d$|RC\d+_OPTION$|CH\d+_OPT$|ARMING|SYSID_|"
    r"MAV_|MOT_BAT|RTL_|LAND_SPEED|FRAME"
)


def is_wanted_setting(name: str) -> bool:
    """Return whether a parameter says something of modes, switches, batteries or failsafes; there are a thousand."""
    return _SETTINGS.match(name) is not None
