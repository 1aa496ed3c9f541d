"""ArduPilot's DataFlash log (.BIN) to our messages, on the vehicle's own clock (TimeUS, microseconds since its boot).

pymavlink's reader follows the log's own formats. Older firmware has fewer fields; what is not there stays unknown.
"""

from __future__ import annotations

import io
import math
import os
import struct
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink import DFReader

from executor.adapters.logs.ardupilot_codes import MODE_REASONS, disarmed_by, failsafe_of
from executor.core import words
from executor.core.hearing.plausible import plausible
from executor.core.messages import (
    Actor,
    Battery,
    FlightMessage,
    Heartbeat,
    MissionCurrent,
    ModeChange,
    OwnFailsafe,
    Position,
    RcChannels,
    Setting,
    StatusText,
)
from executor.core.recording import RcWatch, Record, Skipped, is_wanted_setting
from executor.errors import LogError
from missions import ARDUPILOT

QUADROTOR = 2
SYSTEM = 1
"""Where the log does not say which system wrote it (MAV_SYSID, SYSID_THISMAV)."""
BEAT_USEC = 1_000_000
STANDBY, ACTIVE = 3, 4
EV_ARMED, EV_DISARMED = frozenset({10, 15, 28}), 11
"""LogEvent: armed, auto-armed and not-landed; a log that begins with the arming misses the first of them."""
ARMS = "Arming motors"
WANTED = ("MODE", "ARM", "EV", "ERR", "RCIN", "BAT", "CURR", "POS", "GPS", "XKF1", "MSG", "CMD", "PARM", "MISE")
CHANNELS = 14
SYSTEM_PARAMETERS = frozenset({"MAV_SYSID", "SYSID_THISMAV"})
STDERR = 2
"""The descriptor, which C writes to."""
FAILURE = 2
"""MAV_SEVERITY of a text that a .BIN keeps without one."""


