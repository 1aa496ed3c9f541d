"""Read PX4's ULog (.ulg) as our messages, timed by the vehicle's clock (microseconds since boot).

pyulog reads the file; only the topics in use are kept, and of them only rows that may hold something new. Topics and
fields were added, removed and renamed between 1.5 and 1.17; missing values stay unknown.
"""

from __future__ import annotations

import heapq
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias

from pyulog import ULog

from executor.core import formatting
from executor.core.interface import messages, recorded_log
from executor.core.telemetry.mode_evidence import ARGUMENT_BYTES, parse_px4_event
from executor.core.telemetry.plausibility import filter_implausible
from executor.errors import LogError
from missions import PX4

DO_SET_MODE = 176
SWITCH_MODE = 7
"""action_request.action."""
REQUESTED_BY = MappingProxyType(dict.fromkeys((0, 1, 2, 3), messages.Actor.PILOT))
"""action_request.source: stick gesture, switch, button, mode switch."""
MODE_SWITCHES = (
    "mode_slot", "mode_switch", "return_switch", "loiter_switch", "posctl_switch", "offboard_switch", "acro_switch",
    "rattitude_switch", "stab_switch", "man_switch",
)  # fmt: skip
"""Fields of manual_control_switches; before 1.12, of manual_control_setpoint."""
ORDERED_USEC = 1_500_000
"""Time after a command within which it causes a mode change; the commander polls many times a second."""
FAILED: Mapping[str, tuple[str, str]] = MappingProxyType({
    # failsafe_flags, since 1.14
    "battery_low_remaining_time": ("battery", "battery: too little for the way home"),
    "battery_unhealthy": ("battery", "battery unhealthy"),
    "manual_control_signal_lost": ("rc", "manual control lost"),
    "gcs_connection_lost": ("ground station", "ground station lost"),
    "global_position_invalid": ("gps", "global position invalid"),
    "position_accuracy_low": ("gps", "position accuracy low"),
    "local_position_invalid": ("ekf", "local position invalid"),
    "local_velocity_invalid": ("ekf", "local velocity invalid"),
    "local_altitude_invalid": ("ekf", "local altitude invalid"),
    "attitude_invalid": ("attitude", "attitude invalid"),
    "angular_velocity_invalid": ("attitude", "angular velocity invalid"),
    "geofence_breached": ("fence", "geofence breached"),
    "fd_critical_failure": ("attitude", "failure detector: attitude"),
    "fd_esc_arming_failure": ("motor", "failure detector: speed controller"),
    "fd_motor_failure": ("motor", "failure detector: motor"),
    "fd_imbalanced_prop": ("motor", "failure detector: imbalanced propeller"),
    "mission_failure": ("other", "mission failed"),
    "navigator_failure": ("other", "navigator failed"),
    "offboard_control_signal_lost": ("other", "offboard control lost"),
    "wind_limit_exceeded": ("other", "wind limit exceeded"),
    "flight_time_limit_exceeded": ("other", "flight time limit exceeded"),
    # vehicle_status, before 1.14
    "rc_signal_lost": ("rc", "manual control lost"),
    "data_link_lost": ("ground station", "ground station lost"),
    "engine_failure": ("motor", "motor failed"),
})  # fmt: skip
"""Failure flags, and the kind of failsafe that each triggers."""
VALID: Mapping[str, tuple[str, str]] = MappingProxyType({
    "condition_global_position_valid": ("gps", "global position invalid"),
    "condition_local_position_valid": ("ekf", "local position invalid"),
    "condition_local_velocity_valid": ("ekf", "local velocity invalid"),
    "condition_battery_healthy": ("battery", "battery unhealthy"),
})  # fmt: skip
"""vehicle_status_flags before 1.14: flags of valid conditions."""
CRITICAL = 2
"""battery_warning of failsafe_flags and battery_status: critical; higher values are emergency and failed."""
UNNAMED = ("other", "failsafe")
"""Failure names for logs without a flag for the cause."""
QUADROTOR = 2
TYPES: Mapping[int, int] = {2: 1, 3: 10, 4: 7}
"""vehicle_status.vehicle_type to MAV_TYPE, other than rotary wing: fixed wing, rover, airship."""
STANDBY, ACTIVE, CRITICAL_STATE = 3, 4, 5
HALF = 128
CHANNELS = 18
CELLS = 14
ARMED = 2
"""vehicle_status.arming_state."""
BEAT_USEC = 950_000
MODES: Mapping[int, int] = {
    0: 1 << 16, 1: 2 << 16, 2: 3 << 16, 3: 4 << 24 | 4 << 16, 4: 3 << 24 | 4 << 16, 5: 5 << 24 | 4 << 16,
    10: 5 << 16, 12: 6 << 24 | 4 << 16, 13: 10 << 16, 14: 6 << 16, 15: 7 << 16, 17: 2 << 24 | 4 << 16,
    18: 6 << 24 | 4 << 16, 19: 8 << 24 | 4 << 16, 20: 9 << 24 | 4 << 16,
}  # fmt: skip
"""vehicle_status.nav_state (VehicleStatus.msg) to custom_mode (px4_custom_mode.h); 12, DESCEND, is a landing."""
WARNINGS: Mapping[int, int] = {0: 1, 1: 2, 2: 3, 3: 4, 4: 5}
"""battery_status.warning to MAV_BATTERY_CHARGE_STATE: none, low, critical, emergency, failed."""
STALE_USEC = 3_000_000
"""Age after which the GPS position is used instead of the filter's."""
FIXED = 3
UNKNOWN_M = 100.0
"""Least accuracy at which a receiver counts as without a fix."""
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
OF_EACH = frozenset({"sensor_gps"})
"""Topics with one instance per receiver; the first is read."""
LONGEST_USEC = 3 * 86400 * 1_000_000
"""Longest flight; a time farther from the log's start is damaged. A simulated PX4 uses world time."""


