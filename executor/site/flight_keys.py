"""Site-file keys for flying: flight, faults, fences, links, days of many sorties."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from executor.core.fault_thresholds import Limits
from executor.core.interface.connection import Connection, parse_connection
from executor.core.interface.messages import GROUND_STATION
from executor.site.site_keys import FileName, Positive, SiteTable, Speed
from missions.validation import Name


class FlightTable(SiteTable):
    """How the flight is run."""

    speedup: Annotated[float, Field(gt=0, le=100)] = 1.0
    """Speed of a simulation in multiples of real time; time-outs and heartbeats follow it. Real aircraft: 1."""
    solve_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Time limit of the solver for a re-plan, in real time."""
    connect_timeout_s: Positive = 15.0
    """Before the flight: real seconds to wait for a vehicle that sends nothing."""
    ready_timeout_s: Positive = 120.0
    """Before the flight: seconds that a vehicle may take to be ready to arm, on its own clock."""
    fly_again: Literal["ask", "never", "auto"] = "ask"
    """Whether a vehicle on the ground takes off for a re-plan, or to fly again what was inspected from a layer: `ask`,
    once the crew says that its pad is clear; `never` after it has landed; `auto`, by itself, for simulation only."""
    offer_s: Positive = 300.0
    """Seconds that the crew has to answer such an offer once no vehicle flies."""
    pilot_grace_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    """Seconds that a vehicle's segments stay reserved for it after its pilot has taken over."""
    pilot_return: Literal["ask", "auto"] = "ask"
    """After a pilot has put the vehicle back on its mission: `ask` waits for the operator's `include`, `auto` does
    not."""
    inferred: Literal["count", "fly"] = "count"
    """Segments flown without telemetry, where the vehicle's clock, position and mission fit: `count` them, marked as
    inferred, or `fly` them again for proof by positions."""


MOST_DAYS = 60
"""Most days of one plan."""
_LIMITS = Limits()
"""Source of the site file's defaults."""


class FaultsTable(SiteTable):
    """Thresholds for link loss and battery faults."""

    link_timeout_s: Positive | None = None
    """Silence after which a vehicle is declared lost. Default: the time until its own GCS failsafe acts, plus a margin;
    shorter values are refused."""
    link_stale_s: Positive = _LIMITS.link_stale_s
    """Silence after which a vehicle's link is stale: a warning, no fault."""
    battery_step_pct: Positive = _LIMITS.battery_step_pct
    """Sudden drop of the battery beyond the flight's consumption that is a fault."""
    battery_excess_pct: Positive = _LIMITS.battery_excess_pct
    """Excess over the usual consumption that is a battery drain."""
    battery_window_s: Positive = _LIMITS.battery_window_s
    """Time constant with which an excess of consumption decays to a third."""
    camera: Literal["home", "on"] = "home"
    """When a camera or gimbal fails: fly `home`, or fly `on` with what the vehicle can inspect without it."""


class FenceTable(SiteTable):
    """Fence and rally points of each vehicle, made from the plan.

    With this table, the fence on board is read and checked against the plan; it is changed only with `enabled`.
    """

    enabled: bool = False
    """Whether every vehicle gets its own fence for the flight; its previous fence is restored after landing."""
    margin_m: Annotated[float, Field(ge=5, le=1000, allow_inf_nan=False)] = 20.0
    """Least distance of the fence from the vehicle's routes, its straight RTL included."""
    height_margin_m: Annotated[float, Field(ge=5, le=500, allow_inf_nan=False)] = 10.0
    """Margin of the fence's ceiling above every planned height, RTL included."""
    action: Literal["keep", "warn", "hold", "return", "land"] = "keep"
    """Action on a fence breach: `keep` leaves the vehicle's parameter, any other value is set for the flight."""
    rally: Literal["pad", "keep"] = "pad"
    """Where RTL may end: `pad` at its own pad only, on days at the nearest of its pads; `keep` leaves the rally points
    on board."""

    @property
    def gives_rally(self) -> bool:
        """Whether vehicles are given rally points."""
        return self.enabled and self.rally == "pad"


