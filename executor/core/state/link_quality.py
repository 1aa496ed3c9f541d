"""How good a link is, and whether two vehicles answer over it as one system, by what they say.

Of the frames it is the share that is lost, of the radio its own figures. What is usual is learned: a log that was
thinned, or a router that filters, looks like a loss for ever.

A router may merge two vehicles into one address. Each has a clock since its own boot and a place of its own. Positions
that go to and fro between two that each go on by themselves are those of two vehicles. One that reboots changes over
once, and what comes twice, over two radios of which one is late, is a copy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.interface.messages import Radio, Traffic
from executor.core.lines import link

ENOUGH_FRAMES = 20
"""Of fewer a share says little."""
USUAL_S = 60.0
WEAK_MARGIN = 10
"""RSSI over noise in a SiK radio's units, about half a decibel each: its manual calls less unreliable."""
COUNT_S = 15.0
"""An older count of bytes says nothing of now."""
COUNTS = 3
FULL_BUFFER_PCT = 20
"""Less free than this: the radio cannot send what it is given, and both autopilots slow their telemetry down."""


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """What the frames of one vehicle and its radio say of the link."""

    window: tuple[tuple[float, int, int], ...] = ()
    """(at_s, received, missing) of the last seconds, the oldest first."""
    lost: float | None = None
    """Share of the frames of the window that were lost; None while they are few."""
    usual: float | None = None
    """The same over the last minutes."""
    radio: Radio | None = None
    radio_s: float = float("-inf")
    counted: tuple[tuple[float, int], ...] = ()
    """(at_s, bytes) of the last counts of what went both ways, the oldest first: its own bytes came before it."""
    round_trip_s: float | None = None
    """Of our questions, as it was measured last."""
    round_trip_at_s: float = float("-inf")
    least_round_trip_s: float = float("inf")
    """The shortest that was measured."""

    def count_bytes_s(self, now_s: float) -> float:
        """Return what goes over the link in a second, both ways; nothing once it is silent."""
        if len(self.counted) < 2 or now_s - self.counted[-1][0] > COUNT_S:
            return 0.0
        return sum(one[1] for one in self.counted[1:]) / max(0.1, self.counted[-1][0] - self.counted[0][0])

    @property
    def worse(self) -> float:
        """How much more is lost than usual, as a share of what usually arrives."""
        if self.lost is None or self.usual is None:
            return 0.0
        return max(0.0, (self.lost - self.usual) / max(0.05, 1.0 - self.usual))

    @property
    def weak(self) -> str:
        """What the radio complains of; nothing if it does not."""
        radio = self.radio
        if radio is None:
            return ""
        for name, rssi, noise in (
            (link.HERE, radio.rssi, radio.noise), (link.AT_VEHICLE, radio.remote_rssi, radio.remote_noise)
        ):  # fmt: skip
            if rssi is not None and noise is not None and rssi - noise < WEAK_MARGIN:
                return link.RADIO_WEAK.format(rssi=rssi, noise=noise, end=name)
        if radio.free_buffer_pct is not None and radio.free_buffer_pct < FULL_BUFFER_PCT:
            return link.RADIO_FULL.format(free_pct=radio.free_buffer_pct)
        return ""


def add_traffic(state: LinkQuality, traffic: Traffic, now_s: float, window_s: float) -> LinkQuality:
    """Take what came and what did not since the last count."""
    kept = tuple(one for one in state.window if now_s - one[0] < window_s)
    window = (*kept, (now_s, traffic.received, traffic.missing))
    received, missing = sum(one[1] for one in window), sum(one[2] for one in window)
    if traffic.link_bytes:
        state = replace(state, counted=(*state.counted[1 - COUNTS :], (now_s, traffic.link_bytes)))
    if (took_s := traffic.round_trip_s) is not None:
        least_s = min(took_s, state.least_round_trip_s)
        state = replace(state, round_trip_s=took_s, round_trip_at_s=now_s, least_round_trip_s=least_s)
    if received + missing < ENOUGH_FRAMES:
        return replace(state, window=window, lost=None)
    lost = missing / (received + missing)
    usual = lost if state.usual is None else state.usual
    elapsed_s = now_s - state.window[-1][0] if state.window else 0.0
    # A link that gets better is believed at once, one that gets worse slowly.
    follow = 1.0 if lost < usual else 1.0 - math.exp(-max(0.0, elapsed_s) / USUAL_S)
    return replace(state, window=window, lost=lost, usual=usual + (lost - usual) * follow)


