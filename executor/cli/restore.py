"""The command that gives vehicles back what a flight changed on them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.console import TerminalConsole
from executor.cli.options import JsonOption, QuietOption
from executor.core.commands import Level
from executor.core.preflight.parameters import Kept
from executor.flight.changed_parameters import parameters_report, read_kept
from executor.runtime import turns


def restore(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The run directory of the flight.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before parameters are set.")] = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Restore the parameters that the flight of a run directory changed on its vehicles."""
    from executor.flight import restore as restoring

    waiting = restoring.read_open(directory)[1]
    if not waiting:
        _finish(directory, read_kept(directory) or (), as_json=as_json, quiet=quiet)
        return
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    for one in waiting:
        console.say(Level.INFO, one.words)
    asked = "1 parameter" if len(waiting) == 1 else f"{len(waiting)} parameters"
    if not console.confirm(f"Restore {asked}?"):
        console.say(Level.WARNING, "not confirmed; nothing was sent to any vehicle")
        raise typer.Exit(1)
    _finish(directory, turns.run(restoring.restore(directory, console)), as_json=as_json, quiet=quiet)


def _finish(directory: Path, kept: Sequence[Kept], *, as_json: bool, quiet: bool) -> None:
    stay = sum(one.open for one in kept)
    if as_json:
        print(json.dumps({"restored": stay == 0, "parameters": [row.plain() for row in parameters_report(kept)]}))
    elif not quiet:
        print(
            f"{directory}: all parameters are restored"
            if not stay
            else f"{directory}: {stay} of {len(kept)} not restored"
        )
    if stay:
        raise typer.Exit(1)
