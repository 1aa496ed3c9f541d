"""Tells of a flight: the operator, the event log, the plan files, the broker."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import CLOCK_SET, EventLog, LogPlace, to_plain
from executor.adapters.run_directory import RunDirectory
from executor.adapters.solver import REPLAN_COST, build_replan_task
from executor.core.context import Context
from executor.core.interface.commands import Command, Level, Say, Solve, Upload
from executor.core.interface.events import Event, SolveEnded, Tick
from executor.core.state.fleet_state import FleetState
from executor.errors import LogError
from executor.flight import prepare_vehicles
from executor.flight.checkpoints import Checkpoint, Checkpointer, Planned
from executor.flight.publication import Publication
from executor.flight.run_start import Console, FlightRequest
from executor.runtime.flight_loop import Observer
from executor.supervised import report_mistake
from missions import MissionsError, PlanFile, Pricing, SolverRecord, Task, make_plan_file, read_plan, write_plan
from planner import Plan, Route, segment_of

CLOCK_SET_S = 2.0
"""Smaller steps are drift or NTP corrections."""

SETTLE_S = 60.0
"""Real seconds that the plans may take to be kept at the end of a flight."""


@dataclass(frozen=True, slots=True)
class InheritedRecord:
    """What an earlier process leaves to the one that takes its flight up."""

    unkept: tuple[Planned, ...] = ()
    """Plans that it found, and did not keep in a file."""
    solve: Solve | None = None
    """The last that was to be solved."""
    set_s: float = 0.0
    """By how much the computer's time of day was set in the flight so far."""
    checkpoint: str = ""
    """The file that the flight was taken up from."""


NOTHING_LEFT = InheritedRecord()
"""Of a flight that begins."""


class FlightRecorder:
    """Shows and keeps what happens: lines for the operator, notes in the log, a plan file for each revision."""

    def __init__(
        self,
        order: FlightRequest,
        context: Context,
        console: Console,
        log: EventLog,
        clock: SystemClock,
        publication: Publication,
        legacy: InheritedRecord = NOTHING_LEFT,
    ) -> None:
        """Name who is told."""
        self._order = order
        self._publication = publication
        self._context = context
        self._console = console
        self._log = log
        self._clock = clock
        self._solve = legacy.solve
        self._set_s = clock.clock_step_s()
        self._noted_set_s = legacy.set_s
        """What the log's notes come to."""
        self._launched_s: float | None = None
        self._state: FleetState | None = None
        self._unkept = list(legacy.unkept)
        """Plans that were found, and wait to be kept."""
        self._in_no_file = list(legacy.unkept)
        """Those, and what is just being kept."""
        self._keeping: set[asyncio.Task[None]] = set()
        self._checkpoints = Checkpointer(order.run, log, clock.speedup, self._warn, legacy.checkpoint)

    def build_observer(self) -> Observer:
        """Return what the flight tells of itself."""
        return Observer(self.show_line, self.record_event, self.record_decision, self.show_notice)

    def record_decision(self, command: Command, now_s: float) -> None:
        """Write a decision down, before it is carried out."""
        if not isinstance(command, Say):
            self._log.note(now_s, command=to_plain(command))
        if isinstance(command, Upload):
            try:
                prepare_vehicles.record_wider_fence(self._order.run, self._context, command)
            except (OSError, LogError) as error:
                self._warn(f"the new fence of {command.vehicle} is not on record: {error}")

    def show_line(self, line: Say, now_s: float) -> None:
        """Show, keep and publish a line."""
        self._log.note(now_s, said=line.text, level=line.level.value)
        self._show(line, now_s)

    def show_notice(self, line: Say, now_s: float) -> None:
        """Show and keep what nobody decided, such as that a broker went away: a replay does not look for it."""
        self._log.note(now_s, told=line.text, level=line.level.value)
        self._show(line, now_s)

    def _show(self, line: Say, now_s: float) -> None:
        """Show and publish a line by the clock that people go by, which begins with the order to take off."""
        flight_s = None if self._launched_s is None else now_s - self._launched_s
        self._console.say(line.level, line.text, flight_s)
        self._publication.publish_line(line, now_s, flight_s)

    def record_event(self, event: Event, state: FleetState, now_s: float) -> None:
        """Show the fleet after an event, and keep the plan that it brought."""
        self._launched_s, self._state = state.progress.launched_s, state
        if isinstance(event, Tick):
            self._record_clock_step(now_s)
        if state.replanning.replan is not None:
            self._solve = state.replanning.replan.solve
        if isinstance(event, SolveEnded) and event.routes is not None:
            solve = self._solve
            if solve is not None and event.revision == solve.revision:
                self._unkept.append((solve, event))
                self._in_no_file.append((solve, event))
        if self._unkept and (state.replanning.replan is None or state.replanning.replan.solve_s is None):
            self._write_plans()
        self._console.show(self._context, state, now_s)
        self._publication.publish_event(event, state)
        if self._checkpoints.is_due(state, now_s):
            # Between two events: what this one decides is in the log by then.
            asyncio.get_running_loop().call_soon(self._checkpoints.begin, now_s, self._build_checkpoint)

    def _build_checkpoint(self, place: LogPlace) -> Checkpoint:
        if self._state is None:
            raise RuntimeError("a checkpoint is due after an event")
        return Checkpoint(place, self._state, self._solve, tuple(self._in_no_file), self._noted_set_s)

    def _warn(self, text: str) -> None:
        self.show_notice(Say(Level.WARNING, text), self._clock.now_s())

    def _record_clock_step(self, now_s: float) -> None:
        """Write down that the time of day was set: the flight does not go by it, but its resumption does."""
        set_s = self._clock.clock_step_s()
        by_s = set_s - self._set_s
        if abs(by_s) < CLOCK_SET_S:
            return
        self._set_s = set_s
        self._noted_set_s += by_s
        self._log.note(now_s, **{CLOCK_SET: by_s})
        way = "forward" if by_s > 0 else "back"
        text = f"this computer's clock was set {way} by {abs(by_s):.0f} s; the flight's own time goes on"
        self.show_notice(Say(Level.WARNING, text), now_s)

    def _write_plans(self) -> None:
        """Keep what was planned, in a thread: for fifty vehicles it takes longer than the loop may be blocked.

        It waits until the new missions are on board, which are more urgent and need the same processor.
        """
        for planned in self._unkept:
            task = asyncio.create_task(self._write_plan(planned))
            self._keeping.add(task)
            task.add_done_callback(self._keeping.discard)
        self._unkept.clear()

    async def _write_plan(self, planned: Planned) -> None:
        try:
            content = await asyncio.to_thread(_build_plan_file, self._order, self._context.pricing, planned)
        except Exception as error:  # noqa: BLE001 - what keeps a plan is nothing that a flight may end for
            text = f"plan {planned[1].revision} could not be kept: {type(error).__name__}: {error}"
            self.show_notice(Say(Level.WARNING, text), self._clock.now_s())
            report_mistake("keeping a plan", error, said=True)
            return
        if plan_path_of(self._order.run, planned).exists():
            self._in_no_file.remove(planned)
        self._publication.publish_plan(planned[1].revision, content)

    async def settle(self) -> None:
        """Wait until everything is kept, but not for a disk that never answers."""
        self._write_plans()
        if self._keeping:
            _, waiting = await asyncio.wait(self._keeping, timeout=SETTLE_S)
            if waiting:
                text = f"{len(waiting)} plans are not on the disk after {SETTLE_S:g} s; they are in the event log"
                self.show_notice(Say(Level.WARNING, text), self._clock.now_s())
        await self._checkpoints.settle()


