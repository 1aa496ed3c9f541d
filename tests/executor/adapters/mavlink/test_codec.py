"""MAVLink frames to messages and back: what vehicles mark as unknown, and what the air makes of frames."""

from __future__ import annotations

import math
import struct
from typing import Any

import hypothesis
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.message_readers import GAP, MOST_LETTERS, MOST_SPEAKERS, StatusTextAssembler
from executor.core.interface.messages import (
    Attitude,
    Battery,
    CommandAck,
    ComponentText,
    EstimatorStatus,
    FenceStatus,
    Gps,
    Heartbeat,
    Home,
    LandedState,
    Message,
    MissionAck,
    MissionCount,
    MissionCurrent,
    MissionItemInt,
    MissionReached,
    MissionRequest,
    MissionRequestList,
    OrderSeen,
    Outgoing,
    ParamRefused,
    ParamValue,
    Position,
    RcChannels,
    SendCommand,
    SendHeartbeat,
    SendParamRequest,
    SendParamSet,
    StationHeard,
    StatusText,
    SystemStatus,
    Version,
    Wind,
)
from missions import MissionItem, MissionKind
from simulator.messages import build_message
from simulator.wire import Codec as SimCodec

ARDUPILOT, PX4 = 3, 12
UNUSED = 65535


class Vehicle:
    """Packs frames as system 7 would."""

    def __init__(self, compid: int = 1) -> None:
        self.mav = mav.MAVLink(None, srcSystem=7, srcComponent=compid)

    def pack(self, message: Any) -> bytes:
        frame = bytes(message.pack(self.mav))
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame


def heard(*messages: Any, codec: MavlinkCodec | None = None) -> list[Message | None]:
    """Return what a codec makes of messages."""
    codec, vehicle = codec or MavlinkCodec(), Vehicle()
    return [received.message for message in messages for received in codec.decode(vehicle.pack(message))]


def battery_status(**changes: Any) -> Any:
    fields: dict[str, Any] = {
        "id": 0, "battery_function": 1, "type": 1, "temperature": 32767, "voltages": [16200] + [UNUSED] * 9,
        "current_battery": 1250, "current_consumed": 340, "energy_consumed": -1, "battery_remaining": 87,
        "time_remaining": 0, "charge_state": 1,
    }  # fmt: skip
    return mav.MAVLink_battery_status_message(**(fields | changes))


def battery(**changes: Any) -> Battery:
    [message] = heard(battery_status(**changes))
    assert isinstance(message, Battery)
    return message


def test_a_battery() -> None:
    assert battery() == Battery(0, 87.0, 16.2, 12.5, 0.34, 1, 0)


@pytest.mark.parametrize("remaining", [-1, -100, -106])
def test_a_percentage_below_zero_is_unknown(remaining: int) -> None:
    """-1 says unknown; PX4 without a current sensor sends it times 100, and -106 was seen (mavelous issue 50)."""
    assert battery(battery_remaining=remaining).remaining_pct is None


def test_an_empty_battery_is_known() -> None:
    assert battery(battery_remaining=0).remaining_pct == 0.0


@pytest.mark.parametrize("current", [-1, -100])
def test_a_current_below_zero_is_unknown(current: int) -> None:
    assert battery(current_battery=current).current_a is None


@pytest.mark.parametrize("consumed", [-1, -250])
def test_a_consumption_below_zero_is_unknown(consumed: int) -> None:
    assert battery(current_consumed=consumed).consumed_ah is None


def test_a_pack_of_cells_is_their_sum() -> None:
    cells = [4000] * 10
    assert battery(voltages=cells, voltages_ext=[4000, 4000, 0, 0]).voltage_v == pytest.approx(48.0)
    assert battery(voltages=[4050] * 4 + [UNUSED] * 6).voltage_v == pytest.approx(16.2)


def test_a_pack_above_65_volts_fills_a_second_cell() -> None:
    assert battery(voltages=[65534, 4466] + [UNUSED] * 8).voltage_v == pytest.approx(70.0)


def test_a_battery_without_voltages() -> None:
    assert battery(voltages=[UNUSED] * 10).voltage_v is None


def system_status(**changes: Any) -> SystemStatus:
    fields: dict[str, Any] = {
        "onboard_control_sensors_present": 0x10000000, "onboard_control_sensors_enabled": 0x10000001,
        "onboard_control_sensors_health": 0x10000001, "load": 0, "voltage_battery": 16200, "current_battery": 100,
        "battery_remaining": 87, "drop_rate_comm": 0, "errors_comm": 0, "errors_count1": 0, "errors_count2": 0,
        "errors_count3": 0, "errors_count4": 0,
    }  # fmt: skip
    [message] = heard(mav.MAVLink_sys_status_message(**(fields | changes)))
    assert isinstance(message, SystemStatus)
    return message


