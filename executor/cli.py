"""The command line: `faultline --help`.

Exit codes: 0 done, 1 it ran and the answer is no, 2 bad input with a one-line reason, 130 interrupted by Ctrl-C.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

INTERRUPTED = 128 + signal.SIGINT
NO_READER = 1
"""As typer has it."""
INTERNAL = 70
"""EX_SOFTWARE: a mistake of ours, not of the input."""
LONGEST = 1000
"""Letters of the line that says why; files are named at its begin."""
NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EMFILE, errno.ENFILE})
"""What a computer lacks, and no file is named with."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; the one place where whatever is left over is caught."""
    given = list(arguments) if arguments is not None else sys.argv[1:]
    sys.unraisablehook = _unraisable
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")  # names may hold what a terminal has no letter for
        code = _run(given or ["--help"])
        if code == INTERRUPTED:  # some versions of typer take the interrupt for themselves
            _interrupted()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        _interrupted()
    except OSError as error:
        _no_output(error)
    raise SystemExit(code)


def _unraisable(what: sys.UnraisableHookArgs) -> None:
    """Pass over an event loop that Ctrl-C kept from being made whole: it complains when it is thrown away."""
    if getattr(what.object, "__qualname__", "") != "BaseEventLoop.__del__":
        sys.__unraisablehook__(what)


def _run(given: Sequence[str]) -> int:
    # Loading takes a second, in which Ctrl-C may come, too.
    import typer
    from typer.exceptions import TyperException

    from executor.commandline import cli
    from executor.commands import OUR_ERRORS

    try:
        return int(cli(args=list(given), standalone_mode=False) or 0)
    except OUR_ERRORS as error:
        _fail(str(error), 2)
    except BaseExceptionGroup as group:
        _several(group, OUR_ERRORS)
    except TyperException as error:
        # What a command line can be wrong about; the base class does not promise the method that all of them have.
        said = error.format_message() if isinstance(error, typer.BadParameter) else str(error)
        _fail(f"{said} See --help.", 2)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except OSError as error:
        if error.filename is not None:
            _fail(f"{error.filename}: {error.strerror}", 2)
        if isinstance(error, BrokenPipeError) or error.errno in NO_ROOM:
            raise
        _internal(error)
    except Exception as error:  # noqa: BLE001 - the last place where it can become one line
        _internal(error)


def _several(group: BaseExceptionGroup[BaseException], known: tuple[type[Exception], ...]) -> NoReturn:
    """End with the first of several that were raised side by side."""
    if group.subgroup(KeyboardInterrupt) is not None:
        raise KeyboardInterrupt
    ours, rest = group.split(known)
    if rest is None and ours is not None:
        _fail(str(_first(ours)), 2)
    _internal(group)


def _fail(text: str, code: int) -> NoReturn:
    line = " ".join(text.split())
    if len(line) > LONGEST:
        line = f"{line[:LONGEST]}..."
    print(f"faultline: {line}".encode(errors="backslashreplace").decode(), file=sys.stderr)
    raise SystemExit(code)


def _interrupted() -> NoReturn:
    # Threads end in their own time; one more Ctrl-C meanwhile has nothing left to interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if "multiprocessing" in sys.modules:
        from executor.interrupts import end_children

        end_children()
    _fail("interrupted", INTERRUPTED)


def _no_output(error: OSError) -> NoReturn:
    """End without a word if nobody reads any more, as `| head` does; else say what there is no room for."""
    if not isinstance(error, BrokenPipeError):
        _fail(f"cannot write: {error.strerror}", 2)
    # What is still buffered must not be tried again when Python ends.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    raise SystemExit(NO_READER)


def _internal(error: BaseException) -> NoReturn:
    """Keep a mistake of ours where it can be reported, and say one line."""
    import tempfile
    import traceback
    from contextlib import suppress
    from pathlib import Path

    path = Path(tempfile.gettempdir()) / "faultline-error.txt"
    with suppress(OSError):
        path.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    _fail(f"internal error: {type(error).__name__}: {error}; please report it with {path}", INTERNAL)


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
