"""Flights as a ground station receives them, without sockets: hundreds in minutes.

The pack is the simulator's own. The path is that of a planned mission, flown leg by leg in its estimated time; wind and
gusts change the air speed, and so the consumption. Reports are noisy, rounded, re-estimated, and partly lost.
Everything derives from one random generator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from executor.core.context import Context
from executor.core.interface.messages import Battery, FlightMessage, Heartbeat, MissionCurrent, Position
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import FaultKind, build_onboard_mission
from executor.simulated.simulated_fleet import LISTENING, build_vehicle_tables
from executor.site import site_model
from executor.site.site_file import check_site
from missions import build_flight_path, dialect_for
from simulator.battery import Battery as Pack

ARDUPILOT, PX4, QUADROTOR, ACTIVE = 3, 12, 2, 4
GROUND_S = 5.0
"""Time armed on the pad before it climbs."""
HOME_M_S, DOWN_M_S = 8.0, 1.5
"""Return speed, and descent speed."""
CAPACITY_AH = 2.2
"""Small enough for a mission to use most of the budget."""
VEHICLES, RADIUS_M = 3, 500.0
BLACKOUT_S = 6.0
"""Longest gap of a lossy link that is no fault."""
APART_S = 15.0
"""Minimum time between two gaps; closer ones would merge into one silence."""


@dataclass(frozen=True, slots=True)
class ModelledSite:
    """Missions to fly, and the context of decisions."""

    context: Context
    boards: tuple[OnboardMission, ...]
    drones: tuple[str, ...]


def model_site(autopilot: str) -> ModelledSite:
    """Return three missions over the network included in faultline."""
    content = {
        "network": {"file": "default", "radius_m": RADIUS_M},
        "energy": {"drone": "mavic3", "capacity_ah": CAPACITY_AH},
        "vehicle": build_vehicle_tables(LISTENING[:VEHICLES], autopilot),
        "faults": {"link_timeout_s": 10.0},
    }
    ground = site_model.load_site_model(check_site(content, "the model"), Path())
    setup, task = ground.setup, site_model.build_first_task(ground)
    names, count = ground.names, len(ground.network.segments)
    routes = {name: tuple(2 * segment for segment in range(count)[k::VEHICLES]) for k, name in enumerate(names)}
    context = site_model.build_context(ground, setup, task)
    boards = tuple(
        build_onboard_mission(context, name, 0, build_flight_path(setup, name, routes[name]), routes[name])
        for name in names
    )
    return ModelledSite(context, boards, names)


@dataclass(frozen=True, slots=True)
class Injected:
    """An injected fault."""

    what: str
    """healthy, step, drain, cell or silent."""
    kind: FaultKind | None = None
    at_s: float = math.inf
    size: float = 0.0
    """Points of charge, times the normal rate, volts of one cell, or seconds."""


@dataclass(slots=True)
class ModelledFlight:
    """Reported and true data of one flight."""

    vehicle: int
    autopilot: str
    injected: Injected
    heard: list[tuple[float, FlightMessage]] = field(default_factory=list)
    remaining_pct: list[float] = field(default_factory=list)
    """True charge each second."""
    home_pct: list[float] = field(default_factory=list)
    """Charge that RTL would have used at that second."""
    rate_pct_s: list[float] = field(default_factory=list)
    lasted_s: float = 0.0
    reported_pct: float = 100.0
    """Last reported percentage."""


def draw_fault(what: str, rng: np.random.Generator, mission_s: float) -> Injected:
    """Return one fault of a kind, at a random time in the middle of a mission."""
    at_s = float(rng.uniform(0.1, 0.85)) * mission_s
    match what:
        case "step":
            return Injected(what, FaultKind.BATTERY, at_s, float(rng.uniform(10.0, 40.0)))
        case "drain":
            return Injected(what, FaultKind.BATTERY, at_s, float(rng.uniform(1.3, 4.0)))
        case "cell":
            return Injected(what, FaultKind.BATTERY, at_s, float(rng.uniform(0.8, 2.5)))
        case "silent":
            return Injected(what, FaultKind.LINK, at_s, float(np.exp(rng.uniform(math.log(2.0), math.log(200.0)))))
        case _:
            return Injected("healthy")


class _Weather:
    """Wind and gusts."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        speed, course = rng.uniform(0.0, 5.0), rng.uniform(0.0, 2 * math.pi)
        self._mean = np.array([speed * math.cos(course), speed * math.sin(course)])
        self._gust = np.zeros(2)
        self._sd = rng.uniform(0.3, 1.5)

    def air_speed_m_s(self, east_m_s: float, north_m_s: float) -> float:
        """Return the air speed, a second later."""
        keep = math.exp(-1.0 / 8.0)
        self._gust = keep * self._gust + math.sqrt(1 - keep**2) * self._sd * self._rng.normal(size=2)
        air = np.array([east_m_s, north_m_s]) - self._mean - self._gust
        return float(np.hypot(air[0], air[1]))


