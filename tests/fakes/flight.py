"""A whole flight in the core's own terms: vehicles that fly their paths exactly, and every command carried out.

There is no link, no thread and no clock: a story is a row of events with explicit times. What a command leads to, and
how long that takes, is written here, and a test may change it.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.codes import Ending
from executor.core.interface.commands import (
    AskStreams,
    CancelSolve,
    ChangeSpeed,
    Command,
    Compose,
    Disarm,
    Finish,
    HandsOff,
    Hold,
    LandNow,
    Level,
    ReadMission,
    Resume,
    Say,
    SendHome,
    Solve,
    Start,
    Upload,
)  # fmt: skip
from executor.core.interface.events import (
    Event,
    Found,
    Heard,
    IntentReceived,
    LaunchOrdered,
    Match,
    MissionRead,
    MissionsWanted,
    OrderEnded,
    ReturnEnded,
    SolveEnded,
    StartEnded,
    Tick,
    UploadEnded,
)  # fmt: skip
from executor.core.interface.intents import Action, Intent, IntentRecord
from executor.core.interface.messages import Battery, FlightMessage, Heartbeat, MissionCurrent, Position
from executor.core.interface.ports import EventSink
from executor.core.resume.reconciliation import compare_onboard_mission
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import FlightPath, Phase, encode
from scripts.pages.stage_flags import find_flag_breaches
from tests.fakes.solver import Answer, share_out
from tests.missions.builders import arrival_seq

STEP_S = 0.4
HOLD_S = 1.0


@dataclass(slots=True)
class Craft:
    """One vehicle as it really is."""

    context: Context
    name: str
    place_m: tuple[float, float]
    up_m: float = 0.0
    armed: bool = False
    mode: int = 0
    failsafe: bool = False
    """One of its own acts: its heartbeats are critical."""
    leg: int = 0
    """The waypoint that it flies to."""
    wait_s: float = 0.0
    battery_pct: float = 100.0
    consumption: float = 1.0
    """What it uses relative to the energy model."""
    speed: float = 1.0
    """How fast it flies relative to what was asked for."""
    told_m_s: float | None = None
    """A speed that it was told on this leg; the next one with another speed, or mode, forgets it."""
    aside_m: float = 0.0
    """How far north of where it should be it flies."""
    said_leg: int = -1
    """The leg that it reported last: at every change, and once a second."""
    mute: bool = False
    """It is not heard, nor does it hear."""
    stopped: set[type] = field(default_factory=set)
    """Kinds of messages that do not come any more."""
    counts: bool = False
    """It says how many items it carries."""
    total: int | None = None
    foreign: int | None = None
    alike: int | None = None
    """Of its items, from the first on, that are ours, once another station has put as many on board."""
    unreadable: bool = False
    """How many items another station has put on board."""
    mission_id: int | None = None
    stuck: bool = False
    """It does not move any more, whatever it says."""
    asked_again: int = 0
    """How often it was asked for its streams again."""
    climbs_m_s: float = 0.0
    """How fast it climbs to the height of its return before it comes home; 0 if it does not."""
    deaf_to_speeds: bool = False
    """No speed that it is told arrives."""
    stubborn: bool = False
    """It acknowledges a return and goes on."""
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    path: FlightPath | None = None
    goals_m: list[tuple[float, float, float]] = field(default_factory=list)
    items: list[int] = field(default_factory=list)
    """The item that is reached with each waypoint."""

    def load(self, path: FlightPath) -> None:
        """Take a mission on board; the index stays as it is."""
        frame, mission = self.context.frame, encode(path, self.context.vehicles[self.name].dialect)
        self.path = path
        self.goals_m = [(*frame.to_local_m(at.lat_deg, at.lon_deg), at.alt_rel_m) for at in path.waypoints]
        home = self.context.vehicles[self.name].dialect.current_counts_home
        self.total = len(mission.items) - home if self.counts else None
        self.items = [arrival_seq(mission, index) for index in range(len(path.waypoints))]

    def begin(self) -> None:
        """Take off with the mission on board."""
        self.armed, self.leg, self.wait_s = True, 0, 0.0
        self.mode = self.context.vehicles[self.name].dialect.modes.mission.custom_mode

    def go_home(self) -> None:
        """Fly straight home and land."""
        self.go_to(self.context.vehicles[self.name].dialect.modes.return_home.custom_mode)

    def go_to(self, mode: int) -> None:
        """Change the mode."""
        self.mode, self.told_m_s = mode, None

    def advance(self, step_s: float) -> None:
        """Fly on."""
        self.velocity_m_s = (0.0, 0.0, 0.0)
        if not self.armed or self.stuck:
            return
        modes = self.context.vehicles[self.name].dialect.modes
        if self.mode == modes.return_home.custom_mode:
            self._home(step_s)
        elif self.mode == modes.land.custom_mode:
            if self._toward((*self.place_m, 0.0), 1.0, step_s):
                self.armed = False
        elif self.mode == modes.mission.custom_mode and self.path is not None:
            self._on_path(step_s)
        self.battery_pct -= self.consumption * self.context.draw_pct_per_s(*self.velocity_m_s[:2]) * step_s

    def _on_path(self, step_s: float) -> None:
        assert self.path is not None
        if self.wait_s > 0.0:
            self.wait_s -= step_s
            return
        point = self.path.waypoints[self.leg]
        speed_m_s = self._landing_m_s() if point.phase is Phase.LAND else self.told_m_s or point.speed_m_s
        if not self._toward(self.goals_m[self.leg], speed_m_s * self.speed, step_s):
            return
        self.wait_s = HOLD_S if point.hold else 0.0
        if self.leg + 1 < len(self.path.waypoints):
            self.leg += 1
            self.told_m_s = self.told_m_s if self.path.waypoints[self.leg].speed_m_s == point.speed_m_s else None
        else:
            self.armed = False

    def _landing_m_s(self) -> float:
        """Return how fast it comes down so that its landing takes as long as those of its autopilot."""
        drop_m = self.goals_m[-2][2]
        return float(drop_m / self.context.pricing.models[self.name].performance.landing_s(np.array(drop_m)))

    def _home(self, step_s: float) -> None:
        pad, top_m = self.context.vehicles[self.name].pad_m, self.context.return_height_m(self.name)
        if math.dist(self.place_m, pad) > 0.1 and self.climbs_m_s and self.up_m < top_m:
            self._toward((*self.place_m, top_m), self.climbs_m_s, step_s)
        elif math.dist(self.place_m, pad) > 0.1:
            self._toward((*pad, self.up_m), 8.0, step_s)
        elif self._toward((*pad, 0.0), 1.0, step_s):
            self.armed = False

    def _toward(self, goal_m: tuple[float, float, float], speed_m_s: float, step_s: float) -> bool:
        here = (*self.place_m, self.up_m)
        away = math.dist(here, goal_m)
        share = 1.0 if away <= speed_m_s * step_s else speed_m_s * step_s / away
        moved = tuple(a + (b - a) * share for a, b in zip(here, goal_m, strict=True))
        self.velocity_m_s = (
            (moved[0] - here[0]) / step_s,
            (moved[1] - here[1]) / step_s,
            (moved[2] - here[2]) / step_s,
        )
        self.place_m, self.up_m = (moved[0], moved[1]), moved[2]
        return share == 1.0

    def position(self, now_s: float) -> Position:
        """What it says of its place."""
        lat, lon = self.context.frame.to_wgs84_deg(self.place_m[0], self.place_m[1] + self.aside_m)
        home_alt_m = self.context.setup.pad_of(self.name).alt_m
        east, north, up = self.velocity_m_s
        return Position(now_s, lat, lon, home_alt_m + self.up_m, self.up_m, north, east, -up, None)

    def heartbeat(self) -> Heartbeat:
        """What it says of itself."""
        return Heartbeat(
            self.context.vehicles[self.name].dialect.number, self.mode, self.armed, 5 if self.failsafe else 4
        )

    def battery(self) -> Battery:
        """What it says of its battery, in whole percents as autopilots do."""
        return Battery(0, float(round(self.battery_pct)), 16.6, None, None, 1, 0)

    def current(self) -> MissionCurrent:
        """The item that it flies to."""
        return MissionCurrent(self.items[self.leg], self.foreign or self.total, self.mission_id)


Later = Callable[[], Event | None]


@dataclass(slots=True)
class Story:
    """Drives `fleet_step.step` through a flight."""

    context: Context
    boards: dict[str, OnboardMission | None]
    answer: Answer = share_out
    solve_s: float = 0.4
    upload_s: float = 0.6
    sink: EventSink | None = None
    start_results: dict[str, list[StartEnded]] = field(default_factory=dict)
    """What becomes of a vehicle's starts, in turn; then they succeed."""
    upload_results: dict[str, list[UploadEnded]] = field(default_factory=dict)
    """What becomes of a vehicle's uploads, in turn; then they succeed."""
    return_results: dict[str, list[ReturnEnded]] = field(default_factory=dict)
    """What becomes of a vehicle's orders to return, in turn; then they are followed."""
    start_s: dict[str, float] = field(default_factory=dict)
    """How long a vehicle's first start takes; others take two seconds."""
    now_s: float = 10.0
    state: FleetState = field(init=False)
    crafts: dict[str, Craft] = field(init=False)
    commands: list[tuple[float, Command]] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)
    over: bool = False
    ticking: bool = True
    _due: list[tuple[float, int, Later]] = field(default_factory=list)
    _count: int = 0
    _talk: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Put everybody on the pad."""
        self.state = fleet_step.build_initial_state(self.boards)
        self.crafts = {name: Craft(self.context, name, self.context.vehicles[name].pad_m) for name in self.boards}
        for name, board in self.boards.items():
            if board is not None:
                self.crafts[name].load(board.path)

    def happen(self, event: Event) -> None:
        """Apply an event now, and carry out what is decided."""
        if self.sink is not None:
            self.sink.write(event, self.now_s)
        self.events.append((self.now_s, event))
        before = self.state
        self.state, decided = fleet_step.step(self.context, before, event, self.now_s)
        for name, vehicle in self.state.vehicles.items():
            if vehicle is not before.vehicles[name]:
                assert not list(find_flag_breaches(before.vehicles[name], vehicle)), event
        for command in decided:
            self.commands.append((self.now_s, command))
            self._carry_out(command)

    def launch(self) -> None:
        """Hear everybody once, then start."""
        self._hear()
        self.happen(LaunchOrdered())

    def run(self, until: Callable[[], bool], limit_s: float = 1500.0) -> float:
        """Live until a condition holds, or the flight is over; returns when that was."""
        end_s = self.now_s + limit_s
        while not until():
            assert self.now_s < end_s, f"it never came true: {self.said()[-5:]}"
            assert not self.over, f"the flight ended before: {self.said()[-5:]}"
            self.step()
        return self.now_s

    def finish(self) -> None:
        """Live until the flight is over."""
        end_s = self.now_s + 1500.0
        while not self.over:
            assert self.now_s < end_s, f"it never ended: {self.said()[-5:]}"
            self.step()

    def pass_s(self, seconds: float) -> None:
        """Live on for a while."""
        end_s = self.now_s + seconds
        while self.now_s < end_s - 1e-9 and not self.over:
            self.step()

    def sleep_s(self, seconds: float) -> None:
        """Let the vehicles live on while the ground station does nothing at all."""
        for _ in range(round(seconds / STEP_S)):
            for craft in self.crafts.values():
                craft.advance(STEP_S)
        self.now_s += seconds

    def step(self) -> None:
        """Live for one step: the vehicles fly, speak, and are looked at."""
        self.now_s = round(self.now_s + STEP_S, 6)
        while self._due and self._due[0][0] <= self.now_s:
            event = heapq.heappop(self._due)[2]()
            if event is not None:
                self.happen(event)
        for craft in self.crafts.values():
            craft.advance(STEP_S)
        self._hear()
        if self.ticking:
            self.happen(Tick())

    def vehicle(self, name: str) -> VehicleState:
        """What is known of a vehicle."""
        return self.state.vehicles[name]

    def stage(self, name: str) -> Stage:
        """Where a vehicle is taken to be."""
        return self.state.vehicles[name].stage

    def inspecting(self, name: str, segment: int) -> bool:
        """Whether a vehicle is really on its way along a segment, half of it behind it."""
        craft, board = self.crafts[name], self.state.vehicles[name].assignment.board
        if craft.path is None or board is None:
            return False
        point = craft.path.waypoints[craft.leg]
        if point.phase is not Phase.INSPECT or point.visit is None or board.tracks[point.visit].segment != segment:
            return False
        track = board.tracks[point.visit]
        return track.locate(craft.place_m)[0] > track.length_m / 2

    def said(self, level: Level | None = None) -> list[str]:
        """The lines for the operator."""
        lines = [command for _, command in self.commands if isinstance(command, Say)]
        return [line.text for line in lines if level is None or line.level is level]

    def given(self, kind: type[Command]) -> list[Command]:
        """Every command of a kind."""
        return [command for _, command in self.commands if isinstance(command, kind)]

    def solves(self) -> list[Solve]:
        """Every problem that was given to the solver."""
        return [command for _, command in self.commands if isinstance(command, Solve)]

    def uploads(self) -> list[Upload]:
        """Every mission that was sent."""
        return [command for _, command in self.commands if isinstance(command, Upload)]

    def sent_home(self) -> list[str]:
        """Everybody who was told to return."""
        return [command.vehicle for _, command in self.commands if isinstance(command, SendHome)]

    def later(self, after_s: float, what: Later) -> None:
        """Let something happen in a while."""
        self._count += 1
        heapq.heappush(self._due, (self.now_s + after_s, self._count, what))

    def _hear(self) -> None:
        second = math.floor(self.now_s) != math.floor(self.now_s - STEP_S)
        for name, craft in self.crafts.items():
            if craft.mute:
                continue
            said: list[FlightMessage] = [craft.position(self.now_s)]
            if second:
                said += [craft.heartbeat(), craft.battery()]
            if craft.path is not None and craft.armed and (second or craft.leg != craft.said_leg):
                craft.said_leg = craft.leg
                said.append(craft.current())
            for message in said:
                if type(message) not in craft.stopped:
                    self.happen(Heard(name, message))

    def _carry_out(self, command: Command) -> None:
        match command:
            case Start(name):
                talk = self._talks(name)
                self.later(
                    self.start_s.pop(name, 2.0), lambda: self._started(name) if self._talk[name] == talk else None
                )
            case Upload(name):
                self._talks(name)
                self.later(self.upload_s, lambda: self._uploaded(command))
            case SendHome(name):
                self.later(0.4, lambda: self._returned(name))
            case Hold(name) | Resume(name, _) | LandNow(name):
                self.later(0.4, lambda: self._obeyed(name, command))
            case Solve():
                self.later(self.solve_s, lambda: self._solved(command))
            case Compose(revision):
                self.later(STEP_S, lambda: MissionsWanted(revision))
            case Finish():
                self.over = True
            case Disarm(name, force):
                self.later(0.4, lambda: self._disarmed(name, force=force))
            case HandsOff(name):
                self._talks(name)
            case ReadMission(name):
                self.later(0.6, lambda: self._read(name))
            case AskStreams(name):
                self.crafts[name].asked_again += 1
            case ChangeSpeed(name, speed_m_s):
                craft = self.crafts[name]
                craft.told_m_s = craft.told_m_s if craft.mute or craft.deaf_to_speeds else speed_m_s
            case Say() | CancelSolve():
                pass

    def _talks(self, name: str) -> int:
        """Begin to talk with a vehicle; what was being said to it before is broken off."""
        self._talk[name] = self._talk.get(name, 0) + 1
        return self._talk[name]

    def _started(self, name: str) -> Event | None:
        planned = self.start_results.get(name)
        result = planned.pop(0) if planned else StartEnded(name, accepted=True, reason="")
        if result.accepted:
            self.crafts[name].begin()
        return result

    def _uploaded(self, command: Upload) -> Event | None:
        craft = self.crafts[command.vehicle]
        if craft.mute:
            name, revision = command.vehicle, command.revision
            return UploadEnded(name, revision, accepted=False, mixed=False, reason="silence", code=Ending.NO_ANSWER)
        planned = self.upload_results.get(command.vehicle)
        if planned:
            return planned.pop(0)
        craft.load(command.path)
        return UploadEnded(command.vehicle, command.revision, accepted=True, mixed=False, reason="")

    def _read(self, name: str) -> Event:
        craft, board = self.crafts[name], self.state.vehicles[name].assignment.board
        assert board is not None
        if craft.unreadable:
            return MissionRead(Found(name, heard=True, seq=None, items=None, matches=()))
        if craft.alike is None and craft.path is not None:
            carries = encode(craft.path, self.context.vehicles[name].dialect).items
            return MissionRead(compare_onboard_mission(self.context, self.state, name, carries, None))
        items = len(board.waypoint_of)
        alike = items if craft.alike is None else craft.alike
        match = Match(board.revision, alike, whole=alike == items)
        return MissionRead(Found(name, heard=True, seq=None, items=items, matches=(match,)))

    def _returned(self, name: str) -> Event | None:
        craft = self.crafts[name]
        planned = self.return_results.get(name)
        if planned:
            return planned.pop(0)
        if craft.mute:
            return ReturnEnded(name, accepted=False, reason="no acknowledgement", lost=True)
        if craft.armed and not craft.stubborn:
            craft.go_home()
        return ReturnEnded(name, accepted=True, reason="")

    def _disarmed(self, name: str, *, force: bool) -> Event | None:
        craft = self.crafts[name]
        if craft.up_m > 0.5 and not force:
            return OrderEnded(name, Action.DISARM, accepted=False, reason="disarm: denied", refused=True)
        craft.armed = False
        return OrderEnded(name, Action.DISARM, accepted=True, reason="")

    def _obeyed(self, name: str, command: Hold | Resume | LandNow) -> Event | None:
        craft, modes = self.crafts[name], self.context.vehicles[name].dialect.modes
        match command:
            case Hold():
                action, mode = Action.HOLD, modes.hold
            case Resume():
                action, mode = Action.RESUME, modes.mission
            case LandNow():
                action, mode = Action.LAND, modes.land
        if craft.mute:
            return OrderEnded(name, action, accepted=False, reason="no acknowledgement", lost=True)
        craft.go_to(mode.custom_mode)
        return OrderEnded(name, action, accepted=True, reason="")

    def ask(
        self, action: Action, vehicle: str | None = None, name: str = "", *, confirmed: bool = False
    ) -> IntentRecord:
        """Let the operator ask for something; returns what became of it so far."""
        intent = Intent(name or f"wish-{len(self.events)}", action, vehicle, "page", confirmed)
        self.happen(IntentReceived(intent))
        return self.state.crew.intents[intent.id]

    def outcome(self, record: IntentRecord) -> IntentRecord:
        """What has become of an intent."""
        return self.state.crew.intents[record.intent.id]

    def _solved(self, problem: Solve) -> Event | None:
        cancelled = [command.revision for command in self.given(CancelSolve) if isinstance(command, CancelSolve)]
        if problem.revision in cancelled:
            return SolveEnded(problem.revision, None, (), self.solve_s, "cancelled")
        return self.answer(problem)
