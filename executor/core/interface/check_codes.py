"""What each line of the checklist is about: a code that a program can branch on, beside the words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, StrEnum


class CheckCode(StrEnum):
    """The subject of a check; its severity says how it went."""

    NOT_READY = "not_ready"
    """The vehicle does not answer, or is not ready."""
    FIRMWARE = "firmware"
    """Type, autopilot and version, and whether they were tested."""
    VEHICLE_TYPE = "vehicle_type"
    """It is no multicopter."""
    AUTOPILOT = "autopilot"
    """It is another autopilot than the site file says."""
    DOUBLE_SYSID = "double_sysid"
    """Two vehicles have the same sysid."""
    ARMED = "armed"
    """It is armed already."""
    FAR_FROM_DEPOT = "far_from_depot"
    """It stands too far from the depot."""
    PAD_HEIGHT = "pad_height"
    """Its GPS and depot.alt_m differ."""
    LINK_FAILSAFE = "link_failsafe"
    """The GCS failsafe, and after how long the vehicle is declared lost."""
    WATCHED_STATION = "watched_station"
    """Its GCS failsafe watches another station."""
    OTHER_STATION = "other_station"
    """Another ground station is on its link."""
    BATTERY_FAILSAFE = "battery_failsafe"
    """What it does on a low battery, and whether that would act in the flight."""
    GEOFENCE = "geofence"
    """Whether the flight fits into its geofence."""
    ENERGY = "energy"
    """Whether the battery suffices for the flight."""
    PACK = "pack"
    """Whether its pack is the planned one, and holds what it reports, by its voltage at rest."""
    RTL_ALTITUDE = "rtl_altitude"
    """The RTL altitude after the parameters are set."""
    PARAMETER_CHANGE = "parameter_change"
    """A parameter that is to be set for the flight."""
    SIGNING = "signing"
    """Who could command the vehicles."""
    DISK = "disk"
    """Whether the record of the flight fits on the disk."""
    SEPARATION = "separation"
    """Whether heights and layers keep vehicles apart."""
    HEIGHTS = "heights"
    """By which heights is flown, and what looks wrong about them."""
    CLEARANCE = "clearance"
    """A mission, or one of a later plan, comes too near to the ground or a line."""
    CAMERA = "camera"
    """Whether its autopilot takes the pictures that its mission asks for."""
    TERRAIN = "terrain"
    """What an autopilot follows of the ground by itself."""
    CEILING = "ceiling"
    """A mission or an RTL goes above the ceiling."""
    AREAS = "areas"
    """Whether missions keep out of areas, and where a vehicle's own return leads through one."""
    PLAN = "plan"
    """What each vehicle flies."""
    LEFT_OVER = "left_over"
    """What the plan leaves over, or is not about."""


class Severity(Enum):
    """What a finding means for the flight."""

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
    """A line as it stands in `executor/core/lines`: its severity, subject, and words with `{names}` for values."""

    severity: Severity
    code: CheckCode
    words: str

    def say(self, subject: str, severity: Severity | None = None, **values: object) -> Check:
        """Return the check that says it of a subject with these values, at its own severity or at another."""
        return Check(severity or self.severity, subject, self.words.format(**values), self.code)
