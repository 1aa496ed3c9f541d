"""Plans of a flight and of days, with all that is needed to check them; ``plan_json`` writes and reads them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from missions.areas import UNKNOWN_GROUND, Area, Unreachable
from missions.errors import PlanFileError
from missions.flight_model import Base
from missions.geo import MAX_LATITUDE_DEG, FloatArray, LocalFrame
from missions.inspection_defaults import Inspection
from missions.network import Network, Pylon, Segment
from missions.pads import Pad
from missions.pricing import DEPOT_M, Pricing, Task, build_priced_instance, build_priced_sorties
from missions.setup import FlightSetup, plan_flight_setup
from missions.shortest_ways import build_area_graph
from missions.terrain import Terrain
from missions.validation import Above0, Figure, From0, Id, Known, Pair, Place, Text
from planner import (
    Cost,
    Instance,
    InstanceError,
    Plan,
    PlanError,
    Travel,
    Vehicle,
    build_instance,
    evaluate,
    replan_window,
    segment_of,
)
from planner.sorties import (
    LossWindow,
    Objective,
    SortieBase,
    SortieEvaluation,
    SortieInstance,
    SortiePlan,
    SortieVehicle,
    count_packs_needed,
    evaluate_sorties,
)

PLACE_TOLERANCE_M = 0.05
"""Local metres and latitude/longitude of one place agree to this; 1e-7 degrees are 1 cm."""
FIGURE_TOLERANCE = 1e-6
"""Recomputed figures agree to this, relative to the larger of the figure and 1: sums depend on their order."""


WINDOW_COST = "window"
"""What a file names as the cost of a plan that was chosen by its re-plan window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSegment:
    """A stretch of line between two pylons, a and b: one segment of the plan's own network."""

    id: Id
    """The network's number of it; a plan over a part of a network skips some."""
    name: Text | None = None
    """What its network's file calls it."""
    a_enu_m: Annotated[Place, Field(alias="a")]
    """Metres east, north and up from the depot; up is 0 where the ground's height is not known."""
    b_enu_m: Annotated[Place, Field(alias="b")]
    a_lat_lon_deg: Pair
    b_lat_lon_deg: Pair
    pylons: tuple[str, str]
    length_m: Figure
    """Over the ground."""
    elevation_m: Known = (None, None)
    """Ground at a and b above mean sea level, where it is known."""
    height_m: Known = (None, None)
    """Structure at a and b, where it is known."""

    @property
    def display_name(self) -> str:
        """What people call it."""
        return self.name or f"segment {self.id}"


@dataclass(frozen=True, slots=True)
class BreakingLoss:
    """A loss that nothing repairs."""

    vehicle: Text
    """Its name."""
    from_s: Figure
    to_s: Figure


@dataclass(frozen=True, slots=True)
class Window:
    """The re-plan window: from when on the others can finish if any one vehicle is lost."""

    window_pct: Figure
    """Of the longest route."""
    earliest_s: Figure
    longest_route_s: Figure
    breaking: BreakingLoss | None = None
    """The loss just before it that has no re-plan."""


@dataclass(frozen=True, slots=True)
class SolverRecord:
    """How the plan came about."""

    solver: str
    seed: int
    seconds: float
    """What the solver took."""


@dataclass(frozen=True, slots=True)
class PlanTerrain:
    """The ground that a plan was made over; its heights are not part of the file."""

    source: Text
    """The raster, for people."""
    digest: Text
    """Of what was read of it: the same ground has the same."""
    vertical: Text
    """What its heights were counted from."""
    uncertainty_m: Figure
    """Nine of ten heights are nearer than this to the truth."""
    margin_m: Figure
    """That every leg keeps over the ground beside that."""
    line_margin_m: Figure | None = None
    """That every leg keeps over the tops of lines; without it a share of the inspection height."""


