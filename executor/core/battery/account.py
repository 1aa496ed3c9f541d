"""Keep one vehicle's battery account: charge used against the energy model's figure for the flight so far.

The model is driven by the reported speed, so a detour, a hold or a slow leg is no anomaly; the rest is a factor per
vehicle (pack, load, wind), which `kalman` learns with its uncertainty. Percentage and consumed charge are watched
separately: the first is the remaining charge, the second is finer and comes from another sensor.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from executor.core.battery import kalman
from executor.core.battery.charge_counter import (
    CALM_PCT,
    WHOLE_PCT,
    ChargeCounter,
    compare_with_percentage,
    counter_remaining_pct,
    record_percent_transition,
    start_counter,
)
from executor.core.battery.cusum import Drift, add_usage
from executor.core.battery.kalman import BatteryEstimate, Prior
from executor.core.fault_thresholds import Limits

SAME_REPORT_S = 4.0
"""Time within which two reports belong together: two BATTERY_STATUS at PX4's interval."""


@dataclass(frozen=True, slots=True)
class PercentRounding:
    """The last reports with each rounding, and their times."""

    rounded: float = 0.0
    rounded_s: float = float("-inf")
    ceiled: float = 0.0
    ceiled_s: float = float("-inf")

    @property
    def percent(self) -> float:
        """The middle of the values that fit both, or the newer one if they contradict each other.

        >>> PercentRounding(96.0, 1.0, 97.0, 1.5).percent
        96.25
        """
        if abs(self.rounded_s - self.ceiled_s) > SAME_REPORT_S:
            return self.rounded if self.rounded_s > self.ceiled_s else self.ceiled
        low, high = max(self.rounded - 0.5, self.ceiled - 1.0), min(self.rounded + 0.5, self.ceiled)
        if low < high:
            return (low + high) / 2
        return self.rounded if self.rounded_s >= self.ceiled_s else self.ceiled - 0.5


FACTOR_RANGE = (0.7, 2.0)
"""Range of the factor; beyond it is a fault, which the watchpoints find."""
MIN_FACTOR = FACTOR_RANGE[0]
"""Lower bound of the usual factor: no multicopter uses less, whatever a constant percentage suggests."""
STUCK_PCT = 2.0
"""Modelled consumption after which an unchanged percentage is stuck: saturated, or estimated."""
HISTORY_S = 30.0
SLACK_SD = 2.0
"""Standard deviations of the factor that count as slack: an uncertain factor raises no fault."""
UNKNOWN_SD = 0.3
"""Standard deviation above which a vehicle is unknown, which is slack over minutes as well."""
COUNTED_SLACK = 0.75
"""Share of the slack where charge is counted: only climbs and wind, no rounding."""
USUAL_S = 150.0
"""Time constant of the usual factor: wind may turn, and a fault is found sooner. It is shorter in the first minutes."""
MIN_USUAL_S = 5.0
ROUGHNESS_MEMORY_S = 300.0
"""Time in which an observed fluctuation of the percentage is forgotten."""
GAP_S = 10.0
"""Longest silence over which the flight is known."""
BLIND_PCT = 1.5
"""Deviation of PX4's percentage without a current sensor: some percent, slowly varying."""
FULL_PCT = 100.0
"""Saturation of a percentage: PX4 reports no more for a pack whose voltage is higher."""

NO_PRIOR = Prior()
DEFAULT_LIMITS = Limits()


@dataclass(frozen=True, slots=True)
class BatterySample:
    """A report with the model's figure at that time."""

    at_s: float
    remaining_pct: float
    modelled_pct: float
    """Modelled consumption since the first report."""


@dataclass(frozen=True, slots=True)
class BatteryState:
    """A vehicle's battery since its first report."""

    first_pct: float | None = None
    first_ah: float | None = None
    """The charge counter at the first report."""
    remaining_pct: float | None = None
    """The last report; None before the first."""
    least_pct: float | None = None
    reported_s: float = float("-inf")
    modelled_pct: float = 0.0
    charge_state: int = 0
    history: tuple[BatterySample, ...] = ()
    """The reports of the last `HISTORY_S`, oldest first."""
    lowest_pct: float | None = None
    """Lowest report since the account began."""
    earlier_pct: float = 0.0
    """Percentage used before the account was restarted."""
    estimate: BatteryEstimate | None = None
    """Remaining charge and consumption factor, with their uncertainty."""
    usual: float = 1.0
    """The factor while nothing was wrong."""
    began_s: float | None = None
    """When consumption began."""
    roughness_pct: float = 0.0
    """Largest recent rise of the percentage: charge does not rise, an estimate of it fluctuates."""
    drift: Drift = field(default_factory=Drift)
    """Drain test of the percentage."""
    usual_long: float = 1.0
    """The factor over the whole flight; a mild drain becomes usual only after minutes."""
    slow: Drift = field(default_factory=Drift)
    """Drain test against `usual_long`: mild drains show only over minutes."""
    charge: ChargeCounter = field(default_factory=ChargeCounter)
    still_pct: float = 0.0
    """Least consumption since the percentage last changed."""
    stood: bool = False
    """Whether it was stuck where it should have fallen."""
    anew_s: float = float("-inf")
    """When the account began, or was restarted."""
    slack: float = 0.0
    """Slack of its prior."""

    @property
    def given_pct(self) -> float:
        """Percentage used in the whole flight; PX4's simulated battery is full again as soon as it disarms."""
        if self.first_pct is None or self.lowest_pct is None:
            return self.earlier_pct
        return self.earlier_pct + self.first_pct - self.lowest_pct


