"""c-MinSum on the authors' matrix: the search, the paper's solver and PyVRP, in one run."""

from __future__ import annotations

from statistics import median

from benchmarks.data import CSUM, CsumReference
from benchmarks.markdown import figure, markdown_table, percent_over
from benchmarks.parts.setting import Setting
from benchmarks.peer import pyvrp_installed, solve_pyvrp
from benchmarks.problems import AUTHORS_S, line_instance
from benchmarks.store import Json
from planner import Cost, Seconds, solve, solve_grasp, warm_up

TITLE = "c-MinSum on the authors' matrix"
VEHICLES = 4
TIMES_S = (1.0, 10.0)
GRASP_RUNS = 50
UNTIL_DONE = Seconds(3600.0)


def make(setting: Setting) -> Json:
    """Measure all radii."""
    warm_up()
    return {
        "rows": setting.make_cases(TITLE, CSUM, lambda one: f"csum-{one.radius_m:g}", _row, pyvrp=pyvrp_installed())
    }


def _row(setting: Setting, reference: CsumReference) -> Json:
    instance = line_instance(
        setting.nechranice(reference.radius_m).ends_m, VEHICLES, AUTHORS_S, float(reference.budget_s)
    )
    runs = [
        solve_grasp(instance, cost=Cost.MINSUM, stop=UNTIL_DONE, seed=setting.seed + run, runs=1)
        for run in range(setting.pieces(GRASP_RUNS, 3))
    ]
    values = [run.evaluation.value for run in runs]
    row: Json = {
        "radius_m": reference.radius_m,
        "segments": instance.segments,
        "budget_s": reference.budget_s,
        "grasp": {
            "runs": len(runs),
            "best": min(values),
            "median": median(values),
            "run_s": median(run.seconds for run in runs),
        },
        "search": {},
        "pyvrp": {},
    }
    for limit_s in TIMES_S:
        seconds = setting.seconds(limit_s)
        found = solve(instance, cost=Cost.MINSUM, stop=Seconds(seconds), seed=setting.seed, starts=setting.starts)
        row["search"][f"{limit_s:g}"] = found.evaluation.value if found.feasible else None
        if pyvrp_installed():
            row["pyvrp"][f"{limit_s:g}"] = solve_pyvrp(instance, seconds=seconds, seed=setting.seed).value
    return row


def report(result: Json) -> str:
    """Return its part of the page."""
    references = {row.radius_m: row for row in CSUM}
    columns = ("D_max m", "segments", "budget s", "search 1 s", "search 10 s", "PyVRP 1 s", "PyVRP 10 s",
               "search 1 s over PyVRP 10 s", "search 10 s over PyVRP 10 s", "GRASP median run", "best run",
               "time per run s", "reported: GRASP median", "best (runs)", "PyVRP 1 s", "10 s")  # fmt: skip
    rows = []
    for row in result["rows"]:
        search, pyvrp, own = row["search"], row["pyvrp"], row["grasp"]
        known = references[row["radius_m"]]
        rows.append((
            f"{row['radius_m']:g}", row["segments"], row["budget_s"], *(figure(search[t], 2) for t in ("1", "10")),
            *(figure(pyvrp.get(t), 2) for t in ("1", "10")),
            *(percent_over(search[t], pyvrp.get("10"), 3) for t in ("1", "10")),
            figure(own["median"]), f"{own['best']:.1f} of {own['runs']}", figure(own["run_s"], 3),
            figure(known.grasp_median), f"{known.grasp_best:.1f} ({known.grasp_runs})", figure(known.pyvrp_1s, 1),
            figure(known.pyvrp_10s, 1),
        ))  # fmt: skip
    missing = (
        "" if all(row["pyvrp"] for row in result["rows"]) else "PyVRP is not installed: its columns are empty.\n\n"
    )
    return (
        f"{VEHICLES} vehicles, values and budgets in seconds, the matrix of the authors' public solver (5 and 1 m/s "
        "with accelerations and turns). The search has a start on each core, PyVRP one core; it models a segment as a "
        "mutually exclusive group of two clients, with distances in hundredths of a second. GRASP is our own writing "
        "of the paper's solver, single runs. Reported figures were measured elsewhere.\n\n" + missing
        + markdown_table(columns, rows)
    )  # fmt: skip
