"""What vehicles are asked to send, and how often."""

from __future__ import annotations

from collections.abc import Mapping

from executor.core.interface.ports import Clock, Link
from executor.protocols import vehicle_commands
from executor.protocols.command import CommandDialogue
from executor.runtime import procedures
from missions import Dialect

STREAMS_HZ = {
    vehicle_commands.GLOBAL_POSITION_INT: 5.0,
    vehicle_commands.SYS_STATUS: 1.0,
    vehicle_commands.BATTERY_STATUS: 1.0,
    vehicle_commands.MISSION_CURRENT: 2.0,
    vehicle_commands.EXTENDED_SYS_STATE: 1.0,
    vehicle_commands.ATTITUDE: 1.0,
    vehicle_commands.GPS_RAW_INT: 1.0,
    vehicle_commands.RC_CHANNELS: 1.0,  # its pilot's switches
}
"""What we follow; ArduPilot sends none of it unasked, PX4's battery comes only every 2 s."""
HEARTBEAT_HZ = 1.0


def streams_hz(dialect: Dialect) -> dict[int, float]:
    """Return what a vehicle is asked to send, and how often; one that refuses some of it flies all the same."""
    return STREAMS_HZ | dict(dialect.own_streams_hz)


async def request_streams(link: Link, clock: Clock, dialect: Dialect) -> None:
    """Ask a vehicle for everything that we follow."""
    await _request_streams_at(link, clock, streams_hz(dialect))


async def request_streams_again(link: Link, clock: Clock, dialect: Dialect) -> None:
    """Ask a vehicle of which something does not come any more; HEARTBEAT comes unasked, until it does not."""
    await _request_streams_at(link, clock, {vehicle_commands.HEARTBEAT: HEARTBEAT_HZ} | streams_hz(dialect))


async def _request_streams_at(link: Link, clock: Clock, rates_hz: Mapping[int, float]) -> None:
    for message, rate_hz in rates_hz.items():
        await procedures.send_order(
            link, clock, CommandDialogue(vehicle_commands.set_message_interval(message, rate_hz), "stream")
        )
