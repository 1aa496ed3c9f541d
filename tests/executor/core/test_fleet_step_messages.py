"""Messages of a lost vehicle, and the effect of any message."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core import fleet_step
from executor.core.interface.commands import HandsOff, Level, Say, SendHome
from executor.core.interface.events import Heard
from executor.core.interface.messages import FlightMessage, MissionCurrent, Position, StationHeard, StatusText
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover, TextWindow
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import HOLD, LOW, SECOND, SENT_HOME, TAKEN, Row, beat, flight_of
from tests.executor.core.vehicles import AUTO, DISARMED, FLEET, NOW_S, OUT_THERE, PAD_N, RTL, at, flying

GONE = flying(stage=Stage.LOST, heard_s=NOW_S - 50.0, heartbeat_s=NOW_S - 50.0, spoke_s=NOW_S - 50.0)
LOST_ON_PAD = with_facts(GONE, fix=LOW, heartbeat=DISARMED)
HEARD = {"heard_s": NOW_S, "spoke_s": NOW_S}
SAID = HEARD | {"heartbeat_s": NOW_S, "beat_boot_s": NOW_S}
REGAINED = SAID | {"regained_s": NOW_S, "unseen_until_s": NOW_S}


def said(message: FlightMessage) -> Heard:
    return Heard("uav1", message)


def other(
    east_m: float,
    up_m: float = 20.0,
    *,
    north_m: float = 0.0,
    age_s: float = 0.0,
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> VehicleState:
    """Return another one in the air, so far east of 100 m, seen some time ago."""
    fix = replace(at(up_m=up_m, age_s=age_s), place_m=(100.0 + east_m, PAD_N + north_m), velocity_m_s=velocity_m_s)
    return with_facts(SECOND, fix=fix)


def position(up_m: float = 20.0) -> Heard:
    lat_deg, lon_deg = FLEET.context.frame.to_wgs84_deg(100.0, PAD_N)
    return said(Position(NOW_S + 1.0, lat_deg, lon_deg, 450.0 + up_m, up_m, 0.0, 0.0, 0.0, None))


ROWS = [
    Row(
        "who was lost and flies its mission is told to return",
        GONE,
        said(beat()),
        [
            Say(Level.WARNING, "uav1: link regained; its segments were reassigned, its mission is not resumed"),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | REGAINED | {"flew_mission": True}},
        {},
    ),
    Row(
        "who was lost and flies, in the moment in which the flight ended without it",
        GONE,
        said(beat()),
        [
            Say(Level.WARNING, "uav1: link regained; its segments were reassigned, its mission is not resumed"),
            SendHome("uav1"),
        ],
        {"uav1": SENT_HOME | REGAINED | {"flew_mission": True}},
        {"finished": False},
        {"finished": True},
    ),
    Row(
        "who was lost and is on its pad, in the moment in which the flight ended without it",
        LOST_ON_PAD,
        said(beat(AUTO, armed=False)),
        [
            Say(
                Level.INFO,
                "uav1: link regained, on the ground; switched to RTL, so that it cannot take off with its old mission",
            ),
            SendHome("uav1"),
        ],
        {"uav1": REGAINED | {"stage": Stage.LANDED, "heartbeat": beat(armed=False), "ordered_mode_s": NOW_S}},
        {"finished": False},
        {"finished": True},
    ),
    Row(
        "who was lost and comes home is left to that",
        GONE,
        said(beat(RTL)),
        [Say(Level.WARNING, "uav1: link regained, returning or landing by itself")],
        {
            "uav1": REGAINED
            | {
                "stage": Stage.RETURNING,
                "heartbeat": beat(RTL),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S - 50.0,
                "mode_before": 3,
                "anchor": None,
                "cause": ModeCause.FAILSAFE,
                "errand": HomingOrder(NOW_S),
                "left_s": NOW_S,
            }
        },
        {},
    ),
    Row(
        "who was lost and was taken",
        with_facts(GONE, cause=ModeCause.PERSON),
        said(beat(HOLD)),
        [
            Say(Level.WARNING, "uav1: link regained"),
            Say(Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here"),
            HandsOff("uav1"),
        ],
        {
            "uav1": REGAINED
            | {
                "stage": Stage.PILOT,
                "heartbeat": beat(HOLD),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S - 50.0,
                "mode_before": 3,
                "anchor": None,
                "certain": True,
                "taken": Takeover(since_s=NOW_S, given_away=True),
            }
        },
        {},
    ),
    Row(
        "who was lost, with its pilot all the time",
        with_facts(GONE, taken=TAKEN, cause=ModeCause.PERSON, heartbeat=beat(HOLD)),
        said(beat(HOLD)),
        [
            Say(Level.WARNING, "uav1: link regained"),
            Say(
                Level.FAULT, "uav1: with its pilot, mode HOLD; not commanded from here; its segments are kept for 30 s"
            ),
            HandsOff("uav1"),
        ],
        {"uav1": REGAINED | {"stage": Stage.PILOT, "anchor": None}},
        {},
    ),
    Row(
        "who was lost and is on its pad in its mission's mode",
        LOST_ON_PAD,
        said(beat(armed=False)),
        [
            Say(
                Level.INFO,
                (
                    "uav1: link regained, on the ground; switched to RTL, so that it cannot take off "
                    "with its old mission"
                ),
            ),
            SendHome("uav1"),
        ],
        {"uav1": REGAINED | {"stage": Stage.LANDED, "heartbeat": beat(armed=False), "ordered_mode_s": NOW_S}},
        {},
    ),
    Row(
        "who was lost in its pilot's hands is not switched",
        with_facts(LOST_ON_PAD, taken=Takeover(NOW_S - 90.0)),
        said(beat(armed=False)),
        [
            Say(
                Level.WARNING,
                (
                    "uav1: link regained, on the ground with its pilot, not commanded: armed now, it takes off with "
                    "its old mission"
                ),
            )
        ],
        {"uav1": REGAINED | {"stage": Stage.LANDED, "heartbeat": beat(armed=False), "ordered_mode_s": NOW_S}},
        {},
    ),
    Row(
        "who was lost and is on its pad in another mode",
        LOST_ON_PAD,
        said(beat(RTL, armed=False)),
        [Say(Level.INFO, "uav1: link regained, on the ground")],
        {
            "uav1": REGAINED
            | {
                "stage": Stage.LANDED,
                "heartbeat": beat(RTL, armed=False),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S - 50.0,
                "mode_before": 3,
                "ordered_mode_s": NOW_S,
            }
        },
        {},
    ),
    Row(
        "who was lost and lies somewhere",
        with_facts(GONE, heartbeat=DISARMED),
        said(beat(armed=False)),
        [Say(Level.FAULT, f"uav1: link regained, down at {OUT_THERE}, disarmed")],
        {
            "uav1": REGAINED
            | {"stage": Stage.DOWN, "heartbeat": beat(armed=False), "ordered_mode_s": NOW_S, "place_told": True}
        },
        {},
    ),
    Row(
        "who was lost and says something else",
        GONE,
        said(MissionCurrent(3, None, None)),
        [],
        {"uav1": HEARD | {"waypoint": 1, "item": (3, None), "regained_s": NOW_S}},
        {},
    ),
    Row(
        "a person's mode",
        flying(mode_since_s=NOW_S - 90.0, ordered_modes=frozenset({AUTO})),
        said(beat(0)),
        [HandsOff("uav1")],
        {
            "uav1": {
                "spoke_s": NOW_S,
                "heartbeat": beat(0),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S,
                "mode_before": 3,
                "ordered_modes": frozenset(),
                "cause": ModeCause.PERSON,
                "beat_boot_s": NOW_S,
            }
        },
        {},
    ),
    Row(
        "a person's mode still",
        flying(heartbeat=beat(0), cause=ModeCause.PERSON, mode_since_s=NOW_S - 0.5),
        said(beat(0)),
        [],
        {"uav1": {"spoke_s": NOW_S, "beat_boot_s": NOW_S}},
        {},
    ),
    Row(
        "an ordered mode",
        flying(mode_since_s=NOW_S - 90.0, ordered_modes=frozenset({HOLD}), ordered_mode_s=NOW_S - 9.0),
        said(beat(HOLD)),
        [],
        {
            "uav1": {
                "spoke_s": NOW_S,
                "heartbeat": beat(HOLD),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S,
                "mode_before": 3,
                "beat_boot_s": NOW_S,
            }
        },
        {},
    ),
    Row(
        "a text",
        flying(),
        said(StatusText(2, "something is wrong")),
        [Say(Level.WARNING, "uav1 says: something is wrong")],
        {
            "uav1": {
                "spoke_s": NOW_S,
                "texts": TextWindow(last=("uav1 says: something is wrong", NOW_S), since_s=NOW_S, shown=(1, 0, 0)),
            }
        },
        {},
    ),
    Row(
        "a stranger",
        flying(),
        said(StationHeard(254, 190)),
        [Say(Level.WARNING, "uav1: another ground station is on its link, system 254 component 190")],
        {"uav1": {"strangers": frozenset({StationHeard(system=254, component=190)})}},
        {},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()


SEPARATIONS = [
    ("the first two that are seen", flying(), position(), other(0.0, 30.0), None, 10.0),
    ("two that are nearer than before", flying(), position(), other(3.0, 24.0), 5.1, 5.0),
    ("two that were as near before", flying(), position(), other(3.0, 24.0), 5.0, None),
    (
        "above another within the fastest climb",
        flying(),
        position(),
        other(0.0, 39.9, velocity_m_s=(0.0, 0.0, -12.0), age_s=1.5),
        5.0,
        1.9,
    ),
    (
        "above another beyond the fastest climb",
        flying(),
        position(),
        other(0.0, 40.1, velocity_m_s=(0.0, 0.0, -12.0), age_s=1.5),
        5.0,
        None,
    ),
    (
        "position of the other vehicle by now",
        flying(),
        position(),
        other(10.0, 20.0, north_m=6.0, velocity_m_s=(-4.0, 2.0, 2.0), age_s=1.5),
        None,
        math.sqrt(106.0),
    ),
    ("another that was seen too long ago", flying(), position(), other(0.0, 30.0, age_s=1.6), None, None),
    ("another on the ground", flying(), position(), other(0.0, 1.9), None, None),
    ("another just in the air", flying(), position(), other(0.0, 2.0), None, 18.0),
    ("another that is not armed", flying(), position(), with_facts(other(0.0, 30.0), heartbeat=DISARMED), None, None),
    ("a vehicle that is itself on the ground", flying(), position(1.9), other(0.0, 30.0), None, None),
    ("a vehicle that has itself just taken off", flying(), position(2.0), other(0.0, 30.0), None, 28.0),
    ("a vehicle that is itself disarmed", flying(heartbeat=DISARMED), position(), other(0.0, 30.0), None, None),
]


@pytest.mark.parametrize(
    ("what", "one", "event", "other", "least_m", "expected_m"), SEPARATIONS, ids=[row[0] for row in SEPARATIONS]
)
def test_how_near_two_came(
    what: str, one: VehicleState, event: Heard, other: VehicleState, least_m: float | None, expected_m: float | None
) -> None:
    after, _ = fleet_step.step(FLEET.context, flight_of(one, other, separation_m=least_m), event, NOW_S)
    assert after.progress.separation_m == (least_m if expected_m is None else pytest.approx(expected_m))


def test_an_inspection_is_kept_as_the_first_vehicle_flew_it() -> None:
    for before in ({}, {0: "uav2"}):
        state = flight_of(flying(fix=None), inspected=before)
        for step in range(10):
            lat_deg, lon_deg = FLEET.context.frame.to_wgs84_deg(99.0 + 12.0 * step, -5.0)
            place = Position(NOW_S + 4.0 * step, lat_deg, lon_deg, 465.0, 15.0, 0.0, 3.0, 0.0, None)
            state, _ = fleet_step.step(FLEET.context, state, said(place), NOW_S + 4.0 * step)
        assert dict(state.coverage.inspected) == (before or {0: "uav1"})
        assert list(state.coverage.flown) == ([] if before else [0])
        assert before or state.coverage.flown[0].mean_m_s == pytest.approx(3.0)


def test_two_vehicles_behind_one_address_are_reported_once() -> None:
    """A router that merges two vehicles of one number into one port shows a single address."""
    state, lines = flight_of(flying()), list[str]()
    for number in range(60):
        now_s = NOW_S + number / 10
        boot_s, north_m = (now_s, 0.0) if number % 2 == 0 else (now_s + 500.0, 900.0)
        place = Position(boot_s, 49.6 + north_m / 111_320.0, 15.6, 470.0, 20.0, 0.0, 0.0, 0.0, None)
        state, commands = fleet_step.step(FLEET.context, state, Heard("uav1", place), now_s)
        lines += [one.text for one in commands if isinstance(one, Say) and "two vehicles" in one.text]
    system = FLEET.context.vehicles["uav1"].sysid
    assert lines == [
        f"uav1: two vehicles use system id {system}: their telemetry is mixed, and both would follow commands"
    ]
