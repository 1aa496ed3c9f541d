"""How a line is inspected where the site says nothing else: heights, distances, speeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from missions.validation import Flag

MOST = 1000.0
"""Metres, or metres a second: a figure beyond is a mistake."""
Size = Annotated[float, Field(strict=True, gt=0, le=MOST)]


@dataclass(frozen=True, slots=True)
class Inspection:
    """How segments are flown; the same figures as the site file's section of this name."""

    height_m: Size = 15.0
    """The lowest layer's, over the pylon tops if their heights are known, else over the depot's ground."""
    standoff_m: Annotated[float, Field(strict=True, ge=0, le=MOST)] = 5.0
    """Of the flight track from the line, to the right of a segment's direction from a to b."""
    speed_m_s: Size = 3.0
    transit_speed_m_s: Size = 8.0
    layer_m: Size = 5.0
    """The distance that any two vehicles must keep."""
    flat: Flag = False
    """Whether the ground is claimed to be as high as the depot's everywhere."""
    ceiling_m: Size = 120.0
    """No mission goes higher than this over the ground."""
    return_ceiling_m: Size | None = None
    """The same for the vehicles' own returns, which are level: over hills they are higher than missions."""
    same_distance: Flag = False
    """Whether every vehicle inspects at ``height_m``, and not in its layer, wherever no other can meet it there."""
