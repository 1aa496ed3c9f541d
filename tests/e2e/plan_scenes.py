"""Moments of the plan page, each brought about by a hand on the page, to be looked at: `tests.e2e.gallery` draws them.

They are drawn at the widths of a desk, a laptop and a phone, light and dark; those of the tutorial by
`tests.e2e.docs_pictures`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from contextlib import AsyncExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.async_api import Page, expect

from tests.e2e.plan_pages import SIZES, Hand, planning_alone, write_kml
from tests.executor.plan_page.opened import make_demo_site

Act = Callable[[Page, Hand], Awaitable[None]]


async def empty(_: Page, hand: Hand) -> None:
    """Nothing is open."""
    await expect(hand.page.locator("#drop")).to_be_visible()


async def dropped(page: Page, _: Hand) -> None:
    """A line was dropped that says neither where the depot is nor how high the ground."""
    with TemporaryDirectory() as folder:
        await page.set_input_files("#drop input[type=file]", str(write_kml(Path(folder) / "line.kml")))
        await expect(page.locator("#step-places .wrong").first).to_be_visible()


async def chosen(page: Page, hand: Hand) -> None:
    """Segments are chosen, and one is left out."""
    await hand.open("spans")
    for index in (2, 3, 4):
        await page.locator("#step-spans .spans input").nth(index).click()
    await page.keyboard.press("o")
    await expect(page.locator("#step-spans .status")).to_contain_text("of")


async def wrong(page: Page, hand: Hand) -> None:
    """A vehicle has a budget that it cannot have."""
    await hand.open("vehicles")
    await hand.click("#step-vehicles .item > summary >> nth=0")
    await hand.type('[data-path="vehicle.0.budget_pct"] input', "170")
    await expect(page.locator('[data-path="vehicle.0.budget_pct"] .wrong')).to_be_visible()


async def planned(page: Page, hand: Hand) -> None:
    """There is a plan, looked at in the middle of the flight."""
    await page.locator(".menu select").first.select_option("2")
    await hand.click("#start")
    await expect(page.locator("#times")).to_be_visible()
    await page.locator("#slider").evaluate("one => { one.value = 900; one.dispatchEvent(new Event('input')); }")


async def lost(page: Page, hand: Hand) -> None:
    """A vehicle is lost in the middle of the flight, and the others take over."""
    await planned(page, hand)
    await hand.click("#times .who >> nth=1")
    await hand.click("#lose")
    await expect(page.locator("#plans .answer")).to_be_visible()


async def by_hand(page: Page, hand: Hand) -> None:
    """A segment is given to another vehicle, and not kept yet."""
    await planned(page, hand)
    await hand.click(".routes .who >> nth=0")
    await hand.click(".visits li .pick >> nth=1")
    await hand.give("span.give", "uav3")
    await expect(page.locator("#plans .answer")).to_be_visible()


async def several(page: Page, hand: Hand) -> None:
    """Several plans to choose from."""
    await page.locator(".tick", has_text="several to choose").click()
    await hand.click("#start")
    await expect(page.locator(".card").nth(1)).to_be_visible()
    await expect(page.locator("#start")).to_be_enabled()
    await hand.click(".card >> nth=0")
    await expect(page.locator("#times")).to_be_visible()


async def day(page: Page, hand: Hand) -> None:
    """A working day."""
    await hand.open("day")
    await hand.click(page.locator("#step-day").locator("button").first)
    await expect(page.locator("#step-day .status")).to_contain_text("08:00")
    await planned(page, hand)


async def heights(page: Page, hand: Hand) -> None:
    """Heights over the way of each vehicle."""
    await planned(page, hand)
    await hand.click("#times [data-view=heights]")


PLAN_SCENES: Mapping[str, Act] = {
    "plan-empty": empty, "plan-dropped": dropped, "plan-chosen": chosen, "plan-wrong": wrong, "plan-planned": planned,
    "plan-lost": lost, "plan-by-hand": by_hand, "plan-several": several, "plan-day": day, "plan-heights": heights,
}  # fmt: skip
WITHOUT_SITE = frozenset({"plan-empty", "plan-dropped"})
DESK = {"desk": SIZES["desk"]}


async def draw_plan_scene(folder: Path, name: str, *, in_tutorial: bool = False) -> None:
    """Write a picture of a moment at each width, light and dark; or the one that the tutorial shows."""
    async with AsyncExitStack() as stack:
        root = Path(stack.enter_context(TemporaryDirectory()))
        site = None if name in WITHOUT_SITE else make_demo_site(root)
        page, _ = await stack.enter_async_context(planning_alone(root, site))
        await PLAN_SCENES[name](page, Hand(page))
        for layout, (wide, high) in (DESK if in_tutorial else SIZES).items():
            await page.set_viewport_size({"width": wide, "height": high})
            for scheme in ("light",) if in_tutorial else ("light", "dark"):
                await page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
                await page.locator("#answer").evaluate("one => one.classList.remove('shown')")
                await page.wait_for_timeout(700.0)
                picture = folder / (f"{name}.png" if in_tutorial else f"{name}-{layout}-{scheme}.png")
                await page.screenshot(path=str(picture), full_page=layout == "phone")
