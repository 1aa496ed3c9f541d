"""The search behind ``solve_window``: initial plans, then rounds of walks on the window itself."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from planner.evaluate import Cost, WindowResult, evaluate, rank_window, route_duration_s, route_energy_pct
from planner.fleet_state import merge_times
from planner.kernels.arrays import FloatArray, RandomState, State, allocate
from planner.kernels.repair import Loss, Repairs, RepairWorkspace, find_broken_interval, set_clock
from planner.kernels.robust_walk import (
    RobustWalk,
    WalkLimits,
    anneal_plan,
    assess_repairs,
    take_repairs,
)
from planner.loss_scan import build_empty_repairs, clock_of, list_losses, loss_of, timing_of
from planner.model import Instance, Plan, Route
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.plan_search import build_kernel_problem, build_plan, build_random_state, build_state, copy_state, set_route
from planner.search import Search, run_in_threads
from planner.solve import solve
from planner.stop_rules import Iterations, Progress, StopRule, StopVerdict, Stopwatch, combine_stop_rules
from planner.window import find_broken_loss, replan_window

PAIRS = 40
"""Looks at a plan's whole window that a look at all pairs of losses counts as."""


@dataclass(frozen=True, slots=True)
class FoundPlan:
    """A plan and the start of its window, as far as evaluated."""

    routes: tuple[tuple[int, ...], ...]
    earliest_s: float
    longest_s: float

    @property
    def rank(self) -> tuple[float, float]:
        """Return what plans are chosen by."""
        return rank_window(self.earliest_s, self.longest_s)


@dataclass(slots=True)
class Walker:
    """One walk: its state, aim and random numbers."""

    here: RobustWalk
    there: RobustWalk
    loss: Loss
    desk: RepairWorkspace
    """Work space of repairs."""
    own: RepairWorkspace
    """Work space of the walk."""
    full: Repairs
    """Work space for whole windows."""
    rng: RandomState
    best: FoundPlan
    """The plan that its aim is relative to."""
    start: FoundPlan
    """The plan that its cycles begin from."""
    step: float
    """Distance of the aim below the best, as a share of the longest route."""
    probes_s: FloatArray
    length: int
    """Iterations of a cycle."""
    temperature: FloatArray = field(default_factory=lambda: np.zeros(1))
    left: int = 0
    """Iterations until the cycle ends."""
    cycles: int = 0
    """Number of failed cycles."""
    rounds: int = 0
    """Number of failed rounds of steps."""
    waits: bool = False
    """Whether a failed round has just ended: the walk then waits for a new start."""
    found: list[FoundPlan] = field(default_factory=list)
    """Plans found since they were last gathered."""


