"""The dialogue itself: the same steps for every autopilot; only modes and the home item follow the dialect."""

from __future__ import annotations

import itertools
import math
import struct
from dataclasses import replace
from enum import IntEnum

from missions import Dialect, MissionItem, ModeNumber
from missions.autopilots.dialect import StartStep
from tests.dialogues.acts import Act, Chapter, Download, Look, Say, Step, Until, Upload, What
from tests.simulator.harness import ALT_M, land, numbered, speed, takeoff, waypoint

KNOWN_PARAMETER = {"ardupilot": "FS_GCS_TIMEOUT", "px4": "COM_DL_LOSS_T"}
UNKNOWN_PARAMETER = "NO_SUCH_PARAM"
NO_COMMAND = 31_999
NO_MESSAGE = 60_000
NO_ITEM_COMMAND = 12_345
NO_FRAME = 99
NO_MODE = ModeNumber(99, 99)
HEIGHT_M = 15.0
CRUISE_M_S = 5.0

RETURN_TO_LAUNCH, SET_MODE, PAUSE_CONTINUE, SET_MISSION_CURRENT = 20, 176, 193, 224
MISSION_START, ARM_DISARM, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE, REQUEST_CAPABILITIES = 300, 400, 511, 512, 520

TAKE_OFF, LAND, LOITER_UNLIM, ORBIT, TURN, CHANGE_ALTITUDE, REPOSITION, INJECT_FAILURE = (
    22,
    21,
    17,
    34,
    115,
    186,
    192,
    420,
)
GYRO, MOTOR = 0, 101
"""FAILURE_UNIT."""
PLACE_ALONE, SPEED_ALONE = 0b110111111000, 0b110111000111
SET_POINT_MODES = {"ardupilot": ModeNumber(4, 4), "px4": ModeNumber(6 << 16, 6)}


class Ftp(IntEnum):
    """MAVFTP's opcodes."""

    TERMINATE = 1
    RESET = 2
    LIST = 3
    READ_ONLY = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    MAKE_FOLDER = 9
    REMOVE_FOLDER = 10
    WRITE_ONLY = 11
    TRUNCATE = 12
    RENAME = 13
    CRC32 = 14
    BURST = 15
    NONSENSE = 99


A = tuple(waypoint(*place, HEIGHT_M) for place in ((1200, 0), (1200, 600), (600, 600), (300, 600)))
B = (A[0], *(waypoint(*place, HEIGHT_M) for place in ((1400, 400), (700, 400), (200, 400))))
C = tuple(waypoint(*place, HEIGHT_M) for place in ((1100, -400), (1000, -600), (700, -700), (500, -300)))
NEAR = (waypoint(60, 0, HEIGHT_M), waypoint(60, 40, HEIGHT_M), waypoint(90, 40, HEIGHT_M), waypoint(90, -60, HEIGHT_M))
SHORT = (waypoint(40, -20, HEIGHT_M),)
PLACES = {"A": A, "B": B, "C": C, "N": NEAR, "S": SHORT}


def mission(dialect: Dialect, *flown: MissionItem, lands: bool = True) -> tuple[MissionItem, ...]:
    """Return a whole mission through these waypoints."""
    items = (takeoff(HEIGHT_M), speed(CRUISE_M_S), *flown, *((land(),) if lands else ()))
    return numbered((waypoint(0, 0, 0.0), *items) if dialect.home_item else items)


def labels() -> dict[tuple[int, int, int], str]:
    """Return what an item is called in the answers, by its command and place."""
    named = {f"{name}{number}": item for name, items in PLACES.items() for number, item in enumerate(items, start=1)}
    named |= {"takeoff": takeoff(), "speed": speed(CRUISE_M_S), "land": land()}
    return {(item.command, item.x, item.y): name for name, item in reversed(named.items())}


def order(number: int, *params: float, system: int | None = None, component: int = 1, listen_s: float = 1.0) -> Say:
    """Return a COMMAND_LONG."""
    fields = {f"param{position}": value for position, value in enumerate((*params, *(0.0,) * 7)[:7], start=1)}
    return Say("COMMAND_LONG", {"command": number, "confirmation": 0, **fields}, system, component, listen_s=listen_s)