TopicRow: TypeAlias = Mapping[str, float]
"""One row of a topic: the fields of this firmware version."""
Px4Messages: TypeAlias = messages.FlightMessage | tuple[messages.FlightMessage, ...] | None


@dataclass(slots=True)
class Px4State:
    """Known state of the vehicle."""

    beat: tuple[int, bool] | None = None
    """Mode, and whether the vehicle is armed."""
    beat_usec: int = -BEAT_USEC
    velocity_m_s: tuple[float, float, float] | None = None
    """Velocity north, east, down, from the local position."""
    height_m: float | None = None
    """Height above the filter's origin, from the local position."""
    begun_msl_m: float | None = None
    placed_usec: int = -STALE_USEC
    received_usec: int = -STALE_USEC
    landed: bool | None = None
    item: tuple[int, int] | None = None
    failing: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Raised flags with their subjects, in order of time."""
    failed: messages.OwnFailsafe | None = None
    """Failsafe now in action."""
    asked: tuple[int, messages.Actor] = (-ORDERED_USEC, messages.Actor.UNKNOWN)
    """Time and source of the last mode request."""
    switches: tuple[int, ...] | None = None
    finished: bool = False


def _read_vehicle_status(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    mode = MODES.get(int(row["nav_state"]), 0)
    armed, acts = int(row["arming_state"]) == ARMED, bool(row.get("failsafe", 0))
    _read_failsafe_flags(vehicle, t_usec, row)
    told: list[messages.FlightMessage] = list(_update_failsafe(vehicle, acts=acts and armed))
    if vehicle.beat is None or mode != vehicle.beat[0]:
        told.append(messages.ModeChange(mode, _find_mode_actor(vehicle, t_usec, row, acts=acts)))
    beat = (mode, armed)
    if beat != vehicle.beat or told or t_usec - vehicle.beat_usec >= BEAT_USEC:
        vehicle.beat, vehicle.beat_usec = beat, t_usec
        status = CRITICAL_STATE if acts and armed else ACTIVE if armed else STANDBY
        kind = TYPES.get(int(row.get("vehicle_type", 0)), QUADROTOR)
        told.append(messages.Heartbeat(PX4.number, mode, armed, status, kind))
    return tuple(told)


def _find_mode_actor(vehicle: Px4State, t_usec: int, row: TopicRow, *, acts: bool) -> messages.Actor:
    if acts:
        return messages.Actor.FAILSAFE
    if t_usec - vehicle.asked[0] <= ORDERED_USEC:
        return vehicle.asked[1]
    return messages.Actor.MISSION if int(row.get("executor_in_charge", 0)) else messages.Actor.UNKNOWN


def _update_failsafe(vehicle: Px4State, *, acts: bool) -> Iterator[messages.OwnFailsafe]:
    """Yield failsafes that begin or end; the flag raised last is the reason."""
    if acts:
        what, said = next(reversed(vehicle.failing.values()), UNNAMED)
        if vehicle.failed is None or (vehicle.failed.what != what and what != UNNAMED[0]):
            vehicle.failed = messages.OwnFailsafe(what, active=True, words=said)
            yield vehicle.failed
    elif vehicle.failed is not None:
        yield messages.OwnFailsafe(vehicle.failed.what, active=False, words=vehicle.failed.words)
        vehicle.failed = None


def _read_failsafe_flags(vehicle: Px4State, _: int, row: TopicRow) -> Px4Messages:
    up = {name: meaning for name, meaning in FAILED.items() if row.get(name, 0)}
    up |= {name: meaning for name, meaning in VALID.items() if name in row and not row[name]}
    if row.get("battery_warning", 0) >= CRITICAL:
        up["battery_warning"] = ("battery", "battery critical")
    known = [name for name in (*FAILED, *VALID, "battery_warning") if name in row]
    for name in known:
        if name not in up:
            vehicle.failing.pop(name, None)
        elif name not in vehicle.failing:
            vehicle.failing[name] = up[name]
    return None


def _read_vehicle_command(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    command = int(row["command"])
    if command not in recorded_log.MODE_COMMANDS:
        return None
    if not row.get("from_external", 1):
        vehicle.asked = (t_usec, messages.Actor.MISSION)  # the navigator flies an item: RTL, landing
        return None
    vehicle.asked = (t_usec, messages.Actor.GROUND_STATION)
    main, sub = row["param2"], row["param3"]
    named = command == DO_SET_MODE and 0 <= main < HALF and 0 <= sub < HALF
    return messages.OrderSeen(
        command, int(main) << 16 | int(sub) << 24 if named else None, int(row.get("source_system", 0)) or None
    )


def _read_action_request(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    if int(row["action"]) == SWITCH_MODE:
        vehicle.asked = (t_usec, REQUESTED_BY.get(int(row["source"]), messages.Actor.UNKNOWN))
    return None


def _read_event(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    """Read an event: a failure, or a mode request and its source."""
    size = sum(f"arguments[{one}]" in row for one in range(ARGUMENT_BYTES))
    said = parse_px4_event(int(row["id"]), bytes(int(row[f"arguments[{one}]"]) for one in range(size)))
    if isinstance(said, messages.ModeChange):
        vehicle.asked = (t_usec, said.by)
        return None
    return said


def _read_mode_switches(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    """Note that the pilot moved a mode switch: before 1.13 this is the only evidence."""
    switches = tuple(int(row[name]) for name in MODE_SWITCHES if name in row)
    if switches and vehicle.switches not in {None, switches}:
        vehicle.asked = (t_usec, messages.Actor.PILOT)
    vehicle.switches = switches or vehicle.switches  # a topic of another firmware version lacks them
    return None


def _read_rc_channels(_: Px4State, __: int, row: TopicRow) -> messages.RcChannels | None:
    if row.get("rc_lost", 0):
        return None
    count = min(int(row["channel_count"]), CHANNELS)
    return messages.RcChannels(tuple(int(row[f"values[{one}]"]) for one in range(count)))


def _read_battery(_: Px4State, __: int, row: TopicRow) -> messages.Battery | None:
    if not row.get("connected", 1):
        return None
    remaining, volts = row.get("remaining", math.nan), row["voltage_v"]
    amperes, discharged = row.get("current_a", math.nan), row.get("discharged_mah", -1.0)
    cells = [float(row.get(f"voltage_cell_v[{cell}]", 0.0)) for cell in range(CELLS)]
    known = tuple(cell for cell in cells if math.isfinite(cell) and 1.0 < cell < 5.0)
    sensed = math.isfinite(amperes) and amperes >= 0
    return messages.Battery(
        battery=max(0, int(row.get("id", 1)) - 1),
        remaining_pct=100.0 * float(remaining) if 0.0 <= remaining <= 1.0 else None,
        voltage_v=float(volts) if math.isfinite(volts) and volts > 0 else None,
        current_a=float(amperes) if sensed else None,
        consumed_ah=float(discharged) / 1e3 if sensed and discharged >= 0 else None,
        charge_state=WARNINGS.get(int(row.get("warning", 0)), 0),
        faults=0,
        # If cells are not measured, PX4 divides the voltage by their number.
        cells_v=known if len(set(known)) > 1 else (),
    )


def _read_local_position(vehicle: Px4State, _: int, row: TopicRow) -> Px4Messages:
    if row.get("v_xy_valid", 1):
        vehicle.velocity_m_s = (float(row["vx"]), float(row["vy"]), float(row["vz"]))
    vehicle.height_m = -float(row["z"])
    return None


def _read_global_position(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    vehicle.placed_usec = t_usec
    place = _build_position(vehicle, t_usec, (float(row["lat"]), float(row["lon"]), float(row["alt"])), row)
    return (
        (messages.EstimatorStatus(is_absolute=not row["dead_reckoning"]), place) if "dead_reckoning" in row else place
    )


def _read_gps(vehicle: Px4State, t_usec: int, row: TopicRow) -> Px4Messages:
    """Read the GPS fix, and its position if the log has no filter position."""
    vehicle.received_usec = t_usec
    told = _build_gps(t_usec, row)
    place = _read_receiver_position(vehicle, t_usec, row)
    return told if place is None else (told, place)


def _read_receiver(vehicle: Px4State, t_usec: int, row: TopicRow) -> messages.Gps | None:
    """Read a receiver's own topic if the log lacks the combined one."""
    return None if t_usec - vehicle.received_usec < STALE_USEC else _build_gps(t_usec, row)


