"""One vehicle's battery: what it has given, set against what the energy model says the flight so far should have cost.

The model is driven by the speed that the vehicle reports, so a detour, a hold or a slow leg is no anomaly; what remains
is a factor per vehicle (its pack, its load, the wind), which `estimator` learns with its uncertainty. Percent and
consumed charge are watched apart: the one is what is left, the other is finer and comes from another sensor.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from executor.core.battery import kalman
from executor.core.battery.cusum import Drift, with_usage
from executor.core.battery.kalman import BatteryEstimate, Prior
from executor.core.limits import Limits

FACTOR_RANGE = (0.7, 2.0)
"""A factor outside is no factor but a fault, which the watchpoints find."""
HISTORY_S = 30.0
UNSURE_SD = 2.0
"""Standard deviations of the factor that count as slack: a factor that is not known yet accuses nobody."""
COUNTED = 0.75
"""Share of the slack where charge is counted: there is no rounding in it, only climbs and wind."""
CALM_PCT = 0.5
USUAL_S = 150.0
"""What is usual follows in this time: wind may turn, a fault is found before. In the first minutes it is faster."""
FIRST_S = 5.0
ROUGH_S = 300.0
"""In this time it is forgotten that a percentage wavered."""
AGREES_PCT = 1.5
"""Two roundings and a little."""
GAP_S = 10.0
"""After a longer silence nobody knows how it flew."""
BLIND_PCT = 1.5
"""PX4 without a current sensor: its percentage is off by some percent, and slowly so."""
CAPACITY_PCT = 4.0
"""As much must be used before charge can be set against percent: a step of it is seen up to two seconds late, 0.1 %."""
STEP_PCT = 1.01
"""A percentage that falls by more at once left out a report, or jumped: nobody knows where between."""

NO_PRIOR = Prior()
DEFAULT_LIMITS = Limits()


@dataclass(frozen=True, slots=True)
class BatterySample:
    """One report beside the model's figure at that moment."""

    at_s: float
    remaining_pct: float
    modelled_pct: float
    """What the model says was used since the first report."""


@dataclass(frozen=True, slots=True)
class PercentStep:
    """Where a percentage went on to its next value: only there it is known better than to a whole percent."""

    pct: float
    """Between the two values."""
    counted_ah: float


@dataclass(frozen=True, slots=True)
class Charge:
    """The counter of consumed charge, where there is one."""

    consumed_ah: float | None = None
    at_s: float = 0.0
    modelled_pct: float = 0.0
    began_ah: float = 0.0
    began_pct: float = 0.0
    """What the percentage was when the counter was first heard."""
    first: PercentStep | None = None
    """The first step of the percentage that the counter was there for."""
    last: PercentStep | None = None
    capacity_ah: float | None = None
    """Of the whole pack as the autopilot counts it, learned from both counters; None until enough was used."""
    drift: Drift = field(default_factory=Drift)


@dataclass(frozen=True, slots=True)
class BatteryState:
    """One vehicle's battery since its first report."""

    first_pct: float | None = None
    first_ah: float | None = None
    """What the counter of charge said beside that."""
    remaining_pct: float | None = None
    """The last report; None until there was one."""
    least_pct: float | None = None
    reported_s: float = float("-inf")
    modelled_pct: float = 0.0
    charge_state: int = 0
    history: tuple[BatterySample, ...] = ()
    """The reports of the last `HISTORY_S`, the oldest first."""
    lowest_pct: float | None = None
    """The least that was reported since the account began."""
    earlier_pct: float = 0.0
    """Percent given before the account began anew."""
    estimate: BatteryEstimate | None = None
    """What remains and what is used, with their uncertainty."""
    usual: float | None = None
    """The factor while nothing was wrong."""
    began_s: float | None = None
    """When it began to be used."""
    roughness_pct: float = 0.0
    """How far the percentage was seen to rise lately: a charge does not, an estimate of it wavers."""
    drift: Drift = field(default_factory=Drift)
    """Of the percentage."""
    usual_long: float = 1.0
    """The factor over the whole flight: a mild drain is not usual before minutes have passed."""
    slow: Drift = field(default_factory=Drift)
    """Of the percentage against `usual_long`: mild drains show only over minutes."""
    charge: Charge = field(default_factory=Charge)

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


