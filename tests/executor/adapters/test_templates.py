"""Pages: values in words, and that nothing from outside becomes markup."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.adapters.templates import format_value, render_template, write_page


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "unknown"),
        (False, "no"),
        (7, "7"),
        (9.994, "9.99"),
        (211.44, "211.4"),
        ([], "none"),
        ((3, True), "3, yes"),
    ],
)
def test_values_in_words(value: object, words: str) -> None:
    assert format_value(value) == words


def test_markup_of_others_is_text(tmp_path: Path) -> None:
    evil = "<script>1 & 2</script>\ud83d"
    page = tmp_path / "page.html"
    write_page(page, render_template("report_pictures.html", shown=[(_Asset(evil), [])], width_px=1))
    text = page.read_text(encoding="utf-8")
    assert "<script>" not in text
    assert text.count("&lt;script&gt;1 &amp; 2&lt;/script&gt;&#55357;") == 2


class _Asset:
    def __init__(self, name: str) -> None:
        self.name, self.rows, self.matches, self.taken = name, (), (), 0
