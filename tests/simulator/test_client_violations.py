"""Each mistake of a client is named, and one that keeps to the protocol has none, on any link."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from simulator.client_violations import HEARTBEAT_GAP_S
from simulator.testing import fleet

STEPS = 3
SYSID = 1


class Client:
    """A client without sockets, whose time is the vehicle's."""

    def __init__(self, autopilot: str, *faults: str, seed: int = 0) -> None:
        self.vehicle = fleet(autopilot=autopilot, faults=[f"all:{one}@0s" for one in faults], seed=seed)[0]
        self.mav, self.parser = mav.MAVLink(None, srcSystem=255, srcComponent=190), mav.MAVLink(None)
        self.heard: list[Any] = []
        self.number = True
        self.say(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def say(self, message: Any) -> None:
        self.vehicle.simulated.receive(message.pack(self.mav))
        self.mav.seq = (self.mav.seq + self.number) % 256
        self.listen()

    def listen(self, seconds: float = 0.0) -> None:
        self.vehicle.simulated.advance(self.vehicle.simulated.now_s + seconds)
        for datagram in self.vehicle.simulated.drain():
            self.heard += self.parser.parse_buffer(datagram) or []

    def next(self, *names: str, within_s: float = 3.0) -> Any:
        """Return the next such message, or None; ArduPilot goes on after INVALID_SEQUENCE."""
        for _ in range(round(within_s / 0.05)):
            while self.heard:
                message = self.heard.pop(0)
                if message.get_type() in names and getattr(message, "type", 0) != 13:
                    return message
            self.listen(0.05)
        return None

    def count(self, count: int = STEPS) -> None:
        self.say(mav.MAVLink_mission_count_message(SYSID, 1, count))

    def item(self, seq: int) -> None:
        self.say(mav.MAVLink_mission_item_int_message(SYSID, 1, seq, 6, 16, 0, 1, 0, 0, 0, 0, 1, 1, 10))

    def ask(self, seq: int) -> None:
        self.say(mav.MAVLink_mission_request_int_message(SYSID, 1, seq))

    def acknowledge(self, kind: int = 0) -> None:
        self.say(mav.MAVLink_mission_ack_message(SYSID, 1, kind))

    def upload(self) -> None:
        self.count()
        while (asked := self.next("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", within_s=1.5)) is None:
            self.count()
        while asked is not None and asked.get_type() != "MISSION_ACK":
            self.item(asked.seq)
            asked = self.next("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", within_s=10.0)

    def ask_for_list(self) -> int:
        self.say(mav.MAVLink_mission_request_list_message(SYSID, 1))
        return int(self.next("MISSION_COUNT").count)

    def download(self) -> None:
        for seq in range(self.ask_for_list()):
            self.ask(seq)
        self.acknowledge()

    @property
    def violations(self) -> list[str]:
        return [one.what for one in self.vehicle.find_violations()]


BOTH = pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])


@BOTH
@pytest.mark.parametrize("faults", [(), ("delay=0.3",), ("duplicate=0.5",), ("loss=0.2",)], ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_one_that_answers_each_request_once_does_nothing_wrong(
    autopilot: str, faults: tuple[str, ...], seed: int
) -> None:
    client = Client(autopilot, *faults, seed=seed)
    client.upload()
    if not faults:
        client.download()
    client.listen(5.0)
    assert [what for what in client.violations if "HEARTBEAT" not in what] == []


def send_all(client: Client) -> None:
    client.count()
    for seq in range(STEPS):
        client.item(seq)
    client.item(STEPS - 1)


def send_unasked(client: Client) -> None:
    client.count()
    client.item(2)


def send_outside(client: Client) -> None:
    client.item(0)


def send_nothing(client: Client) -> None:
    client.count()
    client.listen(2.0)


def cancel(client: Client) -> None:
    client.count()
    client.acknowledge(15)
    client.listen(2.0)


def acknowledge_own(client: Client) -> None:
    client.count()
    client.acknowledge()


def leave_one_out(client: Client) -> None:
    client.upload()
    count = client.ask_for_list()
    for seq in range(count - 1):
        client.ask(seq)
    client.acknowledge()


def ask_backwards(client: Client) -> None:
    client.upload()
    client.ask_for_list()
    client.ask(1)
    client.listen(6.0)


def ask_beyond(client: Client) -> None:
    client.upload()
    client.ask_for_list()
    client.ask(STEPS)


def ask_at_once(client: Client) -> None:
    client.upload()
    client.ask(0)


def acknowledge_twice(client: Client) -> None:
    client.upload()
    client.download()
    client.acknowledge()


def forget_to_acknowledge(client: Client) -> None:
    client.upload()
    for seq in range(client.ask_for_list()):
        client.ask(seq)
    client.listen(2.0)


def call_somebody_else(client: Client) -> None:
    client.say(mav.MAVLink_param_request_list_message(77, 1))


def have_one_number(client: Client) -> None:
    client.number = False
    client.count(0)
    client.count(0)
    client.count(0)


@pytest.mark.parametrize(
    ("does", "expected"),
    [
        (send_all, ["sends item 2 2 times, asked for it once"]),
        (send_unasked, ["sends item 2, which was never asked for"]),
        (send_outside, ["sends item 0 while no upload is under way"]),
        (send_nothing, ["never sends item 0, which was asked for 8 times"]),
        (cancel, []),
        (acknowledge_own, ["acknowledges its own upload, which the vehicle does"]),
        (leave_one_out, ["never asks for item 2 of 3"]),
        (ask_backwards, ["asks for item 1 out of order, item 0 is the next"]),
        (ask_beyond, ["asks for item 3 of 3"]),
        (ask_at_once, ["asks for item 0 without knowing how many there are (MISSION_REQUEST_LIST)"]),
        (
            acknowledge_twice,
            ["sends MISSION_ACK though no download is open: one was acknowledged already, or none began"],
        ),
        (forget_to_acknowledge, ["never acknowledges its download of 3 items"]),
        (call_somebody_else, ["sends PARAM_REQUEST_LIST to system 77, which is not in the fleet"]),
        (have_one_number, ["does not number its frames: 3 in a row have the number 1"]),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_what_is_wrong_is_named(does: Callable[[Client], None], expected: list[str]) -> None:
    client = Client("px4")
    does(client)
    assert client.violations == expected


def test_a_heartbeat_that_stays_away_is_missed_while_the_client_says_something() -> None:
    client = Client("px4")
    client.listen(HEARTBEAT_GAP_S + 1.0)
    assert client.violations == [], "it may have gone"
    client.count(0)
    [violation] = client.vehicle.find_violations()
    assert (violation.about, violation.what) == ("heartbeat", "sends no HEARTBEAT for 6.0 s, from 0.0 s on")
    assert str(violation) == "     6.00 s  uav1: client 255 sends no HEARTBEAT for 6.0 s, from 0.0 s on"
