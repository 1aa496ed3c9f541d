"""Propose the changes of fences and rally points on board, and check those found there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.lines import checklist
from executor.core.preflight import onboard_failsafes
from executor.core.preflight.parameter_changes import (
    REAL32,
    Answers,
    Items,
    KeptParameter,
    ParameterProposal,
    Present,
    format_number,
    list_change_checks,
    plan_change,
    propose_return_changes,
)
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.onboard_fence import fence_top_m
from missions import FlightPath, MissionKind
from missions.fences import find_first_outside, parse_outlines

OnboardLists = Mapping[MissionKind, Items | None]
"""The lists on board besides the mission; None for one that cannot be read."""
WantedLists = Mapping[MissionKind, Items]
"""The lists to upload; one not included stays."""
NEAR_M = 5.0
"""Distance within which a rally point counts as a pad."""


def list_fence_parameters(context: Context, name: str) -> tuple[str, ...]:
    """Return the parameters of a vehicle's fence behaviour; none if it gets no fence."""
    if context.fencing is None or not context.fencing.enabled:
        return ()
    setup = context.vehicles[name]
    rule = setup.dialect.geofence
    kinds, far = None if rule.kinds is None else rule.kinds[0], rule.rally_limit if setup.rallies else None
    return onboard_failsafes.select_names(kinds, rule.height, rule.action, rule.enable, far, *rule.enabled_by)


def propose_changes(context: Context, answered: Mapping[str, Answers]) -> ParameterProposal:
    """Propose the changes on board for returns clear of other vehicles, and fences that are kept.

    Args:
        context: The flight.
        answered: The parameters read from each vehicle.
    """
    proposal = propose_return_changes(context, answered)
    changes, checks = list(proposal.changes), list(proposal.checks)
    for name, said in proposal.present.items():
        made = plan_fence_changes(context, name, said)
        changes += made
        checks += [*check_fence_settings(context, name, said, made), *list_change_checks(made)]
    return replace(proposal, changes=tuple(changes), checks=tuple(checks))


def plan_fence_changes(context: Context, name: str, said: Present) -> list[KeptParameter]:
    """Return the parameters to set so that a vehicle keeps to its fence.

    The owner's limits stay where the flight fits them.
    """
    names = list_fence_parameters(context, name)
    if not names or any(one not in said for one in names):
        return []
    rule = context.vehicles[name].dialect.geofence
    stands = onboard_failsafes.read_fence_kinds(context.vehicles[name].dialect, {one: said[one].value for one in names})
    wanted: dict[str, tuple[float, str, str]] = {}
    if rule.kinds is not None:
        kinds, height_bit, _ = rule.kinds
        wanted[kinds] = (float(stands | height_bit | rule.polygons), "", checklist.FENCE_KINDS)
    steps = 10.0 if said[rule.height].kind == REAL32 else 1.0
    top = math.ceil(steps * fence_top_m(context, name)) / steps
    limit = said[rule.height].value if stands & (rule.kinds[1] if rule.kinds is not None else 1) else 0.0
    if not 0.0 < limit <= top:
        wanted[rule.height] = (top, "m", checklist.FENCE_TOP)
    action = dict(rule.named).get(context.fencing.action if context.fencing is not None else "keep")
    if action is not None:
        wanted[rule.action] = (float(action), "", checklist.FENCE_ACTION)
    if rule.rally_limit in names:
        wanted[rule.rally_limit] = (0.0, "km", checklist.RALLY_EVERYWHERE)
    if rule.enable is not None:
        wanted[rule.enable] = (1.0, "", checklist.FENCE_ENABLED)
    return [
        plan_change(context.vehicles[name], said[key], value, unit, why)
        for key, (value, unit, why) in wanted.items()
        if not math.isclose(said[key].value, value, abs_tol=1e-3)
    ]


