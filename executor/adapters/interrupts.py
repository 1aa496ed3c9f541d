"""Handle the end of the program, by Ctrl-C, SIGTERM or a closed terminal, and end the processes it started.

Ctrl-C reaches every process of a program at once; those that only work for another leave it to that one.
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
    """Start processes that Ctrl-C does not reach; one that comes meanwhile is delivered afterwards."""
    if sys.platform == "win32":  # where nothing holds signals back
        yield
        return
    from multiprocessing import resource_tracker

    # It starts with the first process, and has SIGINT delivered again once it runs: to that process as well.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    came: list[int] = []
    # Another thread may take the signal all the same; half a pool of processes would wait for the rest for ever.
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
    """Have SIGTERM, and a terminal that closes, end the program like one Ctrl-C; what is ignored stays so (nohup)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    once = SignalDebouncer()

    def ends(_: int, __: FrameType | None) -> None:
        forget_terminal()
        if once.is_first():
            if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts so what a script does not wait for
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
    """Takes signals that come together for one."""

    def __init__(self) -> None:
        self._last_s = float("-inf")

    def is_first(self) -> bool:
        """Return whether the last one was some time ago."""
        before_s, self._last_s = self._last_s, time.monotonic()
        return self._last_s - before_s > TOGETHER_S


def forget_terminal() -> None:
    """Stop writing to a terminal that is there no more: every line to it would be an error."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and _is_hung_up(stream):
            discard_output(stream)


def discard_output(stream: TextIO) -> None:
    """Throw away what is written to a stream from now on, and what is still buffered."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _is_hung_up(stream: TextIO) -> bool:
    """Return whether a stream led to a terminal that is closed now: it takes nothing, not even nothing."""
    try:
        os.write(stream.fileno(), b"")
    except OSError:
        return True
    except ValueError:
        return False
    return False


def end_children() -> None:
    """End the processes that work for this one: nobody waits for their answers any more."""
    if "multiprocessing" not in sys.modules:
        return
    import multiprocessing

    end_processes(multiprocessing.active_children(), patience_s=0.0)


def end_program(process: subprocess.Popen[bytes]) -> None:
    """End a program that was started beside this one, and kill it if it does not."""
    process.terminate()
    try:
        process.wait(PROGRAM_ENDS_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def end_processes(processes: Collection[BaseProcess], *, patience_s: float = ENDS_S) -> int:
    """End processes, as politely as they allow; blocks for three times `ENDS_S` at most.

    Args:
        processes: Which.
        patience_s: How long they may take to end by themselves.

    Returns:
        How many had to be killed.
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
    """Return those that still run after a while.

    Their sentinels say so: a pool's own thread may have asked the system for the exit code first, and a process that
    somebody else has reaped is alive for `Process.is_alive`.
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
    """End this worker process when the one that started it is gone, however it died: nobody would stop it any more."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def start_worker_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of so many processes.

    They are spawned: one that has had threads, as the compiler's, must not be forked. However this process dies, they
    end, instead of computing for nobody.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
