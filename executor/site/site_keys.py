"""The keys of a site file that say what is there: ground, line, areas, places, vehicles, cameras."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from executor.core.battery.voltage import Chemistry
from executor.core.interface.connection import Connection, parse_connection
from executor.core.interface.ports import LinkRequest
from missions import AUTOPILOTS, SNAP_M, parse_where
from missions.cameras import AIM_DEG, LEAST_INTERVAL_S
from missions.inspection_defaults import Inspection
from missions.terrain import GROUND_MARGIN_M
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
"""A name, or an address of version 4 or 6."""
SpanName = Annotated[str, Field(min_length=1, max_length=200)]
LayerName = Annotated[str, Field(min_length=1, max_length=200)]
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]+$")]
EnvironmentName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]
MOST_LINKS = 4
"""To one vehicle."""


class SiteTable(BaseModel):
    """A table of the file: it has no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


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
    only: tuple[SpanName, ...] = ()
    """The spans that are inspected, such as `V101.3`; a range `V101.3..V101.7`, a line `V101` or a pattern `V10*` names
    several. Without it all."""
    leave_out: tuple[SpanName, ...] = ()
    """The spans that are not inspected, named the same way. The line is still there: flights keep clear of it, and
    spans keep their numbers."""


class LockTable(SiteTable):
    """Spans that one vehicle alone flies, or that are flown in one direction alone; one of both is needed.

    When a vehicle is lost, others may fly what was locked to it.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    segments: Annotated[tuple[SpanName, ...], Field(min_length=1)]
    """The spans, named as `only` of `[network]` has it. Those that are left out are not flown all the same."""
    vehicle: str | None = None
    """The vehicle that alone flies them."""
    begin: Annotated[str, Field(min_length=1, max_length=200)] | None = Field(default=None, alias="from")
    """The pylon, such as `V101-03`, from which they are flown, one after the other; an end of one of them."""

    @model_validator(mode="after")
    def _check_lock(self) -> LockTable:
        if self.vehicle is None and self.begin is None:
            raise ValueError("vehicle: expected one of vehicle and from, got neither")
        return self


_INSPECTION = Inspection()
"""Its figures are the defaults of the site file."""


class InspectionTable(SiteTable):
    """How the line is flown."""

    height_m: Metres = _INSPECTION.height_m
    """Inspection height over the pylon tops where the network knows them, else over the depot's ground."""
    heights: Literal["known", "flat"] = "known"
    """`flat` claims that the ground is everywhere as high as the depot's, where the network does not know it."""
    ceiling_m: Metres = _INSPECTION.ceiling_m
    """No mission goes higher than this over the ground; to fly higher needs a permit."""
    return_ceiling_m: Metres | None = _INSPECTION.return_ceiling_m
    """The same for the RTL height, which is level and so higher over valleys; without it `ceiling_m` holds."""
    standoff_m: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = _INSPECTION.standoff_m
    """Horizontal distance from the line, always on the same side."""
    speed_m_s: Speed = _INSPECTION.speed_m_s
    """Speed along the line."""
    transit_speed_m_s: Speed = _INSPECTION.transit_speed_m_s
    """Speed between segments, and from and to the pad."""
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """The wind by where the air moves to: east, north. Plans count with it."""
    layer_m: Metres = _INSPECTION.layer_m
    """Least distance between any two vehicles; heights are layered by it."""
    same_distance: bool = _INSPECTION.same_distance
    """`true`: inspect at `height_m` instead of the layer height wherever no other vehicle can be present. A vehicle
    with others beside it descends once they have left; segments inspected from a layer are re-inspected if battery
    remains, before RTL or from the pad. The descents cost time, and a lost vehicle's segments are reassigned only once
    it must have left the line."""
    corridor_m: Metres = 10.0
    """A segment counts as inspected only where the flown track is within this of the planned one."""


