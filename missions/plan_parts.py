"""What a plan file is made of, key by key: vehicles, routes, segments, bases."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanVehicle:
    """A vehicle as the planner sees it."""

    name: Name
    """As in the site file; files are named after it."""
    start_m: Annotated[Pair, Field(alias="start")]
    """Where its first route starts: metres east and north of the depot."""
    budget_pct: Figure
    """What it may spend from a start until it is home, in percent of a full battery."""
    consumption: Above0 = 1.0
    """What it uses relative to the energy model."""
    autopilot: Annotated[str, one_of(one.name for one in AUTOPILOTS)] | None = None
    """Whose dialect its missions are in; files of version 1 may not say it."""
    airborne: Flag = False
    """Whether it flies already, and so pays its way home in any case."""
    start_up_m: Figure = 0.0
    """In the air: its height there, as `model` counts heights."""
    facing_m: Pair = (0.0, 0.0)
    """In the air: along which it arrived there, metres east and north; of no length where nobody knows."""

    def to_planner(self) -> Vehicle:
        """Return it as an instance has it."""
        return Vehicle(*(getattr(self, one.name) for one in fields(Vehicle)))


@dataclass(frozen=True, slots=True, kw_only=True)
class DayVehicle(PlanVehicle):
    """A vehicle of days: its start is its pad at its base, its budget what a sortie may use of a full pack."""

    base: Text
    """Where it stands in the morning of the first day."""
    lands: tuple[Text, ...]
    """Bases where it may land and take off."""
    hours: tuple[Pair, ...]
    """When it may fly, in seconds from the first midnight."""
    pads: tuple[Base, ...]
    """At each of the bases."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanVisit:
    """One segment of a route."""

    segment: Id
    """Its id."""
    reversed: Flag
    """Whether it is flown from b to a."""
    inspected_at_m: Figure | None = None
    """How high over the pylon tops, or over the depot's ground, where vehicles inspect as asked if they can."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRoute:
    """One sortie: what one vehicle flies on one pack, from its start to a base."""

    vehicle: str
    visits: tuple[PlanVisit, ...]
    """In the order of flight."""
    duration_s: Figure
    energy_pct: Figure
    """Of a full battery."""
    base: Text = DEPOT
    """Where it begins."""
    lands: Text = DEPOT
    """Where it ends."""
    start_s: Figure = 0.0
    """Of days: seconds from the first midnight."""
    day: Annotated[int, Field(ge=1)] = 1

    @property
    def network_visits(self) -> tuple[int, ...]:
        """Its visits of the network."""
        return tuple(visit_of(visit.segment, visit.reversed) for visit in self.visits)


@dataclass(frozen=True, slots=True)
class PlanCost:
    """What the plan was chosen by."""

    name: Annotated[str, one_of([*(cost.value for cost in Cost), WINDOW_COST])]
    value: Figure
    """In percent of a full battery; of a window, its ``earliest_s``."""


@dataclass(frozen=True, slots=True)
class DayCost:
    """What a plan of days was chosen by."""

    name: Annotated[str, one_of(objective.value for objective in Objective)]
    """When the last sortie lands, the time in the air, or the number of sorties."""
    value: Figure
    """In seconds, or sorties."""
