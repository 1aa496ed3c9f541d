"""The planner in its own process: a real one."""

from __future__ import annotations

import asyncio
import itertools
import os
import signal
import sys
from collections.abc import AsyncIterator
from multiprocessing import active_children
from pathlib import Path

import pytest
import pytest_asyncio

from executor.adapters.solver import SolverProcess, SolverSetup, solve
from executor.core.commands import Solve, Survivor
from executor.core.events import SolveEnded
from planner import PRESETS, travel_for
from tests.missions.builders import line_east

SETUP = SolverSetup(line_east(7), travel_for(PRESETS["mavic3"], 8.0, 3.0), 0.5, 1)
PATIENCE_S = 15.0
SOURCE = Path(__file__).parents[3]


def survivor(name: str, *, budget_pct: float = 60.0, airborne: bool = True, tail: tuple[int, ...] = ()) -> Survivor:
    return Survivor(name, (200.0, 0.0), budget_pct, 1.0, airborne, tail, kept=3)


def problem(revision: int = 1, *survivors: Survivor) -> Solve:
    everybody = survivors or (survivor("uav1", tail=(2,)), survivor("uav3"))
    return Solve(revision, (1, 2, 3, 4, 5), everybody, "uav2: link")


def segments(answer: SolveEnded) -> list[int]:
    assert answer.routes is not None
    return sorted(visit >> 1 for route in answer.routes for visit in route.visits)


def test_everything_is_shared_among_the_survivors() -> None:
    answer = solve(SETUP, problem(), lambda: False)
    assert segments(answer) == [1, 2, 3, 4, 5]
    assert answer.routes is not None
    assert [route.vehicle for route in answer.routes] == ["uav1", "uav3"]
    assert all(route.visits for route in answer.routes)
    assert (answer.revision, answer.uncovered) == (1, ())


def test_what_no_budget_reaches_is_named() -> None:
    answer = solve(SETUP, problem(2, survivor("uav1", budget_pct=4.0), survivor("uav3", budget_pct=0.0)), lambda: False)
    assert set(segments(answer)) | set(answer.uncovered) == {1, 2, 3, 4, 5}
    assert answer.uncovered


def test_a_tail_that_is_not_open_any_more_is_no_hindrance() -> None:
    answer = solve(SETUP, problem(3, survivor("uav1", tail=(0, 2)), survivor("uav3")), lambda: False)
    assert segments(answer) == [1, 2, 3, 4, 5]


def test_a_cancellation_is_seen_while_it_works() -> None:
    looks = itertools.count()
    answer = solve(SETUP, problem(), lambda: next(looks) >= 3)
    assert (answer.routes, answer.reason) == (None, "cancelled")


@pytest_asyncio.fixture
async def process() -> AsyncIterator[SolverProcess]:
    async with SolverProcess(SETUP) as running:
        yield running


async def asked(process: SolverProcess, question: Solve) -> SolveEnded:
    async with asyncio.timeout(PATIENCE_S):
        return await process.solve(question)


@pytest.mark.asyncio
async def test_the_worker_solves_is_cancelled_and_is_replaced_when_it_dies(process: SolverProcess) -> None:
    """One story, for a process takes seconds to begin."""
    answer = await asked(process, problem(1))
    assert segments(answer) == [1, 2, 3, 4, 5]

    process.cancel(2)
    given_up = await asked(process, problem(2))
    assert (given_up.routes, given_up.reason) == (None, "cancelled")
    older = await asked(process, problem(1))
    assert older.routes is None, "what is older than a cancelled revision is of no use either"
    assert segments(await asked(process, problem(3))) == [1, 2, 3, 4, 5]

    [worker] = active_children()
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    died = await asked(process, problem(4))
    assert (died.routes, died.reason) == (None, "the solver's process died")
    assert segments(await asked(process, problem(5))) == [1, 2, 3, 4, 5]
    [other] = active_children()
    assert other.pid != worker.pid


ABANDONED = """
import asyncio, os, signal
from tests.executor.adapters.test_solver import SETUP
from executor.adapters.solver import SolverProcess

async def main():
    async with SolverProcess(SETUP):
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    asyncio.run(main())
"""


@pytest.mark.asyncio
async def test_a_killed_ground_station_leaves_no_worker_behind(tmp_path: Path) -> None:
    """The worker shares its standard output, which therefore ends only with the worker."""
    script = tmp_path / "abandoned.py"
    script.write_text(ABANDONED, encoding="utf-8")
    station = await asyncio.create_subprocess_exec(
        sys.executable, script, stdout=asyncio.subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(SOURCE)}
    )
    async with asyncio.timeout(PATIENCE_S):
        await station.communicate()
    assert station.returncode == -signal.SIGKILL
