"""A simulated vehicle behind its link: every fault to order, and what really happened."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from missions.items import MissionItem
from simulator.autopilot import BOOT_S
from simulator.config import AutopilotKind
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle
from simulator.truth import Truth
from tests.simulator.harness import is_happening, numbered, rtl, sim_vehicle, speed, takeoff, waypoint

ROUTE = (takeoff(20.0), speed(5.0), waypoint(100, 0, 20.0), waypoint(100, 100, 20.0), rtl())
KINDS = pytest.mark.parametrize("kind", list(AutopilotKind))


class Flight:
    """A vehicle on the wire and a ground station that flies it, in simulated time."""

    def __init__(self, kind: AutopilotKind, *faults: str, **changes: object) -> None:
        self.kind = kind
        self.vehicle = SimulatedVehicle(sim_vehicle(kind, **changes), [parse_fault(fault) for fault in faults])
        self._mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._mav.robust_parsing = True
        self.log: list[tuple[float, Any]] = []
        self.truths: list[Truth] = []
        self.events: list[tuple[float, str]] = []
        self.items: Sequence[MissionItem] = []
        self._beat_s = 0.0

    def send(self, message: Any) -> None:
        self.vehicle.receive(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256

    def command(self, number: int, *params: float) -> None:
        self.send(dialect.MAVLink_command_long_message(11, 1, number, 0, *params, *(0.0,) * (7 - len(params))))

    def run(self, seconds: float) -> None:
        until_s = self.vehicle.now_s + seconds
        while self.vehicle.now_s < until_s - 1e-6:
            if self.vehicle.now_s >= self._beat_s:
                self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                self._beat_s = self.vehicle.now_s + 1.0
            self.vehicle.advance(self.vehicle.now_s + 0.05)
            self._listen()

    def run_until(self, good: Callable[[], bool], limit_s: float = 400.0) -> None:
        began_s = self.vehicle.now_s
        while not good():
            assert self.vehicle.now_s - began_s < limit_s
            self.run(0.05)

    def upload(self, patience_s: float = 12.0) -> int | None:
        """Upload the route and return the final ACK's type, or None when there is none."""
        items = (waypoint(0, 0, 0.0), *ROUTE) if self.kind is AutopilotKind.ARDUPILOT else ROUTE
        self.items = numbered(items, 0)
        began_s = self.vehicle.now_s
        while self.vehicle.now_s - began_s < patience_s:
            if not any(message.get_type().startswith("MISSION_REQ") for at_s, message in self.log if at_s >= began_s):
                # Until the vehicle asks, the count may have been lost.
                self.send(dialect.MAVLink_mission_count_message(11, 1, len(self.items)))
                self.run(0.95)
            self.run(0.05)
            final = [ack for ack in self.heard("MISSION_ACK", began_s) if ack.type != 13]
            if final:
                return int(final[0].type)
        return None

    def start(self) -> None:
        self.run(4)
        assert self.upload() == 0
        self.run(1)
        if self.kind is AutopilotKind.ARDUPILOT:
            self.command(176, 1, 4)
            self.command(400, 1)
        self.command(300)
        self.run(0.1)

    def heard(self, name: str, since_s: float = -1.0) -> list[Any]:
        return [message for at_s, message in self.log if at_s >= since_s and message.get_type() == name]

    def what(self) -> list[str]:
        return [what for _, what in self.events]

    def when(self, what: str) -> float:
        return next(at_s for at_s, event in self.events if event == what)

    def _listen(self) -> None:
        for datagram in self.vehicle.drain():
            for message in self._mav.parse_buffer(datagram) or []:
                self.log.append((self.vehicle.now_s, message))
                if message.get_type().startswith("MISSION_REQUEST"):
                    self._answer(self.items[message.seq])
        truths = self.vehicle.drain_truths(lambda at_s: at_s)
        self.truths += truths
        self.events += [(truth.t_s, truth.what) for truth in truths if is_happening(truth)]

    def _answer(self, item: MissionItem) -> None:
        params = (item.param1, item.param2, item.param3, item.param4)
        self.send(
            dialect.MAVLink_mission_item_int_message(
                11, 1, item.seq, item.frame, item.command, int(item.current), 1, *params, item.x, item.y, item.z
            )
        )


@KINDS
def test_a_whole_flight_and_its_truths(kind: AutopilotKind) -> None:
    flight = Flight(kind)
    flight.start()
    flight.run_until(lambda: "disarmed" in flight.what())
    assert flight.what() == ["armed", "mission_started", "took_off", "descends", "landed", "disarmed"]
    share = flight.vehicle.autopilot.flown_share
    assert share is not None
    assert share == pytest.approx(1.0, abs=0.25)  # PX4 climbs to its return height, which is not in the list


