"""What MAVProxy's command line, in a process of its own, can do with a vehicle."""

from __future__ import annotations

import asyncio
import sys
from asyncio.subprocess import PIPE, STDOUT, Process
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import common as mav

from tests.peers.judging import ASK_AGAIN_S, NORTH_DEG, PLACE_DEG, Subject, Suite

FILES = "wp,fence,rally,param,ftp,mode,arm,cmdlong,misc"
NOTE = "".join(f"line {number} of a note\n" for number in range(400))
WP_HEAD = "QGC WPL 110"


async def start(address: str, modules: str, folder: Path, *options: str) -> Process:
    """Start MAVProxy in a folder."""
    return await asyncio.create_subprocess_exec(
        sys.executable, "-u", str(Path(sys.executable).with_name("mavproxy.py")), f"--master={address}",
        f"--default-modules={modules}", "--state-basedir=.", *options,
        cwd=folder, stdin=PIPE, stdout=PIPE, stderr=STDOUT,
    )  # fmt: skip


async def read_until(process: Process, *words: str) -> str:
    """Return the first line that it prints which has any of these words.

    Raises:
        AssertionError: it ended.
    """
    assert process.stdout is not None
    while line := (await process.stdout.readline()).decode(errors="replace"):
        if any(one in line for one in words):
            return line
    raise AssertionError(f"MAVProxy ended before it said {words}")


