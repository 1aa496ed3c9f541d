"""All that can happen.

Each event is logged before it is applied; the log fed to `fleet_step.step` again gives the same commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from executor.core.interface.codes import Ending
from executor.core.interface.intents import Action, Intent
from executor.core.interface.messages import FlightMessage


@dataclass(frozen=True, slots=True)
class Heard:
    """A vehicle said something."""

    vehicle: str
    message: FlightMessage


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed; watchpoints are levels, looked at on every tick."""

    late_s: float = 0.0
    """How much of it the ground station could not do its work in, as its computer was too busy."""


@dataclass(frozen=True, slots=True)
class LaunchOrdered:
    """The operator has said yes; the first missions are on board."""


@dataclass(frozen=True, slots=True)
class UploadEnded:
    """The upload of a mission, with its read-back, has come to its one end."""

    vehicle: str
    revision: int
    accepted: bool
    mixed: bool
    """Whether a part of the new mission may be on board (ArduPilot replaces items one by one)."""
    reason: str
    code: Ending | None = None
    """Why it was not accepted; None where it was, and in a log from before there were codes."""
    fenced: bool = False
    """Whether the wider fence that it needs is on board, with the mission or without it."""


@dataclass(frozen=True, slots=True)
class StartEnded:
    """The start procedure has come to its end."""

    vehicle: str
    accepted: bool
    reason: str
    armed: bool = False
    """Whether the vehicle had acknowledged that it arms."""
    code: Ending | None = None
    """Why it was not accepted; None where it was, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class ReturnEnded:
    """The order to come home was acknowledged, or not."""

    action: ClassVar[Action] = Action.RETURN
    vehicle: str
    accepted: bool
    reason: str
    lost: bool = False
    """Whether nothing came back: the order, or its answer, got lost."""
    refused: bool = False
    """Whether the vehicle said no."""
    code: Ending | None = None
    """Why it was not accepted; None where it was, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class NewRoute:
    """One survivor's visits after a re-plan."""

    vehicle: str
    visits: tuple[int, ...]
    """Visits of the network in their order."""


@dataclass(frozen=True, slots=True)
class Gain:
    """What a re-plan is better in than what everybody carries, by the planning model."""

    segments: int
    """How many more are covered; never fewer."""
    length_m: float
    """How much longer they are together; never shorter."""
    left_over: int
    """How many more of those that the first plan left for the next sortie."""
    longest_s: float
    """The longest route, each from where its vehicle becomes free."""
    carried_s: float
    """The longest of what is carried."""
    short: tuple[str, ...]
    """Vehicles whose budgets do not last for all that they carry."""


@dataclass(frozen=True, slots=True)
class SolveEnded:
    """The solver has come to its end."""

    revision: int
    routes: tuple[NewRoute, ...] | None
    """None if the solver failed or was cancelled."""
    uncovered: tuple[int, ...]
    """Of the open segments; what the first plan left over is not one of them."""
    solve_s: float
    """Real seconds."""
    reason: str
    gain: Gain | None = None
    """None without routes, and in a log from before it was reckoned."""


@dataclass(frozen=True, slots=True)
class MissionsWanted:
    """There is time to make more of a re-plan's missions."""

    revision: int


@dataclass(frozen=True, slots=True)
class ReturnAllOrdered:
    """The operator aborts the flight."""


@dataclass(frozen=True, slots=True)
class Reopened:
    """The ground station runs again on a flight that it left in the midst."""

    unix_s: float
    """Seconds since 1970 by its clock, which is for people: that clock may have been set."""
    away_s: float
    """How long it was away by that clock, in the flight's time; 0 if the clock went back."""
    notes: tuple[str, ...]
    """What was wrong with the log, in words."""


@dataclass(frozen=True, slots=True)
class Match:
    """How much of a revision's mission was found on board."""

    revision: int
    alike: int
    """Items that are the same, from the first on."""
    whole: bool
    """Whether all are, and there are no others."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a vehicle was found to carry after the ground station was away."""

    vehicle: str
    heard: bool
    """Whether it was heard since."""
    seq: int | None
    """The item that it flies to, by its own report; None if it did not say."""
    items: int | None
    """How many are on board; None if they could not be read."""
    matches: tuple[Match, ...]
    """Against every mission that it may have been given."""

    def match_of(self, revision: int) -> Match | None:
        """Return how much of a revision's mission is on board; None if that was not looked at, or nothing was read."""
        return next((one for one in self.matches if one.revision == revision), None)


@dataclass(frozen=True, slots=True)
class MissionRead:
    """What a vehicle carries was looked up in flight."""

    found: Found


@dataclass(frozen=True, slots=True)
class Resumed:
    """All vehicles that answer were asked; supervision goes on."""

    found: tuple[Found, ...]


@dataclass(frozen=True, slots=True)
class IntentReceived:
    """An operator asks for something, from wherever."""

    intent: Intent


@dataclass(frozen=True, slots=True)
class OrderEnded:
    """An order to hold, to go on, to land or to stop the motors was carried out by the vehicle, or not."""

    vehicle: str
    action: Action
    accepted: bool
    reason: str
    lost: bool = False
    """Whether nothing came back: the order, or its answer, got lost."""
    refused: bool = False
    """Whether the vehicle said no."""
    code: Ending | None = None
    """Why it was not accepted; None where it was, and in a log from before there were codes."""


@dataclass(frozen=True, slots=True)
class Examined:
    """A vehicle on its base was looked at before its next sortie."""

    vehicle: str
    ready: bool
    reason: str
    """Why it is not."""
    remaining_pct: float | None = None
    """By its own report, after the change of its pack was confirmed."""
    voltage_v: float | None = None
    """Of its pack at rest."""
    cells: int | None = None
    """How many cells it tells apart."""
    parameters: tuple[tuple[str, float], ...] = ()
    """What it answered, by name."""
    changed: tuple[str, ...] = ()
    """What is not as the flight had set it, in words."""
    sets: bool = False
    """Whether that was tried to be set again."""


@dataclass(frozen=True, slots=True)
class Asked:
    """The crew is asked something before the flight."""

    question: str
    """The name of the action that answers it with yes."""
    text: str
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LossJudged:
    """What the loss of one vehicle would mean now."""

    vehicle: str
    revision: int
    """The plan that was judged."""
    uncovered: tuple[int, ...]
    """Segments that the others could not take over; none inside the re-plan window."""


VehicleAnswer = Heard | UploadEnded | StartEnded | ReturnEnded | OrderEnded | MissionRead | Examined
"""What comes of one vehicle, by itself or as it was told or asked."""
PlannerAnswer = SolveEnded | MissionsWanted | LossJudged
"""What comes of the planner."""
CrewEvent = Asked | LaunchOrdered | IntentReceived | ReturnAllOrdered
"""What the crew is asked, and what it asks for."""
Event = Tick | VehicleAnswer | PlannerAnswer | CrewEvent | Reopened | Resumed
