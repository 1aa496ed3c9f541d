"""Resume a flight from its run directory, after a crash of the ground station or on another computer."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from executor import supervised
from executor.adapters import eventlog
from executor.adapters.clock import SystemClock
from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.analysis import documents
from executor.analysis.report import NOTHING_SAID, build_report
from executor.core import fleet_step
from executor.core.interface.commands import Command, Level, Say, Solve
from executor.core.interface.events import Reopened, SolveEnded
from executor.core.state.fleet_state import FleetState
from executor.errors import LogError
from executor.flight import flight_recorder, run_flight, run_start
from executor.flight.open_links import follow_fleet_time, open_links
from executor.flight.restore_vehicles import PARAMETERS, build_parameter_rows
from executor.simulated.fault_truths import read_injected_faults
from executor.site.site_model import SiteModel
from missions import PlanFile

HEAD = b'{"format":"faultline-'
"""Start of a log's first line."""
LAUNCH = b'"LaunchOrdered"'
"""Text that only the line of a launch contains; in a message the quotation marks would be escaped."""


@dataclass(frozen=True, slots=True)
class InterruptedRun:
    """State of a flight at the end of its log."""

    begun: run_start.RunStart
    head: eventlog.LogHeader
    state: FleetState
    last_s: float
    """Time of the last recorded event."""
    lines: int
    """Number of complete lines in the log."""
    notes: tuple[str, ...]
    """Defects of the log or its checkpoints."""
    undone: tuple[Command, ...]
    """Last decisions without a record that they were carried out."""
    legacy: flight_recorder.InheritedRecord


@dataclass(frozen=True, slots=True)
class ResumePlan:
    """Data of an interrupted flight before its log is read: enough to send its vehicles our heartbeat."""

    request: run_start.FlightRequest
    head: eventlog.LogHeader
    found: flight_recorder.FoundCheckpoint
    """Valid checkpoint, if there is one."""
    last_s: float
    """Time of the last recorded event."""
    set_s: float
    """Sum of the steps of the computer's clock during the flight."""


