"""Keep background tasks running, and report their internal errors, one line for each kind.

Errors go to the event loop's own exception handler, which also gets asyncio's reports; `watch_internal_errors` installs
one that sends the crew a line and keeps the traceback in a file.
"""

from __future__ import annotations

import asyncio
import threading
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import Any

WAITS_S = (0.1, 1.0, 2.0, 5.0, 15.0)
"""Real seconds before each restart of a failed task; the last value repeats."""
AT_ONCE_S = 0.02
"""Pause for tasks that the flight depends on: restart at once, but a task that fails in every round must not block the
processor."""
STEADY_S = 30.0
"""Real seconds without a failure after which the pauses start anew."""
FILE = "mistakes.txt"
"""File of the tracebacks in a run directory."""

Work = Callable[[], Awaitable[None]]


def report_internal_error(what: str, error: BaseException, *, said: bool = False) -> None:
    """Report an internal error to the handler; `said` if the crew knows of it already."""
    with suppress(RuntimeError):  # without a loop there is no handler
        asyncio.get_running_loop().call_exception_handler({"message": what, "exception": error, "said": said})


def call_safely(what: str, work: Callable[..., object], *arguments: object) -> None:
    """Run a function whose errors must not end its caller."""
    try:
        work(*arguments)
    except Exception as error:  # noqa: BLE001 - the boundary that this function is
        report_internal_error(what, error)


async def keep_going(what: str, work: Work, *, at_once: bool = False) -> None:
    """Run a task, and restart it after every error, until it ends normally or is cancelled."""
    loop, attempt = asyncio.get_running_loop(), 0
    while True:
        began_s = loop.time()
        try:
            await work()
        except Exception as error:  # noqa: BLE001 - the boundary that this function is
            report_internal_error(what, error)
        else:
            return
        attempt = 1 if loop.time() - began_s > STEADY_S else attempt + 1
        await asyncio.sleep(AT_ONCE_S if at_once else WAITS_S[min(attempt, len(WAITS_S)) - 1])


@asynccontextmanager
async def run_beside(what: str, work: Work, *, at_once: bool = False) -> AsyncIterator[None]:
    """Keep a task running for as long as the block runs."""
    task = asyncio.create_task(keep_going(what, work, at_once=at_once), name=what)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


class InternalErrorReporter:
    """Report every kind of error once, and keep its traceback; an event loop's exception handler."""

    def __init__(self, say: Callable[[str], None], keep: Callable[[str], None]) -> None:
        """Set the receivers of the lines and of the tracebacks."""
        self._say = say
        self._keep = keep
        self._known: set[tuple[str, str, str]] = set()

    def __call__(self, _: asyncio.AbstractEventLoop | None, context: dict[str, Any]) -> None:
        """Handle an event loop's report; never raises."""
        error = context.get("exception")
        task = context.get("task") or context.get("future")
        named = getattr(task, "get_name", lambda: "")()
        what = named or str(context.get("message", ""))
        ours = "said" in context  # asyncio's own texts hold addresses and times, which differ each time
        kind = (
            what if ours or error is None else "",
            type(error).__name__,
            "" if error is None else _locate_error(error),
        )
        if kind in self._known:
            return
        self._known.add(kind)
        why = "" if error is None else f": {type(error).__name__}: {error}"
        with suppress(Exception):
            if not context.get("said"):
                self._say(" ".join(f"internal error in {what}{why}".split()))
        with suppress(Exception):
            self._keep(f"{what}\n" + ("" if error is None else "".join(traceback.format_exception(error))))


def _locate_error(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""


@contextmanager
def watch_internal_errors(say: Callable[[str], None], run: Path | None) -> Iterator[None]:
    """Report every error of the running loop, and of its threads, in a line.

    The loop keeps the handler, as asyncio reports some tasks only when it ends.

    Args:
        say: Called on the loop with a line for the crew.
        run: Run directory for the tracebacks; None drops them.
    """

    def keep(text: str) -> None:
        if run is not None:
            with (run / FILE).open("a", encoding="utf-8") as file:
                file.write(text + "\n")

    loop, before = asyncio.get_running_loop(), threading.excepthook
    loop.set_exception_handler(InternalErrorReporter(say, keep))

    def in_a_thread(died: threading.ExceptHookArgs) -> None:
        if died.exc_value is not None and not isinstance(died.exc_value, SystemExit):
            name = "a thread" if died.thread is None else f"the thread {died.thread.name}"
            report_on_loop(loop, name, died.exc_value)

    threading.excepthook = in_a_thread
    try:
        yield
    finally:
        threading.excepthook = before


def report_on_loop(loop: asyncio.AbstractEventLoop, what: str, error: BaseException) -> None:
    """Report an error from another thread on a loop; nothing happens if the loop has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(loop.call_exception_handler, {"message": what, "exception": error, "said": False})
