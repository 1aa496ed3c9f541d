"""Plans outside of a flight: the first plan of a site, and what a loss would make of a plan."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum

import numpy as np

from executor.site import assembly
from executor.site.assembly import Ground
from missions import (
    BreakingLoss,
    DayPlanFile,
    PlanFile,
    PlanFileError,
    Pricing,
    Solved,
    Task,
    Window,
    check_plan,
    make_plan_file,
    plan_document,
)
from missions.areas import Area, AreaKind
from missions.asked import Routes
from missions.order import rearranged
from planner import (
    DEFAULT_PARAMS,
    Cost,
    FrontPlan,
    Instance,
    Iterations,
    NoImprovement,
    Plan,
    Progress,
    Remainder,
    ReplanWindow,
    Result,
    Route,
    SearchParams,
    Seconds,
    StopRule,
    any_of,
    evaluate,
    front,
    grasp,
    remaining,
    replan,
    replan_window,
    segment_of,
    solve,
    solve_exact,
    solve_window,
)

SAME_PLACE_M = 1.0
"""A plan's segment that lies farther from the site's of the same number is another one."""
SAME = 1e-9
"""Figures that differ by less, absolutely or relatively, are the same: computers round differently."""
CHANGES_NAMED = 3
WINDOW_UP_TO = 150
"""Segments up to which the window is searched for where nobody asked for a cost: more take longer than a plan may."""
WINDOW_SETTLED = 30_000
"""The same as `SETTLED` for a search on the window."""
REARRANGED = 1.05
"""Routes by which less is inspected from layers may make the plan this much worse."""
LATE_S = 10.0
"""Who is this much later than planned is still out of the way of who comes after it."""
SETTLED = 50_000
"""Iterations without an improvement after which a first plan is good enough."""


class PlanSolver(Enum):
    """Who plans."""

    SEARCH = "search"
    GRASP = "grasp"
    EXACT = "exact"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a first plan is asked to be."""

    cost: Cost | None
    """None: the largest re-plan window."""
    seconds: float
    """The solver's time."""
    seed: int
    iterations: int | None = None
    """Of a search; then `seconds` are only its limit, and a slow computer finds the same plan later."""
    solver: PlanSolver = PlanSolver.SEARCH
    all_vehicles: bool = False
    """Keep no vehicle on the ground."""
    stretch: float = 0.1
    """With a window: how much longer than the best MinMax plan's the longest route may be, as a share of it."""
    starts: int = 0
    """Searches side by side; 0 for as many as there are processors."""
    params: SearchParams = DEFAULT_PARAMS
    """What the search is tuned by."""
    usual: bool = False
    """Whether nobody asked for a cost: then it is the window where there is one to search for in this time, and else
    MinMax."""

    def __post_init__(self) -> None:
        """Check that the solver can do it.

        Raises:
            PlanFileError: the window is asked of a solver that does not know it, or the paper's solver is to be tuned.
        """
        if self.cost is None and not self.usual and self.solver is not PlanSolver.SEARCH:
            raise PlanFileError(f"--solver: expected search for --cost window, got {self.solver.value}")
        if self.params != DEFAULT_PARAMS and self.solver is PlanSolver.GRASP:
            raise PlanFileError("--search: expected none beside --solver grasp, whose numbers are the paper's")

    @property
    def threads(self) -> int:
        """Searches side by side."""
        return self.starts or os.cpu_count() or 1

    def for_task(self, task: Task) -> Wanted:
        """Return what is asked of a task."""
        if not self.usual:
            return self
        able = self.solver is PlanSolver.SEARCH and len(task.instance.vehicles) > 1
        searched = able and 0 < len(task.segment_ids) <= WINDOW_UP_TO
        return replace(self, cost=None if searched else Cost.MINMAX, usual=False)


DEFAULT = Wanted(cost=None, seconds=5.0, seed=1, stretch=0.05, usual=True)
"""What every command plans by where it is not told otherwise: what was looked at is what is flown.

The window, so that the fleet can finish without any one vehicle from as early as possible, at a small price in time."""


