"""What a battery has given, set against what the energy model says the flight so far should have cost.

The model is driven by the speed that the vehicle reports, so a detour, a hold or a slow leg is no anomaly; what remains
is a factor per vehicle (its pack, its load, the wind), learned as the flight goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

PRIOR_PCT = 4.0
"""How much modelled consumption the belief in the model weighs: integer percents say little in the first minutes."""
FACTOR_RANGE = (0.7, 2.0)
"""A factor outside is no factor but a fault, which the watchpoints find."""
HISTORY_S = 120.0


@dataclass(frozen=True, slots=True)
class BatterySample:
    """One report beside the model's figure at that moment."""

    at_s: float
    remaining_pct: float
    modelled_pct: float
    """What the model says was used since the first report."""


@dataclass(frozen=True, slots=True)
class BatteryState:
    """One vehicle's battery since its first report."""

    first_pct: float | None = None
    remaining_pct: float | None = None
    """The last report; None until there was one."""
    least_pct: float | None = None
    reported_s: float = float("-inf")
    modelled_pct: float = 0.0
    charge_state: int = 0
    history: tuple[BatterySample, ...] = ()
    """The reports of the last `HISTORY_S`, the oldest first."""
    base: BatterySample | None = None
    """The report from which the factor is learned: the first, or the last before a jump that was no consumption."""
    lowest_pct: float | None = None
    """The least that was reported since the account began."""
    earlier_pct: float = 0.0
    """Percent given before the account began anew."""

    @property
    def used_pct(self) -> float:
        """Percent given since the first report."""
        if self.first_pct is None or self.remaining_pct is None:
            return 0.0
        return max(0.0, self.first_pct - self.remaining_pct)

    @property
    def given_pct(self) -> float:
        """Percent given in the whole flight: PX4's simulated battery is full again as soon as it disarms."""
        if self.first_pct is None or self.lowest_pct is None:
            return self.earlier_pct
        return self.earlier_pct + self.first_pct - self.lowest_pct


def drawn(state: BatteryState, pct: float) -> BatteryState:
    """Add what the model says was used since the last position."""
    return replace(state, modelled_pct=state.modelled_pct + pct)


def reported(state: BatteryState, remaining_pct: float, charge_state: int, now_s: float) -> BatteryState:
    """Take a report of what is left."""
    sample = BatterySample(now_s, remaining_pct, state.modelled_pct)
    history = (*(old for old in state.history if now_s - old.at_s <= HISTORY_S), sample)
    return replace(
        state,
        first_pct=remaining_pct if state.first_pct is None else state.first_pct,
        remaining_pct=remaining_pct,
        least_pct=remaining_pct if state.least_pct is None else min(state.least_pct, remaining_pct),
        lowest_pct=remaining_pct if state.lowest_pct is None else min(state.lowest_pct, remaining_pct),
        reported_s=now_s,
        charge_state=charge_state,
        history=history,
        base=state.base or sample,
    )


def swapped(state: BatteryState, remaining_pct: float, charge_state: int, now_s: float) -> BatteryState:
    """Start the account anew: a percentage that rises is a reboot or another pack, not a charge in flight."""
    fresh = BatteryState(least_pct=state.least_pct, earlier_pct=state.given_pct)
    return reported(fresh, remaining_pct, charge_state, now_s)


def factor(state: BatteryState, before_s: float = float("inf")) -> float:
    """Return what the vehicle uses relative to the model, judged by the reports before a moment."""
    if state.base is None:
        return 1.0
    known = [sample for sample in state.history if sample.at_s <= before_s]
    if not known:
        return 1.0
    used = state.base.remaining_pct - known[-1].remaining_pct
    modelled = known[-1].modelled_pct - state.base.modelled_pct
    low, high = FACTOR_RANGE
    return min(high, max(low, (used + PRIOR_PCT) / (modelled + PRIOR_PCT)))


def excess_pct(state: BatteryState, window_s: float) -> tuple[float, float]:
    """Return what was used in the last seconds beyond the model, and what the model expected.

    The model is corrected by the factor learned before the window, so that a constant head wind is no anomaly.
    """
    if len(state.history) < 2:
        return 0.0, 0.0
    last = state.history[-1]
    inside = [sample for sample in state.history if last.at_s - sample.at_s <= window_s]
    first = inside[0]
    expected = (last.modelled_pct - first.modelled_pct) * factor(state, first.at_s)
    return (first.remaining_pct - last.remaining_pct) - expected, expected
