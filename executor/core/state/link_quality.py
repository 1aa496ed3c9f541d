"""How good a link is: the share of frames that are lost, the radio's own figures, and the age of the HEARTBEAT.

What is usual is learned: a log that was thinned, or a router that filters, looks like a loss for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from executor.core.interface.messages import Radio, Traffic

ENOUGH_FRAMES = 20
"""Of fewer a share says little."""
USUAL_S = 60.0
WEAK_MARGIN = 10
"""RSSI over noise in a SiK radio's units, about half a decibel each: its manual calls less unreliable."""
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
            ("here", radio.rssi, radio.noise), ("at the vehicle", radio.remote_rssi, radio.remote_noise)
        ):  # fmt: skip
            if rssi is not None and noise is not None and rssi - noise < WEAK_MARGIN:
                return f"radio signal {rssi} over noise {noise} {name}"
        if radio.free_buffer_pct is not None and radio.free_buffer_pct < FULL_BUFFER_PCT:
            return f"radio buffer {radio.free_buffer_pct} % free"
        return ""


def add_traffic(state: LinkQuality, traffic: Traffic, now_s: float, window_s: float) -> LinkQuality:
    """Take what came and what did not since the last count."""
    kept = tuple(one for one in state.window if now_s - one[0] < window_s)
    window = (*kept, (now_s, traffic.received, traffic.missing))
    received, missing = sum(one[1] for one in window), sum(one[2] for one in window)
    if received + missing < ENOUGH_FRAMES:
        return LinkQuality(window, None, state.usual, state.radio, state.radio_s)
    lost = missing / (received + missing)
    usual = lost if state.usual is None else state.usual
    elapsed_s = now_s - state.window[-1][0] if state.window else 0.0
    # A link that gets better is believed at once, one that gets worse slowly.
    follow = 1.0 if lost < usual else 1.0 - math.exp(-max(0.0, elapsed_s) / USUAL_S)
    return LinkQuality(window, lost, usual + (lost - usual) * follow, state.radio, state.radio_s)


def apply_radio_report(state: LinkQuality, radio: Radio, now_s: float) -> LinkQuality:
    """Take the radio's own report."""
    return LinkQuality(state.window, state.lost, state.usual, radio, now_s)
