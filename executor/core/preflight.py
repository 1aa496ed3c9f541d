"""What must be true before anything moves: plain checks over what the vehicles said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from executor.core.context import Context
from executor.core.messages import Heartbeat, Position
from missions import Dialect, FlightPath, Pad, check_separation, estimate

AUTOPILOT_NUMBERS = {"ardupilot": 3, "px4": 12}
"""MAV_AUTOPILOT."""
FARTHEST_PAD_M = 200.0
"""A vehicle that stands farther from the depot than this is not the one that the site file means."""


class Severity(Enum):
    """What a finding means for the flight."""

    OK = "ok"
    WARNING = "warning"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the checklist."""

    severity: Severity
    subject: str
    text: str


@dataclass(frozen=True, slots=True)
class Facts:
    """What one vehicle said before the flight."""

    name: str
    heartbeat: Heartbeat
    position: Position
    remaining_pct: float
    version: str
    failsafe_action: float | None
    """The parameter for the silence of the ground station; None if it was not answered."""
    failsafe_timeout_s: float | None


def pad_from(facts: Facts, east_m: float, north_m: float) -> Pad:
    """Return the place where a vehicle really stands, which is where it will land."""
    return Pad(facts.name, east_m, north_m, facts.position.alt_msl_m - facts.position.alt_rel_m)


def identity(facts: Facts, dialect: Dialect, place_m: tuple[float, float]) -> list[Check]:
    """Check that the vehicle, which stands at `place_m` of the local frame, is the one that the site file means."""
    found: list[Check] = []
    away_m = math.hypot(*place_m)
    expected = AUTOPILOT_NUMBERS[dialect.name]
    if facts.heartbeat.autopilot != expected:
        text = f"its heartbeat says autopilot {facts.heartbeat.autopilot}, expected {dialect.name} ({expected})"
        found.append(Check(Severity.STOP, facts.name, text))
    if facts.heartbeat.armed:
        found.append(Check(Severity.STOP, facts.name, "is armed already, expected a vehicle at rest on its pad"))
    if away_m > FARTHEST_PAD_M:
        text = f"stands {away_m:.0f} m from the depot, expected at most {FARTHEST_PAD_M:.0f} m"
        found.append(Check(Severity.STOP, facts.name, text))
    return found


def failsafe(facts: Facts, dialect: Dialect, link_timeout_s: float) -> Check:
    """Say what the vehicle does by itself when it does not hear us, and whether our time-out waits for that."""
    rule = dialect.ground_station_failsafe
    if facts.failsafe_action is None:
        return Check(Severity.WARNING, facts.name, f"did not say what it does when the link is lost ({rule.action})")
    if facts.failsafe_action == 0:
        text = f"no ground-station failsafe ({rule.action} 0): lost in silence, it flies its mission to the end"
        return Check(Severity.WARNING, facts.name, text)
    acts_s = rule.returns_after_s if facts.failsafe_timeout_s is None else (
        facts.failsafe_timeout_s + rule.returns_after_s - rule.reacts_after_s
    )  # fmt: skip
    if link_timeout_s < acts_s:
        text = (
            f"faults.link_timeout_s {link_timeout_s:g} is shorter than its own failsafe ({acts_s:g} s): its segments "
            "would be given away while it still flies them"
        )
        return Check(Severity.WARNING, facts.name, text)
    return Check(
        Severity.OK,
        facts.name,
        f"acts by itself after {acts_s:g} s without us ({rule.action} {facts.failsafe_action:g})",
    )


def energy(context: Context, name: str, path: FlightPath | None, remaining_pct: float) -> Check:
    """Compare what the flight should take with what is in the battery."""
    setup = context.vehicles[name]
    if path is None:
        return Check(Severity.OK, name, f"stays on the ground as a spare, battery {remaining_pct:.0f} %")
    needed = estimate(path, context.travel, context.setup.motion)
    left = remaining_pct - needed.energy_pct
    text = (
        f"battery {remaining_pct:.0f} %, flight {needed.duration_s / 60:.1f} min and {needed.energy_pct:.0f} %, "
        f"lands with {left:.0f} %"
    )
    if left < setup.reserve_pct:
        return Check(Severity.STOP, name, f"{text}, expected at least the reserve of {setup.reserve_pct:g} %")
    return Check(Severity.OK, name, text)


def separation(paths: list[FlightPath], layer_m: float, home_alt_m: Mapping[str, float]) -> list[Check]:
    """Check that heights and layers keep any two vehicles apart."""
    found = [
        Check(Severity.STOP, "separation", text) for text in check_separation(paths, layer_m, home_alt_m=home_alt_m)
    ]
    return found or [Check(Severity.OK, "separation", f"any two vehicles stay at least {layer_m:g} m apart")]
