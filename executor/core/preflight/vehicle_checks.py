"""Check vehicles and their packs before the flight, and explain why one does not arm."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from executor.core.battery import pack_condition, voltage
from executor.core.battery.pack_condition import RECENT_FLIGHTS, PackCondition
from executor.core.battery.voltage import NO_FACTS, PackFacts
from executor.core.context import Context, VehicleSetup
from executor.core.formatting import format_count
from executor.core.interface import messages
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.ports import LinkView
from executor.core.lines import checklist
from executor.core.preflight import onboard_failsafes
from executor.core.preflight.onboard_failsafes import LinkFailsafe, Parameters
from executor.core.radio_budget import LinkMeasures
from executor.core.telemetry import vehicle_identity
from executor.core.telemetry.vehicle_identity import describe_foreign_system
from missions import (
    Dialect,
    Estimate,
    FlightPath,
    add_first_names,
    check_separation,
    estimate,
    find_name_on_board,
    list_other_names,
    margin_m,
)

RECORD_BYTES_S = 2500.0
"""Bytes per second of a vehicle's events and telemetry log: 2300 in a demo flight of four ArduPilot vehicles."""
SPARE_ROOM = 4.0
"""Factor on the disk space: a flight with a re-plan is longer, and pictures and a copy need room too."""
PAD_OFF_M = 15.0
"""Height error of a GPS."""
PAD_SLOPE = 0.3
"""Steepest slope of the ground from the depot to a pad, in metres per metre."""
FARTHEST_PAD_M = 200.0
"""Distance from the depot beyond which a vehicle is not the one in the site file."""
SILENT_LINK_S = 3.0
GPS_M = 5.0
"""Height error of a good GPS, beside the raster's."""
PREARM_SENSORS = {
    0x1: "gyroscope", 0x2: "accelerometer", 0x4: "compass", 0x8: "barometer", 0x20: "GPS", 0x10000: "remote control",
    0x100000: "geofence", 0x200000: "attitude estimate", 0x1000000: "logging", 0x2000000: "battery",
    0x40000000: "motors",
}  # fmt: skip
"""MAV_SYS_STATUS_SENSOR bits that a multicopter's crew can act on."""
PREARM_PREFIXES = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied:", "Arming denied!")
"""Prefixes of the autopilots before a reason."""
PREARM_VALID_S = 35.0
"""Age at which a reason is settled; ArduPilot repeats them every 30 s."""
PREARM_SHOWN = 3
"""Reasons shown; more are counted."""
USUAL_OTHER = 254
"""A system id that no station has by default."""
LIKE = 1.1
"""Ratio below which two capacities are equal: the label on a pack, and a parameter."""


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """The reports of one vehicle before the flight."""

    name: str
    heartbeat: messages.Heartbeat
    position: messages.Position
    remaining_pct: float
    version: messages.Version | None
    parameters: Parameters
    """The parameters read."""
    stations: tuple[messages.StationHeard, ...] = ()
    """Other ground stations whose HEARTBEATs arrived over its link."""
    doubles: tuple[messages.DoubleHeard, ...] = ()
    """Other vehicles with its system id."""
    voltage_v: float | None = None
    """Voltage of its pack at rest."""
    cells: int | None = None
    """Number of cells it reports."""
    gps: messages.Gps | None = None
    """Its GPS report; None without one."""
    unread: frozenset[str] = frozenset()
    """Parameters that are unknown; one in neither field does not exist."""
    link: LinkMeasures = field(default_factory=LinkMeasures)
    acts: tuple[messages.StationActed, ...] = ()
    """Actions of stations behind `[forward]`, done or blocked."""
    links: tuple[LinkView, ...] = ()
    """Each of its links, where it has several."""

    def check_parameters_read(self, names: Iterable[str], what: str, code: CheckCode) -> list[Check]:
        """Return the reason not to fly for a check whose parameter was not read."""
        lacking = self.unread.intersection(names)
        if not lacking:
            return []
        unread = onboard_failsafes.describe_unread_parameters(lacking)
        return [replace(checklist.NOT_READ.say(self.name, what=what, unread=unread), code=code)]

    @property
    def words(self) -> str:
        """Type, autopilot and firmware."""
        version = "of unknown version" if self.version is None else str(self.version)
        return (
            f"{vehicle_identity.describe_vehicle_type(self.heartbeat.vehicle_type)}, "
            f"{vehicle_identity.describe_autopilot(self.heartbeat.autopilot)} {version}"
        )


