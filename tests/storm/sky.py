"""One story of a storm flown: the flight loop, codec and dialogues as they are, over simulated vehicles in memory."""

from __future__ import annotations

import asyncio
import itertools
import random
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Reopened, ReturnAllOrdered
from executor.core.interface.intents import Action, IntentRecord
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import ConnectionFailed
from executor.runtime.flight_loop import Flight
from missions import Network
from simulator.config import SimVehicle
from simulator.fleet import SimulatedVehicle
from simulator.virtual_loop import VirtualLoop, run_virtual
from tests.stories.story import Answers, Story
from tests.stories.world import Flown, Sky
from tests.storm.air import STEP_S, Air, suffers
from tests.storm.machine import Deputy, Disk
from tests.storm.plot import GROUND, Happening, Plot, network_named

QUIET_S = 135.0
"""So long after the last happening, and the launch, the crew calls it a day."""
AGAIN_S = 45.0
"""Until it does so again, if somebody is still out."""
LIMIT_S = 450.0
"""After that the flight must have come to its own end."""
PATIENCE_S = 15.0
"""Of a flight that is taken up again, for the first answer."""
INSPECTION = {"height_m": 6.0, "speed_m_s": 6.0, "transit_speed_m_s": 10.0}
"""Low and fast, so that a flight is short."""
AGAIN_LATER_S = 10.0
"""Until a crew tries again whose vehicles did not answer."""
SENT_AGAIN_S = 30.0
SPECS = {
    "all silent": "silent", "battery step": "battery-step", "drain": "drain", "crash": "crash", "disarm": "disarm",
    "kill": "kill", "wreck": "wreck", "fence": "fence", "emergency": "emergency", "ekf": "ekf", "reboot": "reboot",
    "refuse-upload": "refuse-upload", "half-upload": "half-upload", "silent": "silent",
}  # fmt: skip
"""What the simulator itself makes happen."""


@dataclass(frozen=True, slots=True)
class Stormed:
    """A flight through a storm."""

    plot: Plot
    flown: Flown
    began: tuple[tuple[float, Happening], ...]
    """What happened, and when by the flight's clock."""
    mistakes: tuple[str, ...]
    """Tracebacks, tasks that died."""
    left: bool
    """Whether the supervision was told to end."""
    shown: Mapping[str, str]
    """Everybody's state as it was shown last."""
    spacing_m: float


