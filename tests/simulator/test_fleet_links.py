"""A simulated vehicle with two links: what goes over which of them, as both autopilots do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from missions.items import MissionItem
from simulator.config import AutopilotKind, SimFleet
from simulator.errors import FaultSpecError
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle, build_vehicles
from tests.simulator.harness import numbered, rtl, sim_vehicle, takeoff, waypoint

CONNECTIONS = ("udpin://127.0.0.1:20001", "udpin://127.0.0.1:20002")
KINDS = pytest.mark.parametrize("kind", list(AutopilotKind))
ARDUPILOT, PX4 = AutopilotKind.ARDUPILOT, AutopilotKind.PX4
ITEMS = numbered((takeoff(), waypoint(50, 0), waypoint(50, 50), rtl()))


class Station:
    """A ground station before both links."""

    def __init__(self, kind: AutopilotKind, *faults: str) -> None:
        self.vehicle = SimulatedVehicle(
            sim_vehicle(kind, connection=CONNECTIONS, ready_after_s=0.5), [parse_fault(fault) for fault in faults]
        )
        self.heard: tuple[list[Any], list[Any]] = ([], [])
        self._senders = tuple(dialect.MAVLink(None, srcSystem=255, srcComponent=190) for _ in CONNECTIONS)
        self._parsers = tuple(dialect.MAVLink(None) for _ in CONNECTIONS)

    def send(self, link: int, message: Any) -> None:
        self.vehicle.receive(message.pack(self._senders[link]), link)

    def command(self, link: int, number: int, *params: float) -> None:
        filled = (*params, *(0.0,) * (7 - len(params)))
        self.send(link, dialect.MAVLink_command_long_message(11, 1, number, 0, *filled))

    def item(self, link: int, item: MissionItem) -> None:
        self.send(
            link,
            dialect.MAVLink_mission_item_int_message(
                11, 1, item.seq, item.frame, item.command, 0, 1, item.param1, 0, 0, 0, item.x, item.y, item.z
            ),
        )

    def count(self, link: int, count: int = len(ITEMS)) -> None:
        self.send(link, dialect.MAVLink_mission_count_message(11, 1, count))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.vehicle.advance(self.vehicle.now_s + 0.05)
            for link, (parser, heard) in enumerate(zip(self._parsers, self.heard, strict=True)):
                for datagram in self.vehicle.drain(link):
                    heard += parser.parse_buffer(datagram) or ()

    def of(self, link: int, name: str) -> Sequence[Any]:
        return [message for message in self.heard[link] if message.get_type() == name]

    def requests(self, link: int) -> list[int]:
        names = {"MISSION_REQUEST", "MISSION_REQUEST_INT"}
        return [message.seq for message in self.heard[link] if message.get_type() in names]


@KINDS
def test_each_link_numbers_its_own_frames_and_has_its_own_streams(kind: AutopilotKind) -> None:
    station = Station(kind)
    station.command(1, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 33, 100_000)
    station.run(5.0)
    assert len(station.of(1, "GLOBAL_POSITION_INT")) >= 48
    assert len(station.of(0, "GLOBAL_POSITION_INT")) <= 21
    for heard in station.heard:
        numbers = [message.get_seq() for message in heard]
        assert numbers == [number % 256 for number in range(len(numbers))]


@KINDS
def test_texts_go_to_all_and_answers_where_it_was_asked(kind: AutopilotKind) -> None:
    station = Station(kind)
    station.send(1, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    station.run(2.0)
    station.command(1, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    station.send(0, dialect.MAVLink_param_request_read_message(11, 1, b"NAV_DLL_ACT", -1))
    station.send(0, dialect.MAVLink_param_request_read_message(11, 1, b"FS_GCS_ENABLE", -1))
    station.run(1.0)
    assert len(station.of(0, "STATUSTEXT")) == len(station.of(1, "STATUSTEXT")) > 0
    assert [len(station.of(link, "COMMAND_ACK")) for link in (0, 1)] == ([0, 1] if kind is ARDUPILOT else [1, 1])
    assert [len(station.of(link, "PARAM_VALUE")) for link in (0, 1)] == [1, 0]


def test_ardupilot_takes_items_from_any_link_and_asks_where_they_were_announced() -> None:
    station = Station(ARDUPILOT)
    station.count(0)
    station.item(0, ITEMS[0])
    station.item(1, ITEMS[1])
    station.run(0.5)
    assert station.requests(0) == [0, 1, 2]
    assert station.requests(1) == []
    station.count(1)
    for item in ITEMS:
        station.item(1, item)
    station.run(0.5)
    assert station.requests(1) == [0, 1, 2, 3]
    assert [ack.type for ack in station.of(1, "MISSION_ACK")] == [0]
    assert station.of(0, "MISSION_ACK") == []


def test_px4_takes_no_mission_over_another_link_for_five_seconds() -> None:
    station = Station(PX4)
    station.count(0)
    station.item(0, ITEMS[0])
    for _ in range(9):
        station.count(1)
        station.run(0.5)
    assert station.requests(1) == []
    assert {ack.type for ack in station.of(1, "MISSION_ACK")} == {1}
    station.run(1.0)
    station.count(1)
    for item in ITEMS:
        station.item(1, item)
    station.run(0.2)
    assert station.requests(1) == [0, 1, 2, 3]
    assert station.of(1, "MISSION_ACK")[-1].type == 0
    assert station.vehicle.autopilot.store.items == ITEMS


def test_px4_is_free_at_once_where_the_other_link_still_brings_the_cancellation() -> None:
    station = Station(PX4)
    station.count(0)
    station.send(0, dialect.MAVLink_mission_ack_message(11, 1, 15))
    station.count(1)
    station.run(0.2)
    assert station.requests(1) == [0]


@KINDS
def test_a_fault_of_one_link_spares_the_other(kind: AutopilotKind) -> None:
    station = Station(kind, "uav1.2:silent@0s")
    station.run(3.0)
    assert station.heard[0]
    assert not station.heard[1]


def test_each_link_may_have_a_radio_of_its_own() -> None:
    config = sim_vehicle(PX4, connection=CONNECTIONS)
    [vehicle] = build_vehicles(SimFleet((config,), radio="sik, lte"))
    [second] = build_vehicles(SimFleet((config,), radio=",lte"))
    assert vehicle.radio is not None
    assert second.radio is None
    assert second.links == vehicle.links == 2


def test_a_fault_of_a_link_that_is_not_there_is_refused() -> None:
    fault = parse_fault("uav1.2:silent@0s")
    with pytest.raises(FaultSpecError, match=r"^fault 'uav1\.2:silent@0s': uav1 has 1 link"):
        SimFleet((sim_vehicle(PX4),), faults=(fault,))
