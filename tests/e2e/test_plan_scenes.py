"""The plan page at its moments: nothing is cut off, covered or hard to read at any width, light and dark."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import Page

from tests.e2e.browser import IN_CHROMIUM
from tests.e2e.plan_pages import SIZES, Hand, look_at, planning
from tests.e2e.plan_scenes import PLAN_SCENES, WITHOUT_SITE
from tests.executor.plan_page.opened import Opened, opened

pytestmark = IN_CHROMIUM


async def look_at_views(page: Page) -> list[str]:
    """Return what is wrong with how the page looks, with one panel beside the map and with the other."""
    found = []
    for view in ("prepare", "plan"):
        tab = page.locator(f'#views [data-view="{view}"]')
        if await tab.is_visible():
            await tab.click()
        found += await look_at(page)
    return found


async def look_at_scene(server: Opened, name: str, site: Path | None = None) -> None:
    query = "?lang=de" if name in {"plan-lost", "plan-by-hand", "plan-day"} else ""
    async with planning(server, site, query=query) as page:
        await PLAN_SCENES[name](page, Hand(page))
        for wide, high in SIZES.values():
            await page.set_viewport_size({"width": wide, "height": high})
            for scheme in ("light", "dark"):
                await page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
                assert await look_at_views(page) == [], f"{wide} px, {scheme}"


@pytest.mark.parametrize("name", [name for name in PLAN_SCENES if name not in WITHOUT_SITE])
async def test_a_moment_of_planning_is_seen_whole(name: str, shared: Opened, site: Path) -> None:
    await look_at_scene(shared, name, site)


async def test_a_moment_before_there_is_a_site_is_seen_whole(tmp_path: Path) -> None:
    with opened(tmp_path, None) as server:
        for name in sorted(WITHOUT_SITE, reverse=True):
            await look_at_scene(server, name)