class SigningTable(SiteTable):
    """MAVLink 2 message signing: the key is in a file or in the environment, never here."""

    key_file: FileName | None = None
    """File with 64 hexadecimal digits, or with a passphrase whose SHA-256 is the key, as in other ground stations."""
    key_env: str | None = None
    """Environment variable with the same content. Exactly one of `key_file` and `key_env` is required."""

    def _find_errors(self) -> Iterator[str]:
        if (self.key_file is None) is (self.key_env is None):
            yield "key_file: expected either key_file or key_env"


class RadioTable(SiteTable):
    """A telemetry radio, identified by the sender of its RADIO_STATUS."""

    system: Annotated[int, Field(ge=1, le=255)]
    """MAVLink system id of the radio; SiK radios use 51."""
    component: Annotated[int, Field(ge=1, le=255)]
    """MAVLink component id of the radio; SiK radios use 68."""


class LinkTable(SiteTable):
    """Our own system id, other senders, and the capacity of the links."""

    station_sysid: Annotated[int, Field(ge=1, le=255)] = GROUND_STATION[0]
    """MAVLink system id of faultline; no vehicle and no other ground station may have it. QGroundControl and Mission
    Planner use 255 too. ArduPilot's MAV_GCS_SYSID (SYSID_MYGCS) must be the same number."""
    radios: tuple[RadioTable, ...] | None = None
    """Radios whose RADIO_STATUS is accepted although radios cannot sign. Default: all on an unsigned flight, none on a
    signed one."""
    bytes_s: Annotated[float, Field(ge=100, le=1e7)] | None = None
    """Capacity of each telemetry radio, both directions together, in bytes a second; streams are thinned until they
    fit. Default: 1200 on serial ports and where a radio reports itself (RADIO_STATUS). For a vehicle with several links
    it applies to the serial ports."""
    one_radio: bool = False
    """Whether all vehicles share one radio although their connections differ, as behind a router: transfers take turns,
    and the heartbeat is sent once. For vehicles with several links it is the first link."""

    def _find_errors(self) -> Iterator[str]:
        for index, radio in enumerate(self.radios or ()):
            if radio in (self.radios or ())[:index]:
                yield (
                    f"radios[{index}]: expected each radio once, got system {radio.system} component "
                    f"{radio.component} again"
                )

    @property
    def station(self) -> tuple[int, int]:
        """Our system and component id."""
        return self.station_sysid, GROUND_STATION[1]

    @property
    def senders(self) -> frozenset[tuple[int, int]] | None:
        """System and component id of each radio."""
        return None if self.radios is None else frozenset((radio.system, radio.component) for radio in self.radios)


class ForwardTable(SiteTable):
    """Other ground stations: they receive all frames of the vehicles, and may send to them if allowed."""

    to: tuple[str, ...] = ()
    """Addresses of other stations, in the form of a vehicle's `connection`: `udpout://127.0.0.1:14550` calls
    QGroundControl on this computer, `tcpin://0.0.0.0:5760` waits for stations. Each receives every frame of every
    vehicle unchanged."""
    allow_orders: bool = False
    """Whether frames from these stations are forwarded to the vehicles. A station that sends a command is named, and
    faultline does not counteract it."""
    bytes_s: Annotated[float, Field(ge=0, le=1e7)] | None = None
    """Bytes a second that stations may send over each telemetry radio, RTCM corrections and Remote ID included; the
    vehicles' streams are reduced by it. Default: a tenth of the radio's capacity."""

    def _find_errors(self) -> Iterator[str]:
        if self.allow_orders and not self.to:
            yield "to: expected at least one connection with allow_orders, got none"
        taken = set[str]()
        for index, text in enumerate(self.to):
            try:
                port = parse_connection(text)
            except ValueError as error:
                yield f"to[{index}]: {error}"
                return
            if port.exclusive_resource in taken:
                yield f"to[{index}]: expected a port of its own, got '{text}' again"
            taken.add(port.exclusive_resource)

    @property
    def ports(self) -> tuple[Connection, ...]:
        """Parsed connections."""
        return tuple(map(parse_connection, self.to))


