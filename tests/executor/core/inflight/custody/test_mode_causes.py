"""Why a vehicle is in its mode: each cause, and how late it still explains it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import Context
from executor.core.inflight.custody.mode_causes import (
    determine_mode_cause,
    is_gcs_absence_failsafe,
    is_taken_over,
    review_mode_cause,
    update_mode_cause,
)
from executor.core.interface.messages import Actor, Heartbeat, MissionCurrent, ModeChange
from executor.core.resume.link_blackout import recover_after_silence
from executor.core.state import mission_ownership
from executor.core.state.fleet_state import FleetState, GroundStationAbsence
from executor.core.state.mission_ownership import MissionOwnership, compute_expected_total
from executor.core.state.vehicle_parts import LastKnown, ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import fleet_of, vehicle, with_facts
from tests.executor.core.vehicles import AUTO, CONTEXT, NOW_S, RTL, at, flying, pack, says

LOITER, BRAKE, LAND, SMART_RTL = 5, 17, 9, 21
HELD = Heartbeat(3, BRAKE, True, 4)


def went(mode: int, **changes: object) -> VehicleState:
    """Return a vehicle whose mode has just changed."""
    return flying(**({"heartbeat": Heartbeat(3, mode, True, 4), "mode_since_s": NOW_S} | changes))


ORDERED: dict[str, object] = {"ordered_modes": frozenset({RTL}), "ordered_mode_s": NOW_S - 120.0}
CAUSES: list[tuple[VehicleState, ModeCause]] = [
    (went(RTL), ModeCause.PERSON),
    (went(LOITER), ModeCause.PERSON),
    (went(AUTO), ModeCause.OURS),
    (went(AUTO, stage=Stage.LOST), ModeCause.OURS),
    (went(AUTO, stage=Stage.RETURNING), ModeCause.PERSON),
    (went(RTL, **ORDERED), ModeCause.OURS),
    (went(RTL, **ORDERED | {"ordered_mode_s": NOW_S - 120.1}), ModeCause.PERSON),
    (went(BRAKE, **ORDERED), ModeCause.PERSON),
    (went(RTL, heartbeat=Heartbeat(3, RTL, True, 5)), ModeCause.FAILSAFE),
    (went(BRAKE, heartbeat=Heartbeat(3, BRAKE, True, 5)), ModeCause.FAILSAFE),
    (went(LOITER, heartbeat=Heartbeat(3, LOITER, True, 5)), ModeCause.PERSON),
    (went(RTL, **says("Battery Failsafe", NOW_S - 15.0)), ModeCause.FAILSAFE),
    (went(RTL, **says("Battery Failsafe", NOW_S - 15.1)), ModeCause.PERSON),
    (went(RTL, **says("Battery Failsafe", NOW_S + 4.0)), ModeCause.FAILSAFE),
    (went(RTL, **says("Battery Failsafe", NOW_S + 4.1)), ModeCause.PERSON),
    (went(RTL, **says("Low battery", NOW_S)), ModeCause.FAILSAFE),  # all that ArduPilot up to 3.5 says
    (went(RTL, **says("GCS Failsafe Cleared", NOW_S)), ModeCause.PERSON),
    (went(RTL, fence_breached=True), ModeCause.FAILSAFE),
    (went(RTL, breached_s=NOW_S - 4.0), ModeCause.FAILSAFE),  # its return has ended the breach already
    (went(RTL, breached_s=NOW_S - 4.1), ModeCause.PERSON),
    (went(RTL, battery=pack(9.0, charge_state=4)), ModeCause.FAILSAFE),
    (went(RTL, battery=pack(9.0, charge_state=3)), ModeCause.PERSON),
    (went(RTL, unseen_until_s=NOW_S), ModeCause.FAILSAFE),
    (went(RTL, unseen_until_s=NOW_S - 1.0), ModeCause.PERSON),
    (went(AUTO, stage=Stage.LANDED, fix=at(up_m=0.0)), ModeCause.PERSON),
    (went(AUTO, stage=Stage.GROUND), ModeCause.PERSON),
]


@pytest.mark.parametrize(("state", "cause"), CAUSES, ids=[f"{n}-{row[1].value}" for n, row in enumerate(CAUSES)])
def test_the_cause_of_a_mode(state: VehicleState, cause: ModeCause) -> None:
    assert determine_mode_cause(CONTEXT, (), flying(), state, NOW_S) is cause


@pytest.mark.parametrize(
    ("mode", "status", "held_s", "changes", "cause"),
    [
        (BRAKE, 4, 3.0, {}, ModeCause.PERSON),
        (BRAKE, 4, 2.0, {}, ModeCause.FAILSAFE),
        (BRAKE, 5, 30.0, {}, ModeCause.FAILSAFE),
        (BRAKE, 4, 30.0, {"fence_breached": True}, ModeCause.FAILSAFE),
        (RTL, 4, 30.0, {}, ModeCause.FAILSAFE),
    ],
)
def test_a_hold_without_a_failsafe_in_its_heartbeats_is_a_persons(
    mode: int, status: int, held_s: float, changes: dict[str, object], cause: ModeCause
) -> None:
    """A text that anybody can send, or a gap of the link, explains a hold for two heartbeats, not for longer."""
    since_s = NOW_S - held_s
    told = {
        "cause": ModeCause.FAILSAFE,
        "alarm": ("GCS Failsafe", since_s),
        "mode_since_s": since_s,
        "heartbeat_s": NOW_S,
    }
    held = flying(heartbeat=Heartbeat(3, mode, True, status), **(told | changes))
    assert review_mode_cause(CONTEXT, (), held, NOW_S).custody.cause is cause


PX4_MISSION, PX4_HOLD, PX4_RTL = 67371008, 50593792, 84148224
LOW = pack(3.0, charge_state=3)
OUT_OF_BOUNDS = says("Geofence: exceeding maximum distance to Home", NOW_S - 15.0)


def held_first(**changes: object) -> VehicleState:
    """Return a PX4 that its battery's failsafe has held for 15 s, which is longer than it holds before it acts."""
    told: dict[str, object] = {"cause": ModeCause.FAILSAFE, "mode_since_s": NOW_S - 15.0, "heartbeat_s": NOW_S}
    given = {"heartbeat": Heartbeat(12, PX4_HOLD, True, 5), "battery": LOW, "critical_since_s": NOW_S - 15.0}
    return flying(**(told | given | changes))


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({}, ModeCause.PERSON),
        ({"heartbeat_s": NOW_S - 0.1}, ModeCause.FAILSAFE),
        ({"mode_since_s": NOW_S - 14.9}, ModeCause.FAILSAFE),
        ({"regained_s": NOW_S - 14.9}, ModeCause.FAILSAFE),
        ({"excused_s": NOW_S - 14.9}, ModeCause.FAILSAFE),
        ({"heartbeat": Heartbeat(12, PX4_RTL, True, 5)}, ModeCause.FAILSAFE),
        ({"fence_breached": True}, ModeCause.PERSON),
        ({"battery": pack(90.0)}, ModeCause.PERSON),
        ({"battery": pack(9.0, charge_state=2), "fence_breached": True}, ModeCause.FAILSAFE),
        ({"battery": pack(90.0)} | OUT_OF_BOUNDS, ModeCause.FAILSAFE),
    ],
)
def test_a_failsafe_that_holds_first_and_does_not_act_was_ended_by_a_person(
    changes: dict[str, object], cause: ModeCause
) -> None:
    """Who tells a PX4 to hold while its failsafe does changes no mode; a fence may be answered by a hold alone."""
    held = review_mode_cause(fleet_of(autopilot="px4").context, (), held_first(**changes), NOW_S).custody
    assert (held.cause, held.certain) == (cause, cause is ModeCause.PERSON)


