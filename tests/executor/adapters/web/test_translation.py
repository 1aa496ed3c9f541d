"""What the program says in another language: every line that readers of its pages see, and nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from string import Formatter

import pytest
from pydantic_core import PydanticKnownError

from executor.adapters.web.page_server import STATIC
from tests.executor.adapters.web.spoken import HAS_WORDS, counted_things, crew_lines, sentences
from tests.test_architecture import ROOT, modules

LANGUAGES = ("de",)
UNREAD = (
    # Whose lines are read in the terminal, in a report or in a picture alone.
    "executor/cli", "executor/replay", "executor/images", "executor/analysis/flight_record.py",
    "executor/analysis/height_profile.py", "executor/analysis/pictures", "executor/analysis/report",
    "executor/simulated", "executor/adapters/logs", "executor/adapters/mavlink/tlog_", "executor/adapters/mqtt",
    "executor/adapters/templates",
    "executor/flight/flight_recorder.py", "executor/flight/open_links.py", "executor/flight/restore_vehicles.py",
    "executor/flight/resume_flight.py", "executor/site/campaigns.py", "missions/exports",
    "planner/bounds.py", "planner/coverage.py", "planner/exact.py", "planner/grasp.py", "planner/risk.py",
    # Whose texts say what a code means, or what comes before what, for the reference; or are words in files.
    "executor/core/fleet_step.py", "executor/core/interface/codes.py", "executor/core/interface/intents.py",
    "executor/core/state/vehicle_state.py", "executor/core/telemetry/message_update.py",
    "executor/core/telemetry/mode_evidence.py", "missions/readers/attributes.py", "missions/readers/values.py",
    # Whose texts are for who calls them.
    "planner/kernels", "planner/model.py", "planner/moves.py", "planner/robust_search.py", "planner/solve.py",
    "planner/sorties", "planner/stop_rules.py", "planner/window_search.py",
    # Whose lines are put together there: they are read as they come out, by `crew_lines`.
    "executor/core/lines",
)  # fmt: skip
"""Whose texts no reader of a page sees; every other module's have their words in each language."""
NO_WORDS = re.compile(
    r"[\\+]|^SELECT|[\[(]\w[^ ]*$|^(Preflight Fail|Arming denied).$|page: http|^cost\.value|duration_s|energy_pct|"
    r"^\S+: \{error\}$|\[inspection\] heights|charset=|-src |^PRAGMA|no-cache|^EntityRef|^us survey|^timed out$|"
    r"^(Anafi|Copernicus|Matrice|Mavic|Skydio) |^backend = |^: depot: $|^page: \{|"
    r"plan page$|^What the plan page "
)
"""What is for no reader: patterns, queries, headers, what autopilots and servers say, names, and keys."""
PYDANTIC = (
    ("less_than_equal", {"le": 1}), ("greater_than_equal", {"ge": 1}), ("less_than", {"lt": 1}),
    ("greater_than", {"gt": 1}), ("multiple_of", {"multiple_of": 1}), ("finite_number", None),
    ("string_pattern_mismatch", {"pattern": "x"}), ("string_too_short", {"min_length": 1}),
    ("string_too_long", {"max_length": 1}), ("too_short", {"field_type": "", "min_length": 1, "actual_length": 1}),
    ("too_long", {"field_type": "", "max_length": 1, "actual_length": 1}),
)  # fmt: skip
"""What a check of the site file says in pydantic's own words."""
FLIGHT_PAGE = (
    "assets.js", "briefing.js", "chart.js", "freshness.js", "ground.js", "intents.js", "offers.js", "page.js",
    "strips.js", "words.js",
)  # fmt: skip
SAY = re.compile(r'\b(?:say|sayCount)\(((?:[^()"]|"[^"]*"|\([^()]*\))*)')
TEXT = re.compile(r'"([^"]*[A-Za-z][^"]*)"')
IN_TABLES = re.compile(r'"([A-Z][a-z]*(?: [^"<>]+)?)"')
"""Words that a table of the page has for a state, or an order."""


KEYS_OF_BROWSERS = {"A", "B", "D", "H", "I", "L", "N", "R", "S", "W", "X", "Enter", "Escape", "GPS", "POST", "Tab"}


