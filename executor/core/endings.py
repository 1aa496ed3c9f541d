"""How a dialogue with a vehicle ends that does not end well: reasons that a program can branch on, beside the words."""

from __future__ import annotations

from enum import StrEnum


class Ending(StrEnum):
    """Why an upload, a command or a parameter was not taken by a vehicle."""

    NO_ANSWER = "no_answer"
    """Nothing came back, however often it was asked."""
    NOT_CONFIRMED = "not_confirmed"
    """It acknowledged, and its HEARTBEAT does not show it."""
    VALUE_STAYS = "value_stays"
    """A parameter keeps its value."""
    READ_BACK_DIFFERS = "read_back_differs"
    """The mission on board is not the one that was sent."""
    LEFT_MISSION = "left_mission"
    """The vehicle left its mission, so that nothing is uploaded any more."""
    BROKEN_OFF = "broken_off"
    """Given up from here: something more important was to be said."""
    TEMPORARILY_REJECTED = "temporarily_rejected"
    """MAV_RESULT 1."""
    DENIED = "denied"
    """MAV_RESULT 2."""
    UNSUPPORTED = "unsupported"
    """MAV_RESULT 3; MAV_MISSION_RESULT 2 or 3, of a frame or a command."""
    FAILED = "failed"
    """MAV_RESULT 4."""
    CANCELLED = "cancelled"
    """MAV_RESULT 6, MAV_MISSION_RESULT 15: by the vehicle."""
    ERROR = "error"
    """MAV_MISSION_RESULT 1: an error, or busy with another transfer."""
    NO_SPACE = "no_space"
    """MAV_MISSION_RESULT 4."""
    INVALID_ITEM = "invalid_item"
    """MAV_MISSION_RESULT 5 to 12: an item, a parameter of it or its place."""
    INVALID_SEQUENCE = "invalid_sequence"
    """MAV_MISSION_RESULT 13."""
    OTHER_STATION = "other_station"
    """MAV_MISSION_RESULT 14: another ground station is uploading."""
    UNKNOWN_RESULT = "unknown_result"
    """A result that this program does not know."""
