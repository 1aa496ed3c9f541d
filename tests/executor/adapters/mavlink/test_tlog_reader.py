"""The reader of telemetry logs says what the codec of a link says, and uses what can be used of damaged files."""

from __future__ import annotations

import random
import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mav

from executor.adapters.chunks import PIECE
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.core.interface.messages import (
    Attitude,
    Battery,
    Heartbeat,
    HeightTarget,
    ListedItem,
    OrderSeen,
    Position,
    Radio,
    RcChannels,
    StatusText,
    SystemStatus,
    Traffic,
    VehicleSetting,
)
from executor.core.interface.recorded_log import SkippedRecords
from tests.recorded import BEGAN_USEC, Writer, battery, flight, heartbeat, position, station, text


def read(path: Path) -> tuple[list[tuple[int, int, Any]], TelemetryFile]:
    file = TelemetryFile(path)
    return list(file.read_records()), file


def written(tmp_path: Path, *messages: Any, system: int = 7) -> Path:
    """Return a log of a vehicle's messages, a second apart."""
    writer = Writer()
    for second, message in enumerate(messages):
        writer.say(float(10 * second), system, message)
    return writer.write(tmp_path / "a.tlog")


SAID = [
    heartbeat(armed=True, mode=6, status=5),
    position(3.0, 40.0),
    battery(87, 11.95, 29.4, 1200, 2),
    mav.MAVLink_battery_status_message(1, 0, 0, 32767, [4010, 4000, 3990, *[65535] * 7], -1, -1, -1, -1, 0, 1),
    mav.MAVLink_sys_status_message(1 << 28, 3, 1, 0, 11800, 100, 55, 0, 0, 0, 0, 0, 0),
    mav.MAVLink_mission_current_message(5, 11),
    mav.MAVLink_gps_raw_int_message(2_500_000, 3, 0, 0, 0, 0, 0, 0, 0, 12, 0, 1800),
    mav.MAVLink_gps2_raw_message(2_500_000, 1, 0, 0, 0, 0, 0, 0, 0, 255, 0, 0),
    ardupilotmega.MAVLink_ekf_status_report_message(831, 0.1, 0.1, 0.1, 0.1, 0.1),
    mav.MAVLink_estimator_status_message(0, 167, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5),
    mav.MAVLink_mission_item_reached_message(4),
    mav.MAVLink_extended_sys_state_message(0, 2),
    text("Battery Failsafe"),
    mav.MAVLink_nav_controller_output_message(0.0, 0.0, 0, 0, 0, 3.5, 0.0, 0.0),
]


@pytest.mark.parametrize("message", SAID, ids=lambda one: str(one.get_type()))
def test_it_reads_what_the_codec_reads(message: Any, tmp_path: Path) -> None:
    records, _ = read(written(tmp_path, heartbeat(), message))
    codec = MavlinkCodec()
    [received] = codec.decode(Writer().frame(7, message))
    assert received.message in [said for _, system, said in records if system == 7]


def test_a_long_text_is_put_together(tmp_path: Path) -> None:
    first, rest = "x" * 50, "the end"
    parts = [mav.MAVLink_statustext_message(4, part.encode(), 9, number) for number, part in enumerate((first, rest))]
    records, _ = read(written(tmp_path, heartbeat(), *parts))
    assert [said.text for _, _, said in records if isinstance(said, StatusText)] == [first + rest]


def test_unknown_is_never_zero(tmp_path: Path) -> None:
    nothing = mav.MAVLink_battery_status_message(0, 0, 0, 32767, [65535] * 10, -100, -7, -1, -100, 0, 0)
    records, file = read(written(tmp_path, heartbeat(), nothing, mav.MAVLink_global_position_int_message(*[0] * 9)))
    [said] = [said for _, _, said in records if isinstance(said, Battery)]
    assert (said.remaining_pct, said.voltage_v, said.current_a, said.consumed_ah) == (None, None, None, None)
    assert not any(isinstance(said, Position) for _, _, said in records)
    assert file.skipped.impossible == 1


