"""Read the site file, and check it before anything else uses it.

Every refusal is one line that names the file, the key and what was expected.
"""

from __future__ import annotations

import hashlib
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence, Set
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from executor.core.interface.connection import Connection
from executor.core.telemetry.vehicle_identity import AUTOPILOT
from executor.errors import SiteError
from executor.site import flight_keys, mqtt_and_web_keys, site_keys
from missions import NESTED, format_first_error
from missions.files import decode_text

PAGE = "docs/reference/site-file.md"
"""Page that documents every key."""


class Site(site_keys.SiteTable):
    """The whole file."""

    depot: site_keys.DepotTable | None = None
    network: site_keys.NetworkTable
    lock: tuple[site_keys.LockTable, ...] = ()
    terrain: site_keys.TerrainTable | None = None
    inspection: site_keys.InspectionTable = site_keys.InspectionTable()
    energy: site_keys.EnergyTable = site_keys.EnergyTable()
    area: tuple[site_keys.AreaTable, ...] = ()
    place: tuple[site_keys.PlaceTable, ...] = ()
    vehicle: Annotated[tuple[site_keys.VehicleTable, ...], Field(min_length=1)]
    flight: flight_keys.FlightTable = flight_keys.FlightTable()
    faults: flight_keys.FaultsTable = flight_keys.FaultsTable()
    fence: flight_keys.FenceTable | None = None
    signing: flight_keys.SigningTable | None = None
    link: flight_keys.LinkTable = flight_keys.LinkTable()
    forward: flight_keys.ForwardTable = flight_keys.ForwardTable()
    mqtt: mqtt_and_web_keys.MqttTable | None = None
    web: mqtt_and_web_keys.WebTable = mqtt_and_web_keys.WebTable()
    map: site_keys.MapTable | None = None
    learned: site_keys.LearnedTable | None = None
    camera: tuple[site_keys.CameraTable, ...] = ()
    look: tuple[site_keys.LookTable, ...] = ()
    day: flight_keys.DayTable | None = None
    base: tuple[flight_keys.BaseTable, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _require_vehicles(cls, content: dict[str, Any]) -> dict[str, Any]:
        if not content.get("vehicle"):
            raise ValueError("vehicle: expected at least one [[vehicle]] table")
        return content

    def _find_errors(self) -> Iterator[str]:
        for check in (
            self._check_terrain, self._check_vehicles, self._check_places, self._check_cameras, self._check_locks,
            self._check_bases, self._check_day, self._check_signing, self._check_radios, self._check_connections,
            self._check_forward,
        ):  # fmt: skip
            yield from check()

    def _check_terrain(self) -> Iterator[str]:
        if self.terrain is not None and self.inspection.heights == "flat":
            yield "inspection.heights: expected 'known' with [terrain], which knows the ground, got 'flat'"

    def _check_vehicles(self) -> Iterator[str]:
        """Yield the names and system ids that several vehicles share."""
        for key in ("name", "sysid"):
            seen: dict[object, str] = {}
            for index, vehicle in enumerate(self.vehicle):
                value = getattr(vehicle, key)
                if value in seen:
                    yield (
                        f"vehicle[{index}].{key}: expected a {key} of its own, got {value}, which is also the {key} of "
                        f"vehicle '{seen[value]}'"
                    )
                seen[value] = vehicle.name

    def _check_places(self) -> Iterator[str]:
        yield from _check_own_names("place", [place.name for place in self.place])
        pads = [place.name for place in self.place if place.kind == "pad"]
        taken: dict[str, str] = {}
        for index, vehicle in enumerate(self.vehicle):
            if vehicle.pad is None:
                continue
            if vehicle.pad not in pads:
                known = ", ".join(map(repr, pads)) or "which there is none of"
                yield (
                    f"vehicle[{index}].pad: expected the name of a [[place]] of kind 'pad', {known}, got "
                    f"'{vehicle.pad}'"
                )
            if vehicle.pad in taken:
                yield (
                    f"vehicle[{index}].pad: expected a pad of its own, got '{vehicle.pad}', which is also the pad of "
                    f"vehicle '{taken[vehicle.pad]}'"
                )
            taken[vehicle.pad] = vehicle.name

    def _check_cameras(self) -> Iterator[str]:
        vehicles, cameras = {vehicle.name for vehicle in self.vehicle}, [camera.name for camera in self.camera]
        yield from _check_own_names("camera", cameras)
        for index, camera in enumerate(self.camera):
            for number, name in enumerate(camera.vehicles):
                if name not in vehicles:
                    yield f"camera[{index}].vehicles[{number}]: expected the name of a vehicle, got '{name}'"
        for index, look in enumerate(self.look):
            if look.camera not in cameras:
                yield f"look[{index}].camera: expected the name of a [[camera]], got '{look.camera}'"

    def _check_locks(self) -> Iterator[str]:
        vehicles = {one.name for one in self.vehicle}
        for index, lock in enumerate(self.lock):
            yield from _check_known(f"lock[{index}].vehicle", [] if lock.vehicle is None else [lock.vehicle], vehicles)

    def _check_bases(self) -> Iterator[str]:
        vehicles, stands = {one.name for one in self.vehicle}, dict[str, str]()
        yield from _check_own_names("base", [one.name for one in self.base])
        for index, base in enumerate(self.base):
            yield from _check_known(f"base[{index}].vehicles", base.vehicles, vehicles)
            for name in base.vehicles:
                if name in stands:
                    yield (
                        f"base[{index}].vehicles: expected each vehicle at one base, got '{name}', which stands at "
                        f"'{stands[name]}'"
                    )
                stands[name] = base.name
        for one in self.vehicle:
            if self.base and one.name not in stands:
                yield f"base: expected every vehicle at one, got none for '{one.name}'"

    def _check_day(self) -> Iterator[str]:
        vehicles, bases = {one.name for one in self.vehicle}, {one.name for one in self.base}
        day = self.day or flight_keys.DayTable()
        for index, road in enumerate(day.road):
            yield from _check_known(f"day.road[{index}].between", road.between, bases)
        for index, quiet in enumerate(day.quiet):
            yield from _check_known(f"day.quiet[{index}].vehicles", quiet.vehicles, vehicles)
        for index, other in enumerate(day.vehicle):
            yield from _check_known(f"day.vehicle[{index}].name", [other.name], vehicles)

    def _check_signing(self) -> Iterator[str]:
        for index, vehicle in enumerate(self.vehicle):
            if self.signing is not None and vehicle.backend == "mavsdk":
                yield f"vehicle[{index}].backend: expected 'native' with [signing], got 'mavsdk', which does not sign"

    def _check_radios(self) -> Iterator[str]:
        names = {vehicle.sysid: vehicle.name for vehicle in self.vehicle}
        if (ours := self.link.station_sysid) in names:
            yield (
                f"link.station_sysid: expected a number that no vehicle has, got {ours}, the sysid of vehicle "
                f"'{names[ours]}'"
            )
        for index, radio in enumerate(self.link.radios or ()):
            if radio.component == AUTOPILOT and radio.system in names:
                yield (
                    f"link.radios[{index}]: expected a radio, got system {radio.system} component {AUTOPILOT}, the "
                    f"autopilot of vehicle '{names[radio.system]}'"
                )

    def _check_connections(self) -> Iterator[str]:
        first: dict[str, tuple[site_keys.VehicleTable, Connection]] = {}
        every = [(index, vehicle, link) for index, vehicle in enumerate(self.vehicle) for link in vehicle.links]
        for index, vehicle, link in every:
            other, as_theirs = first.setdefault(link.exclusive_resource, (vehicle, link))
            if as_theirs != link:
                yield (
                    f"vehicle[{index}].connection: expected a port of its own, or '{as_theirs}' as vehicle "
                    f"'{other.name}' has it, got '{link}'"
                )
            if self.forward.to and vehicle.backend == "mavsdk":
                yield f"vehicle[{index}].backend: expected 'native' with [forward], got 'mavsdk', which has no frames"
            if other.backend != vehicle.backend:
                yield (
                    f"vehicle[{index}].backend: expected '{other.backend}', as vehicle '{other.name}' on the same "
                    f"connection has it, got '{vehicle.backend}'"
                )

    def _check_forward(self) -> Iterator[str]:
        first = {vehicle.link.exclusive_resource: vehicle.name for vehicle in self.vehicle}
        for index, port in enumerate(self.forward.ports):
            if (name := first.get(port.exclusive_resource)) is not None:
                yield f"forward.to[{index}]: expected a port of its own, got '{port}', that of vehicle '{name}'"


def _check_own_names(table: str, names: Sequence[str]) -> Iterator[str]:
    for index, name in enumerate(names):
        if name in names[:index]:
            yield f"{table}[{index}].name: expected a name of its own, got '{name}' again"


def _check_known(key: str, names: Sequence[str], known: Set[str]) -> Iterator[str]:
    for name in names:
        if name not in known:
            yield f"{key}: expected one of {', '.join(sorted(known)) or 'no name at all'}, got '{name}'"


def read_signing_key(site: Site, base: Path) -> bytes | None:
    """Return the key that frames are signed with, 32 bytes; None if they are not signed.

    Raises:
        SiteError: the key that the site names is missing.
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
    return check_site(read_toml(path, "a site file"), str(path))


def read_toml(path: Path, expected: str) -> dict[str, Any]:
    """Read a TOML file; `expected` describes its content, in words.

    Raises:
        SiteError: one line that names the file and what was expected.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SiteError(f"{path}: no such file; expected {expected} (TOML)") from None
    except OSError as error:
        raise SiteError(f"{path}: cannot be read: {error.strerror}; expected {expected} (TOML)") from error
    text = decode_text(content, str(path), SiteError)
    try:
        return parse_toml(text)
    except SiteError as error:
        raise SiteError(f"{path}: {error}; expected {expected}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text.

    Raises:
        SiteError: it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except ValueError as error:  # not only TOMLDecodeError: also whole numbers of thousands of digits
        raise SiteError(f"not TOML: {error}") from error
    except RecursionError:
        raise SiteError(f"not TOML: {NESTED}") from None


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
    """Return the value of an environment variable named in a site file; None if none is named.

    Args:
        variable: The variable.
        key: Site-file key that names it.
        source: The site file.
        environment: The environment to search.

    Raises:
        SiteError: it is not set, or empty.
    """
    if variable is None:
        return None
    value = environment.get(variable)
    if not value:
        raise SiteError(f"{source}: {key}: expected a value in the environment variable {variable}, which is not set")
    return value
