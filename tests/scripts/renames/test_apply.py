"""Renames by a list: where a name is defined, and what is written. The language server itself is not started here."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.renames.apply import ROOT, locate, write_edits

MODULE = '''class Link:
    """A link."""

    def told(self) -> str:
        return "é told"


def over(link: Link) -> str:
    return link.told()
'''


def test_a_definition_is_located(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text(MODULE, encoding="utf-8")
    assert locate(module, "Link") == (0, 6)
    assert locate(module, "Link.told") == (3, 8)
    assert locate(module, "over") == (7, 4)
    with pytest.raises(LookupError, match=r"module.py: expected a definition of Link.heard"):
        locate(module, "Link.heard")


def test_edits_of_one_line_do_not_shift_each_other(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text('é = told(told("x"))\n', encoding="utf-8")
    assert write_edits({module: {(0, 4, 8): "report", (0, 9, 13): "report"}}) == 2
    assert module.read_text(encoding="utf-8") == 'é = report(report("x"))\n'


@pytest.mark.parametrize("name", ["core", "executor", "others"])
def test_a_list_names_files_that_are_there(name: str) -> None:
    lines = (ROOT / "scripts" / "renames" / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    words = [line.partition("#")[0].split() for line in lines]
    assert all(len(pair) == 2 and pair[1].isidentifier() for pair in words if pair)
    assert sum(bool(pair) for pair in words) > 800
