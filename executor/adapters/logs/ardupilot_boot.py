"""Convert the DataFlash records of one boot of an ArduPilot vehicle to our messages, record by record.

Older firmware has fewer fields, other names and other units; missing values stay unknown. Numbers are those of
ModeReason.h, AP_Logger.h and AP_Arming.h, unchanged since Copter 3.3; others are unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from executor.core import formatting
from executor.core.interface import messages
from executor.core.interface.recorded_log import MODE_COMMANDS, is_wanted_setting
from missions import ARDUPILOT
from missions.autopilots.dialect import mode_name
from missions.items import Frame, MissionItem

MODE_REASONS: Mapping[int, messages.Actor] = MappingProxyType({
    # mode switch, toy mode, transmitter's telemetry, its other switches; raised throttle ends a landing
    **dict.fromkeys((1, 18, 42, 53, 9), messages.Actor.PILOT),
    **dict.fromkeys((2, 32, 52), messages.Actor.GROUND_STATION),  # a command, a script, a companion computer
    # radio, battery, station, EKF, GPS, fence, terrain, avoidance and back, terminated, crash, any, leak, back from the
    # fence, radio and back, dead reckoning, take-off
    **dict.fromkeys((3, 4, 5, 6, 7, 10, 11, 14, 15, 17, 19, 25, 29, 43, 48, 50, 51, 55), messages.Actor.FAILSAFE),
    # end of the mission, of brake, flip or throw, a mission item, out of AUTO_RTL
    **dict.fromkeys((8, 12, 13, 16, 41, 45), messages.Actor.MISSION),
})  # fmt: skip
"""Actor by ModeReason."""

RESOLVED = 0
ERRORS: Mapping[int, tuple[str, str]] = MappingProxyType({
    2: ("rc", "late frames of the receiver"),
    3: ("compass", "compass"),
    5: ("rc", "radio failsafe"),
    6: ("battery", "battery failsafe"),
    7: ("gps", "GPS failsafe"),
    8: ("ground station", "ground station failsafe"),
    9: ("fence", "fence breached"),
    11: ("gps", "GPS glitch"),
    12: ("crash", "crash"),
    16: ("ekf", "EKF variance"),
    17: ("ekf", "EKF failsafe"),
    18: ("other", "barometer"),
    19: ("other", "CPU failsafe"),
    20: ("other", "avoids an aircraft"),
    21: ("terrain", "terrain data"),
    23: ("terrain", "terrain failsafe"),
    25: ("motor", "thrust loss"),
    26: ("other", "sensors failsafe"),
    29: ("vibration", "vibration failsafe"),
    30: ("other", "internal error"),
    31: ("gps", "dead reckoning failsafe"),
})  # fmt: skip
"""LogErrorSubsystem, without those that are no failsafe: initialisation, a refused mode, a flip, an EKF lane."""
LOSS_OF_CONTROL = ("crash", 2)
"""The crash check's second code: loss of control."""
DISARMED_BY: Mapping[int, messages.OwnFailsafe] = MappingProxyType({
    5: messages.OwnFailsafe("other", True, "terminated"),
    6: messages.OwnFailsafe("other", True, "CPU failsafe"),
    7: messages.OwnFailsafe("battery", True, "battery failsafe"),
    11: messages.OwnFailsafe("crash", True, "parachute"),
    12: messages.OwnFailsafe("crash", True, "Crash: Disarming"),
    15: messages.OwnFailsafe("fence", True, "fence breached"),
    16: messages.OwnFailsafe("rc", True, "radio failsafe"),
    18: messages.OwnFailsafe("ground station", True, "ground station failsafe"),
    19: messages.OwnFailsafe("terrain", True, "terrain failsafe"),
    21: messages.OwnFailsafe("terrain", True, "terrain failsafe"),
    24: messages.OwnFailsafe("ekf", True, "EKF failsafe"),
    33: messages.OwnFailsafe("gps", True, "dead reckoning failsafe"),
})  # fmt: skip
"""AP_Arming::Method values of disarms to report to the crew."""
Fields = Mapping[str, Any]
"""Fields of a record, by name."""


@dataclass(frozen=True, slots=True)
class WantedColumns:
    """Columns to read of one record type."""

    columns: frozenset[str]
    every_usec: int = 0
    """Shortest interval between records of an instance; more frequent ones are skipped."""