def _build_gps(t_usec: int, row: TopicRow) -> messages.Gps:
    off_m = float(row.get("eph", math.nan))
    return messages.Gps(
        int(row["fix_type"]),
        int(row["satellites_used"]) if "satellites_used" in row else None,
        accuracy_m=off_m if 0.0 < off_m < UNKNOWN_M else None,
        measured_s=t_usec / 1e6,
    )


def _read_receiver_position(vehicle: Px4State, t_usec: int, row: TopicRow) -> messages.Position | None:
    if row["fix_type"] < FIXED or t_usec - vehicle.placed_usec < STALE_USEC:
        return None
    if "latitude_deg" in row:
        place = (float(row["latitude_deg"]), float(row["longitude_deg"]), float(row["altitude_msl_m"]))
    else:
        place = (row["lat"] / 1e7, row["lon"] / 1e7, row["alt"] / 1e3)
    return _build_position(vehicle, t_usec, place, row)


def _build_position(
    vehicle: Px4State, t_usec: int, place: tuple[float, float, float], row: TopicRow
) -> messages.Position:
    lat_deg, lon_deg, alt_m = place
    vehicle.begun_msl_m = alt_m if vehicle.begun_msl_m is None else vehicle.begun_msl_m
    own = tuple(float(row.get(name, row.get(f"{name}_m_s", 0.0))) for name in ("vel_n", "vel_e", "vel_d"))
    north, east, down = vehicle.velocity_m_s or own
    height_m = alt_m - vehicle.begun_msl_m if vehicle.height_m is None else vehicle.height_m
    return messages.Position(t_usec / 1e6, lat_deg, lon_deg, alt_m, height_m, north, east, down, None)


