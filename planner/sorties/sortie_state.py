"""From an instance of sorties to the kernels' arrays, and from their state to a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import PlanError
from planner.kernels.arrays import FloatArray, IntArray
from planner.kernels.sortie_schedule import NEVER, SortieProblem, SortieState, SortieWorkspace
from planner.sorties.sortie_model import Objective, Sortie, SortieInstance, SortiePlan

NEAR = 30
"""Neighbours of a segment that are kept."""
ROWS = 64
"""Visits whose moves are priced at a time: what they take stays small."""
FLIGHT_SHARE = 0.3
"""What a second of somebody's flight weighs, divided by the fleet, where the last landing is to be soon."""
FINISH_SHARE = 0.02
"""What a second of the last landing weighs where it is not what counts."""
RANKS = {Objective.FINISH: 0, Objective.FLIGHT: 1, Objective.SWAPS: 2}


@dataclass(frozen=True, slots=True, eq=False)
class MoveTable:
    """All moves of an instance, and who is near whom: made once, for many searches over the same segments."""

    move: FloatArray
    """(p, 2n, 2n, 2)"""
    near: IntArray
    """(n, m)"""
    longest: int
    """Visits that a sortie has at most."""


def build_move_table(instance: SortieInstance) -> MoveTable:
    """Price all moves."""
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
    """Return how many visits fit into a sortie that uses no more than the least of each."""
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
    """Return the kernels' view."""
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
    # Behind an area no way leads to a segment: that weighs nothing here.
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
    """Return whether a vehicle can inspect a segment at all, by a sortie of its own that fits into its hours."""
    able = np.zeros(instance.able.shape, dtype=np.int64)
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
        able[row] = instance.able[row] & instance.wanted & fits.reshape(-1, 2).any(axis=1)
    return able


def _build_window_table(instance: SortieInstance) -> FloatArray:
    """Return (k, t, w, 2) times by vehicle and day."""
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
    """Return a state without a sortie."""
    fleet, segments = problem.able.shape
    return SortieState(
        visits=np.zeros((segments, table.longest), dtype=np.int64),
        size=np.zeros(segments, dtype=np.int64),
        owner=np.zeros(segments, dtype=np.int64),
        base=np.zeros(segments, dtype=np.int64),
        land=np.zeros(segments, dtype=np.int64),
        between=np.zeros((segments, 2)),
        whole=np.zeros((segments, 2)),
        start=np.zeros(segments),
        order=np.zeros((fleet, segments), dtype=np.int64),
        counts=np.zeros(fleet, dtype=np.int64),
        where=np.full(segments, -1, dtype=np.int64),
        bias=np.zeros((fleet, len(problem.packs))),
        ends=np.zeros(fleet),
        sums=np.zeros(5),
    )


def build_sortie_workspace(problem: SortieProblem) -> SortieWorkspace:
    """Return work space."""
    fleet, segments = problem.able.shape
    bases = len(problem.packs)
    return SortieWorkspace(
        touched=np.zeros(fleet, dtype=np.int64),
        removed=np.zeros(segments, dtype=np.int64),
        keys=np.zeros(segments),
        pool=np.zeros_like(problem.charged),
        pooled=np.zeros(bases, dtype=np.int64),
        last=np.zeros(bases),
        next=np.zeros(fleet, dtype=np.int64),
        at=np.zeros(fleet, dtype=np.int64),
        ready=np.zeros(fleet),
        cost=np.zeros((segments + 1, bases)),
        begun=np.zeros((segments + 1, bases), dtype=np.int64),
        came=np.zeros((segments + 1, bases), dtype=np.int64),
    )


def load_sorties(state: SortieState, sorties: Sequence[Sequence[Sortie]]) -> None:
    """Put sorties into an empty state.

    Raises:
        PlanError: a segment is in two of them.
    """
    row = 0
    for vehicle, own in enumerate(sorties):
        for number, one in enumerate(own):
            state.size[row] = len(one.visits)
            state.visits[row, : len(one.visits)] = one.visits
            state.owner[row], state.base[row], state.land[row] = vehicle, one.base, one.lands
            state.order[vehicle, number] = row
            for visit in one.visits:
                if state.where[visit >> 1] >= 0:
                    raise PlanError(f"initial: segment {visit >> 1} is in two sorties")
                state.where[visit >> 1] = row
            row += 1
        state.counts[vehicle] = len(own)


def build_sortie_plan(instance: SortieInstance, state: SortieState) -> SortiePlan:
    """Return a state as a plan; what finds no day is left uncovered."""
    sorties, flown = [], set()
    for own, count in zip(state.order, state.counts, strict=True):
        mine = [
            Sortie(
                int(state.base[row]), tuple(int(visit) for visit in state.visits[row, : state.size[row]]),
                int(state.land[row]), float(state.start[row]),
            )
            for row in own[:count] if state.start[row] < NEVER
        ]  # fmt: skip
        flown |= {visit >> 1 for one in mine for visit in one.visits}
        sorties.append(tuple(mine))
    missing = [int(segment) for segment in np.flatnonzero(instance.wanted) if segment not in flown]
    return SortiePlan(tuple(sorties), tuple(missing))
