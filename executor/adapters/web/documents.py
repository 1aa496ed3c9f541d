"""The documents that a browser gets beside `FleetView`.

./scripts/reference makes documents.d.ts of them, which the page's JavaScript is checked by.
"""

from __future__ import annotations

from typing import TypedDict

from missions import Window

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
    areas: list[PageArea]
    segments_m: list[tuple[Place, Place]]
    vehicles: list[PageVehicle]


class PageAssets(TypedDict):
    """`/assets`: all but open ones without a picture."""

    assets: int
    rows: list[AssetRow]
