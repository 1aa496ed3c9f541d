"""`faultline bench day`: days of many sorties: against proven optima, over a whole network, and with losses."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.exact_sorties import solve_sorties_exact
from benchmarks.machine import cores
from benchmarks.store import Json
from benchmarks.warm_sorties import warm_up_sorties
from executor.simulated.simulated_fleet import LISTENING, build_vehicle_tables
from executor.site.day_plans import build_day_problem, solve_day
from executor.site.plan_summary import compute_base_needs, compute_rule_packs
from executor.site.site_file import check_site
from executor.site.site_model import load_site_model
from executor.site.site_planning import PlanRequest
from missions import DayPlanFile, default_network_path, read_network
from missions.geo import FloatArray
from planner import Iterations, Stopwatch, Travel, split_flights
from planner.moves import MoveGeometry
from planner.sorties import (
    DAYS_PER_CHUNK,
    SortieBase,
    SortieInstance,
    SortieVehicle,
    SurvivalCampaign,
    add_spares,
    evaluate_sorties,
    simulate_days,
    solve_sorties,
    summarise_samples,
)

Told = Callable[[str, int, int], None]
SMALL = 24
"""Instances compared with proven optima."""
SEGMENTS, BASES, VEHICLES, PACKS = 8, 2, 2, 2
SMALL_ITERATIONS = 100_000
SAME = 1e-5
LONGEST_S = 36_000.0
"""Time limit of a search that its iterations end."""
GENERATOR_AH = 1094.0
"""Battery of a vehicle with a generator: the paper's network is 130 km wide, and four bases leave 36 km to its last
pylon."""
MTBF_H = (2.0, 5.0, 20.0)
SPARES = 3
SHARES = (0.95, 0.99)


def day_figures(network: Path, *, seconds: float, samples: int, seed: int, told: Told) -> Json:
    """Return the figures of all parts."""
    warm_up_sorties(cores())
    return {
        "exact": exact_rows(seed, told),
        "network": network_row(network, seconds, seed, told),
        "fleet": fleet_rows(samples, seed, told),
    }


def exact_rows(seed: int, told: Told) -> list[Json]:
    """Solve small random days to proven optimality, and by the search."""
    rows = []
    for number in range(SMALL):
        told("proven optima", number, SMALL)
        instance = small_day(seed + number, packs=PACKS if number % 2 else None)
        watch = Stopwatch()
        proven = solve_sorties_exact(instance)
        proof_s = watch.seconds
        found = solve_sorties(instance, stop=Iterations(SMALL_ITERATIONS), seed=seed)
        best = None if proven is None else evaluate_sorties(instance, proven)
        rows.append({
            "seed": seed + number,
            "packs": PACKS if number % 2 else None,
            "optimum_s": None if best is None else best.finish_s,
            "sorties": None if best is None else best.count,
            "found_s": found.evaluation.finish_s if not found.plan.uncovered else None,
            "same": best is None if found.plan.uncovered else best is not None
            and abs(best.finish_s - found.evaluation.finish_s) < SAME
            and abs(best.flight_s - found.evaluation.flight_s) < SAME,
            "proof_s": proof_s,
            "search_s": found.seconds,
        })  # fmt: skip
    told("proven optima", SMALL, SMALL)
    return rows


def small_day(seed: int, packs: int | None) -> SortieInstance:
    """Return a day of a few segments with two bases and two vehicles of about two sorties each."""
    rng = np.random.default_rng(seed)
    travel = Travel(5.0, 2.0, 0.1, 0.12)
    bases_m = rng.uniform(0, 1000, (BASES, 2))
    pylons_m = np.cumsum(rng.uniform(-120, 120, (SEGMENTS + 1, 2)), axis=0) + rng.uniform(200, 800, 2)
    first_m = np.stack((pylons_m[:-1], pylons_m[1:]), axis=1).reshape(-1, 2)
    last_m = first_m.reshape(-1, 2, 2)[:, ::-1].reshape(-1, 2)
    along_s = np.hypot(*(last_m - first_m).T) / travel.inspection_speed_m_s
    there_s = _distance_m(bases_m, first_m) / travel.transit_speed_m_s
    back_s = _distance_m(last_m, bases_m) / travel.transit_speed_m_s
    out_pct = there_s * travel.transit_pct_per_s + along_s * travel.inspection_pct_per_s + 2.0
    fleet = range(VEHICLES)
    return SortieInstance(
        moves=MoveGeometry(first_m, last_m, (travel,)),
        bases=tuple(SortieBase(f"base{number}", 60.0, packs) for number in range(BASES)),
        vehicles=tuple(
            SortieVehicle(f"uav{row}", row % BASES, 32.0, ((0.0, 4000.0),), tuple(range(BASES))) for row in fleet
        ),
        days=((0.0, 4000.0),),
        out_s=np.stack([there_s + along_s + 20.0 for _ in fleet]),
        out_pct=np.stack([out_pct for _ in fleet]),
        home_s=np.stack([back_s + 15.0 for _ in fleet]),
        home_pct=np.stack([back_s * travel.transit_pct_per_s + 1.0 for _ in fleet]),
        transfer_s=_distance_m(bases_m, bases_m) / 3.0,
        able=np.ones((VEHICLES, SEGMENTS), dtype=np.bool_),
        wanted=np.ones(SEGMENTS, dtype=np.bool_),
    )


def _distance_m(one_m: FloatArray, other_m: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(one_m[:, np.newaxis] - other_m[np.newaxis], axis=-1))


def network_row(network: Path, seconds: float, seed: int, told: Told) -> Json:
    """Plan a whole network from four bases with six vehicles; the search gets the remaining time."""
    told("the whole network", 0, 1)
    watch = Stopwatch()
    content = build_day_problem(load_site_model(check_site(whole_site(network), "bench day"), Path()))
    ready_s = watch.seconds
    # The search's own timer starts with the pricing of all moves.
    wanted = PlanRequest(None, max(1.0, seconds - ready_s), seed, starts=cores())
    content = solve_day(content, wanted)
    told("the whole network", 1, 1)
    begin_s, end_s = content.days[0]
    found = evaluate_sorties(content.build_instance(), content.plan)
    return {
        "segments": len(content.segments),
        "length_km": sum(segment.length_m for segment in content.segments) / 1000.0,
        "vehicles": len(content.vehicles),
        "bases": len(content.bases),
        "hours": (end_s - begin_s) / 3600.0,
        "uncovered": len(content.uncovered),
        "days": 1 + max((day for day, (begin, _) in enumerate(content.days) if found.finish_s > begin), default=0),
        "finish_s": found.finish_s,
        "flight_h": found.flight_s / 3600.0,
        "sorties": found.count,
        "packs": {one.name: one.packs for one in compute_base_needs(content)},
        "wrong": list(found.violations),
        "seconds": watch.seconds,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def whole_site(network: Path) -> dict[str, Any]:
    """Return a site over a graph file: six vehicles with generators, four bases in the centres of its parts."""
    frame = read_network(default_network_path()).frame
    depot = {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg, "alt_m": frame.alt_m}
    whole = read_network(network, depot=(frame.lat_deg, frame.lon_deg, frame.alt_m))
    middles_m = centres_m(whole.ends_m.mean(axis=1), 4)
    names = [f"uav{number}" for number in range(1, 7)]
    stands = [names[0:2], names[2:4], names[4:5], names[5:6]]
    return {
        "depot": depot,
        "network": {"file": str(network.resolve())},
        "inspection": {"heights": "flat", "speed_m_s": 3.0, "transit_speed_m_s": 10.0},
        "energy": {"drone": "matrice600", "capacity_ah": GENERATOR_AH},
        "day": {"begin": "08:00", "end": "16:00", "days": 20, "lands": "any", "road_m_s": 10.0, "stagger_s": 60.0},
        "base": [
            dict(zip(("lat_deg", "lon_deg"), whole.frame.to_wgs84_deg(*place), strict=True),
                 name=f"base{number}", vehicles=own, turnaround_s=300.0)
            for number, (place, own) in enumerate(zip(middles_m.tolist(), stands, strict=True), 1)
        ],
        "vehicle": build_vehicle_tables(LISTENING[: len(names)], "px4"),
    }  # fmt: skip


def centres_m(places_m: FloatArray, count: int) -> FloatArray:
    """Return the centres of parts, each seeded at the place farthest from the others, busiest first (Lloyd 1982)."""
    centres = places_m[:1]
    for _ in range(count - 1):
        centres = np.vstack((centres, places_m[_distance_m(places_m, centres).min(axis=1).argmax()]))
    part = _distance_m(places_m, centres).argmin(axis=1)
    for _ in range(100):
        part = _distance_m(places_m, centres).argmin(axis=1)
        centres = np.array([places_m[part == number].mean(axis=0) for number in range(count)])
    return np.asarray(centres[np.argsort(-np.bincount(part, minlength=count))])


def fleet_rows(samples: int, seed: int, told: Told) -> list[Json]:
    """Fly faultline's own network many times with losses, with increasing spares; compare with the rule of thumb."""
    content = own_day(seed)
    rows, done = [], 0
    for mtbf_h in MTBF_H:
        for spares in range(SPARES + 1):
            told("fleets", done, len(MTBF_H) * (SPARES + 1))
            done += 1
            rows.append(_fleet_row(content, mtbf_h, spares, samples, seed))
    told("fleets", done, done)
    return rows