@dataclass(frozen=True, slots=True)
class PlanFence:
    """What the site says of the fences of its vehicles, which other ground stations are given too."""

    margin_m: Above0
    """How far a fence is at least from its vehicle's ways."""
    rally: Literal["pad", "keep"]
    """Where its own RTL may end: at its pad, or as the vehicle has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanContent:
    """What plans of single flights and of days have in common."""

    frame: LocalFrame
    segments: tuple[PlanSegment, ...]
    pricing: Pricing | None = field(default=None, compare=False)
    """From which times and energies follow; without it from ``travel``, the paper's model."""
    solved: SolverRecord
    unreachable: tuple[Unreachable, ...] = ()
    """What was asked for as well, and no flight can inspect, by the network's numbers."""
    terrain: PlanTerrain | None = None
    """The ground, where a raster knows it."""
    cameras: tuple[str, ...] = ()
    """Those that its missions trigger or point; how is said by its site."""
    autopilots: Mapping[str, str] = field(default_factory=dict)
    """Of each vehicle by its name, where it is known: in whose dialect its missions are."""
    source: str = field(default="plan", compare=False)
    """Where it was read, for messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFile(PlanContent):
    """What the plan of a single flight says."""

    vehicles: tuple[Vehicle, ...]
    travel: Travel
    plan: Plan
    """Over positions in ``segments``, in the order of ``vehicles``."""
    durations_s: tuple[float, ...]
    energies_pct: tuple[float, ...]
    cost: Cost | None
    """What the plan was chosen by; None: by its re-plan window, the earlier it begins the better."""
    cost_value: float
    """In percent of a full battery; of a window, its ``earliest_s``."""
    window: Window | None = None
    inspection: Inspection | None = None
    """How to fly it; without it the file can be checked but not exported."""
    fly_again: bool = True
    """Whether vehicles that have landed may fly again after a loss: what its window, and a re-plan, reckons with."""
    fence: PlanFence | None = None
    """What its vehicles are given as fences; None: none, or nobody knows."""
    says_distances: bool = True
    """Whether it is known at which distance its segments are inspected: of a re-plan the missions alone say so."""

    def with_site_of(self, other: PlanFile) -> PlanFile:
        """Return this plan with what another one says of their site."""
        return replace(
            self,
            fly_again=other.fly_again,
            terrain=other.terrain,
            cameras=other.cameras,
            autopilots=other.autopilots,
            fence=other.fence,
        )

    @property
    def cost_name(self) -> str:
        """The cost as files and people name it."""
        return WINDOW_COST if self.cost is None else self.cost.value

    @property
    def areas(self) -> tuple[Area, ...]:
        """Areas that its ways lead around."""
        kept_out = () if self.pricing is None else self.pricing.kept_out
        return tuple(one.area for one in kept_out if one.area.name != UNKNOWN_GROUND)

    @property
    def ends_m(self) -> FloatArray:
        """(n, 2, 2) float64: east and north of every segment's a and b."""
        ends = [(segment.a_enu_m[:2], segment.b_enu_m[:2]) for segment in self.segments]
        return np.array(ends, dtype=np.float64).reshape(-1, 2, 2)

    def inspection_height_m(self, vehicle: str, position: int) -> float | None:
        """Return how high a vehicle inspects the segment at a position; None where everybody has its layer anyway."""
        if self.inspection is None or self.pricing is None:
            return None
        if not (self.says_distances and self.inspection.same_distance):
            return None
        height_m, pricing = self.inspection.height_m, self.pricing
        if position not in pricing.layered.get(vehicle, ()):
            return height_m
        return height_m + pricing.steps_m.get(vehicle, 0.0) + pricing.deep_m.get(position, 0.0)

    def build_task(self) -> Task:
        """Return the planning problem that the file is about.

        Raises:
            PlanFileError: its vehicles or coordinates do not make one.
        """
        ids = tuple(segment.id for segment in self.segments)
        return Task(self.build_instance(), ids, self.pricing, self.unreachable)

    def build_instance(self) -> Instance:
        """Return the planning problem over positions in ``segments``.

        Raises:
            PlanFileError: its vehicles or coordinates do not make one.
        """
        try:
            if self.pricing is not None:
                return build_priced_instance(self.pricing, self.vehicles)
            return build_instance(self.ends_m, DEPOT_M, self.vehicles, self.travel)
        except InstanceError as error:
            raise PlanFileError(f"{self.source}: {error}") from error

    def build_network(self) -> Network:
        """Return the file's segments as a network, numbered by their position; labels are their names.

        Raises:
            NetworkError: the segments do not make one.
        """
        pylons: dict[str, Pylon] = {}
        for segment in self.segments:
            places = (segment.a_lat_lon_deg, segment.b_lat_lon_deg)
            for name, place, elevation_m, height_m in zip(
                segment.pylons, places, segment.elevation_m, segment.height_m, strict=True
            ):
                pylons.setdefault(name, Pylon(name, *place, elevation_m, height_m))
        index = {name: number for number, name in enumerate(pylons)}
        segments = tuple(
            Segment(number, index[segment.pylons[0]], index[segment.pylons[1]], segment.display_name)
            for number, segment in enumerate(self.segments)
        )
        return Network(tuple(pylons.values()), segments, self.frame, self.source)


