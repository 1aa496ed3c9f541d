"""What commands that plan have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from executor import build, planning
from executor.console import TerminalConsole
from executor.core.commands import Level
from executor.errors import SiteError
from executor.planning import Wanted
from missions import PlanFile, check_plan
from planner import Progress


def first_plan(
    ground: build.Ground, console: TerminalConsole, wanted: Wanted, segments: Sequence[int] | None = None
) -> PlanFile:
    """Plan a site, or some of its segments, and say how it goes.

    Raises:
        SiteError: the plan does not hold what it must.
        planner.PlannerError: the solver cannot take this problem.
    """
    task = build.task_of(ground, segments)
    progressed = announced(ground, console, wanted, len(task.segment_ids))
    content = planning.first_plan(ground, wanted, progressed, task)
    console.progress("")
    for line in check_plan(content, search_window=False):
        raise SiteError(f"the plan of --solver {wanted.solver.value} does not hold: {line}")
    return content


def announced(
    ground: build.Ground, console: TerminalConsole, wanted: Wanted, segments: int
) -> Callable[[Progress], None]:
    """Say what is planned, and return how to say how far it is."""
    vehicles = len(ground.names)
    name, unit = ("window", "earliest s") if wanted.cost is None else (wanted.cost.value, wanted.cost.value)
    console.say(Level.INFO, f"planning {segments} segments for {vehicles} vehicles ({name}, {wanted.seconds:g} s)")

    def progressed(progress: Progress) -> None:
        console.progress(
            f"{progress.iterations} iterations, {unit} {progress.value:.2f}, {progress.uncovered} left out"
        )

    return progressed


def writable(path: Path, write: Callable[[], object]) -> None:
    """Write a file that the user named.

    Raises:
        SiteError: it cannot be written.
    """
    try:
        write()
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error