STANDBY, ACTIVE = 3, 4
ARMED_EVENTS, DISARMED, LANDED, NOT_LANDED = frozenset({10, 15, 28}), 11, 18, 28
"""LogEvent values: armed, auto-armed and not-landed; a log that begins at arming misses the first."""
ARMS = "Arming motors"
FAILURE = 2
"""MAV_SEVERITY assumed for texts, which a .BIN keeps without one."""
NO_MODE = 255
"""Mode number for an unknown mode."""
MODE_WAIT_USEC = 10_000_000
"""Time within which a log started at arming reports its mode."""
THRUST = 0.05
THRUST_ROWS = 3
"""Seconds of thrust without an arming record after which the log counts as begun in the air."""
STALE_USEC = 3_000_000
"""Age after which the next best source of a position or a speed is used."""
GPS_USEC = 1_000_000
CAPACITY = "BATT_CAPACITY"
FIXED = 3
"""GPS_FIX_TYPE: three-dimensional."""
CHANNELS = 14
DO_SET_MODE, ACCEPTED = 176, frozenset({0, 5})
ITEM = "CTot CNum CId Prm1 Prm2 Prm3 Prm4 Lat Lng Alt Frame"
_MODE_NUMBERS = {mode_name(ARDUPILOT, number).replace("_", "").upper(): number for number in range(29)}
_MODE_NUMBERS |= {"AUTO": 3, "BRAKE": 17}
"""Mode numbers by name; text logs hold the name."""
ArduPilotMessages = messages.FlightMessage | tuple[messages.FlightMessage, ...] | None


