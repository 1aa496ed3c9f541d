"""What is known of one vehicle, in parts: each holds what is heard, decided and forgotten together."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from executor.core.battery.account import BatteryState, PercentRounding
from executor.core.battery.pack_condition import PackState
from executor.core.battery.voltage import VoltageState
from executor.core.interface import messages
from executor.core.state.inspection_proof import InspectionRun, Track
from executor.core.state.link_quality import DuplicateIdWatch, LinkQuality
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.vehicle_learning import LearnedFactors
from missions import FlightPath, LegEstimate, Pace, Phase
from missions.fences import Fence
from missions.flight_model import AS_MODELLED
from missions.items import MissionItem


class ModeCause(Enum):
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
class Takeover:
    """A vehicle in other hands."""

    since_s: float
    given_away: bool = False
    """Whether its segments were reassigned."""
    returned_s: float | None = None
    """Since when it is on its mission again, by its pilot's doing; None if it is not."""


@dataclass(frozen=True, slots=True)
class HomingOrder:
    """What a vehicle is to be told, until it has answered: to return, or to land where it is."""

    since_s: float
    land: bool = False
    told: bool = False
    """Whether it was told, and has not refused since."""
    not_before_s: float = float("-inf")
    """When it may be told again after a refusal."""
    force: bool = False
    """Whether the operator has confirmed that it is taken out of its pilot's hands."""


@dataclass(frozen=True, slots=True)
class PositionFix:
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
    reckoned: bool = False
    """Whether it came while GPS was lost: by its accelerations alone."""

    def distance_m(self, other: PositionFix) -> float:
        """Return how far another one is, in height too."""
        return math.dist((*self.place_m, self.alt_rel_m), (*other.place_m, other.alt_rel_m))


@dataclass(frozen=True, slots=True)
class Positioning:
    """Whether its positions are by satellites, and which was the last that is known to be."""

    fixed: PositionFix | None = None
    """The newest position when its GPS last reported a fix; None before there was one."""
    lost_s: float | None = None
    """When it was heard that GPS is lost; None while it is not."""
    why: str = ""
    """What says so."""
    regained_s: float = float("-inf")
    """When GPS was regained last."""
    fixes: tuple[tuple[int, int], ...] = ()
    """(receiver, GPS_FIX_TYPE) of each receiver's last report."""
    reported_s: float = float("-inf")
    """When a receiver reported last."""
    measured_s: float | None = None
    """The first receiver's own time of its last fix."""
    accuracy_m: float | None = None
    """Of its last fix, horizontally, by the receiver's word."""
    adrift_s: float | None = None
    """Since when its estimator says that it does not know where it is on the earth."""
    estimated_s: float = float("-inf")
    """When its estimator reported last."""


@dataclass(frozen=True, slots=True)
class TextWindow:
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
class OnboardMission:
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
class LegBoundary:
    """A moment at which one leg ended and the next began."""

    at_s: float
    given_pct: float | None
    """What its battery had given by then, in percent; None if it never reported."""
    modelled_pct: float = 0.0
    """What the model says of its battery's account by then."""


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """A leg of a mission that was flown, beside what it should have taken."""

    revision: int
    """Of the mission on board at its end."""
    waypoint: int
    """The one at its end."""
    phase: Phase
    segment: int | None
    """The segment that it inspects, or leads to."""
    planned: LegEstimate
    began: LegBoundary | None
    """None where nobody heard it."""
    ended: LegBoundary | None


@dataclass(frozen=True, slots=True)
class LastKnown:
    """Where a vehicle on its mission was before a gap in its positions, or before nobody listened."""

    fix: PositionFix
    waypoint: int
    run: InspectionRun | None
    run_visit: int | None
    remaining_pct: float | None
    until_s: float = float("-inf")
    """What was said later than this is news."""
    factor: float = 1.0
    """What it was known to use relative to the model: what it used in the gap must not judge itself."""