def add_modelled_use(state: BatteryState, pct: float) -> BatteryState:
    """Add the modelled consumption since the last position."""
    return replace(state, modelled_pct=state.modelled_pct + pct)


def apply_remaining_report(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR,
    limits: Limits = DEFAULT_LIMITS, middle_pct: float = 0.0,
) -> BatteryState:  # fmt: skip
    """Apply a report of the remaining charge.

    `middle_pct` is the offset from the report to the middle of its interval: 0 if it is rounded, half a percent if it
    is truncated.
    """
    stands_for_pct = min(FULL_PCT, remaining_pct + middle_pct)
    sample = BatterySample(now_s, remaining_pct, state.modelled_pct)
    least_pct = remaining_pct if state.least_pct is None else min(state.least_pct, remaining_pct)
    reported = replace(
        state, remaining_pct=remaining_pct, least_pct=least_pct, reported_s=now_s, charge_state=charge_state
    )
    if state.estimate is None or state.remaining_pct is None:
        return replace(
            reported,
            first_pct=remaining_pct,
            lowest_pct=remaining_pct,
            history=(sample,),
            estimate=kalman.initialise_estimate(stands_for_pct, prior),
            usual=prior.factor,
            usual_long=prior.factor,
            anew_s=now_s,
            slack=prior.slack,
        )
    modelled = state.modelled_pct - state.history[-1].modelled_pct
    elapsed_s = max(0.0, now_s - state.reported_s)
    used = state.remaining_pct - remaining_pct
    fades = max(0.0, 1.0 - elapsed_s / ROUGHNESS_MEMORY_S)
    roughness = max(state.roughness_pct * fades, -used)
    moved = remaining_pct != state.remaining_pct
    still_pct = 0.0 if moved else state.still_pct + MIN_FACTOR * modelled
    if still_pct >= STUCK_PCT or (moved and state.still_pct >= STUCK_PCT):
        # Nothing is known of the consumption while it was stuck; when it moves, only from there on.
        anew = rebase_account(state, remaining_pct, charge_state, now_s, prior, middle_pct)
        return replace(anew, stood=True, still_pct=still_pct)
    ahead = kalman.predict_estimate(state.estimate, modelled, elapsed_s)
    modelled = max(modelled, _silent_use_pct(state, elapsed_s))
    drift, slow = _update_drifts(state, used, modelled, elapsed_s, now_s, limits)
    charge = record_percent_transition(
        state.charge, remaining_pct + middle_pct + 0.5 * WHOLE_PCT, used, elapsed_s, now_s
    )
    estimate, charge = _correct_estimate(state, charge, ahead, stands_for_pct, elapsed_s, roughness)
    flown_s = 0.0 if state.began_s is None else now_s - state.began_s
    # A drain must be found before it becomes usual.
    calm = drift.excess_pct <= CALM_PCT and state.charge.drift.excess_pct <= CALM_PCT
    within_s = min(USUAL_S, max(MIN_USUAL_S, flown_s / 2)) if calm else USUAL_S
    recent = (one for one in state.history[:-1] if now_s - one.at_s <= HISTORY_S)
    return replace(
        reported,
        lowest_pct=remaining_pct if state.lowest_pct is None else min(state.lowest_pct, remaining_pct),
        history=(*recent, state.history[-1], sample),
        estimate=estimate,
        usual=_follow_factor(state.usual, estimate, elapsed_s, within_s),
        began_s=now_s if state.began_s is None and state.modelled_pct > 0 else state.began_s,
        roughness_pct=roughness,
        drift=drift,
        usual_long=_follow_factor(state.usual_long, estimate, elapsed_s, max(MIN_USUAL_S, flown_s)),
        slow=slow,
        charge=compare_with_percentage(charge, remaining_pct, rose_pct=-used),
        still_pct=still_pct,
    )


