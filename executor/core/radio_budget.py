"""Choose the message rates to request of vehicles, and thin them where a telemetry radio cannot carry all.

The rates of slowly changing messages are reduced first, the position rate last: positions prove a segment, and any two
some seconds apart prove it as well. Messages that reveal a fault or a pilot's input arrive at least every two seconds:
a single report of a tilt, a lost fix or a switch must be followed by another before it decides anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executor.core.interface.codes import Check
from executor.core.interface.messages import Radio
from executor.core.lines import checklist
from missions import Dialect

HEARTBEAT, SYS_STATUS, GPS_RAW_INT, ATTITUDE = 0, 1, 24, 30
GLOBAL_POSITION_INT, MISSION_CURRENT, RC_CHANNELS = 33, 42, 65
BATTERY_STATUS, EXTENDED_SYS_STATE = 147, 245
HEARTBEAT_HZ = 1.0
"""Rate of the HEARTBEAT, normally sent without a request."""
STREAMS_HZ: Mapping[int, float] = {
    GLOBAL_POSITION_INT: 5.0,
    SYS_STATUS: 1.0,
    BATTERY_STATUS: 1.0,
    MISSION_CURRENT: 2.0,
    EXTENDED_SYS_STATE: 1.0,
    ATTITUDE: 1.0,
    GPS_RAW_INT: 1.0,
    RC_CHANNELS: 1.0,  # the pilot's switches
}
"""Rates of the messages we follow; ArduPilot sends none of them unrequested, PX4 its battery only every 2 s."""
THINNED_HZ: tuple[Mapping[int, float], ...] = (
    {ATTITUDE: 0.5, GPS_RAW_INT: 0.5, RC_CHANNELS: 0.5, MISSION_CURRENT: 1.0},
    {
        GLOBAL_POSITION_INT: 2.0, SYS_STATUS: 0.5, BATTERY_STATUS: 0.5, MISSION_CURRENT: 1.0, EXTENDED_SYS_STATE: 0.5,
        ATTITUDE: 0.5, GPS_RAW_INT: 0.5, RC_CHANNELS: 0.5,
    },
    {
        GLOBAL_POSITION_INT: 1.0, SYS_STATUS: 0.5, BATTERY_STATUS: 0.5, MISSION_CURRENT: 1.0, EXTENDED_SYS_STATE: 0.5,
        ATTITUDE: 0.5, GPS_RAW_INT: 0.5, RC_CHANNELS: 0.5,
    },
)  # fmt: skip
"""Reduced rates, step by step."""
OWN_FACTORS = (1.0, 1.0, 0.5, 0.3)
"""Factors on the rates of messages specific to one autopilot, by the same steps."""
FRAME_BYTES: Mapping[int, int] = {
    HEARTBEAT: 21, SYS_STATUS: 43, GPS_RAW_INT: 64, ATTITUDE: 40, GLOBAL_POSITION_INT: 40, MISSION_CURRENT: 30,
    RC_CHANNELS: 54, BATTERY_STATUS: 66, EXTENDED_SYS_STATE: 14, 162: 21, 168: 24, 193: 34, 230: 54, 231: 52,
    25: 113, 29: 28, 31: 60, 32: 40, 36: 49, 49: 32, 74: 32, 83: 49, 85: 63, 87: 63, 141: 44, 290: 58, 291: 69, 380: 32,
}  # fmt: skip
"""Largest size of each message, with 12 bytes of framing (common.xml, ardupilotmega.xml)."""
SIGNATURE_BYTES = 13
FULL_BUFFER_PCT = 33
"""Free buffer of a radio below which a request waits longer than its answer takes (ArduPilot then sends no
parameters)."""
DEFAULT_CAPACITY_BYTES_S = 1200.0
"""Lossless capacity of the slowest telemetry radio in use: SiK at 64 kbit/s with error correction and factory firmware
(SiK issue 97)."""
STREAMS_SHARE = 0.7
"""Share of a radio's capacity for streams; the rest is for commands, missions and parameters."""
OTHER_STATIONS_SHARE = 0.1
"""Share of a radio's capacity for other stations' frames, where these may command vehicles."""


