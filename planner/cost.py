"""The cost functions of the paper: what a plan is chosen by, and the one place where that is defined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

K_C = 1000.0
"""k_c of the paper: the weight of what a tour spends beyond its budget."""
BUDGET_TOLERANCE_PCT = 1e-6
"""A route spends more than its budget when it does so by more than this: sums depend on their order."""


def budget_excess_pct(energy_pct: float, budget_pct: float) -> float:
    """Return what a route uses beyond its budget."""
    over = energy_pct - budget_pct
    return over if over > BUDGET_TOLERANCE_PCT else 0.0


@dataclass(frozen=True, slots=True)
class CostFunction:
    """total * sum(c(T) + excess * max(0, c(T) - budget)) + peak * max c(T).

    c(T) is a route's energy in percent of a full battery. Whatever searches reads its weights from here, so that
    another cost is another row below.
    """

    total: float
    """Weight of what all routes use; 0 if only the longest counts."""
    peak: float
    """Weight of the longest route."""
    shared_peak: bool
    """Whether that weight is divided by the number of vehicles."""
    excess: float
    """Weight of what a route uses beyond its budget, beside what it uses."""

    @property
    def is_longest_only(self) -> bool:
        """Return whether nothing but the longest route counts."""
        return self.total == 0

    @property
    def has_longest_term(self) -> bool:
        """Return whether the longest route counts beside what all use, or alone."""
        return self.peak > 0

    def peak_weight(self, vehicles: int) -> float:
        """Return the weight of the longest route for a fleet."""
        return self.peak / vehicles if self.shared_peak else self.peak

    def value(self, energies_pct: Sequence[float], budgets_pct: Sequence[float]) -> float:
        """Return the cost of routes, one energy and one budget for each vehicle."""
        longest = max(energies_pct)
        peak = self.peak * longest / (len(energies_pct) if self.shared_peak else 1)
        if self.is_longest_only:
            return peak
        routes = zip(energies_pct, budgets_pct, strict=True)
        soft_sum = sum(energy + self.excess * budget_excess_pct(energy, budget) for energy, budget in routes)
        return self.total * soft_sum + peak


class Cost(Enum):
    """What a plan is chosen by, by its name in plan files."""

    MINMAX = "minmax"
    MINSUM = "minsum"
    MINCOMB = "mincomb"

    @property
    def function(self) -> CostFunction:
        """Return what it computes."""
        return FUNCTIONS[self]


FUNCTIONS: Mapping[Cost, CostFunction] = MappingProxyType({
    Cost.MINMAX: CostFunction(total=0.0, peak=1.0, shared_peak=False, excess=0.0),
    # c-MinSum of the paper
    Cost.MINSUM: CostFunction(total=1.0, peak=0.0, shared_peak=False, excess=K_C),
    # c-MinSum + MinMax / number of vehicles
    Cost.MINCOMB: CostFunction(total=1.0, peak=1.0, shared_peak=True, excess=K_C),
})  # fmt: skip