def _update_drifts(
    state: BatteryState, used: float, modelled: float, elapsed_s: float, now_s: float, limits: Limits
) -> tuple[Drift, Drift]:
    """Return the drain sums against the usual, and against the usual of minutes, after a stretch."""
    known = state.estimate or kalman.initialise_estimate(0.0, NO_PRIOR)
    expected = state.usual * modelled
    slack = _slack_share(state, limits) * expected + (limits.blind_swing_pct_s * elapsed_s if is_blind(state) else 0.0)
    drift = add_usage(
        state.drift, used, expected, slack_pct=slack, elapsed_s=elapsed_s, now_s=now_s,
        memory_s=limits.battery_window_s,
    )  # fmt: skip
    if known.factor_sd > UNKNOWN_SD:
        return drift, Drift()  # its usual consumption is unknown yet
    slow = add_usage(
        state.slow, used, state.usual_long * modelled,
        slack_pct=(limits.slow_slack + state.slack) * state.usual_long * modelled,
        elapsed_s=elapsed_s, now_s=now_s, memory_s=limits.slow_window_s,
    )  # fmt: skip
    return drift, slow


def record_first_count(state: BatteryState, consumed_ah: float | None) -> BatteryState:
    """Record the charge counter while the percentage is still the first one."""
    if state.first_ah is not None or state.remaining_pct != state.first_pct:
        return state
    return replace(state, first_ah=consumed_ah)


def apply_consumed_report(
    state: BatteryState, consumed_ah: float, now_s: float, limits: Limits = DEFAULT_LIMITS
) -> BatteryState:
    """Apply a report of consumed charge; its value in percent is learned from both."""
    charge = state.charge
    if state.remaining_pct is None:
        return state
    if charge.consumed_ah is None or consumed_ah < charge.consumed_ah:  # a counter that goes back was reset
        return replace(state, charge=start_counter(charge, consumed_ah, state.remaining_pct, state.modelled_pct, now_s))
    drift = charge.drift
    if charge.capacity_ah is not None:
        used = 100.0 * (consumed_ah - charge.consumed_ah) / charge.capacity_ah
        elapsed_s = max(0.0, now_s - charge.at_s)
        expected = state.usual * max(state.modelled_pct - charge.modelled_pct, _silent_use_pct(state, elapsed_s))
        drift = add_usage(
            drift, used, expected, slack_pct=_slack_share(state, limits, COUNTED_SLACK) * expected, elapsed_s=elapsed_s,
            now_s=now_s, memory_s=limits.battery_window_s,
        )  # fmt: skip
    taken = replace(charge, consumed_ah=consumed_ah, at_s=now_s, modelled_pct=state.modelled_pct, drift=drift)
    return replace(state, charge=taken)


def restart_account(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR,
    middle_pct: float = 0.0,
) -> BatteryState:  # fmt: skip
    """Restart the account: a percentage that rises is a reboot or another pack, not charging in flight."""
    fresh = BatteryState(
        least_pct=state.least_pct, earlier_pct=state.given_pct, charge=ChargeCounter(set_ah=state.charge.set_ah)
    )
    return apply_remaining_report(fresh, remaining_pct, charge_state, now_s, prior, middle_pct=middle_pct)


def draw_since_start_pct(state: BatteryState) -> float:
    """Return the charge used since the first report, as precisely as known.

    Whole percents are a large part of a small budget. The charge counter knows the charge used better than the charge
    left, which depends on the rounding of the percentage.
    """
    if state.first_pct is None or state.estimate is None:
        return 0.0
    charge = state.charge
    if (
        charge.capacity_ah is None
        or charge.consumed_ah is None
        or state.first_ah is None
        or charge.consumed_ah < state.first_ah  # it was reset
    ):
        return max(0.0, state.first_pct - state.estimate.remaining_pct)
    return 100.0 * (charge.consumed_ah - state.first_ah) / charge.capacity_ah


def apply_uninformative_report(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR,
    middle_pct: float = 0.0,
) -> BatteryState:  # fmt: skip
    """Apply a report in flight without information on consumption: saturated, or while the voltage settles."""
    moved = remaining_pct != state.remaining_pct or not state.history
    modelled = 0.0 if moved else state.modelled_pct - state.history[-1].modelled_pct
    still_pct = 0.0 if moved else state.still_pct + MIN_FACTOR * modelled
    anew = rebase_account(state, remaining_pct, charge_state, now_s, prior, middle_pct)
    return replace(anew, anew_s=state.anew_s, still_pct=still_pct, stood=state.stood or still_pct >= STUCK_PCT)


