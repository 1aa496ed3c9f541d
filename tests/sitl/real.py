"""Real autopilots in software in the loop: started on free ports beside a flight, and stopped with it."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from missions import LocalFrame, Pad

COPTER_PARAMETERS = {
    # What a calibrated quadrotor has; without them, or with figures for a third IMU that it does not simulate,
    # ArduPilot's pre-arm checks fail.
    "FRAME_CLASS": 1,
    "FS_THR_ENABLE": 0,
    **{
        f"COMPASS_OFS{n}_{axis}": value for n in ("", "2", "3") for axis, value in zip("XYZ", (5, 13, -18), strict=True)
    },
    **{f"INS_ACC{n}OFFS_{axis}": 0.001 for n in ("", "2") for axis in "XYZ"},
    **{f"INS_ACC{n}SCAL_{axis}": 1.001 for n in ("", "2") for axis in "XYZ"},
    "BATT_MONITOR": 4,
    # Measured: it hovers at a quarter of a percent a second on its default pack of 3.3 Ah; a site file's energy model
    # must fit its vehicle, so the pack is made to fit the Mavic 3 of the tests.
    "BATT_CAPACITY": 25000,
    "SIM_BATT_CAP_AH": 25,
}
PX4_ENVIRONMENT = {
    "PX4_SIM_MODEL": "sihsim_quadx",
    "PX4_PARAM_SDLOG_BACKEND": "0",
    # Its battery drains linearly in time: this many seconds from full to empty.
    "PX4_PARAM_SIM_BAT_DRAIN": "3000",
}


@dataclass(frozen=True)
class RealVehicle:
    """A running autopilot."""

    process: subprocess.Popen[bytes]

    def suspend(self) -> None:
        """Fall silent, as a vehicle whose link is gone for good."""
        os.killpg(self.process.pid, signal.SIGSTOP)


@contextmanager
def copters(
    binary: Path, work: Path, pads: Mapping[str, Pad], frame: LocalFrame, speedup: float
) -> Iterator[dict[str, RealVehicle]]:
    """ArduPilot copters on the pads; vehicle number i has system i + 1 and sends to UDP port 16000 + i."""
    work.mkdir(parents=True)
    parameters = work / "copter.parm"
    parameters.write_text("".join(f"{name} {value}\n" for name, value in COPTER_PARAMETERS.items()))
    with _running() as running:
        for number, (name, pad) in enumerate(pads.items()):
            lat_deg, lon_deg = frame.to_wgs84_deg(pad.east_m, pad.north_m)
            running[name] = _start(
                [
                    str(binary), "-I", str(number), "--model", "quad", "--speedup", f"{speedup:g}",
                    "--home", f"{lat_deg:.7f},{lon_deg:.7f},{pad.alt_m},0", "--sysid", str(number + 1),
                    "--serial0", f"udpclient:127.0.0.1:{16000 + number}", "--defaults", str(parameters),
                ],
                work / name,
                {},
            )  # fmt: skip
        yield running


@contextmanager
def px4s(
    binary: Path, work: Path, pads: Mapping[str, Pad], frame: LocalFrame, speedup: float
) -> Iterator[dict[str, RealVehicle]]:
    """PX4 quadrotors on the pads; vehicle number i has system i + 1 and sends to UDP port 14540 + i."""
    with _running() as running:
        for number, (name, pad) in enumerate(pads.items()):
            lat_deg, lon_deg = frame.to_wgs84_deg(pad.east_m, pad.north_m)
            place = {"PX4_HOME_LAT": f"{lat_deg:.7f}", "PX4_HOME_LON": f"{lon_deg:.7f}", "PX4_HOME_ALT": str(pad.alt_m)}
            speed = {"PX4_SIM_SPEED_FACTOR": f"{speedup:g}"}
            running[name] = _start([str(binary), "-i", str(number)], work / name, PX4_ENVIRONMENT | place | speed)
        yield running


@contextmanager
def _running() -> Iterator[dict[str, RealVehicle]]:
    running: dict[str, RealVehicle] = {}
    try:
        yield running
    finally:
        for vehicle in running.values():
            os.killpg(vehicle.process.pid, signal.SIGCONT)
            os.killpg(vehicle.process.pid, signal.SIGKILL)
            vehicle.process.wait()


def _start(command: list[str], folder: Path, environment: Mapping[str, str]) -> RealVehicle:
    folder.mkdir(parents=True)
    with (folder / "out.txt").open("wb") as output:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    return RealVehicle(process)