@pytest.mark.parametrize(
    ("holds_s", "held_s", "cause"),
    [
        (5.0, 15.0, ModeCause.PERSON),
        (2.0, 14.9, ModeCause.FAILSAFE),
        (25.0, 15.0, ModeCause.FAILSAFE),
        (25.0, 34.9, ModeCause.FAILSAFE),
        (25.0, 35.0, ModeCause.PERSON),
    ],
)
def test_a_failsafe_that_says_that_it_holds_for_longer_is_waited_for(
    holds_s: float, held_s: float, cause: ModeCause
) -> None:
    context = fleet_of(autopilot="px4").context
    setup = replace(context.vehicles["uav1"], holds_s=holds_s)
    context = replace(context, vehicles={**context.vehicles, "uav1": setup})
    held = held_first(mode_since_s=NOW_S - held_s, critical_since_s=NOW_S - held_s)
    assert review_mode_cause(context, (), held, NOW_S).custody.cause is cause


@pytest.mark.parametrize(("returns", "cause"), [(True, ModeCause.PERSON), (False, ModeCause.FAILSAFE)])
@pytest.mark.parametrize(
    "changes", [{"unseen_until_s": NOW_S - 15.0}, says("GCS connection lost", NOW_S - 15.0)], ids=["unseen", "said"]
)
def test_a_lost_ground_station_is_answered_by_a_hold_alone_where_no_return_is_set(
    changes: dict[str, object], *, returns: bool, cause: ModeCause
) -> None:
    context = fleet_of(autopilot="px4").context
    setup = replace(context.vehicles["uav1"], returns=returns)
    context = replace(context, vehicles={**context.vehicles, "uav1": setup})
    held = held_first(battery=pack(90.0), **changes)
    assert review_mode_cause(context, (), held, NOW_S).custody.cause is cause