def _read_height_target(vehicle: Px4State, _: int, row: TopicRow) -> messages.HeightTarget | None:
    """Read the controller's height target; a landing and a take-off may have none."""
    down_m = float(row["z"])
    return (
        messages.HeightTarget(-down_m - vehicle.height_m)
        if vehicle.height_m is not None and math.isfinite(down_m)
        else None
    )


def _read_attitude(_: Px4State, __: int, row: TopicRow) -> messages.Attitude:
    w, x, y, z = (float(row[f"q[{one}]"]) for one in range(4))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return messages.Attitude(math.degrees(roll), math.degrees(pitch))


def _read_land_detected(vehicle: Px4State, _: int, row: TopicRow) -> messages.LandedState | None:
    landed = bool(row["landed"])
    if landed == vehicle.landed:
        return None
    vehicle.landed = landed
    return messages.LandedState(landed)


def _read_mission_result(vehicle: Px4State, t_usec: int, row: TopicRow) -> messages.MissionCurrent | None:
    finished = bool(row.get("finished", 0))
    if finished and not vehicle.finished:
        vehicle.asked = (t_usec, messages.Actor.MISSION)
    vehicle.finished = finished
    item = (int(row["seq_current"]), int(row.get("seq_total", 0)))
    if item == vehicle.item or item[1] <= 0:
        return None
    vehicle.item = item
    return messages.MissionCurrent(*item)


@dataclass(frozen=True, slots=True)
class TopicReader:
    """How to read a topic."""

    read: Callable[[Px4State, int, TopicRow], Px4Messages]
    every_usec: int = 0
    """Shortest interval between rows read."""


TOPICS: Mapping[str, TopicReader] = {
    "vehicle_status": TopicReader(_read_vehicle_status),
    "battery_status": TopicReader(_read_battery, 450_000),
    "vehicle_local_position": TopicReader(_read_local_position, 200_000),
    "vehicle_global_position": TopicReader(_read_global_position, 950_000),
    "vehicle_gps_position": TopicReader(_read_gps, 950_000),
    "sensor_gps": TopicReader(_read_receiver, 950_000),
    "vehicle_local_position_setpoint": TopicReader(_read_height_target, 950_000),
    "vehicle_attitude": TopicReader(_read_attitude, 450_000),
    "vehicle_land_detected": TopicReader(_read_land_detected),
    "failsafe_flags": TopicReader(_read_failsafe_flags),
    "vehicle_status_flags": TopicReader(_read_failsafe_flags),
    "vehicle_command": TopicReader(_read_vehicle_command),
    "action_request": TopicReader(_read_action_request),
    "event": TopicReader(_read_event),
    "manual_control_switches": TopicReader(_read_mode_switches),
    "manual_control_setpoint": TopicReader(_read_mode_switches),
    "input_rc": TopicReader(_read_rc_channels, 190_000),
    "mission_result": TopicReader(_read_mission_result),
}
"""Readers by topic name."""


