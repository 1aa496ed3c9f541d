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
from executor.core.preflight.failsafe_parameters import read_link_failsafe
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import build_onboard_mission
from executor.errors import ConnectionFailed
from executor.runtime import vehicle_preflight
from executor.runtime.flight_loop import Flight, Observer, send_heartbeats
from executor.site import site_model
from executor.virtual.loop import VirtualLoop, run_virtual
from missions import Network, build_flight_path, dialect_for, encode
from simulator.faults import parse_fault
from tests.stories.story import Answers, Story
from tests.stories.world import Flown, Sky
from tests.storm.air import STEP_S, Air, suffers
from tests.storm.machine import Deputy, Disk
from tests.storm.plot import ALL, GROUND, Happening, Plot, network_named

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

    patience_s = 25.0
    return_m = 32.0

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        self._rng = random.Random(f"air {plot.seed}")
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
        self.airs = {
            name: Air(radio.vehicle, radio.link.sysid, random.Random(f"{plot.seed} {name}"))
            for name, radio in self.radios.items()
        }
        self.disk, self.deputy = Disk(), Deputy(self._ground, plot.solve_s)
        self.sink = self.disk
        self.began: list[tuple[float, Happening]] = []
        self.mistakes: list[str] = []
        self.left = False
        self._due = sorted(plot.happenings, key=lambda one: one.at_s)
        self._then: list[tuple[float, int, str]] = []
        self._number = itertools.count()
        self._flying: asyncio.Task[None] | None = None
        self._beat: asyncio.Task[None] | None = None
        self._away_until_s: float | None = None
        self._reopened: Reopened | None = None
        self._sent_again_s: dict[str, float] = {}
        self._up = asyncio.Event()
        last_s = max((one.ends_s for one in plot.happenings), default=0.0)
        self._quiet_s = last_s + QUIET_S
        self._launch_s: float | None = None

    def _network(self) -> Network:
        return network_named(self.plot.network)

    # The flight.

    async def storm(self) -> Stormed:
        """Connect, check, put on board, fly to the end, whatever happens."""
        asyncio.get_running_loop().set_exception_handler(lambda _, context: self._died(context))
        living = asyncio.create_task(self._live(), name="live")
        links = {name: air.link for name, air in self.airs.items()}
        self._beat = asyncio.create_task(send_heartbeats(links, self.clock))
        ended_s = None
        try:
            asked = [self._interview(name, link) for name, link in links.items()]
            facts = {fact.name: fact for fact in await asyncio.gather(*asked)}
            self.context, boards = self._ready({name: read_link_failsafe(dialect_for(self.autopilot), fact.parameters)
                for name, fact in facts.items()})  # fmt: skip
            await asyncio.gather(*(self._loaded(name, board) for name, board in boards.items() if board is not None))
            self._boards = boards
            self._launch_s = self.now_s
            try:
                async with asyncio.timeout_at(self._launch_s + self._quiet_s + LIMIT_S):
                    await self._to_the_end()
                ended_s = self.now_s
            except TimeoutError:
                pass
        finally:
            self._beat.cancel()
            living.cancel()
            for task in (self._flying, living):
                if task is not None:
                    task.cancel()
                    with suppress(asyncio.CancelledError):
                        await asyncio.gather(task, return_exceptions=True)
            if not living.cancelled() and living.exception() is not None:
                raise living.exception()  # type: ignore[misc]
        self._note()
        flown = self._flown(self.context, self._launch_s, ended_s)
        shown = {one.name: one.state for one in self.view.vehicles}
        return Stormed(
            self.plot, flown, tuple(self.began), tuple(self.mistakes), self.left, shown,
            self.context.setup.layers.spacing_m,
        )  # fmt: skip

    def _died(self, context: Mapping[str, object]) -> None:
        error = context.get("exception")
        self.mistakes.append(f"{context.get('message')}: {_where(error) if isinstance(error, Exception) else ''}")

    async def _loaded(self, name: str, board: OnboardMission) -> None:
        dialect = self.context.vehicles[name].dialect
        await vehicle_preflight.load_mission(
            name, self.airs[name].link, self.clock, dialect, encode(board.path, dialect)
        )

    def _ready(self, own: Mapping[str, object]) -> tuple[Context, dict[str, OnboardMission | None]]:
        setup = self._setup
        task = site_model.build_first_task(
            self._ground, sorted({v >> 1 for visits in self.plot.routes.values() for v in visits})
        )
        context = site_model.build_context(self._ground, setup, task, own)  # type: ignore[arg-type]
        boards = {
            name: build_onboard_mission(context, name, 0, build_flight_path(setup, name, visits), visits)
            if visits
            else None
            for name, visits in self.plot.routes.items()
        }
        return context, boards

    async def _to_the_end(self) -> None:
        """Fly, and take the flight up again as often as the ground station is killed."""
        state = fleet_step.build_initial_state(self._boards)
        while True:
            links = {name: air.link for name, air in self.airs.items()}
            self.flight = Flight(
                self.context, state, links, self.clock, self.sink, self.deputy,
                Observer(lambda line, at_s: self.said.append((at_s, line)), lambda *_: None),
            )  # fmt: skip
            self._flying = asyncio.create_task(self.flight.run(self._reopened, PATIENCE_S), name="flight")
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
            state = self._replayed()

    def _replayed(self) -> FleetState:
        state = fleet_step.build_initial_state(self._boards)
        for at_s, event in self.disk.kept:
            with suppress(Exception):
                state, _ = fleet_step.step(self.context, state, event, at_s)
        return state

    def _die(self, until_s: float) -> None:
        """Kill the ground station: it says nothing to anybody, not even that it gives up."""
        for air in self.airs.values():
            air.close()
        self.disk.lose()
        self._up.clear()
        self._away_until_s = until_s
        assert self._flying is not None
        assert self._beat is not None
        self._flying.cancel()
        self._beat.cancel()

    def _come_back(self, set_s: float) -> None:
        last_s = self.disk.kept[-1][0] if self.disk.kept else 0.0
        self._away_until_s = None
        for air in self.airs.values():
            air.reopen()
        links = {name: air.link for name, air in self.airs.items()}
        self._beat = asyncio.create_task(send_heartbeats(links, self.clock))
        self._reopened = Reopened(1.8e9, max(0.0, self.now_s - last_s + set_s), ())
        self._up.set()

    # Time.

    async def _live(self) -> None:
        """Let time pass for everybody, and the story happen."""
        try:
            step = 0
            while True:
                step += 1
                now_s = step * STEP_S
                for air in self.airs.values():
                    air.live(now_s)
                    air.hand_over(now_s)
                    self.truths += air.truths()
                if self._launch_s is not None and self.flight is not None:
                    self._befalls()
                    step = max(step, round(self.now_s / STEP_S))  # it slept
                    if self.now_s - self._looked_s >= 1.0:
                        self._looked_s = self.now_s
                        self._look()
                await asyncio.sleep(max(0.0, (step + 1) * STEP_S - self.now_s))
        except Exception as error:
            self.mistakes.append(f"the sky: {_where(error)}")
            raise

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

    def _note(self) -> None:
        for air in self.airs.values():
            air.vehicle.autopilot.frame.record_event("at")
            self.truths += air.truths()

    def _befalls(self) -> None:
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
                self.deputy.mood = one.word
                asyncio.get_running_loop().call_later(one.for_s, self._recovers)
            case "disk":
                self.disk.full, self.disk.hangs = one.word == "full", one.word == "hangs"
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

    def befall(self, spec: str) -> None:
        fault = parse_fault(spec + "@0s")
        for name, air in self.airs.items():
            if fault.vehicle in {name, ALL}:
                air.vehicle.apply_injection(fault)

    def _later(self, one: Happening, spec: str) -> None:
        self._then.append((one.ends_s, next(self._number), spec))
        self._then.sort()

    def _asks(self, action: Action, vehicle: str | None, *, sure: bool = True) -> None:
        with suppress(RuntimeError):  # an internal error is said, and found among what was said
            self.ask(action, vehicle, sure=sure)

    def _recovers(self) -> None:
        self.deputy.mood = ""

    def _has_room(self) -> None:
        self.disk.full = self.disk.hangs = False

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
                self.truths += air.truths()
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
