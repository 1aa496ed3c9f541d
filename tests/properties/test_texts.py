"""Texts in parts: whatever twice, late or never does to them, each is shown once and nothing is made up."""

from __future__ import annotations

import random
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from executor.adapters.mavlink.message_readers import (
    GAP,
    MEMORY_FRAMES,
    PART_BYTES,
    PATIENCE_FRAMES,
    StatusTextAssembler,
)
from executor.core.interface.messages import StatusText

UAV1, UAV2 = (1, 1), (2, 1)
LETTERS = st.characters(codec="ascii", categories=["L", "N", "P"])
WORDS = st.text(LETTERS, min_size=1, max_size=230)
LONG = st.text(LETTERS, min_size=PART_BYTES + 1, max_size=230)
Part = tuple[int, bytes]


def parts_of(words: str) -> list[Part]:
    """Return the parts as MAVLink wants them: one that does not fill its field is the last."""
    raw = words.encode()
    return [(number, raw[PART_BYTES * number :][:PART_BYTES]) for number in range(len(raw) // PART_BYTES + 1)]


class Reader:
    """A vehicle's frames on their way in."""

    def __init__(self) -> None:
        self.texts = StatusTextAssembler()
        self.shown: list[StatusText] = []

    def part(self, part: Part, number: int = 7, source: tuple[int, int] = UAV1) -> None:
        self.frames(1, source)
        self.shown += self.texts.add_part(source, 4, part[1].ljust(PART_BYTES, b"\x00"), number, part[0])

    def frames(self, count: int, source: tuple[int, int] = UAV1) -> None:
        for _ in range(count):
            self.shown += self.texts.count_frame(source)


@given(words=WORDS, seed=st.integers(0, 999), twice=st.booleans())
def test_all_parts_in_any_order_make_the_text_once(words: str, seed: int, twice: bool) -> None:
    reader, parts = Reader(), parts_of(words) * (2 if twice else 1)
    random.Random(seed).shuffle(parts)
    for part in parts:
        reader.part(part)
    reader.frames(2 * PATIENCE_FRAMES)
    assert reader.shown == [StatusText(4, words)]


@given(words=WORDS, lost=st.sets(st.integers(0, 4)))
def test_what_never_came_is_a_gap(words: str, lost: set[int]) -> None:
    reader, parts = Reader(), parts_of(words)
    kept = [part for part in parts if part[0] not in lost]
    for part in kept:
        reader.part(part)
    reader.frames(PATIENCE_FRAMES + 1)
    if not kept:
        assert reader.shown == []
        return
    [shown] = reader.shown
    whole = len(kept) == len(parts)
    assert (shown.text == words) is whole or (len(words) % PART_BYTES == 0)
    assert all(raw.decode() in shown.text for _, raw in kept)
    gaps = sum(after - before > 1 for before, after in pairwise([-1, *(number for number, _ in kept)]))
    assert shown.text.count(GAP) == gaps


@given(words=LONG, late=st.integers(0, 4))
def test_a_part_that_comes_too_late_or_again_shows_nothing_twice(words: str, late: int) -> None:
    parts = parts_of(words)
    held = parts[late % len(parts)]
    reader = Reader()
    for part in parts:
        if part != held:
            reader.part(part)
    reader.frames(PATIENCE_FRAMES + 1)
    before = list(reader.shown)
    for part in (held, *parts):
        reader.part(part)
    reader.frames(PATIENCE_FRAMES + 1)
    assert len(before) == 1
    assert reader.shown == before


@given(one=WORDS, other=WORDS, seed=st.integers(0, 999))
def test_two_vehicles_with_the_same_id_do_not_mix(one: str, other: str, seed: int) -> None:
    reader = Reader()
    parts = [(UAV1, part) for part in parts_of(one)] + [(UAV2, part) for part in parts_of(other)]
    random.Random(seed).shuffle(parts)
    for source, part in parts:
        reader.part(part, source=source)
    assert sorted(text.text for text in reader.shown) == sorted([one, other])


def test_a_restarted_vehicle_restarts_its_text_counter() -> None:
    reader = Reader()
    for words in ("a" * 60, "b" * 60):
        for part in parts_of(words):
            reader.part(part)
    assert [text.text for text in reader.shown] == ["a" * 60, "b" * 60]


def test_the_same_words_again_after_a_while_are_news() -> None:
    reader = Reader()
    for _ in range(2):
        for part in parts_of("a" * 60):
            reader.part(part)
        reader.frames(MEMORY_FRAMES + 1)
    assert [text.text for text in reader.shown] == ["a" * 60] * 2


def test_a_text_that_fills_its_last_part_is_shown_without_a_gap() -> None:
    """PX4 sends no empty part after it."""
    reader = Reader()
    for part in parts_of("a" * 100)[:2]:
        reader.part(part)
    assert reader.shown == []
    reader.frames(PATIENCE_FRAMES + 1)
    assert reader.shown == [StatusText(4, "a" * 100)]


def test_a_short_text_has_no_tab_and_no_zeros() -> None:
    reader = Reader()
    reader.part((0, b"Takeoff detected\t"), number=0)
    assert reader.shown == [StatusText(4, "Takeoff detected")]


def test_bytes_that_are_no_text_lose_only_themselves() -> None:
    reader = Reader()
    reader.part((0, b"caf\xe9 \xff\xfe ok"), number=0)
    assert reader.shown[0].text.startswith("caf")
    assert reader.shown[0].text.endswith("ok")
