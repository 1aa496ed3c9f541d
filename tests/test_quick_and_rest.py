"""`./scripts/test` and `./scripts/test rest` run every test between them, and properties twice: first in small."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import SLOW, pytest_collection_modifyitems


@given(st.integers())
def a_property(_: int) -> None:
    """Hold for every number."""


def chosen(option: str) -> list[str]:
    slow = SLOW.read_text(encoding="utf-8").split()[0]
    items: list[Any] = [
        SimpleNamespace(nodeid=f"{slow}[ardupilot]", obj=chosen),
        SimpleNamespace(nodeid="tests/test_new.py::test_one", obj=chosen),
        SimpleNamespace(nodeid="tests/test_new.py::test_property", obj=a_property),
        SimpleNamespace(nodeid="docs/page.md::example"),
    ]
    hook = SimpleNamespace(pytest_deselected=lambda items: None)
    config: Any = SimpleNamespace(getoption=lambda name: name == option, hook=hook)
    pytest_collection_modifyitems(config, items)
    return [item.nodeid.rpartition("::")[2] for item in items]


@pytest.mark.parametrize(
    ("option", "count"), [("", 4), ("--quick", 3), ("--rest", 2)], ids=["all", "quick", "rest"]
)  # fmt: skip
def test_between_them_they_run_everything(option: str, count: int) -> None:
    assert len(chosen(option)) == count


def test_properties_are_in_both() -> None:
    assert "test_property" in chosen("--quick")
    assert "test_property" in chosen("--rest")
