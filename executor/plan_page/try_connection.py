"""Listen for a vehicle on a connection; nothing is sent."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from executor.adapters.mavlink.endpoints import open_mavlink_links
from executor.core.interface.connection import Scheme, parse_connection
from executor.core.interface.messages import Battery, Heartbeat, Message, StatusText, SystemStatus, Version
from executor.core.interface.ports import LinkRequest
from executor.core.telemetry import vehicle_identity
from executor.errors import ConnectionFailed
from missions import dialect_for

LISTEN_S = 4.0
"""Real seconds to listen: HEARTBEATs come once a second, and a radio loses some."""
MORE_S = 1.2
"""Additional real seconds to wait for the battery."""


async def listen_for_vehicle(connection: str, sysid: int, autopilot: str) -> dict[str, Any]:
    """Return whether a vehicle answers on a connection, and in words how.

    Args:
        connection: Connection in the form of the site file.
        sysid: System id of the vehicle.
        autopilot: Its firmware, by its name in site files.

    Raises:
        ValueError: the connection is malformed.
    """
    link = parse_connection(connection)
    if link.scheme is Scheme.UDP_OUT:
        return _answer("only a flight connects to it, and nothing is sent here: not tried", answers=False)
    heard: dict[type[Message], Any] = {}
    arrived = asyncio.Event()

    def take(message: Message) -> None:
        if isinstance(message, StatusText):
            version = vehicle_identity.parse_banner_version(message.text)
            heard.update({} if version is None else {Version: version})
        else:
            heard[type(message)] = message
        if Heartbeat in heard:
            arrived.set()

    try:
        async with open_mavlink_links({"vehicle": LinkRequest(link, sysid)}) as links:
            links["vehicle"].listen(take)
            async with asyncio.timeout(LISTEN_S):
                await arrived.wait()
            await asyncio.sleep(MORE_S)
    except TimeoutError:
        return _answer(f"no message was received from system {sysid} in {LISTEN_S:g} s", answers=False)
    except ConnectionFailed as error:
        return _answer(str(error), answers=False)
    return _answer(_describe_vehicle(heard, autopilot), answers=True)


def _answer(words: str, *, answers: bool) -> dict[str, Any]:
    return {"answers": answers, "words": f"answers: {words}" if answers else words}


def _describe_vehicle(heard: Mapping[type[Message], Any], autopilot: str) -> str:
    beat, version = heard[Heartbeat], heard.get(Version)
    parts = [vehicle_identity.describe_autopilot(beat.autopilot) + ("" if version is None else f" {version}")]
    if beat.vehicle_type not in vehicle_identity.MULTICOPTERS:
        parts.append(vehicle_identity.describe_vehicle_type(beat.vehicle_type))
    for kind in (Battery, SystemStatus):
        left_pct = getattr(heard.get(kind), "remaining_pct", None)
        if left_pct is not None:
            parts.append(f"{left_pct:.0f} %")
            break
    expected = dialect_for(autopilot)
    if beat.autopilot != expected.number:
        parts.append(f"but the site says {expected.title}")
    if beat.armed:
        parts.append("armed")
    return ", ".join(parts)
