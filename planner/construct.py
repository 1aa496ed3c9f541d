"""Instances and plans as the kernels' arrays, and first plans by insertion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from planner.cost import BUDGET_TOLERANCE_PCT, Cost
from planner.kernels.arrays import Problem, RandomState, SearchWorkspace, State, Weights
from planner.kernels.insertion import insert_by_regret
from planner.kernels.tours import measure
from planner.model import Instance, Plan, Route, segment_of
from planner.moves import FloatArray
from planner.params import DEFAULT_PARAMS, AnnealingParams

NEAREST = 128
"""How many neighbours of a segment are listed for the removal of strings."""


def build_kernel_problem(instance: Instance) -> Problem:
    """Return the instance's energies as the kernels take them."""
    fleet, segments = len(instance.vehicles), instance.segments
    alone = (instance.start_pct + instance.home_pct).reshape(fleet, segments, 2)
    effort = alone.min(axis=(0, 2))
    # A plan that leaves out a segment without length is still worse than one that does not.
    value = instance.value + 1e-6 * (float(instance.value.mean()) or 1.0)
    worth = value * float(np.median(effort / value))
    every = np.arange(2 * segments)
    move = np.array([
        instance.moves.pct(profile, every[:, np.newaxis], every[np.newaxis])
        for profile in range(instance.moves.profiles)
    ]).reshape(instance.moves.profiles, 2 * segments, 2 * segments)  # fmt: skip
    return Problem(
        profile=np.array(instance.profile, dtype=np.int64),
        move=move,
        move_into=np.array(move.transpose(0, 2, 1), order="C"),
        start=np.array(instance.start_pct, dtype=np.float64, order="C"),
        home=np.array(instance.home_pct, dtype=np.float64, order="C"),
        idle=np.array(instance.idle_pct, dtype=np.float64),
        consumption=np.array([vehicle.consumption for vehicle in instance.vehicles], dtype=np.float64),
        # Half the tolerance: the kernels add the same figures in another order than evaluate.py.
        budget=np.array([vehicle.budget_pct for vehicle in instance.vehicles]) + BUDGET_TOLERANCE_PCT / 2,
        value=value,
        prize=np.maximum(worth, effort) + 1e-6,
        effort=effort,
        near=_find_nearest_segments(move[0]),
        twin=_find_twins(instance),
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
        params: of the search.
        scale: about the largest load, for the p-norm.
        all_vehicles: whether routes without a visit are to be avoided.
        power: the p of the p-norm.
        soft: whether the search may pass through routes beyond their budgets.
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
    """Return the cost function itself; among plans of equal MinMax the one that uses less is better."""
    return Weights(
        total=1e-6 if cost.function.is_longest_only else cost.function.total,
        peak=cost.function.peak_weight(len(problem.budget)),
        norm=0.0,
        power=1.0,
        scale=1.0,
        prize=0.0,
        empty=_empty_route_weight(problem) if all_vehicles else 0.0,
        excess=0.0,
        slack=0.0,
    )


def build_empty_state(problem: Problem) -> State:
    """Return the state in which nobody visits anything."""
    fleet, segments = len(problem.budget), len(problem.value)
    state = State(
        visits=np.zeros((fleet, segments), dtype=np.int64),
        legs=np.zeros((fleet, segments + 1)),
        lengths=np.zeros(fleet, dtype=np.int64),
        loads=np.zeros(fleet),
        route_of=np.full(segments, -1, dtype=np.int64),
    )
    for route in range(fleet):
        measure(problem, state, route)
    return state


def build_state(problem: Problem, routes: Iterable[Sequence[int]]) -> State:
    """Return the state of routes given as visits, budgets or not."""
    state = build_empty_state(problem)
    for route, visits in enumerate(routes):
        _set_route(problem, state, route, visits)
    return state


def build_search_workspace(problem: Problem) -> SearchWorkspace:
    """Return the work space of an annealing that has not begun."""
    fleet, segments = len(problem.budget), len(problem.value)
    return SearchWorkspace(
        waiting=np.zeros(segments, dtype=np.int64),
        pending=np.zeros(segments, dtype=np.int64),
        keys=np.zeros(segments),
        touched=np.zeros(fleet, dtype=np.int64),
        came_from=np.zeros((segments, 2), dtype=np.int64),
        versions=np.ones(fleet, dtype=np.int64),
        version=np.zeros((segments, fleet), dtype=np.int64),
        added=np.zeros((segments, fleet)),
        place=np.zeros((segments, fleet), dtype=np.int64),
    )


def build_kernel_state(problem: Problem, routes: Iterable[Sequence[int]]) -> State:
    """Return the state of routes given as visits; routes over budget lose visits until they hold.

    What goes first is the visit that spares most energy for its value.
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
    """Return the state that keeps ``routes`` and inserts by regret what they leave open, all within the budgets."""
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
    """Return the kernels' random state for a seed: splitmix64, so that near seeds start far apart."""
    mask = 2**64 - 1
    mixed = (seed + 0x9E3779B97F4A7C15) & mask
    mixed = ((mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9) & mask
    mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & mask
    return np.array([(mixed ^ (mixed >> 31)) or 1], dtype=np.uint64)


def _set_route(problem: Problem, state: State, route: int, visits: Sequence[int]) -> None:
    state.route_of[state.route_of == route] = -1
    state.visits[route, : len(visits)] = visits
    state.lengths[route] = len(visits)
    measure(problem, state, route)


def _drop_one(problem: Problem, state: State, route: int) -> None:
    visits = [int(visit) for visit in state.visits[route, : state.lengths[route]]]
    load = float(state.loads[route])

    def spared_per_value(place: int) -> float:
        _set_route(problem, state, route, visits[:place] + visits[place + 1 :])
        return (load - float(state.loads[route])) / float(problem.value[segment_of(visits[place])])

    worst = max(range(len(visits)), key=spared_per_value)
    _set_route(problem, state, route, visits[:worst] + visits[worst + 1 :])


def _empty_route_weight(problem: Problem) -> float:
    """Return more than any first visit of a vehicle costs."""
    return 2 * float((problem.start + problem.home).max(initial=0.0)) + 1


def _find_twins(instance: Instance) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return (k,) int64, for each vehicle the one before it that differs in nothing but its name, or -1."""
    before: dict[object, int] = {}
    twins = np.full(len(instance.vehicles), -1, dtype=np.int64)
    for number, vehicle in enumerate(instance.vehicles):
        ways = (instance.start_pct[number].tobytes(), instance.home_pct[number].tobytes())
        kind = (vehicle.budget_pct, vehicle.consumption, instance.profile[number], instance.idle_pct[number], ways)
        twins[number] = before.get(kind, -1)
        before[kind] = number
    return twins


def _find_nearest_segments(move: FloatArray) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return (n, m) int64, for each segment itself and the nearest others by the least transit between them."""
    segments = len(move) // 2
    # As a `min` over two axes this takes ten times as long, and a re-plan waits for it.
    by_end = np.minimum(move[:, 0::2], move[:, 1::2])
    between = np.minimum(by_end[0::2], by_end[1::2])
    np.fill_diagonal(between, np.inf)
    # The move into j contains j's inspection; what is common to all moves into j says nothing about nearness.
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
