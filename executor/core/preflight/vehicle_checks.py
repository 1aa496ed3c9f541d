"""What must be true before anything moves: plain checks over what the vehicles said, and why one does not arm."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from executor.core.context import Context
from executor.core.interface.check_codes import CheckCode
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.messages import (
    GROUND_STATION,
    DoubleHeard,
    Gps,
    Heartbeat,
    Position,
    StationHeard,
    SystemStatus,
    Version,
)
from executor.core.preflight import failsafe_parameters
from executor.core.preflight.failsafe_parameters import LinkFailsafe, Parameters
from executor.core.telemetry import firmware
from executor.core.telemetry.foreign_systems import describe_foreign_system
from missions import Dialect, Estimate, FlightPath, Pad, check_separation, estimate, margin_m

RECORD_BYTES_S = 2500.0
"""Of one vehicle's events and telemetry log: 2300 in a demo flight of four ArduPilot vehicles."""
SPARE_ROOM = 4.0
"""A flight with a re-plan takes longer, and pictures and a copy are wanted too."""
PAD_OFF_M = 15.0
"""What a GPS may be off in height."""
PAD_SLOPE = 0.3
"""By how much the ground may rise from the depot to a pad, in metres a metre."""
FARTHEST_PAD_M = 200.0
"""A vehicle that stands farther from the depot than this is not the one that the site file means."""
GPS_M = 5.0
"""What a good GPS is off in height beside the raster."""
PREARM_SENSORS = {
    0x1: "gyroscope", 0x2: "accelerometer", 0x4: "compass", 0x8: "barometer", 0x20: "GPS", 0x10000: "remote control",
    0x100000: "geofence", 0x200000: "attitude estimate", 0x1000000: "logging", 0x2000000: "battery",
    0x40000000: "motors",
}  # fmt: skip
"""MAV_SYS_STATUS_SENSOR, as far as a multicopter's crew can do something about it."""
PREARM_PREFIXES = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied:", "Arming denied!")
"""What the autopilots put before a reason."""
PREARM_VALID_S = 35.0
"""ArduPilot repeats the reasons every 30 s: an older one is settled."""
PREARM_SHOWN = 3
"""More reasons than this are counted only."""