class MapTable(SiteTable):
    """What lies below the line on the page, in the report and in pictures. Nothing is fetched."""

    background: FileName | None = None
    """A picture of the ground, such as an orthophoto: GeoTIFF of any reference system, or MBTiles; relative to the site
    file."""
    attribution: Annotated[str, Field(max_length=200)] | None = None
    """Whom the picture is by, to be shown with it; without it what the file says."""
    contour_m: Metres | None = None
    """Height between contour lines, where the ground's heights are known; without it what fits the relief."""


GroundMargin = Annotated[float, Field(gt=0, le=500, allow_inf_nan=False)]


class TerrainTable(SiteTable):
    """The ground as a raster of heights knows it: every leg keeps a margin over it."""

    files: FileName | Annotated[tuple[FileName, ...], Field(min_length=1)]
    """GeoTIFF or COG (Copernicus GLO-30), SRTM `.hgt`, DTED or ASCII grids, or folders of them, relative to the site
    file, in any reference system. Where several know the ground, the one of the smallest cells does."""
    vertical: Literal["file", "egm2008", "egm96", "ellipsoid"] = "file"
    """What their heights are counted from: `file` takes the word of the file, or of a product that is known by its
    name; others must be told. Heights over the ellipsoid need a geoid that PROJ has on this computer."""
    margin_m: GroundMargin = GROUND_MARGIN_M
    """Least height of every leg, every transit and every way home over the ground, beside `uncertainty_m`."""
    uncertainty_m: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] | None = None
    """Nine of ten heights are nearer than this to the truth. Without it 4 of Copernicus GLO-30 and 16 of SRTM, as they
    are specified; other rasters need it. A metre is added where their geoid is not that of the vehicles, EGM96."""
    line_margin_m: GroundMargin | None = None
    """Least height of every leg over the top of a line that it crosses or follows; without it two thirds of
    `[inspection] height_m`."""


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


class EnergyTable(SiteTable):
    """The multicopter: a preset, and what differs from it."""

    drone: str = "mavic3"
    """Preset: mavic2, mavic3, matrice200, matrice600, anafi-ai or skydio2. The other keys change figures of it."""
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
    """lipo or li-ion: what a resting voltage means. Where it is not set, what both agree about."""
    packs: Annotated[str, Field(min_length=1)] | None = None
    """packs.json of `faultline replay --packs`, relative to the site file: what flights said of labelled packs."""
    area_m2: Annotated[float, Field(ge=1e-4, le=100)] | None = None
    """Area of the vehicle seen from above."""
    efficiency: Annotated[float, Field(ge=0.01, le=1)] | None = None
    """Efficiency of propeller times motor."""

    @model_validator(mode="after")
    def _check_drone(self) -> EnergyTable:
        if self.drone not in PRESETS:
            raise ValueError(f"drone: expected one of {', '.join(PRESETS)}, got '{self.drone}'")
        return self


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
"""The name of an autopilot that is known."""


def check_connection_kind(value: object) -> object:
    """Return what stands for a connection if it is a text, or a list of texts."""
    if isinstance(value, str) or (isinstance(value, list | tuple) and all(isinstance(one, str) for one in value)):
        return value
    raise PydanticCustomError("connection", "expected a text or a list of texts")


