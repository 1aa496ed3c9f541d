"""ArduPilot's DataFlash log (.BIN, or .log as text) to our messages, on the vehicle's own clock: time since its boot.

What a log does not say at once, which system and which vehicle wrote it, is looked for before it is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from executor.adapters.logs.ardupilot_boot import NO_MODE, READERS, WANTED, ArduPilotBoot
from executor.adapters.logs.dataflash_rows import BinaryRows, Fields, Row, TextRows, WantedColumns
from executor.core.interface.messages import ListedItem, VehicleSetting
from executor.core.interface.recorded_log import Record, RecordedFile, SkippedRecords
from executor.core.telemetry.plausibility import filter_implausible
from executor.errors import LogError

SYSTEM = 1
"""Where the log does not say which system wrote it (MAV_SYSID, SYSID_THISMAV)."""
SYSTEM_PARAMETERS = frozenset({"MAV_SYSID", "SYSID_THISMAV"})
MOST_SYSTEMS = 256
BEAT_USEC = 1_000_000
LATE_USEC = 5_000_000
"""Records of one boot are out of order by less."""
LEAP_USEC = 600_000_000
AGREES_USEC = 60_000_000
"""A clock that leaps by more than ten minutes is believed if the next record agrees."""
SURVEY_ROWS = 20_000
"""Parameters and texts at the beginning in which a log says who wrote it."""
MOST_HELD = 5000
TOLD_ONCE = frozenset({"MODE", "EV", "ERR", "PARM", "MSG"})
"""What is kept of the time before the first fix in a log that has no other clock than the satellites'."""
FIXED = 3
COPTER = 2
"""MAV_TYPE: the log does not say how many rotors a copter has."""
FIRMWARE = re.compile(r"(Ardu|APM:? ?)?(?P<name>Copter|Plane|Rover|rover2|Sub|Blimp|AntennaTracker)\b.* V?\d")
TYPES = {"Copter": COPTER, "Plane": 1, "Rover": 10, "rover2": 10, "Sub": 12, "Blimp": 7, "AntennaTracker": 5}
"""MAV_TYPE of a firmware."""
OTHERS_KINDS = {"TECS": 1, "AETR": 1, "STER": 10}
"""Records that only an aeroplane's or a rover's firmware describes."""
SDLOG2 = frozenset({"TIME", "STAT", "GPOS"})
"""PX4's logs before version 1.5 are of the same form, with records of their own."""
SURVEYED = {
    name: WantedColumns(frozenset(columns.split())) for name, columns in (("MSG", "Message"), ("PARM", "Name Value"))
}


