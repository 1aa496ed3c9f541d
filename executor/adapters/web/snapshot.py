"""Data for browsers: the flight's current state, and the map, which seldom changes.

The flight's states are immutable values, so this thread reads them while the flight goes on. ./scripts/reference writes
documents.d.ts from these documents, against which the page's JavaScript is checked.
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
"""Segment, state, number of pictures and vehicle."""


class BesideFleet(TypedDict):
    """Additions to the fleet's view in each state of the page."""

    speedup: float
    """Speed-up: flight seconds per real second."""
    decided_age_s: float | None
    """Seconds since the flight's last decision."""
    chart: list[int]
    """Stamp of the routes; if it changes, there is a new `PageChart`."""
    inferred: list[int]
    """Segments that count as inspected by evidence alone."""
    assets: int
    """Stamp of the assets; changes whenever `PageAssets` may have."""


class BesideVehicle(TypedDict):
    """Additions to each vehicle's view on the page."""

    place_m: Place | None
    waypoint: int
    """Waypoint of its route that it flies to."""


class PageRoute(TypedDict):
    """A route on board."""

    revision: int
    places_m: list[Place]
    inspect: list[bool]
    """Whether the leg to each waypoint is an inspection."""
    segments: list[int]


class PageVehicle(TypedDict):
    """A vehicle on the map."""

    name: str
    pad_m: Place
    route: PageRoute | None
    track_m: list[Place]
    """Track flown so far."""


class PageArea(TypedDict):
    """An area to avoid."""

    name: str
    limit: bool
    """Whether it is a height limit."""
    outlines_m: list[list[Place]]


class PageChart(TypedDict):
    """`/chart`: data that seldom changes."""

    chart: list[int]
    window: Window | None
    """Re-plan window of the first plan."""
    pictures: bool
    """Whether segments are inspected by pictures."""
    assets: list[tuple[int, int]]
    """Segments, and the number of pictures that each needs."""
    names: list[str]
    """Name of each segment."""
    left_out: list[int]
    """Segments that are not part of this flight."""
    unreachable: list[int]
    """Segments in an area, or behind one."""
    areas: list[PageArea]
    segments_m: list[tuple[Place, Place]]
    vehicles: list[PageVehicle]


class PageAssets(TypedDict):
    """`/assets`: all assets except open ones without a picture."""

    assets: int
    rows: list[AssetRow]


Describe = Callable[[Context, FleetState, float], FleetView]
Now = Callable[[], tuple[FleetState, float]]
"""Return the newest state, and the flight time; called from another thread."""

STEP_M = 3.0
"""Distance between two points of a track."""
MOST_POINTS = 1500
"""Most points of a track; beyond, every second one is dropped."""


@dataclass(slots=True)
class _Track:
    """A vehicle's track, thinned."""

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
    """Encode the flight for all browsers; used by one thread."""

    _context: Context
    """Context of the flight."""
    _now: Now
    """Returns its newest state."""
    _speedup: float = 1.0
    """Speed-up: flight seconds per real second."""
    describe: Describe = build_fleet_view
    """Builds the description that is sent; tests replace it to show rare states."""
    _window: Window | None = None
    """Re-plan window of the first plan."""
    _tracks: dict[str, _Track] = field(init=False)
    _asked: Mapping[int, Mapping[str, int]] = field(init=False)
    _covered: tuple[Coverage, int] | None = None
    _assets_changed: int = 0

    def __post_init__(self) -> None:
        """Start reading a flight."""
        self._tracks = {name: _Track() for name in self._context.vehicles}
        self._asked = list_asked_pictures(self._context)

    def encode_clock(self) -> bytes:
        """Return the flight time alone, as JSON; a browser compares it with its displayed state."""
        _, now_s = self._now()
        return json.dumps({"now_s": round(now_s, 2)}).encode()

    def encode_state(self) -> bytes:
        """Return the current state as JSON, and extend the tracks."""
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
        """Return the network, the pads, the routes on board and the tracks flown so far, as JSON."""
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
        """Return the state of each asset as JSON: rows of segment, state, pictures and vehicle.

        A network has thousands: open assets without a picture are left out, and browsers request this when they display
        assets and the stamp in the state has changed.
        """
        state, _ = self._now()
        rows = [
            (one.segment, one.state.value, one.pictures, one.vehicle)
            for one in build_asset_views(self._context, state, self._asked)
            if one.state is not AssetState.OPEN or one.pictures
        ]
        return _encode_json(PageAssets(assets=self._update_assets_stamp(state), rows=rows))

    def _update_assets_stamp(self, state: FleetState) -> int:
        """Return a number that changes whenever the content of `assets` may have."""
        if (
            self._covered is None
            or self._covered[0] is not state.coverage
            or self._covered[1] != state.replanning.revision
        ):
            self._covered = (state.coverage, state.replanning.revision)
            self._assets_changed += 1
        return self._assets_changed


def _encode_json(content: Mapping[str, object]) -> bytes:
    """Return JSON; non-finite numbers become null, so that a browser can still read the rest."""
    plain = {key: asdict(value) if isinstance(value, Window) else value for key, value in content.items()}
    return json_text(plain, (",", ":")).encode()


def _compute_route_stamp(state: FleetState) -> list[int]:
    """Return a stamp that changes whenever a route does."""
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
    """Return areas as browsers' maps show them."""
    return [
        PageArea(
            name=area.name,
            limit=area.kind is AreaKind.HEIGHT_LIMIT,
            outlines_m=[[round_place(place) for place in ring] for ring in area.polygons_m()],
        )
        for area in areas
    ]


def round_place(place: Sequence[float]) -> Place:
    """Return a position rounded to a decimetre."""
    return round(place[0], 1), round(place[1], 1)
