"""The planner in its own process: a real one."""

from __future__ import annotations

import asyncio
import itertools
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Collection
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import pytest
import pytest_asyncio

from executor.adapters.solver import SolverProcess, SolverSetup, solve_for_survivors
from executor.core.interface.commands import Solve, Survivor
from executor.core.interface.events import SolveEnded
from executor.site import site_model
from missions import Pace, Pricing
from missions.flight_model import AS_MODELLED
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import line_east
from tests.patience import PATIENCE_S

SETUP = SolverSetup(0.5, 1)
PRICING = site_model.build_pricing(ground_for(site_of(("uav1", "uav2", "uav3")), line_east(7)))
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
    answer = solve_for_survivors(SETUP, problem(), PRICING, lambda: False)
    assert segments(answer) == [1, 2, 3, 4, 5]
    assert answer.routes is not None
    assert [route.vehicle for route in answer.routes] == ["uav1", "uav3"]
    assert all(route.visits for route in answer.routes)
    assert (answer.revision, answer.uncovered) == (1, ())


def test_what_no_budget_reaches_is_named() -> None:
    answer = solve_for_survivors(
        SETUP, problem(2, survivor("uav1", budget_pct=4.0), survivor("uav3", budget_pct=0.0)), PRICING, lambda: False
    )
    assert set(segments(answer)) | set(answer.uncovered) == {1, 2, 3, 4, 5}
    assert answer.uncovered


def test_a_tail_that_is_not_open_any_more_is_no_hindrance() -> None:
    answer = solve_for_survivors(
        SETUP, problem(3, survivor("uav1", tail=(0, 2)), survivor("uav3")), PRICING, lambda: False
    )
    assert segments(answer) == [1, 2, 3, 4, 5]


def test_what_two_carry_is_flown_once() -> None:
    """As when a vehicle comes back from its pilot whose work another was given meanwhile."""
    answer = solve_for_survivors(
        SETUP, problem(4, survivor("uav1", tail=(2, 4)), survivor("uav3", tail=(4, 6))), PRICING, lambda: False
    )
    assert segments(answer) == [1, 2, 3, 4, 5]


def test_a_slow_survivor_is_given_less() -> None:
    """Both stand at the same place with the same energy; one takes twice as long for all it flies."""
    even, slow = (
        solve_for_survivors(SETUP, problem(5, survivor("uav1"), replace(survivor("uav3"), pace=pace)), PRICING, never)
        for pace in (AS_MODELLED, Pace(2.0, 2.0))
    )

    def shares(answer: SolveEnded) -> list[int]:
        assert answer.routes is not None
        return [len(route.visits) for route in answer.routes]

    assert segments(slow) == [1, 2, 3, 4, 5]
    assert shares(slow)[1] < min(shares(even))


def never() -> bool:
    return False


def test_a_cancellation_is_seen_while_it_works() -> None:
    looks = itertools.count()
    answer = solve_for_survivors(SETUP, problem(), PRICING, lambda: next(looks) >= 3)
    assert (answer.routes, answer.reason) == (None, "cancelled")


@pytest.fixture
def others() -> Collection[int | None]:
    """Processes that tests before this one have left."""
    return {one.pid for one in active_children()}


@pytest_asyncio.fixture
async def process(others: Collection[int | None]) -> AsyncIterator[SolverProcess]:
    async with SolverProcess(SETUP) as running:
        yield running


async def asked(process: SolverProcess, question: Solve) -> SolveEnded:
    async with asyncio.timeout(PATIENCE_S):
        return await process.solve(question, PRICING)


@pytest.mark.asyncio
async def test_the_worker_solves_is_cancelled_and_is_replaced_when_it_dies(
    process: SolverProcess, others: Collection[int | None]
) -> None:
    """One story, for a process takes seconds to begin."""
    answer = await asked(process, problem(1))
    assert segments(answer) == [1, 2, 3, 4, 5]

    process.cancel(2)
    given_up = await asked(process, problem(2))
    assert (given_up.routes, given_up.reason) == (None, "cancelled")
    older = await asked(process, problem(1))
    assert older.routes is None, "what is older than a cancelled revision is of no use either"
    assert segments(await asked(process, problem(3))) == [1, 2, 3, 4, 5]

    [worker] = [one for one in active_children() if one.pid not in others]
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    died = await asked(process, problem(4))
    assert (died.routes, died.reason) == (None, "the solver's process died")
    assert segments(await asked(process, problem(5))) == [1, 2, 3, 4, 5]
    [other] = [one for one in active_children() if one.pid not in others]
    assert other.pid != worker.pid


def stubborn(_problem: Solve, _pricing: Pricing) -> SolveEnded:
    """Never answer, and ignore a polite end."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    Path(os.environ["BEGUN"]).touch()
    while True:
        time.sleep(3600.0)


STUBBORN = """
import asyncio, multiprocessing, os, sys
from tests.executor.adapters import test_solver as tests
from executor.adapters import solver

async def main():
    solver._solve_in_worker = tests.stubborn
    solver.GIVE_UP_S, solver.JUDGE_S = {give_up_s}, 0.1
    async with solver.SolverProcess(tests.SETUP, lambda text: print("told:", text, flush=True)) as process:
        print(*(one.pid for one in multiprocessing.active_children()), flush=True)
        asking = asyncio.create_task(process.solve(tests.problem(), tests.PRICING))
        if {leaves}:
            while not os.path.exists(os.environ["BEGUN"]):
                await asyncio.sleep(0.01)
            asking.cancel()
            await asyncio.wait([asking])
            print("left", flush=True)
        else:
            print(await asking, flush=True)

if __name__ == "__main__":
    asyncio.run(main())
    sys.exit(7)
"""


async def stubbornly(tmp_path: Path, *, give_up_s: float, leaves: bool) -> tuple[list[str], int | None]:
    """Run a program whose solver hangs, and which may leave meanwhile; returns what it printed, and how it ended.

    Worker and program share the standard output, which therefore ends only with both.
    """
    script = tmp_path / "stubborn.py"
    script.write_text(STUBBORN.format(give_up_s=give_up_s, leaves=leaves), encoding="utf-8")
    program = await asyncio.create_subprocess_exec(
        sys.executable, script, stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(SOURCE), "BEGUN": str(tmp_path / "begun")},
    )  # fmt: skip
    try:
        async with asyncio.timeout(PATIENCE_S):
            out, _ = await program.communicate()
    finally:
        if program.returncode is None:
            program.kill()
            await program.wait()
    return out.decode().splitlines(), program.returncode


def gone(pid: str) -> bool:
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.asyncio
async def test_a_solver_that_hangs_is_given_up_and_does_not_outlive_the_program(tmp_path: Path) -> None:
    [worker, answer], code = await stubbornly(tmp_path, give_up_s=0.2, leaves=False)
    assert "the solver did not answer" in answer
    assert code == 7
    assert gone(worker)


@pytest.mark.asyncio
async def test_a_solver_that_hangs_when_the_program_ends_is_killed_and_it_is_reported(tmp_path: Path) -> None:
    [worker, *lines], code = await stubbornly(tmp_path, give_up_s=3600.0, leaves=True)
    assert lines == ["left", "told: the solver did not stop on request, and was killed"]
    assert code == 7
    assert gone(worker)


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
