"""Default inspection heights, distances and speeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from missions.validation import Flag

MOST = 1000.0
"""Largest plausible value in m or m/s."""
Size = Annotated[float, Field(strict=True, gt=0, le=MOST)]


@dataclass(frozen=True, slots=True)
class Inspection:
    """How segments are flown; the same keys as the site file's section of this name."""

    height_m: Size = 15.0
    """Height of the lowest layer above pylon tops if known, else above the depot's ground."""
    standoff_m: Annotated[float, Field(strict=True, ge=0, le=MOST)] = 5.0
    """Distance of the track from the line, to the right of a segment's direction from a to b."""
    speed_m_s: Size = 3.0
    transit_speed_m_s: Size = 8.0
    layer_m: Size = 5.0
    """Least distance between any two vehicles."""
    flat: Flag = False
    """Whether the ground is asserted to be level with the depot."""
    ceiling_m: Size = 120.0
    """Greatest mission height above ground."""
    return_ceiling_m: Size | None = None
    """The same for RTL, which is level, so higher over valleys."""
    same_distance: Flag = False
    """Whether vehicles inspect at ``height_m`` instead of their layer wherever no other can meet them."""