def make_plan_file(
    network: Network,
    task: Task,
    travel: Travel,
    plan: Plan,
    cost: Cost | None,
    solved: SolverRecord,
    *,
    window: Window | None = None,
    inspection: Inspection | None = None,
) -> PlanFile:
    """Return the content of a plan file; all figures come from the definition (``planner.evaluate``).

    Args:
        network: That the task was made from.
        task: The problem that was solved.
        travel: Speeds and rates, of the paper's model.
        plan: Over the task's instance.
        cost: What the plan was chosen by; None for ``window``, which must then be given.
        solved: How the plan came about.
        window: The re-plan window, if computed.
        inspection: How the routes are to be flown.

    Raises:
        planner.PlanError: the plan does not belong to the task.
        PlanFileError: it was chosen by a window that is not given.
    """
    if cost is None and window is None:
        raise PlanFileError("cost: expected the re-plan window that the plan was chosen by")
    evaluation = evaluate(task.instance, plan, cost or Cost.MINMAX)
    if inspection is not None and network.flat:
        # The file must say so itself: nothing else is asked when it is exported.
        inspection = replace(inspection, flat=True)
    return PlanFile(
        frame=network.frame,
        segments=tuple(build_plan_segment(network, segment) for segment in task.segment_ids),
        vehicles=task.instance.vehicles,
        travel=travel,
        plan=plan,
        durations_s=evaluation.durations_s,
        energies_pct=evaluation.energies_pct,
        cost=cost,
        cost_value=evaluation.value if cost is not None or window is None else window.earliest_s,
        solved=solved,
        window=window,
        inspection=inspection,
        pricing=task.pricing,
        unreachable=task.unreachable,
    )


def setup_of_plan(
    content: PlanFile, inspection: Inspection, *, pads: Sequence[Pad] | None = None, terrain: Terrain | None = None
) -> FlightSetup:
    """Return what a plan's routes become flights by.

    Args:
        content: The plan.
        inspection: Its heights and speeds.
        pads: Where the vehicles really stand, once known.
        terrain: The ground that it was made over, which is not in the plan itself.

    Raises:
        MissionsError: as `plan_flight_setup` has it.
    """
    names = [vehicle.name for vehicle in content.vehicles]
    setup = plan_flight_setup(
        content.build_network(), names, inspection, pads=pads, areas=content.areas, terrain=terrain
    )
    kept_out = () if content.pricing is None else content.pricing.kept_out
    return replace(setup, areas=content.areas, kept_out=kept_out) if content.areas else setup


def check_plan(content: PlanFile, *, search_window: bool = True) -> list[str]:
    """Return in words every figure of a plan file that its own content does not bear out; empty if all is well.

    Recomputed are the segments' places and lengths, every route's duration and energy, the cost, coverage, budgets and
    the re-plan window.

    Args:
        content: The file.
        search_window: Whether the window is searched for anew: a second or two for a hundred segments. Otherwise only
            its percentage and longest route are recomputed.

    Raises:
        PlanFileError: its vehicles or coordinates make no planning problem at all.
    """
    findings = list(_check_content(content))
    if search_window and content.window is not None and not findings:
        findings.extend(_check_window(content, content.window))
    return findings


def _check_window(content: PlanFile, written: Window) -> Iterator[str]:
    try:
        found = replan_window(content.build_instance(), content.plan, fly_again=content.fly_again)
    except PlanError as error:
        yield f"window: {error}"
        return
    yield from describe_wrong_figures([("window.earliest_s", written.earliest_s, found.earliest_s)])


def _check_content(content: PlanFile) -> Iterator[str]:
    yield from _check_places(content)
    if (pricing := content.pricing) is not None:
        visits = (visit for route in content.plan.routes for visit in route.visits)
        yield from describe_area_conflicts(pricing, content.segments, visits, pricing.bases.items())
    instance = content.build_instance()
    evaluation = evaluate(instance, content.plan, content.cost or Cost.MINMAX)
    figures = [
        (f"route of {vehicle.name}: {key}", written, computed)
        for key, all_written, all_computed in (
            ("duration_s", content.durations_s, evaluation.durations_s),
            ("energy_pct", content.energies_pct, evaluation.energies_pct),
        )
        for vehicle, written, computed in zip(content.vehicles, all_written, all_computed, strict=True)
    ]
    if content.cost is not None:
        figures.append((f"cost.value ({content.cost_name})", content.cost_value, evaluation.value))
    elif content.window is not None:
        figures.append((f"cost.value ({content.cost_name})", content.cost_value, content.window.earliest_s))
    if content.window is not None:
        longest_s = evaluation.longest_route_s
        window_pct = 100.0 * ((longest_s - content.window.earliest_s) / longest_s) if longest_s > 0 else 100.0
        figures.append(("window.longest_route_s", content.window.longest_route_s, longest_s))
        figures.append(("window.window_pct", content.window.window_pct, window_pct))
    yield from describe_wrong_figures(figures)
    yield from _check_coverage(content)
    for vehicle, energy_pct in zip(content.vehicles, evaluation.energies_pct, strict=True):
        if energy_pct > vehicle.budget_pct + FIGURE_TOLERANCE:
            yield f"route of {vehicle.name}: spends {energy_pct:.3f} %, its budget is {vehicle.budget_pct:.3f} %"