def test_a_hold_of_an_arducopter_is_what_its_failsafe_wanted() -> None:
    """BATT_FS_CRT_ACT 7 is a BRAKE that stays."""
    held = held_first(heartbeat=Heartbeat(3, BRAKE, True, 5))
    assert review_mode_cause(CONTEXT, (), held, NOW_S).custody.cause is ModeCause.FAILSAFE


TOOK_OVER = ModeChange(None, Actor.PILOT)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"recorded": (TOOK_OVER, NOW_S)}, ModeCause.PERSON),
        ({"recorded": (TOOK_OVER, NOW_S - 4.0)}, ModeCause.PERSON),
        ({"recorded": (TOOK_OVER, NOW_S - 8.0)}, ModeCause.FAILSAFE),
        ({"recorded": (ModeChange(None, Actor.MISSION), NOW_S)}, ModeCause.FAILSAFE),
        ({"recorded": (TOOK_OVER, NOW_S), "ordered_mode_s": NOW_S - 4.0}, ModeCause.FAILSAFE),
        ({"recorded": (TOOK_OVER, NOW_S), "heartbeat": Heartbeat(12, PX4_RTL, True, 5)}, ModeCause.FAILSAFE),
        ({}, ModeCause.FAILSAFE),
    ],
)
def test_a_takeover_during_a_failsafe_hold_is_recognised_by_an_event(
    changes: dict[str, object], cause: ModeCause
) -> None:
    held = held_first(**({"mode_since_s": NOW_S - 4.0} | changes))
    assert review_mode_cause(fleet_of(autopilot="px4").context, (), held, NOW_S).custody.cause is cause


@pytest.mark.parametrize(("since_s", "cause"), [(NOW_S - 15.1, ModeCause.PERSON), (NOW_S - 15.0, ModeCause.FAILSAFE)])
@pytest.mark.parametrize("mode", [BRAKE, RTL])
def test_a_failsafe_that_was_in_force_long_before_explains_no_mode(mode: int, since_s: float, cause: ModeCause) -> None:
    """ArduPilot's heartbeats stay critical after a failsafe that only warned; its pilot may take it any time later."""
    warned = flying(heartbeat=Heartbeat(3, AUTO, True, 5), critical_since_s=since_s)
    taken = went(mode, heartbeat=Heartbeat(3, mode, True, 5), critical_since_s=since_s)
    assert determine_mode_cause(CONTEXT, (), warned, taken, NOW_S) is cause


def test_a_failsafe_that_holds_for_long_returns_for_the_same_cause() -> None:
    began: dict[str, object] = {"critical_since_s": NOW_S - 25.0}
    held = flying(heartbeat=Heartbeat(3, BRAKE, True, 5), cause=ModeCause.FAILSAFE, mode_since_s=NOW_S - 25.0, **began)
    home = went(RTL, heartbeat=Heartbeat(3, RTL, True, 5), **began)
    assert determine_mode_cause(CONTEXT, (), held, home, NOW_S) is ModeCause.FAILSAFE


def test_an_order_that_was_followed_and_left_again_explains_no_later_mode() -> None:
    told = flying(stage=Stage.RETURNING, ordered_modes=frozenset({AUTO}), ordered_mode_s=NOW_S - 60.0)
    landing = went(LAND, stage=Stage.RETURNING, ordered_modes=frozenset({AUTO}), ordered_mode_s=NOW_S - 60.0)
    away = update_mode_cause(CONTEXT, (), told, landing, NOW_S)
    again = with_facts(away, heartbeat=Heartbeat(3, AUTO, True, 4), mode_since_s=NOW_S + 4.0)
    assert update_mode_cause(CONTEXT, (), away, again, NOW_S + 4.0).custody.cause is ModeCause.PERSON
    followed_late = with_facts(landing, heartbeat=Heartbeat(3, AUTO, True, 4))
    assert update_mode_cause(CONTEXT, (), flying(heartbeat=HELD), followed_late, NOW_S).custody.cause is ModeCause.OURS


