"""What column generation proves on the paper's network: costs, windows, and losses of plans."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.markdown import figure, markdown_table
from benchmarks.parts.setting import Setting
from benchmarks.problems import line_instance, with_budget
from benchmarks.store import Json
from benchmarks.table.settings import DRONE, INSPECTION_M_S, TRANSIT_M_S, VEHICLES
from planner import (
    PRESETS,
    Cost,
    Instance,
    Iterations,
    Plan,
    Progress,
    build_remaining_problem,
    replan,
    solve,
    solve_exact,
    travel_for,
    warm_up,
)
from planner.bounds import ASCENT, explain_infeasibility
from planner.fleet_state import event_times_s
from planner.kernels.repair import SAME_TIME_S
from planner.proofs import bound_earliest_window_s, decide_cover
from planner.stop_rules import UNLIMITED, StopVerdict

TITLE = "What is proven: bounds by column generation"
MINMAX_PCT = {500.0: 55.5, 700.0: 107.9, 1000.0: 160.6, 1200.0: 200.3, 2000.0: 312.6}
"""By radius, the longest route of the best MinMax plan of docs/results/table.md."""
COST_TIGHTNESS = 0.82
COST_LIMIT_S = 60.0
WINDOWS = (
    (500.0, 0.78, 266.0), (500.0, 0.82, 377.0), (500.0, 0.86, 638.0), (500.0, 0.90, 797.0), (700.0, 0.78, 377.0),
    (700.0, 0.82, 811.0), (700.0, 0.86, 1149.0), (700.0, 0.90, 1527.0), (1000.0, 0.78, 660.0), (1000.0, 0.82, 1239.0),
    (1000.0, 0.86, 1670.0), (1000.0, 0.90, 2230.0), (1200.0, 0.78, 657.0), (1200.0, 0.82, 1298.0),
    (1200.0, 0.86, 2041.0), (1200.0, 0.90, 2681.0), (2000.0, 0.78, 1002.0), (2000.0, 0.82, 2139.0),
    (2000.0, 0.86, 3185.0), (2000.0, 0.90, 4086.0),
)  # fmt: skip
"""Radius, tightness, and the least t* of any plan in docs/results/table.md."""
WINDOW_LIMIT_S = 120.0
LOSS_RADII_M = (1000.0, 1200.0)
LOSS_TIGHTNESS = 0.86
LOSSES = 100
"""Losses of each radius with LEAST_OPEN to MOST_OPEN open segments."""
LEAST_OPEN, MOST_OPEN = 14, 40
LOSS_LIMIT_S = 60.0


def make(setting: Setting) -> Json:
    """Prove costs, then windows, then losses."""
    warm_up()
    costs = [(radius, cost) for radius in MINMAX_PCT for cost in (Cost.MINSUM, Cost.MINMAX)]
    return {
        "costs": setting.make_cases("costs", costs, lambda one: f"{one[1].value}-{one[0]:g}", _prove_cost),
        "windows": setting.make_cases("windows", WINDOWS, lambda one: f"window-{one[0]:g}-{one[1]:g}", _bound_window),
        "losses": setting.make_cases("losses", LOSS_RADII_M, lambda one: f"losses-{one:g}", _decide_losses),
    }


def build_cell(setting: Setting, radius_m: float, tightness: float) -> Instance:
    """Return the table's instance of a radius with the budgets of a tightness."""
    instance = line_instance(
        setting.nechranice(radius_m).ends_m, VEHICLES, travel_for(PRESETS[DRONE], TRANSIT_M_S, INSPECTION_M_S)
    )
    return with_budget(instance, MINMAX_PCT[radius_m] / tightness)


def _prove_cost(setting: Setting, case: tuple[float, Cost]) -> Json:
    instance = build_cell(setting, case[0], COST_TIGHTNESS)
    began_s, limit_s = time.process_time(), setting.seconds(COST_LIMIT_S)

    def stop(progress: Progress) -> StopVerdict:  # noqa: ARG001 - the signature of a stop rule
        return StopVerdict(UNLIMITED if time.process_time() - began_s < limit_s else 0, "processor time")

    result = solve_exact(instance, cost=case[1], stop=stop)
    return {
        "radius_m": case[0], "segments": instance.segments, "cost": case[1].value, "value": result.evaluation.value,
        "bound": result.bound, "processor_s": time.process_time() - began_s,
    }  # fmt: skip


def _bound_window(setting: Setting, case: tuple[float, float, float]) -> Json:
    instance = build_cell(setting, *case[:2])
    limit_s, began_s = setting.seconds(WINDOW_LIMIT_S), time.process_time()
    bound_s = bound_earliest_window_s(
        instance, case[2], go_on=lambda _: time.process_time() - began_s < limit_s
    )  # fmt: skip
    return {
        "radius_m": case[0], "segments": instance.segments, "tightness": case[1],
        "earliest_s": case[2], "bound_s": bound_s, "processor_s": time.process_time() - began_s,
    }  # fmt: skip


