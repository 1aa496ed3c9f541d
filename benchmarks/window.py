"""`faultline bench window`: fly to check whether a plan keeps the claim of its re-plan window.

A plan is chosen for its window; then vehicles are lost at random times after the claimed one, and each flight runs in
virtual time to its end. It has kept the claim if everything was inspected and every other vehicle stands on its pad
with the reserve still in the battery.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.branches import Branch, fly_branches
from benchmarks.errors import BenchError
from benchmarks.store import Json
from benchmarks.virtual_flight import VirtualFlight
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site, size_batteries, with_budgets, with_capacity
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest, plan_site
from missions import PlanFile
from planner import Cost

KINDS = ("crash", "silent")
BUDGET_PCT = 28.0
"""Share of a full battery, as for the paper's fleet, where whole percents matter."""
HOME_M = 5.0
"""Distance within which a vehicle stands on its pad."""
FIRST_S = 10.0
"""Earliest loss: by then every vehicle is in flight."""
BEST_SHARE = 0.25
"""Share of the solver's time for the best MinMax plan, which sets the size of the batteries."""


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """The claim, and how it is tested."""

    network: Path | None
    radius_m: float | None
    autopilot: str
    vehicles: int = 4
    tightness: float = 0.85
    """Share of the budget that the best MinMax plan's most expensive route uses."""
    budget_pct: float = BUDGET_PCT
    seconds: float = 20.0
    """Solver time for the plan."""
    seed: int = 1
    starts: int = 0
    """Parallel searches."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A plan and its claim."""

    ground: SiteModel
    plan: PlanFile
    earliest_s: float
    longest_s: float


@dataclass(frozen=True, slots=True)
class RandomLoss:
    """Loss of one vehicle."""

    number: int
    vehicle: str
    kind: str
    at_s: float
    """Time since it began its mission."""

    @property
    def spec(self) -> str:
        """Fault as for ``--fault``."""
        return f"{self.vehicle}:{self.kind}@{self.at_s:g}s"


@dataclass(frozen=True, slots=True)
class LossOutcome:
    """Result of one flight."""

    loss: RandomLoss
    finished: bool
    """Everything inspected, and every other vehicle on its pad above the reserve."""
    wrong: tuple[str, ...]
    """Reasons if it is not."""
    uncovered: tuple[int, ...]
    """Ids of the segments that its report names as left over."""
    named: bool
    """Whether a re-plan, or a line for the crew, names each of them."""
    least_pct: float
    """Lowest charge of a survivor at landing."""
    flown_s: float


def plan_claim(settings: WindowSettings) -> Claim:
    """Plan for the largest window, with batteries sized for the requested tightness of budgets.

    Raises:
        MissionsError: the network cannot be used.
        BenchError: no plan covers everything, or the plan claims no window.
    """
    ground = with_budgets(
        build_virtual_site(settings.network, settings.radius_m, settings.vehicles, settings.autopilot),
        settings.budget_pct,
    )
    ample = with_capacity(ground, AMPLE_AH)
    wanted = PlanRequest(
        Cost.MINMAX, BEST_SHARE * settings.seconds, settings.seed, all_vehicles=True, starts=settings.starts
    )
    best = plan_site(ample, wanted)
    ground = size_batteries(ground, best, settings.tightness * settings.budget_pct)
    plan = plan_site(ground, replace(wanted, cost=None, seconds=settings.seconds))
    if plan.plan.uncovered or plan.window is None or plan.window.earliest_s >= plan.window.longest_route_s:
        left = len(plan.plan.uncovered)
        what = f"{left} segments are left over" if left else "it has none"
        raise BenchError(f"--tightness {settings.tightness:g}: expected a plan with a re-plan window, but {what}")
    return Claim(ground, plan, plan.window.earliest_s, plan.window.longest_route_s)


def losses(claim: Claim, count: int, seed: int, *, before: bool = False) -> list[RandomLoss]:
    """Draw losses of vehicles in flight: after the claimed time, to the end of the longest route, or before it.

    There are none if that interval is empty.
    """
    rng = np.random.default_rng([seed, 23, int(before)])
    low_s, high_s = (FIRST_S, claim.earliest_s) if before else (max(FIRST_S, claim.earliest_s), claim.longest_s)
    drawn: list[RandomLoss] = []
    while len(drawn) < count and low_s < high_s:
        at_s = round(float(rng.uniform(low_s, high_s)), 1)
        flies = [
            vehicle.name for vehicle, ends_s in zip(claim.plan.vehicles, claim.plan.durations_s, strict=True)
            if ends_s > at_s
        ]  # fmt: skip
        if flies:
            drawn.append(RandomLoss(len(drawn), str(rng.choice(flies)), str(rng.choice(KINDS)), at_s))
    return drawn


