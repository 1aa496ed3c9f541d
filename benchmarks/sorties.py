"""`faultline bench sorties`: a day of many sorties, flown with losses, bad packs and a dying ground station.

Six vehicles stand at four bases of one network, with packs that last for a few segments each. Their day is planned as
by `plan --day` and flown by the executor's own runtime in virtual time: a crew swaps the packs and confirms it, some
packs hold much less than they should, vehicles crash, and the ground station is killed and resumed from the contents of
its checkpoint. The result is checked against the simulator's own positions and charges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.day import centres_m, crowded_m
from benchmarks.parallel_flights import FlightCase
from benchmarks.separation import SeparationWatch
from benchmarks.store import Json
from benchmarks.virtual_day import DayScenario, VirtualDay
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.errors import ExecutorError
from executor.simulated.simulated_fleet import LISTENING, SIMULATED_CEILING_M, build_vehicle_tables
from executor.site import site_model
from executor.site.day_plans import build_day_problem, build_first_sorties_plan, solve_day
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest
from missions import LocalFrame, default_network_path, read_network
from missions.geometry import locate_on_leg
from simulator.config import SimVehicle
from simulator.fleet import SimulatedVehicle

LONGEST_S = 36_000.0
"""Time limit of a search that its iterations end."""
VEHICLES = 6
STANDS = ((0, 1), (2, 3), (4,), (5,))
"""Vehicles of each base, the base with most to inspect around it first."""
LOSSES = 3
BAD_PCT = (18.0, 40.0)
"""Charge of packs that should be full: one is too low for a sortie, the other shortens it."""
FULL_PCT = 100.0
DEATHS = 1
MIDDLE = (0.1, 0.8)
"""Part of the planned day in which losses and deaths occur."""
PATIENT_S = 120.0
"""Time for which vehicles fly on without a ground station."""
APART_M, ON_PAD_M, LOW_M = 5.0, 5.0, 0.3
"""Required separation in the air; allowed distance from a vehicle's own pad on the ground; height below which it
stands."""
FALLS_M_S = 1.0
"""Descent speed near the ground above which a vehicle is falling, not standing."""
END_SHARE = 0.1
"""Share of a segment, at both ends, where a vehicle may still be turning."""
ASIDE_M = 3.0
EVERY = 5
"""Of all position samples, every how many-th is kept: two a second."""


@dataclass(frozen=True, slots=True)
class SortiesOver:
    """Network and equipment of the flights."""

    network: Path | None = None
    """faultline's own if None."""
    radius_m: float | None = None
    """Radius about the network's middle to inspect; None for all of it."""
    pack_ah: float = 2.0
    """Lasts for a few segments of faultline's own network, which is five kilometres wide."""
    speed_m_s: float = 1.2
    """Inspection speed: slow, for images of every insulator."""
    hours: int = 4
    """Length of the day, of which a plan takes a part."""
    reach_m: float | None = None
    """Each base has the most to inspect within this of it; None: in the centres of the network's parts."""


OWN = SortiesOver()


def sorties_over(network: Path | None, radius_m: float | None) -> SortiesOver:
    """Return the settings for a network: a large one in a working day of sorties of some fifty minutes."""
    if network is None:
        return SortiesOver(radius_m=radius_m)
    return SortiesOver(network, radius_m, pack_ah=6.5, speed_m_s=1.0, hours=8, reach_m=5000.0)


@dataclass(frozen=True, slots=True)
class SortiesCase(FlightCase):
    """One day to be flown."""

    iterations: int
    """Iterations of the search for its plan."""
    over: SortiesOver = OWN


