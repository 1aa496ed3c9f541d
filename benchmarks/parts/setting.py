"""What all parts of the measurements share."""

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
"""Of all times, where it is only tried."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Where data and results lie, and how much is done."""

    data: Path | None
    store: Store
    told: Callable[[str, int, int], None]
    seed: int = 1
    quick: bool = False
    """To try it: a tenth of every time, and fewer pieces."""

    def make_cases(
        self,
        title: str,
        cases: Sequence[C],
        key: Callable[[C], str],
        make: Callable[[Setting, C], Json],
        **more: object,
    ) -> list[Json]:
        """Return the results of all cases: those that are there, and those that are made now.

        Args:
            title: Of the stage, for who looks on.
            cases: What is measured.
            key: Names the result of one.
            make: Measures one.
            more: What the results depend on beside seed and haste.
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
        """Searches side by side."""
        return cores()

    def seconds(self, full: float) -> float:
        """Return how long something may take that has ``full`` seconds."""
        return full * QUICK if self.quick else full

    def pieces(self, full: int, tried: int) -> int:
        """Return how many pieces of something are done."""
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
        """The data.

        Raises:
            BenchError: there is none.
        """
        if self.data is None:
            raise BenchError("the benchmark data is not in ../shared/data beside the project; --data DIR names it")
        return self.data
