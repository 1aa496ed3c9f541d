"""Measure the load of a telemetry radio in flight, and judge whether it is congested or weak.

The two need opposite remedies. A congested radio has a full queue or carries all it can: request less. A weak one loses
frames because its signal is near the noise: less traffic does not help, and the crew has to move or turn an antenna. So
a low signal is reported first, and frame loss only where the radio has room.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from executor.core.context import VehicleSetup
from executor.core.interface.codes import ChannelCode
from executor.core.interface.messages import Radio
from executor.core.lines import link
from executor.core.radio_budget import FULL_BUFFER_PCT, RadioShare
from executor.core.state.link_quality import ENOUGH_FRAMES
from executor.core.state.vehicle_state import VehicleState

REPORT_AGE_S = 5.0
"""Age at which a radio's report is stale; it reports once a second."""
NEAR_CAPACITY = 0.9
CAPACITY_LOST = 0.03
"""Frame loss near an assumed capacity that shows it to be the real one."""
QUEUE_FACTOR, QUEUE_TRIP_S = 4.0, 1.0
"""Multiple of the shortest round trip, and shortest time, that indicate a queue; they expire after `TRIP_AGE_S`."""
TRIP_AGE_S = 20.0
WEAK_MARGIN = 19
"""Margin of RSSI over noise in a SiK radio's units, 1.9 per dB; its makers call less than 10 dB unreliable."""
WEAK_LOST = 0.1


@dataclass(frozen=True, slots=True)
class ChannelMeasures:
    """The measurements of a radio over the last seconds, all vehicles together."""

    vehicles: tuple[str, ...]
    bytes_s: float
    capacity_bytes_s: float
    """Its capacity; where the site does not state one, at least the traffic observed."""
    capacity_known: bool = False
    """Whether the site states the capacity."""
    round_trip_s: float | None = None
    """The last measured round trip."""
    grown: bool = False
    """Whether it was measured recently, and is several times the shortest."""
    lost: float | None = None
    """Share of frames lost; None while there are too few."""
    radio: Radio | None = None
    """Its own last report; None if there is no recent one."""


@dataclass(frozen=True, slots=True)
class ChannelTotals:
    """The totals of a radio over a flight."""

    seconds: float = 0.0
    """Time evaluated."""
    bytes: float = 0.0
    most_bytes_s: float = 0.0
    most_round_trip_s: float | None = None
    lost_s: float = 0.0
    """The lost share integrated over time."""
    congested_s: float = 0.0
    weak_s: float = 0.0
    most_step: int = 0
    """Largest number of steps by which streams were thinned."""


ROOM_S = 60.0
"""Time for which a radio must have room before streams are raised."""


@dataclass(frozen=True, slots=True)
class ChannelState:
    """The state of a radio."""

    looked_s: float = float("-inf")
    found: ChannelCode | None = None
    """The problem in the last measurement."""
    found_since_s: float = float("-inf")
    """Start of the present condition: congested, weak or neither."""
    told: ChannelCode | None = None
    """The problem last reported to the crew."""
    told_s: float = float("-inf")
    quiet: bool = False
    """Whether it recurred so soon that it was not reported again."""
    step: int = 0
    """Smallest number of steps by which streams are thinned, from measurements in flight."""
    stepped_s: float = float("-inf")
    raised_s: float = float("-inf")
    """When streams were last raised."""
    missions_s: float = float("-inf")
    """When a mission upload last used the radio."""
    crowded_since_s: float | None = None
    """Start of congestion without a mission upload."""
    room_since_s: float | None = None
    """Since when the radio has room for more frequent streams."""
    patience_s: float = ROOM_S
    """Time for which that must last; doubled after each raise that was too early."""
    totals: ChannelTotals = field(default_factory=ChannelTotals)


def measure_channel(share: RadioShare, vehicles: Iterable[VehicleState], now_s: float) -> ChannelMeasures | None:
    """Return the measurements of a radio; None if there is no radio, or no measurement.

    Args:
        share: The radio's share of each vehicle behind it.
        vehicles: All vehicles behind it.
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
        trip_s is not None and now_s - trip_at_s <= TRIP_AGE_S and trip_s >= max(QUEUE_TRIP_S, QUEUE_FACTOR * least_s),
        missing / (received + missing) if received + missing >= ENOUGH_FRAMES else None,
        radio if now_s - report_s <= REPORT_AGE_S else None,
    )


def judge_channel(found: ChannelMeasures) -> tuple[ChannelCode, str] | None:
    """Return the problem of a radio as a code and in words; None if there is none."""
    for name, margin in list_margins(found.radio):
        if margin < WEAK_MARGIN:
            return ChannelCode.SIGNAL_LOW, link.SIGNAL_LOW.format(margin_db=max(0.0, margin / 1.9), end=name)
    free_pct, lost = None if found.radio is None else found.radio.free_buffer_pct, found.lost or 0.0
    if free_pct is not None and free_pct < FULL_BUFFER_PCT:
        return ChannelCode.BUFFER_FULL, link.RADIO_FULL.format(free_pct=free_pct)
    near = found.bytes_s >= NEAR_CAPACITY * found.capacity_bytes_s
    if near and (found.capacity_known or lost >= CAPACITY_LOST):
        return ChannelCode.AT_CAPACITY, link.AT_CAPACITY
    if found.grown:
        return ChannelCode.ROUND_TRIP_GROWN, link.ROUND_TRIP_GROWN.format(trip_s=found.round_trip_s)
    words = link.LOST_WITH_SIGNAL if list_margins(found.radio) else link.LOST_WITH_ROOM
    return (ChannelCode.FRAMES_LOST, words) if lost >= WEAK_LOST else None


def list_margins(radio: Radio | None) -> list[tuple[str, int]]:
    """Return the margin of signal over noise at each end that reports it, in the radio's units."""
    if radio is None:
        return []
    ends = (link.HERE, radio.rssi, radio.noise), (link.AT_VEHICLE, radio.remote_rssi, radio.remote_noise)
    return [(name, rssi - noise) for name, rssi, noise in ends if rssi is not None and noise is not None]


def describe_figures(found: ChannelMeasures) -> str:
    """Return the load of a radio in words."""
    said = [link.CARRIES.format(kb_s=found.bytes_s / 1e3, most_kb_s=found.capacity_bytes_s / 1e3)]
    said += [] if found.round_trip_s is None else [link.ROUND_TRIP.format(trip_s=found.round_trip_s)]
    return ", ".join([*said, link.LOST_SHARE.format(lost_pct=100 * (found.lost or 0.0))])


def share_of(setup: VehicleSetup, vehicle: VehicleState) -> RadioShare:
    """Return a vehicle's share of its radio, with the thinning decided in flight."""
    return replace(setup.radio, least_step=vehicle.orders.stream_step)


def choose_streams_hz(setup: VehicleSetup, vehicle: VehicleState) -> dict[int, float]:
    """Return the message rates to request of a vehicle now."""
    on_radio = vehicle.link.quality.radio is not None
    return share_of(setup, vehicle).choose_streams_hz(setup.dialect, on_radio=on_radio)