def with_remaining(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR,
    limits: Limits = DEFAULT_LIMITS,
) -> BatteryState:  # fmt: skip
    """Take a report of what is left."""
    sample = BatterySample(now_s, remaining_pct, state.modelled_pct)
    if state.estimate is None or state.remaining_pct is None:
        return replace(
            state,
            first_pct=remaining_pct,
            remaining_pct=remaining_pct,
            least_pct=remaining_pct if state.least_pct is None else min(state.least_pct, remaining_pct),
            lowest_pct=remaining_pct,
            reported_s=now_s,
            charge_state=charge_state,
            history=(sample,),
            estimate=kalman.first_estimate(remaining_pct, prior),
            usual=prior.factor,
            usual_long=prior.factor,
        )
    modelled = state.modelled_pct - state.history[-1].modelled_pct
    elapsed_s = max(0.0, now_s - state.reported_s)
    used = state.remaining_pct - remaining_pct
    fades = max(0.0, 1.0 - elapsed_s / ROUGH_S)
    roughness = max(state.roughness_pct * fades, -used)
    ahead = kalman.flown(state.estimate, modelled, elapsed_s)
    modelled = max(modelled, _unseen_pct(state, elapsed_s))
    expected = _usual(state) * modelled
    slack = _slack(state, limits) * expected + (limits.blind_swing_pct_s * elapsed_s if is_blind(state) else 0.0)
    drift = with_usage(
        state.drift, used, expected, slack_pct=slack, elapsed_s=elapsed_s, now_s=now_s,
        memory_s=limits.battery_window_s,
    )  # fmt: skip
    slow = with_usage(
        state.slow, used, state.usual_long * modelled, slack_pct=limits.slow_slack * state.usual_long * modelled,
        elapsed_s=elapsed_s, now_s=now_s, memory_s=limits.slow_window_s,
    )  # fmt: skip
    charge = _stepped(state, remaining_pct)
    fine, wavers = _counted_pct(charge, remaining_pct), max(roughness, blindness_pct(state))
    rounded = kalman.corrected(ahead, remaining_pct, elapsed_s, wavers)
    estimate = rounded if fine is None else kalman.refined(ahead, fine)
    begins = 0
    while now_s - state.history[begins].at_s > HISTORY_S and begins + 1 < len(state.history):
        begins += 1
    return replace(
        state,
        remaining_pct=remaining_pct,
        least_pct=remaining_pct if state.least_pct is None else min(state.least_pct, remaining_pct),
        lowest_pct=remaining_pct if state.lowest_pct is None else min(state.lowest_pct, remaining_pct),
        reported_s=now_s,
        charge_state=charge_state,
        history=(*state.history[begins:], sample),
        estimate=estimate,
        usual=_followed_usual(state, estimate, drift, elapsed_s, now_s),
        began_s=now_s if state.began_s is None and state.modelled_pct > 0 else state.began_s,
        roughness_pct=roughness,
        drift=drift,
        usual_long=_followed_long(state, estimate, elapsed_s, now_s),
        slow=slow,
        charge=charge,
    )


def with_first_count(state: BatteryState, consumed_ah: float | None) -> BatteryState:
    """Take what the counter of charge says, while the percentage is still the first one."""
    if state.first_ah is not None or state.remaining_pct != state.first_pct:
        return state
    return replace(state, first_ah=consumed_ah)


def with_consumed(
    state: BatteryState, consumed_ah: float, now_s: float, limits: Limits = DEFAULT_LIMITS
) -> BatteryState:
    """Take a report of the consumed charge; what it means in percent is learned from both counters."""
    charge = state.charge
    if state.remaining_pct is None:
        return state
    if charge.consumed_ah is None or consumed_ah < charge.consumed_ah:  # a counter that goes back began anew
        began = Charge(consumed_ah, now_s, state.modelled_pct, consumed_ah, state.remaining_pct)
        return replace(state, charge=began)
    drift = charge.drift
    if charge.capacity_ah is not None:
        used = 100.0 * (consumed_ah - charge.consumed_ah) / charge.capacity_ah
        elapsed_s = max(0.0, now_s - charge.at_s)
        expected = _usual(state) * max(state.modelled_pct - charge.modelled_pct, _unseen_pct(state, elapsed_s))
        drift = with_usage(
            drift, used, expected, slack_pct=_slack(state, limits, COUNTED) * expected, elapsed_s=elapsed_s,
            now_s=now_s, memory_s=limits.battery_window_s,
        )  # fmt: skip
    taken = replace(charge, consumed_ah=consumed_ah, at_s=now_s, modelled_pct=state.modelled_pct, drift=drift)
    return replace(state, charge=taken)


def _stepped(state: BatteryState, reported_pct: float) -> Charge:
    """Set the counter against a percentage that went on to its next value.

    Between two steps both have given exactly as much, however the percentage is rounded.
    """
    charge, before_pct = state.charge, state.remaining_pct
    if charge.consumed_ah is None or before_pct is None or not 0.0 < before_pct - reported_pct <= STEP_PCT:
        return charge
    step = PercentStep((before_pct + reported_pct) / 2, charge.consumed_ah)
    first, capacity = charge.first or step, charge.capacity_ah
    given_pct = first.pct - step.pct
    if given_pct >= CAPACITY_PCT and charge.drift.excess_pct <= CALM_PCT and reported_pct > 0:
        capacity = 100.0 * (step.counted_ah - first.counted_ah) / given_pct
        if capacity <= 0.0:
            capacity = None  # a counter that stands still while the percentage falls counts nothing
    return replace(charge, first=first, last=step, capacity_ah=capacity)


