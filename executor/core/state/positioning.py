"""How a vehicle's position is known: by satellites, or reckoned by its autopilot since they were lost.

An autopilot without GPS goes on reporting positions: it integrates its own accelerations, and what it says may be
hundreds of metres off within a minute. Three things say so: the receiver's fix (GPS_RAW_INT), the estimator's flags
(EKF_STATUS_REPORT, ESTIMATOR_STATUS), and, where the receiver says nothing, its health in SYS_STATUS. GPS is lost only
where there was a fix before: who flies indoors has none to lose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from executor.core.interface.messages import EstimatorStatus, Gps, SystemStatus
from executor.core.state.inspection_run import GAP_S
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.core.state.vehicle_state import VehicleState

FIXED = 3
"""GPS_FIX_TYPE: three-dimensional. With less neither autopilot uses the receiver."""
REPORTED_S = 5.0
"""A report of the receiver or of the estimator that is older says nothing of now."""
GPS_SENSOR = 0x20
"""MAV_SYS_STATUS_SENSOR_GPS."""
SETTLES_S = 10.0
"""After GPS is regained the estimator moves to where it is: so long a jump is a correction."""
DRIFT_M_S2 = 0.25
"""What an estimator without GPS takes for acceleration where there is none: its idea of level is off by 1.5 degrees."""
USUAL_M = 3.0
"""What a fix is off by where its receiver does not say."""


def update_positioning(
    known: Positioning,
    message: Gps | EstimatorStatus | SystemStatus,
    at: PositionFix | None,
    now_s: float,
    *,
    stands: bool,
) -> Positioning:
    """Take what a vehicle says of its GPS.

    Args:
        known: What was known before.
        message: What it says.
        at: Its newest position.
        now_s: When this was heard.
        stands: Whether it stands disarmed before its flight.
    """
    match message:
        case Gps():
            return _gps_heard(known, message, at, now_s)
        case EstimatorStatus():
            return _estimator_heard(known, message, now_s, stands=stands)
        case SystemStatus(unhealthy=unhealthy):
            # For a receiver that says nothing itself.
            ill = unhealthy & GPS_SENSOR and now_s - known.reported_s > REPORTED_S
            return _record_gps_loss(known, "GPS not healthy", now_s) if ill else known


def _gps_heard(known: Positioning, message: Gps, at: PositionFix | None, now_s: float) -> Positioning:
    """Take what a receiver says.

    A report whose own time stands still is that of the last fix, repeated: ArduPilot does so for four seconds.
    """
    fixes = (*(one for one in known.fixes if one[0] != message.receiver), (message.receiver, message.fix))
    repeated = message.measured_s is not None and message.measured_s == known.measured_s and not message.receiver
    known = replace(known, fixes=fixes, reported_s=now_s)
    if max(fix for _, fix in fixes) < FIXED:
        return _record_gps_loss(known, "no GPS fix", now_s)
    if message.fix < FIXED or repeated:
        return known
    measured_s = known.measured_s if message.receiver else message.measured_s
    known = replace(known, measured_s=measured_s, accuracy_m=message.accuracy_m)
    if known.adrift_s is not None and now_s - known.estimated_s <= REPORTED_S:
        return known
    if known.lost_s is None:
        return known if at is None else replace(known, fixed=at)
    # The newest position is from before: the next report confirms one.
    return replace(known, lost_s=None, why="", regained_s=now_s)


def _estimator_heard(known: Positioning, message: EstimatorStatus, now_s: float, *, stands: bool) -> Positioning:
    """Take what an estimator says of itself.

    ArduPilot's takes half a minute to use a receiver that has a fix: until then there is nothing that it could lose.
    """
    known = replace(known, estimated_s=now_s)
    if message.is_absolute:
        return known if known.adrift_s is None else replace(known, adrift_s=None)
    since_s = now_s if known.adrift_s is None else known.adrift_s
    if stands and known.lost_s is None:
        return replace(known, adrift_s=since_s, fixed=None)
    return _record_gps_loss(replace(known, adrift_s=since_s), "its estimator does not use GPS", now_s)


def _record_gps_loss(known: Positioning, why: str, now_s: float) -> Positioning:
    if known.lost_s is not None or known.fixed is None:
        return known
    return replace(known, lost_s=now_s, why=why)


def time_without_fix_s(known: Positioning, at: PositionFix) -> float:
    """Return how long before a position the last one with a fix was, by the vehicle's own clock; 0 where it has one."""
    if not at.reckoned or known.fixed is None:
        return 0.0
    return max(0.0, at.boot_s - known.fixed.boot_s)


def is_dead_reckoning(vehicle: VehicleState) -> bool:
    """Return whether its newest position proves nothing: it is reckoned for longer than a gap that is tolerated."""
    fix = vehicle.motion.fix
    return fix is not None and time_without_fix_s(vehicle.sensors.positioning, fix) > GAP_S


def jumps_by_itself(known: Positioning, now_s: float) -> bool:
    """Return whether positions may jump as GPS is lost, or has just been regained."""
    return known.lost_s is not None or now_s - known.regained_s <= SETTLES_S


def describe_gps_return(before: VehicleState, after: VehicleState, now_s: float) -> str:
    """Return in words that GPS was regained in the air; empty if it was not."""
    lost_s = before.sensors.positioning.lost_s
    if lost_s is None or after.sensors.positioning.lost_s is not None or not after.airborne:
        return ""
    return f"GPS regained after {now_s - lost_s:.0f} s"


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How well the newest position is known."""

    known: str
    """fix: by GPS. reckoned: without it. unsaid: the vehicle has said nothing of its GPS."""
    off_m: float
    """By so much it may be off; a reckoned one by this or more."""
    fixed: PositionFix | None = None
    """The last position with a fix, of one that is reckoned."""


def accuracy_of(vehicle: VehicleState) -> Accuracy | None:
    """Return how well a vehicle's newest position is known; None where there is none."""
    fix, known = vehicle.motion.fix, vehicle.sensors.positioning
    if fix is None:
        return None
    usual_m = USUAL_M if known.accuracy_m is None else known.accuracy_m
    if fix.reckoned:
        drift_m = 0.5 * DRIFT_M_S2 * time_without_fix_s(known, fix) ** 2
        return Accuracy("reckoned", usual_m + drift_m, known.fixed)
    return Accuracy("unsaid" if known.fixed is None else "fix", usual_m)
