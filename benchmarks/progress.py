"""Progress of a long run, on a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

TOLD_S = 60.0


class ShownProgress:
    """A bar for each stage; without a terminal, a line a minute and one for each finished stage."""

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._told_s = clock_s()
        self._console = Console(stderr=True)
        self._bars = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            console=self._console, disable=not self._console.is_terminal,
        )  # fmt: skip
        self._stages: dict[str, TaskID] = {}

    def __enter__(self) -> ShownProgress:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def show_stage(self, stage: str, done: int, total: int) -> None:
        """Show the finished pieces of a stage."""
        if stage not in self._stages:
            self._stages[stage] = self._bars.add_task(stage, total=total)
        self._bars.update(self._stages[stage], completed=done)
        if self._console.is_terminal:
            return
        now_s = self._clock_s()
        if done == total or now_s - self._told_s >= TOLD_S:
            self._told_s = now_s
            self._console.print(f"{stage}: {done} of {total}", highlight=False)
