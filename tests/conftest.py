"""What holds for every test."""

from __future__ import annotations

import asyncio
import signal

from hypothesis import settings

settings.register_profile("faultline", deadline=None, derandomize=True)
settings.load_profile("faultline")

# Before Python 3.12 asking for the main thread's event loop makes one, once, which pytest-asyncio then leaves open: a
# ResourceWarning in some later test. Nobody here wants that loop.
asyncio.set_event_loop(None)

# A shell that starts the tests in the background has Ctrl-C ignored, which every process started by them would inherit.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
