"""The flight loop: every event is written down, applied by `fleet_step.step`, and what was decided is carried out."""

from __future__ import annotations

import asyncio
import itertools
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial

from executor import supervised
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.ground import turnaround
from executor.core.interface import commands, events
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Command
from executor.core.interface.events import Event, LossJudged
from executor.core.interface.intents import Action, Intent, IntentRecord
from executor.core.interface.messages import FlightMessage, Message, Radio, SendFiller, SendHeartbeat, Traffic
from executor.core.interface.ports import Clock, EventSink, Link, LinkView, LossJudge, Solver
from executor.core.radio_budget import HEARTBEAT
from executor.core.replanning import replan_cycle
from executor.core.resume.reconciliation import compare_onboard_mission
from executor.core.state.bases import place_vehicles
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import height_over_fence_m
from executor.core.state.radio_channel import choose_streams_hz, share_of
from executor.protocols import vehicle_commands
from executor.protocols.turns import Rank
from executor.runtime import procedures, vehicle_preflight
from executor.runtime.channel import channel_of
from executor.runtime.dialogue import Lateness, awake
from executor.runtime.link_changes import LinkChanges
from executor.runtime.procedures import UploadNeed
from missions import EncodeError, MissionItem, encode, flag_current
from missions.fences import build_fence_items

TICK_S = 0.2
LEAST_TICK_REAL_S = 0.02
HEARTBEAT_S = 1.0
MOST_SHIFT, GOLDEN_SHARE = 0.4, 0.618
ORDERS = {
    commands.Hold: Action.HOLD, commands.Resume: Action.RESUME, commands.LandNow: Action.LAND,
    commands.Disarm: Action.DISARM,
}  # fmt: skip

Work = Callable[[], Awaitable[Event]]
"""Work that returns its outcome as an event."""
Failed = Callable[[str], Event]
"""Returns the event for a failure with this reason."""


@dataclass(frozen=True, slots=True)
class Observer:
    """Who wants to know; none of these may wait."""

    said: Callable[[commands.Say, float], None]
    """Called with every line for the operator, and its flight time."""
    applied: Callable[[Event, FleetState, float], None]
    """Called after every event."""
    decided: Callable[[Command, float], None] = lambda *_: None
    """Called with every command before it is carried out."""
    told: Callable[[commands.Say, float], None] = lambda *_: None
    """Called with progress lines for the operator, which are no decisions."""


