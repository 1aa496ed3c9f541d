"""`faultline bench pictures`: flights with cameras, with faults and lost datagrams, and their cards.

Fleets fly over parts of faultline's own network in virtual time. Spans require an image every few metres, some pylons
viewpoints around them, on half of the flights from beside their insulators. Vehicles are lost or silent for a while,
cameras fail, cards are full, a fifth of all datagrams is lost. The simulated cameras write real JPEGs, whose clocks are
off by minutes and by time zones. The index, and the matching of files to its rows, are checked against the images that
were really taken.
"""

from __future__ import annotations

import math
import tempfile
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.distance import drawn_faults, kind_of
from benchmarks.parallel_flights import FlightCase
from benchmarks.prediction import plan_with
from benchmarks.store import Json
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from benchmarks.virtual_site import AMPLE_AH, build_virtual_site, dearest_route_pct
from executor.core.payload.camera_state import angle_between_deg
from executor.errors import ExecutorError
from executor.images.index_files import ImageIndex, ImageRow, build_image_index
from executor.images.matching import find_picture_files, match_files
from executor.simulated.simulated_fleet import SimulatedCards
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions.cameras import PylonCameraTask
from missions.geo import LocalFrame
from missions.geometry import locate_on_leg
from planner import Cost, NoImprovement, solve
from simulator.camera import CapturedImage
from simulator.fleet import SimulatedVehicle

VEHICLES = (2, 4)
RADII_M = (320.0, 400.0, 500.0)
EVERY_M = 12.0
GAP, LATE_M = 1.5, 2.5
"""A span is shown if no two images along it are farther apart than this factor times the requested distance, plus this
margin."""
USES_PCT = 40.0
SETTLED = 300
SIZED_IN = 4
"""Steps to find packs of which the most expensive route uses that share."""
LOST_SHARE = 0.2
"""Share of all datagrams, each way."""
FAULTS = (
    "crash", "silent", "silent=30", "pilot=RTL", "camera-silent", "card-full", "gimbal-stuck", "camera-mute",
    "camera-loss=0.4", "",
)  # fmt: skip
ONLY_SPOKEN = frozenset({"gimbal-stuck", "card-full", "camera-mute"})
"""Faults that a wired camera does not have."""
OF_CAMERAS = ONLY_SPOKEN | {"camera-silent", "camera-loss"}
CLOCK_S = 600.0
"""Maximum error of a camera's clock, besides whole hours of a time zone."""
ZONES_H = (-1, 3)
BEGAN_UNIX_S = 1_795_000_000.0
"""Start of every flight, by the computer's clock."""
SAME_S, SAME_M = 1.0, 8.0
"""Tolerance between a row of the index and its image."""
ASIDE_M = 5.0
TRUE_M = 1.0
"""Tolerance between a true and a reported position."""
PYLON_M = 8.0
"""Distance to a pylon, passed at some metres, within which one span's last image meets the next one's first."""
PASS_S, DOUBLE = 20.0, 0.2
"""Two images of one pass are less than this apart in time; closer than this share of the requested distance, one is a
duplicate."""
SPEAKS = {"name": "rgb", "id": 100, "gimbal": True}
WIRED = {"name": "rgb", "id": 1}
BELOW = {"distance_m": 14, "heights_m": [2, -6], "target_m": -3}
"""Half of the flights: viewpoints from beside the insulators, and half of these with a region of interest."""
VIEW_M = 5.0
"""Distance to a viewpoint within which an image counts for it."""


@dataclass(frozen=True, slots=True)
class PicturesFlight:
    """Result of one flight."""

    number: int
    autopilot: str
    vehicles: int
    camera: str
    """speaks or wired."""
    faults: tuple[str, ...]
    assets: int
    seen: int = 0
    named: int = 0
    """Assets not seen, and named as left over."""
    taken: int = 0
    """Images on the cards."""
    indexed: int = 0
    """Of these, the indexed ones."""
    excused: int = 0
    """Of these, those missing in the index because of a vehicle or camera declared failed."""
    files: int = 0
    matched: int = 0
    wrong: tuple[str, ...] = ()
    """Errors in the result."""
    flown_s: float = 0.0
    not_flown: str = ""


