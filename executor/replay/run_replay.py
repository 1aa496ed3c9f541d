"""Replay a live flight: pass the events of its run directory through the same `step`, and compare the decisions.

The context is rebuilt from the directory: the site, the first plan, each vehicle's reports and position. The flight's
decisions are in the log next to the events, so both are compared command by command.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executor.adapters.eventlog import read_decisions, read_events, read_head, to_plain
from executor.adapters.run_directory import RunDirectory
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.inflight.faults import passive_watch
from executor.core.inflight.faults.passive_watch import DeclaredFault, Degradation, Finding
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.commands import Say
from executor.core.interface.events import Tick
from executor.core.interface.recorded_log import SkippedRecords
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage
from executor.flight.run_start import read_run_start
from executor.replay.log_replay import FollowedVehicle
from executor.replay.replay_result import LogReplay, VehicleReplay


@dataclass(frozen=True, slots=True)
class DecisionComparison:
    """The flight's decisions compared with the replay's."""

    logged: int
    """Commands and lines of the flight."""
    replayed: int
    first_difference: str
    """First command or line that differs; empty if there is none."""
    reworded: str = ""
    """First line or reason with a changed wording; empty if there is none. It does not affect `is_same`."""

    @property
    def is_same(self) -> bool:
        """Return whether every command is the same, in the same order, at the same time."""
        return not self.first_difference


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReplay(LogReplay):
    """Results of replaying a run directory."""

    comparison: DecisionComparison
    state: FleetState
    """State at the end of its log."""


Decided = tuple[float, object]


def replay_run(run: Path) -> RunReplay:
    """Replay a run directory.

    Raises:
        LogError: events.jsonl or vehicles.json cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: The first plan cannot be used.
    """
    begun = read_run_start(run)
    context, state = begun.context, begun.state
    events = RunDirectory(run).events
    head = read_head(events)
    watch = _Watch(context)
    decided: list[Decided] = []
    at_s = 0.0
    for at_s, event in read_events(events):
        # An internal error in one decision changed nothing in flight, so it changes nothing here.
        with suppress(Exception):
            state, commands = fleet_step.step(context, state, event, at_s)
            decided += [(at_s, one.text if isinstance(one, Say) else to_plain(one)) for one in commands]
        if isinstance(event, Tick):
            watch.update(state, at_s)
    comparison = compare_decisions(list(read_decisions(events)), decided)
    vehicles = watch.build_vehicle_replays(state, head.began_unix_s, at_s)
    notes = () if comparison.is_same else (f"not what the flight decided: {comparison.first_difference}",)
    if comparison.is_same and comparison.reworded:
        notes = (f"recorded by a version with other words: {comparison.reworded}",)
    began_usec = round(head.began_unix_s * 1e6)
    return RunReplay(run, vehicles, SkippedRecords(), began_usec, at_s, notes, comparison=comparison, state=state)


def compare_decisions(logged: Sequence[Decided], replayed: Sequence[Decided]) -> DecisionComparison:
    """Compare logged with replayed decisions in the log's form: through JSON and back."""
    made: list[Any] = json.loads(json.dumps(replayed))
    commands = any(not isinstance(what, str) for _, what in logged)
    if not commands:  # written before commands were logged: only the lines are compared
        made = [one for one in made if isinstance(one[1], str)]
    first = reworded = ""
    for number, (before, (at_s, decided)) in enumerate(zip(logged, made, strict=False)):
        after = [at_s, _drop_new_fields(before[1], decided)]
        if [before[0], before[1]] == after:
            continue
        what = (
            f"decision {number} at {before[0]:.2f} s was {_format_decision(before[1])}, is {_format_decision(after[1])}"
        )
        if before[0] != after[0] or _strip_wording(before[1]) != _strip_wording(after[1]):
            first = what
            break
        reworded = reworded or what
    if not first and len(logged) != len(made):
        first = f"the flight made {len(logged)} decisions, the replay {len(made)}"
    return DecisionComparison(len(logged), len(made), first, reworded)


def _drop_new_fields(before: object, after: object) -> object:
    """Return a decision without its empty fields that an older program did not have."""
    if not isinstance(before, dict) or not isinstance(after, dict):
        return after
    return {key: value for key, value in after.items() if value or key in before}


def _strip_wording(decided: object) -> object:
    """Return a decision without its texts, which another version of the program may word differently."""
    if not isinstance(decided, dict):
        return ""
    return {key: value for key, value in decided.items() if key not in {"trigger", "reason"}}


def _format_decision(decided: object) -> str:
    return repr(decided) if isinstance(decided, str) else json.dumps(decided)[:120]


class _Watch:
    """Collect impairments, and samples for pictures, during the replay."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._open: dict[tuple[str, str], Degradation] = {}
        self._found: list[Finding] = []
        self._followed = {name: FollowedVehicle() for name in context.vehicles}
        self._looked_s: float | None = None

    def update(self, state: FleetState, now_s: float) -> None:
        since_s = now_s if self._looked_s is None else self._looked_s
        self._looked_s = now_s
        for name, vehicle in state.vehicles.items():
            self._followed[name].observe(self._context, vehicle, now_s, since_s)
            if vehicle.stage is not Stage.LOST:
                view = WatchView(self._context, self._context.vehicles[name], vehicle, False, now_s)
                self._found += passive_watch.update_degradations(view, self._open)

    def build_vehicle_replays(
        self, state: FleetState, began_unix_s: float, ended_s: float
    ) -> tuple[VehicleReplay, ...]:

        def usec(at_s: float) -> int:
            return round((began_unix_s + at_s) * 1e6)

        found = [*self._found, *self._open.values()]
        found += [
            DeclaredFault(name, fault.kind, fault.kind.value, fault.reason, fault.detected_s)
            for name, vehicle in state.vehicles.items()
            if (fault := vehicle.fault) is not None
        ]
        return tuple(
            self._followed[name].build_replay(self._context.vehicles[name], found, usec, ended_s)
            for name in state.vehicles
        )