@dataclass(frozen=True, slots=True)
class SortiesDay:
    """Result of one day."""

    number: int
    autopilot: str
    segments: int
    planned_sorties: int
    planned_s: float
    """From the first take-off to the last landing."""
    losses: tuple[str, ...] = ()
    """Crashed vehicles, and times."""
    died_s: tuple[float, ...] = ()
    """Times at which the ground station died."""
    bad_packs: tuple[str, ...] = ()
    """Bad packs installed, and the charge assumed for each."""
    sorties: int = 0
    """Flown sorties, in the simulator."""
    swaps: int = 0
    inspected: int = 0
    named: int = 0
    """Segments not inspected and named as left over."""
    unproven: tuple[int, ...] = ()
    """Segments that count although no vehicle flew along them in the simulator."""
    replans: int = 0
    least_pct: float = math.inf
    """Lowest charge at any landing."""
    reserve_pct: float = 0.0
    below: tuple[str, ...] = ()
    """Landings below the reserve."""
    nearest_m: float = math.inf
    nearest: str = ""
    strays: tuple[str, ...] = ()
    """Vehicles that stood away from their own pad."""
    mistakes: tuple[str, ...] = ()
    """Log lines of the program's own errors."""
    flown_s: float = 0.0
    took_s: float = 0.0
    """Real time used."""
    wrong: str = ""
    """Why there was no day, or why it did not end."""


@dataclass(slots=True)
class _Watched:
    """True positions of all vehicles."""

    frame: LocalFrame
    """Frame of the network: each vehicle has its own, about its pad."""
    pads_m: Mapping[str, tuple[float, float, float]]
    separation: SeparationWatch = field(default_factory=SeparationWatch)
    strays: dict[str, str] = field(default_factory=dict)
    tracks_m: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def look(self, vehicles: Mapping[str, SimulatedVehicle]) -> None:
        """Record present positions; a crashed vehicle falls where it is."""
        up: dict[str, tuple[float, float, float]] = {}
        for name, vehicle in vehicles.items():
            frame = vehicle.autopilot.frame
            if frame.crashed_s is not None or frame.wrecked:
                continue
            body, pad_m = frame.body, self.pads_m[name][2]
            if body.up_m > LOW_M:
                lat_e7, lon_e7 = vehicle.autopilot.home.lat_lon_e7(body.east_m, body.north_m)
                place_m = (*self.frame.to_local_m(1e-7 * lat_e7, 1e-7 * lon_e7), pad_m + body.up_m)
                up[name] = place_m
                if (self.separation.looks + 1) % EVERY == 0:
                    self.tracks_m.setdefault(name, []).append(place_m[:2])
            elif abs(body.v_up_m_s) < FALLS_M_S and math.hypot(body.east_m, body.north_m) > ON_PAD_M:
                self.strays.setdefault(name, f"{name} stood {math.hypot(body.east_m, body.north_m):.1f} m from its pad")
        self.separation.compare(up)

    def flew_along(self, vehicle: str, begin_m: tuple[float, float], end_m: tuple[float, float]) -> bool:
        """Return whether a vehicle flew along all of a segment, between its ends."""
        length_m = math.dist(begin_m, end_m)
        along_m = []
        for place_m in self.tracks_m.get(vehicle, ()):
            at_m, aside_m = locate_on_leg(begin_m, end_m, place_m)
            if aside_m < ASIDE_M:
                along_m.append(at_m)
        return min(along_m, default=math.inf) < END_SHARE * length_m and (
            max(along_m, default=-math.inf) > (1.0 - END_SHARE) * length_m
        )


