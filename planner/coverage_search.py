"""The search behind ``solve_coverage``: walks on sampled losses, then a choice by flights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.errors import PlanError
from planner.evaluate import Cost, Result, evaluate
from planner.kernels.repair import SAME_TIME_S, try_loss
from planner.kernels.robust_walk import WalkLimits
from planner.model import Instance, Plan
from planner.params import SearchParams
from planner.plan_search import build_plan
from planner.risk import estimate_coverage
from planner.robust_search import FoundPlan, RobustSearch, Walker, plan_from_routes
from planner.stop_rules import Iterations, StopRule, Stopwatch, combine_stop_rules

SEARCH_SEED = 1_000_003
"""Added to the seed for the flights of the search, which must not be those of the final estimate."""


class CoverageSearch(RobustSearch):
    """One search; call only ``run_all``. Its plans are ranked by the probability of a first loss without a re-plan."""

    def __init__(  # noqa: PLR0913 - as solve_coverage
        self,
        instance: Instance,
        stop: StopRule,
        watch: Stopwatch,
        *,
        seed: int,
        all_vehicles: bool,
        starts: int,
        fly_again: bool,
        params: SearchParams,
        mtbf_h: float,
    ) -> None:
        self._coverage = params.coverage
        first = replace(params.window, finalists=1, minmax_searches=1, other_searches=params.coverage.other_searches)
        self._windows = RobustSearch(
            instance, combine_stop_rules(Iterations(params.coverage.window_iterations), stop), watch, seed=seed,
            all_vehicles=all_vehicles, starts=starts, fly_again=fly_again,
            params=replace(params, window=first),
        )  # fmt: skip
        same = ("probes", "cycle", "follow", "ways")
        own = replace(params.window, **{name: getattr(params.coverage, name) for name in same})
        super().__init__(
            instance, stop, watch, seed=seed, all_vehicles=all_vehicles, starts=starts, fly_again=fly_again,
            params=replace(params, window=own),
        )  # fmt: skip
        self._mtbf_h = mtbf_h
        self._cap_s = math.inf

    def run_all(self, initial: Sequence[Plan]) -> Result:
        """Find initial plans, walk from them until the stop rule ends the search, and choose by flights."""
        first = self._windows.run(stretch=math.inf, longest_s=None, initial=initial)
        self._iterations = first.iterations
        known = sorted(self._windows.archive, key=lambda found: found.earliest_s)[: self._coverage.initial]
        if not known:
            raise PlanError("no plan found inspects everything within the budgets")
        for found in known:
            self._place_walker(self._looker, found.routes)
            self._archive_found(FoundPlan(found.routes, self._estimate_failure(self._looker), found.longest_s))
        best = min(self.archive, key=lambda found: found.earliest_s)
        self._walkers = [self._build_walker(self._seed + 2_000 + number, best) for number in range(self._starts)]
        reason = self._run_rounds(self._allow_walk)
        plan = self._choose_by_flights()
        return Result(
            plan=plan,
            evaluation=evaluate(self._instance, plan, Cost.MINMAX),
            feasible=True,
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=reason,
        )

    def _walk(self, walker: Walker, iterations: int) -> None:
        while iterations > 0:
            iterations -= self._anneal(walker, iterations)
            if walker.left <= 0 or walker.here.lacks.sum() <= 0:
                routes = tuple(route.visits for route in build_plan(walker.here.base).routes)
                longest_s = float(walker.here.clock.durations_s.max())
                walker.found.append(FoundPlan(routes, self._estimate_failure(walker), longest_s))
                iterations -= self._params.whole_look
                walker.left = 0
                walker.cycles += 1

    def _gather(self, walkers: Sequence[Walker]) -> None:
        super()._gather(walkers)
        elite = sorted(self.archive, key=lambda found: found.earliest_s)[: self._params.elite]
        for number, walker in enumerate(walkers):
            walker.start = elite[(number + walker.cycles) % len(elite)]

    def _aim(self, walker: Walker) -> None:
        """Sample the times of the first losses, and begin to cool."""
        probes, latest_s = len(walker.probes_s), float(walker.here.clock.durations_s.max())
        rate = len(walker.here.base.lengths) / (3600.0 * self._mtbf_h)
        # Systematic sample: another offset for each cycle, with even steps between the quantiles.
        offset = (walker.cycles * (math.sqrt(5.0) - 1.0) / 2.0) % 1.0
        share = (np.arange(probes) + offset) / probes * -math.expm1(-rate * latest_s)
        walker.probes_s[:] = -np.log1p(-share) / rate
        walker.left = walker.length
        self._assess(walker)
        walker.temperature[0] = self._start_temperature(walker) * self._transit_pct(walker.here.base)

    def _build_limits(self, walker: Walker) -> WalkLimits:
        segment_pct = self._transit_pct(walker.here.base)
        base_pct, most_pct = self._coverage.base * segment_pct, self._coverage.most * segment_pct
        return super()._build_limits(walker)._replace(base_pct=base_pct, most_pct=most_pct)

    def _estimate_failure(self, walker: Walker) -> float:
        """Return the probability that a vehicle fails whose loss, the first of the flight, has no re-plan found."""
        base, clock = walker.here.base, walker.here.clock
        events_s = self._list_events_s(walker)
        # Nobody has failed by then.
        alive = np.exp(-np.minimum(events_s[:, np.newaxis], clock.durations_s).sum(axis=1) / (3600.0 * self._mtbf_h))
        walker.full.known[:] = 0
        failure = 0.0
        for interval in range(len(events_s) - 2, -1, -1):
            at_s = float(events_s[interval])
            flying = np.flatnonzero(clock.durations_s > at_s + SAME_TIME_S)
            for lost in flying:
                lacks = try_loss(
                    self._problem, self._timing, base, clock, int(lost), at_s, self._fly_again, walker.loss,
                    walker.full, walker.desk, self._coverage.look, walker.rng,
                )  # fmt: skip
                if lacks > 0.0:
                    failure += float(alive[interval] - alive[interval + 1]) / len(flying)
        return failure

    def _choose_by_flights(self) -> Plan:
        """Return the plan that most of the same flights finish; of equals the one that leaves least."""
        best = sorted(self.archive, key=lambda found: found.earliest_s)[: self._coverage.finalists]
        plans = [plan_from_routes(found.routes) for found in best]

        def rank(plan: Plan) -> tuple[float, float]:
            chance = estimate_coverage(
                self._instance, plan, self._mtbf_h, flights=self._coverage.flights, seed=self._seed + SEARCH_SEED,
                fly_again=self._fly_again, effort=self._coverage.look,
            )  # fmt: skip
            return -chance.finished[-1].estimate, chance.undone_m[-1]

        return min(dict.fromkeys(plans), key=rank)
