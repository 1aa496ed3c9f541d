"""A flood that no vehicle sent, for the ports where vehicles are heard: noise, damaged frames, frames of strangers.

It comes from a process and a socket of its own.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import random
import socket
import time
from collections.abc import Iterator, Sequence
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event

FRAMES_S = 14.0
"""Frames that a simulated ArduPilot vehicle sends in a second of flight, with all streams that are asked for."""
STEP_S = 0.005
"""Real seconds between two bursts: the flood is spread as evenly as a sleeping process can."""
BEHIND_S = 0.25
"""What was not sent for so long, as the computer was busy, is not made up for."""
STRANGER = 250
"""Its system number; a vehicle of a measured fleet has none above 200."""
VARIETY = 300
"""Different datagrams of each kind."""
LONGEST = 263
"""Bytes of random noise at most: as a frame of MAVLink 2 without a signature is."""


def datagrams(seed: int) -> list[bytes]:
    """Return a third each of random bytes, frames with one byte changed, and whole frames of a stranger, mixed."""
    from pymavlink.dialects.v20 import ardupilotmega as mav

    chance = random.Random(seed)
    codec = mav.MAVLink(None, srcSystem=STRANGER, srcComponent=1)
    found = []
    for number in range(VARIETY):
        place = (chance.randrange(-900_000_000, 900_000_000), chance.randrange(-1_800_000_000, 1_800_000_000))
        frames = (
            mav.MAVLink_heartbeat_message(2, 3, 81, number, 4, 3),
            mav.MAVLink_attitude_message(number, chance.random(), chance.random(), chance.random(), 0.0, 0.0, 0.0),
            mav.MAVLink_global_position_int_message(number, *place, 400_000, 50_000, 1, 2, 3, 9_000),
            mav.MAVLink_statustext_message(6, b"nobody that you know", 0, 0),
        )
        whole = bytes(frames[number % len(frames)].pack(codec))
        codec.seq = (codec.seq + 1) % 256
        damaged = bytearray(whole)
        damaged[chance.randrange(10, len(whole))] ^= chance.randrange(1, 256)
        found += [chance.randbytes(chance.randrange(1, LONGEST)), bytes(damaged), whole]
    return found


class Flood:
    """A flood that can be let loose."""

    def __init__(self) -> None:
        """Hold it back."""
        here = multiprocessing.get_context("spawn")
        self._sent: Synchronized[int] = here.Value("q", 0)
        self._begun, self._over = here.Event(), here.Event()
        self._context = here

    @contextlib.contextmanager
    def ready(self, ports: Sequence[int], a_second: float, seed: int) -> Iterator[None]:
        """Be ready to send so many datagrams in a real second, in turn to these ports of this computer."""
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
        """Let it loose."""
        self._begun.set()

    def sent(self) -> int:
        """Return how many datagrams have gone."""
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
                # Another kind with each round over the ports, or a port would always be sent the same ones.
                kind = (count + count // len(ports)) % len(kinds)
                with contextlib.suppress(OSError):
                    plug.sendto(kinds[kind], ("127.0.0.1", ports[count % len(ports)]))
                count += 1
            sent.value = count
