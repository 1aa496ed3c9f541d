"""The plan page in a real browser: a hand that counts its clicks, and what a look at the page finds."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.async_api import Locator, Page, Route, expect

from tests.e2e.browser import DESK, browsing
from tests.executor.plan_page.opened import Opened, opened
from tests.patience import PATIENCE_S

SHORT_S = 20.0
"""Searches of the menu that are to end by themselves."""
ITERATIONS = {"plan": 3000, "front": 200_000, "day": 300}
SIZES = {"desk": DESK, "laptop": (1024, 768), "phone": (390, 844)}
DEPOT_DEG = (49.60, 15.60)
STEP_DEG = 0.0012
MARK = "<Placemark><name>{name}</name><LineString><coordinates>{corners}</coordinates></LineString></Placemark>"
KML = f"""<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>line</name>
{MARK}
</Document></kml>
"""

LOOK = Path(__file__).with_name("look_at.js").read_text(encoding="utf-8")


async def look_at(page: Page) -> list[str]:
    """Return what is hard to read, cut off, covered, or beyond the edge of the page."""
    found = [f"{way}: {one}" for way in ("faint(4.5)", "cut()", "covered()") for one in await _ask(page, way)]
    wide, seen = await page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    return [*found, *([f"{wide} px of {seen}"] if wide > seen else [])]


async def _ask(page: Page, way: str) -> list[str]:
    found = await page.evaluate(f"{LOOK.partition(chr(10))[2].rstrip()}.{way}")
    assert isinstance(found, list)
    return found


def write_kml(path: Path, name: str = "Line 7", spans: int = 12) -> Path:
    """Write a line from west to east that bends once."""
    steps = range(spans + 1)
    corners = [(DEPOT_DEG[1] + STEP_DEG * step, DEPOT_DEG[0] + 0.0008 * max(0, step - spans // 2)) for step in steps]
    text = " ".join(f"{lon_deg:.6f},{lat_deg:.6f},0" for lon_deg, lat_deg in corners)
    path.write_text(KML.format(name=name, corners=text), encoding="utf-8")
    return path


@dataclass
class Hand:
    """Clicks, and counts them; a key is counted like a click, a word that is typed like one, too."""

    page: Page
    clicks: int = 0

    async def click(self, place: str | Locator, **more: Any) -> None:
        """Click something."""
        self.clicks += 1
        await (self.page.locator(place) if isinstance(place, str) else place).click(**more)

    async def map(self, right: float, down: float) -> None:
        """Click on the map, at shares of its width and height."""
        box = await self.page.locator("#plan-map").bounding_box()
        assert box is not None
        self.clicks += 1
        await self.page.mouse.click(box["x"] + right * box["width"], box["y"] + down * box["height"])

    async def drag(self, *places: tuple[float, float]) -> None:
        """Drag over the map, from the first of some places to the last."""
        box = await self.page.locator("#plan-map").bounding_box()
        assert box is not None
        self.clicks += 1
        for index, (right, down) in enumerate(places):
            await self.page.mouse.move(box["x"] + right * box["width"], box["y"] + down * box["height"], steps=4)
            if index == 0:
                await self.page.mouse.down()
        await self.page.mouse.up()

    async def type(self, place: str, words: str) -> None:
        """Write into a field, and press Enter."""
        self.clicks += 1
        await self.page.locator(place).fill(words)
        await self.page.locator(place).press("Enter")

    async def give(self, act: str, vehicle: str) -> None:
        """Do something with the chosen segments for which a vehicle is asked."""
        await self.click(f'[data-act="{act}"]')
        await self.click(f'#selected [data-vehicle="{vehicle}"]')

    async def open(self, step: str) -> None:
        """Open a step if it is not open."""
        if await self.page.locator(f"#step-{step}").get_attribute("open") is None:
            await self.click(f"#step-{step} > summary")


@asynccontextmanager
async def planning(
    server: Opened, site: Path | None = None, size: tuple[int, int] = DESK, query: str = ""
) -> AsyncIterator[Page]:
    """Open the page of a server, over a site or over what it has; its searches end after iterations, not seconds."""
    if site is not None:
        server.open(str(site.relative_to(server.root)))
    async with browsing("about:blank", size) as page:
        await page.route("**/api/plan", _count_iterations)
        await page.goto(server.server.address + query)
        await ready(page)
        yield page
    server.end_job()


@asynccontextmanager
async def planning_alone(root: Path, site: Path | None = None) -> AsyncIterator[tuple[Page, Opened]]:
    """Open the page of a server of its own: with nothing open but what is given."""
    with opened(root, site) as server:
        async with planning(server) as page:
            yield page, server


async def _count_iterations(route: Route) -> None:
    """Ask for a search that finds the same on every computer, however busy, unless it is meant to go on."""
    asked: Any = route.request.post_data_json
    if asked["seconds"] <= SHORT_S:
        kind = "front" if asked["front"] else "day" if asked["day"] else "plan"
        asked |= {"seconds": PATIENCE_S, "iterations": ITERATIONS[kind]}
    await route.continue_(post_data=asked)


async def ready(page: Page) -> None:
    """Wait until the page shows what there is: a site that is understood, or that there is none."""
    shown = page.locator("#empty:not([hidden]) .drop").or_(
        page.locator("#step-network .status", has_text=re.compile(r"\d"))
    )
    await expect(shown.first).to_be_visible()
