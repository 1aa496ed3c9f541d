"""The way between a simulated vehicle and the ground station, in memory: datagrams as they are, and no socket."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, Tap, VehicleLink, Write, leave_frame
from simulator.autopilot import STEP_S
from simulator.fleet import SimulatedVehicle
from simulator.truth import Truth

UNREAD = ("LOCAL_POSITION_NED", "VFR_HUD", "SYSTEM_TIME", "TIMESYNC")
"""Streams that nobody reads here: a tenth of all work is spared without them."""


class MemoryRadio:
    """One vehicle and its link; the vehicle lives as it is told the time."""

    def __init__(self, vehicle: SimulatedVehicle, sysid: int) -> None:
        """Connect them."""
        self.vehicle, self.sysid = vehicle, sysid
        self.connect()

    def connect(self) -> None:
        """Begin anew on the ground's side, as a new process does."""
        codec = MavlinkCodec()
        link = VehicleLink(self.sysid, codec)
        self.join(link, Router([link], codec), self.write)
        self._waiting: list[bytes] = []

    def join(self, link: VehicleLink, router: Router, write: Write) -> None:
        """Be reached with `write`, and bring what comes down to a router."""
        self.link, self._router, self._write_up = link, router, write
        link.write = write

    def write(self, frame: bytes) -> bool:
        """Send a frame up; it is there with the next step."""
        self._waiting.append(frame)
        return True

    def exchange_until(self, now_s: float) -> None:
        """Live until now, both ways."""
        waiting, self._waiting = self._waiting, []
        for frame in waiting:
            self.vehicle.receive(frame)
        self.vehicle.advance(now_s)
        for datagram in self.vehicle.drain():
            self.receive(datagram)

    def receive(self, datagram: bytes) -> None:
        """Take what has come down."""
        self._router.route_frames(self._router.codec.decode(datagram), self._write_up)

    def drain_truths(self) -> list[Truth]:
        """Take away what really happened, dated by the flight's clock."""
        return self.vehicle.drain_truths(lambda at_s: at_s)

    def stop_unread_streams(self) -> None:
        """Stop the streams that nobody reads."""
        for name in UNREAD:
            self.vehicle.autopilot.streams.set_interval(name, -1.0, 0.0)


def share_port(radios: Sequence[MemoryRadio], codec: MavlinkCodec | None = None, tap: Tap = leave_frame) -> None:
    """Let vehicles behind one radio be behind one port of the ground station, as a telemetry radio is.

    Args:
        radios: Of the vehicles.
        codec: Of the ground station, if it is not the usual one.
        tap: Is shown what comes, as by a `Router`.
    """
    codec = codec or MavlinkCodec()
    links = [VehicleLink(one.sysid, codec) for one in radios]
    router = Router(links, codec, tap)
    for one, link in zip(radios, links, strict=True):
        one.join(link, router, radios[0].write)


async def run_radios(radios: Iterable[MemoryRadio], then: Callable[[float], None], *, every_s: float = STEP_S) -> None:
    """Let everybody live by the loop's time, for ever.

    Args:
        radios: Everybody.
        then: Called with the time after every step.
        every_s: Length of a step: a datagram takes up to this each way.
    """
    loop = asyncio.get_running_loop()
    step = 0
    while True:
        step += 1
        for radio in radios:
            radio.exchange_until(step * every_s)
        then(step * every_s)
        step = max(step, round(loop.time() / every_s))  # the ground station may have kept everybody waiting
        await asyncio.sleep(max(0.0, (step + 1) * every_s - loop.time()))
