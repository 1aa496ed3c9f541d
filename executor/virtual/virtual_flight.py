"""One site flown in virtual time, as `faultline fly` would beside `faultline simulate`.

Interviews, missions on board, the flight loop, codec, dialogues, solver, report and vehicles are the product's own.
What differs: datagrams go through memory, a re-plan takes the same time whatever the computer does, nobody is asked
before the take-off, nothing is written, and what a loss would mean is not judged beside the flight.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.analysis.documents import FlightReport
from executor.analysis.report import PreflightRecord, build_report
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Event, Reopened
from executor.core.interface.ports import EventSink, OpenLink
from executor.core.preflight.vehicle_checks import Check, Severity
from executor.core.state.fleet_state import FleetState
from executor.core.state.onboard_fence import build_first_fences
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import FlightNotFlown
from executor.flight.checkpoint_files import round_trip_state
from executor.flight.fencing import build_wanted_lists
from executor.flight.flight_request import FlightRequest
from executor.flight.parameter_changes import read_changes
from executor.flight.preparation import build_context_and_checklist, interview_vehicles, upload_first_missions
from executor.runtime.board_restore import set_changes
from executor.runtime.flight_loop import Flight, Observer, send_heartbeats
from executor.runtime.vehicle_preflight import load_lists
from executor.simulated.injected_faults import find_injected_fault
from executor.simulated.simulated_fleet import fleet_of
from executor.site import day_flight, site_model
from executor.site.site_model import SiteModel
from executor.virtual.in_process_solver import InProcessSolver
from executor.virtual.loop import run_virtual
from executor.virtual.pad_crew import Packs, PadCrew
from executor.virtual.radio import MemoryRadio, run_radios
from missions import DayPlanFile, PlanFile, dialect_for
from missions.fences import Fence
from simulator.config import SimVehicle
from simulator.faults import parse_fault
from simulator.truth import Truth
from simulator.vehicle import SimulatedVehicle

LIMIT_S = 3 * 3600.0
"""A flight that takes longer than this is left: no pack lasts as long."""
STEP_S = 0.1
"""Of the vehicles' lives between two looks at what they say."""
AWAY_S = 15.0
"""So long a ground station that has died is away."""
PATIENCE_S = 10.0
"""So long it waits for the first answer when it is back."""
FALLS_FROM_M = 10.0
STANDS_S = 5.0
"""After the end of the supervision the vehicles live on for so long: they disarm some seconds after they land."""


@dataclass(frozen=True, slots=True)
class VehicleOutcome:
    """One vehicle in the end, by the simulator."""

    charge_pct: float
    armed: bool
    wrecked: bool
    """Whether it crashed, or lies on its back."""
    from_pad_m: float
    up_m: float


@dataclass(frozen=True, slots=True)
class VirtualFlight:
    """All that a flight left behind."""

    report: FlightReport
    context: Context
    state: FleetState
    """At the end."""
    boards: Mapping[str, OnboardMission | None]
    """The first missions."""
    truths: tuple[Truth, ...]
    """What really happened; times are seconds of the flight's clock."""
    crafts: Mapping[str, VehicleOutcome]
    said: tuple[tuple[float, Say], ...]
    """The lines for the crew, by the flight's clock."""
    launched_s: float
    """On the flight's clock."""
    flown_s: float
    """From the launch to the end of the supervision."""
    ended: bool
    """Whether the supervision came to its own end; otherwise it was left at the limit."""
    took_s: float
    """Of real time."""


@dataclass(frozen=True, slots=True)
class DayScenario:
    """A day of several sorties, as its plan, its crew and its troubles have it."""

    day: DayPlanFile
    packs: Packs
    """What the crew puts in, one after the other."""
    losses: tuple[tuple[float, str], ...] = ()
    """Seconds of the flight, and who is in the air then, or next, falls."""
    away_s: tuple[float, ...] = ()
    """When the ground station dies, at a moment in which nothing is being planned."""


EventCallback = Callable[[Context, Event, FleetState, float], None]


class NullEventSink:
    """`ports.EventSink` that keeps nothing."""

    def write(self, event: Event, now_s: float) -> None:
        """Pass an event over."""

    async def settle(self) -> None:
        """Nothing is ever lost here."""


@dataclass(frozen=True, slots=True)
class FlightObservers:
    """Who looks on at a flight and changes nothing."""

    sink: EventSink = field(default_factory=NullEventSink)
    """Where events are written."""
    applied: EventCallback = lambda *_: None
    """Called after every event with what does not change, the state and the flight's time."""
    lived: Callable[[Mapping[str, SimulatedVehicle]], None] = lambda _: None
    """Called with the vehicles after every step of their lives."""


