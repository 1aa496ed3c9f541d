"""Detect when a vehicle loses GPS and when it regains it.

Three sources report it: the receiver's fix (GPS_RAW_INT), the estimator's flags (EKF_STATUS_REPORT, ESTIMATOR_STATUS),
and, without receiver messages, the GPS health in SYS_STATUS. GPS counts as lost only after a fix: a vehicle indoors has
none to lose.
"""

from __future__ import annotations

from dataclasses import replace

from executor.core.interface.messages import EstimatorStatus, Gps, SystemStatus
from executor.core.lines import position
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.core.state.vehicle_state import VehicleState

FIX_3D = 3
"""GPS_FIX_TYPE: three-dimensional; with less neither autopilot uses the receiver."""
REPORT_AGE_S = 5.0
"""Age at which a receiver's or estimator's report is stale."""
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
    """Update a vehicle's GPS state with a message.

    Args:
        known: The state before.
        message: The message.
        at: Its newest position.
        now_s: When the message was received.
        stands: Whether the vehicle is disarmed on the ground before its flight.
    """
    match message:
        case Gps():
            return _apply_gps(known, message, at, now_s)
        case EstimatorStatus():
            return _apply_estimator(known, message, now_s, stands=stands)
        case SystemStatus(unhealthy=unhealthy):
            # Only without receiver messages.
            ill = unhealthy & GPS_SENSOR and now_s - known.reported_s > REPORT_AGE_S
            return _record_gps_loss(known, position.NOT_HEALTHY, now_s) if ill else known


def _apply_gps(known: Positioning, message: Gps, at: PositionFix | None, now_s: float) -> Positioning:
    """Apply a receiver's report.

    A report whose own time does not advance repeats the last fix: ArduPilot does so for four seconds.
    """
    fixes = (*(one for one in known.fixes if one[0] != message.receiver), (message.receiver, message.fix))
    repeated = message.measured_s is not None and message.measured_s == known.measured_s and not message.receiver
    known = replace(known, fixes=fixes, reported_s=now_s)
    if max(fix for _, fix in fixes) < FIX_3D:
        return _record_gps_loss(known, position.NO_FIX, now_s)
    if message.fix < FIX_3D or repeated:
        return known
    measured_s = known.measured_s if message.receiver else message.measured_s
    known = replace(known, measured_s=measured_s, accuracy_m=message.accuracy_m)
    if known.adrift_s is not None and now_s - known.estimated_s <= REPORT_AGE_S:
        return known
    if known.lost_s is None:
        return known if at is None else replace(known, fixed=at)
    # The newest position is older: the next report confirms one.
    return replace(known, lost_s=None, why="", regained_s=now_s)


def _apply_estimator(known: Positioning, message: EstimatorStatus, now_s: float, *, stands: bool) -> Positioning:
    """Apply an estimator's status.

    ArduPilot's estimator takes half a minute to use a receiver with a fix; until then it has nothing to lose.
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
    """Return the line for GPS regained in the air; empty otherwise."""
    lost_s = before.sensors.positioning.lost_s
    if lost_s is None or after.sensors.positioning.lost_s is not None or not after.airborne:
        return ""
    return position.GPS_REGAINED.format(lost_s=now_s - lost_s)