@dataclass(slots=True)
class _Taken:
    """Images that really came onto the cards."""

    cards: SimulatedCards
    shots: dict[str, list[tuple[CapturedImage, Path]]] = field(default_factory=dict)

    def look(self, vehicles: Mapping[str, SimulatedVehicle]) -> None:
        """Write the images taken since the last call."""
        for name, vehicle in vehicles.items():
            for shot in vehicle.drain_shots():
                self.shots.setdefault(name, []).append((shot, self.cards.write(name, shot)))

    def shot_of(self, row: ImageRow) -> CapturedImage | None:
        """Return the image of an index row; None if there is none."""
        own = self.shots.get(row.vehicle, [])
        at_s = row.unix_s - BEGAN_UNIX_S
        after = bisect_left(own, at_s, key=lambda one: one[0].t_s)
        near = [shot for shot, _ in own[max(0, after - 1) : after + 1] if abs(shot.t_s - at_s) <= SAME_S]
        near = [shot for shot in near if _distance_m(row, shot.lat_deg, shot.lon_deg) <= SAME_M]
        return min(near, key=lambda shot: abs(shot.t_s - at_s), default=None)


def _distance_m(row: ImageRow, lat_deg: float, lon_deg: float) -> float:
    """Return the horizontal distance of an image from a place."""
    east_m, north_m = LocalFrame(row.lat_deg, row.lon_deg).to_local_m(lat_deg, lon_deg)
    return math.hypot(east_m, north_m)


def fly_pictures(case: FlightCase) -> PicturesFlight:
    """Generate a flight, fly it, read its cards, and check it; the same case gives the same figures."""
    rng = np.random.default_rng([case.seed, 37, case.number])
    vehicles = int(rng.integers(VEHICLES[0], VEHICLES[1] + 1))
    speaks = case.autopilot == "px4" or bool(rng.random() < 0.5)
    below = BELOW | {"roi": bool(rng.random() < 0.5)} if case.number % 4 > 1 else {}
    tables = {
        "camera": [SPEAKS if speaks else WIRED],
        "look": [
            {"camera": "rgb", "every_m": EVERY_M},
            {"camera": "rgb", "of": "pylons", "pylons": ["*3"], "bearings_deg": [60, 120], "both_sides": True, **below},
        ],
        "inspection": {"same_distance": bool(below)},
        "faults": {"camera": str(rng.choice(["home", "on"]))},
    }
    over = partial(build_virtual_site, None, float(rng.choice(RADII_M)), vehicles, case.autopilot, tables=tables)
    ground, routes = _plan_site(over, int(rng.integers(1 << 30)))
    kinds = FAULTS if speaks else tuple(kind for kind in FAULTS if kind not in ONLY_SPOKEN)
    faults = drawn_faults(ground.names, kinds, rng, (5, 90))
    ahead_s = {
        name: float(rng.uniform(-CLOCK_S, CLOCK_S)) + 3600.0 * int(rng.integers(*ZONES_H)) for name in ground.names
    }
    empty = PicturesFlight(
        case.number, case.autopilot, vehicles, "speaks" if speaks else "wired", faults,
        len(ground.setup.looks.spans) + len(ground.setup.looks.pylons),
    )  # fmt: skip

    with tempfile.TemporaryDirectory(prefix="faultline-cards-") as folder:
        cards = SimulatedCards(Path(folder), BEGAN_UNIX_S, ahead_s, places=bool(rng.random() < 0.5))
        taken = _Taken(cards)
        try:
            flight = fly_virtual(
                ground, plan_with(ground, routes), faults=(*faults, f"all:loss={LOST_SHARE:g}@0s"), seed=case.number,
                onlookers=FlightObservers(lived=taken.look),
            )  # fmt: skip
        except ExecutorError as error:
            return replace(empty, not_flown=str(error))
        return _judge_flight(empty, ground, flight, taken, Path(folder))


def _plan_site(over: Callable[..., SiteModel], seed: int) -> tuple[SiteModel, dict[str, tuple[int, ...]]]:
    """Return a site with suitable packs, and routes over all segments."""
    capacity_ah = AMPLE_AH
    ground = over(capacity_ah=capacity_ah)
    task = site_model.build_first_task(ground, range(len(ground.network.segments)))
    plan = solve(task.instance, cost=Cost.MINMAX, stop=NoImprovement(SETTLED), seed=seed).plan
    routes = {name: task.to_network(route.visits) for name, route in zip(ground.names, plan.routes, strict=True)}
    for _ in range(SIZED_IN):
        # A small battery delivers less at the same power, so the relation is not proportional.
        capacity_ah *= dearest_route_pct(ground, plan_with(ground, routes)) / USES_PCT
        ground = over(capacity_ah=capacity_ah)
    return ground, routes


