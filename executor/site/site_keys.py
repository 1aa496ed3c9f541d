"""Site-file keys for the site itself: ground, line, areas, places, vehicles, cameras."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from executor.core.battery.voltage import Chemistry
from executor.core.interface.connection import Connection, parse_connection
from executor.core.interface.ports import LinkRequest
from missions import AUTOPILOTS, SNAP_M, parse_where
from missions.cameras import AIM_DEG, LEAST_INTERVAL_S
from missions.inspection_defaults import Inspection
from missions.terrain import GROUND_MARGIN_M
from missions.validation import Name
from planner import PRESETS
from planner.risk import RESERVE_PCT

Percent = Annotated[float, Field(ge=0, le=100)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
Metres = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Speed = Annotated[float, Field(ge=0.01, le=1000, allow_inf_nan=False)]
WindSpeed = Annotated[float, Field(ge=-20, le=20)]
HostName = Annotated[
    str, Field(max_length=253, pattern=r"^([0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*|[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*)$")
]
"""A host name, or an IPv4 or IPv6 address."""
SpanName = Annotated[str, Field(min_length=1, max_length=200)]
LayerName = Annotated[str, Field(min_length=1, max_length=200)]
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]+$")]
EnvironmentName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]
MOST_LINKS = 4
"""Most links to one vehicle."""


class SiteTable(BaseModel):
    """A table of the file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        for text in self._find_errors():
            raise ValueError(text)
        return self

    def _find_errors(self) -> Iterator[str]:
        """Yield the errors in combinations of its keys."""
        yield from ()


class DepotTable(SiteTable):
    """Where the vehicles start and land. May be left out where the network's file has a depot."""

    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level. Required here or in the network file if the network has ground heights."""


def check_where(text: str) -> str:
    """Return a filter if it is valid."""
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
    """Layers, sheets or folders to read; required if the file has more than one of poles or of lines."""
    where: Annotated[str, AfterValidator(check_where), Field(max_length=1000)] | None = None
    """Filter for lines, or for rows of a table, such as `voltage >= 110000 and operator = 'CEPS'`."""
    snap_m: Annotated[float, Field(ge=0.01, le=50, allow_inf_nan=False)] = SNAP_M
    """Distance within which line ends, and lines and poles, are joined."""
    max_span_m: Annotated[float, Field(ge=5, le=20_000, allow_inf_nan=False)] | None = None
    """Longest span in a file without poles; longer ones are divided evenly."""
    radius_m: Positive | None = None
    """Only segments whose two pylons are within this distance of the depot; default: all."""
    crs: str | None = None
    """Reference system of a file that does not name its own, such as `EPSG:5514`. For a graph file, the map grid of its
    metres; default: true east and north."""
    encoding: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    """Encoding of a CSV file or of a shapefile's names, such as `cp1250`; default: detected and reported."""
    tallest_m: Positive | None = None
    """Height of the tallest structure; confirms that heights too large for pylons are metres above ground."""
    pylon_height_m: Annotated[float, Field(ge=2, le=400, allow_inf_nan=False)] | None = None
    """Height above ground of pylons that have none in the file."""
    only: tuple[SpanName, ...] = ()
    """Spans to inspect, such as `V101.3`; a range `V101.3..V101.7`, a line `V101` or a pattern `V10*` names several.
    Default: all."""
    leave_out: tuple[SpanName, ...] = ()
    """Spans not to inspect, named the same way. Flights still keep clear of them, and spans keep their numbers."""


class LockTable(SiteTable):
    """Spans that only one vehicle flies, or that are flown in one direction only; at least one of both is needed.

    When a vehicle is lost, others may fly the spans locked to it.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    segments: Annotated[tuple[SpanName, ...], Field(min_length=1)]
    """Locked spans, named as in `only` of `[network]`. Spans that are left out stay left out."""
    vehicle: str | None = None
    """Vehicle that flies them; no other may."""
    begin: Annotated[str, Field(min_length=1, max_length=200)] | None = Field(default=None, alias="from")
    """Pylon from which they are flown in sequence, such as `V101-03`; an end of one of them."""

    def _find_errors(self) -> Iterator[str]:
        if self.vehicle is None and self.begin is None:
            yield "vehicle: expected one of vehicle and from, got neither"


_INSPECTION = Inspection()
"""Source of the site file's defaults."""


