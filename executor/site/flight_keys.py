"""The keys of a site file that say how it is flown: the flight, faults, fences, links, days of many sorties."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from executor.core.fault_thresholds import Limits
from executor.core.interface.connection import Connection, parse_connection
from executor.core.interface.messages import GROUND_STATION
from executor.site.site_keys import FileName, Positive, SiteTable, Speed


class FlightTable(SiteTable):
    """How the flight is run."""

    speedup: Annotated[float, Field(gt=0, le=100)] = 1.0
    """Speed of a simulation in multiples of real time; time-outs and heartbeats follow it. Real aircraft: 1."""
    solve_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Time limit of the solver for a re-plan, in real time."""
    connect_timeout_s: Positive = 15.0
    """Before the flight: how long a vehicle that sends nothing is waited for, in real time."""
    ready_timeout_s: Positive = 120.0
    """Before the flight: how long a vehicle may take until it is ready to arm, in the vehicle's time."""
    fly_again: Literal["ask", "never", "auto"] = "ask"
    """Whether a vehicle on the ground takes off for a re-plan, or to fly again what was inspected from a layer: `ask`,
    once the crew says that its pad is clear; `never` after it has landed; `auto`, by itself, for simulation only."""
    offer_s: Positive = 300.0
    """How long the crew may take to answer such an offer once no vehicle flies any more."""
    pilot_grace_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    """How long the segments of a vehicle that its pilot has taken are kept for it."""
    pilot_return: Literal["ask", "auto"] = "ask"
    """When a pilot has put the vehicle back on its mission: `ask` waits for the operator's include, `auto` does not."""
    inferred: Literal["count", "fly"] = "count"
    """What a vehicle flew while it was not heard, or nobody listened, where its clock, place and mission fit: `count`
    it, marked as inferred; `fly` it again for proof by positions."""


MOST_DAYS = 60
"""Of one plan."""
_LIMITS = Limits()
"""Its figures are the defaults of the site file."""


class FaultsTable(SiteTable):
    """Thresholds for link loss and battery faults."""

    link_timeout_s: Positive | None = None
    """Silence until a vehicle is declared lost. Without it: until its own GCS failsafe has acted, plus a margin.
    A figure shorter than that time is not taken."""
    link_stale_s: Positive = _LIMITS.link_stale_s
    """Silence until a vehicle's link is called stale: a warning, no fault."""
    battery_step_pct: Positive = _LIMITS.battery_step_pct
    """A loss of this much at once, beyond what the flight costs, is a battery fault."""
    battery_excess_pct: Positive = _LIMITS.battery_excess_pct
    """A loss of this much beyond the usual consumption is a battery drain."""
    battery_window_s: Positive = _LIMITS.battery_window_s
    """Time in which an excess of consumption is forgotten but for a third."""
    camera: Literal["home", "on"] = "home"
    """A vehicle whose camera or gimbal fails flies `home`, or `on` with what it can see without it."""


class FenceTable(SiteTable):
    """Fence and rally points of each vehicle, made from the plan.

    With this table, what is on board is read and held against the plan; nothing is changed there without `enabled`.
    """

    enabled: bool = False
    """Whether every vehicle is given a fence of its own for the flight; what it had is given back after the landing."""
    margin_m: Annotated[float, Field(ge=5, le=1000, allow_inf_nan=False)] = 20.0
    """How far the fence is at least from the vehicle's ways, its own straight way home among them."""
    height_margin_m: Annotated[float, Field(ge=5, le=500, allow_inf_nan=False)] = 10.0
    """How far the fence ends above all that the vehicle flies by any plan, its RTL among it."""
    action: Literal["keep", "warn", "hold", "return", "land"] = "keep"
    """What the vehicle does when it breaches the fence: `keep` leaves its own parameter, any other is set for the
    flight."""
    rally: Literal["pad", "keep"] = "pad"
    """Where its own RTL may end: `pad`, at its own pad alone, on a day at the nearest of its pads; `keep` leaves the
    rally points that are on board."""

    @property
    def gives_rally(self) -> bool:
        """Whether vehicles are given rally points."""
        return self.enabled and self.rally == "pad"


class SigningTable(SiteTable):
    """MAVLink 2 message signing: the key is in a file or in the environment, never here."""

    key_file: FileName | None = None
    """File with 64 hexadecimal digits, or a passphrase, whose SHA-256 is the key, as in other ground stations."""
    key_env: str | None = None
    """Environment variable that holds the same. Either `key_file` or `key_env` must be there."""

    @model_validator(mode="after")
    def _check_key_source(self) -> SigningTable:
        if (self.key_file is None) is (self.key_env is None):
            raise ValueError("key_file: expected either key_file or key_env")
        return self


