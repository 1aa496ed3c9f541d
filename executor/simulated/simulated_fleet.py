"""Simulation of a site's fleet (`faultline simulate`), of its cameras' memory cards, and the demo."""

from __future__ import annotations

import asyncio
import math
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from executor.adapters.interrupts import end_program
from executor.adapters.mavlink.frame_layout import EPOCH_UNIX_S, TICKS_PER_S
from executor.adapters.run_directory import RunDirectory
from executor.images import matching
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import default_network_path, dialect_for, read_network
from simulator import config
from simulator.camera import CapturedImage, format_picture_name
from simulator.fault_kinds import parse_fault
from simulator.fleet import SimulatedVehicle, run_fleet
from simulator.radio import parse_radio
from simulator.truth import Truth, TruthWriter

SIZE_PX = (160, 120)
VIEW_DEG = 70.0
FOCAL_PX = SIZE_PX[0] / 2 / math.tan(math.radians(VIEW_DEG) / 2)
GROUND, SKY, TEXT = (96, 120, 72), (170, 195, 220), (30, 30, 30)
EXPOSURE_S = 0.001


@dataclass(slots=True)
class SimulatedCards:
    """Memory cards of a simulated fleet."""

    folder: Path
    unix_s: float
    """Unix time at which the simulation begins."""
    ahead_s: Mapping[str, float] = field(default_factory=dict)
    """Seconds by which the clocks of a vehicle's cameras are ahead, by vehicle name."""
    places: bool = True
    """Whether the cameras record positions."""

    def write(self, vehicle: str, shot: CapturedImage) -> Path:
        """Write one picture of sky and ground, at the camera's tilt.

        Raises:
            OSError: The disk is full, or the folder cannot be created.
        """
        from PIL import Image, ImageDraw

        folder = self.folder / f"{vehicle}-{shot.camera}"
        folder.mkdir(parents=True, exist_ok=True)
        image = Image.new("RGB", SIZE_PX, SKY)
        draw = ImageDraw.Draw(image)
        horizon_px = SIZE_PX[1] / 2 - FOCAL_PX * math.tan(math.radians(max(-80.0, min(80.0, -shot.pitch_deg))))
        draw.rectangle((0, max(0.0, horizon_px), *SIZE_PX), fill=GROUND)
        draw.text((4, 4), f"{vehicle} {shot.number}", fill=TEXT)
        tags = image.getexif()
        for tag, value in ((matching.MAKE, "faultline"), (matching.MODEL, shot.camera)):
            tags[tag] = value
        taken = datetime.fromtimestamp(self.unix_s + shot.t_s + self.ahead_s.get(vehicle, 0.0), UTC)
        details = {
            matching.ORIGINAL: f"{taken:%Y:%m:%d %H:%M:%S}", matching.SUBSECOND: f"{taken.microsecond // 1000:03d}",
            matching.EXPOSURE: EXPOSURE_S, matching.SERIAL: "0001",
        }  # fmt: skip
        tags.get_ifd(matching.DETAILS).update(details)
        if self.places:
            tags.get_ifd(matching.GPS).update(matching.build_gps_tags(shot.lat_deg, shot.lon_deg, shot.alt_msl_m))
        path = folder / format_picture_name(shot.number)
        image.save(path, "JPEG", quality=60, exif=tags)
        return path


def fleet_of(
    ground: SiteModel,
    *,
    speedup: float,
    faults: Sequence[str],
    seed: int,
    wind: float,
    failsafe: bool,
    signing: config.Signing | None = None,
    radio: str = "",
) -> config.SimFleet:
    """Return the site's vehicles on their pads; with `failsafe` they fly RTL when they lose our heartbeat.

    Raises:
        SimulatorError: A fault, a radio or a connection cannot be simulated.
    """
    slow = bool(first := radio.partition(",")[0].strip()) and parse_radio(first).profile.speaks
    setup, station = ground.setup, ground.site.link.station_sysid
    vehicles = []
    for number, table in enumerate(ground.site.vehicle):
        rule = dialect_for(table.autopilot).ground_station_failsafe
        pad = setup.pad_of(table.name)
        lat_deg, lon_deg = setup.frame.to_wgs84_deg(pad.east_m, pad.north_m)
        vehicles.append(
            config.SimVehicle(
                name=table.name,
                sysid=table.sysid,
                autopilot=config.AutopilotKind(table.autopilot),
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
                    **({} if rule.station_sysid is None else {rule.station_sysid: float(station)}),
                },
                other_station=config.OTHER_STATION - (station == config.OTHER_STATION),
                rate_bytes_s=config.PX4_RATE_BYTES_S if slow else math.inf,
                seed=seed * 1000 + number,
                signing=signing,
                cameras=tuple(
                    config.SimCamera(camera.name, camera.id, camera.gimbal)
                    for camera in ground.site.camera
                    if not camera.vehicles or table.name in camera.vehicles
                ),
            )
        )
    return config.SimFleet(tuple(vehicles), speedup, tuple(parse_fault(fault) for fault in faults), radio)


