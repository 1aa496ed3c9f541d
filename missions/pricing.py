"""Compute the times and energies of all moves of a fleet from each vehicle's flight model.

A transit is priced with its detours around other vehicles' pads and around areas, and over ground covered by a raster
with its climbs and descents; else as one straight leg. Where only the lines' heights are known the actual flight is a
little longer, which `estimate` of the path accounts for.

A vehicle that inspects below its own layer descends to the line straight, and climbs from it: between two segments that
do not meet, on the outbound leg and on the return. A vehicle is priced as if it did so everywhere except where it is
known to stay in its layer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import not_
from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field

import planner
from missions.detours import DetourObstacles
from missions.flight_model import NEVER, SAME_PLACE_M, UNKNOWN, Base, FlightModel, arrival_vectors_m, find_vertical_legs
from missions.geo import BoolArray, FloatArray, IntArray
from missions.no_fly_areas import AreaRestriction, Unreachable
from missions.shortest_ways import Obstacle, build_obstacle
from missions.surface import FEW_PIECES, Relief
from missions.validation import Figure, Flag, From0, IdSet, NameSet, Pair, Place, array_of
from planner.model import BARRED_PCT, TABLES_UP_TO, renumber_visits, visit_of

T = TypeVar("T")
TimesAndEnergies = tuple[FloatArray, FloatArray]
AROUND_UP_TO = 1000
"""Segments times vehicles up to which paths lead around other vehicles' pads: each vehicle then has its own moves."""
DEPOT_M = (0.0, 0.0)
"""The depot in its own frame; pads are a few steps away."""


