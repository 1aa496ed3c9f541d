"""Lines, help texts, docstrings and documents speak the field's language: RTL, link lost, declared lost, read-back."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_architecture import PACKAGES, ROOT, modules

RIDDLES = (
    "of all chance",
    "what the wind makes of",
    "it is not heard",
    "not heard any more",
    "nobody is heard",
    "is heard again",
    "are heard again",
    "heard again, it",
    "without asking",
    "told to return",
    "told to land",
    "told to hold",
    "told to disarm",
    "told to go on",
    "its own return",
    "return is set to",
    "without us it",
    "of silence;",
    "s of silence",
    "silent for {",
    "nothing heard for",
    "nothing was heard from",
    "fell silent",
    "falls silent",
    "silent at once",
    "a silent one",
    "was given up that was well",
    "cannot be told from a busy computer",
    "who does not acknowledge",
    "taken to be away",
    "without that anybody",
    "given to the others",
    "the others are given",
    "read back the same",
    "reads back differently",
    "whoever",
    "planned anew for it",
    "everybody is told",
    "sends everybody home",
    "everybody was sent home",
    "taken to be {",
    "as no vehicle stands",
    "calls its battery",
    "a mixture of two",
    "started anew",
    "any one vehicle may be lost",
    "asked distance (",
    "at the asked distance;",
    "nobody else comes to",
    "takes off once its mission is on board",
    "its rtl is straight",
    "when it is well",
    "a re-plan would share the others",
    "as the budgets on board last for",
    "does not last for all that",
    "without what others fly or have flown",
    "slower, not different",
    "is it our own radio",
    "was thought to be {",
    "planning around it",
    "is flown but not seen",
    "before it was told to stay",
    "internal mistake",
    "by whom nothing says",
    "not read, or not used",
    "use the budgets up",
    "by the operator's word",
    "by its own word",
    "nothing says who",
    "which is waited for",
    "what they say is mixed",
    "its heartbeat says",
    "clearance is too old",
    "the operator did not say yes",
    "take this flight up again",
    "what could hurt",
)
"""Never in a text of the product, in any case of letters."""


def texts_of(path: Path) -> Iterator[str]:
    """Yield every string and docstring of a module; in a formatted one, `{` stands for what is put in."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def riddles(text: str) -> list[str]:
    """Return what a text has that no line of the field has."""
    plain = re.sub(r"\s+", " ", text).lower()
    return [riddle for riddle in RIDDLES if riddle in plain]


@pytest.mark.parametrize("package", PACKAGES)
def test_the_product_speaks_the_fields_language(package: str) -> None:
    found = {str(path.relative_to(ROOT)): riddles("\n".join(texts_of(path))) for path in modules(package)}
    assert {name: words for name, words in found.items() if words} == {}


def test_so_do_the_page_and_the_documents() -> None:
    page = [*(ROOT / "executor" / "adapters" / "web" / "static").glob("*.*s"), *ROOT.glob("executor/**/*.html")]
    documents = [ROOT / "README.md", ROOT / "ARCHITECTURE.md", *(ROOT / "docs").rglob("*.md")]
    found = {path.name: riddles(path.read_text(encoding="utf-8")) for path in (*page, *documents)}
    assert len(page) > 5
    assert {name: words for name, words in found.items() if words} == {}
