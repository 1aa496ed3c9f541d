"""Many vehicles sending at the same time delay no task."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from selectors import EVENT_READ
from typing import cast

import pytest

from executor.adapters.clock import AT_ONCE, FairEventLoop, FairSelector, FleetTime, run_on_fair_loop

VEHICLES = 20
MESSAGES = 5


@pytest.fixture
def ports() -> Iterator[list[socket.socket]]:
    """Ports at which a fleet spoke at the same moment."""
    with ExitStack() as stack:
        ours = []
        for _ in range(VEHICLES):
            here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            stack.callback(here.close)
            stack.callback(there.close)
            here.setblocking(False)
            for _ in range(MESSAGES):
                there.send(b"heard")
            ours.append(here)
        yield ours


def test_no_task_waits_longer_than_one_round_of_reads(ports: list[socket.socket]) -> None:
    with FairSelector() as selector:
        for port in ports:
            selector.register(port, EVENT_READ)
        rounds = [{key.fd for key, _ in selector.select(0)} for _ in range(12)]
    assert all(len(one) == AT_ONCE for one in rounds)
    everybody, enough = {port.fileno() for port in ports}, -(-VEHICLES // AT_ONCE)
    for begin in range(len(rounds) - enough + 1):
        assert set().union(*rounds[begin : begin + enough]) == everybody


def test_fewer_are_taken_together(ports: list[socket.socket]) -> None:
    with FairSelector() as selector:
        for port in ports[:AT_ONCE]:
            selector.register(port, EVENT_READ)
        assert len(selector.select(0)) == AT_ONCE
        selector.unregister(ports[0])
        assert len(selector.select(0)) == AT_ONCE - 1


def test_others_have_their_turn_between_the_messages_of_a_fleet(ports: list[socket.socket]) -> None:
    heard: list[str] = []

    async def listen() -> None:
        loop = asyncio.get_running_loop()
        every = asyncio.Event()

        def read(port: socket.socket) -> None:
            port.recv(100)
            heard.append("message")
            if heard.count("message") == VEHICLES * MESSAGES:
                every.set()

        def other() -> None:
            heard.append("other")
            if not every.is_set():
                loop.call_later(0.0, other)

        for port in ports:
            loop.add_reader(port, read, port)
        other()
        await every.wait()
        for port in ports:
            loop.remove_reader(port)

    run_on_fair_loop(listen())
    most = max(len(one) for one in "".join("m" if what == "message" else "o" for what in heard).split("o"))
    assert heard.count("message") == VEHICLES * MESSAGES
    assert most <= 2 * AT_ONCE  # a deadline that comes due in a round is seen to in the next one


class Slow:
    """A time that somebody else makes, in steps, each when everything before it was dealt with."""

    def __init__(self, said: socket.socket, at_s: float) -> None:
        self.is_synchronised = True
        self.at_s = at_s
        self.steps: list[float] = []
        self.rests = 0
        self._said = said

    def steady_s(self) -> float:
        return self.at_s

    def note_idle(self) -> bool:
        if self.steps:
            self.at_s += self.steps.pop(0)
            return True
        self.rests += 1
        self._said.send(b"more")
        return False

    def note_busy(self) -> None:
        return

    def note_silence(self) -> None:
        self.is_synchronised = False


def test_deadlines_go_by_another_time_after_everything_that_came_before_it() -> None:
    """Ten messages lie there when a second passes: all of them are heard before the deadline at its end."""
    happened: list[str] = []
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    heard, speaks = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)

    async def fly() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, FairEventLoop)
        pace = Slow(there, 500.0)

        def more() -> None:
            here.recv(100)
            for _ in range(10):
                speaks.send(b"heard")
            pace.steps.append(1.0)

        loop.add_reader(here, more)
        loop.add_reader(heard, lambda: happened.append(heard.recv(100).decode()))
        with loop.follow_pacemaker(cast("FleetTime", pace)):
            before_s = loop.time()
            for _ in range(3):
                await asyncio.sleep(1.0)
                happened.append(f"{loop.time() - before_s:.1f} s")
        loop.remove_reader(here)
        loop.remove_reader(heard)

    with here, there, heard, speaks:
        run_on_fair_loop(fly())
    assert happened == [*["heard"] * 10, "1.0 s", *["heard"] * 10, "2.0 s", *["heard"] * 10, "3.0 s"]


def test_without_another_time_the_computers_time_runs() -> None:
    async def fly() -> float:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, FairEventLoop)
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        with here, there:
            pace = Slow(there, 7.0)
            with loop.follow_pacemaker(cast("FleetTime", pace)):
                pace.is_synchronised = False
                await asyncio.sleep(0)
            before_s = loop.time()
            await asyncio.sleep(0.01)
            return loop.time() - before_s

    assert run_on_fair_loop(fly()) >= 0.01
