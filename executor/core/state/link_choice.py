"""Choose which of several links to a vehicle carries commands and missions.

A link that has been silent for about a second is left at once if another one is alive. A live link is left only for one
that has been clearly better for a while, or for a preferred one that is as good: both autopilots accept a mission only
over the link on which its transfer began, so that every change costs an upload.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

SILENT_S = 1.0
LONGEST_PAUSE_S = 3.0
"""Longest pause before a link counts as silent; a slow radio delivers in bursts, and its limit is `PAUSE_FACTOR` times
its longest pause."""
PAUSE_FACTOR = 1.5
PAUSE_MEMORY_S = 60.0
"""Time in which a long pause is forgotten."""
BETTER_S, PREFERRED_S = 10.0, 30.0
"""Time for which another link must be clearly better, and for which a preferred one must be alive and no worse."""
CLEARLY_SLOWER = 2.0
"""Factor in answer time by which the link in use must be slower before another one is chosen."""
SHORTEST_TRIP_S = 0.1
FULL_BUFFER_FACTOR = 4.0
"""Factor on the answer time over a radio with a full buffer, where each message queues behind the others."""
LOSS_WEIGHT, ENOUGH_FRAMES = 0.2, 80
"""Weight of the newest frame count in the loss estimate, and the frames from which the weight is full."""


@dataclass(frozen=True, slots=True)
class LinkHealth:
    """The condition of one link."""

    heard_s: float = float("-inf")
    """When a message last arrived over it."""
    pause_s: float = 0.0
    """Its longest pause that did not count as silence."""
    behind_s: float | None = None
    """Delay of its positions against the vehicle's clock, up to a constant common to all links."""
    lost: float | None = None
    """Share of its frames that are lost."""
    is_full: bool = False
    """Whether its radio last reported a full buffer."""

    @property
    def silent_after_s(self) -> float:
        """Time without messages after which it counts as silent."""
        return min(LONGEST_PAUSE_S, max(SILENT_S, PAUSE_FACTOR * self.pause_s))

    def is_alive(self, now_s: float) -> bool:
        """Return whether a message arrived just now."""
        return now_s - self.heard_s <= self.silent_after_s

    def hear(self, now_s: float) -> Self:
        """Return the link's condition after a message arrived."""
        pause_s, longest_s = now_s - self.heard_s, self.pause_s
        if pause_s > LONGEST_PAUSE_S:
            return replace(self, heard_s=now_s)
        return replace(self, heard_s=now_s, pause_s=max(pause_s, longest_s * (1.0 - pause_s / PAUSE_MEMORY_S)))

    def count(self, received: int, missing: int) -> Self:
        """Return the link's condition after a frame count."""
        frames = max(1, received + missing)
        follows = 1.0 if self.lost is None else LOSS_WEIGHT * min(1.0, frames / ENOUGH_FRAMES)
        lost = self.lost or 0.0
        return replace(self, lost=lost + follows * (missing / frames - lost))

    def estimate_answer_s(self, first_behind_s: float | None) -> float:
        """Return the estimated answer time over this link.

        Args:
            first_behind_s: `behind_s` of the link that delivers positions first; None if unknown.
        """
        later_s = 0.0 if self.behind_s is None or first_behind_s is None else self.behind_s - first_behind_s
        arrives = max(0.1, 1.0 - (self.lost or 0.0)) ** 2
        return (SHORTEST_TRIP_S + 2.0 * later_s) / arrives * (FULL_BUFFER_FACTOR if self.is_full else 1.0)


@dataclass(frozen=True, slots=True)
class LinkChoice:
    """The link in use, and the candidate to replace it."""

    used: int = 0
    better: int | None = None
    better_since_s: float = 0.0


def choose_link(
    choice: LinkChoice, links: Sequence[LinkHealth], now_s: float, *, transfers: bool = False
) -> LinkChoice:
    """Return the link to use now.

    Args:
        choice: The choice so far.
        links: All links, the preferred one first.
        now_s: The time.
        transfers: Whether a mission transfer is in progress, which another link would have to restart.
    """
    alive = [number for number, one in enumerate(links) if one.is_alive(now_s)]
    if not alive:
        return choice  # no link is better
    first_behind_s = min((one.behind_s for one in links if one.behind_s is not None), default=None)
    answers_s = {number: links[number].estimate_answer_s(first_behind_s) for number in alive}
    good = [number for number in alive if answers_s[number] <= CLEARLY_SLOWER * min(answers_s.values())]
    wanted = min(good)
    if choice.used not in answers_s:
        return LinkChoice(wanted)
    if wanted == choice.used or transfers:
        return replace(choice, better=None)
    if choice.better != wanted:
        return replace(choice, better=wanted, better_since_s=now_s)
    lasts_s = PREFERRED_S if choice.used in good else BETTER_S
    return LinkChoice(wanted) if now_s - choice.better_since_s >= lasts_s else choice
