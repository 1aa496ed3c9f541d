"""Where the line is, and how it is flown along."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from executor.site.tables.fields import FileName, LayerName, Metres, Positive, SiteTable, Speed, WindSpeed
from missions import SNAP_M, parse_where


class DepotTable(SiteTable):
    """Where the vehicles start and land. May be left out where the network's file has a depot."""

    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level. Needed, here or in the network's file, where the network knows its ground."""


def check_where(text: str) -> str:
    """Return a filter if it is one."""
    try:
        parse_where(text)
    except ValueError as error:
        raise PydanticCustomError("filter", "{reason}", {"reason": str(error)}) from error
    return text


class NetworkTable(SiteTable):
    """The power line."""

    file: FileName
    """GeoJSON, KML, KMZ, GPX, OpenStreetMap, GeoPackage, shapefile, CSV, XLSX, or a graph file of pylon offsets,
    relative to the site file; `default` is faultline's own network."""
    layer: LayerName | tuple[LayerName, ...] = ()
    """The layer, sheet or folder to read, or several; needed where a file has more than one of poles or of lines."""
    where: Annotated[str, AfterValidator(check_where), Field(max_length=1000)] | None = None
    """Only lines of which this holds, such as `voltage >= 110000 and operator = 'CEPS'`; of a table, only such rows."""
    snap_m: Annotated[float, Field(ge=0.01, le=50, allow_inf_nan=False)] = SNAP_M
    """Ends of lines, and lines and poles, that are nearer to each other than this meet."""
    max_span_m: Annotated[float, Field(ge=5, le=20_000, allow_inf_nan=False)] | None = None
    """Where the file has no poles, spans that are longer than this are divided evenly."""
    radius_m: Positive | None = None
    """Only segments whose two pylons are both nearer to the depot than this; without it all of them."""
    crs: str | None = None
    """The reference system of a file that does not say its own, such as `EPSG:5514`. Of a graph file the map grid of
    its metres; without it they are true east and north."""
    encoding: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    """The encoding of a CSV file or of a shapefile's names, such as `cp1250`; without it it is tried, and said."""
    tallest_m: Positive | None = None
    """Height of the tallest structure. Confirms that heights which look too large for pylons are metres over ground."""
    pylon_height_m: Annotated[float, Field(ge=2, le=400, allow_inf_nan=False)] | None = None
    """Height over their ground of all pylons that have none in the file."""


class InspectionTable(SiteTable):
    """How the line is flown."""

    height_m: Metres = 15.0
    """Inspection height over the pylon tops where the network knows them, else over the depot's ground."""
    heights: Literal["known", "flat"] = "known"
    """`flat` claims that the ground is everywhere as high as the depot's, where the network does not know it."""
    ceiling_m: Metres = 120.0
    """No mission goes higher than this over the ground; to fly higher needs a permit."""
    return_ceiling_m: Metres | None = None
    """The same for the RTL height, which is level and so higher over valleys; without it `ceiling_m` holds."""
    standoff_m: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 5.0
    """Horizontal distance from the line, always on the same side."""
    speed_m_s: Speed = 3.0
    """Speed along the line."""
    transit_speed_m_s: Speed = 8.0
    """Speed between segments, and from and to the pad."""
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """The wind by where the air moves to: east, north. Plans count with it."""
    layer_m: Metres = 5.0
    """Least distance between any two vehicles; heights are layered by it."""
    same_distance: bool = False
    """`true`: inspect at `height_m` instead of the layer height wherever no other vehicle can be present. A vehicle
    with others beside it descends once they have left; segments inspected from a layer are re-inspected if battery
    remains, before RTL or from the pad. The descents cost time, and a lost vehicle's segments are reassigned only once
    it must have left the line."""
    corridor_m: Metres = 10.0
    """A segment counts as inspected only where the flown track is within this of the planned one."""
