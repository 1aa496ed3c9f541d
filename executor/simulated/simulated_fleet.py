"""`faultline simulate`: the site's fleet as simulated vehicles, and the cards of their cameras."""

from __future__ import annotations

import asyncio
import math
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from executor.images import exif
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import Network, dialect_for
from missions.geo import FloatArray
from simulator.camera import CapturedImage, format_picture_name
from simulator.config import AutopilotKind, Signing, SimCamera, SimFleet, SimVehicle, parse_fault
from simulator.fleet import SimulatedVehicle, run_fleet
from simulator.truth import Truth, TruthWriter

SIZE_PX = (160, 120)
VIEW_DEG = 70.0
GROUND, SKY, WIRE = (96, 120, 72), (170, 195, 220), (30, 30, 30)
NEAREST_M = 0.5
EXPOSURE_S = 0.001


@dataclass(slots=True)
class SimulatedCards:
    """The cards of a simulated fleet."""

    folder: Path
    network: Network
    unix_s: float
    """Seconds since 1970 when the simulation begins."""
    ahead_s: Mapping[str, float] = field(default_factory=dict)
    """By how much the clocks of a vehicle's cameras are ahead, by its name."""
    places: bool = True
    """Whether the cameras know where they are."""

    def write(self, vehicle: str, shot: CapturedImage) -> Path:
        """Write one picture.

        Raises:
            OSError: there is no room, or the folder cannot be made.
        """
        from PIL import Image, ImageDraw

        folder = self.folder / f"{vehicle}-{shot.camera}"
        folder.mkdir(parents=True, exist_ok=True)
        image = Image.new("RGB", SIZE_PX, SKY)
        draw = ImageDraw.Draw(image)
        horizon_px = SIZE_PX[1] / 2 - _focal_px() * math.tan(math.radians(max(-80.0, min(80.0, -shot.pitch_deg))))
        draw.rectangle((0, max(0.0, horizon_px), *SIZE_PX), fill=GROUND)
        for ends in self._project_spans(shot):
            draw.line([tuple(end) for end in ends.tolist()], fill=WIRE, width=2)
        draw.text((4, 4), f"{vehicle} {shot.number}", fill=WIRE)
        tags = image.getexif()
        for tag, value in ((exif.MAKE, "faultline"), (exif.MODEL, shot.camera)):
            tags[tag] = value
        taken = datetime.fromtimestamp(self.unix_s + shot.t_s + self.ahead_s.get(vehicle, 0.0), UTC)
        details = {
            exif.ORIGINAL: f"{taken:%Y:%m:%d %H:%M:%S}", exif.SUBSECOND: f"{taken.microsecond // 1000:03d}",
            exif.EXPOSURE: EXPOSURE_S, exif.SERIAL: "0001",
        }  # fmt: skip
        tags.get_ifd(exif.DETAILS).update(details)
        if self.places:
            tags.get_ifd(exif.GPS).update(exif.build_gps_tags(shot.lat_deg, shot.lon_deg, shot.alt_msl_m))
        path = folder / format_picture_name(shot.number)
        image.save(path, "JPEG", quality=60, exif=tags)
        return path

    def _project_spans(self, shot: CapturedImage) -> list[FloatArray]:
        """Return the spans that are in sight, (2, 2) float64 each, in pixels."""
        network, frame = self.network, self.network.frame
        here_m = np.array([*frame.to_local_m(shot.lat_deg, shot.lon_deg), shot.alt_msl_m])
        tops_m = np.array([
            frame.alt_m + shot.up_m - 15.0 if pylon.elevation_m is None else pylon.elevation_m + (pylon.height_m or 0.0)
            for pylon in network.pylons
        ])  # fmt: skip
        seen = []
        for segment in network.segments:
            ends = np.column_stack((network.positions_m[[segment.a, segment.b]], tops_m[[segment.a, segment.b]]))
            pixels = _project_leg(ends - here_m, shot.pitch_deg, shot.yaw_deg)
            if pixels is not None:
                seen.append(pixels)
        return seen


def _focal_px() -> float:
    return SIZE_PX[0] / 2 / math.tan(math.radians(VIEW_DEG) / 2)


