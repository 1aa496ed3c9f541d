"""Names: one for one thing, and a function is a verb with its object, or the quantity that it returns.

What is defined more than once across the packages stands here, with its reason.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("faultline", "planner", "missions", "simulator", "executor", "benchmarks")
APART = ("faultline/", "simulator/", "executor/cli/", "benchmarks/")
"""The simulator shares nothing with what flies it: it speaks the same protocol in words of its own. A function of the
command line is called as the agreement calls its command, and so is one of the library. Benchmarks are never imported
by what they measure."""
REASONS = {
    "Mode": "each simulated autopilot has its own",
    "land_goal": "each simulated autopilot has its own",
    "make": "what every part of the measurements has",
    "report": "what every part of the measurements has",
}

COPIES_AND_HANDLERS = frozenset({"with", "without", "from", "to", "on"})
"""Prefixes that Python has for a changed copy, another way to construct, a conversion and what handles an event."""
PARTICIPLES = frozenset(
    [
        "begun",
        "built",
        "caught",
        "done",
        "given",
        "gone",
        "heard",
        "kept",
        "known",
        "led",
        "lent",
        "left",
        "lost",
        "made",
        "meant",
        "met",
        "said",
        "seen",
        "sent",
        "shown",
        "sold",
        "sought",
        "spent",
        "sunk",
        "taken",
        "taught",
        "thought",
        "thrown",
        "told",
        "won",
        "worn",
        "written",
    ]
)
NO_VERBS = frozenset(
    [
        "again",
        "all",
        "already",
        "alike",
        "also",
        "any",
        "anew",
        "anybody",
        "apart",
        "aside",
        "at",
        "away",
        "before",
        "behind",
        "besides",
        "between",
        "both",
        "by",
        "early",
        "every",
        "everybody",
        "how",
        "in",
        "instead",
        "late",
        "meanwhile",
        "no",
        "nobody",
        "not",
        "nothing",
        "of",
        "once",
        "only",
        "over",
        "since",
        "somebody",
        "soon",
        "still",
        "together",
        "until",
        "what",
        "when",
        "where",
        "which",
        "who",
        "whom",
        "whose",
        "why",
        "within",
    ]
)
THIRD_PERSON = frozenset(
    [
        "becomes",
        "begins",
        "belongs",
        "breaks",
        "brings",
        "carries",
        "comes",
        "crosses",
        "does",
        "ends",
        "falls",
        "feels",
        "finds",
        "fits",
        "flies",
        "follows",
        "gets",
        "gives",
        "goes",
        "holds",
        "hovers",
        "includes",
        "keeps",
        "knows",
        "lands",
        "leads",
        "leaves",
        "lies",
        "lives",
        "loses",
        "makes",
        "matches",
        "meets",
        "names",
        "needs",
        "reaches",
        "reads",
        "says",
        "sees",
        "sends",
        "serves",
        "shows",
        "sinks",
        "speaks",
        "stands",
        "stays",
        "suits",
        "takes",
        "tells",
        "turns",
        "uses",
        "waits",
        "wants",
        "works",
    ]
)
PERSONS = frozenset([
    "anybody", "everybody", "nobody", "somebody", "who", "whom", "whose", "they", "them", "we", "boat", "craft",
    "mast", "tower", "mistake", "mistakes", "thing", "things", "stuff", "wish",
])  # fmt: skip
"""Against the glossary: machines are vehicles, lines hang on pylons, what an operator asks for is an intent."""
QUANTITIES = frozenset({"cost", "energy", "m", "pct", "s", "share", "value", "wh"})
"""What the name of a quantity ends in: a participle may lead it, as in `induced_velocity_m_s`."""
ENDS_IN_ED = frozenset({"embed", "exceed", "feed", "need", "proceed", "seed", "speed"})


def defined() -> Iterator[tuple[str, str]]:
    """Yield every public name at the top of a module, with its file."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                match node:
                    case ast.ClassDef(name) | ast.FunctionDef(name) | ast.AsyncFunctionDef(name) if name[0] != "_":
                        yield name, str(path.relative_to(ROOT))


def twice() -> dict[str, list[str]]:
    """Return the names that two rooms define, or one room that keeps apart defines twice."""
    found: dict[str, list[str]] = defaultdict(list)
    for name, file in defined():
        found[name].append(file)
    rooms = {
        name: [next((one for one in APART if file.startswith(one)), "") for file in files]
        for name, files in found.items()
    }
    return {name: found[name] for name, where in rooms.items() if len(where) > len(set(where))}


def test_no_name_is_defined_twice_without_a_reason() -> None:
    assert {name: files for name, files in twice().items() if name not in REASONS} == {}


def test_every_reason_is_of_a_name_that_is_there_twice() -> None:
    assert set(REASONS) <= set(twice())


def functions() -> Iterator[tuple[str, str]]:
    """Yield the name of every function and method with its file, but properties, `__dunder__` and inner functions."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            module = ast.parse(path.read_text(encoding="utf-8"))
            for body in (module.body, *(node.body for node in ast.walk(module) if isinstance(node, ast.ClassDef))):
                for node in body:
                    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not is_attribute(node):
                        yield node.name, f"{path.relative_to(ROOT)}:{node.lineno}"


def is_attribute(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Return whether nobody calls it by its name: a property, or a method that Python calls."""
    return function.name.startswith("__") or any("property" in ast.unparse(one) for one in function.decorator_list)


def is_named_as_a_function(name: str) -> bool:
    """Return whether a verb or a quantity can lead a name, which no participle, adverb or third person can."""
    words = name.strip("_").split("_")
    first = words[0]
    if first not in NO_VERBS and words[-1] in QUANTITIES:
        return True
    if first in COPIES_AND_HANDLERS:
        return len(words) > 1
    if first in PARTICIPLES | NO_VERBS | THIRD_PERSON:
        return False
    return not first.endswith("ed") or first in ENDS_IN_ED


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("find_survivors", True),
        ("_power_w", True),
        ("with_pack", True),
        ("on_message", True),
        ("seed_walk", True),
        ("told", False),
        ("over", False),
        ("looked_at", False),
        ("of_all", False),
        ("flies_to", False),
        ("who_flies", False),
        ("_without", False),
    ],
)
def test_what_a_name_must_not_begin_with(name: str, expected: bool) -> None:
    assert is_named_as_a_function(name) is expected


def test_functions_are_a_verb_and_its_object_or_the_quantity_that_they_return() -> None:
    assert [f"{where} {name}" for name, where in functions() if not is_named_as_a_function(name)] == []


def test_no_function_or_class_has_a_word_against_the_glossary() -> None:
    found = []
    for name, file in [*defined(), *functions()]:
        words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().strip("_").split("_")
        found += [f"{file}: {name}"] if PERSONS & set(words) else []
    assert found == []
