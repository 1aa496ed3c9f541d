"""Record a flight and report it: operator, event log, plan files, broker, checkpoints.

A checkpoint is the whole state at one position of the event log, so that resuming does not replay ten hours of it. The
log stays the only source of truth. A checkpoint only saves reading what precedes its position; on any doubt (another
program, another plan, another log, damage) it is discarded, and the previous one is used, or the whole log is read. It
is JSON, validated against the types of the state; a run directory may come from an untrusted source, so nothing is ever
unpickled. It is written in the background: the flight never waits for it.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

import missions
from executor import __version__
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import CLOCK_SET, DISK_S, EventLog, LogPlace, is_place_in_log, to_plain
from executor.adapters.run_directory import RunDirectory
from executor.adapters.solver import REPLAN_COST, SolverProcess, build_replan_task
from executor.analysis.documents import AskedVehicles
from executor.core.context import Context
from executor.core.interface.commands import Command, Level, Say, Solve, Upload
from executor.core.interface.events import Event, SolveEnded, Tick
from executor.core.interface.ports import OpenLink
from executor.core.replanning.survivors import find_blind_segments
from executor.core.state.bases import place_vehicles
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import VehicleState
from executor.errors import LogError
from executor.flight import preparation
from executor.flight.publication import Publication
from executor.flight.run_start import Console, FlightRequest
from executor.runtime.flight_loop import Observer
from executor.supervised import report_internal_error
from missions.files import write_whole
from planner import Plan, Route, segment_of

Planned = tuple[Solve, SolveEnded]
"""Planning problem and its answer."""


@dataclass(frozen=True, slots=True)
class InheritedRecord:
    """Record that an earlier process leaves to the process that resumes its flight."""

    unkept: tuple[Planned, ...] = ()
    """Plans found that may not be in a file yet."""
    solve: Solve | None = None
    """Last planning problem."""
    set_s: float = 0.0
    """Sum of the steps of the computer's clock during the flight."""
    checkpoint: str = ""
    """Checkpoint file that the flight was resumed from."""


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """State after replaying the log up to one position."""

    place: LogPlace
    state: FleetState
    legacy: InheritedRecord = field(default_factory=InheritedRecord)


@dataclass(frozen=True, slots=True)
class FoundCheckpoint:
    """Newest usable checkpoint of a run directory."""

    checkpoint: Checkpoint | None
    name: str
    """File name of the checkpoint; empty if there is none."""
    notes: tuple[str, ...]
    """Reasons why newer checkpoints were not used."""


class _Part(BaseModel):
    """One line of the file; strict, so that it reads back as written or fails."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, ser_json_inf_nan="constants", defer_build=True)


class _Head(_Part):
    format: Literal["faultline-checkpoint/2"] = "faultline-checkpoint/2"
    program: str
    """Version of the program that wrote it; another version may have another state or decide differently."""
    plan: str
    """Digest of the first plan."""
    place: LogPlace
    body: str
    """Digest of all other lines."""


class _Fleet(_Part):
    state: FleetState
    """State without vehicles; each vehicle has its own line."""
    legacy: InheritedRecord


class _Vehicle(_Part):
    vehicle: VehicleState


@cache
def describe_program() -> str:
    """Return the version of this program and the shape of its state."""
    shape = json.dumps([model.model_json_schema() for model in (_Fleet, _Vehicle)], sort_keys=True)
    return f"{__version__} {_compute_digest(shape.encode())[:16]}"


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, whole or not at all; called in a thread.

    Raises:
        OSError: it cannot be written.
    """
    write_whole(path, encode_checkpoint(checkpoint, RunDirectory(path.parent).plan_path(0).read_bytes()))


def encode_checkpoint(checkpoint: Checkpoint, plan: bytes) -> bytes:
    """Return the content of a checkpoint file.

    No step takes longer than one vehicle's state, so that the event loop, which shares the interpreter, waits for some
    milliseconds at most.

    Args:
        checkpoint: The checkpoint.
        plan: File of the flight's first plan.
    """
    body = encode_body(checkpoint.state, checkpoint.legacy)
    head = _Head(
        program=describe_program(),
        plan=_compute_digest(plan),
        place=checkpoint.place,
        body=_compute_digest(body),
    )
    return head.model_dump_json().encode() + b"\n" + body


def find_newest_checkpoint(run: Path, log: Path) -> FoundCheckpoint:
    """Return the newest checkpoint that fits a run directory's log."""
    notes: list[str] = []
    files: dict[str, tuple[_Head, bytes]] = {}
    for file in RunDirectory(run).checkpoints:
        name = file.name
        try:
            head, _, body = file.read_bytes().partition(b"\n")
            files[name] = _Head.model_validate_json(head), body
        except FileNotFoundError:
            continue
        except (OSError, ValueError) as error:
            notes.append(f"{name} is not used: {_describe_error(error)}")
    for name in sorted(files, key=lambda name: files[name][0].place.size, reverse=True):
        try:
            return FoundCheckpoint(_restore_checkpoint(run, log, *files[name]), name, tuple(notes))
        except (OSError, ValueError) as error:
            notes.append(f"{name} is not used: {_describe_error(error)}")
    if notes:
        notes.append("without a checkpoint the whole log is read")
    return FoundCheckpoint(None, "", tuple(notes))


