"""One message at a time: what is known of a vehicle before and after it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core.battery.account import BatteryState
from executor.core.interface.messages import (
    Attitude,
    Battery,
    FenceStatus,
    FlightMessage,
    Gps,
    Heartbeat,
    LandedState,
    MissionCurrent,
    OrderSeen,
    Position,
    Radio,
    StatusText,
    SystemStatus,
    Traffic,
    Wind,
)
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.telemetry.message_update import apply_message
from missions import Phase
from tests.executor.builders import with_facts
from tests.executor.core.vehicles import AUTO, CONTEXT, NOW_S, RTL, SETUP, at, flying, volts

ARMED, OFF = Heartbeat(3, AUTO, True, 4), Heartbeat(3, AUTO, False, 4)
QUIET_S = NOW_S - 4.0


def after(state: VehicleState, *messages: FlightMessage, at_s: float = NOW_S) -> VehicleState:
    for message in messages:
        state = apply_message(CONTEXT, state, message, at_s).state
    return state


def position(east_m: float = 300.0, up_m: float = 20.0, boot_s: float = NOW_S, **changes: float) -> Position:
    """Return what a vehicle says of its place, so far east of its pad, flying north at 3 m/s."""
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(SETUP.pad_m[0] + east_m, SETUP.pad_m[1])
    said = Position(boot_s, lat_deg, lon_deg, 450.0 + up_m, up_m, 3.0, 0.0, 0.0, None)
    return replace(said, **changes)


OWN_WORDS: list[FlightMessage] = [
    ARMED, position(), Battery(0, 80.0, 15.0, None, None, 1, 0), SystemStatus(80.0, None, 0, None),
    MissionCurrent(3, None), LandedState(False), Gps(3, 12), Wind(3.0, 90.0), Attitude(1.0, 2.0), FenceStatus(False),
    StatusText(6, "hello"),
]  # fmt: skip
OTHERS_WORDS: list[FlightMessage] = [Traffic(20, 0), Radio(100, 100, 40, 40, 90), OrderSeen(176)]


@pytest.mark.parametrize("message", OWN_WORDS, ids=lambda one: type(one).__name__)
def test_whatever_it_says_it_is_heard(message: FlightMessage) -> None:
    state = after(flying(heard_s=QUIET_S, spoke_s=QUIET_S, fix=at(age_s=4.0)), message)
    assert (state.link.heard_s, state.link.spoke_s, state.link.regained_s) == (NOW_S, NOW_S, NOW_S)
    short = after(flying(heard_s=NOW_S - 2.9, spoke_s=NOW_S - 2.9, fix=at(age_s=4.0)), message)
    assert short.link.regained_s is None, "2.9 s are no silence"
    assert after(flying(spoke_s=NOW_S - 3.0, fix=at(age_s=4.0)), message).link.regained_s == NOW_S


@pytest.mark.parametrize("message", OTHERS_WORDS, ids=lambda one: type(one).__name__)
def test_what_others_say_of_it_is_no_word_of_its_own(message: FlightMessage) -> None:
    state = after(flying(heard_s=QUIET_S, spoke_s=QUIET_S), message)
    assert (state.link.heard_s, state.link.spoke_s, state.link.regained_s) == (QUIET_S, QUIET_S, None)


def test_each_message_is_kept_where_it_belongs() -> None:
    state = after(
        flying(), Gps(3, 12), Wind(3.0, 90.0), Attitude(1.0, 2.0), LandedState(True), FenceStatus(True), OrderSeen(176)
    )  # fmt: skip
    assert (state.sensors.gps, state.sensors.wind, state.sensors.attitude) == (
        Gps(3, 12),
        Wind(3.0, 90.0),
        Attitude(1.0, 2.0),
    )
    assert (state.telemetry.on_ground, state.sensors.fence_breached) == (True, True)
    assert state.evidence.others_orders == ((OrderSeen(176), NOW_S),)
    current = after(flying(), MissionCurrent(3, 9))
    assert (current.telemetry.item, current.telemetry.item_s) == ((3, 9), NOW_S)
    assert after(flying(), Radio(100, 100, 40, 40, 90)).link.quality.radio_s == NOW_S
    assert after(flying(), Traffic(20, 20)).link.quality.lost == 0.5


@pytest.mark.parametrize(
    ("roll", "pitch", "tilted"),
    [(75.0, 0.0, False), (75.1, 0.0, True), (-75.1, 0.0, True), (0.0, 75.1, True), (0.0, -75.1, True)],
)
def test_an_attitude_in_which_no_multicopter_flies(roll: float, pitch: float, *, tilted: bool) -> None:
    state = after(flying(), Attitude(roll, pitch))
    assert state.sensors.tilted_since_s == (NOW_S if tilted else None)
    assert after(state, Attitude(roll, pitch), at_s=NOW_S + 2.0).sensors.tilted_since_s == state.sensors.tilted_since_s
    assert after(state, Attitude(0.0, 0.0)).sensors.tilted_since_s is None


ALARMS = ["Battery Failsafe", "Crash: Disarming", "Battery 1 is low 10.22V", "Kill engaged", "Fence Breached",
          "Potential Thrust Loss (3)", "Critical battery, return now", "Parachute: Released"]  # fmt: skip


@pytest.mark.parametrize("text", ALARMS)
def test_a_text_of_a_failsafe_is_kept(text: str) -> None:
    assert after(flying(), StatusText(4, text)).telemetry.alarm == (text, NOW_S)
    assert after(flying(), StatusText(4, "Reached waypoint #3")).telemetry.alarm == ("", -math.inf)


def test_what_it_does_about_a_reason_does_not_replace_the_reason() -> None:
    known = after(flying(), StatusText(4, "Low battery"))
    then = StatusText(4, "Failsafe activated: switching to Return")
    assert after(known, then, at_s=NOW_S + 4.9).telemetry.alarm == ("Low battery", NOW_S)
    assert after(known, then, at_s=NOW_S + 5.0).telemetry.alarm == (then.text, NOW_S + 5.0)


IN_AIR: dict[str, object] = {"heartbeat": ARMED, "heartbeat_s": NOW_S - 1.0, "fix": replace(at(), at_s=NOW_S - 1.0)}
STILL: dict[str, object] = {"fix": replace(at(up_m=2.0), velocity_m_s=(1.0, 0.0, 0.0))}


@pytest.mark.parametrize("text", ["RC: Motors Emergency Stopped", "Kill engaged"])
def test_a_kill_switch_after_a_landing_ends_no_flight(text: str) -> None:
    def alarm(up_m_s: float = 0.0, age_s: float = 0.0, *, on_ground: bool | None = True) -> str:
        fix = replace(at(up_m=0.0), velocity_m_s=(0.0, 0.0, up_m_s), at_s=NOW_S - age_s)
        return after(flying(fix=fix, on_ground=on_ground), StatusText(2, text)).telemetry.alarm[0]

    assert alarm() == ""
    assert alarm(up_m_s=-0.5) == alarm(age_s=2.0) == alarm(on_ground=False) == alarm(on_ground=None) == text


DOUBTS: list[tuple[dict[str, object], bool]] = [
    ({}, True),
    ({"took_off": False}, False),
    ({"falls_s": NOW_S - 2.4}, False),
    ({"falls_s": NOW_S - 2.5}, True),
    ({"fix": None}, False),
    ({"fix": at(age_s=1.5)}, True),
    ({"fix": at(age_s=1.6)}, False),
    ({"on_ground": True}, False),
    ({"alarm": ("Crash: Disarming", NOW_S - 5.0)}, False),
    ({"alarm": ("Crash: Disarming", NOW_S - 5.1)}, True),
    ({"alarm": ("Battery Failsafe", NOW_S)}, True),
    ({"heartbeat_s": NOW_S - 3.4}, True),
    ({"heartbeat_s": NOW_S - 3.5}, False),
    (STILL, False),
    ({"fix": replace(at(up_m=2.1), velocity_m_s=(0.0, 0.0, 0.0))}, True),
    ({"fix": replace(at(up_m=0.0), velocity_m_s=(1.0, 0.5, 0.0))}, True),
    ({"heartbeat": OFF}, False),
]


@pytest.mark.parametrize(("changes", "doubted"), DOUBTS, ids=[str(number) for number in range(len(DOUBTS))])
def test_a_heartbeat_that_positions_refute_is_believed_when_the_next_one_says_the_same(
    changes: dict[str, object], *, doubted: bool
) -> None:
    before = flying(**(IN_AIR | changes))
    first = after(before, OFF)
    assert (first.telemetry.doubted == (OFF, NOW_S)) is doubted
    if not doubted:
        assert first.telemetry.heartbeat == OFF
        return
    assert (first.telemetry.heartbeat, first.link.heartbeat_s, first.link.heard_s) == (
        before.telemetry.heartbeat,
        before.link.heartbeat_s,
        NOW_S,
    )
    fresh = with_facts(first, fix=replace(at(), at_s=NOW_S + 2.0), heartbeat_s=NOW_S - 0.5)
    again = after(fresh, OFF, at_s=NOW_S + 2.49)
    assert again.telemetry.heartbeat == before.telemetry.heartbeat
    believed = after(fresh, OFF, at_s=NOW_S + 2.51)
    assert (believed.telemetry.heartbeat, believed.telemetry.doubted, believed.sortie.disarmed_s) == (
        OFF,
        None,
        NOW_S + 2.51,
    )
    assert after(fresh, ARMED, at_s=NOW_S + 2.51).telemetry.doubted is None


def test_a_mode_is_as_old_as_its_first_heartbeat() -> None:
    before = flying(mode_since_s=NOW_S - 50.0)
    assert after(before, ARMED).telemetry.mode_since_s == NOW_S - 50.0
    changed = after(before, Heartbeat(3, RTL, True, 4))
    assert changed.telemetry.mode_since_s == NOW_S
    assert after(flying(heartbeat=None), ARMED).telemetry.mode_since_s == NOW_S


def test_when_it_disarmed_is_when_it_was_first_heard_to_be() -> None:
    down = after(flying(took_off=False), OFF)
    assert down.sortie.disarmed_s == NOW_S
    assert after(down, OFF, at_s=NOW_S + 1.0).sortie.disarmed_s == NOW_S
    assert down.sortie.armed_once
    fresh = flying(armed_once=False, heartbeat=OFF)
    assert not after(fresh, OFF).sortie.armed_once
    assert after(fresh, ARMED).sortie.armed_once


@pytest.mark.parametrize(
    ("changes", "flew"),
    [({}, True), ({"took_off": False}, False), ({"took_off": False, "flew_mission": True}, True)],
)
def test_a_vehicle_in_mission_mode_in_the_air_flies_its_mission(changes: dict[str, object], *, flew: bool) -> None:
    assert after(flying(**changes), ARMED).sortie.flew_mission is flew
    assert after(flying(), Heartbeat(3, RTL, True, 4)).sortie.flew_mission is False


@pytest.mark.parametrize(
    ("changes", "unseen"),
    [
        ({"heard_s": NOW_S - 2.9}, False),
        ({"heard_s": NOW_S - 3.0}, True),
        ({"heartbeat_s": None}, True),
        ({"heartbeat_s": NOW_S - 9.0, "regained_s": NOW_S - 1.0}, True),
        ({"heartbeat_s": NOW_S - 1.0, "regained_s": NOW_S - 1.0}, False),
        ({"heartbeat": None, "heartbeat_s": None}, False),
    ],
)
def test_the_first_heartbeat_after_a_silence(changes: dict[str, object], *, unseen: bool) -> None:
    assert after(flying(**changes), ARMED).custody.unseen_until_s == (NOW_S if unseen else None)


def test_a_position_in_our_own_terms() -> None:
    said = position(120.0, 33.0, NOW_S, east_m_s=1.0, north_m_s=2.0, down_m_s=-3.0, heading_deg=45.0)
    fix = after(flying(fix=None), said).motion.fix
    assert fix is not None
    assert fix.place_m == pytest.approx((SETUP.pad_m[0] + 120.0, SETUP.pad_m[1]), abs=0.02)
    assert (fix.at_s, fix.boot_s, fix.alt_rel_m, fix.alt_msl_m) == (NOW_S, NOW_S, 33.0, 483.0)
    assert (fix.velocity_m_s, fix.heading_deg) == ((1.0, 2.0, 3.0), 45.0)


@pytest.mark.parametrize(
    ("boot_s", "heard_ago_s", "taken", "rebooted"),
    [
        (NOW_S + 0.1, 0.0, True, False),
        (NOW_S, 0.0, False, False),
        (NOW_S - 59.9, 2.9, False, False),
        (NOW_S - 60.0, 0.0, True, True),
        (NOW_S - 1.0, 3.0, True, True),
    ],
)
def test_a_clock_that_goes_back_was_overtaken_or_started_again(
    boot_s: float, heard_ago_s: float, *, taken: bool, rebooted: bool
) -> None:
    before = flying(fix=replace(at(), at_s=NOW_S - heard_ago_s))
    state = after(before, position(boot_s=boot_s, up_m=44.0))
    assert state.motion.fix is not None
    assert (state.motion.fix.alt_rel_m == 44.0) is taken
    assert (state.sortie.rebooted_s == NOW_S) is rebooted


@pytest.mark.parametrize(("boot_s", "behind_s"), [(NOW_S - 25.0, 5.0), (NOW_S - 25.1, 5.1), (NOW_S - 24.9, 0.0)])
def test_a_clock_that_hardly_moved_in_a_silence_has_fallen_back(boot_s: float, behind_s: float) -> None:
    before = flying(fix=replace(at(), at_s=NOW_S - 30.0, boot_s=NOW_S - 50.0))
    state = after(before, position(boot_s=boot_s))
    assert state.motion.behind_s == pytest.approx(behind_s)
    assert (state.motion.fell_back_s == NOW_S) is (behind_s > 0.0)
    assert state.sortie.rebooted_s is None


def test_a_clock_set_during_the_absence_says_nothing_about_the_vehicles() -> None:
    before = flying(fix=replace(at(), at_s=NOW_S - 3600.0, boot_s=NOW_S - 50.0), reopened=True)
    motion = after(before, position(boot_s=NOW_S - 42.0)).motion
    assert (motion.behind_s, motion.reopened) == (0.0, False)


def test_messages_queued_during_a_stall_are_processed() -> None:
    vehicle = flying(fix=replace(at(), at_s=NOW_S - 8.0, boot_s=NOW_S - 8.0))
    for late_s in (7.8, 4.0, 0.2, 0.0):
        vehicle = after(vehicle, position(boot_s=NOW_S - late_s))
    assert vehicle.motion.behind_s == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("elapsed_s", "armed", "counts"),
    [(1.0, True, True), (599.9, True, True), (600.0, True, False), (1.0, False, False)],
)
def test_what_the_model_says_was_used_between_two_positions(elapsed_s: float, *, armed: bool, counts: bool) -> None:
    before = flying(fix=replace(at(), boot_s=NOW_S - elapsed_s), heartbeat=ARMED if armed else OFF)
    drawn = after(before, position()).power.battery.modelled_pct - before.power.battery.modelled_pct
    expected = CONTEXT.draw_pct_per_s(0.0, 3.0) * elapsed_s if counts else 0.0
    assert drawn == pytest.approx(expected)


@pytest.mark.parametrize(("climbs_m_s", "more"), [(2.5, 0.1), (0.0, 0.0), (-1.5, 0.0)])
def test_a_climb_uses_more_and_a_descent_no_less(climbs_m_s: float, more: float) -> None:
    before = flying(fix=replace(at(), boot_s=NOW_S - 1.0), heartbeat=ARMED)
    drawn = after(before, replace(position(), down_m_s=-climbs_m_s)).power.battery.modelled_pct
    expected = (1.0 + more) * CONTEXT.draw_pct_per_s(0.0, 3.0)
    assert drawn - before.power.battery.modelled_pct == pytest.approx(expected)


@pytest.mark.parametrize(("moved_m", "anew"), [(2.9, False), (3.1, True)])
def test_the_anchor_is_where_it_last_moved_on(moved_m: float, *, anew: bool) -> None:
    before = flying(fix=replace(at(), boot_s=NOW_S - 1.0), anchor=replace(at(), boot_s=NOW_S - 50.0))
    for said in (position(300.0 + moved_m), position(300.0, 20.0 + moved_m)):
        state = after(before, said)
        assert (state.motion.anchor == state.motion.fix) is anew
        assert anew or state.motion.anchor == before.motion.anchor
    assert after(with_facts(before, anchor=None), position()).motion.anchor is not None
    later = replace(at(), boot_s=NOW_S + 5.0)
    assert after(with_facts(before, anchor=later), position()).motion.anchor != later


@pytest.mark.parametrize(("up_m", "armed", "flies"), [(2.0, True, False), (2.1, True, True), (2.1, False, False)])
def test_a_vehicle_armed_and_above_two_metres_has_taken_off(up_m: float, *, armed: bool, flies: bool) -> None:
    before = flying(took_off=False, fix=replace(at(), boot_s=NOW_S - 1.0), heartbeat=ARMED if armed else OFF)
    state = after(before, position(15.1, up_m))
    assert (state.sortie.took_off, state.sortie.away_once) == (flies, flies)
    assert after(before, position(14.9, up_m)).sortie.away_once is False


@pytest.mark.parametrize(
    ("off_m", "elapsed_s", "jumps"),
    [
        (10.1, 1.0, True),
        (9.9, 1.0, False),
        (10.1, 0.2, True),
        (19.0, 2.0, False),
        (21.0, 2.0, True),
        (150.0, 10.0, False),
    ],
)
def test_a_position_that_lies_where_no_velocity_leads_is_a_jump(off_m: float, elapsed_s: float, *, jumps: bool) -> None:
    """It flew east at 3 m/s before and flies north at 3 m/s now: half of each is where it should be."""
    before = flying(fix=replace(at(), boot_s=NOW_S - elapsed_s, velocity_m_s=(3.0, 0.0, 0.0)))
    half_m = 1.5 * elapsed_s
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(SETUP.pad_m[0] + 300.0 + half_m, SETUP.pad_m[1] + half_m + off_m)
    state = after(before, replace(position(), lat_deg=lat_deg, lon_deg=lon_deg))
    assert (state.motion.jump[1] == NOW_S) is jumps
    if jumps:
        assert state.motion.jump[0] == pytest.approx(off_m, abs=0.05)


def test_an_item_is_the_waypoint_that_it_flies_to_while_it_is_on_its_mission() -> None:
    board = flying().assignment.board
    assert board is not None
    items = {waypoint: seq for seq, waypoint in enumerate(board.waypoint_of) if waypoint is not None}
    for waypoint, seq in items.items():
        assert after(flying(waypoint=0), MissionCurrent(seq, None)).assignment.waypoint == waypoint
        assert after(flying(waypoint=0, stage=Stage.RETURNING), MissionCurrent(seq, None)).assignment.waypoint == 0
    beyond = len(board.waypoint_of)
    assert after(flying(waypoint=2), MissionCurrent(beyond, None)).assignment.waypoint == 2
    landing = next(n for n, point in enumerate(board.path.waypoints) if point.phase is Phase.LAND)
    over = flying(waypoint=landing)
    assert after(over, MissionCurrent(items[2], None)).assignment.waypoint == landing, (
        "it counts anew when the mission is over"
    )


def test_the_emptiest_of_several_packs_counts_and_their_voltages_do_not() -> None:
    fresh = flying(battery=BatteryState(), packs=(), volts=volts())
    one = after(fresh, Battery(0, 80.0, 15.0, 10.0, 1.0, 1, 4))
    assert (one.power.battery.remaining_pct, one.power.volts.voltage_v, one.power.battery_faults) == (80.0, 15.0, 4)
    two = after(one, Battery(1, 70.0, 14.0, 10.0, 1.0, 1, 0))
    assert (two.power.battery.remaining_pct, two.power.volts.voltage_v) == (70.0, 15.0)
    three = after(two, Battery(0, 79.0, 14.5, 10.0, 1.1, 1, 0))
    assert (three.power.battery.remaining_pct, dict(three.power.packs)) == (70.0, {0: 79.0, 1: 70.0})


@pytest.mark.parametrize(("rises_pct", "anew"), [(20.0, False), (20.1, True)])
def test_a_percentage_that_jumps_up_is_another_account(rises_pct: float, *, anew: bool) -> None:
    fresh = flying(battery=BatteryState(), packs=())
    used = after(fresh, Battery(0, 70.0, None, None, None, 1, 0), Battery(0, 60.0, None, None, None, 1, 0))
    state = after(used, Battery(0, 60.0 + rises_pct, None, None, None, 1, 0))
    assert (state.power.battery.first_pct == 60.0 + rises_pct) is anew
