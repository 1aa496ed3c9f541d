"""The flight loop over links in memory, with autopilots that fly what was uploaded to them."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from executor import supervised
from executor.core import fleet_step
from executor.core.interface.commands import Level, Say, Solve
from executor.core.interface.events import Event, Heard, IntentReceived, ReturnAllOrdered, SolveEnded, Tick
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.core.interface.messages import Heartbeat, MissionCount, Outgoing, SendHeartbeat
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage
from executor.runtime import procedures
from executor.runtime.flight_loop import Flight, Observer, send_heartbeats
from missions import Pricing, encode
from tests.executor.builders import THREE, Fleet, fleet_of
from tests.fakes.clock import LoopClock
from tests.fakes.flyer import Flyer
from tests.fakes.link import CLEAN, Air, FakeLink
from tests.fakes.solver import FakeSolver

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

LOSSY = Air(loss=0.2, duplicate=0.1, delay_s=(0.01, 0.2))
PATIENCE_S = 1500.0


class Sky:
    """A fleet in the air, and the loop that supervises it."""

    def __init__(self, ready: Fleet, air: Air) -> None:
        context = ready.context
        self.ready, self.clock, self.solver = ready, LoopClock(), FakeSolver()
        self.flyers = {
            name: Flyer(setup.dialect, context.frame, setup.pad_m, context.setup.pad_of(name).alt_m)
            for name, setup in context.vehicles.items()
        }
        self.links = {
            name: FakeLink(flyer, self.clock, air, seed=seed) for seed, (name, flyer) in enumerate(self.flyers.items())
        }
        self.said: list[Say] = []
        self.written: list[Event] = []
        self.applied = 0
        self.disk = asyncio.Event()
        """Set while the disk takes what is written."""
        self.disk.set()
        self._news = asyncio.Event()
        self.flight = Flight(
            context, fleet_step.build_initial_state(dict(ready.boards)), self.links, self.clock, self, self.solver,
            Observer(lambda line, _: self.said.append(line), self._applied),
        )  # fmt: skip

    def write(self, event: Event, now_s: float) -> None:
        """Note that an event is written before it is applied."""
        assert len(self.written) == self.applied, "an event is written when the one before it has been applied"
        self.written.append(event)

    async def settle(self) -> None:
        """Wait for the disk."""
        await self.disk.wait()

    def _applied(self, event: Event, state: FleetState, now_s: float) -> None:
        assert self.written[-1] is event
        self.applied += 1
        self._news.set()

    async def load(self) -> None:
        """Put the first missions on board."""
        for name, board in self.ready.boards.items():
            if board is not None:
                dialect = self.ready.context.vehicles[name].dialect
                done = await procedures.upload_and_verify(
                    self.links[name], self.clock, dialect, encode(board.path, dialect).items
                )
                assert done.accepted

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until something holds, looked at after every event."""
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                self._news.clear()
                await self._news.wait()

    @property
    def state(self) -> FleetState:
        """The flight as it is known."""
        return self.flight.state

    def faults(self) -> list[str]:
        """The lines that announce a fault."""
        return [line.text for line in self.said if line.level is Level.FAULT]


@asynccontextmanager
async def flying(ready: Fleet, air: Air = CLEAN) -> AsyncIterator[tuple[Sky, asyncio.Task[None]]]:
    """Fly; the flight's task ends inside the block, or is left."""
    sky = Sky(ready, air)
    beat = asyncio.create_task(send_heartbeats(sky.links, sky.clock))
    await sky.load()
    task = asyncio.create_task(sky.flight.run())
    try:
        yield sky, task
        async with asyncio.timeout(PATIENCE_S):
            await task
    finally:
        beat.cancel()
        task.cancel()
        for link in sky.links.values():
            link.close()


