"""What is to be seen, and with which cameras."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from executor.site.tables.fields import Positive, SiteTable

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
    least_interval_s: Annotated[float, Field(ge=0.05, le=60)] = 1.0
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
    aim_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
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
