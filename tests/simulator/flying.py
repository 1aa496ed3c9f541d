"""Runs simulated vehicles on real UDP for as long as a test needs them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from simulator.config import SimFleet
from simulator.fleet import run_fleet
from simulator.truth import Truth
from tests.patience import PATIENCE_S


@asynccontextmanager
async def flying(fleet: SimFleet) -> AsyncIterator[list[Truth]]:
    """Fly the fleet inside the block; the truths appear in the list as they happen."""
    stop, ready = asyncio.Event(), asyncio.Event()
    truths: list[Truth] = []
    async with asyncio.TaskGroup() as group:
        group.create_task(run_fleet(fleet, stop=stop, on_truth=truths.append, ready=ready))
        try:
            async with asyncio.timeout(PATIENCE_S):
                await ready.wait()
            yield truths
        finally:
            stop.set()
