"""One vehicle as we know it: what it said last and when, what it flies, and what is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, StrEnum

from executor.core.battery.account import BatteryState
from executor.core.battery.roundings import Roundings
from executor.core.battery.voltage import VoltageState
from executor.core.carried import Carried
from executor.core.changed import changed
from executor.core.context import Context
from executor.core.coverage import Run, Track
from executor.core.link_quality import LinkQuality
from executor.core.messages import Attitude, DoubleHeard, Gps, Heartbeat, StationHeard, Wind
from missions import FlightPath, LegEstimate, Phase, Waypoint, encode, estimate
from planner import segment_of


class Stage(Enum):
    """Where a vehicle is in its flight."""

    GROUND = "ground"
    """Before its start, or with nothing to do."""
    STARTING = "starting"
    FLYING = "flying"
    """On its mission."""
    RETURNING = "returning"
    """On its way home, or down, and not to fly its mission again."""
    PILOT = "pilot"
    """With its pilot, or with another ground station: not commanded from here."""
    LANDED = "landed"
    DOWN = "down"
    """On the ground where, when or how it should not be."""
    LOST = "lost"
    """Silent for longer than its time-out."""


TRANSITIONS: dict[Stage, frozenset[Stage]] = {
    Stage.GROUND: frozenset({Stage.STARTING, Stage.PILOT, Stage.LOST}),
    Stage.STARTING: frozenset({
        Stage.FLYING, Stage.GROUND, Stage.RETURNING, Stage.PILOT, Stage.LANDED, Stage.DOWN, Stage.LOST,
    }),
    Stage.FLYING: frozenset({Stage.RETURNING, Stage.PILOT, Stage.LANDED, Stage.DOWN, Stage.LOST}),
    Stage.RETURNING: frozenset({Stage.PILOT, Stage.LANDED, Stage.DOWN, Stage.LOST}),
    Stage.PILOT: frozenset({Stage.FLYING, Stage.RETURNING, Stage.LANDED, Stage.DOWN, Stage.LOST}),
    Stage.LANDED: frozenset({Stage.STARTING, Stage.GROUND, Stage.RETURNING, Stage.PILOT, Stage.LOST}),
    Stage.DOWN: frozenset({Stage.RETURNING, Stage.PILOT, Stage.GROUND}),
    Stage.LOST: frozenset({Stage.RETURNING, Stage.PILOT, Stage.LANDED, Stage.DOWN}),
}  # fmt: skip
"""What may follow what; a vehicle at fault never flies its mission again. Landed and taken back into the plan, with
another battery, it is on the ground as before its start; one that its pilot has given back flies on."""


class Cause(Enum):
    """Why a vehicle is in the mode that it is in."""

    OURS = "ours"
    """Ordered here, or the mission that it was started on."""
    MISSION = "mission"
    """Its mission's own end."""
    FAILSAFE = "failsafe"
    """Its own failsafe."""
    PERSON = "person"
    """Its pilot, another ground station, or nobody knows: hands off."""


@dataclass(frozen=True, slots=True)
class TakenOver:
    """A vehicle in other hands."""

    since_s: float
    given_away: bool = False
    """Whether its segments were reassigned."""
    returned_s: float | None = None
    """Since when it is on its mission again, by its pilot's doing; None if it is not."""


@dataclass(frozen=True, slots=True)
class Errand:
    """What a vehicle is to be told, until it has answered: to return, or to land where it is."""

    since_s: float
    land: bool = False
    told: bool = False
    """Whether it was told, and has not refused since."""
    not_before_s: float = float("-inf")
    """When it may be told again after a refusal."""
    force: bool = False
    """Whether the operator has confirmed that it is taken out of its pilot's hands."""


class FaultKind(Enum):
    """What a fault is about."""

    LINK = "link"
    BATTERY = "battery"
    INTERRUPTION = "interruption"
    OPERATOR = "operator"
    """By the operator's word."""
    DOWN = "down"
    """On the ground where, when or how it should not be."""


