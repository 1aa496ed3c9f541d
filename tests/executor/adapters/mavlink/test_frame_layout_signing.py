"""Signed frames: pymavlink's own signatures are taken, ours are taken by pymavlink, and nothing else is believed."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, VehicleLink
from executor.adapters.mavlink.frame_layout import EPOCH_UNIX_S, TICKS_PER_S, FrameRejection, LinkSigning
from executor.core.interface.messages import (
    Heartbeat,
    MissionCount,
    MissionCurrent,
    OrderSeen,
    Radio,
    SendHeartbeat,
)
from simulator import messages as simulated
from simulator.config import Signing as SimSigning
from simulator.messages import build_message
from simulator.wire import Codec as SimCodec
from tests.executor.adapters.mavlink.test_endpoints_link import into

KEY = bytes(range(32))
NOW_UNIX_S = 1.79e9
TICKS = round((NOW_UNIX_S - EPOCH_UNIX_S) * TICKS_PER_S)
BEAT = mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)


class Peer:
    """A vehicle that signs with pymavlink."""

    def __init__(self, key: bytes | None = KEY, *, ticks: int = TICKS, link_id: int = 3) -> None:
        self.mav = mav.MAVLink(None, srcSystem=7, srcComponent=1)
        self.mav.signing.secret_key = key
        self.mav.signing.sign_outgoing = key is not None
        self.mav.signing.timestamp = ticks
        self.mav.signing.link_id = link_id

    def pack(self, message: object = BEAT) -> bytes:
        frame = bytes(message.pack(self.mav))  # type: ignore[attr-defined]
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame


def ours(unix_s: float = NOW_UNIX_S, key: bytes = KEY) -> MavlinkCodec:
    return MavlinkCodec(LinkSigning(key, 0, lambda: unix_s))


def verdicts(codec: MavlinkCodec, *frames: bytes) -> list[object]:
    """What becomes of frames: a message, or why it is refused."""
    return [received.refused or received.message for frame in frames for received in codec.decode(frame)]


def test_what_pymavlink_signed_is_believed() -> None:
    peer = Peer()
    beat, current = verdicts(ours(), peer.pack(), peer.pack(mav.MAVLink_mission_current_message(4)))
    assert isinstance(beat, Heartbeat)
    assert current == MissionCurrent(4, None)


def test_a_sender_without_the_key_is_refused() -> None:
    codec = ours()
    assert verdicts(codec, Peer(None).pack(), Peer(bytes(32)).pack()) == [
        FrameRejection.UNSIGNED,
        FrameRejection.FORGED,
    ]


def test_a_forged_time_locks_out_no_vehicle() -> None:
    """Only a signature that is right tells how far a stream has come."""
    codec = ours()
    assert verdicts(codec, Peer(bytes(32), ticks=TICKS + 10**9).pack()) == [FrameRejection.FORGED]
    assert isinstance(verdicts(codec, Peer().pack())[0], Heartbeat)


def test_a_frame_that_is_sent_again_is_refused() -> None:
    codec, peer = ours(), Peer()
    first, second = peer.pack(), peer.pack()
    assert isinstance(verdicts(codec, first)[0], Heartbeat)
    assert verdicts(codec, first, second, second, first)[0] is FrameRejection.REPLAYED
    assert verdicts(codec, first, second) == [FrameRejection.REPLAYED, FrameRejection.REPLAYED]


def test_what_was_recorded_yesterday_is_refused_by_a_program_that_has_just_begun() -> None:
    day = 86400 * TICKS_PER_S
    assert verdicts(ours(), Peer(ticks=TICKS - day).pack()) == [FrameRejection.REPLAYED]
    assert isinstance(verdicts(ours(), Peer(ticks=TICKS - 30 * TICKS_PER_S).pack())[0], Heartbeat)
    assert isinstance(verdicts(ours(), Peer(ticks=TICKS + day).pack())[0], Heartbeat)


def test_two_links_of_one_vehicle_have_times_of_their_own() -> None:
    codec = ours()
    frames = [Peer(ticks=TICKS + 500, link_id=1).pack(), Peer(ticks=TICKS, link_id=2).pack()]
    assert all(isinstance(one, Heartbeat) for one in verdicts(codec, *frames))


SIK = (51, 68)
HEARD = Radio(200, 190, 50, 40, 90)
REPORT = mav.MAVLink_radio_status_message(200, 190, 90, 50, 40, 0, 0)


def report(system: int = 51, component: int = 68) -> bytes:
    """Return what a SiK radio puts in, which knows no key."""
    return bytes(REPORT.pack(mav.MAVLink(None, srcSystem=system, srcComponent=component)))


def with_radios(*radios: tuple[int, int]) -> MavlinkCodec:
    return MavlinkCodec(LinkSigning(KEY, 0, lambda: NOW_UNIX_S), frozenset(radios))


def test_a_radios_own_report_needs_no_key_if_the_radio_is_named() -> None:
    assert verdicts(ours(), report()) == [FrameRejection.UNSIGNED]
    assert verdicts(with_radios(SIK), report(), report(7, 1)) == [HEARD, FrameRejection.UNSIGNED]
    assert isinstance(verdicts(ours(), Peer().pack(REPORT))[0], Radio)


def test_where_nothing_is_signed_only_named_radios_are_heard_if_any_are() -> None:
    assert isinstance(verdicts(MavlinkCodec(), report())[0], Radio)
    assert verdicts(MavlinkCodec(radios=frozenset({SIK})), report(), report(52)) == [HEARD, None]


def test_a_text_without_a_signature_is_dropped_and_counted() -> None:
    codec = with_radios(SIK)
    link, heard = VehicleLink(7, codec), list[object]()
    link.listen(heard.append)
    text = mav.MAVLink_statustext_message(0, b"Crash: Disarming")
    Router([link], codec).route_frames(codec.decode(Peer(None).pack(text)), lambda _: True)
    assert (heard, link.counts.refused, link.counts.received) == ([], {"unsigned": 1}, 0)


def test_where_frames_are_signed_an_order_or_its_answer_without_a_signature_is_counted_and_no_evidence() -> None:
    codec = ours()
    link, heard = VehicleLink(7, codec), list[object]()
    link.listen(heard.append)
    station, forger = mav.MAVLink(None, srcSystem=254, srcComponent=190), Peer(None)
    answer = mav.MAVLink_command_ack_message(20, 0, 0, 0, 254, 190)
    order = mav.MAVLink_command_long_message(7, 1, 20, 0, *[0.0] * 7)
    for frame in (
        forger.pack(answer),
        bytes(order.pack(station)),
        bytes(mav.MAVLink_set_mode_message(7, 1, 6).pack(station)),
    ):
        Router([link], codec).route_frames(codec.decode(frame), lambda _: True)
    assert (heard, link.counts.refused) == ([], {"unsigned": 3})
    Router([link], codec).route_frames(codec.decode(Peer().pack(answer)), lambda _: True)
    assert heard == [OrderSeen(20, None, 254, 7)]


@pytest.mark.parametrize("sender", [SIK, (7, 1), (7, 68)])
@pytest.mark.parametrize("signed", [True, False])
def test_a_radios_report_never_decides_where_a_vehicle_is(sender: tuple[int, int], *, signed: bool) -> None:
    """Not even in the vehicle's own name, as anybody may send it."""
    codec = with_radios(SIK, sender) if signed else MavlinkCodec()
    link, here, there = VehicleLink(7, codec), list[bytes](), list[bytes]()
    router, heard = Router([link], codec), list[object]()
    router.route_frames(codec.decode(Peer(KEY if signed else None).pack()), into(here), "here")
    link.listen(heard.append)
    for _ in range(3):
        router.route_frames(codec.decode(report(*sender)), into(there), "there")
    link.send(SendHeartbeat())
    assert (len(here), len(there)) == (1, 0)
    assert heard == ([] if sender == SIK else [HEARD] * 3), "a radio speaks from where its vehicle does"
    router.route_frames(codec.decode(report(*sender)), into(here), "here")
    assert heard[-1:] == [HEARD]
    assert link.counts.missing == 0