def _restore_checkpoint(run: Path, log: Path, head: _Head, body: bytes) -> Checkpoint:
    """Return the content of a checkpoint file.

    Raises:
        ValueError: it does not fit, or is damaged.
    """
    if head.program != describe_program():
        raise ValueError("another version of the program wrote it")
    if head.plan != _compute_digest(RunDirectory(run).plan_path(0).read_bytes()):
        raise ValueError("it is of a flight with another plan")
    if head.body != _compute_digest(body):
        raise ValueError("it is torn or damaged")
    if not is_place_in_log(log, head.place):
        raise ValueError("the log does not reach as far, or is another one")
    state, legacy = decode_body(body)
    return Checkpoint(head.place, state, legacy)


def encode_body(state: FleetState, legacy: InheritedRecord) -> bytes:
    """Return the lines of a checkpoint after its head."""
    fleet = _Fleet.model_construct(state=replace(state, vehicles={}), legacy=legacy)
    parts: list[_Part] = [fleet, *(_Vehicle.model_construct(vehicle=vehicle) for vehicle in state.vehicles.values())]
    # Parts of the state that pydantic does not know are read-only mappings.
    return b"".join(part.model_dump_json(fallback=dict, warnings=False).encode() + b"\n" for part in parts)


def decode_body(body: bytes) -> tuple[FleetState, InheritedRecord]:
    """Return the arguments of `encode_body`."""
    first, *rest = body.splitlines()
    fleet = _Fleet.model_validate_json(first)
    vehicles = {row.name: row for row in (_Vehicle.model_validate_json(line).vehicle for line in rest)}
    return replace(fleet.state, vehicles=MappingProxyType(vehicles)), fleet.legacy


def _compute_digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _describe_error(error: Exception) -> str:
    if isinstance(error, ValidationError):
        return missions.format_first_error(error)
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)


EVERY_S = 30.0
"""Flight seconds between checkpoints; replaying that takes under a second, a quarter for six vehicles."""
EVERY_REAL_S = 5.0
"""Least real seconds between checkpoints of a fast simulation."""


class Checkpointer:
    """Write checkpoints one after another, in the background.

    States are immutable: the loop hands one over between two events, and a thread writes it. While one is being
    written, or a disk hangs, no other is begun.
    """

    def __init__(
        self,
        run: Path,
        log: EventLog,
        speedup: float,
        told: Callable[[str], None],
        taken: str = "",
    ) -> None:
        """Set the destination of the checkpoints.

        Args:
            run: The run directory.
            log: The event log that they refer to.
            speedup: Speedup of the flight.
            told: Called with a line for the operator when they cannot be written, and when they can again.
            taken: Checkpoint that the flight was resumed from, which is overwritten last.
        """
        self._files = RunDirectory(run).checkpoints
        self._log = log
        self._every_s = max(EVERY_S, EVERY_REAL_S * speedup)
        self._told = told
        self._next = 1 if taken == self._files[0].name else 0
        self._last_s: float | None = None
        self._writing: asyncio.Task[None] | None = None
        self._failing = False

    def is_due(self, state: FleetState, now_s: float) -> bool:
        """Return whether a checkpoint is due; never before the launch."""
        if state.progress.launched_s is None or self._writing is not None:
            return False
        return self._last_s is None or now_s - self._last_s >= self._every_s

    def begin(self, now_s: float, made: Callable[[LogPlace], Checkpoint]) -> None:
        """Begin to write a checkpoint; called between two events, when all decisions are in the log."""
        place = self._log.current_place()
        if place is None or self._writing is not None:
            return  # disk full: events waiting in memory are in no log yet
        self._last_s = now_s
        self._writing = asyncio.create_task(self._write(made(place)))

    async def _write(self, checkpoint: Checkpoint) -> None:
        try:
            await self._log.settle()  # a checkpoint that outlives its log in a power loss is useless
            await asyncio.to_thread(write_checkpoint, self._files[self._next], checkpoint)
            self._next = 1 - self._next
            self._report("checkpoints are written again", failing=False)
        except Exception as error:  # noqa: BLE001 - an internal error here may cost only time
            text = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error!s:.200}"
            self._report(f"no checkpoint can be written: {text}; resume would take longer", failing=True)
        finally:
            self._writing = None

    def _report(self, text: str, *, failing: bool) -> None:
        if failing is not self._failing:
            self._failing = failing
            self._told(text)

    async def settle(self) -> None:
        """Wait until nothing is being written, at most for the time limit of a disk."""
        if self._writing is not None:
            await asyncio.wait({self._writing}, timeout=DISK_S)


