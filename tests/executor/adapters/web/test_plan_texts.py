"""The words of the plan page: every language has all of them, and no other."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from string import Formatter
from typing import Any

import pytest

from executor.adapters.web.page_server import STATIC
from executor.site.site_file import Site

LANGUAGES = ("en", "de")
HIDDEN = ("learned", "area.polygon", "area.line")
"""Keys of the site file that the page has no field for."""
STEPS = {"depot", "network", "inspection", "energy", "area", "place", "vehicle", "camera", "look", "day", "base"}
"""Tables that have a step of their own, or are lists in one."""
USES = re.compile(r"""\b(say|count)\(\s*(?:(["'])(?P<plain>[^"']+)\2|`(?P<made>[^`]+)`)""")
CHOSEN = re.compile(r"""\b(?:say|count)\([^()]*\?\s*"([^"]+)"\s*:\s*"([^"]+)"[,)]""")
"""One of two keys."""
PLACES = re.compile(r'data-(?:text|name|hint)="([^"]+)"')
PARTS = re.compile(r"\$\{[^}]*\}")


@cache
def catalogue(name: str) -> dict[str, Any]:
    found = json.loads(STATIC.joinpath(name).read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


def sources() -> Iterator[tuple[str, str]]:
    for file in STATIC.iterdir():
        if file.name.startswith("plan") and file.name.endswith((".js", ".html")):
            yield file.name, file.read_text(encoding="utf-8")


def uses() -> Iterator[tuple[str, str]]:
    """Yield each key that the page asks for, as a pattern, with its file."""
    for name, text in sources():
        for found in PLACES.findall(text):
            yield name, re.escape(found)
        for found in CHOSEN.findall(text):
            yield from ((name, re.escape(one)) for one in found)
        for found in USES.finditer(text):
            made = found["plain"] or found["made"]
            pattern = ".+".join(re.escape(part) for part in PARTS.split(made))
            if pattern != r".+\..+":  # `count` itself, which puts a key together
                yield name, pattern + (r"\.(one|many)" if found[1] == "count" else "")


def site_keys() -> Iterator[str]:
    """Yield each key of the site file."""
    schema = Site.model_json_schema()

    def resolve(part: dict[str, Any]) -> dict[str, Any]:
        while True:
            rest = [one for one in part.get("anyOf", ()) if one.get("type") != "null"]
            if "$ref" in part:
                part = schema["$defs"][part["$ref"].rpartition("/")[2]]
            elif len(rest) == 1:
                part = rest[0]
            else:
                return part

    def walk(part: dict[str, Any], way: str) -> Iterator[str]:
        for key, value in part.get("properties", {}).items():
            own = resolve(value)
            item = resolve(own["items"]) if "items" in own else own
            yield way + key
            yield from walk(item, f"{way}{key}.")

    return walk(schema, "")


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_language_has_the_same_texts_with_the_same_values(language: str) -> None:
    def values(text: str) -> set[str]:
        return {name for _, name, _, _ in Formatter().parse(text) if name}

    own, first = catalogue(f"plan-texts-{language}.json"), catalogue("plan-texts-en.json")
    assert list(own) == list(first)
    assert {key: values(text) for key, text in own.items()} == {key: values(text) for key, text in first.items()}
    assert all(text.strip() for text in own.values())


def test_every_text_that_the_page_asks_for_is_there() -> None:
    known = catalogue("plan-texts-en.json")
    missing = [(name, use) for name, use in uses() if not any(re.fullmatch(use, key) for key in known)]
    assert missing == []


def test_no_text_is_left_that_the_page_never_asks_for() -> None:
    asked = [re.compile(use) for _, use in uses()]
    quoted = "\n".join(text for _, text in sources())
    idle = [
        key for key in catalogue("plan-texts-en.json")
        if not any(use.fullmatch(key) for use in asked) and f'"{key}"' not in quoted
    ]  # fmt: skip
    assert idle == []


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_field_is_named_and_explained_in_every_language(language: str) -> None:
    known = catalogue(f"plan-fields-{language}.json")
    wanted = {key for key in site_keys() if not key.startswith(HIDDEN) and key not in STEPS}
    assert wanted - set(known) == set()
    assert [key for key, words in known.items() if len(words) != 2 or not all(words)] == []


def test_english_names_fields_and_leaves_their_meaning_to_the_schema() -> None:
    known = catalogue("plan-fields-en.json")
    assert set(known) - set(site_keys()) == set()
    assert [key for key, words in known.items() if len(words) != 2 or not words[0] or words[1]] == []


def test_no_script_and_no_style_stands_in_the_page() -> None:
    page = STATIC.joinpath("plan.html").read_text(encoding="utf-8")
    assert re.findall(r"<script(?![^>]*\bsrc=)|<style|\son\w+=|\sstyle=", page) == []
    for name, text in sources():
        assert "innerHTML" not in text, name
        assert "insertAdjacentHTML" not in text, name
