"""The ground between the lines, from rasters of heights on this computer."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from executor.site.tables.fields import FileName, SiteTable

Margin = Annotated[float, Field(gt=0, le=500, allow_inf_nan=False)]


class TerrainTable(SiteTable):
    """The ground as a raster of heights knows it: every leg keeps a margin over it."""

    files: FileName | Annotated[tuple[FileName, ...], Field(min_length=1)]
    """GeoTIFF or COG (Copernicus GLO-30), SRTM `.hgt`, DTED or ASCII grids, or folders of them, relative to the site
    file, in any reference system. Where several know the ground, the one of the smallest cells does."""
    vertical: Literal["file", "egm2008", "egm96", "ellipsoid"] = "file"
    """What their heights are counted from: `file` takes the word of the file, or of a product that is known by its
    name; others must be told. Heights over the ellipsoid need a geoid that PROJ has on this computer."""
    margin_m: Margin = 20.0
    """Least height of every leg, every transit and every way home over the ground, beside `uncertainty_m`."""
    uncertainty_m: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] | None = None
    """Nine of ten heights are nearer than this to the truth. Without it 4 of Copernicus GLO-30 and 16 of SRTM, as they
    are specified; other rasters need it. A metre is added where their geoid is not that of the vehicles, EGM96."""
    line_margin_m: Margin | None = None
    """Least height of every leg over the top of a line that it crosses or follows; without it two thirds of
    `[inspection] height_m`."""
