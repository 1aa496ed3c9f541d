"""Places, circles and set-points without a mission, and what the vehicle reports of them when asked."""

from __future__ import annotations

import math

import pytest

from simulator import messages
from simulator.config import AutopilotKind
from simulator.messages import MavCommand, SetPoint
from simulator.physics import GRAVITY_M_S2
from simulator.streams import MESSAGE_IDS
from tests.simulator.harness import ALT_M, GUIDED, Operator, fields_of, place_e7

UP_M = 10.0
SPEED_ALONE, PLACE_ALONE = 0b110111000111, 0b110111111000
OFFBOARD = 6 << 16


def flying(kind: AutopilotKind) -> Operator:
    op = Operator(kind)
    op.run(5)
    if kind is AutopilotKind.ARDUPILOT:
        op.mode(GUIDED)
    op.arm()
    op.command(MavCommand.NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, UP_M + (0.0 if kind is AutopilotKind.ARDUPILOT else ALT_M))
    op.run_until(lambda: op.vehicle.frame.body.up_m > UP_M - 0.5)
    op.run(3)
    return op


def place(op: Operator, number: int, north_m: float, east_m: float, *params: float, frame: int = 0) -> object:
    one, two, three, four = (*params, *(0.0,) * 4)[:4]
    x, y = place_e7(north_m, east_m)
    command = messages.Command(number, (one, two, three, four, x, y, ALT_M + UP_M), frame)
    [answer] = [one for one in op.send(command) if one.name == "COMMAND_ACK"]
    return fields_of(answer)["result"]


def point(mask: int, north_m_s: float = 0.0, north_m: float = 0.0) -> SetPoint:
    x, y = place_e7(north_m, 0.0)
    return SetPoint(6, mask, (x, y, UP_M), (north_m_s, 0.0, 0.0), local=False)