def check_identity(
    facts: VehicleFacts, dialect: Dialect, place_m: tuple[float, float], stated_m: tuple[float, float] | None = None
) -> list[Check]:
    """Check that the vehicle at `place_m` of the local frame is the one in the site file."""
    found = [_check_firmware(facts, dialect)]
    kind = facts.heartbeat.vehicle_type
    if kind not in vehicle_identity.MULTICOPTERS:
        found.append(checklist.VEHICLE_TYPE.say(facts.name, type=vehicle_identity.describe_vehicle_type(kind)))
    is_, number = facts.heartbeat.autopilot, dialect.number
    if is_ != number:
        found.append(checklist.AUTOPILOT.say(facts.name, autopilot=is_, name=dialect.name, number=number))
    found += [checklist.DOUBLE_SYSID.say(facts.name, found=describe_foreign_system(one)) for one in facts.doubles]
    if facts.heartbeat.armed:
        found.append(checklist.ARMED.say(facts.name))
    away_m = math.dist(place_m, stated_m or (0.0, 0.0))
    if away_m > FARTHEST_PAD_M:
        where = "the depot" if stated_m is None else "its pad"
        found.append(checklist.FAR_FROM_PAD.say(facts.name, away_m=away_m, where=where, most_m=FARTHEST_PAD_M))
    return found


def check_pad_height(context: Context, facts: VehicleFacts) -> list[Check]:
    """Compare the height of a vehicle's pad by its own GPS with the depot's, the reference of all heights."""
    pad = context.setup.pad_of(facts.name)
    off_m = pad.alt_m - context.frame.alt_m
    heights = checklist.PAD_AND_DEPOT.format(pad_m=pad.alt_m, depot_m=context.frame.alt_m)
    if abs(off_m) > PAD_OFF_M + PAD_SLOPE * math.hypot(pad.east_m, pad.north_m):
        return [checklist.PAD_HEIGHT.say(facts.name, heights=heights)]
    if abs(off_m) > context.setup.inspection.height_m - margin_m(context.setup):
        return [checklist.PAD_HEIGHT_MATTERS.say(facts.name, heights=heights, off_m=abs(off_m))]
    return []


def check_pad_ground(context: Context, facts: VehicleFacts) -> list[Check]:
    """Compare a pad's height by the vehicle's GPS with the raster; its mission's heights count from it.

    A GPS that reads too high leads the vehicle lower over the ground than planned.
    """
    terrain, pad = context.setup.terrain, context.setup.pad_of(facts.name)
    if terrain is None:
        return []
    known = terrain.elevation
    ground_m = float(known.interpolate_m(np.array([[pad.east_m, pad.north_m]]))[0])
    off_m = pad.alt_m - ground_m
    if not abs(off_m) > known.uncertainty_m + GPS_M:
        return []
    severity = Severity.STOP if off_m > terrain.margin_m else None
    check = checklist.PAD_GROUND.say(
        facts.name, severity, pad_m=pad.alt_m, ground_m=ground_m, source=known.source,
        off_m=abs(off_m), lower="lower" if off_m > 0 else "higher",
    )  # fmt: skip
    return [check]


