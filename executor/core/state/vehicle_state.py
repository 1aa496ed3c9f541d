"""Hold the state of one vehicle: its stage, its fault, and the parts of its state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Generic, ParamSpec, TypeVar

from executor.core.battery import account
from executor.core.context import Context, Scene, VehicleSetup
from executor.core.interface.codes import ReasonCode
from executor.core.interface.messages import CRITICAL
from executor.core.payload.camera_state import PayloadState
from executor.core.state import vehicle_parts
from executor.core.state.inspection_proof import SLOWED_GAP_S, Track
from executor.core.state.mission_ownership import MissionOwnership
from missions import FlightPath, Phase, Waypoint, encode, estimate
from planner import segment_of

Whole = TypeVar("Whole")
Fields = ParamSpec("Fields")


class PartUpdate(Generic[Fields]):
    """A method of a dataclass that replaces fields of one of its parts, as two calls of `replace`.

    `with_orders = PartUpdate(Orders)` makes `vehicle.with_orders(held_s=None)`; every field of the part has a default.
    """

    def __init__(self, part: Callable[Fields, object]) -> None:
        """Take the part's dataclass: its fields are the arguments, and type checkers hold callers to them."""

    def __set_name__(self, owner: type, name: str) -> None:
        """Derive the part's name from the method's name."""
        self.part = name.removeprefix("with_")

    def __get__(self, whole: Whole, owner: type | None = None) -> Callable[Fields, Whole]:
        """Return the bound method of an object."""

        def update(*_: Fields.args, **fields: Fields.kwargs) -> Whole:
            part = replace(getattr(whole, self.part), **fields)
            changed: Whole = replace(whole, **{self.part: part})  # type: ignore[type-var]
            return changed

        return update


class Stage(Enum):
    """The stage of a vehicle in its flight."""

    GROUND = "ground"
    """Before its start, or with nothing to do."""
    STARTING = "starting"
    FLYING = "flying"
    """On its mission."""
    RETURNING = "returning"
    """Returning or landing, and not to fly its mission again."""
    PILOT = "pilot"
    """With its pilot, or with another ground station: not commanded from here."""
    LANDED = "landed"
    DOWN = "down"
    """On the ground at the wrong place or time, or in a wrong attitude."""
    LOST = "lost"
    """Without contact for longer than its link time-out."""

    __hash__ = object.__hash__
    """Every step looks stages up for every vehicle; an Enum's own hash is computed in Python from its name."""


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
"""The transitions between stages. A vehicle at fault never flies its mission again. One that has landed and is taken
back into the plan with another battery is on the ground as before its start; one that its pilot has returned flies
on."""


WATCHED = frozenset({(Stage.GROUND, Stage.FLYING), (Stage.LANDED, Stage.FLYING), (Stage.LOST, Stage.FLYING)})
"""Further transitions of a flight that is only watched, where others start vehicles and no RTL follows a silence."""


class FaultKind(Enum):
    """The kind of a fault."""

    LINK = "link"
    BATTERY = "battery"
    INTERRUPTION = "interruption"
    FENCE = "fence"
    """It is outside its fence."""
    OPERATOR = "operator"
    """On the operator's intent."""
    PAYLOAD = "payload"
    """Its cameras, or its gimbal."""
    DOWN = "down"
    """On the ground at the wrong place or time, or in a wrong attitude."""


