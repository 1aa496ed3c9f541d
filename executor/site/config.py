"""The site file: what a crew writes, checked before anything else looks at it.

Every refusal is one line that names the file, the key and what was expected.
"""

from __future__ import annotations

import hashlib
import ipaddress
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from executor.core.battery.resting import Chemistry
from executor.core.connection import Connection, parse_connection
from executor.core.hearing.speaker import AUTOPILOT
from executor.errors import SiteError
from executor.site.learned import LearnedTable
from missions import AUTOPILOTS, NESTED, SNAP_M, first_reason, parse_where
from planner import PRESETS

Percent = Annotated[float, Field(ge=0, le=100)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
Metres = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Speed = Annotated[float, Field(ge=0.01, le=1000, allow_inf_nan=False)]
WindSpeed = Annotated[float, Field(ge=-20, le=20)]
HostName = Annotated[
    str, Field(max_length=253, pattern=r"^([0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*|[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*)$")
]
"""A name, or an address of version 4 or 6."""
LayerName = Annotated[str, Field(min_length=1, max_length=200)]
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]+$")]
PAGE = "docs/reference/site-file.md"
"""Where every key stands."""
EnvironmentName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DepotTable(_Table):
    """Where the vehicles start and land. May be left out where the network's file has a depot."""

    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    """WGS 84."""
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    """WGS 84."""
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Ground above mean sea level. Needed, here or in the network's file, where the network knows its ground."""


def _where(text: str) -> str:
    try:
        parse_where(text)
    except ValueError as error:
        raise PydanticCustomError("filter", "{reason}", {"reason": str(error)}) from error
    return text


class NetworkTable(_Table):
    """The power line."""

    file: FileName
    """GeoJSON, KML, KMZ, GPX, OpenStreetMap, GeoPackage, shapefile, CSV, XLSX, or a graph file of pylon offsets,
    relative to the site file; `default` is faultline's own network."""
    layer: LayerName | tuple[LayerName, ...] = ()
    """The layer, sheet or folder to read, or several; needed where a file has more than one of poles or of lines."""
    where: Annotated[str, AfterValidator(_where), Field(max_length=1000)] | None = None
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
    tallest_m: Positive | None = None
    """Height of the tallest structure. Confirms that heights which look too large for pylons are metres over ground."""


class InspectionTable(_Table):
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
    corridor_m: Metres = 10.0
    """A segment counts as inspected only where the flown track is within this of the planned one."""


class EnergyTable(_Table):
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
    area_m2: Annotated[float, Field(ge=1e-4, le=100)] | None = None
    """Area of the vehicle seen from above."""
    efficiency: Annotated[float, Field(ge=0.01, le=1)] | None = None
    """Efficiency of propeller times motor."""

    @model_validator(mode="after")
    def _known(self) -> EnergyTable:
        if self.drone not in PRESETS:
            raise ValueError(f"drone: expected one of {', '.join(PRESETS)}, got '{self.drone}'")
        return self


def _known_autopilot(name: str) -> str:
    names = [dialect.name for dialect in AUTOPILOTS]
    if name not in names:
        raise PydanticCustomError("literal_error", "expected {expected}", {"expected": " or ".join(map(repr, names))})
    return name


AutopilotKey = Annotated[
    str,
    AfterValidator(_known_autopilot),
    WithJsonSchema({"type": "string", "enum": [dialect.name for dialect in AUTOPILOTS]}),
]
"""The name of an autopilot that is known."""


