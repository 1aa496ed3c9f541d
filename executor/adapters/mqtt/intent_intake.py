"""Parse MQTT messages: an operator's intent, or the reason for refusing it.

docs/mqtt.md describes the same. Any client with access to the topic can publish anything there: sizes are bounded
before parsing, unknown keys are refused, and outdated intents (retained by the broker, or written long ago) are not
executed. Nothing here needs aiomqtt.
"""

from __future__ import annotations

import hmac
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import AwareDatetime, Field, ValidationError, model_validator

from executor.adapters.intent_body import ID, IntentBody
from executor.core.forwarding import Bucket
from executor.core.interface.codes import ReasonCode
from executor.core.interface.commands import Level
from executor.core.interface.intents import FOR_ALL, FOR_BASE, Action, Intent
from missions import format_first_error
from missions.files import find_object


@dataclass(frozen=True, slots=True)
class IntakeRules:
    """The site's requirements for intents."""

    max_age_s: float
    token: str | None = field(default=None, repr=False)
    closed: str = ""
    """Reason why no intents are accepted; empty if they are."""


MOST_BYTES = 4096
MOST_A_SECOND = 5.0
"""Sustained rate of intents; each is written to the event log."""
BURST = 20
_ALLOWED = Bucket(MOST_A_SECOND, BURST)
MOST_REASON = 200
"""Most characters of a refusal."""
SOURCE = "mqtt"
NAME = r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"
TOLD_EVERY_S = 10.0
"""Real seconds between two lines for the operator about refused messages."""


class IntakeReason(ReasonCode):
    """Reason for refusing a message as an intent."""

    INVALID = "invalid", "It is too long, no JSON, or a key is missing, unknown or of the wrong kind."
    CLOSED = "closed", "This site takes no intents from its broker."
    UNAUTHORIZED = "unauthorized", "The token is not the site's."
    RETAINED = "retained", "The broker had kept it."
    TIMESTAMP = "timestamp", "It is too old, or from the future."
    TOO_MANY = "too_many", "Too many intents came at once."


class IntentMessage(IntentBody):
    """An operator's intent; acknowledged on `intent/ack` under its `id`."""

    headerId: Annotated[int, Field(ge=0, le=2**32 - 1)] | None = None  # noqa: N815 - VDA 5050's name
    """Sender's counter; ignored."""
    timestamp: AwareDatetime
    """Time of writing, ISO 8601 with UTC offset. Old intents are refused."""
    version: Annotated[str, Field(pattern=r"^1\.\d{1,4}\.\d{1,4}$")] = "1.5.0"
    """Version of these topics and payloads."""
    vehicle: Annotated[str, Field(pattern=NAME)] | None = None
    """Vehicle; omitted for `replan`, `prove`, `close`, `open`, `count`, `abort`, `prepare` and `take-off`."""
    token: Annotated[str, Field(max_length=256)] | None = None
    """Token; required if the site names one."""

    @model_validator(mode="after")
    def _check_addressee(self) -> IntentMessage:
        everybody = Action(self.action) in FOR_ALL | FOR_BASE
        if everybody and self.vehicle is not None:
            raise ValueError(f"vehicle: expected none, as {self.action} is for all of them")
        if bool(self.base) != (Action(self.action) in FOR_BASE):
            raise ValueError("base: expected a name for close, open and count, and none for anything else")
        if self.pack and self.action != "swap":
            raise ValueError(f"pack: expected none, as {self.action} changes none")
        if not everybody and self.vehicle is None:
            raise ValueError(f"vehicle: expected a name, as {self.action} is for one of them")
        return self


@dataclass(frozen=True, slots=True)
class RefusedMessage:
    """A message that is not executed."""

    id: str | None
    """Id of the intent, if readable."""
    reason: str
    code: IntakeReason