def set_mode(mode: ModeNumber) -> Say:
    return order(SET_MODE, 1, mode.param2, mode.param3)


def count(number: int, *, other: bool = False, listen_s: float = 1.0) -> Say:
    return Say("MISSION_COUNT", {"count": number, "mission_type": 0}, other=other, listen_s=listen_s)


def clear(listen_s: float = 1.0) -> Say:
    return Say("MISSION_CLEAR_ALL", {"mission_type": 0}, listen_s=listen_s)


def request_list(*, other: bool = False) -> Say:
    return Say("MISSION_REQUEST_LIST", {"mission_type": 0}, other=other)


def set_current(seq: int) -> Say:
    return Say("MISSION_SET_CURRENT", {"seq": seq})


def parameter(name: str, index: int = -1) -> Say:
    return Say("PARAM_REQUEST_READ", {"param_id": name.encode(), "param_index": index})


def start(dialect: Dialect) -> tuple[Say, ...]:
    """Return what starts a mission on the ground."""
    orders = {
        StartStep.GUIDED: set_mode(dialect.modes.guided),
        StartStep.ARM: order(ARM_DISARM, 1),
        StartStep.MISSION_START: order(MISSION_START),
        StartStep.MISSION_MODE: set_mode(dialect.modes.mission),
    }
    return tuple(orders[step] for step in dialect.start)


def step(name: str, *acts: Act) -> Step:
    return Step(name, acts)


def questions(dialect: Dialect) -> Chapter:
    """Everything that is asked and ordered on the ground, but for missions."""
    known = KNOWN_PARAMETER[dialect.name]
    return Chapter("questions", (
        step("arm before it is ready", order(ARM_DISARM, 1)),
        step("wait until it is ready", Until(What.READY), Look()),
        step("request the version", order(REQUEST_MESSAGE, 148)),
        step("request the version the old way", order(REQUEST_CAPABILITIES, 1)),
        step("read a parameter", parameter(known)),
        step("read an unknown parameter", parameter(UNKNOWN_PARAMETER)),
        step("read a parameter beyond the last index", parameter("", 20_000)),
        step("set an unknown parameter", Say(
            "PARAM_SET", {"param_id": UNKNOWN_PARAMETER.encode(), "param_value": 1.0, "param_type": 9})),
        step("unknown command", order(NO_COMMAND)),
        step("unknown command as COMMAND_INT", Say("COMMAND_INT", {"command": NO_COMMAND, "frame": 0, "current": 0,
            "autocontinue": 0, "param1": 0.0, "param2": 0.0, "param3": 0.0, "param4": 0.0, "x": 0, "y": 0, "z": 0.0})),
        step("request an unknown message", order(REQUEST_MESSAGE, NO_MESSAGE)),
        step("set the interval of an unknown message", order(SET_MESSAGE_INTERVAL, NO_MESSAGE, 1e6)),
        step("command to another system", order(REQUEST_MESSAGE, 148, system=99)),
        step("command to another component", order(REQUEST_MESSAGE, 148, component=99)),
        step("command to every component", order(REQUEST_MESSAGE, 148, component=0)),
        step("invalid mode", set_mode(NO_MODE), Look()),
        step("invalid mode with SET_MODE", Say("SET_MODE", {"base_mode": 1, "custom_mode": 99 << 16 | 99}), Look()),
        step("heartbeat of another ground station", Say(
            "HEARTBEAT", {"type": 6, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4,
                          "mavlink_version": 3}, other=True), Look()),
        step("mission mode without a mission", set_mode(dialect.modes.mission), Look()),
        step("start without a mission", order(MISSION_START), Look()),
        step("pause on the ground", order(PAUSE_CONTINUE, 0), Look()),
        step("hold mode on the ground", set_mode(dialect.modes.hold), Look()),
        step("disarm while disarmed", order(ARM_DISARM, 0)),
        step("arm in a mode for it", set_mode(dialect.modes.guided), order(ARM_DISARM, 1), Look()),
        step("arm while armed", order(ARM_DISARM, 1)),
        step("disarm on the ground", order(ARM_DISARM, 0), Look()),
    ))  # fmt: skip


