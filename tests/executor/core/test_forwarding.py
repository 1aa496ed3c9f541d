"""What other stations may send to which vehicles: whatever they send, a router's rules and a radio's share hold."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.forwarding import (
    BURST_S,
    CORRECTIONS,
    CORRECTIONS_BYTES_S,
    FLOODS,
    HEARTBEAT,
    HEARTBEAT_BURST,
    HEARTBEAT_HZ,
    LINK_REPORTS,
    REQUEST_MESSAGE,
    SET_MESSAGE_INTERVAL,
    TRANSFERS,
    Allowance,
    Bucket,
    ForwardRules,
    StationFrame,
    make_allowance,
)
from executor.core.lines import link

COMMAND_LONG, PARAM_SET, MISSION_ITEM_INT, GPS_RTCM_DATA = 76, 23, 73, 233
OURS, STATION = 254, 255
RULES = ForwardRules(OURS, frozenset({1, 2, 3}), allow_orders=True)
SYSTEMS = st.integers(1, 255)
NUMBERS = st.sampled_from(
    [HEARTBEAT, COMMAND_LONG, PARAM_SET, *sorted(FLOODS), *sorted(TRANSFERS), *sorted(LINK_REPORTS), 233, 12900, 12915]
)
COMMANDS = st.sampled_from([None, 20, 22, 400, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL])
FRAMES = st.builds(
    StationFrame, SYSTEMS, st.sampled_from([190, 230]), NUMBERS, st.integers(8, 280), st.integers(0, 255), COMMANDS
)
STEPS = st.lists(st.tuples(FRAMES, st.floats(0.0, 2.0), st.booleans()), max_size=60)
SHARES = st.floats(1.0, 5000.0)


def frame(
    number: int = COMMAND_LONG, *, system: int = STATION, size: int = 45, command: int | None = None
) -> StationFrame:
    return StationFrame(system, 190, number, size, 1, command)


@given(rules=st.builds(ForwardRules, SYSTEMS, st.frozensets(st.integers(1, 254)), st.booleans()), sent=FRAMES)
def test_frames_reach_only_their_vehicle_and_no_sender_uses_anothers_id(
    rules: ForwardRules, sent: StationFrame
) -> None:
    targets = rules.select_targets(sent)
    assert targets <= rules.vehicles
    assert targets == (rules.vehicles if sent.target == 0 else rules.vehicles & {sent.target})
    strange = sent.system != rules.ours and sent.system not in rules.vehicles
    assert (rules.find_refusal(sent) == "") is (rules.allow_orders and strange)
    assert rules.find_refusal(sent, signed=False) != ""


@given(target=st.integers(0, 255), stations=st.frozensets(SYSTEMS))
def test_a_vehicles_answer_goes_to_its_addressee_and_ours_to_no_other(target: int, stations: frozenset[int]) -> None:
    assert RULES.is_for_station(target, stations) is (target == 0 or (target != OURS and target in stations))


@pytest.mark.parametrize(
    ("rules", "system", "signed", "why"),
    [
        (RULES, STATION, True, ""),
        (replace(RULES, allow_orders=False), STATION, True, link.ORDERS_NOT_ALLOWED),
        (RULES, OURS, True, link.HAS_OUR_SYSTEM.format(ours=OURS)),
        (RULES, 2, True, link.HAS_VEHICLES_SYSTEM),
        (RULES, STATION, False, link.NOT_SIGNED),
    ],
)
def test_why_a_station_may_not_order(rules: ForwardRules, system: int, signed: bool, why: str) -> None:
    assert rules.find_refusal(frame(system=system), signed=signed) == why


def send(allowance: Allowance, steps: list[tuple[StationFrame, float, bool]]) -> list[tuple[float, StationFrame, bool]]:
    """Return when what passed, and whether a transfer was under way."""
    now_s, passed = 0.0, []
    for sent, after_s, busy in steps:
        now_s += after_s
        allowance, why = allowance.admit(sent, now_s, busy=busy)
        if why is None:
            passed.append((now_s, sent, busy))
    return passed


@given(steps=STEPS, share_bytes_s=SHARES)
def test_a_radio_is_never_given_more_than_their_share_of_it(
    steps: list[tuple[StationFrame, float, bool]], share_bytes_s: float
) -> None:
    passed = send(make_allowance(share_bytes_s), steps)
    most = make_allowance(share_bytes_s).bytes_.most
    counted = [(at_s, one.size) for at_s, one, _ in passed if one.number != HEARTBEAT]
    for first, (from_s, _) in enumerate(counted):
        for last in range(first, len(counted)):
            size = sum(one for _, one in counted[first : last + 1])
            assert size <= most + share_bytes_s * (counted[last][0] - from_s) + 1e-6
    assert not any(one.is_flood or one.number in LINK_REPORTS for _, one, _ in passed if one.number != HEARTBEAT)
    assert not any(busy and one.number in TRANSFERS | CORRECTIONS for _, one, busy in passed)


@given(steps=STEPS)
def test_without_a_radio_only_corrections_are_rationed(steps: list[tuple[StationFrame, float, bool]]) -> None:
    passed = [one for _, one, _ in send(make_allowance(None), steps)]
    free = [
        one
        for one, _, busy in steps
        if one.number not in CORRECTIONS | LINK_REPORTS | {HEARTBEAT} and not (busy and one.number in TRANSFERS)
    ]
    assert [one for one in passed if one.number not in CORRECTIONS | {HEARTBEAT}] == free


@given(after=st.lists(st.floats(0.0, 3.0), max_size=60), share_bytes_s=st.none() | SHARES)
def test_heartbeats_pass_once_a_second_at_most_and_each_that_is_in_time_does(
    after: list[float], share_bytes_s: float | None
) -> None:
    beat = frame(HEARTBEAT)
    passed = [at_s for at_s, _, _ in send(make_allowance(share_bytes_s), [(beat, one, True) for one in after])]
    for first, from_s in enumerate(passed):
        assert len(passed) - first <= HEARTBEAT_BURST + HEARTBEAT_HZ * (passed[-1] - from_s) + 1e-6
    if all(one >= 1.0 for one in after):
        assert len(passed) == len(after)


def test_a_late_heartbeat_costs_none_of_those_after_it() -> None:
    beats = [(frame(HEARTBEAT), after_s, False) for after_s in (1.0, 1.3, 0.7, 1.2, 0.8) * 4]
    assert len(send(make_allowance(100.0), beats)) == len(beats)


def test_each_station_has_its_own_heartbeats() -> None:
    beats = [(frame(HEARTBEAT, system=100 + system), 0.0, False) for system in range(4)]
    assert len(send(make_allowance(None), beats)) == 4


def test_corrections_leave_room_for_orders() -> None:
    """A base station that sends ten times what the radio has for it, and a pilot who wants his vehicle home."""
    allowance = make_allowance(120.0)
    for tick in range(200):
        allowance, _ = allowance.admit(frame(GPS_RTCM_DATA, size=192), tick / 10, busy=False)
    assert allowance.admit(frame(), 20.0, busy=False)[1] is None
    assert allowance.admit(frame(), 20.0, busy=True)[1] is None


@pytest.mark.parametrize(
    ("sent", "busy", "why"),
    [
        (frame(66), False, link.WOULD_FILL_RADIO),
        (frame(21), False, link.WOULD_FILL_RADIO),
        (frame(command=SET_MESSAGE_INTERVAL), False, link.WOULD_FILL_RADIO),
        (frame(command=REQUEST_MESSAGE), False, None),
        (frame(command=REQUEST_MESSAGE), True, ""),
        (frame(MISSION_ITEM_INT), False, None),
        (frame(MISSION_ITEM_INT), True, link.TRANSFER_UNDER_WAY),
        (frame(GPS_RTCM_DATA), True, ""),
        (frame(109), False, ""),
        (frame(PARAM_SET), True, None),
        (frame(110), True, link.WOULD_FILL_RADIO),
        (frame(size=2000), False, link.MORE_THAN_SHARE),
    ],
)
def test_what_a_radio_is_spared(sent: StationFrame, busy: bool, why: str | None) -> None:
    assert make_allowance(120.0).admit(sent, 0.0, busy=busy)[1] == why


def test_a_file_of_theirs_does_not_end_the_session_of_ours() -> None:
    """ArduPilot has one session of files at a time, and takes missions by it."""
    assert make_allowance(None).admit(frame(110), 0.0, busy=True)[1] == link.TRANSFER_UNDER_WAY
    assert make_allowance(None).admit(frame(110), 0.0, busy=False)[1] is None


def test_a_bucket_fills_up_to_its_brim_and_time_that_stands_still_fills_nothing() -> None:
    bucket = Bucket(10.0, 30.0).take(30.0, 100.0)
    assert bucket is not None
    assert bucket.take(1.0, 100.0) is None
    assert bucket.take(1.0, 90.0) is None
    half = bucket.take(10.0, 101.0)
    assert half is not None
    assert half.left == 0.0
    full = bucket.take(0.0, 1000.0)
    assert full is not None
    assert full.left == 30.0
    assert make_allowance(None).bytes_.most == BURST_S * CORRECTIONS_BYTES_S