def first_plan(
    ground: Ground,
    wanted: Wanted,
    on_progress: Callable[[Progress], None] | None = None,
    task: Task | None = None,
) -> PlanFile:
    """Plan a whole site, or one task of it.

    Raises:
        planner.PlannerError: the solver cannot take this problem.
    """
    task = assembly.task_of(ground) if task is None else task
    wanted = wanted.for_task(task)
    window: Window | None
    if wanted.cost is None:
        stop = _ended(wanted, NoImprovement(WINDOW_SETTLED))
        found = solve_window(
            task.instance, stretch=wanted.stretch, stop=stop, seed=wanted.seed,
            all_vehicles=wanted.all_vehicles, starts=wanted.threads, params=wanted.params, on_progress=on_progress,
            fly_again=landed_fly_again(ground),
        )  # fmt: skip
        plan, seconds, window = found.plan, found.seconds, window_in(found.window, task.instance)
    else:
        result = _solved(task.instance, wanted, wanted.cost, on_progress)
        plan, seconds, window = result.plan, result.seconds, None
    if ground.inspection.same_distance:
        plan = rearranged_plan(ground, task, plan, wanted.cost or Cost.MINMAX, window)
        task = assembly.asked_task(ground, task, plan)
        if window is not None:
            window = window_in(replan_window(task.instance, plan, fly_again=landed_fly_again(ground)), task.instance)
    solved = Solved(solver=wanted.solver.value, seed=wanted.seed, seconds=seconds)
    return site_plan(ground, task, plan, wanted.cost, solved, window)


def rearranged_plan(ground: Ground, task: Task, plan: Plan, cost: Cost, window: Window | None = None) -> Plan:
    """Return a plan of which routes are changed a little, so that less is inspected from layers.

    Args:
        ground: The site, with everybody at the asked distance.
        task: What was planned.
        plan: For it.
        cost: What it was planned by.
        window: Its re-plan window, which does not become smaller.
    """
    if task.pricing is None:
        return plan
    fly_again, was = landed_fly_again(ground), evaluate(task.instance, plan, cost)

    def plan_of(routes: Routes) -> Plan:
        own = (Route(number, task.from_network(routes.get(name, ()))) for number, name in enumerate(ground.names))
        return Plan(tuple(own), plan.uncovered)

    def cost_of(routes: Routes) -> float:
        found = evaluate(task.instance, plan_of(routes), cost)
        worse = max(found.value / was.value, found.longest_route_s / was.longest_route_s)
        return math.inf if found.violations or worse > REARRANGED else worse

    def may(routes: Routes) -> bool:
        return window is None or (
            replan_window(task.instance, plan_of(routes), fly_again=fly_again).earliest_s <= window.earliest_s + SAME
        )

    routes = assembly.routes_of(ground, task, plan)
    ahead_s = assembly.horizon_s(ground.site) + LATE_S
    better = rearranged(ground.setup, routes, task.pricing.models, ahead_s, cost_of, may)
    return plan if better == routes else plan_of(better)


def site_plan(
    ground: Ground, task: Task, plan: Plan, cost: Cost | None, solved: Solved, window: Window | None = None
) -> PlanFile:
    """Return a plan of a site's task as a plan file: with what the site says of its flights and of its ground."""
    content = make_plan_file(
        ground.network, task, ground.travel, plan, cost, solved, window=window, inspection=ground.inspection,
    )  # fmt: skip
    return replace(
        content, fly_again=landed_fly_again(ground), terrain=assembly.plan_terrain(ground),
        autopilots={one.name: one.autopilot for one in ground.site.vehicle}, fence=assembly.plan_fence(ground.site),
    )  # fmt: skip


def landed_fly_again(ground: Ground) -> bool:
    """Return whether a site's vehicles may fly again once they have landed: by themselves, or by the crew's word."""
    return ground.site.flight.fly_again != "never"


def front_plans(
    ground: Ground, wanted: Wanted, on_progress: Callable[[Progress], None] | None = None
) -> tuple[PlanFile, ...]:
    """Return the plans of a site that no other one found beats in longest route, energy and window at once.

    Raises:
        planner.PlanError: there is one vehicle only.
    """
    task = assembly.task_of(ground)
    found = front(
        task.instance, stop=Seconds(wanted.seconds), seed=wanted.seed, all_vehicles=wanted.all_vehicles,
        starts=wanted.threads, params=wanted.params, on_progress=on_progress, fly_again=landed_fly_again(ground),
    )  # fmt: skip
    solved = Solved(solver=wanted.solver.value, seed=wanted.seed, seconds=wanted.seconds)
    return tuple(_of_the_front(ground, task, entry, solved) for entry in found)


def _of_the_front(ground: Ground, task: Task, entry: FrontPlan, solved: Solved) -> PlanFile:
    window = entry.window
    if ground.inspection.same_distance:
        task = assembly.asked_task(ground, task, entry.plan)
        window = replan_window(task.instance, entry.plan, fly_again=landed_fly_again(ground))
    return site_plan(ground, task, entry.plan, None, solved, window_in(window, task.instance))