@dataclass(frozen=True, slots=True)
class DeclinedMission:
    """A new mission that a vehicle could not be given."""

    at_s: float
    """When that was known."""
    tries: int
    """How many in a row."""
    maybe: OnboardMission | None = None
    """What it may carry all the same, instead of its old one; None where that cannot be."""


@dataclass(frozen=True, slots=True)
class LinkState:
    """When it was heard, how well, and by whom else."""

    heard_s: float | None = None
    """When it was heard last; later by what was not its own silence."""
    spoke_s: float | None = None
    """When it really said something last."""
    heartbeat_s: float | None = None
    """When its last HEARTBEAT came: other messages may come without it, and it without them."""
    regained_s: float | None = None
    """When its last silence ended with whatever it said."""
    stale: bool = False
    excused_s: float = float("-inf")
    """Until when nothing that is missing is held against it: we did not listen, or it was silent altogether."""
    quality: LinkQuality = field(default_factory=LinkQuality)
    strangers: frozenset[messages.StationHeard | messages.StationActed | messages.DoubleHeard] = frozenset()
    """Other ground stations on its link, what is not passed on of theirs, and other vehicles with its number."""
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)
    """Whether its positions are those of one vehicle."""


@dataclass(frozen=True, slots=True)
class Telemetry:
    """What it said last of what it does."""

    heartbeat: messages.Heartbeat | None = None
    mode_since_s: float = 0.0
    mode_before_s: float | None = None
    """When a HEARTBEAT showed the mode before last: it changed between the two. None where there was no other."""
    mode_before: int | None = None
    """That mode."""
    critical_since_s: float | None = None
    """Since when its HEARTBEATs say that a failsafe is in force; None if they do not."""
    doubted: tuple[messages.Heartbeat, float] | None = None
    """A HEARTBEAT that said that it is disarmed where it flies, and when: believed if the next one says the same."""
    item: tuple[int, int | None] | None = None
    """The mission item it flies to by its own report, and how many there are."""
    item_s: float | None = None
    """When it said so last."""
    on_ground: bool | None = None
    alarm: tuple[str, float] = ("", float("-inf"))
    """What it said last of a failsafe or a crash, and when."""
    texts: TextWindow = field(default_factory=TextWindow)


@dataclass(frozen=True, slots=True)
class Sensors:
    """What its sensors say of it and of what is around it."""

    gps: messages.Gps | None = None
    positioning: Positioning = field(default_factory=Positioning)
    wind: messages.Wind | None = None
    """As it measures it."""
    attitude: messages.Attitude | None = None
    tilted_since_s: float | None = None
    """Since when it lies or hangs as no multicopter flies."""
    fence_breached: bool = False
    breached_s: float = float("-inf")
    """When it said so last: its return may be over its fence again before its mode is heard."""
    unhealthy: int = 0
    """MAV_SYS_STATUS_SENSOR bits that are enabled and not healthy."""


@dataclass(frozen=True, slots=True)
class MotionState:
    """Where it is, and how it moves."""

    fix: PositionFix | None = None
    last_fix: PositionFix | None = None
    """The one before."""
    anchor: PositionFix | None = None
    """Where the vehicle was when it last moved on, for the stall watchpoint."""
    jump: tuple[float, float] = (0.0, float("-inf"))
    """How far its position lay from where its velocity leads, and when."""
    falls_s: float = float("-inf")
    """When it sank last as no vehicle lands."""
    climbs_m_s: float = 0.0
    """By its heights alone, over some seconds: what it says of its speed may be wrong where it matters."""
    sinks_s: float = float("-inf")
    """When it sank last, by them."""
    drops_s: float = float("-inf")
    """When it sank last faster than any autopilot touches down."""
    behind_s: float = 0.0
    """By how much its clock fell back behind ours in gaps of its positions: it stood still, or has begun anew."""
    fell_back_s: float = float("-inf")
    """When the last such gap ended."""
    reopened: bool = False
    """Whether the ground station was away since its last position: how long that was is its own clock's word alone."""

    @property
    def stood_s(self) -> float:
        """How long it has not moved on, by its own clock; 0 where nobody knows."""
        return 0.0 if self.fix is None or self.anchor is None else self.fix.boot_s - self.anchor.boot_s


