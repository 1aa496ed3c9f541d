"""What a battery holds and what the vehicle uses: a Kalman filter over (remaining percent, consumption factor).

A Kalman filter, because both unknowns enter linearly: a stretch of flight that the energy model puts at m percent takes
factor * m from what remains, and a report is what remains, rounded. Two states and one measurement need no matrix
library, and the covariance between them is what a projection needs: a factor that was learned too high goes with a
remaining charge that was taken too high. A scale factor alone (its Bayesian twin) would not say how sure the charge is.

The factor is a random walk, for wind and load change in flight; gusts add to what is used, in proportion to it. Both
are as small as flights of vehicles that differ from their models say (`faultline bench prediction`); a drain is found
by the account, which looks for what no wind explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

ROUNDED_VAR = 1.0 / 12.0
"""Of a report, in percent squared: both autopilots report whole percents."""
SAWTOOTH_S = 12.0
"""A whole percent lasts this long in an ordinary flight (0.083 %/s in the recorded ones): reports nearer to each other
share one rounding error, and count as one."""
FACTOR_WALK = 0.02
"""Relative change of the factor in `WALK_S`: a wind that turns, a load that is dropped."""
WALK_S = 300.0
GUST_VAR = 0.002
"""Variance in percent squared for each percent used: gusts and climbs, 0.14 % over ten."""
LEAST_VAR = 1e-4
COUNTED_VAR = 0.15**2
"""Of a counter of charge, in percent squared: its own steps, and a capacity that was learned from whole percents."""
OUTLIER_SD = 2.5
"""An innovation beyond this, and beyond `OUTLIER_PCT`, is a jump and says nothing of the factor: a percentage that was
estimated anew. What a vehicle really uses shows in many small innovations."""
OUTLIER_PCT = 2.0


BAND_SD = 1.5
"""Standard deviations on both sides of the mean that hold nine flights of ten: what comes in has thinner tails than a
normal distribution, whose 1.645 held 96 to 98 % in some tenths of a route (`faultline bench prediction --varied`)."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is believed of the factor before anything was used."""

    factor: float = 1.0
    sd: float = 0.12
    """Of the factor: 10 % between vehicles of one data sheet, 5 % between packs, 4 % for the wind."""
    slack: float = 0.0
    """Share of the usual by which a vehicle of which no data sheet is known may use more in one flight than in another:
    its speeds and climbs cost what nobody says."""


@dataclass(frozen=True, slots=True)
class BatteryEstimate:
    """State and covariance."""

    remaining_pct: float
    factor: float
    var_remaining: float
    covariance: float
    var_factor: float

    @property
    def factor_sd(self) -> float:
        """Standard deviation of the factor."""
        return math.sqrt(self.var_factor)


@dataclass(frozen=True, slots=True)
class Projection:
    """What will be left after a stretch of flight, as a normal distribution."""

    mean_pct: float
    sd_pct: float

    @property
    def band_pct(self) -> float:
        """Half the width of the band about the mean in which nine flights of ten should land."""
        return BAND_SD * self.sd_pct

    def chance_below(self, floor_pct: float) -> float:
        """Return the probability that less than `floor_pct` is left.

        >>> Projection(15.0, 2.0).chance_below(15.0)
        0.5
        """
        return 0.5 * math.erfc((self.mean_pct - floor_pct) / (self.sd_pct * math.sqrt(2.0)))


def initialise_estimate(reported_pct: float, prior: Prior) -> BatteryEstimate:
    """Return what the first report says."""
    return BatteryEstimate(reported_pct, prior.factor, ROUNDED_VAR, 0.0, prior.sd**2)


def predict_estimate(estimate: BatteryEstimate, modelled_pct: float, elapsed_s: float) -> BatteryEstimate:
    """Carry the estimate on over a stretch that the model puts at `modelled_pct`."""
    walk = (FACTOR_WALK * estimate.factor) ** 2 * max(0.0, elapsed_s) / WALK_S if modelled_pct > 0 else 0.0
    gusts = GUST_VAR * estimate.factor * modelled_pct
    return BatteryEstimate(
        estimate.remaining_pct - estimate.factor * modelled_pct,
        estimate.factor,
        estimate.var_remaining
        - 2 * modelled_pct * estimate.covariance
        + modelled_pct**2 * estimate.var_factor
        + gusts
        + LEAST_VAR * 0.01,
        estimate.covariance - modelled_pct * estimate.var_factor,
        estimate.var_factor + walk,
    )


def correct_with_report(
    estimate: BatteryEstimate, reported_pct: float, since_s: float, roughness_pct: float = 0.0
) -> BatteryEstimate:
    """Take a report of what remains.

    Args:
        estimate: carried on until the report.
        reported_pct: rounded to whole percents.
        since_s: since the report before.
        roughness_pct: how much the reports are known to waver.
    """
    single = ROUNDED_VAR + roughness_pct**2 / 4
    innovation = reported_pct - estimate.remaining_pct
    if abs(innovation) > max(OUTLIER_PCT, OUTLIER_SD * math.sqrt(estimate.var_remaining + single)):
        return reset_remaining(estimate, reported_pct)
    return _apply_innovation(estimate, innovation, single * max(1.0, SAWTOOTH_S / max(since_s, 0.1)))


def correct_with_counter(estimate: BatteryEstimate, counted_pct: float) -> BatteryEstimate:
    """Take what a counter of charge says remains: it is not rounded."""
    innovation = counted_pct - estimate.remaining_pct
    if abs(innovation) > OUTLIER_PCT:
        return reset_remaining(estimate, counted_pct)
    return _apply_innovation(estimate, innovation, COUNTED_VAR)


def _apply_innovation(estimate: BatteryEstimate, innovation: float, noise: float) -> BatteryEstimate:
    spread = estimate.var_remaining + noise
    gain, gain_factor = estimate.var_remaining / spread, estimate.covariance / spread
    return BatteryEstimate(
        estimate.remaining_pct + gain * innovation,
        estimate.factor + gain_factor * innovation,
        max(LEAST_VAR, (1 - gain) * estimate.var_remaining),
        (1 - gain) * estimate.covariance,
        max(LEAST_VAR, estimate.var_factor - gain_factor * estimate.covariance),
    )


def reset_remaining(estimate: BatteryEstimate, reported_pct: float) -> BatteryEstimate:
    """Take a report that no consumption explains: the charge is another one, the consumption is not."""
    return replace(estimate, remaining_pct=reported_pct, var_remaining=ROUNDED_VAR, covariance=0.0)


def project_remaining(estimate: BatteryEstimate, modelled_pct: float) -> Projection:
    """Return what will be left after a stretch that the model puts at `modelled_pct`."""
    ahead = predict_estimate(estimate, modelled_pct, 0.0)
    return Projection(ahead.remaining_pct, math.sqrt(max(ahead.var_remaining, LEAST_VAR)))
