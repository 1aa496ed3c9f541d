"""Describe a plan in words for the crew to confirm: routes, what is left over, heights."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executor.core.formatting import describe_unreachable, format_count, join_first_names
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.preflight import mission_checks
from executor.errors import SiteError
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import BasePlace, CoverageChance, DayPlanFile, PlanFile, check_ceiling
from missions.area_rules import check_areas, describe_crossing, find_return_crossings
from missions.geo import FloatArray
from planner.model import BARRED_PCT
from planner.sorties import SparesEstimate

NAMED = 50
"""Most segments named in a line; the rest are counted, and `--json` names all."""
NAMED_IN_CHECKLIST = 12
OUT_OF_REACH = "out of range of every vehicle's budget"
OUT_OF_ITS_RANGE = "out of range of its budget"
USED_UP = "reachable, but no battery left after the other segments"
OUT_OF_REACH_BY_DAY = "out of reach of every base on one pack"
OUT_OF_TIME = "within reach, but no time is left"
LOCKED = "locked to {vehicle}: {why}"
NO_CAMERA = "it has no camera for it"
FULL = 1e-9
CLOSED_PCT = 0.001
"""Gap below which a plan is said to be the best: ten times what the proofs themselves leave."""


@dataclass(frozen=True, slots=True)
class LeftOver:
    """A segment that a plan does not inspect."""

    segment: int
    """Segment number in the site's network."""
    name: str
    alone_pct: float
    """Battery that a flight to this segment alone needs, for the most suitable vehicle."""
    budget_pct: float
    """Budget of that vehicle."""
    why: str


def find_left_over(plan: PlanFile | DayPlanFile, later: Collection[int] = ()) -> tuple[LeftOver, ...]:
    """Return the segments that a plan does not inspect, with reasons; without those of later sorties."""
    left = [plan.positions[segment] for segment in plan.uncovered if segment not in later]
    if not left:
        return ()
    is_day = isinstance(plan, DayPlanFile)
    out_of_reach, used_up = (OUT_OF_REACH_BY_DAY, OUT_OF_TIME) if is_day else (OUT_OF_REACH, USED_UP)
    budgets, names = np.array([vehicle.budget_pct for vehicle in plan.vehicles]), list(plan.names)
    alone_pct = _list_alone_pct(plan).reshape(len(budgets), -1, 2).min(axis=2)
    nearest = np.argmin(alone_pct - budgets[:, np.newaxis], axis=0)
    locked = {} if plan.pricing is None else plan.pricing.locked
    for number, keeper in locked.items():
        nearest[number] = names.index(keeper)
    found = []
    for number in left:
        needed, budget = float(alone_pct[nearest[number], number]), float(budgets[nearest[number]])
        segment, why = plan.segments[number], out_of_reach if needed > budget + FULL else used_up
        if number in locked:
            own = NO_CAMERA if needed >= BARRED_PCT else OUT_OF_ITS_RANGE if why == OUT_OF_REACH else why
            why = LOCKED.format(vehicle=locked[number], why=own)
        found.append(LeftOver(segment.id, segment.display_name, needed, budget, why))
    return tuple(found)


def _list_alone_pct(plan: PlanFile | DayPlanFile) -> FloatArray:
    """Return (k, 2n) percentages that each vehicle needs to fly to a visit, along it and home, and nothing else."""
    if isinstance(plan, PlanFile):
        instance = plan.build_instance()
        return instance.start_pct + instance.home_pct
    sorties = plan.build_instance()
    return np.array([
        sorties.out_pct[row, own.lands].min(axis=0) + sorties.home_pct[row][:, own.lands].min(axis=1)
        for row, own in enumerate(sorties.vehicles)
    ])  # fmt: skip


def describe_routes(plan: PlanFile) -> Iterator[str]:
    """Yield the route of each vehicle in words."""
    for vehicle, route in zip(plan.vehicles, plan.routes, strict=True):
        if not route.visits:
            if vehicle.airborne:
                yield f"{vehicle.name}: no segments, returns"
            else:
                yield f"{vehicle.name}: no segments, stays on the ground"
            continue
        yield (
            f"{vehicle.name}: {format_count(len(route.visits), 'segment')}, {route.duration_s / 60:.1f} min, "
            f"{route.energy_pct:.1f} % of its battery (budget {round(vehicle.budget_pct, 1):g} %)"
        )


