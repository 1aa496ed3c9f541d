"""Which fence a vehicle is given, and which a new mission needs before it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import fleet_step
from executor.core.context import Context, FenceRules
from executor.core.inflight.custody.mode_causes import determine_mode_cause
from executor.core.inflight.faults import watchpoints
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Upload
from executor.core.interface.events import Found, Heard, MissionsWanted, NewRoute, Resumed, UploadEnded
from executor.core.interface.messages import OwnFailsafe, StatusText
from executor.core.replanning import replan_cycle
from executor.core.resume import reconciliation
from executor.core.state import onboard_fence
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import FaultCode, FaultKind, Stage, VehicleState
from missions import build_flight_path
from missions.fences import Fence
from tests.executor.core.inflight.faults.watch_views import Verdict, verdict_of
from tests.executor.core.steps import SECOND, beat, flight_of, new_mission, offer_of, plan_of
from tests.executor.core.vehicles import FLEET, NOW_S, flying

RULE = FenceRules(True, 20.0, 10.0, "keep", "pad")
CONTEXT: Context = replace(FLEET.context, fencing=RULE)
FENCES = onboard_fence.build_first_fences(CONTEXT, FLEET.boards)
WIDE = Fence(((-5000.0, -5000.0), (5000.0, -5000.0), (5000.0, 5000.0), (-5000.0, 5000.0)), 500.0)
UNMADE = plan_of(unmade=(NewRoute("uav1", (4,)),), pending=frozenset({"uav1"}))


def fenced(fence: Fence | None = FENCES["uav1"], **given: object) -> VehicleState:
    one = flying(**given)
    return replace(one, assignment=replace(one.assignment, fence=fence))


def test_nothing_is_wanted_where_the_site_does_not_say_so() -> None:
    assert onboard_fence.build_first_fences(FLEET.context, FLEET.boards) == {}
    off = replace(FLEET.context, fencing=replace(RULE, enabled=False))
    assert onboard_fence.build_first_fences(off, FLEET.boards) == {}
    assert onboard_fence.build_rally_list(off, "uav1") is None
    assert onboard_fence.build_rally_list(replace(CONTEXT, fencing=replace(RULE, rally="keep")), "uav1") is None


def test_a_fence_holds_all_of_a_flight_and_ends_above_it() -> None:
    board = FLEET.boards["uav1"]
    assert board is not None
    fence = FENCES["uav1"]
    assert all(fence.distance_outside_m(place) == 0.0 for place in board.places_m)
    assert fence.distance_outside_m(CONTEXT.vehicles["uav1"].pad_m) == 0.0
    assert fence.top_m >= max(point.alt_rel_m for point in board.path.waypoints) + RULE.height_margin_m
    assert fence.top_m >= CONTEXT.return_height_m("uav1") + RULE.height_margin_m
    assert onboard_fence.height_over_fence_m(CONTEXT, "uav1", board.path) == 0.0


def test_the_pad_is_the_one_rally_point() -> None:
    [item] = onboard_fence.build_rally_list(CONTEXT, "uav1") or ()
    assert CONTEXT.frame.to_local_m(item.x / 1e7, item.y / 1e7) == pytest.approx(
        CONTEXT.vehicles["uav1"].pad_m, abs=0.02
    )


def test_a_mission_inside_needs_no_other_fence() -> None:
    path = build_flight_path(CONTEXT.setup, "uav1", (0,))
    assert onboard_fence.widen_fence(CONTEXT, "uav1", FENCES["uav1"], path) is None
    assert onboard_fence.widen_fence(FLEET.context, "uav1", None, path) is None


def test_a_mission_that_leads_out_needs_one_that_covers_both() -> None:
    path = build_flight_path(CONTEXT.setup, "uav1", (0, 8))
    known = onboard_fence.fence_for(CONTEXT, "uav1", None)
    wider = onboard_fence.widen_fence(CONTEXT, "uav1", known, path)
    needed = onboard_fence.fence_for(CONTEXT, "uav1", path)
    assert known is not None
    assert wider is not None
    assert needed is not None
    assert wider.is_covering(known)
    assert wider.is_covering(needed)


def uploads(one: VehicleState) -> list[Upload]:
    before = flight_of(one, SECOND, replan=UNMADE)
    _, commands = replan_cycle.apply_missions_wanted(CONTEXT, before, MissionsWanted(4), NOW_S)
    return [command for command in commands if isinstance(command, Upload)]


def test_the_wider_fence_goes_with_the_upload() -> None:
    narrow = onboard_fence.fence_for(CONTEXT, "uav1", None)
    [widened], [inside] = uploads(fenced(narrow)), uploads(fenced(WIDE))
    assert inside.fence is None
    assert widened.fence is not None
    assert narrow is not None
    assert widened.fence.is_covering(narrow)


MISSION = replace(new_mission(2), fence=WIDE)


def after_upload(event: UploadEnded) -> FleetState:
    before = flight_of(fenced(), SECOND, replan=plan_of(missions={"uav1": MISSION}, pending=frozenset({"uav1"})))
    return fleet_step.step(CONTEXT, before, event, NOW_S)[0]


@pytest.mark.parametrize(
    ("event", "fence"),
    [
        (UploadEnded("uav1", 4, True, False, "", fenced=True), WIDE),
        (UploadEnded("uav1", 4, False, False, "no answer", Ending.NO_ANSWER, fenced=True), WIDE),
        (UploadEnded("uav1", 4, False, False, "its fence: no space", Ending.NO_SPACE), FENCES["uav1"]),
    ],
    ids=["both on board", "broken off between the two", "the fence was refused"],
)
def test_which_fence_is_on_board_after_an_upload(event: UploadEnded, fence: Fence) -> None:
    one = after_upload(event).vehicles["uav1"]
    assert one.assignment.fence == fence
    assert one.stage is Stage.FLYING, "its old mission lies in either"
    assert one.assignment.stubborn is not event.accepted


def test_a_flight_resumed_between_the_two_sends_the_fence_again_before_the_mission() -> None:
    one = fenced()
    offer = offer_of()
    plan = plan_of(offer, missions={"uav1": MISSION}, pending=frozenset({"uav1"}), solve_s=0.5)
    before = flight_of(one, SECOND, replan=plan)
    board = one.assignment.board
    assert board is not None
    found = reconciliation.compare_onboard_mission(CONTEXT, before, "uav1", None, 3)
    assert isinstance(found, Found)
    resumption = reconciliation.resume_fleet(CONTEXT, before, Resumed((found,)), NOW_S)
    again = [command for command in resumption.commands if isinstance(command, Upload)]
    assert [command.fence for command in again] == [WIDE]


def breached(one: VehicleState) -> tuple[Verdict, str]:
    found = watchpoints.check_fence_breach(WatchView(CONTEXT, CONTEXT.vehicles["uav1"], one, False, NOW_S))
    return verdict_of(found), found or ""


def test_a_breach_is_a_fault_of_its_own_by_any_of_its_signs() -> None:
    assert breached(fenced()) == (Verdict.OK, "")
    status = fenced()
    status = replace(status, sensors=replace(status.sensors, fence_breached=True))
    assert breached(status) == (Verdict.FAIL, "its fence is breached")
    bit = fenced()
    bit = replace(bit, sensors=replace(bit.sensors, unhealthy=1 << 20), sortie=replace(bit.sortie, took_off=True))
    assert breached(bit) == (Verdict.FAIL, "its fence is breached")
    said = OwnFailsafe("fence", active=True, words="Polygon fence breached")
    text = fenced()
    text = replace(text, evidence=replace(text.evidence, failed=((said, NOW_S),)))
    assert breached(text) == (Verdict.FAIL, "its fence is breached; it says: Polygon fence breached")


def test_a_position_outside_the_fence_is_a_breach_without_other_reports() -> None:
    away = fenced()
    assert away.motion.fix is not None
    away = replace(away, motion=replace(away.motion, fix=replace(away.motion.fix, place_m=(0.0, 3000.0), at_s=NOW_S)))
    verdict, evidence = breached(away)
    assert verdict is Verdict.FAIL
    assert evidence.startswith("its fence is breached; ")
    assert evidence.endswith(" m outside")
    assert breached(replace(away, assignment=replace(away.assignment, fence=None)))[0] is Verdict.OK
    high = fenced()
    assert high.motion.fix is not None
    top_m = FENCES["uav1"].top_m
    high = replace(high, motion=replace(high.motion, fix=replace(high.motion.fix, alt_rel_m=top_m + 10.0, at_s=NOW_S)))
    assert breached(high)[1] == "its fence is breached; 10 m above it"


def test_the_fence_names_the_reason_before_the_mode_does() -> None:
    rows = [point.name for point in watchpoints.TABLE]
    assert rows.index("fence") < rows.index("mode")
    [row] = [point for point in watchpoints.TABLE if point.name == "fence"]
    assert (row.kind, row.code) == (FaultKind.FENCE, FaultCode.FENCE_BREACHED)
    assert Stage.PILOT not in row.stages


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("Polygon fence breached", True),
        ("Max Alt fence breached", True),
        ("Geofence: exceeding maximum altitude above Home", True),
        ("Geofence: approaching or outside geofence", True),
        ("Geofence violation", True),
        ("Geofence violation for waypoint 2", False),
        ("Geofence invalid, doesn't contain current vehicle position", False),
        ("Fence Indexed OK", False),
        ("Fence upload timeout", False),
        ("Fence breach cleared", False),
    ],
)
def test_a_text_about_an_upload_is_no_breach(text: str, means: bool) -> None:
    before = flight_of(fenced(), SECOND)
    heard = fleet_step.step(CONTEXT, before, Heard("uav1", StatusText(2, text)), NOW_S)[0].vehicles["uav1"]
    assert any(one.what == "fence" for one, _ in heard.evidence.failed) is means


def test_outside_its_fence_a_return_is_its_own() -> None:
    """Both say so in a text, which may be lost; where it is explains it as well."""
    rtl = CONTEXT.vehicles["uav1"].dialect.modes.return_home.custom_mode
    before = fenced()
    assert before.motion.fix is not None
    fix = replace(before.motion.fix, place_m=(0.0, 3000.0), at_s=NOW_S)
    out = replace(before, motion=replace(before.motion, fix=fix))
    returns = replace(out, telemetry=replace(out.telemetry, heartbeat=beat(rtl), mode_since_s=NOW_S))
    inside = replace(returns, motion=replace(returns.motion, fix=before.motion.fix))
    assert determine_mode_cause(CONTEXT, (), before, returns, NOW_S) is ModeCause.FAILSAFE
    assert determine_mode_cause(CONTEXT, (), before, inside, NOW_S) is ModeCause.PERSON
