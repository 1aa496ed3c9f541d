"""A little of what `./scripts/fuzz` does at length: good inputs, spoilt ones and noise into every target."""

from __future__ import annotations

import json

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.guided import FOLLOWED as FOLLOWED_PACKAGES
from tests.fuzz.targets import FOLLOWED, NUMBERS, TARGETS, frame, seeds

pytestmark = pytest.mark.fuzz

FEW = settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


def spoilt(good: bytes) -> st.SearchStrategy[bytes]:
    """Good input in which some bytes are others, missing, or twice there."""

    def spoil(changes: list[tuple[int, int, bytes]]) -> bytes:
        data = good
        for at, gone, new in changes:
            at %= len(data) + 1
            data = data[:at] + new + data[at + gone :]
        return data

    change = st.tuples(st.integers(0, 2**16), st.integers(0, 6), st.binary(max_size=6))
    return st.lists(change, max_size=6).map(spoil)


def test_every_target_has_a_guided_run() -> None:
    assert set(FOLLOWED_PACKAGES) == set(TARGETS)


@pytest.mark.parametrize("name", TARGETS)
def test_noise(name: str) -> None:
    @FEW
    @given(st.binary(max_size=600))
    def feed(data: bytes) -> None:
        TARGETS[name](data)

    feed()


@pytest.mark.parametrize("name", TARGETS)
def test_good_inputs_and_spoilt_ones(name: str) -> None:
    good = seeds(name)
    for one in good:
        TARGETS[name](one)

    @FEW
    @given(st.sampled_from(good).flatmap(spoilt))
    def feed(data: bytes) -> None:
        TARGETS[name](data)

    feed()


@FEW
@given(st.lists(st.tuples(st.sampled_from(NUMBERS), st.binary(max_size=255), st.integers(0, 255)), max_size=12))
def test_any_message_with_any_content_under_a_right_checksum(rows: list[tuple[int, bytes, int]]) -> None:
    data = b"".join(frame(number, body, seq=seq, sysid=seq or 1) for number, body, seq in rows)
    TARGETS["packets"](data)


@FEW
@given(st.lists(st.tuples(st.sampled_from(range(len(FOLLOWED))), st.binary(max_size=255)), max_size=12))
def test_a_flight_that_hears_hostile_messages(rows: list[tuple[int, bytes]]) -> None:
    TARGETS["flight"](b"".join(bytes((17, which, len(body))) + body for which, body in rows))


KEYS = st.sampled_from(["timestamp", "id", "action", "vehicle", "token", "version", "headerId", "\ud800", "x" * 50])
ANYTHING = st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(), st.lists, max_leaves=5)


@FEW
@given(st.dictionaries(KEYS, ANYTHING))
def test_json_that_is_no_intent(content: dict[str, object]) -> None:
    TARGETS["mqtt"](json.dumps(content).encode())
