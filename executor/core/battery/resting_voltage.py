"""What a cell's voltage at rest says of its charge, and what is known of a pack besides what it reports.

A counter of charge knows what has flowed, not what was there: it begins at 100 % with whatever pack is put in, and
divides by a capacity that somebody typed. The voltage at rest knows what is there, within what the curves of the two
chemistries differ by. Where both contradict each other by more than that, the counter is wrong.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

CHARGE_PCT = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)


class Chemistry(Enum):
    """Of a cell."""

    LIPO = "lipo"
    LI_ION = "li-ion"


REST_CELL_V: Mapping[Chemistry, tuple[float, ...]] = MappingProxyType({
    # Lithium polymer (cobalt oxide), the usual published table of hobby packs.
    Chemistry.LIPO: (3.27, 3.61, 3.69, 3.71, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20),
    # Nickel-manganese-cobalt 21700, about as the LG M50 of Chen et al. 2020, J. Electrochem. Soc. 167 080534; not
    # read off its data point by point, so a claim that needs better than 0.05 V is none.
    Chemistry.LI_ION: (2.80, 3.13, 3.27, 3.35, 3.43, 3.53, 3.61, 3.68, 3.78, 3.87, 3.95, 4.06, 4.18),
})  # fmt: skip
"""Open-circuit voltage of a cell at `CHARGE_PCT`, at room temperature."""
FULL_CELL_V = 4.4
"""No cell has more: a pack has at least as many as its highest voltage needs, so that none is called low wrongly."""
CHARGED_CELL_V = 4.2
"""What a parameter for a full pack means by a cell."""
NEAR = 0.12
"""Of a cell: how far such a parameter may be from whole cells and still name their number."""
MOST_CELLS = 24
MAH = 1000.0


@dataclass(frozen=True, slots=True)
class PackFacts:
    """What the site file, or the vehicle's parameters, say of its pack; None where nobody does."""

    cells: int | None = None
    """In series."""
    chemistry: Chemistry | None = None
    capacity_ah: float | None = None
    """What its autopilot divides the charge by."""
    share: float = 1.0
    """How much of that it has, by its earlier flights."""
    ohm: tuple[float, float] | None = None
    """Its resistance by them: mean and standard deviation."""

    def honest_pct(self, claimed_pct: float) -> float:
        """Return what a pack of its share holds of itself when its counter, which began full, claims a percentage.

        >>> PackFacts(share=0.7).honest_pct(30.0), PackFacts(share=0.7).honest_pct(100.0)
        (0.0, 100.0)
        """
        return max(0.0, 100.0 - (100.0 - claimed_pct) / self.share)

    def override_with(self, other: PackFacts) -> PackFacts:
        """Return these with those of `other`, which count more."""
        return PackFacts(
            other.cells or self.cells, other.chemistry or self.chemistry, other.capacity_ah or self.capacity_ah,
            min(other.share, self.share), other.ohm or self.ohm,
        )  # fmt: skip


NO_FACTS = PackFacts()
_CAPACITIES = frozenset({"BATT_CAPACITY", "BAT1_CAPACITY", "BAT_CAPACITY"})
_CELLS = frozenset({"BAT1_N_CELLS", "BAT_N_CELLS"})
FULL_PACK = "MOT_BAT_VOLT_MAX"
"""ArduPilot's parameter of the full pack's voltage, which its thrust is scaled by: 4.2 V times the cells."""
PARAMETERS = ("BATT_CAPACITY", FULL_PACK, "BAT1_CAPACITY", "BAT1_N_CELLS")
"""What a vehicle is asked for before a flight."""


def apply_pack_parameter(facts: PackFacts, name: str, value: float) -> PackFacts:
    """Take a parameter of the vehicle.

    >>> apply_pack_parameter(NO_FACTS, "BATT_CAPACITY", 5100.0).capacity_ah
    5.1
    >>> apply_pack_parameter(NO_FACTS, "MOT_BAT_VOLT_MAX", 12.6).cells
    3
    """
    if name in _CAPACITIES:
        return replace(facts, capacity_ah=value / MAH if value > 0 else None)
    if name in _CELLS:
        return replace(facts, cells=round(value) if 0 < value <= MOST_CELLS else None)
    if name == FULL_PACK and value > 0:
        cells = value / CHARGED_CELL_V
        near = abs(cells - round(cells)) <= NEAR and 1 <= round(cells) <= MOST_CELLS
        return replace(facts, cells=round(cells)) if near else facts
    return facts


def least_cell_count(highest_v: float) -> int:
    """Return how many cells a pack has at least.

    >>> least_cell_count(12.6), least_cell_count(16.8), least_cell_count(25.2)
    (3, 4, 6)
    """
    return max(1, math.ceil(highest_v / FULL_CELL_V))


def rest_charge_pct(cell_v: float, chemistry: Chemistry | None) -> float:
    """Return what a resting cell holds; of a chemistry that nobody names as much as either would.

    >>> round(rest_charge_pct(3.70, Chemistry.LIPO)), round(rest_charge_pct(3.70, None))
    (13, 52)
    """
    if chemistry is None:
        return max(rest_charge_pct(cell_v, one) for one in Chemistry)
    return _interpolate(cell_v, REST_CELL_V[chemistry], CHARGE_PCT)


def rest_cell_v(charge_pct: float, chemistry: Chemistry | None) -> float:
    """Return the resting voltage of a cell; of a chemistry that nobody names the lower one."""
    if chemistry is None:
        return min(rest_cell_v(charge_pct, one) for one in Chemistry)
    return _interpolate(charge_pct, CHARGE_PCT, REST_CELL_V[chemistry])


def _interpolate(at: float, known: tuple[float, ...], values: tuple[float, ...]) -> float:
    if at <= known[0]:
        return values[0]
    if at >= known[-1]:
        return values[-1]
    above = bisect_left(known, at)
    low, high = known[above - 1], known[above]
    return values[above - 1] + (values[above] - values[above - 1]) * (at - low) / (high - low)
