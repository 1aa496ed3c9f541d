"""What a flight changes on board and is to give back: parameters, fences and rally points."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Generic, TypeVar

from executor.core.context import VehicleSetup
from executor.core.interface.messages import ParamValue
from missions import MissionItem, MissionKind
from missions.fences import find_list_differences

Items = tuple[MissionItem, ...]
Value = TypeVar("Value")


class ChangeStage(Enum):
    """How far a change has come."""

    PLANNED = "planned"
    """It may be on board: this is written before it is sent."""
    SET = "set"
    """It was read back."""
    RESTORED = "restored"
    """What was there before was read back."""
    LEFT = "left"
    """Something else was found on board, which somebody put there since: it was left as it is."""


class ValueOrigin(Enum):
    """What is found on board means."""

    OLD = "old"
    OURS = "ours"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class BoardChange(ABC, Generic[Value]):
    """What is on record of one change, so that it can be given back whatever happens to the ground station."""

    vehicle: str
    sysid: int
    autopilot: str
    name: str
    """Of the parameter, or 'fence' or 'rally'."""
    old: Value
    """What was there before anybody here changed anything."""
    new: Value
    """What was put there last."""
    stage: ChangeStage = field(default=ChangeStage.PLANNED, kw_only=True)
    earlier: tuple[Value, ...] = field(default=(), kw_only=True)
    """What was put there from here before, and may still be on board."""

    @property
    def is_open(self) -> bool:
        """Whether it has still to be given back."""
        return self.stage is not ChangeStage.RESTORED

    @property
    def key(self) -> tuple[str, str]:
        """Vehicle and name."""
        return self.vehicle, self.name

    @property
    @abstractmethod
    def words(self) -> str:
        """What is restored, for the crew to confirm."""

    @property
    def words_back(self) -> str:
        """What the vehicle has again once it is given back."""
        return self.words_open

    @property
    @abstractmethod
    def words_open(self) -> str:
        """What the vehicle has not got back."""

    @staticmethod
    @abstractmethod
    def is_same(one: Value, found: Value) -> bool:
        """Return whether what was found on board is this one, but for what is lost on its way."""

    def is_ours(self, found: Value) -> bool:
        """Return whether what is on board was put there from here."""
        return any(self.is_same(one, found) for one in (self.new, *self.earlier))

    def classify(self, found: Value) -> ValueOrigin:
        """Return what it means that this is on board: it is only ours to take back where we put it there."""
        if self.is_same(self.old, found):
            return ValueOrigin.OLD
        return ValueOrigin.OURS if self.is_ours(found) else ValueOrigin.OTHER


@dataclass(frozen=True, slots=True)
class KeptParameter(BoardChange[float]):
    """What is on record of one parameter."""

    kind: int
    """MAV_PARAM_TYPE."""
    unit: str
    why: str

    @property
    def words_set(self) -> str:
        """Old, new and why, for the crew to confirm before it is set."""
        return f"{self.name} {format_change(self.old, self.new, self.unit)}: {self.why}"

    @property
    def words(self) -> str:
        """What is restored, for the crew to confirm."""
        return f"{self.vehicle}: {self.name} {format_change(self.new, self.old, self.unit)}"

    @property
    def words_back(self) -> str:
        """What the vehicle has again once it is given back."""
        return f"{self.name} {format_number(self.old)}"

    @property
    def words_open(self) -> str:
        """What the vehicle has not got back."""
        return f"{self.name} (was {format_number(self.old)})"

    @staticmethod
    def is_same(one: float, found: float) -> bool:
        """Return whether what was found on board is this one, but for what is lost on its way."""
        return math.isclose(one, found, rel_tol=1e-5, abs_tol=1e-6)


def plan_change(setup: VehicleSetup, found: ParamValue, new: float, unit: str, why: str) -> KeptParameter:
    """Return a parameter that is to be set on a vehicle for the flight, from what is on board."""
    return KeptParameter(
        setup.name, setup.sysid, setup.dialect.name, found.name, found.value, new, found.kind, unit, why
    )


@dataclass(frozen=True, slots=True)
class KeptList(BoardChange[Items]):
    """What is on record of one vehicle's fence, or of its rally points."""

    @property
    def kind(self) -> MissionKind:
        """Which list."""
        return MissionKind.FENCE if self.name == "fence" else MissionKind.RALLY

    @property
    def words(self) -> str:
        """What is restored, for the crew to confirm."""
        items = f"{len(self.old)} item{'s' if len(self.old) != 1 else ''}" if self.old else "none"
        return f"{self.vehicle}: {self.words_open} -> {items}, as before the flight"

    @property
    def words_open(self) -> str:
        """What the vehicle has not got back."""
        return "fence" if self.name == "fence" else "rally points"

    @staticmethod
    def is_same(one: Items, found: Items) -> bool:
        """Return whether what was found on board is this one, but for what is lost on its way."""
        return not find_list_differences(one, found)


Change = TypeVar("Change", bound=BoardChange[Any])


def build_board_record(planned: Iterable[Change], before: Sequence[Change]) -> list[Change]:
    """Return the whole record before a flight changes anything.

    What an earlier attempt at the same flight found is the oldest value, and given back, unless somebody put something
    else there since.

    Args:
        planned: What it is going to change, from what is on board now.
        before: The record of earlier attempts; what is not changed again stays on it.
    """
    record = {one.key: one for one in before}
    for change in planned:
        known = record.get(change.key)
        if known is not None and known.is_open and known.classify(change.old) is not ValueOrigin.OTHER:
            earlier = dict.fromkeys((*known.earlier, known.new))
            change = replace(change, old=known.old, earlier=tuple(one for one in earlier if one != change.new))
        record[change.key] = change
    return list(record.values())


def format_number(value: float) -> str:
    """Return a value as people write it.

    >>> format_number(1500.0), format_number(27.299999237060547), format_number(0.0)
    ('1500', '27.3', '0')
    """
    return str(int(value)) if value == int(value) else f"{value:g}"


def format_change(before: float, after: float, unit: str) -> str:
    """Return how a value changes, as people write it."""
    return f"{format_number(before)} -> {format_number(after)}{f' {unit}' if unit else ''}"
