"""What a vehicle does by itself, read from its parameters and said in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from missions import BatteryLevel, Dialect, ThresholdUnit

LINK_MARGIN_S = 3.0
"""Beyond the time in which a vehicle's own failsafe has acted."""
LEAST_LINK_TIMEOUT_S = 10.0
Parameters = Mapping[str, float]
"""What a vehicle answered, by name; a parameter that it does not have, or did not say, is missing."""


def names(dialect: Dialect) -> tuple[str, ...]:
    """Return every parameter that the checks before the flight read."""
    link, battery, fence = dialect.ground_station_failsafe, dialect.battery_failsafe, dialect.geofence
    wanted = [link.action, link.timeout, link.pause, link.exception[0], *link.station_sysid[:1], battery.capacity]
    for level in battery.levels:
        wanted += [level.action, level.threshold, level.voltage]
    wanted += [*fence.enabled_by, fence.height, fence.radius, fence.kinds[0] if fence.kinds is not None else None]
    wanted += [tuning.parameter for tuning in dialect.tunings]
    wanted += dialect.pack_parameters
    return tuple(dict.fromkeys(name for name in wanted if name is not None))


def older_names(dialect: Dialect, parameters: Parameters) -> tuple[str, ...]:
    """Return the older names of a parameter that did not answer by its newest; nothing if it did."""
    stations = dialect.ground_station_failsafe.station_sysid
    return () if any(name in parameters for name in stations) else stations[1:]


@dataclass(frozen=True, slots=True)
class LinkFailsafe:
    """What a vehicle does when it does not hear the ground station."""

    acts: bool | None
    """Whether it does anything; None if it did not say."""
    after_s: float
    """Silence, in its own time, until it has begun to; by its autopilot's defaults if it did not say."""
    words: str
    returns: bool = False
    """Whether that is a straight return, up to its height first."""
    holds_s: float = 0.0
    """How long it holds before this and its other failsafes act; by its autopilot's defaults if it did not say."""


def link_failsafe(dialect: Dialect, parameters: Parameters) -> LinkFailsafe:
    """Return what a vehicle does by itself in silence."""
    rule = dialect.ground_station_failsafe
    slack_s = rule.reacts_after_s - rule.timeout_s
    holds_s = parameters.get(rule.pause, rule.pause_s) if rule.pause is not None else 0.0
    after_s = parameters.get(rule.timeout, rule.timeout_s) + slack_s + holds_s
    action = parameters.get(rule.action)
    if action is None:
        words = f"GCS failsafe not known: no answer for {rule.action}"
        return LinkFailsafe(None, after_s, words, holds_s=holds_s)
    setting = f"{rule.action}={action:g}"
    if action == 0:
        words = f"no GCS failsafe ({setting}): without a link it flies its mission to the end"
        return LinkFailsafe(False, after_s, words, holds_s=holds_s)
    name, bit = rule.exception
    if int(parameters.get(name, 0.0)) & bit:
        words = f"no GCS failsafe in a mission ({setting}, but {name}={parameters[name]:g})"
        return LinkFailsafe(False, after_s, words, holds_s=holds_s)
    does = dict(rule.actions).get(int(action), "unknown action")
    words = f"GCS failsafe: {does} after {after_s:g} s ({setting})"
    return LinkFailsafe(True, after_s, words, returns=int(action) == rule.action_return, holds_s=holds_s)


def declared_lost_after_s(
    dialect: Dialect, wanted_s: float | None, stall_s: float, own: LinkFailsafe | None = None
) -> float:
    """Return the silence after which a vehicle is lost.

    It is the site's figure, or by default when the vehicle's own failsafe must have acted. A figure that is shorter
    than what the vehicle says of itself is not taken: its segments would be given away while it still flies them.

    Args:
        dialect: The vehicle's autopilot.
        wanted_s: The site's figure, if it has one.
        stall_s: The shortest silence that can be told from a busy computer, in the vehicles' time.
        own: What the vehicle says of itself, once it was asked.
    """
    rule = dialect.ground_station_failsafe
    acts_s = own.after_s if own is not None and own.acts else None
    if wanted_s is not None and wanted_s >= (acts_s or 0.0):
        return wanted_s
    if acts_s is None or wanted_s is None:
        least_s = stall_s + rule.returns_after_s - rule.reacts_after_s
        acts_s = max(rule.returns_after_s if acts_s is None else acts_s, least_s)
    return max(LEAST_LINK_TIMEOUT_S, acts_s + LINK_MARGIN_S)


