"""A day of many sorties: hours, bases, packs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from executor.site.tables.fields import SiteTable, Speed

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
Clock = Annotated[str, Field(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9]$")]
Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]


def parse_clock_s(text: str) -> float:
    """Return the seconds since midnight of a time of the day.

    >>> clock_s("08:30")
    30600.0
    """
    hours, minutes = text.split(":")
    return 3600.0 * int(hours) + 60.0 * int(minutes)


class BaseTable(SiteTable):
    """A place where vehicles take off and land. Without any, the depot is the only one, with packs for everybody."""

    name: Name
    """Name of the base: a letter, then letters, digits, - and _."""
    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level; where [terrain] knows it that of the raster. Without both that of the nearest pylon
    where it is known, else the depot's."""
    vehicles: tuple[str, ...] = ()
    """Who stands here in the morning, and begins single flights here. Each vehicle stands at one base."""
    packs: Annotated[int, Field(ge=0, le=1000)] | None = None
    """Charged packs in the morning; without it there are always enough."""
    turnaround_s: Seconds = 180.0
    """From a landing here until the vehicle can take off again: the pack is swapped, or charged in the vehicle."""
    recharge_s: Seconds | None = None
    """From a landing here until the pack is charged again; without it packs are charged overnight alone."""


class RoadTable(SiteTable):
    """A way on which a vehicle is driven from base to base; ways are put together."""

    between: tuple[Name, Name]
    """Two bases."""
    minutes: Annotated[float, Field(ge=0, le=1440, allow_inf_nan=False)]
    """What it takes, either way."""


class QuietTable(SiteTable):
    """A time of every day in which vehicles do not fly: noise, other traffic."""

    begin: Clock
    """Such as `"12:00"`."""
    end: Clock
    """Such as `"14:00"`."""
    vehicles: tuple[str, ...] = ()
    """Whom it holds for; without it for all."""

    @model_validator(mode="after")
    def _check_times(self) -> QuietTable:
        if parse_clock_s(self.begin) >= parse_clock_s(self.end):
            raise ValueError(f"end: expected a time after begin, {self.begin}, got '{self.end}'")
        return self


class OtherTable(SiteTable):
    """In what a vehicle differs from the others."""

    name: str
    """The vehicle."""
    speed_m_s: Speed | None = None
    """Speed along the line, instead of that of [inspection]; such a day is planned and not flown."""
    transit_speed_m_s: Speed | None = None
    """Speed between segments and bases, instead of that of [inspection]; such a day is planned and not flown."""
    segments: tuple[str, ...] = ()
    """Names of the only segments that its camera is good for; without it all."""
    spare: bool = False
    """Nothing is planned for it: it stands at its base, and the crew sends it out with `swap` when it is needed."""


class DayTable(SiteTable):
    """The working days that `plan --day` plans."""

    begin: Clock = "08:00"
    """First take-off of a day."""
    end: Clock = "16:00"
    """Everybody has landed by then."""
    days: Annotated[int, Field(ge=1, le=60)] = 1
    """Days there are at most."""
    stagger_s: Seconds = 30.0
    """Least time between two take-offs from a base."""
    lands: Literal["own", "any"] = "own"
    """`any`: a sortie may end at every base, where its vehicle takes off again; `own`: at the vehicle's own alone."""
    road_m_s: Speed | None = None
    """Speed at which vehicles are driven from base to base over the straight distance; without it, and without roads,
    they are not. Only with `lands = "any"`."""
    road: tuple[RoadTable, ...] = ()
    """What driving takes where the straight distance does not tell."""
    quiet: tuple[QuietTable, ...] = ()
    """Times in which vehicles do not fly."""
    vehicle: tuple[OtherTable, ...] = ()
    """Vehicles that differ."""

    @model_validator(mode="after")
    def _check_day(self) -> DayTable:
        if parse_clock_s(self.begin) >= parse_clock_s(self.end):
            raise ValueError(f"end: expected a time after begin, {self.begin}, got '{self.end}'")
        if self.lands == "own" and (self.road_m_s is not None or self.road):
            raise ValueError("lands: expected 'any' beside roads: vehicles that land at their own base are not driven")
        return self
