"""`faultline bench tune`: thresholds swept over recorded flights.

Each threshold is varied while the others keep their values; for each value the flights are replayed, and declarations
are compared with the injected faults, or in logs without a truth with the log's own statements: detection delays, and
numbers of false declarations.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from benchmarks.few_lines_detector import PERCENT, FewLines
from benchmarks.recorded_truths import RecordedTruth, read_recorded_truths, truth_for
from benchmarks.tuning_picture import ThresholdPoint, draw_tuning
from benchmarks.witness import scoring
from benchmarks.witness.log_evidence import LogEvidence
from benchmarks.witness.statements import find_statements, read_log_evidence
from benchmarks.witness.verdicts import Stand, hold_against
from executor.adapters.interrupts import start_worker_pool
from executor.core.state.vehicle_state import FaultKind
from executor.errors import LogError
from executor.replay.log_replay import ReplayRules, replay_log
from executor.replay.open_log import open_log
from executor.replay.replay_result import Declaration, LogReplay

SCALES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)
LINK = "link_timeout_s"
LOOK_USEC = 500_000
"""Maximum interval between two evaluations of the simple detector."""
LONGEST_USEC = 120_000_000
"""Pause in the log beyond which no new declaration is made."""
THRESHOLDS = (LINK, "battery_excess_pct", "charge_excess_pct", "drain_slack", "voltage_step", "voltage_step_blind")


@dataclass(frozen=True, slots=True)
class Score:
    """Score of one log."""

    false_alarms: int
    delays_s: tuple[float, ...]
    """Delays of the detected faults."""
    faults: int
    flown_s: float


Declared = Sequence[tuple[int, Declaration]]
"""Declarations by system."""


def _list_declarations(found: LogReplay) -> list[tuple[int, Declaration]]:
    return [(vehicle.sysid, one) for vehicle in found.vehicles for one in vehicle.declarations]


def _score_truth(said: Declared, truth: RecordedTruth, flown_s: float) -> Score:
    declared = sorted(((one.t_usec, one.kind) for _, one in said), key=lambda pair: pair[0])
    if truth.kind is None or truth.fault_usec is None:
        return Score(len(declared), (), 0, flown_s)
    before = sum(usec < truth.fault_usec for usec, _ in declared)
    after = [(usec, kind) for usec, kind in declared if usec >= truth.fault_usec]
    if not after or after[0][1] is not truth.kind:
        return Score(before + bool(after), (), 1, flown_s)
    return Score(before, ((after[0][0] - truth.fault_usec) / 1e6,), 1, flown_s)


def _score_witnessed(said: Declared, told: Mapping[int, LogEvidence], link_timeout_s: float, flown_s: float) -> Score:
    """Compare declarations with the statements of a log that has no truth."""
    false, faults = 0, 0
    delays: list[float] = []
    for system, one in said:
        false += system in told and hold_against(one, told[system], link_timeout_s).outcome is Stand.REFUTED
    for system, testimony in told.items():
        mine = [(one.t_usec, one.kind) for number, one in said if number == system]
        stated = find_statements(testimony, link_timeout_s)
        faults += len(stated)
        outcomes = scoring.found_all(testimony, stated, mine, link_timeout_s)
        delays += [one.after_s for one in outcomes if one.after_s is not None]
    return Score(false, tuple(delays), faults, flown_s)


def few_lines(path: Path) -> tuple[list[tuple[int, FaultKind]], float]:
    """Return the simple detector's declarations in a log, each kind once, and the flight time."""
    opened = open_log(path)
    systems: dict[int, FewLines] = {}
    said: set[tuple[int, FaultKind]] = set()
    declared: list[tuple[int, FaultKind]] = []
    began, flown_usec, last = 0, 0, 0
    for usec, system, message in opened.read_records():
        began, last = began or usec, last or usec
        for at_usec in (*range(last + LOOK_USEC, min(usec, last + LONGEST_USEC), LOOK_USEC), usec):
            for number, one in systems.items():
                kind = one.find_fault((at_usec - began) / 1e6)
                if kind is not None and (number, kind) not in said and not (opened.on_board and kind is FaultKind.LINK):
                    said.add((number, kind))
                    declared.append((at_usec, kind))
        flown_usec += (usec - last) * sum(one.armed for one in systems.values())
        if message is not None and system:
            systems.setdefault(system, FewLines(PERCENT)).take(message, (usec - began) / 1e6)
        last = usec
    return declared, flown_usec / 1e6