def _check_coverage(content: PlanFile) -> Iterator[str]:
    visited = {segment_of(visit) for route in content.plan.routes for visit in route.visits}
    for index, segment in enumerate(content.segments):
        if index not in visited and index not in content.plan.uncovered:
            yield f"{segment.display_name} is neither visited nor named as uncovered"


def _check_places(content: PlanFile) -> Iterator[str]:
    for segment in content.segments:
        for key, enu_m, lat_lon_deg in (
            ("a", segment.a_enu_m, segment.a_lat_lon_deg),
            ("b", segment.b_enu_m, segment.b_lat_lon_deg),
        ):
            apart_m = math.dist(enu_m[:2], content.frame.to_local_m(*lat_lon_deg))
            if not apart_m <= PLACE_TOLERANCE_M:
                yield f"{segment.display_name}: {key} and {key}_lat_lon_deg are {apart_m:.2f} m apart"
        length_m = math.dist(segment.a_enu_m[:2], segment.b_enu_m[:2])
        if not _is_same_figure(segment.length_m, length_m):
            yield f"{segment.display_name}: length_m is {segment.length_m:.6g}, its ends are {length_m:.6g} m apart"


def describe_area_conflicts(
    pricing: Pricing, segments: Sequence[PlanSegment], visits: Iterable[int], pads: Iterable[tuple[str, Base]]
) -> Iterator[str]:
    """Yield what of the inspection legs that are flown, and of vehicles' pads, is in an area."""
    flown, pads = sorted({segment_of(visit) for visit in visits}), list(pads)
    tracks_m = pricing.tracks_m[flown, :, :2]
    for one in pricing.kept_out:
        graph = build_area_graph(one.area)
        for number in np.flatnonzero(graph.is_met(tracks_m[:, 0], tracks_m[:, 1])).tolist():
            yield f"{segments[flown[number]].display_name} is flown, and lies in area {one.area.name!r}"
        for name, pad in pads:
            if name in one.vehicles and graph.is_inside(np.array([pad.place_m[:2]]))[0]:
                yield f"the pad of {name} lies in area {one.area.name!r}"


def describe_wrong_figures(figures: Iterable[tuple[str, float, float]]) -> Iterator[str]:
    """Yield which figures, by their name, are not what they were computed anew to be."""
    for name, written, computed in figures:
        if not _is_same_figure(written, computed):
            yield f"{name} is {written:.6g}, its content gives {computed:.6g}"


def _is_same_figure(written: float, computed: float) -> bool:
    return abs(written - computed) <= FIGURE_TOLERANCE * max(1.0, abs(computed))


def build_plan_segment(network: Network, number: int) -> PlanSegment:
    """Return a segment as plan files keep it."""
    segment = network.segments[number]
    a, b = network.pylons[segment.a], network.pylons[segment.b]
    a_m, b_m = network.ends_m[number].tolist()
    return PlanSegment(
        id=number,
        a_enu_m=(*a_m, _up_m(network.frame, a)),
        b_enu_m=(*b_m, _up_m(network.frame, b)),
        a_lat_lon_deg=(a.lat_deg, a.lon_deg),
        b_lat_lon_deg=(b.lat_deg, b.lon_deg),
        pylons=(a.id, b.id),
        length_m=float(network.lengths_m[number]),
        elevation_m=(a.elevation_m, b.elevation_m),
        height_m=(a.height_m, b.height_m),
        name=segment.label or None,
    )


def _up_m(frame: LocalFrame, pylon: Pylon) -> float:
    return 0.0 if pylon.elevation_m is None else frame.up_m(pylon.elevation_m)