class Severity(Enum):
    """What a finding means for the flight."""

    OK = "ok"
    WARNING = "warning"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the checklist."""

    severity: Severity
    subject: str
    text: str
    code: CheckCode


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """What one vehicle said before the flight."""

    name: str
    heartbeat: Heartbeat
    position: Position
    remaining_pct: float
    version: Version | None
    parameters: Parameters
    """Those that were answered."""
    stations: tuple[StationHeard, ...] = ()
    """Other ground stations whose heartbeats came over its link."""
    doubles: tuple[DoubleHeard, ...] = ()
    """Other vehicles with its number."""
    voltage_v: float | None = None
    """Of its pack at rest."""
    cells: int | None = None
    """How many cells it tells apart."""
    gps: Gps | None = None
    """What its position is by; None where it did not say."""
    unread: frozenset[str] = frozenset()
    """Parameters of which nobody knows; what is in neither, the vehicle does not have."""

    def check_parameters_read(self, names: Iterable[str], what: str, code: CheckCode) -> list[Check]:
        """Return the reason not to fly where something cannot be checked, as a parameter of it was not read."""
        lacking = self.unread.intersection(names)
        if not lacking:
            return []
        text = f"{what} not known: {failsafe_parameters.describe_unread_parameters(lacking)}; is the link too bad?"
        return [Check(Severity.STOP, self.name, text, code)]

    @property
    def words(self) -> str:
        """Type, autopilot and firmware."""
        version = "of unknown version" if self.version is None else str(self.version)
        return (
            f"{firmware.describe_vehicle_type(self.heartbeat.vehicle_type)}, "
            f"{firmware.describe_autopilot(self.heartbeat.autopilot)} {version}"
        )


def pad_from(facts: VehicleFacts, east_m: float, north_m: float) -> Pad:
    """Return the place where a vehicle really stands, which is where it will land."""
    return Pad(facts.name, east_m, north_m, facts.position.alt_msl_m - facts.position.alt_rel_m)


def check_identity(
    facts: VehicleFacts, dialect: Dialect, place_m: tuple[float, float], stated_m: tuple[float, float] | None = None
) -> list[Check]:
    """Check that the vehicle, which stands at `place_m` of the local frame, is the one that the site file means."""
    found = [_check_firmware(facts, dialect)]
    kind = facts.heartbeat.vehicle_type
    if kind not in firmware.MULTICOPTERS:
        text = f"HEARTBEAT type is {firmware.describe_vehicle_type(kind)}, expected a multicopter"
        found.append(Check(Severity.STOP, facts.name, text, CheckCode.VEHICLE_TYPE))
    if facts.heartbeat.autopilot != dialect.number:
        text = f"HEARTBEAT autopilot is {facts.heartbeat.autopilot}, expected {dialect.name} ({dialect.number})"
        found.append(Check(Severity.STOP, facts.name, text, CheckCode.AUTOPILOT))
    found += [
        Check(Severity.STOP, facts.name, describe_foreign_system(double), CheckCode.DOUBLE_SYSID)
        for double in facts.doubles
    ]
    if facts.heartbeat.armed:
        text = "already armed, expected a disarmed vehicle on its pad"
        found.append(Check(Severity.STOP, facts.name, text, CheckCode.ARMED))
    away_m = math.dist(place_m, stated_m or (0.0, 0.0))
    if away_m > FARTHEST_PAD_M:
        where = "the depot" if stated_m is None else "its pad"
        text = f"stands {away_m:.0f} m from {where}, expected at most {FARTHEST_PAD_M:.0f} m"
        found.append(Check(Severity.STOP, facts.name, text, CheckCode.FAR_FROM_DEPOT))
    return found


def check_pad_height(context: Context, facts: VehicleFacts) -> list[Check]:
    """Hold the height of a vehicle's pad, by its own GPS, against the depot's: all heights are counted from there."""
    pad = context.setup.pad_of(facts.name)
    off_m = pad.alt_m - context.frame.alt_m
    text = f"its pad is {pad.alt_m:.0f} m above sea level by its GPS, the depot {context.frame.alt_m:.0f} m"
    if abs(off_m) > PAD_OFF_M + PAD_SLOPE * math.hypot(pad.east_m, pad.north_m):
        text += ": expected depot.alt_m and GPS to agree"
        return [Check(Severity.STOP, facts.name, text, CheckCode.PAD_HEIGHT)]
    if abs(off_m) > context.setup.inspection.height_m - margin_m(context.setup):
        text += f": its flight is {abs(off_m):.0f} m off if they do not agree"
        return [Check(Severity.WARNING, facts.name, text, CheckCode.PAD_HEIGHT)]
    return []


def check_pad_ground(context: Context, facts: VehicleFacts) -> list[Check]:
    """Hold a pad's height by the vehicle's own GPS against the raster: all heights of its mission are counted from it.

    A GPS that is too high sends the vehicle lower over the ground than its mission says.
    """
    terrain, pad = context.setup.terrain, context.setup.pad_of(facts.name)
    if terrain is None:
        return []
    known = terrain.elevation
    ground_m = float(known.interpolate_m(np.array([[pad.east_m, pad.north_m]]))[0])
    off_m = pad.alt_m - ground_m
    if not abs(off_m) > known.uncertainty_m + GPS_M:
        return []
    lower = f"{abs(off_m):.0f} m {'lower' if off_m > 0 else 'higher'} over the ground than planned"
    text = f"its pad is at {pad.alt_m:.0f} m by its GPS, at {ground_m:.0f} m by {known.source}: it flies {lower}"
    severity = Severity.STOP if off_m > terrain.margin_m else Severity.WARNING
    return [Check(severity, facts.name, f"{text} if the raster is right", CheckCode.PAD_HEIGHT)]


def _check_firmware(facts: VehicleFacts, dialect: Dialect) -> Check:
    tested = f"tested with {dialect.tested_version}"
    if facts.version is None:
        return Check(Severity.WARNING, facts.name, f"{facts.words}; faultline is {tested}", CheckCode.FIRMWARE)
    if (facts.version.major, facts.version.minor) < dialect.oldest_version:
        oldest = ".".join(map(str, dialect.oldest_version))
        text = f"{facts.words}, which is older than {oldest}; faultline is {tested}"
        return Check(Severity.WARNING, facts.name, text, CheckCode.FIRMWARE)
    return Check(Severity.OK, facts.name, facts.words, CheckCode.FIRMWARE)


def check_link_failsafe(facts: VehicleFacts, own: LinkFailsafe, *, waited_s: float, wanted_s: float | None) -> Check:
    """Say what the vehicle does by itself when it does not hear us, and how long it is waited for.

    Args:
        facts: What it said.
        own: What its parameters mean.
        waited_s: The silence after which its segments are given away.
        wanted_s: The site file's figure for that; None if it has none.
    """
    declared = f"declared lost after {waited_s:g} s"
    if own.unread:
        return Check(Severity.STOP, facts.name, f"{own.words}; {declared}", CheckCode.LINK_FAILSAFE)
    if wanted_s is not None and waited_s > wanted_s:
        text = (
            f"{own.words}; faults.link_timeout_s {wanted_s:g} is shorter, and its segments would be reassigned while "
            f"it still flies them: {declared} instead"
        )
        return Check(Severity.WARNING, facts.name, text, CheckCode.LINK_FAILSAFE)
    severity = Severity.OK if own.acts else Severity.WARNING
    return Check(severity, facts.name, f"{own.words}; {declared}", CheckCode.LINK_FAILSAFE)


def check_ground_stations(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Check that it is our heartbeat, and ours alone, that the vehicle's failsafe waits for."""
    ours, names = GROUND_STATION[0], dialect.ground_station_failsafe.station_sysid
    what = "whose HEARTBEATs its GCS failsafe watches is"
    found = facts.check_parameters_read(names, what, CheckCode.WATCHED_STATION)
    counted = failsafe_parameters.find_watched_station(dialect, facts.parameters)
    if names and counted is None and not found:
        text = f"{what} not known: it has no {' or '.join(names)}"
        found.append(Check(Severity.WARNING, facts.name, text, CheckCode.WATCHED_STATION))
    if counted is not None and counted[1] != ours:
        name, value = counted
        text = f"its GCS failsafe watches system {value} ({name}), ours is {ours}: it will not act when we are lost"
        found.append(Check(Severity.WARNING, facts.name, text, CheckCode.WATCHED_STATION))
    for station in facts.stations:
        hides = counted is None or counted[1] == station.system
        then = "its HEARTBEATs would hide the loss of ours" if hides else "it may command the vehicle too"
        text = f"another ground station is on its link, system {station.system} component {station.component}: {then}"
        found.append(Check(Severity.WARNING, facts.name, text, CheckCode.OTHER_STATION))
    return found


