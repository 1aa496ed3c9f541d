"""The height that a mission asks for where its vehicle is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.core.context import VehicleSetup
from executor.core.interface.messages import Heartbeat
from executor.core.state.mission_height import (
    add_onboard_item,
    find_mission_height,
    is_stopped_below_mission,
    item_of,
    record_current_item,
    restart_mission_here,
)
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import OnboardMission, OwnMission, PositionFix
from executor.core.state.vehicle_state import VehicleState
from missions.items import Frame, MissionItem
from tests.executor.core.vehicles import AUTO, CONTEXT, DISARMED, LIMITS, NOW_S, RTL, SETUP, at, flying, mission

UNPLANNED = replace(SETUP, planned=False)


def board(*heights_m: float) -> OnboardMission:
    """Return the usual mission with other heights of its waypoints, from the take-off on."""
    one = mission()
    points = tuple(
        replace(point, alt_rel_m=up_m)
        for point, up_m in zip(one.path.waypoints, (*heights_m, 15.0, 15.0, 15.0, 15.0, 15.0, 0.0)[:6], strict=True)
    )
    return replace(one, path=replace(one.path, waypoints=points))


def over(share: float, leg: int, up_m: float) -> PositionFix:
    """Return a vehicle over a part of one leg of the mission."""
    (east, north), (x, y) = mission().places_m[leg - 1 : leg + 1]
    place = (east + share * (x - east), north + share * (y - north))
    return replace(at(up_m=up_m), place_m=place)


def below_m(one: VehicleState, setup: VehicleSetup = SETUP) -> float | None:
    found = find_mission_height(CONTEXT, setup, one)
    return None if found is None else round(found.below_m, 2)


@pytest.mark.parametrize(
    ("heights_m", "share", "expected"),
    [
        ((15.0, 15.0, 15.0), 0.5, 5.0),
        ((15.0, 15.0, 35.0), 0.5, 15.0),  # half of the climb
        ((15.0, 35.0, 15.0), 0.25, 20.0),  # a quarter of the descent
        ((15.0, 35.0, 15.0), -0.1, 25.0),  # it has begun the leg early
        ((15.0, 35.0, 15.0, 8.0), 1.2, 3.6),  # beyond its end it may be on the next one already
    ],
)
def test_a_leg_leads_straight_from_one_height_to_the_next(
    heights_m: tuple[float, ...], share: float, expected: float
) -> None:
    assert below_m(flying(board=board(*heights_m), fix=over(share, 2, 10.0))) == pytest.approx(expected)


def test_how_fast_it_leads_down_follows_from_its_speed() -> None:
    found = find_mission_height(CONTEXT, SETUP, flying(board=board(15.0, 35.0, 15.0), fix=over(0.5, 2, 10.0)))
    assert found is not None
    assert found.sinks_m_s == pytest.approx(0.6)  # 20 m down on 100 m, at 3 m/s


NOWHERE: list[dict[str, Any]] = [
    {"heartbeat": Heartbeat(3, RTL, True, 4)},
    {"heartbeat": DISARMED},
    {"heartbeat": None},
    {"fix": None},
    {"took_off": False},
    {"waypoint": 0},  # it takes off
    {"waypoint": 5},  # it lands
    {"board": None},
    {"waypoint": 4, "fix": over(1.01, 4, 10.0)},  # over its pad the landing begins
    {"item_s": NOW_S - 5.1},
    {"carried": replace(MissionOwnership(), foreign_s=NOW_S)},
]


@pytest.mark.parametrize("changes", NOWHERE)
def test_where_nothing_is_asked(changes: dict[str, Any]) -> None:
    assert below_m(flying(**changes)) is None


def item(seq: int, up_m: float = 40.0, command: int = 16, frame: int = 3, east_m: float = 500.0) -> MissionItem:
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(east_m, SETUP.pad_m[1])
    return MissionItem(seq, frame, command, x=round(lat_deg * 1e7), y=round(lon_deg * 1e7), z=up_m)


def seen(
    *items: MissionItem, to: int, came_from: int | None = None, leg_from: PositionFix | None = None
) -> VehicleState:
    listed = tuple(items)
    return flying(listed=listed, leads_to=to, came_from=came_from, leg_from=leg_from, fix=at(up_m=20.0))


FROM = replace(at(up_m=30.0), place_m=(SETUP.pad_m[0] + 100.0, SETUP.pad_m[1]))


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (seen(item(1, 60.0, east_m=0.0), item(2), to=2, came_from=1), 29.5),
        (seen(item(1, 60.0), item(2), to=2, leg_from=at(up_m=40.0)), 20.0),
        (seen(item(1, 90.0, command=22), item(2), to=2, came_from=1, leg_from=at(up_m=40.0)), 20.0),
        (seen(item(2, 470.0 + 9.0, frame=Frame.GLOBAL), to=2, leg_from=at(up_m=29.0)), 9.0),
        (seen(item(2), to=2), None),  # nobody knows where the leg began
        (seen(item(2, command=21), to=2, leg_from=at()), None),
        (seen(item(2, frame=10), to=2, leg_from=at()), None),  # over the ground, which nobody knows
        (seen(item(2), to=3, leg_from=at()), None),
    ],
)
def test_the_items_of_a_log_ask_alike(one: VehicleState, expected: float | None) -> None:
    found = below_m(one, UNPLANNED)
    assert found == (None if expected is None else pytest.approx(expected, abs=0.1))


def test_the_items_of_a_log_are_put_together() -> None:
    own = OwnMission()
    for seq in (0, 2, 1, 1):
        own = add_onboard_item(own, item(seq))
    assert [one.seq for one in own.listed] == [0, 1, 2]
    assert item_of(own, 2) == item(2)
    assert item_of(own, 7) is None
    assert [one.seq for one in add_onboard_item(own, item(0)).listed] == [0], "another mission begins"


def test_a_speed_command_leads_nowhere() -> None:
    own = OwnMission(listed=(item(0), item(1), item(2, command=178), item(3)), leads_to=1)
    assert record_current_item(own, 2, FROM) == own
    assert record_current_item(own, 1, FROM) == own
    on = record_current_item(own, 3, FROM)
    assert (on.leads_to, on.came_from, on.leg_from) == (3, 1, FROM)
    again = restart_mission_here(on)
    assert (again.leads_to, again.came_from, again.leg_from) == (3, None, None)


@pytest.mark.parametrize(("stood_s", "up_m", "lies"), [(8.0, 10.0, True), (7.9, 10.0, False), (8.0, 10.1, False)])
def test_a_vehicle_stopped_far_below_its_mission_is_down(stood_s: float, up_m: float, lies: bool) -> None:
    one = flying(fix=over(0.5, 2, up_m), anchor=replace(over(0.5, 2, up_m), boot_s=NOW_S - stood_s))
    assert LIMITS.lies_s == 8.0
    assert is_stopped_below_mission(CONTEXT, SETUP, one) is lies
    assert not is_stopped_below_mission(CONTEXT, SETUP, replace(one, motion=replace(one.motion, anchor=None)))
    assert Heartbeat(3, AUTO, True, 4) == one.telemetry.heartbeat
