"""The plan page in a real browser: from a network's file to a site that can be planned, and nothing lost on the way."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest
from playwright.async_api import Page, Route, expect

from executor.plan_page.plan_work import PlanSettings, make_plans
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.plan_pages import SIZES, Hand, look_at, planning, planning_alone, ready, write_kml
from tests.executor.plan_page.opened import Opened, make_demo_site, opened

pytestmark = IN_CHROMIUM

SCRIPT = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>'
DROP = """([name, text]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], name));
  for (const kind of ["dragenter", "dragover", "drop"]) {
    document.body.dispatchEvent(new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true }));
  }
}"""
"""A file is dragged from a folder onto the page."""
BUDGET = '[data-path="vehicle.0.budget_pct"]'


async def in_file(page: Page, site: Path, words: str) -> None:
    """Wait until the page says that all is saved, and look into the site file."""
    await expect(page.locator("#saved")).to_have_class("is-saved")
    assert words in await asyncio.to_thread(site.read_text, encoding="utf-8")


async def test_what_is_typed_is_saved_and_what_is_wrong_is_reported_at_its_field(shared: Opened, site: Path) -> None:
    comment = "# what a route may use"
    assert comment in await asyncio.to_thread(site.read_text, encoding="utf-8")
    async with planning(shared, site) as page:
        hand = Hand(page)
        await hand.open("vehicles")
        await hand.click("#step-vehicles .item > summary >> nth=0")
        field = page.locator(BUDGET)
        await expect(field.locator(".unit")).to_have_text("%")
        await expect(field.locator(".meaning")).to_contain_text("Most of a full battery that a route may use.")
        await expect(field.locator(".meaning")).to_contain_text("75 %")
        await hand.type(f"{BUDGET} input", "170")
        await expect(field.locator(".wrong")).to_have_text(re.compile("expected .*got 170"))
        await expect(page.locator("#wrong")).to_have_text("1 to correct")
        await expect(page.locator("#start")).to_be_disabled()
        await hand.type(f"{BUDGET} input", "62,5")
        await expect(field.locator(".wrong")).to_be_hidden()
        await expect(page.locator("#start")).to_be_enabled()
        await in_file(page, site, "budget_pct = 62.5")
        await in_file(page, site, comment)
        await page.locator("#step-vehicles > summary").focus()
        for _ in range(2):
            await page.keyboard.press("Control+z")
        await expect(page.locator(f"{BUDGET} input")).to_have_value("75")
        await page.keyboard.press("Control+Shift+z")
        await page.keyboard.press("Control+Shift+z")
        await expect(page.locator(f"{BUDGET} input")).to_have_value("62.5")
        await expect(page.locator("#redo")).to_be_disabled()
        await in_file(page, site, "budget_pct = 62.5")


async def test_what_a_button_mends_is_shown_without_the_other_fields(tmp_path: Path) -> None:
    kml = write_kml(tmp_path / "line.kml")
    site = tmp_path / "site.toml"
    with site.open("w", encoding="utf-8") as file:
        file.write(f'[network]\nfile = "{kml.name}"\n[depot]\nlat_deg = 49.6\nlon_deg = 15.6\nalt_m = 460\n')
        file.write(
            '[[vehicle]]\nname = "uav1"\nsysid = 1\nconnection = "udpin://0.0.0.0:14551"\nautopilot = "ardupilot"\n'
        )
    async with planning_alone(tmp_path, site) as (page, _):
        step = page.locator("#step-network")
        await expect(step.locator("button.wrong")).to_contain_text("line.kml: heights")
        await expect(step.get_by_role("button", name="The ground is level there")).to_be_in_viewport()
        await expect(step.locator('[data-path="network.file"]')).to_be_hidden()


async def test_segments_are_chosen_by_name_box_lasso_and_click_and_left_out_by_key(shared: Opened, site: Path) -> None:
    async with planning(shared, site) as page:
        hand = Hand(page)
        await page.keyboard.press("/")
        await page.locator("#sought-segments").fill("V101.1..V101.2")
        await page.keyboard.press("Enter")
        await expect(page.locator("#selected b")).to_have_text(re.compile("^2 segments, .* V101.1, V101.2$"))
        await page.keyboard.press("Escape")
        await page.keyboard.press("o")
        await in_file(page, site, 'leave_out = ["V101.1", "V101.2"]')
        await expect(page.locator("#step-spans .status")).to_have_text(re.compile(r"\d+ of \d+"))
        await page.locator('[data-act="span.take-in"]').click()
        await expect(page.locator("#step-spans .status")).to_have_text("all")
        await page.locator('[data-act="span.clear"]').click()
        await hand.click('[data-tool="box"]')
        await hand.drag((0.01, 0.2), (0.99, 0.99))
        await expect(page.locator("#selected")).to_be_visible()
        boxed = await page.locator("#selected b").inner_text()
        await hand.click('[data-act="span.clear"]')
        await hand.click('[data-tool="lasso"]')
        await hand.drag((0.01, 0.2), (0.99, 0.2), (0.99, 0.99), (0.01, 0.99))
        await expect(page.locator("#selected b")).to_have_text(boxed)
        await page.keyboard.press("Escape")
        await expect(page.locator("#selected")).to_be_hidden()
        await page.locator("#step-spans label", has_text="Within").locator("input").fill("2000")
        await page.keyboard.press("Enter")
        await hand.map(0.5, 0.5)
        await expect(page.locator("#selected b")).to_have_text(re.compile("^27 segments"))
        await page.keyboard.press("Escape")
        await expect(page.locator('[data-tool="pick"]')).to_have_attribute("aria-pressed", "true")


async def test_an_area_and_a_pad_are_put_on_the_map_and_their_corners_are_moved(shared: Opened, site: Path) -> None:
    async with planning(shared, site) as page:
        hand = Hand(page)
        await hand.click('[data-tool="area"]')
        for corner in ((0.04, 0.2), (0.12, 0.2), (0.12, 0.3)):
            await hand.map(*corner)
        await hand.click("#tool-done")
        await expect(page.locator("#step-areas .status")).to_have_text("1 area")
        first = shared.checked()["values"]["area"][0]
        assert (first["name"], len(first["polygon"])) == ("area1", 3)
        await hand.open("areas")
        await hand.click("#step-areas .item > summary")
        await hand.type('[data-path="area.0.max_agl_m"] input', "60")
        await expect(page.locator("#step-areas .item b")).to_have_text("area1 (height limit)")
        await hand.open("places")
        await hand.click(page.locator("#step-places").get_by_role("button", name="Place pad"))
        await expect(page.locator("#guided")).to_have_text("Click on the map: pad of uav1")
        await hand.map(0.3, 0.5)
        await expect(page.locator("#step-places .item b")).to_have_text("pad1 (pad)")
        values = shared.checked()["values"]
        assert (values["vehicle"][0]["pad"], values["area"][0]["max_agl_m"]) == ("pad1", 60)


async def test_an_area_is_drawn_and_a_lock_is_set_by_keyboard_alone(shared: Opened, site: Path) -> None:
    async with planning(shared, site) as page:
        press = page.keyboard.press
        await press("?")
        await expect(page.locator("#help")).to_be_visible()
        await press("Escape")
        await expect(page.locator("#help")).to_be_hidden()
        await press("a")
        for key in ("Enter", *["ArrowRight"] * 3, "Enter", *["ArrowDown"] * 3, "Enter", "Enter"):
            await press(key)
        await expect(page.locator("#guide")).to_be_hidden()
        await press("/")
        await page.keyboard.type("V102.1")
        await press("Enter")
        await press("Escape")
        for key in ("k", "Tab", "Enter"):
            await press(key)
        await expect(page.locator("#legend-locked")).not_to_have_attribute("hidden", "")
        await press("Escape")
        await expect(page.locator("#legend-locked")).to_be_visible()
        values = shared.checked()["values"]
        assert values["lock"] == [{"segments": ["V102.1"], "vehicle": "uav2"}]
        assert len(values["area"][0]["polygon"]) == 3


async def test_a_second_tab_is_informed_and_both_edits_are_kept(shared: Opened, site: Path) -> None:
    async with planning(shared, site) as page, browsing(shared.server.address) as other:
        await ready(other)
        await expect(page.locator("#saved")).to_contain_text("open in 2 tabs")
        for tab, step, place, value in (
            (other, "inspection", '[data-path="inspection.height_m"] input', "18"),
            (page, "inspection", '[data-path="inspection.standoff_m"] input', "7"),
        ):
            await Hand(tab).open(step)
            await Hand(tab).type(place, value)
            await expect(tab.locator("#saved")).to_have_class("is-saved")
        await expect(page.locator('[data-path="inspection.height_m"] input')).to_have_value("18")
        await expect(other.locator('[data-path="inspection.standoff_m"] input')).to_have_value("7")
        await expect(other.locator("#answer")).to_contain_text("Another tab has changed this site")
        inspection = shared.checked()["values"]["inspection"]
        assert (inspection["height_m"], inspection["standoff_m"]) == (18, 7)


async def test_a_server_that_is_gone_is_reported_and_what_is_typed_is_sent_once_it_is_back(tmp_path: Path) -> None:
    site = make_demo_site(tmp_path)
    with opened(tmp_path, site) as server:
        port = server.port
        address = server.server.address
        browser = browsing(address)
        page = await browser.__aenter__()
        await ready(page)
        await Hand(page).open("inspection")
    await expect(page.locator("#banner")).to_contain_text("does not answer")
    await Hand(page).type('[data-path="inspection.height_m"] input', "21")
    await expect(page.locator("#banner")).to_contain_text("1 change is kept here")
    await expect(page.locator("#saved")).to_have_class("is-saving")
    with opened(tmp_path, site, port=port) as server:
        await expect(page.locator("#banner")).to_be_hidden()
        await in_file(page, site, "height_m = 21")
        assert server.checked()["undo"] == "set Inspection height"
        await browser.__aexit__(None, None, None)


async def test_a_site_that_cannot_be_saved_is_reported_at_the_top(shared: Opened, site: Path) -> None:
    async def answer_full(route: Route) -> None:
        answer = await route.fetch()
        full = {"saved": False, "save_error": "site.toml: No space left on device"}
        await route.fulfill(response=answer, json=await answer.json() | full)

    async with planning(shared, site) as page:
        await page.route(re.compile("/api/(edits|workspace)$"), answer_full)
        await Hand(page).open("inspection")
        await Hand(page).type('[data-path="inspection.height_m"] input', "19")
        await expect(page.locator("#banner")).to_contain_text("Not saved: site.toml: No space left on device")
        await expect(page.locator("#saved")).to_have_text("not saved")


async def test_a_plan_that_is_still_being_read_is_shown_once_it_was(tmp_path: Path) -> None:
    site = make_demo_site(tmp_path)
    settings = PlanSettings(seconds=60.0, iterations=2, cost="minmax")
    [made] = make_plans(site.read_text(encoding="utf-8"), tmp_path, settings, tmp_path, 1)
    (tmp_path / f"{made.id}.json").rename(tmp_path / "plan.json")
    read = asyncio.Event()

    async def answer_too_early(route: Route) -> None:
        response = await route.fetch()
        said = await response.json()
        if said["chosen"] is None or read.is_set():
            await route.fulfill(response=response)
            return
        read.set()
        await route.fulfill(response=response, json={**said, "plans": []})

    with opened(tmp_path, site) as server:
        async with browsing("about:blank") as page:
            await page.route(re.compile("/api/workspace$"), answer_too_early)
            await page.goto(server.server.address)
            await ready(page)
            await read.wait()
            await asyncio.to_thread(server.follow_until, lambda news: news["plans"])  # another tab is news for this one
            await expect(page.locator("#times")).to_be_visible()


async def test_a_script_in_a_name_is_shown_as_text(tmp_path: Path) -> None:
    name = SCRIPT.replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
    kml = write_kml(tmp_path / "line.kml", name)
    async with planning_alone(tmp_path) as (page, _):
        await page.evaluate(DROP, [kml.name, kml.read_text(encoding="utf-8")])
        hand = Hand(page)
        await expect(page.locator("#step-network .status")).to_contain_text("segment")
        await hand.open("spans")
        first = page.locator("#step-spans .spans .name").first
        await expect(first).to_contain_text("onerror")
        await first.click()
        await expect(page.locator("#selected b")).to_contain_text("<img src=x")
        assert await page.evaluate("window.hacked") is None
        assert await page.locator("#steps img, #steps script").count() == 0


async def test_another_network_is_seen_at_once_and_nothing_of_the_one_before_stays_chosen(tmp_path: Path) -> None:
    first = write_kml(tmp_path / "first.kml").read_text(encoding="utf-8")
    async with planning_alone(tmp_path) as (page, server):
        hand = Hand(page)
        await page.evaluate(DROP, ["line.kml", first])
        await expect(page.locator("#step-network .status")).to_have_text("12 segments")
        await hand.click('[data-tool="box"]')
        await hand.drag((0.01, 0.01), (0.99, 0.99))
        await expect(page.locator("#selected b")).to_have_text(re.compile("^12 segments"))
        await page.evaluate(DROP, ["far.kml", first.replace(">15.6", ">17.6").replace(" 15.6", " 17.6")])
        await expect(page.locator("#site-name")).to_have_text("far")
        await expect(page.locator("#selected")).to_be_hidden()
        server.checked()
        await hand.click('[data-tool="box"]')
        await hand.drag((0.01, 0.01), (0.99, 0.99))
        await expect(page.locator("#selected b")).to_have_text(re.compile("^12 segments"))


@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_every_step_is_legible_and_whole_at_every_width(
    shared: Opened, site: Path, scheme: str, language: str
) -> None:
    async with planning(shared, site, query=f"?lang={language}") as page:
        await page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
        for box in await page.locator(".step > summary").all():
            if await box.locator("xpath=..").get_attribute("open") is None:
                await box.click()
        for size in SIZES.values():
            await page.set_viewport_size({"width": size[0], "height": size[1]})
            assert await look_at(page) == []
        assert await page.locator("html").get_attribute("lang") == language
        for one in await page.locator("button:visible, input:not([aria-hidden]):visible, select:visible").all():
            assert await one.evaluate("one => Boolean(one.textContent.trim() || one.ariaLabel || one.labels?.length)")