class VehicleTable(_Table):
    """One vehicle."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
    """Name of the vehicle everywhere: a letter, then letters, digits, - and _."""
    connection: str
    """`udpin://HOST:PORT` and `tcpin://HOST:PORT` listen, `udpout://HOST:PORT` and `tcpout://HOST:PORT` call,
    `serial:///dev/ttyUSB0:57600` opens a port. Vehicles with different system ids may share a connection."""
    sysid: Annotated[int, Field(ge=1, le=254)]
    """MAVLink system id; each vehicle needs its own."""
    autopilot: AutopilotKey
    """Firmware of the vehicle."""
    backend: Literal["native", "mavsdk"] = "native"
    """Library that carries the messages; `mavsdk` does not sign frames."""
    budget_pct: Percent = 75.0
    """Most of a full battery that a route may use."""
    reserve_pct: Percent = 15.0
    """Share of a full battery that is never planned with."""

    @model_validator(mode="after")
    def _sane(self) -> VehicleTable:
        if self.budget_pct + self.reserve_pct > 100:
            raise ValueError(
                f"budget_pct: expected at most {100 - self.reserve_pct:g} beside a reserve_pct of "
                f"{self.reserve_pct:g}, got {self.budget_pct:g}"
            )
        try:
            parse_connection(self.connection)
        except ValueError as error:
            raise ValueError(f"connection: {error}") from None
        return self

    @property
    def link(self) -> Connection:
        """The connection, read."""
        return parse_connection(self.connection)


class FlightTable(_Table):
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
    """Whether a vehicle on the ground takes off for a re-plan: `ask`, once the crew says that its pad is clear; `never`
    after it has landed; `auto`, by itself, for simulation only."""
    offer_s: Positive = 300.0
    """How long the crew may take to answer such an offer once no vehicle flies any more."""
    pilot_grace_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    """How long the segments of a vehicle that its pilot has taken are kept for it."""
    pilot_return: Literal["ask", "auto"] = "ask"
    """When a pilot has put the vehicle back on its mission: `ask` waits for the operator's include, `auto` does not."""
    inferred: Literal["count", "fly"] = "count"
    """What a vehicle flew while it was not heard, or nobody listened, where its clock, place and mission fit: `count`
    it, marked as inferred; `fly` it again for proof by positions."""


class FaultsTable(_Table):
    """Thresholds for link loss and battery faults."""

    link_timeout_s: Positive | None = None
    """Silence until a vehicle is declared lost. Without it: until its own GCS failsafe has acted, plus a margin.
    A figure shorter than that time is not taken."""
    link_stale_s: Positive = 3.0
    """Silence until a vehicle's link is called stale: a warning, no fault."""
    battery_step_pct: Positive = 8.0
    """A loss of this much at once, beyond what the flight costs, is a battery fault."""
    battery_excess_pct: Positive = 2.0
    """A loss of this much beyond the usual consumption is a battery drain."""
    battery_window_s: Positive = 90.0
    """Time in which an excess of consumption is forgotten but for a third."""


class SigningTable(_Table):
    """MAVLink 2 message signing: the key is in a file or in the environment, never here."""

    key_file: FileName | None = None
    """File with 64 hexadecimal digits, or a passphrase, whose SHA-256 is the key, as in other ground stations."""
    key_env: str | None = None
    """Environment variable that holds the same. Either `key_file` or `key_env` must be there."""

    @model_validator(mode="after")
    def _one(self) -> SigningTable:
        if (self.key_file is None) is (self.key_env is None):
            raise ValueError("key_file: expected either key_file or key_env")
        return self


class RadioTable(_Table):
    """A telemetry radio, by what its RADIO_STATUS names as its sender."""

    system: Annotated[int, Field(ge=1, le=255)]
    """MAVLink system id of the radio; SiK radios use 51."""
    component: Annotated[int, Field(ge=1, le=255)]
    """MAVLink component id of the radio; SiK radios use 68."""


class LinkTable(_Table):
    """Other senders on the links."""

    radios: tuple[RadioTable, ...] | None = None
    """Radios whose RADIO_STATUS is shown, though radios cannot sign. Without this key all reports are shown on an
    unsigned flight, and none on a signed one."""

    @model_validator(mode="after")
    def _distinct(self) -> LinkTable:
        for index, radio in enumerate(self.radios or ()):
            if radio in (self.radios or ())[:index]:
                raise ValueError(
                    f"radios[{index}]: expected each radio once, got system {radio.system} component "
                    f"{radio.component} again"
                )
        return self

    @property
    def senders(self) -> frozenset[tuple[int, int]] | None:
        """System and component of each radio."""
        return None if self.radios is None else frozenset((radio.system, radio.component) for radio in self.radios)


