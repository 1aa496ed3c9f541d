"""Other ground stations, fed by hand: forwarded frames, orders, and the lines for the crew."""

from __future__ import annotations

import struct
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink.codec import MavlinkCodec, target_of
from executor.adapters.mavlink.endpoints import Router, VehicleLink
from executor.adapters.mavlink.forward import GONE_S, MOST_STATIONS, TOLD_AT_ONCE, Forwarder, StationPort
from executor.adapters.mavlink.frame_layout import LinkSigning
from executor.core.forwarding import ForwardRules
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import Message, OrderSeen, StationActed, StationHeard
from executor.core.lines import link
from executor.core.radio_budget import RadioShare
from tests.executor.adapters.mavlink.test_codec import IDS, PX4
from tests.executor.adapters.mavlink.test_endpoints_link import Frames, into

OURS = 254
QGC = (255, 190)
RADIO = RadioShare(2, bytes_s=1200.0, others_bytes_s=None)
BEAT = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 192, 0, 4, 3)
RTL = mav.MAVLink_command_long_message(7, 1, 20, 0, *[0.0] * 7)
PLACE = mav.MAVLink_global_position_int_message(61500, 496000000, 156000000, 470500, 20500, 300, -150, 50, 9000)


class Station:
    """Another ground station on a port of its own."""

    def __init__(self, sky: Sky, sender: tuple[int, int] = QGC, connection: str = "udpin://127.0.0.1:14550") -> None:
        self.mav, self.heard = mav.MAVLink(None, *sender), list[bytes]()
        self.codec = MavlinkCodec(sky.signing, station=(OURS, 190))
        self.port = StationPort(sky.forwarder, self.codec, parse_connection(connection))
        self.write = into(self.heard)

    def say(self, *said: Any) -> list[bytes]:
        packed = [bytes(message.pack(self.mav)) for message in said]
        for frame in packed:
            self.port.route_frames(self.codec.decode(frame), self.write)
        return packed

    @property
    def types(self) -> list[str]:
        return [mav.MAVLink(None).decode(bytearray(frame)).get_type() for frame in self.heard]


class Sky:
    """Two vehicles, 7 and 8, each on its own port, or both behind one."""

    def __init__(
        self, *, allow: bool = True, one_port: bool = False, share: RadioShare | None = None, key: bytes | None = None
    ) -> None:
        self.now_s, self.busy, self.log = 100.0, False, Frames()
        self.signing = None if key is None else LinkSigning(key, 130, time.time)
        rules = ForwardRules(OURS, frozenset({7, 8}), allow)
        shares = {} if share is None else dict.fromkeys((7, 8), share)
        self.forwarder = Forwarder(rules, lambda: self.now_s, shares, lambda _: self.busy)
        self.sent: dict[int, list[bytes]] = {7: [], 8: []}
        self.said: dict[int, list[Message]] = {7: [], 8: []}
        self.routers: dict[int, Router] = {}
        self.vehicles = {sysid: mav.MAVLink(None, srcSystem=sysid, srcComponent=1) for sysid in (7, 8)}
        codec = MavlinkCodec(station=(OURS, 190), systems=frozenset({7, 8}))
        links = {sysid: VehicleLink(sysid, codec, self.log.write) for sysid in (7, 8)}
        shared = Router(links.values(), codec, self.forwarder.tap)
        way = into(self.sent[7])
        for sysid, one in links.items():
            one.listen(self.said[sysid].append)
            self.routers[sysid] = shared if one_port else Router([one], codec, self.forwarder.tap)
            one.write = way if one_port else into(self.sent[sysid])
        self.codec = codec
        self.forwarder.links.update(links)

    def say(self, sysid: int, *said: Any) -> list[bytes]:
        packed = [bytes(message.pack(self.vehicles[sysid])) for message in said]
        for frame in packed:
            self.routers[sysid].route_frames(self.codec.decode(frame), self.forwarder.links[sysid].ways[0].write)
        return packed

    def acts(self, sysid: int = 7) -> list[StationActed]:
        return [one for one in self.said[sysid] if isinstance(one, StationActed)]


def test_every_frame_of_every_vehicle_goes_to_every_station_as_it_came() -> None:
    sky = Sky()
    first, second = Station(sky), Station(sky, (250, 190))
    first.say(BEAT)
    second.say(BEAT)
    came = [*sky.say(7, PLACE), *sky.say(8, mav.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))]
    assert first.heard == second.heard == came


