"""Hold the state of the whole flight."""

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
    """The mission that a re-plan uploads to one vehicle."""

    path: FlightPath
    visits: tuple[int, ...]
    """All visits of the path: those kept, then the new ones."""
    fresh: bool
    """Whether it begins on the ground, with a take-off."""
    fence: Fence | None = None
    """Fence to upload first; None if the one on board covers it."""


@dataclass(frozen=True, slots=True)
class Replan:
    """A re-plan under way: it is solved, then uploaded vehicle by vehicle."""

    solve: Solve
    begun_s: float
    """When its need was declared."""
    solve_s: float | None = None
    """Real seconds of the solver; None while it runs."""
    solved_s: float = 0.0
    uncovered: tuple[int, ...] = ()
    gain: Gain | None = None
    low: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Segments inspected below their layers in the new missions, by vehicle."""
    unmade: tuple[NewRoute, ...] = ()
    """Routes whose missions are still to be built; for a large fleet that takes too long at once."""
    missions: Mapping[str, NewMission] = field(default_factory=lambda: MappingProxyType({}))
    """The missions built so far, by vehicle."""
    pending: frozenset[str] = frozenset()
    """Vehicles whose new mission is not on board yet."""
    failed: tuple[str, ...] = ()
    """Vehicles whose upload failed."""
    let_go: tuple[str, ...] = ()
    """Vehicles for which it came too late."""
    ordered: bool = False
    """Whether an operator requested it."""
    closer: bool = False
    """Whether no segment changes hands: one vehicle only descends for more of the line, or inspects it again."""


@dataclass(frozen=True, slots=True)
class LossOutlook:
    """The effect of a vehicle's loss."""

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
    """Compared with the missions on board; None if the solver did not report it."""
    sortie: str = ""
    """The vehicle whose next sortie it was; empty for a re-plan."""


@dataclass(frozen=True, slots=True)
class GroundStationAbsence:
    """A time in which the ground station was paused, or restarted."""

    until_s: float
    pause_s: float
    """By its own clock, or by the vehicles' where they show more."""
    restarted: bool
    deaf: bool = False
    """Whether it was running without any contact, as with a failed radio."""


@dataclass(frozen=True, slots=True)
class OperatorLine:
    """A line for the operator, kept for later readers: a decision with its reason."""

    at_s: float
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Question:
    """A question to the crew before the flight continues."""

    id: str
    """prepare or take-off: the action that answers yes."""
    text: str
    lines: tuple[str, ...]
    """Details, line by line."""


@dataclass(frozen=True, slots=True)
class TakeoffOffer:
    """Vehicles on the ground offered to the crew for open segments."""

    vehicles: tuple[str, ...]
    segments: tuple[int, ...]
    """Segments without a vehicle that they could inspect."""
    since_s: float
    again: bool = False
    """Whether all of them count already, from too far away."""
    alone_since_s: float | None = None
    """Since when nothing else is awaited."""


@dataclass(frozen=True, slots=True)
class Briefing:
    """The crew's information before the flight."""

    checks: tuple[Check, ...] = ()
    """The checklist, in the crew's reading order."""
    question: Question | None = None
    """The open question."""
    answered: str = ""
    """Id of the question answered with yes, on the page or over MQTT."""


KEPT_LINES = 200


ReportedWarnings = tuple[tuple[str, float], ...]
"""The warnings reported for a vehicle, each by name with its last time."""


@dataclass(frozen=True, slots=True)
class FlightProgress:
    """The progress of the flight from launch to end."""

    launched_s: float | None = None
    recalled: bool = False
    """The flight was aborted."""
    finished: bool = False
    separation_m: float | None = None
    """Closest approach of two vehicles in flight."""

    @property
    def is_under_way(self) -> bool:
        """Whether the flight has begun, and was not aborted."""
        return self.launched_s is not None and not self.recalled


