"""The present as the page shows it: each figure from a state that is made by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.kalman import Projection
from executor.core.fleet_view import FleetView, PositionView, TakenView, VehicleView, build_fleet_view
from executor.core.inflight.homing import advise_homing
from executor.core.interface.commands import Level
from executor.core.interface.messages import Gps, Heartbeat, Wind
from executor.core.replanning.replan_cycle import replan_for_regained_link
from executor.core.replanning.survivors import build_survivor
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState, LossOutlook, OperatorLine, ReplanRecord
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_parts import HomingOrder, ModeCause, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from missions import Phase
from tests.executor.builders import vehicle, with_facts
from tests.executor.core.vehicles import (
    AUTO,
    CONTEXT,
    FLEET,
    NOW_S,
    RTL,
    SETUP,
    at,
    flying,
    mission,
    pack,
    volts,
)

FAULT = Fault(FaultKind.BATTERY, "why", NOW_S, FaultCode.BATTERY_LOW)
BOARD = mission()
LAST = len(BOARD.legs) - 1
INSPECT = next(index for index, point in enumerate(BOARD.path.waypoints) if point.phase is Phase.INSPECT)


def fleet(one: VehicleState, **changes: object) -> FleetView:
    others = {name: vehicle(FLEET, name) for name in ("uav2", "uav3")}
    state = with_facts(FleetState(MappingProxyType({"uav1": one, **others})), launched_s=NOW_S - 100.004)
    return build_fleet_view(CONTEXT, with_facts(state, **changes), NOW_S)


def shown(**changes: object) -> VehicleView:
    return fleet(flying(**changes)).vehicles[0]


def test_a_vehicle_that_has_said_nothing() -> None:
    view = fleet(vehicle(FLEET)).vehicles[0]
    assert (view.name, view.sysid, view.state, view.layer, view.layer_m) == ("uav1", 1, "ground", 0, 0.0)
    assert (view.mode, view.position, view.link_age_s, view.link_loss, view.gps_fix) == (None, None, None, None, None)
    assert (view.satellites, view.wind, view.taken, view.loss, view.fault, view.lands_in_s) == (None,) * 6
    assert view.battery.landing_pct is view.battery.predicted_pct is view.battery.predicted_band_pct is None
    assert (view.battery.measured_pct, view.battery.to_finish_pct, view.battery.reserve_pct) == (None, 0.0, 15.0)
    assert (view.progress.done, view.progress.total) == (0, 2)
    other = fleet(vehicle(FLEET)).vehicles[2]
    assert (other.layer, other.layer_m) == (2, 2.0 * CONTEXT.setup.layers.spacing_m)


def test_what_it_says_is_shown() -> None:
    view = shown(
        heard_s=NOW_S - 1.26, gps=Gps(3, 12), wind=Wind(4.0, 90.0), volts=volts(15.5),
        quality=LinkQuality(lost=0.12345), stale=True, excluded=True, fault=FAULT,
    )  # fmt: skip
    assert (view.link_age_s, view.link_loss, view.gps_fix, view.satellites) == (1.3, 0.123, 3, 12)
    assert (view.wind, view.voltage_v, view.mode, view.armed) == (Wind(4.0, 90.0), 15.5, "MISSION", True)
    assert (view.stale, view.excluded, view.fault, view.fault_kind) == (True, True, "why", "battery")
    assert shown(heard_s=NOW_S + 1.0).link_age_s == 0.0


@pytest.mark.parametrize(
    ("velocity", "compass", "speed", "heading"),
    [
        ((3.0, 4.0, 9.0), None, 5.0, 37.0),
        ((-3.0, 0.0, 0.0), None, 3.0, 270.0),
        ((0.5, 0.0, 0.0), None, 0.5, None),
        ((0.51, 0.0, 0.0), None, 0.5, 90.0),
        ((3.0, 4.0, 0.0), 123.4, 5.0, 123.0),
    ],
)
def test_where_it_is_and_where_it_heads(
    velocity: tuple[float, float, float], compass: float | None, speed: float, heading: float | None
) -> None:
    fix = replace(at(up_m=20.04, age_s=1.26), velocity_m_s=velocity, heading_deg=compass)
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(*fix.place_m)
    assert shown(fix=fix).position == PositionView(
        round(lat_deg, 5), round(lon_deg, 5), 20.0, speed, 1.3, None, heading
    )


def test_the_battery_against_the_plan() -> None:
    state = flying(waypoint=INSPECT, fix=replace(at(), place_m=BOARD.places_m[INSPECT]), began_pct=95.0)
    view, spent_pct = fleet(state).vehicles[0].battery, sum(leg.energy_pct for leg in BOARD.legs[: INSPECT + 1])
    assert view.measured_pct == 90.0
    assert view.predicted_pct == round(95.0 - spent_pct, 1)
    # As unsure as the prior is of what was spent, and as a whole percent is: nine of ten come within.
    sd_pct = math.hypot(SETUP.prior.sd * spent_pct, math.sqrt(1.0 / 12.0))
    assert view.predicted_band_pct == round(1.5 * sd_pct, 1)
    assert view.to_finish_pct == round(legs.energy_to_finish_pct(state), 1)
    ahead = legs.project_landing(CONTEXT, state, SETUP)
    assert isinstance(ahead, Projection)
    assert (view.landing_pct, view.landing_band_pct) == (round(ahead.mean_pct, 1), round(1.5 * ahead.sd_pct, 1))
    first = fleet(with_facts(state, began_pct=None)).vehicles[0].battery
    assert first.predicted_pct == round(90.0 - spent_pct, 1), "its first report stands in"
    assert shown(battery=BatteryState(), began_pct=None).battery.predicted_pct is None


def test_what_is_still_to_be_spent_is_for_the_mission_or_for_the_return() -> None:
    home_pct = legs.energy_to_return_pct(CONTEXT, flying(), SETUP)
    assert home_pct is not None
    assert shown(stage=Stage.RETURNING).battery.to_finish_pct == round(home_pct, 1) > 0.0
    assert shown(stage=Stage.STARTING).battery.to_finish_pct == round(legs.energy_to_finish_pct(flying()), 1) > 0.0
    unarmed = Heartbeat(3, AUTO, False, 4)
    assert shown(stage=Stage.STARTING, heartbeat=unarmed).battery.to_finish_pct == 0.0
    assert shown(stage=Stage.PILOT).battery.to_finish_pct == 0.0
    assert shown(stage=Stage.RETURNING, fix=None).battery.to_finish_pct == 0.0


@pytest.mark.parametrize("share", [-0.1, 0.0, 0.25, 1.0, 1.1])
def test_how_far_it_is_along_its_segment(share: float) -> None:
    track = BOARD.tracks[0]
    east_m = track.begin_m[0] + share * (track.end_m[0] - track.begin_m[0])
    view = shown(waypoint=INSPECT, fix=replace(at(), place_m=(east_m, track.begin_m[1]))).progress
    assert (view.done, view.total, view.segment, view.phase) == (0, 2, 0, "inspect")
    assert view.segment_name == CONTEXT.segment_name(0)
    assert view.segment_share == pytest.approx(min(1.0, max(0.0, share)), abs=1e-3)


def test_the_progress_of_vehicles_without_an_inspection() -> None:
    assert shown(waypoint=INSPECT, fix=None).progress.segment_share == 0.0
    transit = shown(waypoint=INSPECT - 1).progress
    assert (transit.phase, transit.segment_share) == ("transit", 0.0 if transit.segment is not None else None)
    landing = shown(waypoint=LAST).progress
    assert (landing.done, landing.phase, landing.segment) == (2, "land", None)
    home = shown(waypoint=LAST, stage=Stage.RETURNING).progress
    assert (home.done, home.total, home.phase) == (2, 2, "return")
    assert shown(stage=Stage.RETURNING, lands=True).progress.phase == "land"
    assert shown(waypoint=LAST, stage=Stage.LANDED).progress.done == 2
    assert shown(waypoint=LAST, stage=Stage.GROUND).progress.done == 0
    assert (shown(board=None).progress.done, shown(board=None).progress.total) == (0, 0)
    counted = fleet(flying(), inspected=MappingProxyType({0: "uav1", 3: "uav2", 1: "uav1"}))
    assert [one.progress.inspected for one in counted.vehicles] == [2, 1, 0]
    assert counted.inspected == (0, 1, 3)


def test_when_it_should_be_back() -> None:
    assert shown().lands_in_s == round(legs.time_to_reach_s(flying(), LAST), 0)
    assert shown(held_s=NOW_S).lands_in_s is shown(stage=Stage.RETURNING).lands_in_s is shown(board=None).lands_in_s
    assert shown(held_s=NOW_S).lands_in_s is None


@pytest.mark.parametrize(
    ("taken", "view"),
    [
        (Takeover(NOW_S - 10.0), TakenView(NOW_S - 10.0, 20.0, returned=False)),
        (Takeover(NOW_S - 40.0), TakenView(NOW_S - 40.0, 0.0, returned=False)),
        (Takeover(NOW_S - 10.0, given_away=True), TakenView(NOW_S - 10.0, 0.0, returned=False)),
        (Takeover(NOW_S - 10.0, returned_s=NOW_S), TakenView(NOW_S - 10.0, 20.0, returned=True)),
    ],
)
def test_the_party_in_control_and_how_long_segments_are_kept(taken: Takeover, view: TakenView) -> None:
    assert shown(stage=Stage.PILOT, taken=taken).taken == view


def test_what_it_does_in_one_word() -> None:
    hold = Heartbeat(3, 17, True, 4)
    assert shown(held_s=NOW_S, heartbeat=hold).state == "holding"
    assert shown(held_s=NOW_S).state == shown(heartbeat=hold).state == "flying"
    assert shown(stage=Stage.RETURNING, lands=True).state == "landing"
    assert shown(lands=True).state == "flying"
    assert shown(stage=Stage.RETURNING, held_s=NOW_S, heartbeat=hold).state == "returning"


def test_what_its_loss_would_mean_is_shown_while_it_is_on_its_mission() -> None:
    outlook = MappingProxyType({"uav1": LossOutlook(NOW_S - 3.04, (4, 5))})
    loss = fleet(flying(), outlook=outlook).vehicles[0].loss
    assert loss is not None
    assert (loss.inside_window, loss.uncovered, loss.age_s) == (False, (4, 5), 3.0)
    full = fleet(flying(), outlook=MappingProxyType({"uav1": LossOutlook(NOW_S, ())})).vehicles[0].loss
    assert full is not None
    assert full.inside_window
    for state in (flying(fault=FAULT), flying(stage=Stage.RETURNING), flying(stage=Stage.LANDED)):
        assert fleet(state, outlook=outlook).vehicles[0].loss is None


def test_the_flight_as_a_whole() -> None:
    lines = tuple(OperatorLine(NOW_S, Level.INFO, f"line {number}") for number in range(70))
    view = fleet(flying(), given_up=frozenset({5, 2}), inspected=MappingProxyType({2: "uav1"}), said=lines)
    assert (view.now_s, view.flight_s, view.uncovered, view.segments_total) == (NOW_S, 100.0, (5,), 6)
    assert [one.text for one in view.said] == [f"line {number}" for number in range(10, 70)]
    assert (view.said[0].at_s, view.said[0].level) == (NOW_S, "info")
    assert (view.all_silent, fleet(flying(), silent_since_s=NOW_S).all_silent) == (False, True)
    assert fleet(flying(), launched_s=None).flight_s is None
    assert (view.replan, view.offer, view.min_separation_m) == (None, None, None)


HOLDS_BY_ITSELF = {"cause": ModeCause.FAILSAFE, "heartbeat": Heartbeat(3, 17, True, 5), "mode_since_s": NOW_S - 14.9}
NEAR_PAD = replace(at(east_m=6.0), velocity_m_s=(0.0, 0.0, 0.0))
ADVICE: list[tuple[VehicleState, str]] = [
    (flying(), "return"),
    (flying(cause=ModeCause.PERSON), "leave"),
    (flying(taken=Takeover(NOW_S)), "leave"),
    (flying(errand=HomingOrder(NOW_S, land=True)), "land"),
    (flying(heartbeat=Heartbeat(3, RTL, True, 4)), "leave"),
    (flying(heartbeat=Heartbeat(3, RTL, True, 4), errand=HomingOrder(NOW_S, force=True)), "return"),
    (flying(**HOLDS_BY_ITSELF), "wait"),
    (flying(**HOLDS_BY_ITSELF | {"mode_since_s": NOW_S - 15.0}), "return"),
    (flying(**HOLDS_BY_ITSELF | {"errand": HomingOrder(NOW_S, force=True)}), "return"),
    (flying(cause=ModeCause.FAILSAFE), "leave"),
    (flying(fix=at(age_s=3.0), errand=HomingOrder(NOW_S)), "return"),
    (flying(fix=at(age_s=3.1), errand=HomingOrder(NOW_S - 1.4)), "wait"),
    (flying(fix=at(age_s=3.1), errand=HomingOrder(NOW_S - 1.5)), "return"),
    (flying(fix=None, errand=HomingOrder(NOW_S)), "wait"),
    (flying(fix=NEAR_PAD), "land"),
    (flying(fix=replace(at(east_m=6.1), velocity_m_s=(0.0, 0.0, 0.0))), "return"),
    (flying(fix=NEAR_PAD, waypoint=LAST), "leave"),
    (flying(fix=replace(NEAR_PAD, velocity_m_s=(0.0, 0.0, -0.31))), "leave"),
    (flying(fix=replace(NEAR_PAD, velocity_m_s=(0.0, 0.0, -0.3))), "land"),
    (flying(waypoint=LAST), "leave"),
]


@pytest.mark.parametrize(("state", "answer"), ADVICE, ids=[f"{n}-{row[1]}" for n, row in enumerate(ADVICE)])
def test_the_command_for_a_vehicle_that_should_return(state: VehicleState, answer: str) -> None:
    assert advise_homing(CONTEXT, state, NOW_S)[0] == answer


OUT: list[tuple[dict[str, object], bool]] = [
    ({}, True),
    ({"heard_s": NOW_S - 2.9}, True),
    ({"heard_s": NOW_S - 3.0}, False),
    ({"heard_s": None}, False),
    ({"stale": True}, False),
    ({"fault": FAULT}, False),
    ({"stubborn": True}, False),
    ({"excluded": True}, False),
    ({"held_s": NOW_S}, False),
    ({"battery": BatteryState()}, False),
    ({"board": None}, False),
    ({"fix": None}, False),
    ({"stage": Stage.STARTING}, True),
    ({"stage": Stage.RETURNING}, False),
    ({"stage": Stage.PILOT}, False),
    ({"stage": Stage.LANDED}, True),
    ({"stage": Stage.DOWN}, False),
    ({"waypoint": LAST}, False),
]


@pytest.mark.parametrize(("changes", "can"), OUT, ids=[str(number) for number in range(len(OUT))])
def test_vehicles_that_can_take_segments(changes: dict[str, object], *, can: bool) -> None:
    assert (build_survivor(CONTEXT, FleetState(MappingProxyType({})), flying(**changes), NOW_S) is not None) is can


def test_what_it_can_still_spend_leaves_the_reserve() -> None:
    """From 60 % with 15 % in reserve, less a percent for the rounding; landings are in the model's ways home."""
    ground = build_survivor(
        CONTEXT, FleetState(MappingProxyType({})), flying(stage=Stage.LANDED, battery=pack(60.0)), NOW_S
    )
    assert ground is not None
    assert ground.budget_pct == pytest.approx(60.0 - 15.0 - 1.0)
    assert (ground.airborne, ground.tail, ground.kept, ground.start_m) == (False, (), 0, (0.0, 0.0))
    air = build_survivor(CONTEXT, FleetState(MappingProxyType({})), flying(battery=pack(60.0)), NOW_S)
    assert air is not None
    on_its_way_pct = (
        legs.energy_to_reach_pct(flying(), air.kept - 1) if air.kept > flying().assignment.waypoint else 0.0
    )
    assert air.budget_pct == pytest.approx(60.0 - 15.0 - on_its_way_pct - 1.0)
    assert air.airborne
    empty = build_survivor(CONTEXT, FleetState(MappingProxyType({})), flying(battery=pack(10.0)), NOW_S)
    assert empty is not None
    assert empty.budget_pct == 0.0
    # A full battery is not the budget: the site allows a route 75 %.
    full = build_survivor(
        CONTEXT, FleetState(MappingProxyType({})), flying(stage=Stage.LANDED, battery=pack(100.0)), NOW_S
    )
    assert full is not None
    assert full.budget_pct == pytest.approx(min(85.0 - 1.0, SETUP.budget_pct))


