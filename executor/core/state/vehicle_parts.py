"""Hold the state of one vehicle in parts; each part is received, decided and reset together."""

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
    """Why a vehicle is in its mode."""

    OURS = "ours"
    """Commanded by us, or the mission on which we started it."""
    MISSION = "mission"
    """The end of its mission."""
    FAILSAFE = "failsafe"
    """Its own failsafe."""
    PERSON = "person"
    """Its pilot, another ground station, or unknown: hands off."""


@dataclass(frozen=True, slots=True)
class Takeover:
    """A vehicle under the control of others."""

    since_s: float
    given_away: bool = False
    """Whether its segments were reassigned."""
    returned_s: float | None = None
    """Since when its pilot has returned it to its mission; None if not."""


@dataclass(frozen=True, slots=True)
class HomingOrder:
    """The command to return or land that a vehicle has to receive and acknowledge."""

    since_s: float
    land: bool = False
    told: bool = False
    """Whether it was commanded, and has not refused since."""
    not_before_s: float = float("-inf")
    """Earliest time of the next command after a refusal."""
    force: bool = False
    """Whether the operator has confirmed taking it from its pilot."""


@dataclass(frozen=True, slots=True)
class PositionFix:
    """A position in the local frame."""

    at_s: float
    """When it was received."""
    boot_s: float
    place_m: tuple[float, float]
    alt_rel_m: float
    alt_msl_m: float
    velocity_m_s: tuple[float, float, float]
    """East, north, up."""
    heading_deg: float | None = None
    reckoned: bool = False
    """Whether it was dead-reckoned, as GPS was lost."""

    def distance_m(self, other: PositionFix) -> float:
        """Return the distance to another position, height included."""
        return math.dist((*self.place_m, self.alt_rel_m), (*other.place_m, other.alt_rel_m))


@dataclass(frozen=True, slots=True)
class Positioning:
    """Whether its positions come from GPS, and the last one that does."""

    fixed: PositionFix | None = None
    """The newest position when GPS last reported a fix; None before the first."""
    lost_s: float | None = None
    """When GPS was reported lost; None while it is not."""
    why: str = ""
    """The evidence for the loss, in words."""
    regained_s: float = float("-inf")
    """When GPS was last regained."""
    fixes: tuple[tuple[int, int], ...] = ()
    """(receiver, GPS_FIX_TYPE) of each receiver's last report."""
    reported_s: float = float("-inf")
    """When a receiver last reported."""
    measured_s: float | None = None
    """Time of its last fix by the first receiver's own clock."""
    accuracy_m: float | None = None
    """Horizontal accuracy of the last fix, as reported by the receiver."""
    adrift_s: float | None = None
    """Since when its estimator reports that its global position is unknown."""
    estimated_s: float = float("-inf")
    """When its estimator last reported."""


@dataclass(frozen=True, slots=True)
class TextWindow:
    """The texts of a vehicle, as far as they decide which are shown."""

    last: tuple[str, float] = ("", float("-inf"))
    """The line last shown, and when it was last received."""
    since_s: float = float("-inf")
    """Start of the present counting window."""
    shown: tuple[int, ...] = (0, 0, 0)
    """Lines of each rank in this window."""
    passed_over: int = 0
    """Texts left out of it for lack of room."""


@dataclass(frozen=True, slots=True)
class OnboardMission:
    """The mission on board, verified by read-back."""

    revision: int
    path: FlightPath
    waypoint_of: tuple[int | None, ...]
    """Mission item to waypoint of the path."""
    visits: tuple[int, ...]
    """All visits of the path in their order; a waypoint's `visit` is an index here."""
    tracks: tuple[Track, ...]
    """The planned line of each visit."""
    places_m: tuple[tuple[float, float], ...]
    """Each waypoint in the local frame."""
    legs: tuple[LegEstimate, ...]
    """The planned time and energy of each leg of the path."""