@pytest.mark.parametrize(("ordered_ago_s", "cause"), [(60.0, ModeCause.PERSON), (2.0, ModeCause.OURS)])
def test_a_landing_that_is_left_for_a_return_is_a_persons_unless_that_was_ordered_since(
    ordered_ago_s: float, cause: ModeCause
) -> None:
    orders: dict[str, object] = {
        "stage": Stage.RETURNING, "ordered_modes": frozenset({RTL, LAND}), "ordered_mode_s": NOW_S - ordered_ago_s,
        "cause": ModeCause.OURS,
    }  # fmt: skip
    lands = flying(heartbeat=Heartbeat(3, LAND, True, 4), mode_since_s=NOW_S - 20.0, **orders)
    assert update_mode_cause(CONTEXT, (), lands, went(RTL, **orders), NOW_S).custody.cause is cause


PX4_LAND = 100925440


def on_px4(mode: int, **changes: object) -> VehicleState:
    """Return the same for a PX4."""
    return went(mode, **{"heartbeat": Heartbeat(12, mode, True, 4)} | changes)


def test_a_return_of_a_px4_ends_in_a_landing_for_the_same_cause() -> None:
    px4 = fleet_of(autopilot="px4").context
    home = flying(heartbeat=Heartbeat(12, PX4_RTL, True, 4), cause=ModeCause.MISSION)
    assert determine_mode_cause(px4, (), home, on_px4(PX4_LAND, fix=at(east_m=3.0)), NOW_S) is ModeCause.MISSION
    assert determine_mode_cause(px4, (), home, on_px4(PX4_HOLD, fix=at(east_m=3.0)), NOW_S) is ModeCause.PERSON
    assert determine_mode_cause(px4, (), flying(cause=ModeCause.MISSION), on_px4(PX4_LAND), NOW_S) is ModeCause.PERSON


@pytest.mark.parametrize("cause", [ModeCause.OURS, ModeCause.FAILSAFE, ModeCause.MISSION])
def test_a_return_of_an_arducopter_ends_in_its_own_mode(cause: ModeCause) -> None:
    """Whoever chooses LAND over the pad is a person; a failsafe that does says why."""
    for mode in (RTL, SMART_RTL):
        home = flying(heartbeat=Heartbeat(3, mode, True, 4), cause=cause)
        landing = went(LAND, fix=at(east_m=3.0))
        assert determine_mode_cause(CONTEXT, (), home, landing, NOW_S) is ModeCause.PERSON
        said_why = with_facts(landing, **says("Battery Failsafe", NOW_S))
        assert determine_mode_cause(CONTEXT, (), home, said_why, NOW_S) is ModeCause.FAILSAFE


@pytest.mark.parametrize(("age_s", "cause"), [(3.0, ModeCause.MISSION), (3.1, ModeCause.PERSON)])
def test_over_the_pad_needs_a_recent_position(age_s: float, cause: ModeCause) -> None:
    """Its last position before it went silent is that of its pad, and it has flown for half a minute since."""
    px4 = fleet_of(autopilot="px4").context
    home = flying(heartbeat=Heartbeat(12, PX4_RTL, True, 4), cause=ModeCause.MISSION)
    landing = on_px4(PX4_LAND, fix=at(east_m=3.0, age_s=age_s))
    assert determine_mode_cause(px4, (), home, landing, NOW_S) is cause
    said_why = with_facts(landing, **says("EKF Failsafe", NOW_S))
    assert determine_mode_cause(px4, (), home, said_why, NOW_S) is (ModeCause.FAILSAFE if age_s > 3.0 else cause)


def landing_px4(**changes: object) -> VehicleState:
    """Return a PX4 at the end of its mission, just above its pad."""
    px4 = fleet_of(autopilot="px4")
    given = {
        "stage": Stage.FLYING,
        "heartbeat": Heartbeat(12, PX4_MISSION, True, 4),
        "waypoint": 5,
        "fix": at(up_m=1.0),
    }
    return vehicle(px4, "uav1", **given | changes)


