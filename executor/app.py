"""Wires the parts together for one flight; holds no rule."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from executor import build, serving
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog, to_plain
from executor.adapters.mavlink import endpoints
from executor.adapters.mavlink.codec import Codec
from executor.adapters.mavsdk import link as mavsdk
from executor.adapters.rundir import keep_site, locked, write_json
from executor.adapters.solver import REPLAN_COST, SolverProcess, SolverSetup
from executor.adapters.tlog import TelemetryLog
from executor.build import Ground
from executor.checklist import checklist
from executor.config import Site, VehicleTable, signing_key
from executor.core import fleet, preflight
from executor.core.commands import Command, Level, Say, Solve
from executor.core.context import Context
from executor.core.events import Event, IntentReceived, Reopened, ReturnAllOrdered, SolveEnded
from executor.core.failsafes import link_failsafe
from executor.core.ports import Keyring, LinkOrder, OpenLink
from executor.core.preflight import Check, Facts, Severity
from executor.core.state import FleetState
from executor.core.vehicle import OnBoard, aboard
from executor.core.view import fleet_view
from executor.errors import PreflightFailed
from executor.publishing import Publication, Settings
from executor.report import Happening, Said, report_of, vehicles_of
from executor.runtime import preflight as asking
from executor.runtime.flight import Flight, Observer, keep_heartbeat
from executor.runtime.outlook import keep_judging
from missions import (
    FlightSetup,
    MissionsError,
    PlanFile,
    Solved,
    Task,
    dialect_for,
    encode,
    make_plan_file,
    open_task,
    read_plan,
    write_plan,
)
from planner import Plan, Route, Vehicle

LEAVE_AFTER_S = 5.0
"""Real seconds after the first Ctrl-C in which a second one still means 'send them home'."""


LEFT = (
    "supervision ends; the vehicles stay on their missions, unless a ground-station failsafe that is set on them acts"
)


class Console(Protocol):
    """Where the operator looks."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show one line."""
        ...

    def checks(self, found: Sequence[Check]) -> None:
        """Show the checklist."""
        ...

    def confirm(self, question: str) -> bool:
        """Ask before the take-off."""
        ...

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Show the fleet; called often, draws seldom."""
        ...

    def done(self) -> None:
        """Stop drawing."""
        ...


@dataclass(frozen=True, slots=True)
class Flown:
    """What is left after a flight."""

    report: Mapping[str, object]
    context: Context
    left: bool
    """Whether the operator left while the vehicles flew on."""


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be flown, and where its record goes."""

    site: Site
    base: Path
    """The folder that the site file's paths are relative to."""
    ground: Ground
    plan: PlanFile
    """Over all of the ground's segments, for its vehicles."""
    run: Path
    truths: Callable[[SystemClock], Sequence[Happening]]
    """What really happened, asked for at the end; empty without a simulator."""
    mqtt: Settings | None = None
    """Where it is published."""


async def fly(order: Order, console: Console) -> Flown:
    """Connect, check, upload, fly and report.

    Raises:
        ExecutorError: a vehicle does not answer, or a check says no; nothing has moved then.
    """
    serving.check(order.site.web)
    ground = order.ground
    clock = SystemClock(order.site.flight.speedup)
    solver = SolverProcess(
        SolverSetup(ground.network, ground.travel, order.site.flight.solve_s, order.plan.solved.seed)
    )
    with locked(order.run):
        async with open_links(order, clock) as links, solver:
            return await _fly(order, console, clock, solver, links)


async def _fly(
    order: Order,
    console: Console,
    clock: SystemClock,
    solver: SolverProcess,
    links: Mapping[str, OpenLink],
) -> Flown:
    run = order.run
    facts = await _interviews(order, links, clock, console)
    context, boards, found = examined(order, facts)
    console.checks(found)
    stops = [check for check in found if check.severity is Severity.STOP]
    if stops:
        raise PreflightFailed(f"{stops[0].subject}: {stops[0].text}")
    found += await _load(context, links, clock, boards, console)
    said = Said(facts, found)
    write_json(run / "vehicles.json", vehicles_of(context, said))
    if not console.confirm("All missions are on board and read back. Take off?"):
        raise PreflightFailed("the operator did not say yes; nothing has moved")
    log = EventLog(run / "events.jsonl", began_unix_s=clock.began_unix_s, speedup=clock.speedup, told=telling(console))
    return await supervise(order, console, Cockpit(context, fleet.initial(boards), links, clock, log, solver, said))


