"""Define all commands that the core can issue."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from missions.fences import Fence
from missions.flight_model import AS_MODELLED, Pace
from missions.shortest_ways import Obstacle
from missions.waypoints import FlightPath


class Level(StrEnum):
    """The importance of a line."""

    INFO = "info"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True, slots=True)
class Say:
    """One line for the operator and the log: a decision with its reason."""

    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class CrewLine:
    """A line from `executor/core/lines`: its level, and its text with `{names}` for values."""

    level: Level
    words: str

    def with_level(self, level: Level) -> CrewLine:
        """Return this line at another level."""
        return CrewLine(level, self.words)

    def say(self, **values: object) -> Say:
        """Return the line as a command with these values; every name in its text needs one."""
        return Say(self.level, self.words.format(**values))


@dataclass(frozen=True, slots=True)
class Upload:
    """Upload this path; `airborne` if the vehicle flies its mission meanwhile."""

    vehicle: str
    revision: int
    path: FlightPath
    airborne: bool
    fence: Fence | None = None
    """Fence to upload first, which covers the present one as well; None if that suffices."""


@dataclass(frozen=True)
class VehicleCommand:
    """A command to one vehicle without further parameters."""

    vehicle: str


class Start(VehicleCommand):
    """Arm and start the mission on board."""


class SendHome(VehicleCommand):
    """Command RTL."""


class Hold(VehicleCommand):
    """Command the vehicle to stop and hold."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Command the vehicle to continue its mission."""

    vehicle: str
    speed_m_s: float
    """Speed of the present leg; both autopilots drop a mission's speed when the mode changes."""


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Command a ground speed in the present mode; the effect is observed, not acknowledged."""

    vehicle: str
    speed_m_s: float


class LandNow(VehicleCommand):
    """Command the vehicle to land in place."""


@dataclass(frozen=True, slots=True)
class Disarm:
    """Command the motors to stop."""

    vehicle: str
    force: bool
    """Whether the autopilot must comply even if it does not detect the ground."""


@dataclass(frozen=True, slots=True)
class Examine:
    """Check a vehicle after its pack change at its base: readiness, battery, parameters."""

    vehicle: str
    sets: bool = False
    """Whether to set the flight's parameters again that a reboot has reset."""


@dataclass(frozen=True, slots=True)
class AskStreams:
    """Request the vehicle's streams again: some are missing, or slower than they should be."""

    vehicle: str
    messages: tuple[int, ...] = ()
    """The messages to request; empty for all."""


class ReadMission(VehicleCommand):
    """Read back the mission on board: the vehicle reports an upload that was not ours."""


@dataclass(frozen=True, slots=True)
class AskPicture:
    """Request a camera's report of a picture again; it was lost."""

    vehicle: str
    component: int
    sequence: int


class HandsOff(VehicleCommand):
    """Send no more commands to the vehicle: a person has it. An upload under way is still completed."""


@dataclass(frozen=True, slots=True)
class Survivor:
    """A vehicle that can take over segments."""

    vehicle: str
    start_m: tuple[float, float]
    """Local east and north where it becomes free."""
    budget_pct: float
    """Battery it may use from there until it has landed."""
    consumption: float
    """Consumption relative to the energy model."""
    airborne: bool
    tail: tuple[int, ...]
    """The rest of its present route: the warm start."""
    kept: int
    """Waypoints of its present path that stay unchanged."""
    most_pct: float = 0.0
    """Charge there above its reserve: up to this it may keep visits it already carries, even beyond `budget_pct`."""
    start_up_m: float = 0.0
    """In the air: its height where it becomes free, as pricing counts it."""
    pace: Pace = AS_MODELLED
    """Its pace observed in this flight, relative to its model."""
    facing_m: tuple[float, float] = (0.0, 0.0)
    """East and north along the leg on which it arrives there; of zero length if unknown."""
    barred: tuple[int, ...] = ()
    """Segments it cannot get: no camera of it fits them, or another vehicle may be there."""
    low: bool = False
    """Whether it is below its layer where it becomes free."""
    closed: tuple[Obstacle, ...] = ()
    """Others' parts of the line, which its paths avoid."""


@dataclass(frozen=True, slots=True)
class Solve:
    """Plan the open segments for the survivors."""

    revision: int
    open_segments: tuple[int, ...]
    survivors: tuple[Survivor, ...]
    trigger: str
    left_over: tuple[int, ...] = ()
    """Segments left over by the first plan: only for spare budgets, after all open segments."""
    sortie: str = ""
    """The vehicle at its base whose next sortie it is; empty for a re-plan."""
    given: tuple[int, ...] = ()
    """The visits of a sortie planned earlier, or of a vehicle that only descends for more of the line: they are flown
    as given, without a search."""


@dataclass(frozen=True, slots=True)
class Compose:
    """Build more of a re-plan's missions, by a `MissionsWanted`, after other work had its turn."""

    revision: int


@dataclass(frozen=True, slots=True)
class CancelSolve:
    """Cancel the solver's present problem."""

    revision: int


@dataclass(frozen=True, slots=True)
class Finish:
    """End the flight: nothing is left to supervise."""

    reason: str


Order = Upload | Start | SendHome | Hold | Resume | ChangeSpeed | LandNow | Disarm | HandsOff
"""Commands to one vehicle, and leaving it alone."""
Inquiry = Examine | AskStreams | AskPicture | ReadMission
"""Requests to one vehicle."""
Command = Say | Order | Inquiry | Solve | Compose | CancelSolve | Finish