CLOCK_S = 1.0
"""A vehicle's clock goes on as time does, but for what frames take on their way."""
APART_M, FASTEST_M_S = 50.0, 40.0
"""No vehicle is farther from where it was than it flies, and a glitch."""
ENOUGH, WITHIN_S = 4, 10.0
"""So many times back in time, or away and back, each sooner than this after the last one."""
AWAY_M, BACK_M, BACK_S = 3.0, 1.0, 5.0
"""Who stands on the ground is not so far away, and back so near, within this time: that is two of them."""
COPIES = 24
"""Positions that are remembered, to know a copy that comes seconds late."""
METRES_A_DEGREE = 111_320.0


@dataclass(frozen=True, slots=True)
class ReportedPosition:
    """A position as it came."""

    at_s: float
    boot_s: float
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True)
class DuplicateIdWatch:
    """What positions of one system say of how many vehicles it is."""

    one: ReportedPosition | None = None
    """The last one."""
    other: ReportedPosition | None = None
    """The last one of another clock, or of another place."""
    before: ReportedPosition | None = None
    """The last one that is metres away from those after it."""
    swaps: int = 0
    swapped_s: float = float("-inf")
    recent: tuple[tuple[float, float, float], ...] = ()

    @property
    def are_two(self) -> bool:
        """Return whether two vehicles speak."""
        return self.swaps >= ENOUGH


def add_reported_position(known: DuplicateIdWatch, told: ReportedPosition, *, stands: bool = False) -> DuplicateIdWatch:
    """Take a position.

    Args:
        known: What those before it say.
        told: The position.
        stands: Whether the vehicle stands on the ground: two that were switched on in one second are known by metres.
    """
    if known.one is None or _is_continuation(known.one, told):
        after = replace(known, one=told, recent=_append_position(known, told))
        if not stands or known.one is None or _distance_m(known.one, told) < AWAY_M:
            return after
        after = replace(after, before=known.one)
        return _count_swap(after, known, told) if _is_back(known.before, told) else after
    if (told.boot_s, told.lat_deg, told.lon_deg) in known.recent:
        return known
    # What only comes late, however unevenly, never goes back in time.
    late = known.one.boot_s - told.boot_s <= CLOCK_S and _is_near(known.one, told)
    if late or known.other is None or not _is_continuation(known.other, told):
        return replace(known, one=told, other=known.one, recent=_append_position(known, told))
    after = replace(known, one=told, other=known.one, recent=_append_position(known, told))
    return _count_swap(after, known, told)


def _count_swap(after: DuplicateIdWatch, known: DuplicateIdWatch, told: ReportedPosition) -> DuplicateIdWatch:
    swaps = known.swaps + 1 if told.at_s - known.swapped_s <= WITHIN_S else 1
    return replace(after, swaps=swaps, swapped_s=told.at_s)


def _is_back(before: ReportedPosition | None, told: ReportedPosition) -> bool:
    """Return whether this is where a position was a moment ago, before one that is metres away."""
    return before is not None and told.at_s - before.at_s <= BACK_S and _distance_m(before, told) <= BACK_M


def _append_position(known: DuplicateIdWatch, told: ReportedPosition) -> tuple[tuple[float, float, float], ...]:
    return (*known.recent[-COPIES:], (told.boot_s, told.lat_deg, told.lon_deg))


def _is_continuation(before: ReportedPosition, told: ReportedPosition) -> bool:
    elapsed_s = told.at_s - before.at_s
    return abs(told.boot_s - before.boot_s - elapsed_s) <= CLOCK_S and _is_near(before, told)


def _is_near(before: ReportedPosition, told: ReportedPosition) -> bool:
    return _distance_m(before, told) <= APART_M + FASTEST_M_S * max(0.0, told.at_s - before.at_s)


def _distance_m(before: ReportedPosition, told: ReportedPosition) -> float:
    north_m = (told.lat_deg - before.lat_deg) * METRES_A_DEGREE
    east_m = (told.lon_deg - before.lon_deg) * METRES_A_DEGREE * math.cos(math.radians(before.lat_deg))
    return math.hypot(north_m, east_m)