def fly_virtual(
    ground: SiteModel,
    plan: PlanFile,
    *,
    faults: Sequence[str] = (),
    seed: int = 0,
    craft: Callable[[SimVehicle], SimVehicle] = lambda vehicle: vehicle,
    onlookers: FlightObservers | None = None,
    sorties: DayScenario | None = None,
    limit_s: float = LIMIT_S,
) -> VirtualFlight:
    """Fly a plan over a site from the first heartbeat to the end of the supervision.

    The same arguments give the same flight. A vehicle flies again as the site's `fly_again` says; nobody answers
    offers. On a day of several sorties a crew changes packs.

    Args:
        ground: The site; its speedup is taken to be 1.
        plan: Over all of its segments, for its vehicles.
        faults: As ``--fault`` takes them: ``uav2:crash@300s``.
        seed: Of the links' chance.
        craft: Changes a simulated vehicle: its charge, its pack, the wind.
        onlookers: Who looks on.
        sorties: The day whose first sorties the plan is; without it a single flight.
        limit_s: Of the flight's time after the launch.

    Raises:
        SimulatorError: a fault cannot be read, or names nobody.
        PreflightFailed: a vehicle does not become ready.
        FlightNotFlown: the checklist stops the flight.
    """
    flight = ground.site.flight.model_copy(update={"speedup": 1.0})
    ground = replace(ground, site=ground.site.model_copy(update={"flight": flight}))
    began_s = time.perf_counter()
    sky = partial(_VirtualRun, ground, plan, faults, seed, craft, onlookers or FlightObservers(), sorties)
    flown = run_virtual(lambda: sky().fly(limit_s))
    return replace(flown, took_s=time.perf_counter() - began_s)


