"""The page of `faultline bench detection`: modelled flights, and recorded ones with known truths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.data import find_shared_folder
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import MISSING, figure, markdown_page, markdown_table
from benchmarks.recorded_truths import read_recorded_truths, truth_for
from benchmarks.store import Json
from benchmarks.tuning import few_lines
from executor.core.state.vehicle_state import FaultKind
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.open_log import open_log

NAMES = {"watchpoints": "watchpoints", "few_lines": "a few lines"}
INTRODUCTION = (
    "`{command}`: {flights} modelled flights, {hours:.0f} flight hours, half of them ArduPilot's, half PX4's. Healthy "
    "ones have wind, gusts, worn packs, noisy sensors, whole and re-estimated percentages and lossy links; faulty ones "
    "have steps of 10 to 40 points, drains of 1.3 to 4 times the normal rate, a failing cell, and link gaps of 2 to "
    "200 s. A false alarm is a declaration without a fault, or of another kind; a declaration that a pack will land "
    "below its reserve is none if it does, or if its autopilot reports so. A fault breaks the reserve if the flight "
    "would end below it although the vehicle can still return when the fault begins; in time means while the remaining "
    "charge suffices for the return. Intervals are 95 % (Garwood, Wilson)."
)
FEW_LINES = "a percentage below 25 %, a heartbeat older than 5 s"


def logs_directory(given: Path | None) -> Path | None:
    """Return the folder of recorded flights: the given one, or ../shared/logs next to the project or working directory.

    Raises:
        BenchError: the given folder does not exist.
    """
    return find_shared_folder(given, "logs", "a folder of telemetry logs with their truths")


def judge_recorded_flights(folder: Path) -> list[Json]:
    """Return the first declarations of both detectors in each telemetry log of a folder that has a truth."""
    truths, rows = read_recorded_truths(folder), []
    for path in sorted(folder.glob("*.tlog")):
        truth = truth_for(path, truths)
        if truth is None:
            continue
        opened = open_log(path)
        found = replay_log(opened, build_replay_rules(None))
        declared = [(one.t_usec, one.kind, one.reason) for vehicle in found.vehicles for one in vehicle.declarations]
        simple, _ = few_lines(path)
        rows.append(
            {
                "log": path.name,
                "fault": None if truth.kind is None else truth.kind.value,
                "watchpoints": _score_declarations(
                    sorted(declared, key=lambda one: one[0]), truth.kind, truth.fault_usec
                ),
                "few_lines": _score_declarations(
                    [(usec, kind, "") for usec, kind in simple], truth.kind, truth.fault_usec
                ),
            }
        )
    return rows


def _score_declarations(
    declared: Sequence[tuple[int, FaultKind, str]], kind: FaultKind | None, fault_usec: int | None
) -> dict[str, object]:
    right = [(usec, reason) for usec, one, reason in declared if one is kind and usec >= (fault_usec or 0)]
    return {
        "after_s": round((right[0][0] - fault_usec) / 1e6, 1) if right and fault_usec is not None else None,
        "reason": right[0][1] if right else "",
        "false": len(declared) - len(right),
    }


def detection_document(
    healthy: int, faulty: int, seed: int, figures: Mapping[str, object], rows: Sequence[Json]
) -> dict[str, object]:
    """Return the content of detection.json."""
    command = f"faultline bench detection --healthy {healthy} --faulty {faulty} --seed {seed}"
    return {"machine": machine(), "seed": seed, "command": command, **figures, "recorded": list(rows)}


def markdown(content: Mapping[str, Any]) -> str:
    """Return the page."""
    ours = content["watchpoints"]
    return markdown_page(
        "What the watchpoints detect",
        machine_line(content["machine"]),
        INTRODUCTION.format(command=content["command"], flights=ours["flights"], hours=ours["flight_hours"]),
        markdown_table(("", *(NAMES[name] for name in NAMES)), _head(content)),
        f"The detector of a few lines is {FEW_LINES}.",
        "## By fault",
        _kinds(ours["kinds"]),
        "## Drains, by how many times the normal rate",
        "A mild drain that does not break the reserve need not be found.",
        _kinds(ours["drains"]),
        "## Recorded flights" if content["recorded"] else "",
        _render_recorded_flights(content["recorded"]),
    )


def _head(content: Mapping[str, Any]) -> list[tuple[str, ...]]:
    def each(show: Any) -> tuple[str, ...]:  # noqa: ANN401 - JSON
        return tuple(show(content[name]) for name in NAMES)

    return [
        ("false alarms", *each(lambda one: str(one["false_alarms"]))),
        ("in 50 flight hours", *each(lambda one: _with_interval(one, "false_alarms_per_50_h", 1.0))),
        ("would break the reserve", *each(lambda one: str(one["would_break_reserve"]["of"]))),
        ("declared in time", *each(lambda one: str(one["would_break_reserve"]["in_time"]))),
        ("share in time (%)", *each(lambda one: _with_interval(one["would_break_reserve"], "rate", 100.0))),
    ]


def _with_interval(figures: Mapping[str, Any], name: str, times: float) -> str:
    low, high = figures[f"{name}_95"] or (0.0, 0.0)
    return f"{times * (figures[name] or 0.0):.2f} ({times * low:.2f} to {times * high:.2f})"


def _kinds(kinds: Mapping[str, Any]) -> str:
    return markdown_table(
        ("", "due", "declared", "would break the reserve", "in time", "delay median (s)", "95 % (s)",
         "extra battery 95 % (points)", "by"),
        [
            (
                name, row["due"], row["declared"], row["would_break_reserve"], row["in_time"],
                figure(row["delay_s_median"]), figure(row["delay_s_95"]), figure(row["extra_pct_95"] or None),
                ", ".join(f"{reason} {count}" for reason, count in row["reasons"].items()),
            )
            for name, row in kinds.items()
        ],
    )  # fmt: skip


def _render_recorded_flights(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""

    def told(row: Mapping[str, Any], said: Mapping[str, Any]) -> str:
        if row["fault"] is None:
            return f"{said['false']} false" if said["false"] else "nothing"
        late = "missed" if said["after_s"] is None else f"{said['after_s']:.1f} s {said['reason']}".strip()
        return f"{late}, {said['false']} false" if said["false"] else late

    return markdown_table(
        ("log", "fault", "watchpoints after", "a few lines after"),
        [
            (row["log"], row["fault"] or MISSING, told(row, row["watchpoints"]), told(row, row["few_lines"]))
            for row in rows
        ],
    )


def print_summary(name: str, figures: Mapping[str, Any]) -> None:
    """Print the figures of a campaign."""
    low, high = figures["false_alarms_per_50_h_95"] or (0.0, 0.0)
    print(f"{name}: {figures['flights']} flights, {figures['flight_hours']:.0f} flight hours")
    print(
        f"  false alarms: {figures['false_alarms']}, {figures['false_alarms_per_50_h']:.2f} in 50 flight hours "
        f"(95 %: {low:.2f} to {high:.2f})"
    )
    for reason in figures["false_reasons"]:
        print(f"    {reason}")
    breaking = figures["would_break_reserve"]
    low, high = (100 * bound for bound in breaking["rate_95"])
    print(
        f"  would break the reserve: {breaking['in_time']} of {breaking['of']} declared while it could come home, "
        f"{100 * breaking['rate']:.1f} % ({low:.1f} to {high:.1f})"
    )
    print("  fault     due  declared  rate (95 %)               delay median, 95 %   extra battery 95 %")
    for what, row in figures["kinds"].items():
        low, high = (100 * bound for bound in row["rate_95"])
        rate = f"{100 * row['rate']:.1f} % ({low:.1f} to {high:.1f})"
        delay = "" if row["delay_s_median"] is None else f"{row['delay_s_median']:.1f} s, {row['delay_s_95']:.1f} s"
        extra = f"{row['extra_pct_95']:.1f} %" if row["extra_pct_95"] else ""
        print(f"  {what:<8}  {row['due']:>3}  {row['declared']:>8}  {rate:<24}  {delay:<19}  {extra}")


def print_recorded(content: Mapping[str, Any]) -> None:
    """Print the declarations in recorded flights."""
    for row in content["recorded"]:
        print(f"  {row['log']}: {row['fault'] or 'no fault'}")
        for name, words in NAMES.items():
            said = row[name]
            after = "nothing" if said["after_s"] is None else f"after {said['after_s']:.1f} s {said['reason']}"
            print(f"    {words:<12} {after}" + (f", {said['false']} false" if said["false"] else ""))