@dataclass(frozen=True, slots=True)
class Console:
    """MAVProxy, and the vehicle that it is connected to."""

    subject: Subject
    process: Process

    def type(self, line: str) -> None:
        """Type a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())

    async def wait_for(self, *words: str) -> str:
        """Return the first line that it prints which has any of these words."""
        return await read_until(self.process, *words)

    async def ask(self, line: str, *words: str) -> str:
        """Type a line and return what is said to it."""
        self.type(line)
        return await self.wait_for(*words)


@asynccontextmanager
async def typing(subject: Subject) -> AsyncIterator[Console]:
    """Start MAVProxy, and wait until it has found the vehicle and its parameters."""
    process = await start(subject.pymavlink, FILES, subject.folder)
    try:
        console = Console(subject, process)
        await console.wait_for("online system 1")
        yield console
    finally:
        process.kill()
        await process.communicate()


def write_items(path: Path, *items: tuple[int, int, float, float, float]) -> None:
    """Write a file of waypoints: frame, command, first parameter, how far north and east in hundred metres."""
    lines = [
        "\t".join(map(str, (
            seq, int(seq == 0), frame, command, first, 0, 0, 0, round(PLACE_DEG[0] + north * NORTH_DEG, 7),
            round(PLACE_DEG[1] + east * NORTH_DEG, 7), 20.0 if frame != mav.MAV_FRAME_GLOBAL else 488.0, 1,
        )))
        for seq, (frame, command, first, north, east) in enumerate(items)
    ]  # fmt: skip
    path.write_text("\n".join((WP_HEAD, *lines, "")), encoding="ascii")


def write_mission(folder: Path) -> int:
    """Write a mission, home first, and return how many items are on board then."""
    relative = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
    write_items(
        folder / "mission.txt", (mav.MAV_FRAME_GLOBAL, mav.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0),
        (relative, mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0), (relative, mav.MAV_CMD_NAV_WAYPOINT, 0.0, 1.0, 0.0),
        (relative, mav.MAV_CMD_NAV_WAYPOINT, 0.0, 1.0, 1.0),
        (mav.MAV_FRAME_MISSION, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0),
    )  # fmt: skip
    return 5


def count_items(path: Path) -> int:
    return len(path.read_text(encoding="ascii").splitlines()) - 1


def read_commands(path: Path) -> list[str]:
    """Return the commands of a file of waypoints."""
    return [line.split("\t")[3] for line in path.read_text(encoding="ascii").splitlines()[1:]]


async def load_mission(at: Console) -> None:
    count = write_mission(at.subject.folder)
    await at.ask("wp load mission.txt", "Loaded 5 waypoints in")
    await at.subject.until(lambda now: len(now.mission) == count)


async def save_mission(at: Console) -> None:
    await load_mission(at)
    await at.ask("wp save back.txt", "Saved 5 waypoints to back.txt")
    sent, back = (read_commands(at.subject.folder / name) for name in ("mission.txt", "back.txt"))
    assert back == sent


async def list_mission(at: Console) -> None:
    await load_mission(at)
    at.type("wp list")
    for number in range(4):
        await at.wait_for(f"{mav.MAV_CMD_NAV_RETURN_TO_LAUNCH} " if number == 3 else " ")


async def clear_mission(at: Console) -> None:
    await load_mission(at)
    at.type("wp clear")
    await at.subject.until(lambda now: len(now.mission) <= 1)
    await at.ask("wp list", "Requesting 0 waypoints", "Requesting 1 waypoints")


async def set_waypoint(at: Console) -> None:
    await load_mission(at)
    await at.ask("wp set 2", "MISSION_CURRENT", "waypoint 2", "DO_SET_MISSION_CURRENT: ACCEPTED")


async def change_height(at: Console) -> None:
    await load_mission(at)
    await at.ask("wp list", "Saved waypoints")
    await at.ask("wp changealt 2 33", "Changed alt")
    await at.subject.until(lambda now: len(now.mission) > 2 and now.mission[2].z == 33.0)


def write_fence(folder: Path) -> None:
    corners = [(mav.MAV_FRAME_GLOBAL, mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 4.0, *one)
               for one in ((2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0))]  # fmt: skip
    write_items(folder / "fence.txt", *corners)


def write_rally(folder: Path) -> None:
    point = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_CMD_NAV_RALLY_POINT, 0.0)
    write_items(folder / "rally.txt", (*point, 1.0, 0.0), (*point, 0.0, 1.0))


def list_stored_cases(
    kind: str, write: Callable[[Path], None], count: int
) -> dict[str, Callable[[Console], Awaitable[None]]]:
    """Return what is tried alike with a fence and with rally points."""

    async def load(at: Console) -> None:
        write(at.subject.folder)
        await at.ask(f"{kind} load {kind}.txt", f"Loaded {count} {kind} items in")
        await at.subject.until_stored(**{kind: count})

    async def save(at: Console) -> None:
        await load(at)
        await at.ask(f"{kind} save back.txt", f"Saved {count} {kind} items to back.txt")
        assert count_items(at.subject.folder / "back.txt") == count

    async def clear(at: Console) -> None:
        await load(at)
        at.type(f"{kind} clear")
        await at.ask(f"{kind} list", f"Requesting 0 {kind} items")
        await at.subject.until_stored(**{kind: 0})

    return {"load": load, "save": save, "clear": clear}


FENCE, RALLY = list_stored_cases("fence", write_fence, 4), list_stored_cases("rally", write_rally, 2)


async def enable_fence(at: Console) -> None:
    await FENCE["load"](at)
    at.type("fence enable")
    await at.wait_for("DO_FENCE_ENABLE: ACCEPTED")


def name_parameter(at: Console) -> str:
    return "RTL_RETURN_ALT" if at.subject.px4 else "FS_GCS_TIMEOUT"


async def fetch_parameters(at: Console) -> None:
    """Fetch them; MAVProxy does so by itself as well, so it is asked until it has them all."""
    await at.ask("param fetch", "Received ")
    while len({*(await at.ask("param status", "Have ")).split()[-2].split("/")}) != 1:  # noqa: ASYNC110 - nobody tells
        await asyncio.sleep(ASK_AGAIN_S)


async def show_parameter(at: Console) -> None:
    await fetch_parameters(at)
    await at.ask(f"param show {name_parameter(at)}", name_parameter(at))


async def set_parameter(at: Console) -> None:
    await fetch_parameters(at)
    at.type(f"param set {name_parameter(at)} 33.5")
    await at.subject.until(lambda now: now.parameters[name_parameter(at)] == 33.5)
    assert "33.5" in await at.ask(f"param show {name_parameter(at)}", name_parameter(at))


async def save_parameters(at: Console) -> None:
    await fetch_parameters(at)
    await at.ask("param save all.parm", "parameters to all.parm")
    names = {line.split()[0] for line in (at.subject.folder / "all.parm").read_text(encoding="ascii").splitlines()}
    assert name_parameter(at) in names
    at.subject.prove(lambda now: names <= now.parameters.keys())


async def load_parameters(at: Console) -> None:
    await fetch_parameters(at)
    (at.subject.folder / "some.parm").write_text(f"{name_parameter(at)} 44.0\n", encoding="ascii")
    await at.ask("param load some.parm", "Loaded 1 parameters", "changed 1")
    await at.subject.until(lambda now: now.parameters[name_parameter(at)] == 44.0)


async def fetch_packed_parameters(at: Console) -> None:
    await at.ask("param ftp", "parameters (ftp)")


async def list_files(at: Console) -> None:
    await at.ask("ftp list /", "Total size")


async def put_file(at: Console) -> None:
    (at.subject.folder / "note.txt").write_text(NOTE, encoding="ascii")
    await at.ask("ftp put note.txt /note.txt", "Sent file of length")


async def get_file(at: Console) -> None:
    await put_file(at)
    await at.ask("ftp get /note.txt back.txt", f"Wrote {len(NOTE)} bytes")
    assert (at.subject.folder / "back.txt").read_text(encoding="ascii") == NOTE


async def sum_file(at: Console) -> None:
    await put_file(at)
    there = await at.ask("ftp crc /note.txt", "crc: ")
    here = await at.ask("ftp crclocal note.txt", "crclocal: ")
    assert there.split()[2] == here.split()[2]


async def rename_file(at: Console) -> None:
    await put_file(at)
    at.type("ftp rename /note.txt /other.txt")
    await at.ask("ftp list /", "other.txt")


async def remove_file(at: Console) -> None:
    await put_file(at)
    at.type("ftp rm /note.txt")
    await at.ask("ftp get /note.txt gone.txt", "ftp open failed")


async def make_folder(at: Console) -> None:
    at.type("ftp mkdir /folder")
    await at.ask("ftp list /", "folder")


async def remove_folder(at: Console) -> None:
    await make_folder(at)
    at.type("ftp rmdir /folder")
    at.type("ftp list /")
    while "Total size" not in (line := await at.wait_for("folder", "Total size")):
        assert " D folder" not in line


def by_files(kind: str) -> Callable[[Console], Awaitable[None]]:
    """Return a case: items put on board and read back as a file, as ArduPilot has it."""

    async def case(at: Console) -> None:
        name, back = {"wp": ("mission", "way"), "fence": ("fence", "fence-items"), "rally": ("rally", "rally-items")}[
            kind
        ]
        {"wp": write_mission, "fence": write_fence, "rally": write_rally}[kind](at.subject.folder)
        await at.ask(f"{kind} ftpload {name}.txt", "Sent ")
        await at.ask(f"{kind} ftp", f"to ./{back}.txt")
        assert count_items(at.subject.folder / f"{back}.txt") == count_items(at.subject.folder / f"{name}.txt")

    return case


async def arm(at: Console) -> None:
    at.type("arm throttle")
    await at.wait_for("COMPONENT_ARM_DISARM: ACCEPTED", "ARMED")
    await at.subject.until(lambda now: now.armed)


async def change_mode(at: Console) -> None:
    name = "LOITER"
    at.type(f"mode {name}")
    await at.subject.until(lambda now: now.mode == name)
    await at.wait_for("DO_SET_MODE: ACCEPTED", f"Mode {name}", f"{name}> ")


async def take_off(at: Console) -> None:
    if not at.subject.px4:
        await at.ask("mode GUIDED", "DO_SET_MODE: ACCEPTED", "Mode GUIDED")
    await arm(at)
    at.type("takeoff 15" if not at.subject.px4 else "mode TAKEOFF")
    await at.subject.until(lambda now: now.up_m > 1.0)


async def go_home(at: Console) -> None:
    await take_off(at)
    at.type("rtl")
    await at.subject.until(lambda now: now.mode in {"RTL", "RETURN"})


async def send_long(at: Console) -> None:
    await at.ask("long MAV_CMD_REQUEST_MESSAGE 242", "REQUEST_MESSAGE: ACCEPTED")


async def reboot(at: Console) -> None:
    await at.ask("reboot", "PREFLIGHT_REBOOT_SHUTDOWN: ACCEPTED", "Rebooting", "reboot")


CASES: Mapping[str, Mapping[str, Callable[[Console], Awaitable[None]]]] = {
    "mission": {
        "load": load_mission, "save": save_mission, "list": list_mission, "clear": clear_mission,
        "set the waypoint": set_waypoint, "change a height": change_height,
    },
    "fence": {**FENCE, "enable": enable_fence},
    "rally": RALLY,
    "param": {
        "fetch": fetch_parameters, "show": show_parameter, "set": set_parameter, "save": save_parameters,
        "load": load_parameters,
    },
    "ftp": {
        "list": list_files, "put": put_file, "get": get_file, "checksum": sum_file, "rename": rename_file,
        "remove": remove_file, "make a folder": make_folder, "remove a folder": remove_folder,
    },
    "flight": {
        "arm": arm, "mode": change_mode, "take off": take_off, "return": go_home, "any command": send_long,
        "reboot": reboot,
    },
}  # fmt: skip
BY_FILES = {
    "mission": by_files("wp"), "fence": by_files("fence"), "rally points": by_files("rally"),
    "parameters": fetch_packed_parameters,
}  # fmt: skip
SUITES = {
    **{f"MAVProxy {name}": Suite("MAVProxy", typing, cases) for name, cases in CASES.items()},
    "MAVProxy by files": Suite("MAVProxy", typing, BY_FILES, ("ardupilot",)),
}
