"""Whether the predicted landing percentage contains the true one, on vehicles that differ from their models.

Every flight is randomised: consumption, capacity, speed, initial charge, and the wind relative to the site's. At every
tenth of a route the band that the ground station shows is compared with the true charge of the simulated battery at
landing; and the actual "below its reserve" rules are evaluated throughout, with a reserve slightly below the planned
landing charge. None of them acts, so every flight ends as planned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np

from benchmarks.prediction import RouteCase, cases, estimate_mission, plan_with, random_routes
from benchmarks.store import Json
from benchmarks.virtual_flight import FlightObservers, fly_virtual
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site, size_batteries
from executor.core.context import Context
from executor.core.inflight.faults import warning_rules, watchpoints
from executor.core.inflight.faults.watch_view import OK, WatchView
from executor.core.interface.events import Event, Tick
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from simulator.config import SimVehicle

SEGMENTS = (4, 8)
"""Segments of a route."""
CONSUMPTION_SD = 0.10
"""Standard deviation of consumption, relative to the energy model."""
CAPACITY_SD = 0.05
"""Standard deviation of capacity, relative to the data sheet."""
MOST_SD = 2.5
"""Limit of drawn deviations: a vehicle beyond it is faulty."""
SLOWER = 0.10
"""Maximum share by which a vehicle flies slower than commanded, uniform."""
WIND_M_S = (0.0, 6.0)
"""Wind in the site."""
WIND_SD_M_S = 1.5
"""Standard deviation of each wind component about the site's."""
CHARGE_PCT = (90.0, 100.0)
"""Charge at take-off."""
USES_PCT = (30.0, 65.0)
"""Planned share of the battery."""
MARGIN_PCT = (0.0, 15.0)
"""Margin between the planned landing charge and the reserve."""
TENTHS = 10
LOOKS_S = 1.0
RESERVE = next(point for point in watchpoints.TABLE if point.judge is watchpoints.check_reserve)


@dataclass(frozen=True, slots=True)
class Sight:
    """Prediction at one moment."""

    tenth: int
    landing_pct: float
    sd_pct: float
    band_pct: float


@dataclass(frozen=True, slots=True)
class BandRoute:
    """One vehicle's flight."""

    vehicle: str
    autopilot: str
    landed_pct: float
    """True charge at landing."""
    reserve_pct: float
    sights: tuple[Sight, ...]
    warned_s: float | None
    """Time of the first warning that it may land below its reserve."""
    faulted_s: float | None
    """Time of the first fault declaration that would have followed."""

    @property
    def above(self) -> bool:
        """Whether it landed above its reserve."""
        return self.landed_pct >= self.reserve_pct


@dataclass(frozen=True, slots=True)
class BandFlight:
    """One flight."""

    routes: tuple[BandRoute, ...]
    flown_s: float
    took_s: float
    wrong: str = ""
    """Why it does not count."""


@dataclass(slots=True)
class _Watched:
    """Observations of one vehicle so far."""

    reserve_pct: float
    sights: list[Sight] = field(default_factory=list)
    looked_s: float = -math.inf
    failing_since_s: float | None = None
    warned_s: float | None = None
    faulted_s: float | None = None


def band_cases(routes: int, seed: int, autopilots: Sequence[str]) -> list[RouteCase]:
    """Draw this many routes."""
    return cases(routes, seed, autopilots, [None], sizes=SEGMENTS)


def fly_band(case: RouteCase) -> BandFlight:
    """Generate a flight of vehicles that differ from their models, and fly it; the same case gives the same figures."""
    rng = np.random.default_rng([case.seed, case.number, 90])
    said_m_s, course = rng.uniform(*WIND_M_S), rng.uniform(0.0, 2.0 * math.pi)
    wind_m_s = (float(said_m_s * math.sin(course)), float(said_m_s * math.cos(course)))
    ground = build_virtual_site(
        case.network, None, len(case.sizes), case.autopilot, wind_m_s=wind_m_s, capacity_ah=AMPLE_AH
    )
    routes = random_routes(ground, case.sizes, rng)
    ground = size_batteries(ground, plan_with(ground, routes), float(rng.uniform(*USES_PCT)))
    plan = plan_with(ground, routes)
    east_m_s, north_m_s = (float(part + rng.normal(0.0, WIND_SD_M_S)) for part in wind_m_s)
    drawn = {name: _drawn(rng) for name in ground.names}
    promised = dict(zip(ground.names, plan.energies_pct, strict=True))
    watched = {
        name: _Watched(drawn[name].charge_pct - promised[name] - float(rng.uniform(*MARGIN_PCT)))
        for name in ground.names
    }

    def craft(vehicle: SimVehicle) -> SimVehicle:
        one = drawn[vehicle.name]
        return replace(
            vehicle, consumption=one.consumption, health=one.health, speed_reached=one.reached,
            charge_pct=one.charge_pct, wind_m_s=(east_m_s, north_m_s),
        )  # fmt: skip

    def applied(context: Context, event: Event, state: FleetState, now_s: float) -> None:
        if isinstance(event, Tick):
            for name, seen in watched.items():
                _look(context, state.vehicles[name], seen, now_s)

    flight = fly_virtual(ground, plan, seed=case.number, craft=craft, onlookers=FlightObservers(applied=applied))
    report = flight.report
    wrong = "" if flight.ended and report.finished and not report.faults and not report.replans else (
        report.faults[0].reason if report.faults else "it was not flown as planned"
    )  # fmt: skip
    found = []
    for name, seen in watched.items():
        landed = [one.charge_pct for one in flight.truths if one.vehicle == name and one.what == "disarmed"]
        if wrong or not landed or landed[-1] is None:
            continue
        found.append(
            BandRoute(
                name,
                case.autopilot,
                landed[-1],
                seen.reserve_pct,
                tuple(seen.sights),
                seen.warned_s,
                seen.faulted_s,
            )
        )
    return BandFlight(tuple(found), flight.flown_s, flight.took_s, wrong)


