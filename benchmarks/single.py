"""One instance, one solver: the result as external scripts read it."""

from __future__ import annotations

from typing import TypedDict

from benchmarks.problems import NamedProblem
from benchmarks.solvers import run_solver
from executor.site.site_planning import PlanSolver
from planner import Cost, Result, Seconds


class SingleResult(TypedDict):
    """JSON keys of one instance's result."""

    value: float
    """Cost in the instance's unit: length, or seconds."""
    routes: list[list[int] | list[dict[str, int | bool]]]
    """For each vehicle cities by the file's numbers, depot left out; or segments with their direction."""
    seconds: float
    iterations: int
    feasible: bool
    """Whether everything is visited within the budgets."""
    uncovered: list[int]
    """Cities or segments that no route visits."""
    bound: float | None
    """Proven lower bound of such plans; None if the solver proves nothing."""
    instance: str
    solver: str


def solve_single(
    problem: NamedProblem, solver: PlanSolver, *, cost: Cost, seconds: float, seed: int, starts: int
) -> SingleResult:
    """Solve one problem; the time does not include loading compiled code.

    Raises:
        planner.PlannerError: the solver does not take the instance.
    """
    result = run_solver(solver, problem.instance, cost=cost, stop=Seconds(seconds), seed=seed, starts=starts)
    return single_result(problem, solver, result)


def single_result(problem: NamedProblem, solver: PlanSolver, result: Result) -> SingleResult:
    """Return a solver's result as plain data."""
    names = problem.cities
    left = result.plan.uncovered
    return {
        "value": result.evaluation.value,
        "routes": [problem.visits(route) for route in result.plan.routes],
        "seconds": result.seconds,
        "iterations": result.iterations,
        "feasible": result.feasible,
        "uncovered": list(left) if names is None else [names[segment] for segment in left],
        "bound": result.bound,
        "instance": problem.name,
        "solver": solver.value,
    }