@pytest.mark.parametrize("air", [CLEAN, LOSSY], ids=["clean", "lossy"])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_silent_vehicle_is_replaced(autopilot: str, air: Air) -> None:
    async with flying(fleet_of(autopilot=autopilot), air) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
    assert set(sky.state.coverage.inspected) == set(range(6))
    assert len(sky.faults()) == 1
    assert sky.faults()[0].startswith("uav2: link lost for ")
    assert not sky.flyers["uav1"].armed
    assert not sky.flyers["uav3"].armed
    assert sky.state.progress.separation_m is not None
    assert sky.state.progress.separation_m >= 5.0


async def test_no_command_is_sent_before_it_is_on_disk_and_messages_are_read_at_the_same_time() -> None:
    async with flying(fleet_of(), LOSSY) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        counts = {name: len(link.of_kind(MissionCount)) for name, link in sky.links.items()}
        sky.disk.clear()
        sky.links["uav2"].cut = True
        await sky.until(
            lambda: sky.state.replanning.replan is not None and sky.state.replanning.replan.solve_s is not None
        )
        applied = sky.applied
        await sky.until(lambda: sky.applied > applied + 50)
        assert {name: len(link.of_kind(MissionCount)) for name, link in sky.links.items()} == counts
        sky.disk.set()
    assert set(sky.state.coverage.inspected) == set(range(6))


async def test_in_flight_no_item_is_flagged_and_the_index_stands() -> None:
    """ArduPilot and PX4 both keep their index in a list without a flag: the beginning of the list is the same."""
    async with flying(fleet_of(autopilot="px4")) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        before = list(sky.flyers["uav1"].missions.items)
        assert before[0].current
        sky.links["uav2"].cut = True
        await sky.until(lambda: len(sky.state.replanning.records) == 1)
        after = sky.flyers["uav1"].missions.items
        assert not any(item.current for item in after)
        kept = sky.flyers["uav1"].index
        assert [replace(item, current=False) for item in before[: kept + 1]] == after[: kept + 1]


async def test_a_newer_order_takes_the_place_of_an_older_one() -> None:
    """Everybody is sent home in the midst of an upload: the vehicle is told, and flies home."""
    async with flying(fleet_of(autopilot="px4")) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.flyers["uav1"].missions.stops_at = 2
        counts = len(sky.links["uav1"].of_kind(MissionCount))
        sky.links["uav2"].cut = True
        await sky.until(lambda: len(sky.links["uav1"].of_kind(MissionCount)) > counts)
        sky.flight.apply(ReturnAllOrdered())
        sky.links["uav2"].cut = False
    assert {vehicle.stage for vehicle in sky.state.vehicles.values()} == {Stage.LANDED}
    assert len(sky.state.coverage.inspected) < 6
    assert sky.flyers["uav1"].mode == sky.flyers["uav1"].dialect.modes.return_home


async def test_a_link_regained_at_the_end_of_the_flight_still_gets_rtl() -> None:
    """Everybody else has landed, and the last that was lost says on its mission that it flies."""
    async with flying(fleet_of()) as (sky, task):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
        sky.flight.apply(ReturnAllOrdered())
        await sky.until(lambda: sky.state.progress.finished)
        assert sky.state.vehicles["uav2"].stage is Stage.LOST
        assert sky.flyers["uav2"].armed
        sky.links["uav2"].cut = False
        mission = sky.flyers["uav2"].dialect.modes.mission.custom_mode
        sky.flight.apply(Heard("uav2", Heartbeat(3, mission, True, 4)))
        assert not sky.state.progress.finished
        await asyncio.sleep(1.0)
        assert not task.done()
    assert {vehicle.stage for vehicle in sky.state.vehicles.values()} == {Stage.LANDED}
    assert sky.flyers["uav2"].mode == sky.flyers["uav2"].dialect.modes.return_home


async def test_ending_supervision_leaves_the_vehicles_on_their_missions() -> None:
    async with flying(fleet_of()) as (sky, task):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.flight.stop_supervising()
        async with asyncio.timeout(5):
            await task
        assert all(flyer.armed and flyer.mode == flyer.dialect.modes.mission for flyer in sky.flyers.values())


