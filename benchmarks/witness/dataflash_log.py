"""ArduPilot's own log (DataFlash: .BIN, or .log as text) read with pymavlink."""

from __future__ import annotations

import io
import math
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pymavlink import DFReader

from benchmarks.witness.log_evidence import (
    SECOND,
    Controller,
    FailsafeEntry,
    LogEvidence,
    LogLine,
    ModeSet,
    MotionSample,
    PowerReport,
    TransmitterMove,
    note_change,
)

TYPES = ("MODE", "EV", "ERR", "ARM", "MSG", "BAT", "CURR", "POS", "GPS", "CTUN", "ATT", "RCIN", "PARM", "CMD", "XKF1",
         "NKF1", "NTUN", "BARO")  # fmt: skip
REASONS = {
    1: Controller.PILOT, 2: Controller.STATION, 3: Controller.FAILSAFE, 4: Controller.FAILSAFE,
    5: Controller.FAILSAFE, 6: Controller.FAILSAFE,
    7: Controller.FAILSAFE, 8: Controller.MISSION, 9: Controller.PILOT, 10: Controller.FAILSAFE,
    11: Controller.FAILSAFE, 12: Controller.MISSION,
    13: Controller.MISSION, 14: Controller.FAILSAFE, 15: Controller.FAILSAFE, 16: Controller.MISSION,
    17: Controller.FAILSAFE, 18: Controller.PILOT,
    19: Controller.FAILSAFE, 25: Controller.FAILSAFE, 26: Controller.MISSION, 31: Controller.MISSION,
    32: Controller.STATION, 34: Controller.PILOT,
    35: Controller.FAILSAFE, 39: Controller.MISSION, 41: Controller.MISSION, 42: Controller.STATION,
    43: Controller.FAILSAFE, 45: Controller.MISSION,
    48: Controller.FAILSAFE, 50: Controller.FAILSAFE, 51: Controller.FAILSAFE, 52: Controller.STATION,
    53: Controller.PILOT,
}  # fmt: skip
"""ModeReason of AP_Vehicle."""
SUBSYSTEMS = {
    5: "rc", 6: "battery", 7: "gps", 8: "ground station", 9: "fence", 12: "crash", 15: "parachute", 16: "ekf",
    17: "ekf", 23: "terrain", 25: "motor", 29: "vibration", 31: "dead reckoning",
}  # fmt: skip
"""LogErrorSubsystem; code 0 means that the error has ended."""
CRASHES = frozenset({1, 2})
OTHER = re.compile(r"^(Ardu|APM:)? ?(Plane|Rover|Sub|Tracker|Blimp)\b", re.IGNORECASE)
"""Names of firmware for other vehicle types."""
BANDS = (1231, 1361, 1491, 1621, 1750)
MOST_BROKEN = 1000
FIXED, REBOOT_USEC = 3, 5 * SECOND
OWN_TIMES = frozenset({"TimeUS", "TimeMS"})
EV_ARMED, EV_DISARMED = frozenset({10, 15, 28}), 11


@dataclass(slots=True)
class _State:
    climb_m_s: float = 0.0
    speed_m_s: float = 0.0
    height_m: float | None = None
    home_m: float | None = None
    switch_us: int = 0
    percent: float | None = None


def read_onboard(path: Path) -> dict[int, LogEvidence]:
    """Return the evidence in ArduPilot's own log; empty for another file."""
    told, state, log = LogEvidence(1, on_board=True), _State(), _open_log(path)
    if log is None:
        return {}
    own = any(OWN_TIMES & set(one.columns) for one in log.formats.values() if one.name in TYPES and one.name != "GPS")
    for t_usec, message in _attach_times(_read_messages(log), by_satellites=not own):
        told.began_usec = told.began_usec or t_usec
        told.ended_usec = max(told.ended_usec, t_usec)
        try:
            _TELLS[message.get_type()](told, state, t_usec, message)
        except (AttributeError, KeyError, ValueError, TypeError):
            continue  # format of another version
    if any(OTHER.search(one.words) for one in told.texts):
        return {}  # not a copter: its numbers have other meanings
    number = int(told.settings.get("SYSID_THISMAV", told.settings.get("MAV_SYSID", 1)) or 1)
    told.system = number
    return {number: told} if told.ended_usec else {}


