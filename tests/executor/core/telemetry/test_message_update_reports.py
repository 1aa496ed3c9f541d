"""Any other message, and everything that it changes of what is known of a vehicle."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    Attitude,
    FenceStatus,
    Gps,
    LandedState,
    MissionCurrent,
    OrderSeen,
    Radio,
    StationHeard,
    StatusText,
    Traffic,
    Wind,
)
from executor.core.state.vehicle_state import Stage
from executor.core.telemetry import message_update
from tests.executor.builders import fleet_of, vehicle
from tests.executor.core.steps import rounded
from tests.executor.core.telemetry.message_effects import CONTEXT, folded
from tests.executor.core.vehicles import (
    NOW_S,
    flying,
    says,
)

PX4_FLEET = fleet_of(autopilot="px4")
PX4_CONTEXT = PX4_FLEET.context

ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("an item", lambda: folded(flying(), MissionCurrent(7, None)), ({"waypoint": 4, "item": (7, None)},)),
    (
        "items",
        lambda: [
            message_update.apply_message(
                CONTEXT, flying(waypoint=waypoint), MissionCurrent(seq, None), NOW_S
            ).state.assignment.waypoint
            for waypoint, seq in ((2, 0), (2, 1), (2, 9), (2, 10), (2, -1), (5, 4), (4, 4), (5, 9))
        ],
        [2, 0, 5, 2, 2, 5, 2, 5],
    ),
    (
        "items of PX4's",
        lambda: [
            message_update.apply_message(
                PX4_CONTEXT,
                vehicle(PX4_FLEET, "uav1", stage=Stage.FLYING, waypoint=1),
                MissionCurrent(seq, None),
                NOW_S,
            ).state.assignment.waypoint
            for seq in (-1, 0, 1, 3)
        ],
        [1, 0, 1, 2],
    ),
    (
        "items in other stages",
        lambda: [
            message_update.apply_message(
                CONTEXT, flying(stage=stage), MissionCurrent(7, None), NOW_S
            ).state.assignment.waypoint
            for stage in Stage
        ],
        [2, 4, 4, 2, 4, 2, 2, 4],
    ),
    (
        "items of another mission",
        lambda: folded(flying(), MissionCurrent(7, 12)),
        ({"item": (7, 12), "carried": {"foreign_s": NOW_S, "words": "12 items where ours has 9"}},),
    ),
    (
        "items of another mission while it is given one",
        lambda: [
            folded(flying(**given), MissionCurrent(7, 12))[0].get("carried")
            for given in ({"pending": 4}, {"stubborn": True}, {"stage": Stage.RETURNING}, {"board": None})
        ],
        [None, None, None, None],
    ),
    ("on the ground", lambda: folded(flying(), LandedState(True)), ({"on_ground": True},)),
    ("satellites", lambda: folded(flying(), Gps(3, 12))[0]["gps"], Gps(fix=3, satellites=12)),
    ("wind", lambda: folded(flying(), Wind(4.0, 90.0)), ({"wind": Wind(speed_m_s=4.0, from_deg=90.0)},)),
    (
        "an attitude",
        lambda: [
            folded(flying(tilted_since_s=since_s), Attitude(roll_deg, pitch_deg))[0].get("tilted_since_s")
            for since_s in (None, 5.0)
            for roll_deg, pitch_deg in ((75.0, 0.0), (75.1, 0.0), (0.0, -75.1))
        ],
        [None, NOW_S, NOW_S, None, None, None],
    ),
    ("a fence", lambda: folded(flying(), FenceStatus(True)), ({"fence_breached": True, "breached_s": NOW_S},)),
    ("words", lambda: folded(flying(), StatusText(4, "hello")), ({}, None, StatusText(severity=4, text="hello"))),
    (
        "words of an alarm",
        lambda: folded(flying(), StatusText(4, "Battery Failsafe")),
        (says("Battery Failsafe"), None, StatusText(severity=4, text="Battery Failsafe")),
    ),
    (
        "words that only say what follows",
        lambda: [
            folded(flying(alarm=("Low battery", NOW_S - age_s)), StatusText(4, "Failsafe activated: Return"))[0].get(
                "alarm"
            )
            for age_s in (4.9, 5.0)
        ],
        [None, ("Failsafe activated: Return", NOW_S)],
    ),
    (
        "words of a mission that somebody else put on board",
        lambda: folded(flying(), StatusText(6, "Flight plan received")),
        (
            {"carried": {"told_s": NOW_S}},
            None,
            StatusText(severity=6, text="Flight plan received"),
        ),
    ),
    (
        "an order of others",
        lambda: folded(flying(spoke_s=5.0), OrderSeen(21)),
        ({"others_orders": ((OrderSeen(21), NOW_S),)},),
    ),
    (
        "traffic",
        lambda: folded(flying(spoke_s=5.0), Traffic(30, 1)),
        ({"quality": {"window": ((NOW_S, 30, 1),), "lost": 0.0322581, "usual": 0.0322581}},),
    ),
    (
        "a radio",
        lambda: folded(flying(spoke_s=5.0), Radio(80, 60, 20, 20, 90)),
        (
            {
                "quality": {
                    "radio": Radio(rssi=80, remote_rssi=60, noise=20, remote_noise=20, free_buffer_pct=90),
                    "radio_s": NOW_S,
                }
            },
        ),
    ),
    (
        "another station",
        lambda: folded(flying(spoke_s=5.0), StationHeard(254, 190)),
        ({"strangers": frozenset({StationHeard(system=254, component=190)})},),
    ),
    (
        "the end of a silence",
        lambda: [folded(flying(spoke_s=NOW_S - age_s), Wind(4.0, 90.0))[0].get("regained_s") for age_s in (2.9, 3.0)],
        [None, NOW_S],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