def test_answers_go_to_their_addressee_and_ours_to_no_station() -> None:
    sky = Sky()
    first, second = Station(sky), Station(sky, (250, 190))
    first.say(BEAT)
    second.say(BEAT)
    sky.say(7, *(mav.MAVLink_mission_ack_message(system, 190, 0) for system in (255, OURS, 33)))
    assert (first.types, second.types) == (["MISSION_ACK"], [])


def test_our_radio_is_reported_to_them_as_well() -> None:
    sky = Sky()
    station, radio = Station(sky), mav.MAVLink(None, srcSystem=51, srcComponent=68)
    station.say(BEAT)
    report = bytes(mav.MAVLink_radio_status_message(200, 190, 90, 50, 40, 0, 0).pack(radio))
    sky.routers[7].route_frames(sky.codec.decode(report), lambda _: True)
    assert station.heard == [report]


def test_a_listening_station_reaches_no_vehicle_which_is_reported_once() -> None:
    sky = Sky(allow=False)
    station = Station(sky)
    for _ in range(30):
        station.say(BEAT, RTL, mav.MAVLink_param_set_message(7, 1, b"X", 1.0, 9))
        sky.now_s += 0.1
    assert sky.sent == {7: [], 8: []}
    assert sky.acts() == [StationActed(255, 190, link.ORDERS_NOT_ALLOWED, passed=False)]
    assert 1 <= sky.said[8].count(StationHeard(255, 190, behind=True)) <= 4
    assert not any(isinstance(one, OrderSeen) for one in sky.said[7])


def test_an_order_goes_to_its_vehicle_as_it_came_and_is_seen_as_that_stations() -> None:
    sky = Sky()
    station = Station(sky)
    [frame] = station.say(RTL)
    assert sky.sent == {7: [frame], 8: []}
    assert sky.log.frames == [frame]
    assert sky.said[7] == [
        OrderSeen(20, None, 255, 7), StationActed(255, 190, "sends MAV_CMD_NAV_RETURN_TO_LAUNCH"),
    ]  # fmt: skip
    assert sky.said[8] == []


def test_a_mode_of_px4_is_read_as_px4_has_it() -> None:
    sky = Sky()
    sky.say(7, mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3))
    Station(sky).say(mav.MAVLink_command_long_message(7, 1, 176, 0, 1.0, 4.0, 5.0, *[0.0] * 4))
    assert OrderSeen(176, 5 << 24 | 4 << 16, 255, 7) in sky.said[7]


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (mav.MAVLink_param_set_message(7, 1, b"RTL_ALT", 3000.0, 9), "sets RTL_ALT to 3000"),
        (mav.MAVLink_mission_count_message(7, 1, 12, 0), "uploads a mission, 12 items"),
        (mav.MAVLink_mission_count_message(7, 1, 1, 1), "uploads a fence, 1 item"),
        (mav.MAVLink_mission_clear_all_message(7, 1, 2), "clears rally points"),
        (mav.MAVLink_mission_clear_all_message(7, 1, 255), "clears all lists"),
        (mav.MAVLink_mission_set_current_message(7, 1, 4), "moves its mission to item 4"),
        (mav.MAVLink_mission_write_partial_list_message(7, 1, 2, 5), "changes items 2 to 5 of its mission"),
        (mav.MAVLink_set_mode_message(7, 1, 6), "orders mode 6"),
        (mav.MAVLink_manual_control_message(7, 0, 0, 500, 0, 0), "steers it with a joystick, or by set points"),
        (mav.MAVLink_command_int_message(7, 1, 6, 192, 0, 0, *[0.0] * 4, 0, 0, 0.0), "sends MAV_CMD_DO_REPOSITION"),
        (mav.MAVLink_command_long_message(7, 1, 60001, 0, *[0.0] * 7), "sends command 60001"),
    ],
)
def test_the_crew_is_informed_about_changes_by_a_station(act: Any, words: str) -> None:
    sky = Sky()
    station = Station(sky)
    for _ in range(5):  # it asks again until it is answered
        station.say(act)
        sky.now_s += 1.0
    assert sky.acts() == [StationActed(255, 190, words)]
    assert sky.acts(8) == []
    assert len(sky.sent[7]) == 5


