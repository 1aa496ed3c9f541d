"""`faultline simulate`: the site's fleet as simulated vehicles."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path

from executor.simulated.cards import SimulatedCards
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import dialect_for
from simulator.config import AutopilotKind, Signing, SimCamera, SimFleet, SimVehicle
from simulator.faults import parse_fault
from simulator.fleet import run_fleet
from simulator.truth import Truth, TruthWriter
from simulator.vehicle import SimulatedVehicle

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
    setup = site_model.build_flight_setup(ground)
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
