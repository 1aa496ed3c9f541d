"""What column generation proves: that a fleet cannot cover everything, and bounds on the costs and on the window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planner.bounds import bound_window_by_trees_s
from planner.columns import ColumnSearch, RouteKind, check_can_prove, list_kinds
from planner.errors import PlanError
from planner.evaluate import BUDGET_TOLERANCE_PCT, Cost, Result, evaluate
from planner.model import Instance, Plan, lift_locks
from planner.moves import FloatArray
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.solve import solve
from planner.stop_rules import Iterations, Progress, StopRule, Stopwatch

Report = Callable[[float], bool]
"""Called with the proven bound after each step; whether to go on."""
HALVINGS = 8
"""Times that the interval in which a limit is sought is halved."""
NEARLY = 1e-3
"""Share of the cost within which it is not halved, but decided."""
PROVEN = 1e-6
"""A plan is the best if its cost exceeds the bound by this share at most."""
NEAR_S = 1.0
"""An interval of times that is not halved any more."""


def go_on_always(bound: float) -> bool:  # noqa: ARG001 - the signature of Report
    """Never end a proof."""
    return True


def prove_plan(
    instance: Instance, *, cost: Cost, stop: StopRule, all_vehicles: bool = False,
    params: SearchParams = DEFAULT_PARAMS,
) -> Result:  # fmt: skip
    """Return the best plan found with a proven lower bound on its cost: ``solve_exact`` for many segments.

    A plan that leaves something out has no bound.

    Raises:
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    check_can_prove(instance.segments)
    watch = Stopwatch()
    first = solve(
        instance, cost=cost, stop=Iterations(params.exact.search_iterations * instance.segments),
        all_vehicles=all_vehicles, params=params,
    )  # fmt: skip
    if not first.feasible:
        return replace(first, seconds=watch.seconds)
    steps, reason, least, weight = 0, "optimal", 0.0, 1.0

    def go_on(bound: float) -> bool:
        nonlocal steps, reason
        steps += 1
        verdict = stop(
            Progress(steps, 0, watch.seconds, first.evaluation.value, 0, True, False, least + weight * max(0.0, bound))
        )
        if verdict.allowed <= 0:
            reason = verdict.reason
        return verdict.allowed > 0

    function, found = cost.function, [first.plan]
    if function.total > 0:
        total, plan = bound_total_pct(instance, first.plan, go_on=go_on)
        least, found = function.total * total, [*found, plan]
    weight = function.peak_weight(len(instance.vehicles))
    if weight > 0:
        smallest = (least / function.total if function.total > 0 else 0.0) / len(instance.vehicles)
        longest, plan = bound_longest_pct(instance, first.plan, least=smallest, go_on=go_on)
        least, found = least + weight * longest, [*found, plan]

    def rate(plan: Plan) -> tuple[int, float]:
        idle = sum(not route.visits for route in plan.routes) if all_vehicles else 0
        return idle, evaluate(instance, plan, cost).value

    best = min(found, key=rate)
    evaluation = evaluate(instance, best, cost)
    is_proven = least >= evaluation.value * (1 - PROVEN)
    return Result(
        plan=best, evaluation=evaluation, feasible=not evaluation.violations, iterations=first.iterations + steps,
        seconds=watch.seconds, stopped_by="optimal" if is_proven else "gap" if reason == "optimal" else reason,
        bound=evaluation.value if is_proven else least,
    )  # fmt: skip


def _report_fixed(go_on: Report, bound: float) -> Report:
    """Return the report of a bound that the steps of a proof do not change."""
    return lambda _: go_on(bound)


