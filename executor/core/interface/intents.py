"""Define the intents of an operator in flight, and their outcomes.

An intent is executed once: a repeated id gets the outcome of the first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

from executor.core.interface.codes import Ending, ReasonCode


class Action(Enum):
    """The action of an intent."""

    HOLD = "hold"
    """Stop and wait in place."""
    RESUME = "resume"
    """Continue the mission from where it holds."""
    RETURN = "return"
    """RTL; it takes off again only when it is included."""
    LAND = "land"
    """Land where it is."""
    EXCLUDE = "exclude"
    """Treat it as lost, on the operator's intent."""
    INCLUDE = "include"
    """Take a vehicle back into the plan: one on the ground takes off from its pad for that, one that its pilot has
    returned to its mission continues."""
    SWAP = "swap"
    """Its pack is changed: check it, and start its next sortie when the checks pass."""
    DISARM = "disarm"
    """Stop the motors of a vehicle that is down."""
    PREPARE = "prepare"
    """Set the listed parameters and upload the missions: the answer to the first question."""
    TAKE_OFF = "take-off"
    """Start the flight: the answer to the question before take-off."""
    REPLAN = "replan"
    """Plan all segments that are still to be flown again."""
    PROVE = "prove"
    """Fly again what counts as inspected by evidence alone, and what was flown but not seen; or fly the named assets
    again, seen or not."""
    CLOSE = "close"
    """Stop take-offs from a base of the day; vehicles in the air still land there."""
    OPEN = "open"
    """Allow take-offs from a base again."""
    COUNT = "count"
    """Set the number of charged packs at a base of the day; it replaces the plan's count."""
    ABORT = "abort"
    """All vehicles return."""


ActionName = Literal[
    "hold", "resume", "return", "land", "exclude", "include", "swap", "disarm", "replan", "prove", "close", "open",
    "count", "abort", "prepare", "take-off",
]  # fmt: skip
"""The action in a client's message: each value, as a type."""
PACK = r"^[A-Za-z0-9._:#/-]{0,32}$"
"""Format of a pack id."""
MAX_PACKS = 1000
"""Limit of packs at a base."""
MAX_ASSETS = 100
"""Limit of assets in one intent."""
LONGEST_NAME = 128
"""Limit of characters in an asset's name."""
FOR_ALL = frozenset({Action.REPLAN, Action.PROVE, Action.ABORT, Action.PREPARE, Action.TAKE_OFF})
"""Actions that name no vehicle."""
FOR_BASE = frozenset({Action.CLOSE, Action.OPEN, Action.COUNT})
"""Actions that name a base, and no vehicle."""
BEFORE_FLIGHT = frozenset({Action.PREPARE, Action.TAKE_OFF})
"""Answers to the questions before the flight."""


class Outcome(Enum):
    """The outcome of an intent."""

    ACCEPTED = "accepted"
    """Under way."""
    DONE = "done"
    REFUSED = "refused"
    """It would be unsafe, or there is nothing to do; nothing has changed."""
    FAILED = "failed"
    """It was attempted."""


