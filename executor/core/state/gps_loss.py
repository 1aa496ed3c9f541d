"""When a vehicle loses GPS, and has it again.

Three things say so: the receiver's fix (GPS_RAW_INT), the estimator's flags (EKF_STATUS_REPORT, ESTIMATOR_STATUS), and,
where the receiver says nothing, its health in SYS_STATUS. GPS is lost only where there was a fix before: who flies
indoors has none to lose.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.interface.messages import EstimatorStatus, Gps, SystemStatus
from executor.core.lines import position
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.core.state.vehicle_state import VehicleState

FIXED = 3
"""GPS_FIX_TYPE: three-dimensional. With less neither autopilot uses the receiver."""
REPORTED_S = 5.0
"""A report of the receiver or of the estimator that is older says nothing of now."""
GPS_SENSOR = 0x20
"""MAV_SYS_STATUS_SENSOR_GPS."""


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
            return _record_gps_loss(known, position.NOT_HEALTHY, now_s) if ill else known


def _gps_heard(known: Positioning, message: Gps, at: PositionFix | None, now_s: float) -> Positioning:
    """Take what a receiver says.

    A report whose own time stands still is that of the last fix, repeated: ArduPilot does so for four seconds.
    """
    fixes = (*(one for one in known.fixes if one[0] != message.receiver), (message.receiver, message.fix))
    repeated = message.measured_s is not None and message.measured_s == known.measured_s and not message.receiver
    known = replace(known, fixes=fixes, reported_s=now_s)
    if max(fix for _, fix in fixes) < FIXED:
        return _record_gps_loss(known, position.NO_FIX, now_s)
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
    return _record_gps_loss(replace(known, adrift_s=since_s), position.NOT_USED, now_s)


def _record_gps_loss(known: Positioning, why: str, now_s: float) -> Positioning:
    if known.lost_s is not None or known.fixed is None:
        return known
    return replace(known, lost_s=now_s, why=why)


def describe_gps_return(before: VehicleState, after: VehicleState, now_s: float) -> str:
    """Return in words that GPS was regained in the air; empty if it was not."""
    lost_s = before.sensors.positioning.lost_s
    if lost_s is None or after.sensors.positioning.lost_s is not None or not after.airborne:
        return ""
    return position.GPS_REGAINED.format(lost_s=now_s - lost_s)
