"""Whether a radio is congested or weak, by what was measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.codes import ChannelCode
from executor.core.interface.messages import Radio, Traffic
from executor.core.radio_budget import RadioShare
from executor.core.state.link_quality import LinkQuality, add_traffic
from executor.core.state.radio_channel import (
    ChannelMeasures,
    describe_figures,
    judge_channel,
    measure_channel,
    share_of,
)
from tests.executor.core.vehicles import NOW_S, SETUP, flying

FINE = ChannelMeasures(("uav1", "uav2"), 700.0, 1200.0, True, 0.3, lost=0.01, radio=Radio(120, 118, 40, 41, 90))
C = ChannelCode


def heard(*counts: tuple[float, int], radio: Radio | None = None, **given: Any) -> LinkQuality:
    """Return a link after counts of (seconds ago, bytes)."""
    state = LinkQuality(radio=radio, radio_s=NOW_S)
    for ago_s, link_bytes in counts:
        state = add_traffic(state, Traffic(25, 1, link_bytes, **given), NOW_S - ago_s, 12.0)
    return state


@pytest.mark.parametrize(
    ("given", "code", "words"),
    [
        ({}, None, ""),
        ({"radio": Radio(120, 118, 40, 41, 32)}, C.BUFFER_FULL, "radio buffer 32 % free"),
        ({"radio": Radio(120, 118, 40, 41, 33)}, None, ""),
        ({"radio": Radio(120, 118, 40, 41, None)}, None, ""),
        ({"radio": Radio(120, 118, 40, 41, 0)}, C.BUFFER_FULL, "radio buffer 0 % free"),
        ({"bytes_s": 1080.0}, C.AT_CAPACITY, "it carries all that it can"),
        ({"bytes_s": 1080.0, "capacity_known": False}, None, ""),
        ({"bytes_s": 1080.0, "capacity_known": False, "lost": 0.03}, C.AT_CAPACITY, "it carries all that it can"),
        ({"bytes_s": 1080.0, "lost": 0.5}, C.AT_CAPACITY, "it carries all that it can"),
        ({"grown": True, "round_trip_s": 2.4}, C.ROUND_TRIP_GROWN, "answers take 2.4 s"),
        ({"lost": 0.1}, C.FRAMES_LOST, "frames are lost though it has room and signal; is its firmware new?"),
        ({"lost": 0.1, "radio": None}, C.FRAMES_LOST, "frames are lost though it has room"),
        ({"lost": None}, None, ""),
        ({"radio": Radio(59, 118, 41, 41, 90)}, C.SIGNAL_LOW, "signal 9 dB over noise here"),
        ({"radio": Radio(60, 118, 41, 41, 90)}, None, ""),
        ({"radio": Radio(120, 50, 41, 48, 5)}, C.SIGNAL_LOW, "signal 1 dB over noise at the vehicle"),
        ({"radio": Radio(None, 50, 41, None, 90)}, None, ""),
        ({"radio": None}, None, ""),
    ],
)
def test_what_is_wrong_with_a_radio(given: dict[str, Any], code: ChannelCode | None, words: str) -> None:
    assert judge_channel(replace(FINE, **given)) == (None if code is None else (code, words))


def test_a_low_signal_is_no_congestion_though_the_buffer_is_full() -> None:
    assert [code for code in C if code.is_congestion] == [C.BUFFER_FULL, C.AT_CAPACITY, C.ROUND_TRIP_GROWN]


def test_bytes_of_all_vehicles_behind_a_radio_are_one_sum() -> None:
    share = RadioShare(2, 1200.0, names=("uav1", "uav2"))
    one = flying(quality=heard((10.0, 9999), (5.0, 2000), (0.0, 3000)))
    found = measure_channel(share, [one, replace(one, name="uav2")], NOW_S)
    assert found is not None
    assert found.bytes_s == pytest.approx(2 * 500.0), "what came before the first count is in no time that is known"
    assert found.lost == pytest.approx(1 / 26)
    assert describe_figures(found) == "1.0 of 1.2 kB/s, 4 % lost"


def test_a_silent_vehicle_has_no_part_of_a_radio() -> None:
    assert heard((25.0, 5000), (20.0, 2000)).count_bytes_s(NOW_S) == 0.0
    assert heard((0.0, 5000)).count_bytes_s(NOW_S) == 0.0, "one count has no time"


def test_no_report_without_a_radio_or_counters() -> None:
    counted = flying(quality=heard((5.0, 2000), (0.0, 3000)))
    assert measure_channel(RadioShare(names=("uav1",)), [counted], NOW_S) is None
    assert measure_channel(RadioShare(bytes_s=1200.0, names=("uav1",)), [flying()], NOW_S) is None
    reports = flying(quality=heard((5.0, 2000), (0.0, 3000), radio=Radio(1, 1, 1, 1, 90)))
    found = measure_channel(RadioShare(names=("uav1",)), [reports], NOW_S)
    assert found is not None
    assert (found.capacity_bytes_s, found.capacity_known) == (1200.0, False), "a radio that reports itself is one"


def test_a_radio_carries_at_least_what_it_was_seen_to_carry_where_the_site_does_not_say_it() -> None:
    one = flying(quality=heard((5.0, 2000), (0.0, 9000), radio=Radio(1, 1, 1, 1, 90)))
    for said, capacity_bytes_s in ((None, 1800.0), (1200.0, 1200.0)):
        found = measure_channel(RadioShare(bytes_s=said, names=("uav1",)), [one], NOW_S)
        assert found is not None
        assert (found.bytes_s, found.capacity_bytes_s) == (1800.0, capacity_bytes_s)


def test_a_round_trip_has_grown_beside_the_shortest_one_and_for_a_while() -> None:
    share = RadioShare(bytes_s=1200.0, names=("uav1",))
    quality = heard((5.0, 2000), round_trip_s=0.3)
    for took_s, grown in ((0.9, False), (1.1, False), (1.2, True)):
        link = add_traffic(quality, Traffic(25, 0, 900, took_s), NOW_S, 12.0)
        found = measure_channel(share, [flying(quality=link)], NOW_S)
        assert found is not None
        assert (found.round_trip_s, found.grown) == (took_s, grown), took_s
    later = measure_channel(share, [flying(quality=link)], NOW_S + 21.0)
    assert later is not None
    assert not later.grown
    assert "round trip 1.2 s" in describe_figures(later)


def test_an_old_report_of_a_radio_says_nothing() -> None:
    share, full = RadioShare(bytes_s=1200.0, names=("uav1",)), Radio(120, 118, 40, 41, 0)
    quality = heard((5.0, 2000), (0.0, 2000), radio=full)
    for age_s, told in ((5.0, full), (5.1, None)):
        found = measure_channel(share, [flying(quality=quality)], NOW_S + age_s)
        assert found is not None
        assert found.radio == told


def test_streams_are_never_raised_over_what_was_decided_in_flight() -> None:
    setup = replace(SETUP, radio=RadioShare(bytes_s=9000.0, names=("uav1",)))
    steps = [share_of(setup, flying(stream_step=step)).choose_step(setup.dialect, on_radio=True) for step in (0, 1, 3)]
    assert steps == [0, 1, 3]