def reference_plans(ground: Ground, wanted: Wanted) -> Mapping[str, PlanFile]:
    """Return what each of the paper's cost functions gives in a tenth of the time, by its name: to compare with."""
    plans = {}
    for cost in Cost:
        content = first_plan(ground, replace(wanted, cost=cost, seconds=max(0.2, wanted.seconds / 10)))
        instance = content.instance()
        found = replan_window(instance, content.plan, fly_again=content.fly_again)
        plans[cost.value] = replace(content, window=window_in(found, instance))
    return plans


def _solved(instance: Instance, wanted: Wanted, cost: Cost, on_progress: Callable[[Progress], None] | None) -> Result:
    limit = Seconds(wanted.seconds)
    match wanted.solver:
        case PlanSolver.GRASP:
            return grasp(
                instance, cost=cost, stop=limit, seed=wanted.seed, all_vehicles=wanted.all_vehicles,
                on_progress=on_progress,
            )  # fmt: skip
        case PlanSolver.EXACT:
            return solve_exact(
                instance, cost=cost, stop=limit, all_vehicles=wanted.all_vehicles, params=wanted.params,
                on_progress=on_progress,
            )  # fmt: skip
        case PlanSolver.SEARCH:
            return solve(
                instance, cost=cost, stop=_ended(wanted, NoImprovement(SETTLED)), seed=wanted.seed,
                starts=wanted.threads, all_vehicles=wanted.all_vehicles, params=wanted.params, on_progress=on_progress,
            )  # fmt: skip


def _ended(wanted: Wanted, settled: StopRule) -> StopRule:
    """Return when a search ends: after its iterations if they are given, and else once it is settled."""
    return any_of(Seconds(wanted.seconds), settled if wanted.iterations is None else Iterations(wanted.iterations))


def window_in(found: ReplanWindow, instance: Instance) -> Window:
    """Return a re-plan window as plan files keep it."""
    loss = None
    if found.breaking is not None:
        breaking = found.breaking
        loss = BreakingLoss(instance.vehicles[breaking.vehicle].name, breaking.from_s, breaking.to_s)
    return Window(found.window_pct, found.earliest_s, found.longest_route_s, loss)


def fits(plan: PlanFile, ground: Ground, source: str) -> None:
    """Check that a plan file is what a site asks for: its figures are right, and the site is as it was then.

    Raises:
        PlanFileError: it is another site's, or the site has changed since: one line that says where.
    """
    belongs(plan, ground, source)
    for line in check_plan(plan, search_window=False):
        raise PlanFileError(f"{source}: {line}; `faultline check` says more")
    changed = changes(plan, ground)
    if changed:
        more = f"; and {len(changed) - CHANGES_NAMED} more" if len(changed) > CHANGES_NAMED else ""
        raise PlanFileError(f"{source}: the site has changed: {'; '.join(changed[:CHANGES_NAMED])}{more}: plan again")


def changes(plan: PlanFile, ground: Ground) -> list[str]:
    """Return in words where a site says something else now than when a plan was made for it.

    Args:
        plan: One that belongs to the site.
        ground: The site.
    """
    never = {one.segment: one.why for one in ground.setup.unreachable}
    if barred := [segment for segment in plan.segments if segment.id in never]:
        return [f"{segment.called} {never[segment.id]}" for segment in barred]
    task = assembly.task_of(ground, [segment.id for segment in plan.segments])
    nothing = Plan(tuple(Route(number, ()) for number in range(len(plan.vehicles))), tuple(range(len(plan.segments))))
    inspection = None if plan.inspection is None else ground.inspection
    now = make_plan_file(
        ground.network, task, ground.travel, nothing, Cost.MINMAX, plan.solved, inspection=inspection,
    )  # fmt: skip
    return list(_differing(_asked(plan), _asked(replace(now, terrain=assembly.plan_terrain(ground)))))


def _asked(plan: PlanFile) -> dict[str, object]:
    """Return what a plan file says of the site that it was made for.

    Pads and layers are not among it: they are chosen by who else flies, and the next sortie does so without the lost.
    """
    document = plan_document(plan)
    model = None if plan.pricing is None else {"power": asdict(next(iter(plan.pricing.models.values())).power)}
    # Whether a height limit is in anybody's way is a matter of layers.
    areas = [area for area in plan.areas if area.kind is not AreaKind.HEIGHT_LIMIT]
    return {
        **{key: document.get(key) for key in ("depot", "travel", "inspection", "terrain")},
        "model": model,
        "areas": len(areas),
        "area": [_outlined(area) for area in areas],
        "vehicles": {
            vehicle.name: asdict(vehicle)
            | ({} if plan.pricing is None else {"performance": asdict(plan.pricing.models[vehicle.name].performance)})
            for vehicle in plan.vehicles
        },
        "segments": {
            segment.id: {"elevation_m": segment.elevation_m, "height_m": segment.height_m} for segment in plan.segments
        },
    }