@dataclass(frozen=True, slots=True)
class _Drawn:
    consumption: float
    health: float
    reached: float
    charge_pct: float


def _drawn(rng: np.random.Generator) -> _Drawn:
    def about(sd: float) -> float:
        return 1.0 + sd * float(np.clip(rng.normal(), -MOST_SD, MOST_SD))

    return _Drawn(
        about(CONSUMPTION_SD),
        about(CAPACITY_SD),
        float(rng.uniform(1.0 - SLOWER, 1.0)),
        float(rng.uniform(*CHARGE_PCT)),
    )


def _look(context: Context, state: VehicleState, seen: _Watched, now_s: float) -> None:
    """Record the ground station's prediction for a vehicle at one moment."""
    board = state.assignment.board
    if board is None or state.stage is not Stage.FLYING or now_s - seen.looked_s < LOOKS_S:
        return
    seen.looked_s = now_s
    setup = replace(context.vehicles[state.name], reserve_pct=seen.reserve_pct)
    ahead = legs.project_landing(context, state, setup)
    if ahead is None or state.assignment.waypoint == 0:
        return
    whole_s = estimate_mission(board)[0]
    behind_s = sum(leg.duration_s for leg in board.legs[: state.assignment.waypoint])
    # A leg may be longer than a tenth: tenths not reached before count where it ends.
    while len(seen.sights) < TENTHS and behind_s >= len(seen.sights) / TENTHS * whole_s:
        seen.sights.append(Sight(len(seen.sights), ahead.mean_pct, ahead.sd_pct, ahead.band_pct))
    view = WatchView(context, setup, state, seen.failing_since_s is not None, now_s)
    if seen.warned_s is None and warning_rules.describe_reserve_risk(view):
        seen.warned_s = now_s
    found = RESERVE.judge(view)
    if found:
        seen.failing_since_s = now_s if seen.failing_since_s is None else seen.failing_since_s
        if seen.faulted_s is None and now_s - seen.failing_since_s >= RESERVE.raise_after_s:
            seen.faulted_s = now_s
    elif found == OK:
        seen.failing_since_s = None


def band_held(flights: Sequence[BandFlight]) -> Json:
    """Return how often the band contained the true value, by tenths, and how often "below its reserve" was wrong."""
    routes = [route for flight in flights for route in flight.routes]
    above = [route for route in routes if route.above]
    below = [route for route in routes if not route.above]
    return {
        "routes": len(routes),
        "by_autopilot": {
            name: sum(one.autopilot == name for one in routes) for name in sorted({r.autopilot for r in routes})
        },
        "tenths": [_tenth(routes, tenth) for tenth in range(TENTHS)],
        "above": _count_warnings_and_faults(above),
        "below": _count_warnings_and_faults(below),
        "not_counted": [flight.wrong for flight in flights if flight.wrong],
        "flown_s": round(sum(flight.flown_s for flight in flights), 1),
    }


def _tenth(routes: Sequence[BandRoute], tenth: int) -> Json:
    seen = [(route, sight) for route in routes for sight in route.sights if sight.tenth == tenth]
    if not seen:
        return {"tenth": tenth, "routes": 0, "held": None, "band_pct": None, "error_pct": None, "bias_pct": None}
    errors = [route.landed_pct - sight.landing_pct for route, sight in seen]
    return {
        "tenth": tenth,
        "routes": len(seen),
        "held": round(sum(abs(e) <= s.band_pct for e, (_, s) in zip(errors, seen, strict=True)) / len(seen), 3),
        "band_pct": round(median(sight.band_pct for _, sight in seen), 2),
        "error_pct": round(median(abs(error) for error in errors), 2),
        "bias_pct": round(median(errors), 2),
    }


def _count_warnings_and_faults(routes: Sequence[BandRoute]) -> Json:
    return {
        "routes": len(routes),
        "warned": sum(route.warned_s is not None for route in routes),
        "faults": sum(route.faulted_s is not None for route in routes),
    }
