"""Hostile links: all lost at once, another station's mission, and forged frames; with real autopilots."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import VehicleState
from missions import dialect_for
from tests.dialogues.answer import extension
from tests.e2e.flights import began_unix_s
from tests.e2e.tlog import messages
from tests.sitl.custody import LOGGED, nothing_was_commanded, switches, taken_s
from tests.sitl.flights import NAMES, SPEEDUP, VICTIM, Flown, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, NO_FAILSAFE, PX4, SOON_HOME, Autopilot, RealVehicle
from tests.sitl.relay import HOST
from tests.sitl.verdict import ended_well, inspected_by

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

SILENCE_S = 70.0
GRACE_S = 15.0
NOTICED_S = 2.0
READ_S = 6.0
FLOOD = 50
RADIO_PACKETS = 300
PAUSE_S = 5.0
UPLOADS = frozenset({"MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_SET_CURRENT", "COMMAND_LONG", "COMMAND_INT"})


def beside(act: Callable[[RealVehicle], None]) -> Callable[[RealVehicle], None]:
    """Return how something is done to a vehicle that takes its time: the flight's loop must not wait for it."""
    return lambda vehicle: threading.Thread(target=act, args=(vehicle,)).start()


def all_silent(
    autopilot: Autopilot, settings: Mapping[Autopilot, Mapping[str, float]], fly_again: str = "auto"
) -> Story:
    return Story(
        RealVehicle.cut,
        RealVehicle.join,
        lasts_s=SILENCE_S,
        struck=NAMES,
        relayed=NAMES,
        settings=settings[autopilot],
        flight={"fly_again": fly_again},
    )


@BOTH
def test_all_silent_and_they_fly_on(autopilot: Autopilot, tmp_path: Path) -> None:
    """Nobody is given up; what they flew unseen counts by their clocks and places, or is flown again."""
    flight = flown(autopilot, all_silent(autopilot, NO_FAILSAFE), tmp_path)
    ended_well(flight, [], unseen=True)
    assert flight.says("all links lost") is not None, flight.said
    assert flight.says("links regained") is not None, flight.said
    assert flight.report["inferred"] or flight.report["replans"], flight.said


@BOTH
def test_all_silent_and_home_by_their_own_failsafes(autopilot: Autopilot, tmp_path: Path) -> None:
    """Nobody is at fault for that; heard again they are taken up, and fly the rest."""
    flight = flown(autopilot, all_silent(autopilot, SOON_HOME), tmp_path)
    ended_well(flight, [], unseen=True)
    assert came_home_unseen(flight, autopilot), flight.unseen_modes
    assert flight.report["replans"], flight.said


@BOTH
def test_all_silent_and_home_and_the_crew_is_asked(autopilot: Autopilot, tmp_path: Path) -> None:
    """Nobody takes off again without the crew's word; the flight ends once everybody is down."""
    flight = flown(autopilot, all_silent(autopilot, SOON_HOME, "ask"), tmp_path)
    assert flight.report["faults"] == [], flight.said
    assert came_home_unseen(flight, autopilot), flight.unseen_modes
    assert flight.says("can take over") is not None, flight.said
    for name in NAMES:
        assert flight.vehicle(name)["landed"], flight.said
        assert not flight.heartbeats(name)[-1][1], f"{name} is still armed"


def came_home_unseen(flight: Flown, autopilot: Autopilot) -> bool:
    modes = dialect_for(autopilot.name).modes
    return bool({mode for _, mode in flight.unseen_modes} & {modes.return_home.custom_mode, modes.land.custom_mode})


def puts_on_board(autopilot: Autopilot, *, same_count: bool) -> Callable[[RealVehicle], None]:
    """Return how another station puts a mission of its own on board: high over the pad, and down."""

    def act(vehicle: RealVehicle) -> None:
        ours = vehicle.other.mission(vehicle.sysid)
        landing = ours[-1]
        home = [ours[0]] if dialect_for(autopilot.name).home_item else []
        over = len(ours) - len(home) - 1 if same_count else 3
        items = [*home, *(point_over(landing, 60.0 + number) for number in range(over)), landing]
        for seq, item in enumerate(items):
            item.seq, item.target_system, item.target_component = seq, vehicle.sysid, 1
        vehicle.other.upload(vehicle.sysid, items)

    return beside(act)


