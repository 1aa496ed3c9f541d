"""The map alone in a real browser, with the content security policy of the server and nothing else to fetch from."""

from __future__ import annotations

import itertools
import math
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from playwright.async_api import Page, Route

import executor.adapters.web
from executor.adapters.web.guard import HEADERS
from missions import LocalFrame
from tests.e2e.browser import looking

HOST = "http://map.test"
STATIC = Path(executor.adapters.web.__file__).parent / "static"
PAGE = """<!doctype html><html lang="en"><title>map</title><link rel="stylesheet" href="/files/map.css">
<link rel="stylesheet" href="/files/alone.css"><button id="before">before</button><section id="alone"></section>
<button id="after">after</button><script type="module" src="/files/alone.js"></script></html>"""
STYLE = "#alone { position: relative; width: 800px; height: 600px; background: var(--map); }"
SCRIPT = """import { FleetMap } from "/files/map.js";
window.said = [];
window.map = new FleetMap(document.getElementById("alone"), {
  name: "Map", isMetres: location.search === "?metres", onChoose: (choice) => window.said.push(choice),
  onCancel: () => window.said.push("cancel"), onPoint: (place) => { window.pointed = place; },
});
window.use = (tool, given) => {
  window.found = [];
  window.map.startTool(tool, (one) => window.found.push(one), given);
};
"""
KINDS: Mapping[str, str] = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}
FRAME = LocalFrame(49.6, 15.6)
PLACES_M = [(0.0, 0.0), (200.0, 0.0), (400.0, 100.0), (600.0, 100.0)]

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Mapped:
    """A map that a browser shows."""

    page: Page
    frame: LocalFrame | None
    """None where its places are metres."""

    async def run(self, script: str, *given: object) -> Any:
        """Evaluate an expression or a function of one value in the page."""
        return await self.page.evaluate(script, *given)

    def place(self, place_m: Place) -> Place:
        """Return a place as the map has it."""
        return place_m if self.frame is None else self.frame.to_wgs84_deg(*place_m)

    async def show(self, places_m: Sequence[Place] = PLACES_M, **states: str) -> None:
        """Show a line from place to place, its spans P1 and so on; of some, another state than open."""
        spans = [
            {"id": 10 + number, "name": f"P{number + 1}", "a": self.place(a), "b": self.place(b),
             "state": states.get(f"P{number + 1}", "open")}
            for number, (a, b) in enumerate(itertools.pairwise(places_m))
        ]  # fmt: skip
        if self.frame is not None:
            await self.run(
                "frame => map.setFrame(frame)", {"lat_deg": self.frame.lat_deg, "lon_deg": self.frame.lon_deg}
            )
        await self.run("spans => { map.setNetwork(spans); map.fit(); }", spans)

    async def at(self, place_m: Place) -> tuple[float, float]:
        """Return where on the screen a place is."""
        x, y = await self.run("place => map.view.pixels(map.metres(place))", self.place(place_m))
        box = await self.page.locator("#alone").bounding_box()
        assert box is not None
        return box["x"] + x, box["y"] + y

    async def click(self, place_m: Place, beside: tuple[float, float] = (0.0, 0.0)) -> None:
        """Click on a place, or some pixels beside it."""
        x, y = await self.at(place_m)
        await self.page.mouse.click(x + beside[0], y + beside[1])

    async def drag(self, *places_m: Place) -> None:
        """Drag the mouse from place to place."""
        await self.page.mouse.move(*await self.at(places_m[0]))
        await self.page.mouse.down()
        for place in places_m[1:]:
            await self.page.mouse.move(*await self.at(place), steps=4)
        await self.page.mouse.up()

    async def press(self, *keys: str) -> None:
        """Press keys one after another, with the map in focus."""
        await self.page.locator("#alone canvas").focus()
        for key in keys:
            await self.page.keyboard.press(key)

    async def look_at(self, place_m: Place) -> None:
        """Move the map by keys until its crosshair is over a place, as near as keys get."""
        x, y = await self.at(place_m)
        box = await self.page.locator("#alone").bounding_box()
        assert box is not None
        for off_px, ways in (
            (x - box["x"] - box["width"] / 2, ("ArrowRight", "ArrowLeft")),
            (y - box["y"] - box["height"] / 2, ("ArrowDown", "ArrowUp")),
        ):
            steps = round(abs(off_px) / 6.0)
            key = ways[0] if off_px > 0.0 else ways[1]
            await self.press(*[key] * (steps // 10), *[f"Shift+{key}"] * (steps % 10))

    async def picture(self) -> bytes:
        """Return what the map shows, once it stands still."""
        await self.run("() => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
        return await self.page.locator("#alone").screenshot()


def is_near(one: Place, other: Place, most_m: float = 0.01) -> bool:
    """Return whether two places in metres are the same."""
    return math.dist(one, other) <= most_m


@asynccontextmanager
async def mapped(
    *,
    frame: LocalFrame | None = FRAME,
    touch: bool = False,
    dark: bool = False,
    ground: Mapping[str, bytes] = MappingProxyType({}),
) -> AsyncIterator[Mapped]:
    """Open the map in a browser; whatever it complains of, or fetches from elsewhere, fails the test."""
    fetched = list[str]()

    async def serve(route: Route) -> None:
        name = route.request.url.removeprefix(HOST).partition("?")[0]
        extra = {"/files/alone.css": STYLE, "/files/alone.js": SCRIPT}
        file = STATIC / name.removeprefix("/files/")
        if not route.request.url.startswith(HOST):
            fetched.append(route.request.url)
            await route.abort()
        elif name == "/":
            await route.fulfill(body=PAGE, content_type="text/html; charset=utf-8", headers=dict(HEADERS))
        elif name.startswith("/ground/"):
            body = ground.get(name.removeprefix("/ground/"))
            await route.fulfill(status=404 if body is None else 200, body=body or b"", headers=dict(HEADERS))
        else:
            script = extra[name] if name in extra else file.read_text(encoding="utf-8")
            await route.fulfill(body=script, headers={**HEADERS, "content-type": KINDS[file.suffix]})

    scheme = "dark" if dark else "light"
    async with looking(
        lambda line: "status of 404" not in line, (900, 700), has_touch=touch, color_scheme=scheme
    ) as page:
        await page.route("**/*", serve)
        await page.goto(f"{HOST}/" if frame else f"{HOST}/?metres")
        await page.locator("#alone canvas").wait_for()
        yield Mapped(page, frame)
    assert fetched == []