def read_resume_plan(run: Path) -> run_start.FlightRequest | ResumePlan:
    """Return what is known of a flight without reading its log, as far as there is a checkpoint.

    A flight that was never launched starts over, as nothing has moved: it is a request again.

    Raises:
        LogError: the directory holds no flight, or one of a newer version.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    if not RunDirectory(run).site.exists() or not RunDirectory(run).plan_path(0).exists():
        raise LogError(f"{run}: expected a run directory with site.toml and plan-000.json; nothing was flown from here")
    path = RunDirectory(run).events
    found = flight_recorder.find_newest_checkpoint(run, path)
    launched = found.checkpoint is not None or _is_launched(run)
    request = _build_request(run, *run_start.read_site_and_plan(run))
    if not launched:
        return request
    known = found.checkpoint
    set_s = 0.0 if known is None else known.legacy.set_s
    set_s += eventlog.total_clock_step_s(path, None if known is None else known.place)
    last_s = eventlog.read_last_event_s(path) or 0.0
    return ResumePlan(request, eventlog.read_head(path), found, last_s, set_s)


def replay_interrupted_run(run: Path, known: ResumePlan, stopped: Callable[[], bool] = lambda: False) -> InterruptedRun:
    """Return a flight's last state, from its checkpoint and the log since; else from the whole log.

    Args:
        run: The run directory.
        known: Its initial data.
        stopped: Polled: whether the result is no longer needed.

    Raises:
        LogError: as `read_resume_plan`, or it was stopped.
    """
    path, checkpoint = RunDirectory(run).events, known.found.checkpoint
    begun = run_start.build_run_start(run, known.request.ground, known.request.plan)
    notes = list(known.found.notes)
    state, place, last_s = begun.state, None, 0.0
    solves: dict[int, Solve] = {}
    planned: list[flight_recorder.Planned] = []
    if checkpoint is not None:
        state, place, last_s = checkpoint.state, checkpoint.place, checkpoint.place.at_s
        planned, solve = list(checkpoint.legacy.unkept), checkpoint.legacy.solve
        solves = {} if solve is None else {solve.revision: solve}
    replayed = 0
    latest: tuple[Command, ...] = ()
    for last_s, event in eventlog.read_events(path, notes.append, place):
        if stopped():
            raise LogError(f"{path}: was not read to its end")
        latest = ()
        if isinstance(event, SolveEnded) and event.routes is not None and event.revision in solves:
            planned.append((solves[event.revision], event))
        # An internal error in one decision changed nothing in flight; it changes nothing here.
        with suppress(Exception):
            state, latest = fleet_step.step(begun.context, state, event, last_s)
            replayed += len(latest)
            solves |= {command.revision: command for command in latest if isinstance(command, Solve)}
    missing = replayed - sum(1 for _ in eventlog.read_decisions(path, place))
    undone = latest[-missing:] if 0 < missing <= len(latest) else ()
    unkept = tuple(one for one in planned if not flight_recorder.plan_path_of(run, one).exists())
    solve = solves[max(solves)] if solves else None
    legacy = flight_recorder.InheritedRecord(unkept, solve, known.set_s, known.found.name)
    lines = (0 if place is None else place.lines) + eventlog.count_lines_after(path, place)
    return InterruptedRun(begun, known.head, state, last_s, lines, tuple(notes), undone, legacy)


def read_finished_run(run: Path) -> InterruptedRun | None:
    """Return a flight whose log shows that supervision is complete; None if it does not, or there is no flight.

    Raises:
        LogError: as `read_resume_plan`.
    """
    if not RunDirectory(run).events.exists() or not eventlog.is_flight_finished(RunDirectory(run).events):
        return None
    known = read_resume_plan(run)
    left = replay_interrupted_run(run, known) if isinstance(known, ResumePlan) else None
    return left if left is not None and left.state.progress.finished else None


def _is_launched(run: Path) -> bool:
    """Return whether the log holds a launch; without one no vehicle was ordered to move."""
    path = RunDirectory(run).events
    if not path.exists() or path.stat().st_size == 0:
        return False
    with suppress(LogError):
        eventlog.read_head(path)
        with path.open("rb") as file:
            return any(LAUNCH in line[:200] and line.endswith(b"\n") for line in file)
    with path.open("rb") as file:
        line = file.readline()
    # Torn by a crash while the very first line was written; anything else is damage, and may have been a flight.
    torn = not line.endswith(b"\n") and (line.startswith(HEAD) or HEAD.startswith(line))
    if not torn:
        eventlog.read_head(path)  # raises with the reason
    return False


def describe_interrupted_run(left: InterruptedRun) -> list[str]:
    """Return the last state of a flight, for the crew to confirm."""
    state = left.state
    vehicles = [
        f"{vehicle.name} {vehicle.stage.value}" if vehicle.fault is None else f"{vehicle.name} at fault"
        for vehicle in state.vehicles.values()
    ]
    done = f"{len(state.coverage.inspected)} of {left.begun.context.segments} segments inspected"
    plan = state.replanning.replan
    under_way = [] if plan is None else [f"re-plan {plan.solve.revision} was under way: {plan.solve.trigger}"]
    return [*left.notes, f"left at {left.last_s:.0f} s with {done}: {', '.join(vehicles)}", *under_way]


def finish_report(run: Path, left: InterruptedRun) -> documents.FlightReport | None:
    """Return the report of a flight that has ended; None if supervision is not complete."""
    if not left.state.progress.finished:
        return None
    with suppress(LogError):
        return documents.FlightReport.read(RunDirectory(run).report)
    # The process died between the end of the flight and its report.
    parameters = build_parameter_rows(PARAMETERS.read(run))
    report = build_report(
        left.begun.context, left.state, left.last_s, said=_read_preflight_record(run), parameters=parameters
    )
    # Write errors are shown all the same.
    run_flight.write_results(run, left.begun.ground, left.begun.context, left.state, report, left.head.began_unix_s)
    return report


def _build_request(run: Path, ground: SiteModel, plan: PlanFile) -> run_start.FlightRequest:
    mqtt = run_start.read_mqtt_settings(ground.site.mqtt, run, str(RunDirectory(run).site))
    truths, day = partial(read_injected_faults, run), documents.read_flown_day_plan(run)
    return run_start.FlightRequest(ground.site, run, ground, plan, run, truths, mqtt=mqtt, day=day)


async def start_unlaunched_run(request: run_start.FlightRequest, console: run_start.Console) -> documents.FlightReport:
    """Fly a flight that was never launched.

    Raises:
        ExecutorError: as `app.fly`.
    """
    kept = RunDirectory(request.run)
    with lock_run_directory(request.run):  # in another process its checklist may be under way
        # The log holds its head at most; checkpoints would be another flight's.
        for file in (kept.events, *kept.checkpoints):
            file.unlink(missing_ok=True)
    console.say(Level.INFO, f"{request.run}: nothing was launched; the flight begins from its beginning")
    return await run_flight.run_flight(request, console)


def describe_before_resume(run: Path, known: ResumePlan) -> list[str]:
    """Return the summary of a flight before any order is sent; without a checkpoint only its end and its log's size.

    Raises:
        LogError: as `read_resume_plan`.
    """
    if known.found.checkpoint is not None:
        return describe_interrupted_run(replay_interrupted_run(run, known))
    size_mb = 1e-6 * RunDirectory(run).events.stat().st_size
    text = f"left at {known.last_s:.0f} s; its log of {size_mb:.0f} MB is read while the vehicles hear our heartbeat"
    return [*known.found.notes, text]


async def resume_flight(run: Path, console: run_start.Console, told: Sequence[str] = ()) -> documents.FlightReport:
    """Supervise an interrupted flight again, to its end.

    The links are opened first, and our heartbeat is sent: without it the vehicles' GCS failsafes act. The log is read
    meanwhile, in a thread.

    Args:
        run: The run directory.
        console: The operator's console; the operator has confirmed.
        told: Lines already shown.

    Raises:
        ExecutorError: another process flies it, no vehicle answers, or the directory cannot be used.
    """
    with lock_run_directory(run), supervised.watch_internal_errors(lambda text: console.say(Level.FAULT, text), run):
        known = read_resume_plan(run)  # no other process writes to it from here on
        if isinstance(known, run_start.FlightRequest):
            raise LogError(f"{run}: expected a flight that was launched")
        request = known.request
        async with AsyncExitStack() as stack:
            fleet = await stack.enter_async_context(follow_fleet_time(request.site, console))
            head = known.head
            clock = SystemClock.resume(
                head.speedup, head.began_unix_s, known.last_s, known.set_s, fleet.steady_s, fleet.date_unix_s()
            )
            links = await stack.enter_async_context(open_links(request, clock, strict=False))
            console.say(Level.INFO, f"the vehicles hear our heartbeat again; reading {RunDirectory(run).events}")
            await asyncio.to_thread(run_flight.load_optional_parts, request)
            left = await _replay_in_thread(run, known)
            report = finish_report(run, left)
            if report is not None:
                console.say(Level.INFO, f"{run}: this flight is over")
                return report
            for line in describe_interrupted_run(left):
                if line not in told:
                    console.say(Level.INFO, line)
            log = eventlog.EventLog(
                RunDirectory(run).events, told=partial(console.say, Level.WARNING), lines=left.lines
            )
            for command in left.undone:
                _note_undone_command(log, command, left.last_s)
            away_s = max(0.0, clock.now_s() - left.last_s)
            reopened = Reopened(time.time(), away_s, left.notes)
            # The planner's process starts while the vehicles are queried: they fly meanwhile.
            solver = run_flight.make_solver_process(request, console)
            starting = asyncio.ensure_future(stack.enter_async_context(solver))
            try:
                said = partial(_read_preflight_record, run)
                seat = flight_recorder.FlightSession(
                    request, console, left.begun.context, left.state, links, clock, log, solver, said, left.legacy
                )
                return await run_flight.supervise(seat, reopened)
            finally:
                await starting


async def _replay_in_thread(run: Path, known: ResumePlan) -> InterruptedRun:
    """Read the log in a thread that ends with its caller."""
    over = threading.Event()
    try:
        return await asyncio.to_thread(replay_interrupted_run, run, known, over.is_set)
    finally:
        over.set()


def _note_undone_command(log: eventlog.EventLog, command: Command, at_s: float) -> None:
    """Record the decision pending when the ground station died: the vehicles may not have received it."""
    if isinstance(command, Say):
        log.note(at_s, said=command.text, level=command.level.value, carried_out=False)
    else:
        log.note(at_s, command=eventlog.to_plain(command), carried_out=False)


def _read_preflight_record(run: Path) -> documents.AskedVehicles:
    with suppress(LogError):
        return documents.AskedVehicles.read(RunDirectory(run).vehicles)
    return NOTHING_SAID
