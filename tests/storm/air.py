"""The way between a vehicle and the ground station, with all that can be wrong with it."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.virtual.radio import MemoryRadio
from executor.adapters.mavlink.codec import DecodedFrame
from executor.adapters.mavlink.endpoints import discard_frame
from executor.core.interface.messages import Battery, Heartbeat, Message, Position, SystemStatus
from missions.items import MissionKind
from simulator.config import OTHER_STATION
from simulator.fleet import STATION_COMPONENT, SimulatedVehicle
from simulator.messages import (
    ItemReceived,
    MissionCount,
    Outbound,
    Peer,
    build_message,
)
from simulator.messages import Received as Order
from simulator.truth import Truth
from simulator.wire import Codec as Transmitter
from tests.storm.plot import Happening

STEP_S = 0.1
"""A datagram takes at most this each way."""
WAITING = 600
"""Datagrams that wait for a process that does not read, 20 s of a vehicle's: the rest is lost, as in a socket."""
NEVER_S = -math.inf
INT32_MIN = -(2**31)
E7_DEG_M = 90.0
"""Units of 1e-7 degrees in a metre of latitude."""
DROPPED: dict[str, tuple[type[Message], ...]] = {
    "no position": (Position,),
    "no heartbeat": (Heartbeat,),
    "no battery": (Battery, SystemStatus),
}


@dataclass(slots=True)
class Trouble:
    """Until when something is wrong, on the flight's clock."""

    uplink_s: float = NEVER_S
    downlink_s: float = NEVER_S
    held_s: float = NEVER_S
    bursts_s: float = NEVER_S
    frozen_s: float = NEVER_S
    garbage_s: float = NEVER_S
    gps_s: float = NEVER_S
    gps_m: float = 0.0


