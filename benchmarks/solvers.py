"""The planner's solvers behind one call, to measure them all in the same way."""

from __future__ import annotations

from executor.site.site_planning import PlanSolver
from planner import Cost, Instance, Result, StopRule, solve, solve_exact, solve_grasp


def run_solver(
    solver: PlanSolver,
    instance: Instance,
    *,
    cost: Cost,
    stop: StopRule,
    seed: int,
    starts: int = 1,
    all_vehicles: bool = False,
) -> Result:
    """Return a solver's result; ``starts``, parallel threads, apply to the search only.

    Raises:
        planner.PlannerError: the solver does not take the instance.
    """
    match solver:
        case PlanSolver.SEARCH:
            return solve(instance, cost=cost, stop=stop, seed=seed, starts=starts, all_vehicles=all_vehicles)
        case PlanSolver.GRASP:
            return solve_grasp(instance, cost=cost, stop=stop, seed=seed, all_vehicles=all_vehicles)
        case PlanSolver.EXACT:
            return solve_exact(instance, cost=cost, stop=stop, all_vehicles=all_vehicles)
