"""Mode changes and reported failures in a recorded flight, and the declared faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.tlog_reader import TelemetryFile
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.replay_result import LogReplay
from tests.recorded import BEGAN_USEC, Writer, heartbeat, position, text

ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND = 2, 3, 4, 5, 6, 9
LEFT_S, LASTS_S = 60, 120
SWITCHES = {AUTO: 1430, LOITER: 1326, RTL: 1682}


@dataclass
class Recorded:
    """A flight whose mode changes once, and what else is said about it."""

    first: int = AUTO
    mode: int = RTL
    status: int = 4
    """Of its heartbeats from then on."""
    switched: int | None = None
    """To which mode's position its switch goes at that moment."""
    falls_s: float | None = None
    """From when on it lies on the ground, disarmed."""
    says: tuple[tuple[float, int, Any], ...] = ()
    writer: Writer = field(default_factory=Writer)

    def replayed(self, folder: Path) -> LogReplay:
        for second in range(LASTS_S):
            left, lies = second >= LEFT_S, self.falls_s is not None and second >= self.falls_s
            down = self.falls_s is not None and second >= self.falls_s - 3.0
            mode = self.mode if left else self.first
            self.writer.say(second + 0.1, 3, heartbeat(armed=not lies, mode=mode, status=self.status if left else 4))
            self.writer.say(second + 0.3, 3, position(second, 3.0 * second, 0.0 if down else 20.0))
            if self.switched is not None:
                us = SWITCHES[self.switched] if second + 0.7 > LEFT_S else SWITCHES[AUTO]
                self.writer.say(second - 0.3, 3, channels(us))
        for at_s, system, message in self.says:
            self.writer.say(at_s, system, message)
        path = self.writer.write(folder / "a.tlog")
        return replay_log(TelemetryFile(path), build_replay_rules(None))


def channels(mode_us: int) -> Any:
    return mav.MAVLink_rc_channels_raw_message(0, 0, 1500, 1500, 1600, 1500, mode_us, 1000, 1000, 1000, 100)


def set_mode(mode: int) -> Any:
    return mav.MAVLink_set_mode_message(3, 1, mode)


def accepted() -> Any:
    return mav.MAVLink_command_ack_message(11, 0)


def declared(found: LogReplay) -> list[tuple[str, str, float]]:
    [vehicle] = found.vehicles
    return [(one.kind.value, one.reason, (one.t_usec - BEGAN_USEC) / 1e6) for one in vehicle.declarations]


def kinds(found: LogReplay) -> list[tuple[str, str]]:
    return [one[:2] for one in declared(found)]


def modes(found: LogReplay) -> list[tuple[str, str]]:
    [vehicle] = found.vehicles
    return [(one.mode, one.by.value) for one in vehicle.modes]


@pytest.mark.parametrize(
    ("flight", "by", "interrupts"),
    [
        (Recorded(switched=RTL), "pilot", False),
        (Recorded(mode=LOITER, switched=LOITER), "pilot", False),
        (Recorded(says=((59.5, 255, set_mode(RTL)),)), "ground station", False),
        (Recorded(mode=GUIDED, says=((61.0, 3, accepted()),)), "ground station", False),
        (Recorded(status=5), "failsafe", True),
        (Recorded(mode=LAND, says=((59.8, 3, text("EKF Failsafe: changed to LAND Mode")),)), "failsafe", True),
        (Recorded(mode=LOITER), "unknown", False),
        (Recorded(), "unknown", True),
        # An order for one mode explains no other, and a warning acts on nothing.
        (Recorded(says=((59.5, 255, set_mode(GUIDED)),)), "unknown", True),
        (Recorded(says=((59.5, 3, text("GPS Glitch")),)), "unknown", True),
    ],
)
def test_the_source_of_a_mode_change(flight: Recorded, by: str, interrupts: bool, tmp_path: Path) -> None:
    found = flight.replayed(tmp_path)
    assert [one[1] for one in modes(found)] == [by]
    assert kinds(found) == ([("interruption", "mode")] if interrupts else [])


def test_a_station_that_repeats_its_order_for_long_gave_it_at_the_change_too(tmp_path: Path) -> None:
    orders = tuple((59.0 + tenth / 10, 3, accepted()) for tenth in range(300))
    found = Recorded(mode=GUIDED, says=orders).replayed(tmp_path)
    assert modes(found) == [("GUIDED", "ground station")]


def written(folder: Path, beats: Callable[[int], Any], *says: tuple[float, int, Any]) -> LogReplay:
    """Return the replay of a flight whose heartbeats are made second by second."""
    writer = Writer()
    for second in range(LASTS_S):
        writer.say(second + 0.1, 3, beats(second))
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
    for one in says:
        writer.say(*one)
    path = writer.write(folder / "a.tlog")
    return replay_log(TelemetryFile(path), build_replay_rules(None))


