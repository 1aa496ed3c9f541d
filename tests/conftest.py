"""What holds for every test."""

from __future__ import annotations

import asyncio
import signal

import pytest
from hypothesis import settings

from tests.programs import need

settings.register_profile("faultline", deadline=None, derandomize=True)
settings.load_profile("faultline")

# Before Python 3.12 asking for the main thread's event loop makes one, once, which pytest-asyncio then leaves open: a
# ResourceWarning in some later test. Nobody here wants that loop.
asyncio.set_event_loop(None)

# Whoever starts the tests in the background, or with nohup, has these ignored, which every process would inherit.
for name, usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Look for the programs that a test says it needs."""
    for mark in item.iter_markers("needs"):
        need(*mark.args)
