"""A telemetry radio as it is found in flight: what it carries, and whether it is congested or weak.

The two call for opposite things. A congested radio has a queue that is full, or carries as much as it can: less has to
be asked of it. A weak one loses what it is given, as its signal is near the noise: less traffic changes nothing, and
the crew has to move, or to turn an antenna. So a low signal is named first, and a loss only where there is room.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from executor.core.context import VehicleSetup
from executor.core.interface.codes import ChannelCode
from executor.core.interface.messages import Radio
from executor.core.lines import link
from executor.core.radio_budget import FULL_PCT, RadioShare
from executor.core.state.link_quality import ENOUGH_FRAMES
from executor.core.state.vehicle_state import VehicleState

REPORT_S = 5.0
"""A radio reports once a second; an older report says nothing."""
NEAR_CAPACITY = 0.9
LOST_IN_QUEUES = 0.03
"""Of a radio whose capacity is only supposed, near it: so much is lost where it is the real one."""
GROWN, GROWN_S = 4.0, 1.0
"""So many times the shortest round trip, and more than this, is a queue; an older one says nothing after `TRIP_S`."""
TRIP_S = 20.0
WEAK_MARGIN = 19
"""RSSI over noise in a SiK radio's units, 1.9 a decibel: its makers call less than 10 dB unreliable."""
WEAK_LOST = 0.1


@dataclass(frozen=True, slots=True)
class ChannelMeasures:
    """What was measured on a radio in the last seconds, all its vehicles together."""

    vehicles: tuple[str, ...]
    bytes_s: float
    capacity_bytes_s: float
    """What it carries; at least what it was seen to carry, where the site does not say it."""
    capacity_known: bool = False
    """Whether the site says it."""
    round_trip_s: float | None = None
    """As it was measured last."""
    grown: bool = False
    """Whether it was measured lately, and is several times the shortest."""
    lost: float | None = None
    """Share of frames; None while they are few."""
    radio: Radio | None = None
    """Its own last report; None if there was none lately."""


@dataclass(frozen=True, slots=True)
class ChannelTotals:
    """What a radio came to in a flight."""

    seconds: float = 0.0
    """In which it was looked at."""
    bytes: float = 0.0
    most_bytes_s: float = 0.0
    most_round_trip_s: float | None = None
    lost_s: float = 0.0
    """The share that is lost, times the time in which it was."""
    congested_s: float = 0.0
    weak_s: float = 0.0
    most_step: int = 0
    """How far streams were thinned."""


ROOM_S = 60.0
"""For so long a radio must have room before streams are raised."""


@dataclass(frozen=True, slots=True)
class ChannelState:
    """What is known of a radio."""

    looked_s: float = float("-inf")
    found: ChannelCode | None = None
    """What is wrong with it by the last look."""
    found_since_s: float = float("-inf")
    """Since when it is as it is: congested, weak or neither."""
    told: ChannelCode | None = None
    """What is taken to be wrong with it, and the crew was told."""
    told_s: float = float("-inf")
    quiet: bool = False
    """Whether it came back so soon that the crew was not told again."""
    step: int = 0
    """How far streams are thinned at least, by what was found in flight."""
    stepped_s: float = float("-inf")
    raised_s: float = float("-inf")
    """When they were raised last."""
    missions_s: float = float("-inf")
    """When a mission of ours went over it last."""
    crowded_since_s: float | None = None
    """Since when it is congested and no mission of ours goes over it."""
    room_since_s: float | None = None
    """Since when it would carry more frequent streams."""
    patience_s: float = ROOM_S
    """How long that must have been so; longer after each time that was too early."""
    totals: ChannelTotals = field(default_factory=ChannelTotals)