@dataclass(slots=True)
class ArduPilotBoot:
    """Known state of the vehicle since it was switched on."""

    first_usec: int | None = None
    begun: bool = False
    """Whether decoding has begun: the mode is known, or is not logged."""
    mode: int = NO_MODE
    armed: bool = False
    arming_told: bool = False
    changed: bool = False
    """Whether the next HEARTBEAT would differ."""
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Velocity north, east, down, from the filter behind POS."""
    filtered_usec: int = -STALE_USEC
    placed_usec: int = -STALE_USEC
    height_m: float | None = None
    """Height above home, from CTUN."""
    items: dict[int, MissionItem] = field(default_factory=dict)
    """Mission items by number."""
    begun_msl_m: float | None = None
    thrust_rows: int = 0
    capacity_ah: float = 0.0
    """Configured capacity of the first pack; 0 if unknown."""
    fix: tuple[int, int] = (-GPS_USEC, -1)
    """Time and type of the last reported fix."""

    def begin_when_known(self, t_usec: int) -> bool:
        """Return whether the vehicle can be followed from now on."""
        if not self.begun:
            self.first_usec = t_usec if self.first_usec is None else self.first_usec
            self.begun = self.changed = self.mode != NO_MODE or t_usec - self.first_usec > MODE_WAIT_USEC
        return self.begun

    def build_heartbeat(self, vehicle_type: int) -> messages.Heartbeat:
        """Return the HEARTBEAT that the vehicle would send."""
        return messages.Heartbeat(
            ARDUPILOT.number, self.mode, self.armed, ACTIVE if self.armed else STANDBY, vehicle_type
        )

    def set_armed(self, *, armed: bool) -> None:
        """Note that the log reports the vehicle armed or disarmed."""
        self.arming_told = True
        self.changed = self.changed or armed != self.armed
        self.armed = armed


def _read_mode(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    named = fields.get("ModeNum", fields["Mode"])
    number = _MODE_NUMBERS.get(str(named).replace("_", "").replace(" ", "").upper())
    boot.mode, boot.changed = int(float(named)) if number is None else number, True
    if "Rsn" not in fields:
        return None
    return messages.ModeChange(boot.mode, MODE_REASONS.get(int(fields["Rsn"]), messages.Actor.UNKNOWN))


def _read_event(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    event = int(fields["Id"])
    if event in ARMED_EVENTS or event == DISARMED:
        boot.set_armed(armed=event != DISARMED)
    return messages.LandedState(event == LANDED) if event in {LANDED, NOT_LANDED} else None


def _read_arming(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    boot.set_armed(armed=bool(fields["ArmState"]))
    return None if boot.armed else DISARMED_BY.get(int(fields.get("Method", 0)))


def _read_error(_: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    code, known = int(fields["ECode"]), ERRORS.get(int(fields["Subsys"]))
    if known is None:
        return None
    kind, words = known
    return messages.OwnFailsafe(kind, code != RESOLVED, "loss of control" if (kind, code) == LOSS_OF_CONTROL else words)


def _read_rc_channels(_: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    return messages.RcChannels(tuple(int(fields.get(f"C{one}", 0)) for one in range(1, CHANNELS + 1)))


def _read_parameter(boot: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    name, value = formatting.escape_controls(fields["Name"]), float(fields["Value"])
    if name == CAPACITY and math.isfinite(value):
        boot.capacity_ah = value / 1e3
    return messages.VehicleSetting(name, value) if is_wanted_setting(name) and math.isfinite(value) else None


def _read_command(_: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    command = int(fields["Cmd"])
    if command not in MODE_COMMANDS or int(fields["Res"]) not in ACCEPTED:
        return None
    mode = int(fields["P2"]) if command == DO_SET_MODE and math.isfinite(fields["P2"]) else None
    return messages.OrderSeen(command, mode, int(fields["SS"]))


def _read_battery(boot: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    remaining, consumed = fields.get("RemPct"), fields.get("CurrTot")
    # Integers, of old firmware, are in hundredths.
    volts, amperes = (one / 100.0 if isinstance(one, int) else one for one in (fields["Volt"], fields["Curr"]))
    # BATT_MONITOR 3 has no current: both counters stay at zero.
    counts = consumed is not None and (consumed > 0 or amperes > 0)
    battery = int(fields.get("Inst", fields.get("Instance", 0)))
    if remaining is None and counts and consumed is not None and battery == 0 and boot.capacity_ah > 0:
        # AP_BattMonitor_Backend.cpp: older firmware sent this to ground stations, but did not log it.
        remaining = int(max(0.0, min(100.0, 100.0 * (1.0 - consumed / 1e3 / boot.capacity_ah))))
    return messages.Battery(
        battery=battery,
        remaining_pct=float(remaining) if remaining is not None and 0 <= remaining <= 100 else None,
        voltage_v=volts or None,
        current_a=amperes if counts and amperes >= 0 else None,
        consumed_ah=consumed / 1e3 if counts and consumed is not None else None,
        charge_state=0,
        faults=0,
    )


def _read_position(boot: ArduPilotBoot, t_usec: int, fields: Fields) -> ArduPilotMessages:
    boot.placed_usec = t_usec
    return _build_position(t_usec, fields, fields.get("RelHomeAlt", fields.get("RelAlt", math.nan)), boot.velocity_m_s)


def _read_gps(boot: ArduPilotBoot, t_usec: int, fields: Fields) -> ArduPilotMessages:
    """Read GPS: the position if the log has no better one, and its own velocity."""
    if fields.get("I", 0) != 0:
        return None
    fix, told = int(fields["Status"]), list[messages.FlightMessage]()
    if fix != boot.fix[1] or t_usec - boot.fix[0] >= GPS_USEC:
        boot.fix = (t_usec, fix)
        told.append(messages.Gps(fix, int(fields["NSats"]), measured_s=t_usec / 1e6))
    if fix < FIXED:
        return tuple(told)
    course, speed_m_s = math.radians(fields["GCrs"]), fields["Spd"]
    velocity = (speed_m_s * math.cos(course), speed_m_s * math.sin(course), fields.get("VZ", 0.0))
    if t_usec - boot.filtered_usec > STALE_USEC:
        boot.velocity_m_s = velocity
    if t_usec - boot.placed_usec > STALE_USEC:
        boot.begun_msl_m = fields["Alt"] if boot.begun_msl_m is None else boot.begun_msl_m
        height_m = fields.get("RelAlt", boot.height_m)
        told.append(
            _build_position(
                t_usec, fields, fields["Alt"] - boot.begun_msl_m if height_m is None else height_m, velocity
            )
        )
    return tuple(told)


def _build_position(
    t_usec: int, fields: Fields, height_m: float, velocity_m_s: tuple[float, float, float]
) -> messages.Position:
    north, east, down = velocity_m_s
    return messages.Position(
        t_usec / 1e6, fields["Lat"], fields["Lng"], fields["Alt"], height_m, north, east, down, None
    )


def _read_velocity(boot: ArduPilotBoot, t_usec: int, fields: Fields) -> ArduPilotMessages:
    if fields.get("C", 0) == 0:
        boot.velocity_m_s, boot.filtered_usec = (fields["VN"], fields["VE"], fields["VD"]), t_usec
    return None


def _read_attitude(_: ArduPilotBoot, __: int, fields: Fields) -> ArduPilotMessages:
    return messages.Attitude(fields["Roll"], fields["Pitch"])


def _read_throttle(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    boot.height_m, target_m = fields.get("Alt"), fields.get("DAlt")
    share = fields.get("ThO", fields.get("ThrOut", 0))
    share = share / 1000 if share > 1 else share  # per mille in old firmware
    boot.thrust_rows = boot.thrust_rows + 1 if share > THRUST else 0
    if boot.thrust_rows >= THRUST_ROWS and not boot.arming_told and not boot.armed:
        boot.changed = boot.armed = True
    if boot.height_m is None or target_m is None or not math.isfinite(target_m - boot.height_m):
        return None
    return messages.HeightTarget(target_m - boot.height_m)


def _read_message(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    text = formatting.escape_controls(str(fields["Message"]))
    if text == ARMS:
        boot.set_armed(armed=True)
    return messages.StatusText(FAILURE, text)


def _read_started_item(boot: ArduPilotBoot, t_usec: int, fields: Fields) -> ArduPilotMessages:
    """Read an item that begins (MISE)."""
    current = messages.MissionCurrent(int(fields["CNum"]), max(0, int(fields["CTot"]) - 1) or None)
    listed = _read_mission_item(boot, t_usec, fields) if "CId" in fields else None
    return (listed, current) if isinstance(listed, messages.ListedItem) else current


def _read_mission_item(boot: ArduPilotBoot, _: int, fields: Fields) -> ArduPilotMessages:
    """Read an item: written on upload, and before Copter 4.2 again when it begins."""
    number, frame = int(fields["CNum"]), int(fields.get("Frame", Frame.GLOBAL_RELATIVE_ALT))
    x, y = (round(fields[name] * 1e7) for name in ("Lat", "Lng"))
    one, two, three, four = (float(fields.get(f"Prm{one}", 0.0)) for one in range(1, 5))
    item = MissionItem(number, frame, int(fields["CId"]), one, two, three, four, x, y, float(fields["Alt"]))
    if not math.isfinite(item.z):
        return None
    if boot.armed and boot.items.get(number) == item:
        return messages.MissionCurrent(number, max(0, int(fields["CTot"]) - 1) or None)
    boot.items[number] = item
    return messages.ListedItem(item)


_KINDS: tuple[tuple[str, Callable[[ArduPilotBoot, int, Fields], ArduPilotMessages], str, int], ...] = (
    ("MODE", _read_mode, "Mode ModeNum Rsn", 0), ("ARM", _read_arming, "ArmState Method", 0),
    ("EV", _read_event, "Id", 0), ("ERR", _read_error, "Subsys ECode", 0),
    ("RCIN", _read_rc_channels, " ".join(f"C{one}" for one in range(1, CHANNELS + 1)), 90_000),
    ("BAT", _read_battery, "Inst Instance Volt Curr CurrTot RemPct", 450_000),
    ("CURR", _read_battery, "Inst Volt Curr CurrTot", 450_000),
    ("POS", _read_position, "Lat Lng Alt RelHomeAlt RelAlt", 950_000),
    ("GPS", _read_gps, "I Status NSats Lat Lng Alt RelAlt Spd GCrs VZ TimeMS Time", 950_000),
    ("XKF1", _read_velocity, "C VN VE VD", 450_000), ("NKF1", _read_velocity, "VN VE VD", 450_000),
    ("EKF1", _read_velocity, "VN VE VD", 450_000), ("ATT", _read_attitude, "Roll Pitch", 190_000),
    ("CTUN", _read_throttle, "ThO ThrOut Alt DAlt", 950_000), ("MSG", _read_message, "Message", 0),
    ("MISE", _read_started_item, ITEM, 0), ("CMD", _read_mission_item, ITEM, 0),
    ("MAVC", _read_command, "Cmd P2 SS Res", 0), ("PARM", _read_parameter, "Name Value", 0),
)  # fmt: skip
WANTED = {name: WantedColumns(frozenset(columns.split()), every_usec) for name, _, columns, every_usec in _KINDS}
"""Columns read of each record, and how often."""
READERS = {name: read for name, read, *_ in _KINDS}
"""Readers by record type."""
