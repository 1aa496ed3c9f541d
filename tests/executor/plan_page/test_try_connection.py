from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.plan_page.try_connection import listen_for_vehicle
from tests.ports import free_port

PX4, ARDUPILOT = 12, 3


def frames(sysid: int, autopilot: int, vehicle_type: int = 2, armed: int = 0) -> Iterator[bytes]:
    one = mav.MAVLink(None, srcSystem=sysid, srcComponent=1)
    yield one.heartbeat_encode(vehicle_type, autopilot, armed, 0, 4).pack(one)
    yield one.statustext_encode(6, b"ArduCopter V4.7.0 (6a1b8c2d)").pack(one)
    yield one.sys_status_encode(0, 0, 0, 0, 16000, 0, 98, 0, 0, 0, 0, 0, 0).pack(one)


async def listen(sent: list[bytes], sysid: int = 1, autopilot: str = "ardupilot") -> dict[str, object]:
    port = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.connect(("127.0.0.1", port))

        async def speak() -> None:
            while True:
                for frame in sent:
                    try:
                        vehicle.send(frame)
                    except ConnectionRefusedError:
                        continue  # nobody listens yet
                await asyncio.sleep(0.05)

        speaking = asyncio.create_task(speak())
        try:
            answer = await listen_for_vehicle(f"udpin://127.0.0.1:{port}", sysid, autopilot)
        finally:
            speaking.cancel()
        vehicle.setblocking(False)
        with pytest.raises(BlockingIOError):
            vehicle.recv(100)
        return answer


@pytest.fixture(autouse=True)
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executor.plan_page.try_connection.MORE_S", 0.3)


def test_an_answering_vehicle_is_described_and_sent_nothing() -> None:
    answer = asyncio.run(listen(list(frames(1, ARDUPILOT))))
    assert answer == {"answers": True, "words": "answers: ArduPilot 4.7.0, 98 %"}


def test_what_is_not_as_the_site_says_is_named() -> None:
    answer = asyncio.run(listen([next(frames(1, PX4, 1, 128))]))
    assert answer == {"answers": True, "words": "answers: PX4, fixed wing, but the site says ArduPilot, armed"}


def test_silence_and_others_are_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executor.plan_page.try_connection.LISTEN_S", 0.5)
    answer = asyncio.run(listen(list(frames(7, ARDUPILOT))))
    assert answer == {"answers": False, "words": "no message was received from system 1 in 0.5 s"}


def test_a_port_that_is_taken_is_reported() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        where = f"udpin://127.0.0.1:{other.getsockname()[1]}"
        answer = asyncio.run(listen_for_vehicle(where, 1, "px4"))
    assert answer == {"answers": False, "words": f"{where}: cannot be opened: Address already in use"}


def test_a_connection_that_must_be_opened_outwards_is_not_tried() -> None:
    answer = asyncio.run(listen_for_vehicle("udpout://127.0.0.1:9", 1, "px4"))
    assert answer["answers"] is False
    with pytest.raises(ValueError, match="expected udpin"):
        asyncio.run(listen_for_vehicle("carrier pigeon", 1, "px4"))
