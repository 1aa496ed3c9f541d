"""Small instances exactly: whether a plan that covers everything exists, and the best plan with its proof.

The best plan is a choice of routes, one for each vehicle, that share the segments among them: set partitioning over all
routes within the budgets (the best through each set of segments), solved by HiGHS. Vehicles that are alike share their
columns and are only counted. Of the columns most go before branching: a plan by the search is an upper bound, the
linear relaxation a lower one, and a column whose reduced cost is more than lies between them is in no better plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planner.cost import Cost
from planner.evaluate import evaluate
from planner.model import Instance, Plan, Route
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.partition import SAME, build_partition, prove_optimum
from planner.result import Result
from planner.solve import solve
from planner.stop_rules import Iterations, Progress, StopRule, Stopwatch, add_progress_report
from planner.subset_routes import SubsetRoutes, find_covering_sets, find_most_valuable_sets, find_subset_routes

EXACT_SEGMENTS = 16
"""Segments up to which ``find_covering_plan`` answers; two more take four times the memory, up to nine times as long.

For 3 vehicles it takes some 5 ms with 12 segments, 50 ms with 14, 0.2 s with 16.
"""
OPTIMAL_SEGMENTS = 18
"""Segments up to which ``solve_exact`` takes an instance: for 3 vehicles of different starts and budgets that leave a
tenth over the optimum, 0.3 s with 14 segments, 1 s with 16, 4 s and 0.5 GB with 18. Where no budget rules any route
out it is 4 s, 20 s, and 50 s and 3.4 GB."""


def find_covering_plan(instance: Instance) -> Plan | None:
    """Return a plan that inspects everything within all budgets, or None where there is none: both are certain.

    Exact to ``BUDGET_TOLERANCE_PCT``, with the figures of ``evaluate`` to the last bit. Takes 3^n steps for each
    vehicle but two.

    Raises:
        InstanceError: more than EXACT_SEGMENTS segments.
    """
    subsets = find_subset_routes(instance, EXACT_SEGMENTS)
    fits = [np.isfinite(own.energy_pct) for own in subsets]
    parts = find_covering_sets(fits)
    return None if parts is None else _build_plan(instance, subsets, parts)


def solve_exact(
    instance: Instance,
    *,
    cost: Cost,
    stop: StopRule,
    seed: int = 0,
    all_vehicles: bool = False,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Return a plan with the proof of how good it is: ``Result.bound`` and ``Result.gap``.

    As with ``solve``, no route exceeds its vehicle's budget and what cannot be covered is left out, the least value
    first; then, if all vehicles are to fly, as many fly as can; then the cost decides.

    Args:
        instance: the problem, of at most OPTIMAL_SEGMENTS segments.
        cost: what to minimise.
        stop: ends the proof before the gap is closed. An iteration is a node of the branch and bound. The search for a
            first plan takes a fraction of a second and is not stopped by it.
        seed: of that search.
        all_vehicles: leave no vehicle without a visit where segments and budgets allow it.
        params: what that search is tuned by.
        on_progress: called whenever ``stop`` is asked.

    Raises:
        InstanceError: more than OPTIMAL_SEGMENTS segments.
    """
    if instance.segments == 0:
        done = solve(instance, cost=cost, stop=stop)
        return replace(done, bound=done.evaluation.value)
    watch = Stopwatch()
    subsets = find_subset_routes(instance, OPTIMAL_SEGMENTS)
    first = _find_first_plan(instance, subsets, cost, seed, params, all_vehicles=all_vehicles)
    return _prove(
        instance,
        subsets,
        cost,
        first,
        _StopRuleCallback(first, add_progress_report(stop, on_progress), watch),
        all_vehicles=all_vehicles,
    )


