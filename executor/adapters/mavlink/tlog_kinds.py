"""The messages that are read of a telemetry log: their checksums, their fields, and how often one is wanted.

What some watchpoint needs is unpacked field by field; `codec` stays the definition (a test holds the two together).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from executor.adapters.mavlink import px4_events
from executor.core.interface.messages import (
    Attitude,
    Battery,
    EstimatorStatus,
    FlightMessage,
    Gps,
    Heartbeat,
    HeightTarget,
    LandedState,
    MissionCurrent,
    MissionReached,
    Position,
    Radio,
    RcChannels,
    SystemStatus,
)

EVERY_USEC = 450_000
"""Of a battery's reports no watchpoint needs more than two a second."""
SLOW_USEC = 950_000
"""Of everything else one a second is enough."""
POSITION_USEC = 1_400_000
"""Of positions two in three seconds: of one in two each would be called late."""
STEADY_USEC = 2_900_000
"""Of what is repeated until it changes, one in three seconds."""
RC_USEC = 190_000
"""A switch is seen at once."""
GCS_TYPE, NO_AUTOPILOT = 6, 8
PREARM_CHECK = 0x10000000


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One message that is read."""

    extra: int
    """CRC_EXTRA: part of its checksum."""
    layout: struct.Struct
    """All fields in the order on the wire; what a sender left out at the end is zero."""
    read: Callable[..., FlightMessage | None]
    every_usec: int = 0
    """One that follows another sooner than this is passed over."""
    special: bool = False
    """Whether it is not simply a vehicle's word about itself."""

    def unpack_fields(self, buffer: bytes, payload: int, length: int) -> tuple[Any, ...]:
        """Return all fields of a message; what its sender left out at the end is zero."""
        need = self.layout.size
        raw = buffer[payload : payload + min(need, length)]
        return self.layout.unpack(raw if len(raw) == need else raw.ljust(need, b"\0"))


def _read_heartbeat(mode: int, kind: int, autopilot: int, base: int, status: int, _: int) -> Heartbeat | None:
    if kind == GCS_TYPE or autopilot == NO_AUTOPILOT:
        return None
    return Heartbeat(autopilot, mode, bool(base & 128), status, kind)


def _to_percent(value: int) -> float | None:
    return float(value) if 0 <= value <= 100 else None


def _read_system_status(*fields: int) -> SystemStatus:
    present, enabled, healthy, _, voltage = fields[:5]
    return SystemStatus(
        remaining_pct=_to_percent(fields[12]),
        voltage_v=None if voltage in {0, 65535} else voltage / 1e3,
        unhealthy=enabled & ~healthy,
        prearm_ok=bool(healthy & PREARM_CHECK) if present & PREARM_CHECK else None,
        current_a=None if fields[5] == -1 else max(0.0, fields[5] / 100),
    )


def _read_position(boot: int, lat: int, lon: int, alt: int, rel: int, *rest: int) -> Position:
    north, east, down, heading = rest
    return Position(
        boot / 1e3, lat / 1e7, lon / 1e7, alt / 1e3, rel / 1e3, north / 100, east / 100, down / 100,
        None if heading == 65535 else heading / 100,
    )  # fmt: skip


def _read_battery(*fields: int) -> Battery:
    consumed, cells, current = fields[0], fields[3:13], fields[13]
    number, remaining, charge_state, extra, faults = fields[14], fields[17], fields[19], fields[20:24], fields[25]
    known = [cell for cell in cells if cell != 65535]
    known += [cell for cell in extra if cell not in {0, 65535}]
    return Battery(
        battery=number,
        remaining_pct=_to_percent(remaining),
        voltage_v=sum(known) / 1e3 if known else None,
        current_a=None if current < 0 else current / 100,
        consumed_ah=None if consumed < 0 else consumed / 1e3,
        charge_state=charge_state,
        faults=faults,
        cells_v=tuple(cell / 1e3 for cell in known) if len(known) > 1 else (),
    )


def _read_radio(_: int, __: int, rssi: int, remote: int, buffer: int, noise: int, remote_noise: int) -> Radio:
    return Radio(
        rssi=None if rssi == 255 else rssi,
        remote_rssi=None if remote == 255 else remote,
        noise=None if noise == 255 else noise,
        remote_noise=None if remote_noise == 255 else remote_noise,
        free_buffer_pct=buffer if buffer <= 100 else None,
    )


def _read_mission_current(seq: int, total: int, _: int, __: int, number: int) -> MissionCurrent:
    return MissionCurrent(seq, total or None, number or None)


def _read_nav_output(*fields: float) -> HeightTarget:
    return HeightTarget(fields[2])


def _read_landed(_: int, state: int) -> LandedState:
    return LandedState({1: True, 2: False, 3: False, 4: False}.get(state))


def _read_attitude(_: int, roll: float, pitch: float, *__: float) -> Attitude:
    return Attitude(math.degrees(roll), math.degrees(pitch))


NO_SATELLITES = 255
POS_HORIZ_ABS, CONST_POS_MODE = 16, 128


def _gps(measured: int, *fields: int) -> Gps:
    fix, satellites, off_mm = fields[7], fields[8], fields[10]
    return _read_gps_raw(measured, fix, satellites, off_mm, 0)


def _second_gps(measured: int, *fields: int) -> Gps:
    fix, satellites, off_mm = fields[8], fields[9], fields[13]
    return _read_gps_raw(measured, fix, satellites, off_mm, 1)


