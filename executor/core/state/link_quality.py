"""Measure the quality of a link, and detect two vehicles behind one system id.

Quality is the share of frames lost, and the radio's own figures. The usual loss is learned: a thinned log or a
filtering router looks like a permanent loss.

A router may merge two vehicles into one address. Each has its own clock since boot and its own position. Positions that
alternate between two that each progress steadily come from two vehicles. A reboot changes over only once, and a
position that arrives twice, over two radios of which one is late, is a copy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.interface.messages import Radio, Traffic
from executor.core.lines import link

ENOUGH_FRAMES = 20
"""Fewest frames for a meaningful share."""
USUAL_S = 60.0
WEAK_MARGIN = 10
"""Margin of RSSI over noise in a SiK radio's units, about half a decibel each; its manual calls less unreliable."""
COUNT_AGE_S = 15.0
"""Age at which a byte count is stale."""
COUNTS = 3
FULL_BUFFER_PCT = 20
"""Free buffer below which the radio is overloaded, and both autopilots slow their telemetry down."""


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """The quality of one vehicle's link, by its frames and its radio."""

    window: tuple[tuple[float, int, int], ...] = ()
    """(at_s, received, missing) of the last seconds, oldest first."""
    lost: float | None = None
    """Share of the window's frames that were lost; None while there are too few."""
    usual: float | None = None
    """The same over the last minutes."""
    radio: Radio | None = None
    radio_s: float = float("-inf")
    counted: tuple[tuple[float, int], ...] = ()
    """(at_s, bytes) of the last counts in both directions, oldest first; the first one only starts the interval."""
    round_trip_s: float | None = None
    """The last measured round trip of our requests."""
    round_trip_at_s: float = float("-inf")
    least_round_trip_s: float = float("inf")
    """The shortest measured."""

    def count_bytes_s(self, now_s: float) -> float:
        """Return the traffic over the link in both directions, bytes per second; 0 once it is silent."""
        if len(self.counted) < 2 or now_s - self.counted[-1][0] > COUNT_AGE_S:
            return 0.0
        return sum(one[1] for one in self.counted[1:]) / max(0.1, self.counted[-1][0] - self.counted[0][0])

    @property
    def worse(self) -> float:
        """Loss above the usual, as a share of what usually arrives."""
        if self.lost is None or self.usual is None:
            return 0.0
        return max(0.0, (self.lost - self.usual) / max(0.05, 1.0 - self.usual))

    @property
    def weak(self) -> str:
        """The radio's complaint; empty if it has none."""
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
    """Add the frames received and missing since the last count."""
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
    # Adopt an improvement at once, a deterioration slowly.
    follow = 1.0 if lost < usual else 1.0 - math.exp(-max(0.0, elapsed_s) / USUAL_S)
    return replace(state, window=window, lost=lost, usual=usual + (lost - usual) * follow)


CLOCK_ERROR_S = 1.0
"""Largest clock deviation, for delays in transit."""
GLITCH_M, TOP_SPEED_M_S = 50.0, 40.0
"""Largest position glitch, and highest speed; no vehicle moves farther."""
JUMPS, JUMP_INTERVAL_S = 4, 10.0
"""Number of jumps back in time, or away and back, that indicate two vehicles, and the longest time between two."""
AWAY_M, BACK_M, BACK_S = 3.0, 1.0, 5.0
"""Distance away, distance from the start after the return, and time that no vehicle on the ground covers; two vehicles
do."""
COPIES = 24
"""Positions remembered, to recognise copies that arrive seconds late."""
METRES_PER_DEGREE = 111_320.0


@dataclass(frozen=True, slots=True)
class ReportedPosition:
    """A position as reported."""

    at_s: float
    boot_s: float
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True)
class DuplicateIdWatch:
    """The evidence for two vehicles in the positions of one system."""

    one: ReportedPosition | None = None
    """The last one."""
    other: ReportedPosition | None = None
    """The last one with another clock, or from another place."""
    before: ReportedPosition | None = None
    """The last one that is metres away from those after it."""
    swaps: int = 0
    swapped_s: float = float("-inf")
    recent: tuple[tuple[float, float, float], ...] = ()

    @property
    def are_two(self) -> bool:
        """Return whether two vehicles report under one id."""
        return self.swaps >= JUMPS


def add_reported_position(known: DuplicateIdWatch, told: ReportedPosition, *, stands: bool = False) -> DuplicateIdWatch:
    """Add a reported position.

    Args:
        known: The evidence so far.
        told: The position.
        stands: Whether the vehicle is on the ground; two switched on in the same second differ only by metres.
    """
    if known.one is None or _is_continuation(known.one, told):
        after = replace(known, one=told, recent=_append_position(known, told))
        if not stands or known.one is None or _distance_m(known.one, told) < AWAY_M:
            return after
        after = replace(after, before=known.one)
        return _count_swap(after, known, told) if _is_back(known.before, told) else after
    if (told.boot_s, told.lat_deg, told.lon_deg) in known.recent:
        return known
    # A merely delayed position, however irregular, never goes back in time.
    late = known.one.boot_s - told.boot_s <= CLOCK_ERROR_S and _is_near(known.one, told)
    if late or known.other is None or not _is_continuation(known.other, told):
        return replace(known, one=told, other=known.one, recent=_append_position(known, told))
    after = replace(known, one=told, other=known.one, recent=_append_position(known, told))
    return _count_swap(after, known, told)


def _count_swap(after: DuplicateIdWatch, known: DuplicateIdWatch, told: ReportedPosition) -> DuplicateIdWatch:
    swaps = known.swaps + 1 if told.at_s - known.swapped_s <= JUMP_INTERVAL_S else 1
    return replace(after, swaps=swaps, swapped_s=told.at_s)


def _is_back(before: ReportedPosition | None, told: ReportedPosition) -> bool:
    """Return whether a position repeats an earlier one, after one that was metres away."""
    return before is not None and told.at_s - before.at_s <= BACK_S and _distance_m(before, told) <= BACK_M


def _append_position(known: DuplicateIdWatch, told: ReportedPosition) -> tuple[tuple[float, float, float], ...]:
    return (*known.recent[-COPIES:], (told.boot_s, told.lat_deg, told.lon_deg))


def _is_continuation(before: ReportedPosition, told: ReportedPosition) -> bool:
    elapsed_s = told.at_s - before.at_s
    return abs(told.boot_s - before.boot_s - elapsed_s) <= CLOCK_ERROR_S and _is_near(before, told)


def _is_near(before: ReportedPosition, told: ReportedPosition) -> bool:
    return _distance_m(before, told) <= GLITCH_M + TOP_SPEED_M_S * max(0.0, told.at_s - before.at_s)


def _distance_m(before: ReportedPosition, told: ReportedPosition) -> float:
    north_m = (told.lat_deg - before.lat_deg) * METRES_PER_DEGREE
    east_m = (told.lon_deg - before.lon_deg) * METRES_PER_DEGREE * math.cos(math.radians(before.lat_deg))
    return math.hypot(north_m, east_m)