def test_a_system_status() -> None:
    assert system_status() == SystemStatus(87.0, 16.2, 0, prearm_ok=True, current_a=1.0)


@pytest.mark.parametrize("voltage", [0, UNUSED])
def test_no_battery_has_no_voltage_and_no_percentage(voltage: int) -> None:
    """ArduPilot says 0 V and -1 in its first seconds, PX4 65535 and -1 without a battery."""
    status = system_status(voltage_battery=voltage, battery_remaining=-1)
    assert (status.voltage_v, status.remaining_pct) == (None, None)


def attitude(roll: float, pitch: float) -> Message | None:
    [message] = heard(mav.MAVLink_attitude_message(1000, roll, pitch, 0.1, 0.0, 0.0, 0.0))
    return message


def test_an_attitude_in_degrees() -> None:
    heard_as = attitude(math.pi, -math.pi / 4)
    assert isinstance(heard_as, Attitude)
    assert (heard_as.roll_deg, heard_as.pitch_deg) == pytest.approx((180.0, -45.0))


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e9])
def test_an_attitude_that_is_none_is_not_passed_on(wrong: float) -> None:
    assert attitude(wrong, 0.0) is None
    assert attitude(0.0, wrong) is None


def gps(fix: int, satellites: int) -> Message | None:
    [message] = heard(
        mav.MAVLink_gps_raw_int_message(1_000_000, fix, 496000000, 156000000, 300000, 121, 200, 0, 0, satellites)
    )
    return message


def test_a_satellite_fix() -> None:
    assert gps(6, 17) == Gps(6, 17, measured_s=1.0)
    assert gps(0, 0) == Gps(0, 0, measured_s=1.0)


def test_how_far_off_a_fix_may_be() -> None:
    raw = mav.MAVLink_gps_raw_int_message(2_500_000, 3, 0, 0, 0, 0, 0, 0, 0, 12, 0, 1800)
    assert heard(raw) == [Gps(3, 12, accuracy_m=1.8, measured_s=2.5)]
    second = mav.MAVLink_gps2_raw_message(2_500_000, 3, 0, 0, 0, 0, 0, 0, 0, 12, 0, 0)
    assert heard(second) == [Gps(3, 12, measured_s=2.5, receiver=1)]


@pytest.mark.parametrize(("flags", "knows"), [(831, True), (16, True), (167, False), (831 | 128, False), (1024, False)])
def test_whether_an_estimator_knows_where_it_is_on_the_earth(flags: int, *, knows: bool) -> None:
    ardupilot = mav.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.1)
    px4 = mav.MAVLink_estimator_status_message(0, flags, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5)
    assert heard(ardupilot) == heard(px4) == [EstimatorStatus(is_absolute=knows)]


def test_uncounted_satellites_and_an_invalid_fix() -> None:
    assert gps(3, 255) == Gps(3, None, measured_s=1.0)
    assert gps(200, 10) is None


@pytest.mark.parametrize(
    ("north_m_s", "east_m_s", "from_deg"), [(-5.0, 0.0, 0.0), (0.0, -5.0, 90.0), (5.0, 0.0, 180.0), (0.0, 5.0, 270.0)]
)
def test_px4_says_where_the_wind_goes_and_a_crew_asks_where_it_comes_from(
    north_m_s: float, east_m_s: float, from_deg: float
) -> None:
    [message] = heard(mav.MAVLink_wind_cov_message(0, north_m_s, east_m_s, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0))
    assert isinstance(message, Wind)
    assert (message.speed_m_s, message.from_deg) == pytest.approx((5.0, from_deg))


def test_ardupilot_says_where_the_wind_comes_from_below_zero_too() -> None:
    assert heard(mav.MAVLink_wind_message(-90.0, 4.5, 0.0)) == [Wind(4.5, 270.0)]


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -1.0, 1e6])
def test_a_wind_that_is_none_is_not_passed_on(wrong: float) -> None:
    assert heard(mav.MAVLink_wind_message(90.0, wrong, 0.0)) == [None]
    if wrong != -1.0:  # the other way, that is a wind
        assert heard(mav.MAVLink_wind_cov_message(0, wrong, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0)) == [None]


def test_a_fence() -> None:
    assert heard(*(mav.MAVLink_fence_status_message(breached, 1, 1, 0) for breached in (0, 1, 2))) == [
        FenceStatus(breached=False), FenceStatus(breached=True), None,
    ]  # fmt: skip