def plan_path_of(run: Path, planned: Planned) -> Path:
    """Return where a re-plan is kept."""
    return RunDirectory(run).plan_path(planned[1].revision)


def _build_plan_file(order: FlightRequest, pricing: Pricing, planned: Planned) -> PlanFile:
    """Return a re-plan as a plan file, and keep it where there is room."""
    ground, (solve, event) = order.ground, planned
    task, plan = _build_replan(pricing, solve, event)
    solved = SolverRecord(seed=order.plan.solved.seed, solver="search", seconds=event.solve_s)
    content = make_plan_file(
        ground.network, task, ground.travel, plan, REPLAN_COST, solved, inspection=ground.inspection,
    )  # fmt: skip
    content = replace(content.with_site_of(order.plan), says_distances=not ground.inspection.same_distance)
    with suppress(OSError):
        write_plan(plan_path_of(order.run, planned), content)
    return content


def _build_replan(pricing: Pricing, solve: Solve, event: SolveEnded) -> tuple[Task, Plan]:
    task, _ = build_replan_task(pricing, solve)
    visits = {route.vehicle: task.from_network(route.visits) for route in event.routes or ()}
    routes = tuple(Route(index, visits.get(offer.vehicle, ())) for index, offer in enumerate(solve.survivors))
    flown = {segment_of(visit) for route in routes for visit in route.visits}
    return task, Plan(routes, tuple(segment for segment in range(len(task.segment_ids)) if segment not in flown))


def read_plan_in_force(order: FlightRequest, revision: int) -> PlanFile:
    """Return the newest plan that is on record; a flight that is taken up again may have had several."""
    with suppress(OSError, MissionsError):
        if revision > 0:
            return read_plan(RunDirectory(order.run).plan_path(revision))
    return order.plan
