"""What an operator may ask for in flight, and what became of it.

An intent is taken once: the same id again is answered with what became of it the first time.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Action(Enum):
    """What is asked for."""

    HOLD = "hold"
    """Stop where it is and wait."""
    RESUME = "resume"
    """Go on with the mission from where it holds."""
    RETURN = "return"
    """Come home by itself; it takes off again only when it is included."""
    LAND = "land"
    """Land where it is."""
    EXCLUDE = "exclude"
    """Treat it as lost, by the operator's word."""
    INCLUDE = "include"
    """Take a vehicle back into the plan: one on the ground takes off from its pad for that, one that its pilot has
    returned to its mission goes on."""
    DISARM = "disarm"
    """Stop the motors of a vehicle that is down."""
    PREPARE = "prepare"
    """Change the parameters that were told and put the missions on board: the answer to the first question."""
    TAKE_OFF = "take-off"
    """Begin the flight: the answer to the question before the take-off."""
    REPLAN = "replan"
    """Plan everything anew that is still to be flown."""
    ABORT = "abort"
    """Everybody returns."""


FOR_ALL = frozenset({Action.REPLAN, Action.ABORT, Action.PREPARE, Action.TAKE_OFF})
"""Actions that name no vehicle."""
BEFORE = frozenset({Action.PREPARE, Action.TAKE_OFF})
"""Answers to what is asked before the flight."""


class Outcome(Enum):
    """What became of an intent."""

    ACCEPTED = "accepted"
    """Under way."""
    DONE = "done"
    REFUSED = "refused"
    """It would be unsafe, or there is nothing to do; nothing has changed."""
    FAILED = "failed"
    """It was tried."""


@dataclass(frozen=True, slots=True)
class Intent:
    """One wish of an operator."""

    id: str
    """Chosen by who asks; the same id again is the same wish."""
    action: Action
    vehicle: str | None
    """None for what concerns everybody."""
    source: str
    """Who asks: page, mqtt, terminal."""
    confirmed: bool = False
    """Whether who asks has answered the second question, where there is one."""


@dataclass(frozen=True, slots=True)
class IntentRecord:
    """An intent and what became of it."""

    intent: Intent
    outcome: Outcome
    text: str
    """Why, in words."""
    at_s: float
    """When it was asked."""
    waiting: frozenset[str] = frozenset()
    """Vehicles whose own answer is still to come."""
    ended_s: float | None = None
    """When it came to its end; None while it is under way."""
    question: str = ""
    """What has to be confirmed first, where that is why it is refused: asked again with `confirmed` it is done."""
