"""Read a vehicle's failsafes from its parameters, and describe them in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from executor.core.interface.messages import Version
from missions import BatteryLevel, Dialect, ThresholdUnit, Words, find_name_on_board

Parameters = Mapping[str, float]
"""The parameters of a vehicle, by name; one that it does not have is missing."""
UNKNOWN = "unknown action"
LINK_MARGIN_S = 3.0
"""Margin after the vehicle's own failsafe has acted."""
LEAST_LINK_TIMEOUT_S = 10.0


def list_preflight_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return all parameters that the checks before the flight read."""
    return select_names(
        *link_names(dialect), dialect.ground_station_failsafe.station_sysid, *battery_names(dialect),
        *fence_names(dialect), *(tuning.parameter for tuning in dialect.tunings), *dialect.pack_parameters,
    )  # fmt: skip


def select_names(*names: str | None) -> tuple[str, ...]:
    """Return parameter names without those a dialect does not have, each once."""
    return tuple(dict.fromkeys(name for name in names if name is not None))


def link_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters of the GCS failsafe."""
    rule = dialect.ground_station_failsafe
    return select_names(rule.action, rule.timeout, rule.pause, rule.exception[0])


def battery_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters of the battery failsafe."""
    failsafe = dialect.battery_failsafe
    levels = (name for level in failsafe.levels for name in (level.action, level.threshold, level.voltage))
    return select_names(failsafe.capacity, *(early.action for early in failsafe.early), *levels)


def fence_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters of the geofence."""
    rule = dialect.geofence
    kinds = () if rule.kinds is None else rule.kinds[:1]
    return select_names(*rule.enabled_by, rule.height, rule.radius, *kinds, rule.action)


def describe_action(actions: Words, value: float) -> str:
    """Return the meaning of a value; a firmware may have more of them than the table."""
    return dict(actions).get(int(value), UNKNOWN)


@dataclass(frozen=True, slots=True)
class LinkFailsafe:
    """A vehicle's GCS failsafe."""

    acts: bool | None
    """Whether it acts; None if unknown."""
    after_s: float
    """Silence, in the vehicle's time, until it has begun to act: by the autopilot's default for a missing parameter, by
    its largest value for an unread one."""
    words: str
    returns: bool = False
    """Whether it returns at once, climbing first."""
    holds_s: float = 0.0
    """Hold before this and its other failsafes act, likewise."""
    unread: bool = False
    """Whether one of its parameters was not read."""


def read_link_failsafe(dialect: Dialect, parameters: Parameters, unread: Collection[str] = ()) -> LinkFailsafe:
    """Return a vehicle's action in silence.

    Args:
        dialect: The vehicle's autopilot.
        parameters: The parameters read.
        unread: Parameters it may have, but did not answer.
    """
    rule = dialect.ground_station_failsafe
    slack_s = rule.reacts_after_s - rule.timeout_s
    holds_s = 0.0
    if rule.pause is not None:
        holds_s = rule.pause_most_s if rule.pause in unread else parameters.get(rule.pause, rule.pause_s)
    timeout_s = rule.timeout_most_s if rule.timeout in unread else parameters.get(rule.timeout, rule.timeout_s)
    after_s = timeout_s + slack_s + holds_s
    lacking = [name for name in link_names(dialect) if name in unread]
    action, (name, bit) = parameters.get(rule.action), rule.exception
    acts, returns, setting = None, False, f"{rule.action}={action or 0.0:g}"
    if lacking:
        words = f"GCS failsafe not known: {describe_unread_parameters(lacking)}"
    elif action is None:
        words = f"GCS failsafe not known: it has no {rule.action}"
    elif action == 0:
        acts, words = False, f"no GCS failsafe ({setting}): without a link it flies its mission to the end"
    elif int(parameters.get(name, 0.0)) & bit:
        acts, words = False, f"no GCS failsafe in a mission ({setting}, but {name}={parameters[name]:g})"
    else:
        does, returns = describe_action(rule.actions, action), int(action) == rule.action_return
        acts, words = None if does == UNKNOWN else True, f"GCS failsafe: {does} after {after_s:g} s ({setting})"
    return LinkFailsafe(acts, after_s, words, returns=returns, holds_s=holds_s, unread=bool(lacking))


def describe_unread_parameters(names: Collection[str]) -> str:
    """Return in words that parameters were not read.

    >>> describe_unread_parameters(["RTL_ALT"]), describe_unread_parameters(["FENCE_TYPE", "FENCE_ENABLE"])
    ('RTL_ALT was not read', 'FENCE_ENABLE, FENCE_TYPE were not read')
    """
    return f"{', '.join(sorted(names))} {'was' if len(names) == 1 else 'were'} not read"