def read_intent(payload: bytes, rules: IntakeRules, now_unix_s: float, *, retained: bool) -> Intent | RefusedMessage:
    """Return a message's intent, or why it is refused; never raises.

    Args:
        payload: The message as received.
        rules: The site's requirements.
        now_unix_s: Unix time by this computer.
        retained: Whether the broker had retained it for later subscribers.
    """
    if len(payload) > MOST_BYTES:
        return RefusedMessage(None, f"expected at most {MOST_BYTES} bytes, got {len(payload)}", IntakeReason.INVALID)
    try:
        message = IntentMessage.model_validate_json(payload)
    except ValidationError as error:
        reason = format_first_error(error, page="docs/mqtt.md", shown=False)[:MOST_REASON]
        return RefusedMessage(_id_of(payload), reason, IntakeReason.INVALID)
    objection = _find_objection(message, rules, now_unix_s, retained=retained)
    if objection is not None:
        code, why = objection
        return RefusedMessage(message.id, why, code)
    return message.build_intent(SOURCE)


def _find_objection(
    message: IntentMessage, rules: IntakeRules, now_unix_s: float, *, retained: bool
) -> tuple[IntakeReason, str] | None:
    if rules.closed:
        return IntakeReason.CLOSED, rules.closed
    if rules.token is not None and not hmac.compare_digest((message.token or "").encode(), rules.token.encode()):
        return IntakeReason.UNAUTHORIZED, "token: expected the one that the site names, got another or none"
    if retained:
        return IntakeReason.RETAINED, "retained: expected a message for now, got one that the broker had kept"
    age_s = now_unix_s - message.timestamp.timestamp()
    if abs(age_s) > rules.max_age_s:
        when = f"{age_s:.0f} s old" if age_s > 0 else f"{-age_s:.0f} s ahead"
        text = f"timestamp: expected at most {rules.max_age_s:g} s from this computer's clock, got one {when}"
        return IntakeReason.TIMESTAMP, text
    return None


def _id_of(payload: bytes) -> str | None:
    """Return the id of a message that is otherwise invalid, so that its sender can identify it."""
    named = find_object(payload.decode(errors="replace")).get("id")
    return named if isinstance(named, str) and re.fullmatch(ID, named) else None


@dataclass(eq=False, repr=False)
class IntentIntake:
    """Accept messages, at a rate that an operator could mean."""

    _rules: IntakeRules
    """Rules of the site."""
    _clock: Callable[[], float]
    """Unix time."""
    _monotonic_s: Callable[[], float]
    """Monotonic real seconds."""
    _accept: Callable[[Intent], None]
    """Called with every intent."""
    _refuse: Callable[[RefusedMessage], None]
    """Called with refused messages, at a limited rate."""
    _say: Callable[[Level, str], None]
    """Called with lines for the operator."""
    _accepting: Bucket = _ALLOWED
    _refusing: Bucket = _ALLOWED
    _told_s: float = float("-inf")
    refused: int = 0
    """Number of refused messages."""

    def handle_message(self, payload: bytes, retained: bool) -> None:
        """Take one message; an empty one only clears a retained message."""
        if not payload:
            return
        found, now_s = read_intent(payload, self._rules, self._clock(), retained=retained), self._monotonic_s()
        if isinstance(found, Intent):
            if (accepting := self._accepting.take(1.0, now_s)) is not None:
                self._accepting = accepting
                self._accept(found)
                return
            too_many = f"expected at most {MOST_A_SECOND:g} intents a second"
            found = RefusedMessage(found.id, too_many, IntakeReason.TOO_MANY)
        self.refused += 1
        # Answering each would push other answers out of the queue.
        if (refusing := self._refusing.take(1.0, now_s)) is not None:
            self._refusing = refusing
            self._refuse(found)
        if now_s - self._told_s > TOLD_EVERY_S:
            self._told_s = now_s
            self._say(Level.WARNING, f"mqtt: an intent was refused, {self.refused} in all: {found.reason}")