def test_health() -> None:
    failing = system_status(onboard_control_sensors_health=0x1)
    assert (failing.unhealthy, failing.prearm_ok) == (0x10000000, False)
    assert system_status(onboard_control_sensors_present=0).prearm_ok is None


def test_a_position() -> None:
    frame = mav.MAVLink_global_position_int_message(61500, 496000000, 156000000, 470500, 20500, 300, -150, 50, 9000)
    assert heard(frame) == [Position(61.5, 49.6, 15.6, 470.5, 20.5, 3.0, -1.5, 0.5, 90.0)]
    unknown = mav.MAVLink_global_position_int_message(61500, 496000000, 156000000, 0, 0, 0, 0, 0, UNUSED)
    [position] = heard(unknown)
    assert isinstance(position, Position)
    assert position.heading_deg is None


def test_a_heartbeat_of_an_autopilot_and_of_everything_else() -> None:
    armed = mav.MAVLink_heartbeat_message(2, PX4, 129, 67371008, 4, 3)
    camera = mav.MAVLink_heartbeat_message(30, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    assert heard(armed, camera) == [Heartbeat(PX4, 67371008, armed=True, system_status=4, vehicle_type=2), None]


@pytest.mark.parametrize(("lat", "lon"), [(-(2**31), -(2**31)), (2**31 - 1, 0), (0, 0), (910000000, 0)])
def test_a_place_that_is_none_is_not_passed_on(lat: int, lon: int) -> None:
    assert heard(mav.MAVLink_global_position_int_message(61500, lat, lon, 470500, 20500, 0, 0, 0, 0)) == [None]
    assert heard(mav.MAVLink_home_position_message(lat, lon, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)) == [None]


def of_component(component: int, *messages: Any, codec: MavlinkCodec) -> list[Message | None]:
    """Return what is heard of messages of another component of system 7."""
    speaker = Vehicle(component)
    return [received.message for message in messages for received in codec.decode(speaker.pack(message))]


BEAT = mav.MAVLink_heartbeat_message(2, PX4, 128, 67371008, 4, 3)
DISARMED = mav.MAVLink_heartbeat_message(26, ARDUPILOT, 0, 0, 4, 3)


def test_only_the_autopilot_speaks_for_a_vehicle() -> None:
    codec = MavlinkCodec()
    heard(BEAT, codec=codec)
    said_by_a_gimbal = of_component(
        154,
        DISARMED,
        mav.MAVLink_global_position_int_message(61500, 496000000, 156000000, 470500, 20500, 300, -150, 50, 9000),
        battery_status(battery_remaining=3),
        mav.MAVLink_sys_status_message(0, 0, 0, 0, 3000, 0, 3, 0, 0, 0, 0, 0, 0),
        mav.MAVLink_extended_sys_state_message(0, 1),
        mav.MAVLink_mission_current_message(9, 12),
        mav.MAVLink_mission_ack_message(255, 190, 0),
        mav.MAVLink_command_ack_message(400, 0),
        mav.MAVLink_param_value_message(b"RTL_ALT", 1.0, 9, 1, 0),
        codec=codec,
    )
    assert said_by_a_gimbal == [None] * 9
    assert codec.autopilots == {7: PX4}


def test_what_other_components_say_in_words_names_them() -> None:
    text = mav.MAVLink_statustext_message(0, b"Battery Failsafe")
    assert of_component(154, text, codec=MavlinkCodec()) == [ComponentText(154, 0, "Battery Failsafe")]


@pytest.mark.parametrize(
    ("raw", "shown"),
    [
        (b"\x1b[2J\x1b]0;owned\x07", "\ufffd[2J\ufffd]0;owned\ufffd"),
        (b"all well\nuav2: landed", "all well uav2: landed"),
        ("back\u202eward \u2028line".encode(), "back\ufffdward line"),
    ],
)
def test_nothing_that_a_terminal_obeys_is_in_a_text(raw: bytes, shown: str) -> None:
    assert heard(mav.MAVLink_statustext_message(4, raw)) == [StatusText(4, shown)]


def test_a_text_has_an_end() -> None:
    codec, vehicle = MavlinkCodec(), Vehicle()
    found = list[Message]()
    for part in range(100):
        frame = vehicle.pack(mav.MAVLink_statustext_message(4, b"x" * (50 if part < 99 else 5), 9, part))
        found += [one.message for one in codec.decode(frame) if one.message is not None]
    [text] = found
    assert isinstance(text, StatusText)
    assert (len(text.text), text.text[-7:]) == (MOST_LETTERS, f"xx{GAP}")


def test_a_parameters_name_is_shown_as_text() -> None:
    [value] = heard(mav.MAVLink_param_value_message(b"A\x1b[2JB", 1.0, 9, 1, 0))
    assert value == ParamValue("A\ufffd[2JB", 1.0, 9)


def test_a_single_sender_is_forgotten_before_an_active_one() -> None:
    """Anybody may begin a text in the name of any system; a vehicle's own is put together all the same."""
    texts, parts = StatusTextAssembler(), (b"v" * 50, b"the end")
    texts.count_frame((7, 1))
    assert texts.add_part((7, 1), 4, parts[0], 9, 0) == []
    for stranger in range(1000):
        texts.count_frame((stranger % 250 + 1, 2 + stranger // 250))
        texts.add_part((stranger % 250 + 1, 2 + stranger // 250), 4, b"s" * 50, 9, 0)
        if stranger % 40 == 0:
            texts.count_frame((7, 1))
    assert texts.add_part((7, 1), 4, parts[1], 9, 1) == [StatusText(4, "v" * 50 + "the end")]
    assert len(texts._frames) <= MOST_SPEAKERS


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        (mav.MAVLink_set_mode_message(7, 1, 6), OrderSeen(176, 6, 254, 7)),
        (mav.MAVLink_command_long_message(7, 1, 176, 0, 1.0, 5.0, *[0.0] * 5), OrderSeen(176, 5, 254, 7)),
        (mav.MAVLink_command_long_message(7, 1, 20, 0, *[0.0] * 7), OrderSeen(20, None, 254, 7)),
        (mav.MAVLink_command_long_message(7, 1, 176, 0, 1.0, math.nan, *[0.0] * 5), OrderSeen(176, None, 254, 7)),
        (mav.MAVLink_command_long_message(7, 1, 511, 0, *[0.0] * 7), None),
    ],
)
def test_another_stations_order_for_a_mode(order: Any, expected: OrderSeen | None) -> None:
    codec, other = MavlinkCodec(), mav.MAVLink(None, srcSystem=254, srcComponent=190)
    assert [received.message for received in codec.decode(bytes(order.pack(other)))] == [expected]


@pytest.mark.parametrize(
    ("ack", "expected"),
    [
        (mav.MAVLink_command_ack_message(176, 0, 0, 0, 254, 190), [OrderSeen(176, None, 254, 7)]),
        (mav.MAVLink_command_ack_message(20, 5, 0, 0, 254, 0), [OrderSeen(20, None, 254, 7)]),
        (mav.MAVLink_command_ack_message(300, 0, 0, 0, 255, 230), [OrderSeen(300, None, 255, 7)]),
        # The number of SET_MODE itself, as ArduPilot 3 has it.
        (mav.MAVLink_command_ack_message(11, 0, 0, 0, 254, 190), [OrderSeen(176, None, 254, 7)]),
        # Whom these answer nothing says: they may be for us.
        (mav.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190), [CommandAck(400, 0), OrderSeen(400, None, None, 7)]),
        (mav.MAVLink_command_ack_message(400, 0), [CommandAck(400, 0), OrderSeen(400, None, None, 7)]),
        (mav.MAVLink_command_ack_message(176, 2, 0, 0, 254, 190), []),
        (mav.MAVLink_command_ack_message(511, 0, 0, 0, 254, 190), []),
        # Of a computer on board.
        (mav.MAVLink_command_ack_message(176, 0, 0, 0, 7, 191), []),
    ],
)
def test_an_answer_is_the_shadow_of_an_order(ack: Any, expected: list[Message]) -> None:
    [received] = MavlinkCodec().decode(Vehicle().pack(ack))
    assert [one for one in (received.message, *received.more) if one is not None] == expected


def test_an_order_under_our_own_number_may_be_a_routers_echo() -> None:
    """Most ground stations have the same number as ours: the core knows whether it has given one."""
    codec, twin = MavlinkCodec(), mav.MAVLink(None, srcSystem=255, srcComponent=190)
    orders = (mav.MAVLink_set_mode_message(7, 1, 6), mav.MAVLink_command_long_message(7, 1, 20, 0, *[0.0] * 7))
    found = [received.message for order in orders for received in codec.decode(bytes(order.pack(twin)))]
    assert found == [OrderSeen(176, 6, None, 7), OrderSeen(20, None, None, 7)]


def test_with_our_own_number_no_foreign_order_counts_as_ours() -> None:
    codec, other = MavlinkCodec(station=(254, 190)), mav.MAVLink(None, srcSystem=255, srcComponent=190)
    orders = (
        mav.MAVLink_set_mode_message(7, 1, 6).pack(other),
        mav.MAVLink_command_ack_message(176, 0, 0, 0, 255, 190).pack(Vehicle().mav),
        mav.MAVLink_command_ack_message(400, 0, 0, 0, 254, 190).pack(Vehicle().mav),
    )
    found = [(received.message, *received.more) for order in orders for received in codec.decode(bytes(order))]
    assert found == [
        (OrderSeen(176, 6, 255, 7),),
        (OrderSeen(176, None, 255, 7),),
        (CommandAck(400, 0), OrderSeen(400, None, None, 7)),
    ]
    [parsed] = mav.MAVLink(None).parse_buffer(codec.encode(SendHeartbeat(), 7, 1))
    assert (parsed.get_srcSystem(), parsed.get_srcComponent()) == (254, 190)


def test_our_own_heartbeat_that_comes_back_is_no_other_station() -> None:
    codec, twin = MavlinkCodec(), mav.MAVLink(None, srcSystem=255, srcComponent=190)
    ours = [codec.encode(SendHeartbeat(), 7, 1) for _ in range(5)]
    assert [received.message for frame in ours for received in codec.decode(frame)] == [None] * 5
    theirs = bytes(mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 192, 0, 4, 3).pack(twin))
    assert [received.message for received in codec.decode(theirs)] == [StationHeard(255, 190)]


def test_the_modes_of_px4_have_two_numbers() -> None:
    codec, other = MavlinkCodec(), mav.MAVLink(None, srcSystem=254, srcComponent=190)
    codec.autopilots[7] = mav.MAV_AUTOPILOT_PX4
    order = mav.MAVLink_command_long_message(7, 1, 176, 0, 1.0, 4.0, 5.0, *[0.0] * 4)
    [received] = codec.decode(bytes(order.pack(other)))
    assert received.message == OrderSeen(176, 5 << 24 | 4 << 16, 254, 7)


def test_channels_of_the_transmitter() -> None:
    codec, vehicle = MavlinkCodec(), mav.MAVLink(None, srcSystem=7, srcComponent=1)
    list(codec.decode(bytes(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3).pack(vehicle))))
    frame = mav.MAVLink_rc_channels_message(0, 3, 1500, 65535, 1430, *[0] * 15, 100)
    assert [one.message for one in codec.decode(bytes(frame.pack(vehicle)))] == [RcChannels((1500, 0, 1430))]


