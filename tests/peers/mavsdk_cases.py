"""What MAVSDK's client plugins can do with a vehicle."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

from mavsdk.asyncio import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.ftp import FtpAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.asyncio.system import System
from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.action import OrbitYawBehavior
from mavsdk.plugins.failure import FailureType, FailureUnit
from mavsdk.plugins.geofence import Circle, FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission import MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.offboard import PositionNedYaw, VelocityNedYaw
from pymavlink.dialects.v20 import common as mav

from simulator.testing import VehicleState
from tests.peers.judging import NORTH_DEG, PAD_ALT_M, PLACE_DEG, Subject, Suite

LISTED_S = 60.0
CORNERS_DEG = [(NORTH_DEG * north, NORTH_DEG * east) for north, east in ((1, -1), (1, 1), (-1, 1), (-1, -1))]


@dataclass(frozen=True, slots=True)
class Setting:
    """One vehicle, and MAVSDK's end of it."""

    system: System
    subject: Subject


@asynccontextmanager
async def connected(subject: Subject) -> AsyncIterator[Setting]:
    async with Mavsdk(Configuration.create_manual(255, 190, True)) as mavsdk:
        await mavsdk.add_any_connection(subject.connection)
        system = await mavsdk.first_autopilot(timeout_s=LISTED_S)
        assert system is not None
        yield Setting(system, subject)


async def arm(at: Setting) -> None:
    await ActionAsync(at.system).arm()
    await at.subject.until(lambda now: now.armed)


async def disarm(at: Setting) -> None:
    await arm(at)
    await ActionAsync(at.system).disarm()
    await at.subject.until(lambda now: not now.armed)


async def take_off(at: Setting) -> None:
    await arm(at)
    await ActionAsync(at.system).takeoff()
    telemetry = TelemetryAsync(at.system)
    await telemetry.set_rate_in_air(4.0)
    async for is_up in telemetry.subscribe_in_air():
        if is_up:
            break
    await at.subject.until(lambda now: now.up_m > 1.0)


async def hold(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).hold()


async def go_home(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).return_to_launch()
    await at.subject.until(lambda now: now.mode in {"RETURN", "RTL"})


async def land(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).land()
    await at.subject.until(lambda now: now.mode == "LAND")


async def kill(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).kill()
    await at.subject.until(lambda now: not now.armed)


def is_under_way(now: VehicleState) -> bool:
    """Return whether a vehicle has left the place over its pad."""
    return math.hypot(now.lat_deg - PLACE_DEG[0], now.lon_deg - PLACE_DEG[1]) > NORTH_DEG / 10


async def go_to(at: Setting) -> None:
    await take_off(at)
    await ActionAsync(at.system).goto_location(PLACE_DEG[0] + NORTH_DEG, PLACE_DEG[1], PAD_ALT_M + 12.0, math.nan)
    await at.subject.until(is_under_way)


async def orbit(at: Setting) -> None:
    await take_off(at)
    yaw = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    await ActionAsync(at.system).do_orbit(20.0, 3.0, yaw, *PLACE_DEG, PAD_ALT_M + 12.0)
    await at.subject.until(is_under_way)


async def reboot(at: Setting) -> None:
    await ActionAsync(at.system).reboot()


async def change_speed(at: Setting) -> None:
    await ActionAsync(at.system).set_current_speed(4.0)


async def set_return_height(at: Setting) -> None:
    await ActionAsync(at.system).set_return_to_launch_altitude(42.0)
    at.subject.prove(
        lambda now: 42.0 in {now.parameters.get("RTL_RETURN_ALT"), now.parameters.get("RTL_ALT", 0.0) / 100}
    )


def name_int(at: Setting) -> str:
    return "COM_DL_LOSS_T" if at.subject.px4 else "RTL_ALT"


def name_float(at: Setting) -> str:
    return "RTL_RETURN_ALT" if at.subject.px4 else "FS_GCS_TIMEOUT"


