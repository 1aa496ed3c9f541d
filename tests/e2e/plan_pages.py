"""The plan page in a real browser: a hand that counts its clicks, and what a look at the page finds."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.async_api import Locator, Page, expect

from tests.e2e.gallery import browsing
from tests.executor.plan_page.opened import Opened, opened
from tests.patience import PATIENCE_S

PATIENCE_MS = 1000.0 * PATIENCE_S
SIZES = {"desk": (1440, 900), "laptop": (1024, 768), "phone": (390, 844)}
DEPOT_DEG = (49.60, 15.60)
STEP_DEG = 0.0012
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>line</name>
<Placemark><name>{name}</name><LineString><coordinates>{corners}</coordinates></LineString></Placemark>
</Document></kml>
"""

LOW_CONTRAST = """(least) => {
  const parse = (text) => { const found = text.match(/[\\d.]+/g).map(Number); return found.length < 4 ? [...found, 1] : found; };
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgb = (text) => {
    if (text.startsWith("rgb")) return parse(text);
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = text;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], [R, G, B]) => [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a), 1];
  const light = ([r, g, b]) => [r, g, b].map((one) => one / 255)
    .map((one) => (one <= 0.03928 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4))
    .reduce((sum, one, index) => sum + one * [0.2126, 0.7152, 0.0722][index], 0);
  const paper = (one) => {
    const papers = [];
    for (let outer = one; outer; outer = outer.parentElement) papers.unshift(rgb(getComputedStyle(outer).backgroundColor));
    return papers.reduce((below, above) => over(above, below), [255, 255, 255, 1]);
  };
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const one = node.parentElement;
    if (!node.textContent.trim() || !one.getClientRects().length || one.closest(":disabled, .unseen, option, #answer:not(.shown), kbd, label:has(:disabled)")) continue;
    const below = paper(one);
    const above = over(rgb(getComputedStyle(one).color), below);
    const [dark, bright] = [light(below), light(above)].sort((a, b) => a - b);
    const ratio = (bright + 0.05) / (dark + 0.05);
    if (ratio < least) found.push(`${node.textContent.trim().slice(0, 40)}: ${ratio.toFixed(2)}`);
  }
  return found;
}"""
"""Texts that are seen, and whose contrast to what is behind them is less than asked for."""

CUT_OFF = """() => {
  const found = [];
  for (const one of document.querySelectorAll("button, summary, label, b, th, td, p, li, .status, .where, dd")) {
    if (!one.getClientRects().length || one.closest("canvas, .unseen, #answer")) continue;
    const style = getComputedStyle(one);
    const hides = style.overflowX !== "visible";
    const box = one.getBoundingClientRect();
    if (box.width < 2 || one.closest("#history") && box.width < 3) continue;
    if ((hides && one.scrollWidth > one.clientWidth + 1) || box.right > document.documentElement.clientWidth + 1) {
      found.push(`${one.tagName} ${one.className}: ${one.textContent.trim().slice(0, 50)}`);
    }
  }
  for (const one of document.querySelectorAll("select")) {
    if (!one.getClientRects().length) continue;
    const probe = document.createElement("span");
    probe.textContent = one.selectedOptions[0]?.textContent ?? "";
    probe.style.cssText = "position:absolute;white-space:nowrap;visibility:hidden";
    probe.style.font = getComputedStyle(one).font;
    document.body.append(probe);
    if (probe.offsetWidth > one.clientWidth - 8) found.push(`select: ${probe.textContent}`);
    probe.remove();
  }
  return found;
}"""
"""Whatever is not seen whole."""

OVERLAPS = """() => {
  const parts = [...document.querySelectorAll("header > *, main > *, #stage > :not(#plan-map), #times .head > *, #times .grid > *, #plans > *")]
    .filter((one) => one.getClientRects().length && !one.closest("#answer"))
    .map((one) => [one, one.getBoundingClientRect()]).filter(([, box]) => box.width > 0 && box.height > 0);
  const found = [];
  for (const [one, a] of parts) for (const [other, b] of parts) {
    if (one === other || one.contains(other) || other.contains(one) || one.parentElement !== other.parentElement) continue;
    const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (wide > 1 && high > 1 && !(a.bottom > innerHeight + 1 && getComputedStyle(one).position === "sticky")) {
      found.push(`${one.id || one.className || one.tagName} over ${other.id || other.className || other.tagName}`);
    }
  }
  return found;
}"""
"""Parts beside each other of which one lies over the other."""


def write_kml(path: Path, name: str = "Line 7", spans: int = 12) -> Path:
    """Write a line from west to east that bends once."""
    corners = [(DEPOT_DEG[1] + STEP_DEG * step, DEPOT_DEG[0] + 0.0008 * max(0, step - spans // 2)) for step in range(spans + 1)]
    path.write_text(KML.format(name=name, corners=" ".join(f"{lon:.6f},{lat:.6f},0" for lon, lat in corners)), encoding="utf-8")
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

    async def choose(self, place: str, value: str) -> None:
        """Choose from a menu."""
        self.clicks += 1
        await self.page.locator(place).select_option(value)

    async def open(self, step: str) -> None:
        """Open a step if it is not open."""
        if await self.page.locator(f"#step-{step}").get_attribute("open") is None:
            await self.click(f"#step-{step} > summary")


@asynccontextmanager
async def planning(
    root: Path, site: Path | None = None, size: tuple[int, int] = SIZES["desk"], query: str = ""
) -> AsyncIterator[tuple[Page, Opened]]:
    """Open the page over a site, or over nothing."""
    with opened(root, site) as server:
        async with browsing(server.server.address + query, size, patience_ms=PATIENCE_MS) as page:
            await ready(page)
            yield page, server


async def ready(page: Page) -> None:
    """Wait until the page shows what there is: a site that is understood, or that there is none."""
    shown = page.locator("#empty:not([hidden]) .drop").or_(page.locator("#step-network .status", has_text=re.compile(r"\d")))
    await expect(shown.first).to_be_visible()