def transfers(dialect: Dialect) -> Chapter:
    """Missions on the ground."""
    a, b = mission(dialect, *A), mission(dialect, *B)
    first = 1 if dialect.home_item else 0
    bad_command = (*a[: first + 2], replace(a[first + 2], command=NO_ITEM_COMMAND), *a[first + 3 :])
    bad_frame = (*a[: first + 2], replace(a[first + 2], frame=NO_FRAME), *a[first + 3 :])
    return Chapter("transfers", (
        step("wait until it is ready", Until(What.READY), Look()),
        step("download nothing", Download()),
        step("upload", Upload("A", a, flag=dialect.flag_first), Look(2.0, download=True)),
        step("read back", Download(compare=a)),
        step("read back the old way", Download(floats=True)),
        step("ask for an item that is not there", Say(
            "MISSION_REQUEST_INT", {"seq": 99, "mission_type": 0}), Look(6.0)),
        step("identical upload", Upload("A", a, flag=dialect.flag_first), Look(2.0)),
        step("an item comes twice", Upload("B", b, instead={first + 1: (first + 1, first + 1)}),
             Look(1.0, download=True)),
        step("an item comes too early", Upload("A", a, instead={first + 1: (first + 3, first + 1)}),
             Look(1.0, download=True)),
        step("items as MISSION_ITEM", Upload("B", b, floats=True), Look(1.0, download=True)),
        step("an item with an unknown command", Upload("A", bad_command), Look(10.0, download=True)),
        step("whole again", Upload("B", b), Look(1.0, download=True)),
        step("an item with an unknown frame", Upload("A", bad_frame), Look(10.0, download=True)),
        step("whole once more", Upload("B", b), Look(1.0, download=True)),
        step("an upload without a single item", Upload("A", a, answers=0, listen_s=10.0), Look(download=True)),
        step("an upload abandoned after three items", Upload("A", a, answers=3, listen_s=12.0), Look(download=True)),
        step("an upload that interrupts an abandoned one",
             Upload("A", a, answers=3, listen_s=1.3), Upload("B", b), Look(10.0, download=True)),
        step("a download that interrupts an abandoned upload",
             Upload("A", a, answers=3, listen_s=1.3), request_list(), Look(10.0, download=True)),
        step("another ground station during an upload",
             Upload("A", a, answers=3, listen_s=1.3), count(3, other=True), request_list(other=True),
             Look(10.0, download=True)),
        step("cancelled by us", Upload("A", a, answers=3, listen_s=1.3),
             Say("MISSION_ACK", {"type": 15, "mission_type": 0}), Look(10.0, download=True)),
        step("clear during an upload", Upload("A", a, answers=3, listen_s=1.3), clear(), Look(10.0, download=True)),
        step("too many items", count(60_000), Look(10.0, download=True)),
        step("an upload during a download", request_list(), Upload("A", a), Look(10.0, download=True)),
        step("upload after all that", Upload("A", a), Look(1.0, download=True)),
        step("current by message", set_current(first + 3), Look()),
        step("current by message, out of range", set_current(99), Look()),
        step("current by command", order(SET_MISSION_CURRENT, first + 4), Look()),
        step("current by command, out of range", order(SET_MISSION_CURRENT, 99), Look()),
        step("a first upload without a flag afterwards", Upload("B", b), Look(1.0)),
        step("count 0", count(0), Look(1.0, download=True)),
        step("upload after count 0", Upload("A", a), Look(1.0)),
        step("clear", clear(), Look(1.0, download=True)),
        step("clear again", clear(), Look(1.0)),
    ))  # fmt: skip