class StormSky(Sky):
    """A story on its way."""

    step_s = STEP_S
    in_turn = False
    patience_s = 25.0
    return_m = 32.0
    sink: Disk
    solver: Deputy

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        self.airs: dict[str, Air] = {}
        super().__init__(
            Story(
                f"storm {plot.seed}", (), completes=False, fleet=plot.routes, charge_pct=plot.charge_pct,
                offers=Answers.YES if plot.answers else Answers.NOTHING, limit_s=LIMIT_S,
                tables={"inspection": INSPECTION,
                    "flight": {"fly_again": plot.fly_again, "pilot_return": plot.pilot_return}},
            ),
            plot.autopilot,
        )  # fmt: skip
        self.sink, self.solver = Disk(), Deputy(self._ground, plot.solve_s)
        self.began: list[tuple[float, Happening]] = []
        self.mistakes: list[str] = []
        self.left = False
        self._due = sorted(plot.happenings, key=lambda one: one.at_s)
        self._then: list[tuple[float, int, str]] = []
        self._number = itertools.count()
        self._flying: asyncio.Task[None] | None = None
        self._away_until_s: float | None = None
        self._reopened: Reopened | None = None
        self._sent_again_s: dict[str, float] = {}
        self._up = asyncio.Event()
        last_s = max((one.ends_s for one in plot.happenings), default=0.0)
        self._quiet_s = last_s + QUIET_S
        self._launch_s: float | None = None

    def _network(self) -> Network:
        return network_named(self.plot.network)

    def _radio(self, vehicle: SimVehicle) -> Air:
        rng = random.Random(f"{self.plot.seed} {vehicle.name}")
        self.airs[vehicle.name] = Air(SimulatedVehicle(vehicle), vehicle.sysid, rng)
        return self.airs[vehicle.name]

    def _wanted(self) -> list[int]:
        return sorted({visit >> 1 for visits in self.plot.routes.values() for visit in visits})

    # The flight.

    async def storm(self) -> Stormed:
        """Connect, check, put on board, fly to the end, whatever happens."""
        asyncio.get_running_loop().set_exception_handler(lambda _, context: self._died(context))
        flown = await self.fly()
        shown = {one.name: one.state for one in self.view.vehicles}
        spacing_m = self._setup.layers.spacing_m
        return Stormed(self.plot, flown, tuple(self.began), tuple(self.mistakes), self.left, shown, spacing_m)

    def _died(self, context: Mapping[str, object]) -> None:
        error = context.get("exception")
        self.mistakes.append(f"{context.get('message')}: {_where(error) if isinstance(error, Exception) else ''}")

    def _flown(self, context: Context, began_s: float, ended_s: float | None) -> Flown:
        self._note()
        return super()._flown(context, began_s, ended_s)

    def _is_under_way(self) -> bool:
        return self._launch_s is not None

    def _initial(self, boards: Mapping[str, OnboardMission | None]) -> FleetState:
        self._boards = boards
        return super()._initial(boards)

    async def _run(self, flight: Flight, until_s: float) -> float | None:
        self._launch_s = self.now_s
        try:
            async with asyncio.timeout_at(until_s + self._quiet_s):
                await self._to_the_end(flight)
        except TimeoutError:
            return None
        else:
            return self.now_s
        finally:
            if self._flying is not None:
                self._flying.cancel()
                await asyncio.gather(self._flying, return_exceptions=True)

    async def _to_the_end(self, flight: Flight) -> None:
        """Fly, and take the flight up again as often as the ground station is killed."""
        while True:
            self._flying = asyncio.create_task(flight.run(self._reopened, PATIENCE_S), name="flight")
            nobody = False
            try:
                await asyncio.shield(self._flying)
            except asyncio.CancelledError:
                if self._away_until_s is None:
                    raise
            except BaseExceptionGroup as errors:
                nobody = errors.subgroup(ConnectionFailed) is not None
                if not nobody:
                    self.mistakes += [_where(one) for one in errors.exceptions]
                    return
            except ConnectionFailed:
                nobody = True
            if self._away_until_s is None and not nobody:
                return
            if nobody and all(air.vehicle.autopilot.frame.crashed_s is not None for air in self.airs.values()):
                self.left = True  # the crew has found them all: nothing is there to be taken up
                return
            if nobody:  # the crew tries again
                self._die(self.now_s + AGAIN_LATER_S)
                again = Happening("ground killed", GROUND, 0.0, AGAIN_LATER_S + PATIENCE_S)
                self.began.append((self.now_s - PATIENCE_S, replace(again, for_s=again.for_s + PATIENCE_S)))
            await self._up.wait()
            flight = self._begin_flight(flight.context, self._replayed(flight.context))

    def _replayed(self, context: Context) -> FleetState:
        state = self._initial(self._boards)
        for at_s, event in self.sink.kept:
            with suppress(Exception):
                state, _ = fleet_step.step(context, state, event, at_s)
        return state

    def _die(self, until_s: float) -> None:
        """Kill the ground station: it says nothing to anybody, not even that it gives up."""
        for air in self.airs.values():
            air.close()
        self.sink.lose()
        self._up.clear()
        self._away_until_s = until_s
        assert self._flying is not None
        self._flying.cancel()
        self._stop_heartbeats()

    def _come_back(self, set_s: float) -> None:
        last_s = self.sink.kept[-1][0] if self.sink.kept else 0.0
        self._away_until_s = None
        for air in self.airs.values():
            air.connect()
        self._start_heartbeats()
        self._reopened = Reopened(1.8e9, max(0.0, self.now_s - last_s + set_s), ())
        self._up.set()

    # Time.

    def _look(self) -> None:
        if self._away_until_s is None:
            super()._look()
        else:
            self._note()

    def ask(
        self, action: Action, vehicle: str | None, *, sure: bool = True, assets: tuple[int | str, ...] = ()
    ) -> IntentRecord:
        if action is Action.INCLUDE and vehicle is not None:
            self._sent_again_s[vehicle] = self.now_s
        return super().ask(action, vehicle, sure=sure, assets=assets)

    def _answer(self, name: str) -> None:
        """Send a vehicle out again, as a crew does: not the same one every second."""
        if self.now_s - self._sent_again_s.get(name, -SENT_AGAIN_S) >= SENT_AGAIN_S:
            self.ask(Action.INCLUDE, name)

    def _happen(self) -> None:
        assert self._launch_s is not None
        since_s = self.now_s - self._launch_s
        while self._due and self._due[0].at_s <= since_s:
            one = self._due.pop(0)
            self.began.append((self.now_s, one))
            self._happens(one)
        while self._then and self._then[0][0] <= since_s:
            self.befall(self._then.pop(0)[2])
        if self._away_until_s is not None:
            if self.now_s >= self._away_until_s:
                self._come_back(
                    next((one.value for _, one in reversed(self.began) if one.kind == "ground killed"), 0.0)
                )
        elif since_s >= self._quiet_s:
            self._quiet_s += AGAIN_S
            self._call_it_a_day()

    def _happens(self, one: Happening) -> None:
        if one.vehicle != GROUND:
            for name, air in self.airs.items():
                if one.befalls(name) and suffers(air, one, self.now_s):
                    air.vehicle.autopilot.frame.record_event(f"storm {one.kind} {one.word}".rstrip())
        match one.kind:
            case "pilot" | "station":
                word, then = one.word.split()
                self.befall(f"{one.vehicle}:{one.kind}={word}")
                self._later(one, f"{one.vehicle}:{one.kind}={then}")
            case "sticks":
                self.befall(f"{one.vehicle}:sticks")
                self._later(one, f"{one.vehicle}:pilot={one.word}")
            case "bad link":
                self.befall(f"{one.vehicle}:{one.word}={one.value:g}")
                self._later(one, f"{one.vehicle}:{one.word}=0")
            case "wish" if self._away_until_s is None:
                self._asks(Action(one.word), None if one.vehicle == GROUND else one.vehicle, sure=one.value > 0)
            case "solver":
                self.solver.mood = one.word
                asyncio.get_running_loop().call_later(one.for_s, self._recovers)
            case "disk":
                self.sink.full, self.sink.hangs = one.word == "full", one.word == "hangs"
                asyncio.get_running_loop().call_later(one.for_s, self._has_room)
            case "ground sleeps" if self._away_until_s is None:
                self._sleeps(one.for_s)
            case "ground killed" if self._away_until_s is None and not self._over():
                self._die(self.now_s + one.for_s)
            case "ctrl-c" if self._away_until_s is None:
                self._interrupted(one.word)
            case kind if kind in SPECS:
                self._suffers(SPECS[kind], one)

    def _over(self) -> bool:
        return self._flying is None or self._flying.done()

    def _suffers(self, spec: str, one: Happening) -> None:
        value = one.word or (f"{one.for_s:g}s" if one.for_s else f"{one.value:g}" if one.value else "")
        self.befall(f"{one.vehicle}:{spec}={value}" if value else f"{one.vehicle}:{spec}")

    def _later(self, one: Happening, spec: str) -> None:
        self._then.append((one.ends_s, next(self._number), spec))
        self._then.sort()

    def _asks(self, action: Action, vehicle: str | None, *, sure: bool = True) -> None:
        with suppress(RuntimeError):  # an internal error is said, and found among what was said
            self.ask(action, vehicle, sure=sure)

    def _recovers(self) -> None:
        self.solver.mood = ""

    def _has_room(self) -> None:
        self.sink.full = self.sink.hangs = False

    def _sleeps(self, for_s: float) -> None:
        """Let the ground's process stand still: its clock goes on, and what is sent waits as long as there is room."""
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        begins_s = self.now_s
        for number in range(1, round(for_s / STEP_S) + 1):
            for air in self.airs.values():
                air.live(begins_s + number * STEP_S)
                if number % 10 == 0:
                    air.vehicle.autopilot.frame.record_event("at")
                self.truths += air.drain_truths()
        loop.advance(round(for_s / STEP_S) * STEP_S)

    def _interrupted(self, word: str) -> None:
        assert self.flight is not None
        if word == "once":
            self.left = True
            self.flight.stop_supervising()
        else:
            self.said.append((self.now_s, Say(Level.WARNING, "Ctrl-C")))
            self.flight.apply(ReturnAllOrdered())

    def _call_it_a_day(self) -> None:
        """Bring home who is still out: pilots theirs, the crew the others."""
        taken = {one.name for one in self.view.vehicles if one.state == "pilot"}
        for name, air in self.airs.items():
            autopilot = air.vehicle.autopilot
            if autopilot.frame.armed and (autopilot.hands or name in taken):
                self.befall(f"{name}:pilot=RTL")
        if not self._over():
            self._asks(Action.ABORT, None)


def _where(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1:]
    at = "".join(f" at {frame.filename.rpartition('/')[2]}:{frame.lineno}" for frame in last)
    return f"{type(error).__name__}: {error}{at}"


def fly(plot: Plot) -> Stormed:
    """Fly a story of a storm, in virtual time."""

    async def flying() -> Stormed:
        return await StormSky(plot).storm()

    return run_virtual(flying)