class FaultCode(StrEnum):
    """What was found, beside the words: within its kind, and finer."""

    LINK_LOST = "link_lost"
    """Nothing was received for the link time-out."""
    HEARTBEAT_LOST = "heartbeat_lost"
    """No HEARTBEAT while other messages come."""
    POSITION_LOST = "position_lost"
    """No position while other messages come."""
    ITEM_LOST = "item_lost"
    """No current waypoint while other messages come."""
    BATTERY_REPORT_LOST = "battery_report_lost"
    """No battery report while other messages come."""
    BATTERY_STEP = "battery_step"
    """Much charge was lost at once."""
    VOLTAGE_STEP = "voltage_step"
    """The voltage fell at once by more than the load explains."""
    CELL_WEAK = "cell_weak"
    """A cell is near its end, or far below the others."""
    BATTERY_CRITICAL = "battery_critical"
    """The autopilot reports its battery critical, failed or unhealthy."""
    BATTERY_FAILSAFE = "battery_failsafe"
    """The autopilot says that its battery failsafe acts."""
    BATTERY_PLUNGE = "battery_plunge"
    """Far more is used than is usual."""
    BATTERY_DRIFT = "battery_drift"
    """More is used than is usual, for a while."""
    BATTERY_LOW = "battery_low"
    """It would land below its reserve."""
    DISARMED = "disarmed"
    """It disarmed where, or when, it should not have."""
    FALLING = "falling"
    """It falls."""
    TERMINATED = "terminated"
    """Its HEARTBEAT reports an emergency or flight termination."""
    POSITION_JUMP = "position_jump"
    """Its position jumped."""
    MODE_CHANGED = "mode_changed"
    """It left its mission by its own failsafe."""
    STALL = "stall"
    """It does not move on its mission."""
    DOWN = "down"
    """It is on the ground where, or as, it should not be."""
    NOT_STARTED = "not_started"
    """It could not be started."""
    MISSION_FOREIGN = "mission_foreign"
    """After an absence it cannot be left on the mission that it carries."""
    MISSION_MIXED = "mission_mixed"
    """Its mission on board is a mix of two."""
    OPERATOR_LAND = "operator_land"
    """An operator's intent had it land."""
    OPERATOR_EXCLUDE = "operator_exclude"
    """An operator's intent took it out of the plan."""


@dataclass(frozen=True, slots=True)
class Fault:
    """The judgement that a vehicle will not finish its route."""

    kind: FaultKind
    reason: str
    detected_s: float
    code: FaultCode


IN_THE_AIR = frozenset({Stage.FLYING, Stage.RETURNING, Stage.PILOT})


@dataclass(frozen=True, slots=True)
class Watch:
    """One watchpoint's memory: since when it fails, if it does."""

    failing_since_s: float | None = None


@dataclass(frozen=True, slots=True)
class Fix:
    """A position in the local frame."""

    at_s: float
    """When it arrived."""
    boot_s: float
    place_m: tuple[float, float]
    alt_rel_m: float
    alt_msl_m: float
    velocity_m_s: tuple[float, float, float]
    """East, north, up."""
    heading_deg: float | None = None


@dataclass(frozen=True, slots=True)
class TextFlow:
    """What a vehicle said in words, as far as it decides what is shown."""

    last: tuple[str, float] = ("", float("-inf"))
    """The line that was shown last, and when it was heard last."""
    since_s: float = float("-inf")
    """When the window began in which lines are counted."""
    shown: tuple[int, ...] = (0, 0, 0)
    """Lines of each rank in this window."""
    passed_over: int = 0
    """Texts for which there was no room in it."""


@dataclass(frozen=True, slots=True)
class OnBoard:
    """The mission that the vehicle is known to carry."""

    revision: int
    path: FlightPath
    waypoint_of: tuple[int | None, ...]
    """Mission item to waypoint of the path."""
    visits: tuple[int, ...]
    """All visits of the path in their order; a waypoint's `visit` is an index here."""
    tracks: tuple[Track, ...]
    """The line to be flown for each visit."""
    places_m: tuple[tuple[float, float], ...]
    """Each waypoint in the local frame."""
    legs: tuple[LegEstimate, ...]
    """What each leg of the path should take."""