@dataclass(frozen=True, slots=True)
class BasePlace:
    """A place where vehicles take off and land."""

    name: Text
    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    alt_m: Figure
    """Ground above mean sea level."""
    turnaround_s: From0 = 0.0
    """From a landing to the vehicle's next take-off."""
    packs: Id | None = None
    """Charged in the morning; without it there are always enough."""
    recharge_s: From0 | None = None
    """From a landing until the pack is charged; without it overnight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DayPlanFile(PlanContent):
    """What a plan of days says."""

    pricing: Pricing
    """As a single flight has it; its bases are the vehicles' own."""
    bases: tuple[BasePlace, ...]
    vehicles: tuple[SortieVehicle, ...]
    pads: tuple[tuple[Base, ...], ...]
    """For each vehicle its pad at each base."""
    days: tuple[Pair, ...]
    transfer_s: FloatArray
    stagger_s: float
    plan: SortiePlan
    """Over positions in ``segments``, in the order of ``vehicles``."""
    evaluation: SortieEvaluation
    objective: Objective
    windows: tuple[LossWindow, ...] = ()
    """Until when each vehicle must not be lost; empty if nobody looked."""
    part_of: str | None = None
    """The ``schedule_id`` of the whole plan that this is the rest of one day of; None for a whole plan."""

    @property
    def schedule_id(self) -> str:
        """What names the sorties of the whole plan: the same for its file, its copies and the rests of its days."""
        ids = [segment.id for segment in self.segments]
        flown = [
            (own.name, [(self.bases[one.base].name, one.visits, one.start_s) for one in sorties])
            for own, sorties in zip(self.vehicles, self.plan.sorties, strict=True)
        ]
        return self.part_of or sha256(repr((ids, self.days, flown)).encode()).hexdigest()[:16]

    @property
    def first_day(self) -> int:
        """The number of its first day among the days of the whole plan, from 1."""
        return int(self.days[0][0] // 86_400.0) + 1

    @property
    def cost_value(self) -> float:
        """What the plan was chosen by comes to: seconds, or a number of sorties."""
        found = self.evaluation
        values = {Objective.FINISH: found.finish_s, Objective.FLIGHT: found.flight_s, Objective.SWAPS: found.count}
        return float(values[self.objective])

    def build_instance(self) -> SortieInstance:
        """Return the planning problem over positions in ``segments``.

        Raises:
            PlanFileError: its content does not make one.
        """
        try:
            bases = [SortieBase(base.name, base.turnaround_s, base.packs, base.recharge_s) for base in self.bases]
            return build_priced_sorties(
                self.pricing, self.vehicles, self.pads, bases, self.days, self.transfer_s,
                stagger_s=self.stagger_s,
            )  # fmt: skip
        except InstanceError as error:
            raise PlanFileError(f"{self.source}: {error}") from error

    @property
    def count_packs(self) -> tuple[int, ...]:
        """Packs that each base needs, as ``count_packs_needed`` has it."""
        return count_packs_needed(self.build_instance(), self.plan, self.evaluation)

    def count_swaps(self, base: int) -> int:
        """Return how many sorties take a pack of a base."""
        return sum(one.base == base for own in self.plan.sorties for one in own)


def check_day_plan(content: DayPlanFile) -> list[str]:
    """Return in words every figure of a day plan that its own content does not bear out; empty if all is well.

    Recomputed are times, energies, packs, hours, take-offs and coverage; windows after losses are not searched anew.

    Raises:
        PlanFileError: its content makes no planning problem at all.
    """
    return list(_check_days(content))


def _check_days(content: DayPlanFile) -> Iterator[str]:
    computed, written = evaluate_sorties(content.build_instance(), content.plan), content.evaluation
    yield from describe_wrong_figures(
        (f"sortie {index} of {own.name}: {key}", *pair)
        for number, own in enumerate(content.vehicles)
        for key, mine, its in (
            ("duration_s", written.lasts_s[number], computed.lasts_s[number]),
            ("energy_pct", written.energies_pct[number], computed.energies_pct[number]),
        )
        for index, pair in enumerate(zip(mine, its, strict=True), 1)
    )
    yield from describe_wrong_figures(
        (key, getattr(written, key), getattr(computed, key)) for key in ("finish_s", "flight_s")
    )
    yield from computed.violations
    visits = (visit for own in content.plan.sorties for one in own for visit in one.visits)
    pads = ((own.name, content.pads[row][base]) for row, own in enumerate(content.vehicles) for base in own.lands)
    yield from describe_area_conflicts(content.pricing, content.segments, visits, pads)
