"""What people do to a vehicle, and what its own failsafes do with it: as both autopilots were seen to answer."""

from __future__ import annotations

import math

import pytest

from simulator.config import AutopilotKind, SimFleet
from simulator.errors import FaultSpecError
from simulator.fault_kinds import parse_fault
from simulator.messages import MavCommand, Severity
from tests.simulator.harness import LAND, sim_vehicle
from tests.simulator.test_fleet_vehicle import KINDS, Flight

LOITERS = {AutopilotKind.ARDUPILOT: "LOITER", AutopilotKind.PX4: "POSCTL"}
DRIFTS = {AutopilotKind.ARDUPILOT: "ALT_HOLD", AutopilotKind.PX4: "ALTCTL"}
MISSIONS = {AutopilotKind.ARDUPILOT: "AUTO", AutopilotKind.PX4: "MISSION"}


def flying(kind: AutopilotKind, *faults: str) -> Flight:
    """Return a vehicle on its mission, with faults whose WHEN counts from there."""
    flight = Flight(kind, *faults)
    flight.start()
    return flight


def place(flight: Flight) -> tuple[float, float, float]:
    body = flight.vehicle.autopilot.frame.body
    return body.east_m, body.north_m, body.up_m


def texts(flight: Flight) -> list[str]:
    """Return what it said, parts put together."""
    said: list[str] = []
    for message in flight.heard("STATUSTEXT"):
        if message.chunk_seq:
            said[-1] += message.text
        else:
            said.append(message.text)
    return [text.rstrip("\t") for text in said]


def until_down(flight: Flight) -> None:
    flight.run_until(lambda: "disarmed" in flight.what())


@KINDS
def test_a_pilot_who_takes_over_holds_it_in_the_air_until_handing_it_back(kind: AutopilotKind) -> None:
    flight = flying(kind, f"uav1:pilot={LOITERS[kind]}@40s", f"uav1:pilot={MISSIONS[kind]}@100s")
    flight.run_until(lambda: f"pilot {LOITERS[kind]}" in flight.what())
    flight.run(10.0)
    before = place(flight)
    flight.run(40.0)
    assert math.dist(before, place(flight)) < 0.5
    assert before[2] > 15.0
    until_down(flight)
    # It goes on at its item, and comes home.
    assert flight.what()[-2:] == ["landed", "disarmed"]
    assert math.dist(place(flight), (0.0, 0.0, 0.0)) < 1.0


@KINDS
def test_a_mode_that_holds_the_height_alone_drifts_a_few_metres(kind: AutopilotKind) -> None:
    flight = flying(kind, f"uav1:pilot={DRIFTS[kind]}@40s")
    flight.run_until(lambda: f"pilot {DRIFTS[kind]}" in flight.what())
    flight.run(5.0)
    before = place(flight)
    flight.run(60.0)
    assert 1.0 < math.dist(before, place(flight)) < 8.0
    assert place(flight)[2] == pytest.approx(before[2], abs=1.0)


def test_sticks_take_a_px4_over_and_move_an_ardupilot_on_its_mission_not_at_all() -> None:
    px4, ardupilot = (flying(kind, "uav1:sticks@40s") for kind in (AutopilotKind.PX4, AutopilotKind.ARDUPILOT))
    for flight in (px4, ardupilot):
        flight.run_until(lambda flight=flight: "fault uav1:sticks@40s" in flight.what())  # type: ignore[misc]
        flight.run(2.0)
    assert "pilot POSCTL" in px4.what()
    assert "Pilot took over using sticks" in texts(px4)
    assert px4.vehicle.autopilot.mode == 3 << 16
    assert "pilot POSCTL" not in ardupilot.what()
    assert ardupilot.vehicle.autopilot.mode == 3


