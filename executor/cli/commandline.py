"""Build the command tree of `faultline`. A command's module is imported when the command is called."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from executor import __version__
from executor.errors import ExecutorError

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = "benchmarks.commands"
ONLY_IN_A_CHECKOUT = (
    "bench: not part of the installed package; run ./scripts/bench in a checkout of the project's repository"
)


class CheckoutRequired(ExecutorError):
    """Raised when a command needs a checkout of the project."""


COMMANDS: Mapping[str, str] = {
    "demo": "executor.cli.flights:demo",
    "init": "executor.cli.network:init",
    "network": "executor.cli.network:network",
    "open": "executor.cli.plan_page:open_page",
    "plan": "executor.cli.plans:plan",
    "check": "executor.cli.plans:check",
    "window": "executor.cli.plans:window",
    "replan": "executor.cli.plans:replan",
    "export": "executor.cli.exports:export",
    "risk": "executor.cli.plans:risk",
    "simulate": "executor.cli.flights:simulate",
    "fly": "executor.cli.flights:fly",
    "preflight": "executor.cli.flights:preflight",
    "resume": "executor.cli.flights:resume",
    "restore": "executor.cli.flights:restore",
    "images": "executor.cli.images:images",
    "day": "executor.cli.flights:fly_day",
    "replay": "executor.cli.replay:replay_logs",
    "bench": f"{BENCHMARKS}:cli",
}
"""Module and function of each command."""
BENCH = (
    "Run the benchmarks: the planner against published figures, other solvers and the clock; uploads against MAVSDK; "
    "the load of a fleet; the time to resume a flight; the faults that the watchpoints detect; planned against flown."
)
"""Help of the benchmarks where they are installed."""


def read_summary(name: str) -> str:
    """Return a command's line in the overview, from its docstring: nothing is imported."""
    module, _, attribute = COMMANDS[name].partition(":")
    if module == BENCHMARKS:
        return BENCH
    source = (Path(__file__).parent / f"{module.rpartition('.')[2]}.py").read_text(encoding="utf-8")
    functions = [one for one in ast.parse(source).body if isinstance(one, ast.FunctionDef)]
    docstring = next(ast.get_docstring(one) or "" for one in functions if one.name == attribute)
    return " ".join(docstring.partition("\n\n")[0].split())


def load_command(name: str) -> Any:  # noqa: ANN401 - typer does not export the type of its commands
    """Import a command and return it, ready to be called.

    Raises:
        CheckoutRequired: it is `bench`, and this is no checkout.
    """
    if name == "bench" and not _is_checkout():
        raise CheckoutRequired(ONLY_IN_A_CHECKOUT)
    defined = resolve_name(COMMANDS[name])
    if isinstance(defined, typer.Typer):
        return get_command(defined)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, context_settings=HELP)(defined)
    return get_command(app)


def _is_checkout() -> bool:
    """Return whether the benchmarks are next to this program: another package may have their name."""
    found = find_spec(BENCHMARKS.partition(".")[0])
    return found is not None and found.origin is not None and Path(found.origin).resolve().parents[1] == ROOT


class _LazyCommand(TyperCommand):
    """A command whose module is not imported yet."""

    def get_short_help_str(self, limit: int = 45) -> str:
        self.help = read_summary(str(self.name))
        return super().get_short_help_str(limit)

    def make_context(self, info_name: str | None, args: list[str], *more: Any, **named: Any) -> Any:  # noqa: ANN401
        return load_command(str(self.name)).make_context(info_name, args, *more, **named)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"faultline {__version__}")
        raise typer.Exit


HELP = {"help_option_names": ["-h", "--help"]}
_app = typer.Typer(
    name="faultline",
    help="Flies a fleet of UAVs along a power line, and finishes the inspection when one of them is lost.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings=HELP,
)


@_app.callback()
def _start(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that belong to no command."""


cli = cast("TyperGroup", get_command(_app))
cli.commands.update({name: _LazyCommand(name, rich_markup_mode=None) for name in COMMANDS})
