"""A computer that cannot keep up: the program's own time-outs count only the time in which it could work.

The host stalls in virtual time: a callback keeps the loop from everything else for as long as it is told.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from itertools import pairwise

import pytest

from executor.core import fleet_step
from executor.core.interface.events import Tick
from executor.core.interface.messages import Heartbeat, SendCommand
from executor.protocols.machine import Accepted, TimedOut
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime import procedures
from executor.runtime.dialogue import BEAT_REAL_S, MOST_REAL_S, Lateness, awake, run_dialogue
from missions import ARDUPILOT, PX4, Dialect, Inspection, build_flight_path, encode, plan_flight_setup
from simulator.virtual_loop import VirtualLoop, run_virtual
from tests.executor.core.stories import under_way
from tests.fakes.clock import LoopClock
from tests.fakes.link import Air, FakeLink
from tests.fakes.vehicle import FakeAutopilot
from tests.missions.builders import line_east

ARM = CommandDialogue(SendCommand(400), "arm")
PATH = build_flight_path(plan_flight_setup(line_east(8), ["uav1", "uav2"], Inspection()), "uav1", (0, 2, 4, 6))


def loop() -> VirtualLoop:
    running = asyncio.get_running_loop()
    assert isinstance(running, VirtualLoop)
    return running


async def _keeps_stalling(for_s: float, works_s: float) -> None:
    while True:
        await asyncio.sleep(works_s)
        loop().advance(for_s)


async def on_a_host_that_stalls(work: Coroutine[None, None, object], for_s: float, works_s: float = 0.05) -> object:
    """Do something on a host that lets the program work now and then."""
    stalls = asyncio.create_task(_keeps_stalling(for_s, works_s))
    try:
        return await work
    finally:
        stalls.cancel()
        with suppress(asyncio.CancelledError):
            await stalls


def test_a_clock_of_work_stands_still_while_the_program_does() -> None:
    async def seen() -> tuple[float, float]:
        clock = LoopClock()
        with awake(clock) as able:
            began_s = able.now_s()
            await asyncio.sleep(1.0)
            worked_s = able.now_s() - began_s
            loop().advance(30.0)
            return worked_s, able.now_s() - began_s

    worked_s, after_s = run_virtual(seen)
    assert worked_s == pytest.approx(1.0)
    assert after_s <= worked_s + MOST_REAL_S + BEAT_REAL_S


def test_it_never_goes_back() -> None:
    async def seen() -> list[float]:
        with awake(LoopClock()) as able:
            times = []
            for number in range(40):
                await asyncio.sleep(0.04)
                times.append(able.now_s())
                loop().advance(0.1 * (number % 7))
                times.append(able.now_s())
        return times

    times = run_virtual(seen)
    assert times == sorted(times)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("dialect", "for_s"), [(ARDUPILOT, 3.0), (PX4, 2.0)], ids=lambda one: getattr(one, "name", one)
)
def test_an_upload_comes_to_its_end_however_busy_the_host_is(dialect: Dialect, for_s: float, seed: int) -> None:
    """A fifth is lost each way: by the clock of the day, 18 of 20 seeds come to their end on either autopilot."""

    async def flown() -> object:
        clock = LoopClock()
        link = FakeLink(FakeAutopilot(dialect), clock, Air(loss=0.2, delay_s=(0.01, 0.03)), seed=seed)
        try:
            work = procedures.upload_and_verify(link, clock, dialect, encode(PATH, dialect).items)
            return await on_a_host_that_stalls(work, for_s)
        finally:
            link.close()

    assert run_virtual(flown) == procedures.ProcedureResult(accepted=True)


def test_a_vehicle_is_asked_again_in_its_own_time() -> None:
    """A vehicle ends a transfer by its own clock: what is repeated does not wait until this program is quick again."""

    async def asked() -> list[float]:
        clock = LoopClock()
        link = FakeLink(FakeAutopilot(PX4), clock)
        link.cut = True
        await on_a_host_that_stalls(run_dialogue(ARM, link, clock), 0.9)
        link.close()
        return [at_s for at_s, _ in link.sent]

    times_s = run_virtual(asked)
    assert len(times_s) > 10
    assert max(after - before for before, after in pairwise(times_s)) < 2.0


@pytest.mark.parametrize("for_s", [2.0, 60.0])
def test_a_deadline_that_passed_in_a_stall_waits_for_queued_messages(for_s: float) -> None:
    async def asked() -> object:
        clock = LoopClock()
        link = FakeLink(FakeAutopilot(PX4), clock)
        try:
            return (await on_a_host_that_stalls(run_dialogue(ARM, link, clock), for_s)).outcome  # type: ignore[attr-defined]
        finally:
            link.close()

    assert run_virtual(asked) == Accepted()


def test_a_silent_vehicle_is_given_up_after_the_same_work() -> None:
    async def asked() -> tuple[object, float, int]:
        clock = LoopClock()
        link = FakeLink(FakeAutopilot(PX4), clock)
        link.cut = True
        with awake(clock) as able:
            began_s = able.now_s()
            ended = await on_a_host_that_stalls(run_dialogue(ARM, link, clock), 1.0)
            worked_s = able.now_s() - began_s
        link.close()
        return ended.outcome, worked_s, len(link.sent)  # type: ignore[attr-defined]

    outcome, worked_s, sent = run_virtual(asked)
    assert outcome == TimedOut("arm: no acknowledgement")
    assert sent >= 5
    assert worked_s == pytest.approx(5.0, abs=1.5)


def test_a_heartbeat_is_waited_for_as_long_as_the_program_works() -> None:
    async def waited(comes: Callable[[FakeLink], None]) -> bool:
        clock = LoopClock()
        link = FakeLink(FakeAutopilot(PX4), clock)
        comes(link)
        try:
            wait = procedures.wait_for(link, clock, lambda one: isinstance(one, Heartbeat), 2.0)
            return bool(await on_a_host_that_stalls(wait, 3.0))
        finally:
            link.close()

    def never(link: FakeLink) -> None:
        link.cut = True

    assert run_virtual(lambda: waited(lambda _: None))
    assert not run_virtual(lambda: waited(never))


def test_what_a_flight_loses_is_reported_once_in_a_while() -> None:
    async def said() -> list[str]:
        clock, lines = LoopClock(), []
        with awake(clock) as able:
            late = Lateness(able, clock)
            for _ in range(120):
                await asyncio.sleep(0.2)
                late.take_lost_s()
                if text := late.to_be_said():
                    lines.append(text)
                loop().advance(1.0)
        return lines

    lines = run_virtual(said)
    assert lines[0] == (
        "this computer is too busy: the ground station lost 7 of the last 11 s; its time-outs wait that long"
    )
    assert len(lines) == 3


def test_a_flight_that_keeps_up_says_nothing() -> None:
    async def said() -> list[str]:
        clock = LoopClock()
        with awake(clock) as able:
            late = Lateness(able, clock)
            told = []
            for _ in range(100):
                await asyncio.sleep(0.2)
                told.append(late.to_be_said())
                assert late.take_lost_s() == 0.0
        return told

    assert not any(run_virtual(said))


def test_a_late_tick_is_held_against_no_link() -> None:
    flight = under_way()
    heard_s = flight.vehicle("uav2").link.heard_s
    assert heard_s is not None
    state, _ = fleet_step.step(flight.context, flight.state, Tick(late_s=0.9), flight.now_s + 1.2)
    assert state.vehicles["uav2"].link.heard_s == pytest.approx(heard_s + 0.9)
    state, _ = fleet_step.step(flight.context, flight.state, Tick(), flight.now_s + 1.2)
    assert state.vehicles["uav2"].link.heard_s == heard_s