class SilentConsole:
    """A console that nobody looks at."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show nothing."""

    def show_checks(self, found: Sequence[Check]) -> None:
        """Show nothing."""

    def confirm(self, question: str) -> bool:  # noqa: ARG002 - as a console is asked
        """Say yes."""
        return True

    async def ask(self, question: str) -> bool:  # noqa: ARG002 - as a console is asked
        """Say yes."""
        return True

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Show nothing."""

    def stop_drawing(self) -> None:
        """There is nothing to end."""


class _VirtualRun:
    """A flight on its way."""

    def __init__(
        self, ground: SiteModel, plan: PlanFile, faults: Sequence[str], seed: int,
        craft: Callable[[SimVehicle], SimVehicle], onlookers: FlightObservers, sorties: DayScenario | None,
    ) -> None:  # fmt: skip
        day = None if sorties is None else sorties.day
        self._order = FlightRequest(ground.site, Path(), ground, plan, Path(), lambda _: (), day=day)
        self._onlookers, self._sorties = onlookers, sorties
        self._solver = InProcessSolver(plan.solved.seed, takes_s=ground.site.flight.solve_s)
        simulated = fleet_of(ground, speedup=1.0, faults=faults, seed=seed, wind=1.0, failsafe=True)
        setup = site_model.build_flight_setup(ground)
        self._radios = {}
        for config in simulated.vehicles:
            rule = dialect_for(config.autopilot.value).return_parameters
            height = {rule.height: setup.return_height_m(config.name) / rule.unit_m}
            raised = replace(config, parameters={**config.parameters, **height})
            self._radios[config.name] = MemoryRadio(SimulatedVehicle(craft(raised), simulated.faults), config.sysid)
        self._vehicles = {name: radio.vehicle for name, radio in self._radios.items()}
        self._crew = None if sorties is None else PadCrew(self._vehicles, sorties.packs)
        self._losses = [] if sorties is None else sorted(sorties.losses)
        self._flight: Flight | None = None
        """None before it begins, and while the ground station is away."""
        self._launched_s = 0.0
        self._truths: list[Truth] = []
        self._said: list[tuple[float, Say]] = []

    async def _upload_fences(
        self, context: Context, links: Mapping[str, OpenLink], clock: SystemClock, first: Mapping[str, Fence]
    ) -> None:
        """Put the fences on board, with the parameters that they need; a day's are looked at after every boot."""
        if not first and self._sorties is None:
            return
        changes = await read_changes(context, links, clock)
        for name in links:
            await set_changes(links[name], clock, changes.changes_of(name))
        for name, lists in build_wanted_lists(context, first).items():
            await load_lists(name, links[name], clock, context.vehicles[name].dialect, lists)

    async def fly(self, limit_s: float) -> VirtualFlight:
        """Fly from the first heartbeat to the end."""
        loop = asyncio.get_running_loop()
        clock = SystemClock(1.0, 0.0, 0.0, loop.time, (0.0, 0.0))
        links = {name: radio.link for name, radio in self._radios.items()}
        for radio in self._radios.values():
            radio.stop_unread_streams()
        beats = asyncio.create_task(send_heartbeats(links, clock))
        tasks = [asyncio.create_task(run_radios(self._radios.values(), self._update, every_s=STEP_S)), beats]
        console = SilentConsole()
        try:
            facts = await interview_vehicles(self._order, links, clock, console)
            context, boards, found = build_context_and_checklist(self._order, facts)
            stops = [check for check in found if check.severity is Severity.STOP]
            if stops:
                raise FlightNotFlown(f"a flight in virtual time: {stops[0].subject}: {stops[0].text}")
            first = build_first_fences(context, boards)
            await self._upload_fences(context, links, clock, first)
            await upload_first_missions(context, links, clock, boards, console)
            launched_s = self._launched_s = clock.now_s()
            observer = Observer(
                lambda line, at_s: self._said.append((at_s, line)),
                lambda event, state, now_s: self._onlookers.applied(context, event, state, now_s),
            )
            ahead = {} if self._order.day is None else day_flight.sorties_ahead_of(self._order.day)
            state = fleet_step.build_initial_state(boards, fences=first, ahead=ahead)
            wired = partial(
                Flight, context, links=links, clock=clock, sink=self._onlookers.sink, solver=self._solver,
                observer=observer,
            )  # fmt: skip
            flight = self._flight = wired(state)
            ended, reopened = False, None
            for away_s in () if self._sorties is None else sorted(self._sorties.away_s):
                ended = await self._run_until_absence(flight, launched_s + away_s, reopened)
                if ended:
                    break
                self._flight, reopened = None, Reopened(0.0, AWAY_S, ())
                beats.cancel()
                await asyncio.sleep(AWAY_S)
                beats = asyncio.create_task(send_heartbeats(links, clock))
                tasks.append(beats)
                flight = self._flight = wired(round_trip_state(flight.state))
            ended = ended or await _run_to_end(flight, launched_s + limit_s, reopened)
            ended_s = clock.now_s()
            await asyncio.sleep(STANDS_S)
        finally:
            for task in tasks:
                task.cancel()
            for result in await asyncio.gather(*tasks, return_exceptions=True):
                if isinstance(result, Exception):
                    raise result
        happened = [one for truth in self._truths if (one := find_injected_fault(truth, truth.t_s)) is not None]
        frames = {name: link.counts for name, link in links.items()}
        report = build_report(context, flight.state, ended_s, happened, frames, PreflightRecord(facts, found))
        crafts = {name: _build_outcome(radio.vehicle) for name, radio in self._radios.items()}
        return VirtualFlight(
            report, context, flight.state, boards, tuple(self._truths), crafts, tuple(self._said), launched_s,
            ended_s - launched_s, ended, 0.0,
        )  # fmt: skip

    def _update(self, now_s: float) -> None:
        for radio in self._radios.values():
            self._truths += radio.vehicle.drain_truths(lambda at_s: at_s)
        self._onlookers.lived(self._vehicles)
        if self._flight is not None and self._crew is not None and self._launched_s:
            self._crew.attend(self._flight, now_s)
        if self._losses and self._launched_s and now_s - self._launched_s >= self._losses[0][0]:
            self._crash_vehicle(self._losses[0][1])

    def _crash_vehicle(self, name: str) -> None:
        """Have a vehicle fall, once it is well in the air."""
        frame = self._vehicles[name].autopilot.frame
        if frame.crashed_s is None and frame.body.up_m > FALLS_FROM_M:
            del self._losses[0]
            self._vehicles[name].apply_injection(parse_fault(f"{name}:crash@0s"))

    async def _run_until_absence(self, flight: Flight, at_s: float, reopened: Reopened | None) -> bool:
        """Supervise until the ground station dies; returns whether everything was over before."""
        flying = asyncio.create_task(flight.run(reopened, PATIENCE_S))
        try:
            await asyncio.wait({flying}, timeout=at_s - asyncio.get_running_loop().time())
            while not flying.done() and flight.state.replanning.replan is not None:
                await asyncio.wait({flying}, timeout=STEP_S)
            return flying.done()
        finally:
            flying.cancel()
            await asyncio.gather(flying, return_exceptions=True)


async def _run_to_end(flight: Flight, until_s: float, reopened: Reopened | None = None) -> bool:
    flying = asyncio.create_task(flight.run(reopened, PATIENCE_S))
    try:
        async with asyncio.timeout_at(until_s):
            await asyncio.shield(flying)
    except TimeoutError:
        flight.stop_supervising()
        with suppress(asyncio.CancelledError):
            await flying
        return False
    finally:
        flying.cancel()
    return True


def _build_outcome(vehicle: SimulatedVehicle) -> VehicleOutcome:
    frame = vehicle.autopilot.frame
    body = frame.body
    away_m = (body.east_m**2 + body.north_m**2) ** 0.5
    broken = frame.wrecked or frame.crashed_s is not None
    return VehicleOutcome(frame.battery.charge_pct, frame.armed, broken, away_m, body.up_m)