def sorties_site(autopilot: str, over: SortiesOver = OWN) -> dict[str, Any]:
    """Return a site with six vehicles at four bases: in the centres of a network's parts, or where most is near."""
    network = read_network(default_network_path(), radius_m=over.radius_m)
    frame, table = network.frame, {"file": "default"}
    if over.network is not None:
        network = read_network(over.network, depot=(frame.lat_deg, frame.lon_deg, frame.alt_m), radius_m=over.radius_m)
        table = {"file": str(over.network.resolve())}
    middles_m = network.ends_m.mean(axis=1)
    count, reach_m = len(STANDS), over.reach_m
    places_m = (centres_m(middles_m, count) if reach_m is None else crowded_m(middles_m, count, reach_m)).tolist()
    names = [f"uav{number}" for number in range(1, VEHICLES + 1)]
    return {
        "depot": {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg, "alt_m": frame.alt_m},
        "network": {**table, **({} if over.radius_m is None else {"radius_m": over.radius_m})},
        "inspection": {
            "ceiling_m": SIMULATED_CEILING_M, "speed_m_s": over.speed_m_s,
            **({} if over.network is None else {"heights": "flat"}),
        },
        "energy": {"capacity_ah": over.pack_ah},
        "day": {"begin": "08:00", "end": f"{8 + over.hours:02d}:00", "days": 1, "lands": "own"},
        "base": [
            dict(zip(("lat_deg", "lon_deg"), frame.to_wgs84_deg(*place), strict=True),
                 name=f"base{number}", vehicles=[names[one] for one in own])
            for number, (place, own) in enumerate(zip(places_m, STANDS, strict=True), 1)
        ],
        "vehicle": build_vehicle_tables(LISTENING[:VEHICLES], autopilot),
    }  # fmt: skip


def fly_sorties(case: SortiesCase) -> SortiesDay:
    """Plan a day, fly it, and check it against the truth; the same case gives the same figures."""
    ground = site_model.load_site_model(check_site(sorties_site(case.autopilot, case.over), "bench sorties"), Path())
    content = solve_day(
        build_day_problem(ground),
        PlanRequest(None, LONGEST_S, case.seed + case.number, iterations=case.iterations, starts=1),
    )
    planned_s = content.finish_s - min(one.start_s for one in content.routes)
    empty = SortiesDay(case.number, case.autopilot, len(content.segments), len(content.routes), planned_s)
    rng = np.random.default_rng([case.seed, 31, case.number])
    low_s, high_s = (share * planned_s for share in MIDDLE)
    fall = rng.choice(ground.names, size=LOSSES, replace=False)
    losses = tuple((float(rng.uniform(low_s, high_s)), str(name)) for name in fall)
    away_s = tuple(float(rng.uniform(low_s, high_s)) for _ in range(DEATHS))
    packs = _Packs(ground.names, rng)
    watched = _Watched(ground.network.frame, _pads_m(ground))
    run = partial(VirtualDay, DayScenario(content, packs.next, losses, away_s))
    try:
        flight = fly_virtual(
            ground, build_first_sorties_plan(content, ground), seed=case.number, craft=_patient, make=run,
            onlookers=FlightObservers(lived=watched.look), limit_s=3 * planned_s + 3600.0 * case.over.hours,
        )  # fmt: skip
    except ExecutorError as error:
        return replace(empty, wrong=str(error))
    return _judge_day(empty, ground, flight, watched, packs, away_s)


class _Packs:
    """The crew's packs: full ones, and among the first some that hold too little."""

    def __init__(self, names: Sequence[str], rng: np.random.Generator) -> None:
        self.given: dict[str, float] = {}
        self._numbers: Iterator[int] = itertools.count(1)
        self._bad = dict(
            zip(rng.choice(np.arange(2, 2 * len(names)), len(BAD_PCT), replace=False), BAD_PCT, strict=True)
        )

    def next(self, _: str) -> tuple[str, float]:
        """Return the next pack."""
        number = next(self._numbers)
        held_pct = self._bad.get(number, FULL_PCT)
        self.given[f"P{number}"] = held_pct
        return f"P{number}", held_pct


def _patient(vehicle: SimVehicle) -> SimVehicle:
    """Let a vehicle fly on while the ground station is away, which takes less than this."""
    names = {name: PATIENT_S for name in ("FS_GCS_TIMEOUT", "COM_DL_LOSS_T") if name in vehicle.parameters}
    return replace(vehicle, parameters={**vehicle.parameters, **names})


def _pads_m(ground: SiteModel) -> dict[str, tuple[float, float, float]]:
    """Return all vehicles' positions in the morning: local east, north and up."""
    setup = ground.setup
    return {pad.vehicle: (pad.east_m, pad.north_m, setup.frame.up_m(pad.alt_m)) for pad in setup.pads}