@dataclass(eq=False, repr=False)
class Flight:
    """Owns the state of one flight; everything runs on one event loop, and only `apply` changes the state."""

    context: Context
    state: FleetState
    _links: Mapping[str, Link]
    _clock: Clock
    _sink: EventSink
    _solver: Solver
    _observer: Observer
    _jobs: dict[str, asyncio.Task[None]] = field(default_factory=dict)
    _whole: set[str] = field(default_factory=set)
    """Vehicles whose present job is an upload."""
    _solving: set[asyncio.Task[None]] = field(default_factory=set)
    _leaves: bool = False
    """Whether the loop is ending: only uploads that would leave half a mission on board are finished."""
    _tasks: asyncio.TaskGroup | None = None
    _over: asyncio.Event = field(default_factory=asyncio.Event)
    _mistakes: set[str] = field(default_factory=set)
    _stops: list[Callable[[], None]] = field(default_factory=list)
    _answer: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def context_now(self) -> Context:
        """The context with the pads where everybody stands and lands now."""
        return place_vehicles(self.context, self.state.vehicles.values())

    def apply(self, event: Event) -> None:
        """Write an event down, apply it, and carry out what was decided.

        An internal error in one decision must not end the supervision of everybody: the event then changes nothing,
        because states are values, and the operator is told.
        """
        now_s = self._clock.now_s()
        try:
            self._apply(event, now_s)
        except Exception as error:  # noqa: BLE001 - the boundary between one event and the flight
            text = f"internal error while handling {type(event).__name__}: {type(error).__name__}: {error}"
            if text not in self._mistakes:
                self._mistakes.add(text)
                line = commands.Say(commands.Level.FAULT, text)
                supervised.call_safely("what tells the crew", self._observer.said, line, now_s)
                supervised.report_internal_error(f"deciding at {type(event).__name__}", error, said=True)

    def now_s(self) -> float:
        """Return the time on the flight's clock."""
        return self._clock.now_s()

    def describe_links(self, vehicle: str) -> tuple[LinkView, ...]:
        """Return the state of each link of a vehicle that has several."""
        return self._links[vehicle].describe_links() if vehicle in self._links else ()

    def submit_intent(self, intent: Intent) -> IntentRecord:
        """Take an operator's intent, once; returns what became of it so far.

        Raises:
            RuntimeError: an internal error kept it from being decided; nothing has changed.
        """
        self.apply(events.IntentReceived(intent))
        record = self.state.crew.intents.get(intent.id)
        if record is None:
            raise RuntimeError(f"intent {intent.id} could not be decided")
        return record

    def _apply(self, event: Event, now_s: float) -> None:
        self._sink.write(event, now_s)
        self.state, decided = fleet_step.step(self.context, self.state, event, now_s)
        if self.state.crew.briefing.answered:
            self._answer.set()
        # An observer, and one command, must not keep the others from being carried out.
        supervised.call_safely("what shows the flight", self._observer.applied, event, self.state, now_s)
        for command in decided:
            supervised.call_safely("what keeps the decisions", self._observer.decided, command, now_s)
            supervised.call_safely(f"carrying out {type(command).__name__}", self._carry_out, command, now_s)

    async def run(self, reopened: events.Reopened | None = None, patience_real_s: float = 0.0) -> None:
        """Fly until nothing is left to supervise; the missions are on board already.

        Args:
            reopened: For a flight that is taken up again; without it, it is launched.
            patience_real_s: How long to wait for the first answer then.

        Raises:
            ConnectionFailed: in a group, when a flight is taken up again and nobody answers.
        """
        try:
            async with asyncio.TaskGroup() as tasks:
                self._tasks = tasks
                if reopened is not None:
                    self.apply(reopened)
                with self.listen_to_vehicles():
                    if reopened is not None:
                        answers = vehicle_preflight.reconnect_vehicles(
                            self.context, lambda: self.state, self._links, self._clock, patience_real_s
                        )
                        self.apply(await answers)
                    tick = tasks.create_task(
                        supervised.keep_going("the tick", self._run_ticks, at_once=True), name="tick"
                    )
                    if reopened is None:
                        self.apply(events.LaunchOrdered())
                    await self._wait_for_end()
                    tick.cancel()
                    for job in (*self._jobs.values(), *self._solving):
                        job.cancel()
        finally:
            self._tasks = None

    async def _wait_for_end(self) -> None:
        """Wait for the end: who was lost may be heard, in the air, before this is reached.

        A flight whose ground station was killed as it ended is over when it is taken up.
        """
        while not (self._leaves or self.state.progress.finished):
            self._over.clear()
            await self._over.wait()

    @contextmanager
    def listen_to_vehicles(self) -> Iterator[None]:
        """Take what the vehicles say; before a flight too, so that who looks sees them."""
        if self._stops:
            yield  # it listens already
            return
        self._stops = [link.listen(self._make_listener(name)) for name, link in self._links.items()]
        try:
            yield
        finally:
            for stop in self._stops:
                stop()
            self._stops = []

    async def wait_for_yes(self, action: Action) -> bool:
        """Wait until what is asked before the flight is answered with yes, from wherever; returns true."""
        while self.state.crew.briefing.answered != action.value:
            self._answer.clear()
            await self._answer.wait()
        return True

    def stop_supervising(self, *, at_once: bool = False) -> tuple[str, ...]:
        """Stop supervising; the vehicles keep their missions, and nobody is given another one.

        An upload that would leave a part of a new mission on board is brought to its end first, and looked after
        until then; returns whose.

        Args:
            at_once: Whether not even that is waited for.
        """
        self._leaves = True
        for task in self._solving:
            task.cancel()
        waits_for = () if at_once else self._find_partial_uploads()
        if not waits_for:
            self._over.set()
        return waits_for

    def _find_partial_uploads(self) -> tuple[str, ...]:
        """Return who is being given a mission on an autopilot that takes it item by item into the one on board."""
        return tuple(
            name
            for name in sorted(self._whole)
            if not self._jobs[name].done() and not self.context.vehicles[name].dialect.upload_is_atomic
        )

    def _on_job_end(self, _: asyncio.Task[None]) -> None:
        if self._leaves and not self._find_partial_uploads():
            self._over.set()

    def _make_listener(self, name: str) -> Callable[[Message], None]:
        def heard(message: Message) -> None:
            if isinstance(message, Traffic):
                message = replace(message, round_trip_s=channel_of(self._links[name]).take_round_trip_s())
            if isinstance(message, FlightMessage):
                self.apply(events.Heard(name, message))

        return heard

    async def _run_ticks(self) -> None:
        period_s = max(TICK_S / self._clock.speedup, LEAST_TICK_REAL_S)
        with awake(self._clock) as able:
            late, changes = Lateness(able, self._clock), LinkChanges(self._links)
            while True:
                self.apply(events.Tick(late.take_lost_s()))
                if told := late.to_be_said():
                    self._warn(told)
                for line in changes.list_to_say(self._clock.now_s()):
                    self._tell(line)
                await asyncio.sleep(period_s)

    def _carry_out(self, command: Command, now_s: float) -> None:  # noqa: C901, PLR0912 - one case for each command
        failed: Failed
        ended: Callable[..., Event]
        if self._leaves and isinstance(command, commands.Solve | commands.Compose | commands.Upload | commands.Start):
            return  # nobody would be there to look after what it begins
        match command:
            case commands.Say():
                self._observer.said(command, now_s)
            case commands.Upload(vehicle, revision):
                # How far it came is not known then: a part of it may be on board.
                failed = partial(events.UploadEnded, vehicle, revision, False, True)
                # A fence is broken off when a person takes the vehicle, and nothing of it is on board then.
                self._start_job(vehicle, partial(self._upload, command), failed, whole=command.fence is None)
            case commands.Start(vehicle):
                self._start_job(vehicle, partial(self._start, vehicle), partial(events.StartEnded, vehicle, False))
            case commands.SendHome() | commands.Hold() | commands.Resume() | commands.LandNow() | commands.Disarm():
                ended = partial(events.ReturnEnded, command.vehicle)
                if not isinstance(command, commands.SendHome):
                    ended = partial(events.OrderEnded, command.vehicle, ORDERS[type(command)])
                self._start_job(command.vehicle, partial(self._give_order, command, ended), partial(ended, False))
            case commands.HandsOff(vehicle):
                if vehicle in self._jobs and vehicle not in self._whole:
                    self._jobs[vehicle].cancel()
            case commands.AskStreams(vehicle, which):
                self._start_side_job(vehicle, self._ask_streams(vehicle, which))
            case commands.ReadMission(vehicle):
                self._start_side_job(vehicle, self._read_mission(vehicle))
            case commands.Examine(vehicle, sets):
                failed = partial(events.Examined, vehicle, False)
                self._start_job(vehicle, partial(self._examine, vehicle, sets=sets), failed)
            case commands.AskPicture(vehicle, component, sequence):
                # Its answer is heard like any other picture, and asked for again where none comes.
                self._links[vehicle].send(vehicle_commands.request_picture(component, sequence))
            case commands.ChangeSpeed(vehicle, speed_m_s):
                self._links[vehicle].send(vehicle_commands.change_speed(speed_m_s))
            case commands.Solve(given=visits) if visits:
                routes = (events.NewRoute(command.sortie, visits),)
                planned = events.SolveEnded(command.revision, routes, (), 0.0, "planned before")
                asyncio.get_running_loop().call_soon(self.apply, planned)
            case commands.Solve():
                nothing = partial(events.SolveEnded, command.revision, None, (), 0.0)
                solve = partial(self._solver.solve, command, self.context_now.pricing)
                task = self._spawn(self._run_job("the solver", solve, nothing), "solver")
                if task is not None:
                    self._solving.add(task)
                    task.add_done_callback(self._solving.discard)
            case commands.Compose(revision):
                asyncio.get_running_loop().call_soon(self.apply, events.MissionsWanted(revision))
            case commands.CancelSolve(revision):
                self._solver.cancel(revision)
            case commands.Finish():
                self._over.set()

    def _spawn(self, work: Coroutine[None, None, None], name: str) -> asyncio.Task[None] | None:
        if self._tasks is None:
            work.close()
            return None
        return self._tasks.create_task(work, name=name)

    def _start_job(self, vehicle: str, work: Work, failed: Failed, *, whole: bool = False) -> None:
        """Give a vehicle something to do; what it was given before is cancelled: one dialogue runs at a time.

        Args:
            vehicle: Who.
            work: What.
            failed: What an internal error in it comes to.
            whole: Whether it is brought to its end even when a person takes the vehicle: half a mission on board is
                worse for its pilot than a whole one, and neither moves it.
        """
        before = self._jobs.get(vehicle)
        if before is not None:
            before.cancel()
        job = self._run_job(f"an order to {vehicle}", partial(self._run_once_recorded, work), failed)
        self._begin_job(vehicle, job, whole=whole)

    def _start_side_job(self, vehicle: str, work: Coroutine[None, None, None]) -> None:
        """Ask a vehicle something, unless it is being told something: that can wait, and is asked again."""
        job = self._jobs.get(vehicle)
        if job is not None and not job.done():
            work.close()
            return
        self._begin_job(vehicle, work)

    def _begin_job(self, vehicle: str, work: Coroutine[None, None, None], *, whole: bool = False) -> None:
        task = self._spawn(work, vehicle)
        if task is not None:
            self._jobs[vehicle] = task
            (self._whole.add if whole else self._whole.discard)(vehicle)
            task.add_done_callback(self._on_job_end)

    async def _run_job(self, what: str, work: Work, failed: Failed) -> None:
        """Apply what something comes to; an internal error in it ends it like a refusal, and nobody else's work."""
        try:
            event = await work()
        except Exception as error:  # noqa: BLE001 - the boundary between one dialogue and the flight
            supervised.report_internal_error(what, error)
            event = failed(f"internal error: {type(error).__name__}: {error}")
        self.apply(event)

    async def _run_once_recorded(self, work: Work) -> Event:
        """Tell a vehicle something once the decision is on record and outlives a power loss."""
        await self._sink.settle()
        return await work()

    async def _upload(self, command: commands.Upload) -> Event:
        link, name = self._links[command.vehicle], command.vehicle
        dialect = self.context.vehicles[name].dialect
        ended = partial(events.UploadEnded, name, command.revision)
        try:
            mission = encode(command.path, dialect)
        except EncodeError as error:
            return ended(False, False, str(error), Ending.INVALID_ITEM)
        if command.airborne:
            # In flight the index that the vehicle is at must stand: the list begins as the one on board does.
            mission = flag_current(mission, None)
        if over_m := height_over_fence_m(self.context_now, name, command.path):
            return ended(False, False, f"it leads {over_m:.0f} m above its fence", Ending.ABOVE_FENCE)
        fenced = command.fence is not None
        if command.fence is not None:
            items = build_fence_items(command.fence, self.context.frame)
            fence = await procedures.upload_and_verify_fence(
                link, self._clock, dialect, items, partial(self._may_change_fence, name)
            )
            if not fence.accepted:
                return ended(False, False, f"its fence: {fence.reason}", fence.code)
            if not self._may_change_fence(name, mixed=False):
                return ended(False, False, "it has left its mission", Ending.LEFT_MISSION, fenced)
            self._whole.add(name)
        wanted = partial(self._may_receive_mission, name)
        before = self._list_proven_items(name) if command.airborne else ()
        alike = sum(
            1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], zip(before, mission.items, strict=False))
        )
        need_s = replan_cycle.estimate_need_s(self.state, name)
        need = UploadNeed(Rank.IN_FLIGHT, need_s, alike, rest=before[len(mission.items) :])
        done = await procedures.upload_and_verify(
            link, self._clock, dialect, mission.items, wanted, lambda text: self._warn(f"{name}: {text}"), need=need
        )
        return ended(done.accepted, done.mixed, done.reason, done.code, fenced)

    def _list_proven_items(self, vehicle: str) -> tuple[MissionItem, ...]:
        """Return the mission that was read from this vehicle; empty where it may carry another one."""
        known, dialect = self.state.vehicles[vehicle].assignment, self.context.vehicles[vehicle].dialect
        if known.board is None or known.carried.may_be_foreign():
            return ()
        return flag_current(encode(known.board.path, dialect), None).items

    def _warn(self, text: str) -> None:
        self._tell(commands.Say(commands.Level.WARNING, text))

    def _tell(self, line: commands.Say) -> None:
        supervised.call_safely("what tells the crew", self._observer.told, line, self._clock.now_s())

    def _may_receive_mission(self, vehicle: str, mixed: bool) -> bool:
        return replan_cycle.may_retry_upload(self.context_now, self.state.vehicles[vehicle], mixed=mixed)

    def _may_change_fence(self, vehicle: str, mixed: bool) -> bool:
        """Return whether a fence may be changed: never while a person has the vehicle, or may have."""
        return not self.state.vehicles[vehicle].is_under_foreign_control and self._may_receive_mission(vehicle, mixed)

    async def _start(self, vehicle: str) -> Event:
        done = await procedures.arm_and_start(self._links[vehicle], self._clock, self.context.vehicles[vehicle].dialect)
        return events.StartEnded(vehicle, done.accepted, done.reason, done.armed, done.code)

    async def _examine(self, vehicle: str, *, sets: bool) -> Event:
        link, before_s = self._links[vehicle], turnaround.READY_S
        share = share_of(self.context.vehicles[vehicle], self.state.vehicles[vehicle])
        return await vehicle_preflight.examine_vehicle(
            self.context_now, vehicle, link, self._clock, before_s, sets=sets, share=share
        )

    async def _give_order(self, command: procedures.Order, ended: Callable[..., Event]) -> Event:
        link, dialect = self._links[command.vehicle], self.context.vehicles[command.vehicle].dialect
        done = await procedures.give_order(link, self._clock, dialect, command)
        return ended(done.accepted, done.reason, done.lost, done.refused, done.code)

    async def _read_mission(self, vehicle: str) -> None:
        unread = events.MissionRead(events.Found(vehicle, heard=True, seq=None, items=None, matches=()))
        await self._run_job(f"a question to {vehicle}", partial(self._read_back_mission, vehicle), lambda _: unread)

    async def _read_back_mission(self, vehicle: str) -> Event:
        items = await procedures.read_list(self._links[vehicle], self._clock)
        return events.MissionRead(compare_onboard_mission(self.context_now, self.state, vehicle, items, None))

    async def _ask_streams(self, vehicle: str, which: tuple[int, ...]) -> None:
        try:
            setup, link = self.context.vehicles[vehicle], self._links[vehicle]
            asked_hz, again = choose_streams_hz(setup, self.state.vehicles[vehicle]), HEARTBEAT in which or not which
            for way in [link.ways[0], *(way for way in link.ways[1:] if again and way.is_alive)]:
                streams_hz = procedures.choose_link_streams_hz(way, setup.dialect, setup.radio, asked_hz)
                if which:
                    streams_hz = {message: streams_hz[message] for message in which if message in streams_hz}
                await procedures.request_streams(way, self._clock, streams_hz, again=again)
        except Exception as error:  # noqa: BLE001 - the boundary between one dialogue and the flight
            supervised.report_internal_error(f"an order to {vehicle}", error)