@dataclass(frozen=True, slots=True)
class LegBoundary:
    """The moment between two legs."""

    at_s: float
    given_pct: float | None
    """Battery charge used so far, in percent; None without a report."""
    modelled_pct: float = 0.0
    """Modelled charge used so far."""


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """A flown leg, with its planned figures."""

    revision: int
    """Revision of the mission on board at its end."""
    waypoint: int
    """The waypoint at its end."""
    phase: Phase
    segment: int | None
    """The segment that it inspects, or leads to."""
    planned: LegEstimate
    began: LegBoundary | None
    """None where it was not received."""
    ended: LegBoundary | None


@dataclass(frozen=True, slots=True)
class LastKnown:
    """A vehicle's progress before a gap in its positions, or before the ground station was away."""

    fix: PositionFix
    waypoint: int
    run: InspectionRun | None
    run_visit: int | None
    remaining_pct: float | None
    until_s: float = float("-inf")
    """Messages later than this are new."""
    factor: float = 1.0
    """Its consumption factor before the gap; consumption within the gap must not judge itself."""


@dataclass(frozen=True, slots=True)
class DeclinedMission:
    """A new mission that could not be uploaded to a vehicle."""

    at_s: float
    """When the upload failed."""
    tries: int
    """Failed uploads in a row."""
    maybe: OnboardMission | None = None
    """The mission it may carry instead of the old one; None where that cannot be."""


@dataclass(frozen=True, slots=True)
class LinkState:
    """When messages arrived, how well, and from which other parties."""

    heard_s: float | None = None
    """When it was last received; moved on by pauses that were not its silence."""
    spoke_s: float | None = None
    """When a message last really arrived."""
    heartbeat_s: float | None = None
    """When its last HEARTBEAT arrived; other messages may come without it, and it without them."""
    regained_s: float | None = None
    """When its last silence ended, with any message."""
    stale: bool = False
    excused_s: float = float("-inf")
    """End of the time in which missing messages are excused: we were not listening, or the whole link was silent."""
    quality: LinkQuality = field(default_factory=LinkQuality)
    strangers: frozenset[messages.StationHeard | messages.StationActed | messages.DoubleHeard] = frozenset()
    """Other ground stations on its link, their blocked actions, and other vehicles with its id."""
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)
    """Whether its positions come from one vehicle."""


@dataclass(frozen=True, slots=True)
class Telemetry:
    """The last reports of its activity."""

    heartbeat: messages.Heartbeat | None = None
    mode_since_s: float = 0.0
    mode_before_s: float | None = None
    """When a HEARTBEAT last showed the previous mode: it changed between the two. None without a previous mode."""
    mode_before: int | None = None
    """The previous mode."""
    critical_since_s: float | None = None
    """Since when its HEARTBEATs report an active failsafe; None if they do not."""
    doubted: tuple[messages.Heartbeat, float] | None = None
    """A HEARTBEAT that reported disarmed in flight, and its time; believed once the next one agrees."""
    item: tuple[int, int | None] | None = None
    """The current mission item as reported, and the total."""
    item_s: float | None = None
    """When it last reported it."""
    on_ground: bool | None = None
    alarm: tuple[str, float] = ("", float("-inf"))
    """Its last text about a failsafe or a crash, and when."""
    texts: TextWindow = field(default_factory=TextWindow)


@dataclass(frozen=True, slots=True)
class Sensors:
    """Sensor readings."""

    gps: messages.Gps | None = None
    positioning: Positioning = field(default_factory=Positioning)
    wind: messages.Wind | None = None
    """As the vehicle measures it."""
    attitude: messages.Attitude | None = None
    tilted_since_s: float | None = None
    """Since when its attitude is one in which no multicopter flies."""
    fence_breached: bool = False
    breached_s: float = float("-inf")
    """When it last reported a breach: RTL may bring it back inside before its mode is received."""
    unhealthy: int = 0
    """MAV_SYS_STATUS_SENSOR bits that are enabled and not healthy."""