@pytest.mark.parametrize(
    "asks",
    [
        BEAT,
        mav.MAVLink_param_request_read_message(7, 1, b"X", -1),
        mav.MAVLink_command_long_message(7, 1, 512, 0, 148.0, *[0.0] * 6),
        mav.MAVLink_mission_request_list_message(7, 1, 0),
        mav.MAVLink_timesync_message(0, 5),
        mav.MAVLink_request_data_stream_message(7, 1, 0, 4, 1),
    ],
)
def test_questions_are_passed_on_without_a_word(asks: Any) -> None:
    sky = Sky()
    [frame] = Station(sky).say(asks)
    assert sky.sent[7] == [frame]
    assert sky.acts() == []


def test_a_thousand_parameters_are_a_few_lines() -> None:
    sky = Sky()
    station = Station(sky)
    for number in range(1000):
        station.say(mav.MAVLink_param_set_message(7, 1, f"P{number}".encode(), 1.0, 9))
        sky.now_s += 0.01
    assert len(sky.sent[7]) == 1000
    assert TOLD_AT_ONCE <= len(sky.acts()) <= TOLD_AT_ONCE + 2
    assert sky.acts()[-1].words.endswith(link.OTHERS_NOT_LISTED)


def test_what_a_hundred_strangers_may_not_do_is_a_bounded_number_of_lines() -> None:
    sky = Sky(allow=False)
    for system in range(20, 220):
        Station(sky, (system, 190)).say(RTL)
    assert len(sky.acts()) == MOST_STATIONS


@pytest.mark.parametrize(
    ("sender", "why"),
    [((OURS, 190), link.HAS_OUR_SYSTEM.format(ours=OURS)), ((8, 1), link.HAS_VEHICLES_SYSTEM)],
)
def test_no_station_orders_under_our_number_or_a_vehicles(sender: tuple[int, int], why: str) -> None:
    sky = Sky()
    Station(sky, sender).say(BEAT, RTL)
    assert sky.sent == {7: [], 8: []}
    assert sky.acts() == [StationActed(*sender, why, passed=False)]


@pytest.mark.parametrize("one_port", [True, False])
def test_a_broadcast_goes_once_over_each_channel(one_port: bool) -> None:
    sky = Sky(one_port=one_port)
    [frame] = Station(sky).say(mav.MAVLink_set_mode_message(0, 1, 6))
    assert sky.sent == {7: [frame], 8: [] if one_port else [frame]}
    assert sky.log.frames == [frame, frame], "in the telemetry log of each"
    for sysid in (7, 8):
        assert OrderSeen(176, 6, 255, 0) in sky.said[sysid]


def packed(number: int, payload: bytes, system: int) -> bytes:
    """Return a whole frame of any message, whatever its fields say."""
    kind = mav.mavlink_map[number]
    body = payload[: kind.unpacker.size].ljust(kind.unpacker.size, b"\xff")
    head = struct.pack("<BBBBBBBHB", 0xFD, len(body), 0, 0, 0, system, 190, number & 0xFFFF, number >> 16)
    return head + body + struct.pack("<H", mav.x25crc(head[1:] + body + bytes([kind.crc_extra])).crc)


@given(
    said=st.lists(
        st.tuples(st.sampled_from(IDS), st.binary(max_size=255), st.sampled_from([7, 33, OURS, 255])), max_size=8
    ),
    allow=st.booleans(),
    share=st.sampled_from([None, RADIO]),
)
def test_whatever_a_station_sends_it_goes_where_it_may_and_breaks_nothing(
    said: list[tuple[int, bytes, int]], allow: bool, share: RadioShare | None
) -> None:
    sky = Sky(allow=allow, share=share)
    station = Station(sky)
    for number, payload, system in said:
        frame = packed(number, payload, system)
        before = {sysid: len(sent) for sysid, sent in sky.sent.items()}
        station.port.route_frames(station.codec.decode(frame), station.write)
        came = {sysid: sent[before[sysid] :] for sysid, sent in sky.sent.items()}
        assert all(one in ([], [frame]) for one in came.values()), "as it came, and once"
        reached = {sysid for sysid, one in came.items() if one}
        assert not reached or (allow and system not in {7, OURS})
        assert not reached or target_of(frame) in {0, *reached}
    assert station.heard == [], "nothing goes back to where it came from"


