"""`faultline bench prediction`: a plan's estimate of a route's time and energy against the flight.

Random routes are flown nominally in virtual time; time counts from arming to disarming, energy is the battery's true
output from motor start to motor stop. The planned values are those the ground station uses: the estimate of every leg
of the mission on board.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.errors import BenchError
from benchmarks.parallel_flights import FlightCase
from benchmarks.store import Json
from benchmarks.virtual_flight import VirtualFlight, fly_virtual
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site, size_batteries, with_network
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport, LegRow, RouteRow
from executor.analysis.report import build_route_rows
from executor.core.state.vehicle_parts import OnboardMission
from executor.replay.run_replay import replay_run
from executor.site import site_model
from executor.site.site_model import SiteModel
from executor.site.site_planning import build_site_plan_file
from missions import Network, Phase, PlanFile, SolverRecord, build_open_task
from planner import Cost, NoImprovement, Plan, Route, Vehicle, solve
from simulator.truth import Truth, read_truths

LEAST, MOST = 5, 40
"""Segments of a route."""
MOST_VEHICLES = 4
RELIEF_M = (10.0, 60.0)
"""Height from valley to hill."""
STEEP = 0.2
"""Maximum slope of generated hills, metres per metre."""
BESIDE_RAD = 0.3
"""Offset of the depot from the bottom of its valley, as a phase."""
TALLER_M = 8.0
"""Maximum height difference between generated pylons and the network's."""
WIND_M_S = (1.0, 6.0)
CHANCE = 0.5
"""Probability of hills, and of wind."""
USES_PCT = (30.0, 65.0)
"""Share of the battery that each flight's most expensive route uses; it sets the size of the battery."""
SETTLED = 500
"""Iterations of the solver without an improvement: the routes need not be optimal."""


@dataclass(frozen=True, slots=True)
class RouteCase(FlightCase):
    """A flight of random routes."""

    network: Path | None
    sizes: tuple[int, ...]
    """Segments of each vehicle's route."""


@dataclass(frozen=True, slots=True)
class Figures:
    """A planned and a flown value."""

    planned_s: float
    flown_s: float
    planned_pct: float
    flown_pct: float | None
    """None if the battery never reported."""

    @property
    def time_error_pct(self) -> float:
        """Extra flown time, relative to the plan."""
        return 100.0 * (self.flown_s / self.planned_s - 1.0)

    @property
    def energy_error_pct(self) -> float | None:
        """Extra used energy, relative to the plan."""
        return None if self.flown_pct is None else 100.0 * (self.flown_pct / self.planned_pct - 1.0)


@dataclass(frozen=True, slots=True)
class FlownRoute:
    """One route."""

    flight: str
    vehicle: str
    autopilot: str
    segments: int
    relief_m: float | None
    """None without generated hills."""
    wind_m_s: float | None
    figures: Figures
    phases: Mapping[str, Figures]
    """Sums over the legs of one kind, as received by the ground station."""
    plan_file: Figures | None = None
    """The same with the planner's estimate of the route, as in a plan file; None if unknown."""


@dataclass(frozen=True, slots=True)
class Flown:
    """One flight."""

    routes: tuple[FlownRoute, ...]
    flown_s: float
    took_s: float
    wrong: str = ""
    """Why it was not nominal; its routes then do not count."""


def cases(
    routes: int, seed: int, autopilots: Sequence[str], networks: Sequence[Path | None],
    sizes: tuple[int, int] = (LEAST, MOST),
) -> list[RouteCase]:  # fmt: skip
    """Draw ``routes`` routes with sizes in a range, in flights of 1 to 4 vehicles."""
    rng = np.random.default_rng([seed, 17])
    found: list[RouteCase] = []
    left = routes
    for number in itertools.count():
        if left == 0:
            return found
        count = min(left, int(rng.integers(1, MOST_VEHICLES + 1)))
        left -= count
        drawn = tuple(int(size) for size in rng.integers(sizes[0], sizes[1] + 1, size=count))
        autopilot, network = autopilots[number % len(autopilots)], networks[number % len(networks)]
        found.append(RouteCase(number, seed, autopilot, network, drawn))
    raise AssertionError("counting has no end")


