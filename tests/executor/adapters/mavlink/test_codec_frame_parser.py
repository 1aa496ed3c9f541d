"""Frames out of a byte stream that is cut anywhere and has noise in it."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink.codec import MOST_WRONG, FrameParser, MavlinkCodec
from tests.executor.adapters.mavlink.test_codec import Vehicle

MESSAGES = (
    mav.MAVLink_mission_ack_message(255, 190, 0),
    mav.MAVLink_heartbeat_message(2, 3, 0xFD, 0xFDFEFD, 3, 3),
    mav.MAVLink_statustext_message(4, b"\xfd\xfe on the way"),
    mav.MAVLink_global_position_int_message(253, 0x7DFDFDFD, 0x7EFEFEFE, 1, 2, 3, 4, 5, 65535),
)
MARKS = st.sampled_from([b"\xfd", b"\xfe", b"\xfd\xff\x00", b"\xfd\x14\x00\x00\x01\x01\x01\x00\x00\x00", b"\xfe\xff"])
NOISE = st.lists(st.binary(max_size=12) | MARKS, max_size=4).map(b"".join)


@given(
    plan=st.lists(st.tuples(st.sampled_from(MESSAGES), NOISE), min_size=1, max_size=12),
    cuts=st.lists(st.integers(1, 40), min_size=1, max_size=40),
)
def test_every_frame_comes_out_whatever_is_between_and_wherever_it_is_cut(
    plan: list[tuple[object, bytes]], cuts: list[int]
) -> None:
    vehicle = Vehicle()
    frames = [vehicle.pack(message) for message, _ in plan]
    # A mark in noise may promise up to 280 bytes: what makes it wait is what comes behind.
    stream = b"".join(noise + frame for (_, noise), frame in zip(plan, frames, strict=True)) + bytes(300)
    cutter, found, at = FrameParser(), list[bytes](), 0
    for turn in range(len(stream)):
        piece = stream[at : at + cuts[turn % len(cuts)]]
        found += [bytes(frame.get_msgbuf()) for frame in cutter.feed(piece)]
        at += len(piece)
    assert found == frames


def test_a_frame_is_there_with_its_last_byte() -> None:
    frame, cutter = Vehicle().pack(MESSAGES[1]), FrameParser()
    assert [len(cutter.feed(frame[at : at + 1])) for at in range(len(frame))] == [0] * (len(frame) - 1) + [1]


def test_a_signed_frame_and_an_old_one_are_frames() -> None:
    signer, old = mav.MAVLink(None, srcSystem=7, srcComponent=1), Vehicle()
    signer.signing.secret_key, signer.signing.sign_outgoing = bytes(32), True
    stream = bytes(MESSAGES[0].pack(signer)) + bytes(MESSAGES[0].pack(old.mav, force_mavlink1=True))
    cutter = FrameParser()
    assert [received.sysid for received in MavlinkCodec().read(cutter.feed(stream))] == [7, 7]


def test_a_datagram_takes_nothing_into_the_next() -> None:
    cutter, frame = FrameParser(in_datagrams=True), Vehicle().pack(MESSAGES[0])
    assert cutter.feed(b"noise" + frame[:-3]) == []
    assert len(cutter.feed(frame)) == 1


UNKNOWN = b"\xfd\x03\x00\x00\x09\x07\x01\xff\x7f\x00" + b"\x01\x02\x03" + b"\xaa\xbb"
"""Message 32767, which pymavlink does not know, of system 7, with the number 9."""


def test_a_message_that_is_not_known_counts_in_a_datagram() -> None:
    known = Vehicle().pack(MESSAGES[0])
    for datagram in (UNKNOWN, UNKNOWN + known, known + UNKNOWN):
        codec = MavlinkCodec()
        received = list(codec.decode(datagram))
        assert [one.frame for one in received] == [part for part in (datagram.partition(UNKNOWN)) if part]
        [unknown] = [one for one in received if one.frame == UNKNOWN]
        assert (unknown.sysid, unknown.compid, unknown.seq, unknown.message) == (7, 1, 9, None)


def test_a_message_that_is_not_known_is_noise_where_noise_may_be() -> None:
    assert list(MavlinkCodec().decode(UNKNOWN + b"\x00")) == []
    assert FrameParser().feed(UNKNOWN) == []


def test_what_is_full_of_marks_is_given_up() -> None:
    """Each of them could begin a frame, and each costs a checksum: whoever sends them must not hold everybody up."""
    frame = Vehicle().pack(MESSAGES[0])
    for mark in (b"\xfe", b"\xfd"):
        for cutter in (FrameParser(), FrameParser(in_datagrams=True)):
            assert len(cutter.feed(mark * (MOST_WRONG - 1) + bytes(300) + frame)) == 1
            assert cutter.feed(mark * MOST_WRONG + bytes(300) + frame) == []
            assert len(cutter.feed(frame)) == 1


def test_of_strangers_it_is_enough_that_their_frames_are_whole() -> None:
    stranger = Vehicle()
    whole = [stranger.pack(message) for message in MESSAGES]
    damaged = whole[3][:20] + bytes([whole[3][20] ^ 1]) + whole[3][21:]
    cutter = FrameParser(in_datagrams=True, systems={1})
    found = [frame for data in whole for frame in cutter.feed(data)]
    assert [bytes(frame.get_msgbuf()) for frame in found] == whole
    read = [not isinstance(frame, mav.MAVLink_unknown) for frame in found]
    assert read == [False, True, False, False]  # who speaks is heard: another ground station, a radio
    assert {(frame.get_srcSystem(), frame.get_srcComponent()) for frame in found} == {(7, 1)}
    assert [frame.get_seq() for frame in found] == [0, 1, 2, 3]
    assert cutter.feed(damaged) == []
    [ours] = FrameParser(in_datagrams=True, systems={7}).feed(whole[3])
    assert ours.lat == 0x7DFDFDFD


def test_strangers_are_counted_and_say_nothing() -> None:
    codec = MavlinkCodec(systems={1})
    [received] = codec.decode(Vehicle().pack(MESSAGES[3]))
    assert (received.sysid, received.message, received.more, received.own) == (7, None, (), False)
    [beat] = codec.decode(Vehicle().pack(MESSAGES[1]))
    assert beat.message is not None
