"""A flood of foreign datagrams for the vehicles' ports: noise, damaged frames, frames of strangers.

It comes from its own process and socket.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import random
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event

from executor.adapters.mavlink.codec import MavlinkCodec

FRAMES_S = 14.0
"""Frames that a simulated ArduPilot vehicle sends per second of flight, with all requested streams."""
STEP_S = 0.005
"""Real seconds between two bursts: as even as a sleeping process can send."""
BEHIND_S = 0.25
"""Delay on a busy computer beyond which missing datagrams are not caught up."""
STRANGER = 250
"""The stranger's system id; a vehicle of a measured fleet has none above 200."""
VARIETY = 300
"""Different datagrams of each kind."""
SAID: tuple[tuple[str, Mapping[str, object]], ...] = (
    ("HEARTBEAT", {"type": 2, "autopilot": 3, "base_mode": 81, "system_status": 4, "mavlink_version": 3}),
    ("ATTITUDE", {**dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.25),
                  "time_boot_ms": 4711}),
    ("GLOBAL_POSITION_INT", {**dict.fromkeys(("alt", "relative_alt", "vx", "vy", "vz", "hdg"), 900),
                             "time_boot_ms": 4711, "lat": 496_000_000, "lon": 156_000_000}),
    ("STATUSTEXT", {"severity": 6, "text": "nobody that you know", "id": 0, "chunk_seq": 0}),
)  # fmt: skip
"""Messages of a stranger."""
LONGEST = 263
"""Maximum bytes of random noise: the longest MAVLink 2 frame without a signature."""


def datagrams(seed: int) -> list[bytes]:
    """Return a third each of random bytes, frames with one byte changed, and complete frames of a stranger, mixed."""
    chance, codec = random.Random(seed), MavlinkCodec()
    found = []
    for number in range(VARIETY):
        name, fields = SAID[number % len(SAID)]
        more = {"custom_mode": number} if name == "HEARTBEAT" else {}
        read = codec.read_fields(name, STRANGER, 1, {**fields, **more})
        whole = b"" if read is None else read[0]
        damaged = bytearray(whole)
        damaged[chance.randrange(10, len(whole))] ^= chance.randrange(1, 256)
        found += [chance.randbytes(chance.randrange(1, LONGEST)), bytes(damaged), whole]
    return found


class Flood:
    """A flood that can be started."""

    def __init__(self) -> None:
        """Create it stopped."""
        here = multiprocessing.get_context("spawn")
        self._sent: Synchronized[int] = here.Value("q", 0)
        self._begun, self._over = here.Event(), here.Event()
        self._context = here

    @contextlib.contextmanager
    def ready(self, ports: Sequence[int], a_second: float, seed: int) -> Iterator[None]:
        """Prepare to send ``a_second`` datagrams per real second, in turn to these ports of this computer."""
        arguments = (tuple(ports), a_second, seed, self._sent, self._begun, self._over)
        process = self._context.Process(target=_send, args=arguments, daemon=True)
        process.start()
        try:
            yield
        finally:
            self._over.set()
            self._begun.set()
            process.join()

    def begin(self) -> None:
        """Start it."""
        self._begun.set()

    def count_sent(self) -> int:
        """Return the number of datagrams sent."""
        return self._sent.value


def _send(
    ports: Sequence[int], a_second: float, seed: int, sent: Synchronized[int], begun: Event, over: Event
) -> None:  # fmt: skip
    kinds = datagrams(seed)
    begun.wait()
    count, due, last_s = 0, 0.0, time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
        while not over.wait(STEP_S):
            now_s = time.monotonic()
            due += min(BEHIND_S, now_s - last_s) * a_second
            last_s = now_s
            while count < due:
                # Another kind in each round over the ports, or a port would always get the same ones.
                kind = (count + count // len(ports)) % len(kinds)
                with contextlib.suppress(OSError):
                    plug.sendto(kinds[kind], ("127.0.0.1", ports[count % len(ports)]))
                count += 1
            sent.value = count
