"""Links through MAVSDK: what differs from the native ones; what is the same is in tests/conformance."""

from __future__ import annotations

import asyncio
import math
import socket
import struct
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavsdk.mavsdk_link import MavsdkLink, open_mavsdk_links
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import (
    ComponentText,
    Heartbeat,
    Message,
    MissionCount,
    MissionItemInt,
    ParamRefused,
    ParamValue,
    SendHeartbeat,
    SendParamSet,
    StationHeard,
    StatusText,
    Version,
)
from executor.core.interface.ports import LinkRequest
from executor.errors import ConnectionFailed, ExtraMissing
from missions import MissionItem
from tests.executor.adapters.mavlink.test_codec import PX4, Vehicle, bits
from tests.executor.adapters.mavlink.test_endpoints import socket_on_loopback
from tests.executor.adapters.mavlink.test_endpoints_link import Frames
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio
BEAT = mav.MAVLink_heartbeat_message(2, PX4, 0, 0, 3, 3)
LAST = mav.MAVLink_statustext_message(6, b"last")


class Air:
    """A vehicle on a socket, and the link that has found it."""

    def __init__(self, link: MavsdkLink, plug: socket.socket, port: int) -> None:
        self.link = link
        self._plug = plug
        self._port = port
        self._vehicle = Vehicle()
        self._heard: asyncio.Queue[Message] = asyncio.Queue()
        link.listen(self._heard.put_nowait)

    def say(self, message: Any, speaker: mav.MAVLink | None = None) -> None:
        frame = self._vehicle.pack(message) if speaker is None else bytes(message.pack(speaker))
        self._plug.sendto(frame, ("127.0.0.1", self._port))

    async def passed(self, *messages: Any) -> list[Message]:
        """Say messages, and return what the link hands on of them."""
        for message in (*messages, LAST):
            self.say(message)
        came: list[Message] = []
        async with asyncio.timeout(PATIENCE_S):
            while (message := await self._heard.get()) != StatusText(6, "last"):
                came.append(message)
        return came

    async def hear(self, name: str) -> Any:
        """Return the next message of this kind that reaches the vehicle."""
        parser = mav.MAVLink(None)
        async with asyncio.timeout(PATIENCE_S):
            while True:
                for frame in parser.parse_buffer(await asyncio.get_running_loop().sock_recv(self._plug, 2048)) or ():
                    if frame.get_type() == name:
                        return frame


@asynccontextmanager
async def found(log: Frames | None = None, codec: MavlinkCodec | None = None) -> AsyncIterator[Air]:
    port = free_port()
    order = LinkRequest(parse_connection(f"udpin://127.0.0.1:{port}"), 7, (log or Frames()).write)
    with socket_on_loopback() as plug:
        async with open_mavsdk_links({"uav1": order}, codec or MavlinkCodec()) as links:
            air = Air(links["uav1"], plug, port)
            async with asyncio.timeout(PATIENCE_S):
                while not air.link.is_found:
                    air.say(BEAT)
                    await asyncio.sleep(0.02)
            await air.passed(BEAT)
            yield air


async def test_we_speak_under_a_number_of_our_own() -> None:
    async with found(codec=MavlinkCodec(station=(254, 190))) as air:
        air.link.send(MissionCount(3))
        sent = [await air.hear("MISSION_COUNT"), await air.hear("HEARTBEAT")]
    assert {(one.get_srcSystem(), one.get_srcComponent()) for one in sent} == {(254, 190)}


async def test_numbers_come_through_exactly() -> None:
    item = MissionItem(3, 6, 16, 1.0, 1e-45, 0.1, math.nan, 496000001, -156000001, 47.13)
    async with found() as air:
        air.link.send(MissionItemInt(item))
        sent = await air.hear("MISSION_ITEM_INT")
        assert (sent.get_srcSystem(), sent.get_srcComponent(), sent.target_system, sent.seq) == (255, 190, 7, 3)
        assert struct.pack("<3f", sent.param1, sent.param2, sent.z) == struct.pack("<3f", 1.0, 1e-45, 47.13)
        assert (sent.x, sent.y) == (item.x, item.y)
        assert math.isnan(sent.param4)
        [back] = await air.passed(
            mav.MAVLink_mission_item_int_message(
                255, 190, 3, 6, 16, 0, 1, 1.0, 1e-45, 0.1, math.nan, item.x, item.y, 47.13
            )
        )
        assert isinstance(back, MissionItemInt)
        assert struct.pack("<4f", *(getattr(back.item, key) for key in ("param1", "param2", "param3", "z"))) == (
            struct.pack("<4f", 1.0, 1e-45, 0.1, 47.13)
        )
        assert math.isnan(back.item.param4)


async def test_texts_come_through_with_their_marks() -> None:
    async with found() as air:
        assert await air.passed(mav.MAVLink_statustext_message(4, b'say "no" \\ end\t')) == [
            StatusText(4, 'say "no" \\ end')
        ]


async def test_what_kind_of_vehicle_and_which_release_come_through() -> None:
    version = mav.MAVLink_autopilot_version_message(0, 1 << 24 | 17 << 16, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0)
    async with found() as air:
        assert await air.passed(BEAT, version) == [
            Heartbeat(PX4, 0, armed=False, system_status=3, vehicle_type=2),
            Version(1, 17, 0, "dev"),
        ]