@pytest.mark.parametrize(
    ("mode", "status", "before", "cause"),
    [
        (PX4_LAND, 4, ModeCause.OURS, ModeCause.MISSION),
        (PX4_HOLD, 4, ModeCause.OURS, ModeCause.MISSION),
        (PX4_HOLD, 5, ModeCause.OURS, ModeCause.FAILSAFE),
        (PX4_LAND, 4, ModeCause.PERSON, ModeCause.PERSON),
        (PX4_RTL, 4, ModeCause.PERSON, ModeCause.PERSON),
    ],
)
def test_the_end_of_a_mission_is_no_failsafes_hold_and_no_pilots(
    mode: int, status: int, before: ModeCause, cause: ModeCause
) -> None:
    """A failsafe that holds it in its landing goes on by itself; who took it there goes on having it."""
    assert caused_at_the_end(mode, status, before) is cause


@pytest.mark.parametrize("mode", [PX4_LAND, PX4_RTL])
def test_a_mode_change_after_the_hold_at_the_missions_end_is_a_persons(mode: int) -> None:
    assert caused_at_the_end(mode, 4, ModeCause.MISSION, Heartbeat(12, PX4_HOLD, True, 4)) is ModeCause.PERSON


ON_ITS_MISSION = Heartbeat(12, PX4_MISSION, True, 4)


def caused_at_the_end(mode: int, status: int, before: ModeCause, old: Heartbeat = ON_ITS_MISSION) -> ModeCause:
    px4 = fleet_of(autopilot="px4").context
    told = {"heartbeat": Heartbeat(12, mode, True, status), "mode_since_s": NOW_S}
    found = landing_px4(**told, critical_since_s=NOW_S if status == 5 else None)
    earlier = landing_px4(heartbeat=old, cause=before, mode_since_s=NOW_S - 1.0)
    return determine_mode_cause(px4, (), earlier, found, NOW_S)


def returning_in_silence(autopilot: str) -> Context:
    """Return a flight in which uav1's GCS failsafe is known to be an RTL."""
    context = with_failsafe(autopilot)
    return replace(context, vehicles={**context.vehicles, "uav1": replace(context.vehicles["uav1"], returns=True)})


@pytest.mark.parametrize(
    ("autopilot", "mode", "east_m", "cause"),
    [
        ("ardupilot", RTL, 90.0, ModeCause.FAILSAFE),
        ("ardupilot", SMART_RTL, 90.0, ModeCause.FAILSAFE),
        ("ardupilot", LAND, 90.0, ModeCause.PERSON),
        ("ardupilot", LAND, 3.0, ModeCause.PERSON),
        ("ardupilot", BRAKE, 90.0, ModeCause.PERSON),
        ("px4", PX4_RTL, 90.0, ModeCause.FAILSAFE),
        ("px4", PX4_HOLD, 90.0, ModeCause.FAILSAFE),
        ("px4", PX4_LAND, 90.0, ModeCause.PERSON),
        ("px4", PX4_LAND, 3.0, ModeCause.FAILSAFE),
    ],
)
def test_a_silence_explains_what_its_failsafe_leads_to(
    autopilot: str, mode: int, east_m: float, cause: ModeCause
) -> None:
    """A landing or a hold that was found after it is somebody's, unless a failsafe's HEARTBEAT or text says more."""
    context, away = (
        returning_in_silence(autopilot),
        (GroundStationAbsence(NOW_S - 1.0, 10.0, restarted=False, deaf=True),),
    )
    autopilot_id = 12 if autopilot == "px4" else 3
    found = went(mode, heartbeat=Heartbeat(autopilot_id, mode, True, 4), unseen_until_s=NOW_S, fix=at(east_m=east_m))
    before = flying(
        heartbeat=Heartbeat(autopilot_id, context.vehicles["uav1"].dialect.modes.mission.custom_mode, True, 4)
    )
    assert determine_mode_cause(context, away, before, found, NOW_S) is cause
    assert is_gcs_absence_failsafe(context, away, found, NOW_S) is (cause is ModeCause.FAILSAFE)
    critical = with_facts(found, heartbeat=Heartbeat(autopilot_id, mode, True, 5), critical_since_s=NOW_S)
    assert determine_mode_cause(context, away, before, critical, NOW_S) is ModeCause.FAILSAFE


