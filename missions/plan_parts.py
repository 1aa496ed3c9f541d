"""Parts of a plan file: vehicles, routes, segments, bases."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal

from pydantic import Field

from missions.autopilots.dialect import AUTOPILOTS
from missions.flight_model import Base
from missions.geo import MAX_LATITUDE_DEG
from missions.validation import Above0, Figure, Flag, From0, Id, Known, Name, Pair, Place, Text, one_of
from planner import Cost, Vehicle, visit_of
from planner.sorties import Objective

DEPOT = "depot"
"""The only base of a single flight."""
WINDOW_COST = "window"
COVERAGE_COST = "coverage"
"""Cost name of a plan chosen by its re-plan window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSegment:
    """Part of a line between two pylons, a and b: one segment of the plan's own network."""

    id: Id
    """Segment id in the network; a plan over part of a network skips some."""
    name: Text | None = None
    """Name in the network file."""
    a_enu_m: Annotated[Place, Field(alias="a")]
    """Metres east, north and up from the depot; up is 0 if the ground height is unknown."""
    b_enu_m: Annotated[Place, Field(alias="b")]
    a_lat_lon_deg: Pair
    b_lat_lon_deg: Pair
    pylons: tuple[str, str]
    length_m: Figure
    """Horizontal length."""
    elevation_m: Known = (None, None)
    """Ground at a and b above mean sea level, if known."""
    height_m: Known = (None, None)
    """Structure heights at a and b, if known."""

    @property
    def display_name(self) -> str:
        """Display name."""
        return self.name or f"segment {self.id}"


@dataclass(frozen=True, slots=True)
class BreakingLoss:
    """A loss that no re-plan can recover."""

    vehicle: Text
    """Vehicle name."""
    from_s: Figure
    to_s: Figure


@dataclass(frozen=True, slots=True)
class Window:
    """The re-plan window: the time from which the others can finish if any one vehicle is lost, or any two."""

    window_pct: Figure
    """Window as a share of the longest route."""
    earliest_s: Figure
    longest_route_s: Figure
    breaking: BreakingLoss | None = None
    """Latest loss before it without a re-plan."""
    losses: Literal[2] | None = None
    """2 if any two vehicles may be lost, one after the other or at once; None if any one may."""
    then: BreakingLoss | None = None
    """Second loss without a re-plan after that one; None if that one alone has none."""


@dataclass(frozen=True, slots=True)
class CoverageChance:
    """The estimated probability that everything is inspected, under random losses with re-plans."""

    mtbf_h: Annotated[Figure, Field(gt=0)]
    """Mean flight hours between failures of one vehicle."""
    probability: Figure
    low_95: Figure
    """Lower end of the 95 % confidence interval."""
    high_95: Figure
    uninspected_m: Figure
    """Expected metres left uninspected."""
    flights: Annotated[int, Field(ge=1)]
    """Number of simulated flights, which the plan was not chosen by."""
    seed: Annotated[int, Field(ge=0)]
    """Random seed of these flights."""


@dataclass(frozen=True, slots=True)
class SolverRecord:
    """Record of the solver run."""

    solver: str
    seed: int
    seconds: float
    """Solver time."""


@dataclass(frozen=True, slots=True)
class PlanTerrain:
    """The ground that a plan was made over; its heights are not part of the file."""

    source: Text
    """Name of the raster."""
    digest: Text
    """Digest of the data that was read."""
    vertical: Text
    """Vertical reference of its heights."""
    uncertainty_m: Figure
    """Error that 90 % of the heights stay within."""
    margin_m: Figure
    """Margin of every leg above ground, in addition."""
    line_margin_m: Figure | None = None
    """Margin of every leg above lines; default: a share of the inspection height."""


@dataclass(frozen=True, slots=True)
class PlanFence:
    """Fence settings of the site, also used in exports to other ground stations."""

    margin_m: Above0
    """Least distance of a fence from its vehicle's routes."""
    rally: Literal["pad", "keep"]
    """Where RTL may end: at its pad, or as configured on board."""