def test_every_record_comes_where_all_are_wanted(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    for tenth in range(1, 51):
        for message in (battery(80, 11.9), position(tenth / 10), mav.MAVLink_sys_status_message(*[0] * 13)):
            writer.say(tenth / 10, 7, message)
    path = writer.write(tmp_path / "a.tlog")
    said = [one for _, _, one in TelemetryFile(path, every_record=True).read_records()]
    assert [sum(isinstance(one, kind) for one in said) for kind in (Battery, Position, SystemStatus)] == [50, 50, 50]
    usual, _ = read(path)
    assert sum(isinstance(one, Battery) for _, _, one in usual) < 20


def test_cell_voltages_are_read_where_the_vehicle_reports_them(tmp_path: Path) -> None:
    cells = mav.MAVLink_battery_status_message(0, 0, 0, 32767, [4000, 3900, 3800, *[65535] * 7], 0, 0, -1, 50, 0, 1)
    records, _ = read(written(tmp_path, heartbeat(), cells, battery(50, 11.7)))
    first, second = (said for _, _, said in records if isinstance(said, Battery))
    assert (first.cells_v, second.cells_v) == ((4.0, 3.9, 3.8), ())


def test_both_directions_and_several_vehicles(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(5))
    flight(writer, 4, range(5))
    writer.say(1.0, 255, station())
    order = mav.MAVLink_command_long_message(3, 1, 20, 0, *[0.0] * 7)
    writer.say(2.0, 255, order)
    writer.say(2.2, 255, mav.MAVLink_param_request_read_message(3, 1, b"X", -1))
    radio = mav.MAVLink_radio_status_message(120, 110, 90, 30, 40, 0, 0)
    writer.say(3.0, 51, radio)
    records, file = read(writer.write(tmp_path / "a.tlog"))
    assert file.stations == {255}
    assert {system for _, system, said in records if isinstance(said, Heartbeat)} == {3, 4}
    assert [(system, said) for _, system, said in records if isinstance(said, OrderSeen)] == [
        (3, OrderSeen(20, by=255))
    ]
    assert [(system, said) for _, system, said in records if isinstance(said, Radio)] == [
        (0, Radio(120, 110, 30, 40, 90))
    ]


def test_only_the_autopilot_speaks_for_a_vehicle(tmp_path: Path) -> None:
    writer, gimbal = Writer(), mav.MAVLink(None, srcSystem=7, srcComponent=154)
    for second in range(20):
        if second < 10:
            writer.say(float(second), 7, heartbeat())
        for message in (heartbeat(armed=False, kind=26), text("Crash: Disarming"), battery(1), position(second)):
            writer.records.append((second + 0.5, bytes(message.pack(gimbal))))
    records, file = read(writer.write(tmp_path / "a.tlog"))
    said = [one for _, system, one in records if system == 7 and one is not None and not isinstance(one, Traffic)]
    assert said == [Heartbeat(3, 3, armed=True, system_status=4, vehicle_type=2)] * 10
    assert file.heard == {7: BEGAN_USEC + 9_000_000}


def test_an_autopilot_with_another_number_speaks_until_the_first_is_heard(tmp_path: Path) -> None:
    writer, other = Writer(), mav.MAVLink(None, srcSystem=7, srcComponent=2)
    for second in range(6):
        writer.records.append((second + 0.5, bytes(heartbeat(mode=second).pack(other))))
    writer.say(3.0, 7, heartbeat(mode=77))
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    assert [one.custom_mode for _, _, one in records if isinstance(one, Heartbeat)] == [0, 1, 2, 77]


@pytest.mark.parametrize("lat", [-(2**31), 2**31 - 1])
def test_what_no_vehicle_can_say_is_passed_over(lat: int, tmp_path: Path) -> None:
    nowhere = mav.MAVLink_global_position_int_message(1000, lat, 133000000, 300000, 20000, 0, 0, 0, 0)
    records, file = read(written(tmp_path, heartbeat(), nowhere))
    assert not any(isinstance(said, Position) for _, _, said in records)
    assert file.skipped.impossible == 1


def test_lost_frames_are_counted_by_their_sequence_numbers(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(200):
        for part in range(3):
            frame = writer.frame(7, heartbeat() if part == 0 else position(second + part / 3))
            if (3 * second + part) % 4 or part == 0:
                writer.records.append((second + part / 3, frame))
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    traffic = [said for _, _, said in records if isinstance(said, Traffic)]
    received, missing = sum(one.received for one in traffic), sum(one.missing for one in traffic)
    assert missing / (received + missing) == pytest.approx(1 / 6, abs=0.02)


def test_a_vehicle_of_which_nothing_is_read_is_heard(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    for tenth in (*range(1, 50), *range(100, 150)):
        writer.say(tenth / 10, 7, mav.MAVLink_attitude_message(tenth, 0, 0, 0, 0, 0, 0))
    file, passed = TelemetryFile(writer.write(tmp_path / "a.tlog")), []
    for usec, _, said in file.read_records():
        if said is None:
            passed.append(((usec - BEGAN_USEC) / 1e6, (file.heard.get(7, usec) - BEGAN_USEC) / 1e6))
    assert passed[-1] == (10.0, 4.9), "what is heard again is told before it counts as heard"
    assert (file.heard[7] - BEGAN_USEC) / 1e6 == 14.9


def test_an_empty_file_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").touch()
    records, file = read(tmp_path / "a.tlog")
    assert (records, bool(file.skipped)) == ([], False)


def test_a_file_that_is_cut_off_is_read_to_its_last_whole_record(tmp_path: Path) -> None:
    path = written(tmp_path, *(heartbeat() for _ in range(5)))
    path.write_bytes(path.read_bytes()[:-4])
    records, file = read(path)
    assert sum(isinstance(said, Heartbeat) for _, _, said in records) == 4
    assert (file.skipped.truncated, file.skipped.garbage_runs) == (1, 0)


def test_garbage_costs_nothing_behind_it(tmp_path: Path) -> None:
    noise = random.Random(1).randbytes(500)
    path = written(tmp_path, *(heartbeat() for _ in range(6)))
    whole = path.read_bytes()
    record = len(whole) // 6
    path.write_bytes(whole[: 3 * record] + noise + whole[3 * record :])
    records, file = read(path)
    assert sum(isinstance(said, Heartbeat) for _, _, said in records) == 6
    assert 1 <= file.skipped.garbage_runs <= 3


def test_a_clock_that_leaps_by_years_loses_nothing_for_long(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(10))
    before = [(at_s - BEGAN_USEC / 1e6, frame) for at_s, frame in writer.records]
    later = Writer()
    flight(later, 3, range(10, 20))
    path = tmp_path / "a.tlog"
    path.write_bytes(Writer(records=before).data() + later.data())
    records, _ = read(path)
    assert sum(isinstance(said, Heartbeat) for _, _, said in records) == 20


def test_a_wrong_checksum_is_not_believed(tmp_path: Path) -> None:
    path = written(tmp_path, *(heartbeat() for _ in range(4)))
    data = bytearray(path.read_bytes())
    data[2 * (len(data) // 4) + 20] ^= 255
    path.write_bytes(data)
    records, file = read(path)
    assert sum(isinstance(said, Heartbeat) for _, _, said in records) == 3
    assert file.skipped.bad_checksums == 1


def test_a_file_longer_than_a_piece_is_read_the_same(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(2000))
    once = writer.data()
    copies = 2 * PIECE // len(once) + 1
    path = tmp_path / "a.tlog"
    path.write_bytes(once * copies)
    file = TelemetryFile(path)
    assert sum(isinstance(said, Heartbeat) for _, _, said in file.read_records()) == 2000 * copies
    assert file.skipped.counts() == SkippedRecords(time_back=copies - 1).counts(), (
        "each copy begins where the last one began"
    )


def test_the_older_version_of_mavlink(tmp_path: Path) -> None:
    sender = mav.MAVLink(None, srcSystem=9, srcComponent=1)
    frame = bytes(heartbeat().pack(sender, force_mavlink1=True))
    (tmp_path / "a.tlog").write_bytes(struct.pack(">Q", BEGAN_USEC) + frame)
    records, _ = read(tmp_path / "a.tlog")
    assert [(system, type(said)) for _, system, said in records if said is not None] == [(9, Heartbeat)]


def test_an_accepted_order_is_seen_where_only_the_vehicle_was_recorded(tmp_path: Path) -> None:
    answers = [
        mav.MAVLink_command_ack_message(command, result) for command, result in ((176, 0), (11, 0), (176, 4), (511, 0))
    ]
    records, _ = read(written(tmp_path, heartbeat(), *answers))
    assert [said for _, system, said in records if system == 7 and isinstance(said, OrderSeen)] == [OrderSeen(176)] * 2


@pytest.mark.parametrize(("autopilot", "mode"), [(3, 6), (12, 4 << 16 | 5 << 24)])
def test_an_order_and_its_mode(autopilot: int, mode: int, tmp_path: Path) -> None:
    writer, main, sub = Writer(), mode & 255 or 4, mode >> 24
    writer.say(0.0, 7, heartbeat(autopilot=autopilot))
    writer.say(1.0, 254, mav.MAVLink_command_long_message(7, 1, 176, 0, 1, main, sub, 0, 0, 0, 0))
    writer.say(2.0, 254, mav.MAVLink_set_mode_message(7, 1, mode))
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    orders = [(system, said) for _, system, said in records if isinstance(said, OrderSeen)]
    assert orders == [(7, OrderSeen(176, mode, 254))] * 2


def test_parameters_are_settings(tmp_path: Path) -> None:
    named = ((b"BATT_CAPACITY", 5100.0), (b"FLTMODE_CH", 5.0), (b"INS_GYROFFS_X", 0.1))
    messages = [mav.MAVLink_param_value_message(name, value, 9, 600, 1) for name, value in named]
    records, _ = read(written(tmp_path, heartbeat(), *messages))
    said = [one for _, _, one in records if isinstance(one, VehicleSetting)]
    assert said == [VehicleSetting("BATT_CAPACITY", 5100.0), VehicleSetting("FLTMODE_CH", 5.0)]


@pytest.mark.parametrize("older", [True, False])
def test_a_switch_is_reported_at_once(older: bool, tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    for tenth in range(1, 15):
        switch = 1100 if tenth < 8 else 1900
        values = [1500 + tenth, 1500, 1100, 1500, switch, 65535, 65535, 65535]
        message = (
            mav.MAVLink_rc_channels_raw_message(0, 0, *values, 255)
            if older
            else mav.MAVLink_rc_channels_message(0, 8, *values, *[0] * 10, 255)
        )
        writer.say(tenth / 10, 7, message)
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    told = [(t_usec - BEGAN_USEC, said.values_us[3:6]) for t_usec, _, said in records if isinstance(said, RcChannels)]
    assert told == [
        (100_000 * tenth, (1500, 1100 if tenth < 8 else 1900, 0)) for tenth in range(1, 15, 2)
    ]  # fmt: skip


def test_a_steep_attitude_is_reported(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    for half in range(1, 9):
        writer.say(half / 2, 7, mav.MAVLink_attitude_message(0, 1.2 if half in {4, 5} else 0.1, 0.0, 0, 0, 0, 0))
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    told = [(t_usec - BEGAN_USEC, round(said.roll_deg)) for t_usec, _, said in records if isinstance(said, Attitude)]
    assert told == [(500_000 * half, 69 if half in {4, 5} else 6) for half in range(1, 9)]


def test_of_two_lists_of_channels_the_longer_is_taken(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    for tick in range(1, 9):
        writer.say(tick / 4, 7, mav.MAVLink_rc_channels_message(0, 12, *[1500] * 12, *[0] * 6, 255))
        writer.say(tick / 4 + 0.01, 7, mav.MAVLink_rc_channels_raw_message(0, 0, *[1500] * 8, 255))
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    assert [len(said.values_us) for _, _, said in records if isinstance(said, RcChannels)] == [12] * 8


def test_an_incomplete_text_is_shown_as_far_as_it_came(tmp_path: Path) -> None:
    part = mav.MAVLink_statustext_message(2, b"Battery 1 is critical 13.10V used 6400 mAh, going ", 7, 0)
    said = [said for _, _, said in read(written(tmp_path, heartbeat(), part, *[heartbeat()] * 3))[0]]
    first = StatusText(2, "Battery 1 is critical 13.10V used 6400 mAh, going")
    assert said.count(first) == 1
    assert said.index(first) < len(said) - 1, "it does not wait for the log's end"
    last = [said for _, _, said in read(written(tmp_path, heartbeat(), part))[0]]
    assert last[-1] == first


ITEM = (3, 16, 0, 1, 0.0, 0.0, 0.0, 0.0)


def test_items_are_a_vehicles_on_their_way_to_it_and_from_it(tmp_path: Path) -> None:
    """Those of a fence, and a place to fly to at once, are none of its mission."""
    writer = Writer()
    writer.say(0.0, 7, heartbeat())
    up = mav.MAVLink_mission_item_int_message(7, 1, 2, *ITEM, 496000000, 156000000, 30.0, 0)
    guided = mav.MAVLink_mission_item_int_message(
        7, 1, 0, 3, 16, 2, 1, 0.0, 0.0, 0.0, 0.0, 496000000, 156000000, 9.0, 0
    )
    fence = mav.MAVLink_mission_item_int_message(7, 1, 0, *ITEM, 496000000, 156000000, 30.0, 1)
    down = mav.MAVLink_mission_item_message(255, 190, 3, *ITEM, 49.6, 15.6, 40.0)
    for at_s, (system, message) in enumerate([(255, up), (255, guided), (255, fence), (7, down)], start=1):
        writer.say(float(at_s), system, message)
    records, _ = read(writer.write(tmp_path / "a.tlog"))
    found = [(system, said.item.seq, said.item.z) for _, system, said in records if isinstance(said, ListedItem)]
    assert found == [(7, 2, 30.0), (7, 3, 40.0)]


def test_how_far_below_its_target_a_px4_is(tmp_path: Path) -> None:
    px4 = heartbeat(autopilot=12)
    here = mav.MAVLink_local_position_ned_message(0, 0.0, 0.0, -26.5, 0.0, 0.0, 0.0)
    aims = mav.MAVLink_position_target_local_ned_message(0, 1, 0, 0.0, 0.0, -30.0, *[0.0] * 8)
    records, _ = read(written(tmp_path, px4, aims, here, aims))
    assert [said for _, _, said in records if isinstance(said, HeightTarget)] == [HeightTarget(3.5)]