def fly_case(case: RouteCase) -> Flown:
    """Generate a flight, fly it, and check it against its plan; the same case gives the same figures."""
    rng = np.random.default_rng([case.seed, case.number])
    speed_m_s = float(rng.uniform(*WIND_M_S)) if rng.random() < CHANCE else 0.0
    course = float(rng.uniform(0.0, 2.0 * math.pi))
    wind_m_s = (speed_m_s * math.sin(course), speed_m_s * math.cos(course))
    ground = build_virtual_site(
        case.network, None, len(case.sizes), case.autopilot, wind_m_s=wind_m_s, capacity_ah=AMPLE_AH
    )
    relief_m = 0.0
    if ground.network.has_heights and not ground.network.flat and rng.random() < CHANCE:
        relief_m = float(rng.uniform(*RELIEF_M))
        ground = with_network(ground, with_hills(ground.network, relief_m, rng))
    routes = random_routes(ground, case.sizes, rng)
    ground = size_batteries(ground, plan_with(ground, routes), float(rng.uniform(*USES_PCT)))
    plan = plan_with(ground, routes)
    flight = fly_virtual(ground, plan, seed=case.number, craft=lambda craft: replace(craft, wind_m_s=wind_m_s))
    wrong = _describe_anomaly(flight)
    found = []
    for number, (name, board) in enumerate(flight.boards.items()):
        if wrong or board is None:
            continue
        figures = _truly(board, name, flight.truths)
        planner = replace(figures, planned_s=plan.durations_s[number], planned_pct=plan.energies_pct[number])
        found.append(
            FlownRoute(
                f"flight {case.number}", name, case.autopilot, len(routes[name]), relief_m, speed_m_s, figures,
                sum_by_phase(_route_of(flight, name)), planner,
            )
        )  # fmt: skip
    return Flown(tuple(found), flight.flown_s, flight.took_s, wrong)


def with_hills(network: Network, relief_m: float, rng: np.random.Generator) -> Network:
    """Return a network over generated hills, and with other pylons.

    The depot's ground stays as it is, near the bottom of a valley: below the simulated vehicles it is level, so they
    can fly over hills but not below their pads.
    """
    length_m = float(rng.uniform(1.0, 3.0)) * math.pi * relief_m / STEEP
    course, phase = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-BESIDE_RAD, BESIDE_RAD)
    along_m = network.positions_m @ np.array([math.sin(course), math.cos(course)])
    rise_m = relief_m / 2.0 * (math.cos(phase) - np.cos(2.0 * math.pi * along_m / length_m + phase))
    taller_m = rng.uniform(-TALLER_M, TALLER_M, size=len(network.pylons))
    pylons = tuple(
        replace(
            pylon, elevation_m=(pylon.elevation_m or 0.0) + float(rise), height_m=(pylon.height_m or 0.0) + float(up)
        )
        for pylon, rise, up in zip(network.pylons, rise_m, taller_m, strict=True)
    )
    return replace(network, pylons=pylons)


def random_routes(ground: SiteModel, sizes: Sequence[int], rng: np.random.Generator) -> dict[str, tuple[int, ...]]:
    """Return a route for each vehicle: segments around some place of the line, in a good order.

    Raises:
        BenchError: the network has too few.
    """
    middles_m = ground.network.ends_m.mean(axis=1)
    if len(middles_m) < LEAST * len(sizes):
        raise BenchError(
            f"{ground.network.source}: expected {LEAST * len(sizes)} segments or more for {len(sizes)} routes of "
            f"{LEAST} or more, got {len(middles_m)}"
        )
    left = set(range(len(middles_m)))
    routes = {}
    for number, (name, size) in enumerate(zip(ground.names, sizes, strict=True)):
        # Every later vehicle needs some too.
        most = len(left) - LEAST * (len(sizes) - number - 1)
        here_m = middles_m[int(rng.choice(sorted(left)))]
        near = sorted(left, key=lambda segment: float(np.hypot(*(middles_m[segment] - here_m))))[: min(size, most)]
        left -= set(near)
        task = build_open_task(site_model.build_pricing(ground), near, [Vehicle(name, (0.0, 0.0), 100.0)])
        plan = solve(task.instance, cost=Cost.MINMAX, stop=NoImprovement(SETTLED), seed=int(rng.integers(1 << 30))).plan
        routes[name] = task.to_network(plan.routes[0].visits)
    return routes


def plan_with(ground: SiteModel, routes: Mapping[str, tuple[int, ...]]) -> PlanFile:
    """Return a plan file with these routes over a site's network."""
    task = site_model.build_first_task(ground, sorted(visit >> 1 for visits in routes.values() for visit in visits))
    plan = Plan(tuple(Route(number, task.from_network(routes[name])) for number, name in enumerate(ground.names)), ())
    solved = SolverRecord(solver="search", seed=1, seconds=0.0)
    task = site_model.adjust_task_to_layers(ground, task, plan)
    return build_site_plan_file(ground, task, plan, Cost.MINMAX, solved)


def estimate_mission(board: OnboardMission) -> tuple[float, float]:
    """Return a mission's estimated seconds and percent of the battery, as used by the ground station."""
    return sum(leg.duration_s for leg in board.legs), sum(leg.energy_pct for leg in board.legs)


def _truly(board: OnboardMission, name: str, truths: Sequence[Truth]) -> Figures:
    """Return the simulator's true values."""
    at = {truth.what: truth for truth in truths if truth.vehicle == name}
    planned_s, planned_pct = estimate_mission(board)
    given_pct = (at["armed"].charge_pct or 0.0) - (at["disarmed"].charge_pct or 0.0)
    return Figures(planned_s, at["disarmed"].t_s - at["armed"].t_s, planned_pct, given_pct)