def summarise_plan(plan: PlanFile) -> str:
    """Return a plan in one line: segments, duration, cost function."""
    flown, asked = sum(len(route.visits) for route in plan.routes), len(plan.segments) + len(plan.unreachable)
    if not asked:
        return "no segment is open"
    if not flown:
        return f"none of {asked} segments, no vehicle flies"
    longest = max(plan.routes, key=lambda route: route.duration_s)
    route, proof = f"longest route {longest.duration_s / 60:.1f} min ({longest.vehicle})", _describe_proof(plan)
    return f"{flown} of {asked} segments, {route}, chosen by {plan.cost.name}{proof}"


def _describe_proof(plan: PlanFile) -> str:
    """Return how good the plan is proven to be; empty without a proof."""
    if plan.cost.bound is None:
        return ""
    gap_pct = 100.0 * (1.0 - plan.cost.bound / plan.cost.value)
    if gap_pct < CLOSED_PCT:
        return ", proven: no plan is better"
    gap_pct = math.ceil(100.0 * gap_pct - CLOSED_PCT) / 100.0  # rounded down it would promise too much
    return f", proven: no plan is more than {gap_pct:.2f} % better"


def describe_window(plan: PlanFile) -> list[str]:
    """Return a line with the start of the re-plan window, and the worst case before it; empty if unknown.

    For a plan chosen for its probability of coverage, a line with that.
    """
    window = plan.window
    if window is None:
        return [] if plan.coverage is None else [_describe_coverage(plan.coverage)]
    breaking, then = window.breaking, window.then
    before = "" if breaking is None else (
        f"; worst case before: {breaking.vehicle} at {breaking.from_s:.0f} to {breaking.to_s:.0f} s"
    )  # fmt: skip
    if then is not None:
        before += f", then {then.vehicle} at {then.from_s:.0f} to {then.to_s:.0f} s"
    share = f"re-plan window {window.window_pct:.0f} %"
    absorbs = describe_absorbed_losses(window.earliest_s, window.losses or 1)
    return [f"{share}: {absorbs}{but_left_over(plan)}{before}"]


def _describe_coverage(found: CoverageChance) -> str:
    chance = f"everything inspected: {100 * found.probability:.1f} %"
    span = f"(95 %: {100 * found.low_95:.1f} to {100 * found.high_95:.1f} %)"
    flown = f"{found.flights} new flights, one failure in {found.mtbf_h:g} flight hours, re-planned"
    return f"{chance} {span}, {found.uninspected_m:.1f} m left on average; {flown}"


def describe_absorbed_losses(earliest_s: float, losses: int) -> str:
    """Return from when on which losses can be absorbed."""
    if losses == 1:
        return f"from {earliest_s:.0f} s the fleet can absorb the loss of any one vehicle"
    return f"from {earliest_s:.0f} s the fleet can absorb the loss of any two vehicles, one after the other or at once"


def but_left_over(plan: PlanFile) -> str:
    """Return in words what is left over in any case; empty if the plan inspects everything."""
    left = len(plan.uncovered)
    return f", with no more left over than the plan's {format_count(left, 'segment')}" if left else ""


def describe_distances(plan: PlanFile) -> list[str]:
    """Return a line with the inspection heights of segments; empty if every vehicle inspects in its layer."""
    if plan.inspection is None or not plan.inspection.same_distance:
        return []
    rows = [
        (plan.segments[plan.positions[visit.segment]].display_name, route.vehicle, visit.inspected_at_m)
        for route in plan.routes for visit in route.visits if visit.inspected_at_m is not None
    ]  # fmt: skip
    return [mission_checks.describe_inspection_distances(plan.inspection.height_m, rows)] if rows else []


def describe_left_over(plan: PlanFile | DayPlanFile, most: int = NAMED, later: Collection[int] = ()) -> list[str]:
    """Return what is left over, a line for each reason, each with the names of at most `most` segments.

    Args:
        plan: The plan.
        most: Most segments to name.
        later: Ids of the segments that later sorties of a day have.
    """
    reasons: dict[str, list[str]] = {}
    for one in find_left_over(plan, later):
        is_far = one.budget_pct + FULL < one.alone_pct < BARRED_PCT
        figure = f" ({one.alone_pct:.2f} % of {one.budget_pct:g} %)" if is_far else ""
        reasons.setdefault(one.why, []).append(one.name + figure)
    never = ((one.name, one.why) for one in plan.unreachable)
    lines = [f"left over, {why}: {join_first_names(names, most)}" for why, names in reasons.items()]
    return [*lines, *describe_unreachable(never, most)]


