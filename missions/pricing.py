"""What flights take: from how a vehicle moves and what its power is to the times and energies of all moves.

There is one description of a flight. The planner's matrices, the checks before the flight, its progress, re-plans and
reports price their legs here, so that a plan says what will be flown. A *move* is what a route consists of: the
transit to a segment's first pylon, which ends with a stop, and the inspection to its last one, which does too. What a
move takes therefore does not depend on what comes before or after it.

Places are east, north and up in metres, the height as it would be in the lowest layer: layers are parallel, so that
what a move takes is the same in each. A transit is priced as it leads around others' pads and around areas, and where a
raster knows the ground as it rises and falls with it, else as one straight leg; where only the lines' heights are known
the flight is a little longer, which `estimate` of the path knows.

Who inspects below its own layer comes down to the line straight, and goes up from it: between two segments that do not
meet, on the way there and on the way home. A vehicle is priced as if it did so everywhere but where it is known not to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from missions.areas import KeptOut
from missions.detours import Columns, IntArray, led_around
from missions.geo import FloatArray
from missions.pace import AS_MODELLED, Pace
from missions.performance import Performance
from missions.relief import FEW_PIECES, Relief, followed_where_uneven
from missions.rises import NEVER, BoolArray, Rises
from missions.validation import Figure, Place
from missions.ways import Obstacle, obstacle_of
from planner import CLIMB_SHARE_PER_M_S, Instance, Moves, MoveTables, SteadyWind, Vehicle, Visits

SAME_PLACE_M = 0.5
"""An inspection that starts this near to where the last one ended needs no waypoint in between."""
TABLES_UP_TO = 1000
"""Segments up to which all moves are kept in tables: 2000 x 2000 times and energies are 64 MB."""
AROUND_UP_TO = 1000
"""Segments times vehicles up to which ways lead around others' pads: each vehicle then has moves of its own."""
BARRED_PCT = 1e5
"""Of a full battery: a visit that takes so much fits into no budget."""
DEPOT_M = (0.0, 0.0)
"""The depot in its own frame; pads are a few steps away."""
UNKNOWN = np.zeros(3)
"""The direction of who may face anywhere."""
Speed = Annotated[Figure, Field(ge=0.001)]


