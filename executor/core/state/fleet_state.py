"""The state of the whole flight."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar

from executor.core.interface.codes import Check
from executor.core.interface.commands import Command, Level, Solve
from executor.core.interface.events import Gain, NewRoute
from executor.core.interface.intents import IntentRecord
from executor.core.payload.camera_state import AwaitedPictures
from executor.core.state.inspection_proof import SegmentPass
from executor.core.state.radio_channel import ChannelState
from executor.core.state.vehicle_state import Fault, PartUpdate, Stage, VehicleState
from missions import FlightPath
from missions.fences import Fence
from planner import segment_of

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class NewMission:
    """What a re-plan puts on board one vehicle."""

    path: FlightPath
    visits: tuple[int, ...]
    """All visits of the path: those that stay, then the new ones."""
    fresh: bool
    """Whether it begins on the ground, with a take-off."""
    fence: Fence | None = None
    """The fence that has to be on board before it; None where the one on board covers it."""


@dataclass(frozen=True, slots=True)
class Replan:
    """A re-plan under way: first it is solved, then it is put on board vehicle by vehicle."""

    solve: Solve
    begun_s: float
    """When the need for it was declared."""
    solve_s: float | None = None
    """Real seconds that the solver took; None while it works."""
    solved_s: float = 0.0
    uncovered: tuple[int, ...] = ()
    gain: Gain | None = None
    low: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Segments that vehicles inspect below their layers by their new missions, by name."""
    unmade: tuple[NewRoute, ...] = ()
    """Routes whose missions are still to be made: of a large fleet that takes longer than anybody should wait."""
    missions: Mapping[str, NewMission] = field(default_factory=lambda: MappingProxyType({}))
    """What goes on board whom, as far as it is made."""
    pending: frozenset[str] = frozenset()
    """Vehicles whose new mission is not on board yet."""
    failed: tuple[str, ...] = ()
    """Vehicles that could not be given theirs."""
    let_go: tuple[str, ...] = ()
    """Vehicles for which it came too late."""
    ordered: bool = False
    """Whether an operator asked for it."""
    closer: bool = False
    """Whether nobody's work changes: one vehicle comes down to more of the line, or flies there once more."""


@dataclass(frozen=True, slots=True)
class LossOutlook:
    """What the loss of a vehicle would mean."""

    at_s: float
    """For a loss at this time."""
    uncovered: tuple[int, ...]
    """Segments that the others could not take over; none inside the re-plan window."""


@dataclass(frozen=True, slots=True)
class ReplanRecord:
    """A re-plan that has ended."""

    revision: int
    trigger: str
    feasible: bool
    uncovered: tuple[int, ...]
    solve_s: float
    begun_s: float
    ended_s: float
    upload_s: float
    gain: Gain | None = None
    """Against what everybody carried; None where the solver did not say."""
    sortie: str = ""
    """The vehicle whose next sortie it was; empty for a re-plan."""


@dataclass(frozen=True, slots=True)
class GroundStationAbsence:
    """A time in which the ground station was not there: stopped, or restarted."""

    until_s: float
    pause_s: float
    """By its own clock, or by those of the vehicles where they say more."""
    restarted: bool
    deaf: bool = False
    """Whether it was there and heard nobody, as if its radio were gone."""


@dataclass(frozen=True, slots=True)
class OperatorLine:
    """A line for the operator, kept for who looks later: a decision with its reason."""

    at_s: float
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Question:
    """What the crew is asked before anything goes on."""

    id: str
    """prepare or take-off: the action that answers it with yes."""
    text: str
    lines: tuple[str, ...]
    """What it is about, line by line."""


@dataclass(frozen=True, slots=True)
class TakeoffOffer:
    """Vehicles on the ground that could take over work, if the crew says so."""

    vehicles: tuple[str, ...]
    segments: tuple[int, ...]
    """What nobody flies and they could."""
    since_s: float
    again: bool = False
    """Whether all of it counts, from farther away than asked."""
    alone_since_s: float | None = None
    """Since when nothing else is waited for."""


@dataclass(frozen=True, slots=True)
class Briefing:
    """What a crew reads before the flight."""

    checks: tuple[Check, ...] = ()
    """The checklist, in the order in which a crew reads it."""
    question: Question | None = None
    """What it is asked now."""
    answered: str = ""
    """The id of the question that was answered with yes, from the page or over MQTT."""


KEPT_LINES = 200