class _Gauge:
    """An autopilot's estimate of its pack."""

    def __init__(self, rng: np.random.Generator, autopilot: str, pack: Pack) -> None:
        self._rng, self._pack, self._counts = rng, pack, autopilot == "ardupilot"
        self._scale = rng.uniform(0.93, 1.07)
        self._used_pct = self._waver = self._off = 0.0
        self._began_pct = pack.charge_pct
        self.cell_v = 0.0
        self._cells = bool(rng.random() < 0.5)
        self._count = 3 if self._counts else 4

    def advance_second(self, used_pct: float) -> None:
        """Advance one second."""
        self._used_pct += used_pct * self._scale
        keep = math.exp(-1.0 / 30.0)
        self._waver = keep * self._waver + math.sqrt(1 - keep**2) * 0.6 * self._rng.normal()
        if self._rng.random() < 1.0 / 600.0:
            self._off = float(np.clip(self._off + self._rng.normal(0.0, 2.0), -4.0, 4.0))

    def report(self, lost_pct: float, *, climbs: bool) -> Battery:
        """Return a BATTERY_STATUS."""
        pack = self._pack
        volts = pack.voltage_v / 4 * self._count * (1 + 0.002 * self._rng.normal()) - self.cell_v
        cells: tuple[float, ...] = ()
        if self._cells:
            each = (volts + self.cell_v) / self._count
            noisy = each + 0.01 * self._rng.normal(size=self._count)
            noisy[0] -= self.cell_v
            cells = tuple(round(float(cell), 3) for cell in noisy)
        if self._counts:
            current = pack.current_a * self._scale * (1 + 0.03 * self._rng.normal())
            left = self._began_pct - self._used_pct - lost_pct
            consumed = (self._used_pct + lost_pct) / 100 * CAPACITY_AH
            return Battery(0, _round_pct(left), volts, max(0.0, current), round(consumed, 3), 1, 0, cells)
        left = pack.charge_pct + self._waver + self._off - (1.0 if climbs else 0.0)
        return Battery(0, _round_pct(left), volts, None, None, 1, 0, cells)


def _round_pct(percent: float) -> float:
    return float(np.clip(round(percent), 0, 100))


