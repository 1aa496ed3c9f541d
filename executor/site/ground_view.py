"""What lies below the line where the operator looks: a picture of the ground, its relief, and whom they are by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from executor.adapters.extras import Extra, describe_missing_extra, require_extra
from executor.site.hillshade import Heights, Hillshade, compute_hillshade
from executor.site.site_model import SiteModel
from executor.site.tables.map import MapTable
from missions import LocalFrame
from missions.geo import FloatArray
from missions.readers.background_files import Background, Corner, PictureArea, read_background

BESIDE_M = 300.0
BESIDE = 0.25
"""How far around the line the ground is shown: by this share of its extent, too."""
MOST_PIXELS = 6_000_000
"""Of the picture: a metre and a half each for a line of four kilometres."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundView:
    """The ground around a line; either may be missing."""

    low_m: Corner
    high_m: Corner
    background: Background | None = None
    relief: Hillshade | None = None
    attribution: str = ""


def build_ground_view(
    table: MapTable | None, base: Path, frame: LocalFrame, places_m: FloatArray, heights: Heights | None = None
) -> GroundView:
    """Return the ground around places, as a site wants it.

    Args:
        table: What the site says of maps; None if nothing.
        base: The folder of the site file.
        frame: Local metres.
        places_m: (n, 2) what must be on the map: pylons, pads.
        heights: Who knows the ground's heights, if anybody does.

    Raises:
        BackgroundError: the picture cannot be used.
        ExtraMissing: nothing is installed to read it with.
    """
    table = table or MapTable()
    low_m, high_m = compute_shown_area(places_m)
    view = GroundView(low_m, high_m)
    if table.background is not None:
        require_extra(Extra.MAPS, "[map] background")
        wanted = PictureArea(frame, low_m, high_m, MOST_PIXELS)
        background = read_background(base / table.background, wanted)
        by = background.attribution if table.attribution is None else table.attribution
        view = replace(view, background=background, attribution=by)
    if heights is not None and not describe_missing_extra(Extra.MAPS, "relief"):
        view = replace(view, relief=compute_hillshade(heights, low_m, high_m, table.contour_m))
    return view


def view_for(ground: SiteModel, base: Path) -> GroundView:
    """Return the ground around a site's line and pads.

    Raises:
        BackgroundError: the picture cannot be used.
        ExtraMissing: nothing is installed to read it with.
    """
    pads_m = np.array([(pad.east_m, pad.north_m) for pad in ground.setup.pads])
    places_m = np.concatenate((ground.network.positions_m, pads_m))
    heights = None if ground.terrain is None else ground.terrain.elevation
    return build_ground_view(ground.site.map, base, ground.network.frame, places_m, heights)


def compute_shown_area(places_m: FloatArray) -> tuple[Corner, Corner]:
    """Return the corners of the area that is shown around (n, 2) places and the depot."""
    shown = np.concatenate((places_m, np.zeros((1, 2))))
    low, high = shown.min(axis=0), shown.max(axis=0)
    beside_m = BESIDE_M + BESIDE * float((high - low).max())
    low, high = np.floor(low - beside_m), np.ceil(high + beside_m)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
