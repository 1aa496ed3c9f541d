"""A pack's voltage at rest while it flies: a Kalman filter over (resting voltage, resistance).

Voltage = resting voltage - current * resistance. Recursive least squares over the pairs that a vehicle reports, with a
resting voltage that may sink as the pack empties: a load step - the take-off, a climb, a gust - tells the resistance,
and what comes between tells the resting voltage, each with its uncertainty. Without a current nothing is said in
flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

NOISE = 0.004
"""Standard deviation of a voltage, as a share of it: the converter's steps, and a current that lags behind it."""
SINKS = 0.0008
"""What the resting voltage may walk in a second, as a share of it: 0.08 %/s of charge at 10 mV a cell and percent."""
FIRST_OHM, FIRST_OHM_SD = 0.0, 0.1
"""Before any load step, by volt of the pack and ten amperes: anything from nothing to a pack at its end."""
WARMS = 0.1
"""Relative change of the resistance in `WARMS_S`."""
WARMS_S = 300.0
POLARISED = 0.25
"""Share of the ohmic sag that builds up over a minute besides, as ions lag behind: no resting voltage has it. A cell
that rests recovers so much in minutes (recorded: 0.03 to 0.06 V a cell after 13 A from 5.1 Ah)."""
GAP_S = 30.0
"""After a longer silence the resting voltage is another one."""
AT_REST_A = 1.5
"""What avionics alone take at most; more, on the ground or in the air, is a load."""


@dataclass(frozen=True, slots=True)
class SagEstimate:
    """State and covariance."""

    rest_v: float
    ohm: float
    var_v: float
    covariance: float
    var_ohm: float
    at_s: float
    current_a: float = 0.0
    """At its last report."""

    @property
    def rest_sd_v(self) -> float:
        """Standard deviation of the resting voltage."""
        return math.sqrt(max(0.0, self.var_v))

    @property
    def ohm_sd(self) -> float:
        """Standard deviation of the resistance."""
        return math.sqrt(max(0.0, self.var_ohm))

    @property
    def recovered_v(self) -> float:
        """The voltage that it would come to if it rested for minutes."""
        return self.rest_v + POLARISED * max(0.0, self.ohm) * self.current_a


def update_sag(
    known: SagEstimate | None, voltage_v: float, current_a: float, now_s: float, ohm: tuple[float, float] | None = None
) -> SagEstimate:
    """Take a voltage and the current that was measured with it; `ohm` was known of the resistance before any."""
    noise = (NOISE * voltage_v) ** 2
    if known is None or now_s - known.at_s > GAP_S or now_s < known.at_s:
        wide_ohm = FIRST_OHM_SD * voltage_v / 10.0
        first = SagEstimate(voltage_v, FIRST_OHM, (0.2 * voltage_v) ** 2, 0.0, wide_ohm**2, now_s)
        if known is None and ohm is not None:
            first = replace(first, ohm=ohm[0], var_ohm=min(wide_ohm, ohm[1]) ** 2)
        if known is not None:  # the resistance is still that of the pack, unless it is another one
            first = replace(first, ohm=known.ohm, var_ohm=known.var_ohm + (WARMS * known.ohm) ** 2)
        return _correct_sag(first, voltage_v, current_a, noise, now_s)
    elapsed_s = now_s - known.at_s
    ahead = replace(
        known,
        var_v=known.var_v + (SINKS * voltage_v) ** 2 * elapsed_s,
        var_ohm=known.var_ohm + (WARMS * known.ohm) ** 2 * elapsed_s / WARMS_S,
    )
    return _correct_sag(ahead, voltage_v, current_a, noise, now_s)


def _correct_sag(ahead: SagEstimate, voltage_v: float, current_a: float, noise: float, now_s: float) -> SagEstimate:
    innovation = voltage_v - (ahead.rest_v - current_a * ahead.ohm)
    of_v = ahead.var_v - current_a * ahead.covariance
    of_ohm = ahead.covariance - current_a * ahead.var_ohm
    spread = of_v - current_a * of_ohm + noise
    return SagEstimate(
        ahead.rest_v + of_v / spread * innovation,
        ahead.ohm + of_ohm / spread * innovation,
        ahead.var_v - of_v * of_v / spread,
        ahead.covariance - of_v * of_ohm / spread,
        ahead.var_ohm - of_ohm * of_ohm / spread,
        now_s,
        current_a,
    )