class MqttTable(_Table):
    """The MQTT broker where the flight is published and intents are taken from."""

    host: HostName = "127.0.0.1"
    """Host name or address of the broker."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Port of the broker; without it 1883, and 8883 with TLS."""
    prefix: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$")] = "faultline"
    """First part of all topics; flights that are published at the same time need one each."""
    telemetry_rate_hz: Annotated[float, Field(gt=0, le=10)] = 1.0
    """How often telemetry is published, in real time."""
    tls: bool = False
    """Connect with TLS."""
    ca_file: FileName | None = None
    """CA certificate of the broker (PEM), relative to the site file; without it the system's own are trusted."""
    username_env: EnvironmentName | None = None
    """Environment variable that holds the user name at the broker."""
    password_env: EnvironmentName | None = None
    """Environment variable that holds the password; needs `username_env`."""
    token_env: EnvironmentName | None = None
    """Environment variable that holds the token which every intent must carry."""
    intent_max_age_s: Annotated[float, Field(gt=0, le=3600)] = 10.0
    """Intents whose timestamp is further than this from the ground station's clock are refused."""

    @model_validator(mode="after")
    def _fitting(self) -> MqttTable:
        if self.ca_file is not None and not self.tls:
            raise ValueError("ca_file: expected none without tls = true")
        if self.password_env is not None and self.username_env is None:
            raise ValueError("password_env: expected a username_env beside it")
        return self

    @property
    def is_here(self) -> bool:
        """Whether the broker is reached from this computer alone, as far as its name tells."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


class WebTable(_Table):
    """The page to fly by."""

    enabled: bool = True
    """Whether the page is served at all."""
    host: str = "127.0.0.1"
    """Address to listen on: `0.0.0.0` for phones in the field; then `token_env` is needed."""
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    """Port to listen on; 0 takes a free one, and the address is printed."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable that holds the token which browsers must show."""
    names: tuple[str, ...] = ()
    """Further host names under which browsers may call the page."""

    @model_validator(mode="after")
    def _guarded(self) -> WebTable:
        try:
            address = ipaddress.ip_address(self.host)
        except ValueError:
            raise ValueError(f"host: expected an address such as 127.0.0.1 or 0.0.0.0, got '{self.host}'") from None
        if not address.is_loopback and self.token_env is None:
            raise ValueError(
                f"token_env: expected the name of an environment variable with a token, because host {self.host} can "
                "be reached by others"
            )
        return self


