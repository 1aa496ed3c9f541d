"""PX4's own log (ULog) read with pyulog."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pyulog import ULog

from benchmarks.witness.dataflash_log import silence_c_stderr
from benchmarks.witness.log_evidence import (
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

TOPICS = ["vehicle_status", "battery_status", "vehicle_local_position", "vehicle_global_position", "vehicle_attitude",
          "vehicle_command", "manual_control_setpoint", "manual_control_switches", "mission_result", "vehicle_air_data",
          "vehicle_gps_position"]  # fmt: skip
ARMED = 2
FIXED = 3
MODE_COMMANDS = frozenset({16, 17, 18, 19, 20, 21, 22, 176, 193, 252, 300, 400})
WARNINGS = {2: "critical", 3: "emergency", 4: "failed"}
"""battery_status.warning values from which on PX4 itself may act."""
EVERY = 4
METRES_A_DEGREE = 111_320.0
Row = Mapping[str, Any]


def read_px4(path: Path) -> dict[int, LogEvidence]:
    """Return the evidence in PX4's own log; empty for another file."""
    with silence_c_stderr():
        try:
            log = ULog(str(path), TOPICS)
        except Exception:  # noqa: BLE001 - damaged, whatever the library thinks of it
            return {}
    told = LogEvidence(1, on_board=True, ardupilot=False, began_usec=int(log.start_timestamp),
                     ended_usec=int(log.last_timestamp))  # fmt: skip
    told.settings = {str(name): float(value) for name, value in log.initial_parameters.items()}
    told.system = int(told.settings.get("MAV_SYS_ID", 1))
    for text in log.logged_messages:
        told.texts.append(LogLine(int(text.timestamp), str(text.message).strip()))
    readers = {
        "vehicle_status": _record_status, "battery_status": _record_battery,
        "vehicle_local_position": _record_local_position,
        "vehicle_attitude": _record_attitude, "vehicle_command": _record_commands,
        "manual_control_setpoint": _record_switches,
        "manual_control_switches": _record_switches, "mission_result": _record_mission,
        "vehicle_air_data": _record_switch, "vehicle_gps_position": _fix,
    }  # fmt: skip
    for dataset in log.data_list:
        read = readers.get(dataset.name)
        if read is None or dataset.multi_id:
            continue
        try:
            read(told, list(_read_rows(dataset)))
        except (KeyError, ValueError, TypeError):
            continue  # topic of another version
    told.orders.sort(key=lambda one: one.t_usec)
    told.switches.sort(key=lambda one: one.t_usec)
    return {told.system: told}


def _read_rows(dataset: Any) -> Iterator[Row]:  # noqa: ANN401 - pyulog is untyped
    times = dataset.data["timestamp"]
    for index in times.argsort(kind="stable"):
        yield {name: column[index] for name, column in dataset.data.items()}


def _record_status(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows:
        t_usec, armed, mode = int(row["timestamp"]), int(row["arming_state"]) == ARMED, int(row["nav_state"])
        note_change(told.armed, t_usec, armed)
        if told.modes and told.modes[-1].mode == mode:
            continue
        failsafe = bool(row["failsafe"])
        words = "vehicle_status.failsafe" if failsafe else ""
        wanted = int(row.get("nav_state_user_intention", -1)) == mode
        by = Controller.FAILSAFE if failsafe else Controller.PILOT if wanted else None
        told.modes.append(ModeSet(t_usec, mode, by, words or ("nav_state_user_intention" if wanted else "")))


def _record_battery(told: LogEvidence, rows: list[Row]) -> None:
    warning = 0
    for row in rows:
        t_usec, now = int(row["timestamp"]), int(row.get("warning", 0))
        if now in WARNINGS and now > warning:
            told.failings.append(FailsafeEntry(t_usec, "battery", f"battery_status.warning: {WARNINGS[now]}"))
        warning = now
        volts, amperes, share = float(row["voltage_v"]), float(row["current_a"]), float(row["remaining"])
        told.streams.setdefault("battery", []).append(t_usec)
        told.powers.append(
            PowerReport(t_usec, volts if volts > 1 else None, amperes if amperes >= 0 else None,
                  float(row.get("discharged_mah", 0.0)), 100 * share if 0 <= share <= 1 else None)
        )  # fmt: skip


def _record_local_position(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows[::EVERY]:
        t_usec = int(row["timestamp"])
        told.streams.setdefault("position", []).append(t_usec)
        north, east = float(row["x"]), float(row["y"])
        if not all(math.isfinite(float(row[name])) for name in ("x", "y", "z", "vx", "vy", "vz")):
            continue
        told.note_height("vehicle_local_position", t_usec, -float(row["z"]))
        # Degrees from the estimator's origin: only differences are used.
        told.moments.append(
            MotionSample(t_usec, north / METRES_A_DEGREE, east / METRES_A_DEGREE, -float(row["z"]),
                   math.hypot(float(row["vx"]), float(row["vy"])), -float(row["vz"]))
        )  # fmt: skip


def _record_switch(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows:
        told.note_height("vehicle_air_data", int(row["timestamp"]), float(row["baro_alt_meter"]))


def _fix(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows:
        if int(row["fix_type"]) >= FIXED:
            height_m = float(row["altitude_msl_m"]) if "altitude_msl_m" in row else float(row["alt"]) / 1e3
            told.note_height("vehicle_gps_position", int(row["timestamp"]), height_m)


def _record_attitude(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows[::EVERY]:
        upright = 1 - 2 * (float(row["q[1]"]) ** 2 + float(row["q[2]"]) ** 2)
        told.tilts.append((int(row["timestamp"]), math.degrees(math.acos(max(-1.0, min(1.0, upright))))))


def _record_commands(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows:
        if int(row["command"]) in MODE_COMMANDS and bool(row.get("from_external", True)):
            told.orders.append(LogLine(int(row["timestamp"]), f"vehicle_command {int(row['command'])}"))


def _record_switches(told: LogEvidence, rows: list[Row]) -> None:
    before: tuple[int, ...] | None = None
    for row in rows:
        now = tuple(int(row.get(name, 0)) for name in ("mode_slot", "return_switch", "loiter_switch", "mode_switch"))
        if before is not None and now != before:
            told.switches.append(TransmitterMove(int(row["timestamp"]), "a mode switch was moved"))
        before = now


def _record_mission(told: LogEvidence, rows: list[Row]) -> None:
    for row in rows:
        number = int(row["seq_current"])
        if bool(row.get("finished", False)):
            told.orders.append(LogLine(int(row["timestamp"]), "mission_result.finished"))
        note_change(told.items, int(row["timestamp"]), number)
