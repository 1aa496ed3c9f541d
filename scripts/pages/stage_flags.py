"""Flags of a vehicle besides its stage: the stages that allow each, its causes and its ends.

With `TRANSITIONS` this is a vehicle's complete state machine. `docs/explanations/states.md` shows both; every flight
simulated in the tests is checked against them at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from executor.core.state.vehicle_state import TRANSITIONS, Stage, VehicleState

EVERYWHERE = frozenset(Stage)
_OVER = frozenset({Stage.RETURNING, Stage.PILOT, Stage.LANDED, Stage.DOWN, Stage.LOST})
"""The mission is no longer flown, or another controller flies."""


@dataclass(frozen=True, slots=True)
class FlagRule:
    """One flag."""

    name: str
    meaning: str
    stages: frozenset[Stage]
    """Stages in which it may be set."""
    begins: str
    ends: str
    holds: Callable[[VehicleState], bool]


FLAGS: tuple[FlagRule, ...] = (
    FlagRule(
        "fault", "It will not finish its route.", _OVER,
        "A watchpoint that failed for long enough, an operator who excludes it or has it land, a start that failed.",
        "It is included on the ground.",
        lambda one: one.fault is not None,
    ),
    FlagRule(
        "taken", "It is in other hands; not commanded.", _OVER,
        "A change of mode, or another mission, that is a person's.",
        "Its pilot gives it back or lands it, an operator takes it over and confirms, or it is included.",
        lambda one: one.custody.taken is not None,
    ),
    FlagRule(
        "errand", "RTL or a landing is to be commanded, until it has answered.", frozenset({Stage.RETURNING}),
        "It is brought home: after a fault, by an operator, after a silence.",
        "It does so, others have it, it is on the ground, or its link is lost.",
        lambda one: one.orders.errand is not None,
    ),
    FlagRule(
        "held", "It holds by an operator's order.",
        frozenset({Stage.FLYING, Stage.RETURNING, Stage.LANDED, Stage.DOWN}),
        "An operator tells it to hold.",
        "A resume, going on by itself, leaving its mission, or being included.",
        lambda one: one.orders.held_s is not None,
    ),
    FlagRule(
        "lands", "It lands where it is, by an operator's order.", _OVER,
        "An operator tells it to land.",
        "It is included on the ground.",
        lambda one: one.orders.lands,
    ),
    FlagRule(
        "excluded", "It is given nothing.", _OVER | {Stage.GROUND},
        "An operator's word, its kill switch, or its pilot who lands it.",
        "It is included, or given back by its pilot.",
        lambda one: one.orders.excluded,
    ),
    FlagRule(
        "cleared", "The crew said that it may take off.", EVERYWHERE - {Stage.PILOT, Stage.LOST},
        "It is included on the ground.",
        "It flies, has landed, leaves its mission, is excluded, or others have it.",
        lambda one: one.orders.cleared_s is not None,
    ),
    FlagRule(
        "pending", "A new mission is put on board.", EVERYWHERE - {Stage.LOST},
        "A re-plan gives it another route.",
        "The upload has ended, came too late for it, or it leaves the plan.",
        lambda one: one.assignment.pending is not None,
    ),
    FlagRule(
        "stubborn", "It did not take a new mission: planned around.", EVERYWHERE,
        "An upload that failed.",
        "It answers again, or is included on the ground.",
        lambda one: one.assignment.stubborn,
    ),
    FlagRule(
        "owed", "An inspection broke: to be said if it does not count.", frozenset({Stage.FLYING, Stage.PILOT}),
        "A run over a segment that broke.",
        "It has left the segment, or its mission.",
        lambda one: one.assignment.owed is not None,
    ),
)  # fmt: skip


def find_flag_breaches(before: VehicleState, after: VehicleState) -> Iterator[str]:
    """Yield violations of the tables by a step of a vehicle."""
    if after.stage is not before.stage and after.stage not in TRANSITIONS[before.stage]:
        yield f"{after.name}: {before.stage.value} became {after.stage.value}"
    for rule in FLAGS:
        if after.stage not in rule.stages and rule.holds(after):
            yield f"{after.name}: {rule.name} while {after.stage.value}"
