"""Re-check the data package: every best known solution by the checker, the planner's definition, and its proof."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.dataset.catalogue import (
    GENERATED,
    PACKAGE,
    Entry,
    Reference,
    find_entries,
    instance_path,
    load_entry,
    load_instance,
    read_references,
)
from benchmarks.dataset.checker import Instance, SolutionFigures, check
from benchmarks.dataset.compare import BOUNDS, PROOF_S, ProcessorSeconds
from benchmarks.dataset.convert import build_plan, build_planner_instance
from benchmarks.dataset.generator import format_instance
from benchmarks.errors import BenchError
from benchmarks.markdown import figure
from benchmarks.report import Report, Table
from benchmarks.store import Json
from planner import Cost, evaluate, replan_window, solve_exact
from planner.exact import EXACT_SEGMENTS

SAME = 1e-6
"""Values within this share of each other are equal."""
PROVEN_SAME = 1e-5
"""The proof's own tolerance, and that of rounded files."""
COSTS = {"minmax": Cost.MINMAX, "minsum": Cost.MINSUM, "mincomb": Cost.MINCOMB}
NO_WINDOW = "the planner finds no re-plan for a loss that the repairs cover"
"""Not a mistake: the repairs are checked, and a search may miss what another one found."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the re-check of one entry found."""

    entry: str
    objective: str
    value: float
    by: str
    proof: str
    """The claim: none, a bound with its gap, or optimal."""
    again: str
    """Whether the proof was made again."""
    wrong: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def verify_package(
    data: Path | None, show: Callable[[str, int, int], None], *, folder: Path = PACKAGE, proofs: bool = True
) -> Json:
    """Return the verdicts on all instances and best known solutions.

    Args:
        data: the directory with the public files behind instances by reference; None leaves these out.
        show: shows the progress.
        folder: the package.
        proofs: whether to make proofs and windows again.

    Raises:
        BenchError: a file of the package or of the data cannot be read.
    """
    stage = "instances"
    made, own = [], GENERATED if folder == PACKAGE else ()
    for done, one in enumerate(own):
        show(stage, done, len(own))
        made.append(_compare_file(instance_path(one.build().name, folder), format_instance(one.build(), one.source)))
    show(stage, len(own), len(own))
    references = {one.name: one for one in read_references()}
    verdicts, left_out = [], []
    paths, stage = list(find_entries(folder)), "best known solutions"
    for done, path in enumerate(paths):
        show(stage, done, len(paths))
        entry = load_entry(path)
        instance = _find_instance(entry, folder, references, data)
        if instance is None:
            left_out.append(path.stem)
        else:
            verdicts.append(verify_entry(instance, entry, proofs=proofs))
    show(stage, len(paths), len(paths))
    return {
        "instances": len(own),
        "changed": [line for line in made if line],
        "left_out": left_out,
        "rows": [_row(one) for one in verdicts],
    }


def verify_entry(instance: Instance, entry: Entry, *, proofs: bool = True) -> Verdict:
    """Return the verdict on one best known solution."""
    solution = entry.solution
    figures, wrong = check(instance, solution)
    proof, notes = entry.found.get("proof", {"kind": "none"}), list[str]()
    value = solution.value
    if value is None or entry.path.name != f"{solution.instance}.{solution.objective}.json":
        wrong.append("value: expected a value, and a file named after instance and objective")
    if figures is not None and not wrong:
        wrong += _compare_with_planner(instance, entry, figures)
        if solution.objective == "window" and proofs:
            window = replan_window(build_planner_instance(instance), build_plan(solution.routes))
            if window.earliest_s > (figures.window or 0.0) + 1e-3:
                notes.append(f"{NO_WINDOW}: its t* is {window.earliest_s:.3f} s")
    again = "-"
    if proof["kind"] != "none" and proofs and not wrong:
        again, refuted = _prove_again(instance, entry, proof)
        wrong += refuted
    return Verdict(
        entry=solution.instance,
        objective=solution.objective,
        value=math.nan if value is None else value,
        by=f"{entry.found.get('by')}, {entry.found.get('program')}, {entry.found.get('when')}",
        proof=_describe_proof(proof, value),
        again=again,
        wrong=tuple(wrong),
        notes=tuple(notes),
    )


def _compare_file(path: Path, expected: str) -> str:
    """Return why an instance's file is not what its generator makes; empty if it is."""
    try:
        found = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BenchError(f"{path}: expected an instance of the package: {error.strerror}") from error
    return "" if found == expected else f"{path.name}: differs from what its generator makes"