@KINDS
def test_silent_for_good_cuts_both_ways_and_the_vehicle_returns_by_its_failsafe(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:silent@40%")
    flight.start()
    flight.run_until(lambda: "fault uav1:silent@40%" in flight.what())
    share = flight.vehicle.autopilot.flown_share
    assert share is not None
    assert share == pytest.approx(0.4, abs=0.01)
    silent_s = flight.vehicle.now_s
    flight.run_until(lambda: "disarmed" in flight.what())
    assert [at_s for at_s, _ in flight.log if at_s > silent_s] == []
    body = flight.vehicle.autopilot.frame.body
    assert math.hypot(body.east_m, body.north_m) < 0.5


@KINDS
def test_silent_for_a_while_comes_back(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:silent=20s@15s")
    flight.start()
    flight.run(60)
    began_s = flight.when("fault uav1:silent=20s@15s")
    assert began_s == pytest.approx(flight.when("mission_started") + 15, abs=0.1)
    heartbeats = [at_s for at_s, message in flight.log if message.get_type() == "HEARTBEAT"]
    assert not [at_s for at_s in heartbeats if began_s + 0.1 < at_s < began_s + 19.9]
    assert [at_s for at_s in heartbeats if began_s + 20 <= at_s < began_s + 21.1]


@KINDS
def test_battery_step_and_drain(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:battery-step=30@10s", "uav1:drain=3@20s")
    flight.start()
    battery = flight.vehicle.autopilot.frame.battery
    flight.run_until(lambda: len([what for what in flight.what() if "battery-step" in what]) == 1)
    assert 65 < battery.charge_pct < 70
    flight.run_until(lambda: len([what for what in flight.what() if "drain" in what]) == 1)
    before_a = battery.current_a
    flight.run(0.1)
    assert battery.current_a == pytest.approx(3 * before_a, rel=0.15)


@KINDS
def test_a_crash_falls_says_disarmed_for_two_seconds_and_is_silent(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:crash@40%")
    flight.start()
    flight.run_until(lambda: "crash" in flight.what())
    assert flight.when("crash") - flight.when("fault uav1:crash@40%") == pytest.approx(
        math.sqrt(2 * 20 / 9.81), abs=0.3
    )
    crash_s = flight.when("crash")
    flight.run(10)
    last = [(at_s, message) for at_s, message in flight.log if at_s > crash_s + 0.1]
    assert {message.get_type() for _, message in last} == {"HEARTBEAT"}
    assert all(message.base_mode & 128 == 0 for _, message in last)
    assert crash_s + 1 < last[-1][0] <= crash_s + 2.1
    flight.command(400, 1)
    flight.run(5)
    assert not flight.vehicle.autopilot.frame.armed


@KINDS
def test_a_reboot_in_the_air_is_a_crash(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:reboot@20s")
    flight.start()
    flight.run(60)
    assert "crash" in flight.what()
    fault_s = flight.when("fault uav1:reboot@20s")
    assert not [at_s for at_s, _ in flight.log if at_s > fault_s + 0.1]


@KINDS
def test_a_crash_of_a_destroyed_vehicle_brings_no_message_back(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:reboot@20s", "uav1:crash@40s")
    flight.start()
    flight.run(60)
    assert "fault uav1:crash@40s" in flight.what()
    assert flight.what().count("crash") == 1
    assert not [at_s for at_s, _ in flight.log if at_s > flight.when("fault uav1:reboot@20s") + 0.1]


@KINDS
def test_a_reboot_on_the_ground_is_five_silent_seconds_and_a_new_clock(kind: AutopilotKind) -> None:
    flight = Flight(kind, charge_pct=70.0)
    flight.run(20)
    assert flight.upload() == 0
    flight.command(512, 1)
    flight.run(0.2)
    assert flight.heard("SYS_STATUS")[-1].battery_remaining in {69, 70}
    flight.command(246, 1)
    rebooted_s = flight.vehicle.now_s
    flight.run(BOOT_S - 0.2)
    assert not [at_s for at_s, _ in flight.log if at_s > rebooted_s + 0.2]
    flight.run(5)
    flight.command(512, 33)
    flight.command(512, 1)
    flight.run(0.2)
    assert flight.heard("GLOBAL_POSITION_INT")[-1].time_boot_ms < 6000
    # ArduPilot's coulomb counter begins at 100 % again, whatever the pack holds.
    percent = flight.heard("SYS_STATUS")[-1].battery_remaining
    assert percent == (100 if kind is AutopilotKind.ARDUPILOT else 70)
    assert len(flight.vehicle.autopilot.store.items) == len(ROUTE) + (kind is AutopilotKind.ARDUPILOT)


def test_ardupilot_must_be_asked_for_telemetry_again_after_a_reboot() -> None:
    flight = Flight(AutopilotKind.ARDUPILOT)
    flight.command(511, 33, 250_000)
    flight.run(2)
    assert flight.heard("GLOBAL_POSITION_INT")
    flight.command(246, 1)
    flight.run(20)
    assert not flight.heard("GLOBAL_POSITION_INT", 3.0)
    assert flight.heard("HEARTBEAT", 10.0)


@pytest.mark.parametrize(("kind", "result"), [(AutopilotKind.ARDUPILOT, 14), (AutopilotKind.PX4, 1)])
def test_refuse_upload(kind: AutopilotKind, result: int) -> None:
    flight = Flight(kind, "uav1:refuse-upload@0s")
    flight.run(4)
    assert flight.upload() == result


@KINDS
def test_refuse_upload_later_lets_the_first_one_pass(kind: AutopilotKind) -> None:
    flight = Flight(kind, "uav1:refuse-upload@5s")
    flight.start()
    flight.run(6)
    assert flight.upload() != 0


@pytest.mark.parametrize(("kind", "result"), [(AutopilotKind.ARDUPILOT, 15), (AutopilotKind.PX4, None)])
def test_half_upload_stops_asking(kind: AutopilotKind, result: int | None) -> None:
    flight = Flight(kind, "uav1:half-upload@0s")
    flight.run(4)
    began_s = flight.vehicle.now_s
    assert flight.upload() == result
    asked = {message.seq for at_s, message in flight.log if message.get_type().startswith("MISSION_REQUEST")}
    assert asked == set(range(len(flight.items) // 2))
    assert flight.vehicle.now_s - began_s > 7


@KINDS
@pytest.mark.parametrize("fault", ["loss=0.2", "delay=0.3", "duplicate=0.3", "reorder=0.3", "rate=4000"])
def test_an_upload_gets_through_a_bad_link(kind: AutopilotKind, fault: str) -> None:
    flight = Flight(kind, f"all:{fault}@0s", seed=5)
    flight.run(4)
    assert flight.upload(patience_s=30) in {0, None}  # the final ACK itself may be lost
    assert [item.seq for item in flight.vehicle.autopilot.store.items] == [item.seq for item in flight.items]


@KINDS
def test_delay_is_there_each_way(kind: AutopilotKind) -> None:
    flight = Flight(kind, "all:delay=0.3@0s")
    flight.run(1)
    sent_s = flight.vehicle.now_s
    flight.command(520, 1)
    flight.run_until(lambda: bool(flight.heard("AUTOPILOT_VERSION", sent_s)))
    assert flight.vehicle.now_s - sent_s == pytest.approx(0.6, abs=0.11)


@KINDS
def test_a_seed_repeats_a_flight_exactly(kind: AutopilotKind) -> None:
    logs = []
    for _ in range(2):
        flight = Flight(kind, "all:loss=0.2@0s", seed=7)
        flight.run(30)
        logs.append([(at_s, bytes(message.get_msgbuf())) for at_s, message in flight.log])
    assert logs[0] == logs[1]


@KINDS
def test_positions_on_the_wire_never_jump(kind: AutopilotKind) -> None:
    flight = Flight(kind)
    flight.command(511, 33, 200_000)
    flight.start()
    flight.command(511, 33, 200_000)
    flight.run_until(lambda: "disarmed" in flight.what())
    places = [
        (message.time_boot_ms, message.lat, message.lon, message.relative_alt)
        for message in flight.heard("GLOBAL_POSITION_INT")
    ]
    assert len(places) > 300
    for (t0, lat0, lon0, up0), (t1, lat1, lon1, up1) in pairwise(places):
        seconds = (t1 - t0) / 1000
        north_m, east_m = (lat1 - lat0) * 0.01113, (lon1 - lon0) * 0.0071
        assert math.hypot(north_m, east_m, (up1 - up0) / 1000) <= 12 * seconds + 0.05


@KINDS
def test_damaged_datagrams_do_no_harm(kind: AutopilotKind) -> None:
    flight = Flight(kind)
    flight.run(1)
    good = dialect.MAVLink_command_long_message(11, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0).pack(flight._mav)
    for garbage in (b"", b"\x00\x01\x02", good[:-3], good[:5], b"\xfd" * 40, good[:-1] + b"\x00"):
        flight.vehicle.receive(garbage)
    flight.run(0.1)
    assert not flight.heard("AUTOPILOT_VERSION")
    flight.vehicle.receive(good)
    flight.run(0.1)
    assert flight.heard("AUTOPILOT_VERSION")


def test_what_is_meant_for_others_is_not_heard() -> None:
    flight = Flight(AutopilotKind.PX4)
    flight.send(dialect.MAVLink_command_long_message(12, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    flight.send(dialect.MAVLink_command_long_message(11, 100, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    flight.run(1)
    assert not flight.heard("AUTOPILOT_VERSION")