class VehicleTable(SiteTable):
    """One vehicle."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
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
    """Share of a full battery that is never planned with."""
    pack: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$")] | None = None
    """Label of the pack that it flies with: what `[energy] packs` knows of it is reckoned with, and `replay --packs`
    with this site file, or of a flight's run directory, writes it down by it."""
    pad: Annotated[str, Field(min_length=1, max_length=60)] | None = None
    """The `[[place]]` where it starts and lands; without it a pad is chosen around its base, or the depot."""

    @model_validator(mode="after")
    def _check_vehicle(self) -> VehicleTable:
        if self.budget_pct + self.reserve_pct > 100:
            raise ValueError(
                f"budget_pct: expected at most {100 - self.reserve_pct:g} beside a reserve_pct of "
                f"{self.reserve_pct:g}, got {self.budget_pct:g}"
            )
        try:
            links = self.links
        except ValueError as error:
            raise ValueError(f"connection: {error}") from None
        if not 0 < len(links) <= MOST_LINKS:
            raise ValueError(f"connection: expected 1 to {MOST_LINKS}, got {len(links)}")
        ports = [link.exclusive_resource for link in links]
        if twice := [port for port in ports if ports.count(port) > 1]:
            raise ValueError(f"connection: expected each link over a port of its own, got {twice[0]} twice")
        if len(links) > 1 and self.backend == "mavsdk":
            raise ValueError("connection: expected one beside backend 'mavsdk', got a list")
        return self

    @property
    def links(self) -> tuple[Connection, ...]:
        """Its connections, read, the preferred one first."""
        several = (self.connection,) if isinstance(self.connection, str) else self.connection
        return tuple(map(parse_connection, several))

    @property
    def link(self) -> Connection:
        """The preferred one."""
        return self.links[0]

    @property
    def requests(self) -> tuple[LinkRequest, ...]:
        """Its links to be opened."""
        return tuple(LinkRequest(link, self.sysid) for link in self.links)


CameraName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
Side = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=1, le=1_000_000)]


class CameraTable(SiteTable):
    """A camera that vehicles carry."""

    name: CameraName
    """Name of the camera: a letter, then letters, digits, - and _."""
    id: Annotated[int, Field(ge=0, le=255)] = 0
    """As mission items name it: 1 to 6 are wired to the autopilot, 7 to 255 are component ids of MAVLink cameras (the
    first is 100), 0 is whatever camera there is at the autopilot."""
    vehicles: tuple[str, ...] = ()
    """Names of the vehicles that carry it; without any all do."""
    focal_mm: Side | None = None
    """Focal length, the real one."""
    sensor_mm: tuple[Side, Side] | None = None
    """Width and height of the sensor; the width lies across the flight."""
    image_px: tuple[Pixels, Pixels] | None = None
    """Width and height of a picture."""
    least_interval_s: Annotated[float, Field(ge=0.05, le=60)] = LEAST_INTERVAL_S
    """It takes no pictures faster than this."""
    gimbal: bool = False
    """Whether missions point it."""


