"""What pymavlink's own tools, mavutil, mavparm, mavwp and mavftp, can do with a vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from pymavlink import mavftp, mavparm, mavutil, mavwp
from pymavlink.dialects.v20 import common as mav

from tests.peers.judging import PATIENCE_S, Subject, Suite, wait
from tests.peers.mavproxy_cases import NOTE, write_fence, write_items, write_mission, write_rally

ANSWER_S = 5.0
TRANSFERS = ("put", "get")


@dataclass(frozen=True, slots=True)
class Link:
    """mavutil's connection with a vehicle."""

    subject: Subject
    master: Any

    def hear(self, *kinds: str) -> Any:
        """Return the next message of these kinds."""
        message = self.master.recv_match(type=list(kinds), blocking=True, timeout=ANSWER_S)
        assert message is not None, f"no {' or '.join(kinds)}"
        return message


@asynccontextmanager
async def linked(subject: Subject) -> AsyncIterator[Link]:
    """Connect, and wait for a HEARTBEAT."""
    master = mavutil.mavlink_connection(subject.pymavlink, source_system=255)
    try:

        def is_heard() -> bool:
            master.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            return master.wait_heartbeat(timeout=1.0) is not None

        await asyncio.to_thread(wait, is_heard, PATIENCE_S)
        yield Link(subject, master)
    finally:
        master.close()


# Missions as mavwp loads and mavutil sends them, with floats where those are asked for.


def send(at: Link, loader: Any, kind: int) -> int:
    """Upload what a loader has and return the result."""
    at.master.mav.mission_count_send(1, 1, loader.count(), kind)
    while (asked := at.hear("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")).get_type() != "MISSION_ACK":
        item = loader.wp(asked.seq)
        item.target_system, item.target_component, item.mission_type = 1, 1, kind
        if asked.get_type() == "MISSION_REQUEST_INT":
            item = mav.MAVLink_mission_item_int_message(
                1, 1, item.seq, item.frame, item.command, item.current, item.autocontinue, item.param1, item.param2,
                item.param3, item.param4, round(item.x * 1e7), round(item.y * 1e7), item.z, kind,
            )  # fmt: skip
        at.master.mav.send(item)
    return int(asked.type)


def send_mission(at: Link) -> int:
    """Upload the mission of a file and return how many items it has."""
    count = write_mission(at.subject.folder)
    loader = mavwp.MAVWPLoader(1, 1)
    assert loader.load(str(at.subject.folder / "mission.txt")) == count
    assert send(at, loader, mav.MAV_MISSION_TYPE_MISSION) == mav.MAV_MISSION_ACCEPTED
    at.subject.wait_until(lambda now: len(now.mission) == count)
    return count


def upload_mission(at: Link) -> None:
    send_mission(at)


def download_mission(at: Link) -> None:
    count = send_mission(at)
    at.master.waypoint_request_list_send()
    assert at.hear("MISSION_COUNT").count == count
    loader = mavwp.MAVWPLoader(1, 1)
    for number in range(count):
        at.master.waypoint_request_send(number)
        loader.add(at.hear("MISSION_ITEM", "MISSION_ITEM_INT"))
    assert loader.wp(1).command == mav.MAV_CMD_NAV_TAKEOFF


def choose_waypoint(at: Link) -> None:
    send_mission(at)
    at.master.waypoint_set_current_send(2)
    while at.hear("MISSION_CURRENT").seq != 2:
        pass


def clear_mission(at: Link) -> None:
    send_mission(at)
    at.master.waypoint_clear_all_send()
    assert at.hear("MISSION_ACK").type == mav.MAV_MISSION_ACCEPTED
    at.subject.wait_until(lambda now: len(now.mission) <= 1)


def upload_fence(at: Link) -> None:
    write_fence(at.subject.folder)
    (loader := mavwp.MissionItemProtocol_Fence(1, 1)).load(str(at.subject.folder / "fence.txt"))
    assert send(at, loader, mav.MAV_MISSION_TYPE_FENCE) == mav.MAV_MISSION_ACCEPTED
    wait(lambda: at.subject.has_stored(fence=4), ANSWER_S)


def upload_rally(at: Link) -> None:
    write_rally(at.subject.folder)
    (loader := mavwp.MissionItemProtocol_Rally(1, 1)).load(str(at.subject.folder / "rally.txt"))
    assert send(at, loader, mav.MAV_MISSION_TYPE_RALLY) == mav.MAV_MISSION_ACCEPTED
    wait(lambda: at.subject.has_stored(rally=2), ANSWER_S)


def load_old_waypoints(at: Link) -> None:
    """Upload a list that has no home, to a vehicle that lists none."""
    relative = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
    places = [(relative, mav.MAV_CMD_NAV_WAYPOINT, 0.0, float(north), 0.0) for north in range(1, 40)]
    write_items(at.subject.folder / "long.txt", *places)
    (loader := mavwp.MAVWPLoader(1, 1)).load(str(at.subject.folder / "long.txt"))
    assert send(at, loader, mav.MAV_MISSION_TYPE_MISSION) == mav.MAV_MISSION_ACCEPTED
    at.subject.wait_until(lambda now: len(now.mission) == 39)


