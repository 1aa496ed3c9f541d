"""`faultline bench detection --logs FOLDER`: declarations in logs of real aircraft, checked against the logs.

These logs have no injected faults: the truth is what the log states, read by `benchmarks.witness`, which shares no code
with the detectors under test.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.detection import poisson_interval
from benchmarks.recorded_truths import read_recorded_truths, truth_for
from benchmarks.store import Json
from benchmarks.tuning import few_lines
from benchmarks.witness.log_evidence import LogEvidence
from benchmarks.witness.scoring import found_all
from benchmarks.witness.statements import StatementKind, find_statements, read_log_evidence
from benchmarks.witness.verdicts import Stand, hold_against
from executor.adapters.interrupts import start_worker_pool
from executor.core.state.vehicle_state import FaultKind
from executor.errors import ExecutorError
from executor.replay.log_replay import LINK_TIMEOUT_S, build_replay_rules, replay_log
from executor.replay.open_log import open_log
from executor.replay.replay_result import Declaration, LogReplay

SUFFIXES = frozenset({".tlog", ".bin", ".ulg", ".log"})
DETECTORS = ("watchpoints", "few_lines")
DRAWS = 4000
PER_H = 50.0


def logs_under(folder: Path) -> list[Path]:
    """Return every log under a folder without a truth file, sorted by name."""
    truths: dict[Path, Mapping[str, object]] = {}
    found = []
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in SUFFIXES or not path.is_file():
            continue
        if path.parent not in truths:
            truths[path.parent] = read_recorded_truths(path.parent)
        if truth_for(path, truths[path.parent]) is None:  # type: ignore[arg-type]  # as it was read
            found.append(path)
    return found


def aircraft_of(path: Path, folder: Path, systems: Sequence[int]) -> str:
    """Return the aircraft of a log: OWNER+REPOSITORY in its name, its folder, or its system id."""
    owner, found, _ = path.name.partition("__")
    if found and "+" in owner:
        return owner
    if path.parent != folder:
        return path.parent.relative_to(folder).as_posix()
    return f"system {min(systems)}" if systems else "unknown"


def judge_log(path: Path, folder: Path) -> Json:
    """Replay one log and check the declarations against it; errors are reported in the row, not raised."""
    row = _unread(path, folder)
    try:
        opened = open_log(path)
        done = replay_log(opened, build_replay_rules(None))
        simple, _ = few_lines(path)
        told = read_log_evidence(path)
    except ExecutorError as error:
        return row | {"notes": [str(error).replace(f"{path}: ", "")]}
    except Exception as error:  # noqa: BLE001 - a campaign over foreign logs goes on, and counts it
        return row | {"failed": f"{type(error).__name__}: {error}"}
    return row | _judge_log(path, folder, done, simple, told)


def _judge_log(
    path: Path, folder: Path, done: LogReplay, simple: Sequence[tuple[int, FaultKind]], told: Mapping[int, LogEvidence]
) -> Json:
    said: dict[str, list[tuple[int, Declaration]]] = {
        "watchpoints": [(vehicle.sysid, one) for vehicle in done.vehicles for one in vehicle.declarations],
        "few_lines": [
            (_system_at(told, usec), Declaration(kind, "few lines", usec, "")) for usec, kind in simple
        ],
    }  # fmt: skip
    began = done.began_usec
    return {
        "aircraft": aircraft_of(path, folder, [vehicle.sysid for vehicle in done.vehicles]),
        "vehicles": len(done.vehicles),
        "hours": sum(vehicle.flown_s for vehicle in done.vehicles) / 3600,
        "notes": list(done.notes),
        "declared": [
            {"by": by, **_build_declaration(one, told.get(system), began)}
            for by, those in said.items()
            for system, one in those
        ],
        "stated": [
            row
            for system, one in told.items()
            for row in _build_statements(one, _select_system(said, system), began)
        ],
    }  # fmt: skip


def _s(usec: int, began: int) -> float:
    return round((usec - began) / 1e6, 2)


def _system_at(told: Mapping[int, LogEvidence], usec: int) -> int:
    armed = [system for system, one in told.items() if one.is_armed(usec)]
    return next(iter(armed or told), 0)


def _build_declaration(one: Declaration, told: LogEvidence | None, began: int) -> Json:
    verdict = None if told is None else hold_against(one, told, LINK_TIMEOUT_S)
    return {
        "at_s": _s(one.t_usec, began), "kind": one.kind.value, "reason": one.reason, "evidence": one.evidence,
        "verdict": (Stand.UNDECIDED if verdict is None else verdict.outcome).value,
        "because": "the judge could not read the log" if verdict is None else verdict.because,
    }  # fmt: skip


def _select_system(
    said: Mapping[str, Sequence[tuple[int, Declaration]]], system: int
) -> dict[str, list[tuple[int, FaultKind]]]:
    return {by: [(one.t_usec, one.kind) for number, one in those if number == system] for by, those in said.items()}


def _build_statements(told: LogEvidence, said: Mapping[str, Sequence[tuple[int, FaultKind]]], began: int) -> list[Json]:
    """Return a log's statements, and how both detectors declared them."""
    stated = find_statements(told, LINK_TIMEOUT_S)
    outcomes = {by: found_all(told, stated, those, LINK_TIMEOUT_S) for by, those in said.items()}
    return [
        {
            "what": one.what.value, "at_s": _s(one.t_usec, began), "words": one.words,
            **{by: asdict(outcomes[by][number]) for by in DETECTORS},
        }
        for number, one in enumerate(stated)
    ]  # fmt: skip


