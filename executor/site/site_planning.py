"""Plan outside of a flight: the first plan of a site, and the re-plan after a supposed loss."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from enum import Enum
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

import missions
import planner
from executor.errors import SiteError
from executor.site import site_model
from executor.site.site_file import read_toml
from executor.site.site_model import SiteModel
from missions.inspection_height import Routes, rearrange_routes
from missions.no_fly_areas import Area, AreaKind
from missions.plan_parts import PlanFence
from planner.sorties import Objective

SAME_PLACE_M = 1.0
"""Distance beyond which a plan's segment is not the site's segment of that number."""
SAME = 1e-9
"""Absolute and relative tolerance for equal values; computers round differently."""
CHANGES_NAMED = 3
LEFT_OUT = "is left out by the site"
WINDOW_UP_TO = 150
"""Most segments for which the window is the default objective; more take too long."""
WINDOW_SETTLED = 30_000
"""As `SETTLED`, for a search on the window."""
REARRANGED = 1.05
"""Cost factor allowed for routes that inspect less from layers."""
LATE_S = 10.0
"""Delay of a vehicle at which it is still clear of the next one."""
SETTLED = 50_000
"""Iterations without an improvement after which a first plan is good enough."""


class PlanSolver(Enum):
    """Solver of the first plan."""

    SEARCH = "search"
    GRASP = "grasp"
    EXACT = "exact"


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """Requirements on a first plan."""

    cost: planner.Cost | None
    """None: the largest re-plan window."""
    seconds: float
    """Solver time."""
    seed: int
    iterations: int | None = None
    """Iterations of the search; `seconds` is then only a limit, so that a slow computer finds the same plan."""
    solver: PlanSolver = PlanSolver.SEARCH
    all_vehicles: bool = False
    """Whether every vehicle must fly."""
    mtbf_h: float | None = None
    """Mean flight hours between failures of one vehicle: the largest probability of coverage, instead of a cost."""
    stretch: float = 0.1
    """For a window: how much longer than the best MinMax plan's the longest route may be, as a share."""
    losses: int = 1
    """For a window: the number of vehicles that may be lost, 1 or 2."""
    starts: int = 0
    """Parallel searches; 0 for one per processor."""
    params: planner.SearchParams = planner.DEFAULT_PARAMS
    """Tuning of the search."""
    usual: bool = False
    """Whether no cost was given: then the window, if it can be searched in this time, else MinMax."""
    objective: Objective = Objective.FINISH
    """Objective of a day plan, instead of a cost."""

    def __post_init__(self) -> None:
        """Check that the solver supports the request.

        Raises:
            PlanFileError: the solver does not support the window, coverage or an iteration limit, the paper's solver is
                to be tuned, failures are given for a cost without any, or two losses with a cost that does not take
                them into account.
        """
        if self.losses != 1 and (self.cost is not None or self.usual or self.mtbf_h is not None):
            name = planner.Cost.MINMAX.value if self.usual else self.name
            raise missions.PlanFileError(f"--losses: expected 1 with --cost {name}, got {self.losses}")
        if self.cost is None and not self.usual and self.solver is not PlanSolver.SEARCH:
            raise missions.PlanFileError(f"--solver: expected search for --cost {self.name}, got {self.solver.value}")
        if self.mtbf_h is not None and (self.cost is not None or self.usual):
            raise missions.PlanFileError(f"--mtbf: expected --cost coverage with it, got {self.name}")
        if self.iterations is not None and self.solver is not PlanSolver.SEARCH:
            raise missions.PlanFileError(f"--solver: expected search for --iterations, got {self.solver.value}")
        if self.params != planner.DEFAULT_PARAMS and self.solver is PlanSolver.GRASP:
            raise missions.PlanFileError("--search: expected none with --solver grasp, whose numbers are the paper's")

    @property
    def name(self) -> str:
        """Name of the objective."""
        if self.cost is not None:
            return self.cost.value
        return missions.WINDOW_COST if self.mtbf_h is None else missions.COVERAGE_COST

    @property
    def threads(self) -> int:
        """Number of parallel searches."""
        return self.starts or os.cpu_count() or 1

    @property
    def length(self) -> str:
        """Length of the search, in words."""
        return f"{self.seconds:g} s" if self.iterations is None else f"{self.iterations} iterations"

    def build_stop_rule(self, settled: planner.StopRule | None = None) -> planner.StopRule:
        """Return the stop rule of a search: its iterations if given, else once it is settled."""
        sooner = settled if self.iterations is None else planner.Iterations(self.iterations)
        return planner.combine_stop_rules(
            *(rule for rule in (planner.Seconds(self.seconds), sooner) if rule is not None)
        )

    def adapt_to_task(self, task: missions.Task) -> PlanRequest:
        """Return the request for a task."""
        if not self.usual:
            return self
        able = self.solver is PlanSolver.SEARCH and len(task.instance.vehicles) > 1
        searched = able and 0 < len(task.segment_ids) <= WINDOW_UP_TO
        return replace(self, cost=None if searched else planner.Cost.MINMAX, usual=False)


