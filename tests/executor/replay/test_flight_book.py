"""Which flights of a log had a mission."""

from __future__ import annotations

from executor.core.state.vehicle_state import VehicleState
from executor.replay.log_replay import FlightBook
from tests.executor.core.vehicles import DISARMED, flying


def book(*flights: VehicleState) -> FlightBook:
    """Return what was noted of flights that began a hundred seconds apart."""
    kept = FlightBook()
    for number, flight in enumerate(flights):
        kept.begin_flight(100.0 * number)
        kept.update(flight)
    return kept


MISSION, BY_HAND, HOP = flying(flew_mission=True), flying(), flying(took_off=False)


def test_a_flight_with_a_mission_needs_no_words() -> None:
    assert book().describe_missionless("1") == ""
    assert book(MISSION, HOP).describe_missionless("1") == ""


def test_a_flight_without_one_is_no_inspection() -> None:
    assert book(BY_HAND).describe_missionless("1") == (
        "1: flown by hand, or without a mission (at 0.0 s): no inspection that could be interrupted; its battery, "
        "its link and a crash are watched for"
    )


def test_some_of_its_flights() -> None:
    assert (
        book(MISSION, BY_HAND, BY_HAND)
        .describe_missionless("1")
        .startswith("1: 2 of its 3 flights by hand, or without a mission (the first at 100.0 s): ")
    )


def test_a_mission_that_a_pilot_has_left_was_one() -> None:
    kept = book(MISSION)
    kept.update(BY_HAND)
    kept.update(flying(heartbeat=DISARMED))
    assert kept.describe_missionless("1") == ""
