"""Virtual time: no real waiting, and every event keeps its order."""

from __future__ import annotations

import asyncio

from simulator.virtual_loop import VirtualLoop, run_virtual


def test_hours_pass_at_once_and_in_order() -> None:
    happened: list[tuple[float, str]] = []

    async def does(what: str, every_s: float, times: int) -> None:
        for _ in range(times):
            await asyncio.sleep(every_s)
            happened.append((asyncio.get_running_loop().time(), what))

    async def work() -> float:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(does("slow", 3600.0, 2))
            tasks.create_task(does("fast", 1500.0, 3))
        return asyncio.get_running_loop().time()

    assert run_virtual(work) == 7200.0
    assert happened == [(1500.0, "fast"), (3000.0, "fast"), (3600.0, "slow"), (4500.0, "fast"), (7200.0, "slow")]


def test_a_time_out_comes_when_it_should() -> None:
    async def work() -> float:
        try:
            async with asyncio.timeout(30.0):
                await asyncio.Event().wait()
        except TimeoutError:
            return asyncio.get_running_loop().time()
        return -1.0

    assert run_virtual(work) == 30.0


def test_what_a_thread_does_is_waited_for() -> None:
    async def work() -> tuple[str, float]:
        done = await asyncio.to_thread(lambda: "done")
        return done, asyncio.get_running_loop().time()

    assert run_virtual(work) == ("done", 0.0)


def test_blocking_the_loop_lets_time_pass_for_all() -> None:
    async def work() -> list[float]:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        woken: list[float] = []
        loop.call_later(5.0, lambda: woken.append(loop.time()))
        loop.advance(20.0)
        await asyncio.sleep(1.0)
        return woken

    assert run_virtual(work) == [20.0]