def _project_leg(offsets_m: FloatArray, pitch_deg: float, yaw_deg: float) -> FloatArray | None:
    """Return (2, 2) pixels of a leg before the camera, cut off at it; None where all of it is behind."""
    pitch, yaw = math.radians(pitch_deg), math.radians(yaw_deg)
    ahead = np.array([math.cos(pitch) * math.sin(yaw), math.cos(pitch) * math.cos(yaw), math.sin(pitch)])
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    depths = offsets_m @ ahead
    if depths.max() <= NEAREST_M:
        return None
    if depths.min() < NEAREST_M:
        near, far = (0, 1) if depths[0] < depths[1] else (1, 0)
        share = (NEAREST_M - depths[near]) / (depths[far] - depths[near])
        offsets_m = offsets_m.copy()
        offsets_m[near] += share * (offsets_m[far] - offsets_m[near])
        depths = offsets_m @ ahead
    up = np.cross(right, ahead)
    across, above = offsets_m @ right / depths, offsets_m @ up / depths
    focal_px = _focal_px()
    return np.column_stack((SIZE_PX[0] / 2 + focal_px * across, SIZE_PX[1] / 2 - focal_px * above)).clip(-1e4, 1e4)


SIGNING_EPOCH_UNIX_S = 1420070400
"""2015-01-01: the times of signatures count from there."""
TICKS_PER_S = 100_000
"""Steps of 10 us."""


def fleet_of(
    ground: SiteModel,
    *,
    speedup: float,
    faults: Sequence[str],
    seed: int,
    wind: float,
    failsafe: bool,
    signing: Signing | None = None,
) -> SimFleet:
    """Return the site's vehicles, standing on their pads; with `failsafe` they come home when they lose our heartbeat.

    Raises:
        SimulatorError: a fault, or a connection, that cannot be simulated.
    """
    setup = ground.setup
    vehicles = []
    for number, table in enumerate(ground.site.vehicle):
        rule = dialect_for(table.autopilot).ground_station_failsafe
        pad = setup.pad_of(table.name)
        lat_deg, lon_deg = setup.frame.to_wgs84_deg(pad.east_m, pad.north_m)
        vehicles.append(
            SimVehicle(
                name=table.name,
                sysid=table.sysid,
                autopilot=AutopilotKind(table.autopilot),
                connection=table.connection,
                home_lat_deg=lat_deg,
                home_lon_deg=lon_deg,
                home_alt_m=pad.alt_m,
                drone=ground.drone,
                consumption=wind,
                wind_m_s=ground.site.inspection.wind_m_s,
                transfer_patience_s=site_model.stall_s(speedup),
                parameters={
                    rule.action: float(rule.action_return if failsafe else 0),
                    rule.timeout: max(rule.timeout_s, site_model.stall_s(speedup)),
                },
                seed=seed * 1000 + number,
                signing=signing,
                cameras=tuple(
                    SimCamera(camera.name, camera.id, camera.gimbal)
                    for camera in ground.site.camera
                    if not camera.vehicles or table.name in camera.vehicles
                ),
            )
        )
    return SimFleet(tuple(vehicles), speedup, tuple(parse_fault(fault) for fault in faults))


@dataclass(frozen=True, slots=True)
class SimulationOutputs:
    """What a simulation writes besides what it prints."""

    truth: Path | None = None
    """What really happened."""
    cards: Path | None = None
    """What its cameras take."""


def run_simulation(
    ground: SiteModel,
    *,
    speedup: float,
    faults: Sequence[str],
    seed: int,
    wind: float,
    outputs: SimulationOutputs,
    failsafe: bool,
    key: bytes | None = None,
) -> None:
    """Fly the simulated fleet until it is told to stop (SIGINT or SIGTERM)."""
    written = None if outputs.cards is None else SimulatedCards(outputs.cards, ground.network, time.time())
    signing = None
    if key is not None:
        began_ticks = round((time.time() - SIGNING_EPOCH_UNIX_S) * TICKS_PER_S)
        signing = Signing(key, began_ticks, TICKS_PER_S / speedup)
    fleet = fleet_of(ground, speedup=speedup, faults=faults, seed=seed, wind=wind, failsafe=failsafe, signing=signing)
    with ExitStack() as stack:
        writer = stack.enter_context(closing(TruthWriter(outputs.truth))) if outputs.truth is not None else None
        for vehicle in fleet.vehicles:
            print(f"{vehicle.name}: system {vehicle.sysid}, {vehicle.autopilot.value}, {vehicle.connection}")

        def happened(what: Truth) -> None:
            if what.sender is None:  # orders are for those who read the file
                print(f"{what.t_s:8.1f} s  {what.vehicle}: {what.what}", flush=True)
            if writer is not None:
                writer(what)

        def lived(vehicles: Sequence[SimulatedVehicle]) -> None:
            for vehicle in vehicles:
                for shot in vehicle.drain_shots():
                    if written is not None:
                        written.write(vehicle.name, shot)

        asyncio.run(_run_until_signal(fleet, happened, lived))


async def _run_until_signal(
    fleet: SimFleet, happened: Callable[[Truth], None], lived: Callable[[Sequence[SimulatedVehicle]], None]
) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):
            loop.add_signal_handler(number, stop.set)
    await run_fleet(fleet, stop=stop, on_truth=happened, watched=lived)