def _judge_flight(
    empty: PicturesFlight, ground: SiteModel, flight: VirtualFlight, taken: _Taken, folder: Path
) -> PicturesFlight:
    """Check a flight, its index and its cards against the images really taken."""
    index = build_image_index(flight.context, flight.state, BEGAN_UNIX_S)
    found = {id(row): taken.shot_of(row) for row in index.images}
    known = {id(shot) for shot in found.values()}
    failed = {name for name, vehicle in flight.state.vehicles.items() if vehicle.fault or vehicle.payload.broken}
    shots = [(name, shot) for name, own in taken.shots.items() for shot, _ in own]
    unknown = [name for name, shot in shots if id(shot) not in known]
    uncovered = set(flight.report.segments_uncovered)
    unseen = {row.segment for row in index.assets if row.state != "seen"}
    files = list(find_picture_files(folder))
    matching = match_files(index, files, folder)
    by_path = {path: shot for own in taken.shots.values() for shot, path in own}
    wrong = [] if flight.ended else ["the supervision did not end"]
    wrong += [
        f"{row.asset or 'a picture'} by {row.vehicle}: its picture {row.sequence} was never taken"
        for row in index.images if found[id(row)] is None
    ]  # fmt: skip
    # A wired camera's autopilot reports each image once; if that is lost, the span is inspected again.
    failed |= set(taken.shots) if empty.camera == "wired" else set()
    wrong += [f"{name} took a picture that the index lacks" for name in unknown if name not in failed]
    wrong += [f"{segment} was not seen, and is not named" for segment in sorted(unseen - uncovered)]
    wrong += [
        f"the camera of {name} is said to have failed, and did not"
        for name in _find_false_camera_faults(flight, empty.faults)
    ]
    wrong += _gaps(ground, index, taken)
    wrong += _misses(ground, flight, index, taken)
    wrong += _doubles(index)
    wrong += [
        f"{match.file.path.parent.name}/{match.file.path.name} is taken for picture {match.image.sequence} of "
        f"{match.image.vehicle}"
        for match in matching.matches if found[id(match.image)] is not by_path[match.file.path]
    ]  # fmt: skip
    mine = {match.file.path for match in matching.matches}
    wrong += [f"{path.parent.name}/{path.name} belongs to nobody" for path, shot in by_path.items()
              if id(shot) in known and path not in mine]  # fmt: skip
    return replace(
        empty,
        seen=sum(row.state == "seen" for row in index.assets),
        named=len(unseen),
        taken=len(shots),
        indexed=len(shots) - len(unknown),
        excused=sum(name in failed for name in unknown),
        files=len(files),
        matched=len(mine),
        wrong=tuple(wrong),
        flown_s=flight.flown_s,
    )


def _find_false_camera_faults(flight: VirtualFlight, faults: Sequence[str]) -> list[str]:
    """Return the cameras declared failed that had no fault."""
    befell = {fault.split(":")[0] for fault in faults if kind_of(fault) in OF_CAMERAS}
    return [name for name, vehicle in flight.state.vehicles.items() if vehicle.payload.broken and name not in befell]


def _gaps(ground: SiteModel, index: ImageIndex, taken: _Taken) -> list[str]:
    """Return the spans reported as seen along which too few images were really taken."""
    frame, lines = ground.network.frame, ground.setup.tracks_m.tolist()
    places_m = [frame.to_local_m(shot.lat_deg, shot.lon_deg) for own in taken.shots.values() for shot, _ in own]
    found = []
    for row in index.assets:
        if row.state != "seen" or row.take != "pictures":
            continue
        begin_m, end_m = (tuple(end) for end in lines[row.segment])
        length_m = math.dist(begin_m, end_m)
        located = (locate_on_leg(begin_m, end_m, place) for place in places_m)
        along = sorted(at_m for at_m, aside_m in located if aside_m < ASIDE_M)
        gap_m = max(b - a for a, b in zip([0.0, *along], [*along, length_m], strict=True))
        if gap_m > GAP * row.every_m + LATE_M + TRUE_M:
            found.append(f"{row.asset} is called seen, and {gap_m:.1f} m of it are in no picture")
    return found


