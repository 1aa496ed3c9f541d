"""Run the command line: `faultline --help`.

Exit codes: `executor.cli.exit_codes`.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from executor.adapters.interrupts import discard_output, end_children, treat_signals_as_ctrl_c
from executor.cli.exit_codes import BAD_INPUT, DONE, INTERNAL, INTERRUPTED, NO_READER, exit_code_of

ENDS_S = 10.0
"""Real seconds for threads and Python's own shutdown after a command."""
LONGEST = 1000
"""Most characters of the error line; file names come first."""
NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EMFILE, errno.ENFILE})
"""Errors of a full disk or quota that name no file."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; the one place that catches all remaining errors."""
    given = list(arguments) if arguments is not None else sys.argv[1:]
    sys.unraisablehook = _ignore_loop_unraisable
    code: str | int | None = INTERNAL
    try:
        with treat_signals_as_ctrl_c():
            code = _run_to_exit_code(given)
    except SystemExit as end:
        code = end.code
    if arguments is None:  # the program itself; any other caller handles its own exit
        _force_exit(code)
    raise SystemExit(code)


def _run_to_exit_code(given: Sequence[str]) -> int:
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")  # names may hold characters that a terminal cannot show
        code = _run(given or ["--help"])
        if code == INTERRUPTED:  # some versions of typer handle the interrupt themselves
            _exit_interrupted()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        _exit_interrupted()
    except OSError as error:
        _exit_without_output(error)
    return code


def _force_exit(code: str | int | None) -> None:
    """Make the program end in bounded time: Python waits for threads, which may block on anything."""

    def ends() -> None:
        time.sleep(ENDS_S)
        with suppress(OSError, ValueError):
            print(f"faultline: ended while waiting for {_list_waiting_threads()}", file=sys.stderr, flush=True)
        os._exit(code if isinstance(code, int) else int(code is not None))

    threading.Thread(target=ends, name="the end", daemon=True).start()


def _list_waiting_threads() -> str:
    mine = {threading.main_thread(), threading.current_thread()}
    return (
        ", ".join(sorted(one.name for one in threading.enumerate() if one not in mine and not one.daemon)) or "itself"
    )


def _ignore_loop_unraisable(what: sys.UnraisableHookArgs) -> None:
    """Ignore an event loop whose construction Ctrl-C interrupted: it complains when it is deleted."""
    if getattr(what.object, "__qualname__", "") != "BaseEventLoop.__del__":
        sys.__unraisablehook__(what)


def _run(given: Sequence[str]) -> int:
    _say_at_once(given)
    logging.basicConfig(format="%(message)s")
    logging.getLogger("planner").setLevel(logging.INFO)  # it reports compilation
    # Loading takes a second, in which Ctrl-C may come too.
    import typer
    from typer.exceptions import TyperException

    from executor.cli.commandline import cli

    try:
        return int(cli(args=list(given), prog_name="faultline", standalone_mode=False) or DONE)
    except BaseExceptionGroup as group:
        _exit_for_group(group, _load_own_errors())
    except TyperException as error:
        # Errors of a command line; the base class does not declare the method that all of them have.
        said = str(getattr(error, "format_message", error.__str__)())
        if said.startswith("Usage: "):  # a group without a command: its help, as `faultline` alone shows
            print(said)
            return DONE
        said = said.replace("Value error, ", "").replace("Input should be", "expected")  # pydantic's words
        _fail(f"{said}{'' if said.endswith(('.', '?')) else '.'} See --help.", BAD_INPUT)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except OSError as error:
        if error.filename is not None:
            _fail(f"{error.filename}: {error.strerror}", BAD_INPUT)
        if isinstance(error, BrokenPipeError) or error.errno in NO_ROOM:
            raise
        _exit_internal_error(error)
    except Exception as error:  # noqa: BLE001 - the last place where it can become one line
        if isinstance(error, _load_own_errors()):
            _fail(str(error), exit_code_of(error))
        _exit_internal_error(error)


def _load_own_errors() -> tuple[type[Exception], ...]:
    """Import the errors with their own message: only once one was raised, as `--help` needs none."""
    from executor.cli.errors import OUR_ERRORS

    return OUR_ERRORS


def _say_at_once(given: Sequence[str]) -> None:
    """Report the resumption of a flight before anything is loaded: loading takes far longer on a busy computer."""
    quiet = {"--quiet", "-q", "--json", "--help"}
    if given[:1] == ["resume"] and not quiet & set(given) and any(Path(one, "events.jsonl").is_file() for one in given):
        with suppress(OSError, ValueError):
            print("resuming the flight; heartbeats start once it is loaded", flush=True)


def _exit_for_group(group: BaseExceptionGroup[BaseException], known: tuple[type[Exception], ...]) -> NoReturn:
    """Exit with the first of several errors raised concurrently."""
    if group.subgroup(KeyboardInterrupt) is not None:
        raise KeyboardInterrupt
    ours, rest = group.split(known)
    if rest is None and ours is not None:
        first = _find_first_error(ours)
        _fail(str(first), exit_code_of(first))
    _exit_internal_error(group)


def _fail(text: str, code: int) -> NoReturn:
    line = " ".join(text.split())
    if len(line) > LONGEST:
        line = f"{line[:LONGEST]}..."
    with suppress(OSError):  # closed terminal
        print(f"faultline: {line}".encode(errors="backslashreplace").decode(), file=sys.stderr)
    raise SystemExit(code)


def _exit_interrupted() -> NoReturn:
    # Threads end in their own time; another Ctrl-C meanwhile has nothing left to interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_children()
    _fail("interrupted", INTERRUPTED)


def _exit_without_output(error: OSError) -> NoReturn:
    """Exit silently if the reader is gone, as with `| head`; else report what there is no room for."""
    if not isinstance(error, BrokenPipeError):
        _fail(f"cannot write: {error.strerror}", BAD_INPUT)
    discard_output(sys.stdout)
    raise SystemExit(NO_READER)


def _exit_internal_error(error: BaseException) -> NoReturn:
    """Save an internal error for a bug report, and print one line."""
    import tempfile
    import traceback

    kept = ""
    with suppress(OSError):  # a unique name: other users may write to the temporary directory
        number, path = tempfile.mkstemp(prefix="faultline-error-", suffix=".txt")
        with os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write("".join(traceback.format_exception(error)))
        kept = f" with {path}"
    _fail(f"internal error: {type(error).__name__}: {error}; please report it{kept}", INTERNAL)


def _find_first_error(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error = group.exceptions[0]
    return _find_first_error(error) if isinstance(error, BaseExceptionGroup) else error
