"""How long a crew waits for the plan page: a loss of 81 segments, and the first picture of 10,000."""

from __future__ import annotations

import asyncio
import math
import random
import sys
import time
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from executor.plan_page.plan_work import PlanSettings, make_plans
from tests.e2e.browser import browsing
from tests.e2e.plan_pages import DEPOT_DEG, KML, MARK, planning_alone, ready
from tests.e2e.test_map_pace import TIMED
from tests.executor.plan_page.opened import DEMO_RADIUS, make_demo_site

pytestmark = [pytest.mark.campaign, pytest.mark.asyncio, pytest.mark.needs("chromium"), pytest.mark.timeout(1200)]

WAITED = "performance.getEntriesByName('loss').map((one) => one.duration)"
DRAWN = """async (number) => {
  while (performance.getEntriesByName("loss").length < number) await new Promise((go) => requestAnimationFrame(go));
}"""
"""Waits until so many losses were drawn."""
FRAMES = 30.0
"""Half a second of an empty page's."""


async def frame_ms(page: Page) -> float:
    """Return how long a frame takes in which nothing is done: how busy the computer is."""
    return 1000.0 / float(await page.evaluate(TIMED, ["nothing", 2]))


async def test_a_loss_of_eighty_segments_is_drawn_within_the_frames_of_half_a_second(tmp_path: Path) -> None:
    fourth = '[[vehicle]]\nname = "uav4"\nconnection = "udpin://0.0.0.0:14554"\nsysid = 4\nautopilot = "px4"'
    site = make_demo_site(tmp_path, fourth)
    text = site.read_text(encoding="utf-8").replace(DEMO_RADIUS, "radius_m = 2200")
    site.write_text(text, encoding="utf-8")
    [made] = make_plans(text, tmp_path, PlanSettings(seconds=60.0, iterations=2000, cost="minmax"), tmp_path, 1)
    (tmp_path / f"{made.id}.json").rename(tmp_path / "plan.json")
    async with planning_alone(tmp_path, site) as (page, server):
        await asyncio.to_thread(server.follow_until, lambda news: news["warm"])
        await expect(page.locator("#times")).to_be_visible()
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        await page.locator("#times .row .who").nth(1).click()
        empty_ms = await frame_ms(page)
        shares = (0.1, 0.25, 0.4, 0.55, 0.7)
        for number, share in enumerate(shares, 1):
            await page.locator("#slider").fill(str(int(2000 * share)))
            await page.locator("#lose").click()
            await page.evaluate(DRAWN, number)
        empty_ms = max(empty_ms, await frame_ms(page))
        waited = [float(one) for one in await page.evaluate(WAITED)]
        print(f"\na frame of the empty page {empty_ms:.0f} ms; click to drawn", *(f"{one:.0f} ms" for one in waited))
        assert len(asked) == len(shares)  # nothing else is asked for
        assert sorted(waited)[len(waited) // 2] / empty_ms <= FRAMES


def write_lines(path: Path, lines: int, spans: int) -> None:
    """Write lines of spans that cross each other."""
    path.parent.mkdir()
    drawn, marks = random.Random(7), []
    for line in range(lines):
        east_m, north_m, way = drawn.uniform(-3e4, 3e4), drawn.uniform(-3e4, 3e4), drawn.uniform(0.0, 2.0 * math.pi)
        corners = []
        for _ in range(spans + 1):
            corners.append(f"{DEPOT_DEG[1] + east_m / 72_000.0:.7f},{DEPOT_DEG[0] + north_m / 111_300.0:.7f},0")
            way += drawn.uniform(-0.25, 0.25)
            east_m, north_m = east_m + 300.0 * math.cos(way), north_m + 300.0 * math.sin(way)
        marks.append(MARK.format(name=f"L{line}", corners=" ".join(corners)))
    path.write_text(KML.replace(MARK, "".join(marks)), encoding="utf-8")


async def time_first_picture_s(folder: Path, lines: int, spans: int) -> tuple[float, float]:
    """Return the seconds from the command to its address, and from opening that to a network that is drawn."""
    write_lines(folder / "line.kml", lines, spans)
    command = (sys.executable, "-m", "executor", "open", "line.kml", "--no-browser")
    began_s = time.monotonic()
    process = await asyncio.create_subprocess_exec(*command, cwd=folder, stdout=asyncio.subprocess.PIPE)
    try:
        assert process.stdout is not None
        while not (said := (await process.stdout.readline()).decode()).startswith("page: "):
            assert said
        started_s = time.monotonic() - began_s
        async with browsing("about:blank") as page:
            began_s = time.monotonic()
            await page.goto(said.split()[1])
            await ready(page)
            await page.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
            return started_s, time.monotonic() - began_s
    finally:
        process.terminate()
        await process.wait()


async def test_ten_thousand_spans_are_seen_at_most_twice_as_late_as_ten_after_a_cold_start(tmp_path: Path) -> None:
    few_s = await time_first_picture_s(tmp_path / "few", 1, 10)
    many_s = await time_first_picture_s(tmp_path / "many", 40, 250)
    for spans, (started_s, drawn_s) in (("10", few_s), ("10,000", many_s)):
        print(f"\n{spans} spans: the page is served after {started_s:.1f} s, drawn {drawn_s:.1f} s after it is opened")
    assert sum(many_s) <= 2.0 * sum(few_s)
