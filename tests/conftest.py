"""What holds for every test."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings

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
    """Add `--quick` and `--rest`, as `./scripts/test` gives them."""
    parser.addoption("--quick", action="store_true", help="Leave out the tests that tests/slow.txt lists.")
    parser.addoption("--rest", action="store_true", help="Run these alone, and what hypothesis has more examples for.")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests for `--quick`, the others for `--rest`; new ones are quick until their time is known."""
    quick = config.getoption("--quick")
    if not quick and not config.getoption("--rest"):
        return
    listed = set(SLOW.read_text(encoding="utf-8").splitlines())
    wanted, left_out = list[pytest.Item](), list[pytest.Item]()
    for item in items:
        slow, is_property = slow_name(item) in listed, is_hypothesis_test(getattr(item, "obj", None))
        (wanted if (not slow if quick else slow or is_property) else left_out).append(item)
    config.hook.pytest_deselected(items=left_out)
    items[:] = wanted


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let virtual time jump as soon as nothing is ready to run.

    looptime turns the idle loop 42 times before each jump, in case another thread or a socket has news; these tests
    have neither, and most of their time went there.
    """
    if item.get_closest_marker("looptime") is not None:
        item.add_marker(pytest.mark.looptime(noop_cycles=0))


def slow_name(item: pytest.Item) -> str:
    """Return a test's name without its parameters: they are left out together."""
    return item.nodeid.partition("[")[0]


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Look for the programs that a test says it needs."""
    for mark in item.iter_markers("needs"):
        need(*mark.args)
