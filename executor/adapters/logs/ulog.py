"""PX4's ULog (.ulg) to our messages, on the vehicle's own clock (microseconds since its boot).

pyulog reads the file whole; only the topics that are used are kept.
"""

from __future__ import annotations

import heapq
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pyulog import ULog

from executor.adapters.logs.px4_codes import (
    CRITICAL,
    DO_SET_MODE,
    FAILED,
    MODE_SWITCHES,
    ORDERED_USEC,
    REQUESTED_BY,
    SWITCH_MODE,
    UNNAMED,
    VALID,
)
from executor.core import words
from executor.core.hearing.plausible import plausible
from executor.core.messages import (
    Actor,
    Battery,
    FlightMessage,
    Heartbeat,
    LandedState,
    MissionCurrent,
    ModeChange,
    OrderSeen,
    OwnFailsafe,
    Position,
    RcChannels,
    Setting,
    StatusText,
)
from executor.core.recording import MODE_COMMANDS, RcWatch, Record, Skipped, is_wanted_setting
from executor.errors import LogError
from missions import PX4

QUADROTOR = 2
STANDBY, ACTIVE, CRITICAL_STATE = 3, 4, 5
HALF = 128
CHANNELS = 18
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
ARMED = 2
"""vehicle_status.arming_state."""
BEAT_USEC = 950_000
MODES: Mapping[int, int] = {
    0: 1 << 16, 1: 2 << 16, 2: 3 << 16, 3: 4 << 24 | 4 << 16, 4: 3 << 24 | 4 << 16, 5: 5 << 24 | 4 << 16,
    10: 5 << 16, 12: 6 << 24 | 4 << 16, 13: 10 << 16, 14: 6 << 16, 15: 7 << 16, 17: 2 << 24 | 4 << 16,
    18: 6 << 24 | 4 << 16, 19: 8 << 24 | 4 << 16, 20: 9 << 24 | 4 << 16,
}  # fmt: skip
"""vehicle_status.nav_state (VehicleStatus.msg) to custom_mode (px4_custom_mode.h); 12, DESCEND, is a landing."""
TOPICS = (
    "vehicle_status", "battery_status", "vehicle_global_position", "vehicle_local_position", "vehicle_land_detected",
    "mission_result", "failsafe_flags", "vehicle_status_flags", "vehicle_command", "action_request", "input_rc",
    "manual_control_switches", "manual_control_setpoint",
)  # fmt: skip
WARNINGS: Mapping[int, int] = {0: 1, 1: 2, 2: 3, 3: 4, 4: 5}
"""battery_status.warning to MAV_BATTERY_CHARGE_STATE: none, low, critical, emergency, failed."""
LONGEST_USEC = 3 * 86400 * 1_000_000
"""No flight lasts longer: a time beyond is damaged."""
Row = Mapping[str, Any]