@dataclass(frozen=True, slots=True)
class RadioShare:
    """A vehicle's share of its radio, which others may use too."""

    vehicles: int = 1
    """Number of vehicles on the radio."""
    bytes_s: float | None = None
    """Total capacity, where the site states it."""
    signed: bool = False
    is_radio: bool = False
    """Whether it is a radio even without reports of its own: a serial port, or declared in the site."""
    others_bytes_s: float | None = 0.0
    """Bytes per second that other stations may send to the vehicles; None for the usual share of the capacity."""
    names: tuple[str, ...] = ()
    """Vehicles on the radio."""
    least_step: int = 0
    """Smallest number of steps by which streams are thinned, from load measured in flight."""
    further: tuple[tuple[str, RadioShare], ...] = ()
    """For a vehicle with several links, its share of each further one, by connection."""

    def find_link_share(self, connection: str) -> RadioShare:
        """Return the share of one of its links."""
        return dict(self.further).get(connection, self)

    def find_capacity_bytes_s(self, *, on_radio: bool) -> float | None:
        """Return the capacity; None if there is no sign of a radio."""
        return self.bytes_s if self.bytes_s is not None or not (on_radio or self.is_radio) else DEFAULT_CAPACITY_BYTES_S

    def list_unwanted(self, dialect: Dialect, *, on_radio: bool) -> tuple[int, ...]:
        """Return the unrequested messages to switch off for a flight; none if the radio has room for all."""
        capacity_bytes_s = self.find_capacity_bytes_s(on_radio=on_radio)
        more_bytes_s = self._sum_streams_bytes_s(dialect.unasked_hz)
        if capacity_bytes_s is None or self.sum_bytes_s(dialect, 0) + more_bytes_s <= self.find_room_bytes_s(
            capacity_bytes_s
        ):
            return ()
        return tuple(dialect.unasked_hz)

    def choose_step(self, dialect: Dialect, *, on_radio: bool) -> int:
        """Return the number of steps by which streams are thinned: 0 without a radio, otherwise the fewest that fit."""
        capacity_bytes_s = self.find_capacity_bytes_s(on_radio=on_radio)
        steps = range(self.least_step, len(OWN_FACTORS))
        if capacity_bytes_s is None:
            return self.least_step
        most_bytes_s = self.find_room_bytes_s(capacity_bytes_s)
        return next((step for step in steps if self.sum_bytes_s(dialect, step) <= most_bytes_s), steps[-1])

    def find_others_bytes_s(self, capacity_bytes_s: float) -> float:
        """Return the bytes per second that other stations may send."""
        return OTHER_STATIONS_SHARE * capacity_bytes_s if self.others_bytes_s is None else self.others_bytes_s

    def find_room_bytes_s(self, capacity_bytes_s: float) -> float:
        """Return the bytes per second left for streams."""
        return max(0.0, STREAMS_SHARE * capacity_bytes_s - self.find_others_bytes_s(capacity_bytes_s))

    def choose_streams_hz(self, dialect: Dialect, *, on_radio: bool) -> dict[int, float]:
        """Return the message rates to request of a vehicle."""
        return list_streams_hz(dialect, self.choose_step(dialect, on_radio=on_radio))

    def sum_bytes_s(self, dialect: Dialect, step: int) -> float:
        """Return the traffic of all vehicles with the HEARTBEATs in both directions, in bytes per second."""
        return self._sum_streams_bytes_s(list_streams_hz(dialect, step) | {HEARTBEAT: 2.0})

    def _sum_streams_bytes_s(self, streams_hz: Mapping[int, float]) -> float:
        more = SIGNATURE_BYTES if self.signed else 0
        return self.vehicles * sum(hz * (FRAME_BYTES[message] + more) for message, hz in streams_hz.items())


ALONE = RadioShare()
"""The share of a vehicle alone on its link."""


def list_streams_hz(dialect: Dialect, step: int = 0) -> dict[int, float]:
    """Return the message rates to request of a vehicle; if it refuses some, it flies all the same."""
    factor, thinned = OWN_FACTORS[step], THINNED_HZ[step - 1] if step else {}
    return {**STREAMS_HZ, **thinned} | {message: factor * hz for message, hz in dialect.own_streams_hz.items()}


@dataclass(frozen=True, slots=True)
class LinkMeasures:
    """Measurements of a vehicle's link before the flight."""

    radio: Radio | None = None
    """The last report of the local radio."""
    round_trip_s: float | None = None
    lost: float | None = None
    """Share of frames lost."""


def check_radio(share: RadioShare, dialect: Dialect, found: tuple[LinkMeasures, ...]) -> list[Check]:
    """Check a radio's load against its capacity.

    Args:
        share: The radio's share of each vehicle behind it.
        dialect: The dialect of the vehicles.
        found: The measurements of each one's link.
    """
    on_radio = any(one.radio is not None for one in found)
    capacity_bytes_s = share.find_capacity_bytes_s(on_radio=on_radio)
    if capacity_bytes_s is None:
        return []
    step = share.choose_step(dialect, on_radio=on_radio)
    asked_bytes_s, room_bytes_s = share.sum_bytes_s(dialect, step), share.find_room_bytes_s(capacity_bytes_s)
    line = checklist.RADIO_THINNED if step else checklist.RADIO
    if asked_bytes_s > room_bytes_s:
        line = checklist.RADIO_FULL
    check = line.say(
        "radio",
        asked_kb_s=asked_bytes_s / 1e3,
        carries_kb_s=capacity_bytes_s / 1e3,
        trip_s=max(one.round_trip_s or 0.0 for one in found),
        lost_pct=100 * max(one.lost or 0.0 for one in found),
        positions_hz=list_streams_hz(dialect, step)[GLOBAL_POSITION_INT],
        vehicles=share.vehicles,
        fits=int(share.vehicles * room_bytes_s / asked_bytes_s),
    )
    return [check]