class InspectionTable(SiteTable):
    """How the line is flown."""

    height_m: Metres = _INSPECTION.height_m
    """Inspection height above the pylon tops if the network has them, else above the depot's ground."""
    heights: Literal["known", "flat"] = "known"
    """`flat` asserts that unknown ground is level with the depot."""
    ceiling_m: Metres = _INSPECTION.ceiling_m
    """Greatest mission height above ground; flying higher needs a permit."""
    return_ceiling_m: Metres | None = _INSPECTION.return_ceiling_m
    """The same for the RTL height, which is level and so higher over valleys; default: `ceiling_m`."""
    standoff_m: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = _INSPECTION.standoff_m
    """Horizontal distance from the line, always on the same side."""
    speed_m_s: Speed = _INSPECTION.speed_m_s
    """Speed along the line."""
    transit_speed_m_s: Speed = _INSPECTION.transit_speed_m_s
    """Speed between segments, and from and to the pad."""
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """Wind that plans account for, as the direction the air moves: east, north."""
    layer_m: Metres = _INSPECTION.layer_m
    """Least distance between any two vehicles, and spacing of the height layers."""
    same_distance: bool = _INSPECTION.same_distance
    """`true`: inspect at `height_m` instead of the layer height wherever no other vehicle can be present. A vehicle
    with others beside it descends once they have left; segments inspected from a layer are re-inspected if battery
    remains, before RTL or from the pad. The descents cost time, and a lost vehicle's segments are reassigned only once
    it must have left the line."""
    corridor_m: Metres = 10.0
    """Greatest deviation of the flown track from the planned one at which a segment counts as inspected."""


class MapTable(SiteTable):
    """Background of the line on the page, in the report and in pictures. Nothing is fetched."""

    background: FileName | None = None
    """A picture of the ground, such as an orthophoto: GeoTIFF of any reference system, or MBTiles; relative to the site
    file."""
    attribution: Annotated[str, Field(max_length=200)] | None = None
    """Attribution shown with the picture; default: what the file says."""
    contour_m: Metres | None = None
    """Contour interval, where ground heights are known; default: chosen to fit the relief."""


GroundMargin = Annotated[float, Field(gt=0, le=500, allow_inf_nan=False)]


class TerrainTable(SiteTable):
    """Ground heights from rasters: every leg keeps a margin above them."""

    files: FileName | Annotated[tuple[FileName, ...], Field(min_length=1)]
    """GeoTIFF or COG (Copernicus GLO-30), SRTM `.hgt`, DTED or ASCII grids, or folders of them, relative to the site
    file, in any reference system. Where several know the ground, the one of the smallest cells does."""
    vertical: Literal["file", "egm2008", "egm96", "ellipsoid"] = "file"
    """Vertical reference of the heights: `file` uses that of the file, or of a product known by its name; others must
    be given. Ellipsoidal heights need a geoid that PROJ has on this computer."""
    margin_m: GroundMargin = GROUND_MARGIN_M
    """Least height of every leg, transit and RTL above ground, in addition to `uncertainty_m`."""
    uncertainty_m: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] | None = None
    """Error that 90 % of the heights stay within. Default: 4 for Copernicus GLO-30 and 16 for SRTM, as specified; other
    rasters need it. One metre is added if their geoid is not that of the vehicles, EGM96."""
    line_margin_m: GroundMargin | None = None
    """Least height of every leg above a line that it crosses or follows; default: two thirds of `[inspection]
    height_m`."""


LatLon = tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]]
PlaceName = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]
Margin = Annotated[float, Field(ge=2, le=1000, allow_inf_nan=False)]
Width = Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)]
OverGround = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
OverSea = Annotated[float, Field(ge=-500, le=10_000, allow_inf_nan=False)]

MARGIN_M = 10.0


