"""The page in a real browser at moments that a flight seldom comes to: it says what a crew must know then."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from executor.core.interface.intents import Action
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.gallery import LAYOUTS, SCENES, SECOND, Line, Shown, scene_of

pytestmark = IN_CHROMIUM


BEYOND = """[...document.querySelectorAll(".strip *, #briefing *, #offer *, #lines *")].filter((one) =>
  one.getClientRects().length && (
    one.getBoundingClientRect().right > one.closest("section").getBoundingClientRect().right ||
    (one.matches(".row > span") && one.scrollWidth > one.clientWidth)
  )
).map((one) => one.textContent)"""
"""What of the page runs over the edge of its part."""


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", SCENES)
async def test_a_moment_says_what_it_must(name: str, layout: str) -> None:
    scene, size = scene_of(name), LAYOUTS[layout]
    with Shown(scene).serving() as address:
        async with browsing(address, size) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            for place, words in scene.words.items():
                await expect(page.locator(place)).to_contain_text(words)
                await expect(page.locator(place)).to_be_visible()
            assert await page.evaluate("document.documentElement.scrollWidth") <= size[0]
            assert await page.evaluate(BEYOND) == []
            await expect(page.locator("#banner")).to_be_hidden()


NARROWED = """([words]) => {
  document.querySelector("#window").textContent = words;
  const planned = document.querySelector("#planned");
  planned.hidden = false;
  planned.textContent = "plan: any one from T+3:47 on, until then not uav1";
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const beside = box("#fleet").top < box("#summary").bottom;
  const ends = Math.max(box("#window").right, planned.getBoundingClientRect().right);
  return [box("header").height, beside ? box("#fleet").left - ends : 0, document.documentElement.scrollWidth];
}"""
"""How high the header becomes with such words in it, what is free between them and the buttons, and how wide it is."""


@pytest.mark.parametrize("width", [920, 1024, 1280, 1366, 1440, 1600])
async def test_the_header_leaves_the_map_its_height(width: int) -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address, (width, 768)) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            for vehicles, most_px in ((4, 120), (9, 150)):
                words = "✗ not " + ", ".join(f"uav{number + 1}" for number in range(vehicles))
                height_px, free_px, wide_px = await page.evaluate(NARROWED, [words])
                assert height_px <= most_px
                assert free_px >= 0
                assert wide_px <= width


async def test_the_question_before_the_take_off_is_answered_with_two_strokes() -> None:
    shown = Shown(scene_of("before-take-off"))
    with shown.serving() as address:
        async with browsing(address) as page:
            await expect(page.locator("#agree")).to_be_visible()
            await page.keyboard.press("y")
            await expect(page.locator("#question")).to_have_text(
                "All missions are on board, verified by read-back. Take off?"
            )
            await page.keyboard.press("Escape")
            assert shown.asked == []
            await page.locator("#agree").click()
            await page.locator("#yes").click()
            await expect(page.locator("#answer")).to_contain_text("Take off: accepted")
    assert [(one.action, one.vehicle) for one in shown.asked] == [(Action.TAKE_OFF, None)]


async def test_an_offer_is_taken_with_the_pad_in_mind() -> None:
    shown = Shown(scene_of("offer"))
    with shown.serving() as address:
        async with browsing(address) as page:
            await page.locator("#takers button").click()
            await expect(page.locator("#meaning")).to_contain_text("Its pad is clear of people")
            await page.locator("#yes").click()
            await expect(page.locator("#answer")).to_contain_text("Include uav1: accepted")
    assert [(one.action, one.vehicle, one.confirmed) for one in shown.asked] == [(Action.INCLUDE, "uav1", False)]


@pytest.mark.parametrize(("name", "key", "action"), [("takeover", "l", Action.LAND), ("down", "d", Action.DISARM)])
async def test_what_asks_twice_is_not_done_by_enter_alone(name: str, key: str, action: Action) -> None:
    shown = Shown(scene_of(name))
    with shown.serving() as address:
        async with browsing(address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            for _ in range(2):
                await expect(page.locator("#ask")).to_be_hidden()
                await page.keyboard.press("2")
                await page.keyboard.press(key)
                await page.keyboard.press("Enter")
                await expect(page.locator("#meaning")).to_have_text(SECOND)
                if [one.confirmed for one in shown.asked] == [False]:
                    await page.keyboard.press("Enter")
            await page.locator("#yes").click()
            await expect(page.locator("#answer")).to_contain_text("accepted")
    asked = [(one.action, one.vehicle, one.confirmed) for one in shown.asked]
    assert asked == [(action, "uav2", False), (action, "uav2", False), (action, "uav2", True)]
    assert len({one.id for one in shown.asked}) == 3


async def test_what_was_said_yes_to_is_asked_once_however_late_the_dialog_says_that_it_closed() -> None:
    """Two close events that a busy computer delivers late are two of the last question, not one of each."""
    shown = Shown(scene_of("flying"))
    with shown.serving() as address:
        async with browsing(address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            for key, answer in (("h", "Hold uav2"), ("b", "Bring back uav2")):
                await page.keyboard.press("2")
                await page.keyboard.press(key)
                await page.keyboard.press("Enter")
                await page.locator("#ask").dispatch_event("close")
                await expect(page.locator("#answer")).to_contain_text(f"{answer}: accepted")
    assert [one.action for one in shown.asked] == [Action.HOLD, Action.RETURN]


async def test_a_page_that_is_behind_says_so_by_the_flights_own_time() -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with Line.to(address) as line, browsing(line.address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            async with page.expect_response(lambda answer: answer.url.endswith("/clock")):
                line.free.clear()
            banner = page.locator("#banner")
            await expect(banner).to_contain_text("The link to this page is behind: this is T+")
            await expect(banner).to_contain_text("s old; the flight is at T+")
            await expect(page.locator(".strip .when").first).to_have_text("Last at")
            line.free.set()
            await expect(banner).to_be_hidden()


async def test_a_ground_station_that_is_gone_is_reported() -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with Line.to(address) as line, browsing(line.address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            line.cut()
            await expect(page.locator("#banner")).to_contain_text("The ground station does not answer: this is T+")


async def test_a_span_that_is_touched_says_its_name() -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address) as page:
            await expect(page.locator("#lines")).to_contain_text("flies its mission")
            canvas = page.locator("#map")
            box = await canvas.bounding_box()
            assert box is not None
            named = set[str]()
            for y in range(60, round(box["height"]) - 60, 10):
                await canvas.click(position={"x": 0.55 * box["width"], "y": y})
                named.add(await canvas.get_attribute("title") or "")
    assert named == {"", "P43-P44"}