CLOCK_SET_S = 2.0
"""Smallest clock step to record; smaller ones are drift or NTP corrections."""

SETTLE_S = 60.0
"""Real seconds to wait at the end of a flight for plans to be written."""


@dataclass(frozen=True, slots=True)
class FlightSession:
    """All parts of a supervised flight."""

    request: FlightRequest
    console: Console
    context: Context
    state: FleetState
    """State before the launch, or when the ground station went down."""
    links: Mapping[str, OpenLink]
    clock: SystemClock
    log: EventLog
    solver: SolverProcess
    said: Callable[[], AskedVehicles]
    """Vehicle data from before the flight, with findings so far."""
    legacy: InheritedRecord = field(default_factory=InheritedRecord)
    """Record that the previous process left."""


class FlightRecorder:
    """Show and record a flight: lines for the operator, notes in the log, a plan file for each revision."""

    def __init__(self, seat: FlightSession, publication: Publication) -> None:
        self._seat = seat
        self._publication = publication
        self._solve = seat.legacy.solve
        self._set_s = seat.clock.clock_step_s()
        self._noted_set_s = seat.legacy.set_s
        """Sum of the clock steps noted in the log."""
        self._launched_s: float | None = None
        self._state: FleetState | None = None
        self._unkept = list(seat.legacy.unkept)
        """Plans waiting to be written."""
        self._in_no_file = list(seat.legacy.unkept)
        """Plans waiting to be written or being written."""
        self._keeping: set[asyncio.Task[None]] = set()
        self._checkpoints = Checkpointer(
            seat.request.run, seat.log, seat.clock.speedup, self._warn, seat.legacy.checkpoint
        )

    def build_observer(self) -> Observer:
        """Return the observer of the flight."""
        return Observer(self.show_line, self.record_event, self.record_decision, self.show_notice)

    def record_decision(self, command: Command, now_s: float) -> None:
        """Record a decision before it is executed."""
        if not isinstance(command, Say):
            self._seat.log.note(now_s, command=to_plain(command))
        if isinstance(command, Upload):
            try:
                preparation.record_wider_fence(self._seat.request.run, self._seat.context, command)
            except (OSError, LogError) as error:
                self._warn(f"the new fence of {command.vehicle} is not on record: {error}")

    def show_line(self, line: Say, now_s: float) -> None:
        """Show, record and publish a line."""
        self._seat.log.note(now_s, said=line.text, level=line.level.value)
        self._show(line, now_s)

    def show_notice(self, line: Say, now_s: float) -> None:
        """Show and record a line without a decision behind it, such as a lost broker: a replay does not expect it."""
        self._seat.log.note(now_s, told=line.text, level=line.level.value)
        self._show(line, now_s)

    def _show(self, line: Say, now_s: float) -> None:
        """Show and publish a line with the time since the take-off order."""
        flight_s = None if self._launched_s is None else now_s - self._launched_s
        self._seat.console.say(line.level, line.text, flight_s)
        self._publication.publish(lambda to: to.publish_line(line, now_s, flight_s))

    def record_event(self, event: Event, state: FleetState, now_s: float) -> None:
        """Show the fleet after an event, and record the plan that it brought."""
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
        self._seat.console.show(self._seat.context, state, now_s)
        self._publication.publish(lambda to: to.publish_event(event, state))
        if self._checkpoints.is_due(state, now_s):
            # Between two events: this event's decisions are in the log by then.
            asyncio.get_running_loop().call_soon(self._checkpoints.begin, now_s, self._build_checkpoint)

    def _build_checkpoint(self, place: LogPlace) -> Checkpoint:
        if self._state is None:
            raise RuntimeError("a checkpoint is due after an event")
        legacy = InheritedRecord(tuple(self._in_no_file), self._solve, self._noted_set_s)
        return Checkpoint(place, self._state, legacy)

    def _warn(self, text: str) -> None:
        self.show_notice(Say(Level.WARNING, text), self._seat.clock.now_s())

    def _record_clock_step(self, now_s: float) -> None:
        """Record that the computer's clock was set: the flight does not use it, but its resumption does."""
        set_s = self._seat.clock.clock_step_s()
        by_s = set_s - self._set_s
        if abs(by_s) < CLOCK_SET_S:
            return
        self._set_s = set_s
        self._noted_set_s += by_s
        self._seat.log.note(now_s, **{CLOCK_SET: by_s})
        way = "forward" if by_s > 0 else "back"
        text = f"this computer's clock was set {way} by {abs(by_s):.0f} s; the flight's own time continues"
        self.show_notice(Say(Level.WARNING, text), now_s)

    def _write_plans(self) -> None:
        """Write plan files in a thread: for fifty vehicles it takes longer than the loop may be blocked.

        It waits for the uploads of the new missions, which are more urgent and need the same processor.
        """
        for planned in self._unkept:
            task = asyncio.create_task(self._write_plan(planned))
            self._keeping.add(task)
            task.add_done_callback(self._keeping.discard)
        self._unkept.clear()

    async def _write_plan(self, planned: Planned) -> None:
        try:
            vehicles = () if self._state is None else self._state.vehicles.values()
            pricing = place_vehicles(self._seat.context, vehicles).pricing
            blind = {one.name: find_blind_segments(self._seat.context, one) for one in vehicles}
            content = await asyncio.to_thread(_build_plan_file, self._seat.request, pricing, blind, planned)
        except Exception as error:  # noqa: BLE001 - a failed plan file must not end a flight
            text = f"plan {planned[1].revision} could not be kept: {type(error).__name__}: {error}"
            self.show_notice(Say(Level.WARNING, text), self._seat.clock.now_s())
            report_internal_error("keeping a plan", error, said=True)
            return
        if plan_path_of(self._seat.request.run, planned).exists():
            self._in_no_file.remove(planned)
        self._publication.publish(
            lambda to: to.publish_plan(planned[1].revision, missions.build_plan_document(content))
        )

    async def settle(self) -> None:
        """Wait until everything is written, but not for a disk that never answers."""
        self._write_plans()
        if self._keeping:
            _, waiting = await asyncio.wait(self._keeping, timeout=SETTLE_S)
            if waiting:
                text = f"{len(waiting)} plans are not on the disk after {SETTLE_S:g} s; they are in the event log"
                self.show_notice(Say(Level.WARNING, text), self._seat.clock.now_s())
        await self._checkpoints.settle()