@dataclass(frozen=True, slots=True)
class MotionState:
    """Its position and motion."""

    fix: PositionFix | None = None
    last_fix: PositionFix | None = None
    """The position before."""
    anchor: PositionFix | None = None
    """The position when it last advanced, for the stall watchpoint."""
    jump: tuple[float, float] = (0.0, float("-inf"))
    """Distance of its position from the one its velocity predicts, and when."""
    falls_s: float = float("-inf")
    """When it last sank faster than any vehicle lands."""
    climbs_m_s: float = 0.0
    """Climb rate from its heights alone, over some seconds; its reported velocity may be wrong where it matters."""
    sinks_s: float = float("-inf")
    """When it last sank, by its heights."""
    drops_s: float = float("-inf")
    """When it last sank faster than any autopilot touches down."""
    behind_s: float = 0.0
    """Lag of its clock behind ours over gaps in its positions: it paused, or rebooted."""
    fell_back_s: float = float("-inf")
    """When the last such gap ended."""
    reopened: bool = False
    """Whether the ground station was away since its last position: then only its own clock tells for how long."""

    @property
    def stood_s(self) -> float:
        """Time without advancing, by the vehicle's clock; 0 if unknown."""
        return 0.0 if self.fix is None or self.anchor is None else self.fix.boot_s - self.anchor.boot_s


@dataclass(frozen=True, slots=True)
class OwnMission:
    """The mission in its log, for a flight planned by others, and the height its autopilot wants."""

    listed: tuple[MissionItem, ...] = ()
    """Its items by number, as far as received."""
    leads_to: int | None = None
    """The navigation item ahead."""
    came_from: int | None = None
    """The navigation item before it; None if the leg did not begin there."""
    leg_from: PositionFix | None = None
    """Its position when the leg began."""
    below_m: float = 0.0
    """Its distance below the height its autopilot wants."""
    below_s: float = float("-inf")
    """When it last reported that."""


TOUCHDOWN_PCT = 1.0
"""Largest drop of the charge between the last report in the air and the first on the ground, where the landing was
received."""


@dataclass(frozen=True, slots=True)
class PowerState:
    """Battery reports and what follows from them."""

    battery: BatteryState = field(default_factory=BatteryState)
    packs: tuple[tuple[int, float], ...] = ()
    """The last report of each battery, in percent, by its id."""
    roundings: PercentRounding = field(default_factory=PercentRounding)
    """PX4's two ways of reporting its percentage."""
    volts: VoltageState = field(default_factory=VoltageState)
    battery_faults: int = 0
    """MAV_BATTERY_FAULT bits of its last report."""
    pack: PackState = field(default_factory=PackState)
    """The pack's condition by its voltage and parameters."""
    told_s: float = float("-inf")
    """When BATTERY_STATUS last arrived; SYS_STATUS has fewer fields, encoded differently."""
    began_pct: float | None = None
    """Charge at its last take-off."""
    aloft_pct: float | None = None
    """Charge last reported in the air; PX4's simulated pack is full again as soon as it disarms."""

    @property
    def landed_pct(self) -> float | None:
        """Charge at landing; the present one if none was reported in the air, or charge was lost unobserved since."""
        aloft_pct, now_pct = self.aloft_pct, self.battery.remaining_pct
        if aloft_pct is None or (now_pct is not None and now_pct < aloft_pct - TOUCHDOWN_PCT):
            return now_pct
        return aloft_pct


@dataclass(frozen=True, slots=True)
class Assignment:
    """The mission on board, and the progress on it."""

    board: OnboardMission | None = None
    waypoint: int = 0
    """The waypoint at the end of the present leg, as the vehicle reports it."""
    fix_waypoint: int | None = None
    """The same when its newest position arrived; after a silence either may arrive first."""
    run: InspectionRun | None = None
    run_visit: int | None = None
    """The visit that `run` belongs to."""
    runs_broken: tuple[tuple[int, str], ...] = ()
    """(segment, reason) of inspections that do not count."""
    owed: tuple[int, str] | None = None
    """(visit, reason) of an inspection that broke, until it is certain that it does not count."""
    before: LastKnown | None = None
    """Its progress before a time without contact, until that time has been judged."""
    carried: MissionOwnership = field(default_factory=MissionOwnership)
    fence: Fence | None = None
    """The fence on board, of those we uploaded; during the upload of a wider one, the narrower."""
    pending: int | None = None
    """The revision of the mission being uploaded."""
    sent_path: FlightPath | None = None
    """A new mission it may be flying instead, where vehicles leave their layers: sent, and not certainly refused."""
    stubborn: bool = False
    """Whether a new mission could not be uploaded: the plan works around it."""
    declined: DeclinedMission | None = None
    """That mission, until an upload succeeds."""
    failures: int = 0
    """Failed starts and uploads since the last success."""
    leg_began: LegBoundary | None = None
    """Start of the present leg; None before take-off and after landing."""
    flown: tuple[FlownLeg, ...] = ()
    """Flown legs, of all its missions."""
    learned: LearnedFactors | None = None
    """Factors learned from them; None before the first."""

    @property
    def pace(self) -> Pace:
        """The factors on its leg times learned in this flight."""
        return AS_MODELLED if self.learned is None else self.learned.pace


