"""Keeps what goes on beside a flight going, and says what goes wrong there: one line for each kind of mistake.

A mistake is handed to the event loop's own exception handler, where asyncio's complaints end as well; `hear` puts one
there that tells the crew in a line and keeps the traceback in a file.
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
"""Real seconds before what has died is begun again; the last stands for all that follow."""
AT_ONCE_S = 0.02
"""For what the flight itself stands on: no wait, but one that dies in every round must not keep the processor."""
STEADY_S = 30.0
"""What went well for so long begins its waits anew."""
FILE = "mistakes.txt"
"""In a run directory: the tracebacks."""

Work = Callable[[], Awaitable[None]]


def report_internal_error(what: str, error: BaseException, *, said: bool = False) -> None:
    """Hand a mistake to those who listen; `said` if the crew knows of it already."""
    with suppress(RuntimeError):  # without a loop nothing goes on
        asyncio.get_running_loop().call_exception_handler({"message": what, "exception": error, "said": said})


def call_safely(what: str, work: Callable[..., object], *arguments: object) -> None:
    """Do something whose mistakes must not end what goes on around it."""
    try:
        work(*arguments)
    except Exception as error:  # noqa: BLE001 - the boundary that this function is
        report_internal_error(what, error)


async def keep_going(what: str, work: Work, *, at_once: bool = False) -> None:
    """Do something, and again whenever it dies of a mistake, until it ends by itself or is cancelled."""
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
    """Keep something going for as long as the block runs."""
    task = asyncio.create_task(keep_going(what, work, at_once=at_once), name=what)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


class InternalErrorReporter:
    """Says every kind of mistake once, and keeps its traceback; an exception handler of an event loop."""

    def __init__(self, say: Callable[[str], None], keep: Callable[[str], None]) -> None:
        """Name who is told a line, and what keeps a traceback."""
        self._say = say
        self._keep = keep
        self._known: set[tuple[str, str, str]] = set()

    def __call__(self, _: asyncio.AbstractEventLoop | None, context: dict[str, Any]) -> None:
        """Take what an event loop has to say; never raises."""
        error = context.get("exception")
        task = context.get("task") or context.get("future")
        named = getattr(task, "get_name", lambda: "")()
        what = named or str(context.get("message", ""))
        ours = "said" in context  # asyncio's own words hold addresses and times, which differ each time
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
    """Have every mistake of the running loop, and of the threads beside it, said in a line.

    The loop keeps the handler: asyncio complains of some tasks only when it ends.

    Args:
        say: Called on the loop with a line for the crew.
        run: Where the tracebacks are kept; nowhere without a run directory.
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
    """Report a mistake of another thread on a loop; one that has ended hears nothing any more."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(loop.call_exception_handler, {"message": what, "exception": error, "said": False})
