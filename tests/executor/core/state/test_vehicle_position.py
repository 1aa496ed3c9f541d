"""Where a vehicle is, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.inflight.touchdown import describe_unexpected_landing
from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_position import (
    describe_down_place,
    describe_last_position,
    describe_position,
    format_coordinates,
    is_at_rest,
)
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.vehicles import CONTEXT, DISARMED, NOW_S, RTL, at, flying

PLACE = "{:.5f}, {:.5f} (GPS not reported)".format(*CONTEXT.frame.to_wgs84_deg(*at().place_m))
HOMEWARD = Heartbeat(3, RTL, True, 4)


def moving(east_m_s: float = 0.0, north_m_s: float = 0.0, up_m_s: float = 0.0, age_s: float = 0.0) -> VehicleState:
    fix = replace(at(age_s=age_s), velocity_m_s=(east_m_s, north_m_s, up_m_s))
    return flying(heartbeat=DISARMED, disarmed_s=NOW_S - 3.0, fix=fix)


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


def test_a_place_in_words() -> None:
    assert format_coordinates(CONTEXT, flying()) == PLACE
    assert describe_position(CONTEXT, flying()) == f"{PLACE}, 20 m over its home"
    assert (
        describe_last_position(CONTEXT, flying(), NOW_S + 12.0)
        == f"last position {PLACE}, 20 m over its home, 12 s ago"
    )
    assert describe_down_place(CONTEXT, flying()) == f"down at {PLACE}, armed: keep away"
    assert describe_down_place(CONTEXT, flying(heartbeat=DISARMED)) == f"down at {PLACE}, disarmed"
    lost = flying(fix=None)
    assert (format_coordinates(CONTEXT, lost), describe_position(CONTEXT, lost)) == (
        "an unknown place",
        "an unknown place",
    )
    assert describe_last_position(CONTEXT, lost, NOW_S) == "its position is not known"


@pytest.mark.parametrize(
    ("state", "rests"),
    [
        (moving(), True),
        (with_facts(moving(), disarmed_s=NOW_S - 2.9), False),
        (moving(age_s=1.5), True),
        (moving(age_s=1.6), False),
        (moving(0.49), True),
        (moving(0.5), False),
        (moving(0.0, 0.5), False),
        (moving(0.0, 0.0, -0.5), False),
        (moving(0.3, 0.3, -0.3), False),
        (with_facts(moving(), fix=None), False),
    ],
)
def test_a_disarmed_vehicle_lies_at_its_reported_position(state: VehicleState, *, rests: bool) -> None:
    assert is_at_rest(state, NOW_S) is rests


def test_whether_it_is_armed_is_reported_where_that_is_known() -> None:
    assert describe_unexpected_landing(CONTEXT, stood(), NOW_S) == f"does not move, down at {PLACE}, armed: keep away"
    unsaid = describe_unexpected_landing(CONTEXT, stood(heartbeat_s=NOW_S - 10.0), NOW_S)
    assert unsaid == f"does not move, down at {PLACE}; no HEARTBEAT says that it is disarmed: keep away"
