"""`faultline bench distance`: actual inspection distance and separation of vehicles, flown with faults.

With `same_distance` every vehicle inspects at the requested distance wherever no other vehicle's path crosses. Fleets
fly over parts of the network in virtual time, in wind, some of them slower than planned; vehicles crash, fall silent,
return under their pilots' control, or use too much energy. The report on each segment, and the separation of any two
vehicles, are checked against the simulator's own positions.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np

from benchmarks.parallel_flights import FlightCase
from benchmarks.prediction import plan_with
from benchmarks.separation import SeparationWatch
from benchmarks.store import Json
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site, size_batteries, with_budgets
from executor.errors import ExecutorError
from executor.site import site_model
from executor.site.site_model import SiteModel
from executor.site.site_planning import rearrange_plan
from missions import PlanFile
from missions.geometry import locate_on_leg
from planner import Cost, NoImprovement, solve
from simulator.fleet import SimulatedVehicle

VEHICLES = (3, 8)
RADII_M = (400.0, 500.0, 600.0, 700.0)
"""Radii about the depot: 13 to 33 segments of faultline's own network."""
WIND_M_S = 6.0
SLOWER = 0.2
"""A vehicle flies up to this share slower than commanded: it is late by a minute and more."""
USES_PCT = 45.0
"""Default share of the battery that the most expensive route uses."""
BUDGET_PCT = 75.0
"""Budget of a vehicle: enough to take over another's part, and to descend to the line for it."""
SETTLED = 500
FAULTS = ("crash", "silent", "silent=30", "pilot=RTL", "drain=4", "")
"""Faults of a vehicle, equally frequent; the last is none."""
SECOND = 0.3
"""Share of flights in which a second vehicle has a fault too."""
AIRBORNE_M = 1.0
OFF_M = 1.0
"""Tolerance of the distance."""
ALONG = 0.1
"""Share of a segment, at both ends, where a vehicle may still climb or descend."""
ASIDE_M = 3.0
FAST = 1.35
"""Speed above this multiple of the inspection's is a transit."""


@dataclass(frozen=True, slots=True)
class DistanceFlight:
    """Result of one flight."""

    number: int
    autopilot: str
    vehicles: int
    segments: int
    faults: tuple[str, ...]
    planned_asked: int
    """Segments that the plan inspects at the requested distance."""
    counted: int
    """Segments that count."""
    counted_asked: int
    """Of these, the ones reported at the requested distance."""
    untold: int
    """Of these, the ones reported without a distance."""
    off: tuple[str, ...]
    """Segments where the vehicle was truly farther off than reported."""
    replans: int
    nearest_m: float
    """Minimum separation of any two in the air, in the simulator."""
    promised_m: float
    nearest: str
    """Their names, and the time."""
    longest_s: float
    longest_in_layers_s: float
    """Longest route of the same plan, with every vehicle in its layer all the time."""
    flown_s: float
    wrong: str = ""
    """Why there was no flight, or why it did not end."""

    @property
    def longer_pct(self) -> float:
        """Extra length of the longest route, relative to every vehicle in its layer."""
        return 100.0 * (self.longest_s / self.longest_in_layers_s - 1.0)

    @property
    def lasted_longer_pct(self) -> float:
        """Extra duration of the flight, relative to the planned longest route."""
        return 100.0 * (self.flown_s / self.longest_s - 1.0)


