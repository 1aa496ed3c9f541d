"""Plan for the page in a worker process: plans, what-if losses, and changes by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

import missions
import planner
from executor.errors import ExecutorError, SiteError
from executor.flight.next_flight import read_segments_left
from executor.plan_page import plan_view
from executor.plan_page.site_view import SiteKey, find_site_key, read_site_model
from executor.plan_page.worker import report_progress
from executor.site import day_plans, site_model, site_planning
from executor.site.plan_summary import compute_planned_heights
from executor.site.site_model import SiteModel
from executor.site.site_planning import DEFAULT, PlanRequest, to_plan_window
from missions import DayPlanFile, PlanFile, SolverRecord
from planner import Cost, Plan, Route, is_reversed, segment_of, sorties, visit_of
from planner.model import TABLES_UP_TO
from planner.replan import FreeVehicle, find_survivors

ANSWER_S = 0.25
"""Real seconds to search for a re-plan while the slider is dragged."""
SETTLED = 4000
"""Iterations without improvement after which that search ends, as in flight."""
MOST_FRONT = 12
"""Most plans of a front."""


class PlanSettings(BaseModel):
    """Settings of a plan to make."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    seconds: Annotated[float, Field(ge=0.1, le=86_400)] = DEFAULT.seconds
    """Time limit of the search."""
    cost: Literal["minmax", "minsum", "mincomb", "window", "coverage"] | None = None
    """As `faultline plan --cost`; by default the re-plan window, where the problem has one."""
    mtbf_h: Annotated[float, Field(ge=0.01)] | None = None
    """For coverage: mean flight hours between failures of one vehicle."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = DEFAULT.seed
    iterations: Annotated[int, Field(ge=1)] | None = None
    """Iteration limit, so that every computer finds the same plan; `seconds` still holds."""
    front: bool = False
    """Whether to find several plans that trade longest route, energy and window."""
    day: bool = False
    """Whether to plan working days of several sorties."""

    def build_request(self) -> PlanRequest:
        """Return the request that the command line would build from these options."""
        chosen = None if self.cost in {None, "window", "coverage"} else Cost(self.cost)
        usual = self.cost is None and not self.front
        if (self.mtbf_h is None) == (self.cost == "coverage"):
            raise SiteError("mtbf_h: expected flight hours for the cost coverage, and for no other")
        if self.mtbf_h is not None and (self.front or self.day):
            raise SiteError("cost: expected none of coverage for a front or for days")
        return replace(
            DEFAULT, cost=chosen, mtbf_h=self.mtbf_h, usual=usual, seconds=self.seconds, seed=self.seed,
            iterations=self.iterations,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class MadePlan:
    """Plan and its file."""

    id: str
    summary: Mapping[str, Any]


def load_planner() -> None:
    """Load, or compile, the kernels for plans and re-plans."""
    planner.warm_up()
    line = [[[10.0 * at, 0.0], [10.0 * at + 10.0, 0.0]] for at in range(4)]
    fleet = tuple(planner.Vehicle(f"warm-up-{number}", (0.0, 0.0), 100.0) for number in range(2))
    instance = planner.build_instance(line, (0.0, 0.0), fleet, planner.Travel(5.0, 1.0, 1.0, 1.0))
    found = planner.solve_window(instance, stretch=1.0, stop=planner.Iterations(1), starts=2)
    planner.replan_window(instance, found.plan)
    left = planner.build_remaining_problem(instance, found.plan, 0, 0.0)
    planner.replan(left.instance, warm=left.warm, stop=planner.Iterations(1))


def make_plans(
    text: str, folder: Path, wish: PlanSettings, into: Path, job: int, after: Path | None = None
) -> list[MadePlan]:
    """Plan a site, and write the plans.

    Args:
        text: The site file.
        folder: Folder that its paths are relative to.
        wish: Settings of the plan.
        into: Folder for the plans.
        job: Number of the job, for its progress.
        after: Run directory of a flight whose left-over segments are planned.

    Raises:
        ExecutorError: the site cannot be planned, the job was cancelled, or a plan cannot be written.
        PlannerError: the solver cannot take this problem.
        MissionsError: a plan cannot be flown.
    """
    ground, told = read_site_model(text, folder), report_progress(job)
    wanted = wish.build_request()
    left = None if after is None else read_segments_left(after, ground)
    if wish.day:
        return [keep_plan(_plan_day(ground, wanted, told, left), into)]
    if wish.front:
        found = site_planning.plan_front(ground, wanted, told)
        if not found:
            raise SiteError("no plan covers every segment within the budgets, so there is nothing to choose from")
        plans = found[:: max(1, -(-len(found) // MOST_FRONT))]
    else:
        task = site_model.build_first_task(ground, left)
        plans = (site_planning.plan_site(ground, wanted, told, task),)
    for plan in plans:
        for line in missions.check_plan(plan, search_window=False):
            raise SiteError(f"the plan is invalid: {line}")
        compute_planned_heights(ground, [plan.network_routes])
    return [keep_plan(plan, into) for plan in plans]


def _plan_day(ground: SiteModel, wanted: PlanRequest, told: Any, left: Iterable[int] | None) -> DayPlanFile:  # noqa: ANN401
    content = day_plans.solve_day(
        day_plans.build_day_problem(ground, left), wanted, day_plans.list_spares(ground), told
    )
    for line in missions.check_plan(content):
        raise SiteError(f"the day plan is invalid: {line}")
    if content.uncovered or not content.routes:
        return content
    windows = sorties.find_loss_windows(content.build_instance(), content.plan, seed=wanted.seed)
    return replace(content, windows=windows)


def keep_plan(plan: PlanFile | DayPlanFile, into: Path) -> MadePlan:
    """Write a plan under a name derived from its content.

    Raises:
        SiteError: it cannot be written.
    """
    draft = into / "plan.json"
    try:
        into.mkdir(parents=True, exist_ok=True)
        missions.write_plan(draft, plan)
        name = name_plan(draft.read_bytes())
        draft.replace(into / f"{name}.json")
    except OSError as error:
        raise SiteError(f"{draft}: cannot be written: {error.strerror}") from error
    return MadePlan(name, plan_view.summarise(plan))


def name_plan(content: bytes) -> str:
    """Return a plan's name, derived from its content."""
    return sha256(content).hexdigest()[:12]


