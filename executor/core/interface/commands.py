"""All that can be decided."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from missions.fences import Fence
from missions.flight_model import AS_MODELLED, Pace
from missions.shortest_ways import Obstacle
from missions.waypoints import FlightPath


class Level(StrEnum):
    """How much a line matters."""

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
    """A line as it stands in `executor/core/lines`: its level, and its words with `{names}` for values."""

    level: Level
    words: str

    def with_level(self, level: Level) -> CrewLine:
        """Return this line at another level."""
        return CrewLine(level, self.words)

    def say(self, **values: object) -> Say:
        """Return the command that says it with these values; every name in its words needs one."""
        return Say(self.level, self.words.format(**values))


@dataclass(frozen=True, slots=True)
class Upload:
    """Put this path on board; `airborne` when the vehicle flies its mission meanwhile."""

    vehicle: str
    revision: int
    path: FlightPath
    airborne: bool
    fence: Fence | None = None
    """What goes on board before it, and covers what is there as well; None where that suffices."""


@dataclass(frozen=True)
class VehicleCommand:
    """What is decided of one vehicle, and says nothing more than whom it is for."""

    vehicle: str


class Start(VehicleCommand):
    """Arm and start the mission on board."""


class SendHome(VehicleCommand):
    """Order the vehicle to return by itself."""


class Hold(VehicleCommand):
    """Order the vehicle to stop where it is."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Order the vehicle to go on with its mission."""

    vehicle: str
    speed_m_s: float
    """Of the leg under way: both autopilots forget a mission's speed when the mode changes."""


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Tell the vehicle a speed over ground, in the mode that it is in; it is seen to follow, and not asked."""

    vehicle: str
    speed_m_s: float


class LandNow(VehicleCommand):
    """Order the vehicle to land where it is."""


@dataclass(frozen=True, slots=True)
class Disarm:
    """Order the motors to be stopped."""

    vehicle: str
    force: bool
    """Whether the autopilot is to do so even if it does not believe that it is on the ground."""


@dataclass(frozen=True, slots=True)
class Examine:
    """Look at a vehicle on its base whose pack was changed: whether it is ready, its battery, its parameters."""

    vehicle: str
    sets: bool = False
    """Whether what the flight had set, and it lost at a boot, is set again."""


@dataclass(frozen=True, slots=True)
class AskStreams:
    """Ask the vehicle to send again what it should send: some of it does not come, or not as often as it should."""

    vehicle: str
    messages: tuple[int, ...] = ()
    """Which alone; everything if none is named."""


class ReadMission(VehicleCommand):
    """Look up what the vehicle carries: it says that it was given a mission, and not from here."""


@dataclass(frozen=True, slots=True)
class AskPicture:
    """Ask a camera to say again that it took a picture: its word got lost on the way."""

    vehicle: str
    component: int
    sequence: int


class HandsOff(VehicleCommand):
    """Say nothing more to the vehicle: a person has it. What is half on board is still made whole."""


@dataclass(frozen=True, slots=True)
class Survivor:
    """One vehicle that can take over work."""

    vehicle: str
    start_m: tuple[float, float]
    """Local east and north where it becomes free."""
    budget_pct: float
    """What it may spend from there until it is home."""
    consumption: float
    """What it uses relative to the energy model."""
    airborne: bool
    tail: tuple[int, ...]
    """What it would do next by its present route: the warm start."""
    kept: int
    """How many waypoints of its present path stay as they are."""
    most_pct: float = 0.0
    """What its battery has until then without its reserve: as much of it as it carries already it may go on with, also
    beyond `budget_pct`."""
    start_up_m: float = 0.0
    """In the air: its height where it becomes free, as flights are priced."""
    pace: Pace = AS_MODELLED
    """What it has shown of its pace in this flight, beside the one of its model."""
    facing_m: tuple[float, float] = (0.0, 0.0)
    """East and north along the leg on which it comes there; of no length where nobody knows."""
    barred: tuple[int, ...] = ()
    """Segments that it cannot be given, for it has no camera that does what they ask for, or another may be there."""
    low: bool = False
    """Whether it is below its layer where it becomes free."""
    closed: tuple[Obstacle, ...] = ()
    """Others' parts of the line, which its ways lead around."""


@dataclass(frozen=True, slots=True)
class Solve:
    """Plan the open segments for the survivors."""

    revision: int
    open_segments: tuple[int, ...]
    survivors: tuple[Survivor, ...]
    trigger: str
    left_over: tuple[int, ...] = ()
    """What the first plan left for the next sortie: only for budgets to spare, after all of the open segments."""
    sortie: str = ""
    """The vehicle on its base whose next sortie it is; empty for a re-plan."""
    given: tuple[int, ...] = ()
    """The visits of a sortie that was planned before, or of who only comes down to more of the line: they are flown as
    they are, nothing is to be searched then."""


@dataclass(frozen=True, slots=True)
class Compose:
    """More of a re-plan's missions are to be made, by a `MissionsWanted`, as soon as others had their turn."""

    revision: int


@dataclass(frozen=True, slots=True)
class CancelSolve:
    """What the solver works on is of no use any more."""

    revision: int


@dataclass(frozen=True, slots=True)
class Finish:
    """Nothing is left to supervise."""

    reason: str


Order = Upload | Start | SendHome | Hold | Resume | ChangeSpeed | LandNow | Disarm | HandsOff
"""What one vehicle is told to do, or is left alone with."""
Inquiry = Examine | AskStreams | AskPicture | ReadMission
"""What one vehicle is asked for."""
Command = Say | Order | Inquiry | Solve | Compose | CancelSolve | Finish
