"""How a flight is run, and when something is a fault."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from executor.site.tables.fields import Positive, SiteTable


class FlightTable(SiteTable):
    """How the flight is run."""

    speedup: Annotated[float, Field(gt=0, le=100)] = 1.0
    """Speed of a simulation in multiples of real time; time-outs and heartbeats follow it. Real aircraft: 1."""
    solve_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Time limit of the solver for a re-plan, in real time."""
    connect_timeout_s: Positive = 15.0
    """Before the flight: how long a vehicle that sends nothing is waited for, in real time."""
    ready_timeout_s: Positive = 120.0
    """Before the flight: how long a vehicle may take until it is ready to arm, in the vehicle's time."""
    fly_again: Literal["ask", "never", "auto"] = "ask"
    """Whether a vehicle on the ground takes off for a re-plan, or to fly again what was inspected from a layer: `ask`,
    once the crew says that its pad is clear; `never` after it has landed; `auto`, by itself, for simulation only."""
    offer_s: Positive = 300.0
    """How long the crew may take to answer such an offer once no vehicle flies any more."""
    pilot_grace_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    """How long the segments of a vehicle that its pilot has taken are kept for it."""
    pilot_return: Literal["ask", "auto"] = "ask"
    """When a pilot has put the vehicle back on its mission: `ask` waits for the operator's include, `auto` does not."""
    inferred: Literal["count", "fly"] = "count"
    """What a vehicle flew while it was not heard, or nobody listened, where its clock, place and mission fit: `count`
    it, marked as inferred; `fly` it again for proof by positions."""


class FaultsTable(SiteTable):
    """Thresholds for link loss and battery faults."""

    link_timeout_s: Positive | None = None
    """Silence until a vehicle is declared lost. Without it: until its own GCS failsafe has acted, plus a margin.
    A figure shorter than that time is not taken."""
    link_stale_s: Positive = 3.0
    """Silence until a vehicle's link is called stale: a warning, no fault."""
    battery_step_pct: Positive = 8.0
    """A loss of this much at once, beyond what the flight costs, is a battery fault."""
    battery_excess_pct: Positive = 2.0
    """A loss of this much beyond the usual consumption is a battery drain."""
    battery_window_s: Positive = 90.0
    """Time in which an excess of consumption is forgotten but for a third."""
    camera: Literal["home", "on"] = "home"
    """A vehicle whose camera or gimbal fails flies `home`, or `on` with what it can see without it."""
