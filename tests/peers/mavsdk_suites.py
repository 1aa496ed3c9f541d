"""What MAVSDK's client plugins can do with a simulated vehicle, case by case, and the table that says so.

`python -m tests.peers.mavsdk_suites [SUITE ...]` tries every case and writes docs/results/mavsdk.md.
"""

from __future__ import annotations

import asyncio
import math
import os
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from mavsdk.asyncio import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.ftp import FtpAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.asyncio.system import System
from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.failure import FailureType, FailureUnit
from mavsdk.plugins.geofence import Circle, FenceType, GeofenceData, Point, Polygon

from simulator.testing import FleetVehicle, VehicleState, fleet

PAGE = Path(__file__).parents[2] / "docs" / "results" / "mavsdk.md"
AUTOPILOTS = ("px4", "ardupilot")
NOTE = "".join(f"line {number} of a note\n" for number in range(400))
PATIENCE_S = 20.0
"""Real seconds; MAVSDK itself gives up earlier."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One vehicle, and MAVSDK's end of it."""

    system: System
    vehicle: FleetVehicle

    @property
    def truth(self) -> VehicleState:
        return self.vehicle.truth

    @property
    def px4(self) -> bool:
        return "COM_DL_LOSS_T" in self.truth.parameters


@asynccontextmanager
async def connected(autopilot: str) -> AsyncIterator[Setting]:
    with fleet(autopilot=autopilot) as living:
        async with Mavsdk(Configuration.create_manual(255, 190, True)) as mavsdk:
            await mavsdk.add_any_connection(living[0].connection)
            system = await mavsdk.first_autopilot(timeout_s=4 * PATIENCE_S)
            assert system is not None
            yield Setting(system, living[0])


async def until(is_so: Callable[[], bool]) -> None:
    while not is_so():  # noqa: ASYNC110 - nobody tells when
        await asyncio.sleep(0.1)


async def arm(at: Setting) -> None:
    await ActionAsync(at.system).arm()
    await until(lambda: at.truth.armed)


async def disarm(at: Setting) -> None:
    await arm(at)
    await ActionAsync(at.system).disarm()
    await until(lambda: not at.truth.armed)


async def take_off(at: Setting) -> None:
    await arm(at)
    await ActionAsync(at.system).takeoff()
    await until(lambda: at.truth.up_m > 1.0)


async def hold(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).hold()


async def go_home(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).return_to_launch()
    await until(lambda: at.truth.mode in {"RETURN", "RTL"})


async def land(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).land()
    await until(lambda: at.truth.mode == "LAND")


async def kill(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).kill()
    await until(lambda: not at.truth.armed)


async def go_to(at: Setting) -> None:
    await take_off(at)
    here = at.truth
    await ActionAsync(at.system).goto_location(here.lat_deg + 0.001, here.lon_deg, 500.0, math.nan)


async def orbit(at: Setting) -> None:
    from mavsdk.plugins.action import OrbitYawBehavior

    await take_off(at)
    here = at.truth
    yaw = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    await ActionAsync(at.system).do_orbit(20.0, 3.0, yaw, here.lat_deg, here.lon_deg, 500.0)


async def reboot(at: Setting) -> None:
    await ActionAsync(at.system).reboot()


async def change_speed(at: Setting) -> None:
    await ActionAsync(at.system).set_current_speed(4.0)


async def set_return_height(at: Setting) -> None:
    await ActionAsync(at.system).set_return_to_launch_altitude(42.0)
    assert 42.0 in {at.truth.parameters.get("RTL_RETURN_ALT"), at.truth.parameters.get("RTL_ALT", 0.0) / 100}


def name_int(at: Setting) -> str:
    return "COM_DL_LOSS_T" if at.px4 else "RTL_ALT"


def name_float(at: Setting) -> str:
    return "RTL_RETURN_ALT" if at.px4 else "FS_GCS_TIMEOUT"


async def read_int(at: Setting) -> None:
    name = name_int(at)
    assert await ParamAsync(at.system).get_param_int(name) == at.truth.parameters[name]


async def set_int(at: Setting) -> None:
    name = name_int(at)
    await ParamAsync(at.system).set_param_int(name, 17)
    assert at.truth.parameters[name] == 17