def read_search_params(path: Path) -> planner.SearchParams:
    """Read a search's tuning from a TOML file; what it leaves out keeps its default.

    Raises:
        SiteError: one line that names the file, the key and what was expected.
    """
    try:
        return TypeAdapter(planner.SearchParams).validate_python(read_toml(path, "search parameters"))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        reason = missions.format_first_error(error)
        if first["type"] == "unexpected_keyword_argument":
            *table, key = map(str, first["loc"])
            part = getattr(planner.DEFAULT_PARAMS, table[0]) if table else planner.DEFAULT_PARAMS
            known = ", ".join(one.name for one in fields(part))
            reason = f"{'.'.join([*table, key])}: not known; expected one of {known}"
        raise SiteError(f"{path}: {reason}") from error


DEFAULT = PlanRequest(cost=None, seconds=5.0, seed=1, stretch=0.05, usual=True)
"""Default of every planning command, so that the plan shown is the plan flown.

The window, so that the fleet can finish without any one vehicle from as early as possible, at a small price in time.
"""


def plan_site(
    ground: SiteModel,
    wanted: PlanRequest,
    on_progress: Callable[[planner.Progress], None] | None = None,
    task: missions.Task | None = None,
) -> missions.PlanFile:
    """Plan a whole site, or one task of it.

    Raises:
        planner.PlannerError: the solver cannot take this problem.
    """
    task = site_model.build_first_task(ground) if task is None else task
    wanted = wanted.adapt_to_task(task)
    chosen_by: planner.Cost | missions.Window | missions.CoverageChance
    bound: float | None = None
    if wanted.mtbf_h is not None:
        chance = planner.solve_coverage(
            task.instance, mtbf_h=wanted.mtbf_h, stop=wanted.build_stop_rule(planner.NoImprovement(WINDOW_SETTLED)),
            seed=wanted.seed, all_vehicles=wanted.all_vehicles, starts=wanted.threads, params=wanted.params,
            on_progress=on_progress, fly_again=may_fly_again(ground),
        )  # fmt: skip
        plan, seconds, chosen_by = chance.plan, chance.seconds, to_plan_coverage(chance.chance, wanted.seed)
    elif wanted.cost is None:
        stop = wanted.build_stop_rule(planner.NoImprovement(WINDOW_SETTLED))
        found = planner.solve_window(
            task.instance, stretch=wanted.stretch, stop=stop, seed=wanted.seed,
            all_vehicles=wanted.all_vehicles, starts=wanted.threads, params=wanted.params, on_progress=on_progress,
            fly_again=may_fly_again(ground), losses=wanted.losses,
        )  # fmt: skip
        plan, seconds, chosen_by = found.plan, found.seconds, to_plan_window(found.window, task.instance)
    else:
        result = _solve_task(task.instance, wanted, wanted.cost, on_progress)
        plan, seconds, chosen_by, bound = result.plan, result.seconds, wanted.cost, result.bound
    if ground.inspection.same_distance:
        bound = None  # its routes and moves change
        if not isinstance(chosen_by, missions.CoverageChance):
            plan = rearrange_plan(ground, task, plan, chosen_by)
        task = site_model.adjust_task_to_layers(ground, task, plan)
        if isinstance(chosen_by, missions.CoverageChance):
            figures = planner.estimate_coverage(
                task.instance, plan, chosen_by.mtbf_h, flights=chosen_by.flights, seed=wanted.seed,
                fly_again=may_fly_again(ground),
            )  # fmt: skip
            chosen_by = to_plan_coverage(figures, wanted.seed)
        if isinstance(chosen_by, missions.Window):
            again = planner.replan_window(task.instance, plan, fly_again=may_fly_again(ground), losses=wanted.losses)
            chosen_by = to_plan_window(again, task.instance)
    solved = missions.SolverRecord(solver=wanted.solver.value, seed=wanted.seed, seconds=seconds)
    content = build_site_plan_file(ground, task, plan, chosen_by, solved)
    return content if bound is None else replace(content, cost=replace(content.cost, bound=bound))