@dataclass(frozen=True, slots=True)
class OwnMission:
    """Its mission as its log has it, where nobody here planned it, and the height that its autopilot wants."""

    listed: tuple[MissionItem, ...] = ()
    """By their numbers, as far as they were seen."""
    leads_to: int | None = None
    """The item with a place that it flies to."""
    came_from: int | None = None
    """The one that it flew to before; None if its leg did not begin there."""
    leg_from: PositionFix | None = None
    """Where it was when that leg began."""
    below_m: float = 0.0
    """How far it is below the height that its autopilot wants."""
    below_s: float = float("-inf")
    """When it said so."""


TOUCHDOWN_PCT = 1.0
"""What a report on the ground may be below the last one in the air of a landing that was heard."""


@dataclass(frozen=True, slots=True)
class PowerState:
    """What its batteries say, and what is made of it."""

    battery: BatteryState = field(default_factory=BatteryState)
    packs: tuple[tuple[int, float], ...] = ()
    """What each battery reported last, in percent, by its id."""
    roundings: PercentRounding = field(default_factory=PercentRounding)
    """PX4's two ways to say its percentage."""
    volts: VoltageState = field(default_factory=VoltageState)
    battery_faults: int = 0
    """MAV_BATTERY_FAULT bits of its last report."""
    pack: PackState = field(default_factory=PackState)
    """What its voltage and its parameters say of the pack."""
    told_s: float = float("-inf")
    """When BATTERY_STATUS came last: SYS_STATUS says less, and in another way."""
    began_pct: float | None = None
    """What its battery held at its last start."""
    aloft_pct: float | None = None
    """What it held when it was last heard in the air: PX4's simulated pack is full again as soon as it disarms."""

    @property
    def landed_pct(self) -> float | None:
        """What it landed with; what it holds now, if it was not heard in the air or lost charge unheard since."""
        aloft_pct, now_pct = self.aloft_pct, self.battery.remaining_pct
        if aloft_pct is None or (now_pct is not None and now_pct < aloft_pct - TOUCHDOWN_PCT):
            return now_pct
        return aloft_pct


@dataclass(frozen=True, slots=True)
class Assignment:
    """The mission that it carries, and how far it has come with it."""

    board: OnboardMission | None = None
    waypoint: int = 0
    """The waypoint at the end of the leg under way, by the vehicle's own word."""
    fix_waypoint: int | None = None
    """The same when its newest position came: after a silence either may be heard first."""
    run: InspectionRun | None = None
    run_visit: int | None = None
    """The visit that `run` belongs to."""
    runs_broken: tuple[tuple[int, str], ...] = ()
    """(segment, reason) of inspections that do not count."""
    owed: tuple[int, str] | None = None
    """(visit, reason) of an inspection that broke, until it is known that it does not count."""
    before: LastKnown | None = None
    """Until it is known what it did while nobody listened."""
    carried: MissionOwnership = field(default_factory=MissionOwnership)
    fence: Fence | None = None
    """The fence on board, of those that were put there from here: while a wider one is being uploaded, the narrower."""
    pending: int | None = None
    """The revision whose mission is being put on board."""
    sent_path: FlightPath | None = None
    """The new mission that it may fly instead, where vehicles leave their layers: sent, and not surely refused."""
    stubborn: bool = False
    """Whether it could not be given a new mission: it is planned around."""
    declined: DeclinedMission | None = None
    """That mission, until it is given one."""
    failures: int = 0
    """Starts or uploads that failed since the last that succeeded."""
    leg_began: LegBoundary | None = None
    """When the leg under way began; None before the take-off and after the landing."""
    flown: tuple[FlownLeg, ...] = ()
    """Legs that are behind it, of all its missions."""
    learned: LearnedFactors | None = None
    """What they say of the vehicle; None as long as they say nothing."""

    @property
    def pace(self) -> Pace:
        """The factors on the times of its legs, as far as they were seen of it in this flight."""
        return AS_MODELLED if self.learned is None else self.learned.pace


