"""Measure plans chosen for the probability that everything is inspected beside MinComb and window plans.

In each cell of the table the mean time between failures is the one at which the best MinComb plan finishes about
``TARGET`` of its flights. All plans of a cell are then flown in the same new flights, by ``planner.estimate_coverage``,
which is that of ``faultline risk``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows
from benchmarks.problems import line_instance, network_of, with_budget
from benchmarks.report import Report, Table
from benchmarks.store import Json, Store
from benchmarks.table.settings import DRONE, INSPECTION_M_S, TRANSIT_M_S, VEHICLES
from planner import (
    PRESETS,
    Cost,
    Instance,
    Iterations,
    Plan,
    build_risk_campaign,
    estimate_coverage,
    estimate_risks,
    evaluate,
    replan_window,
    simulate_chunk,
    solve,
    solve_window,
    split_flights,
    travel_for,
)
from planner.coverage import solve_coverage

TARGET = 0.8
"""Probability of the MinComb plan at the mean time between failures of a cell."""
HOURS = tuple(2.0 * 1.25**step for step in range(14))
"""Mean times between failures that are tried, in durations of the best MinMax plan."""
TRIAL_FLIGHTS = 500
FRESH_SEED = 7_000_000
Z_95 = 1.959963984540054
POINTS = 0.05
"""The gain that was asked for."""
TITLE = "Plans chosen for the probability of coverage"
INTRODUCTION = (
    "`{command}`: the paper's network, 4 vehicles, none kept on the ground, one core. The mean time between failures "
    "(MTBF) of a cell is the one at which the MinComb plan finishes about 80 % of its flights. *MinComb* is the plan "
    "with the earliest t\\* of {seeds} seeds, {plan_iterations} iterations each. *Window* and *coverage* had "
    "{iterations} iterations each, and both may fly routes as long as the budget allows. All three are estimated from "
    "the same {flights} new flights, which no search has seen, with re-plans after up to two losses. Differences are "
    "in percentage points, with the 95 % interval of the difference of two independent shares, which is wider than "
    "needed, as the flights are the same. Figures of three plans are in that order."
)
COLUMNS = ("D_max m", "tightness", "segments", "MTBF h", "MinComb %", "window %", "coverage %", "over MinComb",
           "over window", "t* s", "longest route s", "in the air s", "processor s")  # fmt: skip


def measure_coverage(  # noqa: PLR0913 - settings of the command
    network: Path, out: Path, cells: Sequence[tuple[float, float]], *, iterations: int, seeds: int, flights: int,
    seed: int, fresh: bool, told: Callable[[int, int], None], command: str,
) -> Json:  # fmt: skip
    """Return the content of coverage.json; finished cells are kept in ``out``.

    Raises:
        BenchError: the directory cannot be written.
        missions.MissionsError: the network cannot be used.
    """
    store = Store(out / "coverage", fresh=fresh)
    settings = {"iterations": iterations, "seeds": seeds, "flights": flights, "seed": seed}
    rows = []
    for number, (radius_m, tightness) in enumerate(cells):
        told(number, len(cells))
        rows.append(store.find_or_make(
            f"{radius_m:g}-{tightness:g}", settings,
            lambda radius_m=radius_m, tightness=tightness: _measure_cell(  # type: ignore[misc]
                network, radius_m, tightness, iterations, seeds, flights, seed
            ),
        ))  # fmt: skip
    told(len(cells), len(cells))
    return {**head("coverage/1", command), **settings, "plan_iterations": iterations // 5, "rows": rows}


def _measure_cell(
    network: Path, radius_m: float, tightness: float, iterations: int, seeds: int, flights: int, seed: int
) -> Json:
    travel = travel_for(PRESETS[DRONE], TRANSIT_M_S, INSPECTION_M_S)
    ample = line_instance(network_of(network, radius_m).ends_m, VEHICLES, travel)
    stop = Iterations(iterations // 5)
    minmax = min(
        (solve(ample, cost=Cost.MINMAX, stop=stop, seed=one, all_vehicles=True) for one in range(seeds)),
        key=lambda result: result.evaluation.value,
    )
    instance = with_budget(ample, minmax.evaluation.value / tightness)
    mincomb = min(
        (
            solve(instance, cost=Cost.MINCOMB, stop=stop, seed=one, all_vehicles=True).plan
            for one in range(seed, seed + seeds)
        ),
        key=lambda plan: replan_window(instance, plan).earliest_s,
    )
    mtbf_h = _choose_mtbf_h(instance, mincomb, minmax.evaluation.longest_route_s / 3600.0, seed)
    began_s = time.process_time()
    window = solve_window(
        instance, stretch=1.0 / tightness - 1.0, stop=Iterations(iterations), seed=seed, all_vehicles=True,
        initial=[mincomb], longest_s=minmax.evaluation.longest_route_s,
    )  # fmt: skip
    window_s = time.process_time() - began_s
    began_s = time.process_time()
    coverage = solve_coverage(
        instance, mtbf_h=mtbf_h, stop=Iterations(iterations), seed=seed, all_vehicles=True, initial=[mincomb],
        flights=1,
    )  # fmt: skip
    coverage_s = time.process_time() - began_s
    plans = {"mincomb": (mincomb, 0.0), "window": (window.plan, window_s), "coverage": (coverage.plan, coverage_s)}
    return {
        "radius_m": radius_m,
        "tightness": tightness,
        "segments": instance.segments,
        "mtbf_h": mtbf_h,
        **{name: _figures(instance, plan, mtbf_h, flights, seed) | {"cpu_s": cpu_s}
           for name, (plan, cpu_s) in plans.items()},
    }  # fmt: skip


def _choose_mtbf_h(instance: Instance, plan: Plan, longest_h: float, seed: int) -> float:
    """Return the mean time between failures at which a plan finishes nearest to ``TARGET`` of its flights."""
    campaign = build_risk_campaign(instance, plan, mtbf_h=[factor * longest_h for factor in HOURS], max_losses=1)
    found = estimate_risks(
        campaign, [simulate_chunk(campaign, chunk) for chunk in split_flights(TRIAL_FLIGHTS, FRESH_SEED + seed)]
    )
    return min(found, key=lambda one: abs(one.finished[-1].estimate - TARGET)).mtbf_h


def _figures(instance: Instance, plan: Plan, mtbf_h: float, flights: int, seed: int) -> Json:
    found = estimate_coverage(instance, plan, mtbf_h, flights=flights, seed=FRESH_SEED + seed, fly_again=True)
    chance, evaluation = found.finished[-1], evaluate(instance, plan, Cost.MINMAX)
    return {
        "routes": [list(route.visits) for route in plan.routes],
        "probability": chance.estimate,
        "low_95": chance.low,
        "high_95": chance.high,
        "uninspected_m": found.undone_m[-1],
        "earliest_s": replan_window(instance, plan).earliest_s,
        "longest_s": evaluation.longest_route_s,
        "flown_s": sum(evaluation.durations_s),
    }


def gain_of(row: Json, over: str, flights: int) -> tuple[float, float]:
    """Return by how much the coverage plan's probability is larger, and half the 95 % interval of that."""
    ours, theirs = float(row["coverage"]["probability"]), float(row[over]["probability"])
    return ours - theirs, Z_95 * math.sqrt((ours * (1 - ours) + theirs * (1 - theirs)) / flights)