def rearrange_plan(
    ground: SiteModel, task: missions.Task, plan: planner.Plan, chosen_by: planner.Cost | missions.Window
) -> planner.Plan:
    """Return a plan with slightly changed routes, so that fewer segments are inspected from layers.

    Args:
        ground: The site, with every vehicle at the requested inspection height.
        task: Problem of the plan.
        plan: Its plan.
        chosen_by: Objective of the plan; its re-plan window does not become smaller.
    """
    if task.pricing is None:
        return plan
    window = chosen_by if isinstance(chosen_by, missions.Window) else None
    cost = planner.Cost.MINMAX if isinstance(chosen_by, missions.Window) else chosen_by
    fly_again, was = may_fly_again(ground), planner.evaluate(task.instance, plan, cost)

    def plan_of(routes: Routes) -> planner.Plan:
        own = (
            planner.Route(number, task.from_network(routes.get(name, ()))) for number, name in enumerate(ground.names)
        )
        return planner.Plan(tuple(own), plan.uncovered)

    def cost_of(routes: Routes) -> float:
        found = planner.evaluate(task.instance, plan_of(routes), cost)
        worse = max(found.value / was.value, found.longest_route_s / was.longest_route_s)
        return math.inf if found.violations or worse > REARRANGED else worse

    def may(routes: Routes) -> bool:
        return window is None or (
            planner.replan_window(
                task.instance, plan_of(routes), fly_again=fly_again, losses=window.losses or 1
            ).earliest_s
            <= window.earliest_s + SAME
        )

    routes = site_model.name_routes(ground, task, plan)
    ahead_s = site_model.horizon_s(ground.site) + LATE_S
    better = rearrange_routes(ground.setup, routes, task.pricing.models, ahead_s, cost_of, may)
    return plan if better == routes else plan_of(better)


def build_site_plan_file(
    ground: SiteModel,
    task: missions.Task,
    plan: planner.Plan,
    chosen_by: planner.Cost | missions.Window | missions.CoverageChance,
    solved: missions.SolverRecord,
) -> missions.PlanFile:
    """Return the plan of a site's task as a plan file, with the site's flight settings and ground."""
    content = missions.make_plan_file(
        ground.network, task, ground.travel, plan, chosen_by, solved, inspection=ground.inspection,
    )  # fmt: skip
    fence, autopilots = ground.site.fence, {one.name: one.autopilot for one in ground.site.vehicle}
    return replace(
        content, fly_again=may_fly_again(ground), terrain=site_model.build_plan_terrain(ground),
        cameras=site_model.list_cameras(ground.site),
        vehicles=tuple(replace(one, autopilot=autopilots.get(one.name)) for one in content.vehicles),
        fence=PlanFence(fence.margin_m, fence.rally) if fence is not None and fence.enabled else None,
    )  # fmt: skip


def may_fly_again(ground: SiteModel) -> bool:
    """Return whether a site's vehicles may fly again after landing, automatically or after the crew's confirmation."""
    return ground.site.flight.fly_again != "never"