def describe_site_choices(ground: SiteModel) -> list[str]:
    """Return the segments that a site leaves out, and those it locks to a vehicle or direction, a line each."""
    network, chosen = ground.network, dict[str, list[str]]()
    for segment in sorted(ground.left_out):
        chosen.setdefault("left out by the site", []).append(network.segment_name(segment))
    for segment, keeper in sorted(ground.locked.items()):
        chosen.setdefault(f"locked to {keeper}", []).append(network.segment_name(segment))
    for segment, is_turned in sorted(ground.directions.items()):
        end = network.segments[segment].b if is_turned else network.segments[segment].a
        begins = f"{network.segment_name(segment)} from {network.pylons[end].id}"
        chosen.setdefault("locked in direction", []).append(begins)
    return [f"{what}: {join_first_names(names, NAMED_IN_CHECKLIST)}" for what, names in chosen.items()]


def build_plan_checks(
    plan: PlanFile, segments: int, later: Collection[int] = (), chosen: Sequence[str] = ()
) -> list[Check]:
    """Return a plan as lines of the checklist, so that the crew sees it before the question.

    Args:
        plan: Plan to fly.
        segments: Segments of the whole site, without those left out.
        later: Ids of the segments that later sorties of a day have.
        chosen: Result of `describe_site_choices`.
    """
    lines = (*describe_routes(plan), summarise_plan(plan), *describe_window(plan), *chosen)
    found = [Check(Severity.OK, "plan", line, CheckCode.PLAN) for line in lines]
    found += [
        Check(Severity.WARNING, "plan", line, CheckCode.LEFT_OVER)
        for line in describe_left_over(plan, NAMED_IN_CHECKLIST, later)
    ]
    if later:
        text = f"{format_count(len(later), 'segment')} of {len(plan.segments)} in later sorties of the day"
        found.append(Check(Severity.OK, "plan", text, CheckCode.PLAN))
    about = len(plan.segments) + len(plan.unreachable)
    if about < segments:
        text = f"it is about {about} of the site's {segments} segments; the others are not flown"
        found.append(Check(Severity.WARNING, "plan", text, CheckCode.LEFT_OVER))
    return found


@dataclass(frozen=True, slots=True)
class PlannedHeights:
    """Heights of a plan's flights."""

    words: str
    warnings: tuple[str, ...]
    document: Mapping[str, object]

    @property
    def lines(self) -> list[str]:
        """Lines for the crew."""
        return [f"heights: {self.words}", *(f"warning: {line}" for line in self.warnings)]

    def to_json(self) -> dict[str, object]:
        """Return the heights for a plan's JSON."""
        return {"heights": self.document, "warnings": list(self.warnings)}


def compute_planned_heights(ground: SiteModel, rounds: Sequence[Mapping[str, tuple[int, ...]]]) -> PlannedHeights:
    """Return the heights by which a plan of a site would be flown.

    Args:
        ground: The site.
        rounds: Each vehicle's visits of the network by name; for a day of sorties the first ones, the second ones...

    Raises:
        SiteError: its flights come too near to the ground or to a line, or into an area.
    """
    setup = ground.setup
    flown = [(routes, list(site_model.build_paths(setup, routes).values())) for routes in rounds]
    paths = [path for _, own in flown for path in own]
    for text in check_areas(setup, paths):
        raise SiteError(f"area: {text}")
    for text in mission_checks.find_low_places(setup, paths):
        raise SiteError(f"{ground.network.source}: heights: {text}")
    returns = (
        describe_crossing(setup, one) for routes, own in flown for one in find_return_crossings(setup, own, routes)
    )
    return PlannedHeights(
        mission_checks.describe_heights(setup, paths),
        (*ground.worth_a_look, *check_ceiling(setup, paths), *dict.fromkeys(returns)),
        mission_checks.build_heights_document(setup, paths),
    )


DAY_S = 86_400.0