def flight(dialect: Dialect) -> Chapter:
    """A mission in flight, and everything that may be said to it."""
    first = 1 if dialect.home_item else 0
    a, b, c = (mission(dialect, *PLACES[name]) for name in "ABC")
    modes = dialect.modes
    onward = (Upload("A", a, flag=first + 2), set_mode(modes.mission))
    return Chapter("flight", (
        step("wait until it is ready", Until(What.READY), Look()),
        step("upload", Upload("A", a, flag=dialect.flag_first), Look(2.0)),
        step("start", *start(dialect), Look(3.0)),
        step("on the first leg", Until(What.FAST, 4.0), Look()),
        step("start while it flies", order(MISSION_START), Look(3.0)),
        step("and on", Until(What.ITEM, first + 2), Until(What.FAST, 4.0), Look()),
        step("arm while it flies", order(ARM_DISARM, 1), Look()),
        step("disarm while it flies", order(ARM_DISARM, 0), Look()),
        step("invalid mode while it flies", set_mode(NO_MODE), Look()),
        step("the same list in flight", Upload("A", a, flag=dialect.flag_first), Look(4.0)),
        step("another list that begins alike, without a flag", Upload("B", b), Look(4.0, download=True)),
        step("another list with a flag", Upload("C", c, flag=first + 3), Look(4.0, download=True)),
        step("the same list with another flag", Upload("C", c, flag=first + 2), Look(4.0)),
        step("current by message in flight", set_current(first + 4), Look(3.0)),
        step("current by message in flight, out of range", set_current(99), Look(3.0)),
        step("current by command in flight", order(SET_MISSION_CURRENT, first + 3), Look(3.0)),
        step("current by command in flight, out of range", order(SET_MISSION_CURRENT, 99), Look(3.0)),
        step("current by command in flight, an item without a place",
             order(SET_MISSION_CURRENT, first + 1), Look(3.0)),
        step("pause", order(PAUSE_CONTINUE, 0), Look(8.0)),
        step("continue", order(PAUSE_CONTINUE, 1), Look(5.0)),
        step("hold mode", set_mode(modes.hold), Look(8.0)),
        step("upload while it holds", Upload("A", a, flag=first + 2), Look(3.0)),
        step("continue in mission mode", set_mode(modes.mission), Look(5.0)),
        step("an upload abandoned in flight", Upload("B", b, answers=first + 4, listen_s=12.0), Look(download=True)),
        step("onward after that", *onward, Look(4.0)),
        step("clear in flight", clear(), Look(8.0, download=True)),
        step("mission mode after the clearing", set_mode(modes.mission), Look(3.0)),
        step("onward after the clearing", *onward, Look(4.0)),
        step("count 0 in flight", count(0), Look(8.0, download=True)),
        step("onward after count 0", *onward, Look(4.0)),
        step("an item with an unknown command in flight", Upload(
            "B", (*b[: first + 2], replace(b[first + 2], command=NO_ITEM_COMMAND), *b[first + 3 :])),
            Look(4.0, download=True)),
        step("onward with a sound list", *onward, Look(4.0)),
        step("return", order(RETURN_TO_LAUNCH), Look(25.0)),
        step("upload while it returns", Upload("B", b), Look(4.0)),
        step("landing", Until(What.DISARMED, limit_s=400.0, narrate=True), Look(3.0, download=True)),
        step("upload after the flight, without a flag", Upload("A", a), Look(3.0)),
    ))  # fmt: skip


def ending(dialect: Dialect) -> Chapter:
    """A list that is shorter than where the vehicle is, and a mission that ends."""
    first = 1 if dialect.home_item else 0
    near, short = mission(dialect, *NEAR), mission(dialect, *SHORT, lands=False)
    return Chapter("ending", (
        step("wait until it is ready", Until(What.READY), Look()),
        step("upload", Upload("N", near, flag=dialect.flag_first), Look(2.0)),
        step("start", *start(dialect), Until(What.FAST, 3.0), Look()),
        step("its third waypoint", order(SET_MISSION_CURRENT, first + 4), set_current(first + 4), Look(2.0)),
        step("a list that ends before that", Upload("S", short), Look(4.0, download=True)),
        step("what follows", Until(What.STILL), Look(40.0)),
        step("mission mode again", set_mode(dialect.modes.mission), Look(5.0)),
        step("a new list after the end", Upload("N", near, flag=first + 5), set_mode(dialect.modes.mission), Look(5.0)),
        step("start it", order(MISSION_START), Look(5.0)),
        step("straight to its landing", set_current(first + 6), Look(5.0)),
        step("landing by the mission", Until(What.DISARMED, limit_s=300.0, narrate=True), Look(3.0, download=True)),
    ))  # fmt: skip


