"""MAVSDK's own mission upload, for comparison: no flight uses it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from executor.adapters.mavsdk.mavsdk_link import add_mavsdk_connection, create_ground_station, load_mavsdk
from executor.core.interface.connection import Connection
from executor.core.interface.messages import GROUND_STATION
from executor.errors import ConnectionFailed
from missions import MissionItem

if TYPE_CHECKING:
    from mavsdk.plugins.mission_raw import MissionRaw
    from mavsdk.system import System


class MavsdkUploader:
    """MAVSDK's MissionRaw plugin for one vehicle, with its default time-outs."""

    def __init__(self, plugin: MissionRaw, thread: ThreadPoolExecutor) -> None:
        """Use this plugin in this thread."""
        self._plugin = plugin
        self._thread = thread

    async def upload(self, items: Sequence[MissionItem]) -> str:
        """Upload a mission; returns the failure reason, empty if it was accepted.

        MAVSDK requires exactly one item flagged as current: the first is.
        """
        from mavsdk.plugins.mission_raw import MissionItem as RawItem
        from mavsdk.plugins.mission_raw import MissionRawError

        raw = [
            RawItem(
                item.seq, item.frame, item.command, int(item.seq == 0), int(item.autocontinue),
                item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, 0,
            )
            for item in items
        ]  # fmt: skip
        try:
            await asyncio.get_running_loop().run_in_executor(self._thread, self._plugin.upload_mission, raw)
        except MissionRawError as error:
            return str(error.result.name.lower().replace("_", " "))
        return ""


@asynccontextmanager
async def open_uploader(connection: Connection, sysid: int, timeout_s: float) -> AsyncIterator[MavsdkUploader]:
    """Open a connection by MAVSDK alone, and wait until it has found the vehicle.

    Raises:
        ConnectionFailed: it cannot be opened, or the vehicle was not found in real seconds.
    """
    load_mavsdk()
    from mavsdk.plugins.mission_raw import MissionRaw

    loop, found = asyncio.get_running_loop(), asyncio.Event()
    with ThreadPoolExecutor(1) as thread:
        mavsdk = await loop.run_in_executor(thread, create_ground_station, GROUND_STATION)
        try:
            mavsdk.subscribe_on_new_system(lambda _: loop.call_soon_threadsafe(found.set))
            add_mavsdk_connection(mavsdk, str(connection))
            try:
                async with asyncio.timeout(timeout_s):
                    while (system := _find_system(mavsdk.get_systems(), sysid)) is None:
                        found.clear()
                        await found.wait()
            except TimeoutError:
                raise ConnectionFailed(
                    f"{connection}: MAVSDK has not found system {sysid} in {timeout_s:g} s"
                ) from None
            yield MavsdkUploader(MissionRaw(system), thread)
        finally:
            await loop.run_in_executor(thread, mavsdk.destroy)


def _find_system(systems: Sequence[System], sysid: int) -> System | None:
    return next((one for one in systems if one.get_system_id() == sysid and one.has_autopilot()), None)
