"""The page of a flight in German: every line of the catalogue comes out as it stands there, and fits on the page."""

from __future__ import annotations

import json
import re

import pytest
from playwright.async_api import expect

from executor.adapters.web.page_server import STATIC
from tests.e2e.browser import IN_CHROMIUM, browsing
from tests.e2e.gallery import LAYOUTS, Shown, scene_of
from tests.e2e.test_gallery import BEYOND

pytestmark = IN_CHROMIUM

HOLE = re.compile(r"\{(\w*)(?:!\w)?(?::([^}]*))?\}")
TRANSLATED = """async ([catalogue, texts]) => {
  const { learn, translate } = await import("/files/translation.js");
  learn("de", catalogue);
  return texts.map(translate);
}"""


def fill(words: str, values: dict[str, str]) -> str:
    """Return a line with values: figures where it has figures, and else words that nobody knows."""

    def value_of(hole: re.Match[str]) -> str:
        kind = hole[2] or ""
        return values.setdefault(hole[1], "7" if kind.endswith("d") else "12.5" if kind else f"V{len(values)}")

    return HOLE.sub(value_of, words)


async def test_every_line_of_the_catalogue_is_recognised_with_its_values() -> None:
    catalogue = json.loads(STATIC.joinpath("lines-de.json").read_text(encoding="utf-8"))
    filled = []
    for words, text in catalogue.items():
        values: dict[str, str] = {}
        filled.append((fill(words, values), text, values))
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address) as page:
            found = await page.evaluate(TRANSLATED, [catalogue, [one for one, _, _ in filled]])
    wanted = [HOLE.sub(lambda hole: values[hole[1]].replace("12.5", "12,5"), text) for _, text, values in filled]  # noqa: B023
    assert [pair for pair in zip(found, wanted, strict=True) if pair[0] != pair[1]] == []


@pytest.mark.parametrize(
    ("text", "german"),
    [
        (
            "uav1: landed with 40 % away from its pad, 49.59841, -15.60000 (GPS, 3 m)",
            "uav1: gelandet mit 40 % abseits seines Startplatzes, 49.59841, -15.60000 (GPS, 3 m)",
        ),
        (
            "re-plan 2: 5 segments (uav2: link lost for 12.3 s, time-out 8 s); planning for a and b",
            "Umplanung 2: 5 Spannfelder (uav2: Verbindung seit 12,3 s verloren, Frist 8 s); geplant wird für a und b",
        ),
        (
            "re-plan window 100 %: from 0 s the fleet can absorb the loss of any one vehicle",
            "Umplan-Fenster 100 %: ab 0 s kann die Flotte den Ausfall eines beliebigen Geräts auffangen",
        ),
        (
            "uav1: ready, quadrotor, ArduPilot 4.6.1, battery 98 %",
            "uav1: bereit, Quadrokopter, ArduPilot 4.6.1, Akku 98 %",
        ),
        ("uav1 says: PreArm: no position", "uav1 sagt: PreArm: no position"),
        ("expected less than or equal to 15, got 20", "erwartet: höchstens 15, ist: 20"),
        ("what nobody knows: it stays, of course", "what nobody knows: it stays, of course"),
    ],
)
async def test_a_line_that_is_made_of_others_is_read_part_by_part(text: str, german: str) -> None:
    catalogue = json.loads(STATIC.joinpath("lines-de.json").read_text(encoding="utf-8"))
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(address) as page:
            assert await page.evaluate(TRANSLATED, [catalogue, [text]]) == [german]


@pytest.mark.parametrize("layout", LAYOUTS)
async def test_the_page_speaks_german_and_goes_back_to_english(layout: str) -> None:
    size = LAYOUTS[layout]
    with Shown(scene_of("flying")).serving() as address:
        async with browsing(f"{address}?lang=de", size) as page:
            await expect(page.locator("html")).to_have_attribute("lang", "de")
            await expect(page.locator(".strip")).to_have_count(3)
            await expect(page.locator("#fleet [data-action=replan]")).to_contain_text("Jetzt umplanen")
            await expect(page.locator(".strip .route").first).to_contain_text("geflogen")
            await expect(page.locator(".strip .state").first).to_have_text("im Flug")
            assert await page.evaluate("document.documentElement.scrollWidth") <= size[0]
            assert await page.evaluate(BEYOND) == []
            await page.locator("#language").select_option("en")
            await expect(page.locator("#fleet [data-action=replan]")).to_contain_text("Re-plan now")


async def test_the_question_before_the_take_off_is_asked_in_german() -> None:
    with Shown(scene_of("before-take-off")).serving() as address:
        async with browsing(f"{address}?lang=de") as page:
            await page.locator("#agree").click()
            await expect(page.locator("#meaning")).to_contain_text("Alle mit einer Route starten jetzt.")
            await expect(page.locator("#yes")).to_have_text("Ja")