def find_watched_station(dialect: Dialect, parameters: Parameters) -> tuple[str, int] | None:
    """Return the parameter that names the GCS whose HEARTBEATs count, and its value; None if any counts, or unknown."""
    first = dialect.ground_station_failsafe.station_sysid
    name = None if first is None else find_name_on_board(dialect, first, parameters)
    return None if name is None or name not in parameters else (name, int(parameters[name]))


def effective_link_timeout_s(
    dialect: Dialect, wanted_s: float | None, stall_s: float, own: LinkFailsafe | None = None
) -> float:
    """Return the silence after which a vehicle is declared lost.

    It is the site's value, or by default the time in which the vehicle's own failsafe must have acted. A shorter value
    than the vehicle's own is rejected: its segments would be reassigned while it still flies them.

    Args:
        dialect: The vehicle's autopilot.
        wanted_s: The site's value, if any.
        stall_s: The shortest silence distinguishable from a busy computer, in the vehicles' time.
        own: The vehicle's own failsafe, once read.
    """
    rule = dialect.ground_station_failsafe
    # Unknown counts as the worst case: it acts, and as late as possible.
    acts_s = None if own is None or own.acts is False else own.after_s
    if wanted_s is not None and wanted_s >= (acts_s or 0.0):
        return wanted_s
    if acts_s is None or wanted_s is None:
        least_s = stall_s + rule.returns_after_s - rule.reacts_after_s
        acts_s = max(rule.returns_after_s if acts_s is None else acts_s, least_s)
    return max(LEAST_LINK_TIMEOUT_S, acts_s + LINK_MARGIN_S)


@dataclass(frozen=True, slots=True)
class BatteryAction:
    """A vehicle's action below one threshold."""

    below_pct: float | None
    """In percent of a full battery; None if only a voltage triggers it."""
    words: str
    known: bool = True
    """Whether the parameter's value is known to this program."""


def list_battery_actions(
    dialect: Dialect, parameters: Parameters, version: Version | None = None
) -> list[BatteryAction]:
    """Return a vehicle's actions on a low battery, level by level; empty if none.

    Args:
        dialect: The vehicle's autopilot.
        parameters: The parameters read.
        version: Its firmware version; None if unknown.
    """
    failsafe = dialect.battery_failsafe
    capacity_mah = parameters.get(failsafe.capacity, 0.0) if failsafe.capacity is not None else 0.0
    actions = [_read_battery_action(level, parameters, capacity_mah, version) for level in failsafe.levels]
    return [action for action in actions if action is not None]


def _read_battery_action(
    level: BatteryLevel, parameters: Parameters, capacity_mah: float, version: Version | None
) -> BatteryAction | None:
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
        return None  # an action without a threshold never occurs
    does, since = describe_action(level.actions, action), level.since.get(int(action))
    if since is not None and (version is None or (version.major, version.minor) < since):
        does = UNKNOWN  # possibly a firmware in which this value has no meaning
    words = f"{does} below {' or '.join(limits)} ({level.action}={action:g})"
    return BatteryAction(below_pct, words, known=does != UNKNOWN)


def list_early_returns(dialect: Dialect, parameters: Parameters) -> list[str]:
    """Return in words what may end a mission before any battery level is reached; empty if nothing."""
    found = []
    for rule in dialect.battery_failsafe.early:
        value = parameters.get(rule.action)
        if value is None or int(value) in rule.nothing or rule.without in parameters:
            continue
        does, setting = describe_action(rule.actions, value), f"{rule.action}={value:g}"
        if rule.without is not None and does == UNKNOWN:
            continue  # the level's own line covers it
        found.append(f"{does} as soon as its time left in the air is just enough to return ({setting})")
    return found


def read_fence_kinds(dialect: Dialect, parameters: Parameters) -> int:
    """Return a vehicle's active fence limits, as bits of their parameter; all bits without one, 0 if off."""
    fence = dialect.geofence
    if not any(parameters.get(name, 0.0) for name in fence.enabled_by):
        return 0
    return -1 if fence.kinds is None else int(parameters.get(fence.kinds[0], -1))


def read_geofence(dialect: Dialect, parameters: Parameters) -> tuple[float | None, float | None]:
    """Return the height and radius around home of a vehicle's cylinder fence; None for no limit."""
    fence, kinds = dialect.geofence, read_fence_kinds(dialect, parameters)
    _, height_bit, radius_bit = fence.kinds or ("", 1, 1)
    height_m = parameters.get(fence.height, 0.0) if kinds & height_bit else 0.0
    radius_m = parameters.get(fence.radius, 0.0) if kinds & radius_bit else 0.0
    return height_m if height_m > 0 else None, radius_m if radius_m > 0 else None
