"""A telemetry log (.tlog) read with pymavlink: each vehicle's own reports."""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from benchmarks.witness.log_evidence import (
    SECOND,
    LogEvidence,
    LogLine,
    ModeSet,
    MotionSample,
    PowerReport,
    Silence,
    TransmitterMove,
    note_change,
)

STAMP = 8
DAYS_USEC = 30 * 86400 * SECOND
"""A time stamp farther from the previous one is damage."""
SILENT_USEC = 2 * SECOND
BOOT_TIMED = frozenset({mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT})
LOOKS_USEC = 5 * SECOND
MIDST_USEC = SECOND // 2
SWITCH_BANDS = (1231, 1361, 1491, 1621, 1750)
"""Where ArduPilot's mode switch changes its position (RC_Channel::read_6pos_switch), microseconds."""
MOVED_US = 250
"""Change of an auxiliary switch."""
COPTERS = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
AUTOPILOTS = frozenset({3, 12})
STATION = 6
MODE_ORDERS = frozenset({11, 16, 17, 18, 19, 20, 21, 22, 85, 176, 185, 192, 193, 252, 300, 400})
"""Commands that change a mode: SET_MODE, whose acknowledgement has the message's own number (11), and commands."""
MODE_SWITCH = ("FLTMODE_CH", "RC_MAP_FLTMODE", "RC_MAP_MODE_SW")
ARDUPILOT_SWITCH = 5
CHANNELS = 8
FIXED = 3
SEA_LEVEL_HPA = 1013.25
OVERTAKEN, SAME = 128, 255
"""A sequence number ahead by more than this is out of order, or a repeat."""


def read_telemetry(path: Path) -> dict[int, LogEvidence]:
    """Return a telemetry log's evidence, by system."""
    reading = _Reading()
    for t_usec, frame in on_vehicles_clocks(list(read_tlog_frames(path.read_bytes()))):
        reading.read_frame(t_usec, frame)
    return reading.build_result()


def read_tlog_frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the records of a log; bytes between them are skipped."""
    at, end, last = 0, len(data), 0
    while at + STAMP + 8 <= end:
        size = _find_frame_size(data, at + STAMP)
        t_usec = int(struct.unpack_from(">Q", data, at)[0])
        after = at + STAMP + size
        following = after + STAMP >= end or _find_frame_size(data, after + STAMP)
        near_it = not last or abs(t_usec - last) < DAYS_USEC or _is_continuation(data, after, t_usec)
        if size and after <= end and following and near_it:
            last = t_usec
            yield t_usec, data[at + STAMP : after]
            at = after
        else:
            at += 1


def _is_continuation(data: bytes, at: int, t_usec: int) -> bool:
    """Return whether the record after one with an implausible time has nearly the same."""
    return at + STAMP <= len(data) and abs(int(struct.unpack_from(">Q", data, at)[0]) - t_usec) < SECOND


def on_vehicles_clocks(records: list[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    """Yield records with continuous times where the recorder's clock was set.

    A clock change shows in the attitudes and positions of the next seconds: each has its vehicle's own time, which from
    then on has another offset from the recorder's.
    """
    apart: dict[int, int] = {}
    shift = last = 0
    for number, (stamp, frame) in enumerate(records):
        leap = stamp + shift - last
        if last and not -SECOND <= leap < SILENT_USEC:
            shift -= _set_by(records, number, shift, apart, leap)
        last = stamp + shift
        told = _boot_usec(frame)
        if told is not None:
            apart[told[0]] = last - told[1]
        yield last, frame


def _set_by(records: list[tuple[int, bytes]], number: int, shift: int, apart: dict[int, int], leap: int) -> int:
    """Return by how much the recorder's clock was set before a record."""
    began, seen = records[number][0], list[int]()
    for stamp, frame in records[number:]:
        if abs(stamp - began) > LOOKS_USEC:
            break
        told = _boot_usec(frame)
        if told is not None and told[0] in apart:
            seen.append(stamp + shift - told[1] - apart[told[0]])
    if seen and max(seen) - min(seen) < SECOND and abs(seen[-1]) > SECOND and seen[-1] * leap > 0:
        return seen[-1]
    return leap if leap < -SECOND or leap > DAYS_USEC else 0