def check_battery_failsafe_settings(facts: VehicleFacts, dialect: Dialect, left_pct: float | None) -> list[Check]:
    """Say what the vehicle does on a low battery, and whether that fits a flight that lands with `left_pct`."""
    names = failsafe_parameters.battery_names(dialect)
    if unread := facts.check_parameters_read(names, "battery failsafe", CheckCode.BATTERY_FAILSAFE):
        return unread
    rule = failsafe_parameters.read_battery_rule(dialect, facts.parameters)
    levels = dict.fromkeys(level.action for level in dialect.battery_failsafe.levels)
    absent = [name for name in levels if name not in facts.parameters]
    settings = ", ".join(name if name in absent else f"{name}={facts.parameters[name]:g}" for name in levels)
    known = bool(rule.actions) and rule.said and all(action.known for action in rule.actions)
    text = f"no battery failsafe ({settings}): on an empty battery it keeps flying until it falls"
    if rule.actions:
        text = f"battery failsafe: {', '.join(action.words for action in rule.actions)}"
        text += f"; it has no {', '.join(absent)}" if absent else ""
    elif not rule.said:
        text = f"battery failsafe not known ({settings})"
    severity = Severity.OK if known else Severity.WARNING
    found = [Check(severity, facts.name, text, CheckCode.BATTERY_FAILSAFE)]
    for words in failsafe_parameters.list_early_returns(dialect, facts.parameters, facts.version):
        text = f"battery failsafe: {words}: it may leave its mission"
        found.append(Check(Severity.WARNING, facts.name, text, CheckCode.BATTERY_FAILSAFE))
    for action in rule.actions:
        if left_pct is not None and action.below_pct is not None and action.below_pct >= left_pct:
            early = f"{action.words}, but its flight ends with {left_pct:.0f} %: it would act in flight"
            text = f"battery failsafe: {early}"
            found.append(Check(Severity.WARNING, facts.name, text, CheckCode.BATTERY_FAILSAFE))
    return found


