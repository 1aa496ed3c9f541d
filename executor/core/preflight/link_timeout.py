"""The link time-out: how long a vehicle may be silent before it counts as lost."""

from __future__ import annotations

from executor.core.preflight.onboard_failsafes import LinkFailsafe
from missions import Dialect

LINK_MARGIN_S = 3.0
"""Beyond the time in which a vehicle's own failsafe has acted."""
LEAST_LINK_TIMEOUT_S = 10.0


def effective_link_timeout_s(
    dialect: Dialect, wanted_s: float | None, stall_s: float, own: LinkFailsafe | None = None
) -> float:
    """Return the silence after which a vehicle is lost.

    It is the site's figure, or by default when the vehicle's own failsafe must have acted. A figure that is shorter
    than what the vehicle says of itself is not taken: its segments would be given away while it still flies them.

    Args:
        dialect: The vehicle's autopilot.
        wanted_s: The site's figure, if it has one.
        stall_s: The shortest silence that can be told from a busy computer, in the vehicles' time.
        own: What the vehicle says of itself, once it was asked.
    """
    rule = dialect.ground_station_failsafe
    # Of what nobody knows the worst is assumed: that it acts, and as late as that.
    acts_s = None if own is None or own.acts is False else own.after_s
    if wanted_s is not None and wanted_s >= (acts_s or 0.0):
        return wanted_s
    if acts_s is None or wanted_s is None:
        least_s = stall_s + rule.returns_after_s - rule.reacts_after_s
        acts_s = max(rule.returns_after_s if acts_s is None else acts_s, least_s)
    return max(LEAST_LINK_TIMEOUT_S, acts_s + LINK_MARGIN_S)
