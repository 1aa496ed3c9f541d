"""How fast a map of 10,000 spans is moved and zoomed, with 50 vehicles that say where they are five times a second."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from tests.e2e.mapped import Mapped, Place, mapped

pytestmark = [pytest.mark.campaign, pytest.mark.asyncio, pytest.mark.needs("chromium"), pytest.mark.timeout(600)]

LINES, SPANS, LONG_M = 40, 250, 300.0
TIMED = """async ([what, seconds]) => {
  const step = {
    nothing: () => {},
    move: (n) => map.move(n % 60 < 30 ? 6 : -6, 2),
    zoom: (n) => map.zoom(n % 80 < 40 ? 1.06 : 1 / 1.06),
  }[what];
  const frame = () => new Promise((go) => requestAnimationFrame(go));
  await frame();
  const from = performance.now();
  let frames = 0;
  for (; performance.now() - from < 1000 * seconds; frames += 1) {
    step(frames);
    await frame();
  }
  return frames / seconds;
}"""
"""Returns the frames of a second while the map is moved, zoomed or left alone."""
FLOWN = """(vehicles) => setInterval(() => {
  for (const one of vehicles) one.place = [one.place[0] + 1.6, one.place[1] + 0.4];
  map.setVehicles(vehicles);
}, 200)"""
FIRST = """async (spans) => {
  const from = performance.now();
  map.setNetwork(spans);
  map.fit();
  await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
  return performance.now() - from;
}"""
STATES = ("open", "open", "open", "done", "left-over")


def _lines() -> list[list[Place]]:
    """Return lines of spans that cross each other in an area of about 100 by 100 km."""
    drawn = random.Random(7)
    lines = []
    for _ in range(LINES):
        place, way = (drawn.uniform(-3e4, 3e4), drawn.uniform(-3e4, 3e4)), drawn.uniform(0.0, 2.0 * math.pi)
        line = [place]
        for _ in range(SPANS):
            way += drawn.uniform(-0.25, 0.25)
            place = (place[0] + LONG_M * math.cos(way), place[1] + LONG_M * math.sin(way))
            line.append(place)
        lines.append(line)
    return lines


async def _show(shown: Mapped) -> float:
    """Show everything; returns the milliseconds until it is seen."""
    pairs = [(a, b) for line in _lines() for a, b in itertools.pairwise(line)]
    spans = [
        {"id": number, "name": f"P{number}", "a": a, "b": b, "state": STATES[number % len(STATES)]}
        for number, (a, b) in enumerate(pairs)
    ]
    first_ms = await shown.run(FIRST, spans)
    vehicles = [
        {"name": f"uav{number}", "place": a, "heading_deg": 7 * number, "colour": "#0072b2", "state": "flying"}
        for number, (a, _) in enumerate(pairs[:: len(pairs) // 50])
    ]
    await shown.run(FLOWN, vehicles)
    return float(first_ms)


async def test_ten_thousand_spans_are_moved_and_zoomed_at_half_the_pace_of_an_empty_page_at_least() -> None:
    """An empty page has 60 frames a second; how many a busy computer leaves it, is measured before and after."""
    async with mapped(frame=None) as shown:
        empty = await shown.run(TIMED, ["nothing", 3])
        first_ms = await _show(shown)
        found = {}
        for near, zoomed in (("all in sight", 1), ("near", 20)):
            for what in ("move", "zoom"):
                await shown.run("zoomed => { map.fit(); map.zoom(zoomed); }", zoomed)
                found[near, what] = await shown.run(TIMED, [what, 3])
        await shown.run("() => { map.setNetwork([]); map.setVehicles([]); }")
        empty = min(empty, await shown.run(TIMED, ["nothing", 3]))
        print(f"\nempty page {empty:.0f} frames/s, first picture after {first_ms:.0f} ms")
        for (near, what), pace in found.items():
            print(f"{near}, {what}: {pace:.0f} frames/s")
        assert min(found.values()) >= empty / 2.0