def _attach_times(messages: Iterator[Any], *, by_satellites: bool) -> Iterator[tuple[int, Any]]:
    """Yield messages with their times: old firmware wrote events and modes without, so they get the previous time.

    Firmware of 2013 wrote no time of its own: then the satellites' is the log's, from the first fix on.
    """
    waiting: list[Any] = []
    last = shift = 0
    for message in messages:
        t_usec = _satellites_usec(message, last) if by_satellites else stamp_of(message)
        if t_usec is not None and t_usec + shift < last - REBOOT_USEC:
            shift = last - t_usec  # rebooted: continue its time
        t_usec = None if t_usec is None else t_usec + shift
        if t_usec is None and not last:
            waiting.append(message)
            continue
        last = t_usec or last
        yield from ((last, one) for one in waiting)
        waiting.clear()
        yield last, message


def _satellites_usec(message: Any, last: int) -> int | None:  # noqa: ANN401 - pymavlink is untyped
    """Return the satellites' time of a fix: without one it is missing or arbitrary."""
    t_msec = getattr(message, "TimeMS", getattr(message, "Time", 0))
    fixed = message.get_type() == "GPS" and int(message.Status) >= FIXED and t_msec * 1000 >= last
    return int(t_msec) * 1000 if fixed else None


def _open_log(path: Path) -> Any:  # noqa: ANN401
    with silence_c_stderr():
        try:
            text = path.read_bytes()[:2] != b"\xa3\x95"
            return DFReader.DFReader_text(str(path)) if text else DFReader.DFReader_binary(str(path))
        except Exception:  # noqa: BLE001 - damaged, whatever the library thinks of it
            return None


def _read_messages(log: Any) -> Iterator[Any]:  # noqa: ANN401
    try:
        yield from _read_all(log)
    finally:
        for one in ("data_map", "filehandle"):
            if hasattr(log, one):
                getattr(log, one).close()


def _read_all(log: Any) -> Iterator[Any]:  # noqa: ANN401 - pymavlink is untyped
    broken = 0
    while broken < MOST_BROKEN:
        try:
            with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
                message = log.recv_match(type=list(TYPES))
        except Exception:  # noqa: BLE001
            broken += 1
            continue
        if message is None:
            return
        yield message