def check_fence_settings(context: Context, name: str, said: Present, made: Sequence[KeptParameter]) -> list[Check]:
    """Check how a vehicle will keep to its fence; if it cannot, that is a reason not to fly."""
    names = list_fence_parameters(context, name)
    if not names:
        return []
    missing = [one for one in names if one not in said]
    if missing:
        return [checklist.NO_FENCE.say(name, names=", ".join(missing))]
    rule, new = context.vehicles[name].dialect.geofence, {change.name: change.new for change in made}
    action = int(new.get(rule.action, said[rule.action].value))
    does = onboard_failsafes.describe_action(rule.actions, action) if action else "nothing"
    setting = f"{rule.action}={action}"
    top = new.get(rule.height, said[rule.height].value)
    margin_m = 0.0 if context.fencing is None else context.fencing.margin_m
    if does in {"nothing", "warning", onboard_failsafes.UNKNOWN}:
        does = onboard_failsafes.UNKNOWN if does == onboard_failsafes.UNKNOWN else checklist.DOES_NOTHING
        return [checklist.FENCE_IDLE.say(name, does=does, setting=setting)]
    return [checklist.FENCE.say(name, margin_m=margin_m, top=format_number(top), does=does, setting=setting)]


def check_onboard_lists(
    context: Context, facts: VehicleFacts, path: FlightPath | None, lists: OnboardLists, ours: OnboardLists
) -> list[Check]:
    """Check lists of others on board against the flight.

    Args:
        context: The flight.
        facts: The vehicle's facts.
        path: Its first mission.
        lists: The lists on board.
        ours: The lists of an earlier attempt at this flight, which we may replace.
    """
    if context.fencing is None:
        return []
    return [
        *_check_onboard_fence(context, facts, path, lists, ours),
        *_check_onboard_rally(context, facts, lists, ours),
    ]


def _check_onboard_fence(
    context: Context, facts: VehicleFacts, path: FlightPath | None, lists: OnboardLists, ours: OnboardLists
) -> list[Check]:
    name, given = facts.name, context.fencing is not None and context.fencing.enabled
    dialect, fence = context.vehicles[name].dialect, lists.get(MissionKind.FENCE)
    if fence is None:
        return [checklist.FENCE_UNREADABLE.say(name, Severity.STOP if given else None)]
    if not fence or fence == ours.get(MissionKind.FENCE):
        return []
    what = checklist.FOREIGN_FENCE.format(items=format_count(len(fence), "item"))
    asked = checklist.IS_FENCE_ON.format(fence=what)
    if unread := facts.check_parameters_read(onboard_failsafes.fence_names(dialect), asked, CheckCode.GEOFENCE):
        return unread
    if not onboard_failsafes.read_fence_kinds(dialect, facts.parameters) & (dialect.geofence.polygons or -1):
        return [checklist.FENCE_OFF.say(name, fence=what)]
    setup, waypoints = context.vehicles[name], path.waypoints if path else ()
    pad_m, places = setup.pad_m, [context.frame.to_local_m(one.lat_deg, one.lon_deg) for one in waypoints]
    shapes = parse_outlines(fence, context.frame)
    ways = [[pad_m, *places], *([place, home_m] for home_m in (pad_m, *setup.day_pads_m) for place in places)]
    out = next((place for way in ways if (place := find_first_outside(shapes, way)) is not None), None)
    if out is not None:
        lat_deg, lon_deg = context.frame.to_wgs84_deg(*out)
        return [checklist.FENCE_LEFT.say(name, fence=what, lat_deg=lat_deg, lon_deg=lon_deg)]
    return [checklist.FENCE_FITS.say(name, fence=what, stays=checklist.FENCE_KEPT if given else "")]


def _check_onboard_rally(context: Context, facts: VehicleFacts, lists: OnboardLists, ours: OnboardLists) -> list[Check]:
    name, rule, rally = facts.name, context.fencing, lists.get(MissionKind.RALLY)
    given = rule is not None and rule.enabled and rule.rally != "keep"
    if rally is None:
        return [checklist.RALLY_UNREADABLE.say(name, Severity.STOP if given else None)]
    if rally == ours.get(MissionKind.RALLY):
        return []
    setup = context.vehicles[name]
    away_m = [setup.pad_distance_m(context.frame.to_local_m(item.x / 1e7, item.y / 1e7)) for item in rally]
    far = [one for one in away_m if one > NEAR_M]
    if not far or given:
        return []
    return [checklist.RALLY_FAR.say(name, points=format_count(len(far), "rally point"), away_m=max(far))]