@lru_cache(maxsize=8)
def read_kept_plan(path: Path) -> PlanFile | DayPlanFile:
    """Return a stored plan; its name identifies its content, so it is read once.

    Raises:
        PlanFileError: it cannot be used.
    """
    return missions.read_any_plan(path)


def summarise_plans(paths: Sequence[Path]) -> dict[str, Mapping[str, Any]]:
    """Return the summaries of readable plans, by name."""
    found = dict[str, Mapping[str, Any]]()
    for path in paths:
        try:
            found[path.stem] = plan_view.summarise(read_kept_plan(path))
        except missions.MissionsError:
            continue
    return found


def is_stale(text: str, folder: Path, path: Path) -> bool:
    """Return whether a site has changed since a plan was made for it."""
    try:
        plan, ground = read_kept_plan(path), read_site_model(text, folder)
        if isinstance(plan, DayPlanFile):
            day_plans.build_first_sorties_plan(plan, ground)
        else:
            site_planning.check_plan_fits(plan, ground, str(path))
    except (missions.MissionsError, ExecutorError):
        return True
    return False


def show_plan(text: str, folder: Path, path: Path) -> dict[str, Any]:
    """Return the page's full view of a plan.

    Raises:
        MissionsError: it cannot be used, or is another site's.
        ExecutorError: the site cannot be used, or the plan cannot be flown there.
    """
    return plan_view.describe_plan(read_kept_plan(path), read_site_model(text, folder))


def prepare_answers(text: str, folder: Path, path: Path) -> None:
    """Price a plan, and the site for changes of it, ahead of the first question about a loss or a change."""
    plan = read_kept_plan(path)
    if isinstance(plan, DayPlanFile):
        if len(plan.segments) <= TABLES_UP_TO:  # beyond, the move table takes gigabytes: only on request
            day_plans.preview_day_loss(plan, plan.names[0], 0.0, seed=1, priced=_price_days(path))
        return
    _build_task(path)
    _build_site_task(find_site_key(text, folder), path, frozenset())


