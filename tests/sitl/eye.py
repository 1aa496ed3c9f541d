"""Cameras that MAVSDK's own server plays, on the link that PX4 keeps for its payload."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from mavsdk.asyncio import Configuration, Mavsdk
from mavsdk.asyncio.plugins.camera_server import CameraServerAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins import camera_server as words
from mavsdk.plugins import telemetry

PAYLOAD_PORT = 14030
"""Where PX4's first vehicle sends what is for its payload; the next one to the next (px4-rc.mavlink)."""
CAMERA = 100
"""MAV_COMP_ID_CAMERA."""
STARTS_S = 60.0


@dataclass(eq=False)
class Eye:
    """One vehicle's camera."""

    sysid: int
    taken: list[words.CaptureInfo] = field(default_factory=list)
    """Its pictures, in their order."""
    broken: bool = False
    """Whether it takes none any more, and answers nobody."""
    _place: telemetry.Position | None = None
    _turned: telemetry.Quaternion | None = None

    async def look(self, begun: Callable[[], None]) -> None:
        """Answer what it is asked until it is cancelled."""
        configuration = Configuration.create_manual(self.sysid, CAMERA, True)
        async with Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(f"udpin://0.0.0.0:{PAYLOAD_PORT + self.sysid - 1}")
            system = await mavsdk.first_autopilot(timeout_s=STARTS_S)
            server = CameraServerAsync(await mavsdk.server_component_by_id(CAMERA))
            await server.set_information(words.Information("peer", "eye", "1.0.0", 24.0, 36.0, 24.0, 8192, 5460))
            begun()
            await asyncio.gather(self._shoot(server), self._follow(TelemetryAsync(system)), self._turn(system))

    async def _follow(self, known: TelemetryAsync) -> None:
        async for place in known.subscribe_position():
            self._place = place

    async def _turn(self, system: object) -> None:
        async for turned in TelemetryAsync(system).subscribe_attitude_quaternion():
            self._turned = turned

    async def _shoot(self, server: CameraServerAsync) -> None:
        async for _ in server.subscribe_take_photo():
            if self.broken or self._place is None or self._turned is None:
                continue
            at, turned = self._place, self._turned
            picture = words.CaptureInfo(
                words.Position(at.latitude_deg, at.longitude_deg, at.absolute_altitude_m, at.relative_altitude_m),
                words.Quaternion(turned.w, turned.x, turned.y, turned.z),
                int(time.time() * 1e6), True, len(self.taken), f"EYE{len(self.taken):05d}.JPG",
            )  # fmt: skip
            self.taken.append(picture)
            await server.respond_take_photo(words.CameraFeedback.OK, picture)


@contextmanager
def looking(eye: Eye) -> Iterator[Eye]:
    """Have a camera look in a thread of its own."""
    begun, ends = threading.Event(), Ends()

    async def live() -> None:
        over = ends.in_loop()
        task = asyncio.create_task(eye.look(begun.set))
        await asyncio.wait({task, asyncio.create_task(over.wait())}, return_when=asyncio.FIRST_COMPLETED)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    thread = threading.Thread(target=lambda: asyncio.run(live()), daemon=True)
    thread.start()
    try:
        if not begun.wait(STARTS_S):
            raise TimeoutError(f"system {eye.sysid}: its camera heard no autopilot")
        yield eye
    finally:
        ends.say()
        thread.join()


class Ends:
    """Tells the event loop of another thread that it is over."""

    def __init__(self) -> None:
        self._told: Callable[[], object] = lambda: None

    def in_loop(self) -> asyncio.Event:
        """Return what the running loop waits for."""
        loop, over = asyncio.get_running_loop(), asyncio.Event()
        self._told = lambda: loop.call_soon_threadsafe(over.set)
        return over

    def say(self) -> None:
        """Say it."""
        self._told()


@contextmanager
def all_looking(eyes: Mapping[str, Eye]) -> Iterator[Mapping[str, Eye]]:
    """Have the cameras of several vehicles look."""
    with ExitStack() as stack:
        for eye in eyes.values():
            stack.enter_context(looking(eye))
        yield eyes
