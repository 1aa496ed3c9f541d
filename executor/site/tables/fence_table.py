"""The fences and rally points that vehicles are given for a flight."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from executor.site.tables.fields import SiteTable


class FenceTable(SiteTable):
    """Fence and rally points of each vehicle, made from the plan.

    With this table, what is on board is read and held against the plan; nothing is changed there without `enabled`.
    """

    enabled: bool = False
    """Whether every vehicle is given a fence of its own for the flight; what it had is given back after the landing."""
    margin_m: Annotated[float, Field(ge=5, le=1000, allow_inf_nan=False)] = 20.0
    """How far the fence is at least from the vehicle's ways, its own straight way home among them."""
    height_margin_m: Annotated[float, Field(ge=5, le=500, allow_inf_nan=False)] = 10.0
    """How far the fence ends above all that the vehicle flies by any plan, its RTL among it."""
    action: Literal["keep", "warn", "hold", "return", "land"] = "keep"
    """What the vehicle does when it breaches the fence: `keep` leaves its own parameter, any other is set for the
    flight."""
    rally: Literal["pad", "keep"] = "pad"
    """Where its own RTL may end: `pad`, at its own pad alone; `keep` leaves the rally points that are on board."""
