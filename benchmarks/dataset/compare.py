"""Solve instances by several programs in one run, each answer checked, and keep what is better than the best known."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.dataset.catalogue import PACKAGE, load_entry, solution_path
from benchmarks.dataset.checker import Instance, Routes, bound_minmax, bound_minsum, check, read_solution
from benchmarks.dataset.convert import build_planner_instance, find_repairs, format_solution
from benchmarks.dataset.peers import solve_hgs, solve_lkh
from benchmarks.machine import head, machine, machine_line
from benchmarks.markdown import figure, percent_over
from benchmarks.peer import pyvrp_installed, solve_pyvrp
from benchmarks.report import Report, Table
from benchmarks.store import Json, write_text
from planner import Cost, Iterations, Plan, Progress, StopRule, solve, solve_exact, solve_window
from planner.exact import EXACT_SEGMENTS
from planner.stop_rules import UNLIMITED, StopVerdict

BETTER = 1e-6
"""A value must be lower by this share to be better."""
BOUNDS = {"minmax": bound_minmax, "minsum": bound_minsum}
"""Bounds that the checker computes."""
PROOF_S = 60.0
"""Processor time for one proof; those of the package take a second or two."""
PYVRP_SCALE = 1000.0
"""Whole numbers of a percent for PyVRP."""


class ProcessorSeconds:
    """Stop after a time that the processor spent on this program, in all its threads: for a busy computer."""

    def __init__(self, limit_s: float) -> None:
        self._until_s = time.process_time() + limit_s

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow any number of iterations before the time is over."""
        del progress
        return StopVerdict(UNLIMITED if time.process_time() < self._until_s else 0, "processor seconds")


@dataclass(frozen=True, slots=True)
class Effort:
    """How long each program searches, and where the others are."""

    seconds: float
    iterations: int | None = None
    """Of faultline's search, in place of seconds: the same answer on every machine."""
    seed: int = 1
    peers: bool = True
    """Whether to ask the other programs."""
    lkh: Path | None = None
    hgs: Path | None = None

    def stop(self) -> StopRule:
        """Return when faultline's search ends."""
        return ProcessorSeconds(self.seconds) if self.iterations is None else Iterations(self.iterations)


@dataclass(frozen=True, slots=True)
class Answer:
    """One program's answer to one instance."""

    program: str
    value: float | None
    """None: no answer, or one that the checker refuses."""
    seconds: float
    content: Json | None = None
    """The solution's file."""
    refused: str = ""


def solve_by_all(instance: Instance, objective: str, effort: Effort) -> list[Answer]:
    """Return the answers of all programs that are there and know the objective.

    Raises:
        BenchError: a named binary cannot be run.
    """
    answers = [_time_answer("faultline", instance, objective, lambda: _search(instance, objective, effort))]
    if not effort.peers:
        return answers
    if objective == "minsum" and pyvrp_installed():
        answers.append(_time_answer("PyVRP", instance, objective, lambda: _ask_pyvrp(instance, effort)))
    if effort.lkh is not None and objective != "window":
        lkh = effort.lkh
        answers.append(_time_answer("LKH-3", instance, objective, lambda: _content(
            instance, objective, solve_lkh(lkh, instance, objective, seconds=effort.seconds, seed=effort.seed)
        )))  # fmt: skip
    if effort.hgs is not None and objective == "minmax":
        hgs = effort.hgs
        answers.append(_time_answer("HGS-CARP", instance, objective, lambda: _content(
            instance, objective, solve_hgs(hgs, instance, seconds=effort.seconds, seed=effort.seed)
        )))  # fmt: skip
    return answers


def _time_answer(program: str, instance: Instance, objective: str, make: Callable[[], Json | None]) -> Answer:
    begun_s = _spent_s()
    content = make()
    seconds = _spent_s() - begun_s
    if content is None:
        return Answer(program, None, seconds)
    figures, wrong = check(instance, read_solution(content))
    if wrong or figures is None:
        return Answer(program, None, seconds, refused=wrong[0])
    value = figures.value(objective)
    return Answer(program, value, seconds, None if value is None else {**content, "value": round(value, 6)})


def _spent_s() -> float:
    """Return the processor time of this program and of those that it ran."""
    return sum(os.times()[:4])


def _search(instance: Instance, objective: str, effort: Effort) -> Json | None:
    theirs = build_planner_instance(instance)
    if objective == "window":
        if instance.longest_s is None or instance.vehicles < 2:
            return None
        found = solve_window(theirs, stretch=0.0, longest_s=instance.longest_s, stop=effort.stop(), seed=effort.seed)
        if found.plan.uncovered or not found.feasible:
            return None
        repairs = find_repairs(theirs, found.plan, found.window.earliest_s)
        return format_solution(instance, objective, found.plan, repairs=repairs)
    cost = Cost(objective)
    result = solve(theirs, cost=cost, stop=effort.stop(), seed=effort.seed)
    return None if result.plan.uncovered else format_solution(instance, objective, result.plan)


def _ask_pyvrp(instance: Instance, effort: Effort) -> Json | None:
    found = solve_pyvrp(
        build_planner_instance(instance), seconds=effort.seconds, seed=effort.seed, scale=PYVRP_SCALE
    ).plan
    return None if found is None else format_solution(instance, "minsum", found)


