"""MAVSDK itself: loaded when it is wanted, silent, and the ground station whose heartbeats vehicles wait for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from executor.errors import ConnectionFailed

if TYPE_CHECKING:
    from mavsdk import Mavsdk

GROUND_STATION = (255, 190)
"""MAVSDK's own default, system 245, would not hold ArduPilot's ground-station failsafe (measured)."""


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MAVSDK's log off standard output, where results for scripts go; what matters shows as a silent vehicle.

    Raises:
        ConnectionFailed: MAVSDK is not there.
    """
    try:
        from mavsdk import logging as chatter
    except Exception as error:
        # Without its native library it raises an error of its own, which cannot be imported then.
        reason = str(error).partition("\n")[0]
        raise ConnectionFailed(f"backend mavsdk: expected the package mavsdk 4 on this machine: {reason}") from error
    chatter.log_subscribe(lambda *_: True)
    try:
        yield
    finally:
        chatter.log_unsubscribe()


def ground_station() -> Mavsdk:
    """Return a MAVSDK of its own threads; `destroy` ends them, and must not be called by the event loop's thread."""
    from mavsdk import Configuration, Mavsdk

    return Mavsdk(Configuration.create_manual(*GROUND_STATION, True))


def connect(mavsdk: Mavsdk, connection: str) -> None:
    """Open a connection.

    Raises:
        ConnectionFailed: MAVSDK cannot open it.
    """
    result = mavsdk.add_any_connection(connection)
    if result.value:
        reason = result.name.lower().replace("_", " ")
        raise ConnectionFailed(f"{connection}: cannot be opened by MAVSDK: {reason}")