@dataclass(frozen=True, slots=True)
class Cockpit:
    """All that a flight is supervised with."""

    context: Context
    state: FleetState
    """Before the launch, or when the ground station went away."""
    links: Mapping[str, OpenLink]
    clock: SystemClock
    log: EventLog
    solver: SolverProcess
    said: Said


async def supervise(order: Order, console: Console, seat: Cockpit, reopened: Reopened | None = None) -> Flown:
    """Fly to the end and report; `reopened` for a flight that is taken up again.

    Raises:
        ConnectionFailed: in a group, when a flight is taken up again and nobody answers.
    """
    context, clock, links = seat.context, seat.clock, seat.links
    publication = None if order.mqtt is None else Publication(order.mqtt, order.run, clock)
    keeper = _Keeper(order, context, console, seat.log, clock, publication)
    if publication is not None:
        publication.plan(seat.state.revision, _in_force(order, seat.state.revision))
    flight = Flight(context, seat.state, links, clock, seat.log, seat.solver, keeper.observer())
    try:
        with serving.page(order.site.web, flight, clock, console), _Interrupts(flight, console) as left:
            async with _published(publication, flight, keeper, clock), _beside(keep_judging(flight, seat.solver)):
                await flight.run(reopened, order.site.flight.connect_timeout_s)
    finally:
        console.done()
        seat.log.close()
    frames = {name: link.counts for name, link in links.items()}
    report = report_of(context, flight.state, clock.now_s(), order.truths(clock), frames, seat.said)
    write_json(order.run / "report.json", report)
    return Flown(report, context, bool(left))


def _in_force(order: Order, revision: int) -> PlanFile:
    """Return the newest plan that is on record; a flight that is taken up again may have had several."""
    with suppress(OSError, MissionsError):
        if revision > 0:
            return read_plan(order.run / f"plan-{revision:03d}.json")
    return order.plan


def _published(
    publication: Publication | None, flight: Flight, keeper: _Keeper, clock: SystemClock
) -> AbstractAsyncContextManager[None]:
    if publication is None:
        return nullcontext()
    return publication.running(
        view=lambda: fleet_view(flight.context, flight.state, clock.now_s()),
        accept=lambda intent: flight.apply(IntentReceived(intent)),
        tell=lambda level, text: keeper.told(Say(level, text), clock.now_s()),
    )


@asynccontextmanager
async def _beside(work: Coroutine[None, None, None]) -> AsyncIterator[None]:
    """Do something for as long as something else goes on."""
    task = asyncio.create_task(work)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def telling(console: Console) -> Callable[[str], None]:
    """Return how a log tells the operator of its troubles."""
    return lambda text: console.say(Level.WARNING, text)


def keep(order: Order) -> None:
    """Write the site and the first plan into the run directory."""
    files = {}
    if order.site.network.file != build.DEFAULT_NETWORK:
        files["network", "file"] = order.base / order.site.network.file
    if order.site.mqtt is not None and order.site.mqtt.ca_file is not None:
        files["mqtt", "ca_file"] = order.base / order.site.mqtt.ca_file
    content = order.site.model_dump(exclude_none=True, mode="json")
    if order.site.signing is not None and order.site.signing.key_file is not None:
        # The key stays where it is: a run directory is copied and handed on.
        content["signing"] = {"key_file": str((order.base / order.site.signing.key_file).resolve())}
    keep_site(order.run, content, files)
    write_plan(order.run / "plan-000.json", order.plan)


