"""The whole story in one call: a site of its own, a simulated fleet in a process of its own, a flight with a loss."""

from __future__ import annotations

import random
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.simulated.simulated_fleet import fleet_of
from executor.site.site_model import SiteModel
from missions import default_network_path, read_network

USUAL_VEHICLES = 4
"""With these the whole of the default network is flown below the ceiling of a site."""
USUAL_RADIUS_M = 700.0
USUAL_BUDGET_PCT = 28.0
"""Of the usual demo: so tight that it matters how a plan was chosen."""
USUAL_LOSS = "uav1:silent@450s"
"""After this one a plan chosen by MinComb leaves segments over; one chosen for its window does not."""
OTHER_LOSS = "uav2:silent@40%"
SIMULATED_CEILING_M = 1000.0
LISTENING = range(14_551, 15_000)
"""Ports of vehicles that are planned for and never opened."""
ENDS_S = 10.0
"""Real seconds that the simulated fleet may take to end."""


def build_demo_site(
    *, network: Path | None, radius_m: float, vehicles: int, speedup: float, autopilot: str, flat: bool = False,
    ports: Sequence[int] = (),
) -> dict[str, object]:  # fmt: skip
    """Return the content of a site file for a simulated fleet; `flat` claims so of its ground.

    Its vehicles answer on the ports given, or else on free ones.
    """
    table: dict[str, object] = {"file": "default" if network is None else str(network.resolve()), "radius_m": radius_m}
    budget = {"budget_pct": USUAL_BUDGET_PCT} if is_default_demo(network, radius_m, vehicles) else {}
    site: dict[str, object] = {
        "network": table,
        "flight": {"speedup": speedup, "fly_again": "auto"},  # nobody stands at these pads
        "vehicle": [table | budget for table in build_vehicle_tables(ports or find_free_ports(vehicles), autopilot)],
    }
    inspection: dict[str, object] = {"heights": "flat"} if flat else {}
    if network is not None or vehicles > USUAL_VEHICLES:
        # Over hills, and with so many layers, the highest return is above 120 m; a simulation needs no permit for that.
        inspection["ceiling_m"] = SIMULATED_CEILING_M
    if inspection:
        site["inspection"] = inspection
    if network is not None and not _is_json(network):
        # A graph file says nothing of where it lies: the demo puts it where the default network is.
        frame = read_network(default_network_path()).frame
        site["depot"] = {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg, "alt_m": frame.alt_m}
    return site


def build_vehicle_tables(ports: Sequence[int], autopilot: str) -> list[dict[str, object]]:
    """Return the vehicles of a site file, which answer on these ports of this computer."""
    return [
        {"name": f"uav{number}", "connection": f"udpin://127.0.0.1:{port}", "sysid": number, "autopilot": autopilot}
        for number, port in enumerate(ports, start=1)
    ]


def is_default_demo(network: Path | None, radius_m: float, vehicles: int) -> bool:
    """Return whether this is the demo that is flown where nothing else is asked for."""
    return (network, radius_m, vehicles) == (None, USUAL_RADIUS_M, USUAL_VEHICLES)


def _is_json(network: Path) -> bool:
    """Return whether a file is GeoJSON, which has places of its own; one that is not there is the reader's concern."""
    try:
        with network.open("rb") as file:
            return file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")
    except OSError:
        return False


UNASKED = range(20_000, 32_000)
"""Below the ports that Linux (32768 on), macOS and Windows (49152 on) choose by themselves."""


def find_free_ports(count: int) -> list[int]:
    """Return UDP ports of this computer that nobody uses, and that no socket is given unasked.

    The simulated vehicles call from ports that the system chooses: of forty one may be the next one's otherwise.
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


def check_faults(ground: SiteModel, faults: Sequence[str]) -> None:
    """Check the faults before anything is started.

    Raises:
        SimulatorError: one of them cannot be read, or names a vehicle that does not fly.
    """
    fleet_of(ground, speedup=1.0, faults=faults, seed=0, wind=1.0, failsafe=False)


@contextmanager
def run_simulated_fleet(run: Path, faults: Sequence[str], seed: int) -> Iterator[None]:
    """Run `faultline simulate` beside the flight; Ctrl-C in the terminal does not reach it."""
    command = [sys.executable, "-m", "executor", "simulate", str(RunDirectory(run).site), "--seed", str(seed)]
    command += ["--truth", str(RunDirectory(run).truths), "--failsafe"]
    for fault in faults:
        command += ["--fault", fault]
    with (run / "simulator.log").open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(ENDS_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
