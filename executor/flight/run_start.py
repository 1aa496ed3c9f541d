"""What a run directory says that its flight began with: the site, the first plan, and who stood where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import AskedVehicle, read_vehicle_answers
from executor.analysis.learned import read_learned_before
from executor.core import fleet
from executor.core.context import Context
from executor.core.fencing import build_first_fences
from executor.core.preflight.failsafes import LinkFailsafe, read_link_failsafe
from executor.core.state import FleetState
from executor.core.vehicle import build_onboard_mission
from executor.site import assembly, dayflight
from executor.site.assembly import SiteModel
from executor.site.config import read_site
from executor.site.planning import check_plan_belongs
from missions import DayPlanFile, Pad, PlanFile, apply_tunings, dialect_for, read_day_plan, read_plan


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
    ground = assembly.load_site_model(site, run, read_learned_before(run))
    plan = read_plan(RunDirectory(run).plan_path(0))
    check_plan_belongs(plan, ground, str(RunDirectory(run).plan_path(0)))
    task = plan.build_task()
    rows = {row.name: row for row in read_vehicle_answers(run).vehicles}
    pads = _build_pads(rows, ground.names)
    setup = assembly.build_flight_setup(ground, pads)
    dialects = {table.name: dialect_for(table.autopilot) for table in site.vehicle}
    own: Mapping[str, LinkFailsafe] = MappingProxyType({
        name: read_link_failsafe(dialects[name], row.parameters) for name, row in rows.items() if name in dialects
    })  # fmt: skip
    performances = {
        name: apply_tunings(dialects[name].performance, dialects[name].tunings, row.parameters)
        for name, row in rows.items()
        if name in dialects
    }
    context = assembly.build_context(ground, setup, task, own, performances)
    day = read_flown_day_plan(run)
    if day is not None:
        context = replace(context, day=dayflight.build_day_rules(day))
    routes = assembly.name_routes(ground, task, plan.plan)
    paths = assembly.build_paths(setup, routes, context.vehicles)
    boards = {
        name: build_onboard_mission(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }
    ahead = {} if day is None else dayflight.sorties_ahead_of(day)
    return RunStart(
        ground,
        plan,
        context,
        fleet.build_initial_state(boards, fences=build_first_fences(context, boards), ahead=ahead),
    )


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