def point_over(landing: mav.MAVLink_mission_item_int_message, alt_m: float) -> mav.MAVLink_mission_item_int_message:
    frame, waypoint = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mav.MAV_CMD_NAV_WAYPOINT
    return mav.MAVLink_mission_item_int_message(
        0, 1, 0, frame, waypoint, 0, 1, 0, 0, 0, float("nan"), landing.x, landing.y, alt_m
    )


def carried(flight: Flown) -> Iterator[tuple[float, int, int]]:
    """Yield what uav2 says of its mission: when, how many items, and its identity, by the flight's clock."""
    began_s = began_unix_s(flight.run)
    for stamp_s, message in messages(flight.run / f"{VICTIM}.tlog", "MISSION_CURRENT"):
        # MAVLink has these fields, this dialect of pymavlink has not.
        yield stamp_s - began_s, extension(message, 2) & 0xFFFF, extension(message, 6)


def said_so_s(flight: Flown, *, by_text: bool) -> float:
    """Return when uav2 first said that it carries another mission, by the flight's clock."""
    assert flight.struck_s is not None
    if by_text:
        began_s = began_unix_s(flight.run)
        texts = messages(flight.run / f"{VICTIM}.tlog", "STATUSTEXT")
        received = [stamp_s - began_s for stamp_s, message in texts if message.text.startswith("Auto mission changed")]
        return next(at_s for at_s in received if at_s > flight.struck_s)
    reports = list(carried(flight))
    ours = [one[1:] for one in reports if one[0] < flight.struck_s][-1]
    return next(at_s for at_s, *other in reports if at_s > flight.struck_s and tuple(other) != ours)


@BOTH
@pytest.mark.parametrize("same_count", [False, True], ids=["shorter", "as_long"])
def test_another_stations_mission(autopilot: Autopilot, same_count: bool, tmp_path: Path) -> None:
    """It is another station's: not commanded, its segments go to the others. In the end that station brings it home."""
    story = Story(
        puts_on_board(autopilot, same_count=same_count),
        switches(autopilot, "rtl"),
        lasts_s=45.0,
        settings=LOGGED if autopilot is PX4 else {},
        flight={"pilot_grace_s": GRACE_S},
    )
    flight = flown(autopilot, story, tmp_path)
    ended_well(flight, [])
    taken, _ = taken_s(flight)
    # A text is looked up on board first: until the other station has stored all of it, nobody may read it.
    by_text = same_count and autopilot is ARDUPILOT
    assert taken - said_so_s(flight, by_text=by_text) <= (READ_S if by_text else NOTICED_S), flight.said
    assert flight.says(f"{VICTIM}: has a foreign mission on board") is not None, flight.said
    nothing_was_commanded(flight, autopilot)
    assert sent_after(flight, taken) == []
    free_s = flight.says(
        f"{VICTIM}: on another station's mission for {GRACE_S:g} s; its segments are released to the others"
    )
    assert free_s is not None, flight.said
    assert GRACE_S - 2.0 <= free_s - taken <= GRACE_S + 2.0
    for one in inspected_by(flight, VICTIM):
        assert one.inspected_s is not None
        assert one.inspected_s + flight.launched_s <= taken


def sent_after(flight: Flown, at_s: float) -> list[str]:
    """Return what we sent to uav2 that commands it, or changes its mission, after a time of the flight's."""
    began_s = began_unix_s(flight.run)
    return [
        f"{stamp_s - began_s:.1f} {message}"
        for stamp_s, message in messages(flight.run / f"{VICTIM}.tlog", *UPLOADS)
        if message.get_srcSystem() == 255 and stamp_s - began_s > at_s + 0.1
        and getattr(message, "command", 0) not in ASKING
    ]  # fmt: skip


ASKING = frozenset({511, 512})
"""For a message, or for one at a rate."""


