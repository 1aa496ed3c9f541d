"""Wires the parts together for one flight; holds no rule."""

from __future__ import annotations

import asyncio
import gc
import shutil
import signal
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    contextmanager,
    nullcontext,
    suppress,
)
from dataclasses import dataclass

from executor import build, changes, serving
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog
from executor.adapters.mavlink import endpoints
from executor.adapters.mavlink.codec import Codec
from executor.adapters.mavsdk import link as mavsdk
from executor.adapters.rundir import locked, write_json
from executor.adapters.solver import SolverProcess, SolverSetup
from executor.adapters.tlog import TelemetryLog
from executor.build import Ground
from executor.checklist import checklist
from executor.config import Site, VehicleTable, signing_key
from executor.core import fleet, preflight
from executor.core.commands import Level, Say
from executor.core.context import Context
from executor.core.events import Asked, IntentReceived, Reopened, ReturnAllOrdered
from executor.core.failsafes import link_failsafe
from executor.core.intents import Action
from executor.core.parameters import Proposal
from executor.core.ports import Keyring, LinkOrder, OpenLink
from executor.core.preflight import Check, Facts, Severity
from executor.core.state import CheckLine, FleetState
from executor.core.vehicle import OnBoard, aboard
from executor.core.view import fleet_view
from executor.errors import PreflightFailed
from executor.keeper import NOTHING_LEFT, Keeper, Legacy, in_force
from executor.kept import reported
from executor.order import Console, Order
from executor.planwords import route_words, summary
from executor.publishing import Publication
from executor.report import Said, report_of, vehicles_of
from executor.runtime import preflight as asking
from executor.runtime.flight import Flight, keep_heartbeat
from executor.runtime.outlook import keep_judging
from missions import (
    FlightSetup,
    dialect_for,
    encode,
)

LOADED_AT_ONCE = 10
"""Vehicles that are given their first mission at the same time: a radio has its limits, and so has a simulator."""
LEAVE_AFTER_S = 5.0
"""Real seconds after the first Ctrl-C in which a second one still means 'send them home'."""


LEFT = "supervision ends; the vehicles go on with what they do, unless a GCS failsafe that is set on them acts"


@dataclass(frozen=True, slots=True)
class Flown:
    """What is left after a flight."""

    report: Mapping[str, object]
    context: Context
    left: bool
    """Whether the operator left while the vehicles flew on."""


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
    try:
        _must_not_stop(found)
    except PreflightFailed:
        await changes.give_back(run, links, clock, console)  # of an earlier attempt in this directory
        raise
    proposal = await changes.read_changes(context, links, clock)
    console.checks(proposal.checks)
    found += proposal.checks
    state = fleet.initial(boards, tuple(CheckLine(one.severity.value, one.subject, one.text) for one in found))
    log = EventLog(run / "events.jsonl", began_unix_s=clock.began_unix_s, speedup=clock.speedup, told=telling(console))
    seat = Cockpit(context, state, links, clock, log, solver, Said(facts, found))
    flown: Flown | None = None
    try:
        flown = await supervise(order, console, seat, Beginning(proposal, boards, found))
    except PreflightFailed:
        (run / "events.jsonl").unlink(missing_ok=True)  # there is nothing to be taken up again
        raise
    finally:
        if flown is None:
            # Nothing stays changed for a flight that is not flown; who flies all the same is armed, and left alone.
            await changes.give_back(run, links, clock, console)
    return flown


def _must_not_stop(found: Sequence[Check]) -> None:
    stops = [check for check in found if check.severity is Severity.STOP]
    if stops:
        raise PreflightFailed(f"{stops[0].subject}: {stops[0].text}")


@dataclass(frozen=True, slots=True)
class Beginning:
    """What has to be done before a flight that begins."""

    proposal: Proposal
    boards: Mapping[str, OnBoard | None]
    found: list[Check]
    """The checklist so far."""


async def _begun(order: Order, console: Console, seat: Cockpit, flight: Flight, beginning: Beginning) -> None:
    """Tell what the flight changes on board, ask, set it, put the missions on board, and ask for the take-off.

    Raises:
        PreflightFailed: the operator did not say yes, or something cannot be put on board.
    """
    context, links, clock, proposal = seat.context, seat.links, seat.clock, beginning.proposal
    if proposal.changes:
        text = changes.question(proposal)
        if not await _asked(flight, console, Action.PREPARE, text, changes.lines(proposal)):
            raise PreflightFailed("the operator did not say yes; nothing was changed on board")
    beginning.found.extend(await changes.apply_changes(order.run, proposal, context, links, clock, console))
    await _load(context, links, clock, beginning.boards, console)
    write_json(order.run / "vehicles.json", vehicles_of(context, seat.said))
    text = f"All missions are on board and read back: {summary(order.plan)}. Take off?"
    if not await _asked(flight, console, Action.TAKE_OFF, text, tuple(route_words(order.plan))):
        raise PreflightFailed("the operator did not say yes; nothing has moved")