def files(dialect: Dialect) -> Chapter:
    """Files over MAVFTP."""
    numbers = itertools.count(1)

    def ask(operation: Ftp, data: bytes = b"", offset: int = 0, size: int = 0, number: int = 0) -> Say:
        head = struct.pack("<HBBBBBxI", number or next(numbers), 0, operation, size or len(data), 0, 0, offset)
        return Say("FILE_TRANSFER_PROTOCOL", {"target_network": 0, "payload": (head + data).ljust(251, b"\0")})

    note, folder = b"folder/note.txt", b"folder"
    return Chapter("files", (
        step("wait until it is ready", Until(What.READY), Look()),
        step("list a folder that is not there", ask(Ftp.LIST, b"nowhere")),
        step("make a folder", ask(Ftp.MAKE_FOLDER, folder)),
        step("make it again", ask(Ftp.MAKE_FOLDER, folder)),
        step("list an empty folder", ask(Ftp.LIST, folder)),
        step("make a file", ask(Ftp.CREATE, note)),
        step("open another one meanwhile", ask(Ftp.READ_ONLY, b"folder/other.txt")),
        step("write", ask(Ftp.WRITE, b"a note")),
        step("write behind its end", ask(Ftp.WRITE, b"more", 10)),
        step("read what is open to write", ask(Ftp.READ, size=20)),
        step("close", ask(Ftp.TERMINATE)),
        step("close again", ask(Ftp.TERMINATE)),
        step("list", ask(Ftp.LIST, folder)),
        step("list from a second entry on", ask(Ftp.LIST, folder, 3)),
        step("checksum", ask(Ftp.CRC32, note)),
        step("checksum of a file that is not there", ask(Ftp.CRC32, b"folder/other.txt")),
        step("open to read", ask(Ftp.READ_ONLY, note)),
        step("read", ask(Ftp.READ, size=20)),
        step("the same request again", ask(Ftp.READ, size=20, number=999), ask(Ftp.READ, size=20, number=999)),
        step("read from its end", ask(Ftp.READ, offset=14, size=20)),
        step("write to what is open to read", ask(Ftp.WRITE, b"no")),
        step("read in a burst", ask(Ftp.BURST, size=8)),
        step("close, with a number that the burst had", ask(Ftp.TERMINATE)),
        step("close what was read", ask(Ftp.TERMINATE)),
        step("read what is not open", ask(Ftp.READ, size=20)),
        step("open a file that is not there to read", ask(Ftp.READ_ONLY, b"folder/other.txt")),
        step("open a file that is not there to write", ask(Ftp.WRITE_ONLY, b"folder/third.txt"), ask(Ftp.RESET)),
        step("remove it", ask(Ftp.REMOVE, b"folder/third.txt")),
        step("truncate", ask(Ftp.TRUNCATE, note, 4)),
        step("rename", ask(Ftp.RENAME, note + b"\0folder/new.txt")),
        step("list once more", ask(Ftp.LIST, folder)),
        step("remove a folder that is not empty", ask(Ftp.REMOVE_FOLDER, folder)),
        step("remove a file", ask(Ftp.REMOVE, b"folder/new.txt")),
        step("remove it again", ask(Ftp.REMOVE, b"folder/new.txt")),
        step("remove the folder", ask(Ftp.REMOVE_FOLDER, folder)),
        step("a path that leads out", ask(Ftp.READ_ONLY, b"../nothing.txt")),
        step("an operation that does not exist", ask(Ftp.NONSENSE)),
        step("parameters", ask(Ftp.READ_ONLY, b"/@PARAM/param.pck"), ask(Ftp.READ, size=2), ask(Ftp.RESET)),
        step("a mission", ask(Ftp.READ_ONLY, b"@MISSION/mission.dat"), ask(Ftp.READ, size=34), ask(Ftp.RESET)),
        step("a fence", ask(Ftp.READ_ONLY, b"@MISSION/fence.dat"), ask(Ftp.READ, size=34), ask(Ftp.RESET)),
    ))  # fmt: skip


