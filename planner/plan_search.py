"""The search for the routes of a single flight, with instances and plans as kernel arrays.

While the best plan leaves something out, every second cycle is soft: it may temporarily exceed budgets. If budgets just
suffice, that finds the complete plan five times as often; if they do not, it finds nothing, so the hard cycles in
between choose what to leave out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from planner.bounds import explain_infeasibility
from planner.evaluate import BUDGET_TOLERANCE_PCT, Cost, Evaluation, Result, evaluate
from planner.kernels.anneal import anneal, compute_objective, uncovered_value
from planner.kernels.arrays import Problem, RandomState, SearchWorkspace, State, Weights, allocate
from planner.kernels.tours import copy_all, insert_by_regret, measure
from planner.model import Instance, Plan, Route, segment_of
from planner.moves import FloatArray
from planner.params import DEFAULT_PARAMS, AnnealingParams, SearchParams
from planner.search import AnnealingSearch, Cycle, SearchStart
from planner.stop_rules import StopRule, Stopwatch


class PlanStart(SearchStart[State]):
    """One walk of the annealing kernel."""

    def __init__(self, problem: Problem, truth: Weights, first: State, rng: RandomState) -> None:
        super().__init__((copy_state(first), copy_state(first), copy_state(first)), copy_all, rng)
        self.key = np.array([uncovered_value(problem, first)[0], compute_objective(problem, truth, first)])
        """(2,) float64: the value that the best plan leaves out, then its cost: less is better."""
        self._problem = problem
        self._truth = truth
        self._memory = allocate(SearchWorkspace, k=len(problem.budget), n=len(problem.value))
        self._memory.versions[:] = 1

    @property
    def rank(self) -> list[float]:
        """Return the key."""
        ranked: list[float] = self.key.tolist()
        return ranked

    def begin(self, leader: PlanStart, temperature: float) -> None:
        """Begin a cycle from the best plan of ``leader``."""
        super().begin(leader, temperature)
        self.key[:] = leader.key
        self._memory.versions[:] += 1

    def run(self, guide: Weights, cooling: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal(
            self._problem, guide, self._truth, self.current, self.trial, self.best,
            self.key, self.temperature, cooling, iterations, self.rng, self._memory,
        )  # fmt: skip
        return improved


class PlanSearch(AnnealingSearch[PlanStart]):
    """One search; call only ``run``."""

    def __init__(
        self,
        instance: Instance,
        *,
        cost: Cost,
        seed: int,
        initial: Plan | None,
        all_vehicles: bool,
        watch: Stopwatch,
        starts: int = 1,
        params: SearchParams = DEFAULT_PARAMS,
    ) -> None:
        self._instance = instance
        self._cost = cost
        self._all_vehicles = all_vehicles
        self._params = params.annealing
        self._problem: Problem = build_kernel_problem(instance)
        self._inspections = self._problem.move.reshape(-1, len(self._problem.value), 2).min(axis=(0, 2))
        truth = build_true_weights(self._problem, cost, all_vehicles=all_vehicles)
        routes = [route.visits for route in initial.routes] if initial is not None else []
        first = build_first_state(self._problem, cost, routes, self._params, all_vehicles=all_vehicles)
        self._soft = False
        super().__init__(
            [PlanStart(self._problem, truth, first, build_random_state(seed + number)) for number in range(starts)],
            watch, batch=self._params.batch, impossible=explain_infeasibility(instance),
        )  # fmt: skip

    def run(self, stop: StopRule) -> Result:
        """Improve the plan until ``stop`` ends the search."""
        reason = self._run_rounds(stop)
        return self._build_result(self._plan, self._evaluation, reason)

    def _build_cycle(self, before: Cycle | None) -> Cycle:
        """Return a cycle twice as long as the one before; after a soft one, a hard one of the same length."""
        best, params, was_soft = self._leader.best, self._params, self._soft
        self._soft = not was_soft and self._impossible is None and bool((best.route_of < 0).any())
        self._scale = float(best.loads.max())
        if before is None:
            length = params.first_cycle_leaving_out if self._soft else params.first_cycle
        else:
            length = before.length if was_soft else 2 * before.length
        # The mean energy of the best plan's transits, inspections excluded.
        covered = best.route_of >= 0
        moves = int(covered.sum()) + int((best.lengths > 0).sum())
        transit = float(best.loads.sum() - self._inspections[covered].sum()) / max(1, moves)
        transit = max(transit, 1e-6 * float(self._problem.effort.max()), 1e-9)
        return Cycle(length, params.hot * transit, params.cold * transit, len(params.powers))

    def _improve(self, start: PlanStart, iterations: int) -> int:
        power = self._params.powers[self._cycle.stage(start.done)]
        weights = build_guide_weights(
            self._problem, self._cost, self._params,
            scale=self._scale, all_vehicles=self._all_vehicles, power=power, soft=self._soft,
        )  # fmt: skip
        return start.run(weights, self._cycle.cooling, iterations)

    def _publish(self) -> None:
        super()._publish()
        self._plan = build_plan(self._leader.best)
        self._evaluation: Evaluation = evaluate(self._instance, self._plan, self._cost)

    def _rate_best(self) -> tuple[float, int, bool]:
        uncovered = len(self._plan.uncovered)
        return self._evaluation.value, uncovered, not uncovered and not self._evaluation.violations


NEAREST = 128
"""Number of neighbours listed for each segment, for the removal of strings."""


def build_kernel_problem(instance: Instance) -> Problem:
    """Return the instance's energies as kernel arrays."""
    fleet, segments = len(instance.vehicles), instance.segments
    alone = (instance.start_pct + instance.home_pct).reshape(fleet, segments, 2)
    effort = alone.min(axis=(0, 2))
    # A plan that leaves out a segment of zero length is still worse than one that does not.
    value = instance.value + 1e-6 * (float(instance.value.mean()) or 1.0)
    worth = value * float(np.median(effort / value))
    move = np.ascontiguousarray(instance.moves.tabulate().table_pct)
    # For each vehicle an earlier one that differs only in its name, or -1.
    before: dict[object, int] = {}
    twins = np.full(len(instance.vehicles), -1, dtype=np.int64)
    for number, vehicle in enumerate(instance.vehicles):
        ways = (instance.start_pct[number].tobytes(), instance.home_pct[number].tobytes())
        kind = (vehicle.budget_pct, vehicle.consumption, instance.profile[number], instance.idle_pct[number], ways)
        twins[number] = before.get(kind, -1)
        before[kind] = number
    return Problem(
        profile=np.array(instance.profile, dtype=np.int64),
        move=move,
        move_into=np.array(move.transpose(0, 2, 1), order="C"),
        start=np.array(instance.start_pct, dtype=np.float64, order="C"),
        home=np.array(instance.home_pct, dtype=np.float64, order="C"),
        idle=np.array(instance.idle_pct, dtype=np.float64),
        consumption=np.array([vehicle.consumption for vehicle in instance.vehicles], dtype=np.float64),
        # Half the tolerance: the kernels add the same figures in a different order from evaluate.py.
        budget=np.array([vehicle.budget_pct for vehicle in instance.vehicles]) + BUDGET_TOLERANCE_PCT / 2,
        value=value,
        prize=np.maximum(worth, effort) + 1e-6,
        effort=effort,
        near=_find_nearest_segments(move[0]),
        twin=twins,
    )


