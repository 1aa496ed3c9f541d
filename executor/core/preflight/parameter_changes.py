"""Record the changes a flight makes on board until they are restored, and propose the parameters to set."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Generic, Literal, TypeVar

from executor.core.context import Context, VehicleSetup
from executor.core.formatting import format_count
from executor.core.interface.codes import Check
from executor.core.interface.messages import ParamValue
from executor.core.lines import checklist
from executor.core.preflight.onboard_failsafes import (
    describe_unread_parameters,
    select_names,
)
from missions import (
    Dialect,
    MissionItem,
    MissionKind,
    find_name_on_board,
    list_other_names,
    max_return_height_m,
)
from missions.fences import find_list_differences

Value = TypeVar("Value")
Present = Mapping[str, ParamValue]
"""The parameters of one vehicle, by name; one that it does not have is missing."""

REAL32 = 9
"""MAV_PARAM_TYPE of a float; 1 to 8 are integers."""
HIGHER_M = 0.5
"""Height above its layer within which an RTL counts as in it: half the autopilots' height accuracy."""
KEPT_HIGHER_M = 50.0
"""Height above the required one that the highest vehicle's RTL may keep: its crew chose it, no vehicle is above, and
the longer climb and descent cost a minute and some 4 % of a battery."""


class ChangeStage(Enum):
    """The stage of a change."""

    PLANNED = "planned"
    """It may be on board: recorded before it is sent."""
    SET = "set"
    """It was verified by read-back."""
    RESTORED = "restored"
    """The old value was verified by read-back."""
    LEFT = "left"
    """Another value was found on board, set by others since: left unchanged."""


@dataclass(frozen=True, slots=True)
class BoardChange(ABC, Generic[Value]):
    """The record of one change, so that it can be restored whatever happens to the ground station."""

    vehicle: str
    sysid: int
    autopilot: str
    name: str
    """Name of the parameter, or 'fence' or 'rally'."""
    old: Value
    """The value before our first change."""
    new: Value
    """The value we last set."""
    stage: ChangeStage = field(default=ChangeStage.PLANNED, kw_only=True)
    earlier: tuple[Value, ...] = field(default=(), kw_only=True)
    """Values that we set before, and that may still be on board."""

    @property
    def is_open(self) -> bool:
        """Whether it has yet to be restored."""
        return self.stage is not ChangeStage.RESTORED

    @property
    def key(self) -> tuple[str, str]:
        """Vehicle and name."""
        return self.vehicle, self.name

    @staticmethod
    @abstractmethod
    def is_same(one: Value, found: Value) -> bool:
        """Return whether a value found on board is this one, within transmission precision."""

    def is_ours(self, found: Value) -> bool:
        """Return whether the value on board was set by us."""
        return any(self.is_same(one, found) for one in (self.new, *self.earlier))

    def classify(self, found: Value) -> Literal["old", "ours", "other"]:
        """Return whose value is on board: only our own is ours to restore."""
        if self.is_same(self.old, found):
            return "old"
        return "ours" if self.is_ours(found) else "other"


@dataclass(frozen=True, slots=True)
class KeptParameter(BoardChange[float]):
    """The record of one parameter."""

    kind: int
    """MAV_PARAM_TYPE."""
    unit: str
    why: str

    @property
    def words_set(self) -> str:
        """Old and new value and the reason, for the crew to confirm."""
        return f"{self.name} {format_change(self.old, self.new, self.unit)}: {self.why}"

    @property
    def words(self) -> str:
        """What is restored, for the crew to confirm."""
        return f"{self.vehicle}: {self.name} {format_change(self.new, self.old, self.unit)}"

    @property
    def words_back(self) -> str:
        """The restored value."""
        return f"{self.name} {format_number(self.old)}"

    @property
    def words_open(self) -> str:
        """The value not restored."""
        return f"{self.name} (was {format_number(self.old)})"

    def describe_other(self, found: float) -> str:
        """Return in words that another value was set since."""
        return f"{self.name} is {format_number(found)}, set by another party since then: left unchanged"

    def describe_stay(self, found: float | None) -> str:
        """Return in words the value that was not restored; None if unreadable."""
        return f"{self.name} does not answer" if found is None else f"{self.name} stays {format_number(found)}"

    @staticmethod
    def is_same(one: float, found: float) -> bool:
        """Return whether a value found on board is this one, within transmission precision."""
        return math.isclose(one, found, rel_tol=1e-5, abs_tol=1e-6)


Items = tuple[MissionItem, ...]
LIST_WORDS = {MissionKind.FENCE: "fence", MissionKind.RALLY: "rally points"}
"""Names of the lists."""