def forges_radio(autopilot: Autopilot, returned: list[bytes]) -> Callable[[RealVehicle], None]:
    """Return how somebody speaks as a SiK radio to uav2's port, from another port; `returned` is what that is sent."""

    def act(vehicle: RealVehicle) -> None:
        forger = mav.MAVLink(None, srcSystem=51, srcComponent=68)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
            plug.settimeout(0.1 / SPEEDUP)
            for _ in range(RADIO_PACKETS):
                # No signal over much noise, and a buffer that takes nothing.
                report = mav.MAVLink_radio_status_message(0, 0, 0, 200, 200, 0, 0)
                plug.sendto(report.pack(forger), (HOST, autopilot.port + vehicle.sysid - 1))
                with contextlib.suppress(TimeoutError):
                    returned.append(plug.recv(65536))

    return beside(act)


@BOTH
def test_a_forged_radio(autopilot: Autopilot, tmp_path: Path) -> None:
    """What we say goes on to the vehicle, whose own failsafe would act if it did not, and the radio is not believed.

    ArduPilot signs, and PX4 from 1.18 on.
    """
    returned: list[bytes] = []
    story = Story(forges_radio(autopilot, returned), settings=SOON_HOME[autopilot], signed=autopilot.signs)
    flight = flown(autopilot, story, tmp_path)
    ended_well(flight, [])
    assert returned == []
    assert flight.struck_s is not None
    assert flight.says("radio signal") is None, flight.said
    assert flight.report["replans"] == [], flight.said
    assert signed(flight) == ({True} if story.signed else {False})


def signed(flight: Flown) -> set[bool]:
    """Return whether the heartbeats of uav2, and ours to it, are signed."""
    return {
        bool(beat.get_header().incompat_flags & mav.MAVLINK_IFLAG_SIGNED)
        for _, beat in messages(flight.run / f"{VICTIM}.tlog", "HEARTBEAT")
    }


def forges_words(autopilot: Autopilot) -> Callable[[RealVehicle], None]:
    """Return how somebody says in uav2's name, from its address, that it is disarmed, and that its battery fails."""
    dialect = dialect_for(autopilot.name)
    kind = mav.MAV_AUTOPILOT_ARDUPILOTMEGA if autopilot is ARDUPILOT else mav.MAV_AUTOPILOT_PX4

    def act(vehicle: RealVehicle) -> None:
        disarmed = mav.MAVLink_heartbeat_message(
            mav.MAV_TYPE_QUADROTOR, kind, 1, dialect.modes.mission.custom_mode, mav.MAV_STATE_STANDBY, 3
        )
        text = mav.MAVLink_statustext_message(mav.MAV_SEVERITY_CRITICAL, b"Battery Failsafe")
        for message, component, count in (
            (disarmed, 190, 1), (disarmed, 1, 1), (disarmed, 190, FLOOD), (disarmed, 1, FLOOD),
            (text, 190, 1), (text, 1, 1),
        ):  # fmt: skip
            forger = mav.MAVLink(None, srcSystem=vehicle.sysid, srcComponent=component)
            for _ in range(count):
                vehicle.relayed.forge(message.pack(forger))
                time.sleep(0.1 / SPEEDUP)
            time.sleep(PAUSE_S / SPEEDUP)

    return beside(act)


def in_a_segment(vehicle: VehicleState, _: FleetState) -> bool:
    return vehicle.assignment.run is not None


@BOTH
def test_forged_words(autopilot: Autopilot, tmp_path: Path) -> None:
    """One HEARTBEAT that says that it is disarmed, then ten a second for 5 s, then a text: everybody flies its plan."""
    story = Story(forges_words(autopilot), at=in_a_segment, relayed=(VICTIM,))
    flight = flown(autopilot, story, tmp_path)
    ended_well(flight, [])
    assert flight.report["replans"] == [], flight.said
    plan = json.loads((flight.run / "plan-000.json").read_text())
    for route in plan["routes"]:
        planned = {visit["segment"] for visit in route["visits"]}
        assert {one.id for one in inspected_by(flight, route["vehicle"])} == planned, flight.said
