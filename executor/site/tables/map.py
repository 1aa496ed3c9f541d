"""What the operator sees below the line."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from executor.site.tables.fields import FileName, Metres, SiteTable


class MapTable(SiteTable):
    """What lies below the line on the page, in the report and in pictures. Nothing is fetched."""

    background: FileName | None = None
    """A picture of the ground, such as an orthophoto: GeoTIFF of any reference system, or MBTiles; relative to the site
    file."""
    attribution: Annotated[str, Field(max_length=200)] | None = None
    """Whom the picture is by, to be shown with it; without it what the file says."""
    contour_m: Metres | None = None
    """Height between contour lines, where the ground's heights are known; without it what fits the relief."""
