"""PX4's ULog (.ulg) to our messages, on the vehicle's own clock (microseconds since its boot).

pyulog reads the file whole; only the topics that are used are kept.
"""

from __future__ import annotations

import heapq
import io
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pyulog import ULog

from executor.core import words
from executor.core.hearing.plausible import plausible
from executor.core.messages import Battery, FlightMessage, Heartbeat, LandedState, MissionCurrent, Position, StatusText
from executor.core.recording import Record, Skipped
from executor.errors import LogError
from missions import PX4

QUADROTOR = 2
STANDBY, ACTIVE = 3, 4
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
    "mission_result",
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
        for t_usec, read, row in heapq.merge(*streams, key=lambda one: one[0]):
            try:
                told = read(self, t_usec, row)
            except (KeyError, ValueError, TypeError):
                self.skipped.unreadable += 1
                continue
            if told is not None and plausible(told) is not told:
                self.skipped.impossible += 1
            elif told is not None:
                yield t_usec, system, told

    def _system(self, log: ULog) -> int:
        for dataset in log.data_list:
            if dataset.name == "vehicle_status" and len(dataset.data.get("system_id", ())):
                return int(dataset.data["system_id"][-1]) or 1
        return int(log.initial_parameters.get("MAV_SYS_ID", 1))

    def _status(self, t_usec: int, row: Row) -> Heartbeat | None:
        mode = MODES.get(int(row["nav_state"]), 0)
        beat = (mode, int(row["arming_state"]) == ARMED)
        if beat == self._beat and t_usec - self._beat_usec < BEAT_USEC:
            return None
        self._beat, self._beat_usec = beat, t_usec
        return Heartbeat(PX4.number, mode, beat[1], ACTIVE if beat[1] else STANDBY, QUADROTOR)

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

    def _progressed(self, _: int, row: Row) -> MissionCurrent | None:
        item = (int(row["seq_current"]), int(row["seq_total"]))
        if item == self._item or item[1] <= 0:
            return None
        self._item = item
        return MissionCurrent(*item)

    def said(self, _: int, row: Row) -> StatusText:
        """Read a text."""
        return StatusText(int(row["severity"]), words.shown(str(row["text"])))


Reader = Callable[[UlogFile, int, Row], FlightMessage | None]


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


_READERS: dict[str, Reader] = {
    "vehicle_status": UlogFile._status,  # noqa: SLF001
    "battery_status": UlogFile._battery,  # noqa: SLF001
    "vehicle_local_position": UlogFile._moved,  # noqa: SLF001
    "vehicle_global_position": UlogFile._placed,  # noqa: SLF001
    "vehicle_land_detected": UlogFile._touched,  # noqa: SLF001
    "mission_result": UlogFile._progressed,  # noqa: SLF001
}
