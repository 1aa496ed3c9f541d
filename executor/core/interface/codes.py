"""Define reason codes beside the texts, for programs: how a dialogue failed, and the subject of a checklist line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Self


class ReasonCode(StrEnum):
    """A code with its meaning, both listed in the reference."""

    meaning: str

    def __new__(cls, value: str, meaning: str) -> Self:
        """Take the value and its meaning."""
        code = str.__new__(cls, value)
        code._value_, code.meaning = value, meaning
        return code


class Ending(ReasonCode):
    """Why a vehicle did not take an upload, a command or a parameter."""

    NO_ANSWER = "no_answer", "No answer, after all retries."
    NOT_CONFIRMED = "not_confirmed", "It acknowledged, but its HEARTBEAT does not show the change."
    VALUE_STAYS = "value_stays", "A parameter keeps its value."
    READ_BACK_DIFFERS = "read_back_differs", "The mission on board is not the one that was sent."
    MODE_CHANGED = "mode_changed", "Another party changed its mode in the meantime."
    LEFT_MISSION = "left_mission", "The vehicle left its mission, so no upload follows."
    STOOD_STILL = "stood_still", "This computer stalled during a start: the crew's confirmation is too old."
    BROKEN_OFF = "broken_off", "Cancelled by faultline for a more important message."
    TEMPORARILY_REJECTED = "temporarily_rejected", "MAV_RESULT 1."
    DENIED = "denied", "MAV_RESULT 2."
    UNSUPPORTED = "unsupported", "MAV_RESULT 3; MAV_MISSION_RESULT 2 or 3, of a frame or a command."
    FAILED = "failed", "MAV_RESULT 4."
    CANCELLED = "cancelled", "MAV_RESULT 6, MAV_MISSION_RESULT 15: by the vehicle."
    ERROR = "error", "MAV_MISSION_RESULT 1: an error, or busy with another transfer."
    FENCE_DROPPED = (
        "fence_dropped",
        "It accepted a fence and dropped it again: its home, or the vehicle, is not inside.",
    )
    ABOVE_FENCE = "above_fence", "The mission leads above the fence, whose height is a parameter and stays in flight."
    NO_SPACE = "no_space", "MAV_MISSION_RESULT 4."
    INVALID_ITEM = "invalid_item", "MAV_MISSION_RESULT 5 to 12: an item, a parameter of it or its place."
    INVALID_SEQUENCE = "invalid_sequence", "MAV_MISSION_RESULT 13."
    OTHER_STATION = "other_station", "MAV_MISSION_RESULT 14: another ground station is uploading."
    UNKNOWN_RESULT = "unknown_result", "A result that this program does not know."


class CheckCode(ReasonCode):
    """The subject of a check; its severity is the result."""

    NOT_READY = "not_ready", "The vehicle does not answer, or is not ready."
    FIRMWARE = "firmware", "Type, autopilot and version, and whether they were tested."
    VEHICLE_TYPE = "vehicle_type", "It is no multicopter."
    AUTOPILOT = "autopilot", "It is a different autopilot from the one in the site file."
    DOUBLE_SYSID = "double_sysid", "Two vehicles have the same sysid."
    ARMED = "armed", "It is armed already."
    FAR_FROM_DEPOT = "far_from_depot", "It stands too far from the depot."
    PAD_HEIGHT = "pad_height", "Its GPS and depot.alt_m differ."
    LINK_FAILSAFE = "link_failsafe", "The GCS failsafe, and the time until the vehicle is declared lost."
    WATCHED_STATION = "watched_station", "Its GCS failsafe watches another station."
    OTHER_STATION = "other_station", "Another ground station is on its link."
    BATTERY_FAILSAFE = "battery_failsafe", "Its battery failsafe, and whether that would act in the flight."
    GEOFENCE = "geofence", "Whether the flight fits into its geofence."
    ENERGY = "energy", "Whether the battery suffices for the flight."
    PACK = "pack", "Whether its pack is the planned one, and holds what it reports, by its voltage at rest."
    RTL_ALTITUDE = "rtl_altitude", "The RTL altitude after the parameters are set."
    PARAMETER_CHANGE = "parameter_change", "A parameter that is to be set for the flight."
    SIGNING = "signing", "Whether other senders could command the vehicles."
    RADIO = "radio", "The load of a telemetry radio, and its capacity."
    DISK = "disk", "Whether the record of the flight fits on the disk."
    SEPARATION = "separation", "Whether heights and layers keep vehicles apart."
    HEIGHTS = "heights", "The heights of the flight, and doubts about them."
    CLEARANCE = "clearance", "A mission, or one of a later plan, comes too close to the ground or a line."
    CAMERA = "camera", "Whether its autopilot takes the pictures that its mission requires."
    TERRAIN = "terrain", "Terrain following by the autopilot."
    CEILING = "ceiling", "A mission or an RTL goes above the ceiling."
    AREAS = "areas", "Whether missions avoid areas, and where a vehicle's own RTL crosses one."
    PLAN = "plan", "The route of each vehicle."
    LEFT_OVER = "left_over", "Segments that the plan leaves over, or that are left out."


class ChannelCode(ReasonCode):
    """The problem of a telemetry radio in flight: congested, or weak."""

    BUFFER_FULL = "buffer_full", "Congested: its transmit buffer is full."
    AT_CAPACITY = "at_capacity", "Congested: it is at capacity."
    ROUND_TRIP_GROWN = "round_trip_grown", "Congested: answers take several times as long as they did."
    SIGNAL_LOW = "signal_low", "Weak: the signal is less than 10 dB over the noise, here or at a vehicle."
    FRAMES_LOST = "frames_lost", "Weak: a tenth of the frames is lost, and the radio has room."

    @property
    def is_congestion(self) -> bool:
        """Whether it is congestion; otherwise the signal is weak."""
        return self not in {ChannelCode.SIGNAL_LOW, ChannelCode.FRAMES_LOST}


class Severity(StrEnum):
    """The consequence of a finding for the flight."""

    OK = "ok"
    WARNING = "warning"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the checklist."""

    severity: Severity
    subject: str
    text: str
    code: CheckCode


@dataclass(frozen=True, slots=True)
class ChecklistLine:
    """A line from `executor/core/lines`: its severity, subject, and text with `{names}` for values."""

    severity: Severity
    code: CheckCode
    words: str

    def say(self, subject: str, severity: Severity | None = None, **values: object) -> Check:
        """Return the check of a subject with these values, at its own severity or at another."""
        return Check(severity or self.severity, subject, self.words.format(**values), self.code)
