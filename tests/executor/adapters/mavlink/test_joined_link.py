"""Several links to one vehicle as one: what counts of what comes twice, and where orders go."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import DecodedFrame, MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, VehicleLink
from executor.adapters.mavlink.joined_link import JoinedLink, open_joined_links
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import (
    CommandAck,
    DoubleHeard,
    Heartbeat,
    Message,
    MissionAck,
    MissionCount,
    MissionRequest,
    Position,
    Radio,
    SendCommand,
    SendHeartbeat,
    StationActed,
    StatusText,
    SystemStatus,
)
from executor.core.interface.ports import LinkRequest, LinkView
from executor.errors import ConnectionFailed
from tests.executor.adapters.mavlink.test_codec import ARDUPILOT, Vehicle
from tests.executor.adapters.mavlink.test_endpoints import inbox, wire
from tests.executor.adapters.mavlink.test_endpoints_link import into
from tests.patience import PATIENCE_S
from tests.ports import free_port

RADIO, LTE = 0, 1


def beat(mode: int = 3) -> Any:
    return mav.MAVLink_heartbeat_message(2, ARDUPILOT, 0, mode, 3, 3)


def position(boot_s: float, lat_deg: float = 50.0) -> Any:
    return mav.MAVLink_global_position_int_message(
        round(boot_s * 1e3), round(lat_deg * 1e7), 13 * 10**7, 4 * 10**5, 10**4, 0, 0, 0, 0
    )


def status(remaining_pct: int) -> Any:
    return mav.MAVLink_sys_status_message(0, 0, 0, 0, 16000, -1, remaining_pct, 0, 0, 0, 0, 0, 0)


@dataclass
class Both:
    """A vehicle's two links, fed by hand; each has a numbering of its own, as both autopilots have."""

    now_s: float = 0.0
    heard: list[Message] = field(default_factory=list)
    sent: tuple[list[bytes], list[bytes]] = field(default_factory=lambda: ([], []))

    def __post_init__(self) -> None:
        self.vehicles = (Vehicle(), Vehicle())
        codecs = (MavlinkCodec(), MavlinkCodec())
        self.links = [VehicleLink(7, codec) for codec in codecs]
        self.tapped: list[bytes] = []
        self.routers = [Router([link], codec, self._tap) for link, codec in zip(self.links, codecs, strict=True)]
        for link, name in zip(self.links, ("radio", "lte"), strict=True):
            link.connection = name
        self.joined = JoinedLink(self.links, lambda: self.now_s)
        self.joined.listen(self.heard.append)

    def _tap(self, received: DecodedFrame, _: object) -> None:
        self.tapped.append(received.frame)

    def _write(self, number: int) -> Callable[[bytes], bool]:
        return into(self.sent[number])

    def feed(self, number: int, data: bytes, source: str = "") -> None:
        router = self.routers[number]
        router.route_frames(router.codec.decode(data), self._write(number), source)

    def say(self, number: int, *messages: Any, at_s: float | None = None) -> None:
        self.now_s = self.now_s if at_s is None else at_s
        for message in messages:
            self.feed(number, self.vehicles[number].pack(message))

    def of(self, kind: type[Message]) -> list[Message]:
        return [message for message in self.heard if isinstance(message, kind)]

    def sent_names(self, number: int) -> list[str]:
        parser = ardupilotmega.MAVLink(None)
        return [one.get_type() for data in self.sent[number] for one in parser.parse_buffer(data) or ()]


@pytest.fixture
def both() -> Both:
    return Both()


def test_a_frame_that_a_router_sends_over_both_links_counts_once(both: Both) -> None:
    for seq, message in enumerate((beat(), mav.MAVLink_mission_request_int_message(255, 190, 4, 0), beat())):
        both.now_s = float(seq)
        frame = both.vehicles[RADIO].pack(message)
        both.feed(LTE, frame)
        both.now_s += 0.4
        both.feed(RADIO, frame)
    assert len(both.of(Heartbeat)) == 2
    assert both.of(MissionRequest) == [MissionRequest(4)]
    assert [link.counts.received for link in both.links] == [3, 3]
    assert [link.counts.missing for link in both.links] == [0, 0]


def test_what_is_the_same_over_one_link_is_no_copy(both: Both) -> None:
    ack = mav.MAVLink_command_ack_message(400, 0)
    both.say(RADIO, beat(), ack)
    for _ in range(256):
        both.vehicles[RADIO].pack(beat())
    both.say(RADIO, ack)
    assert both.of(CommandAck) == [CommandAck(400, 0)] * 2