def answer_loss(text: str, folder: Path, path: Path, lost: str, at_s: float) -> dict[str, Any]:
    """Return the survivors' routes if a vehicle of a plan were lost at a time.

    Raises:
        MissionsError: the plan cannot be used, or has no such vehicle.
        PlannerError: no vehicle is left.
        ExecutorError: the site cannot be used.
    """
    plan, ground = read_kept_plan(path), read_site_model(text, folder)
    content: PlanFile | DayPlanFile
    if isinstance(plan, DayPlanFile):
        content, is_complete = day_plans.preview_day_loss(plan, lost, at_s, seed=1, priced=_price_days(path))
        routes = [one for one in plan_view.list_sorties(content) if one.vehicle != lost]
    else:
        task = _build_task(path)
        content, is_complete = site_planning.preview_loss(
            plan, lost, at_s, cost=Cost.MINMAX, seconds=ANSWER_S, seed=1, settled=SETTLED, task=task
        )
        left = find_survivors(
            task.instance, plan.plan, plan.names.index(lost), at_s, fly_again=plan.fly_again
        )[1]  # fmt: skip
        routes = list(_join_routes(plan, content, left))
    was = {visit.segment for one in plan.routes if one.vehicle == lost for visit in one.visits}
    taken = {visit.segment for one in content.routes if one.vehicle != lost for visit in one.visits}
    return {
        "routes": plan_view.describe_vehicles(routes, plan, ground),
        "uncovered": plan_view.list_uncovered(content),
        "recovered": len(taken & was),
        "complete": is_complete,
    }


def _join_routes(plan: PlanFile, content: PlanFile, left: Sequence[FreeVehicle]) -> Iterator[plan_view.Sortie]:
    """Yield each survivor's flight: its old route's rest joined with the new one, or both if it landed in between."""
    ids = [segment.id for segment in plan.segments]

    def to_network(visits: Iterable[int]) -> tuple[int, ...]:
        return tuple(visit_of(ids[segment_of(one)], is_reversed(one)) for one in visits)

    for one in left:
        name = plan.names[one.vehicle]
        stands = to_network((*one.completed, *(() if one.finishing is None else (one.finishing,))))
        new = content.network_routes[name]
        landed = one.finishing is None and bool(one.completed)
        if landed and new:
            yield plan_view.Sortie(name, stands)
            yield plan_view.Sortie(name, new, one.free_s, 1)
        else:
            yield plan_view.Sortie(name, stands + new)


def _read_flight(path: Path) -> PlanFile:
    plan = read_kept_plan(path)
    if isinstance(plan, DayPlanFile):
        raise SiteError("expected a plan for a single flight, got a day plan")
    return plan


@lru_cache(maxsize=4)
def _build_task(path: Path) -> missions.Task:
    return _read_flight(path).build_task()


@lru_cache(maxsize=2)
def _price_days(path: Path) -> day_plans.PricedDays:
    return day_plans.price_days(missions.read_day_plan(path))


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a plan by hand."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    segment: Annotated[int, Field(ge=0)]
    """Segment id in the network."""
    vehicle: Annotated[str, Field(max_length=32)] | None = None
    """New vehicle; empty for none, null to keep the present one."""
    reversed: bool | None = None
    """Whether to fly it from end b to end a; null keeps the direction, or chooses the best one for a new vehicle."""
    position: Annotated[int, Field(ge=0)] | None = None
    """Position in the route; null to keep it, or to choose the best one for a new vehicle."""