def test_a_failsafe_after_a_person_took_it_interrupts_nothing(tmp_path: Path) -> None:
    """A station flies it by orders, and its link fails: there is no mission any more that could be interrupted."""

    def beats(second: int) -> Any:
        mode = AUTO if second < 30 else GUIDED if second < 60 else RTL
        return heartbeat(mode=mode, status=5 if mode == RTL else 4)

    found = written(tmp_path, beats, (29.9, 255, set_mode(GUIDED)))
    assert modes(found) == [("GUIDED", "ground station"), ("RTL", "failsafe")]
    assert kinds(found) == []


def test_a_batterys_failsafe_is_the_batterys_and_hides_no_crash(tmp_path: Path) -> None:
    """Flown by hand: no inspection is interrupted, and what it says of its battery and of a crash is declared."""
    flight = Recorded(first=ALT_HOLD, mode=ALT_HOLD, status=5, falls_s=80.0)
    flight.says = ((60.0, 3, text("Low Battery!")), (79.0, 3, text("Crash: Disarming")))
    found = flight.replayed(tmp_path)
    assert kinds(found) == [("battery", "battery-failsafe"), ("interruption", "crash")]
    assert all(at_s - said_s <= 2.0 for (_, _, at_s), said_s in zip(declared(found), (60.0, 79.0), strict=True))
    assert any("by hand, or without a mission" in note for note in found.notes)


def test_a_crash_is_reported_after_the_motors_stopped(tmp_path: Path) -> None:
    flight = Recorded(first=ALT_HOLD, mode=ALT_HOLD, falls_s=80.0, says=((81.5, 3, text("Crash: Disarming")),))
    assert kinds(flight.replayed(tmp_path)) == [("interruption", "crash")]


def test_what_was_said_before_a_flight_is_not_of_it(tmp_path: Path) -> None:
    flight = Recorded(first=ALT_HOLD, mode=ALT_HOLD)
    flight.says = ((-5.0, 3, heartbeat(armed=False)), (-4.0, 3, text("Low Battery!")))
    assert kinds(flight.replayed(tmp_path)) == []


def test_a_resumed_mission_may_be_interrupted_again(tmp_path: Path) -> None:
    def beats(second: int) -> Any:
        away = 40 <= second < 60 or second >= 80
        return heartbeat(mode=RTL if away else AUTO, status=5 if away else 4)

    assert kinds(written(tmp_path, beats)) == [("interruption", "mode")] * 2


def test_a_switch_explains_a_mode_that_a_lossy_link_shows_late(tmp_path: Path) -> None:
    """Recorded: the switch was moved 3.1 s before the HEARTBEAT that shows its mode, after four that were lost."""
    writer = Writer()
    for second in range(LASTS_S):
        if not 56 <= second < 61:
            writer.say(second + 0.1, 3, heartbeat(mode=AUTO if second < 56 else RTL))
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
        writer.say(second + 0.4, 3, channels(SWITCHES[AUTO if second < 57 else RTL]))
    path = writer.write(tmp_path / "a.tlog")
    found = replay_log(TelemetryFile(path), build_replay_rules(None))
    assert modes(found) == [("RTL", "pilot")]
    assert kinds(found) == []


@pytest.mark.parametrize("arms_again", [True, False])
def test_a_crash_is_of_the_flight_that_it_ended(arms_again: bool, tmp_path: Path) -> None:
    """Recorded: armed again at once, each crash was told of the next flight too, whose own one was not then."""

    def beats(second: int) -> Any:
        return heartbeat(armed=second < 60 or (arms_again and 61 <= second < 90), mode=ALT_HOLD)

    crashes = [(59.5, 3, text("Crash: Disarming"))] + ([(89.5, 3, text("Crash: Disarming"))] if arms_again else [])
    found = written(tmp_path, beats, *crashes)
    assert kinds(found) == [("interruption", "crash")] * len(crashes)
    assert [round(at_s, -1) for _, _, at_s in declared(found)] == [60.0, 90.0][: len(crashes)]


def test_what_a_log_says_last_is_judged(tmp_path: Path) -> None:
    writer = Writer()
    for second in range(60):
        writer.say(second + 0.1, 3, heartbeat(mode=ALT_HOLD))
        writer.say(second + 0.3, 3, position(second, 3.0 * second))
    writer.say(59.4, 3, text("Crash: Disarming"))
    path = writer.write(tmp_path / "a.tlog")
    assert kinds(replay_log(TelemetryFile(path), build_replay_rules(None))) == [("interruption", "crash")]
