"""Column generation: proven lower bounds on what a fleet needs, and proofs that it cannot cover everything.

The columns of a linear program are routes. It chooses shares of routes so that every segment is covered; a new route is
priced by its reduced cost (``kernels/pricing.py``) until none is worth adding. For any prizes of the segments, their
sum plus the least reduced cost of each vehicle is a lower bound (Lagrange), so each complete pricing proves one, also
long before the program has its optimum. Bounds are rounded down by more than the rounding errors.

HiGHS, of the extra `proofs`, solves the programs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.evaluate import BUDGET_TOLERANCE_PCT
from planner.kernels.arrays import FloatArray, IntArray, allocate
from planner.kernels.pricing import (
    SAME_MEMORY,
    SAME_NODE,
    SAME_SET,
    WORD,
    Completions,
    Labels,
    Priced,
    bound_completions,
    price_routes,
)
from planner.model import Instance, Plan, Route, segment_of

SEGMENTS_UP_TO = 2 * WORD
"""Maximum number of segments: a set of them has two words."""
BUCKETS = 256
ROOM = 2_000_000
"""Maximum number of labels in one pricing: some 110 MB."""
NEIGHBOURS = 10
"""Segments that a route's label does not forget at once: the size of the ng-sets."""
SMOOTHING = 0.7
"""Weight of the prizes of the best bound against those of the program (Wentges 1997): fewer rounds."""
CUT_ROUNDS, CUTS = 40, 40
"""Rounds of subset-row cuts, and cuts in each."""
VIOLATED = 0.02
"""Least violation of a cut that is added."""
FEWER = 0.7
"""Factor on the reduced cost of the routes to choose from, while there are too many."""
NODES = 200
"""Maximum number of nodes of an integer program: a number, so that every machine gives the same answer."""
ROUTES_UP_TO = 6_000
"""Maximum number of routes of one kind that an integer program may choose from."""
SAME = 1e-6
"""Relative tolerance of proofs: a route of a smaller gain is not priced."""
NEVER = 1e300


def is_available() -> bool:
    """Return whether HiGHS is installed."""
    from importlib.util import find_spec

    return find_spec("highspy") is not None


def check_can_prove(segments: int) -> None:
    """Check that column generation can be used.

    Raises:
        InstanceError: too many segments, or HiGHS is not installed.
    """
    if segments > SEGMENTS_UP_TO:
        raise InstanceError(f"{segments} segments, expected at most {SEGMENTS_UP_TO} for a proof")
    if not is_available():
        raise InstanceError(f"a proof for {segments} segments needs the extra proofs: pip install highspy")


@dataclass(frozen=True, slots=True, eq=False)
class RouteKind:
    """Routes of equal vehicles; the figures may be energies or seconds."""

    vehicles: tuple[int, ...]
    start: FloatArray
    """(2n,): from the start to the end of a visit."""
    home: FloatArray
    """(2n,): from the end of a visit to the landing place."""
    move: FloatArray
    """(2n, 2n): from the end of a visit to the end of another."""
    limit: float
    """Most that a route takes."""
    idle: float = 0.0
    """What a vehicle without a visit takes."""
    weight: float = 1.0
    """Cost of a route for each unit that it takes."""
    count: float = 0.0
    """Number of routes, which may be a fraction."""
    share: float = np.inf
    """Most that these routes may cover of any segment."""


def list_kinds(instance: Instance, limits: Sequence[float] | None = None) -> list[RouteKind]:
    """Return the kinds of routes of a fleet by energy, each limited by its vehicle's budget or the given limit."""
    tables = instance.moves.tabulate().table_pct
    kinds: dict[tuple[object, ...], RouteKind] = {}
    for number, vehicle in enumerate(instance.vehicles):
        limit = max(0.0, vehicle.budget_pct) + BUDGET_TOLERANCE_PCT
        limit = limit if limits is None else min(limit, limits[number])
        start, home = instance.start_pct[number], instance.home_pct[number]
        profile, idle = instance.profile[number], float(instance.idle_pct[number])
        key = (profile, vehicle.consumption, limit, idle, start.tobytes(), home.tobytes())
        known = kinds.get(key)
        if known is None:
            known = RouteKind((), start, home, vehicle.consumption * tables[profile], limit, idle)
        kinds[key] = replace(known, vehicles=(*known.vehicles, number), count=known.count + 1)
    return list(kinds.values())


