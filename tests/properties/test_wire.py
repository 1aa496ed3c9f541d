"""Whatever a vehicle sends, in whatever field: what is decided and shown has no number that is none, and ends."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import Router, VehicleLink
from executor.adapters.web.snapshot import WebSnapshot
from executor.core import fleet_step
from executor.core.context import Context
from executor.core.fleet_view import FleetView, build_fleet_view
from executor.core.interface.events import Heard, Tick
from executor.core.interface.messages import FlightMessage, Message
from executor.core.state.fleet_state import FleetState
from tests.executor.core.stories import under_way
from tests.fakes.flight import Story
from tests.fuzz.targets import FOLLOWED, NUMBERS

SYSTEM = 2
MORE = [number for number, kind in mav.mavlink_map.items() if kind.msgname in {"ATTITUDE", "GPS_RAW_INT", "WIND_COV"}]
EDGES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\x00\x00\xc0\x7f", b"\x00\x00\x80\xff", b"\x00\x00\x00\x80")
"""Among them NaN, minus infinity and INT32_MIN, wherever they come to lie."""


@st.composite
def payloads(draw: st.DrawFn, numbers: list[int]) -> tuple[int, bytes]:
    """Return a message's number and a payload of the right length: noise, or one pattern over and over."""
    number = draw(st.sampled_from(numbers))
    size = mav.mavlink_map[number].unpacker.size
    pattern = draw(st.sampled_from(EDGES) | st.binary(min_size=1, max_size=size))
    return number, (pattern * size)[:size]


ANYTHING = payloads([*FOLLOWED, *MORE]) | payloads(NUMBERS)


@cache
def flown() -> Story:
    """Return a flight in which uav2 is on its way."""
    return under_way()


def packed(number: int, payload: bytes, component: int, seq: int) -> bytes:
    head = bytes((len(payload), 0, 0, seq, SYSTEM, component)) + number.to_bytes(3, "little")
    crc = mav.x25crc(head + payload + bytes([mav.mavlink_map[number].crc_extra]))
    return b"\xfd" + head + payload + int(crc.crc).to_bytes(2, "little")


def numbers_in(value: object) -> Iterator[float]:
    match value:
        case float():
            yield value
        case dict():
            for one in value.values():
                yield from numbers_in(one)
        case list() | tuple():
            for one in value:
                yield from numbers_in(one)


Row = tuple[tuple[int, bytes], int]
"""A message's number and payload, and the component that sends it."""


def shown_after(rows: list[Row]) -> FleetState:
    """Let uav2 say messages in flight, look at what is shown, and return what is known then."""
    flight, codec, heard = flown(), MavlinkCodec(), list[Message]()
    link = VehicleLink(SYSTEM, codec)
    link.listen(heard.append)
    router = Router([link], codec)
    for seq, ((number, payload), component) in enumerate(rows):
        router.route_frames(codec.decode(packed(number, payload, component, seq)), lambda _: True)
    state, now_s = flight.state, flight.now_s
    for message in heard:
        now_s += 0.1
        if isinstance(message, FlightMessage):
            state, _ = fleet_step.step(flight.context, state, Heard("uav2", message), now_s)
        state, _ = fleet_step.step(flight.context, state, Tick(), now_s)
    view = build_fleet_view(flight.context, state, now_s)
    assert all(math.isfinite(number) for number in numbers_in(asdict(view)))
    present = WebSnapshot(flight.context, lambda: (state, now_s))
    json.loads(present.encode_state())
    json.loads(present.encode_map())
    said = [line.text for line in state.crew.said]
    assert all(line.isprintable() and len(line) < 500 for line in said)
    return state


@given(st.lists(st.tuples(ANYTHING, st.sampled_from([1, 154])), min_size=1, max_size=8))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_no_message_brings_a_number_that_is_none_into_what_is_shown(rows: list[Row]) -> None:
    shown_after(rows)


@pytest.mark.parametrize("number", [*FOLLOWED, *MORE], ids=lambda number: str(mav.mavlink_map[number].msgname))
def test_nothing_that_is_none_is_shown_in_any_field_of_what_is_followed(number: int) -> None:
    """Each message full of NaN, infinity, INT32_MIN, all bits and none."""
    size = mav.mavlink_map[number].unpacker.size
    for pattern in EDGES:
        shift = pattern[-1:] if size % len(pattern) else b""
        for payload in ((pattern * size)[:size], ((shift * (size % len(pattern))) + pattern * size)[:size]):
            state = shown_after([((number, payload), 1)])
            fix = state.vehicles["uav2"].motion.fix
            assert fix is not None
            assert math.hypot(*fix.place_m) < 1e8


def test_the_page_gets_unknown_for_a_missing_number() -> None:
    """Whatever mistake of ours brings it there, the page must go on."""
    flight = flown()

    def describe(context: Context, state: FleetState, now_s: float) -> FleetView:
        view = build_fleet_view(context, state, now_s)
        wrong = [replace(one, battery=replace(one.battery, measured_pct=math.nan)) for one in view.vehicles]
        return replace(view, vehicles=tuple(wrong))

    present = WebSnapshot(flight.context, lambda: (flight.state, flight.now_s), describe=describe)
    content = json.loads(present.encode_state(), parse_constant=_refuse)
    assert {one["battery"]["measured_pct"] for one in content["vehicles"]} == {None}


def _refuse(constant: str) -> float:
    raise AssertionError(f"no JSON: {constant}")
