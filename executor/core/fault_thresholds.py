"""Define the thresholds of the watchpoints and warnings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Thresholds for warnings and faults; all times are the vehicle's."""

    link_stale_s: float = 3.0
    all_silent_s: float = 60.0
    """Time for which all links may be lost at once before vehicles are: until then it is the ground station's fault."""
    battery_step_pct: float = 8.0
    """Charge lost within `battery_step_window_s`, beyond the flight's consumption, that is no consumption."""
    battery_step_window_s: float = 6.0
    battery_excess_pct: float = 2.0
    """Unexplained charge loss that is a fast drain; reports in whole percent err by one."""
    battery_window_s: float = 90.0
    """Time in which an excess decays to a third: the rate makes the fault."""
    blind_excess_pct: float = 2.4
    """The same without a charge counter behind the percentage, beyond `blind_swing_pct_s`."""
    blind_swing_pct_s: float = 0.06
    """Drop rate that is no excess where the percentage is derived from the voltage: it sags with the load and swings by
    2 % in half a minute. A fast drain exceeds it; a mild one is found over minutes."""
    slow_excess_pct: float = 4.0
    """Charge lost in `slow_window_s`, beyond the expectation from the flight so far, that is a drain, however mild."""
    slow_blind_pct: float = 5.5
    """The same without a charge counter behind the percentage."""
    slow_slack: float = 0.2
    """`drain_slack` over minutes, in which climbs, gusts and legs against the wind average out."""
    slow_window_s: float = 400.0
    charge_excess_pct: float = 1.0
    """The same for the consumed charge, counted in mAh."""
    drain_slack: float = 0.25
    """Share of the usual consumption that a climb, a gust or a turn of the wind explains."""
    reserve_chance: float = 0.93
    """Probability of a landing below the reserve that is a fault; evaluated on every tick, once is enough."""
    reserve_clear_chance: float = 0.8
    reserve_warn_chance: float = 0.95
    """Probability from which a warning is given. A correct probability reaches c by mistake in at most (1 - c) / c of
    its initial value: starting from 0.15, in a hundredth of the flights that land above the reserve."""
    reserve_slack_pct: float = 1.0
    """Margin of a projected landing below the reserve; reports are in whole percent."""
    voltage_step: float = 0.05
    """Share of the voltage lost against the usual under the same load; hovering costs 3 % (recorded)."""
    voltage_step_blind: float = 0.065
    """The same with an unknown current: the load is part of the loss."""
    cell_low_v: float = 3.1
    """Cell voltage under load for `cell_low_s`: a lithium polymer cell at the end of its charge; 3.0 V damages it."""
    cell_low_s: float = 10.0
    """Duration of a low cell; ArduPilot waits as long (BATT_LOW_TIMER), and a climb is over then."""
    cell_spread_v: float = 0.2
    """Largest drop of one cell below the mean of the others; a healthy pack stays within 0.05 V."""
    battery_stale_s: float = 7.0
    """Age at which a battery report is stale; PX4 reports every 2 s, and three reports may be lost."""
    fall_m_s: float = 5.0
    """Descent rate that no autopilot commands (ArduPilot's WPNAV_SPEED_DN and PX4's MPC_Z_VEL_MAX_DN are 1.5)."""
    sinks_m_s: float = 0.5
    """Descent rate above which an autopilot is not holding its height; gusts move it by some decimetres a second."""
    drops_m_s: float = 1.8
    """Descent rate above any autopilot's touchdown (ArduPilot's LAND_SPEED is 0.5, PX4's MPC_LAND_SPEED 0.7)."""
    below_mission_m: float = 5.0
    """Height below its leg that no vehicle in control of its height reaches, by the autopilot's own estimate."""
    below_target_m: float = 2.0
    """Height below the autopilot's target; ArduPilot moves it down with a vehicle that cannot follow."""
    lies_s: float = 8.0
    """Time without motion after which a vehicle far below its mission is on the ground."""
    off_pad_m: float = 15.0
    """Distance from its pad beyond which a vehicle that disarms did not land where it should."""
    off_pad_up_m: float = 5.0
    """Height over its pad above which a vehicle that disarms did not land; autopilots disarm within 2 m of the
    ground."""
    at_rest_m_s: float = 1.0
    """Speed above which a vehicle that disarms did not land."""
    climbs_m_s: float = 0.3
    """Climb rate above which consumption exceeds level flight, which the energy model does not know."""
    alarm_s: float = 15.0
    """Time for which a failsafe's text explains the vehicle's actions; PX4 holds for 5 s before it acts."""
    airborne_m: float = 2.0
    """Height over home above which a vehicle is in the air."""
    jump_m: float = 100.0
    """Jump of a position from the one predicted by velocity that makes flight unsafe: layers are metres apart, and a
    satellite glitch that passes the filter is some tens of metres (33 m in a recorded flight)."""
    jump_warn_m: float = 10.0
    heartbeat_stale_s: float = 3.5
    """Age at which a HEARTBEAT is stale, as in QGroundControl: three missed."""
    loss_window_s: float = 12.0
    loss_warn: float = 0.25
    """Share of frames lost beyond the usual on this link."""
    stall_s: float = 90.0
    unplanned_stall_s: float = 240.0
    """The same without a plan that states how long to stay."""
    stall_m: float = 3.0
    """Distance within which a vehicle on its mission is stuck after `stall_s`."""
    tilt_deg: float = 75.0
    """Tilt that no mission, return or landing uses: ArduPilot's ANGLE_MAX is 30 by default, PX4's tilt limits are 45 or
    less; both report a failure at 30 beyond the command, and at 60."""
    tilt_s: float = 3.0
    """Duration of a tilt that no gust or flip lasts."""
    hangs_s: float = 20.0
    """Time for which a returning vehicle may hover in place before a warning."""
    hangs_most_s: float = 150.0
    """Time after which a vehicle that reports flying counts as on the ground all the same."""
    down_s: float = 30.0
    """Time without motion after which a returning vehicle is on the ground."""
    on_ground_s: float = 5.0
    """The same where it reports itself on the ground."""
    pad_m: float = 6.0
    """Horizontal distance to its pad within which a descending vehicle lands on it."""
    failsafe_hold_s: float = 15.0
    """Longest hold before a failsafe acts: PX4 holds for COM_FAIL_ACT_T, 5 s by default.

    A vehicle that reports a longer hold is given `failsafe_late_s` more than that.
    """
    failsafe_late_s: float = 10.0