@asynccontextmanager
async def open_links(
    order: Order, clock: SystemClock, *, recorded: bool = True
) -> AsyncIterator[Mapping[str, OpenLink]]:
    """Open the links to all vehicles, record them in the run directory, and keep up our heartbeat on them.

    Raises:
        ConnectionFailed: one cannot be opened.
    """
    async with AsyncExitStack() as stack:
        wanted: dict[str, dict[str, LinkOrder]] = {"native": {}, "mavsdk": {}}
        for table in order.site.vehicle:
            log = None
            if recorded:
                log = TelemetryLog(order.run / f"{table.name}.tlog", clock.label_usec)
                stack.callback(log.close)
            wanted[table.backend][table.name] = LinkOrder(table.link, table.sysid, log)
        key = signing_key(order.site, order.base)
        keyring = None if key is None else Keyring(key, clock.dated_s)
        native = await stack.enter_async_context(endpoints.open_links(wanted["native"], keyring))
        others = await stack.enter_async_context(mavsdk.open_links(wanted["mavsdk"], Codec()))
        links = {table.name: native.get(table.name) or others[table.name] for table in order.site.vehicle}
        async with asyncio.TaskGroup() as tasks:
            beat = tasks.create_task(keep_heartbeat(links, clock), name="heartbeat")
            try:
                yield links
            finally:
                beat.cancel()


async def _interviews(
    order: Order, links: Mapping[str, OpenLink], clock: SystemClock, console: Console
) -> Mapping[str, Facts]:
    console.say(Level.INFO, f"waiting for {len(links)} vehicles")
    asked = {
        table.name: asyncio.ensure_future(interview(order.site, table, links[table.name], clock, console))
        for table in order.site.vehicle
    }
    try:
        return {name: await facts for name, facts in asked.items()}
    finally:
        for facts in asked.values():
            facts.cancel()


async def interview(site: Site, table: VehicleTable, link: OpenLink, clock: SystemClock, console: Console) -> Facts:
    """Wait for one vehicle, and ask it what it is and whether it is ready.

    Raises:
        ConnectionFailed: it does not answer.
        PreflightFailed: it does not become ready.
    """
    name, timeout_s = table.name, site.flight.connect_timeout_s
    await asking.answer(name, table.connection, table.sysid, link, timeout_s, clock)

    def waits(missing: str) -> None:
        console.say(Level.INFO, f"{name}: not ready yet: {missing}")

    dialect = dialect_for(table.autopilot)
    facts = await asking.interview(name, link, clock, dialect, site.flight.ready_timeout_s, waits)
    console.say(Level.INFO, f"{name}: ready, {facts.words}, battery {facts.remaining_pct:.0f} %")
    return facts


def examined(order: Order, facts: Mapping[str, Facts]) -> tuple[Context, Mapping[str, OnBoard | None], list[Check]]:
    """Return the context of the flight, everybody's first mission, and the checklist."""
    ground = order.ground
    setup = _setup(ground, facts)
    task, plan = order.plan.task(), order.plan.plan
    dialects = {table.name: dialect_for(table.autopilot) for table in order.site.vehicle}
    own = {name: link_failsafe(dialects[name], fact.parameters) for name, fact in facts.items()}
    context = build.context_of(ground, setup, task, plan, own)
    boards = _boards(context, build.routes_of(ground, task, plan))
    return context, boards, checklist(order.site, order.plan, context, facts, own, boards)


def _setup(ground: Ground, facts: Mapping[str, Facts]) -> FlightSetup:
    frame = ground.network.frame
    pads = []
    for name in ground.names:
        position = facts[name].position
        east_m, north_m = frame.to_local_m(position.lat_deg, position.lon_deg)
        pads.append(preflight.pad_from(facts[name], east_m, north_m))
    return build.setup_of(ground, pads)


