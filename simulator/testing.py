"""A simulated fleet for the tests of any program that uses MAVLink.

    async with fleet(vehicles=20, autopilot="px4", seed=7, radio="sik64") as f:   # in this event loop
    with fleet(vehicles=3, stepped=True) as f:                                      # in its own thread

Time source: in an event loop, the loop's time, which jumps in `run_virtual`; in a thread, the computer's clock, or with
`stepped` only the test's own calls.
"""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Coroutine, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from types import TracebackType
from typing import Self, TypeVar

from missions.items import MissionItem
from simulator.autopilot import STEP_S
from simulator.client_violations import Violation, find_violations
from simulator.config import PX4_RATE_BYTES_S, AutopilotKind, SimFleet, SimVehicle
from simulator.errors import FleetError
from simulator.fault_kinds import faults_of, parse_fault
from simulator.fleet import SimulatedVehicle, UdpLink, build_vehicles, fly_vehicles, live_until, open_sockets
from simulator.radio import parse_radio
from simulator.transcript import Recorder, format_transcript
from simulator.truth import Truth
from simulator.virtual_loop import run_virtual

__all__ = ["Fleet", "FleetVehicle", "Truth", "VehicleState", "Violation", "fleet", "run_virtual"]

T = TypeVar("T")
HOME = (47.397742, 8.545594, 488.0)
SPACING_M = 20.0
METRES_PER_DEG = 111_320.0
ANY_PORT = "udpout://127.0.0.1:0"
BEAT_S = 1.0
MEMORY = "a link in memory needs a fleet in the client's event loop: async with fleet(...)"
STEPPED = "a stepped fleet lives in a thread of its own: with fleet(..., stepped=True)"
CLOCKED = "this fleet's time passes by itself: only one with stepped=True is advanced"
LAST_TRUTHS = 5
"""Truth lines shown when a wait fails."""
BEGUN: deque[Fleet] = deque(maxlen=10)
"""Last fleets, for reports of failed tests."""


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Ground truth of a vehicle at one moment, whatever it reports."""

    t_s: float
    """Simulated seconds since the fleet began."""
    lat_deg: float
    lon_deg: float
    up_m: float
    """Height above its pad."""
    ground_speed_m_s: float
    armed: bool
    in_air: bool
    mode: str
    """Mode name: PX4's, for example LOITER, MISSION, RETURN; ArduPilot's, for example AUTO, GUIDED, RTL."""
    charge_pct: float
    mission: tuple[MissionItem, ...]
    """Mission on board; ArduPilot's begins with home."""
    parameters: Mapping[str, float]