def build_guide_weights(
    problem: Problem,
    cost: Cost,
    params: AnnealingParams,
    *,
    scale: float,
    all_vehicles: bool,
    power: float,
    soft: bool = False,
) -> Weights:
    """Return the objective that guides the search for a cost function.

    Args:
        problem: the instance.
        cost: the cost function.
        params: parameters of the search.
        scale: approximate largest load, for the p-norm.
        all_vehicles: whether to avoid routes without a visit.
        power: exponent p of the p-norm.
        soft: whether routes may temporarily exceed their budgets.
    """
    return Weights(
        total=0.02 if cost.function.is_longest_only else cost.function.total,
        peak=0.0 if cost.function.is_longest_only else cost.function.peak_weight(len(problem.budget)),
        norm=1.0 if cost.function.is_longest_only else 0.0,
        power=power,
        scale=scale if scale > 0 else 1.0,
        prize=params.prize_weight,
        empty=_empty_route_weight(problem) if all_vehicles else 0.0,
        excess=params.excess_weight,
        slack=params.slack if soft else 0.0,
    )


def build_true_weights(problem: Problem, cost: Cost, *, all_vehicles: bool) -> Weights:
    """Return the weights of the cost function itself; ties in MinMax are broken by the total energy."""
    return Weights(
        total=1e-6 if cost.function.is_longest_only else cost.function.total,
        peak=cost.function.peak_weight(len(problem.budget)),
        empty=_empty_route_weight(problem) if all_vehicles else 0.0,
    )


def build_empty_state(problem: Problem) -> State:
    """Return the state in which no route has a visit."""
    fleet = len(problem.budget)
    state = allocate(State, k=fleet, n=len(problem.value))
    state.route_of[:] = -1
    for route in range(fleet):
        measure(problem, state, route)
    return state