def _describe_anomaly(flight: VirtualFlight) -> str:
    """Return why a flight without a fault was not nominal; empty if it was."""
    report = flight.report
    if report.faults:
        return f"{report.faults[0].vehicle}: {report.faults[0].reason}"
    if report.replans:
        return f"re-plan: {report.replans[0].trigger}"
    if not report.finished:
        return f"{len(report.segments_uncovered)} segments were not inspected"
    return "" if flight.ended else "it did not end"


def _route_of(flight: VirtualFlight, name: str) -> RouteRow:
    return next(row for row in flight.report.routes if row.vehicle == name)


def sum_by_phase(route: RouteRow) -> dict[str, Figures]:
    """Return the sums over a route's legs of each kind; incompletely received legs are left out."""

    def total(legs: Sequence[LegRow]) -> Figures:
        known = [leg.flown_pct for leg in legs if leg.flown_pct is not None]
        return Figures(
            sum(leg.planned_s for leg in legs), sum(leg.flown_s or 0.0 for leg in legs),
            sum(leg.planned_pct for leg in legs), sum(known) if len(known) == len(legs) else None,
        )  # fmt: skip

    heard = [leg for leg in route.legs if leg.flown_s is not None]
    return {
        phase: total([leg for leg in heard if leg.phase == phase])
        for phase in dict.fromkeys(leg.phase for leg in heard)
    }


def read_recorded_routes(runs: Sequence[Path]) -> list[FlownRoute]:
    """Return the complete routes of recorded flights; one whose report lacks them is replayed first.

    Battery use is the simulator's truth if available, otherwise the vehicle's report.

    Raises:
        ExecutorError: a run directory cannot be read.
        BenchError: there is no route from take-off to landing in all of them.
    """
    found = [_read_route(run, row) for run in runs for row in _rows(run) if row.whole]
    if not found:
        raise BenchError("--run: expected a flight in which a vehicle flew its mission from take-off to landing")
    return found


def _rows(run: Path) -> Sequence[RouteRow]:
    return FlightReport.read(RunDirectory(run).report).routes or build_route_rows(replay_run(run).state)


def _read_route(run: Path, row: RouteRow) -> FlownRoute:
    truths = RunDirectory(run).truths
    known = read_truths(truths) if truths.exists() else ()
    armed, disarmed = (
        [truth.charge_pct for truth in known if truth.vehicle == row.vehicle and truth.what == what]
        for what in ("armed", "disarmed")
    )
    given_pct = row.flown_pct
    if len(armed) == len(disarmed) == 1 and armed[0] is not None and disarmed[0] is not None:
        given_pct = armed[0] - disarmed[0]
    figures = Figures(row.planned_s, row.flown_s, row.planned_pct, given_pct)
    segments = sum(leg.phase == Phase.INSPECT.value for leg in row.legs)
    return FlownRoute(run.name, row.vehicle, "", segments, None, None, figures, sum_by_phase(row))


def prediction_errors(routes: Sequence[FlownRoute]) -> Json:
    """Return the errors over routes: magnitudes and signed errors."""
    planner = [one.plan_file for one in routes if one.plan_file is not None]
    return {
        "routes": len(routes),
        **_errors([one.figures for one in routes]),
        "plan_file": _errors(planner) if planner else None,
    }


def _errors(figures: Sequence[Figures]) -> Json:
    energies = [one.energy_error_pct for one in figures if one.energy_error_pct is not None]
    return {
        "time_error_pct": _spread([one.time_error_pct for one in figures]),
        "energy_error_pct": _spread(energies),
    }


def _spread(errors: Sequence[float]) -> Json | None:
    if not errors:
        return None
    sizes = [abs(error) for error in errors]
    return {
        "median": round(median(sizes), 2),
        "max": round(max(sizes), 2),
        "median_signed": round(median(errors), 2),
    }


def phases(routes: Sequence[FlownRoute]) -> Json:
    """Return planned and flown sums over all routes, by the kind of leg: the sources of the errors."""
    found: Json = {}
    for phase in dict.fromkeys(phase for route in routes for phase in route.phases):
        parts = [route.phases[phase] for route in routes if phase in route.phases]
        powers = [part for part in parts if part.flown_pct is not None]
        whole = Figures(
            sum(part.planned_s for part in parts), sum(part.flown_s for part in parts),
            sum(part.planned_pct for part in powers), sum(part.flown_pct or 0.0 for part in powers) if powers else None,
        )  # fmt: skip
        energy = whole.energy_error_pct if whole.planned_pct > 0 else None
        found[phase] = {
            "planned_s": round(whole.planned_s, 1),
            "flown_s": round(whole.flown_s, 1),
            "time_error_pct": round(whole.time_error_pct, 2) if whole.planned_s > 0 else None,
            "energy_error_pct": None if energy is None else round(energy, 2),
        }
    return found
