"""The bad link: each ill does what it says, and a seed repeats it."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.fleet import QUEUE_BYTES, Channel, LinkCondition

COUNT = 2000


def carry(condition: LinkCondition, seed: int = 1, until_s: float = 1e9) -> list[int]:
    """Send numbered datagrams, 100 a second, and return those that arrive, in order."""
    channel = Channel(condition, random.Random(seed))
    arrived: list[bytes] = []
    for number in range(COUNT):
        now_s = number / 100
        channel.offer(number.to_bytes(4), now_s)
        arrived += channel.take_due(now_s)
    arrived += channel.take_due(until_s)
    return [int.from_bytes(datagram) for datagram in arrived]


def test_a_good_link_carries_everything_at_once() -> None:
    assert carry(LinkCondition()) == list(range(COUNT))


def test_loss_loses_its_share() -> None:
    assert abs(len(carry(LinkCondition(loss=0.2))) / COUNT - 0.8) < 0.03


def test_duplicates_come_twice() -> None:
    arrived = carry(LinkCondition(duplicate=0.1))
    assert abs(len(arrived) / COUNT - 1.1) < 0.03
    assert set(arrived) == set(range(COUNT))


def test_reordering_loses_nothing_and_changes_the_order() -> None:
    arrived = carry(LinkCondition(reorder=0.1))
    assert sorted(arrived) == list(range(COUNT))
    assert arrived != sorted(arrived)


def test_delay_is_exact() -> None:
    channel = Channel(LinkCondition(delay_s=0.3), random.Random(1))
    channel.offer(b"x", 1.0)
    assert channel.take_due(1.299) == []
    assert channel.take_due(1.3) == [b"x"]


def test_silence_swallows_what_is_sent_and_what_is_on_its_way() -> None:
    condition = LinkCondition(delay_s=0.5)
    channel = Channel(condition, random.Random(1))
    channel.offer(b"before", 0.9)
    condition.silent_until_s = 3.0
    channel.offer(b"during", 2.0)
    channel.offer(b"after", 3.0)
    assert channel.take_due(10.0) == [b"after"]


def test_silence_for_good() -> None:
    assert carry(LinkCondition(silent_until_s=math.inf)) == []


@given(st.integers(0, 1000))
def test_a_seed_repeats_the_link(seed: int) -> None:
    condition = LinkCondition(loss=0.1, delay_s=0.05, duplicate=0.1, reorder=0.2)
    assert carry(condition, seed) == carry(condition, seed)


def test_a_radio_carries_so_many_bytes_a_second_one_behind_the_other() -> None:
    channel = Channel(LinkCondition(rate_bytes_s=1000.0, delay_s=0.3), random.Random(1))
    for _ in range(3):
        channel.offer(bytes(100), 10.0)
    assert [len(channel.take_due(now_s)) for now_s in (10.39, 10.41, 10.51, 10.61)] == [0, 1, 1, 1]
    channel.offer(bytes(100), 20.0)
    assert len(channel.take_due(20.41)) == 1, "its queue is empty again"


def test_what_comes_to_a_full_queue_is_lost() -> None:
    channel = Channel(LinkCondition(rate_bytes_s=1000.0), random.Random(1))
    for _ in range(100):
        channel.offer(bytes(100), 10.0)
    assert len(channel.take_due(99.0)) * 100 == pytest.approx(QUEUE_BYTES, abs=100)