def report_coverage(content: Json) -> Report:
    """Return the report."""
    return Report(
        "coverage", TITLE, content,
        (machine_line(content["machine"]), INTRODUCTION.format_map(content), *_summarise(content),
         Table(COLUMNS, _rows(content), TITLE, 9)),
    )  # fmt: skip


def _summarise(content: Json) -> Iterator[str]:
    rows, flights = content["rows"], content["flights"]
    for over in ("mincomb", "window"):
        gains = [gain_of(row, over, flights) for row in rows]
        reached = sum(gain >= POINTS for gain, _ in gains)
        more = sum(gain - half > 0 for gain, half in gains)
        less = sum(gain + half < 0 for gain, half in gains)
        name = {"mincomb": "MinComb", "window": "window"}[over]
        yield (
            f"Over the {name} plan: {100 * POINTS:g} points or more in {reached} of {len(rows)} cells; the interval "
            f"shows a gain in {more} and a loss in {less}."
        )


def _rows(content: Json) -> Rows:
    def share(one: dict[str, Any]) -> str:
        return f"{100 * one['probability']:.1f} ({100 * one['low_95']:.1f} to {100 * one['high_95']:.1f})"

    def gain(row: Json, over: str) -> str:
        points, half = gain_of(row, over, content["flights"])
        return f"{100 * points:+.1f} ± {100 * half:.1f}"

    plans = ("mincomb", "window", "coverage")

    def each(row: Json, key: str) -> str:
        return " / ".join(f"{row[name][key]:.0f}" for name in plans)

    return [
        (
            f"{row['radius_m']:g}", f"{row['tightness']:.2f}", str(row["segments"]), f"{row['mtbf_h']:.2f}",
            *(share(row[name]) for name in plans), gain(row, "mincomb"), gain(row, "window"),
            each(row, "earliest_s"), each(row, "longest_s"), each(row, "flown_s"), each(row, "cpu_s"),
        )
        for row in content["rows"]
    ]  # fmt: skip
