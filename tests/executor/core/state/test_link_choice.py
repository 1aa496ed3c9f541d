"""Which of several links is used: the one that is alive and clearly better, without going to and fro."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.state.link_choice import (
    BETTER_S,
    LONGEST_PAUSE_S,
    PREFERRED_S,
    SILENT_S,
    LinkChoice,
    LinkHealth,
    choose_link,
)

NOW_S = 100.0
RADIO = LinkHealth(heard_s=NOW_S, behind_s=0.3, lost=0.0)
LTE = LinkHealth(heard_s=NOW_S, behind_s=0.1, lost=0.0)


def silent(link: LinkHealth, for_s: float) -> LinkHealth:
    return replace(link, heard_s=NOW_S - for_s)


@pytest.mark.parametrize(
    ("links", "used"),
    [
        ((LinkHealth(), LinkHealth()), 0),  # before anything is heard
        ((LinkHealth(), LTE), 1),
        ((RADIO, LTE), 0),  # better, but not for long yet
        ((silent(RADIO, 0.9), LTE), 0),
        ((silent(RADIO, 1.1), LTE), 1),
        ((silent(RADIO, 1.1), silent(LTE, 1.1)), 0),  # nobody knows of a better one
        ((silent(replace(RADIO, pause_s=1.2), 1.7), LTE), 0),  # it always speaks in bursts
        ((silent(replace(RADIO, pause_s=1.2), 1.9), LTE), 1),
        ((silent(RADIO, 5.0), RADIO, LTE), 2),  # the best of those that are alive
    ],
)
def test_a_silent_link_is_left_at_once_while_another_is_alive(links: tuple[LinkHealth, ...], used: int) -> None:
    assert choose_link(LinkChoice(), links, NOW_S).used == used


@pytest.mark.parametrize(
    ("used", "other", "moves"),
    [
        (RADIO, LTE, True),
        (LTE, RADIO, False),
        (LTE, LTE, False),
        (replace(LTE, behind_s=0.14), LTE, False),  # not by much
        (replace(LTE, lost=0.4), LTE, True),
        (replace(LTE, is_full=True), LTE, True),
        (replace(LTE, behind_s=None), LTE, False),  # nothing is known of it
    ],
)
def test_from_a_link_that_is_alive_orders_move_to_one_that_is_clearly_better_for_a_while(
    used: LinkHealth, other: LinkHealth, moves: bool
) -> None:
    first = choose_link(LinkChoice(), (used, other), NOW_S)
    assert first.used == 0
    later_s = NOW_S + BETTER_S
    heard = tuple(replace(link, heard_s=later_s) for link in (used, other))
    assert choose_link(first, heard, later_s - 0.1).used == 0
    last = choose_link(first, heard, later_s)
    assert last.used == int(moves)


@pytest.mark.parametrize(("preferred", "returns"), [(LTE, True), (replace(LTE, behind_s=0.14), True), (RADIO, False)])
def test_orders_return_to_the_preferred_link_once_it_has_been_as_good_for_a_while(
    preferred: LinkHealth, returns: bool
) -> None:
    choice = LinkChoice(used=1)
    for second in range(40):
        links = tuple(replace(link, heard_s=NOW_S + second) for link in (preferred, LTE))
        choice = choose_link(choice, links, NOW_S + second)
        assert choice.used == (0 if returns and second >= PREFERRED_S else 1)


def test_an_upload_under_way_is_not_restarted_for_a_better_link() -> None:
    choice = choose_link(LinkChoice(), (RADIO, LTE), NOW_S)
    links = tuple(replace(link, heard_s=NOW_S + 60.0) for link in (RADIO, LTE))
    assert choose_link(choice, links, NOW_S + 60.0, transfers=True).used == 0
    assert choose_link(choice, (RADIO, links[1]), NOW_S + 60.0, transfers=True).used == 1, "unless its link is silent"


def test_a_link_that_is_better_now_and_then_is_not_taken() -> None:
    choice, worse = LinkChoice(), replace(LTE, behind_s=1.0)
    for second in range(60):
        now_s = NOW_S + second
        radio, other = (replace(one, heard_s=now_s) for one in (RADIO, worse if second % 8 == 7 else LTE))
        choice = choose_link(choice, (radio, other), now_s)
        assert choice.used == 0


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=200))
def test_how_long_a_link_may_be_silent_follows_its_pauses(pauses_s: list[float]) -> None:
    link, now_s = LinkHealth(), 0.0
    link = link.hear(now_s)
    for pause_s in pauses_s:
        now_s += pause_s
        link = link.hear(now_s)
        assert SILENT_S <= link.silent_after_s <= LONGEST_PAUSE_S
        assert link.silent_after_s >= min(LONGEST_PAUSE_S, pause_s)
    assert link.is_alive(now_s)
    assert not link.is_alive(now_s + LONGEST_PAUSE_S + 0.1)


def test_a_silence_is_no_pause() -> None:
    link = LinkHealth().hear(0.0).hear(0.2).hear(30.0).hear(30.2)
    assert link.silent_after_s == SILENT_S


def test_loss_follows_the_newest_counts() -> None:
    link = LinkHealth().count(80, 20)
    assert link.lost == pytest.approx(0.2)
    for _ in range(30):
        link = link.count(100, 0)
    assert link.lost == pytest.approx(0.0, abs=0.001)