def _find_instance(entry: Entry, folder: Path, references: dict[str, Reference], data: Path | None) -> Instance | None:
    name = entry.solution.instance
    if name in references:
        return None if data is None else references[name].build(data)
    return load_instance(instance_path(name, folder))


def _compare_with_planner(instance: Instance, entry: Entry, figures: SolutionFigures) -> list[str]:
    """Return where the planner's own definition gives another value than the checker."""
    theirs, plan = build_planner_instance(instance), build_plan(entry.solution.routes)
    wrong = []
    for name, cost in COSTS.items():
        evaluation, mine = evaluate(theirs, plan, cost), figures.value(name)
        if mine is None or abs(evaluation.value - mine) > SAME * max(1.0, mine):
            wrong.append(f"{name}: the checker says {mine}, the planner {evaluation.value}")
        if evaluation.violations:
            wrong.append(f"the planner says: {evaluation.violations[0]}")
    longest_s = evaluate(theirs, plan, Cost.MINMAX).longest_route_s
    if abs(longest_s - figures.longest_s) > SAME * max(1.0, longest_s):
        wrong.append(f"longest route: the checker says {figures.longest_s} s, the planner {longest_s}")
    return wrong


def _prove_again(instance: Instance, entry: Entry, proof: Json) -> tuple[str, list[str]]:
    """Return whether a proof was made again, and why it does not hold."""
    value, objective = entry.solution.value or 0.0, entry.solution.objective
    claimed = value if proof["kind"] == "optimal" else proof["value"]
    if proof["by"] == "checker" and objective in BOUNDS:
        bound: float | None = BOUNDS[objective](instance)
    elif proof["by"] == "exact" and objective in COSTS and len(instance.segments_m) <= EXACT_SEGMENTS:
        bound = solve_exact(
            build_planner_instance(instance), cost=COSTS[objective], stop=ProcessorSeconds(PROOF_S)
        ).bound
    else:
        return "not here", []
    if bound is None:
        return "ran out of time", []
    if bound < claimed - PROVEN_SAME * max(1.0, claimed):
        return "no", [f"proof: says at least {claimed:.6f}, made again it is {bound:.6f}"]
    if bound > value + PROVEN_SAME * max(1.0, value):
        return "no", [f"proof: nothing is below {bound:.6f}, yet the value is {value:.6f}"]
    return "yes", []


def _describe_proof(proof: Json, value: float | None) -> str:
    if proof["kind"] != "bound":
        return f"{proof['kind']}: {proof['by']}" if "by" in proof else str(proof["kind"])
    gap = "" if value is None or value <= 0 else f" (gap {100 * (1 - proof['value'] / value):.2f} %)"
    return f"bound {proof['value']:.3f}{gap}: {proof['by']}"


def _row(one: Verdict) -> Json:
    return {
        "instance": one.entry, "objective": one.objective, "value": one.value, "by": one.by, "proof": one.proof,
        "proof_again": one.again, "wrong": list(one.wrong), "notes": list(one.notes),
    }  # fmt: skip


def has_failed(content: Json) -> bool:
    """Return whether anything in the package is wrong."""
    return bool(content["changed"]) or any(row["wrong"] for row in content["rows"])


def report_verification(content: Json) -> Report:
    """Return the table and the lines of a re-check."""
    rows: list[tuple[str, ...]] = [
        (
            row["instance"], row["objective"], figure(row["value"], 3), "wrong" if row["wrong"] else "valid",
            row["proof"], row["proof_again"], row["by"],
        )
        for row in content["rows"]
    ]  # fmt: skip
    columns = ("instance", "objective", "value", "checked", "proof", "made again", "found by")
    wrong = [f"{row['instance']}, {row['objective']}: {why}" for row in content["rows"] for why in row["wrong"]]
    notes = [f"{row['instance']}, {row['objective']}: {why}" for row in content["rows"] for why in row["notes"]]
    return Report(
        name="benchmark-verified",
        title="The benchmark's best known values, checked again",
        content=content,
        parts=[Table(columns, rows, title="Best known solutions", shown=6)],
        lines=[*_summary(content), *content["changed"], *wrong, *notes],
    )


def _summary(content: Json) -> list[str]:
    rows = content["rows"]
    valid = sum(not row["wrong"] for row in rows)
    unchanged = content["instances"] - len(content["changed"])
    lines = [
        f"{unchanged} of {content['instances']} instances are what their generator makes.",
        f"{valid} of {len(rows)} best known solutions are valid, by the checker and by the planner's definition.",
    ]
    if content["left_out"]:
        lines.append(
            f"{len(content['left_out'])} are of instances by reference and were left out: --data DIR names their files."
        )
    return lines