@dataclass(frozen=True, slots=True)
class Before:
    """Where a vehicle on its mission was when it was last heard, before nobody listened or nobody was heard."""

    fix: Fix
    waypoint: int
    run: Run | None
    run_visit: int | None
    remaining_pct: float | None
    until_s: float = float("-inf")
    """What was said later than this is news."""


@dataclass(frozen=True)  # without slots: `changed` copies it
class VehicleState:
    """Everything known of one vehicle."""

    name: str
    stage: Stage = Stage.GROUND
    heard_s: float | None = None
    """When it was heard last; later by what was not its own silence."""
    spoke_s: float | None = None
    """When it really said something last."""
    heartbeat: Heartbeat | None = None
    mode_since_s: float = 0.0
    ordered_mode_s: float = float("-inf")
    """When we last ordered a change of mode."""
    armed_once: bool = False
    disarmed_s: float = float("-inf")
    """When it was first heard to be disarmed after it was armed."""
    fix: Fix | None = None
    anchor: Fix | None = None
    """Where the vehicle was when it last moved on, for the stall watchpoint."""
    on_ground: bool | None = None
    battery: BatteryState = field(default_factory=BatteryState)
    packs: tuple[tuple[int, float], ...] = ()
    """What each battery reported last, in percent, by its id."""
    roundings: Roundings = field(default_factory=Roundings)
    """PX4's two ways to say its percentage."""
    board: OnBoard | None = None
    waypoint: int = 0
    """The waypoint at the end of the leg under way, by the vehicle's own word."""
    run: Run | None = None
    run_visit: int | None = None
    """The visit that `run` belongs to."""
    runs_broken: tuple[tuple[int, str], ...] = ()
    """(segment, reason) of inspections that do not count."""
    watches: tuple[tuple[str, Watch], ...] = ()
    stale: bool = False
    fault: Fault | None = None
    pending: int | None = None
    """The revision whose mission is being put on board."""
    stubborn: bool = False
    """Whether it could not be given a new mission: it is planned around."""
    failures: int = 0
    """Starts or uploads that failed since the last that succeeded."""
    texts: TextFlow = field(default_factory=TextFlow)
    took_off: bool = False
    """Whether it was heard in the air since its last start."""
    alarm: tuple[str, float] = ("", float("-inf"))
    """What it said last of a failsafe or a crash, and when."""
    heartbeat_s: float | None = None
    """When its last HEARTBEAT came: other messages may come without it, and it without them."""
    quality: LinkQuality = field(default_factory=LinkQuality)
    volts: VoltageState = field(default_factory=VoltageState)
    battery_faults: int = 0
    """MAV_BATTERY_FAULT bits of its last report."""
    unhealthy: int = 0
    """MAV_SYS_STATUS_SENSOR bits that are enabled and not healthy."""
    item: tuple[int, int | None] | None = None
    """The mission item it flies to by its own word, and how many there are."""
    item_s: float | None = None
    """When it said so last."""
    streams_asked_s: float = float("-inf")
    """When it was asked last to send again what does not come."""
    excused_s: float = float("-inf")
    """Until when nothing that is missing is held against it: we did not listen, or it was silent altogether."""
    flew_mission: bool = False
    """Whether it was in mission mode in the air since its last start."""
    jump: tuple[float, float] = (0.0, float("-inf"))
    """How far its position lay from where its velocity leads, and when."""
    strangers: frozenset[StationHeard | DoubleHeard] = frozenset()
    """Other ground stations on its link, and other vehicles with its number."""
    before: Before | None = None
    """Until it is known what it did while nobody listened."""
    held_s: float | None = None
    """Since when it holds by the operator's order; None if it does not."""
    hold_asked_s: float = float("-inf")
    """When a hold was commanded last, and no resume since: it may follow late."""
    excluded: bool = False
    """Whether the operator took it out of the plan: it is given nothing until it is included."""
    lands: bool = False
    """Whether the operator ordered it to land where it was."""
    began_pct: float | None = None
    """What its battery held at its last start."""
    gps: Gps | None = None
    wind: Wind | None = None
    """As it measures it."""
    attitude: Attitude | None = None
    tilted_since_s: float | None = None
    """Since when it lies or hangs as no multicopter flies."""
    fence_breached: bool = False
    ordered_modes: frozenset[int] = frozenset()
    """The modes that the last order leads to."""
    cause: Cause = Cause.OURS
    """Why it is in its mode, as long as it is armed."""
    certain: bool = False
    """Whether no text that may come late can make it anything but a person's."""
    regained_s: float | None = None
    """When its last silence ended with whatever it said."""
    unseen_until_s: float | None = None
    """When its last silence ended with a heartbeat."""
    unseen_from_boot_s: float | None = None
    """By its own clock, when it was seen last before that."""
    beat_boot_s: float | None = None
    """By its own clock, about when its last heartbeat came."""
    taken: TakenOver | None = None
    errand: Errand | None = None
    cleared_s: float | None = None
    """When the crew said that it may take off again; None if it did not, or it has."""
    rebooted_s: float | None = None
    """When its clock was found to have begun anew, since its last start."""
    away_once: bool = False
    """Whether it was seen away from its pad since its last start."""
    place_told: bool = False
    """Whether it was said where it is down."""
    left_s: float | None = None
    """When it left its mission to come home."""
    falls_s: float = float("-inf")
    """When it sank last as no vehicle lands."""
    doubted: tuple[Heartbeat, float] | None = None
    """A HEARTBEAT that said that it is disarmed where it flies, and when: believed if the next one says the same."""
    carried: Carried = field(default_factory=Carried)
    owed: tuple[int, str] | None = None
    """(visit, reason) of an inspection that broke, until it is known that it does not count."""

    @property
    def airborne(self) -> bool:
        """Whether it is out there, as far as we know."""
        return self.stage in IN_THE_AIR or (self.stage is Stage.STARTING and self.armed)

    @property
    def armed(self) -> bool:
        """Whether its last heartbeat said so."""
        return self.heartbeat is not None and self.heartbeat.armed

    @property
    def leg(self) -> Waypoint | None:
        """The waypoint that it flies to."""
        if self.board is None or self.waypoint >= len(self.board.path.waypoints):
            return None
        return self.board.path.waypoints[self.waypoint]

    def remaining_visits(self) -> tuple[int, ...]:
        """Visits of its mission that it has not passed, the one under way included."""
        if self.board is None:
            return ()
        ahead = {waypoint.visit for waypoint in self.board.path.waypoints[self.waypoint :]}
        return tuple(visit for index, visit in enumerate(self.board.visits) if index in ahead)


