"""The link to one vehicle, on real UDP on the loopback interface."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.link import LinkCounts, VehicleLink, open_link
from executor.core.messages import (
    Heartbeat,
    Message,
    MissionAck,
    MissionCurrent,
    SendHeartbeat,
    StationHeard,
    StatusText,
)
from executor.errors import ConnectionFailed
from tests.executor.adapters.test_codec import ARDUPILOT, PX4, Vehicle

PATIENCE_S = 10.0
NOBODY = ("127.0.0.1", 9)


class Frames:
    """A frame log in memory."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []

    def write(self, frame: bytes) -> None:
        self.frames.append(frame)


def link_of(*, log: Frames | None = None) -> tuple[VehicleLink, list[Message]]:
    """Return a link without an endpoint, and what it hands on."""
    link, heard = VehicleLink(7, log), list[Message]()
    link.listen(heard.append)
    return link, heard


def current(seq: int) -> object:
    return mav.MAVLink_mission_current_message(seq)


def frames(numbers: Sequence[int]) -> list[bytes]:
    """Return one frame for each sequence number."""
    vehicle, packed = Vehicle(), []
    for number in numbers:
        vehicle.mav.seq = number % 256
        packed.append(vehicle.pack(current(number)))
    return packed


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        ([0, 1, 2], 0), ([0, 1, 4], 2), ([254, 255, 0, 1], 0), ([254, 1], 2), ([5, 5, 6, 6], 0), ([200], 0),
        ([0, 1, 3, 2, 4], 0), ([0, 3, 1, 4], 1), ([0, 3, 1, 1, 2, 2, 4], 0), ([10, 9, 11], 0), ([255, 1, 0, 2], 0),
    ],
)  # fmt: skip
def test_gaps_in_the_sequence_are_losses_and_overtaking_is_none(numbers: list[int], missing: int) -> None:
    link, _ = link_of()
    for frame in frames(numbers):
        link.datagram_received(frame, NOBODY)
    assert link.counts == LinkCounts(received=len(numbers), missing=missing)


@given(lost=st.sets(st.integers(1, 498)), swaps=st.sets(st.integers(0, 165)))
def test_losses_are_counted_whatever_is_overtaken(lost: set[int], swaps: set[int]) -> None:
    """Five hundred frames, neighbours exchanged here and there."""
    numbers = [number for number in range(500) if number not in lost or number % 100 == 0]
    for swap in swaps:
        at = 3 * swap + 1
        if at + 1 < len(numbers) - 1 and numbers[at + 1] - numbers[at - 1] < 100:
            numbers[at], numbers[at + 1] = numbers[at + 1], numbers[at]
    link, _ = link_of()
    for frame in frames(numbers):
        link.datagram_received(frame, NOBODY)
    assert link.counts == LinkCounts(received=len(numbers), missing=500 - len(numbers))


def test_frames_of_other_systems_are_foreign() -> None:
    link, heard = link_of()
    other = mav.MAVLink(None, srcSystem=8, srcComponent=1)
    link.datagram_received(bytes(current(3).pack(other)), NOBODY)  # type: ignore[attr-defined]
    assert (link.counts.foreign, link.counts.received, heard) == (1, 0, [])


def test_another_ground_stations_heartbeat_is_handed_on_and_changes_nothing() -> None:
    link, heard = link_of()
    station = mav.MAVLink(None, srcSystem=254, srcComponent=190)
    beat = mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    link.datagram_received(bytes(beat.pack(station)), NOBODY)
    assert heard == [StationHeard(254, 190)]
    assert (link.counts.foreign, link.counts.received, link.component, link.codec.autopilot) == (1, 0, 1, None)


def test_a_text_whose_end_never_came_is_handed_on_all_the_same() -> None:
    link, heard = link_of()
    torn = mav.MAVLink_statustext_message(4, b"x" * 50, 9, 0)
    vehicle = Vehicle()
    for message in (torn, *(current(1) for _ in range(60))):
        link.datagram_received(vehicle.pack(message), NOBODY)
    assert [message for message in heard if isinstance(message, StatusText)] == [StatusText(4, "x" * 50)]


def test_frames_of_other_components_neither_lose_nor_gain() -> None:
    link, _ = link_of()
    for frame in frames([0, 1]):
        link.datagram_received(frame, NOBODY)
    gimbal = Vehicle(compid=154)
    gimbal.mav.seq = 90
    link.datagram_received(gimbal.pack(current(5)), NOBODY)
    link.datagram_received(frames([2])[0], NOBODY)
    assert (link.counts.missing, link.counts.received) == (0, 4)