def test_a_hold_of_an_arducopter_during_an_ordered_return_is_a_persons() -> None:
    """Its battery failsafe is in force all the while, and makes its heartbeats critical; it holds nobody."""
    home = flying(heartbeat=Heartbeat(3, RTL, True, 5), cause=ModeCause.OURS, stage=Stage.RETURNING)
    held = went(BRAKE, heartbeat=Heartbeat(3, BRAKE, True, 5), stage=Stage.RETURNING)
    assert determine_mode_cause(CONTEXT, (), home, held, NOW_S) is ModeCause.PERSON
    assert determine_mode_cause(CONTEXT, (), home, with_facts(held, fence_breached=True), NOW_S) is ModeCause.FAILSAFE


@pytest.mark.parametrize(
    ("after_s", "changes", "cause"),
    [
        (1.0, {}, ModeCause.OURS),
        (3.1, {}, ModeCause.PERSON),
        (1.0, {"took_off": True}, ModeCause.PERSON),
        (1.0, {"stage": Stage.GROUND}, ModeCause.PERSON),
    ],
)
def test_a_cancelled_start_may_still_arm_the_vehicle(
    after_s: float, changes: dict[str, object], cause: ModeCause
) -> None:
    stands: dict[str, object] = {
        "stage": Stage.LANDED,
        "fix": at(up_m=0.0),
        "took_off": False,
        "left_s": NOW_S - after_s,
    }
    assert determine_mode_cause(CONTEXT, (), flying(), went(RTL, **stands | changes), NOW_S) is cause


def test_a_return_that_is_broken_off_for_a_landing_elsewhere_is_a_persons() -> None:
    told: dict[str, object] = {"ordered_modes": frozenset({RTL, LAND}), "ordered_mode_s": NOW_S - 30.0}
    returns = flying(heartbeat=Heartbeat(3, RTL, True, 4), stage=Stage.RETURNING, **told)
    landing = went(LAND, stage=Stage.RETURNING, fix=at(east_m=60.0), **told)
    assert determine_mode_cause(CONTEXT, (), returns, landing, NOW_S) is ModeCause.PERSON
    assert (
        determine_mode_cause(CONTEXT, (), returns, with_facts(landing, ordered_modes=frozenset({LAND})), NOW_S)
        is ModeCause.OURS
    )
    assert determine_mode_cause(CONTEXT, (), flying(**told), landing, NOW_S) is ModeCause.OURS, (
        "it lands instead of a return"
    )
    assert determine_mode_cause(CONTEXT, (), returns, with_facts(landing, fix=at(east_m=3.0)), NOW_S) is ModeCause.OURS
    empty = with_facts(landing, **says("Battery Failsafe", NOW_S))
    assert determine_mode_cause(CONTEXT, (), returns, empty, NOW_S) is ModeCause.FAILSAFE


@pytest.mark.parametrize(("since_s", "explained"), [(4.0, True), (4.1, False)])
def test_a_text_that_comes_late_still_explains_it(since_s: float, *, explained: bool) -> None:
    state = went(RTL, mode_since_s=NOW_S - since_s, cause=ModeCause.PERSON, **says("Battery Failsafe", NOW_S))
    assert review_mode_cause(CONTEXT, (), state, NOW_S).custody.cause is (
        ModeCause.FAILSAFE if explained else ModeCause.PERSON
    )
    ours = with_facts(state, cause=ModeCause.OURS)
    assert review_mode_cause(CONTEXT, (), ours, NOW_S) == ours


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({}, ModeCause.PERSON),
        (says("Failsafe activated: entering Hold for 5 seconds", NOW_S - 2.4), ModeCause.FAILSAFE),
        ({"mode_since_s": NOW_S - 2.4}, ModeCause.MISSION),
        ({"on_ground": True}, ModeCause.MISSION),
        ({"on_ground": None}, ModeCause.MISSION),
        ({"heartbeat": Heartbeat(12, 50593792, False, 4)}, ModeCause.MISSION),
        ({"heartbeat": Heartbeat(12, 84148224, True, 4)}, ModeCause.MISSION),
    ],
)
def test_a_hold_where_the_mission_would_have_landed_is_a_persons(changes: dict[str, object], cause: ModeCause) -> None:
    context = fleet_of(autopilot="px4").context
    hold = context.vehicles["uav1"].dialect.modes.hold.custom_mode
    assert hold == 50593792
    told: dict[str, object] = {"cause": ModeCause.MISSION, "mode_since_s": NOW_S - 2.5, "on_ground": False}
    state = flying(**({"heartbeat": Heartbeat(12, hold, True, 4)} | told | changes))
    assert review_mode_cause(context, (), state, NOW_S).custody.cause is cause


