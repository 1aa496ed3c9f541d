"""Real autopilots in software in the loop: started on free ports for a flight, and stopped with it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType

import pytest
from pymavlink.dialects.v20 import common as mav

from missions import LocalFrame, Pad, dialect_for
from tests.sitl.relay import Relay
from tests.sitl.station import OtherLink

COPTER_PARAMETERS: Mapping[str, float] = {
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
MODEL = "model.json"
"""Of a simulated frame, beside its binary's other files: ArduPilot reads no absolute paths."""
RELAYED = 1000
"""How far above its own port a vehicle with a relay is heard."""
EARLY = ("SDLOG_", "TRIG_")
START_REAL_S = 60.0

Started = tuple[subprocess.Popen[bytes], OtherLink]
"""A running process, and another link to it."""


@dataclass(frozen=True)
class Autopilot:
    """One of the two, as the tests start it."""

    name: str
    variable: str
    """Of the environment: where its binary is."""
    port: int
    """The first vehicle sends to this one, the next to the next."""

    @property
    def binary(self) -> str | None:
        """Its binary, if there is one."""
        return os.environ.get(self.variable)

    @property
    def signs(self) -> bool:
        """Whether it can sign: PX4 from 1.18 on, of which FAULTLINE_PX4_SIGNS tells."""
        return self.name == "ardupilot" or bool(os.environ.get("FAULTLINE_PX4_SIGNS"))