def plan_front(
    ground: SiteModel, wanted: PlanRequest, on_progress: Callable[[planner.Progress], None] | None = None
) -> tuple[missions.PlanFile, ...]:
    """Return the found plans of a site that no other beats in longest route, energy and window at once.

    Raises:
        planner.PlanError: there is one vehicle only.
    """
    task = site_model.build_first_task(ground)
    found = planner.find_pareto_front(
        task.instance, stop=wanted.build_stop_rule(), seed=wanted.seed, all_vehicles=wanted.all_vehicles,
        starts=wanted.threads, params=wanted.params, on_progress=on_progress, fly_again=may_fly_again(ground),
        losses=wanted.losses,
    )  # fmt: skip
    solved = missions.SolverRecord(solver=wanted.solver.value, seed=wanted.seed, seconds=wanted.seconds)
    return tuple(_build_front_plan(ground, task, entry, solved) for entry in found)


def _build_front_plan(
    ground: SiteModel, task: missions.Task, entry: planner.ParetoPlan, solved: missions.SolverRecord
) -> missions.PlanFile:
    window = entry.window
    if ground.inspection.same_distance:
        task = site_model.adjust_task_to_layers(ground, task, entry.plan)
        window = planner.replan_window(task.instance, entry.plan, fly_again=may_fly_again(ground), losses=window.losses)
    return build_site_plan_file(ground, task, entry.plan, to_plan_window(window, task.instance), solved)


def plan_references(ground: SiteModel, wanted: PlanRequest) -> Mapping[str, missions.PlanFile]:
    """Return a plan for each of the paper's cost functions by name, in a tenth of the time: for comparison."""
    plans = {}
    for cost in planner.Cost:
        quick = replace(wanted, cost=cost, usual=False, losses=1, seconds=max(0.2, wanted.seconds / 10))
        content = plan_site(ground, quick)
        instance = content.build_instance()
        found = planner.replan_window(instance, content.plan, fly_again=content.fly_again, losses=wanted.losses)
        plans[cost.value] = replace(content, window=to_plan_window(found, instance))
    return plans


def _solve_task(
    instance: planner.Instance,
    wanted: PlanRequest,
    cost: planner.Cost,
    on_progress: Callable[[planner.Progress], None] | None,
) -> planner.Result:
    limit = planner.Seconds(wanted.seconds)
    match wanted.solver:
        case PlanSolver.GRASP:
            return planner.solve_grasp(
                instance, cost=cost, stop=limit, seed=wanted.seed, all_vehicles=wanted.all_vehicles,
                on_progress=on_progress,
            )  # fmt: skip
        case PlanSolver.EXACT:
            return planner.solve_exact(
                instance, cost=cost, stop=limit, all_vehicles=wanted.all_vehicles, params=wanted.params,
                on_progress=on_progress,
            )  # fmt: skip
        case PlanSolver.SEARCH:
            return planner.solve(
                instance, cost=cost, stop=wanted.build_stop_rule(planner.NoImprovement(SETTLED)), seed=wanted.seed,
                starts=wanted.threads, all_vehicles=wanted.all_vehicles, params=wanted.params, on_progress=on_progress,
            )  # fmt: skip


def to_plan_window(found: planner.ReplanWindow, instance: planner.Instance) -> missions.Window:
    """Return a re-plan window in the form of plan files."""
    breaking, then = (
        None if loss is None else missions.BreakingLoss(instance.vehicles[loss.vehicle].name, loss.from_s, loss.to_s)
        for loss in (found.breaking, found.then)
    )
    return missions.Window(
        found.window_pct, found.earliest_s, found.longest_route_s, breaking, 2 if found.losses == 2 else None, then
    )


def to_plan_coverage(found: planner.RiskEstimate, seed: int) -> missions.CoverageChance:
    """Return the estimate of a plan's coverage in the form of plan files."""
    chance = found.finished[-1]
    return missions.CoverageChance(
        found.mtbf_h, chance.estimate, chance.low, chance.high, found.undone_m[-1], found.flights, seed
    )  # fmt: skip


