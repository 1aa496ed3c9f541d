"""When a checkpoint is due, and how it is written: nothing waits for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from executor.adapters.eventlog import DISK_S, EventLog
from executor.adapters.log_end import LogPlace
from executor.adapters.run_directory import RunDirectory
from executor.core.state.fleet_state import FleetState
from executor.flight.checkpoint_files import Checkpoint, write_checkpoint

EVERY_S = 30.0
"""Of the flight: what follows a checkpoint is read in less than a second, for six vehicles in a quarter of one."""
EVERY_REAL_S = 5.0
"""A simulation that is fast writes no more of them than this."""


class Checkpointer:
    """Writes one checkpoint after the other, beside the flight.

    States are values: the loop hands one over between two events, and a thread writes it down. While one is being
    written, or a disk hangs, no other is begun.
    """

    def __init__(
        self,
        run: Path,
        log: EventLog,
        speedup: float,
        told: Callable[[str], None],
        taken: str = "",
    ) -> None:
        """Name where they go.

        Args:
            run: The run directory.
            log: Whose places they are of.
            speedup: Of the flight.
            told: Called with a line for the operator when they cannot be written, and when they can again.
            taken: The file that the flight was taken up from, which is overwritten last.
        """
        self._files = RunDirectory(run).checkpoints
        self._log = log
        self._every_s = max(EVERY_S, EVERY_REAL_S * speedup)
        self._told = told
        self._next = 1 if taken == self._files[0].name else 0
        self._last_s: float | None = None
        self._writing: asyncio.Task[None] | None = None
        self._failing = False

    def is_due(self, state: FleetState, now_s: float) -> bool:
        """Return whether it is time; before the launch nothing is worth it."""
        if state.progress.launched_s is None or self._writing is not None:
            return False
        return self._last_s is None or now_s - self._last_s >= self._every_s

    def begin(self, now_s: float, made: Callable[[LogPlace], Checkpoint]) -> None:
        """Begin to write one; called between two events, when all that was decided is in the log."""
        place = self._log.current_place()
        if place is None or self._writing is not None:
            return  # the disk is full: what waits in memory is in no log yet
        self._last_s = now_s
        self._writing = asyncio.create_task(self._write(made(place)))

    async def _write(self, checkpoint: Checkpoint) -> None:
        try:
            await self._log.settle()  # a checkpoint that outlives its log in a power loss is worth nothing
            await asyncio.to_thread(write_checkpoint, self._files[self._next], checkpoint)
            self._next = 1 - self._next
            self._report("checkpoints are written again", failing=False)
        except OSError as error:
            self._report(f"no checkpoint can be written: {error.strerror}; resume would take longer", failing=True)
        except Exception as error:  # noqa: BLE001 - a mistake of ours here must not cost anything but time
            text = f"{type(error).__name__}: {error!s:.200}"
            self._report(f"no checkpoint can be written: {text}; resume would take longer", failing=True)
        finally:
            self._writing = None

    def _report(self, text: str, *, failing: bool) -> None:
        if failing is not self._failing:
            self._failing = failing
            self._told(text)

    async def settle(self) -> None:
        """Wait until nothing is being written, for no longer than anybody waits for a disk."""
        if self._writing is not None:
            await asyncio.wait({self._writing}, timeout=DISK_S)