def test_the_newest_position_counts_whichever_link_it_comes_over(both: Both) -> None:
    both.say(RADIO, beat(), at_s=0.0)
    for step in range(1, 6):
        both.say(LTE, position(10.0 + step), at_s=step + 0.1)
        both.say(RADIO, position(10.0 + step - 0.4), at_s=step + 0.2)
    told = [one.boot_s for one in both.of(Position) if isinstance(one, Position)]
    assert told == [11.0, 12.0, 13.0, 14.0, 15.0]
    both.say(RADIO, position(15.8), at_s=6.4)
    assert len(both.of(Position)) == 6


def test_two_vehicles_with_one_number_on_one_of_the_links_are_reported(both: Both) -> None:
    """Their clocks are apart, so that neither is taken for a late copy of the other, whatever comes over LTE."""
    other = Vehicle()
    for step in range(12):
        both.say(LTE, position(100.0 + step), at_s=step + 0.1)
        both.now_s = step + 0.3
        both.feed(RADIO, both.vehicles[RADIO].pack(position(100.0 + step + 0.1)), "A")
        both.feed(RADIO, other.pack(position(500.0 + step, 50.1)), "B")
    boots_s = [one.boot_s for one in both.of(Position) if isinstance(one, Position)]
    assert sum(boot_s > 400.0 for boot_s in boots_s) == 12
    assert sum(boot_s < 400.0 for boot_s in boots_s) >= 12
    assert both.of(DoubleHeard) == [DoubleHeard(7, ("A", "B"))]


def test_two_links_of_one_vehicle_are_no_double(both: Both) -> None:
    for step in range(8):
        both.now_s = float(step)
        both.feed(RADIO, both.vehicles[RADIO].pack(beat()), "10.0.0.1:14550")
        both.feed(LTE, both.vehicles[LTE].pack(beat()), "81.2.69.142:14550")
    assert both.of(DoubleHeard) == []


def test_a_slow_link_does_not_bring_back_the_mode_of_a_second_ago(both: Both) -> None:
    both.joined.listen(lambda _: None)
    both.say(RADIO, beat(3), at_s=0.0)
    both.say(LTE, beat(3), at_s=0.1)
    both.say(RADIO, beat(6), at_s=1.0)
    both.say(LTE, beat(3), at_s=1.2)
    modes = [one.custom_mode for one in both.of(Heartbeat) if isinstance(one, Heartbeat)]
    assert modes == [3, 6]


def test_a_state_that_does_not_come_over_the_link_in_use_is_taken_from_the_other(both: Both) -> None:
    both.say(RADIO, beat(), status(80), at_s=0.0)
    for step in range(1, 6):
        both.say(RADIO, beat(), at_s=float(step))
        both.say(LTE, status(80 - step), at_s=step + 0.1)
    told = [one.remaining_pct for one in both.of(SystemStatus) if isinstance(one, SystemStatus)]
    assert told == [80, 77, 76, 75]


def test_a_broadcast_counts_once(both: Both) -> None:
    text = mav.MAVLink_statustext_message(4, b"Battery 1 is low")
    both.say(LTE, text, at_s=0.0)
    both.say(RADIO, text, at_s=0.6)
    both.say(LTE, text, at_s=1.0)
    both.say(RADIO, text, at_s=9.0)
    assert len(both.of(StatusText)) == 3


def test_the_radios_own_report_is_that_of_the_link_in_use(both: Both) -> None:
    for number, free_pct in ((RADIO, 90), (LTE, 50)):
        frame = ardupilotmega.MAVLink_radio_status_message(200, 200, free_pct, 50, 50, 0, 0).pack(
            ardupilotmega.MAVLink(None, srcSystem=51, srcComponent=68)
        )
        both.say(number, beat())
        both.feed(number, bytes(frame))
    assert [one.free_buffer_pct for one in both.of(Radio) if isinstance(one, Radio)] == [90]


def test_orders_leave_a_link_that_has_been_silent_for_a_second_and_our_heartbeat_none(both: Both) -> None:
    for step in range(10):
        both.say(RADIO, beat(), at_s=0.2 * step)
        both.say(LTE, beat(), at_s=0.2 * step)
    both.joined.send(SendCommand(400))
    for step in range(1, 8):
        both.say(LTE, beat(), at_s=1.8 + 0.2 * step)
        both.joined.send(SendCommand(511))
    both.joined.send(SendHeartbeat())
    assert both.sent_names(RADIO) == ["COMMAND_LONG"] * 6 + ["HEARTBEAT"]
    assert both.sent_names(LTE) == ["COMMAND_LONG"] * 2 + ["HEARTBEAT"]
    assert both.joined.ways == (both.links[LTE], both.links[RADIO])
    assert both.joined.describe_links() == (
        LinkView("radio", 1.4, 0.0, used=False), LinkView("lte", 0.0, 0.0, used=True)
    )  # fmt: skip


