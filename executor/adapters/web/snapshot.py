"""What a browser is told: the flight's present, and the map that changes seldom.

The flight's states are immutable values, so they are read here, beside the flight, while it goes on. Of the documents
./scripts/reference makes documents.d.ts, which the page's JavaScript is checked by.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TypedDict

from executor.core.context import Context
from executor.core.fleet_view import FleetView, build_fleet_view
from executor.core.imaging.asset_status import AssetState, build_asset_views, list_asked_pictures
from executor.core.state.bases import place_vehicles
from executor.core.state.fleet_state import Coverage, FleetState
from missions import Phase, Window
from missions.files import json_text
from missions.no_fly_areas import Area, AreaKind

Place = tuple[float, float]
"""East and north of the depot, in metres."""
AssetRow = tuple[int, str, int, str | None]
"""Segment, state, pictures and vehicle."""


class BesideFleet(TypedDict):
    """What the page gets in each state beside a fleet's view."""

    speedup: float
    """Seconds of the flight in a real one."""
    decided_age_s: float | None
    """How long ago the flight decided last."""
    chart: list[int]
    """Changes whenever a route does: then there is a new `PageChart`."""
    inferred: list[int]
    """Segments that count as inspected by evidence alone."""
    assets: int
    """Changes whenever `PageAssets` may have."""


class BesideVehicle(TypedDict):
    """What the page gets of each vehicle beside its view."""

    place_m: Place | None
    waypoint: int
    """Of its route: the one that it flies to."""


class PageRoute(TypedDict):
    """A route on board."""

    revision: int
    places_m: list[Place]
    inspect: list[bool]
    """Of each waypoint: whether the way to it is an inspection."""
    segments: list[int]


class PageVehicle(TypedDict):
    """A vehicle on the map."""

    name: str
    pad_m: Place
    route: PageRoute | None
    track_m: list[Place]
    """Where it has flown so far."""


class PageArea(TypedDict):
    """What flights keep out of."""

    name: str
    limit: bool
    """Whether it is a height limit."""
    outlines_m: list[list[Place]]


class PageChart(TypedDict):
    """`/chart`: what changes seldom."""

    chart: list[int]
    window: Window | None
    """The re-plan window of the first plan."""
    pictures: bool
    """Whether segments are inspected by pictures."""
    assets: list[tuple[int, int]]
    """Segments, and how many pictures each asks for."""
    names: list[str]
    """Of each segment."""
    left_out: list[int]
    """Segments that are none of this flight."""
    unreachable: list[int]
    """Segments in an area, or behind one."""
    areas: list[PageArea]
    segments_m: list[tuple[Place, Place]]
    vehicles: list[PageVehicle]


class PageAssets(TypedDict):
    """`/assets`: all but open ones without a picture."""

    assets: int
    rows: list[AssetRow]


Describe = Callable[[Context, FleetState, float], FleetView]
Now = Callable[[], tuple[FleetState, float]]
"""The newest state, and the time on the flight's clock; asked from another thread."""

STEP_M = 3.0
"""A track's next point is this far from the last one."""
MOST_POINTS = 1500
"""Of one track; when there are more, every second one is dropped."""


@dataclass(slots=True)
class _Track:
    """Where a vehicle was, thinned."""

    step_m: float = STEP_M
    places: list[Place] = field(default_factory=list)

    def add(self, place: Place) -> None:
        if self.places and math.dist(self.places[-1], place) < self.step_m:
            return
        self.places.append(round_place(place))
        if len(self.places) > MOST_POINTS:
            self.places = self.places[::2]
            self.step_m *= 2


