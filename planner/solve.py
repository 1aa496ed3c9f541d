"""Entry point of the solver: one call from an instance to a checked plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from planner.errors import PlanError
from planner.evaluate import Cost, Result, evaluate
from planner.model import Instance, Plan, Route, Vehicle, build_instance, segment_of
from planner.moves import Travel
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.stop_rules import Iterations, Progress, StopRule, Stopwatch, add_progress_report


def solve(  # noqa: PLR0913 - problem, search length and start
    instance: Instance,
    *,
    cost: Cost,
    stop: StopRule,
    seed: int = 0,
    initial: Plan | None = None,
    all_vehicles: bool = False,
    starts: int = 1,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Return the best plan found until ``stop`` ends the search.

    No route ever exceeds its vehicle's budget; what does not fit is left uncovered, the least value first, then the
    cost function decides. The same seed, starts and number of iterations give the same plan.

    Args:
        instance: the problem.
        cost: the cost function to minimise.
        stop: checked at least every 500 iterations of a start, on large instances every few thousand of a region; its
            time does not include loading or compiling the kernels, which the first call does unless ``warm_up`` has.
        seed: seed of all randomness.
        initial: a first plan; visits beyond a budget are removed from it, open segments inserted.
        all_vehicles: leave no vehicle without a visit where segments and budgets allow it: the paper's setting.
        starts: parallel searches, one thread each, that share their best plan from time to time; iterations are counted
            over all of them. Best is one per processor. The plan depends on it.
        params: tuning of the search. The plan depends on it.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        PlanError: ``initial`` is not a plan for this instance, or ``starts`` is less than 1.
    """
    if starts < 1:
        raise PlanError(f"starts is {starts}, expected 1 or more")
    if initial is not None:
        check_routes(instance, initial)
    if instance.segments == 0:
        plan = Plan(tuple(Route(vehicle, ()) for vehicle in range(len(instance.vehicles))))
        evaluation = evaluate(instance, plan, cost)
        return Result(
            plan=plan,
            evaluation=evaluation,
            feasible=not evaluation.violations,
            iterations=0,
            seconds=0.0,
            stopped_by="nothing to inspect",
        )
    # Imported here because numba takes a second to load, and many callers never make a plan.
    from planner.large import LargeSearch
    from planner.plan_search import PlanSearch

    watch = Stopwatch()
    search = (LargeSearch if instance.segments > params.large.above else PlanSearch)(
        instance, cost=cost, seed=seed, initial=initial, all_vehicles=all_vehicles, watch=watch, starts=starts,
        params=params,
    )  # fmt: skip
    return search.run(add_progress_report(stop, on_progress))


def warm_up() -> None:
    """Load the search's kernels, compiling them if they are not cached: some 10 seconds once, then under one."""
    instance = build_instance(
        [[[10.0, 0.0], [20.0, 0.0]], [[20.0, 0.0], [20.0, 10.0]]],
        (0.0, 0.0),
        (Vehicle("warm-up", (0.0, 0.0), 100.0),),
        Travel(5.0, 1.0, 1.0, 1.0),
    )
    for cost in Cost:
        solve(instance, cost=cost, stop=Iterations(1))


def check_routes(instance: Instance, plan: Plan) -> None:
    """Check that a plan has one route for each vehicle of an instance, over its visits.

    Raises:
        PlanError: the routes do not match the instance.
    """
    if [route.vehicle for route in plan.routes] != list(range(len(plan.routes))):
        raise PlanError("routes must be in the order of the vehicles, one each")
    check_tails(instance, [route.visits for route in plan.routes])


def check_tails(instance: Instance, tails: Sequence[Sequence[int]]) -> None:
    """Check that visits, a sequence for each vehicle, belong to an instance.

    Raises:
        PlanError: a vehicle or a visit does not exist in the instance, or a segment occurs twice.
    """
    if len(tails) != len(instance.vehicles):
        raise PlanError(f"{len(tails)} routes for {len(instance.vehicles)} vehicles")
    visits = [visit for tail in tails for visit in tail]
    for visit in visits:
        if not 0 <= visit < 2 * instance.segments:
            raise PlanError(f"visit {visit} is not in the instance of {instance.segments} segments")
    if len({segment_of(visit) for visit in visits}) != len(visits):
        raise PlanError("a segment occurs twice in the routes")
