"""The link to one vehicle: what it counts, logs and hands on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, VehicleLink, Write
from executor.core.interface.messages import (
    DoubleHeard,
    Heartbeat,
    Message,
    MissionCurrent,
    OrderSeen,
    Radio,
    SendCommand,
    SendHeartbeat,
    StationHeard,
    StatusText,
    Traffic,
)
from executor.core.interface.ports import LinkCounts
from tests.executor.adapters.mavlink.test_codec import PX4, Vehicle


class Frames:
    """A frame log in memory."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []

    def write(self, frame: bytes) -> None:
        self.frames.append(frame)


def into(sent: list[bytes]) -> Write:
    """Return how to write to somebody who keeps what comes."""

    def write(frame: bytes) -> bool:
        sent.append(frame)
        return True

    return write


class Behind:
    """Links behind one endpoint that is fed by hand."""

    def __init__(self, *sysids: int, log: Frames | None = None) -> None:
        self.codec = MavlinkCodec()
        self.links = [VehicleLink(sysid, self.codec, (log or Frames()).write) for sysid in sysids]
        self.router = Router(self.links, self.codec)

    def feed(self, data: bytes, sent: list[bytes] | None = None) -> None:
        """Take a datagram from somebody who is answered into `sent`."""

        def write(frame: bytes) -> bool:
            if sent is not None:
                sent.append(frame)
            return sent is not None

        self.router.route_frames(self.codec.decode(data), write)


def link_of(*, log: Frames | None = None) -> tuple[Behind, VehicleLink, list[Message]]:
    """Return an endpoint, its one link, and what that hands on."""
    behind, heard = Behind(7, log=log), list[Message]()
    behind.links[0].listen(heard.append)
    return behind, behind.links[0], heard


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
    behind, link, _ = link_of()
    for frame in frames(numbers):
        behind.feed(frame)
    assert link.counts == LinkCounts(received=len(numbers), missing=missing)


@given(lost=st.sets(st.integers(1, 498)), swaps=st.sets(st.integers(0, 165)))
def test_losses_are_counted_whatever_is_overtaken(lost: set[int], swaps: set[int]) -> None:
    """Five hundred frames, neighbours exchanged here and there."""
    numbers = [number for number in range(500) if number not in lost or number % 100 == 0]
    for swap in swaps:
        at = 3 * swap + 1
        if at + 1 < len(numbers) - 1 and numbers[at + 1] - numbers[at - 1] < 100:
            numbers[at], numbers[at + 1] = numbers[at + 1], numbers[at]
    behind, link, _ = link_of()
    for frame in frames(numbers):
        behind.feed(frame)
    assert link.counts == LinkCounts(received=len(numbers), missing=500 - len(numbers))


def beats(*numbered: tuple[int, int]) -> list[bytes]:
    """Return one HEARTBEAT for each sequence number and mode."""
    vehicle, packed = Vehicle(), []
    for number, mode in numbered:
        vehicle.mav.seq = number % 256
        packed.append(vehicle.pack(mav.MAVLink_heartbeat_message(2, 3, 209, mode, 4, 3)))
    return packed


@pytest.mark.parametrize(
    ("told", "modes"),
    [
        ([(40, 3), (80, 6), (79, 3), (120, 6)], [3, 6, 6]),  # it was overtaken by the first one of another mode
        ([(250, 3), (3, 6), (1, 3)], [3, 6]),
        ([(40, 3), (80, 6), (40, 3)], [3, 6, 3]),  # so far behind it has begun to count anew
        ([(200, 3), (0, 6), (1, 6)], [3, 6, 6]),
        ([(40, 3), (40, 3)], [3, 3]),
        ([(40, 3), (60, 6), (40, 3)], [3, 6]),  # a copy that came late
        ([(80, 6), (80, 6), (79, 3)], [6, 6, 3]),  # nothing was passed over: it counts anew
    ],
)
def test_a_heartbeat_that_was_overtaken_says_nothing(told: list[tuple[int, int]], modes: list[int]) -> None:
    behind, link, heard = link_of()
    for frame in beats(*told):
        behind.feed(frame)
    assert [one.custom_mode for one in heard if isinstance(one, Heartbeat)] == modes
    assert link.counts.received == len(told)


