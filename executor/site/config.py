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

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from executor.core.connection import Connection, parse_connection
from executor.core.hearing.speaker import AUTOPILOT
from executor.errors import SiteError
from missions import AUTOPILOTS, NESTED
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
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]+$")]
EnvironmentName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DepotTable(_Table):
    """Where the vehicles start and land."""

    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    alt_m: Annotated[float, Field(ge=-500, le=9000)] | None = None
    """Above mean sea level; must be known where the network knows its ground, from here or from the network's file."""


class NetworkTable(_Table):
    """The power line."""

    file: FileName
    radius_m: Positive | None = None
    """Takes the segments whose two pylons are both nearer to the depot than this."""
    crs: str | None = None
    """The grid of a graph file's metres, such as EPSG:32633; without it they are true east and north."""
    tallest_m: Positive | None = None
    """Of all structures: says of a line of giants that its heights are metres over ground."""


class InspectionTable(_Table):
    """How the line is flown."""

    height_m: Metres = 15.0
    """Over the pylon tops where the network knows them, else over the depot's ground."""
    heights: Literal["known", "flat"] = "known"
    """flat claims that the ground is everywhere as high as the depot's, where the network does not know it."""
    ceiling_m: Metres = 120.0
    """No mission goes higher than this over the ground; more needs a permit."""
    return_ceiling_m: Metres | None = None
    """The same for the vehicles' own returns, which are level and higher over hills; by default `ceiling_m`."""
    standoff_m: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 5.0
    """Beside the line, always on the same side."""
    speed_m_s: Speed = 3.0
    transit_speed_m_s: Speed = 8.0
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """Where the air moves to, east and north."""
    layer_m: Metres = 5.0
    """Any two vehicles keep at least this far apart."""
    corridor_m: Metres = 10.0
    """How far from the planned track a segment still counts as inspected."""


class EnergyTable(_Table):
    """Which multicopter: a preset, and what differs from it."""

    drone: str = "mavic3"
    mass_kg: Annotated[float, Field(ge=0.05, le=1000)] | None = None
    rotors: Annotated[int, Field(ge=3, le=16)] | None = None
    propeller_radius_m: Annotated[float, Field(ge=0.01, le=10)] | None = None
    cells: Annotated[int, Field(ge=1, le=24)] | None = None
    capacity_ah: Annotated[float, Field(ge=0.01, le=1e6)] | None = None
    area_m2: Annotated[float, Field(ge=1e-4, le=100)] | None = None
    efficiency: Annotated[float, Field(ge=0.01, le=1)] | None = None

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


AutopilotKey = Annotated[str, AfterValidator(_known_autopilot)]
"""The name of an autopilot that is known."""


class VehicleTable(_Table):
    """One vehicle."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
    connection: str
    """udpin:// and tcpin://HOST:PORT listen there, udpout:// and tcpout://HOST:PORT call there, serial://DEVICE:BAUD.
    Vehicles with different system ids may share one."""
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey
    backend: Literal["native", "mavsdk"] = "native"
    """Which software speaks to the vehicle."""
    budget_pct: Percent = 75.0
    reserve_pct: Percent = 15.0

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
    """The factor at which a simulation runs; time-outs and heartbeats follow it."""
    solve_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Real seconds that the solver may take for a re-plan."""
    connect_timeout_s: Positive = 15.0
    """Real seconds until a vehicle that says nothing is given up before the flight."""
    ready_timeout_s: Positive = 120.0
    """Seconds of the vehicle's time until it must be ready to arm."""
    fly_again: Literal["ask", "never", "auto"] = "ask"
    """Whether a vehicle on the ground takes off for a re-plan: when the crew says that its pad is clear, never once it
    has landed, or by itself, for simulation."""
    offer_s: Positive = 300.0
    """How long the crew may take to say so once nobody flies any more."""
    pilot_grace_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    """How long the segments of a vehicle that its pilot has taken are kept for it."""
    pilot_return: Literal["ask", "auto"] = "ask"
    """Whether a vehicle that its pilot has put back on its mission waits for the operator to be in the plan again."""


class FaultsTable(_Table):
    """When a vehicle is judged to be lost."""

    link_timeout_s: Positive | None = None
    """Silence until a vehicle is lost; by default its autopilot's own time for coming home, and a margin."""
    link_stale_s: Positive = 3.0
    battery_step_pct: Positive = 8.0
    battery_excess_pct: Positive = 2.0
    battery_window_s: Positive = 90.0


class SigningTable(_Table):
    """MAVLink 2 message signing: the key is in a file or in the environment, never here."""

    key_file: FileName | None = None
    """64 hexadecimal digits, or a passphrase, of which the SHA-256 is the key, as in other ground stations."""
    key_env: str | None = None
    """The name of a variable that holds the same."""

    @model_validator(mode="after")
    def _one(self) -> SigningTable:
        if (self.key_file is None) is (self.key_env is None):
            raise ValueError("key_file: expected either key_file or key_env")
        return self


class RadioTable(_Table):
    """A telemetry radio, by what its RADIO_STATUS names as its sender."""

    system: Annotated[int, Field(ge=1, le=255)]
    component: Annotated[int, Field(ge=1, le=255)]


class LinkTable(_Table):
    """Who else is on the links."""

    radios: tuple[RadioTable, ...] | None = None
    """Whose reports of the radio link are shown, though radios cannot sign; SiK radios are system 51, component 68.
    Without this key: everybody's where nothing is signed, nobody's where frames are."""

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
    """Where the flight is published, and where intents are taken from."""

    host: HostName = "127.0.0.1"
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """1883 by default, 8883 with TLS."""
    prefix: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$")] = "faultline"
    """What all topics begin with; flights that are published at the same time need one each."""
    telemetry_rate_hz: Annotated[float, Field(gt=0, le=10)] = 1.0
    """How often, in real seconds."""
    tls: bool = False
    ca_file: FileName | None = None
    """The certificate that the broker's is signed with (PEM); without one the system's own are trusted."""
    username_env: EnvironmentName | None = None
    password_env: EnvironmentName | None = None
    token_env: EnvironmentName | None = None
    """The environment variable with the token that intents must carry."""
    intent_max_age_s: Annotated[float, Field(gt=0, le=3600)] = 10.0

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
    host: str = "127.0.0.1"
    """An address of this computer: 0.0.0.0 lets phones in the field look, too."""
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    """0 takes a free one; the address is printed."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """The environment variable that holds the token which has to be shown."""
    names: tuple[str, ...] = ()
    """Host names under which it is called, beside its own."""

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
        raise SiteError(f"{source}: {_first_reason(error)}") from error
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


def _first_reason(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    context = first.get("ctx", {})
    match first["type"]:
        case "missing":
            reason = "expected this key, but it is missing"
        case "extra_forbidden":
            reason = "unknown key; expected one that the manual names"
        case "value_error":
            reason = str(context["error"])
            # A check of several keys names its own; the place before it is the table's.
            return f"{key}.{reason}" if key else reason
        case "too_short":
            reason = "expected at least one vehicle"
        case "literal_error":
            reason = f"expected {context['expected']}, got {first['input']!r}"
        case _:
            said = first["msg"].removeprefix("Input should be ").removeprefix("a valid ")
            reason = f"expected {said}, got {first['input']!r}"
    if key == "vehicle" and first["type"] == "missing":
        reason = "expected at least one [[vehicle]] table"
    return f"{key}: {reason}"