def fly_losses(claim: Claim, drawn: Sequence[RandomLoss], *, jobs: int = 1, seed: int = 0) -> list[LossOutcome]:
    """Fly each loss reproducibly. The common part, the time before the first loss, is flown once.

    A process that has planned must not call this: it has had threads, and is forked here.
    """
    branches = [Branch(loss.vehicle, loss.at_s, loss.spec) for loss in drawn]
    return fly_branches(
        claim.ground, claim.plan, branches, lambda flight, number: judge_loss(flight, drawn[number]),
        jobs=jobs, seed=seed,
    )  # fmt: skip


def judge_loss(flight: VirtualFlight, loss: RandomLoss) -> LossOutcome:
    """Check a flight against the claim, by the simulator's truth where that is better."""
    report, reserves = flight.report, {name: one.reserve_pct for name, one in flight.context.vehicles.items()}
    survivors = {name: craft for name, craft in flight.crafts.items() if name != loss.vehicle}
    wrong = []
    if report.segments_uncovered:
        wrong.append(f"{len(report.segments_uncovered)} segments not inspected")
    for name, craft in survivors.items():
        if craft.wrecked or craft.armed or craft.from_pad_m > HOME_M:
            wrong.append(f"{name} not at home")
        elif craft.charge_pct < reserves[name]:
            wrong.append(f"{name} landed with {craft.charge_pct:.1f} %, reserve {reserves[name]:g} %")
    if not flight.ended:
        wrong.append("the supervision did not end")
    known = {segment for replan in report.replans for segment in replan.uncovered}
    lines = "\n".join(line.text for _, line in flight.said)
    named = all(
        segment in known or flight.context.segment_name(segment) in lines for segment in report.segments_uncovered
    )
    least_pct = min((craft.charge_pct for craft in survivors.values()), default=0.0)
    return LossOutcome(loss, not wrong, tuple(wrong), report.segments_uncovered, named, least_pct, flight.flown_s)


@dataclass(frozen=True, slots=True)
class Trial:
    """One plan, and the results of its losses."""

    settings: WindowSettings
    claim: Claim
    after: tuple[LossOutcome, ...]
    before: tuple[LossOutcome, ...]


@dataclass(frozen=True, slots=True)
class _Order:
    settings: WindowSettings
    claim: Claim
    drawn: tuple[RandomLoss, ...]
    after: int
    jobs: int


def try_plans(
    plans: Sequence[WindowSettings], after: int, before: int, jobs: int,
    told: Callable[[int, int], None] = lambda *_: None,
) -> list[Trial]:  # fmt: skip
    """Choose plans, and distribute losses evenly over them.

    Args:
        plans: The claims.
        after: Losses after the claimed times, in total.
        before: Losses before them.
        jobs: Parallel processes.
        told: Receives the number of finished plans, and the total.

    Raises:
        MissionsError: the network cannot be used.
        BenchError: one of the plans claims nothing.
    """
    trials = []
    for number, settings in enumerate(plans):
        claim = plan_claim(settings)
        late = losses(claim, _part(after, number, len(plans)), settings.seed + number)
        early = losses(claim, _part(before, number, len(plans)), settings.seed + number, before=True)
        order = _Order(settings, claim, (*late, *early), len(late), jobs)
        # Always in its own process: the forked process must never have had threads.
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            trials.append(pool.submit(_flown, order).result())
        told(number + 1, len(plans))
    return trials


def _part(count: int, number: int, parts: int) -> int:
    return count * (number + 1) // parts - count * number // parts


def _flown(order: _Order) -> Trial:
    found = fly_losses(order.claim, order.drawn, jobs=order.jobs, seed=order.settings.seed)
    return Trial(order.settings, order.claim, tuple(found[: order.after]), tuple(found[order.after :]))


def results(trials: Sequence[Trial]) -> Json:
    """Return the figures."""
    after = [one for trial in trials for one in trial.after]
    before = [one for trial in trials for one in trial.before]
    return {
        "losses_after": len(after),
        "finished_after": sum(one.finished for one in after),
        "least_pct_after": round(min((one.least_pct for one in after), default=0.0), 2) if after else None,
        "losses_before": len(before),
        "finished_before": sum(one.finished for one in before),
        "unnamed_before": sum(not one.finished and not one.named for one in before),
        "flown_s": round(sum(one.flown_s for one in (*after, *before)), 1),
        "plans": [_plan_results(trial) for trial in trials],
    }


def _plan_results(trial: Trial) -> Json:
    claim = trial.claim
    return {
        "segments": len(claim.plan.segments),
        "radius_m": trial.settings.radius_m,
        "tightness": trial.settings.tightness,
        "capacity_ah": claim.ground.drone.capacity_ah,
        "claimed_earliest_s": round(claim.earliest_s, 1),
        "longest_route_s": round(claim.longest_s, 1),
        "losses": [
            {
                "loss": one.loss.spec,
                "after": group is trial.after,
                "finished": one.finished,
                "wrong": list(one.wrong),
                "uncovered": list(one.uncovered),
                "least_pct": round(one.least_pct, 2),
            }
            for group in (trial.after, trial.before)
            for one in group
        ],
    }