def _content(instance: Instance, objective: str, routes: Routes | None) -> Json | None:
    if routes is None:
        return None
    return {**format_solution(instance, objective, Plan(())), "routes": [list(route) for route in routes]}


def compare_programs(
    instances: Sequence[Instance],
    objectives: Sequence[str],
    effort: Effort,
    show: Callable[[str, int, int], None],
    *,
    keep: Path | None = None,
) -> Json:
    """Return the answers of all programs to all instances; with ``keep`` write better ones into that package.

    Raises:
        BenchError: a named binary cannot be run, or the package cannot be written.
    """
    cases = [(instance, objective) for instance in instances for objective in objectives]
    rows: list[Json] = []
    for done, (instance, objective) in enumerate(cases):
        show("instances", done, len(cases))
        if objective == "window" and instance.longest_s is None:
            continue
        answers = solve_by_all(instance, objective, effort)
        kept = keep is not None and keep_if_better(instance, objective, answers, keep)
        path = solution_path(instance.name, objective, PACKAGE if keep is None else keep)
        rows.append({
            "instance": instance.name,
            "objective": objective,
            "best_known": load_entry(path).solution.value if path.is_file() else None,
            "kept": kept,
            "answers": {
                one.program: {"value": one.value, "seconds": round(one.seconds, 2), "refused": one.refused}
                for one in answers
            },
        })  # fmt: skip
    show("instances", len(cases), len(cases))
    return {**head("benchmark/1", "bench compare"), "seconds": effort.seconds, "seed": effort.seed,
            "iterations": effort.iterations, "rows": rows}  # fmt: skip


def report_comparison(content: Json) -> Report:
    """Return the table of a comparison."""
    programs = list(dict.fromkeys(name for row in content["rows"] for name in row["answers"]))
    rows = []
    for row in content["rows"]:
        cells = []
        for name in programs:
            one = row["answers"].get(name)
            value = None if one is None else one["value"]
            cells.append(figure(value, 3) + ("" if value is None else f" ({percent_over(value, row['best_known'])})"))
        rows.append((row["instance"], row["objective"], figure(row["best_known"], 3), *cells))
    refused = [
        f"{row['instance']}, {row['objective']}: {name}: {one['refused']}"
        for row in content["rows"] for name, one in row["answers"].items() if one["refused"]
    ]  # fmt: skip
    how = f"{content['seconds']:g} processor seconds for each answer"
    if content["iterations"] is not None:
        how += f", {content['iterations']} iterations for faultline"
    how += (
        ", one core; every answer is checked by the package's own checker. minmax and minsum in percent of a full "
        "battery, the window's t* in seconds; in brackets over the best known value."
    )
    return Report(
        name="benchmark",
        title="Best known values, beside other programs",
        content=content,
        parts=[
            machine_line(content["machine"]),
            how,
            Table(("instance", "objective", "best known", *programs), rows, title="Answers"),
        ],
        lines=[
            *(f"kept: {row['instance']}, {row['objective']}" for row in content["rows"] if row["kept"]),
            *refused,
        ],
    )


def prove(instance: Instance, objective: str, value: float) -> Json:
    """Return the proof that a value of minmax or minsum has: optimal, a bound, or none."""
    if objective not in BOUNDS:
        return {"kind": "none"}
    bound = BOUNDS[objective](instance)
    if value <= bound * (1 + BETTER):
        return {"kind": "optimal", "by": "checker"}
    if len(instance.segments_m) <= EXACT_SEGMENTS:
        proven = solve_exact(
            build_planner_instance(instance), cost=Cost(objective), stop=ProcessorSeconds(PROOF_S)
        ).bound
        if proven is not None and value <= proven * (1 + BETTER):
            return {"kind": "optimal", "by": "exact"}
    return {"kind": "bound", "value": round(bound, 6), "by": "checker"}


def keep_if_better(instance: Instance, objective: str, answers: Sequence[Answer], folder: Path = PACKAGE) -> bool:
    """Write the best answer as the best known solution if it is better than the one there; return whether it was."""
    best = min((one for one in answers if one.value is not None), key=lambda one: one.value or 0.0, default=None)
    if best is None or best.value is None or best.content is None:
        return False
    path = solution_path(instance.name, objective, folder)
    if path.is_file():
        known = load_entry(path).solution.value
        if known is not None and best.value >= known - BETTER * max(1.0, known):
            return False
    about = {
        "by": "the faultline authors",
        "program": f"{best.program} at {machine()['commit']}" if best.program == "faultline" else best.program,
        "when": datetime.now(UTC).date().isoformat(),
        "proof": prove(instance, objective, best.value),
    }
    content = {key: best.content[key] for key in ("format", "instance", "objective", "value")} | about
    routes = {key: best.content[key] for key in ("routes", "repairs") if key in best.content}
    write_text(path, format_file(content | routes))
    return True


def format_file(content: Json) -> str:
    """Return a solution's file: JSON with a route and a repair a line."""
    lines = []
    for key, value in content.items():
        if key in {"routes", "repairs"} and value:
            inner = ",\n".join("  " + json.dumps(one, separators=(",", ":")) for one in value)
            lines.append(f" {json.dumps(key)}: [\n{inner}\n ]")
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"
