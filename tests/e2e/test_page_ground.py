"""What lies below the page's map, and what else it says of places and of the plan, in a real browser."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import httpx
import numpy as np
import pytest
from playwright.async_api import expect

from executor.core.context import DayRules, PackRules
from executor.core.fleet_view import build_fleet_view
from executor.site.ground_view import encode_ground
from missions import BreakingLoss, Window
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.gallery import LAYOUTS, PLACES_M, Shown, scene_of
from tests.executor.builders import with_facts
from tests.executor.grounds import Hills, ground_about
from tests.missions.builders import FRAME

pytestmark = IN_CHROMIUM
HILLS = Hills(cell_m=5.0)
PLANE = Hills(hill_m=0.0, slope=(0.1, 0.2))
WINDOW = Window(80.0, 65.0, 325.0, BreakingLoss("uav2", 10.0, 65.0))


UNFITTED = re.compile(rf", {FRAME.lon_deg:.6f} ")
"""Middle of a map that has not been given its network yet; how far north it is, changes with the header's height."""


def _on_the_plane(told: str) -> float:
    """Return how far east a place is that was told with the height that it has."""
    lat_deg, lon_deg, height_m = map(float, re.findall(r"\d+\.\d{6}|\d+(?= m)", told))
    east_m, north_m = FRAME.to_local_m(lat_deg, lon_deg)
    assert height_m == pytest.approx(430.0 + 0.1 * east_m + 0.2 * north_m, abs=1.1)
    return east_m


async def test_a_place_under_the_pointer_is_shown_with_its_ground_height() -> None:
    """On a plane that rises to the north-east every height is known by hand."""
    ground = ground_about(np.array(PLACES_M), photo=False, hills=PLANE)
    with Shown(scene_of("flying")).serving(ground) as address:
        async with browsing(address) as page:
            await expect(page.locator("#layer")).to_have_text("Relief")
            await expect(page.locator("#pointed")).to_have_text("")
            await expect(page.locator(".strip")).to_have_count(3)  # the header has its words, and so its height
            box = await page.locator("#map").bounding_box()
            assert box is not None
            await page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            told = page.locator("#pointed")
            await expect(told).to_have_text(re.compile(r"^49\.\d{6}, 15\.\d{6} · ground \d+ m$"))
            await expect(told).not_to_have_text(UNFITTED)
            east_m = _on_the_plane(await told.inner_text())
            assert 90.0 < east_m < 600.0  # the middle of what is fitted into the map
            for key, moved in (("ArrowLeft", -1), ("ArrowRight", 1)):
                before = await told.inner_text()
                await page.keyboard.press(key)
                await expect(told).not_to_have_text(before)  # the map moves under a pointer that rests
                assert (_on_the_plane(await told.inner_text()) - _on_the_plane(before)) * moved > 0.0
            await page.mouse.move(box["x"] + box["width"] + 60, box["y"] + 5)
            await expect(told).to_have_text("")


async def test_the_map_backgrounds_are_distinguished_and_attributed() -> None:
    ground = ground_about(np.array(PLACES_M), hills=HILLS)
    with Shown(scene_of("flying")).serving(ground) as address:
        async with browsing(address) as page:
            layer, by = page.locator("#layer"), page.locator("#attribution")
            await expect(layer).to_have_text("Photo")
            await expect(by).to_have_text("contours every 10 m · © Land survey 2026")
            await expect(page.locator("#map")).to_have_attribute("data-ground", "photo")
            pictures = {"Photo": await page.locator("#map").screenshot()}
            for word, said in (("Relief", "contours every 10 m"), ("Plain", ""), ("Photo", re.compile("Land survey"))):
                await page.keyboard.press("m")
                await expect(layer).to_have_text(word)
                await expect(by).to_have_text(said)
                await expect(page.locator("#map")).to_have_attribute("data-ground", word.lower())
                pictures.setdefault(word, await page.locator("#map").screenshot())
            assert len(set(pictures.values())) == 3


