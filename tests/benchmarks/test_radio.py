"""Flights over a radio: which are flown, what is counted of them, and the page."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from benchmarks.radio import (
    RadioCase,
    RadioFlight,
    _Air,
    _Buffer,
    _Waiting,
    fly_and_keep,
    make_radio_cases,
    radio_document,
    report_radio,
)
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.core.interface.messages import MissionItemInt, SendHeartbeat
from executor.core.lines import link
from executor.protocols import vehicle_commands
from missions import MissionItem


def test_every_radio_is_flown_with_each_autopilot_from_its_own_seed() -> None:
    cases = make_radio_cases(["sik", "lte"], [3, 4], ["ardupilot", "px4"], 2, 7, [False, True])
    assert len(cases) == 32
    assert [str(one) for one in cases[:3]] == [
        "sik, ardupilot, 3 vehicles, unsigned, seed 7",
        "sik, ardupilot, 3 vehicles, signed, seed 7",
        "sik, ardupilot, 4 vehicles, unsigned, seed 7",
    ]
    assert {one.seed for one in cases[:16]} == {7}, "a campaign that is broken off has flown every kind"


def test_a_campaign_flies_only_what_is_not_in_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flown: list[RadioCase] = []

    def fly(case: RadioCase) -> RadioFlight:
        flown.append(case)
        return RadioFlight(case.radio, case.autopilot, case.vehicles, case.seed, asked_s=9.0, broken=("uav1: gap",))

    first, second = make_radio_cases(["sik"], [3], ["px4"], 2, 1)
    once = fly_and_keep(first, tmp_path, fly)
    assert fly_and_keep(first, tmp_path, fly) == once
    fly_and_keep(second, tmp_path, fly)
    assert flown == [first, second]
    assert capsys.readouterr().err.splitlines()[0] == (
        "sik, px4, 3 vehicles, unsigned, seed 1: asked 9.0 s, loaded - s, re-plan - s, 0 late; "
        "uav1: gap; not all inspected"
    )


def test_items_are_counted_by_vehicle_and_place() -> None:
    codec, air = MavlinkCodec(), _Air()
    for seq in (5, 5, 6):
        air.take_up(codec.encode(MissionItemInt(MissionItem(seq, 3, 16, z=9.0)), 12, 1))
    air.take_up(codec.encode(SendHeartbeat(), 12, 1))
    assert dict(air.items) == {(12, 5): 2, (12, 6): 1}
    assert air.up_bytes > 3 * 40


def test_times_without_our_heartbeat_are_those_of_each_vehicle() -> None:
    air = _Air()
    for vehicle, at_s in (("uav1", 1.0), ("uav2", 1.5), ("uav1", 4.0), ("uav2", 2.0)):
        air.hear(vehicle, at_s)
    assert air.gaps_s == [3.0, 0.5]


def test_an_order_waits_in_the_radio_until_its_last_byte_is_sent() -> None:
    """It came as the first of three packets went out, behind two items; a heartbeat before them was cut."""
    codec, buffer = MavlinkCodec(), _Buffer()
    item = partial(MissionItem, frame=3, command=16, x=496000000, y=156000000, z=9.0)
    cut, order = codec.encode(SendHeartbeat(), 12, 1), codec.encode(vehicle_commands.arm(), 12, 1)
    first, second = (codec.encode(MissionItemInt(item(seq)), 12, 1) for seq in (5, 6))
    for frame, since_s in ((cut, 9.0), (first, 10.0), (second, 10.0), (order, 10.5)):
        buffer.waiting.append(_Waiting(frame, since_s))
    sent = first + second + order
    for at_s, packet in ((10.5, sent[:60]), (11.0, sent[60:118]), (11.6, sent[118:])):
        buffer.send_packet(packet, at_s)
    assert not buffer.waiting
    assert (buffer.order_wait_s, buffer.order_behind_s) == pytest.approx((1.1, 0.6))
    assert buffer.behind_s == pytest.approx(0.6), (
        "the first item was sent with the first packet, the second by the next"
    )


AGREED = {
    "preflight_s", "upload_s", "replan_on_board_s", "false_losses", "stream_faults", "proofs_broken",
    "heartbeat_late_s",
}  # fmt: skip
"""Figures for checks from outside."""


def test_a_false_fault_and_a_flight_that_was_not_flown_are_wrong() -> None:
    gone = link.MISSING.format(stream=link.NO_BATTERY_REPORT, age_s=40.0)
    flights = [
        RadioFlight("sik", "px4", 4, 1, asked_s=10.0, loaded_s=7.0, items=160, finished=True),
        RadioFlight("sik", "px4", 4, 2, false_faults=("uav1: link lost", f"uav2: {gone}"), broken=("uav3: gap",)),
        RadioFlight("mesh", "px4", 4, 3, failure="uav1: not ready", heartbeat_gap_s=2.5),
    ]
    content = radio_document(flights, "faultline bench radio", 1)
    assert [one.wrong for one in flights] == [
        "", f"uav1: link lost; uav2: {gone}; uav3: gap; not all inspected", "uav1: not ready"
    ]  # fmt: skip
    assert content["wrong"] == 2
    assert {key: value for key, value in content.items() if key in AGREED} == {
        "preflight_s": 10.0, "upload_s": 7.0, "replan_on_board_s": None, "false_losses": 2, "stream_faults": 1,
        "proofs_broken": 1, "heartbeat_late_s": 1.5,
    }  # fmt: skip
    page = report_radio(content).page()
    assert "| sik | px4 | 4 | no | 1 | 10.0 | 7.0 | 160 |" in page
    assert "uav1: not ready" in page