@dataclass(frozen=True, slots=True)
class YieldState:
    """A vehicle flies slowly, as somebody climbs ahead of it."""

    since_s: float
    told_s: float
    """When it was last told a speed."""
    followed: bool = False
    """Whether it was seen to be slow since."""
    over_s: float | None = None
    """Since when it is to be at its leg's speed again."""
    leg: int | None = None
    """The waypoint that it flew to then."""


FOLLOWED_LATE_S = 120.0
"""An order may be followed, or answered, this late: a radio keeps it, or only the answers were lost."""
CLEARED_S = 120.0
"""After this the crew's word that a pad is clear is too old to take off by."""
PLANNED_WITHIN_S = 60.0
"""After this it is too old to plan with: a mission has to be made, and put on board, while it still holds."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What it was ordered, and what the crew wants of it."""

    ordered_mode_s: float = float("-inf")
    """When we last ordered a change of mode."""
    ordered_modes: frozenset[int] = frozenset()
    """The modes that the last order leads to."""
    held_s: float | None = None
    """Since when it holds by the operator's order; None if it does not."""
    hold_asked_s: float = float("-inf")
    """When a hold was commanded last, and no resume since: it may follow late."""
    gives_way: YieldState | None = None
    gave_way_s: float = float("-inf")
    """When it last gave way to anybody: what its legs take says nothing of its pace then."""
    excluded: bool = False
    """Whether the operator took it out of the plan: it is given nothing until it is included."""
    lands: bool = False
    """Whether the operator ordered it to land where it was."""
    errand: HomingOrder | None = None
    cleared_s: float | None = None
    """When the crew said that it may take off again; None if it did not, or it has."""
    start_owed_s: float | None = None
    """When its start failed while it said no position: it is tried again once it says where it is."""
    start_let_go: bool = False
    """Whether its start was let go because somebody changed its mode: nothing pursues it, and it ends unheard."""
    streams_asked_s: float = float("-inf")
    """When it was asked last to send again what does not come."""
    stream_step: int = 0
    """How far its streams are thinned at least, as its radio was found to be full."""


@dataclass(frozen=True, slots=True)
class SortieProgress:
    """What was seen of it since its last start."""

    armed_once: bool = False
    disarmed_s: float = float("-inf")
    """When it was first heard to be disarmed after it was armed."""
    took_off: bool = False
    """Whether it was heard in the air since its last start."""
    flew_mission: bool = False
    """Whether it was in mission mode in the air since its last start."""
    away_once: bool = False
    """Whether it was seen away from its pad since its last start."""
    rebooted_s: float | None = None
    """When its clock was found to have begun anew, since its last start."""
    left_s: float | None = None
    """When it left its mission to come home."""
    place_told: bool = False
    """Whether it was said where it is down."""


@dataclass(frozen=True, slots=True)
class PlannedSortie:
    """A sortie that the day's plan has for a vehicle."""

    visits: tuple[int, ...]
    """Visits of the network in their order."""
    start_s: float
    """Its planned take-off, counted from the first one of the day."""
    base: str = ""
    """Where it begins; empty where the vehicle's sorties all begin and end at one base."""
    lands: str = ""
    """The base where it ends."""


