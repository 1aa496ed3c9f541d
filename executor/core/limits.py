"""The thresholds of the watchpoints, as values."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """When to warn and when to declare; all times are the vehicle's."""

    link_stale_s: float = 3.0
    all_silent_s: float = 60.0
    """How long all vehicles may be silent at once before they are given up: until then it is our own fault."""
    battery_step_pct: float = 8.0
    """A loss of this much within `battery_step_window_s`, beyond what the flight costs, is no consumption."""
    battery_step_window_s: float = 6.0
    battery_excess_pct: float = 3.5
    """A loss of this much beyond the corrected model within `battery_window_s` is a fast drain."""
    battery_window_s: float = 90.0
    reserve_slack_pct: float = 1.0
    """How far below the reserve a projected landing may lie: the reports are whole percents."""
    reserve_clear_pct: float = 1.0
    """How far above the reserve the projection must rise again before the watchpoint clears."""
    battery_stale_s: float = 7.0
    """PX4 reports its battery every 2 s: three reports may be lost before the last one is old."""
    fall_m_s: float = 5.0
    """No autopilot descends this fast on its own (ArduPilot's WPNAV_SPEED_DN and PX4's MPC_Z_VEL_MAX_DN are 1.5)."""
    off_pad_m: float = 15.0
    """A vehicle that disarms farther than this from its pad did not land where it should."""
    off_pad_up_m: float = 5.0
    """A vehicle that disarms higher than this over its pad did not land: autopilots disarm within 2 m of the ground."""
    alarm_s: float = 15.0
    """A text of a failsafe explains what the vehicle does in this time after it: PX4 holds for 5 s before it acts."""
    airborne_m: float = 2.0
    """Above this height over its home a vehicle flies."""
    stall_s: float = 90.0
    stall_m: float = 3.0
    """A vehicle on its mission that moved less than this in `stall_s` is stuck."""
    mode_grace_s: float = 3.0
    """How long a mode other than the mission may last around a change that we ordered ourselves."""