def left_over(*uncovered: int, **changes: object) -> FleetState:
    record = ReplanRecord(1, "why", False, uncovered, 1.0, NOW_S - 9.0, NOW_S - 5.0, 1.0)
    state = with_facts(FleetState(MappingProxyType({})), given_up=frozenset({2, 3, 5}), records=(record,))
    return with_facts(state, **changes)


def test_a_regained_vehicle_may_reach_segments_left_over_by_the_last_re_plan() -> None:
    after = replan_for_regained_link(left_over(2, 3), flying(), NOW_S)
    assert (after.coverage.given_up, after.replanning.urgent, after.replanning.trigger_s) == (
        frozenset({5}),
        True,
        NOW_S,
    )
    assert after.replanning.trigger == "uav1: link regained"


@pytest.mark.parametrize(
    ("state", "one"),
    [
        (left_over(), flying()),
        (left_over(7), flying()),
        (left_over(2, records=()), flying()),
        (left_over(2, recalled=True), flying()),
        (left_over(2, considered=frozenset({"uav1"})), flying()),
        (left_over(2), flying(fault=FAULT)),
        (left_over(2), flying(stage=Stage.RETURNING)),
    ],
)
def test_no_re_plan_for_a_vehicle_that_changes_nothing(state: FleetState, one: VehicleState) -> None:
    assert replan_for_regained_link(state, one, NOW_S) == state