@dataclass(frozen=True, slots=True)
class KeptList(BoardChange[Items]):
    """The record of a vehicle's fence or rally points."""

    @property
    def kind(self) -> MissionKind:
        """The kind of list."""
        return MissionKind[self.name.upper()]

    @property
    def words(self) -> str:
        """What is restored, for the crew to confirm."""
        items = format_count(len(self.old), "item") if self.old else "none"
        return f"{self.vehicle}: {self.words_open} -> {items}, as before the flight"

    @property
    def words_open(self) -> str:
        """The list restored, or not restored."""
        return LIST_WORDS[self.kind]

    words_back = words_open

    def describe_other(self, found: Items) -> str:  # noqa: ARG002 - whatever it is
        """Return in words that the list was changed since."""
        return f"another party has changed the {self.words_open} since then: left unchanged"

    def describe_stay(self, found: Items | None) -> str:
        """Return in words that the list was not restored; None if unreadable."""
        return f"{self.words_open} cannot be read" if found is None else f"{self.words_open}: still the flight's"

    @staticmethod
    def is_same(one: Items, found: Items) -> bool:
        """Return whether a list found on board is this one, within transmission precision."""
        return not find_list_differences(one, found)


Recorded = TypeVar("Recorded", bound=BoardChange[Any])
Change = TypeVar("Change", bound=KeptParameter | KeptList)


def plan_change(setup: VehicleSetup, found: ParamValue, new: float, unit: str, why: str) -> KeptParameter:
    """Return the change of a parameter for the flight, from its value on board."""
    return KeptParameter(
        setup.name, setup.sysid, setup.dialect.name, found.name, found.value, new, found.kind, unit, why
    )


def build_board_record(planned: Iterable[Recorded], before: Sequence[Recorded]) -> list[Recorded]:
    """Return the complete record before a flight changes anything.

    The value found by an earlier attempt at the same flight is the oldest, and is the one restored, unless others have
    set another since.

    Args:
        planned: The changes planned, from the values on board now.
        before: The record of earlier attempts; entries without a new change stay.
    """
    record = {one.key: one for one in before}
    for change in planned:
        known = record.get(change.key)
        if known is not None and known.is_open and known.classify(change.old) != "other":
            earlier = dict.fromkeys((*known.earlier, known.new))
            change = replace(change, old=known.old, earlier=tuple(one for one in earlier if one != change.new))
        record[change.key] = change
    return list(record.values())


def format_number(value: float) -> str:
    """Return a value in its usual notation.

    >>> format_number(1500.0), format_number(27.299999237060547), format_number(0.0)
    ('1500', '27.3', '0')
    """
    return str(int(value)) if value == int(value) else f"{value:g}"


def format_change(before: float, after: float, unit: str) -> str:
    """Return a change of a value in its usual notation."""
    return f"{format_number(before)} -> {format_number(after)}{f' {unit}' if unit else ''}"


@dataclass(frozen=True, slots=True)
class Answers:
    """The parameters read from a vehicle; one in neither field does not exist."""

    present: Present
    unread: frozenset[str] = frozenset()
    """Unknown ones: no answer, or no valid value."""


@dataclass(frozen=True, slots=True)
class ParameterProposal:
    """The changes a flight would make on board, and the values they are based on."""

    present: Mapping[str, Present]
    """The present RTL parameters of each vehicle; without vehicles where they are unknown."""
    changes: tuple[KeptParameter, ...]
    checks: tuple[Check, ...]
    """The changes as checklist lines, with values that are right already or unknown."""

    def changes_of(self, vehicle: str) -> tuple[KeptParameter, ...]:
        """Return the changes of one vehicle."""
        return tuple(change for change in self.changes if change.vehicle == vehicle)


UNASKED = "unasked streams"
"""Name in the record for the number of unrequested streams a vehicle sends."""


def propose_stream_changes(context: Context, proposal: ParameterProposal, radios: Collection[str]) -> ParameterProposal:
    """Add the switched-off unrequested streams, where a radio has no room for them.

    Args:
        context: The flight.
        proposal: The other changes.
        radios: Vehicles whose radio has reported itself.
    """
    own = [
        KeptParameter(name, setup.sysid, setup.dialect.name, UNASKED, len(off), 0.0, REAL32, "", checklist.NO_ROOM)
        for name, setup in context.vehicles.items()
        if (off := setup.radio.list_unwanted(setup.dialect, on_radio=name in radios)) and name in proposal.present
    ]
    return replace(proposal, changes=(*proposal.changes, *own), checks=(*proposal.checks, *list_change_checks(own)))