class Air(MemoryRadio):
    """One vehicle's radio, with its troubles."""

    def __init__(self, vehicle: SimulatedVehicle, sysid: int, rng: random.Random) -> None:
        self.trouble = Trouble()
        self.late_s = 0.0
        """By how much its own time lags, after it was frozen."""
        self.open = True
        """Whether a ground station is there."""
        self.dropped: dict[str, float] = {}
        """Until when messages of a sort do not come."""
        self._rng = rng
        self._place = f"10.0.0.{sysid}:14550"
        self._inbox: deque[bytes] = deque()
        super().__init__(vehicle, sysid)
        self.stop_unread_streams()

    def connect(self) -> None:
        super().connect()
        self._inbox.clear()
        self.open = True

    def close(self) -> None:
        """Let nobody be there on the ground."""
        self.open = False
        self.link.write = discard_frame

    def write(self, frame: bytes) -> bool:
        """Send a frame up."""
        return not self.open or super().write(frame)

    # Time.

    def exchange_until(self, now_s: float) -> None:
        self.live(now_s)
        self.hand_over(now_s)

    def live(self, now_s: float) -> None:
        """Let the vehicle live until now, and what it says wait for who reads."""
        trouble = self.trouble
        waiting, self._waiting = self._waiting, []
        if now_s < trouble.frozen_s:
            self.late_s += STEP_S
            return
        if now_s >= trouble.uplink_s and not self._in_burst(now_s):
            for frame in waiting:
                self.vehicle.receive(frame)
        self.vehicle.advance(now_s - self.late_s)
        datagrams = self.vehicle.drain()
        if now_s < trouble.downlink_s or not self.open or self._in_burst(now_s):
            return
        for datagram in datagrams:
            if len(self._inbox) < WAITING:
                self._inbox.append(datagram)

    def hand_over(self, now_s: float) -> None:
        """Let the ground station read what has come."""
        if now_s < self.trouble.garbage_s:
            self._noise()
        if now_s < self.trouble.held_s:
            return
        codec = self._router.codec
        while self._inbox:
            received = codec.decode(self._inbox.popleft())
            if self.dropped or self.trouble.gps_s > now_s:
                received = (one for one in map(self._spoilt(now_s), received) if one is not None)
            self._router.route_frames(received, self.write, self._place)

    def drain_truths(self) -> list[Truth]:
        truths = super().drain_truths()
        return [replace(one, t_s=one.t_s + self.late_s) for one in truths] if self.late_s else truths

    def _in_burst(self, now_s: float) -> bool:
        """Return whether a link that comes and goes is gone: 3 s in 5."""
        return now_s < self.trouble.bursts_s and now_s % 5.0 < 3.0

    def _spoilt(self, now_s: float) -> Callable[[DecodedFrame], DecodedFrame | None]:
        kinds = tuple(kind for sort, until_s in self.dropped.items() if now_s < until_s for kind in DROPPED[sort])

        def spoilt(received: DecodedFrame) -> DecodedFrame | None:
            message = received.message
            if isinstance(message, kinds):
                return None
            if isinstance(message, Position) and now_s < self.trouble.gps_s:
                moved = replace(message, lat_deg=message.lat_deg + self.trouble.gps_m * E7_DEG_M * 1e-7)
                return replace(received, message=moved)
            return received

        return spoilt

    # Others on the air.

    def forge(self, message: Outbound, *, component: int = 1, sysid: int | None = None) -> None:
        """Send a frame in somebody's name from another address."""
        frame = Transmitter(self.sysid if sysid is None else sysid, component=component).encode(message)
        if self.open:
            self._router.route_frames(self._router.codec.decode(frame), lambda _: True, "10.9.9.9:40000")

    def forge_disarmed(self, component: int) -> None:
        """Say that it is disarmed on the ground."""
        kind = 3 if type(self.vehicle.autopilot).__name__ == "ArduPilot" else 12
        self.forge(
            build_message(
                "HEARTBEAT", type=2, autopilot=kind, base_mode=1, custom_mode=0, system_status=3, mavlink_version=3
            ),
            component=component,
        )

    def forge_position(self) -> None:
        """Say that it is where nobody is."""
        self.forge(build_message(
            "GLOBAL_POSITION_INT", time_boot_ms=1000, lat=INT32_MIN, lon=INT32_MIN, alt=INT32_MIN,
            relative_alt=INT32_MIN, vx=0, vy=0, vz=0, hdg=65535,
        ))  # fmt: skip

    def forge_text(self, text: str) -> None:
        """Say something grave."""
        self.forge(build_message("STATUSTEXT", severity=2, text=text.encode(), id=0, chunk_seq=0))

    def forge_radio(self) -> None:
        """Speak as a radio somewhere else."""
        radio = build_message(
            "RADIO_STATUS", rssi=5, remrssi=5, txbuf=0, noise=200, remnoise=200, rxerrors=999, fixed=0
        )
        self.forge(radio, component=68, sysid=51)

    def upload(self) -> None:
        """Let another ground station put half of its mission on board."""
        autopilot = self.vehicle.autopilot
        items = autopilot.store.items[: max(2, len(autopilot.store.items) // 2)]
        autopilot.receive(Order(Peer(OTHER_STATION, STATION_COMPONENT), MissionCount(len(items), 0)))
        for item in items:
            autopilot.receive(Order(Peer(OTHER_STATION, STATION_COMPONENT), ItemReceived(item, MissionKind.MISSION)))

    def _noise(self) -> None:
        size = self._rng.randrange(1, 200)
        noise = self._rng.randbytes(size)
        marked = bytes([self._rng.choice([0xFD, 0xFE]), size & 0xFF]) + noise
        if self.open:
            self._router.route_frames(self._router.codec.decode(marked), lambda _: True, "10.9.9.9:40000")


def suffers(air: Air, one: Happening, now_s: float) -> bool:
    """Let a trouble of the link begin; returns whether it was one."""
    until_s, trouble = now_s + one.for_s, air.trouble
    match one.kind:
        case "uplink lost":
            trouble.uplink_s = until_s
        case "downlink lost":
            trouble.downlink_s = until_s
        case "held up":
            trouble.held_s = until_s
        case "bursts":
            trouble.bursts_s = until_s
        case "frozen":
            trouble.frozen_s = max(trouble.frozen_s, until_s)
        case "garbage":
            trouble.garbage_s = until_s
        case "gps jump":
            trouble.gps_s, trouble.gps_m = until_s, one.value
        case "no position" | "no heartbeat" | "no battery":
            air.dropped[one.kind] = until_s
        case "forged disarmed":
            air.forge_disarmed(int(one.word))
        case "forged position":
            air.forge_position()
        case "forged text":
            air.forge_text(one.word)
        case "forged radio":
            air.forge_radio()
        case "foreign mission":
            air.upload()
        case _:
            return False
    return True
