"""A flight taken up again from its run directory, after the ground station died, or on another computer."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from executor import supervised
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog, Head, clock_set_s, read_decisions, read_events, read_head, to_plain
from executor.adapters.extras import Extra, what_to_install
from executor.adapters.logend import last_event_s, lines_after, says_it_is_over
from executor.adapters.run_directory import RunDirectory, locked
from executor.analysis.documents import FlightReport, read_asked, read_report
from executor.analysis.learned import began_with
from executor.analysis.report import NOTHING_SAID, Said, report_of
from executor.core import fleet
from executor.core.commands import Command, Level, Say, Solve
from executor.core.events import Reopened, SolveEnded
from executor.core.state import FleetState
from executor.errors import LogError
from executor.flight import fly
from executor.flight.broker import Settings, settings_of
from executor.flight.changed_parameters import parameters_report, read_kept
from executor.flight.checkpoints import FoundCheckpoint, Planned, newest
from executor.flight.flight_order import Console, Order, keep_learned
from executor.flight.fly import Cockpit, FlightResult
from executor.flight.linking import open_links
from executor.flight.recorder import Legacy, plan_path
from executor.flight.run_start import Beginning, beginning, day_rules_of
from executor.flight.together import time_of
from executor.images.store import index_of, write_index
from executor.simulated.injected import happenings
from executor.site.assembly import Ground, ground_of
from executor.site.config import read_site
from executor.site.planning import belongs
from missions import PlanFile, read_plan

HEAD = b'{"format":"faultline-'
"""What the first line of a log begins with."""
LAUNCH = b'"LaunchOrdered"'
"""What stands in the line of a launch; within a text the quotation marks would be escaped."""


@dataclass(frozen=True, slots=True)
class Ready:
    """A run directory of a flight that was never launched: nothing has moved, so it begins from its beginning."""

    ground: Ground
    plan: PlanFile


@dataclass(frozen=True, slots=True)
class Left:
    """A flight as its log ends."""

    begun: Beginning
    head: Head
    state: FleetState
    last_s: float
    """The last time that is on record."""
    lines: int
    """Of the log, as far as they are whole."""
    notes: tuple[str, ...]
    """What is wrong with the log, or with its checkpoints."""
    undone: tuple[Command, ...]
    """What was decided last, and is not on record as carried out."""
    legacy: Legacy


@dataclass(frozen=True, slots=True)
class Outset:
    """What is known of a flight that was left before its log is read: enough to be heard by its vehicles."""

    order: Order
    head: Head
    found: FoundCheckpoint
    """Its checkpoint, if there is a good one."""
    last_s: float
    """The last time that is on record."""
    set_s: float
    """By how much the computer's time of day was set in the flight."""


def outset(run: Path) -> Ready | Outset:
    """Return what is known of a flight without reading its log, as far as there is a checkpoint.

    Raises:
        LogError: the directory holds no flight, or one of a newer version.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    if not RunDirectory(run).site.exists() or not RunDirectory(run).plan(0).exists():
        raise LogError(f"{run}: expected a run directory with site.toml and plan-000.json; nothing was flown from here")
    path = RunDirectory(run).events
    found = newest(run, path)
    launched = found.checkpoint is not None or _launched(run)
    ground, plan = (
        ground_of(read_site(RunDirectory(run).site), run, began_with(run)),
        read_plan(RunDirectory(run).plan(0)),
    )
    belongs(plan, ground, str(RunDirectory(run).plan(0)))
    if not launched:
        return Ready(ground, plan)
    known = found.checkpoint
    set_s = clock_set_s(path) if known is None else known.set_s + clock_set_s(path, known.place)
    last_s = last_event_s(path) or 0.0
    return Outset(_order_in_the_air(run, ground, plan), read_head(path), found, last_s, set_s)


def read_left(run: Path) -> Ready | Left:
    """Return how a flight was left.

    Raises:
        LogError: as `outset`, or what the directory holds cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    known = outset(run)
    return known if isinstance(known, Ready) else read_rest(run, known)