class AreaTable(SiteTable):
    """Areas to keep out of, or to keep low in: those of a file, or one polygon or line given here.

    A polygon is closed to every flight, unless it has a height limit; a line is the centre of a corridor.
    """

    name: PlaceName | None = None
    """Name used in messages; for a file, the name of features that have none."""
    file: FileName | None = None
    """GeoJSON, KML or KMZ with polygons and lines, relative to the site file. A feature's own `width_m`, `margin_m`,
    `max_agl_m` and `max_amsl_m` count before those of this table."""
    layer: LayerName | tuple[LayerName, ...] = ()
    """KML folders to read; default: all."""
    where: Annotated[str, AfterValidator(check_where), Field(max_length=1000)] | None = None
    """Filter for features, such as `class = 'CTR'`."""
    polygon: Annotated[tuple[LatLon, ...], Field(min_length=3)] | None = None
    """Corners as [latitude, longitude], instead of a file."""
    line: Annotated[tuple[LatLon, ...], Field(min_length=2)] | None = None
    """Centre line of a corridor of other traffic, as [latitude, longitude], instead of a file."""
    width_m: Width | None = None
    """Width of the corridor, side to side."""
    margin_m: Margin = MARGIN_M
    """Distance that flights keep from it; GPS, wind and cut corners need at least 2 m."""
    max_agl_m: OverGround | None = None
    """Flights may enter below this height above ground."""
    max_amsl_m: OverSea | None = None
    """The same above mean sea level; for an airspace that begins at 300 m, 300."""

    def _find_errors(self) -> Iterator[str]:
        given = [key for key in ("file", "polygon", "line") if getattr(self, key) is not None]
        if len(given) != 1:
            yield f"file: expected one of file, polygon and line, got {' and '.join(given) or 'none'}"
        if self.file is not None:
            return
        if self.name is None:
            yield f"name: expected one with {given[0]}: messages use it for the area"
        if self.layer or self.where is not None:
            yield f"{'layer' if self.layer else 'where'}: expected none with {given[0]}"
        limited = self.max_agl_m is not None or self.max_amsl_m is not None
        if self.line is not None and (self.width_m is None or limited):
            yield "width_m: expected a width and no height limit with line: it is a corridor"
        if self.polygon is not None and self.width_m is not None:
            yield "width_m: expected none with polygon, got one"


class PlaceTable(SiteTable):
    """A named place."""

    name: PlaceName
    """Name used in messages, and in a vehicle's `pad`."""
    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level; default: the depot's."""
    kind: Literal["pad", "alternate"]
    """`pad`: where a vehicle takes off and lands; `alternate`: where a vehicle that cannot return may land."""


class EnergyTable(SiteTable):
    """The multicopter: a preset, and changes to it."""

    drone: str = "mavic3"
    """Preset: mavic2, mavic3, matrice200, matrice600, anafi-ai or skydio2. The other keys override its values."""
    mass_kg: Annotated[float, Field(ge=0.05, le=1000)] | None = None
    """Take-off mass, with battery and payload."""
    rotors: Annotated[int, Field(ge=3, le=16)] | None = None
    """Number of rotors."""
    propeller_radius_m: Annotated[float, Field(ge=0.01, le=10)] | None = None
    """Radius of one propeller."""
    cells: Annotated[int, Field(ge=1, le=24)] | None = None
    """Battery cells in series."""
    capacity_ah: Annotated[float, Field(ge=0.01, le=1e6)] | None = None
    """Capacity of the battery."""
    chemistry: Chemistry | None = None
    """lipo or li-ion: decides what a resting voltage means. Default: only what both agree on."""
    packs: Annotated[str, Field(min_length=1)] | None = None
    """packs.json written by `faultline replay --packs`, relative to the site file: history of labelled packs."""
    area_m2: Annotated[float, Field(ge=1e-4, le=100)] | None = None
    """Area of the vehicle seen from above."""
    efficiency: Annotated[float, Field(ge=0.01, le=1)] | None = None
    """Combined efficiency of propeller and motor."""

    def _find_errors(self) -> Iterator[str]:
        if self.drone not in PRESETS:
            yield f"drone: expected one of {', '.join(PRESETS)}, got '{self.drone}'"


def _check_autopilot(name: str) -> str:
    names = [dialect.name for dialect in AUTOPILOTS]
    if name not in names:
        raise PydanticCustomError("literal_error", "expected {expected}", {"expected": " or ".join(map(repr, names))})
    return name


AutopilotKey = Annotated[
    str,
    AfterValidator(_check_autopilot),
    WithJsonSchema({"type": "string", "enum": [dialect.name for dialect in AUTOPILOTS]}),
]
"""Name of a supported autopilot."""


def check_connection_kind(value: object) -> object:
    """Return the value of a connection if it is a text, or a list of texts."""
    if isinstance(value, str) or (isinstance(value, list | tuple) and all(isinstance(one, str) for one in value)):
        return value
    raise PydanticCustomError("connection", "expected a text or a list of texts")