async def test_without_known_ground_nothing_is_offered_but_places_are_shown() -> None:
    ground = ground_about(np.array(PLACES_M), photo=False)
    with Shown(scene_of("flying")).serving(ground) as address:
        async with browsing(address) as page:
            await page.locator(".strip").nth(2).wait_for()
            await page.locator("#map").hover()
            await expect(page.locator("#pointed")).to_have_text(re.compile(r"^49\.\d{6}, 15\.\d{6}$"))
            await expect(page.locator("#layer")).to_be_hidden()
            await expect(page.locator("#attribution")).to_be_hidden()


async def test_the_window_of_the_plan_is_shown_until_a_re_plan() -> None:
    scene = scene_of("flying")
    view = build_fleet_view(scene.context, scene.state, scene.now_s)
    assert view.flight_s is not None
    later = Window(80.0, view.flight_s + 300.0, 900.0, BreakingLoss("uav2", 10.0, 65.0))
    for window, words in ((later, r"^plan: any one from T\+\d+:\d\d on, until then not uav2$"),
                          (Window(100.0, 0.0, 325.0), r"^plan: any one at any time$")):  # fmt: skip
        with Shown(scene).serving(window=window) as address:
            async with browsing(address) as page:
                planned = page.locator("#planned")
                await expect(planned).to_have_text(re.compile(words))
                title = await planned.get_attribute("title")
                assert title is not None
                assert title.startswith("Re-plan window of the plan: ")
                assert ("uav2 lost between T+0:10 and T+1:05 breaks it" in title) is (window is later)
    with Shown(scene).serving() as address:
        async with browsing(address) as page:
            await page.locator(".strip").nth(2).wait_for()
            await expect(page.locator("#planned")).to_be_hidden()


async def test_what_was_inferred_is_flown_again_by_a_button() -> None:
    """It is there to be pressed only while something counts by evidence alone."""
    scene = scene_of("flying")
    shown = Shown(scene)
    with shown.serving() as address:
        async with browsing(address) as page:
            button = page.locator("[data-action=prove]")
            await expect(button).to_be_disabled()
            coverage = scene.state.coverage
            [segment] = sorted(coverage.inspected)[:1]
            shown.scene = type(scene)(
                **{
                    **{name: getattr(scene, name) for name in scene.__slots__},
                    "state": with_facts(scene.state, inferred=frozenset({segment})),
                }
            )
            await expect(button).to_be_enabled()
            await expect(page.locator("#legend-inferred")).to_be_visible()
            await page.keyboard.press("f")
            await expect(page.locator("#question")).to_have_text("Re-fly inferred?")
            await page.keyboard.press("Enter")
            await expect(page.locator("#answer")).to_contain_text("Re-fly inferred: accepted")
    assert [(one.action.value, one.vehicle) for one in shown.asked] == [("prove", None)]


async def test_a_base_of_a_day_is_closed_and_opened_by_a_button() -> None:
    scene = scene_of("offer")
    day = DayRules(30.0, {name: "north" if name == "uav1" else "south" for name in scene.state.vehicles}, {})
    scene = replace(scene, context=replace(scene.context, day=day))
    shown = Shown(scene)
    with shown.serving() as address:
        async with browsing(address) as page:
            strip = page.locator(".strip").nth(0)
            close, reopen = strip.locator("[data-base=close]"), strip.locator("[data-base=open]")
            await expect(close).to_have_text("Close base north")
            await expect(reopen).to_be_hidden()
            await close.click()
            await expect(page.locator("#question")).to_have_text("Close base north?")
            await page.keyboard.press("Enter")
            await expect(page.locator("#answer")).to_contain_text("Close base north: accepted")
            shown.scene = replace(scene, state=scene.state.with_crew(closed_bases=frozenset({"north"})))
            await expect(reopen).to_have_text("Open base north")
            await expect(close).to_be_hidden()
            for starts in ("swap", "include"):
                await expect(strip.locator(f"[data-action={starts}]")).to_be_hidden()
            await expect(page.locator(".strip").nth(1).locator("[data-base=close]")).to_have_text("Close base south")
    assert [(one.action.value, one.vehicle, one.base) for one in shown.asked] == [("close", None, "north")]