class IntentReason(ReasonCode):
    """Why an intent was refused, or failed without a vehicle's answer."""

    NOT_BEGUN = "not_begun", "The flight has not begun."
    BEGUN = "begun", "The flight has begun, and the questions before it are answered."
    OVER = "over", "The flight is over."
    NOT_ASKED = "not_asked", "The question that it answers is not pending."
    VEHICLE_UNEXPECTED = "vehicle_unexpected", "It is for the whole fleet and names a vehicle."
    VEHICLE_MISSING = "vehicle_missing", "It names no vehicle."
    VEHICLE_UNKNOWN = "vehicle_unknown", "It names a vehicle that does not exist."
    UNCONFIRMED = "unconfirmed", "It needs confirmation: send it again with `confirmed`."
    ABORTED = "aborted", "The flight was aborted."
    NEVER_HEARD = "never_heard", "No message was ever received from the vehicle."
    LINK_STALE = "link_stale", "No message was received from the vehicle for some time."
    LINK_LOST = "link_lost", "The vehicle is declared lost."
    NOT_ON_MISSION = "not_on_mission", "The vehicle is not on its mission."
    ON_HOLD = "on_hold", "It is on hold already."
    NOT_ON_HOLD = "not_on_hold", "It is not on hold."
    UPLOADING = "uploading", "Its new mission is being uploaded."
    CLIMBING = "climbing", "It climbs from its pad, below its layer."
    LANDING = "landing", "It is landing already."
    RETURNING = "returning", "It returns already."
    WITH_PILOT = "with_pilot", "It is with its pilot, who has not set mission mode."
    ON_GROUND = "on_ground", "It is on the ground."
    NOT_FLYING = "not_flying", "It does not fly."
    NOT_AT_REST = "not_at_rest", "It is not on the ground with its motors off."
    NOT_DOWN = "not_down", "It is not down."
    DISARMED = "disarmed", "Its motors are off already."
    POSITION_UNKNOWN = "position_unknown", "Its position is not known."
    NEAR_LINE = "near_line", "It is too near to the line to land."
    OTHER_PAD = "other_pad", "It would land on another vehicle's pad."
    OUT_OF_PLAN = "out_of_plan", "It is out of the plan."
    IN_PLAN = "in_plan", "It is in the plan, and no segment is left over."
    CLEARED = "cleared", "It is cleared for take-off already."
    TILTED = "tilted", "It is tilted on the ground."
    OFF_PAD = "off_pad", "It is not on its pad."
    BATTERY_LOW = "battery_low", "Its battery is not above its reserve."
    SWAPPING = "swapping", "Its checks before its next sortie are under way already."
    NOT_READY = "not_ready", "Its checks before its next sortie did not pass."
    PACK_POOR = "pack_poor", "Its pack holds too little for a sortie."
    BASE_UNKNOWN = "base_unknown", "It names no base of the day, or the flight is no day of sorties."
    BASE_CLOSED = "base_closed", "The base is closed."
    BASE_OPEN = "base_open", "The base is not closed."
    PACKS_UNCOUNTED = "packs_uncounted", "The plan does not count the packs of that base, or no number was given."
    OUT_OF_HOURS = "out_of_hours", "Its next sortie would not end within its hours."
    REPLANNING = "replanning", "A re-plan is under way."
    NO_VEHICLE = "no_vehicle", "No vehicle is on a mission, or can take a new route."
    NOTHING_TO_PLAN = "nothing_to_plan", "No segment is open."
    ASSET_UNKNOWN = "asset_unknown", "It names an asset that does not exist."
    ASSET_NEVER_FLOWN = (
        "asset_never_flown",
        "It names an asset that no vehicle flies: it is not part of the flight, or no vehicle has its camera.",
    )
    ASSET_OPEN = "asset_open", "It names an asset that is still to be flown."
    OVERTAKEN = "overtaken", "The vehicle did something else before it answered."
    UNANSWERED = "unanswered", "The vehicle did not answer in time."


Reason = tuple[IntentReason, str]
"""Why an intent was refused or failed: the code, and the text for people."""


def fill_in(reason: Reason, **values: object) -> Reason:
    """Return a reason with values for the `{names}` in its text."""
    return reason[0], reason[1].format(**values)


@dataclass(frozen=True, slots=True)
class Intent:
    """A request of an operator."""

    id: str
    """Chosen by the client; a repeated id is the same intent."""
    action: Action
    vehicle: str | None
    """None if it applies to the whole fleet."""
    source: str
    """Where it comes from: page, mqtt, terminal."""
    confirmed: bool = False
    """Whether the operator has answered the confirmation question, if there is one."""
    pack: str = ""
    """For a swap, the id of the new pack; empty if not given."""
    base: str = ""
    """The base to close or open, or whose packs are counted."""
    assets: tuple[int | str, ...] = ()
    """Assets to fly again for proof: a text is an asset's name, a number its segment; empty for all inferred or missed
    ones."""
    charged: int | None = None
    """Number of charged packs at the base."""


@dataclass(frozen=True, slots=True)
class IntentRecord:
    """An intent and its outcome."""

    intent: Intent
    outcome: Outcome
    text: str
    """The reason, in words."""
    at_s: float
    """When it was received."""
    waiting: frozenset[str] = frozenset()
    """Vehicles whose answer is pending."""
    ended_s: float | None = None
    """When it ended; None while it is under way."""
    code: IntentReason | Ending | None = None
    """Why it was refused or failed; None otherwise."""
    question: str = ""
    """The question to confirm, if it was refused for that; repeated with `confirmed` it is executed."""

    def end(self, outcome: Outcome, text: str, now_s: float, code: IntentReason | Ending | None = None) -> IntentRecord:
        """Return the record with its outcome."""
        return replace(self, outcome=outcome, text=text, ended_s=now_s, code=code)