@pytest.mark.parametrize(
    ("state", "sure"),
    [
        (went(LOITER, cause=ModeCause.PERSON, mode_since_s=NOW_S - 1.0), True),
        (went(LOITER, cause=ModeCause.PERSON, mode_since_s=NOW_S - 0.9), False),
        (went(LOITER, cause=ModeCause.FAILSAFE, mode_since_s=NOW_S - 9.0), False),
        (flying(heartbeat=Heartbeat(3, LOITER, False, 4), cause=ModeCause.PERSON, mode_since_s=NOW_S - 9.0), False),
    ],
)
def test_when_it_is_certain_that_a_person_has_it(state: VehicleState, *, sure: bool) -> None:
    assert is_taken_over(state, NOW_S) is sure


def with_failsafe(autopilot: str) -> Context:
    """Return a flight in which uav1 comes home by itself after 5 s without us."""
    context = fleet_of(autopilot=autopilot).context
    return replace(context, vehicles={**context.vehicles, "uav1": replace(context.vehicles["uav1"], failsafe_s=5.0)})


WITH_FAILSAFE = with_failsafe("ardupilot")


@pytest.mark.parametrize(
    ("pause_s", "ended_ago_s", "mode_ago_s", "acted"),
    [
        (4.0, 1.0, 0.0, True),
        (3.9, 1.0, 0.0, False),
        (10.0, 30.0, 27.5, True),
        (10.0, 30.1, 27.6, False),
        (10.0, 6.0, 0.9, False),
        (10.0, 3.0, 0.5, True),
        (10.0, 3.0, 0.4, False),  # it was heard on its mission until then
        (5.5, 5.0, 0.6, True),
        (5.5, 5.0, 0.4, False),
        (10.0, 1.0, 11.0, True),
        (10.0, 1.0, 11.1, False),
    ],
)
def test_a_failsafe_that_waited_for_us(pause_s: float, ended_ago_s: float, mode_ago_s: float, *, acted: bool) -> None:
    """Our last heartbeat may have been a second old when we stopped, and it takes its time to react."""
    away = (GroundStationAbsence(NOW_S - ended_ago_s, pause_s, restarted=False),)
    assert is_gcs_absence_failsafe(WITH_FAILSAFE, away, went(RTL, mode_since_s=NOW_S - mode_ago_s), NOW_S) is acted
    assert is_gcs_absence_failsafe(WITH_FAILSAFE, (), went(RTL), NOW_S) is False


def test_a_failsafe_hold_may_begin_late() -> None:
    away = (GroundStationAbsence(NOW_S - 30.0, 10.0, restarted=False),)
    assert is_gcs_absence_failsafe(with_failsafe("px4"), away, went(RTL), NOW_S)
    assert not is_gcs_absence_failsafe(with_failsafe("px4"), away, went(RTL), NOW_S + 0.1)
    assert not is_gcs_absence_failsafe(WITH_FAILSAFE, away, went(RTL), NOW_S), "it was heard on its mission since"
    assert is_gcs_absence_failsafe(WITH_FAILSAFE, away, went(RTL, unseen_until_s=NOW_S), NOW_S), (
        "nobody heard it until now"
    )


def test_an_unknown_gcs_failsafe_is_assumed_after_a_link_gap() -> None:
    unknown = fleet_of().context
    assert unknown.vehicles["uav1"].failsafe_s is None
    deaf, asleep = (GroundStationAbsence(NOW_S - 1.0, 10.0, restarted=False, deaf=deaf) for deaf in (True, False))
    back = went(RTL, unseen_until_s=NOW_S)
    assert is_gcs_absence_failsafe(unknown, (deaf,), back, NOW_S)
    assert not is_gcs_absence_failsafe(unknown, (asleep,), back, NOW_S)
    assert not is_gcs_absence_failsafe(unknown, (deaf,), went(RTL), NOW_S)


def test_a_vehicle_on_its_mission_after_the_gap_had_no_gcs_failsafe() -> None:
    """Its failsafe holds it first, and that is a mode of its own: who leaves the mission for good later was taken."""
    away, px4 = (GroundStationAbsence(NOW_S - 13.0, 58.0, restarted=False),), with_failsafe("px4")
    modes = px4.vehicles["uav1"].dialect.modes
    on_mission, held = modes.mission.custom_mode, modes.hold.custom_mode
    landing = modes.land.custom_mode
    assert is_gcs_absence_failsafe(px4, away, went(landing, mode_before=held), NOW_S)
    assert not is_gcs_absence_failsafe(px4, away, went(landing, mode_before=on_mission), NOW_S)
    assert is_gcs_absence_failsafe(px4, away, went(landing, mode_before=on_mission, mode_since_s=NOW_S - 10.5), NOW_S)
    assert not is_gcs_absence_failsafe(
        px4, away, went(landing, mode_before=on_mission, mode_since_s=NOW_S - 10.4), NOW_S
    )
    silent_till_now = went(landing, mode_before=on_mission, unseen_until_s=NOW_S)
    assert is_gcs_absence_failsafe(px4, away, silent_till_now, NOW_S), "nobody heard it in its hold"


