"""All commands as one: what `faultline` understands."""

from __future__ import annotations

import typer

from executor.cli import exports, flights, images, init_site, network, plans, replay, restore, risk
from executor.cli.bench import cli as bench

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
    init_site.init,
    network.network,
    plans.plan,
    plans.check,
    plans.window,
    plans.replan,
    exports.export,
    risk.risk,
    flights.simulate,
    flights.fly,
    flights.preflight,
    flights.resume,
    restore.restore,
    images.images,
):
    cli.command()(command)
cli.command("day")(flights.fly_day)
cli.command("replay")(replay.replay_logs)
cli.add_typer(bench)