def measure_channel(share: RadioShare, vehicles: Iterable[VehicleState], now_s: float) -> ChannelMeasures | None:
    """Return what was measured on a radio; None where there is none, or nothing was.

    Args:
        share: Of each vehicle behind it.
        vehicles: All of them.
        now_s: The time.
    """
    links = [vehicle.link.quality for vehicle in vehicles]
    capacity_bytes_s = share.find_capacity_bytes_s(on_radio=any(one.radio is not None for one in links))
    if capacity_bytes_s is None or not any(one.counted for one in links):
        return None
    window = [count for one in links for count in one.window]
    received, missing = sum(one[1] for one in window), sum(one[2] for one in window)
    trips = [(one.round_trip_at_s, one.round_trip_s) for one in links if one.round_trip_s is not None]
    trip_at_s, trip_s = max(trips, default=(float("-inf"), None))
    least_s = min(one.least_round_trip_s for one in links)
    report_s, radio = max(((one.radio_s, one.radio) for one in links), key=lambda one: one[0])
    bytes_s = sum(one.count_bytes_s(now_s) for one in links)
    return ChannelMeasures(
        share.names,
        bytes_s,
        capacity_bytes_s if share.bytes_s is not None else max(capacity_bytes_s, bytes_s),
        share.bytes_s is not None,
        trip_s,
        trip_s is not None and now_s - trip_at_s <= TRIP_S and trip_s >= max(GROWN_S, GROWN * least_s),
        missing / (received + missing) if received + missing >= ENOUGH_FRAMES else None,
        radio if now_s - report_s <= REPORT_S else None,
    )


def judge_channel(found: ChannelMeasures) -> tuple[ChannelCode, str] | None:
    """Return what is wrong with a radio, as a code and in words; None if nothing is."""
    for name, margin in list_margins(found.radio):
        if margin < WEAK_MARGIN:
            return ChannelCode.SIGNAL_LOW, link.SIGNAL_LOW.format(margin_db=max(0.0, margin / 1.9), end=name)
    free_pct, lost = None if found.radio is None else found.radio.free_buffer_pct, found.lost or 0.0
    if free_pct is not None and free_pct < FULL_PCT:
        return ChannelCode.BUFFER_FULL, link.RADIO_FULL.format(free_pct=free_pct)
    near = found.bytes_s >= NEAR_CAPACITY * found.capacity_bytes_s
    if near and (found.capacity_known or lost >= LOST_IN_QUEUES):
        return ChannelCode.AT_CAPACITY, link.AT_CAPACITY
    if found.grown:
        return ChannelCode.ROUND_TRIP_GROWN, link.ROUND_TRIP_GROWN.format(trip_s=found.round_trip_s)
    words = link.LOST_WITH_SIGNAL if list_margins(found.radio) else link.LOST_WITH_ROOM
    return (ChannelCode.FRAMES_LOST, words) if lost >= WEAK_LOST else None


def list_margins(radio: Radio | None) -> list[tuple[str, int]]:
    """Return by how much the signal is over the noise at each end that says so, in the radio's units."""
    if radio is None:
        return []
    ends = (link.HERE, radio.rssi, radio.noise), (link.AT_VEHICLE, radio.remote_rssi, radio.remote_noise)
    return [(name, rssi - noise) for name, rssi, noise in ends if rssi is not None and noise is not None]


def describe_figures(found: ChannelMeasures) -> str:
    """Return in words what a radio carries."""
    said = [link.CARRIES.format(kb_s=found.bytes_s / 1e3, most_kb_s=found.capacity_bytes_s / 1e3)]
    said += [] if found.round_trip_s is None else [link.ROUND_TRIP.format(trip_s=found.round_trip_s)]
    return ", ".join([*said, link.LOST_SHARE.format(lost_pct=100 * (found.lost or 0.0))])


def share_of(setup: VehicleSetup, vehicle: VehicleState) -> RadioShare:
    """Return what a vehicle has of its radio, with what was decided of it in flight."""
    return replace(setup.radio, least_step=vehicle.orders.stream_step)


def choose_streams_hz(setup: VehicleSetup, vehicle: VehicleState) -> dict[int, float]:
    """Return what a vehicle is asked to send now, and how often."""
    on_radio = vehicle.link.quality.radio is not None
    return share_of(setup, vehicle).choose_streams_hz(setup.dialect, on_radio=on_radio)
