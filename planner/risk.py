"""Estimate the probability that everything is inspected from many flights with random losses, re-planned or not.

The model. A vehicle in the air is lost after an exponentially distributed time with the mean time between failures; on
the ground it cannot fail, and if it flies again its flight hours continue. A vehicle's true consumption is its planned
consumption times a factor, normal about 1 and constant for the whole flight; when its budget and its reserve are used
up, it is lost too. Between the ends of visits energy is assumed to be used evenly.

A loss that leaves no visit unfinished costs nothing. After any other the survivors get a new plan at once, from their
positions by `planner.build_remaining_problem`; if no plan inspects everything, there is no further re-plan, and
whatever a lost vehicle has not finished stays open, then and later. Re-plans use the planned consumption, not the true
one: the reserve covers the difference, so whether a loss can be repaired depends only on the lost vehicle and the
interval between the ends of visits. All flights with the same vehicle and interval share one re-plan.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError, PlanError
from planner.evaluate import Cost, CriticalLoss, LossRow, evaluate
from planner.fleet_state import FleetAfterLosses, build_state_before_losses, event_times_s
from planner.model import Instance, Plan
from planner.moves import FloatArray
from planner.replan import SAME_TIME_S, RemainingProblem, build_remaining_problem, replan
from planner.stop_rules import FirstFeasible, Iterations, combine_stop_rules
from planner.window import EFFORT, iterate_losses

FLIGHTS_PER_CHUNK = 10_000
"""Flights that share their re-plans; more chunks keep more processors busy."""
COVERAGE_FLIGHTS = 2_000
"""Flights that estimate the probability of a plan chosen by it."""
TIME_BINS = 10
"""Number of parts of the longest route's duration by which failures are counted."""
RESERVE_PCT = 15.0
"""Default share of a full battery that is never planned with."""
Z_95 = 1.959963984540054
"""Quantile of the standard normal: 95 % lie between minus and plus this."""

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ProbabilityEstimate:
    """A probability estimated from flights, with its 95 % confidence interval (Wilson 1927)."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class RiskCampaign:
    """Settings that all flights have in common."""

    instance: Instance
    plan: Plan
    table: tuple[LossRow, ...] = field(repr=False)
    """The first losses and their repairs."""
    mtbf_h: tuple[float, ...]
    """Mean flight hours between failures of one vehicle; every value uses the same random numbers."""
    battery_spread_pct: float
    """Standard deviation of the true consumption, in percent of the planned."""
    reserve_pct: float
    """Energy of a vehicle beyond its budget before it falls, in percent of a full battery."""
    max_losses: int
    """Maximum number of losses that are re-planned."""
    effort: int
    """Maximum iterations of one re-plan."""
    fly_again: bool = True
    """Whether landed vehicles may fly again after a loss."""


@dataclass(frozen=True, slots=True)
class FlightChunk:
    """A part of the flights with its own random numbers, so results do not depend on the process and order."""

    flights: int
    seed: np.random.SeedSequence
    first: int = 0
    """Number of its first flight."""


@dataclass(frozen=True, slots=True)
class ChunkTally:
    """Counts of a chunk for one mean time between failures."""

    flights: int
    finished: tuple[int, ...]
    """Flights that inspected everything with at most 0, 1, ... re-plans."""
    undone_m: tuple[float, ...]
    """Metres left uninspected in all flights together, with at most 0, 1, ... re-plans."""
    losses: tuple[int, ...]
    """Flights with 0, 1, ... losses, re-planned as often as allowed."""
    failures: tuple[tuple[int, ...], ...]
    """For each vehicle and each part of the longest route's duration, flights in which its loss was not repaired."""


@dataclass(frozen=True, slots=True)
class WorstLoss(CriticalLoss):
    """The vehicle and the time whose losses are most often not repaired.

    Losses after the longest route's end count for its last part.
    """

    share: float
    """Share of all failures."""


