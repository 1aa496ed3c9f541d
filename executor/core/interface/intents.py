"""What an operator may ask for in flight, and what became of it.

An intent is taken once: the same id again is answered with what became of it the first time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

from executor.core.interface.codes import Ending, ReasonCode


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
    """Treat it as lost, on the operator's intent."""
    INCLUDE = "include"
    """Take a vehicle back into the plan: one on the ground takes off from its pad for that, one that its pilot has
    returned to its mission goes on."""
    SWAP = "swap"
    """Its pack is changed: look at it, and send it out on its next sortie when its checks pass."""
    DISARM = "disarm"
    """Stop the motors of a vehicle that is down."""
    PREPARE = "prepare"
    """Change the parameters that were told and put the missions on board: the answer to the first question."""
    TAKE_OFF = "take-off"
    """Begin the flight: the answer to the question before the take-off."""
    REPLAN = "replan"
    """Plan everything anew that is still to be flown."""
    PROVE = "prove"
    """Fly again, for proof, what counts as inspected by evidence alone, and look again at what was flown but not
    seen; or look again at the assets that are named, seen or not."""
    CLOSE = "close"
    """Nobody takes off from a base of the day any more; who is in the air lands there."""
    OPEN = "open"
    """Vehicles may be sent out from a base again."""
    COUNT = "count"
    """Set the number of charged packs at a base of the day; it replaces the plan's count."""
    ABORT = "abort"
    """Everybody returns."""


ActionName = Literal[
    "hold", "resume", "return", "land", "exclude", "include", "swap", "disarm", "replan", "prove", "close", "open",
    "count", "abort", "prepare", "take-off",
]  # fmt: skip
"""What a client writes for an action: the value of each, as a type."""
PACK = r"^[A-Za-z0-9._:#/-]{0,32}$"
"""What the id of a pack is made of."""
MOST_PACKS = 1000
"""At a base."""
MOST_ASSETS = 100
"""In one intent."""
LONGEST_NAME = 128
"""Letters of an asset's name in an intent."""
FOR_ALL = frozenset({Action.REPLAN, Action.PROVE, Action.ABORT, Action.PREPARE, Action.TAKE_OFF})
"""Actions that name no vehicle."""
FOR_BASE = frozenset({Action.CLOSE, Action.OPEN, Action.COUNT})
"""Actions that name a base, and no vehicle."""
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


class IntentReason(ReasonCode):
    """Why an intent was refused, or failed without a vehicle's answer."""

    NOT_BEGUN = "not_begun", "The flight has not begun."
    BEGUN = "begun", "The flight has begun, and what was asked before is answered."
    OVER = "over", "The flight is over."
    NOT_ASKED = "not_asked", "The question that it answers is not open."
    VEHICLE_UNEXPECTED = "vehicle_unexpected", "It is for the whole fleet and names a vehicle."
    VEHICLE_MISSING = "vehicle_missing", "It names no vehicle."
    VEHICLE_UNKNOWN = "vehicle_unknown", "It names a vehicle that does not exist."
    UNCONFIRMED = "unconfirmed", "It has to be confirmed: the same again with `confirmed`."
    ABORTED = "aborted", "The flight was aborted."
    NEVER_HEARD = "never_heard", "Nothing was ever received from the vehicle."
    LINK_STALE = "link_stale", "Nothing was received from the vehicle for a while."
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
    SWAPPING = "swapping", "It is looked at before its next sortie already."
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
        "asset_never_flown", "It names an asset that nobody flies: no part of the flight, or no vehicle has its camera."
    )  # fmt: skip
    ASSET_OPEN = "asset_open", "It names an asset that is still to be flown."
    OVERTAKEN = "overtaken", "The vehicle did something else before it answered."
    UNANSWERED = "unanswered", "The vehicle did not answer in time."


Reason = tuple[IntentReason, str]
"""Why an intent is refused or fails: the code, and the words for people."""


def fill_in(reason: Reason, **values: object) -> Reason:
    """Return a reason with values in the place of the `{names}` of its words."""
    return reason[0], reason[1].format(**values)


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
    pack: str = ""
    """The id of the pack that is put in, for a swap; empty if nobody says."""
    base: str = ""
    """Which base is closed or opened, or has its packs counted."""
    assets: tuple[int | str, ...] = ()
    """Which are looked at again, for proof: a text is an asset's name, a number its segment; none for all that is
    inferred or missed."""
    charged: int | None = None
    """How many charged packs are at the base."""


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
    code: IntentReason | Ending | None = None
    """Why it was refused or failed; None where it was not."""
    question: str = ""
    """What has to be confirmed first, where that is why it is refused: asked again with `confirmed` it is done."""

    def end(self, outcome: Outcome, text: str, now_s: float, code: IntentReason | Ending | None = None) -> IntentRecord:
        """Return it at its end."""
        return replace(self, outcome=outcome, text=text, ended_s=now_s, code=code)