@dataclass(frozen=True, slots=True)
class FlownSortie:
    """A flight from a take-off to the landing."""

    number: int
    """Of this vehicle's, from 1."""
    pack: str
    """The id of the pack, as the crew said; empty if nobody did."""
    began_s: float
    began_pct: float | None
    """By its own report."""
    rest_v: float | None
    """Of the pack at rest, before it."""
    before: tuple[int, ...] = ()
    """The segments that the vehicle had inspected before it."""
    ended_s: float | None = None
    """None for the one under way."""
    ended_pct: float | None = None
    end_v: float | None = None
    """Of the pack at its end, as it would rest where that is known."""
    cells: int | None = None
    base: str = ""
    """Where it began; empty for the vehicle's own of the day."""
    lands: str = ""
    """The base where it ended, or is to end; empty for the one where it began."""


@dataclass(frozen=True, slots=True)
class Turnaround:
    """A vehicle's turnarounds on its base, and its sorties."""

    label: str = ""
    """What stands on the pack in it, as the crew said."""
    swaps: int = 0
    """How often the crew has said that its pack is changed."""
    overstated_pct: float = 0.0
    """By so much its percentage says more than its pack holds, as far as the resting voltage tells."""
    asked_s: float | None = None
    """Since when it is being turned around by the crew's word; None while it is not."""
    intent: str = ""
    """That word's id."""
    ready_s: float | None = None
    """Since when its checks have passed and it waits for its sortie."""
    ahead: tuple[PlannedSortie, ...] = ()
    """What it is planned to fly after what it carries."""
    beyond: frozenset[int] = frozenset()
    """Open segments of which it could fly none with a good pack."""
    sorties: tuple[FlownSortie, ...] = ()
    """Its sorties, the one under way last."""
    base: str = ""
    """Where it stands, or took off; empty for its own of the day."""
    lands_at: str = ""
    """The base where the mission that it carries, or is given, ends; empty for the one where it takes off."""
    moved: bool = False
    """Whether it stands at another base than when its parameters were looked at."""


LONG_AGO_S = float("-inf")


@dataclass(frozen=True, slots=True)
class SwitchMove:
    """A switch of the pilot's transmitter was moved: some time between two reports of its channel."""

    channel: int
    was_us: int
    now_us: int
    from_s: float
    to_s: float


@dataclass(frozen=True, slots=True)
class ModeEvidence:
    """What was heard that may say who changed a mode, and what its autopilot says has failed."""

    others_orders: tuple[tuple[messages.OrderSeen, float], ...] = ()
    """What other stations ordered lately, or the vehicle accepted, and when."""
    channels_us: tuple[int, ...] = ()
    channels_s: float = LONG_AGO_S
    """When its transmitter's channels came last."""
    switched: tuple[SwitchMove, ...] = ()
    """The last switches that were moved."""
    mode_channel: int | None = None
    """Counted from 1, as its settings say; 0 if it has none."""
    throttle_lost_us: float | None = None
    """Below this the throttle's channel says that the receiver hears no transmitter, as its settings say."""
    recorded: tuple[messages.ModeChange | None, float] = (None, LONG_AGO_S)
    """The autopilot's own record of the last change of mode."""
    critical_s: float = LONG_AGO_S
    """When its HEARTBEAT became critical last."""
    failed: tuple[tuple[messages.OwnFailsafe, float], ...] = ()
    """What it says has failed, the last of each kind, and when."""
    passed: tuple[tuple[messages.OwnFailsafe, float, float], ...] = ()
    """What was over again, the last of each kind, when it was said, and when it was over."""


@dataclass(frozen=True, slots=True)
class Custody:
    """Who has it, and in which silence of its link it may have been taken, or have acted by itself."""

    taken: Takeover | None = None
    cause: ModeCause = ModeCause.OURS
    """Why it is in its mode, as long as it is armed."""
    certain: bool = False
    """Whether no text that may come late can make it anything but a person's."""
    unseen_until_s: float | None = None
    """When its last silence ended with a heartbeat."""
    unseen_from_boot_s: float | None = None
    """By its own clock, when it was seen last before that."""
    beat_boot_s: float | None = None
    """By its own clock, about when its last heartbeat came."""
