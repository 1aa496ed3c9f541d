"""One story flown: the flight loop, the codec and the dialogues as they are, over simulated autopilots in memory.

Everything runs on the event loop's time, which looptime lets jump: a flight of minutes takes seconds. What is replaced
is the radio (datagrams go straight to the vehicle, a twentieth of a second each way), the solver (routes are dealt out
after a known time) and the disk (events are kept in a list).
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Coroutine, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from benchmarks.virtual.in_process_solver import InProcessSolver
from benchmarks.virtual.memory_flight import MemoryFlight, NullEventSink, run_until
from benchmarks.virtual.radio import MemoryRadio
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.fleet_view import FleetView, build_fleet_view
from executor.core.interface.commands import Say
from executor.core.interface.events import Event
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.core.interface.ports import OpenLink
from executor.core.preflight.onboard_failsafes import read_link_failsafe
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import build_onboard_mission
from executor.runtime import vehicle_preflight
from executor.runtime.flight_loop import Flight
from executor.site import site_model
from missions import Network, dialect_for, encode
from planner import PRESETS
from simulator.config import AutopilotKind, SimVehicle
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle
from simulator.truth import Truth
from tests.executor.builders import ground_for, site_of
from tests.fakes.solver import FakeSolver
from tests.missions.builders import line_east
from tests.stories.story import MISSION, Answers, Story, World

Got = TypeVar("Got")
LOOK_S = 1.0
"""How often somebody looks at the page, and the truth notes where everybody is."""
PATIENCE_S = 90.0
"""How long a crew waits on the ground for a flight that does not end, before it says that it is over."""
READY_S = 60.0
OFFER_S = 60.0


@dataclass(frozen=True, slots=True)
class Shown:
    """What the page showed of one vehicle."""

    at_s: float
    vehicle: str
    state: str


@dataclass(frozen=True, slots=True)
class Flown:
    """All that a story left behind."""

    story: Story
    autopilot: str
    truths: tuple[Truth, ...]
    """What really happened; ``at`` notes where a vehicle was."""
    log: tuple[tuple[float, Event], ...]
    said: tuple[tuple[float, Say], ...]
    shown: tuple[Shown, ...]
    intents: tuple[IntentRecord, ...]
    began_s: float
    """The launch."""
    ended_s: float | None
    """When the flight loop came to its own end; None if it had to be left."""
    given_up_s: float
    sysids: Mapping[str, int]
    pads: Mapping[str, tuple[float, float]]
    """Where each stands in the beginning: latitude and longitude."""
    segments: Mapping[int, tuple[tuple[float, float], tuple[float, float]]]
    """Both ends of each, in latitude and longitude."""
    inspected: Mapping[int, str]
    """What counts as inspected in the end, and by whom."""
    wanted: frozenset[int]
    reserve_pct: float
    solver_asked: int


class Sink(NullEventSink):
    """Keeps events as the log would."""

    def __init__(self) -> None:
        self.written: list[tuple[float, Event]] = []

    def write(self, event: Event, now_s: float) -> None:
        self.written.append((now_s, event))


class Sky(MemoryFlight, World):
    """A story on its way."""

    sink: Sink
    solver: FakeSolver | InProcessSolver
    patience_s = PATIENCE_S
    return_m = 40.0
    """How high they return by themselves."""
    as_prepared = False
    """Whether all else of their return is as a flight sets it."""
    in_turn = True
    """Whether a vehicle is only asked when the one before it has answered."""

    def __init__(self, story: Story, autopilot: str) -> None:
        self.story, self.autopilot = story, autopilot
        flight = {"fly_again": "ask", "offer_s": OFFER_S, **story.tables.get("flight", {})}
        site = site_of(tuple(story.fleet), autopilot, **{**story.tables, "flight": flight})
        self._ground = ground_for(site, self._network())
        self._setup = self._ground.setup
        radios = {table.name: self._radio(self._craft(table.name, table.sysid)) for table in site.vehicle}
        super().__init__(radios, FakeSolver(takes_s=story.solve_s), Sink())
        self.shown: list[Shown] = []
        self._numbers = itertools.count(1)
        self._left = list(story.moments)
        self._looked_s = self._down_s = float("-inf")

    def _network(self) -> Network:
        return line_east(self.story.pylons)

    def _radio(self, vehicle: SimVehicle) -> MemoryRadio:
        return MemoryRadio(SimulatedVehicle(vehicle), vehicle.sysid)

    def _craft(self, name: str, sysid: int) -> SimVehicle:
        pad, frame = self._setup.pad_of(name), self._setup.frame
        lat_deg, lon_deg = frame.to_wgs84_deg(pad.east_m, pad.north_m)
        dialect = dialect_for(self.autopilot)
        rule, height = dialect.ground_station_failsafe, dialect.return_parameters
        parameters = {rule.action: float(rule.action_return), rule.timeout: rule.timeout_s}
        parameters[height.height] = self.return_m / height.unit_m
        if self.as_prepared:
            parameters[height.cone] = height.cone_off
        return SimVehicle(
            name, sysid, AutopilotKind(self.autopilot), "udpin://127.0.0.1:14550", lat_deg, lon_deg, pad.alt_m,
            drone=PRESETS["mavic3"], charge_pct=self.story.charge_pct, parameters=parameters, seed=sysid,
        )  # fmt: skip

    # What a story may look at and do.

    @property
    def now_s(self) -> float:
        return self.clock.now_s()

    @property
    def state(self) -> FleetState:
        assert self.flight is not None
        return self.flight.state

    @property
    def view(self) -> FleetView:
        assert self.flight is not None
        return build_fleet_view(self.flight.context, self.flight.state, self.now_s)

    def vehicle(self, name: str) -> SimulatedVehicle:
        return self.radios[name].vehicle

    def since(self, vehicle: str, what: str) -> float | None:
        """Return how long ago a vehicle's truth said something for the first time; None if it has not."""
        for truth in self.truths:
            if truth.vehicle == vehicle and truth.what.startswith(what):
                return self.now_s - truth.t_s
        return None

    def befall(self, spec: str) -> None:
        fault = parse_fault(spec.format(**MISSION[self.autopilot]) + "@0s")
        for name, radio in self.radios.items():
            if fault.vehicle in {name, "all"}:
                radio.vehicle.apply_injection(fault)

    def ask(
        self, action: Action, vehicle: str | None, *, sure: bool = True, assets: tuple[int | str, ...] = ()
    ) -> IntentRecord:
        """Ask as a crew does: where there is a second question, it is answered with yes if they are sure."""
        record = self._asked(action, vehicle, confirmed=False, assets=assets)
        if record.outcome is Outcome.REFUSED and record.question and sure:
            record = self._asked(action, vehicle, confirmed=True, assets=assets)
        return record

    def _asked(
        self, action: Action, vehicle: str | None, *, confirmed: bool, assets: tuple[int | str, ...] = ()
    ) -> IntentRecord:
        assert self.flight is not None
        if action is Action.INCLUDE and vehicle is not None:
            self.vehicle(vehicle).autopilot.killed = False  # who sends it out again has looked at its switch
        name = f"story-{next(self._numbers)}"
        return self.flight.submit_intent(Intent(name, action, vehicle, "terminal", confirmed, assets=assets))

    # The flight.

    async def fly(self) -> Flown:
        """Connect, check, put on board, fly to the end."""
        async with self.live():
            facts = await self._with_each(self._interview(name, link) for name, link in self.links.items())
            context, boards = self._context({one.name: one for one in facts})
            await self._with_each(
                self._load(context, name, board) for name, board in boards.items() if board is not None
            )
            began_s = self.now_s
            flight = self._begin_flight(context, self._initial(boards))
            ended_s = await self._run(flight, began_s + self.story.limit_s)
        return self._flown(context, began_s, ended_s)

    async def _with_each(self, work: Iterable[Coroutine[None, None, Got]]) -> list[Got]:
        return [await one for one in work] if self.in_turn else list(await asyncio.gather(*work))

    def _initial(self, boards: Mapping[str, OnboardMission | None]) -> FleetState:
        return fleet_step.build_initial_state(boards)

    async def _run(self, flight: Flight, until_s: float) -> float | None:
        return self.now_s if await run_until(flight, until_s) else None

    async def _interview(self, name: str, link: OpenLink) -> VehicleFacts:
        return await vehicle_preflight.interview_vehicle(
            name, link, self.clock, dialect_for(self.autopilot), READY_S, lambda _: None
        )

    async def _load(self, context: Context, name: str, board: OnboardMission) -> None:
        dialect = context.vehicles[name].dialect
        mission = encode(board.path, dialect)
        await vehicle_preflight.load_mission(name, self.links[name], self.clock, dialect, mission)

    def _context(self, facts: Mapping[str, VehicleFacts]) -> tuple[Context, dict[str, OnboardMission | None]]:
        setup, dialect = self._setup, dialect_for(self.autopilot)
        task = site_model.build_first_task(self._ground, self._wanted())
        own = {name: read_link_failsafe(dialect, fact.parameters) for name, fact in facts.items()}
        context = site_model.build_context(self._ground, setup, task, own)
        paths = site_model.build_paths(setup, {name: visits for name, visits in self.story.fleet.items() if visits})
        boards = {
            name: build_onboard_mission(context, name, 0, paths[name], visits) if visits else None
            for name, visits in self.story.fleet.items()
        }
        return context, boards

    def _wanted(self) -> Sequence[int] | None:
        """Return the segments to be inspected; None is all."""
        return None

    def _after_step(self, now_s: float) -> None:
        super()._after_step(now_s)
        if self.flight is not None and self._is_under_way():
            self._happen()
            if self.now_s - self._looked_s >= LOOK_S:
                self._looked_s = self.now_s
                self._look()

    def _is_under_way(self) -> bool:
        return self.state.progress.launched_s is not None

    def _happen(self) -> None:
        due = [moment for moment in self._left if moment.when(self)]
        for moment in due:
            self._left.remove(moment)
            moment.do(self)

    def _note(self) -> None:
        """Note where everybody is."""
        for radio in self.radios.values():
            radio.vehicle.autopilot.frame.record_event("at")
            self.truths += radio.drain_truths()

    def _look(self) -> None:
        self._note()
        view = self.view
        self.shown += [Shown(self.now_s, one.name, one.state) for one in view.vehicles]
        if view.offer is not None and self.story.offers is Answers.YES:
            for name in view.offer.vehicles:
                self._answer(name)
        self._give_up()

    def _answer(self, name: str) -> None:
        self.ask(Action.INCLUDE, name)

    def _give_up(self) -> None:
        """Say that it is over when everybody has been down for long: an offer that nobody answers holds no crew."""
        frames = [radio.vehicle.autopilot.frame for radio in self.radios.values()]
        if self._down_s < 0 or any(frame.armed and not frame.wrecked for frame in frames):
            self._down_s = self.now_s
        elif self.now_s - self._down_s > self.patience_s and not self.view.recalled:
            self._down_s = self.now_s
            self.ask(Action.ABORT, None)

    def _flown(self, context: Context, began_s: float, ended_s: float | None) -> Flown:
        network, frame = context.setup.network, context.frame
        ends = {
            segment: tuple(frame.to_wgs84_deg(east, north) for east, north in network.ends_m[segment].tolist())
            for segment in context.wanted
        }
        pads = {name: frame.to_wgs84_deg(*setup.pad_m) for name, setup in context.vehicles.items()}
        state = self.state
        return Flown(
            self.story, self.autopilot, tuple(self.truths), tuple(self.sink.written), tuple(self.said),
            tuple(self.shown), tuple(state.crew.intents.values()), began_s, ended_s, self.now_s,
            {name: setup.sysid for name, setup in context.vehicles.items()}, pads,
            {segment: (one, two) for segment, (one, two) in ends.items()}, dict(state.coverage.inspected),
            context.wanted, next(iter(context.vehicles.values())).reserve_pct, len(self.solver.asked),
        )  # fmt: skip


async def flown(story: Story, autopilot: str) -> Flown:
    """Fly a story on one of the dialects."""
    return await Sky(story, autopilot).fly()
