"""Growth of time and memory with the network, each size in its own process."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

from benchmarks.errors import BenchError
from benchmarks.machine import ROOT
from benchmarks.markdown import figure, markdown_table
from benchmarks.parts.setting import Setting
from benchmarks.problems import PAPER_S, line_instance
from benchmarks.store import Json
from benchmarks.synthetic import generate_network
from planner import Cost, Progress, Seconds, Stopwatch, solve, warm_up
from planner.model import TABLES_UP_TO

TITLE = "Scale"
SIZES = (100, 300, 1000, 3000, 10_000)
PER_VEHICLE = 20
"""Segments for each vehicle."""
LONG_FROM = 10_000
"""Segments from which a search gets more time."""
SHORT_S, LONG_S = 20.0, 60.0
TIGHTNESS = 0.85
"""MinMax found over the budget of the other two cost functions."""
EVERYTHING_M = 1_000_000.0
REAL_VEHICLES = 100
AT = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Shares of the time at which the value is noted."""
KIB_PER_MIB = 1024


def make(setting: Setting) -> Json:
    """Measure all sizes, and all segments of the paper's network if it is there."""
    cases = [(f"generated-{size}", size // PER_VEHICLE) for size in SIZES[: setting.pieces(len(SIZES), 3)]]
    if setting.data is not None:
        cases.append(("nechranice", REAL_VEHICLES))
    rows: list[Json] = []
    for name, vehicles in cases:
        budget: float | None = None
        for cost in Cost:
            setting.told(TITLE, len(rows), len(Cost) * len(cases))
            settings = {"seed": setting.seed, "quick": setting.quick, "budget": budget}
            order = _order(setting, name, vehicles, cost, budget)
            key = f"scale-{name}-{cost.value}"
            rows.append(setting.store.find_or_make(key, settings, lambda order=order: _run_in_process(order)))  # type: ignore[misc]
            if cost is Cost.MINMAX:
                budget = rows[-1]["value"] / TIGHTNESS
    setting.told(TITLE, len(rows), len(rows))
    return {"rows": rows}


def _order(setting: Setting, name: str, vehicles: int, cost: Cost, budget: float | None) -> Json:
    generated = name.startswith("generated")
    seconds = LONG_S if generated and int(name.split("-")[1]) >= LONG_FROM else SHORT_S
    return {
        "name": name, "vehicles": vehicles, "cost": cost.value, "budget": budget, "seed": setting.seed,
        "seconds": setting.seconds(seconds), "starts": setting.starts,
        "data": None if generated else str(setting.directory),
    }  # fmt: skip


def _run_in_process(order: Json) -> Json:
    code = "import sys; from benchmarks.parts.scale import child; child(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(order)],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=60 + 20 * order["seconds"],
    )  # fmt: skip
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no word"]
        raise BenchError(f"{order['name']}: the measuring process ended with {done.returncode}: {lines[-1]}")
    result: Json = json.loads(done.stdout)
    return result


def child(text: str) -> None:
    """Solve one instance and print its cost; memory is this process's."""
    order = json.loads(text)
    if order["data"] is None:
        ends_m = generate_network(int(order["name"].split("-")[1]), order["seed"])
    else:
        ends_m = Setting(Path(order["data"]), None, lambda *_: None).nechranice(EVERYTHING_M).ends_m  # type: ignore[arg-type]
    warm_up()
    watch = Stopwatch()
    instance = line_instance(ends_m, order["vehicles"], PAPER_S, order["budget"])
    built_s = watch.seconds
    seen: list[tuple[float, float, bool]] = []

    def on_progress(progress: Progress) -> None:
        seen.append((progress.seconds, progress.value, progress.feasible))

    result = solve(
        instance, cost=Cost(order["cost"]), stop=Seconds(order["seconds"]), seed=order["seed"],
        starts=order["starts"], on_progress=on_progress,
    )  # fmt: skip
    feasible = [one for one in seen if one[2]]
    print(json.dumps({
        "name": order["name"], "segments": instance.segments, "vehicles": order["vehicles"], "cost": order["cost"],
        "seconds": result.seconds, "build_s": built_s, "value": result.evaluation.value, "feasible": result.feasible,
        "uncovered": len(result.plan.uncovered), "iterations": result.iterations,
        "first_plan_s": built_s + feasible[0][0] if feasible else None,
        "values": [_value_at(feasible, share * order["seconds"]) for share in AT],
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_PER_MIB,
    }))  # fmt: skip


def _value_at(seen: list[tuple[float, float, bool]], at_s: float) -> float | None:
    """Return the value of the complete plan known at a time."""
    return next((value for seconds, value, _ in reversed(seen) if seconds <= at_s), None)


def report(result: Json) -> str:
    """Return its part of the page."""
    rows = [
        (
            row["name"], row["segments"], row["vehicles"], row["cost"], figure(row["build_s"], 2),
            figure(row["first_plan_s"], 2), *(_format_excess_pct(value, row["value"]) for value in row["values"][:-1]),
            figure(row["value"], 1), row["uncovered"], figure(row["seconds"], 1), figure(row["peak_mib"], 0),
        )
        for row in result["rows"]
    ]  # fmt: skip
    columns = ("network", "segments", "vehicles", "cost", "instance s", "first complete plan s",
               *(f"value at {100 * share:g} % of the time" for share in AT[:-1]), "value at the end", "left out",
               "seconds", "peak memory MiB")  # fmt: skip
    return (
        "The paper's model in seconds, a start on each core; MinMax without budgets, the other two with MinMax / "
        f"{TIGHTNESS:g} as everybody's budget. Earlier values are percent over the one at the end. The first plan's "
        f"time counts making the instance, not loading compiled kernels. Up to {TABLES_UP_TO} segments all moves are "
        "tables, which grow with the square of the segments; beyond, they are computed from places.\n\n"
        "![Time to the first plan and peak memory over the number of segments](solvers-scale.png)\n\n"
        + markdown_table(columns, rows)
    )


def _format_excess_pct(value: float | None, last: float) -> str:
    return figure(None if value is None or last == 0 else 100 * (value / last - 1), 2)


def draw_scale(result: Json, path: Path) -> None:
    """Draw time to the first plan and memory over the number of segments, both axes logarithmic."""
    from matplotlib.figure import Figure

    from executor.analysis.pictures import save_figure
    from executor.analysis.pictures.style import COLOURS, FAINT, MARKERS, PAPER

    figure = Figure(figsize=(10.0, 4.2), facecolor=PAPER, layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, key, label in ((left, "first_plan_s", "first complete plan, s"), (right, "peak_mib", "peak memory, MiB")):
        for place, cost in enumerate(Cost):
            rows = [row for row in result["rows"] if row["cost"] == cost.value and row[key]]
            generated = [row for row in rows if row["name"].startswith("generated")]
            axes.plot([row["segments"] for row in generated], [row[key] for row in generated], color=COLOURS[place],
                      marker=MARKERS[place], label=cost.value)  # fmt: skip
            real = [row for row in rows if row not in generated]
            axes.plot([row["segments"] for row in real], [row[key] for row in real], color=COLOURS[place], ls="",
                      marker=MARKERS[place], mfc="none", ms=10)  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="segments (hollow: the paper's network)", ylabel=label)
        axes.grid(color=FAINT, alpha=0.3, which="both", lw=0.5)
    left.legend(frameon=False)
    save_figure(figure, path)