# Parameters.


def name_float(at: Link) -> str:
    return "RTL_RETURN_ALT" if at.subject.px4 else "FS_GCS_TIMEOUT"


def fetch_all(at: Link) -> None:
    at.master.param_fetch_all()
    found = mavparm.MAVParmDict()
    while len(found) < (value := at.hear("PARAM_VALUE")).param_count - 1:
        if not value.param_id.startswith("_HASH"):
            found[value.param_id] = value.param_value
    found.save(str(at.subject.folder / "all.parm"))
    assert name_float(at) in (at.subject.folder / "all.parm").read_text(encoding="ascii")


def set_one(at: Link) -> None:
    name = name_float(at)
    assert mavparm.MAVParmDict().mavset(at.master, name, 33.5, parm_type=mav.MAV_PARAM_TYPE_REAL32)
    at.subject.prove(lambda now: now.parameters[name] == 33.5)


def load_file(at: Link) -> None:
    (path := at.subject.folder / "some.parm").write_text(f"{name_float(at)} 44.0\n", encoding="ascii")
    known = mavparm.MAVParmDict()
    known[name_float(at)] = 1.0
    assert known.load(str(path), mav=at.master)
    at.subject.wait_until(lambda now: now.parameters[name_float(at)] == 44.0)


# Files.


def by_ftp(*orders: tuple[str, ...]) -> Callable[[Link], None]:
    """Return a case: orders of mavftp's that must all succeed, after a file was put on board."""

    def case(at: Link) -> None:
        ftp = mavftp.MAVFTP(at.master, 1, 1)
        (at.subject.folder / "note.txt").write_text(NOTE, encoding="ascii")
        for words in (("put", str(at.subject.folder / "note.txt"), "/note.txt"), *orders):
            filled = [word.replace("LOCAL", str(at.subject.folder)) for word in words]
            first = ftp.cmd_ftp(filled)
            assert first.error_code == mavftp.FtpError.Success, f"{words} did not begin: {first.error_code}"
            if filled[0] in TRANSFERS:
                done = ftp.process_ftp_reply(filled[0], timeout=2 * ANSWER_S)
                assert done.error_code == mavftp.FtpError.Success, f"{words}: {done.error_code}"
        back = at.subject.folder / "back.txt"
        assert not any(word[0] == "get" for word in orders) or back.read_text(encoding="ascii") == NOTE

    return case


def fetch_packed(at: Link) -> None:
    ftp = mavftp.MAVFTP(at.master, 1, 1)
    ftp.cmd_getparams([str(at.subject.folder / "all.parm"), str(at.subject.folder / "usual.parm")])
    assert ftp.process_ftp_reply("getparams", timeout=4 * ANSWER_S).error_code == mavftp.FtpError.Success
    assert name_float(at) in (at.subject.folder / "all.parm").read_text(encoding="ascii")


# Flight.


def change_mode(at: Link) -> None:
    at.master.set_mode("LOITER")
    at.subject.wait_until(lambda now: now.mode == "LOITER")


def arm(at: Link) -> None:
    at.master.arducopter_arm()
    at.master.motors_armed_wait()
    at.subject.wait_until(lambda now: now.armed)
    at.master.arducopter_disarm()
    at.master.motors_disarmed_wait()


def hear_place(at: Link) -> None:
    at.master.mav.request_data_stream_send(1, 1, mav.MAV_DATA_STREAM_ALL, 4, 1)
    place = at.master.location()
    at.subject.prove(lambda now: abs(now.lat_deg - place.lat) < 1e-5 and abs(now.lon_deg - place.lng) < 1e-5)


def reboot(at: Link) -> None:
    at.master.reboot_autopilot()
    answer = at.hear("COMMAND_ACK")
    assert (answer.command, answer.result) == (mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, mav.MAV_RESULT_ACCEPTED)


SUITES = {
    "pymavlink mavwp": Suite("pymavlink", linked, {
        "upload": upload_mission, "download": download_mission, "choose an item": choose_waypoint,
        "clear": clear_mission, "fence": upload_fence, "rally points": upload_rally,
        "forty waypoints": load_old_waypoints,
    }),
    "pymavlink mavparm": Suite("pymavlink", linked, {"fetch and save": fetch_all, "set": set_one, "load": load_file}),
    "pymavlink mavftp": Suite("pymavlink", linked, {
        "put": by_ftp(), "list": by_ftp(("list", "/")), "get": by_ftp(("get", "/note.txt", "LOCAL/back.txt")),
        "checksum": by_ftp(("crc", "/note.txt")), "rename": by_ftp(("rename", "/note.txt", "/other.txt")),
        "remove": by_ftp(("rm", "/note.txt")), "make a folder": by_ftp(("mkdir", "/folder")),
        "remove a folder": by_ftp(("mkdir", "/folder"), ("rmdir", "/folder")),
    }),
    "pymavlink packed parameters": Suite("pymavlink", linked, {"fetch": fetch_packed}, ("ardupilot",)),
    "pymavlink mavutil": Suite("pymavlink", linked, {
        "mode": change_mode, "arm and disarm": arm, "place": hear_place, "reboot": reboot,
    }),
}  # fmt: skip