class _Column(NamedTuple):
    kind: int
    visits: tuple[int, ...]


class ColumnSearch:
    """Lower bounds on the cost of covering all segments; each ``step`` prices once and may raise the bound."""

    def __init__(self, segments: int, kinds: Sequence[RouteKind], *, penalty: float) -> None:
        """Begin without a route.

        Args:
            segments: number of segments, at most SEGMENTS_UP_TO.
            kinds: the routes to choose from.
            penalty: cost of leaving a segment out, more than a route with it can cost.

        Raises:
            InstanceError: too many segments, or HiGHS is not installed.
        """
        check_can_prove(segments)
        # Imported here: it loads for a tenth of a second, and is an extra.
        import highspy

        self._kinds, self._segments = kinds, segments
        near = _find_neighbourhoods(kinds, segments)
        self._priced = [_build_priced(kind, near) for kind in kinds]
        self._completions = [allocate(Completions, b=BUCKETS, v=2 * segments) for _ in kinds]
        self._labels = allocate(Labels, c=ROOM, b=BUCKETS, v=2 * segments)
        self._found = np.zeros(max(2 * segments, ROUTES_UP_TO), dtype=np.int64)
        self._constant = sum(kind.weight * kind.idle * kind.count for kind in kinds)
        self._columns: dict[_Column, None] = {}
        self._rule, self._smoothing = SAME_NODE, SMOOTHING
        self._slack = SAME
        """Share of the bound that pricing ignores; more when there is no room for all labels."""
        self.bound = -np.inf
        """Proven lower bound on the cost, with what is left out."""
        self.value = np.inf
        """Cost of the program: no bound gets beyond it without cuts."""
        self._center: FloatArray | None = None
        """Prices of the best bound, and with them the least reduced cost of each kind."""
        self._leasts: list[float] = []
        self._program = highspy.Highs()  # type: ignore[no-untyped-call]
        for option, setting in (("output_flag", False), ("threads", 1), ("random_seed", 0)):
            self._program.setOptionValue(option, setting)
        none = np.array([], dtype=np.int32), np.array([])
        for _ in range(segments):
            self._program.addRow(1.0, np.inf, 0, *none)
        for kind in kinds:
            self._program.addRow(-np.inf, kind.count, 0, *none)
        self._share_row: dict[int, int] = {}
        for number, kind in enumerate(kinds):
            if np.isfinite(kind.share):
                self._share_row[number] = self._program.getNumRow()
                for _ in range(segments):
                    self._program.addRow(-np.inf, kind.share, 0, *none)
        for segment in range(segments):
            self._program.addCol(penalty, 0.0, np.inf, 1, np.array([segment], dtype=np.int32), np.ones(1))

    def add_plan(self, plan: Plan) -> None:
        """Add the routes of a plan that are within the limits."""
        for route in plan.routes:
            for number, kind in enumerate(self._kinds):
                is_own = bool(route.visits) and route.vehicle in kind.vehicles
                if is_own and self._measure(kind, route.visits) <= kind.limit:
                    self._add(number, route.visits)

    def _add(self, number: int, visits: tuple[int, ...]) -> bool:
        """Add a route unless it is known; return whether it was not."""
        column = _Column(number, visits)
        if column in self._columns:
            return False
        self._columns[column] = None
        kind = self._kinds[number]
        segments, times = np.unique(np.array(visits) >> 1, return_counts=True)
        rows, entries = [segments, [self._segments + number]], [times, [1]]
        if number in self._share_row:
            rows.append(segments + self._share_row[number])
            entries.append(times)
        index = np.concatenate(rows).astype(np.int32)
        cost = kind.weight * (self._measure(kind, visits) - kind.idle)
        self._program.addCol(cost, 0.0, np.inf, len(index), index, np.concatenate(entries).astype(np.float64))
        return True

    @staticmethod
    def _measure(kind: RouteKind, visits: tuple[int, ...]) -> float:
        between = kind.move[list(visits[:-1]), list(visits[1:])].sum()
        return float(kind.start[visits[0]] + between + kind.home[visits[-1]])

    def step(self) -> bool:
        """Solve the program, price routes once, and return whether another step may raise the bound."""
        self._program.run()
        self.value = self._program.getInfo().objective_function_value + self._constant
        dual = np.array(self._program.getSolution().row_dual)
        center = dual if self._center is None else self._center
        prices = self._smoothing * center + (1 - self._smoothing) * dual
        added = sum(self._gains(dual, route) and self._add(*route) for route in self._price(prices))
        if self.value - self.bound <= SAME * (1 + abs(self.value)):
            return False
        if added > 0:
            return True
        if self._smoothing > 0:
            self._smoothing = 0.0
        elif self._rule == SAME_NODE:
            self._rule, self._smoothing = SAME_MEMORY, SMOOTHING
        else:
            return False
        return True

    def _gains(self, dual: FloatArray, route: _Column) -> bool:
        """Return whether a route lowers the program's cost."""
        kind, segments = self._kinds[route.kind], np.array(route.visits) >> 1
        cost = kind.weight * (self._measure(kind, route.visits) - kind.idle) - dual[self._segments + route.kind]
        return bool(cost - self._prizes_of(route.kind, dual)[segments].sum() < -SAME * (1 + abs(cost)))

    def _prizes_of(self, number: int, prices: FloatArray) -> FloatArray:
        """Return (n,) float64, what a route of a kind earns for each segment."""
        prizes = np.maximum(prices[: self._segments], 0.0)
        if number in self._share_row:
            prizes = prizes + np.minimum(prices[self._share_row[number] :][: self._segments], 0.0)
        return np.ascontiguousarray(prizes)

    def _price(self, prices: FloatArray) -> list[_Column]:
        """Return routes of negative reduced cost at some prices; raise the bound if these prove a better one."""
        bound, routes, leasts = self._sum_prices(prices), list[_Column](), list[float]()
        scale = 1 + abs(self.value)
        for number, kind in enumerate(self._kinds):
            least = self._bound_reduced_cost(number, prices)
            ignored = self._slack * scale / max(1.0, kind.count) if self._rule == SAME_MEMORY else 0.0
            self._found[: 2 * self._segments] = -1
            labels, _ = self._search_routes(number, prices, kind.weight * kind.idle - ignored - 1e-9, self._rule)
            ends = [int(label) for label in self._found[: 2 * self._segments] if label >= 0]
            found = [_Column(number, self._trace(label)) for label in ends]
            if self._rule == SAME_MEMORY and labels >= 0:
                prizes = self._prizes_of(number, prices)
                costs = [
                    kind.weight * (self._measure(kind, route.visits) - kind.idle)
                    - prizes[np.array(route.visits) >> 1].sum()
                    for route in found
                ]
                least = max(least, min(costs, default=-ignored - 1e-9))
            elif labels < 0 and self._rule == SAME_MEMORY:
                self._slack *= 4
            leasts.append(min(0.0, least))
            bound += kind.count * leasts[-1]
            routes += found
        bound -= 1e-9 * (scale + float(np.abs(prices).sum()))
        if bound > self.bound:
            self.bound, self._center, self._leasts = bound, prices, leasts
        return routes

    def _sum_prices(self, prices: FloatArray) -> float:
        shares = sum(
            self._kinds[number].share * float(np.minimum(prices[row : row + self._segments], 0.0).sum())
            for number, row in self._share_row.items()
        )
        return float(np.maximum(prices[: self._segments], 0.0).sum()) + shares + self._constant

    def _bound_reduced_cost(self, number: int, prices: FloatArray) -> float:
        """Return a lower bound on the reduced cost of all routes of a kind, and set its completions."""
        kind, priced, completions = self._kinds[number], self._priced[number], self._completions[number]
        prizes = self._prizes_of(number, prices)
        bound_completions(priced, kind.weight, prizes, completions)
        left = priced.budget - priced.start
        bucket = np.clip(left / priced.width, 0, BUCKETS - 1).astype(np.int64)
        onward = completions.first[bucket, np.arange(len(left))]
        costs = kind.weight * (priced.start - kind.idle) - np.repeat(prizes, 2) + onward
        return float(np.where(left >= 0, costs, np.inf).min())

    def _search_routes(self, number: int, prices: FloatArray, most: float, rule: int) -> tuple[int, int]:
        priced, kind = self._priced[number], self._kinds[number]
        if rule == SAME_SET:
            priced = priced._replace(near=np.full_like(priced.near, 2**WORD - 1))
        return price_routes(
            priced, kind.weight, self._prizes_of(number, prices), self._completions[number], most, rule, self._labels,
            self._found,
        )  # fmt: skip

    def _trace(self, label: int) -> tuple[int, ...]:
        visits = []
        while label >= 0:
            visits.append(int(self._labels.visit[label]))
            label = int(self._labels.parent[label])
        return tuple(reversed(visits))

    def choose_routes(self, ceiling: float) -> tuple[float, Plan | None]:
        """Return a proven bound, and a plan of cost less than ``ceiling`` if one was found.

        An integer program chooses among all routes that such a plan may have: then the bound is the optimum or the
        ceiling. If there are too many, it chooses among those of least reduced cost; a plan with any other one costs
        more than the bound so far and their largest reduced cost together.

        Args:
            ceiling: cost that the plan must beat.
        """
        gap = max(0.0, ceiling - self.bound) + SAME
        least = gap / 64
        while not self._add_routes_within(gap):
            gap *= FEWER
            if gap < least:
                return self.bound, None
        self._cut(ceiling)
        lowest, chosen = self._solve_whole(ceiling)
        bound = max(self.bound, min(ceiling, lowest, self.bound + gap))
        return bound, None if chosen is None else self._build_plan(chosen)

    def _add_routes_within(self, gap: float) -> bool:
        """Add all routes that a plan may have whose cost exceeds the bound by a gap; return false without room."""
        if self._center is None:
            return False
        for number, kind in enumerate(self._kinds):
            self._bound_reduced_cost(number, self._center)
            most = self._leasts[number] + gap + kind.weight * kind.idle
            labels, routes = self._search_routes(number, self._center, most, SAME_SET)
            if labels < 0:
                return False
            for label in self._found[:routes].tolist():
                self._add(number, self._trace(label))
        return True

    def _cut(self, ceiling: float) -> None:
        """Raise the program's cost by subset-row cuts and bar routes that no plan below the ceiling has.

        Of three segments, at most one route of a plan visits two or more (Jepsen, Petersen, Spoorendonk, Pisinger 2008,
        doi 10.1287/opre.1070.0449). The cuts need no prices, because no route is added after them; a plan visits each
        segment once.
        """
        program, n = self._program, self._segments
        for segment in range(n):
            program.changeRowBounds(segment, 1.0, 1.0)
        visited = np.zeros((n, len(self._columns)), dtype=np.int8)
        for place, column in enumerate(self._columns):
            visited[[segment_of(visit) for visit in column.visits], place] = 1
        for _ in range(CUT_ROUNDS):
            program.run()
            room = ceiling - self._constant - program.getInfo().objective_function_value
            solution = program.getSolution()
            barred = np.flatnonzero(np.array(solution.col_dual)[n:] > room + SAME * (1 + abs(ceiling))) + n
            none = np.zeros(len(barred))
            program.changeColsBounds(len(barred), barred.astype(np.int32), none, none)
            triples = _find_violated_triples(visited, np.array(solution.col_value)[n:])
            if room <= 0 or len(triples) == 0:
                return
            for triple in triples:
                twice = (np.flatnonzero(visited[triple].sum(axis=0) >= 2) + n).astype(np.int32)
                program.addRow(-np.inf, 1.0, len(twice), twice, np.ones(len(twice)))

    def _solve_whole(self, ceiling: float) -> tuple[float, list[_Column] | None]:
        """Return a lower bound on the cost of plans of the known routes, and the best if it is below the ceiling."""
        import highspy

        solver, most = self._program, self._program.getNumCol()
        every = np.arange(most, dtype=np.int32)
        solver.changeColsIntegrality(most, every, np.full(most, highspy.HighsVarType.kInteger))
        solver.setOptionValue("objective_bound", ceiling - self._constant)
        solver.setOptionValue("mip_rel_gap", 0.1 * SAME)
        solver.setOptionValue("mip_max_nodes", NODES)
        solver.run()
        status, info = solver.getModelStatus(), solver.getInfo()
        chosen, shares = None, list(solver.getSolution().col_value)
        if info.primal_solution_status == 2 and not any(share > 0.5 for share in shares[: self._segments]):
            chosen = [
                column for column, share in zip(self._columns, shares[self._segments :], strict=True) if share > 0.5
            ]
        bound = info.mip_dual_bound + self._constant
        solver.changeColsIntegrality(most, every, np.full(most, highspy.HighsVarType.kContinuous))
        solver.setOptionValue("objective_bound", np.inf)
        nothing = status in (highspy.HighsModelStatus.kInfeasible, highspy.HighsModelStatus.kObjectiveBound)
        return (ceiling if nothing else bound), chosen

    def _build_plan(self, columns: Sequence[_Column]) -> Plan | None:
        """Return the plan of some routes: a segment that two of them visit is left to the first.

        Returns None if a route takes more than its limit without such a segment, which turns or areas can cause.
        """
        free = {number: list(kind.vehicles) for number, kind in enumerate(self._kinds)}
        routes, seen = {}, set[int]()
        for column in columns:
            kept = tuple(visit for visit in column.visits if segment_of(visit) not in seen)
            seen.update(segment_of(visit) for visit in kept)
            kind = self._kinds[column.kind]
            if kept and self._measure(kind, kept) > kind.limit:
                return None
            vehicle = free[column.kind].pop(0)
            routes[vehicle] = Route(vehicle, kept)
        fleet = sorted(vehicle for kind in self._kinds for vehicle in kind.vehicles)
        uncovered = tuple(segment for segment in range(self._segments) if segment not in seen)
        return Plan(tuple(routes.get(vehicle, Route(vehicle, ())) for vehicle in fleet), uncovered)


