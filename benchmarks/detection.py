"""`faultline bench detection`: detection quality of the watchpoints on hundreds of modelled flights."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from benchmarks.few_lines_detector import FewLines
from benchmarks.flightmodel import Injected, ModelledFlight, ModelledSite, fly_modelled, model_site
from executor.adapters.interrupts import start_worker_pool
from executor.core.fault_thresholds import Limits
from executor.core.inflight.faults import passive_watch
from executor.core.inflight.faults.passive_watch import DeclaredFault, PassiveWatch
from executor.core.interface.events import Heard, Tick
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import Assignment
from executor.core.state.vehicle_state import FaultKind, VehicleState
from planner.risk import ProbabilityEstimate, estimate_probability

TICK_S = 0.5
KINDS = ("step", "drain", "cell", "silent")
AUTOPILOTS = ("ardupilot", "px4")
DRAINS = ((1.3, 1.7), (1.7, 2.5), (2.5, 4.0))
"""Multiples of the normal consumption, from mild to severe."""
MARGIN_S = 1.0
"""Margin around the time-out in which a silence may be declared or not."""


@dataclass(frozen=True, slots=True)
class Detected:
    """One judged flight."""

    injected: Injected
    autopilot: str
    lasted_s: float
    declared: FaultKind | None
    reason: str
    """The watchpoint, and its evidence."""
    at_s: float | None
    false: bool
    """Declared without a fault, or as another kind."""
    wanted: bool
    """Whether a declaration was due."""
    breaks: bool
    """Whether the fault would have broken the reserve, and RTL was possible when it began."""
    in_time: bool
    """Declared while RTL was still possible."""
    extra_pct: float
    """Consumption above normal until the declaration."""


def poisson_interval(count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a Poisson mean (Garwood), by bisection on its sums."""

    def tail(mean: float, upto: int) -> float:
        term = total = math.exp(-mean)
        for k in range(1, upto + 1):
            term *= mean / k
            total += term
        return total

    def solve(upto: int, wanted: float) -> float:
        low, high = 0.0, 10.0 * count + 20.0
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if tail(middle, upto) > wanted else (low, middle)
        return low

    return (solve(count - 1, 0.975) if count else 0.0), solve(count, 0.025)


@lru_cache(maxsize=2)
def _site(autopilot: str) -> ModelledSite:
    return model_site(autopilot)


def judge_flight(
    site: ModelledSite, flight: ModelledFlight, limits: Limits | None = None, *, few_lines: bool = False
) -> Detected:
    """Feed a flight to the watchpoints, or to the simple detector, and judge their declarations."""
    name = site.drones[flight.vehicle]
    context = site.context if limits is None else replace(site.context, limits=limits)
    known = FleetState(
        MappingProxyType({name: VehicleState(name, assignment=Assignment(board=site.boards[flight.vehicle]))})
    )
    state, simple = PassiveWatch(known), FewLines()
    first: tuple[float, FaultKind, str] | None = None
    next_s = 0.0
    end_s = flight.lasted_s + 5.0
    for at_s, message in (*flight.heard, (end_s, None)):
        while next_s < at_s and first is None:
            if few_lines:
                said = simple.find_fault(next_s)
                first = None if said is None else (next_s, said, "few lines")
            else:
                state, found = passive_watch.step_watch(context, state, Tick(), next_s)
                declared = next((one for one in found if isinstance(one, DeclaredFault)), None)
                first = None if declared is None else (next_s, declared.kind, f"{declared.reason}: {declared.evidence}")
            next_s += TICK_S
        if first is not None or message is None:
            break
        if few_lines:
            simple.take(message, at_s)
        else:
            state, _ = passive_watch.step_watch(context, state, Heard(name, message), at_s)
    return _outcome(site, flight, first)


def _outcome(site: ModelledSite, flight: ModelledFlight, first: tuple[float, FaultKind, str] | None) -> Detected:
    name, fault = site.drones[flight.vehicle], flight.injected
    reserve = site.context.vehicles[name].reserve_pct
    timeout_s = site.context.vehicles[name].link_timeout_s
    breaks_it = flight.remaining_pct[-1] < reserve
    # The autopilot's own percentage is the best available value, and its failsafes use it too.
    lands_low = breaks_it or flight.reported_pct < reserve
    wanted = fault.kind is FaultKind.BATTERY or (fault.kind is FaultKind.LINK and fault.size > timeout_s + MARGIN_S)
    if fault.kind is FaultKind.LINK and flight.lasted_s - fault.at_s < timeout_s + MARGIN_S:
        wanted = False  # it lands before
    onset = min(len(flight.remaining_pct) - 1, int(fault.at_s)) if fault.kind is not None else 0
    # Includes the consumption from then on, which the next second shows.
    after = min(len(flight.home_pct) - 1, onset + 1)
    could = flight.remaining_pct[after] > flight.home_pct[after]
    breaks = fault.kind is FaultKind.BATTERY and fault.what != "cell" and breaks_it and could
    if first is None:
        return Detected(fault, flight.autopilot, flight.lasted_s, None, "", None, False, wanted, breaks, False, 0.0)
    at_s, kind, reason = first
    second = min(len(flight.remaining_pct) - 1, int(at_s))
    early = at_s < fault.at_s
    # A worn pack in strong wind may break the reserve without a fault: declaring that is no false alarm.
    right = (lands_low and kind is FaultKind.BATTERY) if early else kind is fault.kind
    if not early and fault.kind is FaultKind.LINK and fault.size < timeout_s - MARGIN_S:
        right = lands_low and kind is FaultKind.BATTERY
    in_time = flight.remaining_pct[second] > flight.home_pct[second]
    extra = sum(flight.rate_pct_s[onset:second]) * (1 - 1 / fault.size) if fault.what == "drain" and not early else 0.0
    return Detected(fault, flight.autopilot, flight.lasted_s, kind, reason, at_s, not right, wanted, breaks,
                   in_time and right, extra)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Job:
    """Some flights of one kind."""

    what: str
    numbers: tuple[int, ...]
    seed: int


