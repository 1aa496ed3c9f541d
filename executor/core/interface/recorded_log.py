"""Define what log readers yield of recorded flights, and count the records they could not use."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from executor.core.interface.messages import FlightMessage

Record = tuple[int, int, FlightMessage | None]
"""Microseconds of the log's clock, the system id (0 for the link as a whole), and the message; None for the passing of
time. A tuple, because a log has millions."""


@dataclass(slots=True)
class SkippedRecords:
    """Counts of records that could not be read or used."""

    garbage_runs: int = 0
    """Stretches of bytes that are no record."""
    bad_checksums: int = 0
    truncated: int = 0
    """Records cut off by the end of the file."""
    unreadable: int = 0
    """Records of a known kind whose fields do not fit."""
    impossible: int = 0
    """Values that cannot be true: a position at 0, 0."""
    time_back: int = 0
    """How often the log's clock jumped back."""
    gaps: int = 0
    """Gaps without any record: minutes in a link's log, seconds in a vehicle's own."""
    dropouts: int = 0
    """Times the autopilot could not write its own log."""
    before_heartbeat: int = 0
    """Messages of a system before its first HEARTBEAT."""
    not_followed: int = 0
    """Messages of systems that are no supported autopilot."""

    def __bool__(self) -> bool:
        return any(self.counts().values())

    def counts(self) -> dict[str, int]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(slots=True)
class RecordedFile(ABC):
    """One log, read once from start to end."""

    on_board: ClassVar[bool] = True
    """Whether the vehicle wrote it itself: then its link cannot be judged."""
    path: Path
    every_record: bool = field(default=False, kw_only=True)
    """Whether to yield all records; otherwise each kind only as often as a watchpoint needs it."""
    skipped: SkippedRecords = field(default_factory=SkippedRecords, kw_only=True)
    stations: set[int] = field(default_factory=set, kw_only=True)
    """Systems that sent a ground station's HEARTBEAT."""
    heard: dict[int, int] = field(default_factory=dict, kw_only=True)
    """Time of each system's last message, in the log's microseconds, recorded or not."""

    notes: list[str] = field(default_factory=list, kw_only=True)
    """Oddities of the log, in words; complete once it has been read."""

    @abstractmethod
    def read_records(self) -> Iterator[Record]:
        """Yield the records in order."""


MODE_COMMANDS = frozenset({16, 17, 18, 19, 20, 21, 22, 176, 185, 192, 193, 252, 300, 400})
"""MAV_CMD with which a ground station changes the mode, or the vehicle's action in it."""
_SETTINGS = re.compile(
    r"(BATT\d*|BAT\d*|FLTMODE\d*|MODE|FS|RC_MAP|COM|NAV|GF|FENCE|CBRK)_|FLTMODE\d$|RC\d+_OPTION$|CH\d+_OPT$|ARMING|SYSID_|"
    r"MAV_|MOT_BAT|RTL_|LAND_SPEED|FRAME"
)


def is_wanted_setting(name: str) -> bool:
    """Return whether a parameter concerns modes, switches, batteries or failsafes; there are a thousand."""
    return _SETTINGS.match(name) is not None