def _check_firmware(facts: VehicleFacts, dialect: Dialect) -> Check:
    line = checklist.FIRMWARE
    oldest, newest = (".".join(map(str, one)) for one in (dialect.oldest_version, dialect.newest_version))
    if facts.version is None:
        line = checklist.FIRMWARE_UNKNOWN
    elif (facts.version.major, facts.version.minor) < dialect.oldest_version:
        line = checklist.FIRMWARE_OLD
    elif (facts.version.major, facts.version.minor) > dialect.newest_version:
        line = checklist.FIRMWARE_NEW
    return line.say(facts.name, firmware=facts.words, oldest=oldest, newest=newest, tested=dialect.tested_version)


def check_link_failsafe(facts: VehicleFacts, own: LinkFailsafe, *, waited_s: float, wanted_s: float | None) -> Check:
    """Check a vehicle's GCS failsafe and its link time-out.

    Args:
        facts: The vehicle's facts.
        own: Its GCS failsafe.
        waited_s: The silence after which its segments are reassigned.
        wanted_s: The site file's value for that; None if it has none.
    """
    if wanted_s is not None and waited_s > wanted_s and not own.unread:
        return checklist.DECLARED_LATER.say(facts.name, failsafe=own.words, wanted_s=wanted_s, waited_s=waited_s)
    severity = Severity.STOP if own.unread else None if own.acts else Severity.WARNING
    return checklist.DECLARED_LOST.say(facts.name, severity, failsafe=own.words, waited_s=waited_s)


def check_ground_stations(facts: VehicleFacts, dialect: Dialect, ours: int = messages.GROUND_STATION[0]) -> list[Check]:
    """Check that a vehicle's GCS failsafe watches our HEARTBEAT, and only ours.

    Args:
        facts: The vehicle's facts.
        dialect: Its autopilot.
        ours: Our own system id.
    """
    first = dialect.ground_station_failsafe.station_sysid
    names = () if first is None else (first, *list_other_names(dialect, [first]))
    what = "whose HEARTBEATs its GCS failsafe watches is"
    found = facts.check_parameters_read(names, what, CheckCode.WATCHED_STATION)
    counted = onboard_failsafes.find_watched_station(dialect, facts.parameters)
    if names and counted is None and not found:
        found.append(checklist.STATION_UNKNOWN.say(facts.name, what=what, names=" or ".join(names)))
    if counted is not None and counted[1] != ours:
        name, value = counted
        found.append(checklist.STATION_OTHER.say(facts.name, value=value, name=name, ours=ours))
    for station in facts.stations:
        if station.behind:
            continue  # its HEARTBEATs pass through us, and end with ours
        hides = counted is None or counted[1] == station.system
        then, component = checklist.HIDES_OURS if hides else checklist.MAY_COMMAND, station.component
        if station.system == ours:
            then += checklist.HAS_OUR_NUMBER.format(free=USUAL_OTHER - (ours == USUAL_OTHER))
        found.append(checklist.STATION_HIDES.say(facts.name, system=station.system, component=component, then=then))
    return found


def check_links(facts: VehicleFacts) -> list[Check]:
    """Check which of several links of a vehicle are received."""
    silent = [one.connection for one in facts.links if one.heard_age_s is None or one.heard_age_s > SILENT_LINK_S]
    used = [one.connection for one in facts.links if one.used]
    if not used:
        return []
    line = checklist.LINK_SILENT if silent else checklist.LINKS
    return [line.say(facts.name, silent=" and ".join(silent), count=len(facts.links), used=used[0])]


