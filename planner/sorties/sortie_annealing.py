"""The search for days of sorties: cycles of annealing on the kernels' arrays, each from the best plan so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import PlanError
from planner.kernels.arrays import FloatArray, IntArray, RandomState, allocate
from planner.kernels.sortie_schedule import (
    NEVER,
    SortieProblem,
    SortieState,
    SortieWorkspace,
    choose_bases_of_touched,
    measure_given_sorties,
    put_all_segments,
    schedule_sorties,
)
from planner.kernels.sortie_search import anneal_sorties, copy_sorties
from planner.model import Plan, Route
from planner.plan_search import build_random_state
from planner.search import AnnealingSearch, Cycle, SearchStart
from planner.sorties.sortie_model import Objective, SortieInstance, SortieResult, evaluate_sorties
from planner.stop_rules import StopRule, Stopwatch

BATCH = 200
"""Iterations of a start between two checks of the stop rule."""
FIRST_CYCLE = 2_000
"""Iterations of the first cycle for a few segments; each further cycle is half as long again."""
PER_SEGMENT = 15
"""Additional iterations of the first cycle per segment."""
GROWTH = 1.5
HOT = 0.02
"""Start temperature of a cycle, as a share of the mean sortie's duration."""
COLD = 0.0003
"""End temperature of a cycle, in the same unit."""
FEW = 60
"""Segments up to which a plan is so short that it is perturbed more strongly."""