class VehicleTable(SiteTable):
    """One vehicle."""

    name: Name
    """Name of the vehicle everywhere: a letter, then letters, digits, - and _."""
    connection: Annotated[str | tuple[str, ...], BeforeValidator(check_connection_kind)]
    """`udpin://HOST:PORT` and `tcpin://HOST:PORT` listen, `udpout://HOST:PORT` and `tcpout://HOST:PORT` call,
    `serial:///dev/ttyUSB0:57600` opens a port. Vehicles with different system ids may share a connection.
    A list holds up to four links to the one vehicle, such as a radio and LTE, the preferred one first."""
    sysid: Annotated[int, Field(ge=1, le=254)]
    """MAVLink system id; each vehicle needs its own."""
    autopilot: AutopilotKey
    """Firmware of the vehicle."""
    backend: Literal["native", "mavsdk"] = "native"
    """Library that carries the messages; `mavsdk` does not sign frames."""
    budget_pct: Percent = 75.0
    """Most of a full battery that a route may use."""
    reserve_pct: Percent = RESERVE_PCT
    """Reserve of a full battery that plans never use."""
    pack: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$")] | None = None
    """Label of its battery pack. Plans use the history in `[energy] packs`, and `replay --packs` records the flight
    under this label."""
    pad: Annotated[str, Field(min_length=1, max_length=60)] | None = None
    """`[[place]]` where it takes off and lands; default: a pad chosen near its base or the depot."""

    def _find_errors(self) -> Iterator[str]:
        if self.budget_pct + self.reserve_pct > 100:
            yield (
                f"budget_pct: expected at most {100 - self.reserve_pct:g} with a reserve_pct of "
                f"{self.reserve_pct:g}, got {self.budget_pct:g}"
            )
        try:
            links = self.links
        except ValueError as error:
            yield f"connection: {error}"
            return
        if not 0 < len(links) <= MOST_LINKS:
            yield f"connection: expected 1 to {MOST_LINKS}, got {len(links)}"
        ports = [link.exclusive_resource for link in links]
        if twice := [port for port in ports if ports.count(port) > 1]:
            yield f"connection: expected each link over a port of its own, got {twice[0]} twice"
        if len(links) > 1 and self.backend == "mavsdk":
            yield "connection: expected one with backend 'mavsdk', got a list"

    @property
    def links(self) -> tuple[Connection, ...]:
        """Parsed connections, the preferred one first."""
        several = (self.connection,) if isinstance(self.connection, str) else self.connection
        return tuple(map(parse_connection, several))

    @property
    def link(self) -> Connection:
        """Preferred connection."""
        return self.links[0]

    @property
    def requests(self) -> tuple[LinkRequest, ...]:
        """Links to open."""
        return tuple(LinkRequest(link, self.sysid) for link in self.links)


Side = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=1, le=1_000_000)]


class CameraTable(SiteTable):
    """A camera that vehicles carry."""

    name: Name
    """Name of the camera: a letter, then letters, digits, - and _."""
    id: Annotated[int, Field(ge=0, le=255)] = 0
    """Camera id in mission items: 1 to 6 are wired to the autopilot, 7 to 255 are component ids of MAVLink cameras (the
    first is 100), 0 is any camera of the autopilot."""
    vehicles: tuple[str, ...] = ()
    """Names of the vehicles that carry it; default: all."""
    focal_mm: Side | None = None
    """Actual focal length, not the 35 mm equivalent."""
    sensor_mm: tuple[Side, Side] | None = None
    """Width and height of the sensor; the width lies across the flight."""
    image_px: tuple[Pixels, Pixels] | None = None
    """Width and height of a picture."""
    least_interval_s: Annotated[float, Field(ge=0.05, le=60)] = LEAST_INTERVAL_S
    """Shortest interval between two pictures."""
    gimbal: bool = False
    """Whether it has a gimbal that missions point."""