def _judge_day(
    empty: SortiesDay, ground: SiteModel, flight: VirtualFlight, watched: _Watched, packs: _Packs,
    away_s: tuple[float, ...],
) -> SortiesDay:  # fmt: skip
    """Check a day against the simulator's positions and charges."""
    report, tracks_m, reserve_pct = flight.report, ground.setup.tracks_m.tolist(), ground.site.vehicle[0].reserve_pct
    landings = [truth for truth in flight.truths if truth.what == "landed" and truth.charge_pct is not None]
    counted = {row.segment: row.vehicle for row in report.inspections}
    named = set(report.segments_uncovered)
    inspected = set(range(report.segments_total)) - named
    fell = [truth for truth in flight.truths if truth.what == f"fault {truth.vehicle}:crash@0s"]
    mistakes = tuple(line.text for _, line in flight.said if "internal error" in line.text)
    return replace(
        empty,
        losses=tuple(f"{truth.vehicle} after {truth.t_s - flight.launched_s:.0f} s" for truth in fell),
        died_s=away_s,
        bad_packs=tuple(f"{name}: {held_pct:g} %" for name, held_pct in packs.given.items() if held_pct < FULL_PCT),
        sorties=sum(truth.what == "took_off" for truth in flight.truths),
        swaps=len(packs.given),
        inspected=len(inspected),
        named=len(named),
        unproven=tuple(
            segment for segment, vehicle in counted.items()
            if not watched.flew_along(vehicle, tuple(tracks_m[segment][0]), tuple(tracks_m[segment][1]))
        ),
        replans=len(report.replans),
        least_pct=min((truth.charge_pct or 0.0 for truth in landings), default=math.inf),
        reserve_pct=reserve_pct,
        below=tuple(
            f"{truth.vehicle} after {truth.t_s - flight.launched_s:.0f} s with {truth.charge_pct:.1f} %"
            for truth in landings if (truth.charge_pct or 0.0) < reserve_pct
        ),
        nearest_m=watched.separation.nearest_m,
        nearest=watched.separation.nearest,
        strays=tuple(watched.strays.values()),
        mistakes=mistakes,
        flown_s=flight.flown_s,
        took_s=flight.took_s,
        wrong="" if flight.ended else "the supervision did not end",
    )  # fmt: skip


def went_wrong(day: SortiesDay) -> list[str]:
    """Return a day's errors, line by line."""
    lines = [day.wrong] if day.wrong else []
    lines += [f"segment {segment} counts, but no vehicle flew along it" for segment in day.unproven]
    lines += [f"below its reserve of {day.reserve_pct:g} %: {landing}" for landing in day.below]
    lines += [*day.strays, *day.mistakes]
    if day.nearest_m < APART_M:
        lines.append(f"{day.nearest_m:.2f} m apart: {day.nearest}")
    if not day.wrong and day.inspected + day.named != day.segments:
        lines.append(f"{day.segments - day.inspected - day.named} segments neither inspected nor named")
    return [f"day {day.number + 1} ({day.autopilot}): {line}" for line in lines]


def sorties_results(days: Sequence[SortiesDay]) -> Json:
    """Return the figures."""
    return {
        "days": [
            {
                "number": one.number, "autopilot": one.autopilot, "segments": one.segments,
                "planned_sorties": one.planned_sorties, "planned_s": round(one.planned_s, 1), "sorties": one.sorties,
                "flown_s": round(one.flown_s, 1), "swaps": one.swaps, "losses": list(one.losses),
                "died_s": [round(at_s, 1) for at_s in one.died_s], "bad_packs": list(one.bad_packs),
                "replans": one.replans, "inspected": one.inspected, "named": one.named,
                "unproven": list(one.unproven), "least_pct": round(one.least_pct, 1), "reserve_pct": one.reserve_pct,
                "below": list(one.below), "nearest_m": round(one.nearest_m, 2), "nearest": one.nearest,
                "strays": list(one.strays), "mistakes": list(one.mistakes), "took_s": round(one.took_s, 1),
                "wrong": one.wrong,
            }
            for one in days
        ],
    }  # fmt: skip