async def send_heartbeats(links: Mapping[str, Link], clock: Clock) -> None:
    """Send our heartbeat to every vehicle for ever: their ground-station failsafes wait for it, on their own time.

    Behind one radio it is for everybody who hears it, and one a second would do. But radios with stock firmware put a
    report of their own inside other frames, whenever they see a HEARTBEAT: a vehicle's destroys one in four of ours
    (emulated), and each of ours a frame of a vehicle's. Five in a row are a GCS failsafe of ArduPilot's. So there come
    two a second, a little sooner or later every time: two senders that kept one rhythm would keep on colliding. Over a
    radio that loses frames two go out at once: they share a packet, and a report destroys only one of them.

    What is left of a destroyed frame may hold the byte that a frame begins with, and 261 bytes are taken for one: where
    so little goes up, that is 3 s of heartbeats. So over such a radio fillers go out whenever nothing else does. They
    take what is the ground's turn on the air anyway.
    """
    losses, due_s, loop = _Losses(), 0.0, asyncio.get_running_loop()
    with ExitStack() as listened:
        for link in links.values():
            listened.callback(link.listen(losses.hear))
        for beats in itertools.count():
            ways = [(name, way) for name, link in links.items() for way in link.ways]
            once = {way.peer or number: (name, way) for number, (name, way) in enumerate(ways)}
            if loop.time() < due_s - LEAST_TICK_REAL_S:
                _fill(once.values(), clock)
            else:
                for name, link in once.values():
                    for _ in range(1 + losses.are_many):
                        supervised.call_safely(f"our heartbeat to {name}", link.send, SendHeartbeat())
                after_s = HEARTBEAT_S
                if len(once) < len(ways):
                    after_s *= max(LEAST_SHARE, len(once) / len(ways))
                    after_s *= 1.0 + _shift_of(beats + 1) - _shift_of(beats)
                due_s = loop.time() + after_s / clock.speedup
            most_s = FILLER_S / clock.speedup if losses.want_fillers else HEARTBEAT_S
            await asyncio.sleep(min(most_s, max(0.0, due_s - loop.time())))