def _outlined(area: Area) -> dict[str, object]:
    rings = [[[round(figure, 2) for figure in corner] for corner in ring] for ring in area.rings_m]
    return {"name": area.name, "margin_m": area.margin_m, "width_m": area.width_m, "corners": rings}


def _low_starts(pricing: Pricing, left: Remainder) -> Iterator[str]:
    """Yield who is below its layer when it becomes free: it has inspected there last."""
    for vehicle, free in zip(left.instance.vehicles, left.survivors, strict=True):
        last = next(iter(free.completed[::-1]), None) if free.finishing is None else free.finishing
        layered = pricing.layered.get(vehicle.name, frozenset())
        if (
            vehicle.airborne
            and last is not None
            and pricing.steps_m.get(vehicle.name)
            and segment_of(last) not in layered
        ):
            yield vehicle.name


def _differing(before: object, now: object, place: str = "") -> Iterator[str]:
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in {**before, **now}:
            yield from _differing(before.get(key), now.get(key), f"{place}.{key}" if place else str(key))
    elif isinstance(before, list | tuple) and isinstance(now, list | tuple) and len(before) == len(now):
        for index, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _differing(one, other, f"{place}[{index}]")
    elif not _alike(before, now):
        yield f"{place} is {_said(now)}, the plan was made with {_said(before)}"


def _alike(before: object, now: object) -> bool:
    if isinstance(before, int | float) and isinstance(now, int | float):
        return math.isclose(before, now, rel_tol=SAME, abs_tol=SAME)
    return before == now


def _said(value: object) -> str:
    return f"{value:.7g}" if isinstance(value, float) else "not known" if value is None else str(value)


def belongs(plan: PlanFile, ground: Ground, source: str) -> None:
    """Check that a plan file is about a site's vehicles and segments.

    Raises:
        PlanFileError: it has other vehicles, or segments that are not the site's.
    """
    names = tuple(vehicle.name for vehicle in plan.vehicles)
    if names != ground.names:
        raise PlanFileError(f"{source}: vehicles: expected {', '.join(ground.names)}, got {', '.join(names)}")
    same_segments(plan, ground, source)


def same_segments(plan: PlanFile | DayPlanFile, ground: Ground, source: str) -> None:
    """Check that a plan's segments, all of a site's or some of them, are where the site's are.

    Raises:
        PlanFileError: one is not.
    """
    ends_m = ground.network.ends_m
    for segment in plan.segments:
        place = f"{source}: {segment.called}"
        if not 0 <= segment.id < len(ends_m):
            raise PlanFileError(f"{place}: expected one of the site's {len(ends_m)} segments")
        off_m = np.abs(ends_m[segment.id] - np.array([segment.a_enu_m[:2], segment.b_enu_m[:2]])).max()
        if off_m > SAME_PLACE_M:
            raise PlanFileError(
                f"{place}: expected where the site's {ground.network.segment_name(segment.id)} is, got {off_m:.1f} m "
                "beside it"
            )


@dataclass(frozen=True, slots=True)
class WhatIf:
    """What a loss makes of a plan."""

    left: Remainder
    plan: PlanFile
    feasible: bool


def after_loss(plan: PlanFile, lost: str, at_s: float, *, cost: Cost, seconds: float, seed: int) -> WhatIf:
    """Re-plan a plan file for the loss of one vehicle at a time.

    Raises:
        PlanFileError: the plan has no such vehicle.
        planner.PlanError: nobody is left.
    """
    names = [vehicle.name for vehicle in plan.vehicles]
    if lost not in names:
        raise PlanFileError(f"{plan.source}: --lost: expected one of {', '.join(names)}, got {lost}")
    task = plan.task()
    left = remaining(task.instance, plan.plan, names.index(lost), at_s, fly_again=plan.fly_again)
    stop = any_of(Seconds(seconds), NoImprovement(SETTLED))
    result = replan(left.instance, warm=left.warm, cost=cost, stop=stop, seed=seed)
    pricing = plan.pricing and plan.pricing.part(left.open_segments, (one.name for one in left.instance.vehicles))
    if pricing is not None and plan.pricing is not None:
        pricing = replace(pricing, low_starts=frozenset(_low_starts(plan.pricing, left)))
    reduced = Task(left.instance, left.open_segments, pricing)
    solved = Solved(solver=PlanSolver.SEARCH.value, seed=seed, seconds=result.seconds)
    content = make_plan_file(
        plan.network(), reduced, plan.travel, result.plan, cost, solved, inspection=plan.inspection,
    )  # fmt: skip
    return WhatIf(left, content.with_site_of(plan), result.feasible)
