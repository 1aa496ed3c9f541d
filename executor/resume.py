"""A flight taken up again from its run directory, after the ground station died, or on another computer."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Mapping
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

from executor import app, serving, supervised
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog, Head, clock_set_s, read_decisions, read_events, read_head, to_plain
from executor.adapters.rundir import locked, write_json
from executor.app import Cockpit, Flown
from executor.begun import Beginning, beginning
from executor.build import Ground, ground_of
from executor.config import read_site
from executor.core import fleet
from executor.core.commands import Command, Level, Say, Solve
from executor.core.events import LaunchOrdered, Reopened, SolveEnded
from executor.core.state import FleetState
from executor.demo import happenings
from executor.errors import LogError
from executor.keeper import Planned, plan_path
from executor.kept import read_kept, reported
from executor.linking import open_links
from executor.order import Console, Order
from executor.planning import belongs
from executor.publishing import settings_of
from executor.report import Said, report_of
from missions import PlanFile, read_plan

LOG, PLAN, VEHICLES, REPORT = "events.jsonl", "plan-000.json", "vehicles.json", "report.json"


HEAD = b'{"format":"faultline-'
"""What the first line of a log begins with."""


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
    notes: tuple[str, ...]
    """What is wrong with the log."""
    undone: tuple[Command, ...]
    """What was decided last, and is not on record as carried out."""
    planned: tuple[Planned, ...] = ()
    """Every plan that was found."""
    set_s: float = 0.0
    """By how much the computer's time of day was set in the flight."""


