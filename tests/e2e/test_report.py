"""The report in a real browser, as a file without a network: its map by mouse, keys and on paper, and hostile names."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.async_api import Page, expect

from executor.analysis.documents import FlightReport
from executor.analysis.flight_record import FlightRecord, read_run
from executor.analysis.report_page import render_report_page
from executor.site import site_model
from executor.site.ground_view import encode_ground
from missions import Network
from tests.e2e.browser import IN_CHROMIUM, browsing, looking
from tests.e2e.plan_pages import SIZES, look_at
from tests.executor.builders import ground_for, site_of
from tests.executor.flights import NAMES, NETWORK, write_run
from tests.executor.grounds import Hills, ground_about
from tests.executor.plan_page.opened import opened
from tests.missions.builders import FRAME, line_east

pytestmark = IN_CHROMIUM

EVIL = "</script><script>document.title = 'run'</script><img src=x onerror=\"document.title = 'run'\">"


def _site(line: Network = NETWORK, **tables: Any) -> site_model.SiteModel:
    return ground_for(site_of(NAMES, **tables), line)


@pytest.fixture
def record(tmp_path: Path) -> FlightRecord:
    """Return the flight in `flights` that leaves a segment over."""
    write_run(tmp_path, finished=False)
    return read_run(tmp_path)


@asynccontextmanager
async def _showing(
    folder: Path,
    record: FlightRecord,
    ground: site_model.SiteModel | None = None,
    below: Mapping[str, bytes] | None = None,
    *,
    dark: bool = False,
    javascript: bool = True,
) -> AsyncIterator[Page]:
    """Open the report of a flight from a file; whatever it complains of fails the test."""
    text = render_report_page(record, FlightReport.read(folder / "report.json"), {}, ground, below or {})
    (folder / "report.html").write_text(text, encoding="utf-8")
    fetched = list[str]()
    scheme = "dark" if dark else "light"
    async with looking(bool, (1024, 768), color_scheme=scheme, java_script_enabled=javascript) as page:
        page.on("request", lambda one: fetched.append(one.url) if not one.url.startswith(("file:", "data:")) else None)
        await page.goto((folder / "report.html").as_uri())
        yield page
    assert fetched == []


async def _middle(page: Page, east: float, north: float) -> tuple[float, float]:
    """Return where on the screen a share of the map is."""
    box = await page.locator("#map canvas").bounding_box()
    assert box is not None
    return box["x"] + east * box["width"], box["y"] + north * box["height"]


SEARCH = """(words) => {
  const canvas = document.querySelector("#map canvas");
  const { left, top, width, height } = canvas.getBoundingClientRect();
  for (let x = 0; x < width; x += 5) for (let y = 0.46 * height; y < 0.54 * height; y += 5) {
    const [clientX, clientY] = [left + x, top + y];
    canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY, pointerType: "mouse" }));
    if (document.querySelector("#detail").textContent.includes(words)) return [clientX, clientY];
  }
  return null;
}"""
"""Goes over the line from west to east until the map says something there."""
PLACE = """() => {
  const canvas = document.querySelector("#map canvas");
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const [clientX, clientY] = [left + 0.3 * width, top + 0.2 * height];
  canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY, pointerType: "mouse" }));
  return document.querySelector("#pointed").textContent;
}"""
"""Returns the coordinates at one place of the map's frame, wherever the page is scrolled to."""


async def _until(page: Page, met: str) -> None:
    """Wait for a condition in JavaScript, without evaluating it in the page, which its policy forbids."""
    frame = "new Promise((go) => requestAnimationFrame(go))"
    await page.evaluate(f"async () => {{ while (!({met})) await {frame}; }}")


async def _picture(page: Page) -> bytes:
    """Return what the map shows, once it is drawn."""
    await page.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
    return await page.locator("#map canvas").screenshot()


async def _find(page: Page, words: str) -> tuple[float, float]:
    """Point at the place of which the map says something; returns where."""
    found = await page.evaluate(SEARCH, words)
    assert found is not None, f"expected a place of which the map says {words}"
    await page.mouse.move(*found)
    await expect(page.locator("#detail")).to_contain_text(words)
    return found[0], found[1]


async def test_the_map_says_what_became_of_what_is_pointed_at(tmp_path: Path, record: FlightRecord) -> None:
    async with _showing(tmp_path, record, _site()) as page:
        await expect(page.locator("#unmapped")).to_be_hidden()
        assert await page.locator("#legend li").all_inner_texts() == [
            "inspected", "not inspected", "left by a lost vehicle", "flown", "planned", "lost here"
        ]  # fmt: skip
        x, y = await _find(page, "0: inspected by uav2 at T+0:30")
        assert (await page.locator("#pointed").inner_text()).startswith("49.6")
        await page.mouse.click(x, y)
        await page.mouse.move(5, 5)
        await expect(page.locator("#detail")).to_have_text("0: inspected by uav2 at T+0:30")
        await _find(page, "1: not inspected; planned for uav2")
        await _find(page, "uav2: lost at T+0:50: link lost for 10 s")