async def test_ending_supervision_while_the_solver_works_uploads_no_mission() -> None:
    async with flying(fleet_of()) as (sky, task):
        sky.solver = sky.flight._solver = FakeSolver(takes_s=30.0)
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
        await sky.until(lambda: bool(sky.solver.asked))
        counts = {name: len(link.of_kind(MissionCount)) for name, link in sky.links.items()}
        assert sky.flight.stop_supervising() == ()
        async with asyncio.timeout(5):
            await task
        assert {name: len(link.of_kind(MissionCount)) for name, link in sky.links.items()} == counts


async def test_ending_supervision_during_an_upload_leaves_no_mix_on_board() -> None:
    async with flying(fleet_of(autopilot="ardupilot")) as (sky, task):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
        await sky.until(lambda: any(vehicle.assignment.pending for vehicle in sky.state.vehicles.values()))
        waits_for = sky.flight.stop_supervising()
        assert waits_for
        async with asyncio.timeout(60):
            await task
        assert all(sky.state.vehicles[name].assignment.pending is None for name in waits_for)
        assert not any(sky.state.vehicles[name].fault for name in waits_for)


async def test_ending_the_program_at_once_waits_for_no_vehicle() -> None:
    async with flying(fleet_of(autopilot="ardupilot")) as (sky, task):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
        await sky.until(lambda: any(vehicle.assignment.pending for vehicle in sky.state.vehicles.values()))
        assert sky.flight.stop_supervising(at_once=True) == ()
        async with asyncio.timeout(0.1):
            await task


async def test_a_fault_while_the_solver_works_cancels_it() -> None:
    async with flying(fleet_of({**THREE, "uav4": (12, 14)}, pylons=9)) as (sky, _):
        sky.solver = sky.flight._solver = FakeSolver(takes_s=30.0)
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
        await sky.until(lambda: bool(sky.solver.asked))
        sky.flyers["uav3"].percent -= 30.0
        await sky.until(lambda: bool(sky.solver.cancelled))
        assert sky.solver.cancelled == [1]
        sky.solver._takes_s = 0.3
        await sky.until(lambda: len(sky.state.replanning.records) == 1)
        assert sky.state.replanning.records[0].revision == 2
    assert set(sky.state.coverage.inspected) == set(range(8))


async def test_an_error_in_one_decision_ends_no_supervision() -> None:
    async with flying(fleet_of()) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.flight.apply(Heard("nobody", Heartbeat(3, 3, armed=True, system_status=4)))
        sky.applied += 1
        sky.flight.apply(Heard("nobody", Heartbeat(3, 3, armed=True, system_status=4)))
        sky.applied += 1
    assert sky.faults() == ["internal error while handling Heard: KeyError: 'nobody'"]
    assert set(sky.state.coverage.inspected) == set(range(6))


