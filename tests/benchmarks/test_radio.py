"""Flights over a radio: which are flown, what is counted of them, and the page."""

from __future__ import annotations

from benchmarks.radio import RadioFlight, _Air, make_radio_cases, radio_document, report_radio
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.core.interface.messages import MissionItemInt, SendHeartbeat
from missions import MissionItem


def test_every_radio_is_flown_with_each_autopilot_from_its_own_seed() -> None:
    cases = make_radio_cases(["sik", "lte"], [3, 4], ["ardupilot", "px4"], 2, 7)
    assert len(cases) == 16
    assert [(one.radio, one.autopilot, one.vehicles, one.seed) for one in cases[:3]] == [
        ("sik", "ardupilot", 3, 7), ("sik", "ardupilot", 3, 8), ("sik", "ardupilot", 4, 7),
    ]  # fmt: skip


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


def test_a_false_fault_and_a_flight_that_was_not_flown_are_wrong() -> None:
    flights = [
        RadioFlight("sik", "px4", 4, 1, asked_s=10.0, loaded_s=7.0, items=160, finished=True),
        RadioFlight("sik", "px4", 4, 2, false_faults=("uav1: link lost",)),
        RadioFlight("mesh", "px4", 4, 3, failure="uav1: not ready"),
    ]
    content = radio_document(flights, "faultline bench radio", 1)
    assert content["wrong"] == 2
    page = report_radio(content).page()
    assert "| sik | px4 | 10.0 | 7.0 | 160 |" in page
    assert "uav1: not ready" in page