@pytest.mark.parametrize("silent", range(100, 612, 8))
def test_the_first_heartbeat_after_a_silence_counts_however_many_frames_were_not_heard(silent: int) -> None:
    """A counter of 256 numbers says nothing of what was before a silence."""
    behind, _, heard = link_of()
    before = [beats((number, 3))[0] if number % 10 == 0 else frames([number])[0] for number in range(100)]
    for frame in (*before, *beats((100 + silent, 6))):
        behind.feed(frame)
    assert [one.custom_mode for one in heard if isinstance(one, Heartbeat)] == [*[3] * 10, 6]


def test_what_an_overtaken_heartbeat_brings_to_an_end_is_handed_on() -> None:
    behind, _, heard = link_of()
    vehicle = Vehicle()
    newer, older = beats((80, 6), (79, 3))
    vehicle.mav.seq = 78
    behind.feed(frames([77])[0])
    behind.feed(newer)
    behind.feed(vehicle.pack(mav.MAVLink_statustext_message(4, b"x" * 50, 7, 0)))
    for _ in range(60):
        behind.feed(older)
    assert [type(one) for one in heard] == [MissionCurrent, Heartbeat, StatusText]


def test_frames_of_other_systems_are_foreign() -> None:
    behind, link, heard = link_of()
    other = mav.MAVLink(None, srcSystem=8, srcComponent=1)
    behind.feed(bytes(current(3).pack(other)))  # type: ignore[attr-defined]
    assert (link.counts.foreign, link.counts.received, heard) == (1, 0, [])


def test_a_radio_is_believed_from_where_the_vehicles_heartbeats_come() -> None:
    """Anybody can send a text in its name, and a radio's report after it."""
    behind, _, heard = link_of()
    vehicle, radio = mav.MAVLink(None, srcSystem=7, srcComponent=1), mav.MAVLink(None, srcSystem=51, srcComponent=68)
    report = mav.MAVLink_radio_status_message(200, 190, 90, 50, 40, 0, 0)
    told: list[tuple[Any, Any, str]] = [
        (vehicle, mav.MAVLink_heartbeat_message(2, mav.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 4, 3), "A"),
        (vehicle, mav.MAVLink_statustext_message(6, b"hello"), "B"),
        (radio, report, "B"),
        (radio, report, "A"),
    ]
    counts = []
    for sender, message, place in told:
        behind.router.route_frames(behind.codec.decode(bytes(message.pack(sender))), lambda _: True, place)
        counts.append(sum(isinstance(one, Radio) for one in heard))
    assert counts == [0, 0, 0, 1]


def test_another_ground_stations_heartbeat_is_handed_on_and_changes_nothing() -> None:
    behind, link, heard = link_of()
    station, sent = mav.MAVLink(None, srcSystem=254, srcComponent=190), list[bytes]()
    beat = mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    behind.feed(bytes(beat.pack(station)), sent)
    link.send(SendHeartbeat())
    assert (heard, sent) == ([StationHeard(254, 190)], [])
    assert (link.counts.foreign, link.counts.received, link.component, behind.codec.autopilots) == (1, 0, 1, {})


def test_another_stations_order_is_reported_for_its_vehicle() -> None:
    behind, heard = Behind(7, 8), (list[Message](), list[Message]())
    for link, by_link in zip(behind.links, heard, strict=True):
        link.listen(by_link.append)
    station = mav.MAVLink(None, srcSystem=254, srcComponent=190)
    behind.feed(bytes(mav.MAVLink_set_mode_message(8, 1, 6).pack(station)))
    assert heard == ([], [OrderSeen(176, 6, 254, 8)])