def test_a_ground_stations_heartbeat_names_it() -> None:
    codec, other = MavlinkCodec(), mav.MAVLink(None, srcSystem=254, srcComponent=191)
    frame = bytes(mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3).pack(other))
    assert [received.message for received in codec.decode(frame)] == [StationHeard(254, 191)]


@pytest.mark.parametrize(("state", "on_ground"), [(0, None), (1, True), (2, False), (3, False), (4, False), (9, None)])
def test_landed_state(state: int, on_ground: bool | None) -> None:
    assert heard(mav.MAVLink_extended_sys_state_message(0, state)) == [LandedState(on_ground)]


def test_the_rest_of_what_is_followed() -> None:
    item = mav.MAVLink_mission_item_int_message(255, 190, 3, 6, 16, 0, 1, 1.0, 2.0, 0.0, math.nan, 5, 6, 20.5)
    messages = heard(
        mav.MAVLink_home_position_message(496000000, 156000000, 450000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
        mav.MAVLink_mission_current_message(4, 12),
        mav.MAVLink_mission_item_reached_message(3),
        mav.MAVLink_mission_request_message(255, 190, 5),
        mav.MAVLink_mission_request_int_message(255, 190, 6),
        mav.MAVLink_mission_ack_message(255, 190, 13),
        mav.MAVLink_mission_count_message(255, 190, 40),
        mav.MAVLink_command_ack_message(400, 4),
        mav.MAVLink_autopilot_version_message(
            0, 4 << 24 | 7 << 16 | 2 << 8 | 255, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
        ),
    )
    assert messages == [
        Home(49.6, 15.6, 450.0), MissionCurrent(4, 12), MissionReached(3), MissionRequest(5), MissionRequest(6),
        MissionAck(13), MissionCount(40), CommandAck(400, 4), Version(4, 7, 2),
    ]  # fmt: skip
    [received] = heard(item)
    assert isinstance(received, MissionItemInt)
    assert math.isnan(received.item.param4)
    assert (received.item.seq, received.item.x, received.item.z) == (3, 5, 20.5)


def test_which_mission_it_is_stands_behind_what_pymavlink_knows_of_the_message() -> None:
    vehicle, ground = SimCodec(7), MavlinkCodec()
    for number, known in ((0, None), (77, 77), (460575375, 460575375)):
        body = build_message("MISSION_CURRENT", seq=5, total=9, mission_state=3, mission_mode=1, mission_id=number)
        [received] = ground.decode(vehicle.encode(body, 1.0))
        assert received.message == MissionCurrent(5, 9, known)


def version(packed: int) -> Message | None:
    [message] = heard(mav.MAVLink_autopilot_version_message(0, packed, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0))
    return message


@pytest.mark.parametrize(
    ("kind", "words"), [(0, "1.17.0-dev"), (128, "1.17.0-beta"), (192, "1.17.0-rc"), (255, "1.17.0")]
)
def test_a_version_in_words(kind: int, words: str) -> None:
    assert str(version(1 << 24 | 17 << 16 | kind)) == words


def test_a_version_that_is_not_filled_in_is_unknown() -> None:
    assert version(0) is None


@pytest.mark.parametrize("kind", list(MissionKind))
def test_which_of_a_vehicles_lists_is_meant(kind: MissionKind) -> None:
    item = MissionItem(0, 0, 5001, x=1, y=1)
    said = [
        mav.MAVLink_mission_request_int_message(255, 190, 3, kind),
        mav.MAVLink_mission_request_message(255, 190, 3, kind),
        mav.MAVLink_mission_ack_message(255, 190, 0, kind),
        mav.MAVLink_mission_count_message(255, 190, 4, kind),
        mav.MAVLink_mission_item_int_message(255, 190, 0, 0, 5001, 0, 1, 0, 0, 0, 0, 1, 1, 0, kind),
    ]
    assert [one for frame in said for one in heard(frame)] == [
        MissionRequest(3, kind), MissionRequest(3, kind), MissionAck(0, kind), MissionCount(4, kind),
        MissionItemInt(item, kind),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", [3, 255])
def test_a_list_that_is_not_known_says_nothing(kind: int) -> None:
    assert heard(mav.MAVLink_mission_count_message(255, 190, 4, kind)) == [None]


@pytest.mark.parametrize("kind", list(MissionKind))
def test_what_is_sent_says_which_list_is_meant(kind: MissionKind) -> None:
    sent: list[Outgoing] = [
        MissionCount(2, kind), MissionItemInt(MissionItem(0, 0, 5001), kind), MissionRequestList(kind),
        MissionRequest(1, kind), MissionAck(0, kind),
    ]  # fmt: skip
    frames = [mav.MAVLink(None).decode(bytearray(MavlinkCodec().encode(one, 1, 1))) for one in sent]
    assert [frame.mission_type for frame in frames] == [kind] * len(sent)


@pytest.mark.parametrize(
    ("system", "component", "ours"),
    [(255, 190, True), (0, 0, True), (255, 0, True), (254, 190, False), (255, 230, False), (245, 190, False)],
)
def test_what_the_vehicle_says_to_another_ground_station(system: int, component: int, ours: bool) -> None:
    messages = heard(
        mav.MAVLink_mission_request_int_message(system, component, 3),
        mav.MAVLink_mission_request_message(system, component, 3),
        mav.MAVLink_mission_ack_message(system, component, 0),
        mav.MAVLink_mission_count_message(system, component, 9),
        mav.MAVLink_mission_item_int_message(system, component, 3, 6, 16, 0, 1, 0, 0, 0, 0, 5, 6, 20.5),
        mav.MAVLink_command_ack_message(400, 4, 0, 0, system, component),
    )
    assert [message is not None for message in messages] == [ours] * 6


def param(value: float, kind: int, autopilot: int) -> ParamValue:
    codec = MavlinkCodec()
    codec.autopilots = {} if autopilot is None else {7: autopilot}
    [message] = heard(mav.MAVLink_param_value_message(b"SOME_NAME", value, kind, 900, 1), codec=codec)
    assert isinstance(message, ParamValue)
    return message


def bits(value: int) -> float:
    """Return the float whose bits are those of an integer."""
    return float(struct.unpack("<f", struct.pack("<i", value))[0])


@pytest.mark.parametrize("value", [-1, 0, 1, 2, 15, 1500, 1 << 20])
def test_px4_puts_an_integers_bits_where_ardupilot_puts_its_value(value: int) -> None:
    assert param(bits(value), 6, PX4) == ParamValue("SOME_NAME", float(value), 6)
    assert param(float(value), 6, ARDUPILOT) == ParamValue("SOME_NAME", float(value), 6)


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_a_float_parameter_is_a_float(autopilot: int) -> None:
    assert param(8.5, 9, autopilot).value == 8.5


def test_a_parameter_without_a_value_is_an_answer_all_the_same() -> None:
    """Who says nothing of it may be unheard: this vehicle was heard."""
    said = {
        (1, True): mav.MAVLink_param_error_message(255, 190, b"SOME_NAME", -1, mav.MAV_PARAM_ERROR_DOES_NOT_EXIST),
        (2, False): mav.MAVLink_param_error_message(255, 190, b"SOME_NAME", -1, mav.MAV_PARAM_ERROR_PERMISSION_DENIED),
        (3, False): mav.MAVLink_param_value_message(b"SOME_NAME", math.nan, 9, 900, 1),
    }
    for (_, absent), frame in said.items():
        assert heard(frame) == [ParamRefused("SOME_NAME", absent=absent)]


@given(value=st.integers(-(2**31), 2**31 - 1))
def test_an_integer_parameter_survives_both_ways_on_px4(value: int) -> None:
    codec = MavlinkCodec()
    codec.autopilots[7] = PX4
    [received] = MavlinkCodec().decode(codec.encode(SendParamSet("SOME_NAME", float(value), 6), 7, 1))
    wire = struct.unpack_from("<f", received.frame, 10)[0]
    # A signalling NaN becomes a quiet one on its way through a float: those bits are the price of the format.
    if not math.isnan(wire):
        assert param(wire, 6, PX4).value == float(value)


def test_a_long_text_is_put_together_from_its_frames() -> None:
    codec, vehicle = MavlinkCodec(), Vehicle()
    text = "PreArm: the estimator has not settled yet, and the compass is not calibrated either; wait a while"
    raw, found = text.encode() + b"\t", list[Message | None]()
    for part in range(2):
        frame = vehicle.pack(mav.MAVLink_statustext_message(4, raw[50 * part : 50 * part + 50], 9, part))
        found += [received.message for received in codec.decode(frame)]
    assert found == [None, StatusText(4, text)]


def test_a_text_that_stays_torn_is_shown_beside_later_frames() -> None:
    codec, vehicle = MavlinkCodec(), Vehicle()
    list(codec.decode(vehicle.pack(mav.MAVLink_statustext_message(4, b"x" * 50, 9, 0))))
    later = [received for _ in range(60) for received in codec.decode(vehicle.pack(GOOD))]
    assert [received.more for received in later if received.more] == [(StatusText(4, "x" * 50),)]
    assert {received.message for received in later} == {MissionAck(0)}


OUTGOING: tuple[Outgoing, ...] = (
    SendHeartbeat(), MissionCount(12), MissionRequestList(), MissionRequest(3), MissionAck(15),
    SendCommand(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 2), SendParamRequest("RTL_ALT"),
    SendParamSet("RTL_ALT", 1500.0, 9),
    MissionItemInt(MissionItem(3, 6, 16, 1.0, 2.0, 0.0, math.nan, 496000000, -156000000, 20.5, current=True)),
)  # fmt: skip


@pytest.mark.parametrize("message", OUTGOING, ids=lambda message: type(message).__name__)
def test_what_we_send_is_understood_by_pymavlink(message: Outgoing) -> None:
    frame = MavlinkCodec().encode(message, 7, 1)
    [parsed] = mav.MAVLink(None).parse_buffer(frame)
    assert (parsed.get_srcSystem(), parsed.get_srcComponent()) == (255, 190)
    if not isinstance(message, SendHeartbeat):
        assert (parsed.target_system, parsed.target_component) == (7, 1)


def test_the_fields_of_an_item_on_the_wire() -> None:
    [parsed] = mav.MAVLink(None).parse_buffer(MavlinkCodec().encode(OUTGOING[-1], 7, 1))
    assert (parsed.seq, parsed.frame, parsed.command, parsed.current, parsed.autocontinue) == (3, 6, 16, 1, 1)
    assert (parsed.param1, parsed.param2, parsed.x, parsed.y, parsed.z) == (1.0, 2.0, 496000000, -156000000, 20.5)
    assert math.isnan(parsed.param4)


def test_our_sequence_numbers_count_on_for_each_vehicle() -> None:
    codec = MavlinkCodec()
    frames = [codec.encode(SendHeartbeat(), sysid, 1) for _ in range(300) for sysid in (7, 8)]
    assert [frame[4] for frame in frames] == [index % 256 for index in range(300) for _ in (7, 8)]


GOOD = mav.MAVLink_mission_ack_message(255, 190, 0)


@given(data=st.binary(max_size=600))
@example(data=b"\xfd" * 40)
@example(data=b"\xfe\x09\x00\x01\x01\x00" + b"\x00" * 11)
def test_garbage_never_raises_and_is_got_over(data: bytes) -> None:
    codec, vehicle = MavlinkCodec(), Vehicle()
    list(codec.decode(data))
    # A frame that garbage seems to begin takes at most 280 bytes with it.
    after = [received.message for _ in range(40) for received in codec.decode(vehicle.pack(GOOD))]
    assert MissionAck(0) in after


def test_garbage_around_a_frame_costs_only_itself() -> None:
    codec = MavlinkCodec()
    found = list(codec.decode(b"\x00\x01garbage" + Vehicle().pack(GOOD) + b"\x00\x02"))
    assert [received.message for received in found] == [MissionAck(0)]


@pytest.mark.parametrize("cut", [1, 5, 9, 12])
def test_a_truncated_frame_is_got_over(cut: int) -> None:
    codec, vehicle = MavlinkCodec(), Vehicle()
    assert list(codec.decode(vehicle.pack(GOOD)[:-cut])) == []
    after = [received.message for _ in range(10) for received in codec.decode(vehicle.pack(GOOD))]
    assert MissionAck(0) in after


def test_a_wrong_checksum_is_not_believed() -> None:
    codec, frame = MavlinkCodec(), bytearray(Vehicle().pack(GOOD))
    frame[-1] ^= 0xFF
    assert list(codec.decode(bytes(frame))) == []


IDS = sorted(mav.mavlink_map)


@given(number=st.sampled_from(IDS), payload=st.binary(max_size=255), autopilot=st.sampled_from([None, ARDUPILOT, PX4]))
def test_any_frame_with_a_good_checksum_is_read_without_a_fault(
    number: int, payload: bytes, autopilot: int | None
) -> None:
    """Whatever a faulty vehicle puts into its fields: NaN, undecodable names, numbers outside of their enums."""
    codec = MavlinkCodec()
    codec.autopilots = {} if autopilot is None else {7: autopilot}
    size = struct.calcsize(mav.mavlink_map[number].unpacker.format)
    body = payload[:size].ljust(size, b"\xff")
    head = struct.pack("<BBBBBBBHB", 0xFD, size, 0, 0, 0, 7, 1, number & 0xFFFF, number >> 16)
    crc = mav.x25crc(head[1:] + body)
    crc.accumulate(bytes([mav.mavlink_map[number].crc_extra]))
    received = list(codec.decode(head + body + struct.pack("<H", crc.crc)))
    assert len(received) <= 1


@given(number=st.sampled_from(IDS), payload=st.binary(max_size=255))
def test_what_another_parser_took_apart_says_the_same(number: int, payload: bytes) -> None:
    """Every message of the dialect, its fields as JSON would have them."""
    kind = mav.mavlink_map[number]
    body = payload[: kind.unpacker.size].ljust(kind.unpacker.size, b"\x01")
    head = struct.pack("<BBBBBBBHB", 0xFD, len(body), 0, 0, 0, 7, 1, number & 0xFFFF, number >> 16)
    crc = mav.x25crc(head[1:] + body + bytes([kind.crc_extra]))
    try:
        frame = mav.MAVLink(None).decode(bytearray(head + body + struct.pack("<H", crc.crc)))
    except mav.MAVError:
        return  # undecodable text, which no JSON has
    floats = [field for field in kind.fieldnames if isinstance(getattr(frame, field), float)]
    hypothesis.assume(all(math.isfinite(getattr(frame, field)) for field in floats))
    fields = {field: getattr(frame, field) for field in kind.fieldnames}
    if isinstance(frame, mav.MAVLink_statustext_message):
        # pymavlink's own reading loses what is not ASCII; JSON loses nothing of a text.
        text = frame._text_raw.partition(b"\0")[0]
        hypothesis.assume(text.decode(errors="ignore").encode() == text)
        fields["text"] = text.decode()
    [direct] = MavlinkCodec().decode(bytes(frame.get_msgbuf()))
    read = MavlinkCodec().read_fields(kind.msgname, 7, 1, fields)
    assert read is not None
    assert read[1] == tuple(message for message in (direct.message, *direct.more) if message is not None)


def test_fields_that_are_none_of_ours_say_nothing() -> None:
    assert MavlinkCodec().read_fields("NO_SUCH_MESSAGE", 7, 1, {}) is None
    assert MavlinkCodec().read_fields("MISSION_ACK", 7, 1, {"type": "accepted"}) is None