def read_rest(run: Path, known: Outset, stopped: Callable[[], bool] = lambda: False) -> Left:
    """Return how a flight was left, by its checkpoint and what its log holds since; else by the whole log.

    Args:
        run: The run directory.
        known: Its outset.
        stopped: Asked again and again: whether nobody waits for it any more.

    Raises:
        LogError: as `read_left`, or it was stopped.
    """
    path, begun, checkpoint = RunDirectory(run).events, beginning(run), known.found.checkpoint
    notes = list(known.found.notes)
    state, place, last_s = begun.state, None, 0.0
    solves: dict[int, Solve] = {}
    planned: list[Planned] = []
    if checkpoint is not None:
        state, place, last_s = checkpoint.state, checkpoint.place, checkpoint.place.at_s
        solves = {} if checkpoint.solve is None else {checkpoint.solve.revision: checkpoint.solve}
        planned = list(checkpoint.unkept)
    replayed = 0
    latest: tuple[Command, ...] = ()
    for last_s, event in read_events(path, notes.append, place):
        if stopped():
            raise LogError(f"{path}: was not read to its end")
        latest = ()
        if isinstance(event, SolveEnded) and event.routes is not None and event.revision in solves:
            planned.append((solves[event.revision], event))
        # A mistake of ours in one decision changed nothing in flight; it changes nothing here.
        with suppress(Exception):
            state, latest = fleet.step(begun.context, state, event, last_s)
            replayed += len(latest)
            solves |= {command.revision: command for command in latest if isinstance(command, Solve)}
    missing = replayed - sum(1 for _ in read_decisions(path, place))
    undone = latest[-missing:] if 0 < missing <= len(latest) else ()
    unkept = tuple(one for one in planned if not plan_path(run, one).exists())
    solve = solves[max(solves)] if solves else None
    legacy = Legacy(unkept, solve, known.set_s, known.found.name)
    lines = (0 if place is None else place.lines) + lines_after(path, place)
    return Left(begun, known.head, state, last_s, lines, tuple(notes), undone, legacy)


def ended(run: Path) -> Left | None:
    """Return a flight whose log says that nothing is left to supervise; None if it does not, or there is none.

    Raises:
        LogError: as `read_left`.
    """
    if not RunDirectory(run).events.exists() or not says_it_is_over(RunDirectory(run).events):
        return None
    left = read_left(run)
    return left if isinstance(left, Left) and left.state.progress.finished else None


def _launched(run: Path) -> bool:
    """Return whether the log holds a launch; without one nothing was told to move."""
    path = RunDirectory(run).events
    if not path.exists() or path.stat().st_size == 0:
        return False
    with suppress(LogError):
        read_head(path)
        with path.open("rb") as file:
            return any(LAUNCH in line[:200] and line.endswith(b"\n") for line in file)
    with path.open("rb") as file:
        line = file.readline()
    # Torn by a death while the very first line was written; anything else is damage, and may have been a flight.
    torn = not line.endswith(b"\n") and (line.startswith(HEAD) or HEAD.startswith(line))
    if not torn:
        read_head(path)  # says what is wrong with it
    return False


def how_it_was_left(left: Left) -> list[str]:
    """Return how a flight was left, for the crew to confirm."""
    state = left.state
    vehicles = [
        f"{vehicle.name} {vehicle.stage.value}" if vehicle.fault is None else f"{vehicle.name} at fault"
        for vehicle in state.vehicles.values()
    ]
    done = f"{len(state.coverage.inspected)} of {left.begun.context.segments} segments inspected"
    plan = state.replanning.replan
    under_way = [] if plan is None else [f"re-plan {plan.solve.revision} was under way: {plan.solve.trigger}"]
    return [*left.notes, f"left at {left.last_s:.0f} s with {done}: {', '.join(vehicles)}", *under_way]


def over(run: Path, left: Left) -> FlightReport | None:
    """Return the report of a flight that has ended; None if there is something left to supervise."""
    if not left.state.progress.finished:
        return None
    with suppress(LogError):
        return read_report(run)
    # It died between the end of the flight and its report.
    parameters = parameters_report(read_kept(run) or ())
    report = report_of(left.begun.context, left.state, left.last_s, said=_said(run), parameters=parameters)
    with suppress(OSError):  # it is shown all the same
        keep_learned(run, left.begun.context, left.state, left.begun.ground.learned)
        report.write(RunDirectory(run).report)
        if left.begun.context.setup.looks:
            write_index(run, index_of(left.begun.context, left.state, left.head.began_unix_s))
    return report


def order_of(run: Path, ground: Ground, plan: PlanFile) -> Order:
    """Return the order to fly what a run directory describes."""
    return replace(_unpublished(run, ground, plan), mqtt=_broker(run, ground))


def _unpublished(run: Path, ground: Ground, plan: PlanFile) -> Order:
    return Order(ground.site, run, ground, plan, run, lambda clock: happenings(run, clock), day=day_rules_of(run))


def _broker(run: Path, ground: Ground) -> Settings | None:
    return settings_of(ground.site.mqtt, run, str(RunDirectory(run).site))