def bound_total_pct(instance: Instance, plan: Plan, *, go_on: Report = go_on_always) -> tuple[float, Plan]:
    """Return a lower bound on the total energy of covering everything within the budgets, and the best known plan.

    Args:
        instance: the problem.
        plan: a plan that covers everything within the budgets.
        go_on: asked after each step.

    Raises:
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    value = evaluate(instance, plan, Cost.MINSUM).value
    search = _search_cover(instance, list_kinds(instance), [plan], goal=value)
    while search.step() and go_on(min(search.bound, value)):
        pass
    bound = search.bound
    while bound < value * (1 - PROVEN) and go_on(min(search.bound, value)):
        bound, better = search.choose_routes(value, lambda: go_on(search.bound))
        if better is None or evaluate(instance, better, Cost.MINSUM).value >= value:
            break
        # There are fewer routes to choose from below a better plan.
        plan, value = better, evaluate(instance, better, Cost.MINSUM).value
    return min(bound, value), plan


def bound_longest_pct(
    instance: Instance, plan: Plan, *, least: float = 0.0, go_on: Report = go_on_always
) -> tuple[float, Plan]:
    """Return a lower bound on the largest energy of a route of plans that cover everything, and the best known plan.

    Each route of a better plan is within the best known limit, and their sum within as many times the longest: a bound
    on the total within a limit is one on the longest route. Then halves the interval between a limit within which no
    plan exists and that of the best plan.

    Args:
        instance: the problem.
        plan: a plan that covers everything within the budgets.
        least: a known lower bound.
        go_on: asked after each step.

    Raises:
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    fleet, low, known = len(instance.vehicles), least, [plan]
    value = top = limit = evaluate(instance, plan, Cost.MINMAX).value  # no limit from top on is refuted

    def raise_low(total: float) -> bool:
        nonlocal low
        low = max(low, min(limit, total / fleet))
        return go_on(low)

    search = _search_cover(instance, list_kinds(instance, [limit] * fleet), known, goal=fleet * value)
    while search.step() and raise_low(search.bound) and search.value - search.bound > NEARLY * value:
        pass
    for _ in range(2 * HALVINGS):
        if top - low <= PROVEN * value or not go_on(low):
            break
        is_near = top == value and value - low <= NEARLY * value
        limit = value * (1 - PROVEN / 2) if is_near else (low + top) / 2
        verdict = decide_cover(instance, limits=[limit] * fleet, known=known, go_on=raise_low)
        if isinstance(verdict, Plan):
            known, value = [*known, verdict], evaluate(instance, verdict, Cost.MINMAX).value
            top = value
        elif verdict:
            top = limit
        else:
            low = limit
    return low, known[-1]