@dataclass(slots=True)
class UlogFile(recorded_log.RecordedFile):
    """A .ulg, read once."""

    def read_records(self) -> Iterator[recorded_log.Record]:
        """Yield the log's messages in order of time.

        Raises:
            LogError: The file is no such log.
        """
        try:
            # pyulog prints what it does not understand; that is not our output.
            with self.path.open("rb") as file, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                log = ULog(file, list(TOPICS))
        except Exception as error:
            raise LogError(f"{self.path}: expected a ULog of PX4: {error}") from error
        self.skipped.unreadable += bool(log.file_corruption)
        self.skipped.dropouts += len(log.dropouts)
        if not any(one.name == "vehicle_status" for one in log.data_list):
            self.notes.append("no vehicle_status in it: its mode, and whether it was armed, are unknown")
        system, vehicle, began_usec = _find_system(log), Px4State(), int(log.start_timestamp)
        streams = [
            self._read_rows(dataset, TOPICS[dataset.name], began_usec)
            for dataset in log.data_list
            if dataset.name not in OF_EACH or dataset.multi_id == 0
        ]
        for t_usec, read, row in heapq.merge(
            _read_settings(log, began_usec), _read_texts(log, began_usec), *streams, key=lambda one: one[0]
        ):
            try:
                told = read(vehicle, t_usec, row)
            except (KeyError, ValueError, TypeError, OverflowError):
                self.skipped.unreadable += 1
                continue
            for one in told if isinstance(told, tuple) else () if told is None else (told,):
                if (known := filter_implausible(one)) is not one:
                    self.skipped.impossible += 1
                if known is not None:
                    yield t_usec, system, known

    def _read_rows(self, dataset: Any, topic: TopicReader, began_usec: int) -> Iterator[_Turn]:  # noqa: ANN401 - pyulog is untyped
        """Yield the rows of a topic that may hold something new."""
        data, times = dataset.data, dataset.data["timestamp"]
        last_usec = -LONGEST_USEC
        for index in times.argsort(kind="stable"):  # damaged files have them in any order
            t_usec = int(times[index])
            if not _is_near(t_usec, began_usec):
                self.skipped.impossible += 1
                continue
            if t_usec - last_usec < topic.every_usec and not self.every_record:
                continue
            last_usec = t_usec
            yield t_usec, topic.read, {name: column[index] for name, column in data.items()}


_Turn = tuple[int, Callable[[Px4State, int, Any], Px4Messages], Any]
"""Next row of each topic: time, reader, row."""


def _repeat(_: Px4State, __: int, told: messages.FlightMessage) -> Px4Messages:
    return told


def _is_near(t_usec: int, began_usec: int) -> bool:
    return t_usec > 0 and abs(t_usec - began_usec) <= LONGEST_USEC


def _find_system(log: ULog) -> int:
    for dataset in log.data_list:
        if dataset.name == "vehicle_status" and len(dataset.data.get("system_id", ())):
            return int(dataset.data["system_id"][-1]) or 1
    return int(log.initial_parameters.get("MAV_SYS_ID", 1))


def _read_texts(log: ULog, began_usec: int) -> Iterator[_Turn]:
    for text in sorted(log.logged_messages, key=lambda one: one.timestamp):
        if _is_near(text.timestamp, began_usec):
            # The level is a digit; drop the console's colours.
            level = text.log_level - ord("0") if text.log_level >= ord("0") else text.log_level
            words = formatting.escape_controls(_COLOUR.sub("", str(text.message)))
            yield int(text.timestamp), _repeat, messages.StatusText(level, words)


def _read_settings(log: ULog, began_usec: int) -> Iterator[_Turn]:
    told = [(began_usec, *one) for one in log.initial_parameters.items()]
    told += [(int(t_usec), name, value) for t_usec, name, value in log.changed_parameters]
    for t_usec, name, value in sorted(told, key=lambda one: one[0]):
        if recorded_log.is_wanted_setting(name) and _is_near(t_usec, began_usec) and math.isfinite(value):
            yield t_usec, _repeat, messages.VehicleSetting(name, float(value))
