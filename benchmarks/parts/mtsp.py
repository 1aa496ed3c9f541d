"""Min-max multiple TSP: the longest tour against the best known."""

from __future__ import annotations

from statistics import fmean

from benchmarks.data import TSPLIB, MtspReference, mtsp_references
from benchmarks.markdown import figure, markdown_table, percent_over
from benchmarks.parts.setting import Setting
from benchmarks.problems import cities_problem
from benchmarks.store import Json
from planner import Cost, Seconds, solve, warm_up

TITLE = "Min-max multiple TSP"
LIMIT_S = 10.0


def make(setting: Setting) -> Json:
    """Measure all instances."""
    warm_up()
    references = mtsp_references(setting.directory)
    rows = setting.make_cases(
        TITLE, references, lambda one: f"mtsp-{one.instance}-{one.vehicles}", _row, starts=setting.starts
    )
    return {"rows": rows}


def _row(setting: Setting, reference: MtspReference) -> Json:
    path = setting.directory / TSPLIB / f"{reference.instance}.tsp"
    instance = cities_problem(path, reference.vehicles).instance
    stop = Seconds(setting.seconds(LIMIT_S))
    found = solve(instance, cost=Cost.MINMAX, stop=stop, seed=setting.seed, starts=setting.starts)
    there_and_back = (instance.start_pct[0] + instance.home_pct[0]).max()
    return {
        "instance": reference.instance,
        "vehicles": reference.vehicles,
        "best_known": reference.best_known,
        "source": reference.source,
        "value": found.evaluation.value if found.feasible else None,
        "iterations": found.iterations,
        "seconds": found.seconds,
        "farthest": float(there_and_back),
    }


def report(result: Json) -> str:
    """Return its part of the page."""
    rows = result["rows"]
    gaps = [100 * (row["value"] / row["best_known"] - 1) for row in rows if row["value"] is not None]
    shown = [
        (
            row["instance"], row["vehicles"], figure(row["value"], 2), figure(row["best_known"], 2),
            percent_over(row["value"], row["best_known"]), figure(row["farthest"], 2), row["source"],
        )
        for row in rows
    ]  # fmt: skip
    columns = ("instance", "vehicles", "found", "best known", "gap", "to the farthest city and back", "source")
    return (
        f"{LIMIT_S:g} s each, a start on each core. A city is a segment of no length, distances are not rounded. Where "
        "the best value is the way to the farthest city and back it is optimal and tests little. "
        f"Mean gap {fmean(gaps):.3f} %, largest {max(gaps):.3f} %.\n\n" + markdown_table(columns, shown)
    )
