"""What all parts of the measurements share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from executor.bench.data import NECHRANICE
from executor.bench.errors import BenchError
from executor.bench.machine import cores
from executor.bench.store import Store
from missions import Network

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
        from executor.bench.problems import network_of

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
