"""EVENT of MAVLink's common messages, by which PX4 says why a failsafe acts; pymavlink's dialect does not have it."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from executor.adapters.mavlink.frame_layout import CHECKSUM, V2, compute_checksum
from executor.core.interface.messages import ModeChange, OwnFailsafe
from executor.core.telemetry.mode_evidence import parse_px4_event

EVENT = 410
NAME = "EVENT"
EXTRA = 160
"""CRC_EXTRA: part of its checksum."""
LAYOUT = struct.Struct("<IIHBBB40s")
"""Number, the vehicle's clock in ms, sequence number, component and system that it is for, levels, arguments."""
_NUMBERS = ("id", "event_time_boot_ms", "sequence", "destination_component", "destination_system", "log_levels")
FIELDS = (*_NUMBERS, "arguments")
"""Of the layout, in its order."""
REMEMBERED = 64
"""Events that are recognised when they come again: a ground station that missed one has it sent once more to all."""


def build_event_frame(fields: Mapping[str, object], sysid: int, compid: int) -> bytes | None:
    """Return the frame of an event that another parser took apart; None if its fields do not fit."""
    arguments = fields.get("arguments")
    try:
        payload = LAYOUT.pack(
            *(fields[name] for name in _NUMBERS), bytes(arguments if isinstance(arguments, list) else ())
        )
    except (KeyError, TypeError, ValueError, struct.error):
        return None
    frame = bytes((V2, len(payload), 0, 0, 0, sysid, compid, *EVENT.to_bytes(3, "little"))) + payload
    return frame + compute_checksum(frame[1:] + bytes((EXTRA,))).to_bytes(CHECKSUM, "little")


@dataclass(slots=True)
class Px4EventDecoder:
    """The events of one vehicle, each told once."""

    _last: deque[tuple[int, int, int]] = field(default_factory=lambda: deque(maxlen=REMEMBERED))

    def decode(self, number: int, boot_ms: int, sequence: int, arguments: bytes) -> OwnFailsafe | ModeChange | None:
        """Return what an event says that is evidence, and was not said before."""
        said = parse_px4_event(number, arguments)
        if said is None or (number, boot_ms, sequence) in self._last:
            return None
        self._last.append((number, boot_ms, sequence))
        return said
