"""Areas that flights keep out of, and places that have a name."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from executor.site.tables.fields import FileName, LayerName, SiteTable
from executor.site.tables.ground import check_where

LatLon = tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]]
PlaceName = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]
Margin = Annotated[float, Field(ge=2, le=1000, allow_inf_nan=False)]
Width = Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)]
OverGround = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
OverSea = Annotated[float, Field(ge=-500, le=10_000, allow_inf_nan=False)]

MARGIN_M = 10.0


class AreaTable(SiteTable):
    """Areas that flights keep out of, or keep low in: those of a file, or one polygon or line that stands here.

    A polygon is closed to every flight, unless it has a height limit; a line is the middle of a corridor.
    """

    name: PlaceName | None = None
    """What messages call it; of a file where a feature has no name of its own."""
    file: FileName | None = None
    """GeoJSON, KML or KMZ with polygons and lines, relative to the site file. A feature's own `width_m`, `margin_m`,
    `max_agl_m` and `max_amsl_m` count before those of this table."""
    layer: LayerName | tuple[LayerName, ...] = ()
    """The folders of KML to read; without it all of them."""
    where: Annotated[str, AfterValidator(check_where), Field(max_length=1000)] | None = None
    """Only features of which this holds, such as `class = 'CTR'`."""
    polygon: Annotated[tuple[LatLon, ...], Field(min_length=3)] | None = None
    """Corners as [latitude, longitude], instead of a file."""
    line: Annotated[tuple[LatLon, ...], Field(min_length=2)] | None = None
    """The middle of a corridor that others fly along, as [latitude, longitude], instead of a file."""
    width_m: Width | None = None
    """Of a corridor, from side to side."""
    margin_m: Margin = MARGIN_M
    """How far flights keep from it: GPS, wind and corners that are cut take 2 m at least."""
    max_agl_m: OverGround | None = None
    """Flights may enter, and stay below this over the ground."""
    max_amsl_m: OverSea | None = None
    """The same above mean sea level; an airspace that begins at 300 m is one of 300."""

    @model_validator(mode="after")
    def _check_source(self) -> AreaTable:
        given = [key for key in ("file", "polygon", "line") if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(f"file: expected one of file, polygon and line, got {' and '.join(given) or 'none'}")
        if self.file is not None:
            return self
        if self.name is None:
            raise ValueError(f"name: expected one beside {given[0]}: messages call the area by it")
        if self.layer or self.where is not None:
            raise ValueError(f"{'layer' if self.layer else 'where'}: expected none beside {given[0]}")
        limited = self.max_agl_m is not None or self.max_amsl_m is not None
        if self.line is not None and (self.width_m is None or limited):
            raise ValueError("width_m: expected a width and no height limit beside line: it is a corridor")
        if self.polygon is not None and self.width_m is not None:
            raise ValueError("width_m: expected none beside polygon, got one")
        return self


class PlaceTable(SiteTable):
    """A place that people call by a name."""

    name: PlaceName
    """What messages call it, and `pad` of a vehicle."""
    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level; without it as high as the depot's."""
    kind: Literal["pad", "alternate"]
    """`pad`: where a vehicle starts and lands; `alternate`: where one may come down that does not come home."""
