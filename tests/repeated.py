"""A pytest plugin, `-p tests.repeated`: every test FAULTLINE_RUNS times, all of them once before any again."""

from __future__ import annotations

import os

import pytest


@pytest.fixture
def run_number(request: pytest.FixtureRequest) -> int:
    """Give a test the number of its run, from 0."""
    return int(request.param)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Repeat a test."""
    metafunc.fixturenames.append("run_number")
    metafunc.parametrize("run_number", range(int(os.environ["FAULTLINE_RUNS"])), indirect=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the first run of all tests first."""
    items.sort(key=lambda item: item.callspec.params["run_number"])  # type: ignore[attr-defined]