def decide_cover(
    instance: Instance, *, limits: Sequence[float] | None = None, known: Sequence[Plan] = (),
    go_on: Report = go_on_always,
) -> Plan | bool:  # fmt: skip
    """Return a plan that covers everything within the budgets; False if it is proven that there is none, else True.

    Args:
        instance: the problem.
        limits: most energy of each vehicle's route, besides its budget.
        known: plans whose routes are tried.
        go_on: asked after each step.

    Raises:
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    kinds = list_kinds(instance, limits)
    most = sum(kind.limit * kind.count for kind in kinds)
    search = _search_cover(instance, kinds, known, goal=most)
    if _is_refuted(search, most, go_on, thorough=True):
        return False
    if not go_on(search.bound):
        return True
    ceiling = most * (1 + PROVEN)  # so that rounding excludes no plan
    bound, plan = search.choose_routes(ceiling, lambda: go_on(search.bound), any_plan=True)
    return bool(bound < ceiling) if plan is None else plan


def _is_refuted(search: ColumnSearch, most: float, go_on: Report, *, thorough: bool) -> bool:
    """Return whether it is proven that covering everything costs more than ``most``.

    A program of less cost cannot be refuted by its bound; only if ``thorough`` that is improved nevertheless.
    """
    while search.bound <= most and search.step() and go_on(search.bound):
        if not thorough and search.value <= most:
            return False
    return search.bound > most


def _search_cover(
    instance: Instance, kinds: Sequence[RouteKind], known: Sequence[Plan], *, goal: float
) -> ColumnSearch:  # fmt: skip
    most = sum(kind.limit * kind.count for kind in kinds)
    search = ColumnSearch(instance.segments, kinds, penalty=2.0 * most + 1.0, goal=goal, chooses=True)
    for plan in known:
        search.add_plan(plan)
    return search


def bound_earliest_window_s(instance: Instance, most_s: float, *, go_on: Report = go_on_always) -> float:
    """Return a lower bound of the begin of any plan's re-plan window, by the definition of ``replan_window``.

    Two things are needed for a window from t on. If a vehicle has landed by then, its route took t at most and the
    others covered the rest in the plan. If all ``n`` fly, each loss has a re-plan: the lost vehicle's completed work is
    one open path of at most t, and the others cover the rest within their budgets, some in two flights. The mean over
    all ``n`` losses covers everything too, and as no segment is completed by two vehicles, the paths cover at most 1/n
    of each segment. If both are impossible, no window begins at t or before. The search begins with the bound by
    spanning trees, which is better for large networks.

    Args:
        instance: the problem.
        most_s: begin of a known window, or the end of any plan: the bound is sought below it.
        go_on: called with the bound in seconds after each step.

    Raises:
        PlanError: there is one vehicle only.
        InstanceError: too many segments for a proof, or HiGHS is not installed.
    """
    if len(instance.vehicles) == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
    low = bound_window_by_trees_s(lift_locks(instance, range(len(instance.vehicles)))) if instance.segments > 0 else 0.0
    low = min(low, most_s)
    for thorough in (False, True):
        most = most_s  # no time from here on is refuted
        while instance.segments > 0 and most - low > NEAR_S and go_on(low):
            at_s = (low + most) / 2
            if _is_window_refuted(instance, at_s, _report_fixed(go_on, low), thorough=thorough):
                low = at_s
            else:
                most = at_s
    return low


def _is_window_refuted(instance: Instance, at_s: float, go_on: Report, *, thorough: bool) -> bool:
    """Return whether it is proven that no plan has a window that begins at a time or before."""
    kinds, lifted = list_kinds(instance), lift_locks(instance, range(len(instance.vehicles)))
    for number, kind in enumerate(kinds):
        # A vehicle of this kind has landed by then.
        short = _build_timed_kind(instance, kind, at_s, home=instance.home_s[kind.vehicles[0]])
        others = [replace(one, count=one.count - (other == number)) for other, one in enumerate(kinds)]
        beside = _search_beside(instance, [one for one in others if one.count > 0], [short])
        if not _is_refuted(*beside, go_on, thorough=thorough):
            return False
    fleet, survivors, paths = len(instance.vehicles), [], []
    for kind in list_kinds(lifted):
        vehicle = kind.vehicles[0]
        again = instance.vehicles[vehicle].consumption * lifted.depot_pct[vehicle]
        start, move = np.minimum(kind.start, again), np.minimum(kind.move, kind.home[:, np.newaxis] + again)
        survivors.append(replace(kind, start=start, move=move, idle=0.0, count=kind.count * (fleet - 1) / fleet))
        path = _build_timed_kind(lifted, kind, at_s, home=np.zeros(2 * instance.segments))
        paths.append(replace(path, count=kind.count / fleet, share=1.0 / fleet))
    return _is_refuted(*_search_beside(instance, survivors, paths), go_on, thorough=thorough)


def _build_timed_kind(instance: Instance, kind: RouteKind, most_s: float, *, home: FloatArray) -> RouteKind:
    """Return the routes of one vehicle of a kind that take some seconds at most, whatever their energy."""
    vehicle = kind.vehicles[0]
    move = instance.moves.tabulate().table_s[instance.profile[vehicle]]
    return RouteKind(
        (vehicle,), instance.start_s[vehicle], home, move, most_s + BUDGET_TOLERANCE_PCT, weight=0.0, count=1.0
    )  # fmt: skip


def _search_beside(
    instance: Instance, full: Sequence[RouteKind], timed: Sequence[RouteKind]
) -> tuple[ColumnSearch, float]:
    """Return the search for a cover by full routes and timed ones, and the most energy of the full ones."""
    most = sum(kind.limit * kind.count for kind in full)
    return ColumnSearch(instance.segments, [*full, *timed], penalty=2.0 * most + 1.0, goal=most), most
