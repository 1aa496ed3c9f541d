"""What is fed with bytes that anybody may send: each target takes any bytes, and raises only where there is a mistake.

A target may refuse what it is given in the way that its users know; everything else that comes out of it is a find.
"""

from __future__ import annotations

import asyncio
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import cache
from pathlib import Path

from pymavlink.dialects.v20 import common as mav
from pymavlink.generator.mavcrc import x25crc

from executor.adapters.eventlog import from_plain, to_plain
from executor.adapters.mavlink.codec import FrameParser, MavlinkCodec
from executor.adapters.mavlink.endpoints import VehicleLink
from executor.adapters.mqtt.client import Outbox
from executor.adapters.mqtt.intent_intake import IntakeRules, RefusedMessage, read_intent
from executor.adapters.mqtt.publisher import Publisher
from executor.adapters.mqtt.topics import MqttTopics
from executor.adapters.web.page_server import WebSettings
from executor.adapters.web.server import WebServer
from executor.core import fleet_step
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.events import Heard, IntentReceived, Tick
from executor.core.interface.intents import Intent, IntentRecord
from executor.core.interface.messages import FlightMessage, Message
from executor.errors import SiteError
from executor.site.site_file import Site, read_site
from tests.executor.builders import Fleet, fleet_of
from tests.executor.core.stories import under_way

NOW_UNIX_S = 1_790_000_000.0
NUMBERS = sorted(mav.mavlink_map)
FOLLOWED = [
    number
    for number, kind in mav.mavlink_map.items()
    if kind.msgname
    in {
        "HEARTBEAT", "GLOBAL_POSITION_INT", "BATTERY_STATUS", "SYS_STATUS", "EXTENDED_SYS_STATE", "HOME_POSITION",
        "MISSION_CURRENT", "MISSION_ITEM_REACHED", "STATUSTEXT", "RADIO_STATUS", "MISSION_REQUEST_INT", "MISSION_ACK",
        "MISSION_COUNT", "MISSION_ITEM_INT", "COMMAND_ACK", "PARAM_VALUE", "AUTOPILOT_VERSION", "MISSION_REQUEST",
    }
]  # fmt: skip


def frame(number: int, payload: bytes, *, seq: int = 0, sysid: int = 1, compid: int = 1) -> bytes:
    """Return a MAVLink 2 frame with the right checksum around any payload, of the right length or not."""
    payload = payload[:255]
    head = bytes((len(payload), 0, 0, seq % 256, sysid, compid)) + number.to_bytes(3, "little")
    crc = x25crc(head + payload)
    crc.accumulate(bytes((mav.mavlink_map[number].crc_extra,)))
    return b"\xfd" + head + payload + int(crc.crc).to_bytes(2, "little")


def frames(data: bytes) -> Iterator[bytes]:
    """Read bytes as a row of datagrams: noise, or frames around what follows, some of them spoilt."""
    at, seq = 0, 0
    while at + 3 <= len(data):
        kind, which, size = data[at : at + 3]
        body = data[at + 3 : at + 3 + size]
        at += 3 + size
        seq += 1
        if kind < 16:
            yield body
            continue
        numbers = FOLLOWED if kind < 200 else NUMBERS
        whole = frame(numbers[which % len(numbers)], body, seq=seq, sysid=1 + kind % 3, compid=1 + (kind & 32))
        yield whole[: len(whole) - 1] if kind == 199 else whole


def packets(data: bytes) -> None:
    """A datagram, and the same as a stream that is cut into pieces."""
    codec = MavlinkCodec()
    links: dict[int, VehicleLink] = {}
    for received in codec.decode(data):
        link = links.setdefault(received.sysid, VehicleLink(received.sysid, codec))
        link.receive(received)
    cutter, pieces = FrameParser(), [data[at : at + 61] for at in range(0, len(data), 61)]
    for piece in pieces:
        list(codec.read(cutter.feed(piece)))


@cache
def _fleet() -> Fleet:
    return fleet_of()


def flight(data: bytes) -> None:
    """Frames with right checksums around hostile content, through the link and into what decides."""
    ready, codec = _fleet(), MavlinkCodec()
    state, now_s = fleet_step.build_initial_state(ready.boards), 1.0
    names = {setup.sysid: name for name, setup in ready.context.vehicles.items()}
    heard: list[tuple[str, Message]] = []
    links = {sysid: VehicleLink(sysid, codec) for sysid in names}
    for sysid, link in links.items():
        link.listen(lambda message, name=names[sysid]: heard.append((name, message)))  # type: ignore[misc]
    for datagram in frames(data):
        for received in codec.decode(datagram):
            if received.sysid in links:
                links[received.sysid].receive(received)
        for name, message in heard:
            if isinstance(message, FlightMessage):
                event = Heard(name, message)
                _same(event)
                state, _ = fleet_step.step(ready.context, state, event, now_s)
        heard.clear()
        state, _ = fleet_step.step(ready.context, state, Tick(), now_s)
        now_s += 0.2
    view = build_fleet_view(ready.context, state, now_s)
    Publisher(MqttTopics("t"), Outbox(), "fuzz", lambda: NOW_UNIX_S).publish_view(view)


def _same(event: Heard) -> None:
    """What is decided must be the same again from the log."""
    again = from_plain(json.loads(json.dumps(to_plain(event), allow_nan=False)))
    assert again == event, f"the log gives back {again}"


