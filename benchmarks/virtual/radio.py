"""In-memory link between a simulated vehicle and the ground station: real datagrams, no socket."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, Tap, VehicleLink, Write, leave_frame
from executor.adapters.mavlink.joined_link import JoinedLink
from executor.core.interface.ports import OpenLink
from simulator.autopilot import STEP_S
from simulator.fleet import SimulatedVehicle
from simulator.truth import Truth

UNREAD = ("LOCAL_POSITION_NED", "VFR_HUD", "SYSTEM_TIME", "TIMESYNC")
"""Unused streams: without them a tenth of all work is saved."""


class MemoryRadio:
    """One vehicle and its link; the vehicle advances when the time is set."""

    def __init__(self, vehicle: SimulatedVehicle, sysid: int) -> None:
        """Connect them."""
        self.vehicle, self.sysid = vehicle, sysid
        self.connect()

    def connect(self) -> None:
        """Start again on the ground side, as a new process does."""
        codec = MavlinkCodec()
        link = VehicleLink(self.sysid, codec)
        self.join(link, Router([link], codec), self.write)
        self._waiting: list[bytes] = []

    def join(self, link: VehicleLink, router: Router, write: Write) -> None:
        """Send to the vehicle with `write`, and pass what it sends to a router."""
        self.link, self._router, self._write_up = link, router, write
        link.write = write

    @property
    def end(self) -> OpenLink:
        """The ground station's end."""
        return self.link

    def write(self, frame: bytes) -> bool:
        """Send a frame up; it arrives with the next step."""
        self._waiting.append(frame)
        return True

    def exchange_until(self, now_s: float) -> None:
        """Run until now, in both directions."""
        waiting, self._waiting = self._waiting, []
        for frame in waiting:
            self.vehicle.receive(frame)
        self.vehicle.advance(now_s)
        for datagram in self.vehicle.drain():
            self.receive(datagram)

    def receive(self, datagram: bytes) -> None:
        """Handle a datagram from the vehicle."""
        self._router.route_frames(self._router.codec.decode(datagram), self._write_up)

    def drain_truths(self) -> list[Truth]:
        """Remove and return true events, dated by the flight's clock."""
        return self.vehicle.drain_truths(lambda at_s: at_s)

    def stop_unread_streams(self) -> None:
        """Stop the unused streams."""
        for name in UNREAD:
            for streams in self.vehicle.autopilot.schedules:
                streams.set_interval(name, -1.0, 0.0)


class JoinedRadio(MemoryRadio):
    """One vehicle with several links that appear as one to the ground station; only the first may be shared."""

    def join(self, link: VehicleLink, router: Router, write: Write) -> None:
        """Send with `write` on the first link, and on the others as usual."""
        super().join(link, router, write)
        self._others: list[tuple[Router, Write]] = []
        self._sent: list[tuple[int, bytes]] = []
        links = [link]
        for number in range(1, self.vehicle.links):
            codec = MavlinkCodec()
            links.append(VehicleLink(self.sysid, codec))
            self._others.append((Router([links[-1]], codec), partial(self._write_over, number)))
            links[-1].write = self._others[-1][1]
        for one, connection in zip(links, self.vehicle.autopilot.vehicle.connections, strict=True):
            one.connection = connection
        self._joined = JoinedLink(links, lambda: asyncio.get_running_loop().time())

    @property
    def end(self) -> OpenLink:
        """The ground station's end of all of them."""
        return self._joined

    def _write_over(self, number: int, frame: bytes) -> bool:
        self._sent.append((number, frame))
        return True

    def exchange_until(self, now_s: float) -> None:
        """Run until now, in both directions."""
        sent, self._sent = self._sent, []
        for number, frame in sent:
            self.vehicle.receive(frame, number)
        super().exchange_until(now_s)
        for number, (router, write) in enumerate(self._others, start=1):
            for datagram in self.vehicle.drain(number):
                router.route_frames(router.codec.decode(datagram), write)


def share_port(radios: Sequence[MemoryRadio], codec: MavlinkCodec | None = None, tap: Tap = leave_frame) -> None:
    """Put vehicles behind one radio on one port of the ground station, like a telemetry radio.

    Args:
        radios: Links of the vehicles.
        codec: Codec of the ground station, if not the usual one.
        tap: Receives incoming frames, as in a `Router`.
    """
    codec = codec or MavlinkCodec()
    links = [VehicleLink(one.sysid, codec) for one in radios]
    router = Router(links, codec, tap)
    for one, link in zip(radios, links, strict=True):
        one.join(link, router, radios[0].write)


async def run_radios(radios: Iterable[MemoryRadio], then: Callable[[float], None], *, every_s: float = STEP_S) -> None:
    """Run all vehicles by the loop's time, indefinitely.

    Args:
        radios: All vehicles.
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
        step = max(step, round(loop.time() / every_s))  # the ground station may have blocked all
        await asyncio.sleep(max(0.0, (step + 1) * every_s - loop.time()))