@dataclass(slots=True)
class UlogFile:
    """A .ulg being read."""

    path: Path
    skipped: Skipped = field(default_factory=Skipped)
    stations: set[int] = field(default_factory=set)
    heard: dict[int, int] = field(default_factory=dict)
    _beat_usec: int = -BEAT_USEC
    _beat: tuple[int, bool] | None = None
    _local: Row = field(default_factory=dict)
    _landed: bool | None = None
    _item: tuple[int, int] | None = None
    _rc: RcWatch = field(default_factory=RcWatch)
    _failing: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Flags that are up, with kind and words."""
    _failed: OwnFailsafe | None = None
    """What acts now."""
    _asked: tuple[int, Actor] = (-ORDERED_USEC, Actor.UNKNOWN)
    """When a mode was asked for last, and by whom."""
    _switches: tuple[int, ...] | None = None
    _finished: bool = False

    def records(self) -> Iterator[Record]:
        """Yield what the log says, in the order of its time.

        Raises:
            LogError: not such a log at all.
        """
        try:
            # pyulog prints what it does not understand, which is no output of ours.
            with self.path.open("rb") as file, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                log = ULog(file, list(TOPICS))
        except Exception as error:
            raise LogError(f"{self.path}: expected a ULog of PX4: {error}") from error
        self.skipped.unreadable += bool(log.file_corruption)
        self.skipped.truncated += len(log.dropouts)
        system = self._system(log)
        streams = [_rows(dataset, _READERS[dataset.name]) for dataset in log.data_list if dataset.name in _READERS]
        streams.append(_texts(log))
        streams.append(_settings(log))
        for t_usec, read, row in heapq.merge(*streams, key=lambda one: one[0]):
            try:
                told = read(self, t_usec, row)
            except (KeyError, ValueError, TypeError):
                self.skipped.unreadable += 1
                continue
            for one in told if isinstance(told, tuple) else () if told is None else (told,):
                if plausible(one) is not one:
                    self.skipped.impossible += 1
                else:
                    yield t_usec, system, one

    def _system(self, log: ULog) -> int:
        for dataset in log.data_list:
            if dataset.name == "vehicle_status" and len(dataset.data.get("system_id", ())):
                return int(dataset.data["system_id"][-1]) or 1
        return int(log.initial_parameters.get("MAV_SYS_ID", 1))

    def _status(self, t_usec: int, row: Row) -> tuple[FlightMessage, ...]:
        mode = MODES.get(int(row["nav_state"]), 0)
        armed, acts = int(row["arming_state"]) == ARMED, bool(row.get("failsafe", False))
        self._flags(row)
        told: list[FlightMessage] = list(self._failsafe(acts=acts and armed))
        changed = self._beat is None or mode != self._beat[0]
        if changed:
            told.append(ModeChange(mode, self._who(t_usec, row, acts=acts)))
        beat = (mode, armed)
        if beat != self._beat or told or t_usec - self._beat_usec >= BEAT_USEC:
            self._beat, self._beat_usec = beat, t_usec
            status = CRITICAL_STATE if acts and armed else ACTIVE if armed else STANDBY
            told.append(Heartbeat(PX4.number, mode, armed, status, QUADROTOR))
        return tuple(told)

    def _who(self, t_usec: int, row: Row, *, acts: bool) -> Actor:
        """Return who chose a mode that has just changed."""
        if acts:
            return Actor.FAILSAFE
        if t_usec - self._asked[0] <= ORDERED_USEC:
            return self._asked[1]
        if int(row.get("executor_in_charge", 0)):
            return Actor.MISSION
        return Actor.UNKNOWN

    def _failsafe(self, *, acts: bool) -> Iterator[OwnFailsafe]:
        """Yield what began to act or ended; the flag that rose last is the reason."""
        if acts:
            kind, said = next(reversed(self._failing.values()), UNNAMED)
            if self._failed is None or (self._failed.what != kind and kind != UNNAMED[0]):
                self._failed = OwnFailsafe(kind, active=True, words=said)
                yield self._failed
        elif self._failed is not None:
            yield OwnFailsafe(self._failed.what, active=False, words=self._failed.words)
            self._failed = None

    def _flags(self, row: Row) -> None:
        """Note which flags are up, in the order in which they rose."""
        for name, meaning in FAILED.items():
            if name in row:
                self._raised(name, meaning, up=bool(row[name]))
        for name, meaning in VALID.items():
            if name in row:
                self._raised(name, meaning, up=not row[name])
        if "battery_warning" in row:
            self._raised("battery_warning", ("battery", "battery critical"), up=int(row["battery_warning"]) >= CRITICAL)

    def _raised(self, name: str, meaning: tuple[str, str], *, up: bool) -> None:
        if not up:
            self._failing.pop(name, None)
        elif name not in self._failing:
            self._failing[name] = meaning

    def _flagged(self, _: int, row: Row) -> None:
        self._flags(row)

    def _commanded(self, t_usec: int, row: Row) -> OrderSeen | None:
        command = int(row["command"])
        if command not in MODE_COMMANDS:
            return None
        if not row.get("from_external", True):
            self._asked = (t_usec, Actor.MISSION)  # the navigator flies an item: a return, a landing
            return None
        self._asked = (t_usec, Actor.GROUND_STATION)
        main, sub = row["param2"], row["param3"]
        named = command == DO_SET_MODE and 0 <= main < HALF and 0 <= sub < HALF
        mode = int(main) << 16 | int(sub) << 24 if named else None
        return OrderSeen(command, mode, int(row.get("source_system", 0)))

    def _requested(self, t_usec: int, row: Row) -> None:
        if int(row["action"]) == SWITCH_MODE:
            self._asked = (t_usec, REQUESTED_BY.get(int(row["source"]), Actor.UNKNOWN))

    def _switched(self, t_usec: int, row: Row) -> None:
        """Note that the pilot moved a switch of modes: before 1.13 nothing else tells."""
        switches = tuple(int(row[name]) for name in MODE_SWITCHES if name in row)
        if self._switches is not None and switches != self._switches:
            self._asked = (t_usec, Actor.PILOT)
        self._switches = switches

    def _transmitted(self, t_usec: int, row: Row) -> RcChannels | None:
        if row.get("rc_lost"):
            return None
        count = int(row["channel_count"])
        return self._rc.news(t_usec, tuple(int(row[f"values[{one}]"]) for one in range(min(count, CHANNELS))))

    def _battery(self, _: int, row: Row) -> Battery:
        remaining, volts, amperes = row["remaining"], row["voltage_v"], row["current_a"]
        discharged = row.get("discharged_mah", -1.0)
        cells = [row.get(f"voltage_cell_v[{cell}]", 0.0) for cell in range(14)]
        known = tuple(float(cell) for cell in cells if math.isfinite(cell) and 1.0 < cell < 5.0)
        sensed = math.isfinite(amperes) and amperes >= 0
        return Battery(
            battery=max(0, int(row.get("id", 1)) - 1),
            remaining_pct=100.0 * float(remaining) if 0.0 <= remaining <= 1.0 else None,
            voltage_v=float(volts) if math.isfinite(volts) and volts > 0 else None,
            current_a=float(amperes) if sensed else None,
            consumed_ah=float(discharged) / 1e3 if sensed and discharged >= 0 else None,
            charge_state=WARNINGS.get(int(row.get("warning", 0)), 0),
            faults=0,
            # Where cells are not measured PX4 divides the voltage by their number.
            cells_v=known if len(set(known)) > 1 else (),
        )

    def _moved(self, _: int, row: Row) -> None:
        self._local = row

    def _placed(self, t_usec: int, row: Row) -> Position | None:
        lat, lon = float(row["lat"]), float(row["lon"])
        if not (math.isfinite(lat) and math.isfinite(lon)) or (lat == 0 and lon == 0):
            self.skipped.impossible += 1
            return None
        down = float(self._local.get("z", 0.0))
        north, east, sink = (float(self._local.get(name, 0.0)) for name in ("vx", "vy", "vz"))
        return Position(t_usec / 1e6, lat, lon, float(row["alt"]), -down, north, east, sink, None)

    def _touched(self, _: int, row: Row) -> LandedState | None:
        landed = bool(row["landed"])
        if landed == self._landed:
            return None
        self._landed = landed
        return LandedState(landed)

    def _progressed(self, t_usec: int, row: Row) -> MissionCurrent | None:
        if row.get("finished") and not self._finished:
            self._asked = (t_usec, Actor.MISSION)
        self._finished = bool(row.get("finished"))
        item = (int(row["seq_current"]), int(row["seq_total"]))
        if item == self._item or item[1] <= 0:
            return None
        self._item = item
        return MissionCurrent(*item)

    def said(self, _: int, row: Row) -> StatusText:
        """Read a text."""
        return StatusText(int(row["severity"]), words.shown(_COLOUR.sub("", str(row["text"]))))

    def set_to(self, _: int, row: Row) -> Setting:
        """Read a parameter."""
        return Setting(row["name"], float(row["value"]))


Reader = Callable[[UlogFile, int, Row], FlightMessage | tuple[FlightMessage, ...] | None]


def _rows(dataset: Any, read: Reader) -> Iterator[tuple[int, Reader, Row]]:  # noqa: ANN401 - pyulog is untyped
    names = list(dataset.data)
    columns = [dataset.data[name] for name in names]
    times = dataset.data["timestamp"]
    for index in times.argsort(kind="stable"):  # in damaged files they are in any order
        t_usec = int(times[index])
        if not 0 < t_usec < LONGEST_USEC:
            continue
        yield t_usec, read, {name: column[index] for name, column in zip(names, columns, strict=True)}


def _texts(log: ULog) -> Iterator[tuple[int, Reader, Row]]:
    for text in log.logged_messages:
        level = text.log_level - ord("0") if text.log_level >= ord("0") else text.log_level
        yield int(text.timestamp), UlogFile.said, {"severity": level, "text": text.message}


def _settings(log: ULog) -> Iterator[tuple[int, Reader, Row]]:
    began = int(log.start_timestamp)
    for name, value in log.initial_parameters.items():
        if is_wanted_setting(name):
            yield began, UlogFile.set_to, {"name": name, "value": value}
    for t_usec, name, value in log.changed_parameters:
        if is_wanted_setting(name):
            yield int(t_usec), UlogFile.set_to, {"name": name, "value": value}


_READERS: dict[str, Reader] = {
    "vehicle_status": UlogFile._status,  # noqa: SLF001
    "battery_status": UlogFile._battery,  # noqa: SLF001
    "vehicle_local_position": UlogFile._moved,  # noqa: SLF001
    "vehicle_global_position": UlogFile._placed,  # noqa: SLF001
    "vehicle_land_detected": UlogFile._touched,  # noqa: SLF001
    "failsafe_flags": UlogFile._flagged,  # noqa: SLF001
    "vehicle_status_flags": UlogFile._flagged,  # noqa: SLF001
    "vehicle_command": UlogFile._commanded,  # noqa: SLF001
    "action_request": UlogFile._requested,  # noqa: SLF001
    "manual_control_switches": UlogFile._switched,  # noqa: SLF001
    "manual_control_setpoint": UlogFile._switched,  # noqa: SLF001
    "input_rc": UlogFile._transmitted,  # noqa: SLF001
    "mission_result": UlogFile._progressed,  # noqa: SLF001
}
