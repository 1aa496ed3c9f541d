"""One vehicle, simulated or real, with a client of another project, and the result."""

from __future__ import annotations

import asyncio
import inspect
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import AbstractAsyncContextManager, contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Generic, TypeVar

from pymavlink.dialects.v20 import common as mav

from missions import LocalFrame, Pad
from simulator.testing import HOME, FleetVehicle, VehicleState, fleet
from tests.ports import free_port
from tests.sitl import real

T = TypeVar("T")
AUTOPILOTS = ("px4", "ardupilot")
PATIENCE_S = 60.0
"""Real seconds for a case; most clients give up earlier."""
READY_S = 90.0
"""Real seconds in which a real autopilot may be armed."""
ASK_AGAIN_S = 0.1
PLACE_DEG, PAD_ALT_M = HOME[:2], HOME[2]
NORTH_DEG = 0.001
"""A hundred metres."""
REAL_SPEEDUP = 2.0


@dataclass(frozen=True, slots=True)
class Subject:
    """A vehicle of system 1 that was just switched on, on its pad, without a mission."""

    autopilot: str
    connection: str
    """As MAVSDK writes it."""
    folder: Path
    """For the files of a client."""
    vehicle: FleetVehicle | None
    """None of a real one, whose truth nobody knows."""
    is_ready: Callable[[], bool] = lambda: True
    """Whether it may be armed."""

    @property
    def pymavlink(self) -> str:
        """As pymavlink, MAVProxy and their kin write it."""
        return self.connection.replace("://", ":")

    def listen(self) -> str:
        """Let it call a client that listens, and return where, as pymavlink writes it."""
        if self.vehicle is None:
            return self.pymavlink
        self.vehicle.call(port := free_port())
        return f"udpin:127.0.0.1:{port}"

    @property
    def px4(self) -> bool:
        return self.autopilot == "px4"

    def is_so(self, is_so: Callable[[VehicleState], bool]) -> bool:
        """Return whether something is true of it; of a real one, that its client says so is all there is."""
        return self.vehicle is None or is_so(self.vehicle.truth)

    def prove(self, is_so: Callable[[VehicleState], bool]) -> None:
        """Fail unless something is true of it now."""
        assert self.is_so(is_so), "the client says so, and the vehicle's own state does not"

    def has_stored(self, *, fence: int = 0, rally: int = 0) -> bool:
        """Return whether so many items of a fence, and rally points, are on board."""
        if self.vehicle is None:
            return True
        store = self.vehicle.simulated.autopilot.store
        return (len(store.fence), len(store.rally)) == (fence, rally)

    async def until_stored(self, *, fence: int = 0, rally: int = 0) -> None:
        """Wait until so many items of a fence, and rally points, are on board."""
        while not self.has_stored(fence=fence, rally=rally):  # noqa: ASYNC110 - nobody tells when
            await asyncio.sleep(ASK_AGAIN_S)

    def wait_until(self, is_so: Callable[[VehicleState], bool], patience_s: float = PATIENCE_S) -> None:
        """Wait until something is true of it; in a thread that may wait."""
        wait(lambda: self.is_so(is_so), patience_s)

    async def until(self, is_so: Callable[[VehicleState], bool]) -> None:
        """Wait until something is true of it."""
        while not self.is_so(is_so):  # noqa: ASYNC110 - nobody tells when
            await asyncio.sleep(ASK_AGAIN_S)


def find_distribution(name: str) -> str:
    """Return the version of an installed distribution; empty where there is none."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def wait(is_so: Callable[[], bool], patience_s: float) -> None:
    """Wait until something is so.

    Raises:
        TimeoutError: it never was.
    """
    until_s = time.monotonic() + patience_s
    while not is_so():
        if time.monotonic() > until_s:
            raise TimeoutError("it never came true")
        time.sleep(ASK_AGAIN_S)


@contextmanager
def simulated(autopilot: str) -> Iterator[Subject]:
    """Lend a simulated vehicle."""
    parameters = real.NO_FAILSAFE[{"px4": real.PX4, "ardupilot": real.ARDUPILOT}[autopilot]]
    with fleet(autopilot=autopilot, parameters=parameters) as living, TemporaryDirectory() as folder:
        yield Subject(autopilot, living[0].connection, Path(folder), living[0])


def find_real(autopilot: str) -> Path | None:
    """Return the binary of a real autopilot, where the environment names one."""
    binary = {"px4": real.PX4, "ardupilot": real.ARDUPILOT}[autopilot].binary
    return Path(binary) if binary else None


@contextmanager
def real_one(autopilot: str) -> Iterator[Subject]:
    """Lend a real autopilot in software in the loop; it may be armed when it is lent."""
    kind, binary = {"px4": real.PX4, "ardupilot": real.ARDUPILOT}[autopilot], find_real(autopilot)
    assert binary, f"{kind.variable} names no real {autopilot}"
    pads, place = {"uav1": Pad("pad", 0.0, 0.0, PAD_ALT_M)}, LocalFrame(*PLACE_DEG)
    wanted = real.Wanted(pads, place, REAL_SPEEDUP, real.NO_FAILSAFE[kind], frozenset())
    with TemporaryDirectory() as folder, real.running(kind, binary, Path(folder) / "sitl", wanted) as vehicles:
        other = vehicles["uav1"].other

        def is_ready() -> bool:
            order = (mav.MAV_CMD_REQUEST_MESSAGE, 0, mav.MAVLINK_MSG_ID_SYS_STATUS, 0, 0, 0, 0, 0, 0)
            try:
                status = other.ask(mav.MAVLink_command_long_message(1, 1, *order), "SYS_STATUS")
            except OSError:  # it is only starting
                return False
            return bool(status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK)

        yield Subject(autopilot, f"udpin://127.0.0.1:{kind.port}", Path(folder), None, is_ready)


@dataclass(frozen=True)
class Suite(Generic[T]):
    """Cases of one client."""

    client: str
    """What installs it: a distribution of the Python index, or a package of npm's."""
    open: Callable[[Subject], AbstractAsyncContextManager[T]]
    """Connects the client, for one case."""
    cases: Mapping[str, Callable[[T], Awaitable[None] | None]]
    """Those that are no coroutines may block: they have a thread."""
    autopilots: tuple[str, ...] = AUTOPILOTS
    find_version: Callable[[str], str] = find_distribution
    install: str = "pip install --no-deps -r requirements-peers.lock"

    @property
    def version(self) -> str:
        """Of the client; empty where it is not installed."""
        return self.find_version(self.client)

    async def find_fault(self, subject: Subject, *names: str, patience_s: float = PATIENCE_S) -> str:
        """Return why a case fails, or which of several with one client fails first; nothing where they pass."""
        name = names[0]
        try:
            async with asyncio.timeout(patience_s * len(names) + READY_S), self.open(subject) as at:
                for name in names:
                    case = self.cases[name]
                    async with asyncio.timeout(patience_s):
                        if inspect.iscoroutinefunction(case):
                            await case(at)
                        else:
                            await asyncio.to_thread(case, at)
        except Exception as fault:  # noqa: BLE001 - whatever a client raises, the case has failed
            said = f"{type(fault).__name__}: {fault}".splitlines()[0]
            return said if len(names) == 1 else f"{name}: {said}"
        return ""