def _find_violated_triples(visited: npt.NDArray[np.int8], shares: FloatArray) -> IntArray:
    """Return (c, 3) int64, the triples of segments of which routes visit two or more too often, the worst first.

    Args:
        visited: (n, r), 1 where a route visits a segment.
        shares: (r,), how much of each route is chosen.
    """
    used = np.flatnonzero(shares > SAME)
    inside = visited[:, used].astype(np.float64)
    pairs = (inside * shares[used]) @ inside.T
    triples, excesses = [np.empty((0, 3), dtype=np.int64)], [np.empty(0)]
    for third in range(2, len(visited)):
        all_three = (inside[:third] * shares[used] * inside[third]) @ inside[:third].T
        to_third = pairs[third, :third]
        twice = pairs[:third, :third] + to_third[:, np.newaxis] + to_third[np.newaxis] - 2 * all_three
        first, second = np.nonzero(np.triu(twice, 1) > 1 + VIOLATED)
        triples.append(np.column_stack((first, second, np.full(len(first), third))))
        excesses.append(twice[first, second])
    worst = np.argsort(-np.concatenate(excesses), kind="stable")[:CUTS]
    return np.concatenate(triples)[worst]


def _build_priced(kind: RouteKind, near: IntArray) -> Priced:
    width = kind.limit / BUCKETS * (1 + 1e-9) + 1e-12
    other = np.arange(len(near) * 2) >> 1
    apart = other[:, np.newaxis] != other[np.newaxis]
    shortest = float(kind.move.min(initial=np.inf, where=apart))
    start, home, move = (np.array(table, dtype=np.float64, order="C") for table in (kind.start, kind.home, kind.move))
    rounds = 1 if shortest > width * (1 + SAME) + SAME else len(near)
    return Priced(start, home, move, near, kind.limit, width, rounds)


def _find_neighbourhoods(kinds: Sequence[RouteKind], segments: int) -> IntArray:
    """Return (n, 2) int64, a set for each segment: itself and those nearest to it, in either direction."""
    move = kinds[0].move.reshape(segments, 2, segments, 2).min(axis=(1, 3))
    onward = move - move.min(axis=0, initial=np.inf, where=~np.eye(segments, dtype=np.bool_))
    apart = np.minimum(onward, onward.T)
    np.fill_diagonal(apart, -1.0)
    near = np.zeros((segments, 2), dtype=np.int64)
    for segment, others in enumerate(np.argsort(apart, axis=1, kind="stable")[:, :NEIGHBOURS].tolist()):
        for other in others:
            near[segment, other // WORD] |= 1 << other % WORD
    return near