@dataclass(slots=True)
class _Watched:
    """True positions of all vehicles, ten times a second."""

    ground: SiteModel
    separation: SeparationWatch = field(default_factory=SeparationWatch)
    places_m: dict[str, list[tuple[float, float, float, float]]] = field(default_factory=dict)
    """East, north, up and ground speed."""

    def look(self, vehicles: Mapping[str, SimulatedVehicle]) -> None:
        """Record present positions; a crashed vehicle falls where it is."""
        up: dict[str, tuple[float, float, float]] = {}
        for name, vehicle in vehicles.items():
            frame, pad = vehicle.autopilot.frame, self.ground.setup.pad_of(name)
            body, pad_m = frame.body, self.ground.network.frame.up_m(pad.alt_m)
            place_m = (pad.east_m + body.east_m, pad.north_m + body.north_m, pad_m + body.up_m)
            if body.up_m > AIRBORNE_M and frame.crashed_s is None and not frame.wrecked:
                up[name] = place_m
                speed_m_s = math.hypot(body.v_east_m_s, body.v_north_m_s)
                self.places_m.setdefault(name, []).append((*place_m, speed_m_s))
        self.separation.compare(up)

    def inspected_at_m(self, vehicle: str, segment: int) -> list[float]:
        """Return the distances at which a vehicle flew along a segment at inspection speed."""
        setup = self.ground.setup
        (begin_east_m, begin_north_m), (end_east_m, end_north_m) = setup.tracks_m[segment].tolist()
        begin_m, end_m = (begin_east_m, begin_north_m), (end_east_m, end_north_m)
        length_m, inspection = math.dist(begin_m, end_m), setup.inspection
        found = []
        for east_m, north_m, up_m, speed_m_s in self.places_m.get(vehicle, ()):
            along_m, aside_m = locate_on_leg(begin_m, end_m, (east_m, north_m))
            inside = ALONG * length_m < along_m < (1.0 - ALONG) * length_m and aside_m < ASIDE_M
            if inside and speed_m_s < FAST * inspection.speed_m_s:
                surface_m = setup.layers.surface.height_m(east_m, north_m)
                found.append(up_m - surface_m + inspection.height_m)
        return found


def fly_distance(case: FlightCase, *, uses_pct: float = USES_PCT) -> DistanceFlight:
    """Generate a flight, fly it, and check it against the truth; the same case gives the same figures.

    Args:
        case: The case.
        uses_pct: Share of a battery that the most expensive route uses; it sets the size of the batteries.
    """
    rng = np.random.default_rng([case.seed, 29, case.number])
    count = int(rng.integers(VEHICLES[0], VEHICLES[1] + 1))
    speed_m_s, course = float(rng.uniform(0.0, WIND_M_S)), float(rng.uniform(0.0, 2.0 * math.pi))
    wind_m_s = (speed_m_s * math.sin(course), speed_m_s * math.cos(course))
    ground, plan, layered_s = _plan_site(
        case, count, float(rng.choice(RADII_M)), wind_m_s, int(rng.integers(1 << 30)), uses_pct
    )
    faults = drawn_faults(ground.names, FAULTS, rng)
    slower = {name: 1.0 - SLOWER * float(rng.random()) * (rng.random() < SECOND) for name in ground.names}
    watched, asked_m = _Watched(ground), ground.setup.inspection.height_m
    planned_asked = sum(visit.inspected_at_m == asked_m for route in plan.routes for visit in route.visits)
    empty = DistanceFlight(
        case.number, case.autopilot, count, len(plan.segments), faults, planned_asked, 0, 0, 0, (), 0, math.inf,
        ground.setup.inspection.layer_m, "", max(plan.durations_s), layered_s, 0.0,
    )  # fmt: skip
    try:
        flight = fly_virtual(
            ground, plan, faults=faults, seed=case.number, onlookers=FlightObservers(lived=watched.look),
            craft=lambda one: replace(one, wind_m_s=wind_m_s, speed_reached=slower[one.name]),
        )  # fmt: skip
    except ExecutorError as error:
        return replace(empty, wrong=str(error))
    return _judge_flight(empty, flight, watched)


def drawn_faults(
    names: Sequence[str], kinds: Sequence[str], rng: np.random.Generator, between_pct: tuple[int, int] = (10, 95)
) -> tuple[str, ...]:
    """Draw faults of one vehicle, sometimes of another too, but never of all, as for ``--fault``."""
    count = 2 if rng.random() < SECOND else 1
    found = []
    for name in rng.choice(names, size=min(count, len(names) - 1), replace=False):
        kind = str(rng.choice(kinds))
        if kind:
            found.append(f"{name}:{kind}@{int(rng.integers(*between_pct))}%")
    return tuple(found)


def kind_of(fault: str) -> str:
    """Return the kind of a fault given as for ``--fault``."""
    return re.split("[:=@]", fault)[1]


