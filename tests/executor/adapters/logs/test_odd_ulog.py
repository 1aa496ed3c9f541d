"""ULogs of old versions and simulated ones: topics and fields that are not there stay unknown."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import pytest

from executor.adapters.logs.ulog import UlogFile
from executor.core.interface.messages import Battery, Heartbeat, Position, RcChannels, StatusText
from executor.core.interface.recorded_log import Record
from executor.replay.log_replay import build_replay_rules, replay_log
from tests.onboard import UlogWriter

M = TypeVar("M")
SECOND = 1_000_000
STATUS = [("nav_state", "uint8_t"), ("arming_state", "uint8_t")]
OLD_BATTERY = [("voltage_v", "float"), ("current_a", "float"), ("discharged_mah", "float")]
NEW_BATTERY = [*OLD_BATTERY, ("remaining", "float"), ("connected", "uint8_t"), ("warning", "uint8_t")]
OLD_GPS = [("lat", "int32_t"), ("lon", "int32_t"), ("alt", "int32_t"), ("fix_type", "uint8_t"), ("vel_n_m_s", "float")]
NEW_GPS = [
    ("latitude_deg", "double"),
    ("longitude_deg", "double"),
    ("altitude_msl_m", "double"),
    ("fix_type", "uint8_t"),
]
RC = [("channel_count", "uint32_t"), ("rc_lost", "uint8_t"), *((f"values[{one}]", "uint16_t") for one in range(8))]


def read(writer: UlogWriter, path: Path) -> tuple[list[Record], UlogFile]:
    file = UlogFile(writer.write(path / "a.ulg"))
    return list(file.read_records()), file


def of(records: list[Record], kind: type[M]) -> list[M]:
    return [said for _, _, said in records if isinstance(said, kind)]


def flown(topics: dict[str, Any], began_usec: int = 0) -> UlogWriter:
    """Return ten seconds of an armed mission."""
    writer = UlogWriter({"vehicle_status": STATUS, **topics})
    for second in range(1, 11):
        writer.say(began_usec + second * SECOND, "vehicle_status", nav_state=3, arming_state=2)
    return writer


def test_a_battery_that_knows_no_percentage(tmp_path: Path) -> None:
    writer = flown({"battery_status": OLD_BATTERY})
    writer.say(2 * SECOND, "battery_status", voltage_v=15.5, current_a=12.0, discharged_mah=300)
    records, file = read(writer, tmp_path)
    assert [(one.remaining_pct, one.voltage_v, one.consumed_ah) for one in of(records, Battery)] == [(None, 15.5, 0.3)]
    assert not file.skipped


def test_a_battery_that_is_not_connected_says_nothing(tmp_path: Path) -> None:
    writer = flown({"battery_status": NEW_BATTERY})
    writer.say(2 * SECOND, "battery_status", voltage_v=0, remaining=0, connected=0, warning=3)
    assert of(read(writer, tmp_path)[0], Battery) == []


@pytest.mark.parametrize(
    ("fields", "values"),
    [
        (OLD_GPS, {"lat": 473977000, "lon": 85456000, "alt": 488250, "vel_n_m_s": 2.0}),
        (NEW_GPS, {"latitude_deg": 47.3977, "longitude_deg": 8.5456, "altitude_msl_m": 488.25}),
    ],
)
def test_a_place_by_the_receiver_alone(fields: Any, values: dict[str, float], tmp_path: Path) -> None:
    writer = flown({"vehicle_gps_position": fields})
    writer.say(4 * SECOND, "vehicle_gps_position", fix_type=2, **values)
    writer.say(5 * SECOND, "vehicle_gps_position", fix_type=3, **values)
    [there] = of(read(writer, tmp_path)[0], Position)
    assert there.lat_deg == pytest.approx(47.3977)
    assert (there.alt_msl_m, there.alt_rel_m) == (488.25, 0.0)
    assert there.north_m_s == values.get("vel_n_m_s", 0.0)


def test_the_clock_of_a_simulated_vehicle_is_the_worlds(tmp_path: Path) -> None:
    writer = flown({}, began_usec=1_710_773_350 * SECOND)
    writer.began_usec = 1_710_773_350 * SECOND
    records, file = read(writer, tmp_path)
    assert [beat.armed for beat in of(records, Heartbeat)] == [True] * 10
    assert not file.skipped


def test_a_time_that_is_damaged_is_counted(tmp_path: Path) -> None:
    writer = flown({})
    writer.say(1 << 60, "vehicle_status", nav_state=3, arming_state=1)
    records, file = read(writer, tmp_path)
    assert all(beat.armed for beat in of(records, Heartbeat))
    assert file.skipped.impossible == 1


def test_without_vehicle_status_nothing_is_known(tmp_path: Path) -> None:
    writer = UlogWriter({"battery_status": OLD_BATTERY})
    writer.say(SECOND, "battery_status", voltage_v=15.5)
    path = writer.write(tmp_path / "a.ulg")
    found = replay_log(UlogFile(path), build_replay_rules(None))
    assert found.vehicles == ()
    assert any("no vehicle_status" in note for note in found.notes)


def test_what_flies_with_wings_is_not_followed(tmp_path: Path) -> None:
    writer = UlogWriter({"vehicle_status": [*STATUS, ("vehicle_type", "uint8_t")]})
    writer.say(SECOND, "vehicle_status", nav_state=3, arming_state=2, vehicle_type=2)
    path = writer.write(tmp_path / "a.ulg")
    assert any("fixed wing" in note for note in replay_log(UlogFile(path), build_replay_rules(None)).notes)


def test_channels_of_a_receiver_that_hears_its_transmitter(tmp_path: Path) -> None:
    writer, sent = flown({"input_rc": RC}), {f"values[{one}]": 1500 for one in range(8)}
    writer.say(2 * SECOND, "input_rc", channel_count=6, **sent)
    writer.say(3 * SECOND, "input_rc", channel_count=6, rc_lost=1, **dict.fromkeys(sent, 900))
    assert of(read(writer, tmp_path)[0], RcChannels) == [RcChannels((1500,) * 6)]


def test_a_text_without_the_consoles_colours(tmp_path: Path) -> None:
    writer = flown({})
    writer.text(2 * SECOND, "[commander] \x1b[32mReady for takeoff!\x1b[0m")
    assert [one.text for one in of(read(writer, tmp_path)[0], StatusText)] == ["[commander] Ready for takeoff!"]