@dataclass(frozen=True, slots=True)
class FlightModel:
    """What one vehicle's flights take."""

    performance: Performance
    power: SteadyWind
    """What it uses at an air speed, and the wind."""
    transit_speed_m_s: Speed
    inspection_speed_m_s: Speed
    pace: Pace = AS_MODELLED
    """What is known of this very vehicle: on its moves as a whole."""

    def legs(self, along_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (...) float64 seconds and energies in percent of a full battery of straight legs.

        Args:
            along_m: (..., 3) float64, east, north and up.
            speed_m_s: (...) float64 over the ground, at most.
            ends: (...) float64, how many of the two ends are at rest.
        """
        length_m, rise_m = np.hypot(along_m[..., 0], along_m[..., 1]), along_m[..., 2]
        seconds = self.performance.legs_s(length_m, rise_m, speed_m_s, ends)
        speed = self.performance.leg_speed_m_s(length_m, rise_m, speed_m_s)
        # A leg too short for its speed is two ramps, whose mean speed is half of the peak's.
        peak = np.minimum(speed, 2.0 * length_m / np.maximum(seconds, 1e-9))
        ramps_s = np.minimum(seconds, ends * self.performance.level.ramp_s(peak))
        toward = along_m[..., :2] / np.maximum(length_m, 1e-9)[..., np.newaxis] * peak[..., np.newaxis]
        cruise, half, rest = (self._rates_pct_per_s(share * toward) for share in (1.0, 0.5, 0.0))
        ramp_pct = ramps_s * (cruise + 4.0 * half + rest) / 6.0  # Simpson's rule over speeds from 0 to the peak
        climb_pct = CLIMB_SHARE_PER_M_S * np.maximum(rise_m, 0.0) * cruise
        return seconds, np.asarray((seconds - ramps_s) * cruise + ramp_pct + climb_pct)

    @property
    def hover_pct_per_s(self) -> float:
        """What a second at rest over a place uses."""
        return float(self._rates_pct_per_s(np.zeros(2)))

    def take_off(self, climb_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of climbs from the pad."""
        seconds = self.performance.take_off_s(climb_m)
        return seconds, np.asarray((seconds + CLIMB_SHARE_PER_M_S * climb_m) * self.hover_pct_per_s)

    def landing(self, drop_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of landings from over the pad."""
        seconds = self.performance.landing_s(drop_m)
        return seconds, np.asarray(seconds * self.hover_pct_per_s)

    def moves(
        self, from_m: FloatArray, facing_m: FloatArray, first_m: FloatArray, last_m: FloatArray,
        down: BoolArray = NEVER,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return seconds and energies of moves from rest; the four arrays (..., 3) broadcast against each other.

        Args:
            from_m: Where they begin.
            facing_m: Along which the vehicle arrived there; of no length where nobody knows.
            first_m: Where the visits begin.
            last_m: Where they end.
            down: Which visits it comes down to, straight, when it is there.
        """
        there_m, along_m = first_m - from_m, last_m - first_m
        away = np.hypot(there_m[..., 0], there_m[..., 1]) > SAME_PLACE_M
        hold_s = self.performance.hold_s
        transit_s, transit_pct = self._transit(facing_m, there_m, hold_s)
        before_m = np.where(away[..., np.newaxis], there_m, facing_m)
        before_m = _nowhere_where(down, before_m)
        fast_m_s = np.where(away, self.transit_speed_m_s, self.inspection_speed_m_s)
        inspect_s, inspect_pct = self._inspection(before_m, self._arrives_m_s(before_m, fast_m_s), along_m)
        seconds = np.where(away, transit_s, 0.0) + inspect_s
        return np.asarray(seconds), np.asarray(np.where(away, transit_pct, 0.0) + inspect_pct)

    def moves_along(
        self, facing_m: FloatArray, ways_m: FloatArray, last_m: FloatArray, down: BoolArray = NEVER
    ) -> tuple[FloatArray, FloatArray]:
        """Return (k,) seconds and energies of moves whose transits lead through (k, w, 3) places."""
        transit_s, transit_pct = self._transit_along(facing_m, ways_m, self.performance.hold_s)
        before_m, along_m = ways_m[:, -1] - ways_m[:, -2], last_m - ways_m[:, -1]
        before_m = _nowhere_where(down, before_m)
        arrives_m_s = self._arrives_m_s(before_m, self.transit_speed_m_s)
        inspect_s, inspect_pct = self._inspection(before_m, arrives_m_s, along_m)
        return transit_s + inspect_s, transit_pct + inspect_pct

    def ways_home(self, from_m: FloatArray, facing_m: FloatArray, base: Base) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of the ways from rest (..., 3) onto a pad."""
        there_m = np.array(base.place_m) - from_m
        level_s, level_pct = self._transit(facing_m, there_m, 0.0)
        land_s, land_pct = self.landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def ways_home_along(self, facing_m: FloatArray, ways_m: FloatArray, base: Base) -> tuple[FloatArray, FloatArray]:
        """Return (k,) the same of ways through (k, w, 3) places."""
        level_s, level_pct = self._transit_along(facing_m, ways_m, 0.0)
        land_s, land_pct = self.landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def upright(self, rise_m: float) -> tuple[float, float]:
        """Return seconds and energy of a way straight up, or below zero down, with the stop at its end."""
        seconds, pct = self._transit(UNKNOWN, np.array([0.0, 0.0, rise_m]), self.performance.hold_s)
        return float(seconds), float(pct)

    def _transit_along(self, before_m: FloatArray, ways_m: FloatArray, hold_s: float) -> tuple[FloatArray, FloatArray]:
        """Return (k,) seconds and energies from stop to stop through (k, w, 3) places; those between are passed."""
        along_m = np.diff(ways_m, axis=1)
        speed_m_s = np.full(along_m.shape[:-1], self.transit_speed_m_s)
        ends = np.zeros(along_m.shape[:-1])
        ends[:, 0] += 1.0
        ends[:, -1] += 1.0
        seconds, pct = self.legs(along_m, speed_m_s, ends)
        own = self.performance
        arrives_m_s = self._arrives_m_s(before_m, self.inspection_speed_m_s)
        stays_s = own.settle_s + hold_s + own.turns_s(before_m, along_m[:, 0], arrives_m_s)
        stays_s = stays_s + own.corners_s(along_m[:, :-1], along_m[:, 1:], speed_m_s[:, 1:]).sum(axis=1)
        pace = self.pace.transit
        return pace * (seconds.sum(axis=1) + stays_s), pace * (pct.sum(axis=1) + stays_s * self.hover_pct_per_s)

    def _transit(self, before_m: FloatArray, along_m: FloatArray, hold_s: float) -> tuple[FloatArray, FloatArray]:
        arrives_m_s = self._arrives_m_s(before_m, self.inspection_speed_m_s)
        turns_s = self.performance.turns_s(before_m, along_m, arrives_m_s)
        return self._stopping(along_m, self.transit_speed_m_s, hold_s + turns_s, self.pace.transit)

    def _inspection(
        self, before_m: FloatArray, arrives_m_s: FloatArray, along_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        turns_s = self.performance.turns_s(before_m, along_m, arrives_m_s)
        return self._stopping(along_m, self.inspection_speed_m_s, self.performance.hold_s + turns_s, self.pace.inspect)

    def _stopping(
        self, along_m: FloatArray, speed_m_s: float, stays_s: FloatArray, pace: float
    ) -> tuple[FloatArray, FloatArray]:
        shape = along_m.shape[:-1]
        seconds, pct = self.legs(along_m, np.full(shape, speed_m_s), np.full(shape, 2.0))
        stays_s = self.performance.settle_s + stays_s
        return pace * (seconds + stays_s), pace * (pct + stays_s * self.hover_pct_per_s)

    def _arrives_m_s(self, before_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        return self.performance.arrives_m_s(np.hypot(before_m[..., 0], before_m[..., 1]), speed_m_s)

    def _rates_pct_per_s(self, velocities_m_s: FloatArray) -> FloatArray:
        return self.power.rates_pct_per_s(velocities_m_s[..., 0], velocities_m_s[..., 1])


@dataclass(frozen=True, slots=True)
class Base:
    """Where a vehicle takes off and lands."""

    place_m: Place
    """Over its pad, where its climb ends and its landing begins."""
    climb_m: Annotated[Figure, Field(ge=0)]
    """From the pad's ground to there, in the vehicle's own layer."""


@dataclass(frozen=True, slots=True)
class Flier:
    """One vehicle's moves, around the columns above others' pads, around areas and over hills."""

    model: FlightModel
    columns: Columns = field(default_factory=Columns)
    relief: Relief | None = None
    barred: frozenset[int] = frozenset()
    """Segments that it cannot be given."""

    besides_s: tuple[tuple[int, float], ...] = ()
    """Segments that take longer than their tracks, and by how much."""
    in_layer_s: tuple[tuple[int, float], ...] = ()
    """The same of those whose viewpoints lie below the surface, where it looks at them from its layer."""
    step_m: float = 0.0
    """How far it comes down from its layer to a line; 0 where it inspects in its layer."""
    layered: frozenset[int] = frozenset()
    """Segments that it inspects in its layer all the same."""

    def low(self, visits: Visits) -> BoolArray:
        """Return which visits it comes down to."""
        if not self.step_m:
            return NEVER
        return np.asarray(~np.isin(np.asarray(visits) >> 1, list(self.layered)))

    def besides(self, visits: int) -> FloatArray:
        """Return (2, visits) float64: seconds and energy that visits take besides.

        That is more than any battery holds where the vehicle is barred from a visit.
        """
        more = np.zeros((2, visits))
        from_layer = {segment: seconds for segment, seconds in self.in_layer_s if segment in self.layered}
        for segment, seconds in (dict(self.besides_s) | from_layer).items():
            more[:, 2 * segment : 2 * segment + 2] = [[seconds], [seconds * self.model.hover_pct_per_s]]
        for segment in self.barred:
            more[1, 2 * segment : 2 * segment + 2] += BARRED_PCT
        return more

    def moves(
        self, from_m: FloatArray, facing_m: FloatArray, first_m: FloatArray, last_m: FloatArray,
        low: tuple[BoolArray, BoolArray] = (NEVER, NEVER),
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return seconds and energies of moves from rest, as `FlightModel.moves` takes them.

        Args:
            from_m: Where they begin.
            facing_m: Along which the vehicle arrived there.
            first_m: Where the visits begin.
            last_m: Where they end.
            low: Which moves begin, and which of their visits are, below the layer.
        """
        rises = Rises.between(from_m, first_m, *low, SAME_PLACE_M)
        facing_m = _nowhere_where(rises.up, facing_m)
        straight = self.model.moves(from_m, facing_m, first_m, last_m, rises.down)

        def along(which: IntArray, ways_m: FloatArray) -> tuple[FloatArray, FloatArray]:
            facing, last = (
                np.broadcast_to(places, (*straight[0].shape, 3)).reshape(-1, 3)[which] for places in (facing_m, last_m)
            )
            down = np.broadcast_to(rises.down, straight[0].shape).reshape(-1)[which]
            return self.model.moves_along(facing, ways_m, last, down)

        return self._and_upright(self._led(from_m, first_m, straight, along), rises)

    def _and_upright(self, led: tuple[FloatArray, FloatArray], rises: Rises) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of ways with what leads up to their layer, and down from it."""
        if not self.step_m:
            return led
        ups, downs = (self.model.upright(rise_m) for rise_m in (self.step_m, -self.step_m))
        seconds, pct = (led[of] + rises.up * ups[of] + rises.down * downs[of] for of in (0, 1))
        return np.asarray(seconds), np.asarray(pct)

    def ways_home(
        self, from_m: FloatArray, facing_m: FloatArray, base: Base, low: BoolArray = NEVER
    ) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of the ways from rest (..., 3) onto a pad; some begin below the layer."""
        facing_m = _nowhere_where(low, facing_m)
        straight = self.model.ways_home(from_m, facing_m, base)

        def along(which: IntArray, ways_m: FloatArray) -> tuple[FloatArray, FloatArray]:
            facing = np.broadcast_to(facing_m, (*straight[0].shape, 3)).reshape(-1, 3)[which]
            return self.model.ways_home_along(facing, ways_m, base)

        return self._and_upright(self._led(from_m, np.array(base.place_m), straight, along), Rises(low, NEVER))

    def _led(
        self, from_m: FloatArray, to_m: FloatArray, straight: tuple[FloatArray, FloatArray],
        along: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return seconds and energies of ways as they are flown; arguments as `led_around` has them."""
        relief = self.relief
        if relief is None:
            return led_around(self.columns, from_m, to_m, straight, along)

        def over(which: IntArray, ways_m: FloatArray) -> tuple[FloatArray, FloatArray]:
            return along(which, relief.followed(ways_m, FEW_PIECES))

        level = followed_where_uneven(relief, from_m, to_m, straight, along)
        return led_around(self.columns, from_m, to_m, level, over)


@dataclass(frozen=True, slots=True, eq=False)
class Pricing:
    """From which the time and the energy of every move of a fleet are made."""

    tracks_m: FloatArray
    """(n, 2, 3) float64: the two ends of every segment's inspection leg."""
    bases: Mapping[str, Base]
    """By the vehicle's name."""
    models: Mapping[str, FlightModel]
    pads_m: tuple[tuple[float, float], ...] = ()
    """East and north of all pads, also of who does not fly any more: ways lead around the columns above them."""
    column_m: float = 0.0
    """Radius of these columns; 0 where every way is straight."""
    answer_s: float = 0.0
    """How long after a loss everybody flies on as planned, as `planner.Instance` has it."""
    kept_out: tuple[KeptOut, ...] = ()
    """Areas that ways lead around, however many segments there are."""
    relief: Relief | None = None
    """The lowest layer's heights, where a raster knows the ground; without it ways rise evenly."""
    barred: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """By the vehicle's name: segments that it cannot be given, for it lacks what they ask for."""
    besides_s: Mapping[int, float] = field(default_factory=dict)
    """Segments that take longer than their tracks, and by how much: pylons with viewpoints."""
    in_layer_s: Mapping[int, float] = field(default_factory=dict)
    """The same of viewpoints below the surface, for who looks at them from its layer."""
    deep_m: Mapping[int, float] = field(default_factory=dict)
    """How far below the surface the lowest of these viewpoints lies, by segment."""
    steps_m: Mapping[str, float] = field(default_factory=dict)
    """By the vehicle's name: how far it comes down from its layer to inspect as asked; without one it does not."""
    layered: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """By the vehicle's name: segments that it inspects in its layer, where others could meet it."""
    low_starts: frozenset[str] = frozenset()
    """Vehicles in the air whose start is below their layer."""
    closed: Mapping[str, tuple[Obstacle, ...]] = field(default_factory=dict)
    """By the vehicle's name: others' parts of the line, which its ways lead around."""

    def fliers(self, vehicles: Iterable[str], *, around: bool) -> list[Flier]:
        """Return how vehicles move.

        Args:
            vehicles: Their names.
            around: Whether their ways lead around others' pads.
        """
        longer = tuple(sorted(self.besides_s.items()))
        return [
            Flier(
                self.models[name],
                self._columns(name, around=around),
                self.relief,
                self.barred.get(name, frozenset()),
                longer,
                tuple(sorted(self.in_layer_s.items())),
                self.steps_m.get(name, 0.0),
                self.layered.get(name, frozenset()),
            )
            for name in vehicles
        ]

    def _columns(self, vehicle: str, *, around: bool) -> Columns:
        areas = tuple(obstacle_of(one.area) for one in self.kept_out if vehicle in one.vehicles)
        areas += self.closed.get(vehicle, ())
        if not (around and self.column_m):
            return Columns(areas=areas)
        own_m = self.bases[vehicle].place_m[:2]
        others = tuple(pad for pad in self.pads_m if math.dist(pad, own_m) > SAME_PLACE_M)
        return Columns(others, self.column_m, areas)

    def part(self, segments: Sequence[int], vehicles: Iterable[str]) -> Pricing:
        """Return that of some segments, numbered anew in the order given, and of some vehicles."""
        names = tuple(vehicles)
        numbers = {segment: number for number, segment in enumerate(segments)}
        return replace(
            self,
            tracks_m=self.tracks_m[list(segments)],
            besides_s=_of(numbers, self.besides_s),
            in_layer_s=_of(numbers, self.in_layer_s),
            deep_m=_of(numbers, self.deep_m),
            barred={
                name: frozenset(numbers[segment] for segment in self.barred[name] if segment in numbers)
                for name in names
                if name in self.barred
            },
            layered={
                name: frozenset(numbers[segment] for segment in self.layered[name] if segment in numbers)
                for name in names
                if name in self.layered
            },
            steps_m={name: self.steps_m[name] for name in names if name in self.steps_m},
            bases={name: self.bases[name] for name in names},
            models={name: self.models[name] for name in names},
        )


def _of(numbers: Mapping[int, int], figures: Mapping[int, float]) -> dict[int, float]:
    """Return the figures of some segments, by their new numbers."""
    return {numbers[segment]: figure for segment, figure in figures.items() if segment in numbers}


@dataclass(frozen=True, slots=True)
class FlownMoves:
    """Moves priced when they are asked for: memory grows with the segments, not with their square."""

    first_m: FloatArray
    """(2n, 3) float64: where each visit begins."""
    last_m: FloatArray
    """(2n, 3) float64: where it ends."""
    fliers: tuple[Flier, ...]
    """One for each profile."""
    besides: FloatArray | None = None
    """(2, profiles, 2n) float64: seconds and energy that visits take besides, by profile; None where none do."""

    @property
    def profiles(self) -> int:
        """Number of profiles."""
        return len(self.fliers)

    @property
    def visits(self) -> int:
        """Number of visits."""
        return len(self.first_m)

    def seconds(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the seconds of moves."""
        return self._between(profile, before, after)[0]

    def pct(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the energy of moves."""
        return self._between(profile, before, after)[1]

    def part(self, visits: Sequence[int]) -> MoveTables:
        """Return the moves between some of the visits, as tables."""
        which = list(visits)
        besides = None if self.besides is None else self.besides[..., which]
        return replace(self, first_m=self.first_m[which], last_m=self.last_m[which], besides=besides).tables()

    def tables(self) -> MoveTables:
        """Return all moves."""
        every = np.arange(self.visits)
        blocks = [self._between(profile, every[:, np.newaxis], every) for profile in range(self.profiles)]
        shape = (self.profiles, self.visits, self.visits)
        seconds, pct = (np.array([block[of] for block in blocks]).reshape(shape) for of in (0, 1))
        return MoveTables(seconds, pct)

    def _between(self, profile: int, before: Visits, after: Visits) -> tuple[FloatArray, FloatArray]:
        facing_m, flier = self.last_m[before] - self.first_m[before], self.fliers[profile]
        seconds, pct = flier.moves(
            self.last_m[before], facing_m, self.first_m[after], self.last_m[after],
            (flier.low(before), flier.low(after)),
        )  # fmt: skip
        if self.besides is None:
            return seconds, pct
        return seconds + self.besides[0, profile][after], pct + self.besides[1, profile][after]


def _nowhere_where(upright: BoolArray, along_m: FloatArray) -> FloatArray:
    """Return along what vehicles arrive: nobody who comes straight up or down arrives along anything."""
    return np.where(upright[..., np.newaxis], UNKNOWN, along_m) if upright.any() else along_m


def flown_instance(pricing: Pricing, vehicles: Sequence[Vehicle], *, tables_up_to: int = TABLES_UP_TO) -> Instance:
    """Return the planning problem of all segments of a pricing.

    A vehicle on the ground climbs from its pad; one in the air starts at its ``start_m`` and ``start_up_m``, turned
    along its ``facing_m``.

    Args:
        pricing: Of at least these vehicles.
        vehicles: The fleet.
        tables_up_to: Segments beyond which moves are priced when they are asked for.

    Raises:
        planner.InstanceError: there is no vehicle, or a start is not a number.
    """
    tracks_m = pricing.tracks_m.reshape(-1, 2, 3)
    first_m, last_m = tracks_m.reshape(-1, 3), np.array(tracks_m[:, ::-1].reshape(-1, 3))
    around = len(tracks_m) * len(vehicles) <= AROUND_UP_TO
    fliers = pricing.fliers((vehicle.name for vehicle in vehicles), around=around)
    profiles = tuple(dict.fromkeys(fliers))
    more = any(flier.barred or flier.besides_s for flier in fliers)
    besides = np.stack([flier.besides(len(first_m)) for flier in profiles], axis=1) if more else None
    flown = FlownMoves(first_m, last_m, profiles, besides)
    # Who comes down from a layer of its own has moves of its own.
    tables = len(profiles) if pricing.steps_m else 1
    moves: Moves = flown.tables() if profiles and tables * len(tracks_m) ** 2 <= tables_up_to**2 else flown
    start, again, home = (np.zeros((2, len(vehicles), len(first_m))) for _ in range(3))
    idle = np.zeros((2, len(vehicles)))
    for row, vehicle in enumerate(vehicles):
        flier, base = fliers[row], pricing.bases[vehicle.name]
        climb = np.array(flier.model.take_off(np.array(base.climb_m)))
        low = flier.low(np.arange(len(first_m)))
        out = flier.moves(np.array(base.place_m), UNKNOWN, first_m, last_m, (NEVER, low))
        again[:, row] = np.array(out) + climb[:, np.newaxis]
        home[:, row] = flier.ways_home(last_m, last_m - first_m, base, low)
        start[:, row] = again[:, row]
        if vehicle.airborne:
            here_m = np.array([*vehicle.start_m, vehicle.start_up_m])
            facing_m = np.array([*vehicle.facing_m, 0.0])
            here_low = np.array(vehicle.name in pricing.low_starts)
            start[:, row] = flier.moves(here_m, facing_m, first_m, last_m, (here_low, low))
            idle[:, row] = flier.ways_home(here_m, facing_m, base, here_low)
    if more:
        own = np.stack([flier.besides(len(first_m)) for flier in fliers], axis=1)
        start += own
        again += own
    consumption = np.array([vehicle.consumption for vehicle in vehicles], dtype=np.float64)[:, np.newaxis]
    return Instance(
        vehicles=tuple(vehicles),
        profile=tuple(profiles.index(flier) for flier in fliers),
        moves=moves,
        start_s=start[0], start_pct=start[1] * consumption,
        home_s=home[0], home_pct=home[1] * consumption,
        idle_s=idle[0], idle_pct=idle[1] * consumption[:, 0],
        depot_s=again[0], depot_pct=again[1],
        value=np.hypot(*(last_m - first_m)[::2, :2].T),
        end_m=last_m,
        landing_m=DEPOT_M,
        answer_s=pricing.answer_s,
    )  # fmt: skip