def guided(dialect: Dialect) -> Chapter:
    """Flight without a mission: places, set-points, circles."""

    def go(number: int, item: MissionItem, *params: float, z_m: float = ALT_M + HEIGHT_M) -> Say:
        values = {f"param{at}": value for at, value in enumerate((*params, *(0.0,) * 4)[:4], start=1)}
        place = {"frame": 0, "current": 0, "autocontinue": 0, "x": item.x, "y": item.y, "z": z_m}
        return Say("COMMAND_INT", {"command": number, **values, **place})

    def set_point(mask: int, item: MissionItem, north_m_s: float = 0.0) -> Say:
        place = {"coordinate_frame": 6, "lat_int": item.x, "lon_int": item.y, "alt": HEIGHT_M}
        speeds = {
            "vx": north_m_s,
            "vy": 0.0,
            "vz": 0.0,
            "afx": 0.0,
            "afy": 0.0,
            "afz": 0.0,
            "yaw": 0.0,
            "yaw_rate": 0.0,
        }
        return Say("SET_POSITION_TARGET_GLOBAL_INT", {"time_boot_ms": 0, "type_mask": mask, **place, **speeds})

    up: tuple[Say, ...] = (
        order(ARM_DISARM, 1),
        order(TAKE_OFF, 0, 0, 0, math.nan, math.nan, math.nan, ALT_M + HEIGHT_M),
    )
    if dialect.home_item:
        up = (set_mode(dialect.modes.guided), order(ARM_DISARM, 1), order(TAKE_OFF, 0, 0, 0, 0, 0, 0, HEIGHT_M))
    there = (Until(What.FAST, 2.0), Until(What.STILL))
    set_points = SET_POINT_MODES[dialect.name]
    stream = (replace(set_point(SPEED_ALONE, NEAR[0], 3.0), listen_s=0.2),) * 12
    return Chapter("guided", (
        step("wait until it is ready", Until(What.READY), Look()),
        step("go to a place on the ground", go(REPOSITION, NEAR[0], -1, 1), Look()),
        step("take off", *up, Until(What.HIGH, HEIGHT_M - 1), Look(5.0)),
        step("go to a place", go(REPOSITION, NEAR[0], -1, 1), *there, Look(6.0)),
        step("go to a place, as COMMAND_LONG", order(REPOSITION, -1, 1, 0, math.nan, NEAR[1].x * 1e-7,
             NEAR[1].y * 1e-7, ALT_M + HEIGHT_M), Look(12.0)),
        step("go to a place without leave to change the mode", go(REPOSITION, NEAR[2], -1, 0), Look(12.0)),
        step("a place as a set-point", set_point(PLACE_ALONE, NEAR[2]), Look(12.0)),
        step("a speed as a set-point", set_point(SPEED_ALONE, NEAR[2], 4.0), Look(1.5)),
        step("no more set-points", Look(8.0)),
        step("the mode for set-points without set-points", set_mode(set_points), Look(3.0)),
        step("circle about a place", go(ORBIT, NEAR[1], 20.0, 3.0, 0.0), Look(20.0)),
        step("a circle that is too large", go(ORBIT, NEAR[1], 20_000.0, 3.0, 0.0), Look(3.0)),
        step("another height", order(CHANGE_ALTITUDE, ALT_M + HEIGHT_M + 5, 0), Look(8.0)),
        step("hold mode", set_mode(dialect.modes.hold), Look(6.0)),
        step("turn", order(TURN, 90, 20, 1, 0), Look(2.0)),
        step("a motor that is well again", order(INJECT_FAILURE, MOTOR, 0, 1), Look()),
        step("a failure that nothing can have", order(INJECT_FAILURE, GYRO, 6, 0), Look()),
        step("the mode for set-points with set-points", *stream,
             replace(set_mode(set_points), listen_s=0.2), *stream, Look(3.0)),
        step("a place among them", *(replace(set_point(PLACE_ALONE, NEAR[0]), listen_s=0.2),) * 60,
             replace(set_point(PLACE_ALONE, NEAR[0]), listen_s=0.02), Look(3.0)),
        step("and silence", Look(4.0)),
        step("stay", order(LOITER_UNLIM)),
        step("land", order(LAND), Until(What.DISARMED, limit_s=200.0, narrate=True), Look(3.0)),
    ))  # fmt: skip


CHAPTERS = {
    "questions": questions, "transfers": transfers, "flight": flight, "ending": ending, "files": files,
    "guided": guided,
}  # fmt: skip