def format_day_time(seconds: float) -> str:
    """Return the day and time of day.

    >>> format_day_time(86_400 + 30_630.0)
    'day 2 at 08:30'
    """
    day, minutes = int(seconds // DAY_S) + 1, int(seconds % DAY_S // 60)
    return f"day {day} at {minutes // 60:02d}:{minutes % 60:02d}"


@dataclass(frozen=True, slots=True)
class BaseNeeds:
    """Needs of a base on its busiest day."""

    name: str
    sorties: int
    """Sorties of all days; each takes one pack swap."""
    packs: int
    """Most packs in the air and charging at once."""
    people: int
    """Crew size: a pilot, and one person for each vehicle turned around at the same time."""


def compute_base_needs(content: DayPlanFile) -> tuple[BaseNeeds, ...]:
    """Return the needs of each base."""
    return tuple(
        BaseNeeds(
            place.name, sum(one.base == place.name for one in content.routes), packs, _count_people(content, place)
        )
        for place, packs in zip(content.bases, content.count_packs(), strict=True)
    )


def _count_people(content: DayPlanFile, base: BasePlace) -> int:
    turned = []
    for one in content.routes:
        if one.lands == base.name:
            lands_s = one.start_s + one.duration_s
            turned += [(lands_s, 1), (lands_s + base.turnaround_s, 0)]
    at_once = most = 0
    for _, begins in sorted(turned):
        at_once += 1 if begins else -1
        most = max(most, at_once)
    return 1 + most if any(base.name in {one.base, one.lands} for one in content.routes) else 0


def describe_day_sorties(content: DayPlanFile) -> Iterator[str]:
    """Yield a line for each sortie, by day and take-off."""
    for day in range(len(content.days)):
        mine = sorted(content.routes_on(day), key=lambda one: (one.start_s, one.vehicle))
        if not mine:
            continue
        last = format_day_time(max(one.start_s + one.duration_s for one in mine))[-5:]
        yield f"day {day + 1}: {len(mine)} sorties, the last one lands at {last}"
        for one in mine:
            onto = "" if one.lands == one.base else f", lands at {one.lands}"
            yield (
                f"  {format_day_time(one.start_s)[-5:]}  {one.vehicle:<8} {one.base:<8} {one.duration_s / 60:6.1f} min "
                f"{one.energy_pct:6.1f} %  {len(one.visits):4d} segments{onto}"
            )


def describe_base_needs(content: DayPlanFile) -> Iterator[str]:
    """Yield the needs of each base, and when everything is done."""
    for base, own in zip(content.bases, compute_base_needs(content), strict=True):
        there = "" if base.packs is None else f" of {base.packs}"
        yield f"base {own.name}: {own.sorties} sorties and swaps, {own.packs}{there} packs, {own.people} people"
    if not content.routes:
        yield "no vehicle flies"
        return
    yield (
        f"finished on {format_day_time(content.finish_s)}: {len(content.routes)} sorties, "
        f"{content.flight_s / 3600:.1f} h in the air, by {content.flying} vehicles"
    )


def describe_loss_windows(content: DayPlanFile) -> Iterator[str]:
    """Yield from when on each vehicle may be lost for good."""
    end = format_day_time(content.days[-1][1])
    for one in content.windows:
        name = one.vehicle
        if not content.routes_of(name):
            continue
        if one.breaks is None:
            yield f"{name} may be lost at any time: the others finish by {end}"
        else:
            yield (
                f"{name} may be lost from {format_day_time(one.from_s)} on; for its sortie {one.breaks + 1}, and those "
                f"before it, no re-plan was found that finishes by {end}"
            )


def compute_rule_packs(content: DayPlanFile, base: BasePlace) -> int | None:
    """Return the packs of arXiv 2604.15890 for a base: m (ceil(R) + 1) for m vehicles that fly from it.

    R is a pack's turnaround time over its flight time. None if packs are charged overnight only.
    """
    own = [one for one in content.routes if one.base == base.name]
    if base.recharge_s is None or not own:
        return None
    mean_s = float(np.mean([one.duration_s for one in own]))
    return len({one.vehicle for one in own}) * (int(np.ceil(base.recharge_s / mean_s)) + 1)


def describe_spares(content: DayPlanFile, found: list[SparesEstimate], shares: list[float]) -> Iterator[str]:
    """Yield the probability for each number of vehicles, and how many are enough."""
    fleet = content.flying
    for one in found:
        lives, chance = one.lives, one.lives.finished
        yield (
            f"{fleet + len(one.spares):3d} vehicles finish in {100 * chance.estimate:.1f} % of {lives.samples} times "
            f"(95 %: {100 * chance.low:.1f} to {100 * chance.high:.1f} %), {lives.losses:.2f} losses each"
        )
    for share in shares:
        enough = find_enough_spares(found, share)
        if enough is None:
            yield f"{100 * share:g} %: not with {fleet + len(found[-1].spares)} vehicles"
            continue
        packs = ", ".join(
            f"{count} at {place.name}"
            for count, place in zip(enough.lives.packs_for_share(share), content.bases, strict=True)
        )
        spares = len(enough.spares)
        yield f"{100 * share:g} %: {fleet + spares} vehicles, {spares} of them spare; packs: {packs}"


def describe_day(content: DayPlanFile) -> list[str]:
    """Return the days in words."""
    told = (describe_day_sorties(content), describe_base_needs(content), describe_left_over(content))
    return [line for lines in (*told, describe_loss_windows(content)) for line in lines]


def find_enough_spares(found: list[SparesEstimate], share: float) -> SparesEstimate | None:
    """Return the fewest spares that reach a share of completed days, with their results."""
    return next((one for one in found if one.lives.finished.estimate >= share), None)