def moved_to(state: VehicleState, stage: Stage) -> VehicleState:
    """Return the vehicle in another stage.

    Raises:
        ValueError: the table has no such transition; a mistake of the caller's.
    """
    if stage is state.stage:
        return state
    if stage not in TRANSITIONS[state.stage]:
        raise ValueError(f"{state.name}: {state.stage.value} cannot become {stage.value}")
    return changed(state, stage=stage)


def aboard(context: Context, name: str, revision: int, path: FlightPath, visits: tuple[int, ...]) -> OnBoard:
    """Return what a vehicle carries once `path` has been put on board and read back."""
    places = tuple(context.frame.to_local_m(waypoint.lat_deg, waypoint.lon_deg) for waypoint in path.waypoints)
    # The leg that is marked as the inspection of a visit begins where the leg before it ends.
    tracks = tuple(
        Track(segment_of(visits[waypoint.visit]), places[index - 1], places[index])
        for index, waypoint in enumerate(path.waypoints)
        if waypoint.phase is Phase.INSPECT and waypoint.visit is not None
    )
    encoded = encode(path, context.vehicles[name].dialect)
    legs = estimate(path, context.travel, context.setup.motion).legs
    return OnBoard(revision, path, encoded.waypoint_of, visits, tracks, places, legs)