SINCE_S = NOW_S - 60.0


def back(regained_ago_s: float = 1.0, **changes: object) -> VehicleState:
    """Return a vehicle that is heard again, and has said where it is and in which mode, but not on which item."""
    before = LastKnown(at(age_s=61.0), 2, None, None, 90.0, SINCE_S)
    told: dict[str, object] = {"before": before, "regained_s": NOW_S - regained_ago_s, "item_s": SINCE_S}
    return flying(**(told | changes))


@pytest.mark.parametrize(
    ("state", "waits"),
    [
        (back(4.9), True),
        (back(5.0), False),
        (back(4.9, item_s=SINCE_S + 0.1), False),
        (back(9.0, stale=True), True),
        (back(9.0, regained_s=None, fix=at(age_s=60.0)), True),
        (back(regained_s=SINCE_S, fix=at(age_s=60.0)), True),
        (back(regained_s=None, item_s=SINCE_S + 0.1), False),  # its positions alone were gone
        (back(4.9, heartbeat=Heartbeat(3, AUTO, False, 4), took_off=False), False),
        (back(4.9, heartbeat_s=SINCE_S, item_s=NOW_S), True),
        (back(4.9, fix=at(age_s=60.0), item_s=NOW_S), True),
        (back(fix=None), False),
        (back(heartbeat_s=None), False),
        (back(board=None), False),
    ],
)
def test_a_regained_link_is_judged_only_after_enough_reports(state: VehicleState, *, waits: bool) -> None:
    stepped = recover_after_silence(CONTEXT, FleetState({"uav1": state}), state, NOW_S)
    assert (stepped is None) is waits
    if stepped is not None:
        assert stepped[0].vehicles["uav1"].assignment.before is None, "it is asked no more"


def test_a_mission_on_board_is_ours_or_another() -> None:
    ours = MissionOwnership(ours_s=NOW_S, id=7)
    assert mission_ownership.apply_mission_report(ours, MissionCurrent(1, 9, 7), 9, NOW_S + 9.0) == ours
    assert mission_ownership.apply_mission_report(ours, MissionCurrent(1, 65535), 9, NOW_S).words == "none at all"
    other = mission_ownership.apply_mission_report(ours, MissionCurrent(1, 8, 7), 9, NOW_S + 1.0)
    assert (other.foreign_s, other.words) == (NOW_S + 1.0, "8 items where ours has 9")
    assert mission_ownership.apply_mission_report(other, MissionCurrent(1, 8, 7), 9, NOW_S + 2.0) == other, (
        "it is as old as it was"
    )
    assert [other.is_surely_foreign(NOW_S + 1.0 + after_s) for after_s in (0.8, 1.0)] == [False, True]
    assert mission_ownership.apply_mission_report(other, MissionCurrent(1, 9, 7), 9, NOW_S + 2.0) == ours
    early = mission_ownership.apply_mission_report(ours, MissionCurrent(1, 9, 8), 9, NOW_S + 4.9)
    assert (early.id, early.foreign_s) == (8, None), "what it says first may be of before the upload"
    late = mission_ownership.apply_mission_report(ours, MissionCurrent(1, 9, 8), 9, NOW_S + 5.0)
    assert (late.id, late.words) == (7, "as many items as ours, but others")
    text = "Flight plan received"
    assert mission_ownership.note_mission_text(ours, text, NOW_S + 4.9) == ours
    assert mission_ownership.note_mission_text(ours, text, NOW_S + 5.0).told_s == NOW_S + 5.0
    assert mission_ownership.note_mission_text(ours, "flight plan", NOW_S + 5.0) == ours


def test_ardupilot_does_not_count_its_home() -> None:
    assert compute_expected_total(CONTEXT, "uav1", 10) == 9
    assert compute_expected_total(fleet_of(autopilot="px4").context, "uav1", 10) == 10
