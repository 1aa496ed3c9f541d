"""Recorded flights through the watchpoints: what is declared, when, and what is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.cli import main
from executor.core.state.vehicle_state import FaultKind
from executor.replay.log_replay import LINK_TIMEOUT_S, TICK_S, build_replay_rules, replay_log
from executor.replay.replay_result import LogReplay
from executor.site.site_file import check_site
from tests.recorded import BEGAN_USEC, Writer, battery, flight, heartbeat, position, station, text

RTL, LOITER, GUIDED = 6, 5, 4


def replayed(writer: Writer, tmp_path: Path) -> LogReplay:
    path = writer.write(tmp_path / "a.tlog")
    return replay_log(TelemetryFile(path), build_replay_rules(None))


def declared(found: LogReplay) -> list[tuple[int, str, str, float]]:
    return [
        (vehicle.sysid, one.kind.value, one.reason, (one.t_usec - BEGAN_USEC) / 1e6)
        for vehicle in found.vehicles
        for one in vehicle.declarations
    ]


def test_an_ordinary_flight(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(300))
    found = replayed(writer, tmp_path)
    assert declared(found) == []
    assert found.vehicles[0].flown_s == pytest.approx(300, abs=3)
    assert not any(one.kind is FaultKind.LINK for one in found.vehicles[0].degraded)


def test_a_silent_vehicle_is_degraded_then_lost_then_watched_again(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(200), silent=range(60, 75))
    flight(writer, 3, range(200, 300), silent=range(250, 270))
    flight(writer, 4, range(300))
    found = replayed(writer, tmp_path)
    lost = declared(found)
    assert [one[:3] for one in lost] == [(3, "link", "link")] * 2
    last_s = 59.5
    assert last_s + LINK_TIMEOUT_S <= lost[0][3] <= last_s + LINK_TIMEOUT_S + TICK_S + 0.01
    silent = next(one for one in found.vehicles[0].degraded if one.reason == "silent")
    assert silent.from_usec < found.vehicles[0].declarations[0].t_usec < silent.to_usec


def test_all_silent_at_once_is_our_own_radio(tmp_path: Path) -> None:
    writer = Writer()
    for system in (3, 4):
        flight(writer, system, range(200), silent=range(60, 90))
    for second in range(200):
        writer.say(second + 0.7, 255, station())
    assert declared(replayed(writer, tmp_path)) == []


def test_a_stalled_recorder_declares_no_fault(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(200), silent=range(60, 90))
    for second in (*range(60), *range(90, 200)):
        writer.say(second + 0.7, 255, station())
    assert declared(replayed(writer, tmp_path)) == []


def test_a_clock_that_jumps_back_is_counted_and_carried_on(tmp_path: Path) -> None:
    writer, other = Writer(), Writer()
    flight(writer, 3, range(100))
    flight(other, 3, range(100, 200), silent=range(150, 200))
    other.say(195.0, 255, station())
    path = tmp_path / "a.tlog"
    shifted = Writer(records=[(at_s - 90.0, frame) for at_s, frame in other.records])
    for second in range(60, 110):
        shifted.say(float(second), 255, station())
    path.write_bytes(writer.data() + shifted.data())
    found = replay_log(TelemetryFile(path), build_replay_rules(None))
    assert found.skipped.time_back == 1
    [(_, kind, _, at_s)] = declared(found)
    assert kind == "link"
    assert 149.5 + LINK_TIMEOUT_S <= at_s <= 150.0 + LINK_TIMEOUT_S, "by the vehicle's own clock"
    assert found.notes[:1] == ("the recorder's clock was set by -90.0 s at 99.4 s: times go on by the vehicles' own",)


def test_a_voltage_step(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(120):
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
        writer.say(second + 0.5, 3, battery(90 - 0.08 * second, 11.8 if second < 80 else 10.6))
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) == ("battery", "voltage-step")
    assert 80.5 < at_s <= 85.5


@pytest.mark.parametrize("times", [2.0, 3.0, 6.0])
def test_a_fast_drain_is_found_before_5_percent(times: float, tmp_path: Path) -> None:
    writer, rate, begins_s = Writer(), 0.08, 150
    for second in range(400):
        used = rate * (second + max(0, second - begins_s) * (times - 1))
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
        amperes = 30.0 * (times if second > begins_s else 1.0)
        writer.say(second + 0.5, 3, battery(max(0.0, 100 - used), 11.8, amperes, round(50 * used)))
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) in {("battery", "battery-drain"), ("battery", "battery-plunge")}
    assert at_s > begins_s
    assert (at_s - begins_s) * rate * (times - 1) < 5.0


def test_a_percentage_that_is_estimated_again_is_no_fault(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(300):
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
        percent = 100 - 0.08 * second - (5.0 if second > 200 else 0.0)
        writer.say(second + 0.5, 3, battery(percent, 11.8))
    assert declared(replayed(writer, tmp_path)) == []


def test_a_failsafe_says_so_itself(tmp_path: Path) -> None:
    writer = Writer()
    flight(writer, 3, range(100))
    writer.say(60.0, 3, text("Battery 1 is low 10.22V used 1476 mAh"))
    writer.say(60.1, 3, text("Battery Failsafe"))
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) == ("battery", "battery-failsafe")
    assert at_s < 63.0


@pytest.mark.parametrize("ordered", [False, True])
def test_a_mode_without_an_order(ordered: bool, tmp_path: Path) -> None:
    from pymavlink.dialects.v20 import common as mav

    writer = Writer()
    for second in range(120):
        writer.say(second + 0.1, 3, heartbeat(mode=3 if second < 60 else RTL))
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
    if ordered:
        writer.say(59.5, 255, mav.MAVLink_command_long_message(3, 1, 20, 0, *[0.0] * 7))
    found = declared(replayed(writer, tmp_path))
    assert [one[1:3] for one in found] == ([] if ordered else [("interruption", "mode")])


def test_a_flight_by_hand_is_no_interruption(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(120):
        writer.say(second + 0.1, 3, heartbeat(mode=LOITER if second % 40 < 20 else GUIDED))
        writer.say(second + 0.3, 3, position(second))
    assert declared(replayed(writer, tmp_path)) == []


def test_a_vehicle_that_disarms_in_the_air(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(100):
        writer.say(second + 0.1, 3, heartbeat(armed=second < 60))
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
    [(_, kind, reason, _)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) == ("interruption", "off-pad")


def test_a_site_brings_its_own_rules(tmp_path: Path) -> None:
    content = {
        "network": {"file": "default"},
        "faults": {"link_timeout_s": 12.0},
        "vehicle": [{"name": "uav9", "connection": "udpin://0.0.0.0:14550", "sysid": 3, "autopilot": "ardupilot"}],
    }
    writer = Writer()
    flight(writer, 3, range(200), silent=range(60, 100))
    path = writer.write(tmp_path / "a.tlog")
    found = replay_log(TelemetryFile(path), build_replay_rules(check_site(content, "test")))
    [(_, _, _, at_s)] = declared(found)
    assert found.vehicles[0].name == "uav9"
    assert 71.5 <= at_s <= 72.0


def test_other_vehicles_are_named_and_not_followed(tmp_path: Path) -> None:
    writer = Writer()
    writer.say(0.0, 9, heartbeat(autopilot=3, kind=1))
    found = replayed(writer, tmp_path)
    assert found.vehicles == ()
    assert any("system 9 is not followed" in note for note in found.notes)


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main.main(["replay", *arguments])
    return int(left.value.code or 0)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = Writer()
    flight(writer, 3, range(100), silent=range(60, 100))
    flight(writer, 4, range(100))
    path = writer.write(tmp_path / "a.tlog")
    assert called(str(path), "--json", "-o", str(tmp_path / "out")) == 0
    content = json.loads(capsys.readouterr().out)
    assert [(one["sysid"], len(one["declarations"])) for one in content["vehicles"]] == [(3, 1), (4, 0)]
    [fault] = content["vehicles"][0]["declarations"]
    assert set(fault) == {"kind", "reason", "t_usec", "evidence"}
    assert set(content["skipped"]) >= {"garbage_runs", "bad_checksums", "truncated", "time_back"}
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"a.tlog.png", "a.tlog.html"}
    assert called(str(tmp_path)) == 0
    assert "declared" in capsys.readouterr().out


def test_what_is_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    (tmp_path / "empty.tlog").touch()
    (tmp_path / "broken.ulg").write_bytes(b"ULog\x01\x12\x35" + b"\x00" * 20)
    (tmp_path / "empty.BIN").touch()
    assert called(str(tmp_path / "notes.txt")) == 2
    assert "expected a telemetry log" in capsys.readouterr().err
    assert called(str(tmp_path / "none.tlog")) == 2
    for name in ("empty.tlog", "broken.ulg", "empty.BIN"):
        assert called(str(tmp_path / name)) == 1, name
        assert "no vehicle in it" in capsys.readouterr().out


def test_two_vehicles_of_one_number_are_one_line(tmp_path: Path) -> None:
    """One flies, the other stands disarmed 900 m away: each of its HEARTBEATs would be a landing off the pad."""
    writer = Writer()
    for second in range(120):
        writer.say(second + 0.1, 1, heartbeat())
        writer.say(second + 0.5, 1, battery(99 - 0.05 * second))
        for part in (0.0, 0.2, 0.4, 0.6, 0.8):
            writer.say(second + part, 1, position(second + part, 4.0 * second))
        if second >= 40:
            writer.say(second + 0.45, 1, heartbeat(armed=False, mode=0, status=3))
            for part in (0.0, 0.2, 0.4, 0.6, 0.8):
                writer.say(second + part + 0.01, 1, position(second + part + 500.0, 900.0, 0.0))
    found = replayed(writer, tmp_path)
    assert declared(found) == []
    assert [note for note in found.notes if "two vehicles" in note] == [
        (
            "two vehicles use system id 1: their telemetry is mixed, and both would follow commands; "
            "not judged from 30.4 s on"
        )
    ]


@pytest.mark.parametrize("has_counter", [True, False])
@pytest.mark.parametrize("endurance_s", [300.0, 420.0, 900.0, 2400.0])
def test_without_a_site_nothing_is_known_of_what_a_vehicle_uses(
    endurance_s: float, has_counter: bool, tmp_path: Path
) -> None:  # fmt: skip
    """It takes off, flies, lands, and takes off once more: what it uses evenly is usual, however much that is."""
    writer, capacity_mah, used_pct = Writer(), 5000.0, 0.0
    for second in range(round(0.75 * endurance_s)):
        flies = second >= 10 and not 0.4 * endurance_s <= second < 0.5 * endurance_s
        used_pct += flies * 100.0 / endurance_s
        writer.say(second + 0.1, 3, heartbeat(armed=flies))
        writer.say(second + 0.3, 3, position(second, 4.0 * second, 30.0 if flies else 0.0))
        amperes = capacity_mah * 3.6 / endurance_s if flies else 0.4
        counted = (amperes, round(capacity_mah * used_pct / 100)) if has_counter else (-0.01, -1)
        writer.say(second + 0.5, 3, battery(99 - int(used_pct), 15.8, *counted))
    found = replayed(writer, tmp_path)
    assert [one for one in declared(found) if one[1] == "battery"] == []
    assert [note for note in found.notes if "no site" in note] == [
        "no site names the drone, so its consumption is unknown: only a change within its own flight is judged"
    ]


@pytest.mark.parametrize("times", [2.5, 4.0])
def test_a_drain_of_an_unknown_vehicle_is_found_from_its_own_flight(times: float, tmp_path: Path) -> None:
    writer, used_pct = Writer(), 0.0
    for second in range(240):
        rate = 0.15 * (times if second >= 150 else 1.0)
        used_pct += rate
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 4.0 * second, 30.0))
        writer.say(second + 0.5, 3, battery(99 - int(used_pct), 15.8, 180 * rate, round(50 * used_pct)))
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason in {"battery-drain", "battery-plunge"}) == ("battery", True)
    assert 150.0 < at_s < 200.0


def sinking(writer: Writer, up_m: float, *, asked: bool) -> None:
    """Write a flight that sinks at 2 m/s from its 100th second on, and then lies armed in its mission."""
    for second in range(200):
        height_m = max(0.0, up_m - 2.0 * max(0, second - 100))
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 3.0 * min(second, 100 + up_m / 2), height_m))
        if asked:
            below_m = min(3.6, up_m - height_m)
            writer.say(second + 0.4, 3, mav.MAVLink_nav_controller_output_message(0.0, 0.0, 0, 0, 0, below_m, 0.0, 0.0))


def test_a_vehicle_that_sinks_in_its_mission(tmp_path: Path) -> None:
    writer = Writer()
    sinking(writer, 40.0, asked=True)
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) == ("interruption", "thrust")
    assert 102.5 < at_s <= 107.5, "within five seconds of being 5 m lower"


def test_one_that_nothing_asks_for_a_height_is_found_where_it_lies(tmp_path: Path) -> None:
    writer = Writer()
    sinking(writer, 40.0, asked=False)
    [(_, kind, reason, at_s)] = declared(replayed(writer, tmp_path))
    assert (kind, reason) == ("down", "lies")
    assert 120.0 < at_s <= 130.0


def test_a_descent_that_is_asked_for_is_none(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(200):
        up_m = 40.0 - 1.5 * min(20, max(0, second - 100))
        writer.say(second + 0.1, 3, heartbeat())
        writer.say(second + 0.3, 3, position(second, 3.0 * second, up_m))
        writer.say(second + 0.4, 3, mav.MAVLink_nav_controller_output_message(0.0, 0.0, 0, 0, 0, -0.5, 0.0, 0.0))
    assert declared(replayed(writer, tmp_path)) == []
