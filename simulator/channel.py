"""One direction of a bad link: what is lost, late, doubled, overtaken or cut off. Seeded, so a run can be repeated."""

from __future__ import annotations

import heapq
import math
import random
from dataclasses import dataclass

REORDER_HOLD_S = (0.02, 0.2)
"""How long a datagram that is to be overtaken is held back, simulated."""
QUEUE_BYTES = 2048
"""What a radio holds of what it cannot send yet; what comes to a full one is lost (SiK, serial.c: 1850)."""


@dataclass(slots=True)
class LinkCondition:
    """The state of a vehicle's link; both directions share it."""

    loss: float = 0.0
    """Share of datagrams that is lost."""
    delay_s: float = 0.0
    duplicate: float = 0.0
    """Share of datagrams that comes twice."""
    reorder: float = 0.0
    """Share of datagrams that is held back so that later ones overtake it."""
    rate_bytes_s: float = math.inf
    """What passes each way, one datagram behind the other."""
    silent_until_s: float = -math.inf
    """Simulated time until which nothing passes."""


class Channel:
    """Carries datagrams one way; times are simulated seconds."""

    def __init__(self, condition: LinkCondition, rng: random.Random) -> None:
        self._condition = condition
        self._rng = rng
        self._held: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._free_s = -math.inf
        """When all that is in its queue has been sent."""

    def offer(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram that was sent at ``now_s``."""
        condition = self._condition
        if now_s < condition.silent_until_s or self._draw_chance(condition.loss):
            return
        waits_s = max(0.0, self._free_s - now_s)
        if waits_s > QUEUE_BYTES / condition.rate_bytes_s:
            return
        self._free_s = now_s + waits_s + len(datagram) / condition.rate_bytes_s
        for _ in range(2 if self._draw_chance(condition.duplicate) else 1):
            late_s = self._rng.uniform(*REORDER_HOLD_S) if self._draw_chance(condition.reorder) else 0.0
            heapq.heappush(self._held, (self._free_s + condition.delay_s + late_s, self._count, datagram))
            self._count += 1

    def take_due(self, now_s: float) -> list[bytes]:
        """Return what arrives by ``now_s``, in the order of arrival; what arrives in a silence is lost."""
        arrived = []
        while self._held and self._held[0][0] <= now_s:
            at_s, _, datagram = heapq.heappop(self._held)
            if at_s >= self._condition.silent_until_s:
                arrived.append(datagram)
        return arrived

    def _draw_chance(self, share: float) -> bool:
        return share > 0 and self._rng.random() < share