def run_simulation(  # noqa: PLR0913 - the simulation's settings
    ground: SiteModel,
    *,
    speedup: float,
    faults: Sequence[str],
    seed: int,
    wind: float,
    truth: Path | None,
    cards: Path | None,
    failsafe: bool,
    key: bytes | None,
    radio: str,
) -> None:
    """Fly the simulated fleet until SIGINT or SIGTERM.

    The ground truth goes to the file `truth`, the cameras' pictures into the folder `cards`.
    """
    written = None if cards is None else SimulatedCards(cards, time.time())
    signing = None
    if key is not None:
        began_ticks = round((time.time() - EPOCH_UNIX_S) * TICKS_PER_S)
        signing = config.Signing(key, began_ticks, TICKS_PER_S / speedup)
    fleet = fleet_of(
        ground, speedup=speedup, faults=faults, seed=seed, wind=wind, failsafe=failsafe, signing=signing, radio=radio
    )
    with ExitStack() as stack:
        writer = stack.enter_context(closing(TruthWriter(truth))) if truth is not None else None
        for vehicle in fleet.vehicles:
            print(
                f"{vehicle.name}: system {vehicle.sysid}, {vehicle.autopilot.value}, {', '.join(vehicle.connections)}"
            )

        def happened(what: Truth) -> None:
            if what.sender is None:  # commands are for readers of the file
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
    fleet: config.SimFleet, happened: Callable[[Truth], None], lived: Callable[[Sequence[SimulatedVehicle]], None]
) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):
            loop.add_signal_handler(number, stop.set)
    await run_fleet(fleet, stop=stop, on_truth=happened, watched=lived)


USUAL_VEHICLES = 4
"""Vehicles of the default demo: they fly the whole default network below a site's ceiling."""
USUAL_RADIUS_M = 700.0
USUAL_BUDGET_PCT = 28.0
"""Budget of the default demo: so tight that the plan's objective matters."""
USUAL_LOSS = "uav1:silent@450s"
"""Loss in the default demo: after it, a plan chosen by MinComb leaves segments over; one chosen for its window does
not."""
OTHER_LOSS = "uav2:silent@40%"
SIMULATED_CEILING_M = 1000.0
LISTENING = range(14_551, 15_000)
"""Ports of vehicles that are planned for but never opened."""


def build_demo_site(
    *, network: Path | None, radius_m: float, vehicles: int, speedup: float, autopilot: str, flat: bool = False,
    ports: Sequence[int] = (),
) -> dict[str, object]:  # fmt: skip
    """Return the content of a site file for a simulated fleet; `flat` declares its ground flat.

    Its vehicles answer on the given ports, or else on free ones.
    """
    table: dict[str, object] = {"file": "default" if network is None else str(network.resolve()), "radius_m": radius_m}
    budget = {"budget_pct": USUAL_BUDGET_PCT} if is_default_demo(network, radius_m, vehicles) else {}
    site: dict[str, object] = {
        "network": table,
        "flight": {"speedup": speedup, "fly_again": "auto"},  # there is no crew at these pads
        "vehicle": [table | budget for table in build_vehicle_tables(ports or find_free_ports(vehicles), autopilot)],
    }
    inspection: dict[str, object] = {"heights": "flat"} if flat else {}
    if network is not None or vehicles > USUAL_VEHICLES:
        # Over hills, and with many layers, the highest RTL is above 120 m; a simulation needs no permit for that.
        inspection["ceiling_m"] = SIMULATED_CEILING_M
    if inspection:
        site["inspection"] = inspection
    if network is not None and not _is_json(network):
        # A graph file has no location: the demo uses that of the default network.
        frame = read_network(default_network_path()).frame
        site["depot"] = {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg, "alt_m": frame.alt_m}
    return site


def build_vehicle_tables(ports: Sequence[int], autopilot: str) -> list[dict[str, object]]:
    """Return the vehicles of a site file, on these ports of this computer."""
    return [
        {"name": f"uav{number}", "connection": f"udpin://127.0.0.1:{port}", "sysid": number, "autopilot": autopilot}
        for number, port in enumerate(ports, start=1)
    ]


def is_default_demo(network: Path | None, radius_m: float, vehicles: int) -> bool:
    """Return whether this is the demo flown by default."""
    return (network, radius_m, vehicles) == (None, USUAL_RADIUS_M, USUAL_VEHICLES)


def _is_json(network: Path) -> bool:
    """Return whether a file is GeoJSON, which has coordinates; the reader reports a missing file."""
    try:
        with network.open("rb") as file:
            return file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")
    except OSError:
        return False


UNASKED = range(20_000, 32_000)
"""Ports below those that Linux (32768 on), macOS and Windows (49152 on) assign automatically."""


def find_free_ports(count: int) -> list[int]:
    """Return free UDP ports of this computer outside the range that systems assign automatically.

    The simulated vehicles send from ports that the system assigns: among forty, one might otherwise equal another's
    port.
    """
    found: list[int] = []
    with ExitStack() as stack:
        for port in random.sample(UNASKED, len(UNASKED)):
            if len(found) == count:
                break
            plug = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            with suppress(OSError):
                plug.bind(("127.0.0.1", port))
                found.append(port)
    return found


@contextmanager
def run_simulated_fleet(run: Path, faults: Sequence[str], seed: int) -> Iterator[None]:
    """Start `faultline simulate`, and run it during the flight; Ctrl-C in the terminal does not reach it."""
    command = [sys.executable, "-m", "executor", "simulate", str(RunDirectory(run).site), "--seed", str(seed)]
    command += ["--truth", str(RunDirectory(run).truths), "--failsafe"]
    for fault in faults:
        command += ["--fault", fault]
    with (run / "simulator.log").open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
        try:
            # On a slow computer this takes longer than vehicles are waited for.
            while process.poll() is None and not RunDirectory(run).truths.exists():
                time.sleep(0.05)
            yield
        finally:
            end_program(process)
