"""The commands about plans: plan, check, replan, export."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from executor import build, planning
from executor.commands.options import (
    AutopilotName,
    CostName,
    CostOption,
    FormatName,
    JsonOption,
    PlanArgument,
    SecondsOption,
    SeedOption,
    SiteArgument,
    SolverName,
)
from executor.commands.planned import first_plan, writable
from executor.config import read_site
from executor.console import TerminalConsole
from executor.errors import SiteError
from missions import (
    PlanFile,
    check_plan,
    dialect_for,
    encode,
    flight_path,
    flight_setup,
    plan_document,
    qgc_plan,
    qgc_waypoints,
    read_plan,
    write_plan,
)
from planner import Cost


def plan(
    site: SiteArgument,
    cost: CostOption = CostName.MINCOMB,
    solver: Annotated[SolverName, typer.Option(help="Who plans.")] = SolverName.SEARCH,
    all_vehicles: Annotated[bool, typer.Option("--all-vehicles", help="Keep no vehicle on the ground.")] = False,
    seconds: SecondsOption = 5.0,
    seed: SeedOption = 1,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan there.")] = None,
    picture: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw the plan on a map.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan a route for each vehicle within its budget."""
    del solver  # there is one; the option names it for scripts that will choose
    ground = build.ground_of(read_site(site), site.parent)
    console = TerminalConsole(quiet=as_json, yes=True)
    content = first_plan(ground, console, Cost(cost.value), seconds, seed, all_vehicles=all_vehicles)
    if output is not None:
        writable(output, lambda: write_plan(output, content))
    if picture is not None:
        from executor.adapters.pictures import draw_plan

        writable(picture, lambda: draw_plan(content, picture))
    _print_plan(content, as_json=as_json)


def check(plan: PlanArgument, as_json: JsonOption = False) -> None:
    """Recompute every figure of a plan file from its own network, and say what is wrong."""
    wrong = check_plan(read_plan(plan))
    if as_json:
        print(json.dumps({"ok": not wrong, "wrong": wrong}))
    else:
        for line in wrong or ["every figure is right"]:
            print(line)
    if wrong:
        raise typer.Exit(1)


def replan(
    plan: PlanArgument,
    lost: Annotated[str, typer.Option(metavar="NAME", help="The vehicle that is lost.")],
    at: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="When, since the start of the plan.")],
    cost: CostOption = CostName.MINCOMB,
    seconds: SecondsOption = 2.0,
    seed: SeedOption = 1,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the new plan.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Say what the others would do if one vehicle were lost at a time; exit 1 if they cannot finish everything."""
    result = planning.after_loss(read_plan(plan), lost, at, cost=Cost(cost.value), seconds=seconds, seed=seed)
    if output is not None:
        writable(output, lambda: write_plan(output, result.plan))
    _print_plan(result.plan, as_json=as_json)
    if not result.feasible:
        raise typer.Exit(1)


def export(
    plan: PlanArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="A file per vehicle goes there.")],
    to: Annotated[FormatName, typer.Option("--format", help="QGroundControl's .plan, or .waypoints.")] = FormatName.QGC,
    autopilot: Annotated[AutopilotName, typer.Option(help="For whom the items are.")] = AutopilotName.ARDUPILOT,
) -> None:
    """Write a file per vehicle for other ground stations."""
    content = read_plan(plan)
    if content.inspection is None:
        raise SiteError(f"{plan}: inspection: expected heights and speeds, but the plan has none")
    setup = flight_setup(content.network(), [vehicle.name for vehicle in content.vehicles], content.inspection)
    dialect = dialect_for(autopilot.value)
    write, suffix = (qgc_plan, "plan") if to is FormatName.QGC else (qgc_waypoints, "waypoints")
    writable(output, lambda: output.mkdir(parents=True, exist_ok=True))
    for route in content.plan.routes:
        name = content.vehicles[route.vehicle].name
        if not route.visits:
            continue
        items = encode(flight_path(setup, name, route.visits), dialect).items
        pad = setup.pad_of(name)
        home = (*setup.frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m)
        path = output / f"{name}.{suffix}"
        text = write(items, dialect, home)
        writable(path, partial(path.write_text, text, encoding="utf-8"))
        print(path)


def _print_plan(content: PlanFile, *, as_json: bool) -> None:
    uncovered = planning.segment_ids(content, content.plan)
    if as_json:
        print(json.dumps(plan_document(content)))
        return
    for route in content.plan.routes:
        vehicle = content.vehicles[route.vehicle]
        minutes, energy_pct = content.durations_s[route.vehicle] / 60, content.energies_pct[route.vehicle]
        print(
            f"{vehicle.name}: {len(route.visits)} segments, {minutes:.1f} min, {energy_pct:.1f} % of its battery "
            f"(budget {vehicle.budget_pct:g} %)"
        )
    print(f"{content.cost_name} {content.cost_value:.3f}, found in {content.solved.seconds:.1f} s")
    if uncovered:
        print(f"the budgets do not cover segments {', '.join(map(str, uncovered))}")