async def test_plans_and_vehicles_are_chosen(tmp_path: Path, record: FlightRecord) -> None:
    async with _showing(tmp_path, record, _site()) as page:
        plans = await page.locator("#planned option").all_inner_texts()
        assert plans[:2] == ["not shown", "first plan"]
        assert plans[2].startswith("re-plan 1, T+")
        seen = {await _picture(page)}
        for number in (1, 2):
            await page.select_option("#planned", index=number)
            seen.add(await _picture(page))
        await page.locator("#fleet button", has_text="uav1").click()
        await expect(page.locator('#fleet [aria-pressed="true"]')).to_have_text("uav1")
        seen.add(await _picture(page))
        assert len(seen) == 4
        await page.locator("#fleet button", has_text="uav1").click()
        await expect(page.locator('#fleet [aria-pressed="true"]')).to_have_count(0)


async def test_keys_move_and_zoom_the_map_and_the_wheel_only_once_it_has_focus(
    tmp_path: Path, record: FlightRecord
) -> None:
    async with _showing(tmp_path, record, _site()) as page:
        before = await page.evaluate(PLACE)
        assert before.startswith("49.6")
        await page.mouse.move(*await _middle(page, 0.3, 0.2))
        await page.mouse.wheel(0, 120)
        await _until(page, "scrollY > 0")
        assert await page.evaluate(PLACE) == before
        await page.locator("#map canvas").focus()
        await page.keyboard.press("ArrowRight")
        moved = await page.evaluate(PLACE)
        await page.keyboard.press("+")
        nearer = await page.evaluate(PLACE)
        at_px = await page.evaluate("scrollY")
        await page.mouse.wheel(0, -120)
        await _until(page, f"({PLACE})() !== {json.dumps(nearer)}")
        assert len({before, moved, nearer}) == 3
        assert await page.evaluate("scrollY") == at_px


async def test_what_the_site_leaves_out_and_the_ground_are_on_the_map(tmp_path: Path, record: FlightRecord) -> None:
    longer = _site(line_east(8), network={"file": "line", "leave_out": ["segment 5", "segment 6"]})
    below = encode_ground(ground_about(np.array([(100.0, 0.0), (700.0, 0.0)]), hills=Hills()), FRAME)
    async with _showing(tmp_path, record, longer, below) as page:
        await expect(page.locator("#legend")).to_contain_text("left out")
        await expect(page.locator("#map")).to_have_attribute("data-ground", "photo")
        await expect(page.locator("#attribution")).to_contain_text("© Land survey 2026")
        await page.locator("#layer").click()
        await expect(page.locator("#map")).to_have_attribute("data-ground", "relief")


async def test_names_with_scripts_stay_names(tmp_path: Path, record: FlightRecord) -> None:
    named = replace(
        record,
        segments=tuple(replace(one, name=f"{one.id}{EVIL}") for one in record.segments),
        vehicles=tuple(replace(one, name=f"{one.name}{EVIL}") for one in record.vehicles),
    )
    async with _showing(tmp_path, named, _site()) as page:
        await _find(page, "</script><script>")
        assert await page.title() != "run"
        assert await page.locator("img").count() == 0


@pytest.mark.parametrize("dark", [False, True])
async def test_the_report_is_seen_whole_at_every_width(tmp_path: Path, record: FlightRecord, dark: bool) -> None:
    async with _showing(tmp_path, record, _site(), dark=dark) as page:
        for wide, high in SIZES.values():
            await page.set_viewport_size({"width": wide, "height": high})
            # Tables are moved to and fro where they are wider than the page.
            found = [one for one in await look_at(page) if not one.startswith(("cut(): TH", "cut(): TD"))]
            assert found == [], f"{wide} px"


async def test_paper_is_white_in_the_dark_too(tmp_path: Path, record: FlightRecord) -> None:
    corner = "() => [...document.querySelector('#map canvas').getContext('2d').getImageData(300, 2, 1, 1).data]"
    async with _showing(tmp_path, record, _site(), dark=True) as page:
        await page.emulate_media(media="print")
        await expect(page.locator("#zoom")).to_be_hidden()
        assert await page.evaluate("getComputedStyle(document.querySelector('#frame')).backgroundColor") == (
            "rgb(255, 255, 255)"
        )
        assert await page.evaluate(corner) in ([0, 0, 0, 0], [255, 255, 255, 255])


async def test_without_javascript_the_tables_say_the_same(tmp_path: Path, record: FlightRecord) -> None:
    async with _showing(tmp_path, record, javascript=False) as page:
        await expect(page.locator("#unmapped")).to_have_text("The map needs JavaScript. The tables below say the same.")
        await expect(page.locator("#mapped")).to_be_hidden()
        await expect(page.locator("td", has_text="no vehicle")).to_have_count(1)


async def test_the_plan_page_shows_a_report_that_can_do_nothing_there(tmp_path: Path, record: FlightRecord) -> None:
    run = tmp_path / "runs" / "20260101-080000"
    run.mkdir(parents=True)
    (run / "events.jsonl").touch()
    text = render_report_page(record, FlightReport.read(tmp_path / "report.json"), {}, _site())
    (run / "report.html").write_text(text, encoding="utf-8")
    with opened(tmp_path, None) as server:
        async with browsing(f"http://127.0.0.1:{server.port}/api/report?run=runs/20260101-080000") as page:
            await _find(page, "0: inspected by uav2 at T+0:30")
            assert await page.evaluate("origin") == "null"
