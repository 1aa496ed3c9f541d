"""The thresholds of the watchpoints, as values."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """When to warn and when to declare; all times are the vehicle's."""

    link_stale_s: float = 3.0
    all_silent_s: float = 60.0
    """How long all links may be lost at once before the vehicles are: until then it is our own fault."""
    battery_step_pct: float = 8.0
    """A loss of this much within `battery_step_window_s`, beyond what the flight costs, is no consumption."""
    battery_step_window_s: float = 6.0
    battery_excess_pct: float = 2.0
    """A loss of this much beyond what explains itself is a fast drain: whole percents err by one."""
    battery_window_s: float = 90.0
    """In this time an excess is forgotten but for a third: it is the rate that makes a fault."""
    blind_excess_pct: float = 2.4
    """The same where no counter of charge stands behind the percentage, and beyond `blind_swing_pct_s`."""
    blind_swing_pct_s: float = 0.06
    """A percentage that is read off the voltage sinks with the load and swings by 2 % in half a minute: so much in a
    second is no excess. A fast drain takes more, a mild one is found over minutes."""
    slow_excess_pct: float = 4.0
    """A loss of this much in `slow_window_s`, beyond what the flight so far lets expect, is a drain, however mild."""
    slow_blind_pct: float = 5.5
    """The same where no counter of charge stands behind the percentage."""
    slow_slack: float = 0.2
    """The same as `drain_slack` over minutes, in which climbs, gusts and legs against the wind even out."""
    slow_window_s: float = 400.0
    charge_excess_pct: float = 1.0
    """The same for the consumed charge, which is counted in mAh."""
    drain_slack: float = 0.25
    """Share of the usual consumption that a climb, a gust or a turn of the wind explains."""
    reserve_chance: float = 0.93
    """A landing below the reserve that is this probable is a fault: it is asked all the time, and once is enough."""
    reserve_clear_chance: float = 0.8
    reserve_warn_chance: float = 0.95
    """From this on it is worth a warning. A probability that is right reaches c in vain in at most (1 - c) / c of what
    it began with: of flights that begin with one of 0.15, in a hundredth of those that land above it."""
    reserve_slack_pct: float = 1.0
    """How far below the reserve a projected landing may lie: the reports are whole percents."""
    voltage_step: float = 0.05
    """Share of the voltage lost against the usual under the same load. Hovering costs 3 % (recorded)."""
    voltage_step_blind: float = 0.065
    """The same where nobody knows the current: the load is a part of what is lost."""
    cell_low_v: float = 3.1
    """Under load for `cell_low_s`: a lithium polymer cell at the end of its charge; it is damaged at 3.0 V."""
    cell_low_s: float = 10.0
    """As long as ArduPilot waits itself (BATT_LOW_TIMER): a climb is over then."""
    cell_spread_v: float = 0.2
    """How far one cell may lie below the mean of the others; a healthy pack stays within 0.05 V."""
    battery_stale_s: float = 7.0
    """PX4 reports its battery every 2 s: three reports may be lost before the last one is old."""
    fall_m_s: float = 5.0
    """No autopilot descends this fast on its own (ArduPilot's WPNAV_SPEED_DN and PX4's MPC_Z_VEL_MAX_DN are 1.5)."""
    sinks_m_s: float = 0.5
    """Faster than this no autopilot sinks that holds a height: gusts move it by some decimetres a second."""
    drops_m_s: float = 1.8
    """Faster than this no autopilot touches down (ArduPilot's LAND_SPEED is 0.5, PX4's MPC_LAND_SPEED 0.7)."""
    below_mission_m: float = 5.0
    """So far below its leg no vehicle flies that can hold its height: the autopilot's own estimate is compared."""
    below_target_m: float = 2.0
    """So far below its autopilot's target, which ArduPilot moves down with a vehicle that cannot follow."""
    lies_s: float = 8.0
    """A vehicle far below its mission that has not moved for so long lies there."""
    off_pad_m: float = 15.0
    """A vehicle that disarms farther than this from its pad did not land where it should."""
    off_pad_up_m: float = 5.0
    """A vehicle that disarms higher than this over its pad did not land: autopilots disarm within 2 m of the ground."""
    at_rest_m_s: float = 1.0
    """A vehicle that disarms faster than this did not land."""
    climbs_m_s: float = 0.3
    """A climb this fast costs more than level flight, which the energy model does not know."""
    alarm_s: float = 15.0
    """A text of a failsafe explains what the vehicle does in this time after it: PX4 holds for 5 s before it acts."""
    airborne_m: float = 2.0
    """Above this height over its home a vehicle flies."""
    jump_m: float = 100.0
    """A position this far from where the reported velocity leads cannot be flown with: the layers are metres apart, and
    a satellite glitch that a filter lets through is some tens of metres (33 m in a recorded flight)."""
    jump_warn_m: float = 10.0
    heartbeat_stale_s: float = 3.5
    """QGroundControl's time: three heartbeats missed."""
    loss_window_s: float = 12.0
    loss_warn: float = 0.25
    """Share of frames lost beyond what is usual on this link."""
    stall_s: float = 90.0
    unplanned_stall_s: float = 240.0
    """Where no plan says how long it should stay."""
    stall_m: float = 3.0
    """A vehicle on its mission that moved less than this in `stall_s` is stuck."""
    tilt_deg: float = 75.0
    """No mission, return or landing leans a multicopter so far: ArduPilot's ANGLE_MAX is 30 by default, PX4's tilt
    limits are 45 and less; both call it a failure at 30 beyond what was asked for, and at 60."""
    tilt_s: float = 3.0
    """For so long no gust and no flip does."""
    hangs_s: float = 20.0
    """A vehicle that should be on its way home and hangs in the air for this long is worth a word."""
    hangs_most_s: float = 150.0
    """After this a vehicle that says that it flies is taken to lie there all the same."""
    down_s: float = 30.0
    """A vehicle that should be on its way home and does not move for this long is on the ground."""
    on_ground_s: float = 5.0
    """The same where it says itself that it is on the ground."""
    pad_m: float = 6.0
    """Nearer to its pad than this, seen from above, a vehicle that comes down lands on it."""
    failsafe_hold_s: float = 15.0
    """PX4 holds for COM_FAIL_ACT_T, 5 s by default, before its failsafe acts; after this nobody acts.

    One that says of itself that it holds longer is waited for `failsafe_late_s` longer than that.
    """
    failsafe_late_s: float = 10.0