def fly_modelled(site: ModelledSite, autopilot: str, what: str, rng: np.random.Generator) -> ModelledFlight:
    """Fly one mission."""
    number = int(rng.integers(len(site.boards)))
    board = site.boards[number]
    mission_s = sum(leg.duration_s for leg in board.legs)
    fault = draw_fault(what, rng, mission_s)
    flight = ModelledFlight(number, autopilot, fault)
    pack = Pack(
        site.context.drone, charge_pct=float(rng.uniform(94.0, 100.0)), health=float(rng.uniform(0.88, 1.0)),
        consumption=float(rng.uniform(0.92, 1.1)),
    )  # fmt: skip
    gauge, weather = _Gauge(rng, autopilot, pack), _Weather(rng)
    loss = float(rng.uniform(0.0, 0.3)) if rng.random() < 0.5 else 0.0
    gaps = _gaps(rng, mission_s) if rng.random() < 0.5 else []
    if what == "silent":
        gaps.append((fault.at_s, fault.at_s + fault.size))
    seq_of = {waypoint: seq for seq, waypoint in reversed(list(enumerate(board.waypoint_of))) if waypoint is not None}
    lost_pct, done = 0.0, False
    for t_s, waypoint, place, height_m, velocity in _seconds(board):
        if t_s >= fault.at_s and not done:
            done = True
            if what == "step":
                pack.remove_charge(fault.size)
                lost_pct = fault.size
            elif what == "drain":
                pack.drain_factor = fault.size
            elif what == "cell":
                gauge.cell_v = fault.size
        before = pack.charge_pct
        speed = weather.air_speed_m_s(velocity[0], velocity[1])
        pack.step(1.0, motors=True, speed_m_s=speed, climb_m_s=velocity[2])
        rate = before - pack.charge_pct
        gauge.advance_second(rate)
        flight.remaining_pct.append(pack.charge_pct)
        flight.rate_pct_s.append(rate)
        pad = site.context.vehicles[site.drones[number]].pad_m
        flight.home_pct.append(rate * (math.dist(place, pad) / HOME_M_S + height_m / DOWN_M_S))
        said = _build_messages(site, autopilot, t_s, (waypoint, seq_of), (place, height_m, velocity))
        if autopilot == "ardupilot" or int(t_s) % 2 == 0:
            report = gauge.report(lost_pct, climbs=velocity[2] > 0.3)
            flight.reported_pct = report.remaining_pct or 0.0
            said.append((t_s + 0.5, report))
        for at_s, message in said:
            if rng.random() >= loss and not any(begin <= at_s < end for begin, end in gaps):
                flight.heard.append((at_s, message))
    flight.lasted_s = float(len(flight.remaining_pct))
    return flight


def _gaps(rng: np.random.Generator, mission_s: float) -> list[tuple[float, float]]:
    count = rng.poisson(mission_s / 300.0)
    begins = rng.uniform(0.0, mission_s, size=count)
    gaps: list[tuple[float, float]] = []
    for begin, end in sorted((float(begin), float(begin + rng.uniform(0.5, BLACKOUT_S))) for begin in begins):
        if not gaps or begin > gaps[-1][1] + APART_S:
            gaps.append((begin, end))
    return gaps


Moment = tuple[float, int, tuple[float, float], float, tuple[float, float, float]]


def _seconds(board: OnboardMission) -> list[Moment]:
    """Yield (t_s, waypoint, place, height, velocity) for each second of a mission."""
    found: list[Moment] = []
    at_m, height_m = board.places_m[0], 0.0
    t_s, left_s = GROUND_S, 0.0
    for index, (waypoint, leg) in enumerate(zip(board.path.waypoints, board.legs, strict=True)):
        end_m, end_height_m = board.places_m[index], waypoint.alt_rel_m
        took_s = max(leg.duration_s, 0.1)
        velocity = (
            (end_m[0] - at_m[0]) / took_s,
            (end_m[1] - at_m[1]) / took_s,
            (end_height_m - height_m) / took_s,
        )
        while left_s < took_s:
            share = left_s / took_s
            place = (at_m[0] + share * (end_m[0] - at_m[0]), at_m[1] + share * (end_m[1] - at_m[1]))
            found.append((t_s, index, place, height_m + share * (end_height_m - height_m), velocity))
            t_s, left_s = t_s + 1.0, left_s + 1.0
        left_s -= took_s
        at_m, height_m = end_m, end_height_m
    return found


def _build_messages(
    site: ModelledSite,
    autopilot: str,
    t_s: float,
    item: tuple[int, dict[int, int]],
    fix: tuple[tuple[float, float], float, tuple[float, float, float]],
) -> list[tuple[float, FlightMessage]]:
    dialect = dialect_for(autopilot)
    place, height_m, (east, north, up) = fix
    waypoint, seq_of = item
    lat_deg, lon_deg = site.context.frame.to_wgs84_deg(*place)
    kind = ARDUPILOT if autopilot == "ardupilot" else PX4
    said: list[tuple[float, FlightMessage]] = [
        (t_s, Heartbeat(kind, dialect.modes.mission.custom_mode, True, ACTIVE, QUADROTOR)),
        (
            t_s + 0.25,
            Position(t_s, lat_deg, lon_deg, site.context.frame.alt_m + height_m, height_m, north, east, -up, None),
        ),
    ]
    if waypoint in seq_of:
        said.append((t_s + 0.75, MissionCurrent(seq_of[waypoint], None)))
    return said