_scratch = Path(tempfile.mkdtemp(prefix="faultline-fuzz-")) / f"site-{os.getpid()}.toml"


def site(data: bytes) -> None:
    """A site file."""
    _scratch.write_bytes(data)
    try:
        read = read_site(_scratch)
    except SiteError as error:
        text = str(error)
        assert "\n" not in text, text
        assert len(text) < 2000, text
        return
    assert isinstance(read, Site)


RULES = IntakeRules(max_age_s=10.0, token="abc")  # noqa: S106 - of nobody


def mqtt(data: bytes) -> None:
    """An intent over MQTT."""
    found = read_intent(data, RULES, NOW_UNIX_S, retained=False)
    if isinstance(found, RefusedMessage):
        assert found.reason
        assert "\n" not in found.reason
        assert len(found.reason) < 500
        found.reason.encode()


HEADERS = (b"host", b"origin", b"content-type", b"content-length", b"cookie", b"authorization", b"sec-fetch-site")
PATHS = ("/intents", "/", "/files/page.css", "/chart", "/state")
GOOD_HEADERS = {b"host": b"localhost", b"content-type": b"application/json"}


class _Page:
    """The page's server without its socket: what a request may hold is what h11 lets through."""

    def __init__(self, token: str | None) -> None:
        self.flight = under_way()
        settings = WebSettings("127.0.0.1", 0, token)
        self.app = WebServer(
            settings, self.flight.context, lambda: (self.flight.state, self.flight.now_s), self._submit
        ).build_app()
        self.loop = asyncio.new_event_loop()

    def _submit(self, intent: Intent) -> Future[IntentRecord]:
        done: Future[IntentRecord] = Future()
        state, _ = fleet_step.step(self.flight.context, self.flight.state, IntentReceived(intent), self.flight.now_s)
        done.set_result(state.crew.intents[intent.id])
        return done

    def ask(self, scope: dict[str, object], body: bytes) -> int:
        """Return the status of the answer."""
        answers: list[dict[str, object]] = []

        async def receive() -> dict[str, object]:
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message: dict[str, object]) -> None:
            answers.append(message)

        self.loop.run_until_complete(self.app(scope, receive, send))  # type: ignore[arg-type]
        status = answers[0]["status"]
        assert isinstance(status, int)
        return status


@cache
def _pages() -> tuple[_Page, _Page]:
    return _Page(None), _Page("a-token-of-the-crew")


def web(data: bytes) -> None:
    """A request to the page's server: a byte of choices, header fields with their lengths, and the body."""
    choices, at = data[0] if data else 0, 1
    headers = dict(GOOD_HEADERS) if choices & 1 else {}
    for field in HEADERS:
        if at < len(data) and (size := data[at]):
            headers[field] = bytes(byte for byte in data[at + 1 : at + 1 + size] if byte >= 32 and byte != 127)
            at += size
        at += 1
    path = PATHS[choices >> 1 & 7] if choices >> 1 & 7 < len(PATHS) else "/intents"
    scope: dict[str, object] = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "scheme": "http", "root_path": "",
        "method": "GET" if choices & 16 else "POST", "path": path, "raw_path": path.encode(),
        "query_string": headers.get(b"origin", b"") if choices & 32 else b"",
        "headers": list(headers.items()), "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 2),
    }  # fmt: skip
    status = _pages()[choices >> 6 & 1].ask(scope, data[at:])
    assert status < 500, status


TARGETS: dict[str, Callable[[bytes], None]] = {
    "packets": packets, "flight": flight, "site": site, "mqtt": mqtt, "web": web,
}  # fmt: skip


def seeds(name: str) -> list[bytes]:
    """Return good inputs to begin with."""
    match name:
        case "site":
            folder = Path(__file__).parents[2] / "docker"
            return [path.read_bytes() for path in sorted(folder.glob("*.toml"))]
        case "web":
            wish = b'{"id":"a-1","action":"hold","vehicle":"uav1"}'
            bare, digits = bytes((1, *(0 for _ in HEADERS))), b"9" * 200
            plain = bytes((0, 9)) + b"localhost" + bytes(5) + bytes((len(digits),)) + digits
            shown = bytes((1 | 64, 0, 0, 0, 0, 0, 26)) + b"Bearer a-token-of-the-crew" + bytes(1)
            return [bare + wish, plain + wish, shown + wish, bytes((1 | 16 | 32,)) + bare[1:], bare + b"[" * 3000]
        case "mqtt":
            good = b'{"timestamp":"2026-09-21T14:13:20Z","id":"a-1","action":"hold","vehicle":"uav1","token":"abc"}'
            return [good, b'{"timestamp":"2026-09-21T14:13:20+02:00","id":"b","action":"abort"}', b"[" * 2000]
        case _:
            rows = [(number, bytes(mav.mavlink_map[number].unpacker.size)) for number in FOLLOWED]
            whole = b"".join(frame(number, body) for number, body in rows)
            crafted = b"".join(bytes((17, index, len(body))) + body for index, (_, body) in enumerate(rows))
            floats = b"".join(
                bytes((17, index, 255)) + b"\x00\x00\xc0\x7f" * 63 + b"abc" for index, _ in enumerate(rows)
            )
            return [whole, whole[:-1], crafted, floats]


if __name__ == "__main__":
    print(*TARGETS)