def rebase_account(
    state: BatteryState, remaining_pct: float, charge_state: int, now_s: float, prior: Prior = NO_PRIOR,
    middle_pct: float = 0.0,
) -> BatteryState:  # fmt: skip
    """Apply a report before which consumption is unknown: on the ground, or unobserved.

    The pack is the same, and so are its counter and the vehicle's learned figures.
    """
    anew = restart_account(state, remaining_pct, charge_state, now_s, derive_prior(state, prior), middle_pct)
    charge = replace(state.charge, capacity_ah=state.charge.capacity_ah, drift=Drift())
    if charge.consumed_ah is not None:
        charge = start_counter(charge, charge.consumed_ah, remaining_pct, 0.0, now_s)
    return replace(anew, charge=charge, stood=state.stood)


def derive_prior(state: BatteryState, prior: Prior) -> Prior:
    """Return the prior from the vehicle's observed consumption, if its percentage can be trusted."""
    known = state.estimate
    if known is None or is_blind(state) or not known.factor_sd < prior.sd:
        return prior
    return replace(prior, factor=max(MIN_FACTOR, known.factor), sd=known.factor_sd)


def _correct_estimate(
    state: BatteryState, charge: ChargeCounter, ahead: BatteryEstimate, stands_for_pct: float, elapsed_s: float,
    roughness_pct: float,
) -> tuple[BatteryEstimate, ChargeCounter]:  # fmt: skip
    """Return the corrected estimate and the counter; one that disagrees restarts at a coming transition."""
    fine = counter_remaining_pct(charge, stands_for_pct)
    if fine is not None:
        return kalman.correct_with_counter(ahead, fine), charge
    if charge.capacity_ah is not None:
        charge = replace(charge, first=None, last=None)
    rough_pct = max(roughness_pct, blindness_pct(state))
    return kalman.correct_with_report(ahead, stands_for_pct, elapsed_s, rough_pct), charge


def has_running_counter(state: BatteryState) -> bool:
    """Return whether a charge counter advances, whatever the percentage does."""
    charge = state.charge
    return charge.consumed_ah is not None and charge.consumed_ah > charge.began_ah


def is_blind(state: BatteryState) -> bool:
    """Return whether the percentage has no charge counter behind it."""
    return state.stood or not has_running_counter(state) or not state.charge.follows


def blindness_pct(state: BatteryState) -> float:
    """Return the standard deviation of a percentage without a charge counter.

    It is derived from the voltage, which changes with load and temperature.
    """
    return BLIND_PCT if is_blind(state) else 0.0


def consumption_factor(state: BatteryState) -> float:
    """Return the vehicle's consumption relative to the model."""
    if state.estimate is None:
        return 1.0
    low, high = FACTOR_RANGE
    return min(high, max(low, state.estimate.factor))


def excess_pct(state: BatteryState, window_s: float) -> tuple[float, float]:
    """Return the consumption of the last seconds beyond the usual, and the usual one."""
    if len(state.history) < 2:
        return 0.0, 0.0
    last = state.history[-1]
    first = next(sample for sample in state.history if last.at_s - sample.at_s <= window_s)
    expected = (last.modelled_pct - first.modelled_pct) * state.usual
    return (first.remaining_pct - last.remaining_pct) - expected, expected


def _silent_use_pct(state: BatteryState, elapsed_s: float) -> float:
    """Return the modelled consumption of a silence, whose positions may arrive after the report that ends it."""
    if elapsed_s < GAP_S or len(state.history) < 2:
        return 0.0
    first, last = state.history[0], state.history[-1]
    span_s = last.at_s - first.at_s
    return (last.modelled_pct - first.modelled_pct) / span_s * elapsed_s if span_s > 0 else 0.0


def _follow_factor(usual: float, estimate: BatteryEstimate, elapsed_s: float, within_s: float) -> float:
    """Return a usual factor after a report: it follows the filter with this time constant.

    For an unknown vehicle, the first observed consumption is usual, not that of its type.
    """
    share = 1.0 if estimate.factor_sd > UNKNOWN_SD else min(1.0, elapsed_s / within_s)
    return usual + (max(MIN_FACTOR, estimate.factor) - usual) * share


def _slack_share(state: BatteryState, limits: Limits, share: float = 1.0) -> float:
    if state.estimate is None:
        return share * limits.drain_slack
    doubt = state.estimate.factor_sd / max(0.1, state.usual)
    if state.slack and is_blind(state):
        # Most of that doubt is the percentage's own, which `blind_swing_pct_s` allows for already.
        return share * (limits.drain_slack + doubt)
    return share * (limits.drain_slack + state.slack + SLACK_SD * doubt)
