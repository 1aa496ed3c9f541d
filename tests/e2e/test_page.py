"""A flight of four with a loss, watched and steered in a real browser."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.browser import browsing
from tests.e2e.flights import called, ended, said_in, site_file
from tests.ports import free_port

pytestmark = pytest.mark.asyncio

SHOTS = os.environ.get("FAULTLINE_SHOTS")
"""A folder for pictures of the page, for who wants to look at it."""


async def ask(page: Page, number: int, key: str) -> None:
    """Ask for something by keyboard, and say yes."""
    await page.keyboard.press(str(number))
    await page.keyboard.press(key)
    await expect(page.locator("#ask")).to_be_visible()
    await page.keyboard.press("Enter")


async def shot(page: Page, name: str) -> None:
    """Keep a picture where somebody wants to look at it."""
    if SHOTS:
        await page.screenshot(path=str(Path(SHOTS) / f"{name}.png"))
        size = page.viewport_size
        await page.set_viewport_size({"width": 390, "height": 844})
        await page.screenshot(path=str(Path(SHOTS) / f"{name}-phone.png"))
        if size is not None:
            await page.set_viewport_size(size)


@pytest.mark.needs("chromium")
async def test_a_flight_with_a_loss_is_watched_and_steered(tmp_path: Path) -> None:
    port = free_port()
    site, _ = site_file(tmp_path, pylons=17, vehicles=4, speedup=6.0, autopilot="px4")
    site.write_text(f"{site.read_text(encoding='utf-8')}[web]\nport = {port}\n", encoding="utf-8")
    simulated = ("simulate", str(site), "--failsafe", "--fault", "uav2:silent@40%")
    plan = tmp_path / "plan.json"
    async with called("plan", str(site), "--all-vehicles", "--seconds", "0.5", "-o", str(plan)) as planning:
        await ended(planning)
    flown = ("fly", str(site), "--plan", str(plan), "--yes", "--run", str(tmp_path / "run"))
    async with called(*simulated), called(*flown) as fly:
        await said_in(fly.stderr, f"page: http://127.0.0.1:{port}/")
        async with browsing(f"http://127.0.0.1:{port}/") as page:
            strips = page.locator(".strip")
            await expect(strips).to_have_count(4)
            first, lost, third = strips.nth(0), strips.nth(1), strips.nth(2)
            await expect(first.locator(".route")).to_contain_text(re.compile(r"inspects \S"))

            await ask(page, 1, "h")
            await expect(first).to_have_attribute("data-state", "holding")
            await expect(first.locator(".told")).to_have_text("Hold: done, it holds")
            await expect(first.locator(".where")).to_contain_text("0.0 m/s")
            await ask(page, 1, "r")
            await expect(first.locator(".told")).to_have_text("Resume: done, it flies on")
            await expect(first).to_have_attribute("data-state", "flying")
            await ask(page, 1, "l")
            await expect(first.locator(".told")).to_contain_text("Land: refused, it is ")

            await expect(lost).to_have_attribute("data-state", "lost")
            lines = page.locator("#lines")
            await expect(lines).to_contain_text("re-plan 1 is on board")
            await expect(lost.locator(".why")).to_contain_text("link lost for ")
            await ask(page, 3, "x")
            await expect(third.locator(".why")).to_have_text("operator: excluded by the operator")
            await expect(third.locator(".told")).to_contain_text("Exclude: done, it is out of the plan")
            await expect(lines).to_contain_text("planning for uav1, uav4")
            await expect(lines.locator("li").first).to_contain_text(re.compile("re-plan [23] is on board"))
            await expect(page.locator("#revision")).to_have_text(re.compile("revision [23]"))
            await expect(page.locator("#window")).not_to_have_text("not known")
            await shot(page, "flight")
            await expect(page.locator("#count")).to_have_text("16 of 16")
        await ended(fly)
    report = json.loads((tmp_path / "run" / "report.json").read_text(encoding="utf-8"))
    assert report["finished"]
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [("uav2", "link"), ("uav3", "operator")]
    rows = [row["reason"] for row in report["not_counted"] if row["vehicle"] == "uav1"]
    assert not [reason for reason in rows if "flown" in reason or "turned back" in reason]