def check_plan_fits(plan: missions.PlanFile, ground: SiteModel, source: str) -> None:
    """Check that a plan file fits a site: its figures are right, and the site is unchanged.

    Raises:
        PlanFileError: it is another site's, or the site has changed since: one line with the place.
    """
    check_plan_belongs(plan, ground, source)
    for line in missions.check_plan(plan, search_window=False):
        raise missions.PlanFileError(f"{source}: {line}; `faultline check` says more")
    changed = describe_site_changes(plan, ground)
    if changed:
        more = f"; and {len(changed) - CHANGES_NAMED} more" if len(changed) > CHANGES_NAMED else ""
        raise missions.PlanFileError(
            f"{source}: the site has changed: {'; '.join(changed[:CHANGES_NAMED])}{more}: plan again"
        )


def describe_site_changes(plan: missions.PlanFile, ground: SiteModel) -> list[str]:
    """Return in words how a site has changed since a plan was made for it.

    Args:
        plan: A plan of the site.
        ground: The site.
    """
    never = {one.segment: one.why for one in ground.setup.unreachable} | dict.fromkeys(ground.left_out, LEFT_OUT)
    if barred := [segment for segment in plan.segments if segment.id in never]:
        return [f"{segment.display_name} {never[segment.id]}" for segment in barred]
    task = site_model.build_first_task(ground, [segment.id for segment in plan.segments])
    nothing = planner.Plan(
        tuple(planner.Route(number, ()) for number in range(len(plan.vehicles))), tuple(range(len(plan.segments)))
    )
    inspection = None if plan.inspection is None else ground.inspection
    now = missions.make_plan_file(
        ground.network, task, ground.travel, nothing, planner.Cost.MINMAX, plan.solved, inspection=inspection,
    )  # fmt: skip
    return list(
        _describe_differences(
            _collect_site_facts(plan), _collect_site_facts(replace(now, terrain=site_model.build_plan_terrain(ground)))
        )
    )


def _collect_site_facts(plan: missions.PlanFile) -> dict[str, object]:
    """Return a plan file's record of the site that it was made for.

    Pads and layers are not included: they depend on which vehicles fly, and the next flight is without the lost
    ones.
    """
    document = missions.build_plan_document(plan)
    model = None if plan.pricing is None else {"power": asdict(next(iter(plan.pricing.models.values())).power)}
    # Whether a height limit blocks a vehicle depends on layers.
    areas = [area for area in plan.areas if area.kind is not AreaKind.HEIGHT_LIMIT]
    return {
        **{key: document.get(key) for key in ("depot", "travel", "inspection", "terrain")},
        "model": model,
        "areas": len(areas),
        "area": [_outline_area(area) for area in areas],
        "vehicles": {
            vehicle.name: asdict(vehicle.to_planner())
            | ({} if plan.pricing is None else {"performance": asdict(plan.pricing.models[vehicle.name].performance)})
            for vehicle in plan.vehicles
        },
        "segments": {
            segment.id: {
                "elevation_m": segment.elevation_m,
                "height_m": segment.height_m,
                "locked": None if plan.pricing is None else plan.pricing.locked.get(number),
                "reversed": None if plan.pricing is None else plan.pricing.directions.get(number),
            }
            for number, segment in enumerate(plan.segments)
        },
    }


def _outline_area(area: Area) -> dict[str, object]:
    rings = [[[round(figure, 2) for figure in corner] for corner in ring] for ring in area.rings_m]
    return {"name": area.name, "margin_m": area.margin_m, "width_m": area.width_m, "corners": rings}


def _find_low_starts(pricing: missions.Pricing, left: planner.RemainingProblem) -> Iterator[str]:
    """Yield the vehicles that are below their layer when they become free: their last inspection was there."""
    for vehicle, free in zip(left.instance.vehicles, left.survivors, strict=True):
        last = next(iter(free.completed[::-1]), None) if free.finishing is None else free.finishing
        layered = pricing.layered.get(vehicle.name, frozenset())
        if (
            vehicle.airborne
            and last is not None
            and pricing.steps_m.get(vehicle.name)
            and planner.segment_of(last) not in layered
        ):
            yield vehicle.name


