"""The program under test: a client that calls one vehicle over UDP, by pymavlink."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

PATIENCE_S = 60.0
"""Real seconds that a busy computer may take for one answer."""
Place = tuple[float, float]
"""Latitude and longitude in degrees."""
GUIDED = 4
"""ArduPilot's mode that takes off when told to."""


class Client:
    """It orders, uploads, and sends a HEARTBEAT when it is told to."""

    def __init__(self, address: str, sysid: int) -> None:
        self.sysid = sysid
        self.link: Any = mavutil.mavlink_connection(address, source_system=255)
        self.beat()

    def beat(self) -> None:
        """Send a HEARTBEAT, and read what has come: nobody waits for it, and a socket holds only so much."""
        while self.link.recv_msg() is not None:
            pass
        self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def upload(self, places: Sequence[Place], height_m: float = 30.0) -> int:
        """Upload a take-off, the places and a return; returns MAV_MISSION_RESULT."""
        items: list[tuple[int, Place, float]] = [
            (mavlink.MAV_CMD_NAV_TAKEOFF, places[0], height_m),
            *((mavlink.MAV_CMD_NAV_WAYPOINT, place, height_m) for place in places),
            (mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, (0.0, 0.0), 0.0),
        ]
        self.link.mav.mission_count_send(self.sysid, 1, len(items))
        while True:
            asked = self._wait_for("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")
            if asked.get_type() == "MISSION_ACK":
                return int(asked.type)
            command, (lat_deg, lon_deg), up_m = items[asked.seq]
            self.link.mav.mission_item_int_send(
                self.sysid, 1, asked.seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, command, 0, 1, 0, 0, 0, 0,
                round(lat_deg * 1e7), round(lon_deg * 1e7), up_m,
            )  # fmt: skip

    def order(self, command: int, *params: float) -> int:
        """Order something; returns MAV_RESULT."""
        self.link.mav.command_long_send(self.sysid, 1, command, 0, *params, *(0.0,) * (7 - len(params)))
        while True:
            answer = self._wait_for("COMMAND_ACK")
            if answer.command == command:
                return int(answer.result)

    def take_off(self, autopilot: str, height_m: float) -> None:
        """Arm and take off."""
        if autopilot == "ardupilot":
            assert self.order(mavlink.MAV_CMD_DO_SET_MODE, 1, GUIDED) == mavlink.MAV_RESULT_ACCEPTED
        assert self.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        assert self.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m) == mavlink.MAV_RESULT_ACCEPTED

    def close(self) -> None:
        """Close the socket."""
        self.link.close()

    def _wait_for(self, *names: str) -> Any:  # noqa: ANN401 - pymavlink has no types
        message = self.link.recv_match(type=list(names), blocking=True, timeout=PATIENCE_S)
        assert message is not None, f"no {' or '.join(names)}"
        return message
