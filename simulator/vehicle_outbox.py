"""What the vehicle has to say: one outbox for everybody who listens."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from simulator.messages import Outbound, split_status_text

WITHHELD_TEXTS = 20
"""Texts that a vehicle keeps for the time when somebody listens again."""


class VehicleOutbox:
    """Collects messages until they are taken away."""

    def __init__(self, *, tab: bool) -> None:
        self._outbox: list[Outbound] = []
        self._withheld: deque[Outbound] = deque(maxlen=WITHHELD_TEXTS)
        self._tab = "\t" if tab else ""
        """PX4's texts end in a tab."""
        self._texts = 0
        self.muted = False
        """Whether texts are kept back: PX4 does so while no ground station is heard."""

    def send(self, messages: Iterable[Outbound]) -> None:
        """Send messages."""
        self._outbox.extend(messages)

    def send_text(self, severity: int, text: str) -> None:
        """Send a text, in parts when it is long."""
        self._texts += 1
        chunk_id = (self._texts - 1) % 65535 + 1
        (self._withheld if self.muted else self._outbox).extend(split_status_text(severity, text + self._tab, chunk_id))

    def release_withheld(self) -> None:
        """Send the texts that were kept back."""
        self.muted = False
        self._outbox.extend(self._withheld)
        self._withheld.clear()

    def drain(self) -> list[Outbound]:
        """Take away what is to be sent."""
        messages, self._outbox = self._outbox, []
        return messages
