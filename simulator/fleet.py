"""Simulated vehicles on their links, and a fleet of them on UDP in one event loop, at any speed."""

from __future__ import annotations

import asyncio
import heapq
import math
import random
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import cast

from simulator.ardupilot import ArduPilot
from simulator.autopilot import STEP_S, Autopilot
from simulator.camera import GIMBAL, CapturedImage
from simulator.common_time import LOOK_REAL_S, Stations
from simulator.config import AutopilotKind, SimFleet, SimVehicle, parse_vehicle_endpoint
from simulator.fault_kinds import LINK_FAULTS, LINK_FIELDS, Injection, InjectionKind, faults_of, is_due
from simulator.messages import Command, Heartbeat, Peer, Received, build_message
from simulator.mission_store import UploadFault
from simulator.px4 import Px4
from simulator.radio import Radio, build_radios, parse_radio
from simulator.truth import Truth
from simulator.wire import Codec

REORDER_HOLD_S = (0.02, 0.2)
"""Delay of a reordered datagram, simulated."""
QUEUE_BYTES = 2048
"""Queue of a radio; the excess is lost (SiK, serial.c: 1850)."""


@dataclass(slots=True)
class LinkCondition:
    """Condition of a vehicle's link, shared by both directions."""

    loss: float = 0.0
    """Share of datagrams lost."""
    delay_s: float = 0.0
    duplicate: float = 0.0
    """Share of datagrams duplicated."""
    reorder: float = 0.0
    """Share of datagrams reordered."""
    rate_bytes_s: float = math.inf
    """Throughput in each direction."""
    silent_until_s: float = -math.inf
    """Simulated time until which the link is dead."""


