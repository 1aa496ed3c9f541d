"""The same for several vehicles, side by side."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from typing import TypeVar

T = TypeVar("T")
AT_ONCE = 10
"""Vehicles that are spoken to at the same time: a radio has its limits, and so has a simulator."""


async def run_concurrently(works: Iterable[Coroutine[None, None, T]]) -> list[T]:
    """Do several things side by side; the first that fails ends the others, and is raised as it is."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        return await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def run_for_each(names: Iterable[str], work: Callable[[str], Coroutine[None, None, T]]) -> dict[str, T]:
    """Do something with every vehicle, `AT_ONCE` of them at a time; as `run_concurrently` otherwise."""
    turn, every = asyncio.Semaphore(AT_ONCE), list(names)

    async def one(name: str) -> T:
        async with turn:
            return await work(name)

    return dict(zip(every, await run_concurrently(map(one, every)), strict=True))
