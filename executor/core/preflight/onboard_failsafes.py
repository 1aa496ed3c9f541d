"""What a vehicle does by itself, read from its parameters and said in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from executor.core.interface.messages import Version
from missions import BatteryLevel, Dialect, ThresholdUnit, Words, find_name_on_board

Parameters = Mapping[str, float]
"""What a vehicle answered, by name; a parameter that it does not have is missing."""
UNKNOWN = "unknown action"
LINK_MARGIN_S = 3.0
"""Beyond the time in which a vehicle's own failsafe has acted."""
LEAST_LINK_TIMEOUT_S = 10.0


def list_preflight_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return every parameter that the checks before the flight read."""
    return select_names(
        *link_names(dialect), dialect.ground_station_failsafe.station_sysid, *battery_names(dialect),
        *fence_names(dialect), *(tuning.parameter for tuning in dialect.tunings), *dialect.pack_parameters,
    )  # fmt: skip


def select_names(*names: str | None) -> tuple[str, ...]:
    """Return names of parameters without those that a dialect does not have, each once."""
    return tuple(dict.fromkeys(name for name in names if name is not None))


def link_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say what a vehicle does in silence."""
    rule = dialect.ground_station_failsafe
    return select_names(rule.action, rule.timeout, rule.pause, rule.exception[0])


def battery_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say what a vehicle does on a low battery."""
    failsafe = dialect.battery_failsafe
    levels = (name for level in failsafe.levels for name in (level.action, level.threshold, level.voltage))
    return select_names(failsafe.capacity, *(early.action for early in failsafe.early), *levels)


def fence_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that describe a vehicle's geofence."""
    rule = dialect.geofence
    kinds = () if rule.kinds is None else rule.kinds[:1]
    return select_names(*rule.enabled_by, rule.height, rule.radius, *kinds, rule.action)


def describe_action(actions: Words, value: float) -> str:
    """Return what a value of an action means; a firmware may know more of them than this table."""
    return dict(actions).get(int(value), UNKNOWN)


@dataclass(frozen=True, slots=True)
class LinkFailsafe:
    """What a vehicle does when it does not hear the ground station."""

    acts: bool | None
    """Whether it does anything; None if nobody knows."""
    after_s: float
    """Silence, in its own time, until it has begun to: by its autopilot's defaults for a parameter that it does not
    have, by the longest that is allowed for one that was not read."""
    words: str
    returns: bool = False
    """Whether that is a straight return, up to its height first."""
    holds_s: float = 0.0
    """How long it holds before this and its other failsafes act, by the same."""
    unread: bool = False
    """Whether a parameter of it was not read."""


def read_link_failsafe(dialect: Dialect, parameters: Parameters, unread: Collection[str] = ()) -> LinkFailsafe:
    """Return what a vehicle does by itself in silence.

    Args:
        dialect: The vehicle's autopilot.
        parameters: What it answered.
        unread: What it may have, and did not answer.
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
    """Return the parameter that says whose heartbeats count, and its value; None if anybody's do or nobody knows."""
    first = dialect.ground_station_failsafe.station_sysid
    name = None if first is None else find_name_on_board(dialect, first, parameters)
    return None if name is None or name not in parameters else (name, int(parameters[name]))


def effective_link_timeout_s(
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
    # Of what nobody knows the worst is assumed: that it acts, and as late as that.
    acts_s = None if own is None or own.acts is False else own.after_s
    if wanted_s is not None and wanted_s >= (acts_s or 0.0):
        return wanted_s
    if acts_s is None or wanted_s is None:
        least_s = stall_s + rule.returns_after_s - rule.reacts_after_s
        acts_s = max(rule.returns_after_s if acts_s is None else acts_s, least_s)
    return max(LEAST_LINK_TIMEOUT_S, acts_s + LINK_MARGIN_S)


@dataclass(frozen=True, slots=True)
class BatteryAction:
    """What a vehicle does below one threshold."""

    below_pct: float | None
    """Of a full battery; None where only a voltage sets it off."""
    words: str
    known: bool = True
    """Whether this program knows what the value of its parameter means."""


def list_battery_actions(
    dialect: Dialect, parameters: Parameters, version: Version | None = None
) -> list[BatteryAction]:
    """Return what a vehicle does by itself on a low battery, level by level; empty if it does nothing.

    Args:
        dialect: The vehicle's autopilot.
        parameters: What it answered.
        version: Of its firmware; None if that is not known.
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
        return None  # an action without a threshold is never taken
    does, since = describe_action(level.actions, action), level.since.get(int(action))
    if since is not None and (version is None or (version.major, version.minor) < since):
        does = UNKNOWN  # it may be a firmware to which this value says nothing
    words = f"{does} below {' or '.join(limits)} ({level.action}={action:g})"
    return BatteryAction(below_pct, words, known=does != UNKNOWN)


def list_early_returns(dialect: Dialect, parameters: Parameters) -> list[str]:
    """Return in words what may end a mission before any level of the battery is reached; empty if nothing does."""
    found = []
    for rule in dialect.battery_failsafe.early:
        value = parameters.get(rule.action)
        if value is None or int(value) in rule.nothing or rule.without in parameters:
            continue
        does, setting = describe_action(rule.actions, value), f"{rule.action}={value:g}"
        if rule.without is not None and does == UNKNOWN:
            continue  # the level's own line says so
        found.append(f"{does} as soon as its time left in the air is only just enough to come home ({setting})")
    return found


def read_fence_kinds(dialect: Dialect, parameters: Parameters) -> int:
    """Return which limits a vehicle keeps to, as bits of its parameter for that; all of one without it, 0 if off."""
    fence = dialect.geofence
    if not any(parameters.get(name, 0.0) for name in fence.enabled_by):
        return 0
    return -1 if fence.kinds is None else int(parameters.get(fence.kinds[0], -1))


def read_geofence(dialect: Dialect, parameters: Parameters) -> tuple[float | None, float | None]:
    """Return height over home and radius about it of the cylinder that a vehicle keeps to; None of no limit."""
    fence, kinds = dialect.geofence, read_fence_kinds(dialect, parameters)
    _, height_bit, radius_bit = fence.kinds or ("", 1, 1)
    height_m = parameters.get(fence.height, 0.0) if kinds & height_bit else 0.0
    radius_m = parameters.get(fence.radius, 0.0) if kinds & radius_bit else 0.0
    return height_m if height_m > 0 else None, radius_m if radius_m > 0 else None
