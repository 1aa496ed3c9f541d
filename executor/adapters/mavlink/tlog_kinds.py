"""The messages that are read of a telemetry log, how often one is wanted, and how it is unpacked.

What some watchpoint needs is unpacked by pymavlink's own definitions and read by `message_readers`, as on a link; only
the classes of pymavlink are passed by, whose making takes most of the time of a long log.
"""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink import message_readers
from executor.adapters.mavlink.frame_layout import payload_of
from executor.adapters.mavlink.message_readers import Frame
from executor.core.interface.messages import FlightMessage

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
STAND_IN_USEC = 4_000_000
"""SYS_STATUS stands in for BATTERY_STATUS; beside it one in five seconds is enough."""


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One message that is read."""

    name: str
    extra: int
    """CRC_EXTRA: part of its checksum."""
    layout: struct.Struct
    """All fields in the order on the wire; what a sender left out at the end is zero."""
    name_fields: Callable[[tuple[Any, ...]], Any]
    """Makes of their values an object that has them by MAVLink's names."""
    read: Callable[[Any], FlightMessage | None]
    every_usec: int
    """One that follows another sooner than this is passed over."""
    special: bool
    """Whether it is not simply a vehicle's word about itself."""
    arrays: tuple[tuple[int, int], ...] = ()
    """Where each field begins and ends among the values, if any has more than one."""

    def unpack_fields(self, frame: bytes) -> Frame:
        """Return all fields of a frame by their names."""
        values = self.layout.unpack(payload_of(frame, self.layout.size))
        if self.arrays:
            values = tuple(values[first] if end == first + 1 else values[first:end] for first, end in self.arrays)
        return self.name_fields(values)


def _ignore_message(_: object) -> None:
    """Say nothing: it is not the message alone that tells."""


def _make_kind(name: str, every_usec: int, *, special: bool) -> MessageKind:
    """Return a kind as pymavlink defines it."""
    known, read = _DEFINED[name], message_readers.READERS.get(name, _ignore_message)
    read = message_readers.read_channels if name == "RC_CHANNELS_RAW" else read
    more_format, more_fields = _MORE.get(name, ("", ()))
    layout = struct.Struct(known.unpacker.format + more_format)
    name_fields = _named_tuple(name, (*known.ordered_fieldnames, *more_fields))._make
    ends = list(accumulate(known.lengths))
    arrays = tuple(zip([0, *ends], ends, strict=False)) if max(known.lengths) > 1 else ()
    return MessageKind(name, known.crc_extra, layout, name_fields, read, every_usec, special, arrays)


_named_tuple: Any = namedtuple
_DEFINED: Mapping[str, Any] = {one.msgname: one for one in mav.mavlink_map.values()}
_MORE = {"MISSION_CURRENT": ("I", ("mission_id",))}
"""Fields at the end that pymavlink's definition does not have yet."""
_PLAIN = {
    "SYS_STATUS": SLOW_USEC,
    "GPS_RAW_INT": SLOW_USEC,
    "GPS2_RAW": SLOW_USEC,
    "EKF_STATUS_REPORT": SLOW_USEC,
    "ESTIMATOR_STATUS": SLOW_USEC,
    "GLOBAL_POSITION_INT": POSITION_USEC,
    "MISSION_CURRENT": STEADY_USEC,
    "MISSION_ITEM_REACHED": 0,
    "NAV_CONTROLLER_OUTPUT": SLOW_USEC,
    "BATTERY_STATUS": EVERY_USEC,
    "EXTENDED_SYS_STATE": STEADY_USEC,
}
"""A vehicle's words about itself, and how often one is wanted."""
_SPECIAL = {
    "HEARTBEAT": 0,
    "ATTITUDE": EVERY_USEC,
    "LOCAL_POSITION_NED": SLOW_USEC,
    "POSITION_TARGET_LOCAL_NED": SLOW_USEC,
    "MISSION_ITEM": 0,
    "MISSION_ITEM_INT": 0,
    "RADIO_STATUS": POSITION_USEC,
    "STATUSTEXT": 0,
    "COMMAND_LONG": 0,
    "COMMAND_INT": 0,
    "SET_MODE": 0,
    "COMMAND_ACK": 0,
    "PARAM_VALUE": 0,
    "RC_CHANNELS_RAW": RC_USEC,
    "RC_CHANNELS": RC_USEC,
}
"""What is not simply that."""
_EVENT = MessageKind(
    message_readers.EVENT_NAME,
    message_readers.EVENT_EXTRA,
    message_readers.EVENT_LAYOUT,
    _named_tuple(message_readers.EVENT_NAME, message_readers.EVENT_FIELDS)._make,
    _ignore_message,
    every_usec=0,
    special=True,
)
KINDS: Mapping[int, MessageKind] = (
    {_DEFINED[name].id: _make_kind(name, every_usec, special=False) for name, every_usec in _PLAIN.items()}
    | {_DEFINED[name].id: _make_kind(name, every_usec, special=True) for name, every_usec in _SPECIAL.items()}
    | {message_readers.EVENT: _EVENT}
)
"""By message id: what is read; RADIO_STATUS is also what SiK radios send."""
ORDERS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
ITEMS = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})
TOLD_BY_VEHICLES = frozenset({
    message_readers.EVENT_NAME, "COMMAND_ACK", "PARAM_VALUE", "RC_CHANNELS_RAW", "RC_CHANNELS", "ATTITUDE",
    "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED",
})  # fmt: skip
