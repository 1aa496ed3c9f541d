"""What holds for every test."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from pathlib import Path

import pytest
from hypothesis import settings

from planner import stop_rules
from tests.programs import need

settings.register_profile("quick", deadline=None, derandomize=True, max_examples=25)
settings.register_profile("all", deadline=None, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "all"))

# Before Python 3.12 asking for the main thread's event loop makes one, once, which pytest-asyncio then leaves open: a
# ResourceWarning in some later test. Nobody here wants that loop.
asyncio.set_event_loop(None)

# Whoever starts the tests in the background, or with nohup, has these ignored, which every process would inherit.
for name, usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)


# A search that stops after some seconds finds less on a busy computer: in tests it gets that much of a processor.
stop_rules.clock_s = time.process_time

SLOW = Path(__file__).with_name("slow.txt")
"""Tests that took long when durations were last recorded, by `python -m tests.durations`."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--quick`, as `./scripts/test` gives it."""
    parser.addoption("--quick", action="store_true", help="Leave out the tests that tests/slow.txt lists.")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out slow tests where `--quick` is given; new ones run until their duration is recorded."""
    if not config.getoption("--quick"):
        return
    listed = set(SLOW.read_text(encoding="utf-8").splitlines())
    left_out = [item for item in items if slow_name(item) in listed]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if slow_name(item) not in listed]


def slow_name(item: pytest.Item) -> str:
    """Return a test's name without its parameters: they are left out together."""
    return item.nodeid.partition("[")[0]


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Look for the programs that a test says it needs."""
    for mark in item.iter_markers("needs"):
        need(*mark.args)
