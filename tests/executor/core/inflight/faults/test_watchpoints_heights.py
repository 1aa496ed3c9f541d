"""A vehicle that does not hold its height on its mission."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.messages import Heartbeat
from executor.core.state.vehicle_parts import PositionFix
from missions.items import MissionItem
from tests.executor.core.inflight.faults.watch_views import look
from tests.executor.core.vehicles import NOW_S, RTL, SETUP, at, flying, mission, says

UNPLANNED = replace(SETUP, planned=False)
WEAK = "Potential Thrust Loss (3)"


def on_leg(up_m: float, *, age_s: float = 0.0, stood_s: float = 0.0) -> PositionFix:
    """Return a vehicle in the middle of its second leg, which leads from 15 m to 15 m."""
    (east, north), (x, y) = mission().places_m[1:3]
    return replace(at(up_m=up_m, age_s=age_s + stood_s), place_m=((east + x) / 2, (north + y) / 2))


SINKS: list[tuple[dict[str, Any], str]] = [
    ({"fix": on_leg(10.0), "climbs_m_s": -2.4}, "sinks at 2.4 m/s, 5 m below its mission"),
    ({"fix": on_leg(10.1), "climbs_m_s": -2.4}, "ok"),
    ({"fix": on_leg(2.0), "climbs_m_s": -0.51}, "sinks at 0.5 m/s, 13 m below its mission"),
    ({"fix": on_leg(2.0), "climbs_m_s": -0.5}, "ok"),
    ({"fix": on_leg(2.0), "climbs_m_s": 1.0}, "ok"),
    ({"fix": on_leg(2.0), "climbs_m_s": -2.4, "heartbeat": Heartbeat(3, RTL, True, 4)}, "ok"),
    ({"fix": on_leg(2.0), "climbs_m_s": -2.4, "waypoint": 5}, "ok"),
    ({"fix": on_leg(2.0, age_s=3.1), "climbs_m_s": -2.4}, "stale"),
    # Its own word of lost thrust decides nothing alone, and halves what is waited for.
    (
        says(WEAK, NOW_S - 9.0, fix=on_leg(12.5), climbs_m_s=-1.0),
        f"sinks at 1.0 m/s, 2 m below its mission; it says: {WEAK}",
    ),
    (says(WEAK, NOW_S - 9.0, fix=on_leg(12.6), climbs_m_s=-1.0), "ok"),
    (says(WEAK, NOW_S - 10.1, fix=on_leg(12.5), climbs_m_s=-1.0), "ok"),
    (says(WEAK, fix=on_leg(2.0), climbs_m_s=0.0), "ok"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "expected"), SINKS)
def test_a_vehicle_sinking_far_below_its_mission(changes: dict[str, Any], expected: str) -> None:
    assert look("sinking", flying(**changes)) == expected


TARGETS: list[tuple[dict[str, Any], str]] = [
    ({}, "sinks at 1.0 m/s, while its autopilot wants to be 3.6 m higher"),
    ({"below_m": 2.0}, "sinks at 1.0 m/s, while its autopilot wants to be 2.0 m higher"),
    ({"below_m": 1.9}, "ok"),
    ({"climbs_m_s": -0.8}, "ok"),
    ({"below_s": NOW_S - 3.6}, "ok"),
    ({"took_off": False}, "ok"),
    ({"heartbeat": Heartbeat(3, RTL, True, 4)}, "ok"),
    ({"listed": (MissionItem(2, 3, 21),), "leads_to": 2}, "ok"),  # it lands
    (says("EKF Failsafe: changed to Land Mode"), "ok"),  # it does not know how high it is
    (says(WEAK, below_m=1.0), f"sinks at 1.0 m/s, while its autopilot wants to be 1.0 m higher; it says: {WEAK}"),
    ({"fix": at(age_s=3.1)}, "stale"),
]


@pytest.mark.parametrize(("changes", "expected"), TARGETS)
def test_a_vehicle_sinking_while_its_autopilot_wants_to_climb(changes: dict[str, Any], expected: str) -> None:
    sinks = {"below_m": 3.6, "below_s": NOW_S, "climbs_m_s": -1.0}
    assert look("thrust", flying(**{**sinks, **changes}), UNPLANNED) == expected


LIES: list[tuple[dict[str, Any], str]] = [
    ({}, "has not moved for 5 s on its mission, 0 m over its home, after it came down"),
    ({"anchor": at(up_m=0.0, age_s=4.9)}, "ok"),
    ({"fix": at(up_m=1.6)}, "ok"),  # it may hover there
    ({"drops_s": NOW_S - 9.1}, "ok"),  # it came down as in a landing
    ({"took_off": False}, "ok"),
    ({"heartbeat": Heartbeat(3, RTL, True, 4)}, "ok"),
    ({"listed": (MissionItem(2, 3, 21),), "leads_to": 2}, "ok"),
    ({"fix": at(up_m=0.0, age_s=3.1)}, "stale"),
]


@pytest.mark.parametrize(("changes", "expected"), LIES)
def test_a_vehicle_down_on_its_mission_and_still_armed(changes: dict[str, Any], expected: str) -> None:
    lies = {"fix": at(up_m=0.0), "anchor": at(up_m=0.0, age_s=5.0), "drops_s": NOW_S - 8.0}
    assert look("lies", flying(**{**lies, **changes}), UNPLANNED) == expected


def test_a_vehicle_lying_far_below_its_known_mission() -> None:
    lies = flying(fix=on_leg(3.0), anchor=on_leg(3.0, stood_s=8.0))
    assert look("lies", lies) == "does not move, down at 49.59996, 15.60208 (GPS not reported), armed: keep away"
    assert look("lies", flying(fix=on_leg(15.0), anchor=on_leg(15.0, stood_s=8.0))) == "ok"