@dataclass(frozen=True, slots=True)
class BasePlace:
    """A place where vehicles take off and land."""

    name: Text
    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    alt_m: Figure
    """Ground above mean sea level."""
    turnaround_s: From0 = 0.0
    """Time from landing to the vehicle's next take-off."""
    packs: Id | None = None
    """Charged packs at the start of the day; default: always enough."""
    recharge_s: From0 | None = None
    """Time from landing until the pack is charged; default: overnight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanVehicle:
    """A vehicle as an input of the planner."""

    name: Name
    """Name as in the site file; file names use it."""
    start_m: Annotated[Pair, Field(alias="start")]
    """Start of its first route, in metres east and north of the depot."""
    budget_pct: Figure
    """Energy budget from take-off to landing, in percent of a full battery."""
    consumption: Above0 = 1.0
    """Consumption relative to the energy model."""
    autopilot: Annotated[str, one_of(one.name for one in AUTOPILOTS)] | None = None
    """Autopilot of its missions; files of version 1 may omit it."""
    airborne: Flag = False
    """Whether it is in the air, so that its return costs energy in any case."""
    start_up_m: Figure = 0.0
    """In the air: its height in the reference of `model`."""
    facing_m: Pair = (0.0, 0.0)
    """In the air: direction of arrival, metres east and north; zero if unknown."""

    def to_planner(self) -> Vehicle:
        """Return the planner's vehicle."""
        return Vehicle(*(getattr(self, one.name) for one in fields(Vehicle)))


@dataclass(frozen=True, slots=True, kw_only=True)
class DayVehicle(PlanVehicle):
    """A vehicle of a day plan: its start is its pad at its base, its budget the usable part of a pack per sortie."""

    base: Text
    """Base at the start of the first day."""
    lands: tuple[Text, ...]
    """Bases where it may land and take off."""
    hours: tuple[Pair, ...]
    """Hours in which it may fly, in seconds from the first midnight."""
    pads: tuple[Base, ...]
    """Pads at each base."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanVisit:
    """One segment of a route."""

    segment: Id
    """Segment id."""
    reversed: Flag
    """Whether it is flown from b to a."""
    inspected_at_m: Figure | None = None
    """Inspection height above pylon tops, or above the depot's ground, if vehicles leave their layers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRoute:
    """One sortie: the flight of one vehicle on one pack, from its start to a base."""

    vehicle: str
    visits: tuple[PlanVisit, ...]
    """Visits in order of flight."""
    duration_s: Figure
    energy_pct: Figure
    """Energy in percent of a full battery."""
    base: Text = DEPOT
    """Base of take-off."""
    lands: Text = DEPOT
    """Base of landing."""
    start_s: Figure = 0.0
    """Start time on days, in seconds from the first midnight."""
    day: Annotated[int, Field(ge=1)] = 1

    @property
    def network_visits(self) -> tuple[int, ...]:
        """Its visits, by the network's segments."""
        return tuple(visit_of(visit.segment, visit.reversed) for visit in self.visits)


@dataclass(frozen=True, slots=True)
class PlanCost:
    """Objective of the plan."""

    name: Annotated[str, one_of([*(cost.value for cost in Cost), WINDOW_COST, COVERAGE_COST])]
    value: Figure
    """Cost in percent of a full battery; for a window, its ``earliest_s``; for coverage, the probability."""
    bound: Figure | None = None
    """Proven least cost of a plan with as many segments and flying vehicles; only ``--solver exact`` proves one."""


@dataclass(frozen=True, slots=True)
class DayCost:
    """Objective of a day plan."""

    name: Annotated[str, one_of(objective.value for objective in Objective)]
    """Objective: last landing, time in the air, or number of sorties."""
    value: Figure
    """Value in seconds, or in sorties."""