def _order_in_the_air(run: Path, ground: Ground, plan: PlanFile) -> Order:
    """Return the order of a flight that was launched: it is taken up though it cannot be published."""
    order = _unpublished(run, ground, plan)
    return order if what_to_install(Extra.MQTT, "[mqtt]") else replace(order, mqtt=_broker(run, ground))


async def begin_again(run: Path, ready: Ready, console: Console) -> FlightResult:
    """Fly a flight that was never launched.

    Raises:
        ExecutorError: as `app.fly`.
    """
    kept = RunDirectory(run)
    for file in (
        kept.events,
        *kept.checkpoints,
    ):  # the log holds its head at most; checkpoints would be another flight's
        file.unlink(missing_ok=True)
    console.say(Level.INFO, f"{run}: nothing was launched; the flight begins from its beginning")
    return await fly.fly(order_of(run, ready.ground, ready.plan), console)


def beforehand(run: Path, known: Outset) -> list[str]:
    """Return what there is to say of a flight before anybody is told anything: the less, the longer its log is.

    Raises:
        LogError: as `read_left`.
    """
    if known.found.checkpoint is not None:
        return how_it_was_left(read_rest(run, known))
    size_mb = 1e-6 * RunDirectory(run).events.stat().st_size
    text = f"left at {known.last_s:.0f} s; its log of {size_mb:.0f} MB is read while the vehicles hear our heartbeat"
    return [*known.found.notes, text]


async def take_up(run: Path, console: Console, told: Sequence[str] = ()) -> FlightResult:
    """Supervise a flight again that was left in the midst, to its end.

    The links are opened first, and our heartbeat goes out: without it the vehicles' own failsafes act. The log is read
    meanwhile, in a thread.

    Args:
        run: The run directory.
        console: Where the operator looks, who has said yes.
        told: What was said already.

    Raises:
        ExecutorError: another process flies it, nobody answers, or the directory cannot be used.
    """
    with locked(run), supervised.hear(lambda text: console.say(Level.FAULT, text), run):
        known = outset(run)  # now that nobody else writes to it
        if isinstance(known, Ready):
            raise LogError(f"{run}: expected a flight that was launched")
        order = known.order
        if order.mqtt is None and order.site.mqtt is not None:
            why = what_to_install(Extra.MQTT, f"[mqtt] in {RunDirectory(run).site}")
            console.say(Level.WARNING, f"{why}; the flight goes on unpublished")
        async with AsyncExitStack() as stack:
            found = await stack.enter_async_context(time_of(order.site, console))
            head = known.head
            clock = SystemClock.again(
                head.speedup, head.began_unix_s, known.last_s, known.set_s, found.steady, found.date_unix_s()
            )
            links = await stack.enter_async_context(open_links(order, clock))
            console.say(Level.INFO, f"the vehicles hear our heartbeat again; reading {RunDirectory(run).events}")
            await asyncio.to_thread(fly.load_parts, order)
            left = await _read(run, known)
            report = over(run, left)
            if report is not None:
                console.say(Level.INFO, f"{run}: this flight is over")
                return FlightResult(report, left.begun.context, left=False)
            for line in how_it_was_left(left):
                if line not in told:
                    console.say(Level.INFO, line)
            log = EventLog(RunDirectory(run).events, told=fly.telling(console), lines=left.lines)
            for command in left.undone:
                _note(log, command, left.last_s)
            away_s = max(0.0, clock.now_s() - left.last_s)
            reopened = Reopened(time.time(), away_s, left.notes)
            # The planner's process starts while the vehicles are asked: they fly meanwhile.
            solver = fly.solver_of(order, console)
            starting = asyncio.ensure_future(stack.enter_async_context(solver))
            try:
                seat = Cockpit(left.begun.context, left.state, links, clock, log, solver, _said(run), left.legacy)
                return await fly.supervise(order, console, seat, reopened)
            finally:
                await starting


async def _read(run: Path, known: Outset) -> Left:
    """Read the log in a thread, which ends with its caller."""
    over = threading.Event()
    try:
        return await asyncio.to_thread(read_rest, run, known, over.is_set)
    finally:
        over.set()


def _note(log: EventLog, command: Command, at_s: float) -> None:
    """Write down what was decided when the ground station died: the vehicles may not know of it."""
    if isinstance(command, Say):
        log.note(at_s, said=command.text, level=command.level.value, carried_out=False)
    else:
        log.note(at_s, command=to_plain(command), carried_out=False)


def _said(run: Path) -> Said:
    """Return what was known before the flight, as vehicles.json has it."""
    with suppress(LogError):
        return Said({}, (), kept=read_asked(run))
    return NOTHING_SAID