class SortieStart(SearchStart[SortieState]):
    """One walk of the annealing kernel."""

    def __init__(self, problem: SortieProblem, table: MoveTable, first: SortieState, rng: RandomState) -> None:
        current, trial, best = (build_sortie_state(problem, table) for _ in range(3))
        super().__init__((current, trial, best), copy_sorties, rng)
        self._problem = problem
        self._memory = build_sortie_workspace(problem)
        copy_sorties(first, self.best)

    @property
    def rank(self) -> list[float]:
        """Return the segments that do not fit into any day, then the objective's figure, then the others."""
        late, *figures = self.best.sums[:4].tolist()
        return [late, figures[self._problem.objective], *figures]

    def run(self, cooling: float, most: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal_sorties(
            self._problem, self.current, self.trial, self.best, self.temperature, cooling, most, iterations,
            self.rng, self._memory,
        )  # fmt: skip
        return improved


class SortieSearch(AnnealingSearch[SortieStart]):
    """One search; call only ``run``."""

    def __init__(
        self,
        instance: SortieInstance,
        *,
        objective: Objective,
        seed: int,
        starts: int,
        initial: Sequence[Route] | None = None,
        table: MoveTable | None = None,
    ) -> None:
        watch = Stopwatch()
        self._instance = instance
        self._table = build_move_table(instance) if table is None else table
        self._problem = build_sortie_problem(instance, self._table, objective)
        able = self._problem.able.any(axis=0)
        self._idle = not able.any()
        first = self._build_first_state(initial, seed)
        super().__init__(
            [SortieStart(self._problem, self._table, first, build_random_state(seed + one)) for one in range(starts)],
            watch, batch=BATCH, impossible="a segment is out of reach" if (instance.wanted & ~able).any() else None,
        )  # fmt: skip

    def _build_first_state(self, initial: Sequence[Route] | None, seed: int) -> SortieState:
        """Return the given sorties with all open segments inserted at least cost, the farthest first."""
        state, memory = build_sortie_state(self._problem, self._table), build_sortie_workspace(self._problem)
        if initial is not None:
            load_sorties(state, initial)
            if not measure_given_sorties(self._problem, state, memory):
                state = build_sortie_state(self._problem, self._table)
        nearest_s = self._problem.out[:, :, ::2, 0].min(axis=(0, 1))
        able = self._problem.able.any(axis=0) & (state.where < 0)
        waiting = np.array(sorted(np.flatnonzero(able), key=lambda one: -nearest_s[one]), dtype=np.int64)
        put_all_segments(self._problem, state, memory, waiting, len(waiting), build_random_state(seed))
        self._schedule_anew(state, memory)
        if state.sums[0] > 0 and initial is None:  # the days are too short: the most valuable comes first
            for vehicle, count in enumerate(state.counts):
                own = state.order[vehicle, :count].copy()
                state.order[vehicle, :count] = own[np.argsort(-state.size[own] / state.whole[own, 0], kind="stable")]
            self._schedule_anew(state, memory)
        return state

    def _schedule_anew(self, state: SortieState, memory: SortieWorkspace) -> None:
        """Split each vehicle's visits into new sorties, and schedule them."""
        memory.touched[:] = 1
        choose_bases_of_touched(self._problem, state, memory)
        memory.touched[:] = 0
        schedule_sorties(self._problem, state, memory)

    def run(self, stop: StopRule) -> SortieResult:
        """Improve the plan until ``stop`` ends the search."""
        reason = "nothing to do" if self._idle else self._run_rounds(stop)
        plan = build_sortie_plan(self._instance, self._leader.best)
        return SortieResult(plan, evaluate_sorties(self._instance, plan), self._iterations, self._watch.seconds, reason)

    def _build_cycle(self, before: Cycle | None) -> Cycle:
        best, segments = self._leader.best, self._instance.segments
        self._most = float(best.whole[:, 0].max(initial=1.0))
        mean_s = best.sums[2] / max(1.0, best.sums[3])
        few = 15.0 if segments <= FEW else 1.0
        hot, cold = (few * share * max(mean_s, 1.0) for share in (HOT, COLD))
        return Cycle(FIRST_CYCLE + PER_SEGMENT * segments if before is None else int(GROWTH * before.length), hot, cold)

    def _improve(self, start: SortieStart, iterations: int) -> int:
        return start.run(self._cycle.cooling, self._most, iterations)

    def _rate_best(self) -> tuple[float, int, bool]:
        best = self._leader.best
        uncovered = int(self._instance.wanted.sum()) - int(best.size[best.start < 1e17].sum())
        return float(best.sums[1 + self._problem.objective]), uncovered, uncovered == 0


NEAR = 30
"""Number of neighbours kept for each segment."""
ROWS = 64
"""Visits whose moves are computed at a time: limits memory."""
FLIGHT_SHARE = 0.3
"""Weight of a second of flight, divided by the fleet size, if the last landing is the objective."""
FINISH_SHARE = 0.02
"""Weight of a second of the last landing if it is not the objective."""
RANKS = {Objective.FINISH: 0, Objective.FLIGHT: 1, Objective.SWAPS: 2}


@dataclass(frozen=True, slots=True, eq=False)
class MoveTable:
    """All moves of an instance, and each segment's neighbours: built once, for many searches over the same segments."""

    move: FloatArray
    """(p, 2n, 2n, 2)"""
    near: IntArray
    """(n, m)"""
    longest: int
    """Maximum number of visits in a sortie."""


def build_move_table(instance: SortieInstance) -> MoveTable:
    """Compute the table of all moves."""
    moves, visits = instance.moves, instance.moves.visits
    move = np.empty((moves.profiles, visits, visits, 2))
    after = np.arange(visits)
    for profile in range(moves.profiles):
        for begin in range(0, visits, ROWS):
            before = np.arange(begin, min(begin + ROWS, visits))[:, np.newaxis]
            move[profile, begin : begin + ROWS, :, 0] = moves.seconds(profile, before, after)
            move[profile, begin : begin + ROWS, :, 1] = moves.pct(profile, before, after)
    segments = visits // 2
    between = move[0, :, :, 0].reshape(segments, 2, segments, 2).min(axis=(1, 3))
    np.fill_diagonal(between, np.inf)
    near = between.argsort(axis=1, kind="stable")[:, : min(NEAR, max(1, segments - 1))]
    return MoveTable(move, np.ascontiguousarray(near.astype(np.int64)), _max_visits_per_sortie(instance, move))


def _max_visits_per_sortie(instance: SortieInstance, move: FloatArray) -> int:
    """Return the number of visits that fit into a sortie if each uses the least possible."""
    segments = instance.segments
    if segments < 2:
        return 1
    most = max(own.budget_pct / own.consumption for own in instance.vehicles)
    least = np.full(segments, np.inf)
    for profile in move:
        into = profile[:, :, 1].copy()
        np.fill_diagonal(into, np.inf)
        least = np.minimum(least, into.min(axis=0).reshape(-1, 2).min(axis=1))
    return min(segments, 1 + int((np.sort(least).cumsum() <= most + 1e-6).sum()))


def build_sortie_problem(instance: SortieInstance, table: MoveTable, objective: Objective) -> SortieProblem:
    """Return the instance as kernel arrays."""
    fleet, bases, days = len(instance.vehicles), len(instance.bases), instance.days
    out = np.stack((instance.out_s, instance.out_pct), axis=-1)
    home = np.stack((instance.home_s, instance.home_pct), axis=-1)
    lands = np.zeros((fleet, bases), dtype=np.int64)
    for row, own in enumerate(instance.vehicles):
        lands[row, list(own.lands)] = 1
    packs = np.array([-1 if base.packs is None else base.packs for base in instance.bases], dtype=np.int64)
    first = [base.list_packs(0, days[0][0]) for base in instance.bases]
    room = int(np.maximum(packs, 0).sum()) + sum(map(len, first)) + instance.segments
    charged = np.full((bases, room), NEVER)
    for row, times in enumerate(first):
        charged[row, : len(times)] = times
    lengths = np.array([end - begin for begin, end in days])
    share = FLIGHT_SHARE / fleet
    # Segments that an area cuts off have infinite moves, which are excluded here.
    longest_s = float(sum(table[..., 0].max(where=np.isfinite(table[..., 0]), initial=0.0) for table in (out, home)))
    weights = {
        Objective.FINISH: (1.0, share, 0.0),
        Objective.FLIGHT: (FINISH_SHARE, 1.0, 0.0),
        Objective.SWAPS: (FINISH_SHARE, share, longest_s),
    }[objective]
    return SortieProblem(
        move=table.move,
        out=np.ascontiguousarray(out),
        home=np.ascontiguousarray(home),
        profile=np.array([own.profile for own in instance.vehicles], dtype=np.int64),
        consumption=np.array([own.consumption for own in instance.vehicles]),
        budget=np.array([own.budget_pct for own in instance.vehicles]),
        able=_build_ability_table(instance, lands),
        lands=lands,
        transfer=np.where(np.isfinite(instance.transfer_s), np.minimum(instance.transfer_s, NEVER), NEVER),
        turnaround=np.array([base.turnaround_s for base in instance.bases]),
        recharge=np.array([NEVER if base.recharge_s is None else base.recharge_s for base in instance.bases]),
        packs=packs,
        days=np.column_stack(([begin for begin, _ in days], [end for _, end in days], lengths.cumsum() - lengths)),
        windows=_build_window_table(instance),
        near=table.near,
        place=np.array([own.base for own in instance.vehicles], dtype=np.int64),
        ready=np.array([own.ready_s for own in instance.vehicles], dtype=np.float64),
        stock=np.array([len(times) for times in first], dtype=np.int64),
        charged=charged,
        taken_off=np.array([max(base.taken_off_s, -NEVER) for base in instance.bases]),
        stagger=instance.stagger_s,
        finish=weights[0],
        flight=weights[1],
        swap=weights[2],
        late=longest_s,
        objective=RANKS[objective],
    )


def _build_ability_table(instance: SortieInstance, lands: IntArray) -> IntArray:
    """Return whether each vehicle can inspect each segment in a single sortie within its flight windows."""
    able, allowed = np.zeros(instance.able.shape, dtype=np.int64), instance.allowed
    for row, own in enumerate(instance.vehicles):
        may = lands[row] > 0
        if not may.any() or not own.windows:
            continue
        out, home = instance.out_pct[row][may], instance.home_pct[row][:, may]
        pct = (out[:, :, np.newaxis] + home[np.newaxis]).min(axis=(0, 2))
        seconds = (instance.out_s[row][may][:, :, np.newaxis] + instance.home_s[row][:, may][np.newaxis]).min(
            axis=(0, 2)
        )
        fits = (pct <= own.budget_pct + 1e-9) & (seconds <= max(end - begin for begin, end in own.windows))
        able[row] = allowed[row] & instance.wanted & fits.reshape(-1, 2).any(axis=1)
    return able


def _build_window_table(instance: SortieInstance) -> FloatArray:
    """Return (k, t, w, 2) flight windows by vehicle and day."""
    parted = [
        [[window for window in own.windows if begin <= window[0] < end] for begin, end in instance.days]
        for own in instance.vehicles
    ]
    width = max(1, *(len(day) for own in parted for day in own))
    table = np.empty((len(parted), len(instance.days), width, 2))
    table[..., 0], table[..., 1] = NEVER, -NEVER
    for row, own in enumerate(parted):
        for number, day in enumerate(own):
            table[row, number, : len(day)] = np.array(day).reshape(-1, 2)
    return table


def build_sortie_state(problem: SortieProblem, table: MoveTable) -> SortieState:
    """Return a state without sorties."""
    fleet, segments = problem.able.shape
    state = allocate(SortieState, r=segments, c=table.longest, k=fleet, n=segments, d=len(problem.packs))
    state.where[:] = -1
    return state


def build_sortie_workspace(problem: SortieProblem) -> SortieWorkspace:
    """Return work space for the kernels."""
    fleet, segments = problem.able.shape
    bases, packs = problem.charged.shape
    return allocate(SortieWorkspace, r=segments, k=fleet, n=segments, d=bases, s=packs)


def load_sorties(state: SortieState, sorties: Sequence[Route]) -> None:
    """Load sorties into an empty state.

    Raises:
        PlanError: a segment occurs twice.
    """
    for row, one in enumerate(sorties):
        state.size[row] = len(one.visits)
        state.visits[row, : len(one.visits)] = one.visits
        state.owner[row], state.base[row], state.land[row] = one.vehicle, one.base, one.lands
        state.order[one.vehicle, state.counts[one.vehicle]] = row
        state.counts[one.vehicle] += 1
        for visit in one.visits:
            if state.where[visit >> 1] >= 0:
                raise PlanError(f"initial: segment {visit >> 1} is in two sorties")
            state.where[visit >> 1] = row


def build_sortie_plan(instance: SortieInstance, state: SortieState) -> Plan:
    """Return a state as a plan; segments that do not fit into any day are left uncovered."""
    routes = tuple(
        Route(
            vehicle, tuple(int(visit) for visit in state.visits[row, : state.size[row]]),
            int(state.base[row]), int(state.land[row]), float(state.start[row]),
        )
        for vehicle, count in enumerate(state.counts) for row in state.order[vehicle, :count]
        if state.start[row] < NEVER
    )  # fmt: skip
    flown = {visit >> 1 for one in routes for visit in one.visits}
    missing = (int(segment) for segment in np.flatnonzero(instance.wanted) if segment not in flown)
    return Plan(routes, tuple(missing))