def _fill(once: Iterable[tuple[str, Link]], clock: Clock) -> None:
    for name, link in once:
        channel = channel_of(link)
        # Between the items of a transfer others may still be in the radio: a filler would keep the next one waiting.
        if channel.is_quiet((TRANSFER_QUIET_S if channel.is_busy else FILLER_S) / clock.speedup):
            supervised.call_safely(f"a filler to {name}", link.send, SendFiller())


LEAST_SHARE = 0.5
FILLER_S = 0.1
"""Interval of fillers of 26 bytes: 261 bytes pass in a second."""
TRANSFER_QUIET_S = 1.0
"""Time without a message after which fillers are sent during a transfer: it has stalled."""
EMPTY_PCT = 90
"""Free share of our radio's buffer from which it has nothing else to send."""
MANY_LOST, COUNTS = 0.025, 16


@dataclass(slots=True)
class _Losses:
    """What the last counts of frames say of the radio that vehicles are behind, if there is one."""

    _free_pct: int | None = None
    _counts: deque[Traffic] = field(default_factory=lambda: deque(maxlen=COUNTS))

    def hear(self, message: Message) -> None:
        if isinstance(message, Radio):
            self._free_pct = message.free_buffer_pct
        elif isinstance(message, Traffic):
            self._counts.append(message)

    @property
    def are_many(self) -> bool:
        missing = sum(one.missing for one in self._counts)
        many = missing > MANY_LOST * sum(one.received + one.missing for one in self._counts)
        return many and self._free_pct is not None

    @property
    def want_fillers(self) -> bool:
        return self.are_many and self._free_pct is not None and self._free_pct >= EMPTY_PCT