def test_a_transfer_that_begins_over_another_link_ends_the_one_before(both: Both) -> None:
    both.say(RADIO, beat(), at_s=0.0)
    both.say(LTE, beat(), at_s=0.0)
    both.joined.send(MissionCount(5))
    both.joined.send(MissionCount(5))
    both.say(LTE, beat(), mav.MAVLink_mission_request_int_message(255, 190, 0, 0), at_s=1.2)
    both.joined.send(MissionCount(5))
    both.say(RADIO, mav.MAVLink_mission_request_int_message(255, 190, 3, 0), at_s=1.3)
    assert both.sent_names(RADIO) == ["MISSION_COUNT", "MISSION_COUNT", "MISSION_ACK"]
    assert both.sent_names(LTE) == ["MISSION_COUNT"]
    assert both.of(MissionRequest) == [MissionRequest(0)], "what the link that was left still brings is of the old one"
    assert both.of(MissionAck) == []


def test_other_stations_get_what_comes_over_the_link_in_use_and_reach_the_vehicle_over_it(both: Both) -> None:
    both.say(RADIO, beat(), at_s=0.0)
    both.say(LTE, beat(), position(1.0), at_s=0.1)
    assert len(both.tapped) == 1
    both.say(LTE, beat(), at_s=1.2)
    assert len(both.tapped) == 2
    both.joined.send_frame(b"a frame of theirs")
    assert both.sent == ([], [b"a frame of theirs"])
    both.joined.hear(StationActed(250, 190, "uploads a mission"))
    assert both.of(StationActed) == [StationActed(250, 190, "uploads a mission")]
    assert both.joined.sysid == 7


def test_counts_are_those_of_all_links(both: Both) -> None:
    both.say(RADIO, beat(), beat())
    both.vehicles[LTE].pack(beat())
    both.say(LTE, beat())
    both.vehicles[LTE].pack(beat())
    both.say(LTE, beat())
    counts = both.joined.counts
    assert (counts.received, counts.missing) == (4, 1)
    assert {name: (one.received, one.missing) for name, one in counts.by_connection.items()} == {
        "radio": (2, 0), "lte": (2, 1)
    }  # fmt: skip


@pytest.mark.asyncio
async def test_a_serial_radio_that_is_unplugged_is_replaced_by_the_other_link_until_it_is_back(tmp_path: Path) -> None:
    name, port, now_s = tmp_path / "ttyUSB0", free_port(), [0.0]
    order = LinkRequest(parse_connection(f"serial://{name}:57600"), 7)
    order = LinkRequest(order.connection, 7, more=(LinkRequest(parse_connection(f"udpin://127.0.0.1:{port}"), 7),))
    with wire() as (old, device):
        name.symlink_to(device)
        async with open_joined_links({"uav1": order}, lambda: now_s[0]) as links:
            link, loop = links["uav1"], asyncio.get_running_loop()
            lte, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, remote_addr=("127.0.0.1", port))
            heard, (radio, phone) = inbox(link), (Vehicle(), Vehicle())

            async def step(wire_end: int | None) -> None:
                now_s[0] += 0.5
                if wire_end is not None:
                    os.write(wire_end, radio.pack(beat()))
                lte.sendto(phone.pack(beat()))
                link.send(SendHeartbeat())
                await asyncio.sleep(0.02)

            async def step_until(wire_end: int | None, scheme: str, alive: int) -> None:
                async with asyncio.timeout(PATIENCE_S):
                    while not (link.connection.startswith(scheme) and sum(way.is_alive for way in link.ways) == alive):
                        await step(wire_end)

            await step_until(old, "serial", 2)
            name.unlink()
            with wire() as (theirs, other):
                os.dup2(theirs, old)  # the device is gone
                await step_until(None, "udpin", 1)
                name.symlink_to(other)
                await step_until(theirs, "udpin", 2)
            assert not heard.empty()
            lte.close()


@pytest.mark.asyncio
async def test_a_missing_device_is_named_unless_a_flight_is_resumed() -> None:
    other = LinkRequest(parse_connection(f"udpin://127.0.0.1:{free_port()}"), 7)
    order = LinkRequest(parse_connection("serial:///dev/nothing:57600"), 7, more=(other,))
    with pytest.raises(ConnectionFailed, match=r"^serial:///dev/nothing:57600: cannot be opened: No such file"):
        async with open_joined_links({"uav1": order}, lambda: 0.0):
            pass
    async with open_joined_links({"uav1": order}, lambda: 0.0, may_be_absent=True) as links:
        assert len(links["uav1"].ways) == 2
