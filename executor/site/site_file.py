"""The site file: what a crew writes, checked before anything else looks at it.

Every refusal is one line that names the file, the key and what was expected.
"""

from __future__ import annotations

import hashlib
import os
import re
import tomllib
from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from executor.core.telemetry.vehicle_identity import AUTOPILOT
from executor.errors import SiteError
from executor.site.tables.aircraft import EnergyTable, VehicleTable
from executor.site.tables.area_tables import AreaTable, PlaceTable
from executor.site.tables.camera_tables import CameraTable, LookTable
from executor.site.tables.day_tables import BaseTable, DayTable
from executor.site.tables.fence_table import FenceTable
from executor.site.tables.fields import SiteTable
from executor.site.tables.flight import FaultsTable, FlightTable
from executor.site.tables.ground import DepotTable, InspectionTable, NetworkTable
from executor.site.tables.learned import LearnedTable
from executor.site.tables.links import LinkTable, MqttTable, SigningTable, WebTable
from executor.site.tables.map import MapTable
from executor.site.tables.terrain_table import TerrainTable
from missions import NESTED, format_first_error

PAGE = "docs/reference/site-file.md"
"""Where every key stands."""


class Site(SiteTable):
    """The whole file."""

    depot: DepotTable | None = None
    network: NetworkTable
    terrain: TerrainTable | None = None
    inspection: InspectionTable = InspectionTable()
    energy: EnergyTable = EnergyTable()
    area: tuple[AreaTable, ...] = ()
    place: tuple[PlaceTable, ...] = ()
    vehicle: Annotated[tuple[VehicleTable, ...], Field(min_length=1)]
    flight: FlightTable = FlightTable()
    faults: FaultsTable = FaultsTable()
    fence: FenceTable | None = None
    signing: SigningTable | None = None
    link: LinkTable = LinkTable()
    mqtt: MqttTable | None = None
    web: WebTable = WebTable()
    map: MapTable | None = None
    learned: LearnedTable | None = None
    camera: tuple[CameraTable, ...] = ()
    look: tuple[LookTable, ...] = ()
    day: DayTable | None = None
    base: tuple[BaseTable, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _require_vehicles(cls, content: dict[str, Any]) -> dict[str, Any]:
        if not content.get("vehicle"):
            raise ValueError("vehicle: expected at least one [[vehicle]] table")
        return content

    @model_validator(mode="after")
    def _check_terrain(self) -> Site:
        if self.terrain is not None and self.inspection.heights == "flat":
            raise ValueError(
                "inspection.heights: expected 'known' beside [terrain], which knows the ground, got 'flat'"
            )
        return self

    @model_validator(mode="after")
    def _check_distinct(self) -> Site:
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
    def _check_places(self) -> Site:
        _check_own_names("place", [place.name for place in self.place])
        pads = [place.name for place in self.place if place.kind == "pad"]
        taken: dict[str, str] = {}
        for index, vehicle in enumerate(self.vehicle):
            if vehicle.pad is None:
                continue
            if vehicle.pad not in pads:
                known = ", ".join(map(repr, pads)) or "which there is none of"
                raise ValueError(
                    f"vehicle[{index}].pad: expected the name of a [[place]] of kind 'pad', {known}, "
                    f"got '{vehicle.pad}'"
                )
            if vehicle.pad in taken:
                raise ValueError(
                    f"vehicle[{index}].pad: expected a pad of its own, got '{vehicle.pad}', which is also the pad of "
                    f"vehicle '{taken[vehicle.pad]}'"
                )
            taken[vehicle.pad] = vehicle.name
        return self

    @model_validator(mode="after")
    def _check_cameras(self) -> Site:
        vehicles, cameras = {vehicle.name for vehicle in self.vehicle}, [camera.name for camera in self.camera]
        _check_own_names("camera", cameras)
        for index, camera in enumerate(self.camera):
            for number, name in enumerate(camera.vehicles):
                if name not in vehicles:
                    raise ValueError(
                        f"camera[{index}].vehicles[{number}]: expected the name of a vehicle, got '{name}'"
                    )
        for index, look in enumerate(self.look):
            if look.camera not in cameras:
                raise ValueError(f"look[{index}].camera: expected the name of a [[camera]], got '{look.camera}'")
        return self

    @model_validator(mode="after")
    def _check_bases(self) -> Site:
        vehicles, stands = {one.name for one in self.vehicle}, dict[str, str]()
        _check_own_names("base", [one.name for one in self.base])
        for index, base in enumerate(self.base):
            for name in base.vehicles:
                _check_named(f"base[{index}].vehicles", name, vehicles)
                if name in stands:
                    raise ValueError(
                        f"base[{index}].vehicles: expected each vehicle at one base, got '{name}', which stands at "
                        f"'{stands[name]}'"
                    )
                stands[name] = base.name
        for one in self.vehicle:
            if self.base and one.name not in stands:
                raise ValueError(f"base: expected every vehicle at one, got none for '{one.name}'")
        return self

    @model_validator(mode="after")
    def _check_day(self) -> Site:
        vehicles, bases = {one.name for one in self.vehicle}, {one.name for one in self.base}
        day = self.day or DayTable()
        for index, road in enumerate(day.road):
            for name in road.between:
                _check_named(f"day.road[{index}].between", name, bases)
        for index, quiet in enumerate(day.quiet):
            for name in quiet.vehicles:
                _check_named(f"day.quiet[{index}].vehicles", name, vehicles)
        for index, other in enumerate(day.vehicle):
            _check_named(f"day.vehicle[{index}].name", other.name, vehicles)
        return self

    @model_validator(mode="after")
    def _check_signing(self) -> Site:
        for index, vehicle in enumerate(self.vehicle):
            if self.signing is not None and vehicle.backend == "mavsdk":
                raise ValueError(
                    f"vehicle[{index}].backend: expected 'native' beside [signing], got 'mavsdk', which does not sign"
                )
        return self

    @model_validator(mode="after")
    def _check_radios(self) -> Site:
        names = {vehicle.sysid: vehicle.name for vehicle in self.vehicle}
        for index, radio in enumerate(self.link.radios or ()):
            if radio.component == AUTOPILOT and radio.system in names:
                raise ValueError(
                    f"link.radios[{index}]: expected a radio, got system {radio.system} component {AUTOPILOT}, the "
                    f"autopilot of vehicle '{names[radio.system]}'"
                )
        return self

    @model_validator(mode="after")
    def _check_connections(self) -> Site:
        first: dict[str, VehicleTable] = {}
        for index, vehicle in enumerate(self.vehicle):
            other = first.setdefault(vehicle.link.exclusive_resource, vehicle)
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


def _check_own_names(table: str, names: Sequence[str]) -> None:
    for index, name in enumerate(names):
        if name in names[:index]:
            raise ValueError(f"{table}[{index}].name: expected a name of its own, got '{name}' again")


def _check_named(key: str, name: str, known: Set[str]) -> None:
    if name not in known:
        raise ValueError(f"{key}: expected one of {', '.join(sorted(known)) or 'no name at all'}, got '{name}'")


def read_signing_key(site: Site, base: Path) -> bytes | None:
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
        raise SiteError(f"{source}: {format_first_error(error, page=PAGE)}") from error
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