def _fleet_row(content: DayPlanFile, mtbf_h: float, spares: int, samples: int, seed: int) -> Json:
    fleet = len(content.vehicles)
    chosen = tuple(number % fleet for number in range(spares))
    campaign = SurvivalCampaign(add_spares(content.build_instance(), chosen), content.plan, mtbf_h, seed)
    lives = summarise_samples(
        [simulate_days(campaign, part) for part in split_flights(samples, 0, per_chunk=DAYS_PER_CHUNK)]
    )
    return {
        "mtbf_h": mtbf_h,
        "vehicles": fleet + spares,
        "probability": lives.finished.estimate,
        "low_95": lives.finished.low,
        "high_95": lives.finished.high,
        "losses": lives.losses,
        "packs": [sum(lives.packs_for_share(share)) for share in SHARES],
        "planned_packs": sum(content.count_packs()),
        "rule_packs": sum(compute_rule_packs(content, place) or 0 for place in content.bases),
    }


def own_day(seed: int) -> DayPlanFile:
    """Return a planned short day over faultline's own network: three vehicles, two bases, packs charged in an hour."""
    frame = read_network(default_network_path()).frame
    site = {
        "network": {"file": "default"},
        "day": {"begin": "08:00", "end": "10:00", "days": 1},
        "base": [
            {
                "name": name, "vehicles": own, "packs": 20, "recharge_s": 3600.0,
                **dict(zip(("lat_deg", "lon_deg"), frame.to_wgs84_deg(east_m, north_m), strict=True)),
            }
            for name, own, east_m, north_m in (
                ("north", ["uav1", "uav2"], 1500.0, 1500.0), ("south", ["uav3"], -1500.0, -1000.0)
            )
        ],
        "vehicle": build_vehicle_tables(LISTENING[:3], "px4"),
    }  # fmt: skip
    content = build_day_problem(load_site_model(check_site(site, "bench day"), Path()))
    return solve_day(content, PlanRequest(None, LONGEST_S, seed, iterations=150_000, starts=1))


def crowded_m(places_m: FloatArray, count: int, reach_m: float) -> FloatArray:
    """Return places, each at the largest count of places within `reach_m` not covered by an earlier one."""
    near = _distance_m(places_m, places_m) <= reach_m
    left, found = np.ones(len(places_m), dtype=np.bool_), []
    for _ in range(count):
        best = int((near & left).sum(axis=1).argmax())
        found.append(places_m[best])
        left &= ~near[best]
    return np.array(found)
