"""Parameters that a flight needs otherwise than the vehicles have them, and what is changed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from executor.core.context import Context, VehicleSetup
from executor.core.interface.check_codes import Check
from executor.core.interface.messages import ParamValue
from executor.core.lines import checklist
from executor.core.preflight.board_changes import KeptParameter, plan_change
from executor.core.preflight.failsafe_parameters import describe_unread_parameters, select_names
from missions import Dialect, ReturnParameters, max_return_height_m

Present = Mapping[str, ParamValue]
"""What one vehicle answered, by name; a parameter that it does not have is missing."""

REAL32 = 9
"""MAV_PARAM_TYPE of a float; 1 to 8 are integers."""
HIGHER_M = 0.5
"""A return this much above its layer is in its layer: half of what autopilots hold their height to."""
KEPT_HIGHER_M = 50.0
"""The highest of a fleet may return this much higher than it must: a crew knows why, nobody else is up there, and the
longer way up and down takes a minute and some 4 % of a battery."""


@dataclass(frozen=True, slots=True)
class Answers:
    """What came of asking one vehicle for parameters: what is in neither of these is not there."""

    present: Present
    unread: frozenset[str] = frozenset()
    """Of these nobody knows: the link was silent, or what came was no value."""


@dataclass(frozen=True, slots=True)
class ParameterProposal:
    """What a flight would change on board, and what that is held against."""

    present: Mapping[str, Present]
    """What each vehicle has now, as far as it matters to its RTL; without those of which that is not known."""
    changes: tuple[KeptParameter, ...]
    checks: tuple[Check, ...]
    """The same for the checklist, with what is right already and what is not known."""

    def changes_of(self, vehicle: str) -> tuple[KeptParameter, ...]:
        """Return the changes of one vehicle."""
        return tuple(change for change in self.changes if change.vehicle == vehicle)


def list_return_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that a vehicle is asked for before a change of its return."""
    rule = dialect.return_parameters
    return select_names(rule.height, rule.cone, rule.descend_height, rule.descend_wait)


def list_newer_return_parameters(dialect: Dialect, present: Present) -> tuple[str, ...]:
    """Return what else it is asked for: the name of its height in newer firmware, where the older is not known."""
    rule = dialect.return_parameters
    return (rule.newer_height,) if rule.newer_height is not None and rule.height not in present else ()


def propose_return_changes(
    context: Context, answered: Mapping[str, Answers], *, ceiling_m: float | None = None
) -> ParameterProposal:
    """Return what must be set so that every vehicle comes home by itself clear of the others.

    What is right already stays, and so does a higher return of the one vehicle above which there is nobody. A vehicle
    lower down may not return higher than its layer: it would climb through the layers of others.

    Args:
        context: Of the flight.
        answered: What came of asking each vehicle.
        ceiling_m: How high over its own home a return that is set already may be to stay; by default as high as the
            site's ceiling over the ground allows.
    """
    changes: list[KeptParameter] = []
    checks: list[Check] = []
    over_depot_m = {
        name: context.return_height_m(name) + context.frame.up_m(context.setup.pad_of(name).alt_m)
        for name in context.vehicles
    }
    highest = max(over_depot_m, key=over_depot_m.__getitem__)
    for name, answers in answered.items():
        said = answers.present
        if answers.unread:
            unread = describe_unread_parameters(answers.unread)
            checks.append(checklist.CHANGES_UNKNOWN.of(name, unread=unread))
            continue
        allowed_m = max_return_height_m(context.setup, name) if ceiling_m is None else ceiling_m
        own, check = _propose_for_vehicle(context, name, said, allowed_m if name == highest else 0.0)
        changes += own
        checks += [check, *list_change_checks(own)]
    present = {name: answers.present for name, answers in answered.items() if not answers.unread}
    return ParameterProposal(present, tuple(changes), tuple(checks))


def list_change_checks(changes: Sequence[KeptParameter]) -> list[Check]:
    """Return the lines of the checklist that name changes."""
    return [checklist.TO_BE_SET.of(one.vehicle, change=one.words_set) for one in changes]


