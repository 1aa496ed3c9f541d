"""Simulated fences and rally points: stored, dropped and kept to as the real autopilots were measured to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from missions.items import Frame, MissionItem, PlaceCommand
from simulator.ardupilot import FENCE_BIT
from simulator.config import AutopilotKind
from simulator.messages import (
    MavCommand,
    MissionAckReceived,
    MissionCount,
    MissionRequest,
    MissionRequestList,
    MissionWritePartialList,
    Outbound,
    ParamSet,
)
from tests.simulator.harness import (
    AUTO,
    BRAKE,
    LAND,
    PX4_LOITER,
    PX4_MISSION,
    PX4_RTL,
    RTL,
    Operator,
    fields_of,
    numbered,
    on_wire,
    place_e7,
    rtl,
    takeoff,
    waypoint,
)

ARDUPILOT, PX4 = AutopilotKind.ARDUPILOT, AutopilotKind.PX4
BOTH = pytest.mark.parametrize("kind", [ARDUPILOT, PX4], ids=lambda kind: str(kind.value))
FENCE, RALLY = 1, 2


def square(
    half_m: float, north_m: float = 0.0, command: PlaceCommand = PlaceCommand.INCLUSION_VERTEX
) -> tuple[MissionItem, ...]:
    corners = [(-half_m, -half_m), (-half_m, half_m), (half_m, half_m), (half_m, -half_m)]
    places = [place_e7(north_m + north, east) for north, east in corners]
    return numbered(MissionItem(0, Frame.GLOBAL, command, 4.0, x=x, y=y) for x, y in places)


def put(op: Operator, items: Sequence[MissionItem], kind: int = FENCE) -> int:
    answers = op.send(MissionCount(len(items), kind))
    while True:
        for answer in answers:
            fields = fields_of(answer)
            if answer.name == "MISSION_ACK":
                assert fields["mission_type"] == kind
                assert isinstance(fields["type"], int)
                return fields["type"]
        seq = next(fields_of(one)["seq"] for one in answers if one.name.startswith("MISSION_REQUEST"))
        assert isinstance(seq, int)
        answers = op.send(replace(on_wire(items[seq]), mission_type=kind))


def read(op: Operator, kind: int = FENCE) -> list[tuple[object, ...]]:
    [count] = [fields_of(one)["count"] for one in op.send(MissionRequestList(kind)) if one.name == "MISSION_COUNT"]
    assert isinstance(count, int)
    answers: list[Outbound] = [op.send(MissionRequest(seq, kind, integer=True))[0] for seq in range(count)]
    op.send(MissionAckReceived(0, kind))
    keys = ("command", "param1", "x", "y", "mission_type")
    return [tuple(fields_of(one)[key] for key in keys) for one in answers]


def meant(items: Sequence[MissionItem], kind: int = FENCE) -> list[tuple[object, ...]]:
    return [(one.command, one.param1, one.x, one.y, kind) for one in items]


def flying(kind: AutopilotKind, *, north_m: float = 150.0, **parameters: float) -> Operator:
    """Return a vehicle on its way north, 30 m high, inside a fence of 200 m."""
    given = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 5.0} if kind is ARDUPILOT else {"GF_ACTION": 3.0}
    op = Operator(kind, {"parameters": {**given, **parameters}})
    assert put(op, square(200.0)) == 0
    home = [waypoint(0.0, 0.0, 0.0)] if kind is ARDUPILOT else []
    op.fly(numbered([*home, takeoff(30.0), waypoint(north_m, 0.0, 30.0), rtl()]))
    op.run_until(lambda: op.vehicle.frame.body.north_m > 60.0)
    return op


@BOTH
def test_what_is_put_on_board_is_read_back_and_the_mission_is_another_list(kind: AutopilotKind) -> None:
    op = Operator(kind)
    x, y = place_e7(0.0, 20.0)
    rally = (MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, PlaceCommand.RALLY_POINT, x=x, y=y, z=3.7),)
    assert put(op, square(100.0)) == 0
    assert put(op, rally, RALLY) == 0
    assert read(op) == meant(square(100.0))
    assert read(op, RALLY) == meant(rally, RALLY)
    assert len(op.vehicle.store.items) == (1 if kind is ARDUPILOT else 0)
    assert put(op, ()) == 0
    assert read(op) == []
    assert read(op, RALLY) == meant(rally, RALLY)


@BOTH
def test_too_few_corners_are_refused_and_an_abandoned_upload_changes_nothing(kind: AutopilotKind) -> None:
    op = Operator(kind)
    assert put(op, square(100.0)) == 0
    two = tuple(replace(item, param1=2.0) for item in square(50.0)[:2])
    assert put(op, two) == 1
    op.send(MissionCount(4, FENCE))
    op.send(replace(on_wire(square(50.0)[0]), mission_type=FENCE))
    op.run(12.0)
    assert read(op) == meant(square(100.0))


def test_a_part_of_a_fence_is_replaced_and_the_rest_stays() -> None:
    op = Operator(ARDUPILOT)
    assert put(op, square(100.0)) == 0
    corner = square(120.0)[1]
    op.send(MissionWritePartialList(1, 1, FENCE))
    op.send(replace(on_wire(corner), mission_type=FENCE))
    assert read(op) == meant((square(100.0)[0], corner, *square(100.0)[2:]))


def test_px4_does_not_know_parts() -> None:
    assert Operator(AutopilotKind.PX4).send(MissionWritePartialList(0, 0, FENCE)) == []


def test_what_ardupilot_has_no_room_for() -> None:
    op = Operator(ARDUPILOT)
    assert put(op, square(10.0) * 20) == 4
    assert "Only 70 items are supported" in op.texts()


def test_a_station_switches_ardupilots_fence_on_and_off() -> None:
    op = Operator(ARDUPILOT, {"parameters": {"FENCE_TYPE": 4.0}})
    op.run(60.0)
    assert op.command(MavCommand.DO_FENCE_ENABLE, 1) == 4, "it has no polygon"
    assert put(op, square(100.0)) == 0
    assert op.command(MavCommand.DO_FENCE_ENABLE, 1) == 0
    assert op.telemetry("SYS_STATUS", 1)["onboard_control_sensors_enabled"] & FENCE_BIT  # type: ignore[operator]
    op.vehicle.params["FENCE_ENABLE"] = 1.0
    assert op.command(MavCommand.DO_FENCE_ENABLE, 0) == 0
    assert not op.telemetry("SYS_STATUS", 1)["onboard_control_sensors_enabled"] & FENCE_BIT  # type: ignore[operator]
    assert op.command(MavCommand.DO_FENCE_ENABLE, 7) == 4


def mode_of(op: Operator) -> int:
    return int(op.vehicle.mode)


@pytest.mark.parametrize(("action", "mode"), [(0, AUTO), (1, RTL), (2, LAND), (4, BRAKE)])
def test_ardupilot_outside_its_polygon_does_as_it_is_set_to(action: int, mode: int) -> None:
    op = flying(ARDUPILOT, FENCE_ACTION=float(action))
    op.run(1.0)
    assert put(op, square(20.0)) == 0
    op.run(1.0)
    assert mode_of(op) == mode
    assert "Polygon fence breached" in op.texts()
    assert fields_of(op.vehicle._build("FENCE_STATUS"))["breach_status"] == 1  # type: ignore[arg-type]
    status = fields_of(op.vehicle._build("SYS_STATUS"))  # type: ignore[arg-type]
    assert int(status["onboard_control_sensors_enabled"]) & 1 << 20  # type: ignore[arg-type]
    assert not int(status["onboard_control_sensors_health"]) & 1 << 20  # type: ignore[arg-type]


def test_ardupilot_far_outside_lands_whatever_it_is_set_to() -> None:
    op = flying(ARDUPILOT)
    op.run_until(lambda: op.vehicle.frame.body.north_m > 130.0)
    assert put(op, square(20.0)) == 0
    op.run(1.0)
    assert mode_of(op) == LAND


def test_ardupilot_says_when_it_is_inside_again() -> None:
    op = flying(ARDUPILOT)
    assert put(op, square(20.0)) == 0
    op.run_until(lambda: "Fence breach cleared" in op.texts())
    assert abs(op.vehicle.frame.body.north_m) < 21.0


def test_px4_drops_a_fence_that_it_is_not_in_itself_and_says_so_alone() -> None:
    op = flying(PX4)
    assert put(op, square(20.0)) == 0
    op.run(1.0)
    assert "Geofence invalid, doesn't contain current vehicle position" in "".join(op.texts())
    assert mode_of(op) == PX4_MISSION
    assert put(op, square(20.0, north_m=500.0)) == 0
    assert "Geofence invalid, doesn't contain Home position" in "".join(op.texts())


def test_px4_holds_its_mission_against_a_fence_that_comes_later() -> None:
    op = flying(PX4)
    assert put(op, square(100.0)) == 0
    op.run(1.0)
    assert any("Geofence violation for waypoint 2" in text for text in op.texts())
    assert mode_of(op) == PX4_LOITER


def test_px4_holds_a_mission_against_the_fence_on_board() -> None:
    op = flying(PX4)
    assert op.upload(numbered([takeoff(30.0), waypoint(400.0, 0.0, 30.0), rtl()])) == 0
    op.run(1.0)
    assert mode_of(op) == PX4_LOITER
    assert put(op, square(500.0)) == 0
    assert op.mode(PX4_MISSION) == 0
    op.run(1.0)
    assert mode_of(op) == PX4_MISSION


@pytest.mark.parametrize(("action", "first", "then"), [(2, PX4_LOITER, PX4_LOITER), (3, PX4_LOITER, PX4_RTL)])
def test_px4_above_its_fence_holds_first(action: int, first: int, then: int) -> None:
    op = flying(PX4, GF_ACTION=float(action))
    op.send(ParamSet("GF_MAX_VER_DIST", 20.0, 9))
    op.run(1.0)
    assert any("Geofence: exceeding maximum altitude above Home" in text for text in op.texts())
    assert mode_of(op) == first
    op.run(6.0)
    assert mode_of(op) == then


@BOTH
def test_its_own_rtl_ends_at_the_nearest_rally_point(kind: AutopilotKind) -> None:
    op = flying(kind)
    x, y = place_e7(60.0, 25.0)
    rally = (MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, PlaceCommand.RALLY_POINT, x=x, y=y),)
    assert put(op, rally, RALLY) == 0
    assert op.mode(RTL if kind is ARDUPILOT else PX4_RTL) == 0
    op.run_until(lambda: not op.vehicle.frame.armed)
    body = op.vehicle.frame.body
    assert (body.north_m, body.east_m) == pytest.approx((60.0, 25.0), abs=1.5)