class _StopRuleCallback:
    """Asks the stop rule while HiGHS works."""

    def __init__(self, first: Result, stop: StopRule, watch: Stopwatch) -> None:
        self._first = first
        self._stop = stop
        self._watch = watch
        self.reason = "no better bound"

    def __call__(self, nodes: int) -> bool:
        """Return whether to stop."""
        progress = Progress(
            iterations=nodes,
            since_improvement=nodes,
            seconds=self.seconds,
            value=self._first.evaluation.value,
            uncovered=len(self._first.plan.uncovered),
            feasible=self._first.feasible,
            impossible=not self._first.feasible,
        )
        verdict = self._stop(progress)
        if verdict.allowed <= 0:
            self.reason = verdict.reason
        return verdict.allowed <= 0

    @property
    def seconds(self) -> float:
        """Seconds since the call of the solver."""
        return self._watch.seconds


def _find_first_plan(
    instance: Instance,
    subsets: Sequence[SubsetRoutes],
    cost: Cost,
    seed: int,
    params: SearchParams,
    *,
    all_vehicles: bool,
) -> Result:
    """Return a good plan that covers as much value as any."""
    from planner.construct import build_kernel_problem

    stop = Iterations(params.exact.search_iterations)
    found = solve(instance, cost=cost, stop=stop, seed=seed, all_vehicles=all_vehicles, params=params)
    if not found.plan.uncovered:
        return found
    plan = _build_plan(instance, subsets, find_most_valuable_sets(subsets, build_kernel_problem(instance).value))
    again = solve(instance, cost=cost, stop=stop, seed=seed, initial=plan, all_vehicles=all_vehicles, params=params)
    if _plan_value(instance, again.plan) >= _plan_value(instance, plan) * (1 - SAME):
        return again
    # A route within the last of the tolerance, from which the search takes a visit.
    return replace(again, plan=plan, evaluation=evaluate(instance, plan, cost))


def _prove(
    instance: Instance,
    subsets: Sequence[SubsetRoutes],
    cost: Cost,
    first: Result,
    ask: _StopRuleCallback,
    *,
    all_vehicles: bool,
) -> Result:
    """Return the best plan and what is proved of it, beginning with a plan of the value that a plan can have."""
    from planner.construct import build_kernel_problem, build_true_weights

    numbers = build_kernel_problem(instance)
    grounded = build_true_weights(numbers, cost, all_vehicles=all_vehicles).empty
    everybody = len(instance.vehicles)

    def charge(plan: Plan) -> float:
        """Return what vehicles without a visit add to the cost."""
        return grounded * (everybody - sum(bool(route.visits) for route in plan.routes))

    ceiling = first.evaluation.value + charge(first.plan)
    least_value = _plan_value(instance, first.plan) if first.plan.uncovered else np.inf
    program = build_partition(
        instance, subsets, cost, ceiling=ceiling, grounded=grounded, value=numbers.value, least_value=least_value
    )
    proof = prove_optimum(program, ceiling, ask)
    plan = first.plan if proof.parts is None else _build_plan(instance, subsets, proof.parts)
    evaluation = evaluate(instance, plan, cost)
    bound = None if proof.bound is None else min(evaluation.value, proof.bound - charge(plan))
    return Result(
        plan=plan,
        evaluation=evaluation,
        feasible=not plan.uncovered and not evaluation.violations,
        iterations=proof.nodes,
        seconds=ask.seconds,
        stopped_by="optimal" if bound is not None and _is_same(bound, evaluation.value) else ask.reason,
        impossible=first.impossible or ("the budgets do not suffice for every segment" if plan.uncovered else None),
        bound=bound,
    )


def _is_same(one: float, other: float) -> bool:
    return abs(one - other) <= SAME * (1 + abs(other))


def _plan_value(instance: Instance, plan: Plan) -> float:
    """Return the value of what a plan inspects, as the search weighs it."""
    from planner.construct import build_kernel_problem

    value = build_kernel_problem(instance).value
    return float(value.sum() - value[list(plan.uncovered)].sum())


def _build_plan(instance: Instance, subsets: Sequence[SubsetRoutes], parts: Sequence[int]) -> Plan:
    """Return the plan that gives each vehicle its best route through a set of segments."""
    routes = tuple(Route(vehicle, own.route_of(parts[vehicle])) for vehicle, own in enumerate(subsets))
    inspected = sum(parts)
    return Plan(routes, tuple(segment for segment in range(instance.segments) if not inspected >> segment & 1))