def test_what_we_sign_pymavlink_believes_and_no_time_comes_twice() -> None:
    codec = ours()
    reader = mav.MAVLink(None)
    reader.signing.secret_key = KEY
    reader.signing.timestamp = TICKS
    for _ in range(50):
        [frame] = reader.parse_buffer(codec.encode(SendHeartbeat(), 7, 1))
        assert frame.get_type() == "HEARTBEAT"
        assert frame.get_signed()


def test_after_a_restart_with_the_clock_set_back_we_are_still_believed() -> None:
    """The flight's clock goes on from its log; the vehicle has heard later times than the time of day says."""
    vehicle = SimCodec(7, signing=SimSigning(KEY, TICKS))
    first = ours(NOW_UNIX_S)
    assert vehicle.decode(first.encode(MissionCount(3), 7, 1))
    assert vehicle.decode(ours(NOW_UNIX_S - 3600).encode(MissionCount(3), 7, 1)) == []
    assert vehicle.decode(ours(NOW_UNIX_S + 1).encode(MissionCount(3), 7, 1))


def test_the_simulated_vehicle_signs_and_asks_for_signatures() -> None:
    vehicle, codec = SimCodec(7, signing=SimSigning(KEY, TICKS)), ours()
    plain = build_message("MISSION_CURRENT", seq=4, total=9, mission_state=3, mission_mode=1)
    extended = build_message("MISSION_CURRENT", seq=5, total=9, mission_state=3, mission_mode=1, mission_id=77)
    said = verdicts(codec, vehicle.encode(plain, 1.0), vehicle.encode(extended, 1.0), vehicle.encode(plain, 1.0))
    assert said == [MissionCurrent(4, 9), MissionCurrent(5, 9, 77), MissionCurrent(4, 9)]
    [received] = vehicle.decode(codec.encode(MissionCount(3), 7, 1))
    assert isinstance(received.body, simulated.MissionCount)
    assert vehicle.decode(MavlinkCodec().encode(MissionCount(3), 7, 1)) == []
    assert vehicle.decode(ours(key=bytes(32)).encode(MissionCount(3), 7, 1)) == []