class FaultCode(ReasonCode):
    """The finding: finer than the kind, with its meaning."""

    LINK_LOST = "link_lost", "Nothing was received for the link time-out."
    HEARTBEAT_LOST = "heartbeat_lost", "No HEARTBEAT while other messages come."
    POSITION_LOST = "position_lost", "No position while other messages come."
    ITEM_LOST = "item_lost", "No current waypoint while other messages come."
    BATTERY_REPORT_LOST = "battery_report_lost", "No battery report while other messages come."
    BATTERY_STEP = "battery_step", "Much charge was lost at once."
    VOLTAGE_STEP = "voltage_step", "The voltage fell at once by more than the load explains."
    CELL_WEAK = "cell_weak", "A cell is near its end, or far below the others."
    BATTERY_CRITICAL = "battery_critical", "The autopilot reports its battery critical, failed or unhealthy."
    BATTERY_FAILSAFE = "battery_failsafe", "The autopilot says that its battery failsafe acts."
    BATTERY_PLUNGE = "battery_plunge", "Far more is used than is usual."
    BATTERY_DRIFT = "battery_drift", "More is used than is usual, for a while."
    PACK_SHORT = "pack_short", "By its resting voltage its pack holds much less than it reports."
    BATTERY_LOW = "battery_low", "It would land below its reserve."
    DISARMED = "disarmed", "It disarmed where, or when, it should not have."
    CRASHED = "crashed", "Its autopilot says that it has crashed, or it lies as none flies."
    FALLING = "falling", "It falls."
    SINKING = "sinking", "It sinks far below what its mission asks."
    THRUST_LOST = "thrust_lost", "It sinks though its autopilot wants to be higher."
    TERMINATED = "terminated", "Its HEARTBEAT reports an emergency or flight termination."
    POSITION_JUMP = "position_jump", "Its position jumped."
    MODE_CHANGED = "mode_changed", "It left its mission by its own failsafe."
    FENCE_BREACHED = "fence_breached", "It is outside its fence: its autopilot says so, or its position shows it."
    STALL = "stall", "It does not move on its mission."
    DOWN = "down", "It is on the ground where, or as, it should not be."
    NOT_STARTED = "not_started", "It could not be started."
    MISSION_FOREIGN = "mission_foreign", "After an absence it cannot be left on the mission that it carries."
    MISSION_MIXED = "mission_mixed", "Its mission on board is a mix of two."
    OPERATOR_LAND = "operator_land", "An operator's intent had it land."
    CAMERA_SILENT = "camera_silent", "A camera takes no pictures where it should, and says nothing."
    CAMERA_MUTE = "camera_mute", "The autopilot triggers a camera that does not say that it took a picture."
    CARD_FULL = "card_full", "A camera has no room for pictures, or says that it cannot take them."
    GIMBAL_STUCK = "gimbal_stuck", "The gimbal does not point where it should."
    OPERATOR_EXCLUDE = "operator_exclude", "An operator's intent took it out of the plan."


SINKS = frozenset({FaultCode.FALLING, FaultCode.SINKING, FaultCode.THRUST_LOST})
"""Faults of a vehicle that cannot hold its height."""


@dataclass(frozen=True, slots=True)
class Fault:
    """The decision that a vehicle will not finish its route."""

    kind: FaultKind
    reason: str
    detected_s: float
    code: FaultCode


