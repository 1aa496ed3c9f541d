"""Column generation: proven lower bounds on what a fleet needs, and proofs that it cannot cover everything.

The columns of a linear program are routes. It chooses shares of routes so that every segment is covered; a new route is
priced by its reduced cost (``kernels/pricing.py``) until none is worth adding. For any prizes of the segments, their
sum plus the least reduced cost of each vehicle is a lower bound (Lagrange), so each complete pricing proves one, also
long before the program has its optimum. Bounds are rounded down by more than the rounding errors.

HiGHS, of the extra `proofs`, solves the programs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from planner.errors import InstanceError
from planner.evaluate import BUDGET_TOLERANCE_PCT
from planner.kernels.arrays import FloatArray, IntArray, allocate
from planner.kernels.pricing import (
    SAME_MEMORY,
    SAME_NODE,
    SAME_SET,
    WORD,
    Choosable,
    Completions,
    Cuts,
    Labels,
    Partial,
    Priced,
    bound_completions,
    choose_partition,
    price_routes,
)
from planner.model import Instance, Plan, Route, segment_of
from planner.row_cuts import Cut, count_routes, find_memory, find_violated_triples, tabulate_cuts

SEGMENTS_UP_TO = 2 * WORD
"""Maximum number of segments: a set of them has two words."""
BUCKETS = 256
ROOM = 2_000_000
"""Maximum number of labels in one pricing: some 140 MB."""
NEIGHBOURS, NEIGHBOURS_UP_TO = 8, 18
"""Segments that a route's label does not forget at once: the size of the ng-sets, at first and when they have grown."""
SMOOTHING = 0.7
"""Weight of the prizes of the best bound against those of the program (Wentges 1997): fewer rounds."""
PRICED_CUTS, PRICED_CUTS_UP_TO = 20, 2 * WORD
"""Cuts that pricing regards: how many are added at once, and at most; a set of them has two words."""
PATIENCE, GAINED = 4, 0.01
"""The bound is tightened as long as so many rounds gain this share of what it lacks."""
FEWER = 0.7
"""Factor on the reduced cost of the routes to choose from, while there are too many."""
CHECKS_UP_TO = 2_000_000_000
"""Routes checked in one choice, some seconds: a number, so that every machine gives the same answer."""
ROUTES_UP_TO = 100_000
"""Maximum number of routes of one kind to choose from."""
SLACK_UP_TO = 0.02
"""Share of the bound that pricing may ignore for lack of room; a tenth of it ends the tightening."""
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
    """Lower bounds on the cost of covering all segments; each ``step`` prices once and may raise the bound.

    At the program's optimum the routes are tightened: cycles are forbidden, and subset-row cuts are added.
    """

    def __init__(
        self, segments: int, kinds: Sequence[RouteKind], *, penalty: float, goal: float = np.inf, chooses: bool = False
    ) -> None:  # fmt: skip
        """Begin without a route.

        Args:
            segments: number of segments, at most SEGMENTS_UP_TO.
            kinds: the routes to choose from.
            penalty: cost of leaving a segment out, more than a route with it can cost.
            goal: bound that is sought, or the cost of a known plan.
            chooses: end the tightening as soon as ``choose_routes`` has room for all routes of a plan up to the goal.

        Raises:
            InstanceError: too many segments, or HiGHS is not installed.
        """
        check_can_prove(segments)
        # Imported here: it loads for a tenth of a second, and is an extra.
        import highspy

        self._kinds, self._segments, self._goal = kinds, segments, goal
        self._tried = np.inf if chooses else 0.0
        """Gap for whose routes there was no room."""
        self._near = _find_neighbourhoods(kinds, segments)
        self._priced = [_build_priced(kind, self._near) for kind in kinds]
        self._cuts: list[Cut] = []
        self._counted, self._cut_tables = tabulate_cuts([], segments), allocate(Cuts, n=segments)
        self._past: list[float] = []
        """Bound before each round of tightening."""
        self._completions = [allocate(Completions, b=BUCKETS, v=2 * segments) for _ in kinds]
        self._labels = allocate(Labels, c=ROOM, b=BUCKETS, v=2 * segments)
        self._found = np.zeros(max(2 * segments, ROUTES_UP_TO), dtype=np.int64)
        self._constant = sum(kind.weight * kind.idle * kind.count for kind in kinds)
        self._columns: dict[_Column, int] = {}
        """Each route's place in the program."""
        self._rule, self._smoothing = SAME_NODE, SMOOTHING
        self._slack = SAME
        """Share of the bound that pricing ignores; more when there is no room for all labels."""
        self.bound = -np.inf
        """Proven lower bound on the cost, with what is left out."""
        self.value = np.inf
        """Cost of the program: no bound gets beyond it without cuts."""
        self._center = np.empty(0)
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
        self._rows = self._program.getNumRow()
        """Rows before those of the cuts."""
        for segment in range(segments):
            self._program.addCol(penalty, 0.0, np.inf, 1, np.array([segment], dtype=np.int32), np.ones(1))

    def add_plan(self, plan: Plan) -> None:
        """Add the routes of a plan that are within the limits."""
        for route in plan.routes:
            for number, kind in enumerate(self._kinds):
                is_own = bool(route.visits) and route.vehicle in kind.vehicles
                if is_own and self._measure(kind, route.visits) <= kind.limit:
                    self._add(number, route.visits)

    def _add(self, number: int, visits: tuple[int, ...], dual: FloatArray | None = None) -> bool:
        """Add a route unless it is known, or gains nothing at some prices; return whether it was added."""
        column = _Column(number, visits)
        if column in self._columns:
            return False
        kind = self._kinds[number]
        segments, times = np.unique(np.array(visits) >> 1, return_counts=True)
        rows, entries = [segments, [self._segments + number]], [times, [1]]
        if number in self._share_row:
            rows.append(segments + self._share_row[number])
            entries.append(times)
        counts = count_routes(*self._counted, [visits])[:, 0]
        rows.append(self._rows + np.flatnonzero(counts))
        entries.append(counts[counts > 0])
        index, entry = np.concatenate(rows).astype(np.int32), np.concatenate(entries).astype(np.float64)
        cost = kind.weight * (self._measure(kind, visits) - kind.idle)
        if dual is not None and cost - dual[index] @ entry >= -SAME * (1 + abs(cost)):
            return False
        self._columns[column] = self._program.getNumCol()
        self._program.addCol(cost, 0.0, np.inf, len(index), index, entry)
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
        center = self._center if len(self._center) > 0 else dual
        prices = self._smoothing * center + (1 - self._smoothing) * dual
        slack = self._slack
        added = sum(self._add(*route, dual) for route in self._price(prices))
        if self.value - self.bound <= SAME * (1 + abs(self.value)):
            return self._tighten()
        if added > 0:
            return True
        if self._smoothing > 0:
            self._smoothing = 0.0
        elif self._rule == SAME_NODE:
            self._rule, self._smoothing = SAME_MEMORY, SMOOTHING
        else:
            return slack < self._slack < SLACK_UP_TO or (slack == self._slack and self._tighten())
        return True

    def _tighten(self) -> bool:
        """Forbid cycles of the chosen routes and add cuts that these violate; return whether that may pay."""
        self._past.append(self.bound)
        lacks = min(self._goal, 2 * abs(self.bound)) - self.bound
        is_slow = len(self._past) > PATIENCE and self.bound - self._past[-1 - PATIENCE] < GAINED * lacks
        if lacks <= 0 or is_slow or self._slack > SLACK_UP_TO / 10:
            return False
        solution = self._program.getSolution()
        shares, duals = np.array(solution.col_value), np.array(solution.row_dual)[self._rows :]
        used = {column: shares[place] for column, place in self._columns.items() if shares[place] > SAME}
        if lacks < FEWER * self._tried:
            self._tried = lacks
            if self._list_routes(lacks + SAME) is not None:
                return False
        self._drop_cuts(np.flatnonzero((duals >= 0) & (self._center[self._rows :] >= 0)))
        grown = sum([self._forbid_cycle(column.visits) for column in used])
        if grown > 0:
            self._bar_cycles()
        if not self._add_cuts(used) and grown == 0:
            return False
        self._rule, self._smoothing = SAME_NODE, SMOOTHING
        return True

    def _drop_cuts(self, numbers: IntArray) -> None:
        """Take cuts without a price out of the program."""
        self._program.deleteRows(len(numbers), (self._rows + numbers).astype(np.int32))
        self._center = np.delete(self._center, self._rows + numbers)
        self._cuts = [cut for number, cut in enumerate(self._cuts) if number not in set(numbers.tolist())]
        self._counted = tabulate_cuts(self._cuts, self._segments)

    def _forbid_cycle(self, visits: tuple[int, ...]) -> bool:
        """Let the segments between two visits to another one remember it; return whether they did not."""
        last, grown = dict[int, int](), False
        for place, visit in enumerate(visits):
            segment = segment_of(visit)
            between = [segment_of(one) for one in visits[last.get(segment, place) + 1 : place]]
            bit = np.int64(1 << segment % WORD)
            fits = all(sum(int(word).bit_count() for word in self._near[one]) < NEIGHBOURS_UP_TO for one in between)
            if between and fits:
                self._near[between, segment // WORD] |= bit
                grown = True
            last[segment] = place
        return grown

    def _bar_cycles(self) -> None:
        """Bar the routes that visit a segment again which they have not forgotten."""
        near = [int(low) | int(high) << WORD for low, high in self._near]
        barred = []
        for column, place in self._columns.items():
            forbidden = 0
            for visit in column.visits:
                if forbidden >> segment_of(visit) & 1:
                    barred.append(place)
                    break
                forbidden = forbidden & near[segment_of(visit)] | 1 << segment_of(visit)
        none = np.zeros(len(barred))
        self._program.changeColsBounds(len(barred), np.array(barred, dtype=np.int32), none, none)

    def _add_cuts(self, used: Mapping[_Column, float]) -> bool:
        """Add the cuts that the chosen routes violate most, and return whether there are any."""
        routes = [column.visits for column in used]
        visited = np.zeros((self._segments, len(routes)), dtype=np.int8)
        for place, visits in enumerate(routes):
            visited[[segment_of(visit) for visit in visits], place] = 1
        known = {cut.triple: number for number, cut in enumerate(self._cuts)}
        room = min(PRICED_CUTS, PRICED_CUTS_UP_TO - len(self._cuts))
        found = find_violated_triples(visited, np.array(list(used.values())))
        cuts = list[Cut]()
        for triple in map(tuple, found.tolist()):
            memory = frozenset(triple).union(*(find_memory(visits, triple) for visits in routes))
            if len(cuts) < room:
                cuts.append(Cut(triple, memory | (self._cuts[known[triple]].memory if triple in known else set())))
        columns = list(self._columns)
        counted = count_routes(*tabulate_cuts(cuts, self._segments), [column.visits for column in columns])
        for cut, counts in zip(cuts, counted, strict=True):
            paid = np.flatnonzero(counts)
            index = np.array([self._columns[columns[place]] for place in paid], dtype=np.int32)
            self._program.addRow(-np.inf, 1.0, len(paid), index, counts[paid].astype(np.float64))
            self._cuts.append(cut)
        self._center = np.append(self._center, np.zeros(len(cuts)))
        self._counted = tabulate_cuts(self._cuts, self._segments)
        return len(cuts) > 0

    def _price_cuts(self, prices: FloatArray) -> None:
        """Set the tables of the cuts that have a price."""
        tables = self._cut_tables
        for table in tables:
            table[:] = 0
        price = np.zeros(2 * 64)
        costly = [(cut, -one) for cut, one in zip(self._cuts, prices[self._rows :], strict=True) if one < 0]
        for number, (cut, one) in enumerate(costly):
            word, bit = number // WORD, np.int64(1 << number % WORD)
            price[64 * word + number % WORD] = one
            tables.member[list(cut.triple), word] |= bit
            tables.memory[list(cut.memory), word] |= bit
        bits = np.arange(256)[:, np.newaxis] >> np.arange(8) & 1
        tables.price[:] = price.reshape(16, 8) @ bits.T

    def _prizes_of(self, number: int, prices: FloatArray) -> FloatArray:
        """Return (n,) float64, what a route of a kind earns for each segment."""
        prizes = np.maximum(prices[: self._segments], 0.0)
        if number in self._share_row:
            prizes = prizes + np.minimum(prices[self._share_row[number] :][: self._segments], 0.0)
        return np.ascontiguousarray(prizes)

    def _price(self, prices: FloatArray) -> list[_Column]:
        """Return routes of negative reduced cost at some prices; raise the bound if these prove a better one."""
        bound, routes, leasts = self._sum_prices(prices), list[_Column](), list[float]()
        self._price_cuts(prices)
        scale = 1 + abs(self.value)
        for number, kind in enumerate(self._kinds):
            least = self._bound_reduced_cost(number, prices)
            ignored = self._slack * scale / max(1.0, kind.count) if self._rule == SAME_MEMORY else 0.0
            self._found[: 2 * self._segments] = -1
            labels, _ = self._search_routes(number, prices, kind.weight * kind.idle - ignored - 1e-9, self._rule)
            ends = [int(label) for label in self._found[: 2 * self._segments] if label >= 0]
            found = [_Column(number, self._trace(label)) for label in ends]
            if self._rule == SAME_MEMORY and labels >= 0:
                costs = self._labels.cost[ends] + kind.weight * (kind.home[self._labels.visit[ends]] - kind.idle)
                least = max(least, costs.min(initial=-ignored - 1e-9))
            elif labels < 0 and self._rule == SAME_MEMORY:
                self._slack *= 10
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
        cuts = float(np.minimum(prices[self._rows :], 0.0).sum())
        return float(np.maximum(prices[: self._segments], 0.0).sum()) + shares + cuts + self._constant

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
            priced, kind.weight, self._prizes_of(number, prices), self._cut_tables, self._completions[number], most,
            rule, self._labels, self._found,
        )  # fmt: skip

    def _trace(self, label: int) -> tuple[int, ...]:
        visits = []
        while label >= 0:
            visits.append(int(self._labels.visit[label]))
            label = int(self._labels.parent[label])
        return tuple(reversed(visits))

    def choose_routes(
        self, ceiling: float, go_on: Callable[[], bool] = lambda: True, *, any_plan: bool = False
    ) -> tuple[float, Plan | None]:  # fmt: skip
        """Return a proven bound, and a plan of cost less than ``ceiling`` if one was found.

        Tries all choices of the routes that such a plan may have: then the bound is the optimum or the ceiling. If
        there are too many, it tries those of least reduced cost; a plan with any other one costs more than the bound so
        far and their largest reduced cost together.

        Args:
            ceiling: cost that the plan must beat.
            go_on: asked now and then; whether to go on.
            any_plan: end with the first plan below the ceiling.
        """
        gap = within = max(0.0, ceiling - self.bound) + SAME
        while (listed := self._list_routes(within)) is None:
            within *= FEWER
            if within < gap / 64 or not go_on():
                return self.bound, None
        columns, routes = listed
        left = np.array([len(kind.vehicles) for kind in self._kinds])
        chosen = np.full(int(left.sum()), -1)
        room, work = ceiling - self._constant, allocate(Partial, k=len(chosen))
        best, is_all = choose_partition(routes, self._segments, left, gap, room, any_plan, CHECKS_UP_TO, work, chosen)
        plan = self._build_plan([columns[place] for place in chosen if place >= 0]) if best < room else None
        least = ceiling if plan is None else best + self._constant
        return max(self.bound, min(least, self.bound + within)) if is_all else self.bound, plan

    def _list_routes(self, gap: float) -> tuple[list[_Column], Choosable] | None:
        """Return all routes that a plan may have whose cost exceeds the bound by a gap; None without room.

        Of the routes of one kind that visit the same segments, only the cheapest.
        """
        if len(self._center) == 0:
            return None
        self._price_cuts(self._center)
        columns, rows = list[_Column](), list[FloatArray]()
        table = self._labels
        for number, kind in enumerate(self._kinds):
            self._bound_reduced_cost(number, self._center)
            least, idle = self._leasts[number], kind.weight * kind.idle
            labels, count = self._search_routes(number, self._center, least + gap + idle, SAME_SET)
            if labels < 0:
                return None
            ends = self._found[:count]
            ends = ends[np.argsort(table.energy[ends] + kind.home[table.visit[ends]], kind="stable")]
            _, first = np.unique(np.column_stack((table.low[ends], table.high[ends])), axis=0, return_index=True)
            ends = ends[first]
            home = kind.weight * kind.home[table.visit[ends]] - idle
            rows.append(np.array((table.cost[ends] + home - least, kind.weight * table.energy[ends] + home)))
            columns += [_Column(number, self._trace(label)) for label in ends.tolist()]
        reduced, cost = np.concatenate(rows, axis=1)
        low = np.array([min(map(segment_of, column.visits)) for column in columns], dtype=np.int64)
        order = np.lexsort((reduced, low))
        columns = [columns[place] for place in order]
        sets = np.zeros((len(columns), 2), dtype=np.int64)
        for place, column in enumerate(columns):
            for visit in column.visits:
                sets[place, segment_of(visit) // WORD] |= 1 << segment_of(visit) % WORD
        kinds = np.array([column.kind for column in columns], dtype=np.int64)
        begin = np.searchsorted(low[order], np.arange(self._segments + 1)).astype(np.int64)
        return columns, Choosable(sets, reduced[order], cost[order], kinds, begin)

    def _build_plan(self, columns: Sequence[_Column]) -> Plan:
        """Return the plan of routes that visit each segment once."""
        free = {number: list(kind.vehicles) for number, kind in enumerate(self._kinds)}
        visits = {free[column.kind].pop(0): column.visits for column in columns}
        fleet = sorted(vehicle for kind in self._kinds for vehicle in kind.vehicles)
        return Plan(tuple(Route(vehicle, visits.get(vehicle, ())) for vehicle in fleet))


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