@dataclass(frozen=True, slots=True)
class YieldState:
    """A vehicle that flies slowly to yield to another's climb."""

    since_s: float
    told_s: float
    """When a speed was last commanded."""
    followed: bool = False
    """Whether it has been seen slow since."""
    over_s: float | None = None
    """Since when its leg's speed is being restored."""
    leg: int | None = None
    """The waypoint ahead at that time."""


FOLLOWED_LATE_S = 120.0
"""Longest delay until a command takes effect or is answered: a radio queues it, or only the answers were lost."""
CLEARED_S = 120.0
"""Longest age of the crew's clearance of a pad at the take-off."""
PLANNED_WITHIN_S = 60.0
"""Longest age of a clearance to plan with: a mission has to be built and uploaded while it is valid."""


@dataclass(frozen=True, slots=True)
class Orders:
    """Commands to the vehicle, and the crew's intents for it."""

    ordered_mode_s: float = float("-inf")
    """When we last commanded a change of mode."""
    ordered_modes: frozenset[int] = frozenset()
    """The modes that result from that command."""
    held_s: float | None = None
    """Since when it holds on the operator's intent; None if it does not."""
    hold_asked_s: float = float("-inf")
    """When a hold was last commanded without a resume since; it may take effect late."""
    gives_way: YieldState | None = None
    gave_way_s: float = float("-inf")
    """When it last yielded; its leg times do not show its pace then."""
    excluded: bool = False
    """Whether the operator took it out of the plan: it gets no segments until it is included."""
    lands: bool = False
    """Whether the operator ordered it to land in place."""
    errand: HomingOrder | None = None
    cleared_s: float | None = None
    """When the crew cleared it for another take-off; None if not cleared, or already in the air."""
    start_owed_s: float | None = None
    """When its start failed for want of a position; it is repeated once it reports one."""
    start_let_go: bool = False
    """Whether its start was abandoned because its mode was changed by others: nothing follows it up, and its end is
    ignored."""
    streams_asked_s: float = float("-inf")
    """When missing streams were last requested again."""
    stream_step: int = 0
    """Smallest number of steps by which its streams are thinned, for its radio's load."""


@dataclass(frozen=True, slots=True)
class SortieProgress:
    """Observations since its last start."""

    armed_once: bool = False
    disarmed_s: float = float("-inf")
    """When it was first received disarmed after being armed."""
    took_off: bool = False
    """Whether it was received in the air since its last start."""
    flew_mission: bool = False
    """Whether it was in mission mode in the air since its last start."""
    away_once: bool = False
    """Whether it was seen away from its pad since its last start."""
    rebooted_s: float | None = None
    """When its clock was found to have restarted, since its last start."""
    left_s: float | None = None
    """When it left its mission to return."""
    place_told: bool = False
    """Whether its position on the ground was reported to the crew."""


@dataclass(frozen=True, slots=True)
class PlannedSortie:
    """A sortie planned for a vehicle in the day's plan."""

    visits: tuple[int, ...]
    """Visits of the network in order."""
    start_s: float
    """Planned take-off, counted from the first one of the day."""
    base: str = ""
    """Base of its start; empty where all sorties of the vehicle begin and end at one base."""
    lands: str = ""
    """The base where it ends."""


