"""Define all events that the core can receive.

Each event is logged before it is applied; the same log through `fleet_step.step` gives the same commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from executor.core.interface.codes import Ending
from executor.core.interface.intents import Action, Intent
from executor.core.interface.messages import FlightMessage


@dataclass(frozen=True, slots=True)
class Heard:
    """A message of a vehicle arrived."""

    vehicle: str
    message: FlightMessage


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed; watchpoints are levels, evaluated on every tick."""

    late_s: float = 0.0
    """Part of it in which the ground station could not work, as its computer was too busy."""


@dataclass(frozen=True, slots=True)
class LaunchOrdered:
    """The operator confirmed the take-off; the first missions are on board."""


@dataclass(frozen=True, slots=True)
class UploadEnded:
    """The upload of a mission ended, read-back included."""

    vehicle: str
    revision: int
    accepted: bool
    mixed: bool
    """Whether part of the new mission may be on board (ArduPilot replaces items one by one)."""
    reason: str
    code: Ending | None = None
    """Why it was rejected; None if accepted, and in a log from before there were codes."""
    fenced: bool = False
    """Whether the wider fence it needs is on board, with or without the mission."""


@dataclass(frozen=True, slots=True)
class StartEnded:
    """The start procedure ended."""

    vehicle: str
    accepted: bool
    reason: str
    armed: bool = False
    """Whether the vehicle acknowledged arming."""
    code: Ending | None = None
    """Why it was rejected; None if accepted, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class ReturnEnded:
    """The RTL command was acknowledged, or not."""

    action: ClassVar[Action] = Action.RETURN
    vehicle: str
    accepted: bool
    reason: str
    lost: bool = False
    """Whether there was no answer: the command or its acknowledgement was lost."""
    refused: bool = False
    """Whether the vehicle refused."""
    code: Ending | None = None
    """Why it was rejected; None if accepted, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class NewRoute:
    """A survivor's visits after a re-plan."""

    vehicle: str
    visits: tuple[int, ...]
    """Visits of the network in order."""


@dataclass(frozen=True, slots=True)
class Gain:
    """The improvement of a re-plan over the missions on board, by the planning model."""

    segments: int
    """Additional segments covered; never negative."""
    length_m: float
    """Additional length covered; never negative."""
    left_over: int
    """Additional segments of those left over by the first plan."""
    longest_s: float
    """The longest route, each from where its vehicle becomes free."""
    carried_s: float
    """The longest of those on board."""
    short: tuple[str, ...]
    """Vehicles whose budgets do not cover the missions on board."""


@dataclass(frozen=True, slots=True)
class SolveEnded:
    """The solver ended."""

    revision: int
    routes: tuple[NewRoute, ...] | None
    """None if the solver failed or was cancelled."""
    uncovered: tuple[int, ...]
    """Open segments not covered; those left over by the first plan are not among them."""
    solve_s: float
    """Real seconds."""
    reason: str
    gain: Gain | None = None
    """None without routes, and in a log from before it was computed."""


@dataclass(frozen=True, slots=True)
class MissionsWanted:
    """There is time to build more of a re-plan's missions."""

    revision: int


@dataclass(frozen=True, slots=True)
class ReturnAllOrdered:
    """The operator aborts the flight."""


@dataclass(frozen=True, slots=True)
class Reopened:
    """The ground station resumes a flight that it left."""

    unix_s: float
    """Seconds since 1970 by the computer's clock, for people: the clock may have been set."""
    away_s: float
    """Absence by that clock, in the flight's time; 0 if the clock went back."""
    notes: tuple[str, ...]
    """Defects of the log, in words."""


@dataclass(frozen=True, slots=True)
class Match:
    """The agreement of the items on board with a revision's mission."""

    revision: int
    alike: int
    """Number of leading items that are equal."""
    whole: bool
    """Whether all are equal, and there are no others."""


@dataclass(frozen=True, slots=True)
class Found:
    """A vehicle's mission as found after an absence of the ground station."""

    vehicle: str
    heard: bool
    """Whether it was received since."""
    seq: int | None
    """The current item as reported by the vehicle; None if not reported."""
    items: int | None
    """Number of items on board; None if unreadable."""
    matches: tuple[Match, ...]
    """The agreement with each mission that may have been uploaded."""

    def match_of(self, revision: int) -> Match | None:
        """Return the agreement with a revision's mission; None if not compared, or unreadable."""
        return next((one for one in self.matches if one.revision == revision), None)


@dataclass(frozen=True, slots=True)
class MissionRead:
    """A vehicle's mission was read back in flight."""

    found: Found


@dataclass(frozen=True, slots=True)
class Resumed:
    """All vehicles that answer were read; supervision continues."""

    found: tuple[Found, ...]


@dataclass(frozen=True, slots=True)
class IntentReceived:
    """An intent of an operator arrived."""

    intent: Intent


@dataclass(frozen=True, slots=True)
class OrderEnded:
    """A command to hold, resume, land or disarm was carried out by the vehicle, or not."""

    vehicle: str
    action: Action
    accepted: bool
    reason: str
    lost: bool = False
    """Whether there was no answer: the command or its acknowledgement was lost."""
    refused: bool = False
    """Whether the vehicle refused."""
    code: Ending | None = None
    """Why it was rejected; None if accepted, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class Examined:
    """A vehicle at its base was checked before its next sortie."""

    vehicle: str
    ready: bool
    reason: str
    """Why it is not ready."""
    remaining_pct: float | None = None
    """As reported by the vehicle, after the pack change was confirmed."""
    voltage_v: float | None = None
    """Voltage of its pack at rest."""
    cells: int | None = None
    """Number of cells it reports."""
    parameters: tuple[tuple[str, float], ...] = ()
    """The parameters it reported, by name."""
    changed: tuple[str, ...] = ()
    """Parameters that differ from the flight's, in words."""
    sets: bool = False
    """Whether setting them again was attempted."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A question to the crew before the flight."""

    question: str
    """Name of the action that answers yes."""
    text: str
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LossJudged:
    """The effect of one vehicle's loss at present."""

    vehicle: str
    revision: int
    """The plan that was judged."""
    uncovered: tuple[int, ...]
    """Segments that the others could not take over; none inside the re-plan window."""


VehicleAnswer = Heard | UploadEnded | StartEnded | ReturnEnded | OrderEnded | MissionRead | Examined
"""Events from one vehicle: messages, and results of commands and requests."""
PlannerAnswer = SolveEnded | MissionsWanted | LossJudged
"""Events from the planner."""
CrewEvent = Asked | LaunchOrdered | IntentReceived | ReturnAllOrdered
"""Questions to the crew, and its intents."""
Event = Tick | VehicleAnswer | PlannerAnswer | CrewEvent | Reopened | Resumed
