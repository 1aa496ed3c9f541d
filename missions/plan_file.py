"""Plans of a flight and of days, with all data to check and to fly them: the plan file, ``faultline-plan/2``.

The classes match the file, key by key; ``plan_json`` writes and reads them unchanged. They identify segments by the
network's ids; planner problems (``plan``, ``build_instance``) use positions in ``segments``.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from operator import not_
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from missions import plan_parts
from missions.errors import PlanFileError
from missions.flight_model import Base
from missions.geo import FloatArray, LocalFrame
from missions.inspection_defaults import Inspection
from missions.network import Network, Pylon, Segment
from missions.no_fly_areas import UNKNOWN_GROUND, Area, Unreachable
from missions.pads import Pad
from missions.pricing import DEPOT_M, Pricing, Task, build_priced_instance, price_fleet
from missions.setup import FlightSetup, plan_flight_setup
from missions.terrain import Terrain
from missions.validation import Figure, Flag, From0, Id, Pair, Printable, Text
from planner import (
    Cost,
    Instance,
    InstanceError,
    Plan,
    Route,
    Travel,
    build_instance,
    evaluate,
    is_reversed,
    segment_of,
    sorties,
)
from planner.model import renumber_visits

FORMAT: Final = "faultline-plan/2"


@dataclass(frozen=True, kw_only=True)
class PlanContent:
    """Common content of plans of a single flight and of days."""

    # Strict and finite for the planner's types too, which do not define document rules.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True, allow_inf_nan=False)

    format: Literal["faultline-plan/2"]
    frame: Annotated[LocalFrame, Field(alias="depot")]
    """Origin of the local metres, WGS 84."""
    bases: Annotated[tuple[plan_parts.BasePlace, ...], Field(min_length=1)]
    """Bases; a single flight has only the depot."""
    vehicles: Annotated[tuple[plan_parts.PlanVehicle, ...], Field(min_length=1)]
    routes: tuple[plan_parts.PlanRoute, ...]
    """Routes: one per vehicle in a single flight, in order; for days, each vehicle's sorties in order of time."""
    uncovered: tuple[Id, ...]
    """Ids of segments that no route covers."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)]
    """Seed of the solver."""
    solver: Printable
    """Name of the solver."""
    seconds: Figure
    """Seconds that it took."""
    pricing: Annotated[Pricing | None, Field(alias="model")]
    unreachable: Annotated[tuple[Unreachable, ...], Field(exclude_if=not_)] = ()
    """Requested segments that lie in or behind an area, so that they are not planned."""
    terrain: plan_parts.PlanTerrain | None = None
    """Terrain data behind the plan, if any."""
    cameras: Annotated[tuple[Printable, ...], Field(exclude_if=not_)] = ()
    """Names of the cameras that its missions use; the site has the details."""
    segments: tuple[plan_parts.PlanSegment, ...]
    source: Annotated[SkipJsonSchema[Any], Field(exclude=True)] = field(default="plan", compare=False)
    """Source, for messages; not part of the file."""

    @cached_property
    def positions(self) -> Mapping[int, int]:
        """Positions in `segments`, by id."""
        return {segment.id: index for index, segment in enumerate(self.segments)}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return tuple(vehicle.name for vehicle in self.vehicles)

    @property
    def areas(self) -> tuple[Area, ...]:
        """Areas that its paths lead around."""
        kept_out = () if self.pricing is None else self.pricing.kept_out
        return tuple(one.area for one in kept_out if one.area.name != UNKNOWN_GROUND)

    @property
    def solved(self) -> plan_parts.SolverRecord:
        """Record of the solver run."""
        return plan_parts.SolverRecord(self.solver, self.seed, self.seconds)

    @cached_property
    def plan(self) -> Plan:
        """The routes as the planner's plan, over positions in ``segments``.

        Raises:
            planner.PlanError: it contains a segment twice.
        """
        vehicle, base = self.names.index, [place.name for place in self.bases].index
        routes = (
            Route(vehicle(one.vehicle), self.visits_of(one), base(one.base), base(one.lands), one.start_s)
            for one in self.routes
        )
        return Plan(
            tuple(sorted(routes, key=lambda route: route.vehicle)),
            tuple(self.positions[segment] for segment in self.uncovered),
        )

    def build_routes(
        self, plan: Plan, durations_s: Sequence[float], energies_pct: Sequence[float]
    ) -> tuple[plan_parts.PlanRoute, ...]:
        """Return a plan's routes for the file, with the figures of each."""
        return tuple(
            plan_parts.PlanRoute(
                vehicle=self.names[route.vehicle],
                visits=tuple(
                    plan_parts.PlanVisit(
                        segment=self.segments[segment_of(visit)].id, reversed=is_reversed(visit),
                        inspected_at_m=self.inspection_height_m(route.vehicle, segment_of(visit)),
                    )
                    for visit in route.visits
                ),
                duration_s=duration_s, energy_pct=energy_pct,
                base=self.bases[route.base].name, lands=self.bases[route.lands].name, start_s=route.start_s,
            )
            for route, duration_s, energy_pct in zip(plan.routes, durations_s, energies_pct, strict=True)
        )  # fmt: skip

    def inspection_height_m(self, vehicle: int, position: int) -> float | None:  # noqa: ARG002 - of days nobody says so
        """Return the height at which a vehicle inspects the segment at a position, if known in advance."""
        return None

    def visits_of(self, route: plan_parts.PlanRoute) -> tuple[int, ...]:
        """Return a route's visits, over positions in ``segments``."""
        return renumber_visits(route.network_visits, self.positions)


