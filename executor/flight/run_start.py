"""What a run directory says that its flight began with: the site, the first plan, and who stood where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import AskedVehicle, read_vehicle_answers
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.preflight.failsafe_parameters import LinkFailsafe, read_link_failsafe
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import build_onboard_mission
from executor.site import day_plans, site_model
from executor.site.learned_files import read_learned_before
from executor.site.site_file import read_site
from executor.site.site_model import SiteModel
from executor.site.site_planning import check_plan_belongs
from missions import DayPlanFile, FlightSetup, Pad, PlanFile, apply_tunings, dialect_for, read_day_plan, read_plan


@dataclass(frozen=True, slots=True)
class RunStart:
    """A flight before its launch."""

    ground: SiteModel
    plan: PlanFile
    context: Context
    state: FleetState


def read_run_start(run: Path) -> RunStart:
    """Return what a flight began with.

    Raises:
        LogError: vehicles.json cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    site = read_site(RunDirectory(run).site)
    ground = site_model.load_site_model(site, run, read_learned_before(run))
    plan = read_plan(RunDirectory(run).plan_path(0))
    check_plan_belongs(plan, ground, str(RunDirectory(run).plan_path(0)))
    rows = {row.name: row for row in read_vehicle_answers(run).vehicles}
    pads = _build_pads(rows, ground.names)
    setup = ground.setup if pads is None else replace(ground.setup, pads=tuple(pads))
    dialects = {table.name: dialect_for(table.autopilot) for table in site.vehicle}
    parameters = {name: row.parameters for name, row in rows.items() if name in dialects}
    own = {name: read_link_failsafe(dialects[name], known) for name, known in parameters.items()}
    day = read_flown_day_plan(run)
    context, boards = build_context_and_boards(ground, setup, plan, day, own, parameters)
    ahead = {} if day is None else day_plans.sorties_ahead_of(day)
    return RunStart(
        ground,
        plan,
        context,
        fleet_step.build_initial_state(boards, fences=build_first_fences(context, boards), ahead=ahead),
    )


def build_context_and_boards(
    ground: SiteModel,
    setup: FlightSetup,
    plan: PlanFile,
    day: DayPlanFile | None,
    own: Mapping[str, LinkFailsafe],
    parameters: Mapping[str, Mapping[str, float]],
) -> tuple[Context, dict[str, OnboardMission | None]]:
    """Return the context of a flight, and everybody's first mission.

    Args:
        ground: The site.
        setup: Its heights, over the pads where everybody stands.
        plan: What is flown first.
        day: The day plan that it is a part of.
        own: What each vehicle does by itself in silence.
        parameters: What each vehicle answered.
    """
    dialects = {table.name: dialect_for(table.autopilot) for table in ground.site.vehicle}
    performances = {
        name: apply_tunings(dialects[name].performance, dialects[name].tunings, known)
        for name, known in parameters.items()
    }
    task = plan.build_task()
    context = site_model.build_context(ground, setup, task, own, performances)
    if day is not None:
        context = replace(context, day=day_plans.build_day_rules(day))
    routes = site_model.name_routes(ground, task, plan.plan)
    paths = site_model.build_paths(context.setup, routes, context.vehicles)
    return context, {
        name: build_onboard_mission(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }


def read_flown_day_plan(run: Path) -> DayPlanFile | None:
    """Return the day plan that a run directory was flown by; None for a single flight.

    Raises:
        MissionsError: it cannot be used.
    """
    path = RunDirectory(run).day_plan
    return read_day_plan(path) if path.exists() else None


def _build_pads(rows: Mapping[str, AskedVehicle], names: tuple[str, ...]) -> list[Pad] | None:
    pads = []
    for name in names:
        row = rows.get(name)
        if row is None or row.pad is None:
            return None  # an older directory: the pads are those that the site gives
        pads.append(Pad(name, row.pad.east_m, row.pad.north_m, row.pad.alt_m))
    return pads
