"""Settings shared by all parts of the measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from benchmarks.data import NECHRANICE
from benchmarks.errors import BenchError
from benchmarks.machine import cores
from benchmarks.store import Json, Store
from missions import Network

C = TypeVar("C")
QUICK = 0.1
"""Factor on all times, for a trial run."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Location of data and results, and the amount of work."""

    data: Path | None
    store: Store
    told: Callable[[str, int, int], None]
    seed: int = 1
    quick: bool = False
    """Trial run: a tenth of every time, and fewer pieces."""

    def make_cases(
        self,
        title: str,
        cases: Sequence[C],
        key: Callable[[C], str],
        make: Callable[[Setting, C], Json],
        **more: object,
    ) -> list[Json]:
        """Return the results of all cases: existing ones, and those made now.

        Args:
            title: Name of the stage, for display.
            cases: The cases.
            key: Names the result of one.
            make: Measures one.
            more: Dependencies of the results besides seed and trial run.
        """
        settings = {"seed": self.seed, "quick": self.quick, **more}
        rows = []
        for done, case in enumerate(cases):
            self.told(title, done, len(cases))
            rows.append(self.store.find_or_make(key(case), settings, partial(make, self, case)))
        self.told(title, len(cases), len(cases))
        return rows

    @property
    def starts(self) -> int:
        """Parallel searches."""
        return cores()

    def seconds(self, full: float) -> float:
        """Return the time of a step that has ``full`` seconds in a full run."""
        return full * QUICK if self.quick else full

    def pieces(self, full: int, tried: int) -> int:
        """Return the number of pieces to do."""
        return tried if self.quick else full

    def nechranice(self, radius_m: float) -> Network:
        """Return the paper's network.

        Raises:
            BenchError: it is not there.
        """
        from benchmarks.problems import network_of

        return network_of(self.directory / NECHRANICE, radius_m)

    @property
    def directory(self) -> Path:
        """Data directory.

        Raises:
            BenchError: there is none.
        """
        if self.data is None:
            raise BenchError("the benchmark data is not in ../shared/data beside the project; --data DIR names it")
        return self.data