def check_forwarding(
    facts: Iterable[VehicleFacts], ports: Sequence[Connection], *, allow_orders: bool, signed: bool
) -> list[Check]:
    """Check the stations behind `[forward]` and their permissions.

    Args:
        facts: The vehicles' facts.
        ports: Ports where other stations receive the vehicles' frames.
        allow_orders: Whether their frames reach the vehicles.
        signed: Whether those must be signed.
    """
    if not ports:
        return []
    known, subject = tuple(facts), checklist.FORWARD
    senders = sorted({one.system for fact in known for one in fact.stations if one.behind})
    who = ", ".join(map(str, senders)) or checklist.NOBODY
    open_ = [str(port) for port in ports if port.is_on_a_network]
    line = checklist.FORWARD_ORDERS if allow_orders else checklist.FORWARD_LISTENS
    if allow_orders and open_ and not signed:
        line = checklist.FORWARD_OPEN
    acts = sorted({describe_foreign_system(act) for fact in known for act in fact.acts})
    return [
        line.say(subject, ports=", ".join(map(str, ports)), who=who, open=", ".join(open_)),
        *(checklist.FORWARD_ACT.say(subject, found=found) for found in acts),
    ]


def check_battery_failsafe_settings(facts: VehicleFacts, dialect: Dialect, left_pct: float | None) -> list[Check]:
    """Check a vehicle's battery failsafe against a flight that lands with `left_pct`."""
    names = onboard_failsafes.battery_names(dialect)
    if unread := facts.check_parameters_read(names, "battery failsafe", CheckCode.BATTERY_FAILSAFE):
        return unread
    does = onboard_failsafes.list_battery_actions(dialect, facts.parameters, facts.version)
    levels = dict.fromkeys(level.action for level in dialect.battery_failsafe.levels)
    absent = [name for name in levels if name not in facts.parameters]
    settings = ", ".join(name if name in absent else f"{name}={facts.parameters[name]:g}" for name in levels)
    known = not absent and all(action.known for action in does)
    line = checklist.BATTERY_FAILSAFE_UNKNOWN if absent else checklist.BATTERY_FAILSAFE_NONE
    actions = ", ".join(action.words for action in does)
    if does:
        line = checklist.BATTERY_FAILSAFE
        actions += checklist.FAILSAFE_LACKS.format(absent=", ".join(absent)) if absent else ""
    severity = None if known else Severity.WARNING
    found = [line.say(facts.name, severity, settings=settings, actions=actions)]
    early = onboard_failsafes.list_early_returns(dialect, facts.parameters)
    found += [checklist.RETURNS_EARLY.say(facts.name, action=words) for words in early]
    return found + [
        checklist.ACTS_IN_FLIGHT.say(facts.name, action=action.words, left_pct=left_pct)
        for action in does
        if left_pct is not None and action.below_pct is not None and action.below_pct >= left_pct
    ]


def check_own_geofence(context: Context, facts: VehicleFacts, path: FlightPath | None) -> list[Check]:
    """Check that the flight and the RTL fit a vehicle's own geofence."""
    setup = context.vehicles[facts.name]
    names = onboard_failsafes.fence_names(setup.dialect)
    if unread := facts.check_parameters_read(names, "its geofence is", CheckCode.GEOFENCE):
        return unread
    ends_high_m, ends_away_m = onboard_failsafes.read_geofence(setup.dialect, facts.parameters)
    if ends_high_m is None and ends_away_m is None:
        return []
    high_m, away_m = context.return_height_m(facts.name), 0.0
    for point in path.waypoints if path is not None else ():
        high_m = max(high_m, point.alt_rel_m)
        away_m = max(away_m, math.dist(setup.pad_m, context.frame.to_local_m(point.lat_deg, point.lon_deg)))
    rule, found = setup.dialect.geofence, list[Check]()
    action = facts.parameters.get(rule.action, 0.0)
    if action and onboard_failsafes.describe_action(rule.actions, action) == onboard_failsafes.UNKNOWN:
        does = onboard_failsafes.UNKNOWN
        found.append(checklist.GEOFENCE_ACTION.say(facts.name, action=does, name=rule.action, value=action))
    # The owner's limits are not lifted for a fence of ours.
    severity = Severity.STOP if context.fencing is not None and context.fencing.enabled else None
    for limit_m, needed_m, name, what in (
        (ends_high_m, high_m, rule.height, "high"),
        (ends_away_m, away_m, rule.radius, "away from home"),
    ):
        if limit_m is not None and needed_m > limit_m:
            found.append(
                checklist.GEOFENCE_ENDS.say(
                    facts.name, severity, limit_m=limit_m, needed_m=needed_m, what=what, name=name
                )
            )
    return found or [checklist.GEOFENCE_FITS.say(facts.name)]


