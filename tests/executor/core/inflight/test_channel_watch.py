"""Radios in flight, second by second: the reports, and how far streams are thinned."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest

from executor.analysis.report import build_report
from executor.core.context import Context
from executor.core.fleet_view import RadioView, build_fleet_view
from executor.core.inflight import channel_watch
from executor.core.inflight.faults.watch_view import WatchView, list_streams_to_ask
from executor.core.interface.codes import ChannelCode
from executor.core.interface.commands import AskStreams, Say
from executor.core.interface.messages import Radio
from executor.core.radio_budget import GLOBAL_POSITION_INT, MISSION_CURRENT, OWN_FACTORS, RadioShare
from executor.core.state.fleet_state import FleetState
from executor.core.state.link_quality import LinkQuality
from executor.core.state.radio_channel import choose_streams_hz
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import vehicle
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import FLEET, NOW_S, at, flying

NAMES = ("uav1", "uav2")
SHARE = RadioShare(2, 2000.0, names=NAMES)
"""It carries what two vehicles are asked for, not thinned."""
Found = tuple[list[Any], FleetState]


def context_of(share: RadioShare = SHARE) -> Context:
    vehicles = {
        name: replace(setup, radio=share if name in share.names else setup.radio)
        for name, setup in FLEET.context.vehicles.items()
    }
    return replace(FLEET.context, vehicles=vehicles)


def linked(now_s: float, bytes_s: float, free_pct: int | None, lost: int = 0) -> LinkQuality:
    """Return a link over which so much goes, each of two."""
    counted = ((now_s - 5.0, 0), (now_s, round(5.0 * bytes_s / 2)))
    radio = Radio(120, 120, 40, 40, free_pct)
    return LinkQuality(window=((now_s, 50, lost),), counted=counted, radio=radio, radio_s=now_s)


def fly(
    seconds: Iterable[tuple[float, float, int]],
    state: FleetState | None = None,
    context: Context | None = None,
    change: Callable[[Any], Any] = lambda one: one,
) -> Found:
    """Watch the radio over stretches of (seconds, bytes a second, per cent of the buffer free)."""
    context = context or context_of()
    state = state or flight_of(flying(), vehicle(FLEET, "uav2", stage=Stage.FLYING, fix=at(), heard_s=NOW_S))
    now_s, told = max((one.looked_s for one in state.channels.values()), default=NOW_S), []
    for length_s, bytes_s, free_pct in seconds:
        for _ in range(round(length_s)):
            now_s += 1.0
            for name in NAMES:
                one = change(state.vehicles[name])
                state = state.put(one.with_link(quality=linked(now_s, bytes_s, free_pct), heard_s=now_s))
            state, commands = channel_watch.watch_channels(context, state, now_s)
            told += [(now_s - NOW_S, one) for one in commands]
    return told, state


def lines(told: list[Any]) -> list[tuple[float, str]]:
    return [(at_s, one.text) for at_s, one in told if isinstance(one, Say)]


def asked(told: list[Any]) -> list[tuple[float, str]]:
    return [(at_s, one.vehicle) for at_s, one in told if isinstance(one, AskStreams)]


def test_congestion_is_reported_once_it_has_lasted_and_once_it_is_over() -> None:
    told, _ = fly([(5, 900.0, 90), (4, 900.0, 10), (20, 900.0, 90)])
    assert lines(told) == [], "shorter than a few seconds is none"
    told, _ = fly([(5, 900.0, 90), (7, 900.0, 10), (20, 900.0, 90)])
    assert lines(told) == [
        (12.0, "radio of uav1, uav2 congested: radio buffer 10 % free; 0.9 of 2.0 kB/s, 0 % lost"),
        (23.0, "radio of uav1, uav2: 0.9 of 2.0 kB/s, 0 % lost"),
    ]


def test_congestion_that_comes_back_soon_is_not_said_again() -> None:
    told, _ = fly([(1, 900.0, 90), *[(7, 900.0, 10), (11, 900.0, 90)] * 5])
    assert [at_s for at_s, text in lines(told) if "congested" in text] == [8.0, 80.0]
    assert len([text for _, text in lines(told) if text.endswith("lost") and "congested" not in text]) == 2


def test_streams_are_thinned_a_step_and_only_what_changes_is_asked() -> None:
    told, state = fly([(1, 900.0, 90), (9, 1900.0, 90), (5, 900.0, 90)])
    assert lines(told)[1:2] == [(10.0, "radio of uav1, uav2: streams are thinned, positions at 5 Hz")]
    assert asked(told) == [(10.0, "uav1"), (11.0, "uav2")], "one in a second"
    [only] = {one.messages for _, one in told if isinstance(one, AskStreams)}
    assert GLOBAL_POSITION_INT not in only
    assert only
    assert [state.vehicles[name].orders.stream_step for name in NAMES] == [1, 1]
    setup = context_of().vehicles["uav1"]
    assert choose_streams_hz(setup, state.vehicles["uav1"]) == SHARE.choose_streams_hz(setup.dialect, on_radio=True) | {
        message: choose_streams_hz(setup, state.vehicles["uav1"])[message] for message in only
    }


def test_streams_are_thinned_step_by_step_and_never_below_the_last() -> None:
    told, state = fly([(200, 1900.0, 90)])
    steps = [at_s for at_s, text in lines(told) if "thinned" in text]
    assert steps == [9.0, 29.0, 49.0]
    assert state.channels["uav1"].step == len(OWN_FACTORS) - 1
    assert choose_streams_hz(context_of().vehicles["uav1"], state.vehicles["uav1"])[GLOBAL_POSITION_INT] == 1.0


def test_streams_are_raised_after_long_room_and_later_where_that_was_too_early() -> None:
    told, state = fly([(10, 1900.0, 90), (75, 800.0, 90)])
    assert [text for _, text in lines(told) if "has room" in text] == [
        "radio of uav1, uav2 has room: positions at 5 Hz again"
    ]
    assert state.channels["uav1"].step == 0
    assert asked(told)[-2:] == [(71.0, "uav1"), (72.0, "uav2")]
    patience_s = state.channels["uav1"].patience_s
    told, state = fly([(25, 1900.0, 90)], state)
    assert state.channels["uav1"].step == 1
    assert state.channels["uav1"].patience_s == 2 * patience_s
    told, state = fly([(100, 800.0, 90)], state)
    assert state.channels["uav1"].step == 1, "it waits twice as long now"
    told, state = fly([(40, 800.0, 90)], state)
    assert state.channels["uav1"].step == 0


def test_streams_are_not_raised_where_the_radio_would_be_full_again() -> None:
    _, state = fly([(10, 1900.0, 90), (300, 1590.0, 90)])
    assert state.channels["uav1"].step == 1


def test_streams_are_never_raised_over_the_budget_before_the_flight() -> None:
    tight = replace(SHARE, bytes_s=1000.0)
    base = tight.choose_step(context_of().vehicles["uav1"].dialect, on_radio=True)
    assert base > 0
    told, state = fly([(400, 300.0, 95)], context=context_of(tight))
    assert (told, state.channels["uav1"].step) == ([], 0)
    told, state = fly([(10, 950.0, 90)], context=context_of(tight))
    assert state.channels["uav1"].step == base + 1


def test_no_request_while_the_buffer_is_full() -> None:
    told, state = fly([(30, 900.0, 10)])
    assert state.channels["uav1"].step == 1
    assert asked(told) == []
    told, _ = fly([(3, 900.0, 40)], state)
    assert asked(told) == [(31.0, "uav1"), (32.0, "uav2")]


def test_a_mission_under_way_is_no_reason_to_thin_and_comes_first() -> None:
    def loads(one: Any) -> Any:
        return one.with_assignment(pending=one.assignment.board)

    told, state = fly([(60, 1900.0, 90)], change=loads)
    assert told == []
    assert state.channels["uav1"].step == 0


def test_missions_that_have_just_gone_over_a_radio_are_no_congestion() -> None:
    def loads(one: Any) -> Any:
        return one.with_assignment(pending=one.assignment.board)

    def loaded(one: Any) -> Any:
        return one.with_assignment(pending=None)

    _, state = fly([(20, 1900.0, 90)], change=loads)
    told, state = fly([(14, 1900.0, 90), (20, 500.0, 90)], state, change=loaded)
    assert told == [], "they are counted for some seconds more"
    told, _ = fly([(30, 1900.0, 90)], state)
    assert "congested" in lines(told)[0][1]


def test_the_uploads_before_take_off_are_no_congestion() -> None:
    both = flying(), vehicle(FLEET, "uav2", stage=Stage.FLYING, fix=at(), heard_s=NOW_S)
    told, _ = fly([(14, 1900.0, 90), (20, 500.0, 90)], flight_of(*both, launched_s=NOW_S))
    assert told == []
    told, _ = fly([(30, 1900.0, 90)], flight_of(*both, launched_s=NOW_S))
    assert lines(told)[0][0] == 21.0


def test_a_vehicle_that_its_pilot_has_is_not_asked() -> None:
    told, _ = fly([(15, 1900.0, 90)], change=lambda one: replace(one, stage=Stage.PILOT))
    assert asked(told) == []


def test_a_weak_radio_is_reported_and_nothing_is_thinned() -> None:
    context, state = context_of(), flight_of(flying(), vehicle(FLEET, "uav2", stage=Stage.FLYING, heard_s=NOW_S))
    told: list[Any] = []
    for second in range(1, 40):
        now_s = NOW_S + second
        for name in NAMES:
            quality = replace(linked(now_s, 600.0, 90), radio=Radio(120, 50, 40, 45, 90))
            state = state.put(state.vehicles[name].with_link(quality=quality, heard_s=now_s))
        state, commands = channel_watch.watch_channels(context, state, now_s)
        told += [(second, one) for one in commands]
    assert lines(told) == [
        (7, "radio of uav1, uav2 weak: signal 3 dB over noise at the vehicle; 0.6 of 2.0 kB/s, 0 % lost")
    ]
    assert state.channels["uav1"].step == 0
    assert state.channels["uav1"].totals.weak_s == pytest.approx(32.0)


def test_what_a_radio_came_to_is_added_up() -> None:
    _, state = fly([(20, 1000.0, 90), (20, 1900.0, 90)])
    totals = state.channels["uav1"].totals
    assert totals.bytes / totals.seconds == pytest.approx(1450.0, rel=0.03)
    assert totals.most_bytes_s == 1900.0
    assert totals.congested_s == pytest.approx(13.0)


def test_nothing_is_watched_before_the_flight() -> None:
    state = flight_of(flying(quality=linked(NOW_S, 1900.0, 5)), launched_s=None)
    assert channel_watch.watch_channels(context_of(), state, NOW_S) == (state, ())


def test_a_radio_is_described_for_page_and_broker() -> None:
    _, state = fly([(30, 1900.0, 90)])
    [radio] = build_fleet_view(context_of(), state, NOW_S + 30.0).radios
    assert radio == RadioView(
        NAMES, "congested", ChannelCode.AT_CAPACITY, "1.9 of 2.0 kB/s, 0 % lost", 1900.0, 2000.0, None, 0.0, 2.0
    )
    _, state = fly([(30, 500.0, 90)])
    assert [one.state for one in build_fleet_view(context_of(), state, NOW_S + 30.0).radios] == ["fine"]
    assert build_fleet_view(FLEET.context, flight_of(flying()), NOW_S + 30.0).radios == ()


def test_a_radio_stands_in_the_report() -> None:
    _, state = fly([(20, 1000.0, 90), (20, 1900.0, 90)])
    content: dict[str, Any] = build_report(context_of(), state, NOW_S + 40.0).to_plain()
    [row] = content["radios"]
    assert row == {
        "vehicles": list(NAMES), "bytes_s": 1439.0, "most_bytes_s": 1900.0, "capacity_bytes_s": 2000.0,
        "round_trip_s": None, "lost": 0.0, "congested_s": 13.0, "weak_s": 0.0, "positions_hz": 5.0,
    }  # fmt: skip
    assert "radios" not in build_report(FLEET.context, flight_of(flying()), NOW_S + 40.0).to_plain()


def test_over_a_radio_only_what_is_missing_is_asked_again_and_later_where_it_is_thinned() -> None:
    setup = context_of().vehicles["uav1"]

    def missing(**given: Any) -> tuple[int, ...] | None:
        one = flying(quality=linked(NOW_S, 500.0, 90), **given)
        return list_streams_to_ask(WatchView(context_of(), setup, one, False, NOW_S))

    assert missing() is None
    assert missing(item_s=NOW_S - 30.0) == (MISSION_CURRENT,)
    assert missing(fix=at(age_s=3.0), item_s=NOW_S - 30.0) == (GLOBAL_POSITION_INT, MISSION_CURRENT)
    assert missing(fix=at(age_s=3.9), stream_step=3) is None, "four of one a second are missing"
    assert missing(fix=at(age_s=4.0), stream_step=3) == (GLOBAL_POSITION_INT,)
