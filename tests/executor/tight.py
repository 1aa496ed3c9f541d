"""Flights whose plans leave segments out: budgets are tight, and the solver in flight is the real one."""

from __future__ import annotations

import numpy as np

from benchmarks.synthetic import generate_network
from executor.adapters.solver import SolverSetup, solve_for_survivors
from executor.core.interface.commands import Solve
from executor.core.interface.events import SolveEnded
from executor.core.state.vehicle_state import build_onboard_mission
from executor.site import site_model
from missions import Network, build_flight_path
from planner import Cost, Iterations, Plan, solve
from tests.executor.builders import Fleet, ground_for, site_of
from tests.fakes.flight import Story
from tests.missions.builders import network_of

NAMES = ("uav1", "uav2", "uav3")
SEGMENTS = 18
SOLVE_S = 0.3


def branching(segments: int, seed: int) -> Network:
    """Return a network of branching lines about the depot."""
    ends_m = generate_network(segments, seed)
    places: dict[tuple[float, float], int] = {}
    pairs = []
    for a, b in np.round(ends_m, 3).tolist():
        one, other = (places.setdefault(tuple(end), len(places)) for end in (a, b))
        pairs.append((one, other))
    return network_of(list(places), pairs)


def tight_plan(seed: int, *, budget_pct: float = 9.0, **flight: object) -> tuple[Fleet, Plan, SolverSetup]:
    """Return a fleet with its plan, which leaves some segments out, and how the solver in flight works."""
    site = site_of(NAMES, **({"flight": flight} if flight else {}))
    site = site.model_copy(
        update={"vehicle": [table.model_copy(update={"budget_pct": budget_pct}) for table in site.vehicle]}
    )
    ground = ground_for(site, branching(SEGMENTS, seed))
    setup, task = ground.setup, site_model.build_first_task(ground)
    plan = task.plan_to_network(solve(task.instance, cost=Cost.MINMAX, stop=Iterations(20_000), seed=seed).plan)
    context = site_model.build_context(ground, setup, task)
    boards = {
        name: build_onboard_mission(context, name, 0, build_flight_path(setup, name, route.visits), route.visits)
        if route.visits
        else None
        for name, route in zip(NAMES, plan.routes, strict=True)
    }
    return Fleet(context, boards), plan, SolverSetup(SOLVE_S, seed)


def story_of(ready: Fleet, solver: SolverSetup) -> Story:
    """Return a flight that has been launched, with the real solver."""

    def answer(problem: Solve) -> SolveEnded:
        return solve_for_survivors(solver, problem, ready.context.pricing, lambda: False, settled=1000)

    flight = Story(ready.context, dict(ready.boards), answer=answer)
    flight.launch()
    return flight
