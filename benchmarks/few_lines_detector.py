"""The obvious simple detector: a percentage below a threshold, a heartbeat older than five seconds.

It is measured next to the watchpoints, on the same messages, to show the difference.
"""

from __future__ import annotations

from dataclasses import dataclass

from executor.core.interface.messages import Battery, FlightMessage, Heartbeat
from executor.core.state.vehicle_state import FaultKind

PERCENT = 25.0
HEARTBEAT_S = 5.0


@dataclass(slots=True)
class FewLines:
    """Simple detector for one vehicle."""

    percent: float = PERCENT
    heartbeat_s: float | None = None
    armed: bool = False
    remaining_pct: float | None = None

    def take(self, message: FlightMessage, now_s: float) -> None:
        """Handle a message."""
        if isinstance(message, Heartbeat):
            self.heartbeat_s, self.armed = now_s, message.armed
        elif isinstance(message, Battery) and message.remaining_pct is not None:
            self.remaining_pct = message.remaining_pct

    def find_fault(self, now_s: float) -> FaultKind | None:
        """Return the fault it detects now."""
        if not self.armed:
            return None
        if self.heartbeat_s is not None and now_s - self.heartbeat_s > HEARTBEAT_S:
            return FaultKind.LINK
        return FaultKind.BATTERY if self.remaining_pct is not None and self.remaining_pct < self.percent else None
