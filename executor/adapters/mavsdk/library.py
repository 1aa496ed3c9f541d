"""MAVSDK itself: loaded when it is wanted, silent, and the ground station whose heartbeats vehicles wait for.

What it does with threads is handled with care: it frees a callback of ours as soon as it is told to, even if one of its
threads is in it, so callbacks stay for as long as those threads do.
"""

from __future__ import annotations

import atexit
import functools
from typing import TYPE_CHECKING

from executor.adapters.extras import Extra, require_extra
from executor.core.interface.messages import GROUND_STATION
from executor.errors import ConnectionFailed

if TYPE_CHECKING:
    from mavsdk import Mavsdk

WANTED_BY = 'backend = "mavsdk"'
"""As the site file says it."""
MOST_AT_ONCE = 16
"""MAVSDKs in one process: with 24 it wrote beyond its memory, and the process died (measured). One holds any fleet."""


def load_mavsdk() -> None:
    """Load MAVSDK, and keep its log off standard output: results for scripts go there, and silence shows by itself.

    Raises:
        ExtraMissing: MAVSDK is not installed.
        ConnectionFailed: it cannot be loaded.
    """
    require_extra(Extra.MAVSDK, WANTED_BY)
    try:
        import mavsdk  # noqa: F401 - whether it can be
    except Exception as error:
        # Without its native library it raises an error of its own, which cannot be imported then.
        reason = str(error).partition("\n")[0]
        raise ConnectionFailed(f"backend mavsdk: expected the package mavsdk 4 on this machine: {reason}") from error
    _silence_mavsdk_log()


@functools.cache
def _silence_mavsdk_log() -> None:
    from mavsdk import logging as chatter

    chatter.log_subscribe(lambda *_: True)
    atexit.register(chatter.log_unsubscribe)


def create_ground_station() -> Mavsdk:
    """Return a MAVSDK of its own threads; `destroy` ends them. Both block: not for the event loop."""
    from mavsdk import Configuration, Mavsdk

    # MAVSDK's own default, system 245, would not hold ArduPilot's ground-station failsafe (measured).
    return Mavsdk(Configuration.create_manual(*GROUND_STATION, True))


def add_mavsdk_connection(mavsdk: Mavsdk, connection: str) -> None:
    """Open a connection.

    Raises:
        ConnectionFailed: MAVSDK cannot open it.
    """
    result = mavsdk.add_any_connection(connection)
    if result.value:
        reason = result.name.lower().replace("_", " ")
        raise ConnectionFailed(f"{connection}: cannot be opened by MAVSDK: {reason}")