def check_own_geofence(context: Context, facts: VehicleFacts, path: FlightPath | None) -> list[Check]:
    """Check that the flight, and the return by itself, fit into the vehicle's own geofence."""
    setup = context.vehicles[facts.name]
    names = failsafe_parameters.fence_names(setup.dialect)
    if unread := facts.check_parameters_read(names, "its geofence is", CheckCode.GEOFENCE):
        return unread
    cylinder = failsafe_parameters.read_geofence(setup.dialect, facts.parameters)
    if cylinder is None:
        return []
    high_m, away_m = context.return_height_m(facts.name), 0.0
    for point in path.waypoints if path is not None else ():
        high_m = max(high_m, point.alt_rel_m)
        away_m = max(away_m, math.dist(setup.pad_m, context.frame.to_local_m(point.lat_deg, point.lon_deg)))
    rule, found = setup.dialect.geofence, list[Check]()
    action = facts.parameters.get(rule.action, 0.0)
    if action and failsafe_parameters.describe_action(rule.actions, action) == failsafe_parameters.UNKNOWN:
        text = f"at a breach of its geofence: {failsafe_parameters.UNKNOWN} ({rule.action}={action:g})"
        found.append(Check(Severity.WARNING, facts.name, text, CheckCode.GEOFENCE))
    # What its owner has set is no limit to be lifted for a fence of ours.
    stops = context.fencing is not None and context.fencing.enabled
    for limit_m, needed_m, name, what in (
        (cylinder.height_m, high_m, rule.height, "high"),
        (cylinder.radius_m, away_m, rule.radius, "away from home"),
    ):
        if limit_m is not None and needed_m > limit_m:
            text = f"its geofence ends {limit_m:g} m {what} ({name}), but its flight goes {needed_m:.0f} m {what}"
            found.append(Check(Severity.STOP if stops else Severity.WARNING, facts.name, text, CheckCode.GEOFENCE))
    text = "its flight fits into the cylinder of its own geofence"
    return found or [Check(Severity.OK, facts.name, text, CheckCode.GEOFENCE)]


