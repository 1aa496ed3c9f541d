"""A live flight again: the events of its run directory through the same `step`, and whether it decides the same.

The context is built anew from what the directory holds: the site, the first plan, what each vehicle said and where
it stood. What the flight decided stands in the log beside the events, so the two are compared command by command.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from executor import build
from executor.adapters.eventlog import read_decisions, read_events, read_head, to_plain
from executor.config import read_site
from executor.core import fleet, passive
from executor.core.commands import Command, Say
from executor.core.context import Context
from executor.core.events import Tick
from executor.core.failsafes import LinkFailsafe, link_failsafe
from executor.core.faults import View
from executor.core.passive import Degraded
from executor.core.recording import Skipped
from executor.core.replayed import Declaration, Impaired, LogReplay, Trace, VehicleReplay
from executor.core.state import FleetState
from executor.core.vehicle import Stage, aboard
from executor.errors import LogError
from executor.replay import sampled
from missions import Pad, dialect_for, read_plan


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True)


class _PadRow(_Row):
    east_m: float
    north_m: float
    alt_m: float


class _VehicleRow(_Row):
    name: str
    pad: _PadRow | None = None
    parameters: dict[str, float] = {}


class _Vehicles(_Row):
    """What a replay takes from vehicles.json."""

    vehicles: tuple[_VehicleRow, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """What the flight decided beside what the replay did."""

    logged: int
    """Commands and lines of the flight."""
    replayed: int
    first_difference: str
    """Empty if there is none."""

    @property
    def same(self) -> bool:
        """Whether every command is the same, in the same order, at the same time."""
        return not self.first_difference


@dataclass(frozen=True, slots=True)
class RunReplay:
    """A run directory, replayed."""

    log: LogReplay
    comparison: Comparison
    state: FleetState


Decided = tuple[float, object]


def rerun(run: Path) -> RunReplay:
    """Replay a run directory.

    Raises:
        LogError: events.jsonl or vehicles.json cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan cannot be used.
    """
    context, state = _beginning(run)
    events = run / "events.jsonl"
    head = read_head(events)
    watch = _Watch(context)
    decided: list[Decided] = []
    at_s = 0.0
    for at_s, event in read_events(events):
        # A mistake of ours in one decision changed nothing in flight; it changes nothing here.
        with suppress(Exception):
            state, commands = fleet.step(context, state, event, at_s)
            decided += [(at_s, _plain(command)) for command in commands]
        if isinstance(event, Tick):
            watch.look(state, at_s)
    comparison = _compared(list(read_decisions(events)), decided)
    vehicles = watch.vehicles(state, head.began_unix_s, at_s)
    notes = () if comparison.same else (f"not what the flight decided: {comparison.first_difference}",)
    log = LogReplay(run, vehicles, Skipped(), round(head.began_unix_s * 1e6), at_s, notes)
    return RunReplay(log, comparison, state)


def _beginning(run: Path) -> tuple[Context, FleetState]:
    """Return the context of the flight, and its state before the launch."""
    site = read_site(run / "site.toml")
    ground = build.ground_of(site, run)
    plan = read_plan(run / "plan-000.json")
    task = plan.task()
    rows = _vehicles(run / "vehicles.json")
    pads = _pads(rows, ground.names)
    setup = build.setup_of(ground, pads)
    dialects = {table.name: dialect_for(table.autopilot) for table in site.vehicle}
    own: Mapping[str, LinkFailsafe] = MappingProxyType({
        name: link_failsafe(dialects[name], row.parameters) for name, row in rows.items() if name in dialects
    })  # fmt: skip
    context = build.context_of(ground, setup, task, plan.plan, own)
    routes = build.routes_of(ground, task, plan.plan)
    paths = build.paths_of(setup, routes)
    boards = {
        name: aboard(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }
    return context, fleet.initial(boards)


def _vehicles(path: Path) -> dict[str, _VehicleRow]:
    try:
        content = _Vehicles.model_validate_json(path.read_bytes())
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise LogError(f"{path}: {key}: expected what vehicles said before a flight: {first['msg']}") from error
    return {row.name: row for row in content.vehicles}


def _pads(rows: Mapping[str, _VehicleRow], names: tuple[str, ...]) -> list[Pad] | None:
    pads = []
    for name in names:
        row = rows.get(name)
        if row is None or row.pad is None:
            return None  # an older directory: the pads are those that the site gives
        pads.append(Pad(name, row.pad.east_m, row.pad.north_m, row.pad.alt_m))
    return pads


def _plain(command: Command) -> object:
    return command.text if isinstance(command, Say) else to_plain(command)


def _compared(logged: list[Decided], replayed: list[Decided]) -> Comparison:
    """Compare in the form that the log has: through JSON and back."""
    made: list[Any] = json.loads(json.dumps(replayed))
    commands = any(not isinstance(what, str) for _, what in logged)
    if not commands:  # written before commands were kept: the lines are compared alone
        made = [one for one in made if isinstance(one[1], str)]
    first = ""
    for number, (before, after) in enumerate(zip(logged, made, strict=False)):
        if [before[0], before[1]] != after:
            first = f"decision {number} at {before[0]:.2f} s was {_words(before[1])}, is {_words(after[1])}"
            break
    if not first and len(logged) != len(made):
        first = f"the flight made {len(logged)} decisions, the replay {len(made)}"
    return Comparison(len(logged), len(made), first)


def _words(decided: object) -> str:
    return repr(decided) if isinstance(decided, str) else json.dumps(decided)[:120]


class _Watch:
    """Collects what is not well, and samples for pictures, beside the decisions."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._open: dict[tuple[str, str], Degraded] = {}
        self._over: list[Degraded] = []
        self._traces = {name: Trace() for name in context.vehicles}
        self._flown = dict.fromkeys(context.vehicles, 0.0)
        self._looked_s: float | None = None

    def look(self, state: FleetState, now_s: float) -> None:
        """Look at everybody."""
        elapsed_s = 0.0 if self._looked_s is None else now_s - self._looked_s
        self._looked_s = now_s
        for name, vehicle in state.vehicles.items():
            setup = self._context.vehicles[name]
            if vehicle.armed and vehicle.stage is not Stage.LOST:
                self._flown[name] += elapsed_s
            if vehicle.stage is not Stage.LOST:
                found = passive.warned(View(self._context, setup, vehicle, False, now_s), self._open)
                self._over += [one for one in found if isinstance(one, Degraded)]
            trace = self._traces[name]
            if not trace.samples or now_s - trace.samples[-1].at_s >= trace.every_s:
                trace.add(sampled(self._context, vehicle, now_s))

    def vehicles(self, state: FleetState, began_unix_s: float, ended_s: float) -> tuple[VehicleReplay, ...]:
        """Return every vehicle as the replay of a log has it."""

        def usec(at_s: float) -> int:
            return round((began_unix_s + at_s) * 1e6)

        found = []
        for name, vehicle in state.vehicles.items():
            fault = vehicle.fault
            declared = (
                ()
                if fault is None
                else (Declaration(fault.kind, fault.kind.value, usec(fault.detected_s), fault.reason),)
            )
            mine = [one for one in (*self._over, *self._open.values()) if one.vehicle == name]
            degraded = tuple(
                Impaired(one.kind, one.reason, usec(one.from_s), usec(one.to_s or ended_s), one.evidence)
                for one in sorted(mine, key=lambda one: one.from_s)
            )
            setup = self._context.vehicles[name]
            found.append(
                VehicleReplay(
                    setup.sysid, name, setup.dialect.name, declared, degraded, self._flown[name],
                    tuple(self._traces[name].samples),
                )
            )  # fmt: skip
        return tuple(found)
