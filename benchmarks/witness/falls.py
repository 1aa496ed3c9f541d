"""A vehicle's true sink rate, from several independent instruments.

Each one alone may be wrong: a deceived estimate reports standing during a fall, a barometer reads wind as height, and
CTUN.CRt is centimetres in one firmware and metres in another. Two that agree, or the median of three, are trusted.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.witness.log_evidence import SECOND, LogEvidence, select_pairs_between

INSTRUMENTS = (
    ("BARO.Alt", "CTUN.BarAlt", "SCALED_PRESSURE", "vehicle_air_data"),
    ("GPS.Alt", "GPS_RAW_INT", "vehicle_gps_position"),
    ("POS.Alt", "CTUN.Alt", "GLOBAL_POSITION_INT", "VFR_HUD", "vehicle_local_position"),
)
"""Barometer, satellites, filter; of each the first that a log has, as the others are equivalent."""
SPAN_S, LONGEST_S = 1.0, 4.0
"""Heights closer in time than this give no speed, and farther apart none for one moment."""
BY_HAND = {True: frozenset({0, 1, 11, 13, 14, 18, 26}), False: frozenset({0, 10, 15})}
"""Modes without a sink rate limit of ArduPilot (stabilize, acro, drift, sport, flip, throw, autorotate) and of PX4 in
its own log (manual, acro, stabilized)."""
PX4_MAIN_BY_HAND = frozenset({1, 5, 7, 8})
"""The same for PX4 in a HEARTBEAT: manual, acro, stabilized, rattitude."""
DESCENTS_CM_S = ("WPNAV_SPEED_DN", "PILOT_SPEED_DN", "PILOT_VELZ_MAX", "PILOT_SPEED_UP", "LAND_SPEED_HIGH")
DESCENTS_M_S = ("MPC_Z_VEL_MAX_DN", "MPC_Z_V_AUTO_DN", "WP_SPD_DN", "PILOT_SPD_DN")
USUAL_DESCENT_M_S, TIMES, LEAST_M_S = 2.5, 1.5, 4.0


def sank_m_s(told: LogEvidence, from_usec: int, to_usec: int) -> tuple[float, str]:
    """Return the maximum sink rate in an interval, and its instruments; 0 without an instrument."""
    found = []
    for names in INSTRUMENTS:
        name = next((one for one in names if len(told.heights.get(one, ())) > 1), None)
        rows = () if name is None else select_pairs_between(told.heights[name], from_usec, to_usec)
        if name is not None and len(rows) > 1:
            found.append((_steepest_m_s(rows), name))
    if not found:
        return 0.0, "nothing that tells heights"
    found.sort()
    # Of two the slower one, of three the middle one.
    return found[(len(found) - 1) // 2][0], " and ".join(f"{speed:.1f} m/s by {name}" for speed, name in found)


def _steepest_m_s(rows: Sequence[tuple[int, float]]) -> float:
    steepest, first = 0.0, 0
    for t_usec, height_m in rows:
        while first + 1 < len(rows) and t_usec - rows[first + 1][0] >= SPAN_S * SECOND:
            first += 1
        elapsed_s = (t_usec - rows[first][0]) / SECOND
        if SPAN_S <= elapsed_s <= LONGEST_S:
            steepest = max(steepest, (rows[first][1] - height_m) / elapsed_s)
    return steepest


def never_ordered_m_s(told: LogEvidence, at_usec: int) -> float | None:
    """Return the sink rate above which none is commanded; None in modes without a limit."""
    mode = next((one.mode for one in reversed(told.modes) if one.t_usec <= at_usec), None)
    if mode is None or _is_by_hand(told, mode):
        return None
    allowed = [told.settings.get(name, 0.0) / 100.0 for name in DESCENTS_CM_S]
    allowed += [told.settings.get(name, 0.0) for name in DESCENTS_M_S]
    return max(LEAST_M_S, TIMES * max(USUAL_DESCENT_M_S, *allowed))


def _is_by_hand(told: LogEvidence, mode: int) -> bool:
    if not told.ardupilot and not told.on_board:
        return (mode >> 16) & 0xFF in PX4_MAIN_BY_HAND
    return mode in BY_HAND[told.ardupilot]
