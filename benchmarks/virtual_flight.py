"""One site flown in virtual time, as `faultline fly` would with `faultline simulate`.

Interviews, missions on board, the flight loop, codec, dialogues, solver, report and vehicles are the product's own.
Differences: datagrams go through memory, a re-plan takes a fixed time on any computer, there is no confirmation before
take-off, nothing is written, and consequences of a loss are not evaluated during the flight.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from benchmarks.errors import FlightNotFlown
from benchmarks.virtual.in_process_solver import InProcessSolver
from benchmarks.virtual.memory_flight import MemoryFlight, NullEventSink, run_until
from benchmarks.virtual.radio import JoinedRadio, MemoryRadio, share_port
from executor.analysis.documents import FlightReport
from executor.analysis.report import build_report, build_vehicle_answers
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.codes import Check, Severity
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Event
from executor.core.interface.ports import EventSink
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.core.state.vehicle_parts import OnboardMission
from executor.flight.preparation import (
    build_context_and_checklist,
    build_wanted_lists,
    interview_vehicles,
    read_changes,
    upload_first_missions,
)
from executor.flight.run_start import FlightRequest
from executor.runtime.flight_loop import Flight
from executor.runtime.procedures import keep_asking_links
from executor.runtime.vehicle_preflight import load_lists, set_changes
from executor.simulated.fault_truths import find_injected_fault
from executor.simulated.simulated_fleet import fleet_of
from executor.site import day_plans
from executor.site.site_model import SiteModel, radio_share_of
from executor.supervised import run_beside
from missions import DayPlanFile, PlanFile, dialect_for
from missions.fences import Fence
from simulator.config import SimVehicle
from simulator.fleet import SimulatedVehicle, build_vehicles
from simulator.radio import parse_radio
from simulator.truth import Truth
from simulator.virtual_loop import run_virtual

LIMIT_S = 3 * 3600.0
"""Time limit of a flight: no pack lasts as long."""
STEP_S = 0.1
"""Simulation time between two reads of the vehicles' output."""
STANDS_S = 5.0
"""Time for which the vehicles run on after supervision ends: they disarm some seconds after landing."""


@dataclass(frozen=True, slots=True)
class VehicleOutcome:
    """One vehicle's final state in the simulator."""

    charge_pct: float
    armed: bool
    wrecked: bool
    """Whether it crashed, or lies on its back."""
    from_pad_m: float
    up_m: float


@dataclass(frozen=True, slots=True)
class VirtualFlight:
    """All results of a flight."""

    report: FlightReport
    context: Context
    state: FleetState
    """State at the end."""
    boards: Mapping[str, OnboardMission | None]
    """The first missions."""
    truths: tuple[Truth, ...]
    """True events; times are seconds of the flight's clock."""
    crafts: Mapping[str, VehicleOutcome]
    said: tuple[tuple[float, Say], ...]
    """The lines for the crew, by the flight's clock."""
    launched_s: float
    """Launch time on the flight's clock."""
    flown_s: float
    """From the launch to the end of the supervision."""
    ended: bool
    """Whether the supervision ended regularly; otherwise it was stopped at the limit."""
    took_s: float
    """Real time used."""


EventCallback = Callable[[Context, Event, FleetState, float], None]


@dataclass(frozen=True, slots=True)
class FlightObservers:
    """Observers of a flight, without any effect on it."""

    sink: EventSink = field(default_factory=NullEventSink)
    """Where events are written."""
    applied: EventCallback = lambda *_: None
    """Called after every event with the fixed context, the state and the flight's time."""
    lived: Callable[[Mapping[str, SimulatedVehicle]], None] = lambda _: None
    """Called with the vehicles after each of their steps."""


def fly_virtual(
    ground: SiteModel,
    plan: PlanFile,
    *,
    faults: Sequence[str] = (),
    seed: int = 0,
    craft: Callable[[SimVehicle], SimVehicle] = lambda vehicle: vehicle,
    onlookers: FlightObservers | None = None,
    limit_s: float = LIMIT_S,
    make: Callable[..., VirtualRun] | None = None,
) -> VirtualFlight:
    """Fly a plan over a site from the first heartbeat to the end of the supervision.

    The same arguments give the same flight. A vehicle flies again as the site's `fly_again` says; offers get no answer.

    Args:
        ground: The site; its speedup is ignored and counts as 1.
        plan: Over all of its segments, for its vehicles.
        faults: As for ``--fault``: ``uav2:crash@300s``.
        seed: Seed of the links.
        craft: Changes a simulated vehicle: its charge, its pack, the wind.
        onlookers: The observers.
        limit_s: Limit of flight time after the launch.
        make: Makes another run than the plain one, from the same six.

    Raises:
        SimulatorError: a fault or the radio cannot be parsed, or a fault names no vehicle.
        PreflightFailed: a vehicle does not become ready.
        FlightNotFlown: the checklist stops the flight.
    """
    flight = ground.site.flight.model_copy(update={"speedup": 1.0})
    ground = replace(ground, site=ground.site.model_copy(update={"flight": flight}))
    began_s = time.perf_counter()
    run = partial(make or VirtualRun, ground, plan, faults, seed, craft, onlookers or FlightObservers())
    flown = run_virtual(lambda: run().fly(limit_s))
    return replace(flown, took_s=time.perf_counter() - began_s)