@dataclass(frozen=True, slots=True)
class VehicleMoves:
    """One vehicle's moves, around the columns above other vehicles' pads, around areas and over hills."""

    model: FlightModel
    columns: DetourObstacles
    relief: Relief | None
    barred: frozenset[int]
    """Segments that it cannot be assigned."""
    locked: frozenset[int]
    """Segments locked to another vehicle."""
    step_m: float
    """Its descent from its layer to a line; 0 if it inspects in its layer."""
    layered: frozenset[int]
    """Segments that it inspects in its layer nevertheless."""

    def find_low_visits(self, visits: planner.Visits) -> BoolArray:
        """Return for which visits it descends below its layer."""
        if not self.step_m:
            return NEVER
        return np.asarray(~np.isin(np.asarray(visits, dtype=np.int64) >> 1, list(self.layered)))

    def price_moves(
        self, from_m: FloatArray, facing_m: FloatArray, first_m: FloatArray, last_m: FloatArray,
        low: tuple[BoolArray, BoolArray] = (NEVER, NEVER),
    ) -> TimesAndEnergies:  # fmt: skip
        """Return seconds and energies of moves from rest; arrays (..., 3) broadcast against each other.

        Args:
            from_m: Their start places.
            facing_m: Directions of arrival there.
            first_m: Places where the visits begin.
            last_m: Places where they end.
            low: Which moves, and which of their visits, begin below the layer.
        """
        ups, downs = find_vertical_legs(from_m, first_m, *low)
        facing_m, down = arrival_vectors_m(ups, facing_m), downs[..., np.newaxis]

        def price(legs_m: FloatArray, facing_m: FloatArray, along_m: FloatArray, down: BoolArray) -> TimesAndEnergies:
            return self.model.price_moves(facing_m, legs_m, along_m, down[..., 0])

        return self._price_ways(from_m, first_m, price, (facing_m, last_m - first_m, down), ups, downs)

    def price_ways_home(
        self, from_m: FloatArray, facing_m: FloatArray, base: Base, low: BoolArray = NEVER
    ) -> TimesAndEnergies:
        """Return seconds and energies of returns from rest (..., 3) onto a pad; some begin below the layer."""

        def price(legs_m: FloatArray, facing_m: FloatArray) -> TimesAndEnergies:
            return self.model.price_ways_home(facing_m, legs_m, base)

        return self._price_ways(from_m, np.array(base.place_m), price, (arrival_vectors_m(low, facing_m),), low, NEVER)

    def _price_ways(
        self, from_m: FloatArray, to_m: FloatArray, price: Callable[..., TimesAndEnergies],
        others: Sequence[np.ndarray], ups: BoolArray, downs: BoolArray,
    ) -> TimesAndEnergies:  # fmt: skip
        """Return seconds and energies of paths as flown.

        Args:
            from_m: (..., 3) their starts.
            to_m: (..., 3) their ends.
            price: Prices paths along (..., w, 3) legs, given these and the others.
            others: (..., k) further inputs of each path's price.
            ups: Which begin with a climb to their layer.
            downs: Which end with a descent from it.
        """
        straight = price((to_m - from_m)[..., np.newaxis, :], *others)
        shape = straight[0].shape

        def flatten(one: np.ndarray) -> np.ndarray:
            return np.broadcast_to(one, (*shape, one.shape[-1])).reshape(-1, one.shape[-1])

        seconds, pct = (one.flatten() for one in straight)
        for which, ways_m in self._iterate_ways(flatten(from_m), flatten(to_m)):
            seconds[which], pct[which] = price(np.diff(ways_m, axis=1), *(flatten(one)[which] for one in others))
        priced = seconds.reshape(shape), pct.reshape(shape)
        if not self.step_m:
            return priced
        up, down = (self.model.price_vertical(rise_m) for rise_m in (self.step_m, -self.step_m))
        return priced[0] + ups * up[0] + downs * down[0], priced[1] + ups * up[1] + downs * down[1]

    def _iterate_ways(self, from_m: FloatArray, to_m: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield the indices of (n, 3) paths that are not straight, and their (k, w, 3) places; later ones override.

        Paths follow the surface where it is uneven, including those with detours.
        """
        if self.relief is not None:
            yield from self.relief.iterate_ways(from_m, to_m)
        for which, ways_m in self.columns.iterate_ways(from_m, to_m):
            yield which, ways_m if self.relief is None else self.relief.follow_surface(ways_m, FEW_PIECES)


@dataclass(frozen=True, slots=True, eq=False)
class Pricing:
    """Data from which the time and energy of every move of a fleet are computed."""

    tracks_m: Annotated[FloatArray, array_of(tuple[tuple[Place, Place], ...])]
    """(n, 2, 3) float64: ends of every segment's inspection leg, in the lowest layer."""
    bases: Mapping[str, Base]
    """By vehicle name: base where it lands, and takes off unless listed in `starts`."""
    models: Mapping[str, FlightModel]
    pads_m: tuple[Pair, ...] = ()
    """East and north of all pads, including those of vehicles that no longer fly: paths avoid the columns above
    them."""
    column_m: From0 = 0.0
    """Radius of these columns; 0 if every path is straight."""
    answer_s: From0 = 0.0
    """Time after a loss during which all vehicles fly on as planned, see `planner.Instance`."""
    kept_out: tuple[AreaRestriction, ...] = ()
    """Areas that paths lead around, for any number of segments."""
    relief: Relief | None = None
    """The lowest layer's heights, where a raster covers the ground; without it paths climb at a constant rate."""
    barred: Mapping[str, IdSet] = field(default_factory=dict)
    """By vehicle name: segments that it cannot be assigned because it lacks the required equipment."""
    locked: Annotated[Mapping[int, str], Field(exclude_if=not_)] = field(default_factory=dict)
    """Segments locked to one vehicle, and its name; valid while it is in the fleet."""
    directions: Annotated[Mapping[int, Flag], Field(exclude_if=not_)] = field(default_factory=dict)
    """Segments flown in one direction only, and whether that is reversed."""
    besides_s: Mapping[int, Figure] = field(default_factory=dict)
    """Segments that take longer than their tracks, and their extra time: pylons with viewpoints."""
    in_layer_s: Mapping[int, Figure] = field(default_factory=dict)
    """The same for viewpoints below the surface, for vehicles that view them from their layer."""
    deep_m: Mapping[int, Figure] = field(default_factory=dict)
    """By segment: depth below the surface of the lowest of these viewpoints."""
    steps_m: Mapping[str, From0] = field(default_factory=dict)
    """By vehicle name: descent from its layer to the requested inspection height; if missing it does not descend."""
    layered: Mapping[str, IdSet] = field(default_factory=dict)
    """By vehicle name: segments that it inspects in its layer, where it could meet other vehicles below."""
    low_starts: NameSet = frozenset()
    """Vehicles in the air that start below their layer."""
    closed: Mapping[str, tuple[Obstacle, ...]] = field(default_factory=dict)
    """By vehicle name: other vehicles' parts of the line that its paths lead around."""
    starts: Annotated[Mapping[str, Base], Field(exclude_if=not_)] = field(default_factory=dict)
    """By vehicle name: take-off base of each vehicle that lands elsewhere."""

    def build_vehicle_moves(self, vehicle: str, *, around: bool) -> VehicleMoves:
        """Return a vehicle's moves; its paths may lead around other vehicles' pads."""
        return VehicleMoves(
            self.models[vehicle],
            self._build_obstacles(vehicle, around=around),
            self.relief,
            self.barred.get(vehicle, frozenset()),
            frozenset(segment for segment, keeper in self.locked.items() if keeper != vehicle),
            self.steps_m.get(vehicle, 0.0),
            self.layered.get(vehicle, frozenset()),
        )

    def _build_obstacles(self, vehicle: str, *, around: bool) -> DetourObstacles:
        areas = tuple(build_obstacle(one.area) for one in self.kept_out if vehicle in one.vehicles)
        areas += self.closed.get(vehicle, ())
        if not (around and self.column_m):
            return DetourObstacles(areas=areas)
        own_m = self.bases[vehicle].place_m[:2]
        others = tuple(pad for pad in self.pads_m if math.dist(pad, own_m) > SAME_PLACE_M)
        return DetourObstacles(others, self.column_m, areas)

    def select_segments(self, segments: Sequence[int], vehicles: Iterable[str]) -> Pricing:
        """Return the pricing of some segments, renumbered in the given order, and of some vehicles."""
        names = tuple(vehicles)
        numbers = {segment: number for number, segment in enumerate(segments)}

        def renumber(figures: Mapping[int, T]) -> dict[int, T]:
            return {numbers[segment]: figure for segment, figure in figures.items() if segment in numbers}

        def select(sets: Mapping[str, frozenset[int]]) -> dict[str, frozenset[int]]:
            return {
                name: frozenset(numbers[segment] for segment in sets[name] if segment in numbers)
                for name in names
                if name in sets
            }

        return replace(
            self,
            tracks_m=self.tracks_m[list(segments)],
            besides_s=renumber(self.besides_s),
            in_layer_s=renumber(self.in_layer_s),
            deep_m=renumber(self.deep_m),
            barred=select(self.barred),
            locked=renumber({segment: keeper for segment, keeper in self.locked.items() if keeper in names}),
            directions=renumber(self.directions),
            layered=select(self.layered),
            steps_m={name: self.steps_m[name] for name in names if name in self.steps_m},
            bases={name: self.bases[name] for name in names},
            starts={name: self.starts[name] for name in names if name in self.starts},
            models={name: self.models[name] for name in names},
        )


@dataclass(frozen=True, slots=True)
class PricedMoves(planner.Moves):
    """Moves by the vehicles' own flight models, for a single flight and for a day of sorties.

    Prices of moves from a start or from a base are (2, 2n) float64: seconds and energies at a consumption of 1.
    """

    first_m: FloatArray
    """(2n, 3) float64: start of each visit."""
    last_m: FloatArray
    """(2n, 3) float64: end of each visit."""
    fliers: tuple[VehicleMoves, ...]
    """One per profile."""
    besides: FloatArray
    """(2, profiles, 2n) float64: extra seconds and energy of visits, by profile."""

    @property
    def profiles(self) -> int:
        """Number of profiles."""
        return len(self.fliers)

    @property
    def visits(self) -> int:
        """Number of visits."""
        return len(self.first_m)

    def select_visits(self, visits: Sequence[int]) -> planner.MoveTables:
        """Return the moves between some of the visits, as tables."""
        which = list(visits)
        first_m, last_m, besides = self.first_m[which], self.last_m[which], self.besides[..., which]
        return replace(self, first_m=first_m, last_m=last_m, besides=besides).tabulate()

    def add_pct(self, more_pct: FloatArray) -> PricedMoves:
        """Return moves with additional energy."""
        return replace(self, besides=np.stack((self.besides[0], self.besides[1] + more_pct)))

    def compute(self, profile: int, before: planner.Visits, after: planner.Visits) -> tuple[FloatArray, FloatArray]:
        """Return the seconds and the energy of moves."""
        facing_m, flier = self.last_m[before] - self.first_m[before], self.fliers[profile]
        seconds, pct = flier.price_moves(
            self.last_m[before], facing_m, self.first_m[after], self.last_m[after],
            (flier.find_low_visits(before), flier.find_low_visits(after)),
        )  # fmt: skip
        return seconds + self.besides[0, profile][after], pct + self.besides[1, profile][after]

    def price_out(self, profile: int, base: Base) -> FloatArray:
        """Return the moves from a pad to the end of each visit, climb included."""
        climb = np.array(self.fliers[profile].model.price_take_off(np.array(base.climb_m)))
        return self.price_from(profile, np.array(base.place_m), UNKNOWN, NEVER) + climb[:, np.newaxis]

    def price_from(self, profile: int, from_m: FloatArray, facing_m: FloatArray, is_low: BoolArray) -> FloatArray:
        """Return the moves from rest at a place, possibly below the vehicle's layer, to the end of each visit."""
        flier = self.fliers[profile]
        low = is_low, flier.find_low_visits(np.arange(self.visits))
        priced = np.array(flier.price_moves(from_m, facing_m, self.first_m, self.last_m, low))
        return np.asarray(priced + self.besides[:, profile])

    def price_home(self, profile: int, base: Base) -> FloatArray:
        """Return the moves from the end of each visit onto a pad."""
        flier = self.fliers[profile]
        low = flier.find_low_visits(np.arange(self.visits))
        return np.array(flier.price_ways_home(self.last_m, self.last_m - self.first_m, base, low))


def price_fleet(pricing: Pricing, vehicles: Iterable[str]) -> tuple[PricedMoves, tuple[int, ...]]:
    """Return the moves of some vehicles, priced on demand, and each vehicle's profile."""
    tracks_m, names = pricing.tracks_m.reshape(-1, 2, 3), tuple(vehicles)
    first_m, last_m = tracks_m.reshape(-1, 3), np.array(tracks_m[:, ::-1].reshape(-1, 3))
    around = len(tracks_m) * len(names) <= AROUND_UP_TO
    fliers = tuple(pricing.build_vehicle_moves(name, around=around) for name in names)
    profiles = tuple(dict.fromkeys(fliers))
    besides = np.zeros((2, len(profiles), len(first_m)))
    for number, flier in enumerate(profiles):
        # A barred or locked visit takes more energy than any battery holds.
        more = besides[:, number]
        from_layer = {segment: pricing.in_layer_s[segment] for segment in flier.layered & pricing.in_layer_s.keys()}
        for segment, seconds in {**pricing.besides_s, **from_layer}.items():
            more[:, 2 * segment : 2 * segment + 2] = [[seconds], [seconds * flier.model.hover_pct_per_s]]
        for segment in (*flier.barred, *flier.locked):
            more[1, 2 * segment : 2 * segment + 2] += BARRED_PCT
        for segment, is_turned in pricing.directions.items():
            more[1, visit_of(segment, not is_turned)] += BARRED_PCT
    return PricedMoves(first_m, last_m, profiles, besides), tuple(map(profiles.index, fliers))


def build_priced_instance(pricing: Pricing, vehicles: Sequence[planner.Vehicle]) -> planner.Instance:
    """Return the planning problem of one flight over all segments of a pricing.

    A vehicle on the ground climbs from its pad; one in the air starts at its ``start_m`` and ``start_up_m``, turned
    along its ``facing_m``.

    Args:
        pricing: Of at least these vehicles.
        vehicles: The fleet.

    Raises:
        planner.InstanceError: there is no vehicle, or a start is not a number.
    """
    flown, profiles = price_fleet(pricing, (vehicle.name for vehicle in vehicles))
    # A vehicle that descends from its own layer has its own moves, as does a vehicle with locked segments.
    tables = flown.profiles if pricing.steps_m or pricing.locked else 1
    small = flown.profiles and tables * len(pricing.tracks_m) ** 2 <= TABLES_UP_TO**2
    moves: planner.Moves = flown.tabulate() if small else flown
    start, again, home = (np.zeros((2, len(vehicles), flown.visits)) for _ in range(3))
    idle = np.zeros((2, len(vehicles)))
    for row, (vehicle, profile) in enumerate(zip(vehicles, profiles, strict=True)):
        base = pricing.bases[vehicle.name]
        again[:, row], home[:, row] = flown.price_out(profile, base), flown.price_home(profile, base)
        first = pricing.starts.get(vehicle.name)
        start[:, row] = again[:, row] if first is None else flown.price_out(profile, first)
        if vehicle.airborne:
            here_m = np.array([*vehicle.start_m, vehicle.start_up_m])
            facing_m = np.array([*vehicle.facing_m, 0.0])
            here_low = np.array(vehicle.name in pricing.low_starts)
            start[:, row] = flown.price_from(profile, here_m, facing_m, here_low)
            idle[:, row] = flown.fliers[profile].price_ways_home(here_m, facing_m, base, here_low)
    consumption = np.array([vehicle.consumption for vehicle in vehicles], dtype=np.float64)[:, np.newaxis]
    return planner.Instance(
        vehicles=tuple(vehicles),
        profile=profiles,
        moves=moves,
        start_s=start[0], start_pct=start[1] * consumption,
        home_s=home[0], home_pct=home[1] * consumption,
        idle_s=idle[0], idle_pct=idle[1] * consumption[:, 0],
        depot_s=again[0], depot_pct=again[1],
        value=np.hypot(*(flown.last_m - flown.first_m)[::2, :2].T),
        end_m=flown.last_m,
        landing_m=DEPOT_M,
        answer_s=pricing.answer_s,
        locked={
            segment: number
            for number, vehicle in enumerate(vehicles)
            for segment, keeper in pricing.locked.items() if keeper == vehicle.name
        },
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """A planning problem over some of a network's segments."""

    instance: planner.Instance
    segment_ids: tuple[int, ...]
    """The network's segment ids, by the instance's segment."""
    pricing: Pricing | None = None
    """Source of the instance; None: the paper's model."""
    unreachable: tuple[Unreachable, ...] = ()
    """Other requested segments of the network that no flight can inspect."""

    def to_network(self, visits: Iterable[int]) -> tuple[int, ...]:
        """Return the instance's visits as visits of the network."""
        return renumber_visits(visits, self.segment_ids)

    def from_network(self, visits: Iterable[int]) -> tuple[int, ...]:
        """Return the network's visits as visits of the instance.

        Raises:
            KeyError: a visit's segment is not part of the problem.
        """
        reduced = {segment: index for index, segment in enumerate(self.segment_ids)}
        return renumber_visits(visits, reduced)

    def plan_to_network(self, plan: planner.Plan) -> planner.Plan:
        """Return a plan of the instance with the network's segments."""
        routes = tuple(planner.Route(route.vehicle, self.to_network(route.visits)) for route in plan.routes)
        return planner.Plan(routes, tuple(self.segment_ids[segment] for segment in plan.uncovered))


def build_open_task(pricing: Pricing, open_segments: Iterable[int], vehicles: Sequence[planner.Vehicle]) -> Task:
    """Return the problem of inspecting the remaining segments from the vehicles' current places.

    Args:
        pricing: Pricing of the whole network.
        open_segments: Its segments still to be inspected; used in ascending order.
        vehicles: Each with the start (east, north) where it becomes free, its remaining budget there, and whether it is
            in the air.

    Raises:
        IndexError: a segment is not in the network.
        planner.InstanceError: there is no vehicle, or a start is not a number.
    """
    segment_ids = tuple(sorted(set(open_segments)))
    count = len(pricing.tracks_m)
    if segment_ids and not 0 <= segment_ids[0] <= segment_ids[-1] < count:
        raise IndexError(f"open segments {segment_ids[0]} to {segment_ids[-1]}: expected below {count}")
    part = pricing.select_segments(segment_ids, (vehicle.name for vehicle in vehicles))
    return Task(build_priced_instance(part, vehicles), segment_ids, part)