def build_state(problem: Problem, routes: Iterable[Sequence[int]]) -> State:
    """Return the state of routes given as visits, whether or not they exceed their budgets."""
    state = build_empty_state(problem)
    for route, visits in enumerate(routes):
        set_route(problem, state, route, visits)
    return state


def build_kernel_state(problem: Problem, routes: Iterable[Sequence[int]]) -> State:
    """Return the state of routes given as visits; routes over budget lose visits until they fit.

    Removes the visit with the largest energy saving per value first.
    """
    state = build_state(problem, routes)
    for route in range(len(state.lengths)):
        while state.loads[route] > problem.budget[route] and state.lengths[route] > 0:
            _drop_one(problem, state, route)
    return state


def build_first_state(
    problem: Problem,
    cost: Cost,
    routes: Iterable[Sequence[int]],
    params: AnnealingParams = DEFAULT_PARAMS.annealing,
    *,
    all_vehicles: bool = False,
) -> State:
    """Return the state that keeps ``routes`` and inserts open segments by regret, all within the budgets."""
    state = build_kernel_state(problem, routes)
    scale = float(problem.effort.max())
    weights = build_guide_weights(problem, cost, params, scale=scale, all_vehicles=all_vehicles, power=params.powers[0])
    waiting = np.flatnonzero(state.route_of < 0).astype(np.int64)
    insert_by_regret(problem, weights, state, waiting, build_random_state(0))
    return state


def build_plan(state: State) -> Plan:
    """Return a state as a plan."""
    routes = tuple(
        Route(vehicle, tuple(int(visit) for visit in state.visits[vehicle, :length]))
        for vehicle, length in enumerate(state.lengths)
    )
    return Plan(routes, tuple(int(segment) for segment in np.flatnonzero(state.route_of < 0)))


def copy_state(state: State) -> State:
    """Return an independent copy."""
    return State._make(array.copy() for array in state)


def build_random_state(seed: int) -> RandomState:
    """Return the kernels' random state for a seed: splitmix64, so that similar seeds start far apart."""
    mask = 2**64 - 1
    mixed = (seed + 0x9E3779B97F4A7C15) & mask
    mixed = ((mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9) & mask
    mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & mask
    return np.array([(mixed ^ (mixed >> 31)) or 1], dtype=np.uint64)


def set_route(problem: Problem, state: State, route: int, visits: Sequence[int]) -> None:
    """Set the visits of a route, and measure it."""
    state.route_of[state.route_of == route] = -1
    state.visits[route, : len(visits)] = visits
    state.lengths[route] = len(visits)
    measure(problem, state, route)


def _drop_one(problem: Problem, state: State, route: int) -> None:
    visits = [int(visit) for visit in state.visits[route, : state.lengths[route]]]
    load = float(state.loads[route])

    def spared_per_value(place: int) -> float:
        set_route(problem, state, route, visits[:place] + visits[place + 1 :])
        return (load - float(state.loads[route])) / float(problem.value[segment_of(visits[place])])

    worst = max(range(len(visits)), key=spared_per_value)
    set_route(problem, state, route, visits[:worst] + visits[worst + 1 :])


def _empty_route_weight(problem: Problem) -> float:
    """Return a weight larger than the cost of any vehicle's first visit."""
    return 2 * float((problem.start + problem.home).max(initial=0.0)) + 1


def _find_nearest_segments(move: FloatArray) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return (n, m) int64: each segment followed by its nearest others, by the least transit between them."""
    segments = len(move) // 2
    # A `min` over two axes takes ten times as long, and a re-plan waits for it.
    by_end = np.minimum(move[:, 0::2], move[:, 1::2])
    between = np.minimum(by_end[0::2], by_end[1::2])
    np.fill_diagonal(between, np.inf)
    # The move into j contains j's inspection; what all moves into j have in common is irrelevant to nearness.
    if segments > 1:
        between = between - between.min(axis=0)
    between = np.minimum(between, between.T)
    np.fill_diagonal(between, -1.0)
    if segments > NEAREST:
        near = np.sort(np.argpartition(between, NEAREST - 1, axis=1)[:, :NEAREST], axis=1)
    else:
        near = np.broadcast_to(np.arange(segments), between.shape)
    order = np.argsort(np.take_along_axis(between, near, axis=1), axis=1, kind="stable")
    return np.array(np.take_along_axis(near, order, axis=1), dtype=np.int64, order="C")