def _boot_usec(frame: bytes) -> tuple[int, int] | None:
    """Return a vehicle's system and time since boot, if a frame begins with that."""
    first = frame[0] == 0xFE
    number = frame[5] if first else int.from_bytes(frame[7:10], "little")
    if number not in BOOT_TIMED:
        return None
    begins = 6 if first else 10
    return frame[3 if first else 5], 1000 * int.from_bytes(frame[begins : begins + min(4, frame[1])], "little")


def _find_frame_size(data: bytes, at: int) -> int:
    """Return the length of the frame at this position; 0 without one."""
    if data[at] == 0xFE and at + 8 <= len(data):
        return data[at + 1] + 8
    if data[at] == 0xFD and at + 12 <= len(data):
        return data[at + 1] + 12 + (13 if data[at + 2] & 1 else 0)
    return 0


@dataclass(slots=True)
class _Vehicle:
    """State kept for one vehicle between messages."""

    told: LogEvidence
    heard_usec: int = 0
    channels: tuple[int, ...] = ()
    percent: float | None = None
    consumed_mah: float | None = None
    sequence: int | None = None


@dataclass(slots=True)
class _Reading:
    vehicles: dict[int, _Vehicle] = field(default_factory=dict)
    decoder: Any = field(default_factory=lambda: mav.MAVLink(None))
    stations: list[int] = field(default_factory=list)
    """Times at which ground stations were heard."""
    last_usec: int = 0

    def read_frame(self, t_usec: int, frame: bytes) -> None:
        first = frame[0] == 0xFE
        system, component = (frame[3], frame[4]) if first else (frame[5], frame[6])
        number = frame[5] if first else int.from_bytes(frame[7:10], "little")
        self.last_usec = t_usec
        if number not in _READ and system not in self.vehicles:
            return
        message = self._decode_frame(frame) if number in _READ else None
        if number in _READ and message is None:
            return
        if (
            message is not None
            and number == mav.MAVLINK_MSG_ID_HEARTBEAT
            and not self._register_vehicle(system, message)
        ):
            if message.type == STATION:
                self.stations.append(t_usec)
            return
        if message is not None and number in _ORDERED:
            self._record_order(t_usec, system, message)
        vehicle = self.vehicles.get(system)
        if vehicle is None or component not in {0, 1}:
            return
        self._record_heard_time(vehicle, t_usec)
        self._count_frames(vehicle, t_usec, frame[2] if first else frame[4])
        if message is not None and number in _TELLS:
            _TELLS[number](vehicle, t_usec, message)

    def _decode_frame(self, frame: bytes) -> Any:  # noqa: ANN401 - pymavlink is untyped
        try:
            return self.decoder.decode(bytearray(frame))
        except Exception:  # noqa: BLE001 - a damaged frame, whatever the library thinks of it
            return None

    def _register_vehicle(self, system: int, beat: Any) -> bool:  # noqa: ANN401
        if beat.autopilot not in AUTOPILOTS or beat.type not in COPTERS:
            return False
        if system not in self.vehicles:
            told = LogEvidence(system, ardupilot=beat.autopilot == 3, began_usec=self.last_usec)
            self.vehicles[system] = _Vehicle(told, heard_usec=self.last_usec)
        return True

    def _record_heard_time(self, vehicle: _Vehicle, t_usec: int) -> None:
        if t_usec - vehicle.heard_usec >= SILENT_USEC:
            vehicle.told.silences.append(self._build_silence(vehicle.heard_usec, t_usec))
        vehicle.heard_usec = vehicle.told.ended_usec = t_usec

    def _build_silence(self, from_usec: int, to_usec: int) -> Silence:
        """Return a silence, and whether a station was heard during it: otherwise the recorder may have paused."""
        first = bisect_left(self.stations, from_usec + MIDST_USEC)
        midst = first < len(self.stations) and self.stations[first] <= to_usec - MIDST_USEC
        return Silence(from_usec, to_usec, midst if self.stations else None)

    @staticmethod
    def _count_frames(vehicle: _Vehicle, t_usec: int, sequence: int) -> None:
        """Count received and missing frames, by sequence numbers."""
        minute = vehicle.told.frames.setdefault((t_usec - vehicle.told.began_usec) // (60 * SECOND), [0, 0])
        minute[0] += 1
        if vehicle.sequence is not None:
            missing = (sequence - vehicle.sequence - 1) % 256
            if missing < OVERTAKEN:
                minute[1] += missing
            elif missing != SAME:
                return  # out of order: it was counted as missing
        vehicle.sequence = sequence

    def _record_order(self, t_usec: int, system: int, message: Any) -> None:  # noqa: ANN401
        """Record a command to a vehicle, or a vehicle's answer to one."""
        number = message.get_msgId()
        if number == mav.MAVLINK_MSG_ID_COMMAND_ACK:
            if system in self.vehicles and message.result == 0 and message.command in MODE_ORDERS:
                words = f"COMMAND_ACK: {message.command} accepted"
                self.vehicles[system].told.orders.append(LogLine(t_usec, words))
            return
        target = getattr(message, "target_system", 0)
        if number != mav.MAVLINK_MSG_ID_SET_MODE and message.command not in MODE_ORDERS:
            return
        what = "SET_MODE" if number == mav.MAVLINK_MSG_ID_SET_MODE else f"command {message.command}"
        for known, vehicle in self.vehicles.items():
            if target in {0, known} and system != known:
                vehicle.told.orders.append(LogLine(t_usec, f"{what} of system {system}"))

    def build_result(self) -> dict[int, LogEvidence]:
        found = {}
        for system, vehicle in self.vehicles.items():
            told = vehicle.told
            if self.last_usec - vehicle.heard_usec >= SILENT_USEC:
                told.silences.append(self._build_silence(vehicle.heard_usec, self.last_usec))
            found[system] = told
        return found


def _record_stream_time(vehicle: _Vehicle, stream: str, t_usec: int) -> None:
    vehicle.told.streams.setdefault(stream, []).append(t_usec)


def _record_heartbeat(vehicle: _Vehicle, t_usec: int, beat: Any) -> None:  # noqa: ANN401
    if beat.autopilot not in AUTOPILOTS or beat.type == STATION:
        return
    told = vehicle.told
    _record_stream_time(vehicle, "HEARTBEAT", t_usec)
    note_change(told.armed, t_usec, bool(beat.base_mode & 128))
    if not told.modes or told.modes[-1].mode != beat.custom_mode:
        told.modes.append(ModeSet(t_usec, int(beat.custom_mode)))
    note_change(told.statuses, t_usec, int(beat.system_status))


def _record_text(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    words = message.text.rstrip("\0").strip()
    vehicle.told.texts.append(LogLine(t_usec, words, int(message.severity)))


def _record_place(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    _record_stream_time(vehicle, "position", t_usec)
    vehicle.told.note_height("GLOBAL_POSITION_INT", t_usec, message.alt / 1e3)
    vehicle.told.moments.append(
        MotionSample(t_usec, message.lat / 1e7, message.lon / 1e7, message.relative_alt / 1e3,
               math.hypot(message.vx, message.vy) / 100, -message.vz / 100)
    )  # fmt: skip


def _fix(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    if message.fix_type >= FIXED:
        vehicle.told.note_height("GPS_RAW_INT", t_usec, message.alt / 1e3)


def _record_switch(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    if message.press_abs > 0:
        height_m = 44_330.0 * (1.0 - (message.press_abs / SEA_LEVEL_HPA) ** 0.190263)  # of the standard atmosphere
        vehicle.told.note_height("SCALED_PRESSURE", t_usec, height_m)


def _record_position(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    vehicle.told.note_height("VFR_HUD", t_usec, float(message.alt))


def _record_attitude(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    upright = math.cos(message.roll) * math.cos(message.pitch)
    vehicle.told.tilts.append((t_usec, math.degrees(math.acos(max(-1.0, min(1.0, upright))))))


def _record_status(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    _record_stream_time(vehicle, "battery", t_usec)
    percent = message.battery_remaining
    vehicle.percent = float(percent) if 0 <= percent <= 100 else None
    vehicle.told.powers.append(
        PowerReport(t_usec, message.voltage_battery / 1e3 if 0 < message.voltage_battery < 65535 else None,
              message.current_battery / 100 if message.current_battery >= 0 else None, vehicle.consumed_mah,
              vehicle.percent)
    )  # fmt: skip


def _record_battery(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    _record_stream_time(vehicle, "battery", t_usec)
    if message.id == 0 and message.current_consumed >= 0:
        vehicle.consumed_mah = float(message.current_consumed)


def _record_channels(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    told = vehicle.told
    now = tuple(getattr(message, f"chan{number}_raw") for number in range(1, CHANNELS + 1))
    if not any(now):
        return
    before, vehicle.channels = vehicle.channels, now
    if not before:
        return
    chosen = next((int(told.settings[name]) for name in MODE_SWITCH if told.settings.get(name)), ARDUPILOT_SWITCH)
    for number in range(5, CHANNELS + 1):
        was, is_ = before[number - 1], now[number - 1]
        if not (800 < was < 2200 and 800 < is_ < 2200):
            continue
        turned = (
            _band_of(was) != _band_of(is_) and abs(was - is_) > 20 if number == chosen else abs(was - is_) > MOVED_US
        )
        if turned:
            name = "mode switch" if number == chosen else "a switch"
            told.switches.append(TransmitterMove(t_usec, f"{name} (channel {number}) from {was} to {is_}", number))


def _band_of(value: int) -> int:
    return sum(value >= edge for edge in SWITCH_BANDS)


def _record_mission_current(vehicle: _Vehicle, t_usec: int, message: Any) -> None:  # noqa: ANN401
    _record_stream_time(vehicle, "item", t_usec)
    note_change(vehicle.told.items, t_usec, int(message.seq))


def _record_parameter(vehicle: _Vehicle, _: int, message: Any) -> None:  # noqa: ANN401
    vehicle.told.settings[message.param_id.rstrip("\0")] = float(message.param_value)


_TELLS: dict[int, Callable[[_Vehicle, int, Any], None]] = {
    mav.MAVLINK_MSG_ID_HEARTBEAT: _record_heartbeat,
    mav.MAVLINK_MSG_ID_STATUSTEXT: _record_text,
    mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _record_place,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: _fix,
    mav.MAVLINK_MSG_ID_SCALED_PRESSURE: _record_switch,
    mav.MAVLINK_MSG_ID_VFR_HUD: _record_position,
    mav.MAVLINK_MSG_ID_ATTITUDE: _record_attitude,
    mav.MAVLINK_MSG_ID_SYS_STATUS: _record_status,
    mav.MAVLINK_MSG_ID_BATTERY_STATUS: _record_battery,
    mav.MAVLINK_MSG_ID_RC_CHANNELS: _record_channels,
    mav.MAVLINK_MSG_ID_RC_CHANNELS_RAW: _record_channels,
    mav.MAVLINK_MSG_ID_MISSION_CURRENT: _record_mission_current,
    mav.MAVLINK_MSG_ID_PARAM_VALUE: _record_parameter,
}
_ORDERED = frozenset({
    mav.MAVLINK_MSG_ID_COMMAND_ACK, mav.MAVLINK_MSG_ID_SET_MODE, mav.MAVLINK_MSG_ID_COMMAND_LONG,
    mav.MAVLINK_MSG_ID_COMMAND_INT,
})  # fmt: skip
_READ = _ORDERED | frozenset(_TELLS)