async def read_int(at: Setting) -> None:
    value = await ParamAsync(at.system).get_param_int(name := name_int(at))
    at.subject.prove(lambda now: now.parameters[name] == value)


async def set_int(at: Setting) -> None:
    await ParamAsync(at.system).set_param_int(name := name_int(at), 17)
    at.subject.prove(lambda now: now.parameters[name] == 17)


async def read_float(at: Setting) -> None:
    value = await ParamAsync(at.system).get_param_float(name := name_float(at))
    at.subject.prove(lambda now: now.parameters[name] == value)


async def set_float(at: Setting) -> None:
    await ParamAsync(at.system).set_param_float(name := name_float(at), 33.5)
    at.subject.prove(lambda now: now.parameters[name] == 33.5)


async def list_parameters(at: Setting) -> None:
    found = await ParamAsync(at.system).get_all_params()
    names = {one.name for one in (*found.int_params, *found.float_params)}
    assert names
    at.subject.prove(lambda now: now.parameters.keys() == names)


async def refuse_unknown(at: Setting) -> None:
    try:
        await ParamAsync(at.system).get_param_float("NO_SUCH_ONE")
    except MavsdkError:
        return
    raise AssertionError("it has an answer")


def _corners() -> list[Point]:
    return [Point(PLACE_DEG[0] + north, PLACE_DEG[1] + east) for north, east in CORNERS_DEG]


async def upload_polygon(at: Setting) -> None:
    await GeofenceAsync(at.system).upload_geofence(GeofenceData([Polygon(_corners(), FenceType.INCLUSION)], []))
    await at.subject.until_stored(fence=4)


async def upload_circle(at: Setting) -> None:
    circle = Circle(_corners()[0], 30.0, FenceType.EXCLUSION)
    await GeofenceAsync(at.system).upload_geofence(GeofenceData([], [circle]))
    await at.subject.until_stored(fence=1)


async def download_fence(at: Setting) -> None:
    await upload_polygon(at)
    [back] = (await GeofenceAsync(at.system).download_geofence()).polygons
    assert len(back.points) == 4


async def clear_fence(at: Setting) -> None:
    await upload_polygon(at)
    await GeofenceAsync(at.system).clear_geofence()
    await at.subject.until_stored(fence=0)


def _plan() -> MissionPlan:
    nothing = math.nan
    return MissionPlan([
        MissionItem(
            PLACE_DEG[0] + north, PLACE_DEG[1] + east, 12.0, 4.0, True, nothing, nothing,
            MissionItem.CameraAction.NONE, nothing, nothing, nothing, nothing, nothing, MissionItem.VehicleAction.NONE,
        )
        for north, east in CORNERS_DEG
    ])  # fmt: skip


async def upload_plan(at: Setting) -> None:
    await MissionAsync(at.system).upload_mission(_plan())
    at.subject.prove(lambda now: len(now.mission) >= len(CORNERS_DEG))


async def download_plan(at: Setting) -> None:
    await upload_plan(at)
    back = await MissionAsync(at.system).download_mission()
    assert [round(item.relative_altitude_m) for item in back.mission_items] == [12] * len(CORNERS_DEG)


async def clear_plan(at: Setting) -> None:
    await upload_plan(at)
    await MissionAsync(at.system).clear_mission()
    at.subject.prove(lambda now: len(now.mission) <= 1)  # ArduPilot's home stays


async def start_plan(at: Setting) -> None:
    await upload_raw(at)
    await arm(at)
    await MissionAsync(at.system).start_mission()
    await at.subject.until(lambda now: now.up_m > 1.0)


async def pause_plan(at: Setting) -> None:
    await start_plan(at)
    await MissionAsync(at.system).pause_mission()
    await at.subject.until(lambda now: now.mode in {"LOITER", "BRAKE"})


async def choose_plan_item(at: Setting) -> None:
    await upload_plan(at)
    await MissionAsync(at.system).set_current_mission_item(2)


async def hear_plan_progress(at: Setting) -> None:
    await upload_plan(at)
    async for progress in MissionAsync(at.system).subscribe_mission_progress():
        if progress.total == len(CORNERS_DEG):
            break


