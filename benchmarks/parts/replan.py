"""From a loss to a checked re-plan: the time it takes, and whether abandoned cases are infeasible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import as_completed
from dataclasses import dataclass

import numpy as np

from benchmarks.markdown import figure, markdown_table
from benchmarks.parts.setting import Setting
from benchmarks.peer import pyvrp_installed, solve_pyvrp
from benchmarks.problems import PAPER_S, line_instance, with_budget
from benchmarks.store import Json
from benchmarks.synthetic import generate_network
from executor.adapters.interrupts import start_worker_pool
from planner import (
    Cost,
    FirstFeasible,
    Instance,
    Plan,
    Route,
    Seconds,
    Stopwatch,
    build_remaining_problem,
    combine_stop_rules,
    completion_times_s,
    evaluate,
    replan,
    route_duration_s,
    solve,
    warm_up,
)

TITLE = "Re-plans"
PEER_TITLE = "Given up, asked of PyVRP"
TIGHTNESS = (0.78, 0.82, 0.86, 0.90)
LARGE_TIGHTNESS = (0.90, 0.97)
"""Tightness; nineteen vehicles replace twenty more easily than three replace four."""
REAL_RADIUS_M, REAL_VEHICLES = 2000.0, 4
LARGE_SEGMENTS, LARGE_VEHICLES = 500, 20
PLAN_S = {"real": 5.0, "large": 20.0}
EFFORT_S = {"real": 1.0, "large": 2.0}
"""Time after which a loss counts as one without a re-plan."""
MOST_LOSSES = 2000
"""Maximum losses of one plan; of more, this many at even spacing."""
SAMPLE = 100
PEER_S = 10.0
PEER_SCALE = 1000.0
PERCENTILES = (50, 90, 99)


@dataclass(frozen=True, slots=True)
class Case:
    """A plan whose losses are evaluated."""

    name: str
    tightness: float


def make(setting: Setting) -> Json:
    """Measure all plans, then give PyVRP some of the abandoned cases."""
    warm_up()
    cases = [Case("real", tightness) for tightness in TIGHTNESS] if setting.data is not None else []
    cases += [Case("large", tightness) for tightness in LARGE_TIGHTNESS]
    rows = setting.make_cases(TITLE, cases, lambda case: f"replan-{case.name}-{case.tightness:g}", _measure_case)
    return {"rows": rows, "peer": _peer(setting, rows) if pyvrp_installed() else None}


def _measure_case(setting: Setting, case: Case) -> Json:
    instance, plan = _plan(setting, case)
    losses = list(_losses(instance, plan))
    every = np.unique(np.linspace(0, len(losses) - 1, min(len(losses), setting.pieces(MOST_LOSSES, 100))).astype(int))
    feasible_s, given_up_s, given_up = [], [], []
    effort = combine_stop_rules(FirstFeasible(), Seconds(setting.seconds(EFFORT_S[case.name])))
    for lost, at_s in (losses[place] for place in every):
        watch = Stopwatch()
        left = build_remaining_problem(instance, plan, lost, at_s)
        result = replan(left.instance, warm=left.warm, stop=effort, seed=setting.seed)
        if result.feasible:
            feasible_s.append(watch.seconds)
        else:
            given_up_s.append(watch.seconds)
            given_up.append([lost, at_s, result.impossible is not None])
    return {
        "case": case.name, "tightness": case.tightness, "segments": instance.segments,
        "vehicles": len(instance.vehicles), "budget": instance.vehicles[0].budget_pct,
        "routes": [list(route.visits) for route in plan.routes], "uncovered": len(plan.uncovered),
        "losses": len(losses), "tried": len(every), "feasible": _distribution(feasible_s),
        "certain": sum(one[2] for one in given_up), "given_up": given_up, "given_up_s": _distribution(given_up_s),
    }  # fmt: skip


def _plan(setting: Setting, case: Case) -> tuple[Instance, Plan]:
    """Return a MinComb plan whose budget is the best MinMax over the tightness."""
    if case.name == "real":
        instance = line_instance(setting.nechranice(REAL_RADIUS_M).ends_m, REAL_VEHICLES, PAPER_S)
    else:
        instance = line_instance(generate_network(LARGE_SEGMENTS, setting.seed), LARGE_VEHICLES, PAPER_S)
    stop = Seconds(setting.seconds(PLAN_S[case.name]))
    minmax = solve(instance, cost=Cost.MINMAX, stop=stop, seed=setting.seed, starts=setting.starts)
    tight = with_budget(instance, minmax.evaluation.value / case.tightness)
    plan = solve(
        tight, cost=Cost.MINCOMB, stop=stop, seed=setting.seed, starts=setting.starts, initial=minmax.plan,
        all_vehicles=True,
    ).plan  # fmt: skip
    return tight, plan


def _losses(instance: Instance, plan: Plan) -> Iterator[tuple[int, float]]:
    """Yield each flying vehicle at the start of each interval between two completions, with that time."""
    ends = [route_duration_s(instance, route) for route in plan.routes]
    times = {0.0, *ends}
    for route in plan.routes:
        times.update(completion_times_s(instance, route))
    for at_s in sorted(times):
        for vehicle, end_s in enumerate(ends):
            if end_s > at_s + 1e-9:
                yield vehicle, at_s


def _distribution(times_s: list[float]) -> Json | None:
    if not times_s:
        return None
    values = {f"p{share}_ms": 1000 * float(np.percentile(times_s, share)) for share in PERCENTILES}
    return {"count": len(times_s), **values, "max_ms": 1000 * max(times_s)}


def _peer(setting: Setting, rows: list[Json]) -> Json:
    """Give PyVRP a sample of abandoned cases; its plan counts if it is valid by our definition."""
    given_up = [(row, lost, at_s, sure) for row in rows for lost, at_s, sure in row["given_up"]]
    chance = np.random.default_rng(setting.seed)
    count = min(len(given_up), setting.pieces(SAMPLE, 3))
    chosen = [given_up[figure] for figure in sorted(chance.choice(len(given_up), count, replace=False))]
    questions = [_Question(setting, row, lost, at_s) for row, lost, at_s, _ in chosen]
    answers = _answers(setting, questions)
    solved = [
        {"case": one.case, "tightness": one.tightness, "lost": one.lost, "at_s": one.at_s}
        for one, answer in zip(questions, answers, strict=True)
        if answer["solved"]
    ]
    certain = sum(sure for *_, sure in chosen)
    return {"given_up": len(given_up), "asked": count, "certain": certain, "solved": solved}


class _Question:
    """A loss for PyVRP: all that another process needs, and nothing else."""

    def __init__(self, setting: Setting, row: Json, lost: int, at_s: float) -> None:
        self.case: str = row["case"]
        self.tightness: float = row["tightness"]
        self.lost, self.at_s = lost, at_s
        real = self.case == "real"
        ends_m = setting.nechranice(REAL_RADIUS_M).ends_m if real else generate_network(LARGE_SEGMENTS, setting.seed)
        self._ends_m, self._vehicles, self._budget, self._routes = ends_m, row["vehicles"], row["budget"], row["routes"]
        self._seconds, self._seed = setting.seconds(PEER_S), setting.seed
        self.key = f"replan-peer-{self.case}-{self.tightness:g}-{lost}-{at_s:.3f}"
        self.settings: Mapping[str, object] = {
            "seed": setting.seed, "quick": setting.quick, "routes": row["routes"], "budget": row["budget"],
        }  # fmt: skip

    def answer(self) -> Json:
        """Run PyVRP; its answer counts if it is valid by our definition."""
        instance = line_instance(self._ends_m, self._vehicles, PAPER_S, self._budget)
        plan = Plan(tuple(Route(vehicle, tuple(visits)) for vehicle, visits in enumerate(self._routes)))
        left = build_remaining_problem(instance, plan, self.lost, self.at_s)
        answer = solve_pyvrp(left.instance, seconds=self._seconds, seed=self._seed, scale=PEER_SCALE)
        holds = answer.plan is not None and not evaluate(left.instance, answer.plan, Cost.MINSUM).violations
        return {"solved": holds}


def _answers(setting: Setting, questions: list[_Question]) -> list[Json]:
    """Return known or new answers, one question per core: PyVRP uses one."""
    known = {one.key: setting.store.find_result(one.key, one.settings) for one in questions}
    missing = [one for one in questions if known[one.key] is None]
    setting.told(PEER_TITLE, len(questions) - len(missing), len(questions))
    pool = start_worker_pool(setting.starts)
    try:
        futures = {pool.submit(one.answer): one for one in missing}
        for done, future in enumerate(as_completed(futures), len(questions) - len(missing) + 1):
            one = futures[future]
            known[one.key] = setting.store.keep(one.key, one.settings, future.result())
            setting.told(PEER_TITLE, done, len(questions))
    finally:
        pool.shutdown(cancel_futures=True)
    answers = [known[one.key] for one in questions]
    return [answer for answer in answers if answer is not None]


def report(result: Json) -> str:
    """Return its part of the page."""
    columns = ("segments", "vehicles", "tightness", "losses", "tried", "re-planned",
               *(f"{p} % ms" for p in PERCENTILES),
               "longest ms", "given up", "of these certain", "given up after ms, 50 %", "longest ms")  # fmt: skip
    rows = [
        (
            row["segments"], row["vehicles"], row["tightness"], row["losses"], row["tried"], *_times(row["feasible"]),
            len(row["given_up"]), row["certain"], *_times(row["given_up_s"])[1::3],
        )
        for row in result["rows"]
    ]  # fmt: skip
    efforts = f"{EFFORT_S['real']:g} s with 4 vehicles, {EFFORT_S['large']:g} s with 20"
    said = (
        "Every loss of a MinComb plan: each interval between two completions with each vehicle flying in it, from the "
        "loss to a re-plan that covers everything and was checked, one core, kernels loaded. The paper's model; "
        "tightness is the best MinMax found over the budget. The networks are the paper's within "
        f"{REAL_RADIUS_M:g} m and a generated one. A loss is given up after {efforts}, or at once where it is "
        "certain that no re-plan exists."
    )
    return "\n\n".join([
        said,
        markdown_table(columns, rows),
        _peer_text(result["peer"]),
    ])  # fmt: skip


def _times(one: Json | None) -> tuple[str, ...]:
    if one is None:
        return ("0", *["-"] * (len(PERCENTILES) + 1))
    return (str(one["count"]), *(figure(one[f"p{p}_ms"], 1) for p in PERCENTILES), figure(one["max_ms"], 1))


def _peer_text(peer: Json | None) -> str:
    if peer is None:
        return "PyVRP is not installed: what was given up was not asked of it."
    return (
        f"Of {peer['given_up']} losses given up, {peer['asked']} were given to PyVRP for {PEER_S:g} s each, every "
        f"survivor a vehicle type with a depot of its own: it found a re-plan for {len(peer['solved'])}. "
        f"{peer['certain']} of those asked are certain to have none."
    )