async def read_float(at: Setting) -> None:
    name = name_float(at)
    assert await ParamAsync(at.system).get_param_float(name) == at.truth.parameters[name]


async def set_float(at: Setting) -> None:
    name = name_float(at)
    await ParamAsync(at.system).set_param_float(name, 33.5)
    assert at.truth.parameters[name] == 33.5


async def list_parameters(at: Setting) -> None:
    found = await ParamAsync(at.system).get_all_params()
    named = {one.name: one.value for one in (*found.int_params, *found.float_params)}
    assert named.keys() == at.truth.parameters.keys()


async def refuse_unknown(at: Setting) -> None:
    try:
        await ParamAsync(at.system).get_param_float("NO_SUCH_ONE")
    except MavsdkError:
        return
    raise AssertionError("it has an answer")


def _corners(at: Setting) -> list[Point]:
    here = at.truth
    return [Point(here.lat_deg + north, here.lon_deg + east) for north, east in ((1, -1), (1, 1), (-1, 1), (-1, -1))]


async def upload_polygon(at: Setting) -> None:
    await GeofenceAsync(at.system).upload_geofence(GeofenceData([Polygon(_corners(at), FenceType.INCLUSION)], []))
    assert len(at.vehicle.simulated.autopilot.store.fence) == 4


async def upload_circle(at: Setting) -> None:
    circle = Circle(_corners(at)[0], 30.0, FenceType.EXCLUSION)
    await GeofenceAsync(at.system).upload_geofence(GeofenceData([], [circle]))
    assert len(at.vehicle.simulated.autopilot.store.fence) == 1


async def download_fence(at: Setting) -> None:
    await upload_polygon(at)
    [back] = (await GeofenceAsync(at.system).download_geofence()).polygons
    assert len(back.points) == 4


async def clear_fence(at: Setting) -> None:
    await upload_polygon(at)
    await GeofenceAsync(at.system).clear_geofence()
    assert not at.vehicle.simulated.autopilot.store.fence


def hear(what: str, rate: str = "") -> Callable[[Setting], Awaitable[None]]:
    """Return a case: one update of a telemetry stream, asked for where a rate can be set."""

    async def case(at: Setting) -> None:
        telemetry = TelemetryAsync(at.system)
        if rate:
            await getattr(telemetry, f"set_rate_{rate}")(4.0)
        stream = getattr(telemetry, f"subscribe_{what}")()
        try:
            await anext(stream)
        finally:
            await stream.aclose()

    return case


async def hear_text(at: Setting) -> None:
    arming = asyncio.create_task(ActionAsync(at.system).arm())
    await hear("status_text")(at)
    await arming


async def list_files(at: Setting) -> None:
    await FtpAsync(at.system).list_directory("/")


async def upload_file(at: Setting) -> None:
    with TemporaryDirectory() as folder:
        (path := Path(folder) / "note.txt").write_text(NOTE, encoding="ascii")
        async for _ in FtpAsync(at.system).upload(str(path), "/"):
            pass


async def download_file(at: Setting) -> None:
    await upload_file(at)
    with TemporaryDirectory() as folder:
        async for _ in FtpAsync(at.system).download("/note.txt", folder, False):
            pass
        assert (Path(folder) / "note.txt").read_text(encoding="ascii") == NOTE


async def download_in_bursts(at: Setting) -> None:
    await upload_file(at)
    with TemporaryDirectory() as folder:
        async for _ in FtpAsync(at.system).download("/note.txt", folder, True):
            pass
        assert (Path(folder) / "note.txt").read_text(encoding="ascii") == NOTE


async def remove_file(at: Setting) -> None:
    await upload_file(at)
    await FtpAsync(at.system).rename("/note.txt", "/other.txt")
    await FtpAsync(at.system).remove_file("/other.txt")


async def compare_file(at: Setting) -> None:
    with TemporaryDirectory() as folder:
        (path := Path(folder) / "note.txt").write_text(NOTE, encoding="ascii")
        async for _ in FtpAsync(at.system).upload(str(path), "/"):
            pass
        assert await FtpAsync(at.system).are_files_identical(str(path), "/note.txt")