SAME_M = 0.5
"""Difference below which two distances to the line are equal."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """The state of each segment."""

    inspected: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the vehicle that inspected it."""
    flown: Mapping[int, SegmentPass] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the figures of its inspection."""
    inspected_at_m: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to its inspection distance, where vehicles leave their layers."""
    given_up: frozenset[int] = frozenset()
    """Segments that no survivor can inspect."""
    left_over: frozenset[int] = frozenset()
    """Segments that the first plan left over: no reason for a re-plan, taken up by one with budget to spare."""
    attempts: Mapping[int, int] = field(default_factory=lambda: MappingProxyType({}))
    """Number of times a segment was flown without proof."""
    inferred: frozenset[int] = frozenset()
    """Segments flown wholly or partly without contact, where all evidence fits."""
    caught: Mapping[int, tuple[tuple[str, float], ...]] = field(default_factory=lambda: MappingProxyType({}))
    """For segments that require pictures: camera, and metres along the flight track from a, of each that counts."""
    caught_nearer: Mapping[int, tuple[tuple[str, float], ...]] = field(default_factory=lambda: MappingProxyType({}))
    """The same for segments that count, taken from closer: they replace the others once complete."""
    unseen: Mapping[int, AwaitedPictures] = field(default_factory=lambda: MappingProxyType({}))
    """Flown segments that wait for their pictures."""
    not_seen: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    """Segment to the vehicle that last flew it without seeing it; some were seen later."""

    def is_nearer_than_counted(self, segment: int, at_m: float | None) -> bool:
        """Return whether a segment that counts was inspected from farther away than this."""
        counted_m = self.inspected_at_m.get(segment) if segment in self.inspected else None
        return counted_m is not None and at_m is not None and at_m < counted_m - SAME_M

    def list_inferred_segments(self) -> frozenset[int]:
        """Return the segments that count by evidence alone."""
        return self.inferred & set(self.inspected)


@dataclass(frozen=True, slots=True)
class ReplanningState:
    """Whether a re-plan is needed or under way, and the ended ones."""

    revision: int = 0
    replan: Replan | None = None
    orphans_since_s: float | None = None
    urgent: bool = False
    """A fault was declared since the last re-plan began."""
    trigger: str = ""
    trigger_s: float = 0.0
    """When the last fault was declared."""
    wait_until_s: float = float("-inf")
    """Earliest start of the next re-plan: the last solve failed."""
    closer_s: float = float("-inf")
    """When vehicles were last evaluated for a lower mission or a second pass."""
    ordered: bool = False
    """An operator requested a re-plan, which begins without a need."""
    considered: frozenset[str] = frozenset()
    """The survivors of the last re-plan."""
    mended: tuple[tuple[str, Fault], ...] = ()
    """(vehicle, fault) of vehicles taken back into the plan."""
    records: tuple[ReplanRecord, ...] = ()
    outlook: Mapping[str, LossOutlook] = field(default_factory=lambda: MappingProxyType({}))
    """The effect of each flying vehicle's loss; computed seldom."""

    @property
    def is_changing(self) -> bool:
        """Whether a re-plan is under way, or about to begin."""
        return self.replan is not None or self.urgent or self.ordered


@dataclass(frozen=True, slots=True)
class ContactState:
    """Whether the ground station was running, and had contact."""

    tick_s: float | None = None
    late_s: float = 0.0
    """Part of the time before the last tick that its computer was too busy."""
    silent_since_s: float | None = None
    """Since when no vehicle is received."""
    silence_told_s: float | None = None
    """When that was last reported."""
    absences: tuple[GroundStationAbsence, ...] = ()
    """Absences of the ground station long enough to report, the latest last."""


@dataclass(frozen=True, slots=True)
class CountedPacks:
    """The charged packs at a base, as counted by the crew."""

    charged: int
    at_s: float
    in_vehicles: frozenset[str] = frozenset()
    """Vehicles in turnaround at that time: their packs were taken before, and fly later."""