async def test_the_charged_packs_of_a_base_are_counted_on_the_page() -> None:
    scene = scene_of("offer")
    day = DayRules(30.0, dict.fromkeys(scene.state.vehicles, "north"), {}, packs={"north": PackRules(4)})
    shown = Shown(replace(scene, context=replace(scene.context, day=day)))
    with shown.serving() as address:
        async with browsing(address) as page:
            count, charged = page.locator(".strip").nth(0).locator("[data-base=count]"), page.locator("#charged")
            await expect(count).to_have_text("Count packs at north")
            await count.click()
            await expect(page.locator("#question")).to_have_text("Count packs at north?")
            await expect(charged).to_be_focused()
            for wrong in ("", "-1", "1.5", "1001"):  # the browser keeps what is no number of packs
                await charged.fill(wrong)
                await page.keyboard.press("Enter")
                await expect(page.locator("#ask")).to_be_visible()
            await page.keyboard.press("Escape")
            await count.click()
            await charged.fill("7")
            await page.keyboard.press("Enter")
            await expect(page.locator("#answer")).to_contain_text("Count packs at north: accepted")
            await page.locator(".strip").nth(0).locator("[data-base=close]").click()
            await expect(charged).to_be_hidden()
            await page.keyboard.press("Enter")
            await expect(page.locator("#answer")).to_contain_text("Close base north: accepted")
    assert [(one.action.value, one.vehicle, one.base, one.charged) for one in shown.asked] == [
        ("count", None, "north", 7), ("close", None, "north", None),
    ]  # fmt: skip


async def test_a_browser_keeps_the_pictures_and_fetches_them_once() -> None:
    ground = ground_about(np.array(PLACES_M), hills=HILLS)
    files = encode_ground(ground, FRAME)
    assert sum(map(len, files.values())) < 3_000_000
    with Shown(scene_of("flying")).serving(ground) as address:
        async with httpx.AsyncClient(base_url=address) as client:
            for name, kind in (("ground-photo.webp", "image/webp"), ("ground-relief.png", "image/png"),
                               ("ground.json", "application/json")):  # fmt: skip
                first = await client.get(f"/ground/{name}")
                assert (first.status_code, first.headers["content-type"], first.content) == (200, kind, files[name])
                assert first.headers["cache-control"] == "private, no-cache"
                again = await client.get(f"/ground/{name}", headers={"if-none-match": first.headers["etag"]})
                assert (again.status_code, again.content) == (304, b"")
            assert (await client.get("/ground/site.toml")).status_code == 404
            assert (await client.get("/state")).headers["cache-control"] == "no-store"


@pytest.mark.parametrize("layout", LAYOUTS)
async def test_nothing_on_the_map_lies_over_anything_else(layout: str) -> None:
    ground = ground_about(np.array(PLACES_M), hills=HILLS)
    with Shown(scene_of("flying")).serving(ground, WINDOW) as address:
        async with browsing(address, LAYOUTS[layout]) as page:
            await expect(page.locator("#attribution")).to_contain_text("Land survey")
            await page.locator("#map").hover(position={"x": 60.0, "y": 200.0})
            await expect(page.locator("#pointed")).not_to_have_text("")
            boxes = {}
            for name in ("#zoom", "#legend", "#below-map"):
                box = await page.locator(name).bounding_box()
                assert box is not None
                boxes[name] = (box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"])
            names = sorted(boxes)
            for index, one in enumerate(names):
                for other in names[index + 1 :]:
                    a, b = boxes[one], boxes[other]
                    assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1], (one, other, boxes)
            for name in ("#planned", "#fleet", "#pointed"):
                box = await page.locator(name).bounding_box()
                assert box is not None
                assert box["x"] + box["width"] <= LAYOUTS[layout][0], name
            ends = [await part.bounding_box() for part in await page.locator("#summary > div").all()]
            lefts = [(box["x"], box["x"] + box["width"]) for box in ends if box is not None]
            assert all(one[1] <= other[0] for one, other in itertools.pairwise(lefts)), lefts
            widths = (
                "[...document.querySelectorAll('#summary dd')].every((one) => one.scrollWidth <= one.clientWidth + 1)"
            )
            assert await page.evaluate(widths)
            assert await page.evaluate("document.documentElement.scrollWidth") <= LAYOUTS[layout][0]
