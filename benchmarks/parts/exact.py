"""The search against the proven optimum on small random instances, and the proof's limit in a minute."""

from __future__ import annotations

import numpy as np

from benchmarks.markdown import figure, markdown_table
from benchmarks.parts.setting import Setting
from benchmarks.problems import PAPER_S, line_instance, with_budget
from benchmarks.store import Json
from planner import Cost, Instance, Iterations, PlannerError, Seconds, solve, solve_exact, warm_up

TITLE = "The search against the proven optimum"
SIZES = ((4, 2), (6, 2), (6, 3), (8, 2), (8, 3))
"""Segments and vehicles."""
INSTANCES = 10
GROWTH = (10, 12, 14, 16, 18)
GROWTH_VEHICLES = 3
LIMIT_S = 60.0
ITERATIONS = 20_000
SAME = 1e-6
"""Values within this share of each other are equal."""


def make(setting: Setting) -> Json:
    """Compare, then increase the instances."""
    warm_up()
    solve_exact(random_line(*SIZES[0], setting.seed), cost=Cost.MINCOMB, stop=Seconds(LIMIT_S))  # loads its kernels
    cases = [(size, cost) for size in SIZES for cost in Cost]
    small = []
    for done, ((segments, vehicles), cost) in enumerate(cases):
        setting.told(TITLE, done, len(cases) + len(GROWTH))
        small.append(_compare_with_optimum(setting, segments, vehicles, cost))
    growth = []
    for done, segments in enumerate(GROWTH[: setting.pieces(len(GROWTH), 2)]):
        setting.told(TITLE, len(cases) + done, len(cases) + len(GROWTH))
        growth.append(_grown(setting, segments))
    setting.told(TITLE, len(cases) + len(GROWTH), len(cases) + len(GROWTH))
    return {"small": small, "growth": growth}


def random_line(segments: int, vehicles: int, seed: int) -> Instance:
    """Return segments of up to 300 m in a square of 2 km, with budgets a fifth above the longest route's need."""
    chance = np.random.default_rng(seed)
    first = chance.uniform(-1000, 1000, (segments, 2))
    ends = np.stack([first, first + chance.uniform(-210, 210, (segments, 2))], axis=1)
    instance = line_instance(ends, vehicles, PAPER_S)
    longest = solve(instance, cost=Cost.MINMAX, stop=Iterations(5000)).evaluation.value
    return with_budget(instance, 1.2 * longest)


def _compare_with_optimum(setting: Setting, segments: int, vehicles: int, cost: Cost) -> Json:
    seeds = range(setting.seed, setting.seed + setting.pieces(INSTANCES, 2))
    equal, worst, times = 0, 0.0, []
    for seed in seeds:
        instance = random_line(segments, vehicles, seed)
        proven = solve_exact(instance, cost=cost, stop=Seconds(LIMIT_S))
        found = solve(instance, cost=cost, stop=Iterations(ITERATIONS), seed=seed)
        over = found.evaluation.value / proven.evaluation.value - 1.0
        same_cover = len(found.plan.uncovered) == len(proven.plan.uncovered)
        equal += same_cover and abs(over) <= SAME
        worst = max(worst, over)
        times.append(proven.seconds)
    return {
        "segments": segments, "vehicles": vehicles, "cost": cost.value, "instances": len(seeds), "equal": equal,
        "worst": worst, "exact_s": max(times),
    }  # fmt: skip


def _grown(setting: Setting, segments: int) -> Json:
    instance = random_line(segments, GROWTH_VEHICLES, setting.seed)
    row: Json = {"segments": segments, "costs": {}}
    for cost in Cost:
        try:
            result = solve_exact(instance, cost=cost, stop=Seconds(setting.seconds(LIMIT_S)))
        except PlannerError as error:
            row["costs"][cost.value] = {"refused": str(error)}
        else:
            row["costs"][cost.value] = {"seconds": result.seconds, "proved": result.bound is not None}
    return row


def report(result: Json) -> str:
    """Return its part of the page."""
    small = [
        (
            row["segments"], row["vehicles"], row["cost"], f"{row['equal']} of {row['instances']}",
            figure(100 * row["worst"], 4), figure(row["exact_s"], 2),
        )
        for row in result["small"]
    ]  # fmt: skip
    growth = [(row["segments"], *(_grown_cell(row["costs"][cost.value]) for cost in Cost)) for row in result["growth"]]
    said = (
        f"Random segments of up to 300 m in a square of 2 km, budgets a fifth above the least longest route; the "
        f"search had {ITERATIONS} iterations of one start."
    )
    return "\n\n".join([
        said,
        markdown_table(("segments", "vehicles", "cost", "equal", "largest gap %", "longest proof s"), small),
        f"{GROWTH_VEHICLES} vehicles, seconds to the proof; each had {LIMIT_S:g} s:",
        markdown_table(("segments", *(cost.value for cost in Cost)), growth),
    ])  # fmt: skip


def _grown_cell(one: Json) -> str:
    if "refused" in one:
        return f"refused: {one['refused']}"
    if not one["proved"]:
        return f"none after {one['seconds']:.1f} s"
    return f"{one['seconds']:.2f} s"