@dataclass(frozen=True, slots=True)
class RiskEstimate:
    """The estimate for one mean time between failures."""

    mtbf_h: float
    flights: int
    finished: tuple[ProbabilityEstimate, ...]
    """Probability that everything is inspected with at most 0, 1, ... re-plans."""
    undone_m: tuple[float, ...]
    """Expected metres left uninspected with at most 0, 1, ... re-plans."""
    expected_losses: float
    """Expected losses in a flight that is re-planned as often as allowed, as for all fields below."""
    losses_share: tuple[float, float, float]
    """Share of flights with no loss, with one, and with more."""
    blame_share: tuple[float, ...]
    """For each vehicle, the share of failures in which its loss was the one that was not repaired."""
    worst: WorstLoss | None
    """The most frequent failure; None without a failure."""


def build_risk_campaign(
    instance: Instance,
    plan: Plan,
    *,
    mtbf_h: Sequence[float],
    battery_spread_pct: float = 0.0,
    reserve_pct: float = RESERVE_PCT,
    max_losses: int = 2,
    effort: int = EFFORT,
    fly_again: bool = True,
) -> RiskCampaign:
    """Return the settings of all flights; checks every first loss once (``planner.iterate_losses``).

    Raises:
        InstanceError: a figure is out of its range.
        PlanError: the plan does not match the instance, or does not inspect everything within its budgets.
    """
    if not mtbf_h or not all(math.isfinite(hours) and hours > 0 for hours in mtbf_h):
        raise InstanceError(f"mean time between failures is {list(mtbf_h)} h, expected more than zero")
    if not (math.isfinite(battery_spread_pct) and battery_spread_pct >= 0):
        raise InstanceError(f"battery spread is {battery_spread_pct} %, expected zero or more")
    if not (math.isfinite(reserve_pct) and reserve_pct >= 0):
        raise InstanceError(f"reserve is {reserve_pct} %, expected zero or more")
    if max_losses < 0:
        raise InstanceError(f"max_losses is {max_losses}, expected zero or more")
    for violation in evaluate(instance, plan, Cost.MINMAX).violations:
        raise PlanError(f"the plan does not hold: {violation}")
    if plan.uncovered:
        raise PlanError(f"the plan leaves out {len(plan.uncovered)} segments, expected one that inspects everything")
    losses = len(plan.routes) > 1 and max_losses > 0
    table = tuple(iterate_losses(instance, plan, effort=effort, fly_again=fly_again)) if losses else ()
    return RiskCampaign(
        instance, plan, table, tuple(mtbf_h), battery_spread_pct, reserve_pct, max_losses, effort, fly_again
    )  # fmt: skip


def split_flights(flights: int, seed: int, *, per_chunk: int = FLIGHTS_PER_CHUNK) -> tuple[FlightChunk, ...]:
    """Return ``flights`` in chunks, each with its own seed.

    Raises:
        InstanceError: there are no flights.
    """
    if flights < 1:
        raise InstanceError(f"flights is {flights}, expected one or more")
    firsts = range(0, flights, per_chunk)
    seeds = np.random.SeedSequence(seed).spawn(len(firsts))
    return tuple(
        FlightChunk(min(per_chunk, flights - first), own, first) for first, own in zip(firsts, seeds, strict=True)
    )


def simulate_chunk(campaign: RiskCampaign, chunk: FlightChunk) -> tuple[ChunkTally, ...]:
    """Return the counts of a chunk for each ``campaign.mtbf_h``; they do not depend on the process that runs it."""
    log = _FlightLog.draw(campaign, chunk)
    state = build_state_before_losses(campaign.instance, campaign.plan)
    everybody = np.arange(len(log.life_s))
    _simulate_group(
        campaign, log, _FlightGroup(state, everybody, np.zeros(len(everybody)), at_s=0.0, replans=0, losses=0)
    )
    return tuple(
        _count_flights(campaign, log, slice(first, first + chunk.flights))
        for first in range(0, len(everybody), chunk.flights)
    )  # fmt: skip


def estimate_risks(campaign: RiskCampaign, tallies: Sequence[Sequence[ChunkTally]]) -> tuple[RiskEstimate, ...]:
    """Return the estimates for each ``campaign.mtbf_h`` from the tallies of all chunks, in the chunks' order."""
    return tuple(
        _estimate_risk(campaign, hours, [tally[number] for tally in tallies])
        for number, hours in enumerate(campaign.mtbf_h)
    )