def test_an_answer_to_another_station_is_of_the_vehicle_that_gives_it() -> None:
    """A vehicle on the same port that is nobody's says nothing of ours."""
    behind, link, heard = link_of()
    for system in (7, 8):
        vehicle = mav.MAVLink(None, srcSystem=system, srcComponent=1)
        behind.feed(bytes(mav.MAVLink_command_ack_message(20, 0, 0, 0, 254, 190).pack(vehicle)))
    assert (heard, link.counts.foreign) == ([OrderSeen(20, None, 254, 7)], 1)


def test_every_vehicle_on_a_port_hears_of_another_ground_station_there() -> None:
    behind, heard = Behind(7, 8), (list[Message](), list[Message]())
    for link, by_link in zip(behind.links, heard, strict=True):
        link.listen(by_link.append)
    station = mav.MAVLink(None, srcSystem=254, srcComponent=190)
    behind.feed(bytes(mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3).pack(station)))
    assert heard == ([StationHeard(254, 190)], [StationHeard(254, 190)])


def test_an_incomplete_text_is_forwarded() -> None:
    behind, _, heard = link_of()
    torn = mav.MAVLink_statustext_message(4, b"x" * 50, 9, 0)
    vehicle = Vehicle()
    for message in (torn, *(current(1) for _ in range(60))):
        behind.feed(vehicle.pack(message))
    assert [message for message in heard if isinstance(message, StatusText)] == [StatusText(4, "x" * 50)]


def test_frames_of_other_components_neither_lose_nor_gain() -> None:
    behind, link, _ = link_of()
    for frame in frames([0, 1]):
        behind.feed(frame)
    gimbal = Vehicle(compid=154)
    gimbal.mav.seq = 90
    behind.feed(gimbal.pack(current(5)))
    behind.feed(frames([2])[0])
    assert (link.counts.missing, link.counts.received) == (0, 4)


def test_the_share_that_is_lost_is_the_autopilots_own() -> None:
    logged = Frames()
    behind, _, heard = link_of(log=logged)
    gimbal, vehicle = Vehicle(compid=154), Vehicle()
    for number in range(100):
        behind.feed(gimbal.pack(current(5)))
        vehicle.mav.seq = 2 * number % 256
        behind.feed(vehicle.pack(current(1)))
    vehicle.mav.seq = 200
    behind.feed(vehicle.pack(mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3)))
    assert [one for one in heard if isinstance(one, Traffic)] == [Traffic(101, 100, sum(map(len, logged.frames)))]


def test_bytes_both_ways_are_reported_with_every_fifth_heartbeat() -> None:
    behind, link, heard = link_of()
    vehicle = Vehicle()
    for _ in range(10):
        behind.feed(vehicle.pack(mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3)))
        link.send(SendHeartbeat())
    counted = [one for one in heard if isinstance(one, Traffic)]
    assert [one.link_bytes for one in counted] == [(5 + 4) * 21, (5 + 5) * 21], "received and sent"


def test_another_component_moves_no_vehicle_and_is_no_second_one() -> None:
    """A computer on board may send from an address of its own."""
    behind, link, heard = link_of()
    first, second = frames([0, 1])
    computer, here, there = Vehicle(compid=191), list[bytes](), list[bytes]()
    for frame, sent, place in (
        (first, here, "A"), (computer.pack(current(5)), there, "B"), (second, here, "A"),
        (computer.pack(mav.MAVLink_heartbeat_message(18, 3, 0, 0, 4, 3)), there, "B"),
    ):  # fmt: skip
        behind.router.route_frames(behind.codec.decode(frame), into(sent), place)
    link.send(SendHeartbeat())
    assert answered((here, there)) == [1, 0]
    assert heard == [MissionCurrent(0, None), MissionCurrent(1, None)]


def test_the_heartbeat_says_which_autopilot_and_which_component() -> None:
    behind, link, heard = link_of()
    behind.feed(Vehicle(compid=2).pack(mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3)))
    assert (behind.codec.autopilots, link.component) == ({7: PX4}, 2)
    assert heard == [Heartbeat(PX4, 0, armed=False, system_status=3, vehicle_type=2)]