def _read_gps_raw(measured: int, fix: int, satellites: int, off_mm: int, receiver: int) -> Gps:
    known = None if satellites == NO_SATELLITES else satellites
    return Gps(fix, known, off_mm / 1e3 or None, measured / 1e6 or None, receiver)


def _ekf(*fields: int) -> EstimatorStatus:
    return EstimatorStatus(fields[5] & (POS_HORIZ_ABS | CONST_POS_MODE) == POS_HORIZ_ABS)


def _estimator(*fields: int) -> EstimatorStatus:
    return EstimatorStatus(fields[9] & (POS_HORIZ_ABS | CONST_POS_MODE) == POS_HORIZ_ABS)


NO_CHANNEL = 65535
"""Of RC_CHANNELS and RC_CHANNELS_RAW."""


def _read_channels_raw(_: int, *fields: int) -> RcChannels:
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in fields[:8]))


def _read_channels(_: int, *fields: int) -> RcChannels:
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in fields[: min(18, fields[18])]))


STAND_IN_USEC = 4_000_000
"""SYS_STATUS stands in for BATTERY_STATUS; beside it one in five seconds is enough."""


def _ignore_message(*_: object) -> None:
    """Say nothing: it is not the message alone that tells."""


HEARTBEAT, SYSTEM, POSITION, BATTERY, STATUSTEXT, COMMAND_LONG, COMMAND_INT, SET_MODE = 0, 1, 33, 147, 253, 76, 75, 11
COMMAND_ACK, PARAM_VALUE, RC_CHANNELS_RAW, RC_CHANNELS, ATTITUDE = 77, 22, 35, 65, 30
NAV_CONTROLLER_OUTPUT, LOCAL_POSITION, LOCAL_TARGET, ITEM, ITEM_INT = 62, 32, 85, 39, 73
KINDS: dict[int, MessageKind] = {
    HEARTBEAT: MessageKind(50, struct.Struct("<IBBBBB"), _read_heartbeat, special=True),
    SYSTEM: MessageKind(124, struct.Struct("<IIIHHhHHHHHHb"), _read_system_status, SLOW_USEC),
    24: MessageKind(24, struct.Struct("<QiiiHHHHBBiIIIIH"), _gps, SLOW_USEC),
    124: MessageKind(87, struct.Struct("<QiiiIHHHHBBBHiIIII"), _second_gps, SLOW_USEC),
    193: MessageKind(71, struct.Struct("<5fHf"), _ekf, SLOW_USEC),
    230: MessageKind(163, struct.Struct("<Q8fH"), _estimator, SLOW_USEC),
    POSITION: MessageKind(104, struct.Struct("<IiiiihhhH"), _read_position, POSITION_USEC),
    ATTITUDE: MessageKind(39, struct.Struct("<I6f"), _read_attitude, EVERY_USEC, special=True),
    42: MessageKind(28, struct.Struct("<HHBBI"), _read_mission_current, STEADY_USEC),
    46: MessageKind(11, struct.Struct("<H"), MissionReached),
    NAV_CONTROLLER_OUTPUT: MessageKind(183, struct.Struct("<5fhhH"), _read_nav_output, SLOW_USEC),
    LOCAL_POSITION: MessageKind(185, struct.Struct("<I6f"), _ignore_message, SLOW_USEC, special=True),
    LOCAL_TARGET: MessageKind(140, struct.Struct("<I11fHB"), _ignore_message, SLOW_USEC, special=True),
    ITEM: MessageKind(254, struct.Struct("<7fHHBBBBBB"), _ignore_message, special=True),
    ITEM_INT: MessageKind(38, struct.Struct("<4fiifHHBBBBBB"), _ignore_message, special=True),
    109: MessageKind(185, struct.Struct("<HHBBBBB"), _read_radio, POSITION_USEC, special=True),
    BATTERY: MessageKind(154, struct.Struct("<iih10HhBBBbiB4HBI"), _read_battery, EVERY_USEC),
    245: MessageKind(130, struct.Struct("<BB"), _read_landed, STEADY_USEC),
    STATUSTEXT: MessageKind(83, struct.Struct("<B50sHB"), _ignore_message, special=True),
    COMMAND_LONG: MessageKind(152, struct.Struct("<7fHBB"), _ignore_message, special=True),
    COMMAND_INT: MessageKind(158, struct.Struct("<4fiifHBB"), _ignore_message, special=True),
    SET_MODE: MessageKind(89, struct.Struct("<IBB"), _ignore_message, special=True),
    COMMAND_ACK: MessageKind(143, struct.Struct("<HB"), _ignore_message, special=True),
    px4_events.EVENT: MessageKind(px4_events.EXTRA, px4_events.LAYOUT, _ignore_message, special=True),
    PARAM_VALUE: MessageKind(220, struct.Struct("<fHH16sB"), _ignore_message, special=True),
    RC_CHANNELS_RAW: MessageKind(244, struct.Struct("<I8HBB"), _read_channels_raw, RC_USEC, special=True),
    RC_CHANNELS: MessageKind(118, struct.Struct("<I18HBB"), _read_channels, RC_USEC, special=True),
}
"""By message id: what is read. The numbers are those of common.xml; RADIO_STATUS is also what SiK radios send."""
ORDERS = frozenset({COMMAND_LONG, COMMAND_INT, SET_MODE})
ITEMS = frozenset({ITEM, ITEM_INT})
TOLD_BY_VEHICLES = frozenset({
    px4_events.EVENT, COMMAND_ACK, PARAM_VALUE, RC_CHANNELS_RAW, RC_CHANNELS, ATTITUDE, LOCAL_POSITION, LOCAL_TARGET,
})  # fmt: skip
