"""What vehicles are asked to send, and which streams are thinned where a telemetry radio cannot carry all of it.

Given up first is how often something comes that changes slowly, and last how often a vehicle says where it is: a
segment is proven by positions, and any two that are some seconds apart prove it as well. What a fault or a pilot's hand
is known by comes every two seconds at least: one report of a tilt, of a lost fix or of a switch is to be followed by
another before it decides anything.
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
"""It comes unasked, until it does not."""
STREAMS_HZ: Mapping[int, float] = {
    GLOBAL_POSITION_INT: 5.0,
    SYS_STATUS: 1.0,
    BATTERY_STATUS: 1.0,
    MISSION_CURRENT: 2.0,
    EXTENDED_SYS_STATE: 1.0,
    ATTITUDE: 1.0,
    GPS_RAW_INT: 1.0,
    RC_CHANNELS: 1.0,  # its pilot's switches
}
"""What we follow; ArduPilot sends none of it unasked, PX4's battery comes only every 2 s."""
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
"""What is asked for instead, step by step."""
OWN_FACTORS = (1.0, 1.0, 0.5, 0.3)
"""Of the rates of what only one of the autopilots sends, by the same steps."""
FRAME_BYTES: Mapping[int, int] = {
    HEARTBEAT: 21, SYS_STATUS: 43, GPS_RAW_INT: 64, ATTITUDE: 40, GLOBAL_POSITION_INT: 40, MISSION_CURRENT: 30,
    RC_CHANNELS: 54, BATTERY_STATUS: 66, EXTENDED_SYS_STATE: 14, 162: 21, 168: 24, 193: 34, 230: 54, 231: 52,
    25: 113, 29: 28, 31: 60, 32: 40, 36: 49, 49: 32, 74: 32, 83: 49, 85: 63, 87: 63, 141: 44, 290: 58, 291: 69, 380: 32,
}  # fmt: skip
"""Of each message at most, with the 12 bytes around it (common.xml, ardupilotmega.xml)."""
SIGNATURE_BYTES = 13
FULL_PCT = 33
"""Of a radio's buffer less is free: what is asked now waits in it for longer than an answer takes (ArduPilot sends no
parameters from there on)."""
USUAL_BYTES_S = 1200.0
"""What the slowest telemetry radio that is in use carries without losing any of it: SiK at 64 kbit/s with error
correction and the firmware that it is sold with (SiK issue 97)."""
STREAMS_SHARE = 0.7
"""Of what a radio carries; the rest is for orders, missions and parameters."""
OTHERS_SHARE = 0.1
"""Of what a radio carries, for what other stations send, where they may order."""


@dataclass(frozen=True, slots=True)
class RadioShare:
    """What a vehicle has of the radio that it is behind, maybe with others."""

    vehicles: int = 1
    """How many."""
    bytes_s: float | None = None
    """What it carries, all together, where the site says it."""
    signed: bool = False
    is_radio: bool = False
    """Whether it is one, though it may not report itself: a serial port, or what the site calls one."""
    others_bytes_s: float | None = 0.0
    """What other stations may send to the vehicles; None for the usual share of what it carries."""
    names: tuple[str, ...] = ()
    """Who is behind it."""
    least_step: int = 0
    """How far the streams are thinned at least, as the radio was found to be full in flight."""
    further: tuple[tuple[str, RadioShare], ...] = ()
    """Of a vehicle with several links: what it has of each further one, by its connection."""

    def find_link_share(self, connection: str) -> RadioShare:
        """Return what it has of one of its links."""
        return dict(self.further).get(connection, self)

    def find_capacity_bytes_s(self, *, on_radio: bool) -> float | None:
        """Return what may be sent; None where nothing says that there is a radio."""
        return self.bytes_s if self.bytes_s is not None or not (on_radio or self.is_radio) else USUAL_BYTES_S

    def list_unwanted(self, dialect: Dialect, *, on_radio: bool) -> tuple[int, ...]:
        """Return what is sent unasked and switched off for a flight: none of it where the radio has room for all."""
        capacity_bytes_s = self.find_capacity_bytes_s(on_radio=on_radio)
        more_bytes_s = self._sum_streams_bytes_s(dialect.unasked_hz)
        if capacity_bytes_s is None or self.sum_bytes_s(dialect, 0) + more_bytes_s <= self.find_room_bytes_s(
            capacity_bytes_s
        ):
            return ()
        return tuple(dialect.unasked_hz)

    def choose_step(self, dialect: Dialect, *, on_radio: bool) -> int:
        """Return how far the streams are thinned: not at all without a radio, and no further than it takes."""
        capacity_bytes_s = self.find_capacity_bytes_s(on_radio=on_radio)
        steps = range(self.least_step, len(OWN_FACTORS))
        if capacity_bytes_s is None:
            return self.least_step
        most_bytes_s = self.find_room_bytes_s(capacity_bytes_s)
        return next((step for step in steps if self.sum_bytes_s(dialect, step) <= most_bytes_s), steps[-1])

    def find_others_bytes_s(self, capacity_bytes_s: float) -> float:
        """Return what other stations may send."""
        return OTHERS_SHARE * capacity_bytes_s if self.others_bytes_s is None else self.others_bytes_s

    def find_room_bytes_s(self, capacity_bytes_s: float) -> float:
        """Return what is left for streams."""
        return max(0.0, STREAMS_SHARE * capacity_bytes_s - self.find_others_bytes_s(capacity_bytes_s))

    def choose_streams_hz(self, dialect: Dialect, *, on_radio: bool) -> dict[int, float]:
        """Return what a vehicle is asked to send, and how often."""
        return list_streams_hz(dialect, self.choose_step(dialect, on_radio=on_radio))

    def sum_bytes_s(self, dialect: Dialect, step: int) -> float:
        """Return what all vehicles send together, with our heartbeats, of which there are as many as of theirs."""
        return self._sum_streams_bytes_s(list_streams_hz(dialect, step) | {HEARTBEAT: 2.0})

    def _sum_streams_bytes_s(self, streams_hz: Mapping[int, float]) -> float:
        more = SIGNATURE_BYTES if self.signed else 0
        return self.vehicles * sum(hz * (FRAME_BYTES[message] + more) for message, hz in streams_hz.items())


ALONE = RadioShare()
"""Of a vehicle that shares its link with nobody."""


def list_streams_hz(dialect: Dialect, step: int = 0) -> dict[int, float]:
    """Return what a vehicle is asked to send, and how often; one that refuses some of it flies all the same."""
    factor, thinned = OWN_FACTORS[step], THINNED_HZ[step - 1] if step else {}
    return {**STREAMS_HZ, **thinned} | {message: factor * hz for message, hz in dialect.own_streams_hz.items()}


@dataclass(frozen=True, slots=True)
class LinkMeasures:
    """What was measured on a vehicle's link before the flight."""

    radio: Radio | None = None
    """The last report of the radio here."""
    round_trip_s: float | None = None
    lost: float | None = None
    """Share of its frames."""


def check_radio(share: RadioShare, dialect: Dialect, found: tuple[LinkMeasures, ...]) -> list[Check]:
    """Say what a radio has to carry beside what it can.

    Args:
        share: Of each of the vehicles behind it.
        dialect: Of their autopilots.
        found: What was measured on the link of each.
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
