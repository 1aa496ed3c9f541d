"""A simulated ArduPilot copter at its operator's hand: what several tests begin with."""

from __future__ import annotations

from missions.items import MissionItem
from simulator.config import AutopilotKind
from tests.simulator.harness import (
    Operator,
    numbered,
    takeoff,
    waypoint,
)

HOME = waypoint(0, 0, 0.0)


def operator(*, heartbeats: bool = True, **changes: object) -> Operator:
    return Operator(AutopilotKind.ARDUPILOT, changes, heartbeats=heartbeats)


def mission(*items: MissionItem) -> tuple[MissionItem, ...]:
    return numbered((HOME, takeoff(), *items))


def cruising(*items: MissionItem, **changes: object) -> Operator:
    """Return a vehicle on its first leg at full speed."""
    op = Operator(AutopilotKind.ARDUPILOT, changes)
    op.fly(mission(*items))
    op.run_until(lambda: op.vehicle.frame.body.ground_speed_m_s > 4.9)
    return op


def speed_now(op: Operator) -> float:
    return op.vehicle.frame.body.ground_speed_m_s
