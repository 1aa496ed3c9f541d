"""The map's tools by mouse, fingers and keys, in a real browser."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.async_api import expect

from executor.site.ground_view import encode_ground
from missions import LocalFrame
from tests.e2e.browser import IN_CHROMIUM
from tests.e2e.mapped import FRAME, PLACES_M, STATIC, Mapped, Place, is_near, mapped
from tests.executor.grounds import Hills, ground_about

pytestmark = IN_CHROMIUM

SHARP = """async () => {
  while (map.still.scale !== map.view.scale) await new Promise((go) => requestAnimationFrame(go));
}"""
"""Waits until what was zoomed as a picture is drawn anew."""
RING = [(100.0, -150.0), (300.0, -150.0), (300.0, -250.0), (100.0, -250.0)]


def _metres(places: list[Place]) -> list[Place]:
    return [FRAME.to_local_m(lat_deg, lon_deg) for lat_deg, lon_deg in places]


async def _found(shown: Mapped) -> list[Place]:
    """Return the places of the only thing that a tool has found, in metres."""
    [places] = await shown.run("found")
    return _metres(places)


async def _show_area(shown: Mapped) -> None:
    area = {"index": 3, "name": "school", "isLimit": False, "rings": [[shown.place(place) for place in RING]]}
    await shown.run("area => map.setAreas([area])", area)


async def test_what_is_clicked_on_is_chosen() -> None:
    async with mapped() as shown:
        await shown.show()
        await _show_area(shown)
        pad = {"kind": "pad", "name": "uav1", "place": shown.place((0.0, -280.0))}
        flying = {"name": "uav1", "place": shown.place((300.0, 50.0)), "heading_deg": 60, "colour": "#0072b2"}
        await shown.run("places => map.setPlaces(places)", [pad])
        await shown.run("vehicles => map.setVehicles(vehicles)", [flying | {"state": "flying"}])
        await shown.run("map.fit()")
        clicked = [(100.0, 0.0), (300.0, 50.0), (0.0, -280.0), (250.0, -200.0), (550.0, -100.0)]
        for place_m in clicked:
            await shown.click(place_m, beside=(0.0, 3.0))
        assert await shown.run("said") == [
            {"kind": "segment", "id": 10}, {"kind": "vehicle", "id": "uav1"}, {"kind": "place", "id": "pad uav1"},
            {"kind": "area", "id": 3}, None,
        ]  # fmt: skip
        await shown.click((100.0, 0.0))
        await expect(shown.page.locator("#alone")).to_have_attribute("title", "P1")


@pytest.mark.parametrize("tool", ["select-box", "select-lasso"])
async def test_spans_are_chosen_by_a_box_and_by_a_lasso(tool: str) -> None:
    """A span is in it if its middle is; a drag chooses and does not move the map."""
    async with mapped() as shown:
        await shown.show()
        before = await shown.at((0.0, 0.0))
        await shown.run("tool => use(tool)", tool)
        corners = [(50.0, 120.0), (430.0, 120.0), (430.0, -40.0), (50.0, -40.0)]
        await (shown.drag(corners[0], corners[2]) if tool == "select-box" else shown.drag(*corners))
        assert await shown.run("found") == [[10, 11]]
        assert await shown.at((0.0, 0.0)) == before
        assert await shown.run("said") == []


async def test_a_box_is_drawn_by_keys() -> None:
    async with mapped() as shown:
        await shown.show()
        await shown.run("use('select-box')")
        await shown.look_at((150.0, 130.0))
        await shown.press(" ")
        await shown.look_at((650.0, 20.0))
        await shown.press(" ")
        assert await shown.run("found") == [[11, 12]]


async def test_an_area_is_drawn_and_its_corners_snap_to_pylons() -> None:
    async with mapped() as shown:
        await shown.show()
        await shown.run("use('polygon')")
        await shown.click(PLACES_M[1], beside=(7.0, -5.0))
        await shown.click((300.0, 150.0))
        await shown.click((310.0, 250.0))
        await shown.press("Backspace")
        await shown.click((200.0, 150.0))
        await shown.click(PLACES_M[1], beside=(2.0, 2.0))  # the first corner closes it
        ring = await _found(shown)
        assert len(ring) == 3
        assert is_near(ring[0], PLACES_M[1])
        assert is_near(ring[1], (300.0, 150.0), 2.0)
        assert is_near(ring[2], (200.0, 150.0), 2.0)


async def test_a_place_is_put_where_it_is_clicked_and_alt_keeps_a_corner_from_snapping() -> None:
    async with mapped() as shown:
        await shown.show()
        await shown.run("use('place')")
        await shown.click(PLACES_M[1], beside=(6.0, 0.0))
        place = _metres(await shown.run("found"))
        assert not is_near(place[0], PLACES_M[1], 1.0)
        await shown.run("use('line')")
        await shown.page.keyboard.down("Alt")
        await shown.click(PLACES_M[1], beside=(6.0, 0.0))
        await shown.page.keyboard.up("Alt")
        await shown.click(PLACES_M[2], beside=(6.0, 0.0))
        await shown.run("map.finishTool()")
        line = await _found(shown)
        assert not is_near(line[0], PLACES_M[1], 1.0)
        assert is_near(line[1], PLACES_M[2])


async def test_an_area_is_drawn_by_keys() -> None:
    async with mapped() as shown:
        await shown.show()
        await shown.run("use('polygon')")
        for place_m in ((250.0, -100.0), (400.0, -100.0), (400.0, -200.0)):
            await shown.look_at(place_m)
            await shown.press("Enter")
        await shown.press("Enter")
        ring = await _found(shown)
        assert len(ring) == 3
        assert is_near(ring[2], (400.0, -200.0), 8.0)


async def test_corners_of_an_area_are_moved_added_and_taken_away() -> None:
    async with mapped() as shown:
        await shown.show()
        await _show_area(shown)
        given = [shown.place(place) for place in RING]
        await shown.run("ring => use('edit-area', ring)", [*given, given[0]])
        await shown.drag(RING[0], PLACES_M[0])  # onto a pylon
        await shown.drag((300.0, -200.0), (380.0, -200.0))
        await shown.click((550.0, -50.0))
        ring = await _found(shown)
        assert len(ring) == 5
        assert is_near(ring[0], PLACES_M[0])
        assert is_near(ring[2], (380.0, -200.0), 4.0)
        assert is_near(ring[4], RING[3])
        await shown.run("ring => use('edit-area', ring)", given)
        await shown.click(RING[1])
        await shown.press("Delete")
        await shown.run("map.finishTool()")
        assert all(map(is_near, await _found(shown), [RING[0], *RING[2:]]))


async def test_a_corner_is_moved_by_keys() -> None:
    async with mapped() as shown:
        await shown.show()
        await shown.run("ring => use('edit-area', ring)", [shown.place(place) for place in RING])
        await shown.look_at(RING[2])
        await shown.press(" ")
        await shown.look_at((420.0, -260.0))
        await shown.press(" ", "Enter")
        ring = await _found(shown)
        assert is_near(ring[2], (420.0, -260.0), 8.0)
        assert all(map(is_near, (ring[0], ring[1], ring[3]), (RING[0], RING[1], RING[3])))


async def test_fingers_draw_move_and_zoom() -> None:
    async with mapped(touch=True) as shown:
        await shown.show()
        await shown.run("use('polygon')")
        for place_m in ((250.0, -50.0), (400.0, -50.0), (400.0, -150.0), (250.0, -50.0)):
            await shown.page.touchscreen.tap(*await shown.at(place_m))
        assert len(await _found(shown)) == 3
        await shown.run("map.stopTool()")
        session = await shown.page.context.new_cdp_session(shown.page)
        before = await shown.run("map.view.scale")
        for kind, apart in (("touchStart", 60.0), ("touchMove", 90.0), ("touchMove", 120.0), ("touchEnd", None)):
            points = (
                [] if apart is None else [{"x": 400 - apart, "y": 350, "id": 1}, {"x": 400 + apart, "y": 350, "id": 2}]
            )
            await session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        assert await shown.run("map.view.scale") / before == pytest.approx(2.0, rel=0.05)
        assert await shown.run("said") == []


async def test_the_crosshair_says_what_is_under_it_and_tab_leaves_the_map() -> None:
    async with mapped() as shown:
        await shown.show()
        plain = await shown.picture()
        await shown.look_at((100.0, 0.0))
        await expect(shown.page.locator("#alone output")).to_have_text("P1")
        assert await shown.picture() != plain
        await shown.press("Enter", "Escape")
        assert await shown.run("said") == [{"kind": "segment", "id": 10}, "cancel"]
        await shown.page.keyboard.press("Tab")
        await expect(shown.page.locator("#after")).to_be_focused()


async def test_what_is_moved_as_a_picture_is_what_would_be_drawn_there() -> None:
    async with mapped() as shown:
        await shown.show(P1="done", P2="left-over", P3="left-out")
        await _show_area(shown)
        pictures = []
        for moved in ((120, -60), (100, 90), (900, 20)):
            await shown.run("([right, down]) => map.move(right, down)", moved)
            pictures.append(await shown.picture())
            await shown.run("map.renew()")
            assert await shown.picture() == pictures[-1]
        assert len(set(pictures)) == 3
        await shown.run("map.fit()")
        await shown.run("map.zoom(1.3)")
        await shown.run(SHARP)
        sharp = await shown.picture()
        await shown.run("map.renew()")
        assert await shown.picture() == sharp


async def test_degrees_are_where_the_program_has_them() -> None:
    """Twenty kilometres from the depot within 0.1 m, and back to the place that was given."""
    far = [(20_000.0, -15_000.0), (-9000.0, 18_000.0), (150.0, 80.0)]
    async with mapped(frame=LocalFrame(-33.9, 151.2)) as shown:
        await shown.show()
        for place_m in far:
            [metres, degrees] = await shown.run(
                "place => [map.metres(place), map.projection.toDegrees(map.metres(place))]", shown.place(place_m)
            )
            assert is_near(metres, place_m, 0.1)
            assert degrees == pytest.approx(shown.place(place_m), abs=1e-12)


async def test_what_was_given_before_its_frame_is_where_it_belongs_after_it() -> None:
    async with mapped() as shown:
        await _show_area(shown)
        await shown.show()
        await shown.run("map.zoom(1.2)")
        seen = await shown.run("map.projection.toDegrees(map.view.middle)")
        await shown.run("frame => map.setFrame(frame)", {"lat_deg": FRAME.lat_deg + 0.1, "lon_deg": FRAME.lon_deg})
        assert await shown.run("map.projection.toDegrees(map.view.middle)") == pytest.approx(seen, abs=1e-9)
        for place_m in ((100.0, 0.0), (200.0, -160.0)):
            await shown.click(place_m)
        assert await shown.run("said") == [{"kind": "segment", "id": 10}, {"kind": "area", "id": 3}]


async def test_a_map_that_was_hidden_or_tiny_is_right_when_it_is_seen() -> None:
    async with mapped() as shown:
        await shown.run("() => { document.getElementById('alone').hidden = true; }")
        await shown.show()
        await shown.run("() => { document.getElementById('alone').hidden = false; }")
        await expect(shown.page.locator("#alone")).to_be_visible()
        await shown.picture()
        await shown.click((100.0, 0.0))
        assert await shown.run("said") == [{"kind": "segment", "id": 10}]
        await shown.run("() => { document.getElementById('alone').style.height = '60px'; }")
        await shown.picture()
        await shown.run("map.showSegment(12)")
        assert await shown.run("map.view.scale") > 0.0
        await expect(shown.page.locator("#alone")).to_have_attribute("title", "P3")


async def test_metres_are_taken_as_they_are_and_the_dark_map_is_dark() -> None:
    pictures = []
    for dark in (False, True):
        async with mapped(frame=None, dark=dark) as shown:
            await shown.show(P1="missed", P2="inferred", P3="unreachable")
            await shown.click((100.0, 0.0))
            assert await shown.run("said") == [{"kind": "segment", "id": 10}]
            pictures.append(await shown.picture())
    assert len(set(pictures)) == 2


async def test_a_background_is_shown_where_it_lies_and_gone_when_its_site_has_none_any_more() -> None:
    ground = dict(encode_ground(ground_about(np.array(PLACES_M), hills=Hills(cell_m=5.0)), FRAME))
    async with mapped(ground=ground) as shown:
        await shown.show()
        await shown.run("map.ground.load()")
        await expect(shown.page.locator("#alone")).to_have_attribute("data-ground", "photo")
        lat_deg, lon_deg = shown.place((200.0, 50.0))
        told = await shown.run("place => map.ground.describe(place)", (lat_deg, lon_deg))
        assert told.startswith(f"{lat_deg:.6f}, {lon_deg:.6f} · ground ")
        assert await shown.run("map.ground.next()") == "Relief"
        await shown.run("map.ground.load()")  # the same again: the layer that was chosen stays
        await expect(shown.page.locator("#alone")).to_have_attribute("data-ground", "relief")
        ground.clear()
        await shown.run("map.ground.load()")
        await expect(shown.page.locator("#alone")).to_have_attribute("data-ground", "plain")
        assert await shown.run("place => map.ground.describe(place)", (lat_deg, lon_deg)) == ""


def _luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _contrast(one: str, other: str) -> float:
    high, low = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


async def test_lines_and_names_keep_their_contrast_in_light_and_dark() -> None:
    """By WCAG 2.2: lines 3:1, text 4.5:1."""
    style = (STATIC / "map.css").read_text(encoding="utf-8")
    light, dark = (
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", part)) for part in style.split("#map {")[0].split("@media")
    )
    hues = re.findall(r"#[0-9a-f]{6}", (STATIC / "map.js").read_text(encoding="utf-8"))
    assert len(hues) == 8
    for colours in (light, light | dark):
        below = {
            name: round(_contrast(colours.get(name, name), colours["map"]), 2)
            for name, least in (
                *((name, 3.0) for name in ("open", "done", "left", "focus", "contour", "soft", *hues)),
                *((name, 4.5) for name in ("ink", "bad", "warn")),
            )
            if _contrast(colours.get(name, name), colours["map"]) < least
        }
        assert below == {}