IN_THE_AIR = frozenset({Stage.FLYING, Stage.RETURNING, Stage.PILOT})


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The state of one vehicle."""

    name: str
    stage: Stage = Stage.GROUND
    fault: Fault | None = None
    watches: tuple[tuple[str, float], ...] = ()
    """Failing watchpoints, and since when."""
    link: vehicle_parts.LinkState = field(default_factory=vehicle_parts.LinkState)
    telemetry: vehicle_parts.Telemetry = field(default_factory=vehicle_parts.Telemetry)
    sensors: vehicle_parts.Sensors = field(default_factory=vehicle_parts.Sensors)
    motion: vehicle_parts.MotionState = field(default_factory=vehicle_parts.MotionState)
    power: vehicle_parts.PowerState = field(default_factory=vehicle_parts.PowerState)
    assignment: vehicle_parts.Assignment = field(default_factory=vehicle_parts.Assignment)
    orders: vehicle_parts.Orders = field(default_factory=vehicle_parts.Orders)
    sortie: vehicle_parts.SortieProgress = field(default_factory=vehicle_parts.SortieProgress)
    custody: vehicle_parts.Custody = field(default_factory=vehicle_parts.Custody)
    evidence: vehicle_parts.ModeEvidence = field(default_factory=vehicle_parts.ModeEvidence)
    payload: PayloadState = field(default_factory=PayloadState)
    turn: vehicle_parts.Turnaround = field(default_factory=vehicle_parts.Turnaround)
    own: vehicle_parts.OwnMission = field(default_factory=vehicle_parts.OwnMission)

    with_link = PartUpdate(vehicle_parts.LinkState)
    with_telemetry = PartUpdate(vehicle_parts.Telemetry)
    with_motion = PartUpdate(vehicle_parts.MotionState)
    with_power = PartUpdate(vehicle_parts.PowerState)
    with_assignment = PartUpdate(vehicle_parts.Assignment)
    with_orders = PartUpdate(vehicle_parts.Orders)
    with_sortie = PartUpdate(vehicle_parts.SortieProgress)
    with_custody = PartUpdate(vehicle_parts.Custody)
    with_turn = PartUpdate(vehicle_parts.Turnaround)

    @property
    def airborne(self) -> bool:
        """Whether it is in the air, as far as known."""
        return self.stage in IN_THE_AIR or (self.stage is Stage.STARTING and self.armed)

    @property
    def is_on_base(self) -> bool:
        """Whether it is on the ground where it may take off, as far as known."""
        return self.stage is Stage.GROUND or self.stage is Stage.LANDED

    @property
    def is_at_rest(self) -> bool:
        """Whether it is on the ground, on its base or elsewhere."""
        return self.is_on_base or self.stage is Stage.DOWN

    @property
    def is_pulled_out(self) -> bool:
        """Whether it is at fault, or the operator took it out of the plan."""
        return self.fault is not None or self.orders.excluded

    @property
    def armed(self) -> bool:
        """Whether its last HEARTBEAT reported it armed."""
        return self.telemetry.heartbeat is not None and self.telemetry.heartbeat.armed

    @property
    def mode(self) -> int | None:
        """The mode in its last HEARTBEAT; None before the first."""
        return None if self.telemetry.heartbeat is None else self.telemetry.heartbeat.custom_mode

    @property
    def is_critical(self) -> bool:
        """Whether its last HEARTBEAT reported an active failsafe."""
        return self.telemetry.heartbeat is not None and self.telemetry.heartbeat.system_status >= CRITICAL

    @property
    def is_under_foreign_control(self) -> bool:
        """Whether a person controls it, or may: nothing is commanded then."""
        return self.custody.taken is not None or (self.armed and self.custody.cause is vehicle_parts.ModeCause.PERSON)

    @property
    def leg(self) -> Waypoint | None:
        """The waypoint ahead."""
        board, waypoint = self.assignment.board, self.assignment.waypoint
        return None if board is None or waypoint >= len(board.path.waypoints) else board.path.waypoints[waypoint]

    def remaining_visits(self) -> tuple[int, ...]:
        """Return the visits of its mission not known to be passed, the one under way included."""
        board, before = self.assignment.board, self.assignment.before
        if board is None:
            return ()
        passed = self.assignment.waypoint if before is None else min(before.waypoint, self.assignment.waypoint)
        ahead = {waypoint.visit for waypoint in board.path.waypoints[passed:]}
        return tuple(visit for index, visit in enumerate(board.visits) if index in ahead)


def change_stage(
    state: VehicleState, stage: Stage, *, besides: frozenset[tuple[Stage, Stage]] = frozenset()
) -> VehicleState:
    """Return the vehicle in another stage, otherwise unchanged.

    Args:
        state: The vehicle.
        stage: The new stage.
        besides: Transitions allowed beside the table's.

    Raises:
        ValueError: the table has no such transition; the caller is wrong.
    """
    if stage is state.stage:
        return state
    if stage not in TRANSITIONS[state.stage] and (state.stage, stage) not in besides:
        raise ValueError(f"{state.name}: {state.stage.value} cannot become {stage.value}")
    return replace(state, stage=stage)


def is_slowed_by_us(state: VehicleState, now_s: float) -> bool:
    """Return whether streams are slow because a mission is, or just was, uploaded over a telemetry radio.

    The upload takes part of the radio's capacity, and ArduPilot then sends everything at a quarter of its rate.
    """
    known = state.assignment
    loads = known.pending is not None or now_s - known.carried.ours_s <= SLOWED_GAP_S
    return loads and state.link.quality.radio is not None


def suppose_lost(state: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle as if lost, to compute the effect of its loss; no vehicle ever takes this state."""
    return replace(state, stage=Stage.LOST, fault=Fault(FaultKind.LINK, "what if", now_s, FaultCode.LINK_LOST))