ARDUPILOT = Autopilot("ardupilot", "FAULTLINE_ARDUCOPTER", 16000)
PX4 = Autopilot("px4", "FAULTLINE_PX4", 14540)
BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
NO_FAILSAFE: Mapping[Autopilot, Mapping[str, float]] = {ARDUPILOT: {"FS_GCS_ENABLE": 0.0}, PX4: {"NAV_DLL_ACT": 0.0}}
"""They fly on unseen."""
SOON_HOME: Mapping[Autopilot, Mapping[str, float]] = {
    ARDUPILOT: {"FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 8.0},
    PX4: {"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 8.0, "COM_FAIL_ACT_T": 1.0},
}
"""Their patience is eight seconds, then they come home."""


class RealVehicle:
    """A running autopilot."""

    def __init__(self, sysid: int, start: Callable[[Pad | None], Started], relay: Relay | None) -> None:
        """Start it."""
        self.sysid, self.relay = sysid, relay
        self._start = start
        self.process, self.other = start(None)

    def end(self) -> None:
        """Take its power away."""
        _end(self.process)
        self.other.close()

    def begin_again(self, at: Pad | None = None) -> None:
        """Give it power again: with a full pack, on its first pad or another, with the parameters that it keeps."""
        self.process, self.other = self._start(at)

    def suspend(self) -> None:
        """Fall silent, as a vehicle whose link is gone for good."""
        os.killpg(self.process.pid, signal.SIGSTOP)

    def cut(self) -> None:
        """Cut its link; it flies on."""
        self.relayed.cut = True

    def join(self) -> None:
        """Bring its link back."""
        self.relayed.cut = False

    def set(self, name: str, value: float, patience_s: float = 5.0) -> None:
        """Set a parameter beside the link that it is flown over."""
        self.other.set(self.sysid, name, value, patience_s)

    def switch(self, main: int, sub: int = 0) -> None:
        """Switch its mode as another ground station does."""
        order = mav.MAVLink_command_long_message(self.sysid, 1, mav.MAV_CMD_DO_SET_MODE, 0, 1, main, sub, 0, 0, 0, 0)
        self.other.say(order)

    def turn(self, pwm: int) -> None:
        """Turn ArduPilot's mode switch, channel 5 of the remote control, which it takes from its own station only."""
        free = 65535
        channels = [free, free, free, free, pwm, free, free, free]
        self.other.say(mav.MAVLink_rc_channels_override_message(self.sysid, 1, *channels), system=255)

    def push(self, forward: int) -> None:
        """Hold one of PX4's sticks, from -1000 to 1000; 0 is its middle."""
        self.other.say(mav.MAVLink_manual_control_message(self.sysid, forward, 0, 500, 0, 0))

    @property
    def relayed(self) -> Relay:
        """Its relay."""
        assert self.relay is not None, "this vehicle has no relay"
        return self.relay


@dataclass(frozen=True)
class Wanted:
    """Which vehicles are started, and how."""

    pads: Mapping[str, Pad]
    """Where they stand, by their names."""
    frame: LocalFrame
    speedup: float
    settings: Mapping[str, float]
    """Parameters of all of them."""
    relayed: frozenset[str]
    """Whose link can be cut: they are heard `RELAYED` above their own port."""
    own: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: MappingProxyType({}))
    """Parameters of single vehicles, by their names."""
    packs_ah: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """What ArduPilot's packs really hold; the voltage of the others stays that of full ones."""
    numbers: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """System numbers of ArduPilot's vehicles that are not those of their places."""


@contextmanager
def running(autopilot: Autopilot, binary: Path, work: Path, wanted: Wanted) -> Iterator[dict[str, RealVehicle]]:
    """Start vehicles on their pads; number i, from 0, has system i + 1 and sends to UDP port `autopilot.port` + i."""
    work.mkdir(parents=True)
    start = _copter if autopilot is ARDUPILOT else _px4
    with ExitStack() as stack:
        vehicles: dict[str, RealVehicle] = {}
        for number, (name, pad) in enumerate(wanted.pads.items()):
            relay = None
            if name in wanted.relayed:
                port = autopilot.port + number
                relay = stack.enter_context(Relay(port, port + RELAYED).running())
            beginning = partial(_begin, start, str(binary), number, pad, wanted, work / name)
            vehicles[name] = RealVehicle(number + 1, beginning, relay)
            stack.callback(vehicles[name].end)
        if autopilot is PX4:
            # Its start script has figures of its own, so these are set once it has run.
            for name, vehicle in vehicles.items():
                for parameter, value in {**wanted.settings, **wanted.own.get(name, {})}.items():
                    vehicle.set(parameter, value, START_REAL_S)
        yield vehicles


def _begin(
    start: Callable[[str, int, Pad, Wanted, Path], Started], binary: str, number: int, pad: Pad, wanted: Wanted,
    folder: Path, at: Pad | None,
) -> Started:  # fmt: skip
    return start(binary, number, at or pad, wanted, folder)


def _copter(binary: str, number: int, pad: Pad, wanted: Wanted, folder: Path) -> Started:
    parameters, own = folder.with_suffix(".parm"), wanted.own.get(folder.name, {})
    settings = {**COPTER_PARAMETERS, **wanted.settings, **own}
    # Copter ignores names that it does not have: the other one is a newer firmware's.
    for name, other in dialect_for(ARDUPILOT.name).other_names.items():
        if name in settings:
            settings[other.name] = settings[name] * other.unit
    parameters.write_text("".join(f"{name} {value}\n" for name, value in settings.items()))
    lat_deg, lon_deg = wanted.frame.to_wgs84_deg(pad.east_m, pad.north_m)
    model = "quad"
    if folder.name in wanted.packs_ah:
        folder.mkdir(exist_ok=True)
        (folder / MODEL).write_text(json.dumps({"battCapacityAh": wanted.packs_ah[folder.name], "maxVoltage": 12.6}))
        model = f"quad:{MODEL}"
    command = [
        binary, "-I", str(number), "--model", model, "--speedup", f"{wanted.speedup:g}",
        "--home", f"{lat_deg:.7f},{lon_deg:.7f},{pad.alt_m},0",
        "--sysid", str(wanted.numbers.get(folder.name, number + 1)),
        "--serial0", f"udpclient:127.0.0.1:{ARDUPILOT.port + number}", "--defaults", str(parameters),
    ]  # fmt: skip
    return _start(command, folder, {}), OtherLink(socket.SOCK_STREAM, 5762 + 10 * number, bytewise=False)


def px4_command(binary: str, number: int, folder: Path) -> list[str]:
    """Return how an instance of PX4 is started: one that was built keeps its files in a folder, and has no shell.

    Its shell would ask again and again where there is no terminal, and its files would be those of every flight.
    """
    etc = Path(binary).resolve().parent.parent / "etc"
    return [binary, "-i", str(number), *(("-d", "-w", str(folder), str(etc)) if etc.is_dir() else ())]


def _px4(binary: str, number: int, pad: Pad, wanted: Wanted, folder: Path) -> Started:
    lat_deg, lon_deg = wanted.frame.to_wgs84_deg(pad.east_m, pad.north_m)
    place = {"PX4_HOME_LAT": f"{lat_deg:.7f}", "PX4_HOME_LON": f"{lon_deg:.7f}", "PX4_HOME_ALT": str(pad.alt_m)}
    speed = {"PX4_SIM_SPEED_FACTOR": f"{wanted.speedup:g}"}
    # Whether it keeps a log of its own, and triggers cameras, is decided while it starts.
    early = {f"PX4_PARAM_{name}": f"{value:g}" for name, value in wanted.settings.items() if name.startswith(EARLY)}
    process = _start(px4_command(binary, number, folder), folder, {**PX4_ENVIRONMENT, **place, **speed, **early})
    return process, OtherLink(socket.SOCK_DGRAM, 18570 + number, bytewise=True)


def _start(command: list[str], folder: Path, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    folder.mkdir(exist_ok=True)
    with (folder / "out.txt").open("ab") as output:
        return subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )


def _end(process: subprocess.Popen[bytes]) -> None:
    os.killpg(process.pid, signal.SIGCONT)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