def test_what_is_refused_is_counted_and_goes_nowhere() -> None:
    codec = ours()
    links = [VehicleLink(7, codec), VehicleLink(8, codec)]
    router, heard = Router(links, codec), list[object]()
    links[0].listen(heard.append)
    peer = Peer()
    good = peer.pack()
    for frame in (good, good, Peer(None).pack(), Peer(bytes(32)).pack()):
        router.route_frames(codec.decode(frame), lambda _: True)
    assert links[0].counts.refused == {"replayed": 1, "unsigned": 1, "forged": 1}
    assert links[1].counts.refused == {}
    assert len([one for one in heard if isinstance(one, Heartbeat)]) == 1
    assert links[0].counts.received == 1


@given(data=st.binary(max_size=60), at=st.integers(0, 40), flip=st.integers(1, 255))
@settings(max_examples=60)
def test_no_garbled_frame_is_believed(data: bytes, at: int, flip: int) -> None:
    frame = bytearray(Peer().pack())
    frame[at % len(frame)] ^= flip
    said = verdicts(ours(), bytes(frame) + data)
    assert not any(isinstance(one, Heartbeat) for one in said)


@pytest.mark.parametrize("length", [12, 13, 20])
def test_a_frame_that_is_cut_short_is_no_frame(length: int) -> None:
    assert verdicts(ours(), Peer().pack()[:-length]) == []