def _decide_losses(setting: Setting, radius_m: float) -> Json:
    """Decide losses of the best MinComb plan, at times drawn from the whole plan."""
    instance = build_cell(setting, radius_m, LOSS_TIGHTNESS)
    plan = solve(
        instance, cost=Cost.MINCOMB, stop=Iterations(1_000 * instance.segments), all_vehicles=True
    ).plan  # fmt: skip
    chance, rows = np.random.default_rng(setting.seed), list[Json]()
    events_s = event_times_s(instance, plan)
    while len(rows) < setting.pieces(LOSSES, 2):
        lost, at_s = int(chance.integers(VEHICLES)), float(chance.choice(events_s[:-1]))
        row = _decide_loss(instance, plan, lost, at_s, setting.seconds(LOSS_LIMIT_S))
        if row is not None:
            rows.append(row)
    return {"radius_m": radius_m, "segments": instance.segments, "rows": rows}


def _decide_loss(instance: Instance, plan: Plan, lost: int, at_s: float, limit_s: float) -> Json | None:
    left = build_remaining_problem(instance, plan, lost, at_s + SAME_TIME_S)
    if not LEAST_OPEN <= len(left.open_segments) <= MOST_OPEN:
        return None
    began_s, how, verdict = time.process_time(), "search", "open"
    found = replan(left.instance, warm=left.warm, stop=Iterations(10_000))
    if found.feasible:
        verdict = "feasible"
    elif explain_infeasibility(left.instance, ascent=ASCENT) is not None:
        verdict, how = "impossible", "trees"
    else:
        how = "columns"
        answer = decide_cover(
            left.instance, known=[found.plan], go_on=lambda _: time.process_time() - began_s < limit_s
        )  # fmt: skip
        if answer is not True:
            verdict = "feasible" if isinstance(answer, Plan) else "impossible"
    return {
        "open": len(left.open_segments), "verdict": verdict, "how": how, "processor_s": time.process_time() - began_s,
    }  # fmt: skip


def report(result: Json) -> str:
    """Return its part of the page."""
    costs = [
        (
            f"{row['radius_m']:g}", row["segments"], row["cost"], figure(row["value"], 4),
            figure(row["bound"] or 0.0, 4), figure(_gap_pct(row["value"], row["bound"]), 3),
            figure(row["processor_s"], 1),
        )
        for row in result["costs"]
    ]  # fmt: skip
    windows = [
        (
            f"{row['radius_m']:g}", f"{row['tightness']:.2f}", figure(row["earliest_s"], 0), figure(row["bound_s"], 0),
            figure(_gap_pct(row["earliest_s"], row["bound_s"]), 1), figure(row["processor_s"], 1),
        )
        for row in result["windows"]
    ]  # fmt: skip
    about = (
        f"The instances of the [table](table.md): {VEHICLES} vehicles, budgets by tightness. Values and bounds are in "
        "percent of a battery, times in processor seconds."
    )
    about_costs = (
        f"Costs, tightness {COST_TIGHTNESS}, {COST_LIMIT_S:g} s each, the search for the first plan included. A gap of "
        "0 is a proof that the plan is the best."
    )
    about_windows = (
        f"Windows: the least t* of any plan in the table, and the bound for any plan of any length, {WINDOW_LIMIT_S:g} "
        "s each."
    )
    about_losses = (
        f"Losses of a MinComb plan, tightness {LOSS_TIGHTNESS}, at times drawn from all its events, with {LEAST_OPEN} "
        f"to {MOST_OPEN} open segments: 10,000 iterations of search, then the bound by spanning trees, then columns, "
        f"{LOSS_LIMIT_S:g} s each at most."
    )
    heads = ("D_max m", "losses", "re-plan found", "by columns", "impossible by trees", "by columns", "open", "most s")
    return "\n\n".join(
        [
            about,
            about_costs,
            markdown_table(("D_max m", "segments", "cost", "best known", "bound", "gap %", "s"), costs),
            about_windows,
            markdown_table(("D_max m", "tightness", "t* s", "bound s", "gap %", "s"), windows),
            about_losses,
            markdown_table(heads, [_loss_row(one) for one in result["losses"]]),
        ]
    )


def _gap_pct(value: float, bound: float | None) -> float:
    return 100.0 * (1.0 - (bound or 0.0) / value) if value > 0 else 0.0


def _loss_row(one: Json) -> tuple[object, ...]:
    def count(verdict: str, how: str) -> int:
        return sum((row["verdict"], row["how"]) == (verdict, how) for row in one["rows"])

    return (
        f"{one['radius_m']:g}", len(one["rows"]), count("feasible", "search"), count("feasible", "columns"),
        count("impossible", "trees"), count("impossible", "columns"), count("open", "columns"),
        figure(max(row["processor_s"] for row in one["rows"]), 1),
    )  # fmt: skip