def test_what_would_fill_a_radio_is_not_passed_on_and_told_once() -> None:
    """QGroundControl asks for everything at 4 Hz, all parameters and its component's files."""
    sky = Sky(one_port=True, share=RADIO)
    station = Station(sky)
    for _ in range(20):
        for stream in range(13):
            station.say(mav.MAVLink_request_data_stream_message(0, 0, stream, 4, 1))
        station.say(mav.MAVLink_param_request_list_message(7, 1), BEAT)
        sky.now_s += 0.25
    types = {mav.MAVLink(None).decode(bytearray(frame)).get_type() for frame in sky.sent[7]}
    assert types == {"HEARTBEAT"}
    assert 5 <= len(sky.sent[7]) <= 7, "once a second at most"
    assert sky.acts() == [StationActed(255, 190, link.WOULD_FILL_RADIO, passed=False)]


def test_a_radio_that_only_reports_itself_is_spared_too() -> None:
    sky = Sky(share=RadioShare(1, others_bytes_s=None))
    station, radio = Station(sky), mav.MAVLink(None, srcSystem=51, srcComponent=68)
    asks = mav.MAVLink_request_data_stream_message(7, 1, 0, 4, 1)
    station.say(asks)
    report = bytes(mav.MAVLink_radio_status_message(200, 190, 90, 50, 40, 0, 0).pack(radio))
    sky.routers[7].route_frames(sky.codec.decode(report), lambda _: True)
    station.say(asks)
    assert len(sky.sent[7]) == 1
    assert sky.acts() == [StationActed(255, 190, link.WOULD_FILL_RADIO, passed=False)]


def test_corrections_pass_beside_our_own_traffic_and_never_ahead_of_it() -> None:
    sky = Sky(one_port=True, share=RADIO)
    station, correction = Station(sky), mav.MAVLink_gps_rtcm_data_message(0, 100, b"\1" * 180)
    sky.busy = True
    station.say(correction)
    assert sky.sent[7] == []
    sky.busy = False
    [frame] = station.say(correction)
    assert sky.sent[7] == [frame], "once, for both vehicles"


def test_a_mission_of_theirs_waits_for_the_end_of_ours() -> None:
    sky = Sky()
    station, upload = Station(sky), mav.MAVLink_mission_count_message(7, 1, 12, 0)
    sky.busy = True
    station.say(upload, RTL)
    assert len(sky.sent[7]) == 1, "an order is none"
    assert StationActed(255, 190, link.TRANSFER_UNDER_WAY, passed=False) in sky.acts()
    sky.busy = False
    station.say(upload)
    assert len(sky.sent[7]) == 2


@pytest.mark.parametrize(("key", "passes"), [(b"k" * 32, True), (b"x" * 32, False), (None, False)])
def test_only_a_station_with_the_key_orders_signed_vehicles(key: bytes | None, passes: bool) -> None:
    sky = Sky(key=b"k" * 32)
    station = Station(sky)
    if key is not None:
        signing = station.mav.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = key, 5, True
        signing.timestamp = LinkSigning(key, 5, time.time).timestamp_ticks()
    [frame] = station.say(RTL)
    assert sky.sent[7] == ([frame] if passes else [])
    assert (StationActed(255, 190, link.NOT_SIGNED, passed=False) in sky.acts()) is not passes


def test_a_station_that_called_and_is_silent_is_sent_nothing_more() -> None:
    sky = Sky()
    station = Station(sky)
    station.say(BEAT)
    sky.now_s += GONE_S + 1.0
    sky.say(7, PLACE)
    assert station.heard == []
    station.say(BEAT)
    sky.say(7, PLACE)
    assert len(station.heard) == 1


def test_what_we_call_is_one_station_however_it_answers() -> None:
    sky = Sky()
    station = Station(sky, connection="udpout://127.0.0.1:14550")
    station.port.connect_all(station.write)
    answers = list[bytes]()
    frame = bytes(BEAT.pack(station.mav))
    station.port.route_frames(station.codec.decode(frame), into(answers))
    sky.now_s += 10 * GONE_S
    sky.say(7, PLACE)
    assert (len(station.heard), answers) == (1, [])


def test_a_port_that_is_lost_and_back_is_reported() -> None:
    sky = Sky()
    station = Station(sky, connection="tcpout://127.0.0.1:5760")
    station.port.connect_all(station.write)
    station.port.disconnect(station.write)
    sky.say(7, PLACE)
    station.port.connect_all(station.write)
    assert station.heard == []
    assert [one.words for one in sky.acts()] == [
        "tcpout://127.0.0.1:5760 is lost; it is opened again", "tcpout://127.0.0.1:5760 is open again",
    ]  # fmt: skip
