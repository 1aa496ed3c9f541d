"""The page's list of spans and pylons: what asks for attention first, where it is, and a look again at one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from playwright.async_api import expect

from executor.core.intents import Action
from executor.core.payload.pictures import NotSeen
from executor.core.state import FleetState
from executor.core.view import FleetView
from tests.e2e.gallery import CHROMIUM, LAYOUTS, Scene, Shown, browsing, scene_of
from tests.executor.builders import with_facts

pytestmark = [
    pytest.mark.asyncio,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (Debian: apt-get install chromium)"),
]


class Missing(Shown):
    """One span was flown and not seen, and one is left over."""

    def __init__(self, scene: Scene) -> None:
        unseen = (NotSeen("uav2", 4, 60.0, "no picture"),)
        super().__init__(replace(scene, state=with_facts(scene.state, not_seen=unseen, given_up=frozenset({5}))))

    def describe(self, context: object, state: FleetState, now_s: float) -> FleetView:
        assert context is self.scene.context
        return replace(self.scene.view(state, now_s), missed=(4,), uncovered=(5,))


@pytest.mark.parametrize("layout", LAYOUTS)
async def test_what_asks_for_attention_is_first_and_looked_at_again_by_its_name(layout: str) -> None:
    shown = Missing(scene_of("flying"))
    with shown.serving() as address:
        async with browsing(address, LAYOUTS[layout]) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            await page.locator("#list").click()
            await expect(page.locator("#tally")).to_have_text(
                "1 not seen, 1 left over, 2 under way, 1 to inspect, 1 inspected"
            )
            rows = page.locator("#rows li")
            await expect(rows.nth(0)).to_contain_text("not seen")
            await expect(rows.nth(0)).to_contain_text("P45-P46")
            await expect(rows.nth(1)).to_contain_text("left over")
            await expect(rows.last).to_contain_text("inspected")
            assert await page.evaluate("document.documentElement.scrollWidth") <= LAYOUTS[layout][0]
            await page.locator("#part").fill("p41")
            await expect(rows).to_have_count(1)
            await page.locator("#part").press("Enter")
            await rows.nth(0).get_by_role("button", name="Look again at P41-P42").click()
            await expect(page.locator("#question")).to_have_text("Look again at P41-P42?")
            await page.locator("#yes").click()
            await expect(page.locator("#answer")).to_contain_text("Look again at P41-P42: accepted")
    assert [(one.action, one.vehicle, one.asset) for one in shown.asked] == [(Action.PROVE, None, "P41-P42")]


async def test_one_is_shown_on_the_map_and_nothing_is_asked_before_the_take_off() -> None:
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            await page.keyboard.press("v")
            await page.get_by_role("button", name="P43-P47", exact=True).click()
            await expect(page.locator("#assets")).to_be_hidden()
    with Shown(scene_of("before-take-off")).serving() as address:
        async with browsing(address) as page:
            await expect(page.locator(".strip")).to_have_count(3)
            await page.keyboard.press("v")
            await expect(page.locator("#rows li")).to_have_count(6)
            for button in await page.locator("#rows [data-what=again]").all():
                await expect(button).to_be_disabled()