ReportedWarnings = tuple[tuple[str, float], ...]
"""What an operator was told of a vehicle: each warning by its name, and when it held last."""


@dataclass(frozen=True, slots=True)
class FlightProgress:
    """How far the flight is from its launch to its end."""

    launched_s: float | None = None
    recalled: bool = False
    """The flight was aborted."""
    finished: bool = False
    separation_m: float | None = None
    """The nearest that two flying vehicles came to each other."""

    @property
    def is_under_way(self) -> bool:
        """Whether the flight has begun, and was not aborted."""
        return self.launched_s is not None and not self.recalled


SAME_M = 0.5
"""Distances to the line that differ by less are one."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """What became of each segment."""

    inspected: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the vehicle that inspected it."""
    flown: Mapping[int, SegmentPass] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to how it was flown then."""
    inspected_at_m: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the distance at which its mission did so, where vehicles leave their layers for it."""
    given_up: frozenset[int] = frozenset()
    """Segments that no survivor can inspect."""
    left_over: frozenset[int] = frozenset()
    """Segments that the first plan left for the next sortie: no reason for a re-plan, taken up where one has budget to
    spare."""
    attempts: Mapping[int, int] = field(default_factory=lambda: MappingProxyType({}))
    """How often a segment was flown without proof."""
    inferred: frozenset[int] = frozenset()
    """Segments of which the whole or a part was flown in a silence: nobody saw it, everything fits."""
    caught: Mapping[int, tuple[tuple[str, float], ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Of segments that ask for pictures: the camera, and metres along the flight track from a, of each that counts."""
    caught_nearer: Mapping[int, tuple[tuple[str, float], ...]] = field(default_factory=lambda: MappingProxyType({}))
    """The same of segments that count, taken from nearer: they take the others' place once they show all of it."""
    unseen: Mapping[int, AwaitedPictures] = field(default_factory=lambda: MappingProxyType({}))
    """Segments that were flown, and whose pictures are waited for."""
    not_seen: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the vehicle that flew it last without seeing it; some were seen later."""

    def is_nearer_than_counted(self, segment: int, at_m: float | None) -> bool:
        """Return whether a segment that counts was inspected from farther away than this."""
        counted_m = self.inspected_at_m.get(segment) if segment in self.inspected else None
        return counted_m is not None and at_m is not None and at_m < counted_m - SAME_M

    def list_inferred_segments(self) -> frozenset[int]:
        """Return the segments that count as inspected by evidence alone."""
        return self.inferred & set(self.inspected)


@dataclass(frozen=True, slots=True)
class ReplanningState:
    """Whether a re-plan is needed or under way, and those that have ended."""

    revision: int = 0
    replan: Replan | None = None
    orphans_since_s: float | None = None
    urgent: bool = False
    """A fault was declared since the last re-plan began."""
    trigger: str = ""
    trigger_s: float = 0.0
    """When the last fault was declared."""
    wait_until_s: float = float("-inf")
    """No re-plan begins before this: the last solve failed."""
    closer_s: float = float("-inf")
    """When it was looked at last who may come down to more of the line, or fly there once more."""
    ordered: bool = False
    """An operator asked for a re-plan, which begins without need."""
    considered: frozenset[str] = frozenset()
    """The survivors of the last re-plan."""
    mended: tuple[tuple[str, Fault], ...] = ()
    """(vehicle, fault) of vehicles that were taken back into the plan."""
    records: tuple[ReplanRecord, ...] = ()
    outlook: Mapping[str, LossOutlook] = field(default_factory=lambda: MappingProxyType({}))
    """Of each vehicle that flies its mission: what its loss would mean; computed seldom."""

    @property
    def is_changing(self) -> bool:
        """Whether a re-plan is under way, or about to begin."""
        return self.replan is not None or self.urgent or self.ordered


@dataclass(frozen=True, slots=True)
class ContactState:
    """Whether the ground station was there, and heard anybody."""

    tick_s: float | None = None
    late_s: float = 0.0
    """How much of the time before the last tick its computer kept it from its work."""
    silent_since_s: float | None = None
    """Since when nobody at all is heard."""
    silence_told_s: float | None = None
    """When that was said last."""
    absences: tuple[GroundStationAbsence, ...] = ()
    """When the ground station was not there for long enough to be worth a word, the last one last."""


@dataclass(frozen=True, slots=True)
class CountedPacks:
    """The charged packs at a base, by the crew's count."""

    charged: int
    at_s: float
    in_vehicles: frozenset[str] = frozenset()
    """Vehicles that were being turned around: their packs were taken before, and fly later."""


@dataclass(frozen=True, slots=True)
class CrewDialogue:
    """What the crew was told, what it asked for, and what it is asked."""

    said: tuple[OperatorLine, ...] = ()
    """The last lines for the operator, the oldest first."""
    told: Mapping[str, ReportedWarnings] = field(default_factory=lambda: MappingProxyType({}))
    """Of each vehicle that was not well: what the operator was told."""
    intents: Mapping[str, IntentRecord] = field(default_factory=lambda: MappingProxyType({}))
    """What an operator asked for in flight, by its id, the oldest first."""
    briefing: Briefing = field(default_factory=Briefing)
    offer: TakeoffOffer | None = None
    offer_wanted_s: float | None = None
    """Since when there is something to offer."""
    offers_over: bool = False
    """Whether an offer was not answered in its time: nobody takes off again."""
    closed_bases: frozenset[str] = frozenset()
    """Bases of the day that the crew has closed."""
    counted_packs: Mapping[str, CountedPacks] = field(default_factory=lambda: MappingProxyType({}))
    """How many charged packs the crew counted last, by the base."""


@dataclass(frozen=True, slots=True)
class FleetState:
    """The flight as it is known at one moment."""

    vehicles: Mapping[str, VehicleState]
    progress: FlightProgress = field(default_factory=FlightProgress)
    coverage: Coverage = field(default_factory=Coverage)
    replanning: ReplanningState = field(default_factory=ReplanningState)
    listening: ContactState = field(default_factory=ContactState)
    crew: CrewDialogue = field(default_factory=CrewDialogue)
    channels: Mapping[str, ChannelState] = field(default_factory=lambda: MappingProxyType({}))
    """What is known of each telemetry radio, by the first of the vehicles behind it."""

    with_progress = PartUpdate(FlightProgress)
    with_coverage = PartUpdate(Coverage)
    with_replanning = PartUpdate(ReplanningState)
    with_listening = PartUpdate(ContactState)
    with_crew = PartUpdate(CrewDialogue)

    def put(self, vehicle: VehicleState) -> FleetState:
        """Return the state with one vehicle replaced."""
        if self.vehicles.get(vehicle.name) is vehicle:
            return self
        # Every message comes here: made at once, it takes a third of what `replace` takes.
        vehicles = MappingProxyType({**self.vehicles, vehicle.name: vehicle})
        return FleetState(
            vehicles, self.progress, self.coverage, self.replanning, self.listening, self.crew, self.channels
        )

    def list_uncovered_last(self) -> frozenset[int]:
        """Return what the last re-plan left over."""
        records = self.replanning.records
        return frozenset(records[-1].uncovered) if records else frozenset()

    def want_replan(self, trigger: str, since_s: float) -> FleetState:
        """Return the state in which a re-plan begins at once, for this reason and as old as that."""
        return self.with_replanning(urgent=True, trigger=trigger, trigger_s=since_s)

    def later_segments(self) -> frozenset[int]:
        """Return the segments of the sorties that are planned for later."""
        return frozenset(
            segment_of(visit)
            for vehicle in self.vehicles.values()
            for sortie in vehicle.turn.ahead
            for visit in sortie.visits
        )

    def airborne_vehicles(self) -> list[VehicleState]:
        """Vehicles that are out there as far as we know."""
        return [vehicle for vehicle in self.vehicles.values() if vehicle.airborne]

    def mission_vehicles(self) -> list[VehicleState]:
        """Vehicles whose remaining visits will be flown, or are kept for them while their pilot has them."""
        return [vehicle for vehicle in self.vehicles.values() if vehicle.fault is None and _has_segments(vehicle)]


Stepped = tuple[FleetState, tuple[Command, ...]]
"""What a step comes to: the state after it, and what is to be done."""


def step_each(state: FleetState, items: Iterable[T], step: Callable[[FleetState, T], Stepped]) -> Stepped:
    """Take a step for one after the other; returns the state after the last, and all that is to be done."""
    commands: list[Command] = []
    for item in items:
        state, more = step(state, item)
        commands.extend(more)
    return state, tuple(commands)


def _has_segments(vehicle: VehicleState) -> bool:
    if vehicle.stage is Stage.PILOT:
        return vehicle.custody.taken is not None and not vehicle.custody.taken.given_away
    return vehicle.stage in {Stage.STARTING, Stage.FLYING}
