"""Which of several links to one vehicle orders and missions go over.

A link over which nothing came for about a second is left at once while another one is alive. From one that is alive
orders move only to one that has been clearly better for a while, or is preferred and as good: both autopilots take a
mission over the link on which it was announced, so that every change costs an upload.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

SILENT_S = 1.0
MOST_SILENT_S = 3.0
"""A slow radio brings what a vehicle says in bursts: it is silent after one and a half of its longest pauses."""
PAUSES = 1.5
FORGETS_S = 60.0
"""How soon a long pause is forgotten."""
LASTING_S, RETURNS_S = 10.0, 30.0
"""How long another link has to be clearly better; and one that is preferred, alive and not clearly worse."""
CLEARLY = 2.0
"""How many times as long an answer has to take over the link in use before another one is taken."""
LEAST_TRIP_S = 0.1
FULL_FACTOR = 4.0
"""What is sent into a radio whose buffer is full waits behind all that is in it."""
LOST_SHARE, ENOUGH_FRAMES = 0.2, 80
"""How much the newest count of frames says of what is lost, and one of fewer frames less."""


@dataclass(frozen=True, slots=True)
class LinkHealth:
    """What is known of one link."""

    heard_s: float = float("-inf")
    """When something came over it last."""
    pause_s: float = 0.0
    """Its longest pause, of those that were no silence."""
    behind_s: float | None = None
    """How much later than the vehicle's own clock its positions come, up to a constant that all links share."""
    lost: float | None = None
    """Share of its frames."""
    is_full: bool = False
    """Whether its radio said last that it holds more than it can send."""

    @property
    def silent_after_s(self) -> float:
        """How long nothing has to come until it is silent."""
        return min(MOST_SILENT_S, max(SILENT_S, PAUSES * self.pause_s))

    def is_alive(self, now_s: float) -> bool:
        """Return whether something has come over it just now."""
        return now_s - self.heard_s <= self.silent_after_s

    def hear(self, now_s: float) -> Self:
        """Return what is known after something has come."""
        pause_s, longest_s = now_s - self.heard_s, self.pause_s
        if pause_s > MOST_SILENT_S:
            return replace(self, heard_s=now_s)
        return replace(self, heard_s=now_s, pause_s=max(pause_s, longest_s * (1.0 - pause_s / FORGETS_S)))

    def count(self, received: int, missing: int) -> Self:
        """Return what is known after a count of frames."""
        frames = max(1, received + missing)
        follows = 1.0 if self.lost is None else LOST_SHARE * min(1.0, frames / ENOUGH_FRAMES)
        lost = self.lost or 0.0
        return replace(self, lost=lost + follows * (missing / frames - lost))

    def estimate_answer_s(self, first_behind_s: float | None) -> float:
        """Return how long an answer takes over it, as far as is known.

        Args:
            first_behind_s: `behind_s` of the link over which positions come first; None if it is not known.
        """
        later_s = 0.0 if self.behind_s is None or first_behind_s is None else self.behind_s - first_behind_s
        arrives = max(0.1, 1.0 - (self.lost or 0.0)) ** 2
        return (LEAST_TRIP_S + 2.0 * later_s) / arrives * (FULL_FACTOR if self.is_full else 1.0)


@dataclass(frozen=True, slots=True)
class LinkChoice:
    """Which link is in use, and which one may be next."""

    used: int = 0
    better: int | None = None
    better_since_s: float = 0.0


def choose_link(
    choice: LinkChoice, links: Sequence[LinkHealth], now_s: float, *, transfers: bool = False
) -> LinkChoice:
    """Return which link is to be used now.

    Args:
        choice: So far.
        links: All of them, the one that is preferred first.
        now_s: The time.
        transfers: Whether a mission is under way, which would have to begin anew over another link.
    """
    alive = [number for number, one in enumerate(links) if one.is_alive(now_s)]
    if not alive:
        return choice  # nobody knows of a better one
    first_behind_s = min((one.behind_s for one in links if one.behind_s is not None), default=None)
    answers_s = {number: links[number].estimate_answer_s(first_behind_s) for number in alive}
    good = [number for number in alive if answers_s[number] <= CLEARLY * min(answers_s.values())]
    wanted = min(good)
    if choice.used not in answers_s:
        return LinkChoice(wanted)
    if wanted == choice.used or transfers:
        return replace(choice, better=None)
    if choice.better != wanted:
        return replace(choice, better=wanted, better_since_s=now_s)
    lasts_s = RETURNS_S if choice.used in good else LASTING_S
    return LinkChoice(wanted) if now_s - choice.better_since_s >= lasts_s else choice