def _plan_site(
    case: FlightCase, vehicles: int, radius_m: float, wind_m_s: tuple[float, float], seed: int, uses_pct: float
) -> tuple[SiteModel, PlanFile, float]:
    """Return a site, a plan at the requested distance, and its longest route's time with every vehicle in its layer."""
    ground = build_virtual_site(
        None, radius_m, vehicles, case.autopilot, wind_m_s=wind_m_s, capacity_ah=AMPLE_AH, same_distance=True
    )
    task = site_model.build_first_task(ground, range(len(ground.network.segments)))
    plan = solve(task.instance, cost=Cost.MINMAX, stop=NoImprovement(SETTLED), seed=seed).plan
    routes = site_model.name_routes(ground, task, rearrange_plan(ground, task, plan, Cost.MINMAX))
    ground = with_budgets(size_batteries(ground, plan_with(ground, routes), uses_pct), BUDGET_PCT)
    layered = build_virtual_site(
        None, radius_m, vehicles, case.autopilot, wind_m_s=wind_m_s, capacity_ah=ground.drone.capacity_ah
    )
    return ground, plan_with(ground, routes), max(plan_with(layered, routes).durations_s)


def _judge_flight(empty: DistanceFlight, flight: VirtualFlight, watched: _Watched) -> DistanceFlight:
    """Check a flight against the simulator's positions."""
    asked_m, rows = watched.ground.setup.inspection.height_m, flight.report.inspections
    off = []
    for row in rows:
        if row.inspected_at_m is None:
            continue
        really_m = watched.inspected_at_m(row.vehicle, row.segment)
        if not any(abs(at_m - row.inspected_at_m) <= OFF_M for at_m in really_m):
            nearest = min(really_m, key=lambda at_m: abs(at_m - (row.inspected_at_m or 0.0)), default=math.nan)
            off.append(f"{row.segment} by {row.vehicle}: {nearest:.1f} m, said {row.inspected_at_m:g} m")
    return replace(
        empty,
        counted=len(rows),
        counted_asked=sum(row.inspected_at_m == asked_m for row in rows),
        untold=sum(row.inspected_at_m is None for row in rows),
        off=tuple(off),
        replans=len(flight.report.replans),
        nearest_m=watched.separation.nearest_m,
        nearest=watched.separation.nearest,
        flown_s=flight.flown_s,
        wrong="" if flight.ended else "the supervision did not end",
    )


def distance_results(flights: Sequence[DistanceFlight]) -> Json:
    """Return the figures."""
    flown = [one for one in flights if not one.wrong]
    longer_pct = [one.longer_pct for one in flown]
    near = [one for one in flown if one.nearest_m < one.promised_m]
    calm = [one for one in flown if not one.faults]
    return {
        "flights": len(flown),
        "by_autopilot": dict(sorted(Counter(one.autopilot for one in flown).items())),
        "faults": dict(sorted(Counter(kind_of(fault) for one in flown for fault in one.faults).items())),
        "replans": sum(one.replans for one in flown),
        "segments": sum(one.segments for one in flown),
        "planned_asked": sum(one.planned_asked for one in flown),
        "counted": sum(one.counted for one in flown),
        "counted_asked": sum(one.counted_asked for one in flown),
        "untold": sum(one.untold for one in flown),
        "off": [f"flight {one.number}: {line}" for one in flown for line in one.off],
        "promised_m": min((one.promised_m for one in flown), default=None),
        "nearest_m": round(min((one.nearest_m for one in flown), default=math.inf), 2),
        "too_near": [
            f"flight {one.number} ({one.autopilot}, {', '.join(one.faults) or 'no fault'}): {one.nearest_m:.2f} m, "
            f"{one.nearest}"
            for one in near
        ],
        "longer_pct": {
            "median": round(median(longer_pct), 2) if longer_pct else None,
            "most": round(max(longer_pct), 2) if longer_pct else None,
        },
        "undisturbed": {
            "flights": len(calm),
            "lasted_longer_pct": round(median(one.lasted_longer_pct for one in calm), 2) if calm else None,
        },
        "by_vehicles": [_fleet(flown, count) for count in sorted({one.vehicles for one in flown})],
        "not_flown": [f"flight {one.number}: {one.wrong}" for one in flights if one.wrong],
        "flown_s": round(sum(one.flown_s for one in flown), 1),
    }  # fmt: skip


def _fleet(flown: Sequence[DistanceFlight], vehicles: int) -> Json:
    own = [one for one in flown if one.vehicles == vehicles]
    return {
        "vehicles": vehicles,
        "flights": len(own),
        "planned_asked": round(sum(one.planned_asked for one in own) / sum(one.segments for one in own), 3),
        "counted_asked": round(
            sum(one.counted_asked for one in own) / max(1, sum(one.counted - one.untold for one in own)), 3
        ),
        "nearest_m": round(min(one.nearest_m for one in own), 2),
        "longer_pct": round(median(one.longer_pct for one in own), 2),
    }
