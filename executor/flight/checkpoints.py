"""Checkpoints beside the event log: the whole state at one place of it, so that nobody reads ten hours of log.

The log stays the only truth. A checkpoint saves reading what is before its place, and whatever makes it doubtful
(another program, another plan, another log, damage) makes it nothing: the one before it is taken, or the whole log is
read. It is JSON, checked against the types of the state; a run directory may come from anybody, so nothing is ever
unpickled. It is written beside the flight: nothing waits for it.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from executor.adapters.eventlog import DISK_S, EventLog, LogPlace, is_place_in_log
from executor.adapters.run_directory import RunDirectory
from executor.core.interface.commands import Solve
from executor.core.interface.events import SolveEnded
from executor.core.state.fleet_state import Coverage, CrewDialogue, FleetState, Replan, ReplanningState
from executor.core.state.vehicle_state import VehicleState
from missions import format_first_error
from missions.files import write_whole

FORMAT = "faultline-checkpoint/2"

Planned = tuple[Solve, SolveEnded]
"""A problem and its answer."""
_MAPPING = (Coverage, ReplanningState, CrewDialogue, Replan)
"""What of the state of a flight holds mappings."""
T = TypeVar("T", bound=FleetState | Coverage | ReplanningState | CrewDialogue | Replan)


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """All that the log up to one place comes to."""

    place: LogPlace
    state: FleetState
    solve: Solve | None
    """The last that was to be solved."""
    unkept: tuple[Planned, ...]
    """Plans that were found, and may be in no file."""
    set_s: float
    """By how much the computer's time of day was set in the flight."""


@dataclass(frozen=True, slots=True)
class FoundCheckpoint:
    """What a run directory has."""

    checkpoint: Checkpoint | None
    name: str
    """Its file; empty without one."""
    notes: tuple[str, ...]
    """Why a newer one, or any, is not used."""


class _Part(BaseModel):
    """A line; strict, so that what is read is what was written, or an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, ser_json_inf_nan="constants")


class _Head(_Part):
    format: str
    program: str
    """Which wrote it: another one may know another state, or decide otherwise."""
    plan: str
    """Digest of the first plan."""
    place: LogPlace
    body: str
    """Digest of all other lines."""


class _Fleet(_Part):
    state: FleetState
    """Without the vehicles, which have a line each."""
    solve: Solve | None
    unkept: tuple[Planned, ...]
    set_s: float


class _Vehicle(_Part):
    vehicle: VehicleState


@cache
def describe_program() -> str:
    """Return the version of this program, and the shape of the state that it knows."""
    shape = json.dumps([model.model_json_schema() for model in (_Fleet, _Vehicle)], sort_keys=True)
    release = ""
    with suppress(PackageNotFoundError):  # run from its sources
        release = version("faultline")
    return f"{release} {_compute_digest(shape.encode())[:16]}"


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write one, whole or not at all; called in a thread.

    Raises:
        OSError: it cannot be written.
    """
    write_whole(path, encode_checkpoint(checkpoint, RunDirectory(path.parent).plan_path(0).read_bytes()))