async def make_folder(at: Setting) -> None:
    await FtpAsync(at.system).create_directory("/folder")
    await FtpAsync(at.system).remove_directory("/folder")


def fail(unit: FailureUnit) -> Callable[[Setting], Awaitable[None]]:
    async def case(at: Setting) -> None:
        await FailureAsync(at.system).inject(unit, FailureType.OFF, 0)

    return case


SUITES: Mapping[str, Mapping[str, Callable[[Setting], Awaitable[None]]]] = {
    "action": {
        "arm": arm, "disarm": disarm, "take off": take_off, "hold": hold, "return": go_home, "land": land, "kill": kill,
        "go to a place": go_to, "orbit": orbit, "reboot": reboot, "set the speed": change_speed,
        "set the return height": set_return_height,
    },
    "param": {
        "read an integer": read_int, "set an integer": set_int, "read a float": read_float, "set a float": set_float,
        "list all": list_parameters, "no answer for an unknown one": refuse_unknown,
    },
    "geofence": {
        "upload a polygon": upload_polygon, "upload a circle": upload_circle, "download": download_fence,
        "clear": clear_fence,
    },
    "telemetry": {
        "position": hear("position", "position"), "home": hear("home", "home"), "in air": hear("in_air", "in_air"),
        "landed state": hear("landed_state", "landed_state"), "armed": hear("armed"),
        "attitude": hear("attitude_euler", "attitude_euler"), "velocity": hear("velocity_ned", "velocity_ned"),
        "GPS": hear("gps_info", "gps_info"), "raw GPS": hear("raw_gps", "gps_info"),
        "battery": hear("battery", "battery"), "flight mode": hear("flight_mode"),
        "health": hear("health", "health"), "remote control": hear("rc_status"),
        "text": hear_text, "actuator outputs": hear("actuator_output_status", "actuator_output_status"),
        "odometry": hear("odometry", "odometry"), "ground truth": hear("ground_truth", "ground_truth"),
        "IMU": hear("imu", "imu"), "time of day": hear("unix_epoch_time", "unix_epoch_time"),
        "pressure": hear("scaled_pressure"), "heading": hear("heading", "position"),
        "altitude": hear("altitude", "altitude"), "wind": hear("wind"),
    },
    "ftp": {
        "list a folder": list_files, "upload a file": upload_file, "download a file": download_file,
        "download in bursts": download_in_bursts, "rename and remove a file": remove_file,
        "compare a file": compare_file, "make and remove a folder": make_folder,
    },
    "failure": {"GPS off": fail(FailureUnit.SENSOR_GPS), "motor off": fail(FailureUnit.SYSTEM_MOTOR)},
}  # fmt: skip


async def is_passed(autopilot: str, case: Callable[[Setting], Awaitable[None]], patience_s: float = PATIENCE_S) -> bool:
    """Return whether a case passes, with a vehicle and a MAVSDK of its own."""
    async with connected(autopilot) as at:
        try:
            async with asyncio.timeout(patience_s):
                await case(at)
        except (MavsdkError, TimeoutError, AssertionError, ValueError):
            return False
    return True


def read_passed(autopilot: str) -> list[tuple[str, str]]:
    """Return what the published table says that passes: suites and cases."""
    rows = [line.strip("| ").split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines() if " | " in line]
    left_out = {row[0]: row[4].split(", ") for row in rows if row[1] == autopilot}
    return [(suite, name) for suite in SUITES for name in SUITES[suite] if name not in left_out[suite]]


async def main(only: Sequence[str]) -> None:
    """Try every case of these suites, or of all, and write the page."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    for suite in only or SUITES:
        for autopilot in AUTOPILOTS:
            cases = SUITES[suite]
            failed = [name for name, case in cases.items() if not await is_passed(autopilot, case)]
            passed = len(cases) - len(failed)
            row = f"| {suite} | {autopilot} | {len(cases)} | {passed} | {', '.join(failed) or 'nothing'} |"
            print(row, flush=True)
            lines = [row if line.startswith(f"| {suite} | {autopilot} |") else line for line in lines]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    asyncio.new_event_loop().run_until_complete(main(sys.argv[1:]))
    os._exit(0)  # MAVSDK's questions about files have no end where nobody answers
