"""What commands that plan have in common."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from executor import build, planning
from executor.console import TerminalConsole
from executor.core.commands import Level
from executor.errors import SiteError
from missions import PlanFile, check_plan
from planner import Cost, Progress


def first_plan(
    ground: build.Ground, console: TerminalConsole, cost: Cost, seconds: float, seed: int, *, all_vehicles: bool
) -> PlanFile:
    """Plan a site and say how it goes.

    Raises:
        SiteError: the plan does not hold what it must.
    """
    segments, vehicles = len(ground.network.segments), len(ground.names)
    console.say(
        Level.INFO, f"planning {segments} segments for {vehicles} vehicles ({cost.value}, {seconds:g} s at most)"
    )

    def progressed(progress: Progress) -> None:
        console.progress(
            f"{progress.iterations} iterations, {cost.value} {progress.value:.2f}, left out {progress.uncovered}"
        )

    content = planning.first_plan(
        ground, cost=cost, seconds=seconds, seed=seed, all_vehicles=all_vehicles, on_progress=progressed
    )
    console.progress("")
    for line in check_plan(content):
        raise SiteError(f"the plan does not hold: {line}")
    return content


def writable(path: Path, write: Callable[[], object]) -> None:
    """Write a file that the user named.

    Raises:
        SiteError: it cannot be written.
    """
    try:
        write()
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error
