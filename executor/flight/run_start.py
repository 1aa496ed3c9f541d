"""What a run directory says that its flight began with: the site, the first plan, and who stood where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import AskedVehicle, read_asked
from executor.analysis.learned import began_with
from executor.core import fleet
from executor.core.context import Context
from executor.core.fencing import first_fences
from executor.core.preflight.failsafes import LinkFailsafe, link_failsafe
from executor.core.state import FleetState
from executor.core.vehicle import aboard
from executor.site import assembly, dayflight
from executor.site.assembly import Ground
from executor.site.config import read_site
from executor.site.planning import belongs
from missions import DayPlanFile, Pad, PlanFile, dialect_for, read_day_plan, read_plan, tuned


@dataclass(frozen=True, slots=True)
class Beginning:
    """A flight before its launch."""

    ground: Ground
    plan: PlanFile
    context: Context
    state: FleetState


def beginning(run: Path) -> Beginning:
    """Return what a flight began with.

    Raises:
        LogError: vehicles.json cannot be used.
        SiteError: site.toml cannot be used.
        MissionsError: the first plan, or the network, cannot be used.
    """
    site = read_site(RunDirectory(run).site)
    ground = assembly.ground_of(site, run, began_with(run))
    plan = read_plan(RunDirectory(run).plan(0))
    belongs(plan, ground, str(RunDirectory(run).plan(0)))
    task = plan.task()
    rows = {row.name: row for row in read_asked(run).vehicles}
    pads = _pads(rows, ground.names)
    setup = assembly.setup_of(ground, pads)
    dialects = {table.name: dialect_for(table.autopilot) for table in site.vehicle}
    own: Mapping[str, LinkFailsafe] = MappingProxyType({
        name: link_failsafe(dialects[name], row.parameters) for name, row in rows.items() if name in dialects
    })  # fmt: skip
    performances = {
        name: tuned(dialects[name].performance, dialects[name].tunings, row.parameters)
        for name, row in rows.items()
        if name in dialects
    }
    context = assembly.context_of(ground, setup, task, own, performances)
    day = day_rules_of(run)
    if day is not None:
        context = replace(context, day=dayflight.day_rules(day))
    routes = assembly.routes_of(ground, task, plan.plan)
    paths = assembly.paths_of(setup, routes, context.vehicles)
    boards = {
        name: aboard(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }
    ahead = {} if day is None else dayflight.ahead_of(day)
    return Beginning(ground, plan, context, fleet.initial(boards, fences=first_fences(context, boards), ahead=ahead))


def day_rules_of(run: Path) -> DayPlanFile | None:
    """Return the day plan that a run directory was flown by; None for a single flight.

    Raises:
        MissionsError: it cannot be used.
    """
    path = RunDirectory(run).day_plan
    return read_day_plan(path) if path.exists() else None


def _pads(rows: Mapping[str, AskedVehicle], names: tuple[str, ...]) -> list[Pad] | None:
    pads = []
    for name in names:
        row = rows.get(name)
        if row is None or row.pad is None:
            return None  # an older directory: the pads are those that the site gives
        pads.append(Pad(name, row.pad.east_m, row.pad.north_m, row.pad.alt_m))
    return pads
