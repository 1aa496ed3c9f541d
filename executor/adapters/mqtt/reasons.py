"""Why a message from the broker is not taken as an intent: a code that a program can branch on, beside the words."""

from __future__ import annotations

from executor.core.interface.codes import ReasonCode


class IntakeReason(ReasonCode):
    """Why a message is not taken for an intent."""

    INVALID = "invalid", "It is too long, no JSON, or a key is missing, unknown or of the wrong kind."
    CLOSED = "closed", "This site takes no intents from its broker."
    UNAUTHORIZED = "unauthorized", "The token is not the site's."
    RETAINED = "retained", "The broker had kept it."
    TIMESTAMP = "timestamp", "It is too old, or from the future."
    TOO_MANY = "too_many", "Too many intents came at once."