@dataclass(slots=True)
class DataFlashFile:
    """A .BIN being read once."""

    path: Path
    skipped: Skipped = field(default_factory=Skipped)
    stations: set[int] = field(default_factory=set)
    heard: dict[int, int] = field(default_factory=dict)
    system: int = SYSTEM
    _mode: int = 0
    _armed: bool = False
    _heartbeat: bool = False
    """Whether the mode is known."""
    _beat_usec: int = -BEAT_USEC
    _velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _items: int = 0
    _rc: RcWatch = field(default_factory=RcWatch)
    _noise: io.StringIO = field(default_factory=io.StringIO)
    """What the library prints."""

    def records(self) -> Iterator[Record]:
        """Yield what the log says, in its order, with a heartbeat a second.

        Raises:
            LogError: not such a log at all.
        """
        if self.path.stat().st_size == 0:
            return  # pymavlink maps the file into memory, which an empty one cannot be
        try:
            with (
                warnings.catch_warnings(), redirect_stdout(self._noise), redirect_stderr(self._noise),
                _passed_over(self.skipped),
            ):  # fmt: skip
                warnings.simplefilter("ignore")
                log = DFReader.DFReader_binary(str(self.path), zero_time_base=True)
        except (OSError, ValueError, IndexError, KeyError, struct.error, TypeError) as error:
            raise LogError(f"{self.path}: expected a DataFlash log of ArduPilot: {error}") from error
        try:
            self.system = self._sysid(log)
            yield from self._all(log)
        finally:
            log.data_map.close()
            log.filehandle.close()

    def _all(self, log: Any) -> Iterator[Record]:  # noqa: ANN401 - pymavlink's classes are untyped
        while True:
            try:
                with redirect_stderr(self._noise), redirect_stdout(self._noise):
                    message = log.recv_match(type=list(WANTED))
            except (ValueError, IndexError, KeyError, struct.error, TypeError, UnicodeDecodeError):
                # pymavlink goes on behind the message whose fields do not fit.
                self.skipped.unreadable += 1
                if self.skipped.unreadable > MOST_UNREADABLE:
                    return
                continue
            if self._noise.tell():  # pymavlink prints a line for each byte that it passes over
                self.skipped.garbage_runs += 1
                self._noise.seek(0)
                self._noise.truncate()
            if message is None:
                return
            yield from self._read(message)

    def _sysid(self, log: Any) -> int:  # noqa: ANN401 - pymavlink's classes are untyped
        for name in SYSTEM_PARAMETERS:
            value = log.params.get(name)
            if value:
                return int(value)
        return SYSTEM

    def _read(self, message: Any) -> Iterator[Record]:  # noqa: ANN401
        t_usec = getattr(message, "TimeUS", None)
        if t_usec is None:
            return
        kind = message.get_type()
        if kind == "PARM" and message.Name in SYSTEM_PARAMETERS and message.Value:
            self.system = int(message.Value)
        try:
            told = _READERS[kind](self, message) if kind in _READERS else None
        except (AttributeError, ValueError, TypeError):
            self.skipped.unreadable += 1
            return
        if self._heartbeat and t_usec - self._beat_usec >= BEAT_USEC:
            self._beat_usec = t_usec
            yield t_usec, self.system, self._beat()
        if told is not None and plausible(told) is not told:
            self.skipped.impossible += 1
        elif told is not None and self._heartbeat:
            yield t_usec, self.system, told
        if kind == "MODE" and hasattr(message, "Rsn"):
            yield t_usec, self.system, ModeChange(self._mode, MODE_REASONS.get(message.Rsn, Actor.UNKNOWN))
        elif kind == "ARM" and not self._armed and (why := disarmed_by(getattr(message, "Method", 0))) is not None:
            yield t_usec, self.system, why

    def _beat(self) -> Heartbeat:
        return Heartbeat(ARDUPILOT.number, self._mode, self._armed, ACTIVE if self._armed else STANDBY, QUADROTOR)

    def _moded(self, message: Any) -> Heartbeat:  # noqa: ANN401
        self._mode, self._heartbeat = int(getattr(message, "ModeNum", message.Mode)), True
        return self._beat()

    def _happened(self, message: Any) -> Heartbeat | None:  # noqa: ANN401
        if message.Id not in EV_ARMED and message.Id != EV_DISARMED:
            return None
        armed = message.Id != EV_DISARMED
        if armed == self._armed:
            return None
        self._armed = armed
        return self._beat()

    def _armed_or_not(self, message: Any) -> Heartbeat:  # noqa: ANN401
        self._armed = bool(message.ArmState)
        return self._beat()

    def _failed(self, message: Any) -> OwnFailsafe | None:  # noqa: ANN401
        return failsafe_of(int(message.Subsys), int(message.ECode))

    def _transmitted(self, message: Any) -> RcChannels | None:  # noqa: ANN401
        values = tuple(int(getattr(message, f"C{one}", 0)) for one in range(1, CHANNELS + 1))
        return self._rc.news(message.TimeUS, values)

    def _set(self, message: Any) -> Setting | None:  # noqa: ANN401
        return Setting(message.Name, float(message.Value)) if is_wanted_setting(message.Name) else None

    def _powered(self, message: Any) -> Battery:  # noqa: ANN401
        remaining = getattr(message, "RemPct", None)
        consumed = getattr(message, "CurrTot", None)
        # MONITOR 3 has no current: both counters stay at nothing.
        counts = consumed is not None and (consumed > 0 or message.Curr > 0)
        return Battery(
            battery=int(getattr(message, "Inst", getattr(message, "Instance", 0))),
            remaining_pct=float(remaining) if remaining is not None and 0 <= remaining <= 100 else None,
            voltage_v=float(message.Volt) or None,
            current_a=float(message.Curr) if counts and message.Curr >= 0 else None,
            consumed_ah=consumed / 1e3 if counts and consumed is not None else None,
            charge_state=0,
            faults=0,
        )

    def _placed(self, message: Any) -> Position | None:  # noqa: ANN401
        if message.Lat == 0 and message.Lng == 0:
            self.skipped.impossible += 1
            return None
        north, east, down = self._velocity
        return Position(
            boot_s=message.TimeUS / 1e6,
            lat_deg=message.Lat,
            lon_deg=message.Lng,
            alt_msl_m=message.Alt,
            alt_rel_m=message.RelHomeAlt,
            north_m_s=north,
            east_m_s=east,
            down_m_s=down,
            heading_deg=None,
        )

    def _moved(self, message: Any) -> None:  # noqa: ANN401
        if getattr(message, "C", 0) == 0:
            self._velocity = (message.VN, message.VE, message.VD)

    def _flown_by_satellites(self, message: Any) -> None:  # noqa: ANN401

        course = math.radians(message.GCrs)
        self._velocity = (message.Spd * math.cos(course), message.Spd * math.sin(course), message.VZ)

    def _said(self, message: Any) -> StatusText:  # noqa: ANN401
        if message.Message == ARMS:
            self._armed = True
        return StatusText(FAILURE, words.shown(str(message.Message)))

    def _item(self, message: Any) -> MissionCurrent:  # noqa: ANN401
        self._items = int(message.CTot)
        return MissionCurrent(int(message.CNum), max(0, self._items - 1) or None)


@contextmanager
def _passed_over(skipped: Skipped) -> Iterator[None]:
    """Count the stretches that pymavlink's indexer passes over; it is C, and tells the standard error of each byte."""
    sys.stderr.flush()
    kept = os.dup(STDERR)
    with tempfile.TemporaryFile() as told:
        os.dup2(told.fileno(), STDERR)
        try:
            yield
        finally:
            sys.stderr.flush()
            os.dup2(kept, STDERR)
            os.close(kept)
        told.seek(0)
        last = -2
        for line in told:
            if line.startswith((b"bad header", b"unknown msg type")):
                at = int(line.rpartition(b" ")[2])
                skipped.garbage_runs += at != last + 1
                last = at


MOST_UNREADABLE = 100_000
_READERS: dict[str, Callable[[DataFlashFile, Any], FlightMessage | None]] = {
    "MODE": DataFlashFile._moded,  # noqa: SLF001
    "EV": DataFlashFile._happened,  # noqa: SLF001
    "ARM": DataFlashFile._armed_or_not,  # noqa: SLF001
    "ERR": DataFlashFile._failed,  # noqa: SLF001
    "RCIN": DataFlashFile._transmitted,  # noqa: SLF001
    "PARM": DataFlashFile._set,  # noqa: SLF001
    "BAT": DataFlashFile._powered,  # noqa: SLF001
    "CURR": DataFlashFile._powered,  # noqa: SLF001
    "POS": DataFlashFile._placed,  # noqa: SLF001
    "GPS": DataFlashFile._flown_by_satellites,  # noqa: SLF001
    "XKF1": DataFlashFile._moved,  # noqa: SLF001
    "MSG": DataFlashFile._said,  # noqa: SLF001
    "MISE": DataFlashFile._item,  # noqa: SLF001
}