def _shift_of(beats: int) -> float:
    """Return how much later than its second a heartbeat goes out, as a share: no two in a row are alike."""
    return MOST_SHIFT * (beats * GOLDEN_SHARE % 1.0)


REST_S = 5.0
"""Least real seconds between two rounds."""
SHARE = 8.0
"""Pause before the next round, in durations of the last one, so that the flight keeps the computer."""


async def keep_judging(flight: Flight, judge: LossJudge) -> None:
    """Judge every vehicle's loss, whenever a plan has come or a visit has ended, for ever."""
    loop = asyncio.get_running_loop()
    judged: tuple[object, ...] | None = None
    while True:
        began_s = loop.time()
        moment = replan_cycle.build_judgement_key(flight.state)
        if moment != judged and await _judge_all(flight, judge):
            judged = moment
        await asyncio.sleep(max(REST_S, SHARE * (loop.time() - began_s)))


async def _judge_all(flight: Flight, judge: LossJudge) -> bool:
    """Judge everybody once; returns whether that came to its end."""
    names = replan_cycle.select_vehicles_to_judge(flight.state)
    for name in names:
        revision = flight.state.replanning.revision
        if name not in replan_cycle.select_vehicles_to_judge(flight.state):
            return False
        problem = replan_cycle.build_loss_problem(flight.context_now, flight.state, name, flight.now_s())
        uncovered = problem if isinstance(problem, tuple) else await judge(problem, flight.context_now.pricing)
        if uncovered is None or revision != flight.state.replanning.revision:
            return False
        flight.apply(LossJudged(name, revision, uncovered))
    return bool(names)