class SilentConsole:
    """A console without output."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show nothing."""

    def show_checks(self, found: Sequence[Check]) -> None:
        """Show nothing."""

    async def ask(self, question: str) -> bool:  # noqa: ARG002 - as a console is asked
        """Answer yes."""
        return True

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Show nothing."""

    def stop_drawing(self) -> None:
        """There is nothing to stop."""


class VirtualRun(MemoryFlight):
    """A flight in progress."""

    step_s = STEP_S

    def __init__(
        self, ground: SiteModel, plan: PlanFile, faults: Sequence[str], seed: int,
        craft: Callable[[SimVehicle], SimVehicle], onlookers: FlightObservers, *, day: DayPlanFile | None = None,
        radio: str = "",
    ) -> None:  # fmt: skip
        """Prepare; the arguments are those of `fly_virtual`, and the day that begins with the plan's sorties.

        `radio` is as for ``--radio``.
        """
        self._order = FlightRequest(ground.site, Path(), ground, plan, Path(), lambda _: (), day=day)
        self._onlookers = onlookers
        simulated = fleet_of(ground, speedup=1.0, faults=faults, seed=seed, wind=1.0, failsafe=True, radio=radio)
        setup = ground.setup

        def raise_return(config: SimVehicle) -> SimVehicle:
            rule = dialect_for(config.autopilot.value).return_parameters
            height = {rule.height: setup.return_height_m(config.name) / rule.unit_m}
            return craft(replace(config, parameters={**config.parameters, **height}))

        vehicles = zip(simulated.vehicles, build_vehicles(simulated, raise_return), strict=True)
        radios = {
            config.name: (MemoryRadio if vehicle.links == 1 else JoinedRadio)(vehicle, config.sysid)
            for config, vehicle in vehicles
        }
        if (first := radio.partition(",")[0]) and parse_radio(first).profile.shared:
            share_port(tuple(radios.values()))
        solver = InProcessSolver(plan.solved.seed, takes_s=ground.site.flight.solve_s)
        super().__init__(radios, solver, self._onlookers.sink)
        self._vehicles = {name: radio.vehicle for name, radio in radios.items()}
        self._launched_s = 0.0

    async def _upload_fences(self, context: Context, first: Mapping[str, Fence]) -> None:
        """Upload the fences and set the parameters they need; a day's fences are checked after every boot."""
        if not first and self._order.day is None:
            return
        links = self.links
        changes = await read_changes(context, links, self.clock)
        for name in links:
            await set_changes(links[name], self.clock, changes.changes_of(name))
        for name, lists in build_wanted_lists(context, first).items():
            await load_lists(name, links[name], self.clock, context.vehicles[name].dialect, lists)

    async def fly(self, limit_s: float) -> VirtualFlight:
        """Fly from the first heartbeat to the end."""
        links, clock, console = self.links, self.clock, SilentConsole()
        for radio in self.radios.values():
            radio.stop_unread_streams()
        setups = {
            table.name: (dialect_for(table.autopilot), radio_share_of(self._order.site, table.name))
            for table in self._order.site.vehicle
        }
        async with self.live(), run_beside("further links", partial(keep_asking_links, links, clock, setups)):
            facts = await interview_vehicles(self._order, links, clock, console)
            context, boards, found = build_context_and_checklist(self._order, facts)
            stops = [check for check in found if check.severity is Severity.STOP]
            if stops:
                raise FlightNotFlown(f"a flight in virtual time: {stops[0].subject}: {stops[0].text}")
            first = build_first_fences(context, boards)
            await self._upload_fences(context, first)
            await upload_first_missions(context, links, clock, boards, console)
            launched_s = self._launched_s = clock.now_s()
            ahead = {} if self._order.day is None else day_plans.sorties_ahead_of(self._order.day)
            state = fleet_step.build_initial_state(boards, fences=first, ahead=ahead)
            flight, ended = await self._supervise(context, state, launched_s + limit_s)
            ended_s = clock.now_s()
            await asyncio.sleep(STANDS_S)
        happened = [one for truth in self.truths if (one := find_injected_fault(truth, truth.t_s)) is not None]
        frames = {name: link.counts for name, link in links.items()}
        said = build_vehicle_answers(context, facts, found)
        report = build_report(context, flight.state, ended_s, happened, frames, said)
        crafts = {name: _build_outcome(vehicle) for name, vehicle in self._vehicles.items()}
        return VirtualFlight(
            report, context, flight.state, boards, tuple(self.truths), crafts, tuple(self.said), launched_s,
            ended_s - launched_s, ended, 0.0,
        )  # fmt: skip

    async def _supervise(self, context: Context, state: FleetState, until_s: float) -> tuple[Flight, bool]:
        """Supervise; returns the last flight loop, and whether it ended regularly."""
        flight = self._begin_loop(context, state)
        return flight, await run_until(flight, until_s)

    def _begin_loop(self, context: Context, state: FleetState) -> Flight:
        return self._begin_flight(context, state, partial(self._onlookers.applied, context))

    def _after_step(self, now_s: float) -> None:
        super()._after_step(now_s)
        self._onlookers.lived(self._vehicles)


def _build_outcome(vehicle: SimulatedVehicle) -> VehicleOutcome:
    frame = vehicle.autopilot.frame
    body = frame.body
    away_m = (body.east_m**2 + body.north_m**2) ** 0.5
    broken = frame.wrecked or frame.crashed_s is not None
    return VehicleOutcome(frame.battery.charge_pct, frame.armed, broken, away_m, body.up_m)
