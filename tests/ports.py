"""Ports for tests that run at the same time."""

from __future__ import annotations

import random
import socket

PORTS = (20_000, 32_000)
"""Linux gives sockets that ask for any port one from 32768 on; what is below these belongs to autopilots."""


def free_ports(count: int) -> list[int]:
    """Return ports that nobody uses at the moment, and that no socket is given that asks for any.

    Between this and their use by a process of a test, others' connections would be given those of the system's own
    range now and then.
    """
    found: list[int] = []
    chance = random.SystemRandom()
    while len(found) < count:
        port = chance.randrange(*PORTS)
        if port not in found and is_free(port):
            found.append(port)
    return found


def free_port() -> int:
    """Return one of them."""
    return free_ports(1)[0]


def is_free(port: int) -> bool:
    """Return whether nobody listens on a port of this computer, by UDP or TCP."""
    for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
        with socket.socket(socket.AF_INET, kind) as plug:
            try:
                plug.bind(("127.0.0.1", port))
            except OSError:
                return False
    return True