def plan_path_of(run: Path, planned: Planned) -> Path:
    """Return the path of a re-plan's file."""
    return RunDirectory(run).plan_path(planned[1].revision)


def _build_plan_file(
    request: FlightRequest, pricing: missions.Pricing, blind: Mapping[str, frozenset[int]], planned: Planned
) -> missions.PlanFile:
    """Return a re-plan as a plan file, and write it if there is room."""
    ground, (solve, event) = request.ground, planned
    task, plan = _build_replan(pricing, solve, event)
    solved = missions.SolverRecord(seed=request.plan.solved.seed, solver="search", seconds=event.solve_s)
    content = missions.make_plan_file(
        ground.network, task, ground.travel, plan, REPLAN_COST, solved, inspection=ground.inspection,
        says_distances=False,
    ).with_site_of(request.plan)  # fmt: skip
    content = name_locks(content, pricing.locked, blind)
    with suppress(OSError):
        missions.write_plan(plan_path_of(request.run, planned), content)
    return content


def name_locks(
    content: missions.PlanFile, locked: Mapping[int, str], blind: Mapping[str, frozenset[int]]
) -> missions.PlanFile:
    """Return a re-plan with its locks as such, where the solver only knew which vehicles may not fly a segment.

    A window or a loss computed from it then releases the segments that were locked to the lost vehicle.

    Args:
        content: The re-plan.
        locked: The flight's locks, by segment id of the network.
        blind: Segment ids that a vehicle has no camera for, by vehicle name.
    """
    if content.pricing is None or not locked:
        return content
    ids, barred, names = list(content.positions), content.pricing.barred, frozenset(content.names)
    locks = {
        number: locked[segment]
        for number, segment in enumerate(ids)
        if locked.get(segment) in names
        and all((number in barred.get(name, ())) == (name != locked[segment]) for name in names)
    }
    kept = {
        name: frozenset(one for one in own if one not in locks or ids[one] in blind.get(name, ()))
        for name, own in barred.items()
    }
    return replace(
        content, pricing=replace(content.pricing, locked=locks, barred={name: own for name, own in kept.items() if own})
    )


def _build_replan(pricing: missions.Pricing, solve: Solve, event: SolveEnded) -> tuple[missions.Task, Plan]:
    task, _ = build_replan_task(pricing, solve)
    visits = {route.vehicle: task.from_network(route.visits) for route in event.routes or ()}
    routes = tuple(Route(index, visits.get(offer.vehicle, ())) for index, offer in enumerate(solve.survivors))
    flown = {segment_of(visit) for route in routes for visit in route.visits}
    return task, Plan(routes, tuple(segment for segment in range(len(task.segment_ids)) if segment not in flown))


def read_plan_in_force(request: FlightRequest, revision: int) -> missions.PlanFile:
    """Return the newest recorded plan; a resumed flight may have had several."""
    with suppress(OSError, missions.MissionsError):
        if revision > 0:
            return missions.read_plan(RunDirectory(request.run).plan_path(revision))
    return request.plan