class LookTable(SiteTable):
    """What spans, or pylons, ask for."""

    camera: CameraName
    """The camera that sees them: only vehicles that carry it are given these spans."""
    of: Literal["spans", "pylons"] = "spans"
    """Whether spans are looked at along their way, or pylons from viewpoints around them."""
    segments: Annotated[tuple[str, ...], Field(min_length=1)] = ("*",)
    """Names of the spans, `*` stands for anything in them; without it all."""
    take: Literal["pictures", "video"] = "pictures"
    """Pictures one after another, or a video."""
    trigger: Literal["distance", "interval"] = "distance"
    """Who takes pictures: the autopilot by distance, or the camera by time."""
    every_m: Positive | None = None
    """Metres between two pictures."""
    overlap_pct: Annotated[float, Field(ge=0, le=95)] | None = None
    """Instead: how much of a picture the next one shows again; needs `focal_mm` and `sensor_mm` of the camera."""
    sample_mm: Positive | None = None
    """A pixel may show no more of the line than this; needs `image_px` of the camera, too."""
    pitch_deg: Annotated[float, Field(ge=-90, le=45)] | None = None
    """Where a gimbal points, from the horizon, down is negative; without it at the line, or at what `target_m` says."""
    aim_deg: Annotated[float, Field(gt=0, le=180)] = AIM_DEG
    """A picture whose camera points farther beside that does not count."""
    pylons: Annotated[tuple[str, ...], Field(min_length=1)] = ("*",)
    """Names of the pylons, as `segments` has those of spans."""
    bearings_deg: tuple[Annotated[float, Field(ge=-180, le=180)], ...] = ()
    """Viewpoints around a pylon in the order in which they are flown, clockwise from the direction of its line."""
    both_sides: bool = False
    """Whether the same are flown on the other side of the line, too."""
    distance_m: Annotated[float, Field(ge=3, le=200)] = 12.0
    """Of viewpoints from the pylon, over the ground."""
    heights_m: tuple[Annotated[float, Field(ge=-200, le=200)], ...] = ()
    """Heights of viewpoints over the pylon's top, below it negative, each at every bearing; without any they lie as
    high as spans are flown. Needs `same_distance`; nobody is below the tops within 10 m of a line."""
    target_m: Annotated[float, Field(ge=-200, le=50)] = 0.0
    """What is looked at, from the pylon's top."""
    roi: bool = False
    """Whether the vehicle turns its nose there (region of interest): for cameras that no gimbal turns to the side."""
    hover_s: Annotated[float, Field(ge=0, le=60)] = 2.0
    """How long a vehicle stays at a viewpoint before the picture is taken."""

    @model_validator(mode="after")
    def _check_spacing(self) -> LookTable:
        if self.of == "pylons":
            if len(self.bearings_deg) * (1 + self.both_sides) < 2:
                raise ValueError("bearings_deg: expected two viewpoints or more for a pylon")
            return self
        for key in ("heights_m", "target_m", "roi"):
            if getattr(self, key):
                raise ValueError(f"{key}: expected it for pylons only")
        given = [key for key in ("every_m", "overlap_pct") if getattr(self, key) is not None]
        if self.take == "pictures" and len(given) != 1:
            raise ValueError(
                f"every_m: expected one of every_m and overlap_pct, got {' and '.join(given) or 'neither'}"
            )
        if self.take == "video" and given:
            raise ValueError(f"{given[0]}: expected none for a video")
        return self


Amount = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Deviation = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class FigureTable(SiteTable):
    """One learned figure; the other figures have the same keys."""

    mean: Amount
    """What was found."""
    sd: Deviation
    """How sure it is: standard deviation."""
    samples: Count
    """How many pieces of flight, pairs of reports or minutes it is from."""


class SpeedTable(SiteTable):
    """Consumption in level flight at one speed."""

    speed_m_s: Annotated[float, Field(ge=0, le=200)]
    """Over ground, the mean of what was flown."""
    current_a: FigureTable
    """Current that was drawn."""
    pct_per_min: FigureTable | None = None
    """The same in percent of the learned capacity a minute."""


class SwitchTable(SiteTable):
    """The pilot's mode switch."""

    channel: Annotated[int, Field(ge=1, le=18)]
    """Of the transmitter."""
    source: Annotated[str, Field(max_length=60)]
    """Parameter that names it, or `seen`: it moved before changes of mode."""
    moved: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Changes of mode that it moved before."""
    changes: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Changes of mode in the logs."""


class LearnedTable(SiteTable):
    """What `faultline replay --learn` found. It changes no plan: `[energy]` does, which the same command writes."""

    logs: Count
    """Logs that it is from."""
    minutes: Annotated[float, Field(ge=0, le=1e6)]
    """In the air."""
    hover_a: FigureTable | None = None
    """Current in hover."""
    hover_w: FigureTable | None = None
    """Power in hover."""
    level: tuple[SpeedTable, ...] = ()
    """Level flight, by speed."""
    climb_share: FigureTable | None = None
    """Extra consumption for each m/s of climb, as a share of level flight's."""
    capacity_ah: FigureTable | None = None
    """What the counter of charge gives for the percentage that is shown."""
    resistance_ohm: FigureTable | None = None
    """Of the pack with its wires, from steps of the load."""
    link_loss_pct: FigureTable | None = None
    """Frames that were lost on the way to the ground station."""
    mode_switch: SwitchTable | None = None
    """The pilot's mode switch."""