def _describe_differences(before: object, now: object, place: str = "") -> Iterator[str]:
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in {**before, **now}:
            yield from _describe_differences(before.get(key), now.get(key), f"{place}.{key}" if place else str(key))
    elif isinstance(before, list | tuple) and isinstance(now, list | tuple) and len(before) == len(now):
        for index, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _describe_differences(one, other, f"{place}[{index}]")
    elif not _is_alike(before, now):
        yield f"{place} is {_format_value(now)}, the plan was made with {_format_value(before)}"


def _is_alike(before: object, now: object) -> bool:
    if isinstance(before, int | float) and isinstance(now, int | float):
        return math.isclose(before, now, rel_tol=SAME, abs_tol=SAME)
    return before == now


def _format_value(value: object) -> str:
    return f"{value:.7g}" if isinstance(value, float) else "not known" if value is None else str(value)


def check_plan_belongs(plan: missions.PlanFile, ground: SiteModel, source: str) -> None:
    """Check that a plan file has a site's vehicles and segments.

    Raises:
        PlanFileError: it has other vehicles, or segments that are not the site's.
    """
    if plan.names != ground.names:
        raise missions.PlanFileError(
            f"{source}: vehicles: expected {', '.join(ground.names)}, got {', '.join(plan.names)}"
        )
    check_same_segments(plan, ground, source)


def check_same_segments(plan: missions.PlanFile | missions.DayPlanFile, ground: SiteModel, source: str) -> None:
    """Check that a plan's segments, all or some of a site's, are where the site's are.

    Raises:
        PlanFileError: one is not.
    """
    ends_m = ground.network.ends_m
    for segment in plan.segments:
        place = f"{source}: {segment.display_name}"
        if not 0 <= segment.id < len(ends_m):
            raise missions.PlanFileError(f"{place}: expected one of the site's {len(ends_m)} segments")
        off_m = np.abs(ends_m[segment.id] - np.array([segment.a_enu_m[:2], segment.b_enu_m[:2]])).max()
        if off_m > SAME_PLACE_M:
            raise missions.PlanFileError(
                f"{place}: expected where the site's {ground.network.segment_name(segment.id)} is, got {off_m:.1f} m "
                "beside it"
            )


def preview_loss(
    plan: missions.PlanFile,
    lost: str,
    at_s: float,
    *,
    cost: planner.Cost,
    seconds: float,
    seed: int,
    settled: int = SETTLED,
    task: missions.Task | None = None,
) -> tuple[missions.PlanFile, bool]:
    """Re-plan a plan file for the loss of one vehicle at a time; return also whether the rest is all inspected.

    It ends after `seconds`, or `settled` iterations without an improvement. `task` is the plan's own problem, if
    already built.

    Raises:
        PlanFileError: the plan has no such vehicle.
        planner.PlanError: no vehicle is left.
    """
    if lost not in plan.names:
        raise missions.PlanFileError(f"{plan.source}: --lost: expected one of {', '.join(plan.names)}, got {lost}")
    task = task or plan.build_task()
    left = planner.build_remaining_problem(
        task.instance, plan.plan, plan.names.index(lost), at_s, fly_again=plan.fly_again
    )
    stop = planner.combine_stop_rules(planner.Seconds(seconds), planner.NoImprovement(settled))
    result = planner.replan(left.instance, warm=left.warm, cost=cost, stop=stop, seed=seed)
    pricing = plan.pricing and plan.pricing.select_segments(
        left.open_segments, (one.name for one in left.instance.vehicles)
    )
    if pricing is not None and plan.pricing is not None:
        pricing = replace(pricing, low_starts=frozenset(_find_low_starts(plan.pricing, left)))
    reduced = missions.Task(left.instance, left.open_segments, pricing)
    solved = missions.SolverRecord(solver=PlanSolver.SEARCH.value, seed=seed, seconds=result.seconds)
    content = missions.make_plan_file(
        plan.build_network(), reduced, plan.travel, result.plan, cost, solved, inspection=plan.inspection,
    )  # fmt: skip
    return content.with_site_of(plan), result.feasible