def flight_times(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Say where it is not known how fast a vehicle flies: its times and its energy are planned by that."""
    names = [tuning.parameter for tuning in dialect.tunings]
    if unread := facts.check_parameters_read(names, "how it flies is", CheckCode.ENERGY):
        return unread
    absent = [name for name in names if name not in facts.parameters]
    if not absent:
        return []
    text = f"it has no {', '.join(absent)}: its times are planned by {dialect.tested_version}'s default"
    return [Check(Severity.WARNING, facts.name, text, CheckCode.ENERGY)]


def list_terrain_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say whether it follows the ground by itself."""
    return tuple(rule.parameter for rule in dialect.terrain)


def check_terrain_following(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Say what a vehicle follows by itself: a warning where its flight is another for it than was planned."""
    names = list_terrain_parameters(dialect)
    if unread := facts.check_parameters_read(names, "whether it follows the ground is", CheckCode.TERRAIN):
        return unread
    set_ = [rule for rule in dialect.terrain if facts.parameters.get(rule.parameter)]
    on = [rule for rule in set_ if int(facts.parameters[rule.parameter]) in rule.on]
    setting = {rule: f"{rule.parameter} {facts.parameters[rule.parameter]:g}" for rule in set_}
    found = [f"follows the ground by itself: {setting[rule]}: {rule.words}" for rule in on if rule.in_flight]
    found += [f"may follow the ground by itself: {setting[rule]} is unknown" for rule in set_ if rule not in on]
    if found:
        return [Check(Severity.WARNING, facts.name, text, CheckCode.TERRAIN) for text in found]
    idle = "; ".join(f"{setting[rule]} {rule.words}" for rule in on)
    text = "its missions and its RTL do not follow the ground by themselves" + (f" ({idle})" if idle else "")
    return [Check(Severity.OK, facts.name, text, CheckCode.TERRAIN)]


def list_shutter_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say whether it takes pictures."""
    return (dialect.shutter.parameter,)


def check_shutter(facts: VehicleFacts, dialect: Dialect, path: FlightPath | None) -> list[Check]:
    """Say whether pictures are taken that a vehicle's mission asks of its autopilot; nothing where it asks for none."""
    rule = dialect.shutter
    asked = {capture.trigger for point in path.waypoints for capture in point.captures} if path is not None else set()
    if not asked & rule.triggers:
        return []
    what = "whether its autopilot takes pictures is"
    if unread := facts.check_parameters_read((rule.parameter,), what, CheckCode.CAMERA):
        return unread
    value = facts.parameters.get(rule.parameter)
    if value:
        text = f"its autopilot takes pictures ({rule.parameter} {value:g})"
        return [Check(Severity.OK, facts.name, text, CheckCode.CAMERA)]
    said = f"does not say {rule.parameter}" if value is None else f"{rule.parameter} 0"
    text = f"{said}: its autopilot takes no pictures {rule.words}; expected {rule.remedy}, and a restart"
    return [Check(Severity.WARNING, facts.name, text, CheckCode.CAMERA)]


def charge_after_flight_pct(context: Context, path: FlightPath | None, remaining_pct: float) -> float | None:
    """Return what a flight should leave in the battery; None if there is no flight."""
    return None if path is None else remaining_pct - _estimate_flight(context, path).energy_pct


def _estimate_flight(context: Context, path: FlightPath) -> Estimate:
    """Return what a flight should take, with what is known of its vehicle's consumption."""
    factor = context.vehicles[path.vehicle].prior.factor
    return estimate(path, context.pricing.models[path.vehicle], consumption=factor)


def check_energy(context: Context, name: str, path: FlightPath | None, remaining_pct: float) -> Check:
    """Compare what the flight should take with what is in the battery."""
    setup = context.vehicles[name]
    if path is None:
        text = f"stays on the ground as a spare, battery {remaining_pct:.0f} %"
        return Check(Severity.OK, name, text, CheckCode.ENERGY)
    needed = _estimate_flight(context, path)
    left = remaining_pct - needed.energy_pct
    text = (
        f"battery {remaining_pct:.0f} %, flight {needed.duration_s / 60:.1f} min and {needed.energy_pct:.0f} %, "
        f"lands with {left:.0f} %"
    )
    if left < setup.reserve_pct:
        text += f", expected at least the reserve of {setup.reserve_pct:g} %"
        return Check(Severity.STOP, name, text, CheckCode.ENERGY)
    return Check(Severity.OK, name, text, CheckCode.ENERGY)


def check_signing(connections: Mapping[str, Connection], *, signed: bool) -> Check:
    """Say who may speak for the vehicles, and to them.

    Args:
        connections: Of each vehicle.
        signed: Whether frames must be signed.
    """
    if signed:
        text = "frames are signed; frames not signed with our key are rejected"
        return Check(Severity.OK, "signing", text, CheckCode.SIGNING)
    open_ = [name for name, connection in connections.items() if connection.is_on_a_network]
    if not open_:
        radios = any(connection.scheme is Scheme.SERIAL for connection in connections.values())
        beyond = "a radio like ours on the same channel could command the vehicles" if radios else "no link leaves here"
        return Check(Severity.OK, "signing", f"frames are not signed; {beyond}", CheckCode.SIGNING)
    text = (
        f"frames are not signed, and {', '.join(open_)} {'is' if len(open_) == 1 else 'are'} reached over a network: "
        "any sender there can command and imitate the vehicles"
    )
    return Check(Severity.WARNING, "signing", text, CheckCode.SIGNING)


def check_disk_space(free_bytes: int, paths: Mapping[str, FlightPath], context: Context) -> Check:
    """Compare the room on the disk with what the record of a flight takes."""
    flown_s = sum(estimate(path, context.pricing.models[path.vehicle]).duration_s for path in paths.values())
    needed = RECORD_BYTES_S * flown_s
    text = f"{free_bytes / 1e9:.1f} GB free, the record of a flight like this takes about {needed / 1e6:.0f} MB"
    if free_bytes < SPARE_ROOM * needed:
        return Check(Severity.WARNING, "disk", f"{text}: it may not fit", CheckCode.DISK)
    return Check(Severity.OK, "disk", text, CheckCode.DISK)


def check_layer_separation(paths: list[FlightPath], layer_m: float, home_alt_m: Mapping[str, float]) -> list[Check]:
    """Check that heights and layers keep any two vehicles apart."""
    if near := check_separation(paths, layer_m, home_alt_m=home_alt_m):
        return [Check(Severity.STOP, "separation", text, CheckCode.SEPARATION) for text in near]
    text = f"any two vehicles stay at least {layer_m:g} m apart"
    return [Check(Severity.OK, "separation", text, CheckCode.SEPARATION)]


def parse_prearm_reason(text: str) -> str | None:
    """Return the reason that a text gives; None if it is about something else.

    >>> parse_prearm_reason("PreArm: Compass not calibrated")
    'Compass not calibrated'
    """
    for prefix in PREARM_PREFIXES:
        if text.startswith(prefix):
            return text.removeprefix(prefix).strip() or None
    return None


def describe_prearm_failure(reasons_s: Mapping[str, float], status: SystemStatus | None, now_s: float) -> str:
    """Return why the pre-arm checks fail.

    Args:
        reasons_s: What the vehicle said, and when last.
        status: Its last SYS_STATUS.
        now_s: The time.
    """
    fresh = [reason for reason, said_s in reasons_s.items() if now_s - said_s <= PREARM_VALID_S]
    parts = fresh[:PREARM_SHOWN]
    if len(fresh) > PREARM_SHOWN:
        parts.append(f"{len(fresh) - PREARM_SHOWN} more")
    if not parts and status is not None:
        ill = [name for bit, name in PREARM_SENSORS.items() if status.unhealthy & bit]
        if ill:
            parts.append(f"not healthy: {', '.join(ill)}")
    return "its own pre-arm checks fail" + (f": {'; '.join(parts)}" if parts else ", no reason reported")
