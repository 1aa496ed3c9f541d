"""What became of each asset, and how many of its pictures there are."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core.context import Context
from executor.core.imaging.asset_status import AssetState, AssetView, build_asset_views, list_asked_pictures
from executor.core.payload.camera_state import AwaitedPictures
from executor.core.state.fleet_state import FleetState
from missions.cameras import Camera, CameraTasks, SpanCameraTask, Trigger
from tests.executor.core.imaging.test_asset_status_reinspected import EVERYBODY, SITE, sighted
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import CONTEXT, FLEET, NOW_S, flying

CAUGHT = MappingProxyType({
    0: tuple(("rgb", 10.0 * number) for number in range(11)),
    1: (("rgb", 5.0), ("rgb", 5.0), ("ir", 7.0)),
    2: (("rgb", 0.0), ("rgb", 0.0)),
})  # fmt: skip
FLOWN = flight_of(
    flying(),
    inspected=MappingProxyType({0: "uav1", 2: "uav2"}),
    inferred=frozenset({2}),
    caught=CAUGHT,
    unseen=MappingProxyType({1: AwaitedPictures("uav3", NOW_S)}),
    not_seen=MappingProxyType({3: "uav2", 0: "uav2"}),
    given_up=frozenset({3}),
    left_over=frozenset({4}),
)


def views(context: Context, state: FleetState) -> tuple[AssetView, ...]:
    return build_asset_views(context, state, list_asked_pictures(context))


def test_each_asset_has_its_state_pictures_and_vehicle() -> None:
    assert views(SITE, FLOWN) == (
        AssetView(0, AssetState.SEEN, 10, 10, "uav1"),
        AssetView(1, AssetState.MISSED, 1, 10, "uav3"),
        AssetView(2, AssetState.INFERRED, 1, 2, "uav2"),
        AssetView(3, AssetState.GIVEN_UP, 0, 10, "uav2"),
        AssetView(4, AssetState.LEFT_OVER, 0, 10, None),
    )
    assert views(SITE, flight_of(flying()))[4] == AssetView(4, AssetState.OPEN, 0, 10, None)


def test_only_what_asks_for_pictures_is_an_asset_where_any_does() -> None:
    assert list_asked_pictures(SITE) == {0: {"rgb": 10}, 1: {"rgb": 10}, 2: {"rgb": 2}, 3: {"rgb": 10}, 4: {"rgb": 10}}
    assert list_asked_pictures(sighted(wanted=frozenset({2, 5}))) == {2: {"rgb": 2}}
    assert list_asked_pictures(CONTEXT) == {segment: {} for segment in range(6)}
    states = [one.state for one in views(CONTEXT, flight_of(flying(), inspected=MappingProxyType({3: "uav1"})))]
    assert states == [*[AssetState.OPEN] * 3, AssetState.SEEN, *[AssetState.OPEN] * 2]


@pytest.mark.parametrize(
    ("looks", "asked", "there"),
    [
        ((SpanCameraTask("rgb", Trigger.VIDEO),), 0, 0),
        ((SpanCameraTask("rgb", Trigger.INTERVAL, 25.0), SpanCameraTask("ir", Trigger.DISTANCE, 50.0)), 6, 2),
        ((SpanCameraTask("rgb", Trigger.DISTANCE, 1.0), SpanCameraTask("ir", Trigger.VIDEO)), 100, 1),
        ((SpanCameraTask("rgb", Trigger.DISTANCE, 400.0),), 1, 1),
    ],
)
def test_films_are_no_pictures_and_each_camera_counts_for_itself(
    looks: tuple[SpanCameraTask, ...], asked: int, there: int
) -> None:
    cameras = {name: Camera(name, 100) for name in ("rgb", "ir")}
    setup = replace(CONTEXT.setup, looks=CameraTasks(cameras, dict.fromkeys(FLEET.boards, EVERYBODY), {1: looks}))
    [one] = views(replace(CONTEXT, setup=setup), FLOWN)
    assert (one.segment, one.asked, one.pictures) == (1, asked, there)