def _boards(context: Context, routes: Mapping[str, tuple[int, ...]]) -> dict[str, OnBoard | None]:
    paths = build.paths_of(context.setup, routes)
    return {
        name: aboard(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }


async def _load(
    context: Context,
    links: Mapping[str, OpenLink],
    clock: SystemClock,
    boards: Mapping[str, OnBoard | None],
    console: Console,
) -> list[Check]:
    found: list[Check] = []

    async def one(name: str, board: OnBoard | None) -> None:
        dialect, link = context.vehicles[name].dialect, links[name]
        height = await asking.prepare_return(link, clock, dialect, context.return_height_m(name))
        found.append(preflight.return_height(context, name, height))
        console.checks(found[-1:])
        if board is not None:
            mission = encode(board.path, dialect)
            await asking.load(name, link, clock, dialect, mission)
            console.say(Level.INFO, f"{name}: {len(mission.items)} mission items on board, read back the same")

    async with asyncio.TaskGroup() as tasks:
        for name, board in boards.items():
            tasks.create_task(one(name, board))
    return found


class _Keeper:
    """Shows and keeps what happens: lines for the operator, notes in the log, a plan file for each revision."""

    def __init__(
        self,
        order: Order,
        context: Context,
        console: Console,
        log: EventLog,
        clock: SystemClock,
        publication: Publication | None,
    ) -> None:
        self._order = order
        self._publication = publication
        self._context = context
        self._console = console
        self._log = log
        self._clock = clock
        self._solve: Solve | None = None

    def observer(self) -> Observer:
        return Observer(self.said, self.applied, self.decided)

    def decided(self, command: Command, now_s: float) -> None:
        if not isinstance(command, Say):
            self._log.note(now_s, command=to_plain(command))

    def said(self, line: Say, now_s: float) -> None:
        self._log.note(now_s, said=line.text, level=line.level.value)
        self._console.say(line.level, line.text, now_s)
        if self._publication is not None:
            self._publication.said(line, now_s)

    def told(self, line: Say, now_s: float) -> None:
        """Show and keep what nobody decided, such as that a broker went away: a replay does not look for it."""
        self._log.note(now_s, told=line.text, level=line.level.value)
        self._console.say(line.level, line.text, now_s)
        if self._publication is not None:
            self._publication.said(line, now_s)

    def applied(self, event: Event, state: FleetState, now_s: float) -> None:
        if state.replan is not None:
            self._solve = state.replan.solve
        if isinstance(event, SolveEnded) and event.routes is not None and self._solve is not None:
            self._keep_plan(event, self._solve)
        self._console.show(self._context, state, now_s)
        if self._publication is not None:
            self._publication.applied(event, state)

    def _keep_plan(self, event: SolveEnded, solve: Solve) -> None:
        if solve.revision != event.revision:
            return
        ground = self._order.ground
        task, plan = _replanned(ground, solve, event)
        solved = Solved(seed=self._order.plan.solved.seed, solver="search", seconds=event.solve_s)
        content = make_plan_file(
            ground.network, task, ground.travel, plan, REPLAN_COST, solved, inspection=ground.inspection
        )
        with suppress(OSError):
            write_plan(self._order.run / f"plan-{event.revision:03d}.json", content)
        if self._publication is not None:
            self._publication.plan(event.revision, content)


def _replanned(ground: Ground, solve: Solve, event: SolveEnded) -> tuple[Task, Plan]:
    vehicles = [
        Vehicle(offer.vehicle, offer.start_m, offer.budget_pct, offer.consumption, offer.airborne)
        for offer in solve.survivors
    ]
    task = open_task(ground.network, solve.open_segments, vehicles, ground.travel)
    number = {segment: index for index, segment in enumerate(task.segment_ids)}
    visits = {route.vehicle: task.from_network(route.visits) for route in event.routes or ()}
    routes = tuple(Route(index, visits.get(vehicle.name, ())) for index, vehicle in enumerate(vehicles))
    return task, Plan(routes, tuple(number[segment] for segment in event.uncovered))


class _Interrupts:
    """Ctrl-C once leaves the vehicles on their missions, twice sends them home."""

    def __init__(self, flight: Flight, console: Console) -> None:
        self._flight = flight
        self._console = console
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self.left: list[bool] = []

    def __enter__(self) -> list[bool]:
        with suppress(NotImplementedError):
            self._loop.add_signal_handler(signal.SIGINT, self._pressed)
        return self.left

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()
        with suppress(NotImplementedError):
            self._loop.remove_signal_handler(signal.SIGINT)

    def _pressed(self) -> None:
        if self._timer is None:
            text = f"Ctrl-C: the vehicles stay on their missions; once more within {LEAVE_AFTER_S:g} s sends them home"
            self._console.say(Level.WARNING, text)
            self._timer = self._loop.call_later(LEAVE_AFTER_S, self._leave)
            return
        self._timer.cancel()
        self._flight.apply(ReturnAllOrdered())

    def _leave(self) -> None:
        self.left.append(True)
        self._console.say(Level.WARNING, LEFT)
        self._flight.leave()