def ask(op: Operator, name: str) -> dict[str, float]:
    answers = op.send(messages.Command(MavCommand.REQUEST_MESSAGE, (MESSAGE_IDS[name], 0, 0, 0, 0, 0, 0)))
    [fields] = [fields_of(one) for one in answers if one.name == name]
    return dict(fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_it_flies_to_a_place_and_stays_there(kind: AutopilotKind) -> None:
    op = flying(kind)
    assert place(op, MavCommand.DO_REPOSITION, 60, 20, -1, 1) == messages.Result.ACCEPTED
    op.run(1)
    assert ask(op, "POSITION_TARGET_LOCAL_NED")["x"] == pytest.approx(60, abs=0.1)
    op.run(40)
    body = op.vehicle.frame.body
    assert (body.north_m, body.east_m, body.up_m) == pytest.approx((60, 20, UP_M), abs=0.7)


def test_ardupilot_refuses_a_place_outside_its_fence_and_one_that_is_nowhere() -> None:
    op = flying(AutopilotKind.ARDUPILOT)
    op.vehicle.params["FENCE_ENABLE"] = 1.0
    assert place(op, MavCommand.DO_REPOSITION, 900, 0, -1, 1) == messages.Result.FAILED
    assert place(op, MavCommand.DO_REPOSITION, 60, 0, -1, 1, frame=99) == messages.Result.DENIED


def test_ardupilots_fence_is_switched_by_command_too() -> None:
    op = flying(AutopilotKind.ARDUPILOT)
    assert op.command(MavCommand.DO_FENCE_ENABLE, 1) == messages.Result.ACCEPTED
    assert place(op, MavCommand.DO_REPOSITION, 900, 0, -1, 1) == messages.Result.FAILED
    assert op.command(MavCommand.DO_FENCE_ENABLE, 0, 2) == messages.Result.ACCEPTED
    assert place(op, MavCommand.DO_REPOSITION, 900, 0, -1, 1) == messages.Result.ACCEPTED, "the circle is off"
    assert op.command(MavCommand.DO_FENCE_ENABLE, 3) == messages.Result.FAILED


def test_px4_says_that_a_place_is_outside_its_fence_and_stays() -> None:
    op = flying(AutopilotKind.PX4)
    op.vehicle.params["GF_MAX_HOR_DIST"] = 100.0
    place(op, MavCommand.DO_REPOSITION, 900, 0, -1, 1)
    op.run(5)
    assert "Reposition is outside geofence\t" in op.texts()
    assert op.vehicle.frame.body.north_m < 1.0


@pytest.mark.parametrize("radius_m", [20.0, -20.0])
def test_px4_circles_with_its_nose_to_the_middle(radius_m: float) -> None:
    op = flying(AutopilotKind.PX4)
    place(op, MavCommand.DO_ORBIT, 40, 0, radius_m, 3.0)
    op.run(25)
    body = op.vehicle.frame.body
    east, north = body.east_m, body.north_m - 40
    assert math.hypot(east, north) == pytest.approx(20, abs=1.0)
    assert body.ground_speed_m_s == pytest.approx(3.0, abs=0.3)
    turning = math.copysign(1.0, east * -body.v_north_m_s + north * body.v_east_m_s)
    assert turning == math.copysign(1.0, radius_m), "clockwise where the radius is above 0"
    assert math.remainder(body.yaw_rad - math.atan2(-east, -north), 2 * math.pi) == pytest.approx(0, abs=0.2)
    assert ask(op, "ORBIT_EXECUTION_STATUS")["radius"] == radius_m


def test_ardupilot_flies_at_a_speed_for_as_long_as_set_points_come() -> None:
    op = flying(AutopilotKind.ARDUPILOT)
    for _ in range(4):
        op.send(point(SPEED_ALONE, 3.0))
        op.run(1)
    assert op.vehicle.frame.body.v_north_m_s == pytest.approx(3.0, abs=0.1)
    op.run(7)
    assert op.vehicle.frame.body.ground_speed_m_s < 0.1


def test_px4_takes_set_points_in_their_mode_and_returns_without_them() -> None:
    op = flying(AutopilotKind.PX4)
    assert op.mode(OFFBOARD) == messages.Result.TEMPORARILY_REJECTED
    op.send(point(PLACE_ALONE, north_m=30.0))
    assert op.mode(OFFBOARD) == messages.Result.ACCEPTED
    for _ in range(40):
        op.send(point(PLACE_ALONE, north_m=30.0))
        op.run(0.5)
    assert op.vehicle.frame.body.north_m == pytest.approx(30.0, abs=0.7)
    op.run(3)
    assert op.vehicle.mode == 4 << 16 | 5 << 24


def test_px4_loses_a_motor_and_gps_to_order() -> None:
    op = flying(AutopilotKind.PX4)
    assert op.command(MavCommand.INJECT_FAILURE, 4, 1, 0) == messages.Result.ACCEPTED
    op.run(1)
    assert op.vehicle.gps_fix == 1
    assert op.command(MavCommand.INJECT_FAILURE, 4, 0, 0) == messages.Result.ACCEPTED
    op.run(1)
    assert op.vehicle.gps_fix == 3
    assert op.command(MavCommand.INJECT_FAILURE, 101, 1, 1) == messages.Result.ACCEPTED
    op.run_until(lambda: op.vehicle.frame.wrecked)


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_sensors_say_what_the_body_does(kind: AutopilotKind) -> None:
    op = Operator(kind)
    op.run(5)
    still = ask(op, "HIGHRES_IMU")
    assert (still["xacc"], still["yacc"], still["zacc"]) == pytest.approx((0.0, 0.0, -GRAVITY_M_S2), abs=1e-6)
    assert still["abs_pressure"] == pytest.approx(977.7, abs=0.1)
    assert ask(op, "SERVO_OUTPUT_RAW")["servo1_raw"] == 1000
    op = flying(kind)
    assert ask(op, "SERVO_OUTPUT_RAW")["servo1_raw"] == pytest.approx(1500, abs=20), "it hovers at half of its thrust"
    place(op, MavCommand.DO_REPOSITION, 80, 80, -1, 1)
    op.run(6)
    body = op.vehicle.frame.body
    q = ask(op, "ATTITUDE_QUATERNION")
    w, x, y, z = (q[f"q{at}"] for at in range(1, 5))
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(body.yaw_rad)
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(body.pitch_rad)
    assert ask(op, "NAV_CONTROLLER_OUTPUT")["wp_dist"] > 0