def read_left(run: Path) -> Ready | Left:
    """Return how a flight was left.

    Raises:
        LogError: the directory holds no flight, or one of a newer version, or what it holds cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    if not (run / "site.toml").exists() or not (run / PLAN).exists():
        raise LogError(f"{run}: expected a run directory with site.toml and {PLAN}; nothing was flown from here")
    if not _launched(run):
        ground, plan = ground_of(read_site(run / "site.toml"), run), read_plan(run / PLAN)
        belongs(plan, ground, str(run / PLAN))
        return Ready(ground, plan)
    path, begun, notes = run / LOG, beginning(run), list[str]()
    state, last_s, replayed = begun.state, 0.0, 0
    latest: tuple[Command, ...] = ()
    solves: dict[int, Solve] = {}
    planned: list[Planned] = []
    for last_s, event in read_events(path, notes.append):
        latest = ()
        if isinstance(event, SolveEnded) and event.routes is not None and event.revision in solves:
            planned.append((solves[event.revision], event))
        # A mistake of ours in one decision changed nothing in flight; it changes nothing here.
        with suppress(Exception):
            state, latest = fleet.step(begun.context, state, event, last_s)
            replayed += len(latest)
            solves |= {command.revision: command for command in latest if isinstance(command, Solve)}
    missing = replayed - sum(1 for _ in read_decisions(path))
    undone = latest[-missing:] if 0 < missing <= len(latest) else ()
    return Left(begun, read_head(path), state, last_s, tuple(notes), undone, tuple(planned), clock_set_s(path))


def _launched(run: Path) -> bool:
    """Return whether the log holds a launch; without one nothing was told to move."""
    path = run / LOG
    if not path.exists() or path.stat().st_size == 0:
        return False
    with suppress(LogError):
        read_head(path)
        return any(isinstance(event, LaunchOrdered) for _, event in read_events(path, lambda _: None))
    with path.open("rb") as file:
        line = file.readline()
    # Torn by a death while the very first line was written; anything else is damage, and may have been a flight.
    torn = not line.endswith(b"\n") and (line.startswith(HEAD) or HEAD.startswith(line))
    if not torn:
        read_head(path)  # says what is wrong with it
    return False


def words(left: Left) -> list[str]:
    """Return how a flight was left, for whoever must say yes."""
    state = left.state
    vehicles = [
        f"{vehicle.name} {vehicle.stage.value}" if vehicle.fault is None else f"{vehicle.name} at fault"
        for vehicle in state.vehicles.values()
    ]
    done = f"{len(state.inspected)} of {left.begun.context.segments} segments inspected"
    plan = state.replan
    under_way = [] if plan is None else [f"re-plan {plan.solve.revision} was under way: {plan.solve.trigger}"]
    return [*left.notes, f"left at {left.last_s:.0f} s with {done}: {', '.join(vehicles)}", *under_way]


def over(run: Path, left: Left) -> Mapping[str, object] | None:
    """Return the report of a flight that has ended; None if there is something left to supervise."""
    if not left.state.finished:
        return None
    with suppress(OSError, ValueError, RecursionError):
        report = json.loads((run / REPORT).read_text(encoding="utf-8"))
        if isinstance(report, dict):
            return report
    # It died between the end of the flight and its report.
    parameters = reported(read_kept(run) or ())
    report = report_of(left.begun.context, left.state, left.last_s, said=_said(run), parameters=parameters)
    with suppress(OSError):  # it is shown all the same
        write_json(run / REPORT, report)
    return report


def order_of(run: Path, ground: Ground, plan: PlanFile) -> Order:
    """Return the order to fly what a run directory describes."""
    mqtt = settings_of(ground.site.mqtt, run, str(run / "site.toml"))
    return Order(ground.site, run, ground, plan, run, lambda clock: happenings(run, clock), mqtt)


async def begin_again(run: Path, ready: Ready, console: Console) -> Flown:
    """Fly a flight that was never launched.

    Raises:
        ExecutorError: as `app.fly`.
    """
    (run / LOG).unlink(missing_ok=True)  # its head at most
    console.say(Level.INFO, f"{run}: nothing was launched; the flight begins from its beginning")
    return await app.fly(order_of(run, ready.ground, ready.plan), console)


async def take_up(run: Path, console: Console) -> Flown:
    """Supervise a flight again that was left in the midst, to its end.

    Raises:
        ExecutorError: another process flies it, nobody answers, or the directory cannot be used.
    """
    with locked(run), supervised.hear(lambda text: console.say(Level.FAULT, text), run):
        left = read_left(run)  # now that nobody else writes to it
        if isinstance(left, Ready):
            raise LogError(f"{run}: expected a flight that was launched")
        order = order_of(run, left.begun.ground, left.begun.plan)
        serving.check(order.site.web)
        clock = SystemClock.again(left.head.speedup, left.head.began_unix_s, left.last_s, left.set_s)
        log = EventLog(run / LOG, told=app.telling(console))
        for command in left.undone:
            _note(log, command, left.last_s)
        away_s = max(0.0, clock.now_s() - left.last_s)
        reopened = Reopened(time.time(), away_s, left.notes)
        async with AsyncExitStack() as stack:
            links = await stack.enter_async_context(open_links(order, clock))
            # The planner's process starts while the vehicles are asked: they fly meanwhile.
            solver = app.solver_of(order, left.begun.ground, console)
            starting = asyncio.ensure_future(stack.enter_async_context(solver))
            try:
                said, unkept = _said(run), tuple(one for one in left.planned if not plan_path(run, one).exists())
                seat = Cockpit(left.begun.context, left.state, links, clock, log, solver, said, unkept)
                return await app.supervise(order, console, seat, reopened)
            finally:
                await starting


def _note(log: EventLog, command: Command, at_s: float) -> None:
    """Write down what was decided when the ground station died: the vehicles may not know of it."""
    if isinstance(command, Say):
        log.note(at_s, said=command.text, level=command.level.value, carried_out=False)
    else:
        log.note(at_s, command=to_plain(command), carried_out=False)


def _said(run: Path) -> Said:
    """Return what was known before the flight, as vehicles.json has it."""
    with suppress(OSError, ValueError, RecursionError):
        kept = json.loads((run / VEHICLES).read_text(encoding="utf-8"))
        if isinstance(kept, dict):
            return Said({}, (), kept)
    return Said({}, ())