async def test_an_order_that_dies_of_our_mistake_ends_like_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its vehicle is not waited for for ever, and nobody else notices."""
    said = list[str]()

    async def mistaken(*_: object, **__: object) -> None:
        raise KeyError("speed")

    async with flying(fleet_of()) as (sky, _):
        with supervised.watch_internal_errors(said.append, None):
            await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
            monkeypatch.setattr(procedures, "give_order", mistaken)
            sky.flight.apply(IntentReceived(Intent("w1", Action.HOLD, "uav2", "terminal")))
            await sky.until(lambda: sky.state.crew.intents["w1"].outcome is Outcome.FAILED)
    assert said == ["internal error in an order to uav2: KeyError: 'speed'"]
    assert set(sky.state.coverage.inspected) == set(range(6))


async def test_a_solver_that_dies_of_our_error_is_started_again_and_ends_no_supervision() -> None:
    class Mistaken(FakeSolver):
        async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
            if not self.asked:
                self.asked.append(problem)
                raise ValueError("no such vehicle")
            return await super().solve(problem, pricing)

    async with flying(fleet_of()) as (sky, _):
        sky.solver = sky.flight._solver = Mistaken()
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        sky.links["uav2"].cut = True
    assert len(sky.solver.asked) > 1
    assert set(sky.state.coverage.inspected) == set(range(6))


async def test_a_tick_that_dies_is_there_again_at_once() -> None:
    class Wrong(LoopClock):
        def now_s(self) -> float:
            task = asyncio.current_task()
            if task is not None and task.get_name() == "tick" and next(looks) == 100:
                raise ZeroDivisionError
            return super().now_s()

    looks, said = itertools.count(), list[str]()
    async with flying(fleet_of()) as (sky, _):
        with supervised.watch_internal_errors(said.append, None):
            sky.flight._clock = Wrong()
            await sky.until(lambda: bool(said))
            ticks = sum(isinstance(event, Tick) for event in sky.written)
            await sky.until(lambda: sum(isinstance(event, Tick) for event in sky.written) > ticks + 10)
    assert [line.partition(": ")[0] for line in said] == ["internal error in the tick"]
    assert set(sky.state.coverage.inspected) == set(range(6))


async def test_one_link_that_fails_keeps_no_heartbeat_from_the_others() -> None:
    class Broken(FakeLink):
        def send(self, message: Outgoing) -> None:
            raise RuntimeError("no such port")

    ready, clock, said = fleet_of(), LoopClock(), list[str]()
    flyer = Flyer(ready.context.vehicles["uav1"].dialect, ready.context.frame, (0, 0), 0.0)
    broken, whole = Broken(flyer, clock), FakeLink(flyer, clock)
    with supervised.watch_internal_errors(said.append, None), pytest.raises(TimeoutError):
        async with asyncio.timeout(10.5):
            await send_heartbeats({"uav1": broken, "uav2": whole}, clock)
    for link in (broken, whole):
        link.close()
    assert len(whole.of_kind(SendHeartbeat)) == 11
    assert said == ["internal error in our heartbeat to uav1: RuntimeError: no such port"]


async def test_a_failing_display_cannot_block_a_decision() -> None:
    def gone(*_: object) -> None:
        raise OSError(5, "input/output error")

    async with flying(fleet_of()) as (sky, _):

        def seen(event: Event, state: FleetState, now_s: float) -> None:
            sky._applied(event, state, now_s)
            gone()

        sky.flight._observer = Observer(gone, seen, gone)
    assert set(sky.state.coverage.inspected) == set(range(6))


@pytest.mark.parametrize("speedup", [1.0, 20.0])
async def test_our_heartbeat_keeps_the_vehicles_time(speedup: float) -> None:
    """Their failsafes run on the vehicle's clock: at five times the speed a beat a second is too few (measured)."""
    clock = LoopClock(speedup)
    link = FakeLink(Flyer(fleet_of().context.vehicles["uav1"].dialect, fleet_of().context.frame, (0, 0), 0.0), clock)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(10.5 / speedup):
            await send_heartbeats({"uav1": link}, clock)
    link.close()
    assert len(link.of_kind(SendHeartbeat)) == 11


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_vehicle_holds_and_continues_at_the_speed_of_its_leg(autopilot: str) -> None:
    async with flying(fleet_of(autopilot=autopilot)) as (sky, _):

        def ask(action: Action) -> IntentRecord:
            intent = Intent(action.value, action, "uav2", "terminal")
            sky.flight.apply(IntentReceived(intent))
            return sky.state.crew.intents[intent.id]

        def halfway() -> bool:
            run = sky.state.vehicles["uav2"].assignment.run
            return run is not None and run.furthest_m > 30.0

        await sky.until(halfway)
        assert ask(Action.HOLD).outcome is Outcome.ACCEPTED
        await sky.until(lambda: sky.state.crew.intents["hold"].outcome is Outcome.DONE)
        assert sky.flyers["uav2"].mode == sky.flyers["uav2"].dialect.modes.hold
        place_m = sky.flyers["uav2"].place_m
        await asyncio.sleep(60.0)
        assert sky.flyers["uav2"].place_m == place_m
        ask(Action.RESUME)
        await sky.until(lambda: sky.state.crew.intents["resume"].outcome is Outcome.DONE)
    assert set(sky.state.coverage.inspected) == set(range(6))
    assert sky.faults() == []
    assert sky.state.vehicles["uav2"].assignment.runs_broken == ()
    assert sky.state.replanning.records == ()