def judge_logs(folder: Path, jobs: int, told: Callable[[int, int], None] = lambda *_: None) -> list[Json]:
    """Judge every log under a folder; a log whose process dies is counted, and the rest continues."""
    paths = logs_under(folder)
    # Longest first, so that no process waits for one at the end.
    order = sorted(range(len(paths)), key=lambda number: -paths[number].stat().st_size)
    rows: dict[int, Json] = {}
    try:
        with start_worker_pool(max(1, jobs)) as pool:
            waiting = [(number, pool.submit(judge_log, paths[number], folder)) for number in order]
            for number, future in waiting:
                rows[number] = future.result()
                told(len(rows), len(paths))
    except BrokenProcessPool:  # the culprit is unknown: judge the rest one by one
        for number in order:
            if number not in rows:
                rows[number] = _alone(paths[number], folder)
                told(len(rows), len(paths))
    return [rows[number] for number in range(len(paths))]


def _alone(path: Path, folder: Path) -> Json:
    try:
        with start_worker_pool(1) as pool:
            return pool.submit(judge_log, path, folder).result()
    except BrokenProcessPool:
        return _unread(path, folder) | {"failed": "its process died"}


def _unread(path: Path, folder: Path) -> Json:
    """Return the row of a log before it is read."""
    return {"log": path.relative_to(folder).as_posix(), "aircraft": aircraft_of(path, folder, ()), "hours": 0.0,
            "vehicles": 0, "notes": [], "failed": "", "declared": [], "stated": []}  # fmt: skip


def real_summary(rows: Sequence[Json]) -> Json:
    """Return the figures of a campaign over real logs as JSON."""
    followed = [row for row in rows if row["vehicles"]]
    return {
        "logs": len(rows),
        "followed": len(followed),
        "flown": sum(row["hours"] > 0 for row in rows),
        "not_followed": dict(Counter(_reason(row) for row in rows if not row["vehicles"] and not row["failed"])),
        "failed": [f"{row['log']}: {row['failed']}" for row in rows if row["failed"]],
        "aircraft": len({row["aircraft"] for row in rows if row["hours"] > 0}),
        "flight_hours": round(sum(row["hours"] for row in rows), 3),
        **{by: _figures(rows, by) for by in DETECTORS},
    }


