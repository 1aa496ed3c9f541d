"""Handle the end of the program, by Ctrl-C, SIGTERM or a closed terminal, and end the processes it started.

Ctrl-C reaches every process of a program at once; worker processes leave it to their parent.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing.process import BaseProcess

ENDS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end the program like Ctrl-C; some systems lack one."""
TOGETHER_S = 2.0
"""Seconds within which repeated signals of a closing terminal, from the system and its shell, count once."""
ENDS_S = 1.0
"""Real seconds that a process gets at each step of ending it."""
PROGRAM_ENDS_S = 10.0
"""Real seconds for another program to end; it may have a flight or a fleet to close."""


@contextmanager
def defer_ctrl_c() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach; deliver one that arrives meanwhile afterwards."""
    if sys.platform == "win32":  # where signals cannot be held back
        yield
        return
    from multiprocessing import resource_tracker

    # It starts with the first process, and then SIGINT is delivered again, to that process too.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    came: list[int] = []
    # Another thread may still take the signal; half a pool of processes would wait for the rest for ever.
    raises = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    plain = raises and threading.current_thread() is threading.main_thread()
    if plain:
        signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        if plain:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def treat_signals_as_ctrl_c() -> Iterator[None]:
    """Make SIGTERM and a closing terminal end the program like one Ctrl-C; ignored signals stay ignored (nohup)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    once = SignalDebouncer()

    def ends(_: int, __: FrameType | None) -> None:
        forget_terminal()
        if once.is_first():
            if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts a script's background jobs like this
                signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.raise_signal(signal.SIGINT)

    ours = [number for number in ENDS if signal.getsignal(number) == signal.SIG_DFL]
    for number in ours:
        signal.signal(number, ends)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


class SignalDebouncer:
    """Treat signals that arrive together as one."""

    def __init__(self) -> None:
        self._last_s = float("-inf")

    def is_first(self) -> bool:
        """Return whether the last signal was some time ago."""
        before_s, self._last_s = self._last_s, time.monotonic()
        return self._last_s - before_s > TOGETHER_S


def forget_terminal() -> None:
    """Stop writing to a closed terminal: every line to it would be an error."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and _is_hung_up(stream):
            discard_output(stream)


def discard_output(stream: TextIO) -> None:
    """Discard further output of a stream, and its buffer."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _is_hung_up(stream: TextIO) -> bool:
    """Return whether a stream led to a terminal that is now closed; even an empty write fails then."""
    try:
        os.write(stream.fileno(), b"")
    except OSError:
        return True
    except ValueError:
        return False
    return False


def end_children() -> None:
    """End worker processes, whose results are no longer needed."""
    if "multiprocessing" not in sys.modules:
        return
    import multiprocessing

    end_processes(multiprocessing.active_children(), patience_s=0.0)


def end_program(process: subprocess.Popen[bytes]) -> None:
    """End a program that was started alongside this one; kill it if it does not end."""
    process.terminate()
    try:
        process.wait(PROGRAM_ENDS_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def end_processes(processes: Collection[BaseProcess], *, patience_s: float = ENDS_S) -> int:
    """End processes, as politely as they allow; blocks for at most three times `ENDS_S`.

    Args:
        processes: Processes to end.
        patience_s: Seconds for them to end without a signal.

    Returns:
        Number of processes that had to be killed.
    """
    left = _wait_for_processes(processes, patience_s)
    for process in left:
        process.terminate()
    left = _wait_for_processes(left, ENDS_S)
    for process in left:
        process.kill()
    _wait_for_processes(left, ENDS_S)
    return len(left)


def _wait_for_processes(processes: Collection[BaseProcess], within_s: float) -> list[BaseProcess]:
    """Return the processes that still run after a while.

    Their sentinels are used: a pool's own thread may have collected the exit code first, and `Process.is_alive` reports
    a process as alive that was reaped elsewhere.
    """
    from multiprocessing import connection

    until_s = time.monotonic() + within_s
    left = {process.sentinel: process for process in processes}
    while left and (ended := connection.wait(list(left), max(0.0, until_s - time.monotonic()))):
        for one in ended:
            if isinstance(one, int):
                left.pop(one).join(0.0)
    return list(left.values())


def end_with_parent() -> None:
    """End this worker process when its parent is gone, however it died; otherwise it would run for ever."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def start_worker_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool with `count` processes.

    They are spawned, as a process that has had threads, such as the compiler's, must not be forked. However this
    process dies, they end and do not go on computing.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