@cache
def catalogue(name: str) -> dict[str, str]:
    found = json.loads(STATIC.joinpath(name).read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


@cache
def said() -> frozenset[str]:
    """Return every text of the program that could be shown."""
    paths = [*modules("executor"), *modules("missions"), *modules("planner")]
    return frozenset((*crew_lines(), *counted_things(paths), *(text for path in paths for text in sentences(path))))


def pydantic_words() -> Iterator[str]:
    for kind, context in PYDANTIC:
        text = PydanticKnownError(kind, context).message_template  # type: ignore[arg-type]
        words = re.sub(r"^(\w+|\{field_type\}) should (be |have )?", "", text)
        yield from (words.replace("{expected_plural}", ending) for ending in ("", "s"))


def read_by_people() -> Iterator[str]:
    """Yield every text that has to have its words in each language."""
    yield from crew_lines()
    yield from pydantic_words()
    read = [path for path in modules("executor") + modules("missions") + modules("planner")
            if not path.relative_to(ROOT).as_posix().startswith(UNREAD)]  # fmt: skip
    yield from counted_things(read)
    yield from (text for path in read for text in sentences(path) if not NO_WORDS.search(text))


def names(text: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(text) if name}


class Words(HTMLParser):
    """Collects the words of a document."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()
        self._tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._tags.append(tag)
        self.found |= {value for name, value in attrs if name in {"aria-label", "title", "placeholder"} and value}

    def handle_endtag(self, tag: str) -> None:
        while self._tags and self._tags.pop() != tag:
            pass  # of a tag that has no end

    def handle_data(self, data: str) -> None:
        if self._tags and self._tags[-1] not in {"kbd", "title", "h1"}:
            self.found.add(data.strip())


def words_of_flight_page() -> set[str]:
    """Return what the page of a flight says of itself."""
    page = Words()
    page.feed(STATIC.joinpath("page.html").read_text(encoding="utf-8").partition("<body>")[2])
    strips = STATIC.joinpath("strips.js").read_text(encoding="utf-8")
    page.feed(strips.partition("TEMPLATE = `")[2].partition("`")[0])
    found = {words for words in page.found if HAS_WORDS.search(words)}
    for file in FLIGHT_PAGE:
        text = STATIC.joinpath(file).read_text(encoding="utf-8")
        found |= {one for part in SAY.findall(text) for one in TEXT.findall(part)}
        found |= {one for one in IN_TABLES.findall(text) if one not in KEYS_OF_BROWSERS}
    return found


def tables_of_flight_page() -> str:
    """Return the sources whose tables have words that are said by a name."""
    return "\n".join(STATIC.joinpath(file).read_text(encoding="utf-8") for file in FLIGHT_PAGE)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_line_that_a_page_shows_has_its_words_in_every_language(language: str) -> None:
    known = catalogue(f"lines-{language}.json")
    wanted = {text for text in read_by_people() if HAS_WORDS.search(re.sub(r"\{[^}]*\}", "", text))}
    assert sorted(wanted - set(known)) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_translation_is_used(language: str) -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in modules("executor") + modules("missions"))
    idle = [
        text for text in catalogue(f"lines-{language}.json")
        if text not in said() and text not in set(pydantic_words())
        and f'"{text}"' not in sources and f"'{text}'" not in sources
    ]  # fmt: skip
    assert idle == []


@pytest.mark.parametrize("name", [f"{kind}-{language}.json" for kind in ("lines", "page") for language in LANGUAGES])
def test_a_line_has_the_same_values_in_every_language(name: str) -> None:
    assert {words for words, text in catalogue(name).items() if names(words) != names(text)} == set()
    assert all(text.strip() for text in catalogue(name).values())


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_page_of_a_flight_has_its_words_in_every_language(language: str) -> None:
    known = catalogue(f"page-{language}.json")
    tables = tables_of_flight_page()
    assert sorted(words_of_flight_page() - set(known)) == []
    idle = [words for words in known if words not in words_of_flight_page()]
    assert [words for words in idle if not re.search(rf"\b{re.escape(words.replace(' ', '_'))}\b", tables)
            and f'"{words}"' not in tables] == []  # fmt: skip


@pytest.mark.parametrize("language", LANGUAGES)
def test_words_of_both_catalogues_mean_the_same(language: str) -> None:
    page, lines = catalogue(f"page-{language}.json"), catalogue(f"lines-{language}.json")
    assert {
        words: (page[words], lines[words]) for words in page.keys() & lines.keys() if page[words] != lines[words]
    } == {}
