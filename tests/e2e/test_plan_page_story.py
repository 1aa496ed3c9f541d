"""From a network's file to a plan on the page alone, counted in clicks; then losses, changes, days, a flight."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from playwright.async_api import Page, Route, expect

from missions import PlanFile, check_plan, read_any_plan
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.flights import called, said_in
from tests.e2e.plan_pages import Hand, planning, planning_alone, write_kml
from tests.executor.flights import write_run
from tests.executor.plan_page.opened import Opened, make_demo_site
from tests.ports import free_ports

pytestmark = IN_CHROMIUM

UNKNOWN = Path(__file__).parents[3] / "shared" / "data" / "kml" / "pylons.kml"
MOST_CLICKS = 40
HOUR = "08:00"


@asynccontextmanager
async def planned(server: Opened, site: Path) -> AsyncIterator[tuple[Page, Hand]]:
    """Open the page over a site, and plan it."""
    async with planning(server, site) as page:
        hand = Hand(page)
        await plan(page, hand)
        yield page, hand


def use_free_ports(site: Path) -> int:
    """Have the vehicles of a site heard on ports that nobody else uses; returns one more."""
    *ports, one_more = free_ports(4)
    text = site.read_text(encoding="utf-8")
    for number, port in enumerate(ports, 1):
        text = text.replace(f":{14550 + number}", f":{port}")
    site.write_text(text, encoding="utf-8")
    return one_more


async def plan(page: Page, hand: Hand) -> None:
    """Search for a plan, the shortest that the menu offers."""
    await page.locator(".menu select").first.select_option("2")
    await hand.click("#start")
    await expect(page.locator("#times")).to_be_visible()


async def go_to(page: Page, share: float) -> None:
    """Drag the slider to a share of the time."""
    box = await page.locator("#slider").bounding_box()
    assert box is not None
    await page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)


@pytest.mark.parametrize("source", ["written", "unknown"])
async def test_a_crew_comes_from_a_file_to_a_plan_in_few_clicks(tmp_path: Path, source: str) -> None:
    kml = tmp_path / "from" / "line.kml"
    kml.parent.mkdir()
    if source == "written":
        write_kml(kml)
    elif UNKNOWN.is_file():
        shutil.copy(UNKNOWN, kml)
    else:
        pytest.skip(f"{UNKNOWN} is not there")
    root = tmp_path / "site"
    root.mkdir()
    async with planning_alone(root) as (page, server):
        hand = Hand(page, 1)
        await page.set_input_files("#drop input[type=file]", str(kml))
        places = page.locator("#step-places")
        await expect(places.locator(".wrong").first).to_contain_text("depot")
        await hand.click(places.get_by_role("button", name="Place depot"))
        await hand.map(0.5, 0.45)
        await hand.click(page.locator("#step-network").get_by_role("button", name="The ground is level there"))
        await expect(page.locator("#wrong")).to_be_hidden()

        await hand.click('[data-tool="area"]')
        for corner in ((0.86, 0.12), (0.95, 0.12), (0.95, 0.2), (0.86, 0.2)):
            await hand.map(*corner)
        await hand.click("#tool-done")
        await expect(page.locator("#step-areas .status")).to_have_text("1 area")

        await hand.open("spans")
        first = page.locator("#step-spans .spans input").first
        name = await page.locator("#step-spans .spans .name").first.inner_text()
        await hand.click(first)
        await hand.give("span.lock", "uav2")
        await expect(page.locator("#step-spans .spans .state-word").first).to_have_text("locked: uav2")
        await expect(page.locator("#selected b")).to_contain_text("· locked: uav2")
        await expect(page.locator("#step-spans .status")).to_contain_text("all, 1 locked")

        await hand.click("#start")
        await expect(page.locator("#times")).to_be_visible()
        await expect(page.locator(".routes tbody tr")).to_have_count(3)
        await expect(page.locator(".card[aria-checked=true] .fact b").last).to_have_text("0")
        assert hand.clicks <= MOST_CLICKS
        summary = server.get("/api/workspace")
    values = summary["values"]
    assert ([one["name"] for one in values["area"]], values["lock"][0]["vehicle"]) == (["area1"], "uav2")
    made = read_any_plan(root / "plan.json")
    assert isinstance(made, PlanFile)
    assert check_plan(made) == []
    flown = {
        made.segments[made.positions[visit.segment]].display_name: one.vehicle
        for one in made.routes for visit in one.visits
    }  # fmt: skip
    assert (len(made.names), flown[name]) == (3, "uav2")


async def test_a_loss_is_answered_where_the_slider_stands(shared: Opened, site: Path) -> None:
    async with planned(shared, site) as (page, hand):
        await expect(page.locator("#lose")).to_be_disabled()
        await page.locator("#plan-map").click(position={"x": 12, "y": 12})
        await page.keyboard.press("2")
        await go_to(page, 0.5)
        await expect(page.locator("#times .row.chosen .where")).to_contain_text("%")
        await hand.click("#lose")
        notice = page.locator("#plans .answer")
        await expect(notice.locator("h3")).to_have_text(re.compile(r"uav2 lost at T\+\d+:\d\d"))
        await expect(notice).to_contain_text(re.compile(r"The others inspect|left over"))
        await expect(page.locator("#times .row").nth(1).locator(".lost")).to_be_visible()
        await expect(page.locator("#times .row").nth(1).locator(".where")).to_contain_text("lost at T+")
        await expect(page.locator("#times .visit.again")).not_to_have_count(0)
        await hand.click(notice.get_by_role("button", name="Back to the plan"))
        await expect(notice).to_be_hidden()
        await expect(page.locator("#times .visit.again")).to_have_count(0)


async def test_a_change_by_hand_is_checked_and_priced_before_it_is_kept(shared: Opened, site: Path) -> None:
    async with planned(shared, site) as (page, hand):
        before = shared.get("/api/workspace")["chosen"]
        await hand.click(".routes .who >> nth=0")
        first = page.locator(".visits li .pick").first
        name = (await first.inner_text()).split(" ", 1)[1]
        await hand.click(first)
        await hand.give("span.give", "uav3")
        notice = page.locator("#plans .answer")
        await expect(notice.locator("h3")).to_have_text("1 manual change")
        await expect(notice).to_contain_text("Budgets, areas, heights and separation are respected.")
        await expect(notice).to_contain_text("Window: ")
        await hand.click(".routes .who >> nth=2")
        await expect(page.locator(".visits")).to_contain_text(name)
        await page.keyboard.press("Escape")
        await expect(notice).to_be_hidden()
        assert shared.get("/api/workspace")["chosen"] == before
        await hand.give("span.give", "uav3")
        await hand.click(notice.get_by_role("button", name="Keep"))
        await expect(notice).to_be_hidden()
        await expect(page.locator(".visits")).to_contain_text(name)
        chosen = shared.get("/api/workspace")["chosen"]
        assert chosen != before
        shown = shared.get(f"/api/plans/{chosen}")["vehicles"]
        segments = {one["id"]: one["name"] for one in shared.get("/api/network")["segments"]}
        assert name in [segments[visit["segment"]] for visit in shown[2]["routes"][0]["visits"]]


async def test_several_plans_are_shown_side_by_side_and_chosen_by_click(shared: Opened, site: Path) -> None:
    async with planning(shared, site) as page:
        hand = Hand(page)
        await page.locator(".tick", has_text="several to choose").click()
        await hand.click("#start")
        cards = page.locator(".card")
        await expect(cards.nth(1)).to_be_visible()
        await expect(page.locator("#start")).to_be_enabled()
        await hand.click(cards.last)
        await expect(cards.last).to_have_attribute("aria-checked", "true")
        await expect(page.locator("#times")).to_be_visible()
        workspace = shared.get("/api/workspace")
        assert workspace["chosen"] == workspace["plans"][-1]["id"]
        await expect(page.locator("svg.front circle")).to_have_count(len(workspace["plans"]))


async def test_a_search_is_cancelled_and_the_plan_before_is_kept(shared: Opened, site: Path) -> None:
    async with planned(shared, site) as (page, hand):
        before = shared.get("/api/workspace")["chosen"]
        await page.locator(".menu select").first.select_option("300")
        await hand.click("#start")
        await expect(page.locator(".busy progress")).to_be_visible()
        await hand.click(".busy .cancel")
        await expect(page.locator(".busy")).to_be_hidden()
        assert shared.get("/api/workspace")["chosen"] == before
        await hand.open("inspection")
        await hand.type('[data-path="inspection.height_m"] input', "17")
        await expect(page.locator("#plans .notice", has_text="The site has changed since this plan")).to_be_visible()
        await expect(page.locator("#fly")).to_be_disabled()


async def test_why_what_is_left_cannot_be_planned_stays_in_sight(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "elsewhere"
    run.mkdir(parents=True)
    report = write_run(run, finished=False)
    report.model_copy(update={"uncovered_names": ("P1-P2",)}).write(run / "report.json")
    async with planning_alone(tmp_path, make_demo_site(tmp_path)) as (page, _):
        await page.set_viewport_size({"width": 1440, "height": 500})
        hand = Hand(page)
        failed = page.locator("#plans .failed")
        await expect(failed).to_be_hidden()
        await hand.click(page.get_by_role("button", name="Plan the remaining 1"))
        await expect(failed).to_contain_text("plan-000.json")
        await expect(failed).to_be_in_viewport(ratio=1)
        await hand.open("inspection")
        await hand.type('[data-path="inspection.height_m"] input', "17")
        await expect(failed).to_be_hidden()


async def test_a_day_is_planned_with_its_hours_and_shown_as_a_chart_that_is_the_slider(
    shared: Opened, site: Path
) -> None:
    async with planning(shared, site) as page:
        hand = Hand(page)
        await hand.open("day")
        await hand.click(page.locator("#step-day").get_by_role("button", name="Plan days"))
        await expect(page.locator("#step-day .status")).to_have_text(f"{HOUR}–16:00")
        await expect(page.locator(".tick", has_text="days").locator("input")).to_be_checked()
        await page.locator(".menu select").first.select_option("2")
        await hand.click("#start")
        await expect(page.locator("#times")).to_be_visible()
        await expect(page.locator("#times .clock")).to_have_text(re.compile(r"0[89]:\d\d"))
        await go_to(page, 0.6)
        await expect(page.locator("#times .row .where").first).to_contain_text(re.compile("%|landed|pad|ground"))
        assert shared.get("/api/workspace")["plans"][-1]["kind"] == "day"
        await expect(page.locator(".card")).to_contain_text(re.compile(r"Last landing\s*0[89]:\d\d"))
        await hand.click("#times .row .who >> nth=0")
        await expect(page.locator("#times .safe-from")).to_have_text(
            re.compile(r"(from 0[89]:\d\d on )?the fleet can absorb the loss of uav1")
        )
        await hand.click("#lose")
        notice = page.locator("#plans .notice.answer")
        await expect(notice).to_contain_text(re.compile(r"uav1 lost at 0[89]:\d\d"))
        await expect(notice).to_contain_text("The others inspect")
        await expect(page.locator("#times .row .where").first).to_contain_text("lost")


async def test_the_page_leads_on_to_the_flight_which_asks_before_anything_moves(tmp_path: Path) -> None:
    site = make_demo_site(tmp_path)
    port = use_free_ports(site)
    async with called("open", str(site), "--no-browser", "--port", str(port)) as server:
        await said_in(server.stdout, "page: http")
        async with browsing(f"http://127.0.0.1:{port}/") as page:
            hand = Hand(page)
            await plan(page, hand)
            await hand.click("#fly")
            await expect(page.locator("#meaning")).to_contain_text("asks again before anything is changed")
            async with called("simulate", str(site)):
                await hand.click("#yes")
                try:
                    await expect(page.locator("#agree")).to_be_visible()
                    await expect(page.locator("#clock")).to_have_text("before take-off")
                finally:
                    for flight in list_flights(tmp_path):
                        os.kill(flight, signal.SIGINT)


async def test_a_flight_that_is_starting_is_shown_and_not_started_twice(shared: Opened, site: Path) -> None:
    refused, asked = asyncio.Event(), list[str]()

    async def refuse(route: Route) -> None:
        asked.append(route.request.url)
        await refused.wait()
        await route.fulfill(
            status=422, json={"error": "the flight has not begun: udp port 14551 is taken", "path": None}
        )

    async with planned(shared, site) as (page, hand):
        await expect(page.locator("#plans")).to_contain_text(re.compile(r"faultline simulate \S*site\.toml"))
        await page.route("**/api/fly", refuse)
        await hand.click("#fly")
        await hand.click("#yes")
        notice = page.locator(".flying .notice")
        await expect(notice).to_have_text("Starting the page of the flight …")
        await expect(notice).to_be_in_viewport(ratio=1)
        await expect(page.locator("#fly")).to_be_disabled()
        await expect(page.locator("#checklist")).to_be_disabled()
        refused.set()
        await expect(notice).to_contain_text("udp port 14551 is taken")
        await expect(page.locator("#fly")).to_be_enabled()
        assert len(asked) == 1


async def test_a_flight_that_does_not_begin_says_why(shared: Opened, site: Path) -> None:
    use_free_ports(site)
    with site.open("a", encoding="utf-8") as file:
        file.write("[flight]\nconnect_timeout_s = 1.0\n")
    async with planned(shared, site) as (page, hand):
        await hand.click("#checklist")
        await expect(page.locator(".flying .notice")).to_contain_text("no heartbeat of system 1")


def list_flights(root: Path) -> list[int]:
    """Return the processes of flights that were begun over a folder: they outlive the page."""
    found = []
    for one in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = one.read_bytes().decode(errors="replace").split("\0")
            if "fly" in words and any(word.startswith(str(root)) for word in words):
                found.append(int(one.parent.name))
    return found