class FleetVehicle:
    """One vehicle of a fleet."""

    def __init__(self, fleet: Fleet, config: SimVehicle, vehicle: SimulatedVehicle) -> None:
        self.name, self.sysid = config.name, config.sysid
        self.simulated = vehicle
        """The simulated vehicle itself; use only in the fleet's thread, or while the fleet waits."""
        self._fleet, self._config = fleet, config
        self._recorder = Recorder(config.name, lambda: vehicle.now_s)
        vehicle.tap = self._recorder.note
        self.links: Sequence[UdpLink] = ()

    @property
    def connection(self) -> str:
        """Connection string for MAVSDK and faultline: ``udpout://127.0.0.1:PORT``."""
        return f"udpout://127.0.0.1:{self.port}" if self.links[0].target is None else self._config.connections[0]

    @property
    def port(self) -> int:
        """UDP port on which it listens."""
        return self.links[0].address[1]

    @property
    def pymavlink(self) -> str:
        """Connection string for pymavlink and MAVProxy: ``udpout:127.0.0.1:PORT``."""
        return self.connection.replace("://", ":")

    @property
    def truth(self) -> VehicleState:
        """Its ground truth now."""
        return self._fleet.run(self._read_state)

    @property
    def events(self) -> list[str]:
        """Its true events: ``armed``, ``took_off``, ``failsafe link``, ``landed``, as in `Truth.what`."""
        return [truth.what for truth in tuple(self._fleet.truths) if truth.vehicle == self.name]

    def inject(self, fault: str) -> None:
        """Inject a fault into this vehicle, see `Fleet.inject`: ``silent=20s``, ``battery-step=30``, ``crash@40%``."""
        self._fleet.inject(f"{self.name}:{fault}")

    def call(self, port: int, host: str = "127.0.0.1") -> None:
        """Make it send unprompted to a client that listens on a UDP port."""
        self._fleet.run(lambda: setattr(self.links[0], "target", (host, port)))

    def open_link(self, hear: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Connect in memory, without a socket; returns the function that sends to it.

        Args:
            hear: Called by the event loop with each datagram of the vehicle.

        Raises:
            FleetError: the fleet runs in another thread.
        """
        loop, link = self._fleet.require_loop(), self.links[0]
        link.listeners.append(hear)

        def send(datagram: bytes) -> None:
            loop.call_soon(link.receive, datagram)

        return send

    @property
    def transcript(self) -> str:
        """Dialogue between it and its clients, without telemetry and HEARTBEATs."""
        return self._fleet.run(lambda: format_transcript(self._recorder.said))

    def find_violations(self) -> list[Violation]:
        """Return the clients' protocol violations towards it so far."""
        known = [one.sysid for one in self._fleet.vehicles]
        said, vehicle = self._recorder.said, self.simulated
        return self._fleet.run(lambda: find_violations(said, self.sysid, known, vehicle.now_s))

    def _read_state(self) -> VehicleState:
        autopilot = self.simulated.autopilot
        frame, params = autopilot.frame, autopilot.params
        lat_e7, lon_e7 = autopilot.home.lat_lon_e7(frame.body.east_m, frame.body.north_m)
        return VehicleState(
            self.simulated.now_s, lat_e7 / 1e7, lon_e7 / 1e7, frame.body.up_m, frame.body.ground_speed_m_s, frame.armed,
            not frame.body.on_ground, getattr(autopilot.mode, "name", str(autopilot.mode)), frame.battery.charge_pct,
            autopilot.store.items, {name: params[name] for name in params},
        )  # fmt: skip


class Fleet:
    """Simulated vehicles for one test: ``with`` runs them in their own thread, ``async with`` in the test's loop.

    All times are simulated: seconds since the start, at any speed.
    """

    def __init__(
        self,
        config: SimFleet,
        *,
        stepped: bool = False,
        watch: Callable[[Sequence[SimulatedVehicle]], None] = lambda _: None,
    ) -> None:
        """Build the vehicles without starting them.

        Args:
            config: The fleet.
            stepped: Whether time passes only in `advance` and `wait_until`.
            watch: Called with the vehicles after each step of all.

        Raises:
            SimulatorError: there is no such radio.
        """
        self.config, self._stepped, self._watch = config, stepped, watch
        self.truths: list[Truth] = []
        """Ground truth, in order."""
        self.vehicles = tuple(
            FleetVehicle(self, one, vehicle)
            for one, vehicle in zip(config.vehicles, build_vehicles(config), strict=True)
        )
        self._links: Sequence[UdpLink] = ()
        self._loop: asyncio.AbstractEventLoop
        self._stop = asyncio.Event()
        self._thread: threading.Thread | None = None
        self._flying: asyncio.Task[None] | None = None
        self._failure: BaseException | None = None
        self._ready: Future[None] = Future()
        self._began_unix_s = 0.0
        self._waits: list[tuple[Callable[[], bool], float, asyncio.Future[bool]]] = []

    def __getitem__(self, key: str | int) -> FleetVehicle:
        """Return a vehicle by name, or by index from 0."""
        return self.vehicles[key] if isinstance(key, int) else {one.name: one for one in self.vehicles}[key]

    def __iter__(self) -> Iterator[FleetVehicle]:
        """Iterate over the vehicles."""
        return iter(self.vehicles)

    def __len__(self) -> int:
        """Return the number of vehicles."""
        return len(self.vehicles)

    @property
    def connections(self) -> list[str]:
        """Connection strings of all vehicles for MAVSDK."""
        return [vehicle.connection for vehicle in self.vehicles]

    @property
    def now_s(self) -> float:
        """Simulated time reached."""
        return self.run(lambda: self.vehicles[0].simulated.now_s)

    def inject(self, fault: str) -> None:
        """Inject a fault in the grammar of ``faultline simulate --fault``; without ``@WHEN`` it happens now.

        ``uav2:silent=20s``, ``all:loss=0.2``, ``uav1:crash@40%``.

        Raises:
            FaultSpecError: it cannot be read, or names a vehicle that is not there.
        """
        now = "@" not in fault
        parsed = parse_fault(f"{fault}@0s" if now else fault)
        self.config.check_fault(parsed)

        def order() -> None:
            for vehicle in self.vehicles:
                for one in faults_of([parsed], vehicle.name):
                    (vehicle.simulated.apply_injection if now else vehicle.simulated.schedule_injection)(one)

        self.run(order)

    @property
    def transcript(self) -> str:
        """Dialogues of all vehicles, one after the other."""
        return "\n".join(filter(None, (vehicle.transcript for vehicle in self.vehicles)))

    def find_violations(self) -> list[Violation]:
        """Return the clients' protocol violations so far, in order of time."""
        found = [one for vehicle in self.vehicles for one in vehicle.find_violations()]
        return sorted(found, key=lambda one: one.t_s)

    def check_client(self, *, but: Collection[str] = ()) -> None:
        """Fail if a client violated the protocol.

        Args:
            but: Categories to ignore, of ``upload``, ``download``, ``heartbeat``, ``address``, ``numbering``.

        Raises:
            AssertionError: lists the violations, with the dialogue of the vehicles concerned.
        """
        found = [one for one in self.find_violations() if one.about not in but]
        if found:
            concerned = dict.fromkeys(one.vehicle for one in found)
            dialogues = [self[name].transcript for name in concerned]
            raise AssertionError("\n".join(["the client did wrong:", *map(str, found), "the dialogue:", *dialogues]))

    # Time.

    def advance(self, seconds: float, beat: Callable[[], None] = lambda: None) -> None:
        """Advance simulated time of a stepped fleet.

        Args:
            seconds: Simulated seconds to advance.
            beat: Called before each second, for a client's periodic work, for example its HEARTBEAT.
        """
        self._live_until(self.now_s + seconds, lambda: False, beat)

    def wait_until(
        self, is_so: Callable[[], bool], limit_s: float = 600.0, beat: Callable[[], None] = lambda: None
    ) -> None:
        """Wait until a condition holds; a stepped fleet runs until then.

        Args:
            is_so: Called by the fleet after each step: read truths there, and do not block.
            limit_s: Simulated seconds.
            beat: As for `advance`.

        Raises:
            TimeoutError: the condition did not hold in time.
        """
        until_s = self.now_s + limit_s
        if self._stepped:
            so = self._live_until(until_s, is_so, beat)
        else:
            so = self._submit(self._wait(is_so, until_s)).result()
        self._require(so, limit_s)

    async def wait_for(self, is_so: Callable[[], bool], limit_s: float = 600.0) -> None:
        """Wait as `wait_until` does, in the event loop of the fleet.

        Raises:
            TimeoutError: the condition did not hold in time.
        """
        self._require(await self._wait(is_so, self.now_s + limit_s), limit_s)

    # Life cycle.

    def __enter__(self) -> Self:
        """Start in a thread.

        Raises:
            OSError: a port is taken.
        """
        self._thread = threading.Thread(target=self._live_in_thread, name="simulated fleet", daemon=True)
        self._thread.start()
        self._ready.result()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """Stop, and raise any error of the fleet."""
        self.run(self._stop.set)
        if self._thread is not None:
            self._thread.join()
        if self._failure is not None:
            raise self._failure

    async def __aenter__(self) -> Self:
        """Start in the running loop.

        Raises:
            OSError: a port is taken.
            FleetError: it is stepped.
        """
        if self._stepped:
            raise FleetError(STEPPED)
        self._flying = asyncio.create_task(self._live())
        waiting = asyncio.wrap_future(self._ready)
        await asyncio.wait([self._flying, waiting], return_when=asyncio.FIRST_COMPLETED)
        if self._flying.done():
            waiting.cancel()
            await self._flying
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """Stop, and raise any error of the fleet."""
        self._stop.set()
        if self._flying is not None:
            await self._flying

    def run(self, work: Callable[[], T]) -> T:
        """Run a function between two steps of the fleet, in the fleet's own thread if it has one."""
        thread = self._thread
        if thread is None or thread is threading.current_thread() or not thread.is_alive():
            return work()

        done: Future[T] = Future()

        def do() -> None:
            try:
                done.set_result(work())
            except BaseException as failure:  # noqa: BLE001 - raised in the thread of the test
                done.set_exception(failure)

        try:
            self._loop.call_soon_threadsafe(do)
        except RuntimeError:  # it has just ended
            return work()
        return done.result()

    def require_loop(self) -> asyncio.AbstractEventLoop:
        """Return the running loop if the fleet runs in it.

        Raises:
            FleetError: it does not.
        """
        if self._flying is None:
            raise FleetError(MEMORY)
        return self._loop

    def _submit(self, work: Coroutine[None, None, T]) -> Future[T]:
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    def _live_in_thread(self) -> None:
        try:
            asyncio.run(self._live())
        except BaseException as failure:  # noqa: BLE001 - raised in the thread of the test
            self._failure = failure
            if not self._ready.done():
                self._ready.set_exception(failure)

    async def _live(self) -> None:
        """Run until the end of the block."""
        self._loop, self._began_unix_s = asyncio.get_running_loop(), time.time()
        try:
            async with open_sockets(self.config, [one.simulated for one in self.vehicles]) as self._links:
                for vehicle in self.vehicles:
                    vehicle.links = [link for link in self._links if link.vehicle is vehicle.simulated]
                BEGUN.append(self)
                if self._stepped:
                    self._look([])
                    await self._stop.wait()
                else:
                    await fly_vehicles(
                        self.config, self._links, stop=self._stop, on_truth=self.truths.append, watched=self._look
                    )
        finally:
            for _, _, waiting in self._waits:
                waiting.cancel()

    def _look(self, vehicles: Sequence[SimulatedVehicle]) -> None:
        """Resolve waiting conditions after all vehicles have advanced."""
        self._watch(vehicles)
        if not self._ready.done():
            self._ready.set_result(None)
        self._waits = [one for one in self._waits if not one[2].done()]
        for is_so, until_s, waiting in self._waits:
            try:
                if (so := is_so()) or self.now_s >= until_s:
                    waiting.set_result(so)
            except Exception as failure:  # noqa: BLE001 - raised where it is waited
                waiting.set_exception(failure)

    async def _wait(self, is_so: Callable[[], bool], until_s: float) -> bool:
        waiting: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self._waits.append((is_so, until_s, waiting))
        return await waiting

    def _live_until(self, until_s: float, is_so: Callable[[], bool], beat: Callable[[], None]) -> bool:
        """Step, and return whether the condition held."""
        if not self._stepped:
            raise FleetError(CLOCKED)
        while True:
            beat()
            next_s = min(self.now_s + BEAT_S, until_s)
            if self._submit(self._step_until(next_s, is_so)).result():
                return True
            if next_s >= until_s:
                return False

    async def _step_until(self, until_s: float, is_so: Callable[[], bool]) -> bool:
        while True:
            await self._hear_all()
            self._watch(live_until(self._links, (now_s := self.now_s), self._date_unix_s, self.truths.append))
            if is_so():
                return True
            if now_s >= until_s - STEP_S / 2:
                return False
            live_until(self._links, now_s + STEP_S, self._date_unix_s, self.truths.append)

    async def _hear_all(self) -> None:
        """Read everything that waits at the sockets."""
        heard = -1
        while heard != (heard := sum(link.heard for link in self._links)):
            await asyncio.sleep(0)  # poll the sockets
            await asyncio.sleep(0)  # read them

    def _date_unix_s(self, at_s: float) -> float:
        return self._began_unix_s + at_s

    def _require(self, so: bool, limit_s: float) -> None:
        if not so:
            last = "; ".join(f"{one.vehicle} {one.what} at {one.t_s:.1f} s" for one in self.truths[-LAST_TRUTHS:])
            raise TimeoutError(f"not so within {limit_s:g} simulated seconds; last happened: {last or 'nothing'}")


def fleet(  # noqa: PLR0913 - what is simulated, and how
    vehicles: int | Sequence[SimVehicle] = 1,
    *,
    autopilot: str | Sequence[str] = "px4",
    seed: int = 0,
    radio: str = "",
    faults: Sequence[str] = (),
    speedup: float = 1.0,
    stepped: bool = False,
    home: tuple[float, float, float] = HOME,
    parameters: Mapping[str, float] | None = None,
) -> Fleet:
    """Return a fleet for a ``with`` or ``async with`` block; its vehicles stand in a row, ready to arm.

    Each listens on its own UDP port, which the system chooses: `FleetVehicle.connection`.

    Args:
        vehicles: Number of vehicles, named uav1 and so on with the system ids 1 and so on; or a list of vehicles.
        autopilot: ``px4`` or ``ardupilot``, or several, assigned in turn.
        seed: Seed of losses and all other randomness.
        radio: Shared telemetry radio, as for ``faultline simulate --radio``; empty for a network.
        faults: As for ``faultline simulate --fault``.
        speedup: Simulated seconds per real second.
        stepped: Whether time passes only in `Fleet.advance` and `Fleet.wait_until`.
        home: Latitude and longitude of the first pad in degrees, and its height above sea level in metres; each
            further pad is 20 m to the east of the one before.
        parameters: Autopilot parameters that differ from the defaults.

    Raises:
        SimulatorError: a fault, a radio or a parameter does not exist.
    """
    if isinstance(vehicles, int):
        kinds = [autopilot] if isinstance(autopilot, str) else list(autopilot)
        if vehicles < 1 or not kinds or not {*kinds} <= {kind.value for kind in AutopilotKind}:
            raise FleetError(f"{vehicles} vehicles of {autopilot!r}: expected 1 or more, of ardupilot and px4")
        east_deg = SPACING_M / (METRES_PER_DEG * math.cos(math.radians(home[0])))
        slow = bool(first := radio.partition(",")[0].strip()) and parse_radio(first).profile.speaks
        vehicles = [
            SimVehicle(
                f"uav{number + 1}", number + 1, AutopilotKind(kinds[number % len(kinds)]), ANY_PORT, home[0],
                home[1] + number * east_deg, home[2], ready_after_s=0.0, parameters=parameters or {},
                rate_bytes_s=PX4_RATE_BYTES_S if slow else math.inf, seed=seed * 1000 + number,
            )
            for number in range(vehicles)
        ]  # fmt: skip
    return Fleet(
        SimFleet(tuple(vehicles), speedup, tuple(parse_fault(fault) for fault in faults), radio), stepped=stepped
    )