Clock = Annotated[str, Field(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9]$")]
Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]


def parse_clock_s(text: str) -> float:
    """Return the seconds since midnight of a time of the day.

    >>> parse_clock_s("08:30")
    30600.0
    """
    hours, minutes = text.split(":")
    return 3600.0 * int(hours) + 60.0 * int(minutes)


class BaseTable(SiteTable):
    """A place where vehicles take off and land. Without any, the depot is the only one, with unlimited packs."""

    name: Name
    """Name of the base: a letter, then letters, digits, - and _."""
    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level. Default: the height in [terrain], else that of the nearest pylon with a known
    height, else the depot's."""
    vehicles: tuple[str, ...] = ()
    """Vehicles that start the day here, and take off here for single flights. Each vehicle belongs to one base."""
    packs: Annotated[int, Field(ge=0, le=1000)] | None = None
    """Charged packs at the start of the day; default: always enough."""
    turnaround_s: Seconds = 180.0
    """Time from landing to the next take-off here: the pack is swapped, or charged in the vehicle."""
    recharge_s: Seconds | None = None
    """Time from landing until the pack is charged again; default: packs are charged overnight only."""


class RoadTable(SiteTable):
    """A road on which a vehicle is driven from base to base; roads are combined into routes."""

    between: tuple[Name, Name]
    """Two bases."""
    minutes: Annotated[float, Field(ge=0, le=1440, allow_inf_nan=False)]
    """Driving time, in either direction."""


class QuietTable(SiteTable):
    """A period of every day in which vehicles do not fly: noise, other traffic."""

    begin: Clock
    """Such as `"12:00"`."""
    end: Clock
    """Such as `"14:00"`."""
    vehicles: tuple[str, ...] = ()
    """Vehicles that it applies to; default: all."""

    def _find_errors(self) -> Iterator[str]:
        if parse_clock_s(self.begin) >= parse_clock_s(self.end):
            yield f"end: expected a time after begin, {self.begin}, got '{self.end}'"


class OtherTable(SiteTable):
    """Differences of one vehicle from the others."""

    name: str
    """The vehicle."""
    speed_m_s: Speed | None = None
    """Speed along the line, instead of [inspection]'s; a day with it can be planned but not flown."""
    transit_speed_m_s: Speed | None = None
    """Speed between segments and bases, instead of [inspection]'s; a day with it can be planned but not flown."""
    segments: tuple[str, ...] = ()
    """Segments that its camera can inspect, named as in `only` of `[network]`; default: all."""
    spare: bool = False
    """Whether it is a spare without planned sorties: the crew sends it out with `swap` when needed."""


class DayTable(SiteTable):
    """The working days that `plan --day` plans."""

    begin: Clock = "08:00"
    """First take-off of a day."""
    end: Clock = "16:00"
    """Latest landing of a day."""
    days: Annotated[int, Field(ge=1, le=MOST_DAYS)] = 1
    """Most days."""
    stagger_s: Seconds = 30.0
    """Least time between two take-offs from a base."""
    lands: Literal["own", "any"] = "own"
    """`own`: sorties end at the vehicle's own base; `any`: at any base, where the vehicle takes off again."""
    road_m_s: Speed | None = None
    """Speed at which vehicles are driven between bases, over the straight distance. Without it and without roads they
    are not driven. Needs `lands = "any"`."""
    road: tuple[RoadTable, ...] = ()
    """Driving times between bases that the straight distance does not give."""
    quiet: tuple[QuietTable, ...] = ()
    """Periods without flights."""
    vehicle: tuple[OtherTable, ...] = ()
    """Vehicles that differ from the others."""

    def _find_errors(self) -> Iterator[str]:
        if parse_clock_s(self.begin) >= parse_clock_s(self.end):
            yield f"end: expected a time after begin, {self.begin}, got '{self.end}'"
        if self.lands == "own" and (self.road_m_s is not None or self.road):
            yield "lands: expected 'any' with roads: vehicles that land at their own base are not driven"