async def test_a_long_text_is_put_together_and_a_torn_one_is_shown_as_far_as_it_came() -> None:
    whole, torn = b"w" * 60, b"t" * 50
    parts = [mav.MAVLink_statustext_message(4, whole[at : at + 50], 8, at // 50) for at in (0, 50)]
    async with found() as air:
        heard = await air.passed(*parts, mav.MAVLink_statustext_message(3, torn, 9, 0), *[BEAT] * 60)
    texts = [message for message in heard if isinstance(message, StatusText)]
    assert texts == [StatusText(4, whole.decode()), StatusText(3, torn.decode())]


async def test_only_the_autopilot_speaks_for_a_vehicle_and_within_what_can_be() -> None:
    gimbal = mav.MAVLink(None, srcSystem=7, srcComponent=154)
    nowhere = mav.MAVLink_global_position_int_message(1000, -(2**31), -(2**31), 300000, 20000, 0, 0, 0, 0)
    async with found() as air:
        air.say(mav.MAVLink_heartbeat_message(26, 3, 0, 0, 4, 3), gimbal)
        air.say(mav.MAVLink_extended_sys_state_message(0, 1), gimbal)
        air.say(mav.MAVLink_statustext_message(0, b"Crash\x1b[2J"), gimbal)
        assert await air.passed(nowhere) == [ComponentText(154, 0, "Crash\ufffd[2J")]
        assert air.link.component == 1


async def test_other_ground_stations_are_heard_and_other_vehicles_are_not() -> None:
    station, vehicle = (mav.MAVLink(None, srcSystem=system, srcComponent=190) for system in (254, 8))
    async with found() as air:
        heard: list[Message] = []
        air.link.listen(heard.append)
        async with asyncio.timeout(PATIENCE_S):
            while StationHeard(254, 190) not in heard:
                air.say(mav.MAVLink_heartbeat_message(6, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3), station)
                air.say(BEAT, vehicle)
                await asyncio.sleep(0.02)
    assert set(heard) == {StationHeard(254, 190)}


async def test_a_negative_integer_of_px4_is_neither_read_wrongly_nor_set_wrongly() -> None:
    """Its bits are those of a NaN, for which MAVSDK's messages have no number."""
    async with found() as air:
        values = [mav.MAVLink_param_value_message(b"COUNT", bits(value), 6, 1, 0) for value in (-5, 123456789)]
        assert await air.passed(*values) == [
            ParamRefused("COUNT", absent=False), ParamValue("COUNT", 123456789.0, 6),
        ]  # fmt: skip
        for value in (-5.0, 123456789.0):
            air.link.send(SendParamSet("COUNT", value, 6))
        assert (await air.hear("PARAM_SET")).param_value == bits(123456789)


async def test_both_directions_are_logged() -> None:
    log = Frames()
    async with found(log) as air:
        log.frames.clear()
        air.link.send(SendHeartbeat())
        await air.passed(BEAT)
        systems = [mav.MAVLink(None).parse_buffer(frame)[0].get_srcSystem() for frame in log.frames]
    assert systems == [255, 7, 7]


async def test_before_the_vehicle_is_found_there_is_nowhere_to_send_to() -> None:
    log = Frames()
    order = LinkRequest(parse_connection(f"udpin://127.0.0.1:{free_port()}"), 7, log.write)
    async with open_mavsdk_links({"uav1": order}, MavlinkCodec()) as links:
        links["uav1"].send(SendHeartbeat())
    assert log.frames == []


async def refusal(connection: str) -> str:
    with pytest.raises(ConnectionFailed) as raised:
        async with open_mavsdk_links({"uav1": LinkRequest(parse_connection(connection), 7)}, MavlinkCodec()):
            pass
    return str(raised.value)


async def test_what_cannot_be_opened_is_named() -> None:
    with socket_on_loopback() as plug:
        taken = f"udpin://127.0.0.1:{plug.getsockname()[1]}"
        assert await refusal(taken) == f"{taken}: cannot be opened: Address already in use"
    unknown = "udpout://nowhere.invalid:14550"
    assert await refusal(unknown) == f"{unknown}: cannot be opened by MAVSDK: destination ip unknown"
    missing = "serial:///dev/nothing:57600"
    assert await refusal(missing) == f"{missing}: cannot be opened by MAVSDK: connection error"


async def test_without_mavsdk_its_backend_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mavsdk", None)
    with pytest.raises(ExtraMissing) as raised:
        await refusal("udpin://127.0.0.1:14550")
    assert str(raised.value) == 'backend = "mavsdk" needs the extra mavsdk: pip install mavsdk'


async def test_nothing_of_mavsdk_is_loaded_for_a_fleet_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mavsdk", None)
    async with open_mavsdk_links({}, MavlinkCodec()) as links:
        assert links == {}


async def test_its_log_stays_off_standard_output(capfd: pytest.CaptureFixture[str]) -> None:
    async with found():
        pass
    assert capfd.readouterr().out == ""