class LookTable(SiteTable):
    """Required coverage of spans, or of pylons."""

    camera: Name
    """Camera to use: only vehicles that carry it get these spans."""
    of: Literal["spans", "pylons"] = "spans"
    """Whether spans are inspected along the line, or pylons from viewpoints around them."""
    segments: Annotated[tuple[str, ...], Field(min_length=1)] = ("*",)
    """Names of the spans; `*` matches anything. Default: all."""
    take: Literal["pictures", "video"] = "pictures"
    """Pictures one after another, or a video."""
    trigger: Literal["distance", "interval"] = "distance"
    """Trigger of pictures: the autopilot by distance, or the camera by time."""
    every_m: Positive | None = None
    """Metres between two pictures."""
    overlap_pct: Annotated[float, Field(ge=0, le=95)] | None = None
    """Instead of `every_m`: overlap of two pictures; needs `focal_mm` and `sensor_mm` of the camera."""
    sample_mm: Positive | None = None
    """Largest ground sample: what one pixel may cover; also needs `image_px` of the camera."""
    pitch_deg: Annotated[float, Field(ge=-90, le=45)] | None = None
    """Gimbal pitch from the horizon, negative is down; default: at the line, or at `target_m`."""
    aim_deg: Annotated[float, Field(gt=0, le=180)] = AIM_DEG
    """Largest aiming error of a picture that counts."""
    pylons: Annotated[tuple[str, ...], Field(min_length=1)] = ("*",)
    """Names of the pylons, in the form of `segments`."""
    bearings_deg: tuple[Annotated[float, Field(ge=-180, le=180)], ...] = ()
    """Bearings of the viewpoints around a pylon in order of flight, clockwise from the direction of its line."""
    both_sides: bool = False
    """Whether to fly the same viewpoints on the other side of the line too."""
    distance_m: Annotated[float, Field(ge=3, le=200)] = 12.0
    """Horizontal distance of viewpoints from the pylon."""
    heights_m: tuple[Annotated[float, Field(ge=-200, le=200)], ...] = ()
    """Heights of viewpoints above the pylon's top, negative below it, each at every bearing; default: the height at
    which spans are flown. Needs `same_distance`; no vehicle goes below the tops within 10 m of a line."""
    target_m: Annotated[float, Field(ge=-200, le=50)] = 0.0
    """Height of the target, from the pylon's top."""
    roi: bool = False
    """Whether the vehicle turns its nose to the target (region of interest), for cameras without a yaw gimbal."""
    hover_s: Annotated[float, Field(ge=0, le=60)] = 2.0
    """Hover time at a viewpoint before the picture."""

    def _find_errors(self) -> Iterator[str]:
        if self.of == "pylons":
            if len(self.bearings_deg) * (1 + self.both_sides) < 2:
                yield "bearings_deg: expected two viewpoints or more for a pylon"
            return
        for key in ("heights_m", "target_m", "roi"):
            if getattr(self, key):
                yield f"{key}: expected it for pylons only"
        given = [key for key in ("every_m", "overlap_pct") if getattr(self, key) is not None]
        if self.take == "pictures" and len(given) != 1:
            yield (f"every_m: expected one of every_m and overlap_pct, got {' and '.join(given) or 'neither'}")
        if self.take == "video" and given:
            yield f"{given[0]}: expected none for a video"


Amount = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Deviation = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class FigureTable(SiteTable):
    """One learned figure; the other figures have the same keys."""

    mean: Amount
    """Mean."""
    sd: Deviation
    """Standard deviation."""
    samples: Count
    """Number of flight segments, report pairs or minutes behind it."""


class SpeedTable(SiteTable):
    """Consumption in level flight at one speed."""

    speed_m_s: Annotated[float, Field(ge=0, le=200)]
    """Mean ground speed."""
    current_a: FigureTable
    """Current."""
    pct_per_min: FigureTable | None = None
    """The same in percent of the learned capacity a minute."""


class SwitchTable(SiteTable):
    """The pilot's mode switch."""

    channel: Annotated[int, Field(ge=1, le=18)]
    """Transmitter channel."""
    source: Annotated[str, Field(max_length=60)]
    """Parameter that names it, or `seen`: it moved before mode changes."""
    moved: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Mode changes that it moved before."""
    changes: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Mode changes in the logs."""


class LearnedTable(SiteTable):
    """What `faultline replay --learn` found. It changes no plan: `[energy]` does, which the same command writes."""

    logs: Count
    """Number of logs."""
    minutes: Annotated[float, Field(ge=0, le=1e6)]
    """Minutes in the air."""
    hover_a: FigureTable | None = None
    """Current in hover."""
    hover_w: FigureTable | None = None
    """Power in hover."""
    level: tuple[SpeedTable, ...] = ()
    """Level flight, by speed."""
    climb_share: FigureTable | None = None
    """Extra consumption for each m/s of climb, as a share of level flight's."""
    capacity_ah: FigureTable | None = None
    """Capacity from the charge counter and the displayed percentage."""
    resistance_ohm: FigureTable | None = None
    """Resistance of the pack and its wires, from load steps."""
    link_loss_pct: FigureTable | None = None
    """Frames lost on the link to the ground station."""
    mode_switch: SwitchTable | None = None
    """The pilot's mode switch."""