def _propose_for_vehicle(
    context: Context, vehicle: str, said: Present, kept_to_m: float
) -> tuple[list[KeptParameter], Check]:
    setup, wanted_m = context.vehicles[vehicle], context.return_height_m(vehicle)
    rule = setup.dialect.return_parameters
    name, unit_m = find_height_parameter(rule, said)
    known = said.get(name)
    if known is None:
        names = " or ".join(one for one in (rule.height, rule.newer_height) if one is not None)
        return [], checklist.RTL_UNKNOWN.of(vehicle, names=names)
    is_m = known.value * unit_m
    most_m = max(wanted_m + HIGHER_M, min(kept_to_m, wanted_m + KEPT_HIGHER_M))
    changes, height_m = [], is_m
    if not wanted_m - unit_m <= is_m <= most_m:
        value = _round_up_height(wanted_m, unit_m, known.kind)
        height_m = value * unit_m
        unit = "cm" if unit_m < 1.0 else "m"
        why = _explain_return_height(context)
        changes.append(plan_change(setup, known, value, unit, why))
    changes += _propose_other_changes(setup, said, height_m)
    is_ = "is" if height_m == is_m else "will be"
    return changes, checklist.RTL_ALTITUDE.of(vehicle, is_=is_, height_m=round(height_m, 1), name=name)


def check_return_height(context: Context, vehicle: str, proposal: ParameterProposal, ends: Mapping[str, str]) -> Check:
    """Say at which height a vehicle comes home by itself once its parameters are set.

    Args:
        context: Of the flight.
        vehicle: Which one.
        proposal: What was to be set.
        ends: By name, why a parameter is not as wanted; empty where it is.
    """
    said, wanted_m = proposal.present[vehicle], context.return_height_m(vehicle)
    name, unit_m = find_height_parameter(context.vehicles[vehicle].dialect.return_parameters, said)
    problems = "; ".join(problem for problem in ends.values() if problem)
    new = next((change.new for change in proposal.changes_of(vehicle) if change.name == name), said[name].value)
    height_m = round((said[name].value if ends.get(name) else new) * unit_m, 1)
    line = checklist.RTL_STAYS if ends.get(name) else checklist.RTL_SET_BUT if problems else checklist.RTL_SET
    return line.of(vehicle, height_m=height_m, name=name, wanted_m=wanted_m, problems=problems)


def find_height_parameter(rule: ReturnParameters, said: Present) -> tuple[str, float]:
    """Return the parameter that holds the height of a vehicle's RTL, and its unit in metres."""
    if rule.newer_height is not None and rule.height not in said and rule.newer_height in said:
        return rule.newer_height, 1.0
    return rule.height, rule.unit_m


def _round_up_height(height_m: float, unit_m: float, kind: int) -> float:
    """Return a height in a parameter's unit: whole centimetres, whole metres of an integer, else tenths."""
    step = 0.1 if unit_m == 1.0 and kind == REAL32 else 1.0
    return round(math.ceil(round(height_m / unit_m / step, 6)) * step, 1)


def _explain_return_height(context: Context) -> str:
    heights = context.setup.layers.track_heights_m
    if len(context.vehicles) == 1:
        return checklist.ABOVE_LINE
    if float(heights.max() - heights.min()) > 1.0:  # as `missions.safety` tells flat from uneven
        return checklist.ABOVE_LAYERS
    return checklist.IN_ITS_LAYER


def _propose_other_changes(setup: VehicleSetup, said: Present, height_m: float) -> list[KeptParameter]:
    """Return what else keeps a vehicle from returning at that height."""
    rule, changes = setup.dialect.return_parameters, []
    cone = said.get(rule.cone)
    if cone is not None and cone.value >= rule.cone_least:
        changes.append(plan_change(setup, cone, rule.cone_off, rule.cone_unit, checklist.CLIMBS_NEAR_PAD))
    stop = None if rule.descend_height is None else said.get(rule.descend_height)
    wait = None if rule.descend_wait is None else said.get(rule.descend_wait)
    waits = wait is None or wait.value != 0.0
    if stop is not None and waits and stop.value < height_m:
        changes.append(plan_change(setup, stop, height_m, "m", checklist.WAITS_IN_LAYER))
    return changes