def swapped(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR
) -> BatteryState:
    """Start the account anew: a percentage that rises is a reboot or another pack, not a charge in flight."""
    fresh = BatteryState(least_pct=state.least_pct, earlier_pct=state.given_pct)
    return with_remaining(fresh, remaining_pct, charge_state, now_s, prior)


def drawn_so_far_pct(state: BatteryState) -> float:
    """Return what was given since the first report, as exactly as it is known.

    Whole percents are a large part of a small budget. The counter of charge knows what was given better than how much
    is left, which depends on how the percentage is rounded.
    """
    if state.first_pct is None or state.estimate is None:
        return 0.0
    charge = state.charge
    if (
        charge.capacity_ah is None
        or charge.consumed_ah is None
        or state.first_ah is None
        or charge.consumed_ah < state.first_ah  # it began anew
    ):
        return max(0.0, state.first_pct - state.estimate.remaining_pct)
    return 100.0 * (charge.consumed_ah - state.first_ah) / charge.capacity_ah


def _counted_pct(charge: Charge, reported_pct: float) -> float | None:
    """Return what the counter of charge says is left, finer than whole percents; None where the two do not agree."""
    if charge.capacity_ah is None or charge.consumed_ah is None or charge.last is None:
        return None
    left = charge.last.pct - 100.0 * (charge.consumed_ah - charge.last.counted_ah) / charge.capacity_ah
    return left if abs(left - reported_pct) <= AGREES_PCT else None


def is_blind(state: BatteryState) -> bool:
    """Return whether no counter of charge stands behind the percentage."""
    charge = state.charge
    return charge.consumed_ah is None or charge.consumed_ah <= charge.began_ah


def blindness_pct(state: BatteryState) -> float:
    """Return the standard deviation of a percentage that no counter of charge stands behind.

    It is read off the voltage, which moves with load and temperature.
    """
    return BLIND_PCT if is_blind(state) else 0.0


def factor(state: BatteryState) -> float:
    """Return what the vehicle uses relative to the model."""
    if state.estimate is None:
        return 1.0
    low, high = FACTOR_RANGE
    return min(high, max(low, state.estimate.factor))


def excess_pct(state: BatteryState, window_s: float) -> tuple[float, float]:
    """Return what was used in the last seconds beyond what is usual, and what the usual would have been."""
    if len(state.history) < 2:
        return 0.0, 0.0
    last = state.history[-1]
    first = next(sample for sample in state.history if last.at_s - sample.at_s <= window_s)
    expected = (last.modelled_pct - first.modelled_pct) * _usual(state)
    return (first.remaining_pct - last.remaining_pct) - expected, expected


def _unseen_pct(state: BatteryState, elapsed_s: float) -> float:
    """Return what the model should say of a silence, whose positions may come after the report that ends it."""
    if elapsed_s < GAP_S or len(state.history) < 2:
        return 0.0
    first, last = state.history[0], state.history[-1]
    span_s = last.at_s - first.at_s
    return (last.modelled_pct - first.modelled_pct) / span_s * elapsed_s if span_s > 0 else 0.0


def _followed_long(state: BatteryState, estimate: BatteryEstimate, elapsed_s: float, now_s: float) -> float:
    """Return the mean factor of the flight so far."""
    flown_s = now_s - (state.began_s if state.began_s is not None else now_s)
    share = min(1.0, elapsed_s / max(FIRST_S, flown_s))
    return state.usual_long + (max(0.0, estimate.factor) - state.usual_long) * share


def _usual(state: BatteryState) -> float:
    return 1.0 if state.usual is None else state.usual


def _slack(state: BatteryState, limits: Limits, share: float = 1.0) -> float:
    if state.estimate is None:
        return share * limits.drain_slack
    return share * (limits.drain_slack + UNSURE_SD * state.estimate.factor_sd / max(0.1, _usual(state)))


def _followed_usual(
    state: BatteryState, estimate: BatteryEstimate, drift: Drift, elapsed_s: float, now_s: float
) -> float:
    """Return what is usual now: it follows the filter, but a drain must not become usual before it is found."""
    calm = drift.excess_pct <= CALM_PCT and state.charge.drift.excess_pct <= CALM_PCT
    flown_s = now_s - (state.began_s if state.began_s is not None else now_s)
    within_s = min(USUAL_S, max(FIRST_S, flown_s / 2)) if calm else USUAL_S
    return _usual(state) + (max(0.0, estimate.factor) - _usual(state)) * min(1.0, elapsed_s / within_s)
