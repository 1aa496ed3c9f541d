"""A day of two vehicles with two sorties each, flown in virtual time, and a crew that changes packs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from benchmarks.pad_crew import PadCrew
from benchmarks.virtual.in_process_solver import InProcessSolver
from executor.adapters.eventlog import from_plain, to_plain
from executor.core import fleet_step
from executor.core.battery.pack_condition import PackHistory
from executor.core.context import Context, DayRules, PackRules
from executor.core.interface.events import Reopened
from executor.core.interface.intents import IntentRecord
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission, PlannedSortie
from executor.runtime.flight_loop import Flight
from missions import Network
from simulator.config import SimVehicle
from tests.missions.builders import line_east
from tests.stories.story import Moment, Routes, Story, When
from tests.stories.world import Flown, Sky

FIRST: Routes = {"uav1": (0, 2), "uav2": (4, 6)}
LATER: Mapping[str, tuple[tuple[int, ...], ...]] = {"uav1": ((8, 10),), "uav2": ((12, 14),)}
STAGGER_S = 10.0
LONG_S = 3600.0
HISTORY = PackHistory("", 3, (3.0, 0.1))
AWAY_S = 15.0
"""So long the ground station is away."""


@dataclass(frozen=True, slots=True)
class Crew:
    """What the crew does between two sorties."""

    packs: Mapping[str, float]
    """What each pack really holds, by its id; put in one after the other."""
    confirms: bool = True
    """Whether it says so."""


@dataclass(frozen=True, slots=True)
class Day:
    """What is planned, and what happens."""

    crew: Crew
    first: Routes = field(default_factory=lambda: FIRST)
    later: Mapping[str, tuple[tuple[int, ...], ...]] = field(default_factory=lambda: LATER)
    """The sorties of each vehicle after its first."""
    segments: int = 8
    moments: tuple[Moment, ...] = ()
    windows_s: tuple[tuple[float, float], ...] = ((0.0, LONG_S),)
    ruled: bool = True
    """Whether it is a day's plan that is flown; else a single flight."""
    budgets_pct: Mapping[str, float] = field(default_factory=dict)
    """Of packs that are known by their labels."""
    forgets: Mapping[str, float] = field(default_factory=dict)
    """Parameters that a vehicle has with every new pack, as it boots."""
    bases: Mapping[str, str] = field(default_factory=dict)
    """Of vehicles that have another than the depot."""
    packs: Mapping[str, PackRules] = field(default_factory=dict)
    """Of each base that the plan counts the packs of."""
    dies: When | None = None
    """When the ground station dies, and comes back a while later."""


class DaySky(Sky):
    """A day on its way."""

    step_s = 0.1
    patience_s = 400.0
    as_prepared = True

    def __init__(self, day: Day, autopilot: str) -> None:
        self.day = day
        self._packs = iter(day.crew.packs.items())
        self._died = asyncio.Event()
        super().__init__(Story("a day", day.moments, fleet=day.first, limit_s=LONG_S), autopilot)
        vehicles = {name: radio.vehicle for name, radio in self.radios.items()}
        self._crew = PadCrew(vehicles, self._next_pack, confirms=day.crew.confirms)
        self.solver = InProcessSolver(1, takes_s=1.0, settled=500)
        for radio in self.radios.values():
            radio.stop_unread_streams()

    def _next_pack(self, name: str) -> tuple[str, float] | None:
        for parameter, value in self.day.forgets.items():
            self.vehicle(name).autopilot.params[parameter] = value
        return next(self._packs, None)

    @property
    def lines(self) -> list[str]:
        """What the crew was told, without when."""
        return [line.text for _, line in self.said]

    def swap(self, name: str, pack: str, *, confirmed: bool = True) -> IntentRecord:
        assert self.flight is not None
        return self._crew.swap(self.flight, name, pack, confirmed=confirmed)

    @property
    def asked(self) -> list[IntentRecord]:
        """What the crew asked for."""
        return self._crew.asked

    def _network(self) -> Network:
        return line_east(self.day.segments + 1)

    def _craft(self, name: str, sysid: int) -> SimVehicle:
        self.return_m = self._setup.return_height_m(name)  # as the flight would have set it
        return super()._craft(name, sysid)

    def _context(self, facts: Mapping[str, VehicleFacts]) -> tuple[Context, dict[str, OnboardMission | None]]:
        context, self._boards = super()._context(facts)
        known = {label: replace(HISTORY, label=label) for label in self.day.budgets_pct}
        setups = {
            name: replace(
                setup,
                packs={
                    label: replace(setup, budget_pct=self.day.budgets_pct[label], history=known[label])
                    for label in known
                },
            )
            for name, setup in context.vehicles.items()
        }
        context = replace(context, vehicles=setups)
        if self.day.ruled:
            everybody = tuple(context.vehicles)
            windows = dict.fromkeys(everybody, self.day.windows_s)
            bases = {**dict.fromkeys(everybody, "depot"), **self.day.bases}
            context = replace(context, day=DayRules(STAGGER_S, bases, windows, packs=self.day.packs))
        return context, self._boards

    def _initial(self, boards: Mapping[str, OnboardMission | None]) -> FleetState:
        if not self.day.ruled:
            return fleet_step.build_initial_state(boards)
        sorties = {name: (visits, *self.day.later.get(name, ())) for name, visits in self.day.first.items()}
        ahead = {name: tuple(PlannedSortie(one, 0.0) for one in own) for name, own in sorties.items()}
        return fleet_step.build_initial_state(boards, ahead=ahead)

    async def _run(self, flight: Flight, until_s: float) -> float | None:
        if self.day.dies is None:
            return await super()._run(flight, until_s)
        flying = asyncio.create_task(flight.run())
        await self._died.wait()
        flying.cancel()
        await asyncio.gather(flying, return_exceptions=True)
        self.flight = None
        await asyncio.sleep(AWAY_S)
        again = self._begin_flight(flight.context, self._by_the_log(flight.context))
        async with asyncio.timeout_at(until_s):
            await again.run(Reopened(0.0, AWAY_S, ()), 10.0)
        return self.now_s

    def _by_the_log(self, context: Context) -> FleetState:
        """Return the state that the log gives, as it is written and read again."""
        state = self._initial(self._boards)
        for now_s, event in self.sink.written:
            state, _ = fleet_step.step(context, state, from_plain(json.loads(json.dumps(to_plain(event)))), now_s)
        return state

    def _happen(self) -> None:
        super()._happen()
        if self.day.dies is not None and self.day.dies(self):
            self._died.set()

    def _look(self) -> None:
        super()._look()
        if self.flight is not None:
            self._crew.attend(self.flight, self.now_s)


async def day_flown(day: Day, autopilot: str) -> tuple[DaySky, Flown]:
    """Fly a day on one of the dialects."""
    sky = DaySky(day, autopilot)
    return sky, await sky.fly()