@dataclass(slots=True)
class DataFlashFile(RecordedFile):
    """A log being read once."""

    text: bool = False
    system: int = SYSTEM
    vehicle_type: int = COPTER
    _now_usec: int | None = None
    _held: list[tuple[str, Fields]] = field(default_factory=list)
    """Records without a time, before the first one that has one."""
    _doubted: tuple[int, str, Fields] | None = None
    """A record whose time is far from that of the others."""
    _boot: ArduPilotBoot = field(default_factory=ArduPilotBoot)
    _beat_usec: int = 0

    def read_records(self) -> Iterator[Record]:
        """Yield what the log says, in its order, with a heartbeat a second.

        Raises:
            LogError: not such a log at all.
        """
        if self.path.stat().st_size == 0:
            self.notes.append("it is empty")
            return
        if not self._find_writer():
            return
        wanted = {kind: replace(one, every_usec=0) for kind, one in WANTED.items()} if self.every_record else WANTED
        rows = self._open_rows(wanted, self.skipped)
        for row in rows:
            for t_usec, kind, fields in self._attach_time(row, rows):
                yield from self._read(t_usec, kind, fields)
        if not rows.kinds:
            raise LogError(
                f"{self.path}: expected a DataFlash log of ArduPilot: it describes none of its records (FMT)"
            )
        if self._doubted is not None:
            self.skipped.impossible += 1
        if not self._boot.begun and self._now_usec is not None:
            self.notes.append("it ends before it says a mode or lasts ten seconds")
        elif self._boot.mode == NO_MODE:
            self.notes.append("no MODE in it: nobody knows in which mode it flew")

    def _open_rows(self, wanted: Mapping[str, WantedColumns], skipped: SkippedRecords) -> BinaryRows | TextRows:
        return TextRows(self.path, wanted, skipped) if self.text else BinaryRows(self.path, wanted, skipped)

    def _find_writer(self) -> bool:
        """Look for who wrote the log; returns whether it can be read."""
        rows, system, kind = self._open_rows(SURVEYED, SkippedRecords()), None, None
        for number, (_, name, fields) in enumerate(rows):
            if name == "PARM" and fields.get("Name") in SYSTEM_PARAMETERS and 0 < fields.get("Value", 0) < MOST_SYSTEMS:
                system = system or int(fields["Value"])
            elif name == "MSG" and (found := FIRMWARE.match(fields.get("Message", ""))) is not None:
                kind = kind or TYPES[found["name"]]
            if (system and kind) or number > SURVEY_ROWS:
                break
        self.system = system or SYSTEM
        self.vehicle_type = kind or next((OTHERS_KINDS[one] for one in OTHERS_KINDS if one in rows.kinds), COPTER)
        if rows.kinds >= SDLOG2 and "MODE" not in rows.kinds:
            self.notes.append("it is a log of PX4 before version 1.5 (sdlog2), which is not read")
            return False
        return True

    def _attach_time(self, row: Row, rows: BinaryRows | TextRows) -> Iterable[tuple[int, str, Fields]]:
        """Return a record with its time, and before it one whose time is no longer doubted; nothing while it is."""
        t_usec, kind, fields = row if row[0] is not None else _with_satellites_time(row, rows)
        if self._now_usec is None:
            if t_usec is not None or kind in TOLD_ONCE or rows.is_timed:
                self._held.append((kind, fields))
            if t_usec is None and len(self._held) < MOST_HELD:
                return []
            self._now_usec = t_usec or 0
            held, self._held = self._held, []
            return [(self._now_usec, *one) for one in held]
        if t_usec is None:
            return [(self._now_usec, kind, fields)]
        ahead_usec = t_usec - self._now_usec
        if -LATE_USEC <= ahead_usec <= LEAP_USEC:
            if self._doubted is not None:
                self.skipped.impossible += 1
                self._doubted = None
            self._now_usec = max(t_usec, self._now_usec)
            return [(self._now_usec, kind, fields)]
        before, self._doubted = self._doubted, (t_usec, kind, fields)
        if before is None or abs(t_usec - before[0]) > AGREES_USEC:
            self.skipped.impossible += before is not None
            return []
        if t_usec < self._now_usec:
            self._boot = ArduPilotBoot()  # another boot: it was neither armed nor in a mode
        self._now_usec, self._doubted = t_usec, None
        return [(min(before[0], t_usec), *before[1:]), (t_usec, kind, fields)]

    def _read(self, t_usec: int, kind: str, fields: Fields) -> Iterator[Record]:
        boot = self._boot
        try:
            told = READERS[kind](boot, t_usec, fields)
        except (KeyError, ValueError, TypeError, OverflowError):
            self.skipped.unreadable += 1
            return
        if not boot.begun and not boot.begin_when_known(t_usec):
            if isinstance(told, VehicleSetting | ListedItem):
                yield t_usec, self.system, told
            return
        if boot.changed or t_usec - self._beat_usec >= BEAT_USEC:
            self._beat_usec, boot.changed = t_usec, False
            yield t_usec, self.system, boot.build_heartbeat(self.vehicle_type)
        for one in told if isinstance(told, tuple) else () if told is None else (told,):
            if (known := filter_implausible(one)) is not one:
                self.skipped.impossible += 1
            if known is not None:
                yield t_usec, self.system, known


def _with_satellites_time(row: Row, rows: BinaryRows | TextRows) -> Row:
    """Return a record of a log of 2013, which has no time of its own, with that of its fix."""
    _, kind, fields = row
    if kind != "GPS" or rows.is_timed or fields.get("Status", 0) < FIXED:
        return row
    return 1000 * int(fields.get("TimeMS", fields.get("Time", 0))) or None, kind, fields