class RobustSearch(Search):
    """One search; call only ``run``."""

    def __init__(  # noqa: PLR0913 - problem, search length and start
        self,
        instance: Instance,
        stop: StopRule,
        watch: Stopwatch,
        *,
        seed: int,
        all_vehicles: bool,
        starts: int,
        fly_again: bool,
        losses: int = 1,
        params: SearchParams = DEFAULT_PARAMS,
    ) -> None:
        super().__init__(watch, batch=params.window.batch, starts=max(1, starts))
        self._instance = instance
        self._stop = stop
        self._reason = ""
        self._seed = seed
        self._all_vehicles = all_vehicles
        self._starts = max(1, starts)
        self._fly_again = fly_again
        self._losses = losses
        self._who = list_losses(len(instance.vehicles), losses)
        self._plans_params = params
        self._params = params.window
        self._problem = build_kernel_problem(instance)
        self._timing = timing_of(instance)
        self._cap_s = math.inf
        self._longest_s = 0.0
        self._rate = 0.0
        self._others = 0
        self._walkers: list[Walker] = []
        self.earliest_s = math.inf
        """The earliest window start so far."""
        self._looker = self._build_walker(seed, FoundPlan((), math.inf, math.inf))
        self.archive: list[FoundPlan] = []
        """All complete plans evaluated, and those that were the best when a walk found them."""

    def run(
        self, *, stretch: float, longest_s: float | None, initial: Sequence[Plan], rivals: Sequence[Plan] = ()
    ) -> WindowResult:
        """Find initial plans, then improve them until the stop rule ends the search.

        The result is no worse than any of the ``rivals`` whose longest route is within the limit.
        """
        params = self._params
        plans = [
            self._solve_limited(self._instance, Cost.MINMAX, number, params.minmax_iterations)
            for number in range(params.minmax_searches)
        ]
        plans += initial
        complete = [plan for plan in plans if self._is_complete(plan)]
        if complete:
            shortest_s = min(self._route_s(plan) for plan in complete)
            self._longest_s = shortest_s if longest_s is None else longest_s
            self._cap_s = (1 + stretch) * self._longest_s * (1 + 1e-12)
            # The best MinMax plan gives the energy per second of flight.
            minmax = min(complete, key=self._route_s)
            longest = max(minmax.routes, key=lambda route: route_duration_s(self._instance, route))
            self._rate = route_energy_pct(self._instance, longest) / route_duration_s(self._instance, longest)
            plans += [self._find_other_plan() for _ in range(params.other_searches)]
            for plan in plans:
                self._archive_plan(plan)
        if self.archive:
            elite = sorted(self.archive, key=lambda found: found.rank)
            self._walkers = [
                self._build_walker(self._seed + 1_000 + number, elite[number % len(elite)])
                for number in range(self._starts)
            ]
            self._reason = self._run_rounds(self._allow_walk)
        return self._choose_result(plans, rivals)

    def _ask(self, progress: Progress) -> StopVerdict:
        """Check the stop rule from a search for an initial plan, with all iterations so far."""
        own, known = self._build_progress(), math.isfinite(self.earliest_s)
        verdict = self._stop(replace(
            own, iterations=own.iterations + progress.iterations, impossible=progress.impossible,
            since_improvement=own.since_improvement + progress.iterations if known else 0,
            uncovered=0 if known else progress.uncovered,
        ))  # fmt: skip
        if verdict.allowed <= 0:
            self._reason = verdict.reason
        return verdict

    def _allow_walk(self, progress: Progress) -> StopVerdict:
        """Check the stop rule between rounds of the walks, which all run the same number of iterations."""
        if self.earliest_s <= 0:
            return StopVerdict(0, "full window")
        verdict = self._stop(progress)
        return replace(verdict, allowed=verdict.allowed // self._starts * self._starts)

    def _rate_best(self) -> tuple[float, int, bool]:
        known = math.isfinite(self.earliest_s)
        return self.earliest_s, 0 if known else 1, known

    def _find_other_plan(self) -> Plan:
        """Return the next plan of the other costs, with budgets reduced to the energy of about the allowed length."""
        number, self._others = self._others, self._others + 1
        # Energy and time are not quite proportional: every second pair is a little shorter.
        cap_pct = self._cap_s * self._rate * (1.0 - 0.01 * (number // 2 % 2))
        capped = replace(self._instance, vehicles=tuple(
            replace(vehicle, budget_pct=min(vehicle.budget_pct, cap_pct)) for vehicle in self._instance.vehicles
        ))  # fmt: skip
        return self._solve_limited(
            capped, (Cost.MINCOMB, Cost.MINSUM)[number % 2], number // 2, self._params.other_iterations
        )

    def _solve_limited(self, instance: Instance, cost: Cost, number: int, iterations: int) -> Plan:
        share = min(1.0, instance.segments / self._params.full_effort_from)
        stop = combine_stop_rules(Iterations(int(share * iterations)), self._ask)
        result = solve(
            instance,
            cost=cost,
            stop=stop,
            seed=self._seed + number,
            all_vehicles=self._all_vehicles,
            params=self._plans_params,
        )
        self._iterations += result.iterations
        return result.plan

    def _route_s(self, plan: Plan) -> float:
        return max(route_duration_s(self._instance, route) for route in plan.routes)

    def _is_complete(self, plan: Plan) -> bool:
        if self._all_vehicles and not all(route.visits for route in plan.routes):
            return False
        return not plan.uncovered and not evaluate(self._instance, plan, Cost.MINMAX).violations

    def _archive_plan(self, plan: Plan) -> None:
        """Add a plan to the archive, in its best orientation, if it is valid."""
        if not self._is_complete(plan) or self._route_s(plan) > self._cap_s:
            return
        routes = [route.visits for route in plan.routes]
        used = [vehicle for vehicle, visits in enumerate(routes) if visits]
        choices = itertools.product((False, True), repeat=len(used) if len(used) <= self._params.most_flipped else 0)
        found = [self._evaluate_orientation(routes, dict(zip(used, flipped, strict=False))) for flipped in choices]
        best = min(found, key=lambda one: one.rank)
        if self._losses > 1 and math.isfinite(best.earliest_s):
            self._place_walker(self._looker, best.routes)
            best = replace(best, earliest_s=self._find_window_begin(self._looker, math.inf)[0])
        self._archive_found(best)

    def _evaluate_orientation(self, routes: Sequence[tuple[int, ...]], flipped: Mapping[int, bool]) -> FoundPlan:
        turned = tuple(
            tuple(visit ^ 1 for visit in reversed(visits)) if flipped.get(vehicle, False) else visits
            for vehicle, visits in enumerate(routes)
        )
        looker = self._looker
        self._place_walker(looker, turned)
        base, longest_s = looker.here.base, float(looker.here.clock.durations_s.max())
        if (base.loads > self._problem.budget).any() or longest_s > self._cap_s:
            return FoundPlan(turned, math.inf, longest_s)
        return FoundPlan(turned, self._find_window_begin(looker)[0], longest_s)

    def _archive_found(self, found: FoundPlan) -> None:
        if math.isfinite(found.earliest_s):
            self.archive.append(found)
            if found.earliest_s < self.earliest_s:
                self.earliest_s = found.earliest_s
                self._improved_at = self._iterations

    def _advance(self, iterations: int, threads: Executor | None = None) -> None:
        """Run all walks in parallel."""
        run_in_threads(threads, self._walk, self._walkers, [iterations // self._starts] * self._starts)
        self._iterations += iterations
        self._gather(self._walkers)

    def _gather(self, walkers: Sequence[Walker]) -> None:
        """Collect the plans that the walks have found; restart walks without success from another elite plan."""
        for walker in walkers:
            for found in walker.found:
                self._archive_found(found)
            walker.found.clear()
        waiting = sum(walker.waits for walker in walkers)
        if waiting == 0:
            return
        for _ in range(waiting):
            self._archive_plan(self._find_other_plan())
        elite = sorted(self.archive, key=lambda found: found.rank)[: self._params.elite]
        for walker in walkers:
            if walker.waits:
                walker.best, walker.start = elite[0], elite[walker.rounds % len(elite)]
                walker.waits, walker.left = False, 0

    def _build_walker(self, seed: int, best: FoundPlan) -> Walker:
        fleet = len(self._instance.vehicles)
        base = build_state(self._problem, [()] * fleet)
        desk, own = (allocate(RepairWorkspace, k=fleet, n=self._instance.segments) for _ in range(2))
        return Walker(
            here=self._build_walk(base), there=self._build_walk(copy_state(base)),
            loss=loss_of(self._problem, self._instance.locked, self._who),
            desk=desk, own=own, full=build_empty_repairs(self._problem, len(self._who)),
            rng=build_random_state(seed), best=best, start=best, step=self._params.first_step,
            probes_s=np.full(self._params.probes, -1.0), length=self._params.cycle,
        )  # fmt: skip

    def _build_walk(self, base: State) -> RobustWalk:
        slots = self._params.probes * len(self._who)
        walk = allocate(RobustWalk, losses=slots, k=len(base.lengths), n=len(base.route_of))
        repairs = build_empty_repairs(self._problem, slots)
        return walk._replace(base=base, clock=clock_of(self._problem, self._timing, base), repairs=repairs)

    def _place_walker(self, walker: Walker, routes: Sequence[tuple[int, ...]]) -> None:
        """Set both plans of a walker to given routes, without repairs."""
        for walk_at in (walker.here, walker.there):
            walk_at.base.route_of[:] = -1
            for route, visits in enumerate(routes):
                set_route(self._problem, walk_at.base, route, visits)
                set_clock(self._problem, self._timing, walk_at.base, walk_at.clock, route)
            walk_at.repairs.known[:] = 0

    def _list_events_s(self, walker: Walker) -> FloatArray:
        """Return (e,) float64: the times of ``event_times_s`` for a walker's plan."""
        base, clock = walker.here.base, walker.here.clock
        visits_end_s = [clock.ends_s[route, :length] for route, length in enumerate(base.lengths)]
        return np.array(merge_times(np.concatenate([clock.durations_s, *visits_end_s]), self._instance.answer_s))

    def _find_window_begin(self, walker: Walker, before_s: float = 0.0) -> tuple[float, float]:
        """Return the start of a plan's window and of the interval that breaks it, -1 if none does.

        With two losses, only those at once count, unless the window then begins before ``before_s``.
        """
        base, clock, events_s = walker.here.base, walker.here.clock, self._list_events_s(walker)
        walker.full.known[:] = 0
        interval = find_broken_interval(
            self._problem, self._timing, base, clock, events_s, self._fly_again, walker.loss, walker.full, walker.desk,
            self._params.look, walker.rng,
        )  # fmt: skip
        found = (0.0, -1.0) if interval < 0 else (float(events_s[interval + 1]), float(events_s[interval]))
        if self._losses == 1 or found[0] >= before_s:
            return found
        broken = find_broken_loss(
            self._instance, build_plan(base), effort=self._params.look, seed=self._seed, fly_again=self._fly_again,
            losses=self._losses,
        )  # fmt: skip
        return (0.0, -1.0) if broken is None else (broken.to_s, broken.from_s)

    def _walk(self, walker: Walker, iterations: int) -> None:
        while iterations > 0 and not walker.waits:
            iterations -= self._anneal(walker, iterations)
            here = walker.here
            # At the end of a cycle, repairs that lack a little are rebuilt.
            if walker.left <= 0 and 0 < here.lacks.sum() <= self._params.nearly * self._transit_pct(here.base):
                here.repairs.known[here.lacks > 0] = 0
                self._assess(walker)
            if walker.here.lacks.sum() <= 0:
                self._verify_window(walker)
                iterations -= self._params.whole_look * (1 if self._losses == 1 else PAIRS)
                if walker.best.earliest_s <= 0:
                    return
            elif walker.left <= 0:
                self._lower_step(walker)

    def _anneal(self, walker: Walker, iterations: int) -> int:
        """Walk on in its cycle, or in a new one; return how many of the iterations were used."""
        if walker.left <= 0:
            self._begin_cycle(walker)
        cooling = (self._params.cold / self._start_temperature(walker)) ** (1 / walker.length)
        done = anneal_plan(
            self._problem, self._timing, walker.here, walker.there, walker.loss, walker.desk, walker.own,
            walker.probes_s, self._build_limits(walker), walker.temperature, cooling,
            min(iterations, walker.left), walker.rng,
        )  # fmt: skip
        done = max(1, done)
        walker.left -= done
        return done

    def _lower_step(self, walker: Walker) -> None:
        """Reduce the step for the next cycle; after the last step begin again, with longer cycles."""
        walker.cycles += 1
        if walker.step > self._params.last_step:
            walker.step /= 2
        else:
            walker.step = self._params.first_step
            walker.rounds += 1
            often = walker.rounds & -walker.rounds
            walker.length = min(self._params.cycle * often * often, self._params.longest_cycle)
            walker.waits = True

    def _build_limits(self, walker: Walker) -> WalkLimits:
        params = self._params
        early, polish = params.ways[walker.cycles % len(params.ways)]
        rise = params.rise * float(walker.here.base.loads.sum())
        return WalkLimits(
            self._cap_s, self._all_vehicles, self._fly_again, params.follow, rise, early, polish,
            base_pct=0.0, most_pct=math.inf,
        )  # fmt: skip

    def _begin_cycle(self, walker: Walker) -> None:
        self._place_walker(walker, walker.start.routes)
        self._aim(walker)

    def _aim(self, walker: Walker) -> None:
        """Aim a step below the best of a walk, and begin to cool."""
        longest_s = float(walker.here.clock.durations_s.max())
        walker.probes_s[0] = max(0.0, walker.best.earliest_s - walker.step * longest_s)
        walker.probes_s[walker.probes_s < walker.probes_s[0]] = -1.0
        self._assess(walker)
        walker.temperature[0] = self._start_temperature(walker) * self._transit_pct(walker.here.base)
        walker.left = walker.length

    def _assess(self, walker: Walker) -> None:
        """Evaluate all repairs of a walk's current plan."""
        assess_repairs(
            self._problem, self._timing, walker.here, walker.there, walker.loss, walker.desk, walker.probes_s,
            self._build_limits(walker), np.inf, walker.rng,
        )  # fmt: skip
        take_repairs(walker.there, walker.here)

    def _start_temperature(self, walker: Walker) -> float:
        """Return the start temperature of a cycle, in mean transits."""
        return self._params.hot * math.sqrt(math.sqrt(walker.length / self._params.cycle))

    def _transit_pct(self, base: State) -> float:
        """Return the mean energy of a plan's transits, inspections excluded."""
        inspections = self._problem.move.reshape(-1, len(self._problem.value), 2).min(axis=(0, 2))
        moves = len(inspections) + len(base.lengths)
        return max(float(base.loads.sum() - inspections.sum()) / moves, 1e-3 * float(self._problem.effort.max()), 1e-9)

    def _verify_window(self, walker: Walker) -> None:
        """Evaluate the whole window of a plan whose losses at the probes can be repaired, and set a new aim."""
        earliest_s, broken_s = self._find_window_begin(walker, walker.best.earliest_s)
        if earliest_s < walker.best.earliest_s:
            routes = tuple(route.visits for route in build_plan(walker.here.base).routes)
            longest_s = float(walker.here.clock.durations_s.max())
            walker.best = walker.start = FoundPlan(routes, earliest_s, longest_s)
            walker.found.append(walker.best)
            walker.step = min(self._params.first_step, 1.5 * walker.step)
        elif broken_s in walker.probes_s or broken_s < walker.probes_s[0]:
            # The evaluation does not find a repair that the walk has: try elsewhere.
            self._lower_step(walker)
            walker.left = 0
            return
        if broken_s > walker.probes_s[0]:
            walker.probes_s[2:] = walker.probes_s[1:-1]
            walker.probes_s[1] = broken_s
        self._aim(walker)

    def _choose_result(self, plans: Sequence[Plan], rivals: Sequence[Plan]) -> WindowResult:
        """Return the first in rank of the best plans found and of their rivals, by their whole windows."""
        best = sorted(self.archive, key=lambda found: found.rank)[: self._params.finalists]
        given = (plan for plan in rivals if self._is_complete(plan) and self._route_s(plan) <= self._cap_s)
        candidates = [*dict.fromkeys([*(plan_from_routes(found.routes) for found in best), *given])] or [
            min(plans, key=lambda plan: (len(plan.uncovered), self._route_s(plan)))
        ]
        windows = [
            replan_window(self._instance, plan, fly_again=self._fly_again, losses=self._losses) for plan in candidates
        ]
        chosen = min(
            range(len(windows)),
            key=lambda number: rank_window(windows[number].earliest_s, windows[number].longest_route_s),
        )
        return WindowResult(
            plan=candidates[chosen],
            window=windows[chosen],
            evaluation=evaluate(self._instance, candidates[chosen], Cost.MINMAX),
            feasible=bool(best),
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=self._reason or "full window",
        )


def plan_from_routes(routes: Sequence[tuple[int, ...]]) -> Plan:
    """Return routes as a plan without uncovered segments."""
    return Plan(tuple(Route(vehicle, visits) for vehicle, visits in enumerate(routes)))
