"""Pages in a real browser: one Chromium for all tests of a module, and for each page a profile of its own."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from playwright.async_api import Browser, Page, async_playwright, expect

from tests.patience import PATIENCE_S
from tests.programs import find_program

IN_CHROMIUM = [
    pytest.mark.asyncio(loop_scope="module"),
    pytest.mark.needs("chromium"),
    pytest.mark.usefixtures("chromium"),
]
"""What marks a module whose tests look at pages."""
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-smooth-scrolling",
)  # fmt: skip
DESK = (1440, 900)
PATIENCE_MS = 1000.0 * PATIENCE_S

_shared: list[Browser] = []
"""The browser that runs, if one does."""


@asynccontextmanager
async def running() -> AsyncIterator[Browser]:
    """Have all pages that are opened meanwhile share one browser."""
    if _shared:
        yield _shared[0]
        return
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=find_program("chromium"), args=list(QUIET))
        _shared.append(browser)
        try:
            yield browser
        finally:
            _shared.clear()
            await browser.close()


@asynccontextmanager
async def looking(is_complaint: Callable[[str], bool], size: tuple[int, int], **options: Any) -> AsyncIterator[Page]:
    """Yield an empty page; an error in it, or a line of its console that is a complaint, fails the test."""
    complaints = list[str]()
    expect.set_options(timeout=PATIENCE_MS)
    async with running() as browser:
        page = await browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda line: complaints.append(line.text) if is_complaint(line.text) else None)
        try:
            yield page
        finally:
            await page.context.close()
    assert complaints == []


@asynccontextmanager
async def browsing(address: str, size: tuple[int, int] = DESK) -> AsyncIterator[Page]:
    """Open a page of a server, which its content security policy must let be what it is."""
    async with looking(lambda line: "Content Security" in line, size) as page:
        await page.goto(address)
        yield page