def list_return_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters read before a change of the RTL."""
    rule = dialect.return_parameters
    return select_names(rule.height, rule.cone, rule.descend_height, rule.descend_wait)


def propose_return_changes(context: Context, answered: Mapping[str, Answers]) -> ParameterProposal:
    """Propose the changes that give every vehicle an RTL clear of the others.

    Right values stay, and so does a higher RTL of the topmost vehicle, up to the site's ceiling over the ground. A
    lower vehicle's RTL must not be above its layer: it would climb through the layers of others.

    Args:
        context: The flight.
        answered: The parameters read from each vehicle.
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
            checks.append(checklist.CHANGES_UNKNOWN.say(name, unread=unread))
            continue
        kept_to_m = max_return_height_m(context.setup, name) if name == highest else 0.0
        own, check = _propose_for_vehicle(context, name, said, kept_to_m)
        changes += own
        checks += [check, *list_change_checks(own)]
    present = {name: answers.present for name, answers in answered.items() if not answers.unread}
    return ParameterProposal(present, tuple(changes), tuple(checks))


def add_other_homes(context: Context, proposal: ParameterProposal) -> ParameterProposal:
    """Add the changes needed later for other pads, whose ground is higher or lower.

    They are recorded from the start, so that they are restored from whichever pad is the last.
    """
    changes, setup = {one.key: one for one in proposal.changes}, context.setup
    for name, said in proposal.present.items():
        for home in setup.list_pads_of(name)[1:]:
            pads = tuple(home if pad.vehicle == name else pad for pad in setup.pads)
            elsewhere = replace(context, setup=replace(setup, pads=pads))
            for one in propose_return_changes(elsewhere, {name: Answers(said)}).changes:
                known = changes.get(one.key, replace(one, new=one.old))
                more = checklist.AT_OTHER_PAD.format(value=format_number(one.new))
                if one.new not in {known.new, *known.earlier}:
                    known = replace(known, earlier=(*known.earlier, one.new), why=known.why + more)
                changes[one.key] = known
    return replace(proposal, changes=tuple(changes.values()))


def list_change_checks(changes: Sequence[KeptParameter]) -> list[Check]:
    """Return the checklist lines of changes."""
    return [checklist.TO_BE_SET.say(one.vehicle, change=one.words_set) for one in changes]


def _propose_for_vehicle(
    context: Context, vehicle: str, said: Present, kept_to_m: float
) -> tuple[list[KeptParameter], Check]:
    setup, wanted_m = context.vehicles[vehicle], context.return_height_m(vehicle)
    rule = setup.dialect.return_parameters
    name, unit_m = find_height_parameter(setup.dialect, said)
    known = said.get(name)
    if known is None:
        names = " or ".join((rule.height, *list_other_names(setup.dialect, [rule.height])))
        return [], checklist.RTL_UNKNOWN.say(vehicle, names=names)
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
    return changes, checklist.RTL_ALTITUDE.say(vehicle, is_=is_, height_m=round(height_m, 1), name=name)


def check_return_height(context: Context, vehicle: str, proposal: ParameterProposal, ends: Mapping[str, str]) -> Check:
    """Check a vehicle's RTL height after its parameters are set.

    Args:
        context: The flight.
        vehicle: The vehicle's name.
        proposal: The changes that were to be set.
        ends: By parameter, why it is not as wanted; empty if it is.
    """
    said, wanted_m = proposal.present[vehicle], context.return_height_m(vehicle)
    name, unit_m = find_height_parameter(context.vehicles[vehicle].dialect, said)
    problems = "; ".join(problem for problem in ends.values() if problem)
    new = next((change.new for change in proposal.changes_of(vehicle) if change.name == name), said[name].value)
    height_m = round((said[name].value if ends.get(name) else new) * unit_m, 1)
    line = checklist.RTL_STAYS if ends.get(name) else checklist.RTL_SET_BUT if problems else checklist.RTL_SET
    return line.say(vehicle, height_m=height_m, name=name, wanted_m=wanted_m, problems=problems)


def find_height_parameter(dialect: Dialect, said: Present) -> tuple[str, float]:
    """Return the parameter of a vehicle's RTL height, and its unit in metres."""
    rule = dialect.return_parameters
    name = find_name_on_board(dialect, rule.height, said)
    return name, rule.unit_m if name == rule.height else rule.unit_m / dialect.other_names[rule.height].unit


def _round_up_height(height_m: float, unit_m: float, kind: int) -> float:
    """Return a height in a parameter's unit: whole centimetres, whole metres of an integer, else tenths."""
    step = 0.1 if unit_m == 1.0 and kind == REAL32 else 1.0
    return round(math.ceil(round(height_m / unit_m / step, 6)) * step, 1)


def _explain_return_height(context: Context) -> str:
    heights = context.setup.layers.track_heights_m
    if len(context.vehicles) == 1:
        return checklist.ABOVE_LINE
    if float(heights.max() - heights.min()) > 1.0:  # the limit for flat ground in `missions.layers_and_rtl_heights`
        return checklist.ABOVE_LAYERS
    return checklist.IN_ITS_LAYER


def _propose_other_changes(setup: VehicleSetup, said: Present, height_m: float) -> list[KeptParameter]:
    """Return other changes needed for a return at that height."""
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
