"""What the checklist says of fences and rally points, and which parameters a fence needs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import Context, FenceRules
from executor.core.interface.codes import Severity
from executor.core.interface.messages import ParamValue
from executor.core.preflight import fence_changes, vehicle_checks
from executor.core.preflight.fence_changes import OnboardLists
from executor.core.preflight.parameter_changes import Answers, propose_return_changes
from executor.core.state.onboard_fence import fence_top_m
from missions import MissionItem, MissionKind
from missions.items import PlaceCommand
from tests.executor.builders import fleet_of
from tests.executor.core.preflight.test_vehicle_checks import said

RULE = FenceRules(True, 20.0, 10.0, "keep", "pad")
SHIPS = {name: fleet_of(autopilot=name) for name in ("ardupilot", "px4")}
OFF = {"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 0.0, "FENCE_TYPE": 7.0, "FENCE_ALT_MAX": 100.0, "FENCE_ACTION": 1.0}
PIXHAWK = {"GF_ACTION": 2.0, "GF_MAX_VER_DIST": 0.0}
TOP_M = 35.0
FENCE, RALLY = MissionKind.FENCE, MissionKind.RALLY
NOTHING: OnboardLists = {}


def context_of(autopilot: str = "ardupilot", **rule: object) -> Context:
    return replace(SHIPS[autopilot].context, fencing=replace(RULE, **rule))  # type: ignore[arg-type]


def present(**values: float) -> dict[str, ParamValue]:
    whole = ("FENCE_ENABLE", "FENCE_AUTOENABLE", "FENCE_TYPE", "FENCE_ACTION", "GF_ACTION")
    return {name: ParamValue(name, value, 6 if name in whole else 9) for name, value in values.items()}


def made(context: Context, **values: float) -> dict[str, float]:
    ends_m = fence_top_m(context, "uav1")
    found = {one.name: one.new for one in fence_changes.plan_fence_changes(context, "uav1", present(**values))}
    return {name: TOP_M if abs(value - ends_m) < 0.11 else value for name, value in found.items()}


def test_nothing_is_read_or_set_without_the_sites_word() -> None:
    for context in (SHIPS["px4"].context, context_of("px4", enabled=False)):
        assert fence_changes.list_fence_parameters(context, "uav1") == ()
        assert fence_changes.plan_fence_changes(context, "uav1", present(**PIXHAWK)) == []
        answered = {"uav1": Answers({}), "uav2": Answers({})}
        assert fence_changes.propose_changes(context, answered) == propose_return_changes(context, answered)


def test_what_a_fence_needs() -> None:
    assert made(context_of(), **OFF) == {"FENCE_TYPE": 5.0, "FENCE_ALT_MAX": TOP_M, "FENCE_ENABLE": 1.0}
    assert made(context_of("px4"), **PIXHAWK) == {"GF_MAX_VER_DIST": TOP_M}


@pytest.mark.parametrize(
    ("action", "ardupilot", "px4"),
    [("warn", 0.0, 1.0), ("hold", 4.0, None), ("return", None, 3.0), ("land", 2.0, 5.0)],
)
def test_what_a_vehicle_is_to_do_at_a_breach(action: str, ardupilot: float | None, px4: float | None) -> None:
    """None is what it does already."""
    assert made(context_of(action=action), **OFF).get("FENCE_ACTION") == ardupilot
    assert made(context_of("px4", action=action), **PIXHAWK).get("GF_ACTION") == px4


def test_the_limits_of_its_owner_stay() -> None:
    circle = {**OFF, "FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 22.0}
    assert made(context_of(), **circle) == {"FENCE_TYPE": 7.0}
    assert made(context_of("px4"), GF_ACTION=2.0, GF_MAX_VER_DIST=22.0) == {}
    assert made(context_of("px4"), GF_ACTION=2.0, GF_MAX_VER_DIST=400.0) == {"GF_MAX_VER_DIST": TOP_M}


def test_limits_of_its_owner_that_the_flight_breaks_stop_it() -> None:
    board = SHIPS["ardupilot"].boards["uav1"]
    assert board is not None
    facts = said(FENCE_ENABLE=1.0, FENCE_RADIUS=250.0)
    [found] = vehicle_checks.check_own_geofence(context_of(), facts, board.path)
    assert found.severity is Severity.STOP
    [found] = vehicle_checks.check_own_geofence(SHIPS["ardupilot"].context, facts, board.path)
    assert found.severity is Severity.WARNING


def told(context: Context, **values: float) -> list[tuple[Severity, str]]:
    there = present(**values)
    own = fence_changes.plan_fence_changes(context, "uav1", there)
    return [(one.severity, one.text) for one in fence_changes.check_fence_settings(context, "uav1", there, own)]


def test_what_the_checklist_says_of_it() -> None:
    [(severity, text)] = told(context_of(), **OFF)
    assert severity is Severity.OK
    assert text.startswith("fence 20 m around its legs and ")
    assert text.endswith(" m high; at a breach: RTL (FENCE_ACTION=1)")
    [(severity, text)] = told(context_of("px4", action="warn"), **PIXHAWK)
    assert (severity, text) == (Severity.WARNING, "does nothing when it breaches its fence (GF_ACTION=1)")
    [(severity, text)] = told(context_of("px4"), GF_ACTION=2.0)
    assert (severity, text) == (Severity.STOP, "cannot be given a fence: GF_MAX_VER_DIST does not answer")


def circle(radius_m: float, command: PlaceCommand = PlaceCommand.INCLUSION_CIRCLE) -> tuple[MissionItem, ...]:
    lat_deg, lon_deg = SHIPS["ardupilot"].context.frame.to_wgs84_deg(0.0, 0.0)
    return (MissionItem(0, 0, command, radius_m, x=round(1e7 * lat_deg), y=round(1e7 * lon_deg)),)


def found_on_board(
    context: Context, lists: OnboardLists, ours: OnboardLists = NOTHING, **values: float
) -> list[tuple[Severity, str]]:
    board = SHIPS["ardupilot"].boards["uav1"]
    assert board is not None
    facts = said(**{"FENCE_ENABLE": 1.0, **values})
    return [
        (one.severity, one.text) for one in fence_changes.check_onboard_lists(context, facts, board.path, lists, ours)
    ]


def test_a_fence_of_others_that_the_flight_leaves_stops_it() -> None:
    for context in (context_of(), context_of(enabled=False)):
        [(severity, text)] = found_on_board(context, {FENCE: circle(200.0), RALLY: ()})
        assert severity is Severity.STOP
        assert text.startswith("a fence of 1 item that is not ours is on board, and its flight or its RTL leaves it")
        [(severity, _)] = found_on_board(context, {FENCE: circle(40.0, PlaceCommand.EXCLUSION_CIRCLE), RALLY: ()})
        assert severity is Severity.STOP


def test_a_fence_of_others_that_holds_the_flight_or_is_off_is_reported() -> None:
    [(severity, text)] = found_on_board(context_of(), {FENCE: circle(2000.0), RALLY: ()})
    assert severity is Severity.OK
    assert text.endswith("and its flight fits into it; saved, and restored after the landing")
    for off in ({"FENCE_ENABLE": 0.0}, {"FENCE_TYPE": 3.0}):
        [(severity, text)] = found_on_board(context_of(), {FENCE: circle(200.0), RALLY: ()}, NOTHING, **off)
        assert (severity, text) == (Severity.OK, "a fence of 1 item that is not ours is on board, switched off")


def test_what_an_earlier_attempt_left_is_ours() -> None:
    assert found_on_board(context_of(), {FENCE: circle(10.0), RALLY: ()}, {FENCE: circle(10.0), RALLY: ()}) == []
    assert found_on_board(context_of(), {FENCE: (), RALLY: ()}) == []
    assert found_on_board(SHIPS["ardupilot"].context, NOTHING) == []


def test_an_unreadable_fence_stops_a_vehicle_that_needs_one() -> None:
    assert [one for one, _ in found_on_board(context_of(), NOTHING)] == [Severity.STOP, Severity.STOP]
    assert [one for one, _ in found_on_board(context_of(enabled=False), NOTHING)] == [Severity.WARNING] * 2


def test_rally_points_of_others_are_reported_where_they_stay() -> None:
    lat_deg, lon_deg = SHIPS["ardupilot"].context.frame.to_wgs84_deg(0.0, 500.0)
    far = (MissionItem(0, 3, PlaceCommand.RALLY_POINT, x=round(1e7 * lat_deg), y=round(1e7 * lon_deg)),)
    assert found_on_board(context_of(), {FENCE: (), RALLY: far}) == []
    [(severity, text)] = found_on_board(context_of(rally="keep"), {FENCE: (), RALLY: far})
    assert severity is Severity.WARNING
    assert text.startswith("1 rally point on board, up to 4")
    assert text.endswith(" m from its pad: its RTL may end there")