@dataclass(eq=False, repr=False)
class WebSnapshot:
    """Reads the flight for everybody who looks; used by one thread."""

    _context: Context
    """The flight's."""
    _now: Now
    """Returns its newest state."""
    _speedup: float = 1.0
    """Seconds of the flight in a real one."""
    describe: Describe = build_fleet_view
    """Makes the description that is sent; tests show what a flight seldom comes to."""
    _window: Window | None = None
    """The re-plan window of the first plan."""
    _tracks: dict[str, _Track] = field(init=False)
    _asked: Mapping[int, Mapping[str, int]] = field(init=False)
    _covered: tuple[Coverage, int] | None = None
    _assets_changed: int = 0

    def __post_init__(self) -> None:
        """Look at a flight."""
        self._tracks = {name: _Track() for name in self._context.vehicles}
        self._asked = list_asked_pictures(self._context)

    def encode_clock(self) -> bytes:
        """Return the time on the flight's clock alone, as JSON: a browser holds it against what it shows."""
        _, now_s = self._now()
        return json.dumps({"now_s": round(now_s, 2)}).encode()

    def encode_state(self) -> bytes:
        """Return the present as JSON, and remember where everybody is."""
        state, now_s = self._now()
        content = asdict(self.describe(self._context, state, now_s))
        for shown in content["vehicles"]:
            vehicle = state.vehicles[shown["name"]]
            place = None if vehicle.motion.fix is None else round_place(vehicle.motion.fix.place_m)
            shown |= BesideVehicle(place_m=place, waypoint=vehicle.assignment.waypoint)
            if place is not None and vehicle.armed:
                self._tracks[vehicle.name].add(place)
        tick_s = state.listening.tick_s
        content |= BesideFleet(
            speedup=self._speedup,
            decided_age_s=None if tick_s is None else round(max(0.0, now_s - tick_s), 2),
            chart=_compute_route_stamp(state),
            inferred=sorted(state.coverage.list_inferred_segments()),
            assets=self._update_assets_stamp(state),
        )
        return _encode_json(content)

    def encode_map(self) -> bytes:
        """Return the network, the pads, the routes on board and the ways flown so far, as JSON."""
        state, _ = self._now()
        setup = place_vehicles(self._context, state.vehicles.values()).setup
        pads = {name: setup.landing_pad_of(name) for name in self._context.vehicles}
        never = {one.segment for one in self._context.unreachable}
        return _encode_json(
            PageChart(
                chart=_compute_route_stamp(state),
                window=self._window,
                pictures=bool(setup.looks),
                assets=[(segment, sum(most.values())) for segment, most in self._asked.items()],
                names=[self._context.segment_name(segment.id) for segment in setup.network.segments],
                left_out=[one.id for one in setup.network.segments if one.id not in self._context.wanted | never],
                unreachable=sorted(never),
                areas=list_page_areas(setup.areas),
                segments_m=[(round_place(a), round_place(b)) for a, b in setup.network.ends_m.tolist()],
                vehicles=[
                    PageVehicle(
                        name=name,
                        pad_m=round_place((pads[name].east_m, pads[name].north_m)),
                        route=_build_route(state, name),
                        track_m=self._tracks[name].places,
                    )
                    for name in self._context.vehicles
                ],
            )
        )

    def encode_assets(self) -> bytes:
        """Return what became of each asset, as JSON: rows of segment, state, pictures and vehicle.

        A network has thousands: an asset that is open and has no picture is left out, and browsers ask for this when
        they show it and its stamp in the state is another one.
        """
        state, _ = self._now()
        rows = [
            (one.segment, one.state.value, one.pictures, one.vehicle)
            for one in build_asset_views(self._context, state, self._asked)
            if one.state is not AssetState.OPEN or one.pictures
        ]
        return _encode_json(PageAssets(assets=self._update_assets_stamp(state), rows=rows))

    def _update_assets_stamp(self, state: FleetState) -> int:
        """Return a number that changes whenever anything that `assets` says may have."""
        if (
            self._covered is None
            or self._covered[0] is not state.coverage
            or self._covered[1] != state.replanning.revision
        ):
            self._covered = (state.coverage, state.replanning.revision)
            self._assets_changed += 1
        return self._assets_changed


def _encode_json(content: Mapping[str, object]) -> bytes:
    """Return JSON; a number that is none is unknown to a browser, and must not keep it from all that is known."""
    plain = {key: asdict(value) if isinstance(value, Window) else value for key, value in content.items()}
    return json_text(plain, (",", ":")).encode()


def _compute_route_stamp(state: FleetState) -> list[int]:
    """Return what changes whenever a route does."""
    return [-1 if one.assignment.board is None else one.assignment.board.revision for one in state.vehicles.values()]


def _build_route(state: FleetState, name: str) -> PageRoute | None:
    board = state.vehicles[name].assignment.board
    if board is None:
        return None
    return PageRoute(
        revision=board.revision,
        places_m=[round_place(place) for place in board.places_m],
        inspect=[waypoint.phase is Phase.INSPECT for waypoint in board.path.waypoints],
        segments=[track.segment for track in board.tracks],
    )


def list_page_areas(areas: Iterable[Area]) -> list[PageArea]:
    """Return areas as maps in browsers show them."""
    return [
        PageArea(
            name=area.name,
            limit=area.kind is AreaKind.HEIGHT_LIMIT,
            outlines_m=[[round_place(place) for place in ring] for ring in area.polygons_m()],
        )
        for area in areas
    ]


def round_place(place: Sequence[float]) -> Place:
    """Return a place to a decimetre."""
    return round(place[0], 1), round(place[1], 1)