def _raw(first_command: int = mav.MAV_CMD_NAV_TAKEOFF, kind: int = 0) -> list[RawItem]:
    """Return waypoints, or what else has places, in the order of the autopilot's own list."""
    commands = [first_command, *[mav.MAV_CMD_NAV_WAYPOINT] * 3] if kind == 0 else [first_command] * 2
    return [
        RawItem(
            seq, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT if kind == 0 else mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, command,
            int(kind == 0 and seq == 0), 1, 0.0, 0.0, 0.0, math.nan, round((PLACE_DEG[0] + north) * 1e7),
            round((PLACE_DEG[1] + east) * 1e7), 12.0, kind,
        )
        for seq, (command, (north, east)) in enumerate(zip(commands, CORNERS_DEG, strict=False))
    ]  # fmt: skip


def _own(at: Setting) -> list[RawItem]:
    """Return a mission as the autopilot lists it: ArduPilot's first item is its home."""
    items = _raw()
    if at.subject.px4:
        return items
    home = _raw(mav.MAV_CMD_NAV_WAYPOINT)[0]
    return [home, *(replace_number(item, number) for number, item in enumerate(items, start=1))]


def replace_number(item: RawItem, number: int) -> RawItem:
    """Return an item at another place of its list."""
    item.seq, item.current = number, 0
    return item


async def upload_raw(at: Setting) -> None:
    items = _own(at)
    await MissionRawAsync(at.system).upload_mission(items)
    at.subject.prove(lambda now: len(now.mission) == len(items))


async def download_raw(at: Setting) -> None:
    await upload_raw(at)
    back = await MissionRawAsync(at.system).download_mission()
    assert [item.command for item in back] == [item.command for item in _own(at)]


async def clear_raw(at: Setting) -> None:
    await upload_raw(at)
    await MissionRawAsync(at.system).clear_mission()
    at.subject.prove(lambda now: len(now.mission) <= 1)


async def upload_raw_fence(at: Setting) -> None:
    points = _raw(mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, mav.MAV_MISSION_TYPE_FENCE)
    for point in points:
        point.param1, point.param4, point.z = 30.0, 0.0, 0.0
    raw = MissionRawAsync(at.system)
    await raw.upload_geofence(points)
    await at.subject.until_stored(fence=2)
    assert len(await raw.download_geofence()) == 2


async def upload_raw_rally(at: Setting) -> None:
    points = _raw(mav.MAV_CMD_NAV_RALLY_POINT, mav.MAV_MISSION_TYPE_RALLY)
    for point in points:
        point.param4 = 0.0
    raw = MissionRawAsync(at.system)
    await raw.upload_rally_points(points)
    await at.subject.until_stored(rally=2)
    assert len(await raw.download_rallypoints()) == 2


async def hear_raw_change(at: Setting) -> None:
    stream = MissionRawAsync(at.system).subscribe_mission_changed()
    waiting = asyncio.ensure_future(anext(stream))
    await upload_raw(at)
    await waiting


async def steer_to_place(at: Setting) -> None:
    await take_off(at)
    offboard = OffboardAsync(at.system)
    await offboard.set_position_ned(PositionNedYaw(60.0, 0.0, -12.0, 0.0))
    await offboard.start()
    await at.subject.until(is_under_way)


async def steer_by_velocity(at: Setting) -> None:
    await take_off(at)
    offboard = OffboardAsync(at.system)
    await offboard.set_velocity_ned(VelocityNedYaw(4.0, 0.0, 0.0, 0.0))
    await offboard.start()
    await at.subject.until(is_under_way)


async def stop_steering(at: Setting) -> None:
    await steer_by_velocity(at)
    await OffboardAsync(at.system).stop()
    await at.subject.until(lambda now: now.ground_speed_m_s < 1.0)


async def refuse_unfed(at: Setting) -> None:
    await take_off(at)
    try:
        await OffboardAsync(at.system).start()
    except MavsdkError:
        return
    raise AssertionError("it began without a set-point")


