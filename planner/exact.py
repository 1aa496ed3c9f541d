"""Solve instances exactly: whether a plan covers everything, and the best plan with its proof.

More than EXACT_SEGMENTS segments are left to column generation (``proofs.py``). For fewer, first compute the best route
of each vehicle through each set of segments; then each vehicle in turn takes its part of what the others leave, for all
sets at once. Both are dynamic programs over sets: a set of segments is a number with a bit for each segment. If the
longest route counts in addition to the sum, this is repeated, each time excluding the routes that are too long for a
better plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.evaluate import BUDGET_TOLERANCE_PCT, Cost, Result, evaluate
from planner.model import Instance, Plan, Route
from planner.moves import FloatArray
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.search import SearchRecord
from planner.solve import solve
from planner.stop_rules import Iterations, Progress, StopRule, Stopwatch, add_progress_report

EXACT_SEGMENTS = 18
"""Maximum number of segments for sets; two more take four times the memory and up to nine times as long."""
SAME = 1e-7
"""Relative tolerance for equal costs."""


@dataclass(frozen=True, slots=True)
class SubsetRoutes:
    """The best route of one vehicle through each set of segments."""

    energy_pct: FloatArray
    """(2^n,) float64: energy of the best route through exactly this set, inf if none is within the budget."""
    spent_pct: FloatArray
    """(2^n, 2n) float64: least energy spent at the end of visit j when it is the last of the set."""
    home_pct: FloatArray
    """(2n,) float64: energy from the end of a visit to the landing place."""
    move_pct: FloatArray
    """(2n, 2n) float64: energy from visit to visit with the vehicle's consumption."""

    def route_of(self, chosen: int) -> tuple[int, ...]:
        """Return the visits of the best route through a feasible set."""
        route: list[int] = []
        onward = self.home_pct
        while chosen > 0:
            last = int((self.spent_pct[chosen] + onward).argmin())
            route.append(last)
            chosen ^= 1 << (last >> 1)
            onward = self.move_pct[:, last]
        return tuple(reversed(route))


def find_subset_routes(instance: Instance) -> tuple[SubsetRoutes, ...]:
    """Return the best routes of each vehicle through all sets of segments; identical vehicles share theirs.

    Raises:
        InstanceError: more segments than EXACT_SEGMENTS.
    """
    if instance.segments > EXACT_SEGMENTS:
        raise InstanceError(f"{instance.segments} segments, expected at most {EXACT_SEGMENTS} for an exact answer")
    known: dict[tuple[object, ...], SubsetRoutes] = {}
    answer = []
    for number, vehicle in enumerate(instance.vehicles):
        ways = (instance.start_pct[number].tobytes(), instance.home_pct[number].tobytes())
        kind = (instance.profile[number], vehicle.consumption, vehicle.budget_pct, instance.idle_pct[number], ways)
        if kind not in known:
            known[kind] = _find_routes_of(instance, number)
        answer.append(known[kind])
    return tuple(answer)


def _find_routes_of(instance: Instance, number: int) -> SubsetRoutes:
    # Imported here because it loads numba.
    from planner.kernels.proofs import find_best_routes

    vehicle, pct = instance.vehicles[number], instance.moves.tabulate().table_pct[instance.profile[number]]
    start = np.array(instance.start_pct[number], dtype=np.float64)
    home = np.array(instance.home_pct[number], dtype=np.float64)
    move = np.array(vehicle.consumption * pct, dtype=np.float64, order="C")
    most = vehicle.budget_pct + BUDGET_TOLERANCE_PCT
    sets = 2**instance.segments
    spent, energy = np.empty((sets, len(start))), np.empty(sets)
    idle = float(instance.idle_pct[number])
    energy[0] = idle if idle <= most else np.inf
    find_best_routes(start, home, move, most, spent, energy)
    return SubsetRoutes(energy, spent, home, move)


@dataclass(frozen=True, slots=True)
class JoinedSets:
    """The sets that some vehicles can cover together."""

    cost: FloatArray
    """(2^n,) float64: the least cost of each set, infinite if infeasible."""
    parts_of: tuple[npt.NDArray[np.int64], ...]
    """(2^n,) int64 for each vehicle: its part of the set that it covers together with the vehicles before it."""

    def trace_parts(self, chosen: int) -> list[int]:
        """Return each vehicle's part of a set that they cover together."""
        parts = []
        for part_of in reversed(self.parts_of):
            parts.append(int(part_of[chosen]))
            chosen ^= parts[-1]
        return parts[::-1]