@dataclass(frozen=True, slots=True)
class FlownSortie:
    """A sortie from take-off to landing."""

    number: int
    """Of this vehicle, from 1."""
    pack: str
    """Id of the pack as entered by the crew; empty if none."""
    began_s: float
    began_pct: float | None
    """As reported by the vehicle."""
    rest_v: float | None
    """Rest voltage of the pack before it."""
    before: tuple[int, ...] = ()
    """Segments the vehicle had inspected before it."""
    ended_s: float | None = None
    """None for the one under way."""
    ended_pct: float | None = None
    end_v: float | None = None
    """Voltage of the pack at its end, recovered to rest where known."""
    cells: int | None = None
    base: str = ""
    """Base of its start; empty for the vehicle's own of the day."""
    lands: str = ""
    """Base of its actual or planned end; empty for the one of its start."""


@dataclass(frozen=True, slots=True)
class Turnaround:
    """A vehicle's turnarounds at its base, and its sorties."""

    label: str = ""
    """Label of the pack in the vehicle, as entered by the crew."""
    swaps: int = 0
    """Number of pack changes the crew has reported."""
    overstated_pct: float = 0.0
    """Percentage that it reports above the pack's real content, by the rest voltage."""
    asked_s: float | None = None
    """Start of its turnaround, on the crew's intent; None outside one."""
    intent: str = ""
    """Id of that intent."""
    ready_s: float | None = None
    """Since when its checks have passed and it waits for its sortie."""
    ahead: tuple[PlannedSortie, ...] = ()
    """The sorties planned for it after its present mission."""
    beyond: frozenset[int] = frozenset()
    """Open segments none of which it could fly even with a good pack."""
    sorties: tuple[FlownSortie, ...] = ()
    """Its sorties, the one under way last."""
    base: str = ""
    """Base where it stands or took off; empty for its own of the day."""
    lands_at: str = ""
    """Base where its present or next mission ends; empty for the one of its take-off."""
    moved: bool = False
    """Whether it stands at another base than when its parameters were checked."""


LONG_AGO_S = float("-inf")


@dataclass(frozen=True, slots=True)
class SwitchMove:
    """A switch move on the pilot's transmitter, between two reports of its channel."""

    channel: int
    was_us: int
    now_us: int
    from_s: float
    to_s: float


@dataclass(frozen=True, slots=True)
class ModeEvidence:
    """Evidence of which party changed a mode, and the failures its autopilot reports."""

    others_orders: tuple[tuple[messages.OrderSeen, float], ...] = ()
    """Commands of other stations seen or accepted recently, and when."""
    channels_us: tuple[int, ...] = ()
    channels_s: float = LONG_AGO_S
    """When the transmitter's channels last arrived."""
    switched: tuple[SwitchMove, ...] = ()
    """The last switch moves."""
    mode_channel: int | None = None
    """Counted from 1, by its parameters; 0 if it has none."""
    throttle_lost_us: float | None = None
    """Throttle channel value below which the receiver has lost the transmitter, by its parameters."""
    recorded: tuple[messages.ModeChange | None, float] = (None, LONG_AGO_S)
    """The autopilot's own record of the last mode change."""
    critical_s: float = LONG_AGO_S
    """When its HEARTBEAT last became critical."""
    failed: tuple[tuple[messages.OwnFailsafe, float], ...] = ()
    """The failures it reports, the last of each kind, and when."""
    passed: tuple[tuple[messages.OwnFailsafe, float, float], ...] = ()
    """Failures that are over, the last of each kind, when reported, and when over."""


@dataclass(frozen=True, slots=True)
class Custody:
    """Which party controls it, and the silence in which it may have been taken over or acted by itself."""

    taken: Takeover | None = None
    cause: ModeCause = ModeCause.OURS
    """The cause of its present mode, while armed."""
    certain: bool = False
    """Whether no late text can still show that a person changed it."""
    unseen_until_s: float | None = None
    """When a HEARTBEAT ended its last silence."""
    unseen_from_boot_s: float | None = None
    """When it was last received before that, by the vehicle's clock."""
    beat_boot_s: float | None = None
    """Approximate time of its last HEARTBEAT, by the vehicle's clock."""
