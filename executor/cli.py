"""The command line: `faultline --help`.

Exit codes: 0 done, 1 it ran and the answer is no, 2 bad input with a one-line reason.
"""

from __future__ import annotations

import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import typer
from typer.exceptions import TyperException

from executor.bench.cli import cli as bench
from executor.commands import OUR_ERRORS, flights, plans, replay, restore, risk

cli = typer.Typer(
    name="faultline",
    help="Flies a fleet of UAVs along a power line, and finishes the inspection when one of them is lost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    flights.demo,
    plans.plan,
    plans.check,
    plans.window,
    plans.replan,
    plans.export,
    risk.risk,
    flights.simulate,
    flights.fly,
    flights.preflight,
    flights.resume,
    restore.restore,
):
    cli.command()(command)
cli.command("replay")(replay.replay_logs)
cli.add_typer(bench)

INTERRUPTED = 1
INTERNAL = 70
"""EX_SOFTWARE: a mistake of ours, not of the input."""


def _fail(text: str, code: int) -> NoReturn:
    print(f"faultline: {text}", file=sys.stderr)
    raise SystemExit(code)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; the one place where whatever is left over is caught."""
    given = list(arguments) if arguments is not None else sys.argv[1:]
    try:
        code = cli(args=given or ["--help"], standalone_mode=False)
    except OUR_ERRORS as error:
        _fail(str(error), 2)
    except BaseExceptionGroup as group:
        ours, rest = group.split(OUR_ERRORS)
        if rest is None and ours is not None:
            _fail(str(_first(ours)), 2)
        _internal(group)
    except TyperException as error:
        # What a command line can be wrong about; the base class does not promise the method that all of them have.
        said = error.format_message() if isinstance(error, typer.BadParameter) else str(error)
        _fail(f"{said} See --help.", 2)
    except (KeyboardInterrupt, typer.Abort):
        _fail("interrupted", INTERRUPTED)
    except OSError as error:
        if error.filename is None:
            _internal(error)
        _fail(f"{error.filename}: {error.strerror}", 2)
    except Exception as error:  # noqa: BLE001 - the last place where it can become one line
        _internal(error)
    raise SystemExit(code or 0)


def _internal(error: BaseException) -> NoReturn:
    """Keep a mistake of ours where it can be reported, and say one line."""
    path = Path(tempfile.gettempdir()) / "faultline-error.txt"
    with suppress(OSError):
        path.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    _fail(f"internal error: {type(error).__name__}: {error}; please report it with {path}", INTERNAL)


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