def join_vehicles(
    own: Sequence[FloatArray], *, longest: bool, complete: bool, may_go_on: Callable[[], bool] = lambda: True
) -> JoinedSets | None:
    """Return the sets that vehicles can cover together, each at the least cost.

    Args:
        own: for each vehicle (2^n,) float64, its cost of each set, infinite if infeasible.
        longest: whether the largest of their costs counts instead of the sum.
        complete: whether only the set of all segments is needed.
        may_go_on: called before each vehicle; when it returns false, None is returned.
    """
    # Imported here because it loads numba.
    from planner.kernels.proofs import join_sets

    cost = np.full(len(own[0]), np.inf)
    cost[0] = 0.0
    parts_of = []
    for number, of_vehicle in enumerate(own, 1):
        if not may_go_on():
            return None
        together, part_of = np.full(len(cost), np.inf), np.zeros(len(cost), dtype=np.int64)
        join_sets(cost, of_vehicle, longest, complete and number == len(own), together, part_of)
        parts_of.append(part_of)
        cost = together
    return JoinedSets(cost, tuple(parts_of))


def find_covering_plan(instance: Instance) -> Plan | None:
    """Return a plan that inspects everything within all budgets, or None if there is none: both are certain.

    Exact to ``BUDGET_TOLERANCE_PCT``, with the figures of ``evaluate`` to the last bit. Takes 3^n steps for each
    vehicle but two.

    Raises:
        InstanceError: more than EXACT_SEGMENTS segments.
    """
    subsets = find_subset_routes(instance)
    free = [np.where(np.isfinite(own.energy_pct), 0.0, np.inf) for own in subsets]
    joined = join_vehicles(free, longest=False, complete=True)
    if joined is None or np.isinf(joined.cost[-1]):
        return None
    return _build_plan(instance, subsets, joined.trace_parts(len(joined.cost) - 1))