def encode_checkpoint(checkpoint: Checkpoint, plan: bytes) -> bytes:
    """Return what the file of a checkpoint holds.

    No step of this takes longer than one vehicle's state does, so that the event loop, which has to share the
    interpreter with it, waits for some milliseconds at most.

    Args:
        checkpoint: What to write.
        plan: The file of the flight's first plan.
    """
    body = _encode_body(checkpoint.state, checkpoint.solve, checkpoint.unkept, checkpoint.set_s)
    head = _Head(
        format=FORMAT,
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
            files[name] = _parse_header(file.read_bytes())
        except FileNotFoundError:
            continue
        except (OSError, ValueError, RecursionError) as error:
            notes.append(f"{name} is not used: {_describe_error(error)}")
    for name in sorted(files, key=lambda name: files[name][0].place.size, reverse=True):
        try:
            return FoundCheckpoint(_restore_checkpoint(run, log, *files[name]), name, tuple(notes))
        except (OSError, ValueError) as error:
            notes.append(f"{name} is not used: {_describe_error(error)}")
    if notes:
        notes.append("without a checkpoint the whole log is read")
    return FoundCheckpoint(None, "", tuple(notes))


def _parse_header(content: bytes) -> tuple[_Head, bytes]:
    head, _, body = content.partition(b"\n")
    found = json.loads(head)
    known = found.get("format") if isinstance(found, dict) else None
    if known != FORMAT:
        raise ValueError(f"expected format {FORMAT}, got {known!s:.40}")
    return _Head.model_validate_json(head), body


def _restore_checkpoint(run: Path, log: Path, head: _Head, body: bytes) -> Checkpoint:
    """Return what a file holds.

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
    fleet, state = _decode_body(body)
    return Checkpoint(head.place, state, fleet.solve, fleet.unkept, fleet.set_s)


def round_trip_state(state: FleetState) -> FleetState:
    """Return a state as it is once a checkpoint was made of it and read again."""
    return _decode_body(_encode_body(state, None, (), 0.0))[1]


def _encode_body(state: FleetState, solve: Solve | None, unkept: tuple[Planned, ...], set_s: float) -> bytes:
    plain = replace(_convert_mappings(state, dict), vehicles={})
    fleet = _Fleet.model_construct(state=plain, solve=solve, unkept=unkept, set_s=set_s)
    parts: list[_Part] = [fleet, *(_Vehicle.model_construct(vehicle=vehicle) for vehicle in state.vehicles.values())]
    return b"".join(part.model_dump_json().encode() + b"\n" for part in parts)


def _decode_body(body: bytes) -> tuple[_Fleet, FleetState]:
    first, *rest = body.splitlines()
    fleet = _Fleet.model_validate_json(first)
    vehicles = {row.name: row for row in (_Vehicle.model_validate_json(line).vehicle for line in rest)}
    return fleet, replace(_convert_mappings(fleet.state, MappingProxyType), vehicles=MappingProxyType(vehicles))


def _convert_mappings(value: T, kind: Callable[[Mapping[Any, Any]], Mapping[Any, Any]]) -> T:
    """Return a state in whose parts every mapping is of one kind: dictionaries can be written, proxies not changed."""
    changes: dict[str, Any] = {}
    for field in fields(value):
        held = getattr(value, field.name)
        if isinstance(held, Mapping):
            changes[field.name] = kind(held)
        elif isinstance(held, _MAPPING):
            changes[field.name] = _convert_mappings(held, kind)
    return replace(value, **changes)


def _compute_digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _describe_error(error: Exception) -> str:
    """Return in one line why a checkpoint is not used."""
    if isinstance(error, ValidationError):
        return format_first_error(error)
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)


EVERY_S = 30.0
"""Of the flight: what follows a checkpoint is read in less than a second, for six vehicles in a quarter of one."""
EVERY_REAL_S = 5.0
"""A simulation that is fast writes no more of them than this."""


class Checkpointer:
    """Writes one checkpoint after the other, beside the flight.

    States are values: the loop hands one over between two events, and a thread writes it down. While one is being
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
        """Name where they go.

        Args:
            run: The run directory.
            log: Whose places they are of.
            speedup: Of the flight.
            told: Called with a line for the operator when they cannot be written, and when they can again.
            taken: The file that the flight was taken up from, which is overwritten last.
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
        """Return whether it is time; before the launch nothing is worth it."""
        if state.progress.launched_s is None or self._writing is not None:
            return False
        return self._last_s is None or now_s - self._last_s >= self._every_s

    def begin(self, now_s: float, made: Callable[[LogPlace], Checkpoint]) -> None:
        """Begin to write one; called between two events, when all that was decided is in the log."""
        place = self._log.current_place()
        if place is None or self._writing is not None:
            return  # the disk is full: what waits in memory is in no log yet
        self._last_s = now_s
        self._writing = asyncio.create_task(self._write(made(place)))

    async def _write(self, checkpoint: Checkpoint) -> None:
        try:
            await self._log.settle()  # a checkpoint that outlives its log in a power loss is worth nothing
            await asyncio.to_thread(write_checkpoint, self._files[self._next], checkpoint)
            self._next = 1 - self._next
            self._report("checkpoints are written again", failing=False)
        except OSError as error:
            self._report(f"no checkpoint can be written: {error.strerror}; resume would take longer", failing=True)
        except Exception as error:  # noqa: BLE001 - a mistake of ours here must not cost anything but time
            text = f"{type(error).__name__}: {error!s:.200}"
            self._report(f"no checkpoint can be written: {text}; resume would take longer", failing=True)
        finally:
            self._writing = None

    def _report(self, text: str, *, failing: bool) -> None:
        if failing is not self._failing:
            self._failing = failing
            self._told(text)

    async def settle(self) -> None:
        """Wait until nothing is being written, for no longer than anybody waits for a disk."""
        if self._writing is not None:
            await asyncio.wait({self._writing}, timeout=DISK_S)