def counted_station(dialect: Dialect, parameters: Parameters) -> tuple[str, int] | None:
    """Return the parameter that says whose heartbeats count, and its value; None if anybody's do or nobody knows."""
    for name in dialect.ground_station_failsafe.station_sysid:
        if name in parameters:
            return name, int(parameters[name])
    return None


@dataclass(frozen=True, slots=True)
class BatteryAction:
    """What a vehicle does below one threshold."""

    below_pct: float | None
    """Of a full battery; None where only a voltage sets it off."""
    words: str


@dataclass(frozen=True, slots=True)
class BatteryRule:
    """What a vehicle does on a low battery."""

    said: bool
    """Whether it said so of every level."""
    actions: tuple[BatteryAction, ...]
    """What it does, level by level; empty if it does nothing."""


def battery_rule(dialect: Dialect, parameters: Parameters) -> BatteryRule:
    """Return what a vehicle does by itself on a low battery."""
    failsafe = dialect.battery_failsafe
    capacity_mah = parameters.get(failsafe.capacity, 0.0) if failsafe.capacity is not None else 0.0
    actions = [_battery_action(level, parameters, capacity_mah) for level in failsafe.levels]
    said = all(level.action in parameters for level in failsafe.levels)
    return BatteryRule(said, tuple(action for action in actions if action is not None))


def _battery_action(level: BatteryLevel, parameters: Parameters, capacity_mah: float) -> BatteryAction | None:
    action = parameters.get(level.action, 0.0)
    if action == 0:
        return None
    threshold = parameters.get(level.threshold, 0.0)
    volts = parameters.get(level.voltage, 0.0) if level.voltage is not None else 0.0
    limits, below_pct = [], None
    if threshold > 0 and level.unit is ThresholdUnit.SHARE:
        below_pct = 100.0 * threshold
    elif threshold > 0 and capacity_mah > 0:
        below_pct = 100.0 * threshold / capacity_mah
    elif threshold > 0:
        limits.append(f"{threshold:g} mAh")
    if below_pct is not None:
        limits.insert(0, f"{below_pct:.0f} %")
    if volts > 0:
        limits.append(f"{volts:g} V")
    if not limits:
        return None  # an action without a threshold is never taken
    does = dict(level.actions).get(int(action), "unknown action")
    return BatteryAction(below_pct, f"{does} below {' or '.join(limits)} ({level.action}={action:g})")


@dataclass(frozen=True, slots=True)
class Cylinder:
    """The geofence that a vehicle's parameters describe."""

    height_m: float | None
    """Over home; None if there is no limit."""
    radius_m: float | None
    """About home."""


def geofence(dialect: Dialect, parameters: Parameters) -> Cylinder | None:
    """Return the cylinder that a vehicle keeps to by itself; None if it has none."""
    fence = dialect.geofence
    if not any(parameters.get(name, 0.0) for name in fence.enabled_by):
        return None
    height_m, radius_m = parameters.get(fence.height, 0.0), parameters.get(fence.radius, 0.0)
    if fence.kinds is not None:
        name, height_bit, radius_bit = fence.kinds
        kinds = int(parameters.get(name, height_bit | radius_bit))
        height_m, radius_m = height_m * bool(kinds & height_bit), radius_m * bool(kinds & radius_bit)
    if height_m <= 0 and radius_m <= 0:
        return None
    return Cylinder(height_m if height_m > 0 else None, radius_m if radius_m > 0 else None)
