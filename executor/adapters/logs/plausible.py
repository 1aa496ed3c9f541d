"""What no vehicle can say: autopilots' own logs have no checksums, so a damaged record shows in its values alone."""

from __future__ import annotations

import math

from executor.core.messages import Battery, FlightMessage, Position

HIGHEST_M, FASTEST_M_S = 1e5, 200.0
LEAST_V, MOST_V = 1.0, 1000.0
MOST_A, MOST_AH = 1e4, 1e4


def is_plausible(message: FlightMessage) -> bool:
    """Return whether a vehicle can have said it; numbers that are none are not."""
    match message:
        case Position():
            speeds = (message.north_m_s, message.east_m_s, message.down_m_s)
            return (
                abs(message.lat_deg) <= 90.0
                and abs(message.lon_deg) <= 180.0
                and abs(message.alt_msl_m) <= HIGHEST_M
                and abs(message.alt_rel_m) <= HIGHEST_M
                and all(abs(speed) <= FASTEST_M_S for speed in speeds)
            )
        case Battery():
            return (
                _within(message.voltage_v, LEAST_V, MOST_V)
                and _within(message.current_a, 0.0, MOST_A)
                and _within(message.consumed_ah, 0.0, MOST_AH)
                and _within(message.remaining_pct, 0.0, 100.0)
            )
        case _:
            return True


def _within(value: float | None, least: float, most: float) -> bool:
    return value is None or (math.isfinite(value) and least <= value <= most)