def estimate_coverage(
    instance: Instance, plan: Plan, mtbf_h: float, *, flights: int, seed: int, fly_again: bool, effort: int = EFFORT
) -> RiskEstimate:
    """Return the estimate of ``faultline risk`` with its default settings, flown in this process.

    Raises:
        InstanceError, PlanError: as for ``build_risk_campaign`` and ``split_flights``.
    """
    campaign = build_risk_campaign(instance, plan, mtbf_h=(mtbf_h,), effort=effort, fly_again=fly_again)
    (found,) = estimate_risks(campaign, [simulate_chunk(campaign, chunk) for chunk in split_flights(flights, seed)])
    return found


def estimate_probability(successes: int, flights: int) -> ProbabilityEstimate:
    """Return a share with its 95 % interval (Wilson 1927), which is also valid for shares near 0 and 1.

    >>> estimate_probability(10, 10).low
    0.7224672001371107
    """
    share, square = successes / flights, Z_95 * Z_95 / flights
    middle = (share + square / 2) / (1 + square)
    half = Z_95 / (1 + square) * math.sqrt(share * (1 - share) / flights + square / (4 * flights))
    return ProbabilityEstimate(share, max(0.0, min(share, middle - half)), min(1.0, max(share, middle + half)))


@dataclass(frozen=True, slots=True, eq=False)
class _FlightLog:
    """Random numbers and outcome of each flight; those of one mean time between failures are stored together."""

    life_s: FloatArray
    """(flights, k): flight seconds after which a vehicle fails."""
    charge_pct: FloatArray
    """(flights, k): planned energy after which its battery is empty."""
    undone: IntArray
    """(flights, max_losses + 1): segments left, with at most 0, 1, ... re-plans, as the next two."""
    undone_m: FloatArray
    losses: IntArray
    culprit: IntArray
    """(flights,): the vehicle whose loss was not repaired, -1 for none."""
    culprit_s: FloatArray

    @staticmethod
    def draw(campaign: RiskCampaign, chunk: FlightChunk) -> _FlightLog:
        chance = np.random.default_rng(chunk.seed)
        shape, values = (chunk.flights, len(campaign.plan.routes)), len(campaign.mtbf_h)
        life = chance.standard_exponential(shape)
        # Factors on consumption, normal about 1; drawn again if not positive.
        spread = campaign.battery_spread_pct / 100.0
        factor = chance.normal(1.0, spread, shape)
        while np.any(wrong := factor <= 0):
            factor[wrong] = chance.normal(1.0, spread, int(wrong.sum()))
        charge = np.array([vehicle.budget_pct for vehicle in campaign.instance.vehicles]) + campaign.reserve_pct
        total, policies = values * chunk.flights, campaign.max_losses + 1
        return _FlightLog(
            life_s=np.concatenate([3600.0 * hours * life for hours in campaign.mtbf_h]),
            charge_pct=np.tile(charge / factor, (values, 1)),
            undone=np.zeros((total, policies), dtype=np.int64),
            undone_m=np.zeros((total, policies)),
            losses=np.zeros((total, policies), dtype=np.int64),
            culprit=np.full(total, -1, dtype=np.int64),
            culprit_s=np.zeros(total),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _FlightGroup:
    """Flights that have reached the same state."""

    state: FleetAfterLosses
    who: IntArray
    """(m,): their rows in the log."""
    since_s: FloatArray
    """(m,): time at which each reached it."""
    at_s: float
    """Time of the state's plan: the beginning of the interval that holds all of ``since_s``."""
    replans: int
    losses: int
    """Number of losses so far in each of them."""


def _simulate_group(campaign: RiskCampaign, log: _FlightLog, group: _FlightGroup) -> None:
    """Record the outcome of a group's flights, and continue those that are re-planned."""
    lost_s, undone, undone_m = _predict_outcome(log, group)
    log.undone[group.who, group.replans :] = undone.sum(axis=1)[:, np.newaxis]
    log.undone_m[group.who, group.replans :] = undone_m.sum(axis=1)[:, np.newaxis]
    log.losses[group.who, group.replans :] = group.losses + np.isfinite(lost_s).sum(axis=1)[:, np.newaxis]
    broken = np.flatnonzero(undone.sum(axis=1) > 0)
    if len(broken) == 0:
        return
    lost_s, undone = lost_s[broken], undone[broken]
    # The first loss that leaves something; vehicles lost before it had nothing left to inspect.
    culprit = np.where(undone > 0, lost_s, np.inf).argmin(axis=1)
    at_s = lost_s[np.arange(len(broken)), culprit]
    who = group.who[broken]
    log.culprit[who] = np.array(group.state.fleet)[culprit]
    log.culprit_s[who] = at_s
    if group.replans == campaign.max_losses:
        return
    for rows, vehicle, interval_s, gone in _group_equal_losses(group.state, culprit, at_s, lost_s):
        since_s = max(interval_s, group.at_s)
        after = _apply_repair(campaign, group, vehicle, since_s, gone)
        if after is not None:
            log.culprit[who[rows]] = -1
            losses = group.losses + 1 + len(gone)
            _simulate_group(
                campaign, log, _FlightGroup(after, who[rows], at_s[rows], since_s, group.replans + 1, losses)
            )


def _predict_outcome(log: _FlightLog, group: _FlightGroup) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return the outcome of a group's flights without further re-plans: (m, vehicles of the state) each.

    Loss time of each vehicle, infinite without a loss; segments that its loss leaves; their metres.
    """
    state, shape = group.state, (len(group.who), len(group.state.fleet))
    lost_s, undone, undone_m = np.full(shape, np.inf), np.zeros(shape, dtype=np.int64), np.zeros(shape)
    for vehicle, number in enumerate(state.fleet):
        flown, ends_s = state.progress_of(vehicle), state.visit_ends_s(vehicle)
        fails_s = _crossing_times_s(log.life_s[group.who, number], flown.airborne_s, flown.time_s)
        empty_s = _crossing_times_s(log.charge_pct[group.who, number], flown.used_pct, flown.time_s)
        # A re-plan may launch it within the interval of the loss, slightly before the loss itself.
        lost_s[:, vehicle] = np.maximum(group.since_s, np.minimum(fails_s, empty_s))
        done = np.searchsorted(ends_s, lost_s[:, vehicle] + SAME_TIME_S, side="right")
        undone[:, vehicle] = len(ends_s) - done
        undone_m[:, vehicle] = np.append(np.cumsum(state.visit_values(vehicle)[::-1])[::-1], 0.0)[done]
    return lost_s, undone, undone_m


def _crossing_times_s(level: FloatArray, column: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return when an ascending column reaches each level, infinite if it does not."""
    return np.where(level < column[-1], np.interp(level, column, time_s), np.inf)


def _group_equal_losses(
    state: FleetAfterLosses, culprit: IntArray, at_s: FloatArray, lost_s: FloatArray
) -> Iterator[tuple[IntArray, int, float, tuple[int, ...]]]:
    """Yield flights that share a re-plan: their rows, the lost vehicle, the interval's start, vehicles lost before."""
    events = np.array(event_times_s(state.instance, state.plan))
    interval = np.searchsorted(events, at_s + SAME_TIME_S, side="right") - 1
    gone = lost_s < at_s[:, np.newaxis]
    kinds, kind_of = np.unique(np.column_stack([culprit, interval, gone]), axis=0, return_inverse=True)
    order = np.argsort(kind_of.ravel(), kind="stable")
    bounds = np.searchsorted(kind_of.ravel()[order], np.arange(len(kinds) + 1))
    for number, kind in enumerate(kinds):
        rows = order[bounds[number] : bounds[number + 1]]
        yield rows, int(kind[0]), float(events[kind[1]]), tuple(int(one) for one in np.flatnonzero(kind[2:]))


def _apply_repair(
    campaign: RiskCampaign, group: _FlightGroup, vehicle: int, at_s: float, gone: tuple[int, ...]
) -> FleetAfterLosses | None:
    """Return the state after a loss that a re-plan repairs, None if there is no repair."""
    state = group.state
    if group.replans == 0 and not gone:
        plan = next((row.plan for row in campaign.table if (row.vehicle, row.from_s) == (vehicle, at_s)), None)
        if plan is None:
            return None
        left = build_remaining_problem(campaign.instance, campaign.plan, vehicle, at_s, fly_again=campaign.fly_again)
        return state.apply_plan(left, plan)
    if gone:
        vehicle -= sum(one < vehicle for one in gone)
        # The vehicles lost before have nothing left to inspect.
        kept = [one for one in range(len(state.fleet)) if one not in gone]
        state = state.drop_vehicles(kept)
    answer = repair_plan(state, vehicle, at_s, effort=campaign.effort, fly_again=campaign.fly_again)
    return None if answer is None else state.apply_plan(*answer)


def _count_flights(campaign: RiskCampaign, log: _FlightLog, rows: slice) -> ChunkTally:
    fleet, longest_s = len(campaign.plan.routes), _longest_s(campaign)
    failed = log.culprit[rows] >= 0
    culprit, culprit_s = log.culprit[rows][failed], log.culprit_s[rows][failed]
    part = np.minimum(TIME_BINS * culprit_s / longest_s, TIME_BINS - 1).astype(np.int64)
    failures = np.bincount(culprit * TIME_BINS + part, minlength=fleet * TIME_BINS).reshape(fleet, TIME_BINS)
    finished = np.sum(log.undone[rows] == 0, axis=0)
    return ChunkTally(
        flights=len(log.culprit[rows]),
        finished=tuple(int(count) for count in finished),
        undone_m=tuple(float(metres) for metres in log.undone_m[rows].sum(axis=0)),
        losses=tuple(int(count) for count in np.bincount(log.losses[rows, -1], minlength=fleet + 1)),
        failures=tuple(tuple(int(count) for count in row) for row in failures),
    )


def _estimate_risk(campaign: RiskCampaign, mtbf_h: float, tallies: Sequence[ChunkTally]) -> RiskEstimate:
    flights = sum(tally.flights for tally in tallies)
    finished = np.sum([tally.finished for tally in tallies], axis=0)
    undone_m = np.sum([tally.undone_m for tally in tallies], axis=0) / flights
    losses = np.sum([tally.losses for tally in tallies], axis=0)
    failures = np.sum([tally.failures for tally in tallies], axis=0)
    failed = int(failures.sum())
    more = flights - int(losses[:2].sum())
    return RiskEstimate(
        mtbf_h=mtbf_h,
        flights=flights,
        finished=tuple(estimate_probability(int(count), flights) for count in finished),
        undone_m=tuple(float(metres) for metres in undone_m),
        expected_losses=float(losses @ np.arange(len(losses))) / flights,
        losses_share=(float(losses[0]) / flights, float(losses[1]) / flights, more / flights),
        blame_share=tuple(float(count) / max(1, failed) for count in failures.sum(axis=1)),
        worst=_find_worst_loss(failures, _longest_s(campaign)),
    )


def _find_worst_loss(failures: IntArray, longest_s: float) -> WorstLoss | None:
    if not failures.any():
        return None
    vehicle, part = (int(place) for place in np.unravel_index(failures.argmax(), failures.shape))
    step_s = longest_s / TIME_BINS
    return WorstLoss(vehicle, part * step_s, (part + 1) * step_s, float(failures[vehicle, part] / failures.sum()))


def _longest_s(campaign: RiskCampaign) -> float:
    return event_times_s(campaign.instance, campaign.plan)[-1]


def repair_plan(
    state: FleetAfterLosses, lost: int, at_s: float, *, effort: int, fly_again: bool = True
) -> tuple[RemainingProblem, Plan] | None:
    """Return the problem after the loss of a vehicle and a plan for it; None if none was found.

    The same arguments give the same plan.

    Args:
        state: the state in which the vehicle is lost.
        lost: its number in ``state``.
        at_s: time of the loss, since the launch of the fleet.
        effort: maximum number of iterations.
        fly_again: whether vehicles that are on the ground or returning may fly (again).
    """
    if len(state.fleet) == 1:
        return None
    left = build_remaining_problem(state.instance, state.plan, lost, at_s, fly_again=fly_again)
    result = replan(left.instance, warm=left.warm, stop=combine_stop_rules(FirstFeasible(), Iterations(effort)))
    return (left, result.plan) if result.feasible else None