def test_a_listener_that_has_stopped_hears_nothing() -> None:
    behind, heard = Behind(7), list[Message]()
    stop = behind.links[0].listen(heard.append)
    behind.feed(frames([0])[0])
    stop()
    behind.feed(frames([1])[0])
    assert heard == [MissionCurrent(0, None)]


def test_what_is_received_is_logged_and_foreign_frames_are_not() -> None:
    log = Frames()
    behind = Behind(7, log=log)
    [frame] = frames([0])
    other = mav.MAVLink(None, srcSystem=8, srcComponent=1)
    behind.feed(frame + bytes(current(3).pack(other)))  # type: ignore[attr-defined]
    assert log.frames == [frame]


def test_before_the_vehicle_is_known_there_is_nowhere_to_send_to() -> None:
    log = Frames()
    _, link, _ = link_of(log=log)
    link.send(SendHeartbeat())
    assert log.frames == []


def test_vehicles_on_one_port_are_distinguished_and_answered_where_each_calls_from() -> None:
    behind = Behind(7, 8)
    sent: dict[int, list[bytes]] = {7: [], 8: []}
    for sysid in (7, 8):
        vehicle = mav.MAVLink(None, srcSystem=sysid, srcComponent=1)
        behind.feed(bytes(current(3).pack(vehicle)), sent[sysid])  # type: ignore[attr-defined]
    for link in behind.links:
        link.send(SendCommand(400))
    assert [link.counts for link in behind.links] == [LinkCounts(received=1)] * 2
    targets = {
        sysid: [mav.MAVLink(None).parse_buffer(frame)[0].target_system for frame in sent[sysid]] for sysid in sent
    }
    assert targets == {7: [7], 8: [8]}
    assert [frame[4] for frames_of in sent.values() for frame in frames_of] == [0, 0]


def answered(stations: Iterable[list[bytes]]) -> list[int]:
    return [len(station) for station in stations]


def test_a_vehicle_that_moves_to_another_address_is_answered_there() -> None:
    behind, link, _ = link_of()
    old, new = list[bytes](), list[bytes]()
    for station in (old, new):
        behind.feed(frames([len(old)])[0], station)
        link.send(SendHeartbeat())
    assert answered((old, new)) == [1, 1]


def test_what_was_not_sent_is_not_logged() -> None:
    log = Frames()
    behind, link, _ = link_of(log=log)
    [frame] = frames([0])
    behind.feed(frame)
    link.send(SendHeartbeat())
    assert log.frames == [frame]


def test_two_vehicles_with_one_number_are_named_with_both_addresses() -> None:
    behind, link, heard = link_of()
    first, second = frames([0, 1, 2]), frames([100, 101])
    for frame, place in zip(
        (first[0], second[0], first[1], second[1], first[2]), ("A", "B", "A", "B", "A"), strict=True
    ):
        behind.router.route_frames(behind.codec.decode(frame), lambda _: True, place)
    assert [one for one in heard if isinstance(one, DoubleHeard)] == [DoubleHeard(7, ("A", "B"))]
    assert link.counts.received == 5


def test_a_vehicle_that_moved_to_another_address_is_one_vehicle() -> None:
    behind, _, heard = link_of()
    for frame, place in zip(frames([0, 1, 2, 3]), ("A", "A", "B", "B"), strict=True):
        behind.router.route_frames(behind.codec.decode(frame), lambda _: True, place)
    assert not any(isinstance(one, DoubleHeard) for one in heard)


def test_strange_systems_are_remembered_with_where_they_are() -> None:
    behind = Behind(9)
    behind.router.route_frames(behind.codec.decode(frames([0])[0]), lambda _: True, "10.0.0.7:14550")
    assert behind.links[0].counts.strangers == {7: "10.0.0.7:14550"}