@contextmanager
def silence_c_stderr() -> Iterator[None]:
    """Redirect C's standard error, on which pymavlink reports each skipped byte, to nowhere."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def stamp_of(message: Any) -> int | None:  # noqa: ANN401 - pymavlink is untyped
    """Return the time of writing, since the vehicle's start: old firmware counted milliseconds.

    TimeMS of its GPS records is that of the satellites; the vehicle's is T.
    """
    of_satellites = message.get_type() == "GPS"
    for name, factor in (("TimeUS", 1), ("T" if of_satellites else "TimeMS", 1000)):
        value = getattr(message, name, None)
        if isinstance(value, (int, float)):
            return int(value * factor)
    return None


def _record_mode(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    number = int(getattr(row, "ModeNum", getattr(row, "Mode", 0)))
    reason = getattr(row, "Rsn", getattr(row, "Reason", None))
    by = None if reason is None else REASONS.get(int(reason))
    words = "" if reason is None else f"MODE.Rsn {int(reason)}"
    if not told.modes or told.modes[-1].mode != number:
        told.modes.append(ModeSet(t_usec, number, by, words))


def _record_event(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if row.Id in EV_ARMED or row.Id == EV_DISARMED:
        note_change(told.armed, t_usec, row.Id != EV_DISARMED)


def _record_arming(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    note_change(told.armed, t_usec, bool(row.ArmState))


def _record_error(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    kind = SUBSYSTEMS.get(int(row.Subsys))
    code = int(row.ECode)
    if kind is not None and code and (kind != "crash" or code in CRASHES):
        told.failings.append(FailsafeEntry(t_usec, kind, f"ERR {int(row.Subsys)} {code}"))


def _record_text(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if row.Message == "Arming motors":
        note_change(told.armed, t_usec, True)
    told.texts.append(LogLine(t_usec, str(row.Message).strip()))


def _record_battery(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if int(getattr(row, "Inst", getattr(row, "Instance", 0))):
        return
    volts = float(row.Volt)
    volts = volts / 100 if isinstance(row.Volt, int) and volts > 100 else volts
    amperes, percent = float(row.Curr), getattr(row, "RemPct", None)
    amperes = amperes / 100 if isinstance(row.Curr, int) else amperes
    told.streams.setdefault("battery", []).append(t_usec)
    told.powers.append(
        PowerReport(t_usec, volts or None, amperes if amperes >= 0 else None, float(row.CurrTot),
              None if percent is None else float(percent))
    )  # fmt: skip


def _record_fix(told: LogEvidence, state: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if int(getattr(row, "I", 0)):
        return  # a second receiver
    if int(row.Status) >= FIXED:
        told.note_height("GPS.Alt", t_usec, float(row.Alt))
    state.speed_m_s = float(row.Spd)
    if getattr(row, "VZ", None) is not None:
        state.climb_m_s = -float(row.VZ)
    height = getattr(row, "RelAlt", getattr(row, "RAlt", None))
    state.height_m = float(height) if height is not None and not told.streams.get("position") else state.height_m
    if not told.streams.get("position"):
        told.moments.append(MotionSample(t_usec, float(row.Lat), float(row.Lng), state.height_m, state.speed_m_s,
                                   state.climb_m_s))  # fmt: skip


def _record_switch(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if not int(getattr(row, "I", 0)):
        told.note_height("BARO.Alt", t_usec, float(row.Alt))


def _record_place(told: LogEvidence, state: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    told.note_height("POS.Alt", t_usec, float(row.Alt))
    told.streams.setdefault("position", []).append(t_usec)
    height = float(getattr(row, "RelHomeAlt", math.nan))
    told.moments.append(
        MotionSample(t_usec, float(row.Lat), float(row.Lng), height if math.isfinite(height) else state.height_m,
               state.speed_m_s, state.climb_m_s)
    )  # fmt: skip


def _record_control_tuning(told: LogEvidence, state: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    height = getattr(row, "BAlt", getattr(row, "BarAlt", None))
    climb = getattr(row, "CRt", getattr(row, "CRate", None))
    if height is not None:
        state.height_m = float(height)
        told.note_height("CTUN.BarAlt", t_usec, state.height_m)
    if getattr(row, "Alt", None) is not None:
        told.note_height("CTUN.Alt", t_usec, float(row.Alt))
    if climb is not None:
        state.climb_m_s = float(climb) / 100 if isinstance(climb, int) else float(climb)


def _record_attitude(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    if told.tilts and t_usec - told.tilts[-1][0] < SECOND // 5:
        return
    upright = math.cos(math.radians(float(row.Roll))) * math.cos(math.radians(float(row.Pitch)))
    told.tilts.append((t_usec, math.degrees(math.acos(max(-1.0, min(1.0, upright))))))


def _record_mode_switch(told: LogEvidence, state: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    number = int(told.settings.get("FLTMODE_CH", 5) or 5)
    value = int(getattr(row, f"C{number}", getattr(row, f"Ch{number}", 0)))
    before, state.switch_us = state.switch_us, value
    if before and value and sum(before >= edge for edge in BANDS) != sum(value >= edge for edge in BANDS):
        told.switches.append(
            TransmitterMove(t_usec, f"mode switch (channel {number}) from {before} to {value}", number)
        )


def _record_parameter(told: LogEvidence, _: _State, __: int, row: Any) -> None:  # noqa: ANN401
    told.settings[str(row.Name)] = float(row.Value)


def _record_mission_item(told: LogEvidence, _: _State, t_usec: int, row: Any) -> None:  # noqa: ANN401
    told.items.append((t_usec, int(row.CNum)))


def _ignore_message(_: LogEvidence, __: _State, ___: int, ____: Any) -> None:  # noqa: ANN401
    return


_TELLS: dict[str, Callable[[LogEvidence, _State, int, Any], None]] = dict.fromkeys(TYPES, _ignore_message) | {
    "MODE": _record_mode, "EV": _record_event, "ERR": _record_error, "ARM": _record_arming, "MSG": _record_text,
    "BAT": _record_battery, "CURR": _record_battery,
    "GPS": _record_fix, "POS": _record_place, "CTUN": _record_control_tuning, "ATT": _record_attitude,
    "RCIN": _record_mode_switch, "PARM": _record_parameter,
    "CMD": _record_mission_item, "BARO": _record_switch,
}  # fmt: skip
