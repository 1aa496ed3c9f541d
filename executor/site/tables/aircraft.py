"""The vehicles and what they are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from executor.core.battery.voltage import Chemistry
from executor.core.interface.connection import Connection, parse_connection
from executor.site.tables.fields import Percent, SiteTable
from missions import AUTOPILOTS
from planner import PRESETS


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


class VehicleTable(SiteTable):
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
            parse_connection(self.connection)
        except ValueError as error:
            raise ValueError(f"connection: {error}") from None
        return self

    @property
    def link(self) -> Connection:
        """The connection, read."""
        return parse_connection(self.connection)
