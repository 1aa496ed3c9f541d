"""Where a vehicle is, in words, and who is taken to be down."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import words
from executor.core.homing.down import flies_again, found_down
from executor.core.messages import Heartbeat
from executor.core.places import at_rest, coordinates, last_heard, place_words, where
from executor.core.vehicle import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.faults.test_watchpoints import AUTO, CONTEXT, DISARMED, NOW_S, RTL, at, flying

PLACE = "{:.6f}, {:.6f}".format(*CONTEXT.frame.to_wgs84_deg(*at().place_m))
HOMEWARD = Heartbeat(3, RTL, True, 4)


def test_a_place_in_words() -> None:
    assert coordinates(CONTEXT, flying()) == PLACE
    assert where(CONTEXT, flying()) == f"{PLACE}, 20 m over its home"
    assert last_heard(CONTEXT, flying()) == f"last position {PLACE}, 20 m over its home"
    assert place_words(CONTEXT, flying()) == f"down at {PLACE}, armed: keep away"
    assert place_words(CONTEXT, flying(heartbeat=DISARMED)) == f"down at {PLACE}, disarmed"
    lost = flying(fix=None)
    assert (coordinates(CONTEXT, lost), where(CONTEXT, lost)) == ("an unknown place", "an unknown place")
    assert last_heard(CONTEXT, lost) == "its position is not known"


def moving(east_m_s: float = 0.0, north_m_s: float = 0.0, up_m_s: float = 0.0, age_s: float = 0.0) -> VehicleState:
    fix = replace(at(age_s=age_s), velocity_m_s=(east_m_s, north_m_s, up_m_s))
    return flying(heartbeat=DISARMED, disarmed_s=NOW_S - 3.0, fix=fix)


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
def test_who_has_disarmed_lies_where_it_is_seen_to_lie(state: VehicleState, *, rests: bool) -> None:
    assert at_rest(state, NOW_S) is rests


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
    (stood(fix=None), stood()),
    (stood(anchor=None), stood()),
]


@pytest.mark.parametrize(("not_yet", "down"), DOWN, ids=map(str, range(len(DOWN))))
def test_who_has_stopped_on_its_way_home_is_down(not_yet: VehicleState, down: VehicleState) -> None:
    assert found_down(CONTEXT, not_yet, NOW_S) == ""
    assert found_down(CONTEXT, down, NOW_S).startswith("does not move, down at ")


def test_whether_it_is_armed_is_said_where_that_is_known() -> None:
    assert found_down(CONTEXT, stood(), NOW_S) == f"does not move, down at {PLACE}, armed: keep away"
    unsaid = found_down(CONTEXT, stood(heartbeat_s=NOW_S - 10.0), NOW_S)
    assert unsaid == f"does not move, down at {PLACE}; no HEARTBEAT says that it is disarmed: keep away"


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
def test_who_was_found_down_and_flies(state: VehicleState, *, flies: bool) -> None:
    still = replace(at(), velocity_m_s=(0.0, 0.0, 0.0))
    fix = state.motion.fix
    if fix is not None and fix.velocity_m_s == at().velocity_m_s:
        state = with_facts(state, fix=replace(fix, velocity_m_s=(0.0, 0.0, 0.0)))
    if state.motion.anchor is not None:
        state = with_facts(state, anchor=still)
    assert flies_again(state) is flies


FIXES = ["no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK", "fix 7"]


@pytest.mark.parametrize(("number", "name"), list(enumerate(FIXES)))
def test_a_gps_fix_in_words(number: int, name: str) -> None:
    assert words.gps(number, None) == name
    assert words.gps(number, 0) == f"{name}, 0 sat"


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(0.0, "0:00"), (59.9, "0:59"), (60.0, "1:00"), (3599.0, "59:59"), (3600.0, "1:00:00"), (-0.1, "0:00")],
)
def test_a_time_in_words(seconds: float, shown: str) -> None:
    assert words.minutes(seconds) == shown
    assert words.since_take_off(seconds) == ("" if seconds < 0 else f"T+{shown}")