async def read_version(at: Setting) -> None:
    assert (await InfoAsync(at.system).get_version()).flight_sw_major > 0


async def read_identification(at: Setting) -> None:
    assert (await InfoAsync(at.system).get_identification()).hardware_uid


async def read_product(at: Setting) -> None:
    await InfoAsync(at.system).get_product()


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


NOTE = "".join(f"line {number} of a note\n" for number in range(400)).encode()


async def list_names(at: Setting) -> set[str]:
    """Return what is in the root folder."""
    return {one.name.strip("/") for one in (await FtpAsync(at.system).list_directory("/")).entries}


async def list_files(at: Setting) -> None:
    await list_names(at)


async def upload_file(at: Setting) -> None:
    (path := at.subject.folder / "note.txt").write_bytes(NOTE)
    async for _ in FtpAsync(at.system).upload(str(path), "/"):
        pass


def download_file(*, burst: bool) -> Callable[[Setting], Awaitable[None]]:
    async def case(at: Setting) -> None:
        await upload_file(at)
        (folder := at.subject.folder / "back").mkdir()
        async for _ in FtpAsync(at.system).download("/note.txt", str(folder), burst):
            pass
        assert (folder / "note.txt").read_bytes() == NOTE

    return case


async def compare_file(at: Setting) -> None:
    await upload_file(at)
    assert await FtpAsync(at.system).are_files_identical(str(at.subject.folder / "note.txt"), "/note.txt")


async def rename_file(at: Setting) -> None:
    await upload_file(at)
    await FtpAsync(at.system).rename("/note.txt", "/other.txt")
    assert "other.txt" in await list_names(at)


async def remove_file(at: Setting) -> None:
    await upload_file(at)
    await FtpAsync(at.system).remove_file("/note.txt")
    assert "note.txt" not in await list_names(at)


async def make_folder(at: Setting) -> None:
    await FtpAsync(at.system).create_directory("/folder")
    assert "folder" in await list_names(at)


async def remove_folder(at: Setting) -> None:
    await make_folder(at)
    await FtpAsync(at.system).remove_directory("/folder")


async def refuse_missing_file(at: Setting) -> None:
    try:
        async for _ in FtpAsync(at.system).download("/nothing.txt", str(at.subject.folder), False):
            pass
    except MavsdkError:
        return
    raise AssertionError("it has such a file")


def fail(unit: FailureUnit) -> Callable[[Setting], Awaitable[None]]:
    async def case(at: Setting) -> None:
        await FailureAsync(at.system).inject(unit, FailureType.OFF, 0)

    return case


CASES: Mapping[str, Mapping[str, Callable[[Setting], Awaitable[None]]]] = {
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
        "list a folder": list_files, "upload": upload_file, "download": download_file(burst=False),
        "download in bursts": download_file(burst=True), "compare": compare_file, "rename": rename_file,
        "remove": remove_file, "make a folder": make_folder, "remove a folder": remove_folder,
        "refuse a file that is not there": refuse_missing_file,
    },
    "mission": {
        "upload": upload_plan, "download": download_plan, "clear": clear_plan, "start": start_plan, "pause": pause_plan,
        "choose an item": choose_plan_item, "progress": hear_plan_progress,
    },
    "mission_raw": {
        "upload": upload_raw, "download": download_raw, "clear": clear_raw, "fence": upload_raw_fence,
        "rally points": upload_raw_rally, "a change is told": hear_raw_change,
    },
    "offboard": {
        "to a place": steer_to_place, "by velocity": steer_by_velocity, "stop": stop_steering,
        "refused without a set-point": refuse_unfed,
    },
    "info": {"version": read_version, "identification": read_identification, "product": read_product},
    "failure": {"GPS off": fail(FailureUnit.SENSOR_GPS), "motor off": fail(FailureUnit.SYSTEM_MOTOR)},
}  # fmt: skip
SUITES = {f"MAVSDK {plugin}": Suite("mavsdk", connected, cases) for plugin, cases in CASES.items()}
