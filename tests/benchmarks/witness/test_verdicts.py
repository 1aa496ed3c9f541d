"""Declarations compared with generated logs: each line of a log that confirms or refutes one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from benchmarks.witness.statements import StatementKind, find_statements, read_log_evidence
from benchmarks.witness.verdicts import Stand, hold_against
from executor.core.state.vehicle_state import FaultKind
from executor.replay.replay_result import Declaration
from tests.recorded import BEGAN_USEC, Writer, heartbeat, position, station, text

AUTO, LOITER, RTL = 3, 5, 6
TIMEOUT_S = 4.5
MODE = (FaultKind.INTERRUPTION, "mode", "went to mode RTL by itself")
LINK = (FaultKind.LINK, "link", "link lost for 4.6 s, time-out 4.5 s")
DRAIN = (FaultKind.BATTERY, "battery-drain", "used 5 % in 20 s where 1 % is usual")
PACK = (FaultKind.BATTERY, "pack", "its pack rests at 3.81 V a cell, about 42 %, and reports 91 %")
STEP = (FaultKind.BATTERY, "voltage-step", "13.9 V where 15.2 V is usual under this load")
FALLS = (FaultKind.INTERRUPTION, "falling", "falls at 5.8 m/s")
SINKS = (FaultKind.INTERRUPTION, "sinking", "sinks at 2.0 m/s, 6 m below its mission")
LIES = (FaultKind.DOWN, "lies", "has not moved for 5 s on its mission")
DISARMED = (FaultKind.INTERRUPTION, "off-pad", "disarmed 20 m over its home at 3.0 m/s")
AT_S = 60.0


def power(volts: float, amperes: float = 20.0, percent: int = 80) -> Any:
    return mav.MAVLink_sys_status_message(
        0, 0, 0, 0, round(1000 * volts), round(100 * amperes), percent, 0, 0, 0, 0, 0, 0
    )


def channels(switch: int) -> Any:
    return mav.MAVLink_rc_channels_raw_message(0, 0, *[1500] * 4, switch, *[1000] * 3, 255)


def attitude(roll_rad: float) -> Any:
    return mav.MAVLink_attitude_message(0, roll_rad, 0.0, 0.0, 0.0, 0.0, 0.0)


def flown(
    writer: Writer, seconds: Iterable[int] = range(200), *, mode: Callable[[int], int] = lambda _: AUTO,
    armed: Callable[[int], bool] = lambda _: True, volts: Callable[[int], float] = lambda _: 15.2, up_m: float = 20.0,
) -> Writer:  # fmt: skip
    """Write a flight; a station is heard all the time."""
    for second in range(200):
        writer.say(second + 0.05, 255, station())
    for second in seconds:
        writer.say(second + 0.1, 1, heartbeat(armed=armed(second), mode=mode(second)))
        writer.say(second + 0.2, 1, position(second, 3.0 * second, up_m) if up_m > 1.0 else on_the_ground(second))
        writer.say(second + 0.3, 1, power(volts(second)))
        writer.say(second + 0.4, 1, attitude(0.1))
        writer.say(second + 0.5, 1, channels(1165))
    return writer


def on_the_ground(second: int) -> Any:
    return mav.MAVLink_global_position_int_message(1000 * second, 503000000, 133000000, 300000, 200, 0, 0, 0, 0)


def to_rtl(second: int) -> int:
    return AUTO if second < AT_S else RTL


def accepted() -> Writer:
    writer = flown(Writer(), mode=to_rtl)
    writer.say(AT_S - 0.3, 1, mav.MAVLink_command_ack_message(11, 0))
    return writer


def refused() -> Writer:
    writer = flown(Writer(), mode=to_rtl)
    writer.say(AT_S - 0.3, 1, mav.MAVLink_command_ack_message(11, 4))
    return writer


def set_by_a_station() -> Writer:
    writer = flown(Writer(), mode=to_rtl)
    writer.say(AT_S - 0.5, 255, mav.MAVLink_set_mode_message(1, 1, RTL))
    return writer


def switched() -> Writer:
    writer = flown(Writer(), range(0), mode=to_rtl)
    for second in range(200):
        writer.say(second + 0.1, 1, heartbeat(mode=to_rtl(second)))
        writer.say(second + 0.5, 1, channels(1165 if second + 0.5 < AT_S - 0.4 else 1800))
    return writer


def said(words: str, at_s: float = AT_S - 1.0, **flight: Any) -> Writer:
    writer = flown(Writer(), **flight)
    writer.say(at_s, 1, text(words))
    return writer


def silent(*, with_station: bool) -> Writer:
    writer = Writer()
    for second in range(200):
        if with_station or not AT_S - 5 <= second < AT_S + 10:
            writer.say(second + 0.05, 255, station())
        if not AT_S - 5 <= second < AT_S + 10:
            writer.say(second + 0.1, 1, heartbeat())
    return writer


def fell(volts: Callable[[int], float]) -> Writer:
    return flown(Writer(), volts=volts)


def rested(after_v: float, after_pct: int, before_v: float = 16.0) -> Writer:
    """Write a flight from 30 s to 100 s of a pack of four cells that says 99 % before it."""
    writer = Writer()
    for second in range(200):
        flies = 30 <= second < 100
        writer.say(second + 0.1, 1, heartbeat(armed=flies))
        writer.say(second + 0.2, 1, position(second, 3.0 * second, 20.0) if flies else on_the_ground(second))
        volts = 14.8 if flies else before_v if second < 30 else after_v
        writer.say(second + 0.3, 1, power(volts, 20.0 if flies else 0.4, 99 if second < 100 else after_pct))
    return writer


def tumbled() -> Writer:
    writer = flown(Writer(), armed=lambda second: second < AT_S)
    writer.say(AT_S - 1.0, 1, attitude(2.0))
    return writer


def lowered(up_m: Callable[[int], float], *, armed: Callable[[int], bool] = lambda _: True) -> Writer:
    """Write a flight that stands where it has come down to."""
    writer = Writer()
    for second in range(200):
        writer.say(second + 0.1, 1, heartbeat(armed=armed(second)))
        writer.say(second + 0.2, 1, position(second, 3.0 * min(second, AT_S), up_m(second)))
    return writer


ROWS: list[tuple[str, Callable[[], Writer], tuple[FaultKind, str, str], Stand, str]] = [
    ("a mode that was accepted", accepted, MODE, Stand.REFUTED, "COMMAND_ACK"),
    ("a mode that was refused before", refused, MODE, Stand.UNDECIDED, "names nobody"),
    ("a mode that a station set", set_by_a_station, MODE, Stand.REFUTED, "SET_MODE of system 255"),
    ("a mode that the pilot chose", switched, MODE, Stand.REFUTED, "mode switch"),
    ("a mode by a failsafe", lambda: said("Low Battery!", mode=to_rtl), MODE, Stand.CONFIRMED, "Low Battery!"),
    ("a mode of which nothing is said", lambda: flown(Writer(), mode=to_rtl), MODE, Stand.UNDECIDED, "nobody"),
    ("a mode that is as it was", lambda: flown(Writer()), MODE, Stand.REFUTED, "never changed"),
    ("a link that was lost", lambda: silent(with_station=True), LINK, Stand.CONFIRMED, "16.0 s"),
    ("a recorder that paused", lambda: silent(with_station=False), LINK, Stand.REFUTED, "paused"),
    ("a link that was there", lambda: flown(Writer()), LINK, Stand.REFUTED, "all the time"),
    ("a drain of a pack that lasts", lambda: flown(Writer()), DRAIN, Stand.REFUTED, "3.80 V a cell"),
    ("a drain of a pack that ends", lambda: fell(lambda s: 15.2 - max(0, s - 50) * 0.013), DRAIN, Stand.CONFIRMED,
     "V a cell"),
    ("a drain before its failsafe", lambda: said("Battery Failsafe", AT_S + 100), DRAIN, Stand.CONFIRMED,
     "Battery Failsafe, +98.8 s"),
    ("a drain on the ground", lambda: flown(Writer(), range(50, 200), up_m=0.1), DRAIN, Stand.REFUTED, "ground"),
    ("a pack that rests as much lower as it did not count", lambda: rested(15.2, 87), PACK, Stand.CONFIRMED,
     "4.00 V a cell before it and 3.80 V after it: 12 % counted, 22 % gone at least"),
    ("a pack that was not full", lambda: rested(14.44, 87, 14.84), PACK, Stand.CONFIRMED,
     "3.61 V a cell at rest after it, 40 % at most, and 87 % reported"),
    ("a pack that rests where its count has it", lambda: rested(15.2, 60), PACK, Stand.REFUTED, "37 % gone at most"),
    ("a pack between both chemistries", lambda: rested(15.2, 72), PACK, Stand.REFUTED, "3.70 V a cell under load"),
    ("a step that stays", lambda: fell(lambda s: 15.2 - (1.3 if s >= AT_S - 3 else 0)), STEP, Stand.CONFIRMED,
     "not regained"),
    ("a step that is over", lambda: fell(lambda s: 15.2 - (1.3 if AT_S - 3 <= s < AT_S + 2 else 0)), STEP,
     Stand.REFUTED, "again within"),
    ("a failsafe that nobody speaks of", lambda: flown(Writer()), (FaultKind.BATTERY, "battery-failsafe", ""),
     Stand.REFUTED, "no text"),
    ("a fall on the ground", lambda: flown(Writer(), up_m=0.2), FALLS, Stand.REFUTED, "not left the ground"),
    ("a fall that is flown on", lambda: flown(Writer()), FALLS, Stand.REFUTED, "flew on"),
    ("sinking to the ground", lambda: lowered(lambda s: max(0.0, 60.0 - 2.0 * max(0, s - 50))), SINKS,
     Stand.CONFIRMED, "did not climb again"),
    ("sinking that is over", lambda: lowered(lambda s: 40.0 + 2.0 * abs(s - AT_S)), SINKS, Stand.REFUTED, "high again"),
    ("sinking that was none", lambda: flown(Writer()), SINKS, Stand.REFUTED, "lost 0.0 m"),
    ("lying there, armed", lambda: lowered(lambda s: max(0.0, 2.0 * (AT_S - s))), LIES, Stand.CONFIRMED, "armed"),
    ("lying there for a landing", lambda: lowered(lambda s: max(0.0, 2.0 * (AT_S - s)), armed=lambda s: s < AT_S + 5),
     LIES, Stand.REFUTED, "disarmed"),
    ("lying there and flying on", lambda: flown(Writer()), LIES, Stand.REFUTED, "moved"),
    ("a crash that is spoken of", lambda: said("Crash: Disarming", armed=lambda s: s < AT_S), DISARMED,
     Stand.CONFIRMED, "Crash: Disarming"),
    ("a crash that is seen", tumbled, DISARMED, Stand.CONFIRMED, "tilted by"),
    ("a heartbeat that came", lambda: flown(Writer()), (FaultKind.INTERRUPTION, "heartbeat", ""), Stand.REFUTED,
     "HEARTBEAT came"),
    ("a place that did not jump", lambda: flown(Writer()), (FaultKind.INTERRUPTION, "position", ""), Stand.REFUTED,
     "jumped by"),
    ("a flight that goes on", lambda: flown(Writer()), (FaultKind.INTERRUPTION, "terminated", ""), Stand.REFUTED,
     "system_status 4"),
    ("a flight that moves", lambda: flown(Writer()), (FaultKind.INTERRUPTION, "stall", ""), Stand.REFUTED, "moved"),
]  # fmt: skip


@pytest.mark.parametrize(("what", "written", "claim", "outcome", "because"), ROWS, ids=[row[0] for row in ROWS])
def test_a_declaration_against_its_log(
    what: str, written: Callable[[], Writer], claim: tuple[FaultKind, str, str], outcome: Stand, because: str,
    tmp_path: Path,
) -> None:  # fmt: skip
    told = read_log_evidence(written().write(tmp_path / "a.tlog"))[1]
    kind, reason, evidence = claim
    verdict = hold_against(Declaration(kind, reason, BEGAN_USEC + round((AT_S + 1.2) * 1e6), evidence), told, TIMEOUT_S)
    assert (verdict.outcome, because in verdict.because) == (outcome, True), verdict


def stated(writer: Writer, tmp_path: Path) -> list[tuple[StatementKind, float]]:
    told = read_log_evidence(writer.write(tmp_path / "a.tlog"))[1]
    return [(one.what, (one.t_usec - BEGAN_USEC) / 1e6) for one in find_statements(told, TIMEOUT_S)]


def test_what_a_log_states(tmp_path: Path) -> None:
    writer = flown(Writer(), armed=lambda second: 20 <= second < 100)
    for at_s in (10.0, 50.0, 60.0):
        writer.say(at_s, 1, text("Low Battery!"))
    writer.say(100.4, 1, text("Crash: Disarming"))
    writer.say(150.0, 1, text("Crash: Disarming"))
    # Before the arming it is no flight's, said again it is the same, and long after the flight it is nobody's.
    assert stated(writer, tmp_path) == [(StatementKind.BATTERY, 50.0), (StatementKind.CRASH, 100.4)]


def test_a_gap_is_stated_where_others_were_heard_in_the_meantime(tmp_path: Path) -> None:
    [(what, at_s)] = stated(silent(with_station=True), tmp_path)
    assert (what, round(at_s, 1)) == (StatementKind.SILENCE, 54.1)
    assert stated(silent(with_station=False), tmp_path) == []


def test_what_only_warns_is_no_failsafe(tmp_path: Path) -> None:
    writer = flown(Writer())
    for number, words in enumerate(("PreArm: Battery 1 low voltage failsafe", "Low battery level! Return advised")):
        writer.say(50.0 + number, 1, text(words))
    assert stated(writer, tmp_path) == []
