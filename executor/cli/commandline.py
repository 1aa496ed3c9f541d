"""All commands as one: what `faultline` understands. A command's module is imported only once the command is called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from executor.errors import ExecutorError

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = "benchmarks.commands"
ONLY_IN_A_CHECKOUT = (
    "bench: not part of the installed package; run ./scripts/bench in a checkout of the project's repository"
)


class CheckoutRequired(ExecutorError):
    """A command needs what only a checkout of the project has."""


@dataclass(frozen=True, slots=True)
class _CommandPlace:
    """Where a command is defined, and its line in the overview (a test holds it to the command's own help)."""

    module: str
    attribute: str
    help: str


COMMANDS: Mapping[str, _CommandPlace] = {
    "demo": _CommandPlace(
        "executor.cli.flights",
        "demo",
        "Plan, fly four simulated vehicles, lose one, re-plan, finish; leaves a run directory with pictures.",
    ),
    "init": _CommandPlace(
        "executor.cli.init_site",
        "init",
        "Write a commented site file to start from.",
    ),
    "network": _CommandPlace(
        "executor.cli.network",
        "network",
        "Show how a network file is read, what was repaired and what to check; needs no depot.",
    ),
    "plan": _CommandPlace(
        "executor.cli.plans",
        "plan",
        "Plan a route for each vehicle within its budget; exit 1 if segments are left over.",
    ),
    "check": _CommandPlace(
        "executor.cli.plans",
        "check",
        "Recompute every figure of a plan file, or a day plan, from its own network and report errors.",
    ),
    "window": _CommandPlace(
        "executor.cli.plans",
        "window",
        "Compute from when on the fleet can finish without any one vehicle, and which loss breaks it before.",
    ),
    "replan": _CommandPlace(
        "executor.cli.plans",
        "replan",
        "Plan the response to the loss of one vehicle at a given time; exit 1 if segments are left over.",
    ),
    "export": _CommandPlace(
        "executor.cli.exports",
        "export",
        "Write a plan for other ground stations, or a plan or a flight for maps.",
    ),
    "risk": _CommandPlace(
        "executor.cli.risk",
        "risk",
        "Estimate the probability of a complete inspection, as planned and with re-plans after losses.",
    ),
    "simulate": _CommandPlace(
        "executor.cli.flights",
        "simulate",
        "Run the simulated fleet alone, on UDP, for any ground station; ends with Ctrl-C.",
    ),
    "fly": _CommandPlace(
        "executor.cli.flights",
        "fly",
        "Connect, check, upload, fly and supervise; re-plan when a vehicle is lost.",
    ),
    "preflight": _CommandPlace(
        "executor.cli.flights",
        "preflight",
        "Read every vehicle's state and parameters and run the checklist; nothing is uploaded, nothing moves.",
    ),
    "resume": _CommandPlace(
        "executor.cli.flights",
        "resume",
        "Resume a flight from its run directory after its ground station died; on another computer too.",
    ),
    "restore": _CommandPlace(
        "executor.cli.restore",
        "restore",
        "Restore the parameters, fences and rally points that the flight of a run directory changed on its vehicles.",
    ),
    "images": _CommandPlace(
        "executor.cli.images",
        "images",
        "Match camera files to the pictures of a flight by time and place, and list what is missing.",
    ),
    "day": _CommandPlace(
        "executor.cli.flights",
        "fly_day",
        "Plan a working day of sorties from the bases of the site, and fly it.",
    ),
    "replay": _CommandPlace(
        "executor.cli.replay",
        "replay_logs",
        "Run recorded flights through the fault detection of a live flight: what it declares, when and why.",
    ),
    "bench": _CommandPlace(
        BENCHMARKS,
        "cli",
        "Run the benchmarks: the planner against published figures, other solvers and the clock; uploads against "
        "MAVSDK; what a fleet costs; how soon a flight is resumed; what the watchpoints detect; flown against planned.",
    ),
}


def load_command(name: str) -> Any:  # noqa: ANN401 - typer does not export what its commands are
    """Import a command and return it, ready to be called.

    Raises:
        NotInstalled: it is `bench`, and this is no checkout.
    """
    place = COMMANDS[name]
    if place.module == BENCHMARKS and not _is_checkout():
        raise CheckoutRequired(ONLY_IN_A_CHECKOUT)
    defined = getattr(import_module(place.module), place.attribute)
    if isinstance(defined, typer.Typer):
        return get_command(defined)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name)(defined)
    return get_command(app)


def _is_checkout() -> bool:
    """Return whether the benchmarks lie beside this program: another package may have their name."""
    found = find_spec(BENCHMARKS.partition(".")[0])
    return found is not None and found.origin is not None and Path(found.origin).resolve().parents[1] == ROOT


class _LazyCommand(TyperCommand):
    """A command whose module is not imported yet."""

    def make_context(self, info_name: str | None, args: list[str], *more: Any, **named: Any) -> Any:  # noqa: ANN401
        """Import the command, and hand the arguments on to it."""
        return load_command(str(self.name)).make_context(info_name, args, *more, **named)


cli = TyperGroup(
    name="faultline",
    help="Flies a fleet of UAVs along a power line, and finishes the inspection when one of them is lost.",
    no_args_is_help=True,
    rich_markup_mode=None,
    commands=[_LazyCommand(name, help=place.help, rich_markup_mode=None) for name, place in COMMANDS.items()],
)
