"""Vehicles that count as down, and those that fly after all."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.inflight.touchdown import describe_unexpected_landing, is_flying_again
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.vehicles import AUTO, CONTEXT, DISARMED, NOW_S, RTL, at, flying

HOMEWARD = Heartbeat(3, RTL, True, 4)


def stood(seconds: float = 30.0, **changes: object) -> VehicleState:
    """Return a vehicle that should be on its way home and has not moved for so long."""
    told: dict[str, object] = {
        "stage": Stage.RETURNING,
        "heartbeat": HOMEWARD,
        "left_s": NOW_S - 60.0,
        "fix": at(up_m=0.5),
        "anchor": replace(at(up_m=0.5), boot_s=NOW_S - seconds),
    }
    return flying(**(told | changes))


ON_PAD = {"fix": at(east_m=15.0, up_m=2.0)}
DOWN = [
    # (it is not found down yet, it is)
    (stood(29.9), stood(30.0)),
    (stood(4.9, on_ground=True), stood(5.0, on_ground=True)),
    (stood(149.9, on_ground=False, fix=at(up_m=5.1)), stood(150.0, on_ground=False, fix=at(up_m=5.1))),
    (stood(30.0, on_ground=False, fix=at(up_m=5.1)), stood(30.0, on_ground=False, fix=at(up_m=5.0))),
    (stood(left_s=NOW_S - 4.9), stood(left_s=NOW_S - 5.0)),
    (stood(left_s=None), stood()),
    # It flies its mission, and says so; after 10 s without a HEARTBEAT nobody knows that any more.
    (stood(heartbeat=Heartbeat(3, AUTO, True, 4)), stood(heartbeat_s=NOW_S - 10.0)),
    (
        stood(heartbeat=Heartbeat(3, AUTO, True, 4), heartbeat_s=NOW_S - 9.9),
        stood(heartbeat=Heartbeat(3, AUTO, True, 4), heartbeat_s=NOW_S - 10.0),
    ),
    (
        stood(heartbeat=Heartbeat(3, AUTO, True, 4), heartbeat_s=NOW_S - 99.0, excused_s=NOW_S - 9.9),
        stood(heartbeat=Heartbeat(3, AUTO, True, 4), heartbeat_s=None),
    ),
    # Over its pad, which is within 15 m, it comes down.
    (stood(fix=at(east_m=15.0, up_m=2.1)), stood(fix=at(east_m=15.0, up_m=2.0))),
    (stood(fix=at(east_m=15.0, up_m=2.1)), stood(fix=at(east_m=15.1, up_m=2.1))),
    (stood(29.9, on_ground=True, **ON_PAD), stood(30.0, on_ground=True, **ON_PAD)),
    # It has not noticed yet that it stands on its pad.
    (stood(149.9, on_ground=False, **ON_PAD), stood(150.0, on_ground=False, **ON_PAD)),
    (stood(30.0, on_ground=False, **ON_PAD), stood(30.0, on_ground=False, fix=at(east_m=15.1, up_m=2.0))),
    (stood(fix=None), stood()),
    (stood(anchor=None), stood()),
]


@pytest.mark.parametrize(("not_yet", "down"), DOWN, ids=map(str, range(len(DOWN))))
def test_a_vehicle_that_has_stopped_in_its_return_is_down(not_yet: VehicleState, down: VehicleState) -> None:
    assert describe_unexpected_landing(CONTEXT, not_yet, NOW_S) == ""
    assert describe_unexpected_landing(CONTEXT, down, NOW_S).startswith("does not move, down at ")


@pytest.mark.parametrize(
    ("state", "flies"),
    [
        (flying(fix=at(up_m=25.1)), True),
        (flying(fix=at(up_m=25.0)), False),
        (flying(fix=at(up_m=14.9)), True),
        (flying(fix=replace(at(), velocity_m_s=(1.5, 0.0, 0.0))), False),
        (flying(fix=replace(at(), velocity_m_s=(0.0, 1.6, 0.0))), True),
        (flying(fix=replace(at(), velocity_m_s=(0.0, 0.0, 1.6))), True),
        (flying(fix=at(up_m=30.0), heartbeat=DISARMED), False),
        (flying(fix=at(up_m=30.0), tilted_since_s=NOW_S), False),
        (flying(fix=None), False),
        (flying(anchor=None), False),
    ],
)
def test_a_vehicle_found_down_that_flies(state: VehicleState, *, flies: bool) -> None:
    still = replace(at(), velocity_m_s=(0.0, 0.0, 0.0))
    fix = state.motion.fix
    if fix is not None and fix.velocity_m_s == at().velocity_m_s:
        state = with_facts(state, fix=replace(fix, velocity_m_s=(0.0, 0.0, 0.0)))
    if state.motion.anchor is not None:
        state = with_facts(state, anchor=still)
    assert is_flying_again(state) is flies