def test_the_heartbeat_says_which_autopilot_and_which_component() -> None:
    link, heard = link_of()
    link.datagram_received(Vehicle(compid=2).pack(mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3)), NOBODY)
    assert (link.codec.autopilot, link.component) == (PX4, 2)
    assert heard == [Heartbeat(PX4, 0, armed=False, system_status=3, vehicle_type=2)]


def test_a_listener_that_has_stopped_hears_nothing() -> None:
    link, heard = VehicleLink(7, None), list[Message]()
    stop = link.listen(heard.append)
    link.datagram_received(frames([0])[0], NOBODY)
    stop()
    link.datagram_received(frames([1])[0], NOBODY)
    assert heard == [MissionCurrent(0, 0)]


def test_what_is_received_is_logged_and_foreign_frames_are_not() -> None:
    log = Frames()
    link, _ = link_of(log=log)
    [frame] = frames([0])
    other = mav.MAVLink(None, srcSystem=8, srcComponent=1)
    link.datagram_received(frame + bytes(current(3).pack(other)), NOBODY)  # type: ignore[attr-defined]
    assert log.frames == [frame]


def test_before_the_vehicle_is_known_there_is_nowhere_to_send_to() -> None:
    log = Frames()
    link, _ = link_of(log=log)
    link.send(SendHeartbeat())
    assert log.frames == []


def socket_on_loopback() -> socket.socket:
    plug = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    plug.bind(("127.0.0.1", 0))
    plug.setblocking(False)
    return plug


def free_port() -> int:
    with socket_on_loopback() as plug:
        return int(plug.getsockname()[1])


@asynccontextmanager
async def opened(connection: str, log: Frames | None = None) -> AsyncIterator[VehicleLink]:
    link = await open_link(connection, 7, log)
    try:
        yield link
    finally:
        link.close()
        await asyncio.sleep(0)


async def received(plug: socket.socket) -> bytes:
    async with asyncio.timeout(PATIENCE_S):
        return await asyncio.get_running_loop().sock_recv(plug, 2048)


@pytest.mark.asyncio
async def test_udpin_answers_where_the_vehicle_calls_from() -> None:
    port, log = free_port(), Frames()
    async with opened(f"udpin://127.0.0.1:{port}", log) as link:
        came = asyncio.Event()
        link.listen(lambda _: came.set())
        with socket_on_loopback() as plug:
            plug.sendto(Vehicle().pack(mav.MAVLink_heartbeat_message(2, ARDUPILOT, 0, 0, 3, 3)), ("127.0.0.1", port))
            async with asyncio.timeout(PATIENCE_S):
                await came.wait()
            link.send(SendHeartbeat())
            frame = await received(plug)
    assert log.frames[-1] == frame
    assert mav.MAVLink(None).parse_buffer(frame)[0].get_type() == "HEARTBEAT"


@pytest.mark.asyncio
async def test_udpout_calls_the_vehicle() -> None:
    with socket_on_loopback() as plug:
        async with opened(f"udpout://127.0.0.1:{plug.getsockname()[1]}") as link:
            heard: asyncio.Queue[Message] = asyncio.Queue()
            link.listen(heard.put_nowait)
            link.send(SendHeartbeat())
            async with asyncio.timeout(PATIENCE_S):
                _, address = await asyncio.get_running_loop().sock_recvfrom(plug, 2048)
            plug.sendto(Vehicle().pack(mav.MAVLink_mission_ack_message(255, 190, 0)), address)
            async with asyncio.timeout(PATIENCE_S):
                assert await heard.get() == MissionAck(0)


@pytest.mark.asyncio
async def test_a_port_that_is_taken_is_named() -> None:
    with socket_on_loopback() as plug:
        connection = f"udpin://127.0.0.1:{plug.getsockname()[1]}"
        with pytest.raises(ConnectionFailed, match=f"^{connection}: cannot be opened: "):
            await open_link(connection, 7, None)


@pytest.mark.asyncio
async def test_a_vehicle_that_is_not_there_yet_costs_nothing() -> None:
    """The refusal of a closed port comes back as an error on the socket, which stays open."""
    port = free_port()
    async with opened(f"udpout://127.0.0.1:{port}") as link:
        link.send(SendHeartbeat())
        link.send(SendHeartbeat())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
            plug.setblocking(False)
            plug.bind(("127.0.0.1", port))
            link.send(SendHeartbeat())
            assert await received(plug)