def flight_times(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Check whether the parameters of a vehicle's speed, the basis of its times and energy, are known."""
    names = [tuning.parameter for tuning in dialect.tunings]
    asked = (*names, *list_other_names(dialect, names))
    if unread := facts.check_parameters_read(asked, "how it flies is", CheckCode.ENERGY):
        return unread
    known = add_first_names(dialect, facts.parameters)
    absent = [name for name in names if name not in known]
    if not absent:
        return []
    return [checklist.TIMES_BY_DEFAULT.say(facts.name, names=", ".join(absent), tested=dialect.tested_version)]


def check_terrain_following(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Check a vehicle's terrain following: a warning if it makes the flight differ from the plan."""
    names, known = [rule.parameter for rule in dialect.terrain], facts.parameters
    asked = (*names, *list_other_names(dialect, names))
    if unread := facts.check_parameters_read(asked, "whether it follows the ground is", CheckCode.TERRAIN):
        return unread
    on_board = {rule: find_name_on_board(dialect, rule.parameter, known) for rule in dialect.terrain}
    set_ = [rule for rule, name in on_board.items() if known.get(name)]
    on = [rule for rule in set_ if int(known[on_board[rule]]) in rule.on]
    setting = {rule: f"{on_board[rule]} {known[on_board[rule]]:g}" for rule in set_}
    follows, unknown, name = checklist.TERRAIN_FOLLOWED, checklist.TERRAIN_UNKNOWN, facts.name
    found = [follows.say(name, setting=setting[rule], meaning=rule.words) for rule in on if rule.in_flight]
    found += [unknown.say(name, setting=setting[rule]) for rule in set_ if rule not in on]
    idle = "; ".join(f"{setting[rule]} {rule.words}" for rule in on)
    return found or [checklist.TERRAIN_NOT_FOLLOWED.say(name, idle=f" ({idle})" if idle else "")]


def check_shutter(facts: VehicleFacts, dialect: Dialect, path: FlightPath | None) -> list[Check]:
    """Check whether the autopilot takes the pictures its mission requires; empty if it requires none."""
    rule = dialect.shutter
    asked = {capture.trigger for point in path.waypoints for capture in point.captures} if path is not None else set()
    if not asked & rule.triggers:
        return []
    what = "whether its autopilot takes pictures is"
    if unread := facts.check_parameters_read((rule.parameter,), what, CheckCode.CAMERA):
        return unread
    value = facts.parameters.get(rule.parameter)
    if value:
        return [checklist.SHUTTER.say(facts.name, name=rule.parameter, value=value)]
    said = f"does not say {rule.parameter}" if value is None else f"{rule.parameter} 0"
    return [checklist.NO_SHUTTER.say(facts.name, said=said, words=rule.words, remedy=rule.remedy)]


def estimate_flight(context: Context, path: FlightPath) -> Estimate:
    """Return the expected flight time and energy, with the vehicle's learned consumption."""
    factor = context.vehicles[path.vehicle].prior.factor
    return estimate(path, context.pricing.models[path.vehicle], consumption=factor)


def check_energy(context: Context, name: str, path: FlightPath | None, remaining_pct: float) -> Check:
    """Compare the flight's energy with the battery's charge."""
    setup = context.vehicles[name]
    if path is None:
        return checklist.SPARE.say(name, left_pct=remaining_pct)
    needed = estimate_flight(context, path)
    left_pct = remaining_pct - needed.energy_pct
    line = checklist.ENERGY_SHORT if left_pct < setup.reserve_pct else checklist.ENERGY
    return line.say(
        name, has_pct=remaining_pct, minutes=needed.duration_s / 60, needs_pct=needed.energy_pct, left_pct=left_pct,
        reserve_pct=setup.reserve_pct,
    )  # fmt: skip


def check_signing(connections: Mapping[str, Sequence[Connection]], *, signed: bool) -> Check:
    """Check who could send frames as the vehicles, or to them.

    Args:
        connections: All connections of each vehicle.
        signed: Whether frames must be signed.
    """
    if signed:
        return checklist.SIGNED.say("signing")
    open_ = [name for name, several in connections.items() if any(one.is_on_a_network for one in several)]
    if not open_:
        radios = any(one.scheme is Scheme.SERIAL for several in connections.values() for one in several)
        return checklist.UNSIGNED.say("signing", beyond=checklist.RADIOS if radios else checklist.NO_RADIOS)
    are = "is" if len(open_) == 1 else "are"
    return checklist.UNSIGNED_ON_NETWORK.say("signing", vehicles=", ".join(open_), are=are)


def check_disk_space(free_bytes: int, paths: Mapping[str, FlightPath], context: Context) -> Check:
    """Compare the free disk space with the size of the flight's record."""
    flown_s = sum(estimate(path, context.pricing.models[path.vehicle]).duration_s for path in paths.values())
    needed = RECORD_BYTES_S * flown_s
    line = checklist.DISK_FULL if free_bytes < SPARE_ROOM * needed else checklist.DISK
    return line.say("disk", free_gb=free_bytes / 1e9, needed_mb=needed / 1e6)


def check_layer_separation(paths: list[FlightPath], layer_m: float, home_alt_m: Mapping[str, float]) -> list[Check]:
    """Check that heights and layers keep any two vehicles apart."""
    if near := check_separation(paths, layer_m, home_alt_m=home_alt_m):
        return [checklist.TOO_NEAR.say("separation", found=text) for text in near]
    return [checklist.SEPARATED.say("separation", layer_m=layer_m)]


def parse_prearm_reason(text: str) -> str | None:
    """Return the reason in a text; None for another text.

    >>> parse_prearm_reason("PreArm: Compass not calibrated")
    'Compass not calibrated'
    """
    for prefix in PREARM_PREFIXES:
        if text.startswith(prefix):
            return text.removeprefix(prefix).strip() or None
    return None


def find_missing_before_takeoff(position: messages.Position | None, remaining_pct: float | None) -> str:
    """Return in words what a vehicle must report before it may arm; empty if nothing is missing."""
    if position is None or (position.lat_deg == 0.0 and position.lon_deg == 0.0):
        return "no position"
    return "no battery state" if remaining_pct is None else ""


def describe_prearm_failure(reasons_s: Mapping[str, float], status: messages.SystemStatus | None, now_s: float) -> str:
    """Return why the pre-arm checks fail.

    Args:
        reasons_s: The vehicle's reasons, with their last times.
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


@dataclass(frozen=True, slots=True)
class PackAtRest:
    """The condition of a pack at rest."""

    standing: PackCondition
    count: str
    """Number of cells, in words."""
    reads_volts: bool
    """Whether its percentage is derived from that voltage, so that they cannot disagree."""

    @property
    def doubtful(self) -> bool:
        """Whether its percentage exceeds what its voltage allows."""
        return self.standing.doubtful and not self.reads_volts

    @property
    def held_pct(self) -> float:
        """Its charge: by voltage where that contradicts its percentage."""
        claimed_pct = self.standing.claimed_pct
        return min(claimed_pct, self.standing.held_pct) if self.doubtful else claimed_pct


def pack_facts_from_parameters(parameters: Mapping[str, float]) -> PackFacts:
    """Return the facts of a pack from a vehicle's parameters."""
    said = NO_FACTS
    for name in voltage.PARAMETERS:
        if name in parameters:
            said = voltage.apply_pack_parameter(said, name, parameters[name])
    return said


def assess_pack_at_rest(
    setup: VehicleSetup, claimed_pct: float, rest_v: float | None, cells: int | None, parameters: Mapping[str, float]
) -> PackAtRest | None:
    """Return the condition of a vehicle's pack at rest, with the cells it reports; None without a voltage."""
    if rest_v is None:
        return None
    known = pack_facts_from_parameters(parameters).override_with(setup.pack)
    told = cells or known.cells
    cells = told or voltage.least_cell_count(rest_v)
    found = pack_condition.assess_resting_pack(rest_v, cells, known, claimed_pct)
    count = (checklist.CELLS if told else checklist.CELLS_AT_LEAST).format(cells=cells)
    reads_volts = setup.dialect.rounds_twice and parameters.get("BAT1_CAPACITY", -1.0) <= 0.0
    return PackAtRest(found, count, reads_volts)


def check_pack(context: Context, facts: VehicleFacts) -> list[Check]:
    """Compare the capacity it counts with to the plan's, and its rest voltage to its percentage."""
    names = context.vehicles[facts.name].dialect.pack_parameters
    if unread := facts.check_parameters_read(names, "what its pack is taken for is", CheckCode.PACK):
        return unread
    setup, planned_ah, checks = context.vehicles[facts.name], context.drone.capacity_ah, list[Check]()
    if (known := setup.history) is not None:
        severity, history = None, describe_pack_history(setup, planned_ah)
        if known.share_of(planned_ah) < 1.0:
            severity = Severity.WARNING
        checks.append(checklist.PACK_HISTORY.say(facts.name, severity, label=known.label, history=history))
    counted_ah = pack_facts_from_parameters(facts.parameters).capacity_ah
    if counted_ah is not None and not planned_ah / LIKE <= counted_ah <= planned_ah * LIKE:
        line, factor = checklist.PACK_CAPACITY, planned_ah / counted_ah
        checks.append(line.say(facts.name, counted_ah=counted_ah, planned_ah=planned_ah, factor=factor))
    found = assess_pack_at_rest(setup, facts.remaining_pct, facts.voltage_v, facts.cells, facts.parameters)
    if found is None:
        return [*checks, checklist.NO_VOLTAGE.say(facts.name)]
    line = checklist.PACK_BY_VOLTS if found.reads_volts else checklist.PACK_AT_REST
    severity = Severity.WARNING if found.doubtful else None
    return [*checks, line.say(facts.name, severity, standing=found.standing.words, count=found.count)]


def describe_pack_history(setup: VehicleSetup, planned_ah: float) -> str:
    """Return the results of a pack's earlier flights, to follow its name; empty without a label."""
    known = setup.history
    if known is None:
        return ""
    if known.capacity_ah is None and known.ohm is None:
        silent = checklist.FLIGHTS_SILENT if known.flights else checklist.NO_FLIGHTS
        return silent.format(flights=format_count(known.flights, "flight"), planned_ah=planned_ah)
    parts = []
    if known.capacity_ah is not None:
        has_ah = known.capacity_ah[0]
        share_pct = 100.0 * has_ah / planned_ah
        parts.append(checklist.HAS_CAPACITY.format(has_ah=has_ah, share_pct=share_pct, planned_ah=planned_ah))
    if known.ohm is not None:
        parts.append(checklist.HAS_RESISTANCE.format(mohm=1000.0 * known.ohm[0]))
    flights = format_count(min(known.flights, RECENT_FLIGHTS), "flight")
    text = checklist.HAS.format(what=" and ".join(parts), flights=flights)
    worn = known.share_of(planned_ah) < 1.0
    if worn:
        text += checklist.WORN_BUDGET.format(budget_pct=setup.budget_pct)
    if setup.empty_pct > 0:
        text += (", " if worn else ": ") + checklist.EMPTY_AT.format(empty_pct=setup.empty_pct)
    return text
