"""A program that flies a fleet and shares out what a lost vehicle leaves, in virtual time: minutes of flight at once.

The program is asyncio, and joined to its vehicles in memory; with the same seed every run is the same.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from simulator.testing import Fleet, FleetVehicle, fleet

PATIENCE_S = 2.0
TRIES = 5
LOST_S = 4.0
"""A vehicle that says nothing for so long is lost."""
UP_M = 30.0
Place = tuple[float, float]


class Pilot:
    """The program's end of one vehicle: it uploads, starts, and notes how far it has come."""

    def __init__(self, vehicle: FleetVehicle) -> None:
        self.sysid = vehicle.sysid
        self.places: Sequence[Place] = ()
        self.reached = 0
        """How many of them it has been to."""
        self.armed = False
        self.heard_s = self._now_s()
        self._mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = mavlink.MAVLink(None)
        self._inbox: asyncio.Queue[Any] = asyncio.Queue()
        self._send = vehicle.open_link(self._hear)
        self.heartbeats = asyncio.create_task(self._keep_beating())

    async def fly(self, places: Sequence[Place]) -> None:
        """Upload a mission over these places and a return, and start it."""
        self.places, self.reached = places, 0
        steps = [(mavlink.MAV_CMD_NAV_TAKEOFF, places[0], UP_M)]
        steps += [(mavlink.MAV_CMD_NAV_WAYPOINT, place, UP_M) for place in places]
        steps += [(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, (0.0, 0.0), 0.0)]
        question: Any = mavlink.MAVLink_mission_count_message(self.sysid, 1, len(steps))
        while (answer := await self._ask(question, "MISSION_REQUEST_INT", "MISSION_ACK")).get_type() != "MISSION_ACK":
            command, (lat_deg, lon_deg), up_m = steps[answer.seq]
            question = mavlink.MAVLink_mission_item_int_message(
                self.sysid, 1, answer.seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, command, 0, 1, 0, 0, 0, 0,
                round(lat_deg * 1e7), round(lon_deg * 1e7), up_m,
            )  # fmt: skip
        assert answer.type == mavlink.MAV_MISSION_ACCEPTED
        await asyncio.sleep(1.0)  # PX4 looks at a new mission before it lets it be started
        for command, param in ((mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0), (mavlink.MAV_CMD_MISSION_START, 0.0)):
            order = mavlink.MAVLink_command_long_message(self.sysid, 1, command, 0, param, 0, 0, 0, 0, 0, 0)
            while (answer := await self._ask(order, "COMMAND_ACK")).command != command:
                pass
            assert answer.result == mavlink.MAV_RESULT_ACCEPTED

        self.armed = True

    @property
    def left(self) -> Sequence[Place]:
        """Where it has not been yet."""
        return self.places[self.reached :]

    @property
    def is_lost(self) -> bool:
        """Whether it says nothing any more."""
        return self._now_s() - self.heard_s > LOST_S

    async def _ask(self, question: Any, *names: str) -> Any:  # noqa: ANN401 - pymavlink has no types
        for _ in range(TRIES):
            self._say(question)
            try:
                async with asyncio.timeout(PATIENCE_S):
                    while (answer := await self._inbox.get()).get_type() not in names:
                        pass
                    return answer
            except TimeoutError:
                continue
        raise AssertionError(f"no answer to {question.get_type()}")

    def _hear(self, datagram: bytes) -> None:
        message: Any
        for message in self._parser.parse_buffer(datagram) or []:
            if message.get_srcSystem() == self.sysid:  # the radio on the ground talks as well
                self.heard_s = self._now_s()
            match message.get_type():
                case "MISSION_ITEM_REACHED":  # item 0 is the take-off, and the last one the return
                    self.reached = min(max(self.reached, message.seq), len(self.places))
                case "HEARTBEAT":
                    self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self._inbox.put_nowait(message)

    def _say(self, message: Any) -> None:  # noqa: ANN401
        self._send(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256

    async def _keep_beating(self) -> None:
        while True:
            self._say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
            await asyncio.sleep(1.0)

    @staticmethod
    def _now_s() -> float:
        return asyncio.get_running_loop().time()


async def fly_all(pilots: dict[str, Pilot], shares: Mapping[str, Sequence[Place]]) -> None:
    """Fly every share; what a lost vehicle leaves is flown by the first one that is back."""
    await asyncio.gather(*(pilot.fly(shares[name]) for name, pilot in pilots.items()))
    while any(pilot.left for pilot in pilots.values()):
        await asyncio.sleep(1.0)
        lost = next((one for one in pilots.values() if one.left and one.is_lost), None)
        back = next((one for one in pilots.values() if not one.left and not one.armed and not one.is_lost), None)
        if lost is not None and back is not None:
            places, lost.places = lost.left, ()
            lost.reached = 0
            await back.fly(places)


def list_places(vehicle: FleetVehicle, count: int) -> list[Place]:
    """Return places in a row to the north of a vehicle, 60 m apart."""
    here = vehicle.truth
    return [(here.lat_deg + 0.00054 * number, here.lon_deg) for number in range(1, count + 1)]


async def watch_places(flying: Fleet, places: Sequence[Place], seen: dict[Place, str]) -> None:
    """Note, by the truth, who was first at each place."""
    while True:
        for vehicle in flying:
            here = vehicle.truth
            for lat_deg, lon_deg in places:
                north_m, east_m = (here.lat_deg - lat_deg) * 111e3, (here.lon_deg - lon_deg) * 75e3
                if math.hypot(north_m, east_m) < 3 and here.up_m > UP_M - 3:
                    seen.setdefault((lat_deg, lon_deg), vehicle.name)
        await asyncio.sleep(0.2)


@pytest.mark.virtual_time(limit_s=1800)
@pytest.mark.parametrize("radio", ["", "sik64"])
async def test_every_place_is_seen_though_a_vehicle_is_lost(radio: str) -> None:
    seen: dict[Place, str] = {}
    async with fleet(vehicles=3, autopilot="px4", seed=7, radio=radio, faults=["uav2:crash@45%"]) as flying:
        shares = {vehicle.name: list_places(vehicle, 4) for vehicle in flying}
        everywhere = [place for share in shares.values() for place in share]
        watching = asyncio.create_task(watch_places(flying, everywhere, seen))
        pilots = {vehicle.name: Pilot(vehicle) for vehicle in flying}
        await fly_all(pilots, shares)
        await flying.wait_for(lambda: not any(vehicle.truth.armed for vehicle in flying))
        for task in (watching, *(pilot.heartbeats for pilot in pilots.values())):
            task.cancel()
        flying.check_client()
    assert set(seen) == set(everywhere)
    assert "crash" in flying["uav2"].events
    assert {seen[place] for place in shares["uav2"]} == {"uav2", "uav1"}
