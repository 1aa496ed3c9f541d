"""Real autopilots for a dialogue, started where the simulated ones stand and apart from other flights' ports."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.dialogues.wires import UdpWire
from tests.simulator.harness import ALT_M, LAT_DEG, LON_DEG
from tests.sitl.real import COPTER_PARAMETERS, PX4_ENVIRONMENT, px4_command

INSTANCE = 6
SPEEDUP = {"ardupilot": 4.0, "px4": 3.0}
PORTS = {"ardupilot": 16000, "px4": 14540}
VARIABLES = {"ardupilot": "FAULTLINE_ARDUCOPTER", "px4": "FAULTLINE_PX4"}


def binary(autopilot: str) -> str | None:
    """Return the simulator that the environment names."""
    return os.environ.get(VARIABLES[autopilot])


@contextmanager
def real(autopilot: str, work: Path, instance: int = INSTANCE) -> Iterator[UdpWire]:
    """Start an autopilot and open the way to it."""
    program, speedup = binary(autopilot), SPEEDUP[autopilot]
    assert program is not None
    wire = UdpWire(PORTS[autopilot] + instance, instance + 1, speedup)
    try:
        if autopilot == "px4":
            place = {"PX4_HOME_LAT": f"{LAT_DEG}", "PX4_HOME_LON": f"{LON_DEG}", "PX4_HOME_ALT": f"{ALT_M}"}
            environment = PX4_ENVIRONMENT | place | {"PX4_SIM_SPEED_FACTOR": f"{speedup:g}"}
            process = _start(px4_command(program, instance, work), work, environment)
        else:
            parameters = work / "copter.parm"
            parameters.write_text("".join(f"{name} {value}\n" for name, value in COPTER_PARAMETERS.items()))
            process = _start([
                program, "-I", str(instance), "--model", "quad", "--speedup", f"{speedup:g}",
                "--home", f"{LAT_DEG},{LON_DEG},{ALT_M},0", "--sysid", str(instance + 1),
                "--serial0", f"udpclient:127.0.0.1:{PORTS[autopilot] + instance}", "--defaults", str(parameters),
            ], work, {})  # fmt: skip
        try:
            yield wire
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    finally:
        wire.close()


def _start(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    with (folder / "out.txt").open("wb") as output:
        return subprocess.Popen(
            command, cwd=folder, env={**os.environ, **environment}, stdin=subprocess.DEVNULL, stdout=output,
            stderr=output, start_new_session=True,
        )  # fmt: skip
