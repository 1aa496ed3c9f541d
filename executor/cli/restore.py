"""The command that gives vehicles back what a flight changed on them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from executor.adapters import clock
from executor.cli.console import TerminalConsole
from executor.cli.options import JsonOption, QuietOption
from executor.core.formatting import format_count
from executor.core.interface.commands import Level
from executor.core.preflight.board_changes import KeptList, KeptParameter
from executor.flight.restore_vehicles import build_parameter_rows, read_kept_lists, read_kept_parameters
from missions.files import json_text


def restore(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The run directory of the flight.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before parameters are set.")] = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Restore the parameters, fences and rally points that the flight of a run directory changed on its vehicles."""
    from executor.flight import restore_vehicles as restoring

    _, waiting, lists = restoring.read_open_changes(directory)
    if not waiting and not lists:
        _finish(
            directory, read_kept_parameters(directory) or (), read_kept_lists(directory), as_json=as_json, quiet=quiet
        )
        return
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    for words in (*(one.words for one in waiting), *(one.words for one in lists)):
        console.say(Level.INFO, words)
    counted = [format_count(len(waiting), "parameter")] if waiting else []
    counted += list(dict.fromkeys(one.words_open for one in lists))
    asked = " and ".join(counted)
    if not console.confirm(f"Restore {asked}?"):
        console.say(Level.WARNING, "not confirmed; nothing was sent to any vehicle")
        raise typer.Exit(1)
    kept, fences = clock.run_on_fair_loop(restoring.restore_from_run(directory, console))
    _finish(directory, kept, fences, as_json=as_json, quiet=quiet)


def _finish(
    directory: Path, kept: Sequence[KeptParameter], lists: Sequence[KeptList], *, as_json: bool, quiet: bool
) -> None:
    stay = sum(one.is_open for one in kept) + sum(one.is_open for one in lists)
    if as_json:
        rows = {"parameters": [row.to_plain() for row in build_parameter_rows(kept)]}
        if lists:
            rows["fences"] = [
                {"vehicle": one.vehicle, "list": one.kind.name.lower(), "restored": not one.is_open} for one in lists
            ]
        print(json_text({"restored": stay == 0, **rows}))
    elif not quiet:
        what = "all parameters, fences and rally points are restored" if lists else "all parameters are restored"
        print(f"{directory}: {what}" if not stay else f"{directory}: {stay} of {len(kept) + len(lists)} not restored")
    if stay:
        raise typer.Exit(1)
