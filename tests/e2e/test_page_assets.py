"""The list of assets in a real browser: missed ones come first, and any that counts may be inspected again."""

from __future__ import annotations

import pytest
from playwright.async_api import Page, expect

from executor.core.interface.intents import Action
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.gallery import LAYOUTS, Shown, scene_of

pytestmark = IN_CHROMIUM

BEYOND = """[...document.querySelectorAll("#assets *")].filter((one) => one.getClientRects().length &&
  one.getBoundingClientRect().right > document.querySelector("#assets").getBoundingClientRect().right + 0.5
).map((one) => one.textContent)"""
EXPECTED = [
    ("P42-P43", "missed 3 of 11", "uav1"),
    ("pylon p3", "missed 2 of 4", "uav3"),
    ("P43-P47", "given up 0 of 10", "uav2"),
    ("P43-P44", "open 2 of 10", ""),
    ("P44-P45", "open", ""),
    ("P45-P46", "open", ""),
    ("pylon p1", "inferred 4 of 4", "uav1"),
    ("P41-P42", "seen 10 of 10", "uav1"),
]


async def listed(page: Page) -> list[tuple[str, str, str]]:
    columns = [await page.locator(f".asset .{name}").all_text_contents() for name in ("asset-name", "became", "by")]
    return [(name, became, by) for name, became, by in zip(*columns, strict=True)]


@pytest.mark.parametrize("layout", LAYOUTS)
async def test_missed_ones_come_first_and_red(layout: str) -> None:
    size = LAYOUTS[layout]
    with Shown(scene_of("pictures")).serving() as address:
        async with browsing(address, size) as page:
            await expect(page.locator("#tally-missed")).to_have_text("3 missed")
            if layout == "phone":
                await expect(page.locator("#listed")).to_be_hidden()
                await page.locator("#assets summary").click()
            await expect(page.locator(".asset .became").nth(1)).to_have_text("missed 2 of 4")
            assert await listed(page) == EXPECTED
            await expect(page.locator("#sought")).to_be_hidden()
            red, other = (page.locator(".asset .pick").nth(number) for number in (0, 3))
            colour = "one => getComputedStyle(one).color"
            assert await red.evaluate(colour) != await other.evaluate(colour)
            await page.locator(".asset .pick").last.click()
            await expect(page.locator(".asset .again").last).to_be_in_viewport()
            assert await page.evaluate(BEYOND) == []
            assert await page.evaluate("document.documentElement.scrollWidth") <= size[0]


async def test_an_asset_that_counts_may_be_inspected_again() -> None:
    shown = Shown(scene_of("pictures"))
    with shown.serving() as address:
        async with browsing(address) as page:
            row = page.locator(".asset", has_text="P41-P42")
            await expect(row).to_have_attribute("data-state", "seen")
            await row.locator(".pick").click()
            await expect(page.locator("#map")).to_have_attribute("title", "P41-P42")
            await row.locator(".again").click()
            await expect(page.locator("#question")).to_have_text("Look again at P41-P42?")
            await expect(page.locator("#meaning")).to_contain_text("its pictures so far do not count")
            await page.keyboard.press("Escape")
            assert shown.asked == []
            await row.locator(".again").click()
            await page.locator("#yes").click()
            await expect(page.locator("#answer")).to_contain_text("Look again at P41-P42: accepted")
    assert [(one.action, one.vehicle, one.assets) for one in shown.asked] == [(Action.PROVE, None, (0,))]


@pytest.mark.parametrize(
    ("asset", "why"),
    [("pylon p3", "it is flown again"), ("P44-P45", "still to be flown"), ("P43-P47", "No vehicle flies it any more")],
)
async def test_what_is_open_says_so_instead(asset: str, why: str) -> None:
    with Shown(scene_of("pictures")).serving() as address:
        async with browsing(address) as page:
            row = page.locator(".asset", has_text=asset)
            await row.locator(".pick").click()
            await expect(row.locator(".asset-why")).to_contain_text(why)
            await expect(row.locator(".again")).to_be_visible(visible=asset == "P43-P47")
            await row.locator(".pick").click()
            await expect(row.locator(".more")).to_be_hidden()


async def test_of_a_thousand_those_are_shown_that_are_sought() -> None:
    shown = Shown(scene_of("pictures-many"))
    with shown.serving() as address:
        async with browsing(address) as page:
            await expect(page.locator("#unlisted")).to_have_text("880 more: search for a name, a state or a vehicle.")
            await expect(page.locator(".asset.is-missed")).to_have_count(10)
            await page.keyboard.press("/")
            await expect(page.locator("#sought")).to_be_focused()
            await page.keyboard.type("p941-p9")
            await expect(page.locator(".asset-name")).to_have_text(["P941-P942"])
            await page.locator("#sought").fill("missed")
            await expect(page.locator(".asset")).to_have_count(10)
            await page.locator("#sought").fill("UAV2")
            await expect(page.locator(".asset")).to_have_count(89)
            await page.locator("#sought").fill("nowhere")
            await expect(page.locator("#unlisted")).to_have_text("No asset has this name or this state.")
            # What is typed there asks for nothing else.
            await page.locator("#sought").fill("")
            await page.keyboard.type("pAh1?")
            assert await page.locator("dialog[open]").count() == 0
    assert shown.asked == []


async def test_without_cameras_it_is_there_on_demand() -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address) as page, page.expect_request("**/assets"):
            await expect(page.locator("#assets summary")).to_have_text("Segments 1 of 6 inspected ")
            await expect(page.locator("#listed")).to_be_hidden()
            assert await page.locator(".asset").count() == 0
            await page.locator("#assets summary").click()
            await expect(page.locator(".asset")).to_have_count(6)
            await expect(page.locator(".asset").last).to_contain_text("inspected")
            await expect(page.locator(".asset .by").last).to_have_text("uav1")


async def test_before_the_take_off_there_is_none() -> None:
    with Shown(scene_of("before-take-off")).serving() as address:
        async with browsing(address) as page:
            await expect(page.locator("#agree")).to_be_visible()
            await expect(page.locator("#assets")).to_be_hidden()