class Site(_Table):
    """The whole file."""

    depot: DepotTable | None = None
    network: NetworkTable
    inspection: InspectionTable = InspectionTable()
    energy: EnergyTable = EnergyTable()
    vehicle: Annotated[tuple[VehicleTable, ...], Field(min_length=1)]
    flight: FlightTable = FlightTable()
    faults: FaultsTable = FaultsTable()
    signing: SigningTable | None = None
    link: LinkTable = LinkTable()
    mqtt: MqttTable | None = None
    web: WebTable = WebTable()
    learned: LearnedTable | None = None

    @model_validator(mode="before")
    @classmethod
    def _has_vehicles(cls, content: dict[str, Any]) -> dict[str, Any]:
        if not content.get("vehicle"):
            raise ValueError("vehicle: expected at least one [[vehicle]] table")
        return content

    @model_validator(mode="after")
    def _distinct(self) -> Site:
        for key in ("name", "sysid"):
            seen: dict[object, str] = {}
            for index, vehicle in enumerate(self.vehicle):
                value = getattr(vehicle, key)
                if value in seen:
                    raise ValueError(
                        f"vehicle[{index}].{key}: expected a {key} of its own, got {value}, which is also the "
                        f"{key} of vehicle '{seen[value]}'"
                    )
                seen[value] = vehicle.name
        return self

    @model_validator(mode="after")
    def _signs(self) -> Site:
        for index, vehicle in enumerate(self.vehicle):
            if self.signing is not None and vehicle.backend == "mavsdk":
                raise ValueError(
                    f"vehicle[{index}].backend: expected 'native' beside [signing], got 'mavsdk', which does not sign"
                )
        return self

    @model_validator(mode="after")
    def _reports(self) -> Site:
        names = {vehicle.sysid: vehicle.name for vehicle in self.vehicle}
        for index, radio in enumerate(self.link.radios or ()):
            if radio.component == AUTOPILOT and radio.system in names:
                raise ValueError(
                    f"link.radios[{index}]: expected a radio, got system {radio.system} component {AUTOPILOT}, the "
                    f"autopilot of vehicle '{names[radio.system]}'"
                )
        return self

    @model_validator(mode="after")
    def _reachable(self) -> Site:
        first: dict[str, VehicleTable] = {}
        for index, vehicle in enumerate(self.vehicle):
            other = first.setdefault(vehicle.link.place, vehicle)
            if other.link != vehicle.link:
                raise ValueError(
                    f"vehicle[{index}].connection: expected a port of its own, or '{other.link}' as vehicle "
                    f"'{other.name}' has it, got '{vehicle.connection}'"
                )
            if other.backend != vehicle.backend:
                raise ValueError(
                    f"vehicle[{index}].backend: expected '{other.backend}', as vehicle '{other.name}' on the same "
                    f"connection has it, got '{vehicle.backend}'"
                )
        return self


def signing_key(site: Site, base: Path) -> bytes | None:
    """Return the key that frames are signed with, 32 bytes; None if they are not.

    Raises:
        SiteError: there is none where the site says that it is.
    """
    table = site.signing
    if table is None:
        return None
    text = read_secret(table.key_env, "signing.key_env", str(base))
    if table.key_file is not None:
        path = base / table.key_file
        try:
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise SiteError(f"signing.key_file: {path}: cannot be read: {error}") from error
    text = (text or "").strip()
    if not text:
        raise SiteError("signing: expected 64 hexadecimal digits or a passphrase, but there is nothing")
    if re.fullmatch(r"[0-9a-fA-F]{64}", text):
        return bytes.fromhex(text)
    return hashlib.sha256(text.encode()).digest()


def read_site(path: Path) -> Site:
    """Read and check a site file.

    Raises:
        SiteError: one line that names the file, the key and what was expected.
    """
    try:
        content = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise SiteError(f"{path}: no such file; expected a site file (TOML)") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError(f"{path}: cannot be read: {error}") from error
    except ValueError as error:  # beside TOMLDecodeError: whole numbers of thousands of digits
        raise SiteError(f"{path}: not TOML: {error}") from error
    except RecursionError:
        raise SiteError(f"{path}: not TOML: {NESTED}") from None
    return check_site(content, str(path))


def check_site(content: dict[str, Any], source: str) -> Site:
    """Check the content of a site file that came from `source`.

    Raises:
        SiteError: one line that names the source, the key and what was expected.
    """
    try:
        return Site.model_validate(content)
    except ValidationError as error:
        raise SiteError(f"{source}: {first_reason(error, page=PAGE)}") from error
    except RecursionError:
        raise SiteError(f"{source}: content: {NESTED}") from None


def read_secret(variable: str | None, key: str, source: str, environment: Mapping[str, str] = os.environ) -> str | None:
    """Return what an environment variable holds that a site file names; None if it names none.

    Args:
        variable: The variable.
        key: The key of the site file that names it.
        source: The site file.
        environment: Where it is looked for.

    Raises:
        SiteError: it is not set, or empty.
    """
    if variable is None:
        return None
    value = environment.get(variable)
    if not value:
        raise SiteError(f"{source}: {key}: expected a value in the environment variable {variable}, which is not set")
    return value