def last_known_of(vehicle: VehicleState, until_s: float = float("-inf")) -> vehicle_parts.LastKnown | None:
    """Return the last reported progress of a vehicle on its mission; None if it is on none.

    Args:
        vehicle: The vehicle, without messages from after a gap.
        until_s: Messages later than this are new.
    """
    known, fix = vehicle.assignment, vehicle.motion.fix
    if vehicle.stage not in {Stage.STARTING, Stage.FLYING} or fix is None or known.board is None:
        return None
    waypoint = known.waypoint if known.fix_waypoint is None else known.fix_waypoint
    battery = vehicle.power.battery
    return vehicle_parts.LastKnown(
        fix, waypoint, known.run, known.run_visit, battery.remaining_pct, until_s, account.consumption_factor(battery)
    )  # fmt: skip


def apply_onboard_mission(vehicle: VehicleState, board: vehicle_parts.OnboardMission, now_s: float) -> VehicleState:
    """Return a vehicle with another mission of ours on board.

    The run of a visit that is no longer in its place ends, as an upload may take longer than expected. A gap that has
    not been judged yet belongs to the old mission.
    """
    old = vehicle.assignment

    def stays(visit: int | None) -> bool:
        return visit is None or (old.board is not None and board.tracks[visit:][:1] == old.board.tracks[visit:][:1])

    run, run_visit = (old.run, old.run_visit) if stays(old.run_visit) else (None, None)
    owed = old.owed if old.owed is not None and stays(old.owed[0]) else None
    assignment = replace(
        old, pending=None, sent_path=None, board=board, run=run, run_visit=run_visit, owed=owed, before=None,
        stubborn=False, declined=None, carried=MissionOwnership(ours_s=now_s),
    )  # fmt: skip
    return replace(vehicle, assignment=assignment)


def build_onboard_mission(
    context: Context, name: str, revision: int, path: FlightPath, visits: tuple[int, ...]
) -> vehicle_parts.OnboardMission:
    """Return the mission a vehicle carries once `path` has been uploaded and read back."""
    places = tuple(context.frame.to_local_m(waypoint.lat_deg, waypoint.lon_deg) for waypoint in path.waypoints)
    pylons = context.setup.looks.pylons
    # A leg marked as the inspection of a visit begins where the leg before it ends.
    tracks = tuple(
        Track(segment := segment_of(visits[waypoint.visit]), places[index - 1], places[index], segment in pylons)
        for index, waypoint in enumerate(path.waypoints)
        if waypoint.phase is Phase.INSPECT and waypoint.visit is not None
    )
    encoded = encode(path, context.vehicles[name].dialect)
    legs = estimate(path, context.pricing.models[name]).legs
    return vehicle_parts.OnboardMission(revision, path, encoded.waypoint_of, visits, tracks, places, legs)


def current_setup_of(context: Scene, vehicle: VehicleState) -> VehicleSetup:
    """Return the setup of a vehicle, with the overstated part of its percentage added to its reserve."""
    setup, turn = context.vehicles[vehicle.name], vehicle.turn
    if turn.swaps == 0:
        return setup
    setup = setup.with_pack(turn.label)
    if turn.overstated_pct > 0.0:
        return replace(setup, reserve_pct=setup.reserve_pct + turn.overstated_pct)
    return setup