@dataclass(frozen=True, slots=True)
class CrewDialogue:
    """What the crew was told and asked, and its intents."""

    said: tuple[OperatorLine, ...] = ()
    """The last lines for the operator, oldest first."""
    told: Mapping[str, ReportedWarnings] = field(default_factory=lambda: MappingProxyType({}))
    """The warnings reported, by vehicle."""
    intents: Mapping[str, IntentRecord] = field(default_factory=lambda: MappingProxyType({}))
    """The operator's intents by id, oldest first."""
    briefing: Briefing = field(default_factory=Briefing)
    offer: TakeoffOffer | None = None
    offer_wanted_s: float | None = None
    """Since when there is something to offer."""
    offers_over: bool = False
    """Whether an offer expired: no vehicle takes off again."""
    closed_bases: frozenset[str] = frozenset()
    """Bases of the day that the crew has closed."""
    counted_packs: Mapping[str, CountedPacks] = field(default_factory=lambda: MappingProxyType({}))
    """The crew's last count of charged packs, by base."""


@dataclass(frozen=True, slots=True)
class FleetState:
    """The flight as known at one moment."""

    vehicles: Mapping[str, VehicleState]
    progress: FlightProgress = field(default_factory=FlightProgress)
    coverage: Coverage = field(default_factory=Coverage)
    replanning: ReplanningState = field(default_factory=ReplanningState)
    listening: ContactState = field(default_factory=ContactState)
    crew: CrewDialogue = field(default_factory=CrewDialogue)
    channels: Mapping[str, ChannelState] = field(default_factory=lambda: MappingProxyType({}))
    """The state of each telemetry radio, by the first vehicle behind it."""

    with_progress = PartUpdate(FlightProgress)
    with_coverage = PartUpdate(Coverage)
    with_replanning = PartUpdate(ReplanningState)
    with_listening = PartUpdate(ContactState)
    with_crew = PartUpdate(CrewDialogue)

    def put(self, vehicle: VehicleState) -> FleetState:
        """Return the state with one vehicle replaced."""
        if self.vehicles.get(vehicle.name) is vehicle:
            return self
        # Runs for every message: a direct construction takes a third of the time of `replace`.
        vehicles = MappingProxyType({**self.vehicles, vehicle.name: vehicle})
        return FleetState(
            vehicles, self.progress, self.coverage, self.replanning, self.listening, self.crew, self.channels
        )

    def list_uncovered_last(self) -> frozenset[int]:
        """Return the segments the last re-plan left uncovered."""
        records = self.replanning.records
        return frozenset(records[-1].uncovered) if records else frozenset()

    def want_replan(self, trigger: str, since_s: float) -> FleetState:
        """Return the state in which a re-plan begins at once, for this reason and since this time."""
        return self.with_replanning(urgent=True, trigger=trigger, trigger_s=since_s)

    def later_segments(self) -> frozenset[int]:
        """Return the segments of later sorties."""
        return frozenset(
            segment_of(visit)
            for vehicle in self.vehicles.values()
            for sortie in vehicle.turn.ahead
            for visit in sortie.visits
        )

    def airborne_vehicles(self) -> list[VehicleState]:
        """Return the vehicles in the air, as far as known."""
        return [vehicle for vehicle in self.vehicles.values() if vehicle.airborne]

    def mission_vehicles(self) -> list[VehicleState]:
        """Return the vehicles whose remaining visits will be flown, or are reserved while their pilot has them."""
        return [vehicle for vehicle in self.vehicles.values() if vehicle.fault is None and _has_segments(vehicle)]


Stepped = tuple[FleetState, tuple[Command, ...]]
"""The result of a step: the next state and the commands."""


def step_each(state: FleetState, items: Iterable[T], step: Callable[[FleetState, T], Stepped]) -> Stepped:
    """Apply a step to one item after the other; return the last state and all commands."""
    commands: list[Command] = []
    for item in items:
        state, more = step(state, item)
        commands.extend(more)
    return state, tuple(commands)


def _has_segments(vehicle: VehicleState) -> bool:
    if vehicle.stage is Stage.PILOT:
        return vehicle.custody.taken is not None and not vehicle.custody.taken.given_away
    return vehicle.stage in {Stage.STARTING, Stage.FLYING}