@dataclass(frozen=True, slots=True)
class _Job:
    """One log, with every value of every threshold."""

    path: Path
    truth: RecordedTruth | None
    rules: ReplayRules


def sweep_thresholds(paths: Sequence[Path], rules: ReplayRules, jobs: int = 1) -> list[ThresholdPoint]:
    """Replay all logs with every value of every threshold.

    Logs with a truth are compared with it, all others with their own statements.

    Raises:
        LogError: no log has a truth, and none has data of a vehicle.
    """
    work = [_Job(path, truth_for(path, read_recorded_truths(path.parent)), rules) for path in paths]
    if jobs > 1:
        with start_worker_pool(jobs) as pool:
            scores = [one for one in pool.map(_swept, work) if one]
    else:
        scores = [one for one in map(_swept, work) if one]
    if not scores:
        raise LogError(
            "LOG: expected logs with truth files next to them (*_truth.json), or logs that state what happened"
        )
    settings = [*_settings(rules), ("few lines", PERCENT, 1.0, rules)]
    return [
        _point(name, value, scale, [one[number] for one in scores])
        for number, (name, value, scale, _) in enumerate(settings)
    ]


def _settings(rules: ReplayRules) -> Iterator[tuple[str, float, float, ReplayRules]]:
    for name in THRESHOLDS:
        usual = rules.link_timeout_s if name == LINK else getattr(rules.limits, name)
        for scale in SCALES:
            value = usual * scale
            if name == LINK:
                yield name, value, scale, replace(rules, link_timeout_s=value)
            else:
                yield name, value, scale, replace(rules, limits=replace(rules.limits, **{name: value}))


def _swept(job: _Job) -> list[Score]:
    """Return the scores of a log, the last of the simple detector; empty for a log without data."""
    told = {} if job.truth is not None else read_log_evidence(job.path)
    if job.truth is None and not told:
        return []

    def scored(said: Declared, flown_s: float) -> Score:
        if job.truth is not None:
            return _score_truth(said, job.truth, flown_s)
        return _score_witnessed(said, told, job.rules.link_timeout_s, flown_s)

    found = []
    for _, _, _, rules in _settings(job.rules):
        done = _replay_log(job.path, rules)
        found.append(scored(_list_declarations(done), sum(vehicle.flown_s for vehicle in done.vehicles)))
    simple, flown_s = few_lines(job.path)
    system = next(iter(told), 0)
    said = [(system, Declaration(kind, "few lines", usec, "")) for usec, kind in simple]
    return [*found, scored(said, flown_s)]


def _replay_log(path: Path, rules: ReplayRules) -> LogReplay:
    opened = open_log(path)
    return replay_log(opened, rules)


def _point(name: str, value: float, scale: float, scores: Sequence[Score]) -> ThresholdPoint:
    delays = [delay for one in scores for delay in one.delays_s]
    return ThresholdPoint(
        threshold=name,
        value=round(value, 4),
        chosen=scale == 1.0,
        found=len(delays),
        faults=sum(one.faults for one in scores),
        mean_delay_s=sum(delays) / len(delays) if delays else None,
        false_alarms=sum(one.false_alarms for one in scores),
        flight_hours=sum(one.flown_s for one in scores) / 3600,
    )


def print_tuning(paths: Sequence[Path], rules: ReplayRules, output: Path | None, *, as_json: bool) -> None:
    """Sweep, print, and draw the picture if its folder is given."""
    points = sweep_thresholds(paths, rules, os.cpu_count() or 1)
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        draw_tuning(points, output / "tuning.png")
    if as_json:
        print(json.dumps({"points": [asdict(point) for point in points]}))
        return
    print("threshold              value   found  mean delay   false alarms per flight hour")
    for point in points:
        delay = "" if point.mean_delay_s is None else f"{point.mean_delay_s:.1f} s"
        mark = "*" if point.chosen else " "
        print(
            f"{point.threshold:<20} {point.value:>7g}{mark}  {point.found} of {point.faults}  {delay:>10}   "
            f"{point.false_per_hour:.2f} ({point.false_alarms})"
        )