@dataclass(frozen=True, kw_only=True)
class PlanFile(PlanContent):
    """A plan, with all data to check and to fly it."""

    travel: Travel
    cost: plan_parts.PlanCost
    window: plan_parts.Window | None = None
    coverage: plan_parts.CoverageChance | None = None
    """The probability that the plan was chosen by."""
    inspection: Inspection | None = None
    """Inspection settings; without them the plan can be checked but not flown."""
    pricing: Annotated[Pricing | None, Field(alias="model")] = field(default=None, compare=False)
    """Model of times and energies; without it they follow from `travel` and straight lines between pylons, as in the
    paper. Segments are positions in `segments`."""
    fly_again: Flag = True
    """Whether landed vehicles may fly again after a loss; the window accounts for it."""
    fence: plan_parts.PlanFence | None = None
    """Fences to upload; without it none."""

    @property
    def network_routes(self) -> dict[str, tuple[int, ...]]:
        """Each vehicle's visits by the network's segments, by vehicle name."""
        return {route.vehicle: route.network_visits for route in self.routes}

    @property
    def durations_s(self) -> tuple[float, ...]:
        """Durations of the routes."""
        return tuple(route.duration_s for route in self.routes)

    @property
    def energies_pct(self) -> tuple[float, ...]:
        """Energies of the routes."""
        return tuple(route.energy_pct for route in self.routes)

    def inspection_height_m(self, vehicle: int, position: int) -> float | None:
        """Return the height at which a vehicle inspects the segment at a position; None if all stay in their layers."""
        if self.inspection is None or self.pricing is None or not self.inspection.same_distance:
            return None
        height_m, pricing, name = self.inspection.height_m, self.pricing, self.names[vehicle]
        if position not in pricing.layered.get(name, ()):
            return height_m
        return height_m + pricing.steps_m.get(name, 0.0) + pricing.deep_m.get(position, 0.0)

    def with_site_of(self, other: PlanFile) -> PlanFile:
        """Return this plan with the site data of another."""
        autopilots = {one.name: one.autopilot for one in other.vehicles}
        return replace(
            self,
            vehicles=tuple(replace(one, autopilot=autopilots.get(one.name)) for one in self.vehicles),
            fly_again=other.fly_again,
            terrain=other.terrain,
            cameras=other.cameras,
            fence=other.fence,
        )

    @property
    def ends_m(self) -> FloatArray:
        """(n, 2, 2) float64: east and north of every segment's a and b."""
        ends = [(segment.a_enu_m[:2], segment.b_enu_m[:2]) for segment in self.segments]
        return np.array(ends, dtype=np.float64).reshape(-1, 2, 2)

    def build_task(self) -> Task:
        """Return the planning problem of the file.

        Raises:
            PlanFileError: its vehicles or coordinates are invalid.
        """
        return Task(self.build_instance(), tuple(self.positions), self.pricing, self.unreachable)

    def build_instance(self) -> Instance:
        """Return the planning problem over positions in ``segments``.

        Raises:
            PlanFileError: its vehicles or coordinates are invalid.
        """
        vehicles = [one.to_planner() for one in self.vehicles]
        try:
            if self.pricing is not None:
                return build_priced_instance(self.pricing, vehicles)
            return build_instance(self.ends_m, DEPOT_M, vehicles, self.travel)
        except InstanceError as error:
            raise PlanFileError(f"{self.source}: {error}") from error

    def build_network(self) -> Network:
        """Return the file's segments as a network, numbered by their position; labels are their names.

        Raises:
            NetworkError: the segments are not a valid network.
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


@dataclass(frozen=True, kw_only=True)
class DayPlanFile(PlanContent):
    """Days of many sorties, with all data to check and to fly them."""

    days: Annotated[tuple[Pair, ...], Field(min_length=1)]
    """Start and end of each day, in seconds from the first midnight."""
    stagger_s: From0
    """Least time between two take-offs from a base."""
    transfers_s: tuple[tuple[From0 | None, ...], ...]
    """Driving times between bases; null where vehicles are not driven."""
    vehicles: Annotated[tuple[plan_parts.DayVehicle, ...], Field(min_length=1)]
    cost: plan_parts.DayCost
    finish_s: Figure
    """Landing time of the last sortie, in seconds from the first midnight."""
    flight_s: Figure
    """Total flight time of all sorties."""
    pricing: Annotated[Pricing, Field(alias="model")] = field(compare=False)
    """Model of times and energies."""
    windows: tuple[sorties.LossWindow, ...] = ()
    """Times from which the loss of each vehicle can be absorbed, if computed."""
    part_of: Text | None = None
    """Id of the day plan that this plan continues."""

    def routes_of(self, vehicle: str) -> tuple[plan_parts.PlanRoute, ...]:
        """Return a vehicle's sorties in order of time."""
        return tuple(route for route in self.routes if route.vehicle == vehicle)

    def routes_on(self, day: int) -> tuple[plan_parts.PlanRoute, ...]:
        """Return all sorties of a day, counted from 0."""
        begin_s, end_s = self.days[day]
        return tuple(route for route in self.routes if begin_s <= route.start_s < end_s)

    @property
    def flying(self) -> int:
        """Number of vehicles that fly."""
        return len({route.vehicle for route in self.routes})

    @property
    def base_names(self) -> list[str]:
        """Names of the bases."""
        return [base.name for base in self.bases]

    @property
    def pads(self) -> list[tuple[str, Base]]:
        """Each vehicle by name, with its pads at the bases where it may land."""
        return [
            (own.name, pad) for own in self.vehicles for name, pad in zip(self.base_names, own.pads, strict=True)
            if name in own.lands
        ]  # fmt: skip

    @property
    def schedule_id(self) -> str:
        """Id of the sorties of the whole plan: the same for its file, its copies and the remainders of its days."""
        flown = [
            (name, [(one.base, self.visits_of(one), one.start_s) for one in self.routes_of(name)])
            for name in self.names
        ]
        return self.part_of or sha256(repr(([*self.positions], self.days, flown)).encode()).hexdigest()[:16]

    @property
    def first_day(self) -> int:
        """Number of its first day among the days of the whole plan, from 1."""
        return int(self.days[0][0] // 86_400.0) + 1

    def with_plan(self, plan: Plan, found: sorties.SortieEvaluation, objective: sorties.Objective) -> DayPlanFile:
        """Return these days with another plan, its evaluation and its objective."""
        ends_s = [end_s for _, end_s in self.days[:-1]]
        return replace(
            self,
            routes=tuple(
                replace(route, day=1 + bisect_right(ends_s, route.start_s))
                for route in self.build_routes(plan, found.durations_s, found.energies_pct)
            ),
            uncovered=tuple(self.segments[number].id for number in plan.uncovered),
            cost=plan_parts.DayCost(objective.value, found.value_of(objective)),
            finish_s=found.finish_s,
            flight_s=found.flight_s,
        )

    def build_instance(self) -> sorties.SortieInstance:
        """Return the planning problem over positions in ``segments``; moves are priced on demand.

        Raises:
            PlanFileError: its content is invalid.
        """
        base, bases, segments = self.base_names.index, len(self.bases), len(self.segments)
        # Locks do not affect prices here: a lock ends with its vehicle.
        flown, profiles = price_fleet(replace(self.pricing, locked={}), self.names)
        out = np.zeros((2, len(profiles), bases, 2 * segments))
        home = np.zeros((2, len(profiles), 2 * segments, bases))
        able = np.ones((len(profiles), segments), dtype=np.bool_)
        for row, (own, profile) in enumerate(zip(self.vehicles, profiles, strict=True)):
            factors = np.array([1.0, own.consumption])[:, np.newaxis]
            able[row, list(self.pricing.barred.get(own.name, ()))] = False
            for place, pad in enumerate(own.pads):
                out[:, row, place] = factors * flown.price_out(profile, pad)
                home[:, row, :, place] = factors * flown.price_home(profile, pad)
        try:
            return sorties.SortieInstance(
                moves=flown,
                bases=tuple(
                    sorties.SortieBase(one.name, one.turnaround_s, one.packs, one.recharge_s) for one in self.bases
                ),
                vehicles=tuple(
                    sorties.SortieVehicle(
                        own.name, base(own.base), own.budget_pct, own.hours, tuple(map(base, own.lands)), profile,
                        own.consumption, ready_s=self.days[0][0],
                    )
                    for own, profile in zip(self.vehicles, profiles, strict=True)
                ),
                days=self.days,
                out_s=out[0], out_pct=out[1], home_s=home[0], home_pct=home[1],
                transfer_s=np.array([[math.inf if one is None else one for one in row] for row in self.transfers_s]),
                able=able,
                wanted=np.ones(segments, dtype=np.bool_),
                stagger_s=self.stagger_s,
                locked={
                    segment: self.names.index(keeper) for segment, keeper in self.pricing.locked.items()
                },
            )  # fmt: skip
        except InstanceError as error:
            raise PlanFileError(f"{self.source}: {error}") from error

    def count_packs(self) -> tuple[int, ...]:
        """Return the number of packs that each base needs, see ``count_packs_needed``."""
        return sorties.count_packs_needed(self.build_instance(), self.plan.routes)


def make_plan_file(
    network: Network,
    task: Task,
    travel: Travel,
    plan: Plan,
    chosen_by: Cost | plan_parts.Window | plan_parts.CoverageChance,
    solved: plan_parts.SolverRecord,
    *,
    inspection: Inspection | None = None,
    says_distances: bool = True,
) -> PlanFile:
    """Return the content of a plan file; all figures are computed by their definition (``planner.evaluate``).

    Args:
        network: Network of the task.
        task: The solved problem.
        travel: Speeds and rates of the paper's model.
        plan: Plan over the task's instance.
        chosen_by: A cost; the plan's re-plan window, where an earlier begin is better; or its probability of coverage.
        solved: Record of the solver run.
        inspection: Inspection settings of the routes.
        says_distances: Whether the inspection distances of its segments are known: for a re-plan only the missions
            define them.

    Raises:
        planner.PlanError: the plan does not belong to the task.
    """
    window = chosen_by if isinstance(chosen_by, plan_parts.Window) else None
    coverage = chosen_by if isinstance(chosen_by, plan_parts.CoverageChance) else None
    evaluation = evaluate(task.instance, plan, chosen_by if isinstance(chosen_by, Cost) else Cost.MINMAX)
    if inspection is not None and network.flat:
        # The file itself must state this: an export has no other source.
        inspection = replace(inspection, flat=True)
    frame = network.frame
    content = PlanFile(
        format=FORMAT,
        frame=frame,
        bases=(plan_parts.BasePlace(plan_parts.DEPOT, frame.lat_deg, frame.lon_deg, frame.alt_m),),
        vehicles=tuple(plan_parts.PlanVehicle(**asdict(vehicle)) for vehicle in task.instance.vehicles),
        routes=(),
        uncovered=tuple(task.segment_ids[number] for number in plan.uncovered),
        **asdict(solved),
        pricing=task.pricing,
        unreachable=task.unreachable,
        segments=tuple(build_plan_segment(network, segment) for segment in task.segment_ids),
        travel=travel,
        cost=plan_parts.PlanCost(chosen_by.value, evaluation.value) if isinstance(chosen_by, Cost)
        else plan_parts.PlanCost(plan_parts.WINDOW_COST, chosen_by.earliest_s)
        if isinstance(chosen_by, plan_parts.Window)
        else plan_parts.PlanCost(plan_parts.COVERAGE_COST, chosen_by.probability),
        window=window,
        coverage=coverage,
        inspection=inspection,
    )  # fmt: skip
    said = content if says_distances else replace(content, inspection=None)
    return replace(content, routes=said.build_routes(plan, evaluation.durations_s, evaluation.energies_pct))


def setup_of_plan(
    content: PlanFile, inspection: Inspection, *, pads: Sequence[Pad] | None = None, terrain: Terrain | None = None
) -> FlightSetup:
    """Return the setup that turns a plan's routes into flights.

    Args:
        content: The plan.
        inspection: Heights and speeds.
        pads: Actual pads, once known.
        terrain: The ground that it was made over, which is not stored in the plan.

    Raises:
        MissionsError: as for `plan_flight_setup`.
    """
    setup = plan_flight_setup(
        content.build_network(), content.names, inspection, pads=pads, areas=content.areas, terrain=terrain
    )
    kept_out = () if content.pricing is None else content.pricing.kept_out
    return replace(setup, areas=content.areas, kept_out=kept_out) if content.areas else setup


def build_plan_segment(network: Network, number: int) -> plan_parts.PlanSegment:
    """Return a segment in the format of plan files."""
    segment = network.segments[number]
    a, b = network.pylons[segment.a], network.pylons[segment.b]
    a_m, b_m = network.ends_m[number].tolist()
    return plan_parts.PlanSegment(
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
