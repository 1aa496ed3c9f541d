"""Decide which transfer is next on a channel that several vehicles share: the most urgent one first.

Parallel transfers slow each other down and are all late. Only where round trips are long do two or three run at
once, as one alone leaves the channel idle. A stalled transfer holds no other back: its vehicle may be out of reach.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import IntEnum

from executor.core.interface.messages import Radio
from executor.core.radio_budget import FULL_BUFFER_PCT
from executor.protocols.machine import MOST_AHEAD, RoundTrip

STALLED_S = 2.0
"""Time without progress after which a transfer no longer holds the channel: three questions on a fast radio."""
SLOW_S, FAR_S = 0.5, 1.25
"""Round trips from which two, and three transfers run in parallel."""
FREE_PCT = 70
"""Free share of our radio's buffer for three: it then holds no more than it sends in one round."""
AHEAD = {1: MOST_AHEAD, 2: 6, 3: 10}
"""Most items in flight by number of parallel transfers: orders and our heartbeats wait behind all of them."""
ALONE_AHEAD = 24
"""The same for a vehicle alone behind a slow radio: 1,200 bytes, which leave within a second."""
REPORT_S = 2.5
"""Age up to which a radio's report counts; it reports once a second."""
HOLD_S = 0.25
MOST_HELD_S = 10.0
"""Longest time for which a full buffer holds back repeats."""


class Rank(IntEnum):
    """What kind of transfer it is, the most urgent first."""

    IN_FLIGHT = 0
    """A new mission or fence for a vehicle in flight."""
    BEFORE_FLIGHT = 1
    BESIDE = 2
    """Transfers that nothing waits for."""


@dataclass(frozen=True, slots=True, order=True)
class Turn:
    """A transfer that wants the channel."""

    rank: Rank
    needed_s: float
    """Seconds within which it should be complete."""
    number: int
    """Sequence number of the request."""


def count_at_once(trip: RoundTrip, radio: Radio | None) -> int:
    """Return how many transfers may run at once: a single one with a long round trip leaves the channel idle.

    A full buffer of our own radio also lengthens round trips; then there are two at most.
    """
    if trip.mean_s is None or trip.mean_s < SLOW_S:
        return 1
    free_pct = 100 if radio is None or radio.free_buffer_pct is None else radio.free_buffer_pct
    return 3 if trip.mean_s >= FAR_S and free_pct >= FREE_PCT else 2


def find_most_ahead(trip: RoundTrip, radio: Radio | None, *, alone: bool) -> int:
    """Return how many items of a transfer may be in flight; `alone` if no other vehicle is behind the radio."""
    at_once = count_at_once(trip, radio)
    return ALONE_AHEAD if alone and at_once > 1 else AHEAD[at_once]


def is_next(turn: Turn, waiting: Collection[Turn], progressed_s: Iterable[float], now_s: float, at_once: int) -> bool:
    """Return whether a transfer may begin.

    Args:
        turn: Which.
        waiting: All that wait, this one among them.
        progressed_s: When each that is under way came on last.
        now_s: The time.
        at_once: How many may be under way.
    """
    return turn == min(waiting) and sum(now_s - at_s < STALLED_S for at_s in progressed_s) < at_once


def find_wait_s(progressed_s: Iterable[float], now_s: float, at_once: int) -> float:
    """Return after how long it is worth looking again, if none ends before."""
    latest_s = sorted(progressed_s)[-at_once:]
    return max(0.0, latest_s[0] + STALLED_S - now_s) if len(latest_s) == at_once else 0.0


def is_buffer_full(radio: Radio | None, heard_s: float, now_s: float) -> bool:
    """Return whether our own radio has said just now that it holds more than it can send."""
    free_pct = None if radio is None else radio.free_buffer_pct
    return free_pct is not None and free_pct < FULL_BUFFER_PCT and now_s - heard_s <= REPORT_S