def _reason(row: Mapping[str, Any]) -> str:
    """Return why a log was not followed, without details that differ between logs."""
    notes = [note for note in row["notes"] if not note.startswith("no vehicle in it that can be followed")]
    text = "; ".join(notes or row["notes"]) or "no reason given"
    return re.sub(r"^system \d+ is not followed: ", "", text)


def _figures(rows: Sequence[Json], by: str) -> Json:
    declared = [one for row in rows for one in row["declared"] if one["by"] == by]
    names = sorted({_name(one) for one in declared})
    return {
        **_outcomes(rows, by, None),
        "kinds": {name: _outcomes(rows, by, name) for name in names},
        "stated": {what.value: _count_statements(rows, by, what.value) for what in StatementKind},
    }


def _name(one: Mapping[str, Any]) -> str:
    return f"{one['kind']}: {one['reason']}"


def _outcomes(rows: Sequence[Json], by: str, name: str | None) -> Json:
    chosen = [
        (row["aircraft"], one)
        for row in rows
        for one in row["declared"]
        if one["by"] == by and name in {None, _name(one)}
    ]
    counts = Counter(one["verdict"] for _, one in chosen)
    wrong = Counter(aircraft for aircraft, one in chosen if one["verdict"] == Stand.REFUTED)
    hours: Counter[str] = Counter()
    for row in rows:
        hours[row["aircraft"]] += row["hours"]
    total = sum(hours.values())
    low, high = compute_clustered_interval(wrong, hours)
    return {
        "declared": len(chosen),
        **{outcome.value: counts[outcome.value] for outcome in Stand},
        "refuted_per_50_h": round(PER_H * counts[Stand.REFUTED] / total, 2) if total else None,
        "refuted_per_50_h_95": [round(low, 2), round(high, 2)] if total else None,
    }


def compute_clustered_interval(wrong: Mapping[str, int], hours: Mapping[str, float]) -> tuple[float, float]:
    """Return the 95 % interval of the number of refuted declarations in 50 hours.

    Errors of one aircraft's flights are correlated, so aircraft are resampled with replacement, not flights. Without
    refuted declarations, or with a single aircraft, resampling shows nothing: then the interval is Poisson's, as for
    independent flights.
    """
    flown = [name for name in hours if hours[name] > 0]
    total, count = sum(hours.values()), sum(wrong.values())
    if not total:
        return 0.0, float("inf")
    low, high = (PER_H * bound / total for bound in poisson_interval(count))
    if not count or len(flown) < 2:
        return low, high
    rng = np.random.default_rng(1)
    drawn = rng.integers(0, len(flown), size=(DRAWS, len(flown)))
    counts, flights = np.array([wrong.get(name, 0) for name in flown]), np.array([hours[name] for name in flown])
    rates = PER_H * counts[drawn].sum(axis=1) / flights[drawn].sum(axis=1)
    return float(np.quantile(rates, 0.025)), float(np.quantile(rates, 0.975))


def _count_statements(rows: Sequence[Json], by: str, what: str) -> Json:
    """Return how logs' statements were detected: in logs that are followed, and in those that are not."""
    those = [(row, one[by]) for row in rows for one in row["stated"] if one["what"] == what]
    outcomes = Counter(one["outcome"] for _, one in those)
    after = [one["after_s"] for _, one in those if one["after_s"] is not None]
    lead = [-value for value in after if value < 0]
    delay = [value for value in after if value >= 0]
    return {
        "stated": len(those),
        "declared": outcomes["declared"],
        "late": outcomes["late"],
        "missed": outcomes["missed"],
        "missed_not_followed": sum(one["outcome"] == "missed" and not row["vehicles"] for row, one in those),
        "delay_s_median": round(float(np.median(delay)), 2) if delay else None,
        "delay_s_most": round(max(delay), 2) if delay else None,
        "before_the_text": len(lead),
        "lead_s_median": round(float(np.median(lead)), 2) if lead else None,
    }