@KINDS
def test_another_station_orders_a_mode_and_its_heartbeat_is_heard(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:station=RTL@40s")
    flight.run_until(lambda: "station RTL" in flight.what())
    flight.run(5.0)
    [(order, sender)] = [(truth.what, truth.sender) for truth in flight.truths if truth.sender not in {None, 255}]
    assert order.startswith("order command 176 1 ")
    assert sender == 254
    beats = [beat for beat in flight.heard("HEARTBEAT") if beat.get_srcSystem() == 254]
    assert len(beats) in {5, 6}
    acknowledged = [ack for ack in flight.heard("COMMAND_ACK") if ack.target_system == 254]
    assert {ack.result for ack in acknowledged} == {0}
    until_down(flight)


@KINDS
def test_a_kill_switch_in_the_take_off_looks_like_a_landing(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:kill@2.5m")
    until_down(flight)
    flight.run(3.0)
    assert flight.what() == [
        "armed", "mission_started", "took_off", "fault uav1:kill@2.5m", "kill", "disarmed", "fell",
    ]  # fmt: skip
    assert flight.heard("HEARTBEAT", flight.when("disarmed"))[0].base_mode & 128 == 0
    assert math.dist(place(flight), (0.0, 0.0, 0.0)) < 1.0
    # Nothing on board speaks against arming it again: nobody but its crew knows better.
    assert flight.vehicle.autopilot.frame.crashed_s is None


@KINDS
def test_a_kill_switch_high_up_is_a_crash(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:kill@40s")
    flight.run_until(lambda: "crash" in flight.what())
    assert flight.what().index("disarmed") < flight.what().index("crash")


@KINDS
def test_the_sticks_do_not_disarm_a_vehicle_in_the_air(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:disarm@40s")
    flight.run_until(lambda: "fault uav1:disarm@40s" in flight.what())
    flight.run(5.0)
    assert flight.vehicle.autopilot.frame.armed


@KINDS
def test_a_wreck_lies_armed_in_its_mode_and_continues_talking(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:wreck@40s")
    flight.run_until(lambda: "wreck" in flight.what())
    mode, lies = flight.vehicle.autopilot.mode, place(flight)
    flight.run(120.0)
    assert place(flight) == lies
    assert math.dist(lies, (0.0, 0.0, 0.0)) > 20.0
    beat = flight.heard("HEARTBEAT")[-1]
    assert (beat.base_mode & 128, beat.custom_mode) == (128, mode)
    attitude = flight.vehicle.autopilot._builders["ATTITUDE"]()
    assert attitude is not None
    assert math.degrees(attitude.fields["roll"]) == pytest.approx(170.0)  # type: ignore[arg-type]
    position = flight.vehicle.autopilot._builders["GLOBAL_POSITION_INT"]()
    assert position is not None
    assert position.fields["relative_alt"] == 100


@KINDS
def test_a_wreck_that_restarted_as_it_fell_lies_disarmed(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:reboot@40s", "uav1:wreck@40s")
    flight.run_until(lambda: "wreck" in flight.what())
    flight.run(20.0)
    assert not flight.vehicle.autopilot.frame.armed
    assert not flight.heard("HEARTBEAT")[-1].base_mode & 128


@KINDS
def test_a_wreck_is_disarmed_by_force_alone(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:wreck@40s")
    flight.run_until(lambda: "wreck" in flight.what())
    flight.command(MavCommand.COMPONENT_ARM_DISARM, 0.0)
    flight.run(1.0)
    assert flight.vehicle.autopilot.frame.armed
    flight.command(MavCommand.COMPONENT_ARM_DISARM, 0.0, 21196.0)
    flight.run(1.0)
    assert not flight.vehicle.autopilot.frame.armed
    flight.command(MavCommand.COMPONENT_ARM_DISARM, 1.0)
    flight.run(1.0)
    assert not flight.vehicle.autopilot.frame.armed


def test_an_ardupilot_on_its_back_disarms_when_commanded_to_land() -> None:
    flight = flying(AutopilotKind.ARDUPILOT, "uav1:wreck@40s")
    flight.run_until(lambda: "wreck" in flight.what())
    flight.command(MavCommand.DO_SET_MODE, 1.0, LAND)
    flight.run(1.0)
    assert not flight.vehicle.autopilot.frame.armed


@KINDS
def test_one_that_loses_thrust_sinks_in_its_mode_and_lies_there_armed(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:weak=0.7@40s")
    flight.run_until(lambda: any("weak" in what for what in flight.what()))
    mode, body = flight.vehicle.autopilot.mode, flight.vehicle.autopilot.frame.body
    flight.run(4.0)
    assert body.v_up_m_s == pytest.approx(-3.3, abs=0.3)
    flight.run(120.0)
    beat = flight.heard("HEARTBEAT")[-1]
    assert (beat.base_mode & 128, beat.custom_mode, flight.what()[-1]) == (128, mode, "wreck")
    assert math.degrees(body.roll_rad) == pytest.approx(0.0)


@KINDS
def test_one_that_has_thrust_left_flies_on(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:weak=0.4@40s")
    flight.run_until(lambda: "landed" in flight.what())
    assert "wreck" not in flight.what()


@KINDS
def test_a_fence_is_reported_and_the_vehicle_returns(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:fence@40s")
    flight.run_until(lambda: "failsafe fence" in flight.what())
    flight.run(2.0)
    said = {message.text.rstrip("\t"): message.severity for message in flight.heard("STATUSTEXT")}
    if kind is AutopilotKind.ARDUPILOT:
        assert said["Circle fence breached"] == Severity.NOTICE
        assert flight.vehicle.autopilot._build("FENCE_STATUS").fields["breach_status"] == 1  # type: ignore[union-attr]
        assert flight.heard("HEARTBEAT")[-1].system_status == 4  # a fence is no failsafe to it
    else:
        assert said["Failsafe activated: switching to Return"] == Severity.CRITICAL
        assert flight.heard("HEARTBEAT")[-1].system_status == 5
    until_down(flight)
    assert math.dist(place(flight), (0.0, 0.0, 0.0)) < 1.0


def test_px4_holds_before_it_lands_with_an_empty_battery() -> None:
    flight = flying(AutopilotKind.PX4, "uav1:emergency@40s")
    flight.run_until(lambda: "failsafe battery" in flight.what())
    flight.run(2.0)
    assert texts(flight)[-2:] == ["Emergency battery level", "Failsafe activated: entering Hold for 5 seconds"]
    beat = flight.heard("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.system_status) == (4 << 16 | 3 << 24, 5)
    flight.run(5.0)
    assert flight.heard("HEARTBEAT")[-1].custom_mode == 4 << 16 | 6 << 24
    until_down(flight)
    assert math.dist(place(flight), (0.0, 0.0, 0.0)) > 5.0


def test_an_order_in_that_hold_takes_the_place_of_the_failsafe() -> None:
    """Measured: a return that was ordered then climbed to 90 m with 8 %."""
    flight = flying(AutopilotKind.PX4, "uav1:emergency@40s")
    flight.run_until(lambda: "failsafe battery" in flight.what())
    flight.run(1.0)
    flight.command(MavCommand.DO_SET_MODE, 1.0, 4.0, 5.0)
    flight.run(10.0)
    assert flight.heard("HEARTBEAT")[-1].custom_mode == 4 << 16 | 5 << 24


def test_ardupilot_lands_at_once_with_an_empty_battery() -> None:
    flight = flying(AutopilotKind.ARDUPILOT, "uav1:emergency@40s")
    flight.run_until(lambda: "failsafe battery" in flight.what())
    flight.run(1.5)
    assert texts(flight)[-1] == "Battery Failsafe"
    assert texts(flight)[-2].startswith("Battery 1 is critical ")
    beat = flight.heard("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.system_status) == (LAND, 5)


@KINDS
def test_without_an_estimate_it_lands_where_it_is(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:ekf@40s")
    flight.run_until(lambda: "failsafe ekf" in flight.what())
    flight.run(1.5)
    ardupilot = kind is AutopilotKind.ARDUPILOT
    assert any("EKF Failsafe" in text or "switching to Descend" in text for text in texts(flight))
    assert flight.heard("HEARTBEAT")[-1].system_status == (5 if ardupilot else 6)
    until_down(flight)
    assert math.dist(place(flight), (0.0, 0.0, 0.0)) > 5.0


@KINDS
def test_an_autopilot_that_is_started_again_stands_on_its_pad(kind: AutopilotKind) -> None:
    flight = flying(kind, "uav1:reboot=pad@40s")
    flight.run_until(lambda: "on_pad" in flight.what())
    flight.run(5.0)
    silent_from_s = flight.when("on_pad") + 0.5
    assert flight.heard("HEARTBEAT", silent_from_s) == []
    flight.run(6.0)
    assert flight.heard("HEARTBEAT", silent_from_s)[-1].base_mode & 128 == 0
    assert place(flight) == (0.0, 0.0, 0.0)
    assert len(flight.vehicle.autopilot.store.items) == len(flight.items)


@KINDS
def test_every_order_is_in_the_truth_with_its_sender_and_its_place(kind: AutopilotKind) -> None:
    flight = flying(kind)
    flight.run(30.0)
    orders = [truth for truth in flight.truths if truth.sender is not None]
    assert {truth.sender for truth in orders} == {255}
    assert f"order mission {len(flight.items)}" in [truth.what for truth in orders]
    assert any(truth.what.startswith("order command 300") for truth in orders)
    assert all(truth.lat_deg == pytest.approx(50.345749, abs=1e-6) for truth in orders)


@KINDS
def test_a_mode_that_the_autopilot_does_not_have_is_refused_before_the_flight(kind: AutopilotKind) -> None:
    other = {AutopilotKind.ARDUPILOT: "POSCTL", AutopilotKind.PX4: "STABILIZE"}[kind]
    for spec in (f"uav1:pilot={other}@1s", f"all:station={other}@1s"):
        with pytest.raises(FaultSpecError, match=f"uav1 has no mode {other}, expected one of "):
            SimFleet((sim_vehicle(kind),), faults=(parse_fault(spec),))


@KINDS
def test_home_is_where_it_is_armed(kind: AutopilotKind) -> None:
    flight = Flight(kind)
    autopilot = flight.vehicle.autopilot
    flight.run(10.0)
    home, body = autopilot.home, autopilot.frame.body
    before = home.lat_lon_e7(0.0, 0.0)
    elsewhere = home.lat_lon_e7(40.0, -30.0)
    body.east_m, body.north_m = 1.0, 0.5
    autopilot.arm()
    assert (autopilot.frame.armed, home.lat_lon_e7(0.0, 0.0)) == (True, before)  # beside its pad it is the pad
    autopilot.frame.disarm()
    body.east_m, body.north_m = 40.0, -30.0
    autopilot.arm()
    assert home.lat_lon_e7(0.0, 0.0) == elsewhere
    assert (body.east_m, body.north_m) == (0.0, 0.0)