@dataclass(frozen=True, slots=True)
class Pair:
    """One flight, judged by both detectors."""

    watchpoints: Detected
    few_lines: Detected


def fly_job(job: Job) -> list[Pair]:
    """Fly and judge a job; the same seed and number always give the same flight."""
    found = []
    for number in job.numbers:
        rng = np.random.default_rng([job.seed, number, ("healthy", *KINDS).index(job.what)])
        autopilot = AUTOPILOTS[number % len(AUTOPILOTS)]
        site = _site(autopilot)
        flight = fly_modelled(site, autopilot, job.what, rng)
        found.append(Pair(judge_flight(site, flight), judge_flight(site, flight, few_lines=True)))
    return found


def campaign(
    healthy: int, faulty: int, seed: int, jobs: int, told: Callable[[int, int], None] = lambda *_: None
) -> list[Pair]:
    """Fly a campaign: ``healthy`` healthy flights, and ``faulty`` with each kind of fault."""
    share = 10
    work = [
        Job(what, tuple(range(begin, min(begin + share, count))), seed)
        for what, count in (("healthy", healthy), *((what, faulty) for what in KINDS))
        for begin in range(0, count, share)
    ]
    found: list[Pair] = []
    if jobs <= 1:
        for number, job in enumerate(work):
            found += fly_job(job)
            told(number + 1, len(work))
        return found
    with start_worker_pool(jobs) as pool:
        for number, outcomes in enumerate(pool.map(fly_job, work)):
            found += outcomes
            told(number + 1, len(work))
    return found


def detection_summary(outcomes: Sequence[Detected]) -> dict[str, object]:
    """Return the figures of a campaign as JSON."""
    hours = sum(one.lasted_s for one in outcomes) / 3600
    false = [one for one in outcomes if one.false]
    low, high = poisson_interval(len(false))
    breaking = [one for one in outcomes if one.breaks]
    in_time = sum(one.in_time for one in breaking)
    return {
        "flights": len(outcomes),
        "flight_hours": round(hours, 2),
        "false_alarms": len(false),
        "false_alarms_per_50_h": round(50 * len(false) / hours, 3) if hours else None,
        "false_alarms_per_50_h_95": [round(50 * low / hours, 3), round(50 * high / hours, 3)] if hours else None,
        "false_reasons": sorted({f"{_name(one)} ({one.injected.what}, {one.autopilot})" for one in false}),
        "would_break_reserve": {"of": len(breaking), "in_time": in_time, **_rate(in_time, len(breaking))},
        "kinds": {what: _kind([one for one in outcomes if one.injected.what == what]) for what in KINDS},
        "drains": {
            f"{low:g} to {high:g}": _kind(
                [one for one in outcomes if one.injected.what == "drain" and low <= one.injected.size < high]
            )
            for low, high in DRAINS
        },
    }


def _name(outcome: Detected) -> str:
    """Return the watchpoint without its evidence."""
    return outcome.reason.partition(":")[0]


def _rate(hits: int, of: int) -> dict[str, object]:
    """Return a rate with its 95 % interval; 0 to 1 without samples."""
    found = estimate_probability(hits, of) if of else ProbabilityEstimate(0.0, 0.0, 1.0)
    return {"rate": round(found.estimate, 4), "rate_95": [round(found.low, 4), round(found.high, 4)]}


def _kind(outcomes: Sequence[Detected]) -> dict[str, object]:
    due = [one for one in outcomes if one.wanted]
    found = [one for one in due if one.declared is not None and not one.false and one.at_s is not None]
    delays = [one.at_s - one.injected.at_s for one in found if one.at_s is not None]
    extra = [one.extra_pct for one in found]
    reasons = sorted({_name(one) for one in found})
    breaking = [one for one in outcomes if one.breaks]
    return {
        "due": len(due),
        "would_break_reserve": len(breaking),
        "in_time": sum(one.in_time for one in breaking),
        "declared": len(found),
        **_rate(len(found), len(due)),
        "delay_s_median": round(float(np.median(delays)), 2) if delays else None,
        "delay_s_95": round(float(np.quantile(delays, 0.95)), 2) if delays else None,
        "extra_pct_95": round(float(np.quantile(extra, 0.95)), 2) if extra else None,
        "reasons": {reason: sum(_name(one) == reason for one in found) for reason in reasons},
    }
