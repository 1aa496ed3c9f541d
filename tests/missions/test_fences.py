"""The fence of a vehicle covers its ways and its ways home, only ever grows, and goes on board as it is."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import LocalFrame, MissionItem
from missions.fences import (
    MOST_CORNERS,
    Corner,
    Fence,
    build_fence,
    build_fence_hull,
    build_fence_items,
    build_rally_items,
    find_first_outside,
    find_list_differences,
    number_items,
    parse_outlines,
    simplify_polygon,
)
from missions.items import Frame, PlaceCommand

FRAME = LocalFrame(49.6, 15.6, 460.0)
PLACES = st.tuples(st.floats(-900.0, 900.0), st.floats(-900.0, 900.0))
ROUTES = st.lists(PLACES, min_size=1, max_size=40)
SQUARE = ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))


def ring(middle: Corner, radius_m: float, count: int) -> list[Corner]:
    turns = [2.0 * math.pi * number / count for number in range(count)]
    return [(middle[0] + radius_m * math.cos(turn), middle[1] + radius_m * math.sin(turn)) for turn in turns]


@settings(max_examples=200, deadline=None)
@given(places=ROUTES, margin_m=st.floats(5.0, 60.0))
def test_the_margin_holds_about_every_way_and_every_return(places: list[Corner], margin_m: float) -> None:
    fence, pad = build_fence(places, margin_m, 60.0), places[0]
    assert 3 <= len(fence.corners_m) <= MOST_CORNERS
    for place in places:
        for share in (0.0, 0.25, 0.5, 1.0):
            on_its_way_home = (pad[0] + share * (place[0] - pad[0]), pad[1] + share * (place[1] - pad[1]))
            assert all(fence.distance_outside_m(point) < 0.01 for point in ring(on_its_way_home, margin_m, 16))


@settings(max_examples=100, deadline=None)
@given(old=ROUTES, new=ROUTES)
def test_a_fence_with_another_one_covers_both(old: list[Corner], new: list[Corner]) -> None:
    one, other = build_fence(old, 20.0, 60.0), build_fence(new, 20.0, 70.0)
    both = one.merge_with(other)
    assert both.is_covering(one)
    assert both.is_covering(other)
    assert both.top_m == 70.0
    assert len(both.corners_m) <= MOST_CORNERS


def test_fewer_corners_lie_outside_and_not_far() -> None:
    many = build_fence_hull(ring((0.0, 0.0), 100.0, 90))
    few = simplify_polygon(many, 12)
    assert len(few) == 12
    fence = Fence(few, 60.0)
    assert all(fence.distance_outside_m(corner) < 0.01 for corner in many)
    assert max(math.hypot(*corner) for corner in few) < 110.0


def test_how_far_outside_a_place_is() -> None:
    fence = Fence(SQUARE, 60.0)
    assert fence.distance_outside_m((0.0, 0.0)) == 0.0
    assert fence.distance_outside_m((80.0, 0.0)) == pytest.approx(30.0)
    assert fence.distance_outside_m((53.0, 54.0)) == pytest.approx(5.0)


def test_a_fence_that_is_lower_does_not_cover() -> None:
    fence = Fence(SQUARE, 60.0)
    assert fence.is_covering(fence)
    assert not fence.is_covering(replace(fence, top_m=61.0))


def test_a_fence_goes_on_board_corner_by_corner() -> None:
    items = build_fence_items(Fence(SQUARE, 60.0), FRAME)
    assert [(item.seq, item.command, item.param1) for item in items] == [
        (seq, PlaceCommand.INCLUSION_VERTEX, 4.0) for seq in range(4)
    ]


def test_what_is_read_back_as_each_autopilot_writes_it_is_the_same() -> None:
    items = build_fence_items(Fence(SQUARE, 60.0), FRAME)
    px4 = tuple(replace(item, frame=Frame.GLOBAL_INT, current=item.seq == 0, autocontinue=False) for item in items)
    assert find_list_differences(items, px4) == ()
    [rally] = build_rally_items([(3.0, 4.0)], FRAME)
    assert find_list_differences((rally,), (replace(rally, z=0.4),)) == ()


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"param1": 3.0}, "param1 sent 4, read back 3"),
        ({"command": PlaceCommand.EXCLUSION_VERTEX}, "command sent 5001, read back 5002"),
        ({"x": 0}, "x sent"),
        ({"y": 0}, "y sent"),
    ],
)
def test_what_means_something_else_is_named(changed: dict[str, float], words: str) -> None:
    items = build_fence_items(Fence(SQUARE, 60.0), FRAME)
    other = (replace(items[0], **changed), *items[1:])  # type: ignore[arg-type]
    [found] = find_list_differences(items, other)
    assert found.startswith(f"item 0: {words}")
    assert find_list_differences(items, items[1:]) == ("4 items sent, 3 read back",)


def placed(command: PlaceCommand, param1: float, east_m: float, north_m: float) -> MissionItem:
    lat_deg, lon_deg = FRAME.to_wgs84_deg(east_m, north_m)
    return MissionItem(0, Frame.GLOBAL, command, param1, x=round(lat_deg * 1e7), y=round(lon_deg * 1e7))


def test_where_a_way_leaves_what_others_put_on_board() -> None:
    polygon = [placed(PlaceCommand.INCLUSION_VERTEX, 4.0, *corner) for corner in SQUARE]
    circle = [placed(PlaceCommand.INCLUSION_CIRCLE, 30.0, 0.0, 0.0)]
    hole = [placed(PlaceCommand.EXCLUSION_CIRCLE, 5.0, 20.0, 0.0)]
    east = [(0.0, 0.0), (100.0, 0.0)]

    def leaves_at(items: list[MissionItem]) -> float | None:
        place = find_first_outside(parse_outlines(items, FRAME), east)
        return None if place is None else place[0]

    assert leaves_at([]) is None
    assert leaves_at(polygon) == pytest.approx(50.0, abs=2.1)
    assert leaves_at([*polygon, *circle]) == pytest.approx(30.0, abs=2.1)
    assert leaves_at([*polygon, *circle, *hole]) == pytest.approx(15.0, abs=2.1)
    assert leaves_at([placed(PlaceCommand.FENCE_RETURN_POINT, 0.0, 0.0, 0.0)]) is None


def test_what_was_read_is_sent_back_in_order() -> None:
    read = (MissionItem(4, 0, PlaceCommand.RALLY_POINT, current=True), MissionItem(9, 0, PlaceCommand.RALLY_POINT))
    assert [(item.seq, item.current) for item in number_items(read)] == [(0, False), (1, False)]