def edit_plan_by_hand(text: str, folder: Path, path: Path, changes: Sequence[Change], into: Path) -> dict[str, Any]:
    """Change a plan by hand, check and price it; it is stored even with violations.

    Raises:
        MissionsError: the plan cannot be used.
        ExecutorError: the site cannot be used, or a change names a missing segment or vehicle.
    """
    plan, ground = _read_flight(path), read_site_model(text, folder)
    dropped = frozenset(one.segment for one in changes if one.vehicle == "")
    task = _build_site_task(find_site_key(text, folder), path, dropped)
    known = set(task.segment_ids)
    routes = {
        name: list(task.from_network(one for one in visits if segment_of(one) in known))
        for name, visits in plan.network_routes.items()
    }
    for change in changes:
        if change.segment not in dropped:
            _apply_change(change, plan, task, routes)
            _check_camera(change, ground)
    violations = list(_find_broken_locks(ground, {name: task.to_network(visits) for name, visits in routes.items()}))
    if violations:  # priced as if nothing were locked; such a plan does not fit its site, so it is not flown
        ground = replace(ground, locked={}, directions={})
        task = site_model.build_first_task(ground, task.segment_ids)
    flown = {segment_of(one) for visits in routes.values() for one in visits}
    left = tuple(one for one in range(len(task.segment_ids)) if one not in flown)
    made = Plan(tuple(Route(number, tuple(routes[name])) for number, name in enumerate(plan.names)), left)
    if ground.inspection.same_distance:
        task = site_model.adjust_task_to_layers(ground, task, made)
    found = planner.evaluate(task.instance, made, Cost.MINMAX)
    again = site_planning.may_fly_again(ground)
    losses = 1 if plan.window is None else plan.window.losses or 1
    window = to_plan_window(planner.replan_window(task.instance, made, fly_again=again, losses=losses), task.instance)
    solved = SolverRecord("by hand", plan.seed, 0.0)
    content = site_planning.build_site_plan_file(ground, task, made, window, solved)
    violations += found.violations
    try:
        shown = plan_view.describe_plan(content, ground)
    except (ExecutorError, missions.MissionsError) as error:
        violations.append(str(error))
        shown = {"vehicles": [], "uncovered": plan_view.list_uncovered(content), "lines": []}
    kept = keep_plan(content, into)
    return {
        "made": kept, "plan": shown, "violations": violations,
        "window_was": None if plan.window is None else plan.window.window_pct, "window_is": window.window_pct,
    }  # fmt: skip


def _find_broken_locks(ground: SiteModel, routes: Mapping[str, Sequence[int]]) -> Iterator[str]:
    """Yield the locks of a site that visits of its network break, by vehicle name."""
    for name, visits in routes.items():
        for visit in visits:
            segment, keeper = segment_of(visit), ground.locked.get(segment_of(visit))
            if keeper not in {None, name}:
                yield f"{ground.network.segment_name(segment)} is locked to {keeper}, got {name}"
            if ground.directions.get(segment, is_reversed(visit)) is not is_reversed(visit):
                yield f"{ground.network.segment_name(segment)} is locked in the other direction"


def _check_camera(change: Change, ground: SiteModel) -> None:
    if change.vehicle and change.segment in ground.setup.looks.find_barred_segments(change.vehicle):
        name = ground.network.segment_name(change.segment)
        raise SiteError(f"changes: vehicle: expected one with the camera that {name} requires, got '{change.vehicle}'")


@lru_cache(maxsize=2)
def _build_site_task(site: SiteKey, path: Path, dropped: frozenset[int]) -> missions.Task:
    """Return a plan's problem for the present site, without dropped segments: those are not left over."""
    plan, ground = _read_flight(path), read_site_model(site[0], site[1])
    site_planning.check_plan_belongs(plan, ground, "the plan")
    kept = [segment.id for segment in plan.segments if segment.id not in dropped]
    if not kept or not dropped <= set(plan.positions):
        raise SiteError("changes: segment: expected some of the plan's, and one that is left")
    return site_model.build_first_task(ground, kept)


def _apply_change(change: Change, plan: PlanFile, task: missions.Task, routes: dict[str, list[int]]) -> None:
    if change.segment not in task.segment_ids:
        raise SiteError(f"changes: segment: expected one of the plan's, got {change.segment}")
    if change.vehicle and change.vehicle not in routes:
        raise SiteError(f"changes: vehicle: expected one of {', '.join(routes)}, got {change.vehicle!r}")
    number = task.segment_ids.index(change.segment)
    had, was = next(
        ((name, at) for name, visits in routes.items() for at, one in enumerate(visits) if segment_of(one) == number),
        (None, 0),
    )
    before = None if had is None else routes[had].pop(was)
    goes = had if change.vehicle is None else change.vehicle
    if goes is None:
        raise SiteError(f"changes: vehicle: expected one for segment {change.segment}, which no vehicle flies")
    position, turned = change.position, change.reversed
    if goes == had and before is not None:  # same vehicle: unset fields keep their values
        position = was if position is None else position
        turned = is_reversed(before) if turned is None else turned
    visits, row = routes[goes], plan.names.index(goes)
    places = range(len(visits) + 1) if position is None else [min(position, len(visits))]
    ways = (False, True) if turned is None else (turned,)
    tried = ([*visits[:at], visit_of(number, way), *visits[at:]] for at in places for way in ways)
    routes[goes] = min(tried, key=lambda one: planner.route_duration_s(task.instance, Route(row, tuple(one))))