def solve_exact(
    instance: Instance,
    *,
    cost: Cost,
    stop: StopRule,
    all_vehicles: bool = False,
    params: SearchParams = DEFAULT_PARAMS,
    on_progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Return the best plan with its proof: ``Result.bound`` is its cost, or less if the proof is not complete.

    There is no bound if not everything is covered and the proof is not complete.

    As with ``solve``, no route exceeds its vehicle's budget and what cannot be covered is left out, the least value
    first; then, with ``all_vehicles``, as many vehicles as possible fly; then the cost decides.

    Args:
        instance: the problem; more than EXACT_SEGMENTS segments need HiGHS, of the extra `proofs`.
        cost: the cost function to minimise.
        stop: ends the proof before it is complete. One iteration is one vehicle that takes its part of all sets, or one
            pricing of routes. The search for a first plan takes up to some seconds and is not stopped by it.
        all_vehicles: leave no vehicle without a visit where segments and budgets allow it.
        params: tuning of that search.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        InstanceError: too many segments, or HiGHS is not installed for more than EXACT_SEGMENTS.
    """
    if instance.segments > EXACT_SEGMENTS:
        # Imported here: only a large proof needs the extra.
        from planner.proofs import prove_plan

        return prove_plan(
            instance, cost=cost, stop=add_progress_report(stop, on_progress), all_vehicles=all_vehicles, params=params
        )
    if instance.segments == 0:
        done = solve(instance, cost=cost, stop=stop)
        return replace(done, bound=done.evaluation.value)
    watch = Stopwatch()
    subsets = find_subset_routes(instance)
    first = solve(
        instance, cost=cost, stop=Iterations(params.exact.search_iterations), all_vehicles=all_vehicles,
        params=params,
    )  # fmt: skip
    proof = _Proof(instance, subsets, cost, first, add_progress_report(stop, on_progress), watch, all_vehicles)
    proof.run()
    return proof.build_result()


class _Proof(SearchRecord):
    """The best plan so far, and the proof for all others."""

    def __init__(
        self,
        instance: Instance,
        subsets: Sequence[SubsetRoutes],
        cost: Cost,
        first: Result,
        stop: StopRule,
        watch: Stopwatch,
        all_vehicles: bool,
    ) -> None:
        from planner.plan_search import build_kernel_problem, build_true_weights

        super().__init__(watch)
        numbers = build_kernel_problem(instance)
        self._instance = instance
        self._subsets = subsets
        self._cost = cost
        self._first = first
        self._stop = stop
        self._grounded = build_true_weights(numbers, cost, all_vehicles=all_vehicles).empty
        """Cost of a vehicle without a visit."""
        self._reason: str | None = None
        sets = np.arange(2**instance.segments)
        worth = (sets[:, np.newaxis] >> np.arange(instance.segments) & 1) @ numbers.value
        self._allowed = sets == len(sets) - 1
        self._take(first.plan)
        if first.plan.uncovered:
            self._leave_out_least(worth)
        # The energy of each vehicle's route through each set, and its contribution to the cost, without the longest
        # route. A vehicle without a visit keeps its idle energy even if it cannot return.
        function, energies, prices = self._cost.function, [], []
        for number, own in enumerate(self._subsets):
            energy, idle = own.energy_pct.copy(), float(self._instance.idle_pct[number])
            energy[0] = idle
            price = np.where(np.isfinite(energy), function.total * np.nan_to_num(energy, posinf=0.0), np.inf)
            over = max(0.0, idle - self._instance.vehicles[number].budget_pct)
            price[0] += function.total * function.excess * over + self._grounded
            energies.append(energy)
            prices.append(price)
        self._energies, self._prices = energies, prices

    def _take(self, plan: Plan) -> None:
        self._plan = plan
        self._evaluation = evaluate(self._instance, plan, self._cost)
        too_little = "the budgets do not suffice for every segment" if plan.uncovered else None
        self._impossible = self._first.impossible or too_little
        self._ceiling = self._evaluation.value + self._grounded * sum(not route.visits for route in plan.routes)

    def _leave_out_least(self, worth: FloatArray) -> None:
        """Allow the sets of the highest value that can be covered, and take a plan for one of them."""
        free = [np.where(np.isfinite(own.energy_pct), 0.0, np.inf) for own in self._subsets]
        for own in free:
            own[0] = 0.0  # a vehicle that cannot return takes the empty set
        joined = join_vehicles(free, longest=False, complete=False)
        if joined is None:
            return
        worth = np.where(np.isfinite(joined.cost), worth, -np.inf)
        self._allowed = worth >= worth.max() * (1 - SAME)
        if not self._allowed[-1 - sum(1 << segment for segment in self._plan.uncovered)]:
            self._take(_build_plan(self._instance, self._subsets, joined.trace_parts(int(worth.argmax()))))

    def run(self) -> None:
        """Prove that no plan is better, or find a better one, until the stop rule ends the search."""
        weight = self._cost.function.peak_weight(len(self._subsets))
        shortest = self._choose_parts(self._energies, longest=True) if weight > 0 else 0.0
        least = 0.0
        while self._reason is None:
            tolerance = SAME * (1 + self._ceiling)
            if least + weight * shortest >= self._ceiling - tolerance:
                self._reason = "optimal"
                return
            # A plan with a longer route costs no less than the incumbent.
            most = (self._ceiling - tolerance - least) / weight if weight > 0 else np.inf
            pairs = zip(self._energies, self._prices, strict=True)
            least = self._choose_parts([np.where(energy <= most, price, np.inf) for energy, price in pairs])

    def _choose_parts(self, own: Sequence[FloatArray], *, longest: bool = False) -> float:
        """Return the least cost of the allowed sets, infinite without any; keep the plan if it is the best so far."""
        complete = bool(self._allowed[-1])
        joined = join_vehicles(own, longest=longest, complete=complete, may_go_on=self._may_go_on)
        if joined is None:
            return 0.0
        cost = np.where(self._allowed, joined.cost, np.inf)
        chosen = int(cost.argmin())
        if np.isfinite(cost[chosen]):
            plan, known = _build_plan(self._instance, self._subsets, joined.trace_parts(chosen)), self._plan
            ceiling = self._ceiling
            self._take(plan)
            if self._ceiling >= ceiling - SAME * (1 + ceiling):
                self._take(known)
        return float(cost[chosen])

    def _may_go_on(self) -> bool:
        verdict = self._stop(self._build_progress())
        self._iterations += 1
        if verdict.allowed <= 0:
            self._reason = verdict.reason
        return verdict.allowed > 0

    def build_result(self) -> Result:
        """Return the best plan and the bound proven for it."""
        found = self._build_result(self._plan, self._evaluation, self._reason or "")
        return replace(found, bound=self._evaluation.value if self._reason == "optimal" else None)

    def _rate_best(self) -> tuple[float, int, bool]:
        left = self._plan.uncovered
        return self._evaluation.value, len(left), not left and not self._evaluation.violations


def _build_plan(instance: Instance, subsets: Sequence[SubsetRoutes], parts: Sequence[int]) -> Plan:
    """Return the plan in which each vehicle flies its best route through its part."""
    routes = tuple(Route(vehicle, own.route_of(parts[vehicle])) for vehicle, own in enumerate(subsets))
    inspected = sum(parts)
    return Plan(routes, tuple(segment for segment in range(instance.segments) if not inspected >> segment & 1))