async def _asked(flight: Flight, console: Console, action: Action, text: str, lines: Sequence[str] = ()) -> bool:
    """Ask the crew, in the terminal and on the page; the first answer counts."""
    flight.apply(Asked(action.value, text, tuple(lines)))
    answers = {asyncio.ensure_future(console.ask(text)), asyncio.ensure_future(flight.answered(action))}
    try:
        done, _ = await asyncio.wait(answers, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for answer in answers:
            answer.cancel()
    return any(answer.result() for answer in done)


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
    legacy: Legacy = NOTHING_LEFT
    """What the process before this one left."""


async def supervise(order: Order, console: Console, seat: Cockpit, begins: Beginning | Reopened) -> Flown:
    """Begin a flight, or take one up again that was left in the midst; fly it to its end and report.

    Raises:
        PreflightFailed: the operator did not say yes.
        ConnectionFailed: in a group, when a flight is taken up again and nobody answers.
    """
    context, clock, links = seat.context, seat.clock, seat.links
    publication = None if order.mqtt is None else Publication(order.mqtt, order.run, clock)
    keeper = Keeper(order, context, console, seat.log, clock, publication, seat.legacy)
    if publication is not None:
        publication.plan(seat.state.revision, in_force(order, seat.state.revision))
    flight = Flight(context, seat.state, links, clock, seat.log, seat.solver, keeper.observer())
    try:
        listening = flight.listening() if isinstance(begins, Beginning) else nullcontext()
        with listening, _Interrupts(flight, console) as interrupts:
            async with (
                serving.page(order.site.web, flight, clock, console),
                _published(publication, flight, keeper, clock),
            ):
                reopened = begins if isinstance(begins, Reopened) else None
                if isinstance(begins, Beginning):
                    await interrupts.unless_pressed(_begun(order, console, seat, flight, begins))
                with _settled_memory():
                    async with _beside(keep_judging(flight, seat.solver)):
                        await flight.run(reopened, order.site.flight.connect_timeout_s)
                        await keeper.settle()
    finally:
        console.done()
        seat.log.close()
    ended_s = clock.now_s()
    given_back = await changes.give_back(order.run, links, clock, console)
    frames = {name: link.counts for name, link in links.items()}
    report = report_of(context, flight.state, ended_s, order.truths(clock), frames, seat.said, reported(given_back))
    try:
        write_json(order.run / "report.json", report)
    except OSError as error:
        console.say(Level.WARNING, f"report.json cannot be written: {error.strerror}")
    return Flown(report, context, interrupts.left)


def _published(
    publication: Publication | None, flight: Flight, keeper: Keeper, clock: SystemClock
) -> AbstractAsyncContextManager[None]:
    if publication is None:
        return nullcontext()
    return publication.running(
        view=lambda: fleet_view(flight.context, flight.state, clock.now_s()),
        accept=lambda intent: flight.apply(IntentReceived(intent)),
        tell=lambda level, text: keeper.told(Say(level, text), clock.now_s()),
    )


@contextmanager
def _settled_memory() -> Iterator[None]:
    """Keep the collector of cycles away from what was there before the flight: one look at all of it takes 80 ms."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


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
    return (
        context,
        boards,
        checklist(
            order.site, order.plan, context, facts, own, boards, shutil.disk_usage(order.run).free, ground.worth_a_look
        ),
    )


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
) -> None:
    turn = asyncio.Semaphore(LOADED_AT_ONCE)

    async def one(name: str, board: OnBoard) -> None:
        async with turn:
            await load(name, board)

    async def load(name: str, board: OnBoard) -> None:
        dialect = context.vehicles[name].dialect
        mission = encode(board.path, dialect)
        await asking.load(name, links[name], clock, dialect, mission)
        console.say(Level.INFO, f"{name}: {len(mission.items)} mission items on board, read back the same")

    async with asyncio.TaskGroup() as tasks:
        for name, board in boards.items():
            if board is not None:
                tasks.create_task(one(name, board))


class _Interrupts:
    """Ctrl-C: before the take-off it ends everything.

    Then once leaves the vehicles on their missions, twice sends them home, three times ends the supervision at once.
    """

    def __init__(self, flight: Flight, console: Console) -> None:
        self._flight = flight
        self._console = console
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._recalled = False
        self._declined = asyncio.Event()
        self.left = False

    def __enter__(self) -> _Interrupts:
        with suppress(NotImplementedError):
            self._loop.add_signal_handler(signal.SIGINT, self._pressed)
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()
        with suppress(NotImplementedError):
            self._loop.remove_signal_handler(signal.SIGINT)

    async def unless_pressed(self, work: Coroutine[None, None, None]) -> None:
        """Do what comes before the take-off.

        Raises:
            PreflightFailed: Ctrl-C was pressed before it was done.
        """
        task, pressed = asyncio.ensure_future(work), asyncio.ensure_future(self._declined.wait())
        try:
            await asyncio.wait({task, pressed}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            pressed.cancel()
            ended = task.done()
            if not ended:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
        if not ended:
            raise PreflightFailed("Ctrl-C: nothing has moved")
        await task

    def _pressed(self) -> None:
        if self._flight.state.launched_s is None:
            self._declined.set()
        elif self._recalled:
            self._leave()
        elif self._timer is None:
            text = f"Ctrl-C: the vehicles stay on their missions; once more within {LEAVE_AFTER_S:g} s sends them home"
            self._console.say(Level.WARNING, text)
            self._timer = self._loop.call_later(LEAVE_AFTER_S, self._leave)
        else:
            self._timer.cancel()
            self._recalled = True
            self._flight.apply(ReturnAllOrdered())
            self._console.say(Level.WARNING, "once more ends the supervision; the vehicles come home by themselves")

    def _leave(self) -> None:
        self.left = True
        self._console.say(Level.WARNING, LEFT)
        self._flight.leave()