def _misses(ground: SiteModel, flight: VirtualFlight, index: ImageIndex, taken: _Taken) -> list[str]:
    """Return the viewpoints reported as seen without an image taken as requested."""
    frame, pylons, found = ground.network.frame, ground.setup.looks.pylons, []
    asked_m = ground.setup.inspection.height_m
    shots = [
        ((*frame.to_local_m(shot.lat_deg, shot.lon_deg), shot.alt_msl_m - frame.alt_m), shot)
        for own in taken.shots.values() for shot, _ in own
    ]  # fmt: skip
    for row in index.assets:
        look = pylons.get(row.segment)
        if look is None or row.state != "seen":
            continue
        low = flight.state.coverage.inspected_at_m.get(row.segment, asked_m) == asked_m
        for number, point in enumerate(look.points, start=1):
            up_m = ground.setup.layers.surface.height_m(*point.place_m) - point.below_m
            near = [
                (place_m, shot) for place_m, shot in shots
                if math.dist(place_m[:2], point.place_m) < VIEW_M and (not look.deepest_m or not low
                                                                       or abs(place_m[2] - up_m) < VIEW_M)
            ]  # fmt: skip
            gimbal = ground.setup.looks.cameras[look.camera].gimbal
            if not any(not (look.roi or gimbal) or _faces(look, place_m, shot, gimbal) for place_m, shot in near):
                found.append(f"{row.asset}: viewpoint {number} is called seen, and no picture was taken from it")
    return found


def _faces(look: PylonCameraTask, place_m: tuple[float, float, float], shot: CapturedImage, gimbal: bool) -> bool:
    """Return whether a camera pointed as its pylon requires; one on the nose only turns."""
    east_m, north_m, up_m = (there - here for there, here in zip(look.target_m, place_m, strict=True))
    to_deg = math.degrees(math.atan2(east_m, north_m))
    if not gimbal:
        return angle_between_deg(0.0, shot.yaw_deg, 0.0, to_deg) <= look.aim_deg
    down_deg = math.degrees(math.atan2(up_m, math.hypot(east_m, north_m)))
    return angle_between_deg(shot.pitch_deg, shot.yaw_deg, down_deg, to_deg) <= look.aim_deg


def _doubles(index: ImageIndex) -> list[str]:
    """Return duplicates within one pass, among images that count.

    A repeated flight is another pass, and at a pylon where two spans meet each requires an image.
    """
    found, last = [], dict[tuple[str, int], ImageRow]()
    pylons = {place for row in index.assets for place in row.line}
    for row in index.images:
        if row.segment is None or row.flaw:
            continue
        before = last.get((row.vehicle, row.segment))
        last[row.vehicle, row.segment] = row
        if before is None or row.unix_s - before.unix_s > PASS_S:
            continue
        along = row.viewpoint.endswith(" m")
        met = along and any(_distance_m(row, *place) < PYLON_M for place in pylons)
        near = _distance_m(row, before.lat_deg, before.lon_deg) < DOUBLE * EVERY_M
        if not met and (near if along else row.viewpoint == before.viewpoint):
            found.append(f"{row.asset}, {row.viewpoint}, was taken twice by {row.vehicle}")
    return found


def pictures_results(flights: Sequence[PicturesFlight]) -> Json:
    """Return the figures."""
    flown = [one for one in flights if not one.not_flown]
    sums = {
        name: sum(getattr(one, name) for one in flown)
        for name in ("assets", "seen", "named", "taken", "indexed", "excused", "files", "matched")
    }
    return {
        "flights": len(flown),
        "by_autopilot": dict(sorted(Counter(one.autopilot for one in flown).items())),
        "by_camera": dict(sorted(Counter(one.camera for one in flown).items())),
        "faults": dict(sorted(Counter(kind_of(fault) for one in flown for fault in one.faults).items())),
        **sums,
        "wrong": [
            f"flight {one.number} ({one.autopilot}, {one.camera}, {', '.join(one.faults) or 'no fault'}): {line}"
            for one in flown for line in one.wrong
        ],
        "not_flown": [f"flight {one.number}: {one.not_flown}" for one in flights if one.not_flown],
        "flown_s": round(sum(one.flown_s for one in flown), 1),
    }  # fmt: skip