class Channel:
    """Carry datagrams in one direction; times are simulated seconds."""

    def __init__(self, condition: LinkCondition, rng: random.Random) -> None:
        self._condition = condition
        self._rng = rng
        self._held: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._free_s = -math.inf
        """Time at which its queue is empty."""

    def offer(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram sent at ``now_s``."""
        condition = self._condition
        if now_s < condition.silent_until_s or self._draw_chance(condition.loss):
            return
        waits_s = max(0.0, self._free_s - now_s)
        if waits_s > QUEUE_BYTES / condition.rate_bytes_s:
            return
        self._free_s = now_s + waits_s + len(datagram) / condition.rate_bytes_s
        for _ in range(2 if self._draw_chance(condition.duplicate) else 1):
            late_s = self._rng.uniform(*REORDER_HOLD_S) if self._draw_chance(condition.reorder) else 0.0
            heapq.heappush(self._held, (self._free_s + condition.delay_s + late_s, self._count, datagram))
            self._count += 1

    def take_due(self, now_s: float) -> list[bytes]:
        """Return datagrams that arrive by ``now_s``, in order of arrival; those that arrive in a silence are lost."""
        arrived = []
        while self._held and self._held[0][0] <= now_s:
            at_s, _, datagram = heapq.heappop(self._held)
            if at_s >= self._condition.silent_until_s:
                arrived.append(datagram)
        return arrived

    def _draw_chance(self, share: float) -> bool:
        return share > 0 and self._rng.random() < share


STATION_COMPONENT = 190
"""Component id of the other ground station."""


def make_autopilot(vehicle: SimVehicle) -> Autopilot:
    """Return the vehicle's autopilot."""
    return ArduPilot(vehicle) if vehicle.autopilot is AutopilotKind.ARDUPILOT else Px4(vehicle)


class _Line:
    """One link of a vehicle: it numbers its own frames and has its own link condition."""

    def __init__(self, vehicle: SimVehicle, number: int, components: frozenset[int], radio: Radio | None) -> None:
        self.radio, signing, ardupilot = radio, vehicle.signing, vehicle.autopilot is AutopilotKind.ARDUPILOT
        self.codec = Codec(vehicle.sysid, every_component=ardupilot, signing=signing, others=components)
        self.components = {one: Codec(vehicle.sysid, component=one, signing=signing) for one in (*components, GIMBAL)}
        """Codecs of cameras and gimbal, which number their own frames."""
        self.condition = LinkCondition()
        rng = random.Random(f"{vehicle.seed}:{vehicle.name}" + (f":{number}" if number else ""))
        self.up, self.down = Channel(self.condition, rng), Channel(self.condition, rng)


class SimulatedVehicle:
    """An autopilot on one or several imperfect links; all times are simulated seconds."""

    def __init__(
        self,
        vehicle: SimVehicle,
        faults: Iterable[Injection] = (),
        radios: Sequence[Radio | None] = (),
        place: int = 0,
    ) -> None:
        """Switch it on; `radios` are those of its links, and `place` its index on them."""
        self._place = place
        self.name = vehicle.name
        self.autopilot = make_autopilot(vehicle)
        payload = self.autopilot.payload
        speaking = frozenset(one.config.id for one in ([] if payload is None else payload.units) if one.speaks)
        self._lines = [
            _Line(vehicle, number, speaking, radio)
            for number, (_, radio) in enumerate(zip_longest(vehicle.connections, radios[: len(vehicle.connections)]))
        ]
        self._pending = list(faults_of(faults, vehicle.name))
        self._stranger = Peer(vehicle.other_station, STATION_COMPONENT)
        self._station: Codec | None = None
        """Codec of the other ground station, once it appears."""
        self._station_beat_s = 0.0
        self._now_s = 0.0
        self.tap: Callable[[bytes, bool], None] | None = None
        """Called with frames from (True) and to (False) ground stations."""
        self._inject()

    @property
    def now_s(self) -> float:
        """Simulated time reached."""
        return self._now_s

    @property
    def links(self) -> int:
        """Number of links."""
        return len(self._lines)

    @property
    def radio(self) -> Radio | None:
        """Radio of its first link."""
        return self._lines[0].radio

    def receive(self, datagram: bytes, link: int = 0) -> None:
        """Take a datagram from a ground station on one link; an answer may be ready immediately."""
        if self.tap is not None:
            self.tap(datagram, True)
        line = self._lines[link]
        if line.radio is not None:
            line.radio.send(self._place, datagram, self._now_s, up=True)
            return
        line.up.offer(datagram, self._now_s)
        self._deliver()

    def advance(self, until_s: float) -> None:
        """Run until ``until_s``, in whole steps."""
        while self._now_s + STEP_S <= until_s + 1e-9:
            self._now_s += STEP_S
            for line in self._lines:
                if line.radio is not None:
                    for datagram in line.radio.take(self._place, self._now_s, up=True):
                        line.up.offer(datagram, self._now_s)
            self._deliver()
            self.autopilot.advance(self._now_s)
            self._inject()
            self._send_station_heartbeat()
            self._collect()

    def drain(self, link: int = 0) -> list[bytes]:
        """Remove and return the datagrams that have reached the ground stations on one link."""
        self._collect()
        line = self._lines[link]
        arrived = line.down.take_due(self._now_s)
        if line.radio is not None:
            for datagram in arrived:
                line.radio.send(self._place, datagram, self._now_s, up=False)
            arrived = line.radio.take(self._place, self._now_s, up=False)
        if self.tap is not None:
            for datagram in arrived:
                self.tap(datagram, False)
        return arrived

    def drain_truths(self, unix_s: Callable[[float], float]) -> list[Truth]:
        """Remove and return true events, with global position and the time of a machine's clock."""
        truths = []
        for event in self.autopilot.frame.drain_events():
            lat_e7, lon_e7 = self.autopilot.home.lat_lon_e7(event.place.east_m, event.place.north_m)
            truths.append(
                Truth(
                    self.name, event.what, event.t_s, unix_s(event.t_s), event.sender, lat_e7 / 1e7, lon_e7 / 1e7,
                    event.place.up_m, event.charge_pct,
                )
            )  # fmt: skip
        return truths

    def drain_shots(self) -> list[CapturedImage]:
        """Remove and return new images on its cameras' cards."""
        return [] if self.autopilot.payload is None else self.autopilot.payload.drain_shots()

    def _deliver(self) -> None:
        for number, line in enumerate(self._lines):
            for datagram in line.up.take_due(self._now_s):
                for received in line.codec.decode(datagram):
                    payload = self.autopilot.payload
                    if payload is not None and received.component in line.components:
                        if isinstance(received.body, Command):
                            payload.answer_component_command(received.body, received.component)
                    else:
                        self.autopilot.receive(replace(received, sender=replace(received.sender, link=number)))

    def _collect(self) -> None:
        messages = self.autopilot.voice.drain()
        if not self.autopilot.is_mute:
            for link, message in messages:
                for line in self._lines if link is None else (self._lines[link],):
                    line.down.offer(line.codec.encode(message, self._now_s), self._now_s)
        if self.autopilot.payload is not None and self.autopilot.frame.crashed_s is None:
            for said in self.autopilot.payload.drain():
                for line in self._lines:
                    codec = line.codec if said.component is None else line.components[said.component]
                    line.down.offer(codec.encode(said.message, self._now_s), self._now_s)

    def _inject(self) -> None:
        if not self._pending:
            return
        mission_s, share, frame = self.autopilot.mission_s, self.autopilot.flown_share, self.autopilot.frame
        up_m, highest_m = frame.body.up_m, frame.highest_m
        landings = self.autopilot.landings
        due = [fault for fault in self._pending if is_due(fault, mission_s, share, up_m, highest_m, landings)]
        if due:
            self._pending = [fault for fault in self._pending if fault not in due]
            for fault in due:
                self.apply_injection(fault)

    def schedule_injection(self, fault: Injection) -> None:
        """Schedule a fault in this vehicle's time."""
        self._pending.append(fault)

    def apply_injection(self, fault: Injection) -> None:
        """Apply a fault now, whatever its trigger."""
        self.autopilot.frame.record_event(f"fault {fault.spec}")
        if fault.kind in LINK_FAULTS:
            lines = self._lines if fault.link == 0 else [self._lines[fault.link - 1]]
            for line in lines:
                if fault.kind is InjectionKind.SILENT:
                    line.condition.silent_until_s = self._now_s + (fault.value or math.inf)
                else:
                    setattr(line.condition, LINK_FIELDS[fault.kind], fault.value or 0.0)
            return
        self._apply(fault.kind, fault.value or 0.0, fault.word)

    def _apply(self, kind: InjectionKind, value: float, word: str) -> None:
        frame = self.autopilot.frame
        match kind:
            case InjectionKind.BATTERY_STEP:
                frame.battery.remove_charge(value)
            case InjectionKind.DRAIN:
                frame.battery.drain_factor = value
            case InjectionKind.GPS:
                self.autopilot.positioning.lose(self.autopilot.now_s, value)
            case InjectionKind.CRASH:
                frame.lose_thrust()
            case InjectionKind.REBOOT:
                self.autopilot.reboot(on_pad=word == "pad")
            case InjectionKind.STATION:
                # From now on the other ground station sends heartbeats.
                if self._station is None:
                    self._station = Codec(self._stranger.sysid, component=self._stranger.compid)
                    self._station_beat_s = self._now_s
                self.autopilot.frame.record_event(f"station {word}")
                self.autopilot.receive(Received(self._stranger, self.autopilot.build_mode_order(word)))
            case InjectionKind.REFUSE_UPLOAD | InjectionKind.HALF_UPLOAD:
                refuses = kind is InjectionKind.REFUSE_UPLOAD
                for store in self.autopilot.stores:
                    store.fault = UploadFault.REFUSE if refuses else UploadFault.HALF
            case _:
                self.autopilot.apply_injection(kind, word, value)

    def _send_station_heartbeat(self) -> None:
        if self._station is None or self._now_s < self._station_beat_s:
            return
        self._station_beat_s += 1.0
        self.autopilot.receive(Received(self._stranger, Heartbeat(ground_station=True)))
        beat = build_message(
            "HEARTBEAT", type=6, autopilot=8, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
        )
        for line in self._lines:
            line.down.offer(self._station.encode(beat, self._now_s), self._now_s)


def build_vehicles(
    fleet: SimFleet, craft: Callable[[SimVehicle], SimVehicle] = lambda one: one
) -> list[SimulatedVehicle]:
    """Return the vehicles of a fleet, on their radio if any; `craft` changes each before it is built.

    Raises:
        SimulatorError: there is no such radio.
    """
    crafts = [craft(one) for one in fleet.vehicles]
    if not crafts:
        return []
    radios: list[Sequence[Radio | None]] = [
        build_radios(parse_radio(one), len(crafts), f"{crafts[0].seed}:{number}" if number else crafts[0].seed)
        if one.strip()
        else [None] * len(crafts)
        for number, one in enumerate(fleet.radio.split(","))
    ]
    return [
        SimulatedVehicle(one, fleet.faults, [of_all[place] for of_all in radios], place)
        for place, one in enumerate(crafts)
    ]


Address = tuple[str, int]

PEER_S = 10.0
"""Silence in real seconds after which the vehicle stops sending to a ground station."""
TICK_S = (0.005, 0.05)
"""Shortest and longest real pause between two steps."""
CHUNK_STEPS = 40
"""Most steps between two reads of the sockets: after a stall, waiting heartbeats must be read before the vehicle's
time-outs expire."""
MAX_LAG_S = 2.0
"""Longest stall in real seconds that is caught up; after a longer one the vehicles' clocks lag, as in a suspended
process."""


class UdpLink(asyncio.DatagramProtocol):
    """UDP socket of one link, and its listeners in the same process."""

    def __init__(self, vehicle: SimulatedVehicle, number: int, target: Address | None) -> None:
        self.vehicle, self._number = vehicle, number
        self.target = target
        """Address to send to."""
        self.listeners: list[Callable[[bytes], None]] = []
        """Listeners without a socket."""
        self.heard = 0
        """Number of datagrams received."""
        self._loop = asyncio.get_running_loop()
        self._heard_s: dict[Address, float] = {}
        self._transport: asyncio.DatagramTransport | None = None
        self._closed = asyncio.Event()

    @property
    def address(self) -> Address:
        """Address on which it listens; the system has chosen the port if none was given."""
        host, port = ("", 0) if self._transport is None else self._transport.get_extra_info("sockname")
        return host, port

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport."""
        # asyncio's own datagram transport is no subclass of the class that its documentation names (3.11).
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """Handle a ground station's datagram, and answer immediately."""
        self._heard_s[addr] = self._loop.time()
        self.receive(data)

    def receive(self, data: bytes) -> None:
        """Handle a datagram from the same process."""
        self.heard += 1
        self.vehicle.receive(data, self._number)
        self.flush()

    def error_received(self, exc: Exception) -> None:
        """Ignore that no ground station listens yet or any more: a vehicle keeps sending."""

    def flush(self) -> None:
        """Send pending datagrams to every recently heard ground station and to the configured target."""
        datagrams = self.vehicle.drain(self._number)
        if not datagrams or self._transport is None:
            return
        oldest_s = self._loop.time() - PEER_S
        peers = {addr for addr, heard_s in self._heard_s.items() if heard_s >= oldest_s}
        if self.target is not None:
            peers.add(self.target)
        for addr in peers:
            for datagram in datagrams:
                self._transport.sendto(datagram, addr)
        for hear in self.listeners:
            for datagram in datagrams:
                self._loop.call_soon(hear, datagram)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Record that the socket is closed."""
        self._closed.set()

    async def close(self) -> None:
        """Close the socket, and wait until it is closed."""
        if self._transport is not None:
            self._transport.close()
            await self._closed.wait()


class SimClock:
    """Simulated time that follows a monotonic clock and never jumps over a long stall."""

    def __init__(self, speedup: float, *, monotonic_s: float, unix_s: float) -> None:
        self._speedup = speedup
        self._origin_s = monotonic_s
        self._unix_s = unix_s

    def now_s(self, lived_s: float, monotonic_s: float, *, dated: bool = True) -> float:
        """Return the simulated time that the fleet should reach, given the time it has reached.

        Args:
            lived_s: Simulated time reached.
            monotonic_s: Now.
            dated: Whether dates follow the computer's clock; without it they follow simulated time only.
        """
        due_s = (monotonic_s - self._origin_s) * self._speedup
        excess_s = due_s - lived_s - MAX_LAG_S * self._speedup
        if excess_s > 0:
            self._origin_s += excess_s / self._speedup
            self._unix_s += excess_s / self._speedup if dated else 0.0
            due_s -= excess_s
        return due_s

    def unix_s(self, at_s: float) -> float:
        """Return this machine's time of day at a simulated time."""
        return self._unix_s + at_s / self._speedup


async def run_fleet(
    fleet: SimFleet,
    *,
    stop: asyncio.Event,
    on_truth: Callable[[Truth], None],
    watched: Callable[[Sequence[SimulatedVehicle]], None] = lambda _: None,
) -> None:
    """Run the fleet until ``stop`` is set.

    Args:
        fleet: the fleet.
        stop: ends it.
        on_truth: receives true events.
        watched: receives the vehicles after each step of all.

    Raises:
        OSError: a port is taken.
    """
    vehicles = build_vehicles(fleet)
    async with open_sockets(fleet, vehicles) as links:
        await fly_vehicles(fleet, links, stop=stop, on_truth=on_truth, watched=watched)


@asynccontextmanager
async def open_sockets(fleet: SimFleet, vehicles: Sequence[SimulatedVehicle]) -> AsyncIterator[list[UdpLink]]:
    """Open the vehicles' sockets, one per link, in their order.

    Raises:
        OSError: a port is taken.
    """
    loop = asyncio.get_running_loop()
    links: list[UdpLink] = []
    try:
        for config, vehicle in zip(fleet.vehicles, vehicles, strict=True):
            for number, endpoint in enumerate(map(parse_vehicle_endpoint, config.connections)):
                link = UdpLink(vehicle, number, endpoint.target)
                await loop.create_datagram_endpoint(lambda link=link: link, local_addr=endpoint.bind)  # type: ignore[misc]
                links.append(link)
        yield links
    finally:
        for link in links:
            await link.close()


async def fly_vehicles(
    fleet: SimFleet,
    links: Sequence[UdpLink],
    *,
    stop: asyncio.Event,
    on_truth: Callable[[Truth], None],
    watched: Callable[[Sequence[SimulatedVehicle]], None] = lambda _: None,
) -> None:
    """Run as `run_fleet` does, for vehicles with open sockets; time is that of the running loop."""
    loop = asyncio.get_running_loop()
    clock = SimClock(fleet.speedup, monotonic_s=loop.time(), unix_s=time.time())
    async with _keep_common_time(fleet.speedup, clock, links) as stations:
        tick_s = min(max(STEP_S / stations.speedup, TICK_S[0]), TICK_S[1])
        lived_s = 0.0
        while not stop.is_set():
            stations.moved.clear()
            due_s = clock.now_s(lived_s, loop.time(), dated=not stations.ever)
            behind = due_s - lived_s > CHUNK_STEPS * STEP_S
            wanted_s = lived_s + CHUNK_STEPS * STEP_S if behind else due_s
            # It may have advanced further while a ground station was stopped.
            until_s = max(lived_s, stations.safe_time_s())
            lived_s = min(wanted_s, until_s)
            watched(live_until(links, lived_s, clock.unix_s, on_truth))
            stations.send_time(lived_s)
            if lived_s < wanted_s:
                await _pause(stations.moved, LOOK_REAL_S / 5)
            else:
                await _pause(stop, 0.0 if behind else tick_s)


@asynccontextmanager
async def _keep_common_time(speedup: float, clock: SimClock, links: Sequence[UdpLink]) -> AsyncIterator[Stations]:
    """Synchronise time with ground stations that connect to the first link's port, unless it runs in real time."""
    stations = Stations(speedup, clock.unix_s)
    server: asyncio.Server | None = None
    if speedup > 1:
        _, port = links[0].target or links[0].address
        with suppress(OSError):  # another program has the port: the fleet keeps its own time, as for any station
            server = await stations.open(port)
    try:
        yield stations
    finally:
        stations.close()
        if server is not None:
            server.close()


def live_until(
    links: Sequence[UdpLink], until_s: float, unix_s: Callable[[float], float], on_truth: Callable[[Truth], None]
) -> list[SimulatedVehicle]:
    """Run the vehicles behind links until a simulated time, and send their output; returns them."""
    of_vehicles: dict[SimulatedVehicle, list[UdpLink]] = {}
    for link in links:
        of_vehicles.setdefault(link.vehicle, []).append(link)
    for vehicle, own in of_vehicles.items():
        vehicle.advance(until_s)
        for truth in vehicle.drain_truths(unix_s):
            on_truth(truth)
        for link in own:
            link.flush()
    return list(of_vehicles)


async def _pause(end: asyncio.Event, seconds: float) -> None:
    """Let the sockets be read for a while, or until the end."""
    if seconds == 0.0:
        await asyncio.sleep(0)
        return
    try:
        async with asyncio.timeout(seconds):
            await end.wait()
    except TimeoutError:
        return
