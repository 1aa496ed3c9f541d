"""Every key of the site file counts in every way into a flight, as docs/reference/site-keys.md says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.executor.site.keys import ENVIRONMENT, KEYS, WAYS, compare, write_files
from tests.test_architecture import ROOT

PAGE = (ROOT / "docs/reference/site-keys.md").read_text(encoding="utf-8")
SAID = {
    match[1]: dict(zip(WAYS, match[2].split(" | "), strict=True))
    for match in re.finditer(r"^\| `([a-z0-9_.]+)` \| (.+) \|$", PAGE, re.MULTILINE)
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("site")
    write_files(made)
    return made


@pytest.mark.parametrize("key", KEYS)
def test_a_key_counts_where_the_page_says(key: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ENVIRONMENT.items():
        monkeypatch.setenv(name, value)
    assert compare(key, folder) == SAID[key.replace("[0]", "")]


def test_the_page_has_every_key_of_the_site_file() -> None:
    site_file = (ROOT / "docs/reference/site-file.md").read_text(encoding="utf-8")
    keys, table = set[str](), ""
    for line in site_file.splitlines():
        if found := re.match(r"## `\[+([a-z_.]+)\]+`", line):
            table = found[1]
        elif found := re.match(r"\| `([a-z0-9_]+)` \|", line):
            keys.add(f"{table}.{found[1]}")
    assert {key.replace("[0]", "") for key in KEYS} == set(SAID) == keys