class RadioTable(SiteTable):
    """A telemetry radio, by what its RADIO_STATUS names as its sender."""

    system: Annotated[int, Field(ge=1, le=255)]
    """MAVLink system id of the radio; SiK radios use 51."""
    component: Annotated[int, Field(ge=1, le=255)]
    """MAVLink component id of the radio; SiK radios use 68."""


class LinkTable(SiteTable):
    """Our own number, other senders, and what the links carry."""

    station_sysid: Annotated[int, Field(ge=1, le=255)] = GROUND_STATION[0]
    """MAVLink system id of faultline itself, one that no vehicle and no other ground station has. 255 is what
    QGroundControl and Mission Planner use too; ArduPilot's MAV_GCS_SYSID (SYSID_MYGCS) must be the same number."""
    radios: tuple[RadioTable, ...] | None = None
    """Radios whose RADIO_STATUS is shown, though radios cannot sign. Without this key all reports are shown on an
    unsigned flight, and none on a signed one."""
    bytes_s: Annotated[float, Field(ge=100, le=1e7)] | None = None
    """What a telemetry radio carries, both ways together, in bytes a second, for each connection: streams are thinned
    until they fit. Without this key 1200 on serial ports and where a radio reports itself (RADIO_STATUS). Where a
    vehicle has several links, a serial port among them, it is that of the serial ports."""
    one_radio: bool = False
    """Whether all vehicles are behind one radio though their connections differ, as behind a router: transfers take
    turns, and the heartbeat is sent once. Of vehicles with several links it is the first."""

    @model_validator(mode="after")
    def _check_radios(self) -> LinkTable:
        for index, radio in enumerate(self.radios or ()):
            if radio in (self.radios or ())[:index]:
                raise ValueError(
                    f"radios[{index}]: expected each radio once, got system {radio.system} component "
                    f"{radio.component} again"
                )
        return self

    @property
    def station(self) -> tuple[int, int]:
        """Our own system and component."""
        return self.station_sysid, GROUND_STATION[1]

    @property
    def senders(self) -> frozenset[tuple[int, int]] | None:
        """System and component of each radio."""
        return None if self.radios is None else frozenset((radio.system, radio.component) for radio in self.radios)


class ForwardTable(SiteTable):
    """Other ground stations: what vehicles send goes to them, and what they send to the vehicles if that is allowed."""

    to: tuple[str, ...] = ()
    """Where stations are, as `connection` of a vehicle: `udpout://127.0.0.1:14550` calls QGroundControl on this
    computer, `tcpin://0.0.0.0:5760` waits for stations. Each gets every frame of every vehicle as it came."""
    allow_orders: bool = False
    """Whether what the stations send goes to the vehicles. Who orders something is named, and not worked against."""
    bytes_s: Annotated[float, Field(ge=0, le=1e7)] | None = None
    """What they may send over each telemetry radio, in bytes a second, with RTCM corrections and Remote ID; the streams
    of the vehicles get as much less. Without this key a tenth of what the radio carries."""

    @model_validator(mode="after")
    def _check_ports(self) -> ForwardTable:
        if self.allow_orders and not self.to:
            raise ValueError("to: expected at least one connection beside allow_orders, got none")
        taken = set[str]()
        for index, text in enumerate(self.to):
            try:
                port = parse_connection(text)
            except ValueError as error:
                raise ValueError(f"to[{index}]: {error}") from None
            if port.exclusive_resource in taken:
                raise ValueError(f"to[{index}]: expected a port of its own, got '{text}' again")
            taken.add(port.exclusive_resource)
        return self

    @property
    def ports(self) -> tuple[Connection, ...]:
        """The connections, read."""
        return tuple(map(parse_connection, self.to))


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
    """The only segments that its camera is good for, named as `only` of `[network]` has it; without it all."""
    spare: bool = False
    """Nothing is planned for it: it stands at its base, and the crew sends it out with `swap` when it is needed."""


class DayTable(SiteTable):
    """The working days that `plan --day` plans."""

    begin: Clock = "08:00"
    """First take-off of a day."""
    end: Clock = "16:00"
    """Everybody has landed by then."""
    days: Annotated[int, Field(ge=1, le=MOST_DAYS)] = 1
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
