"""What every flight of real autopilots has in common, whatever happened in it."""

from __future__ import annotations

from executor.analysis.flight_record import SegmentRecord, read_run
from tests.e2e.judge import wrongly_counted
from tests.sitl.flights import NAMES, VICTIM, Flown

LEAST_APART_M = 5.0


def ended_well(flight: Flown, lost: list[str], *, down: tuple[str, ...] = NAMES, unseen: bool = False) -> None:
    """Check what every flight has in common.

    Args:
        flight: To be checked.
        lost: The kinds of uav2's faults.
        down: Those who must land.
        unseen: Whether segments may count that nobody saw flown.
    """
    report, said = flight.report, flight.said
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [(VICTIM, kind) for kind in lost], said
    assert report["finished"], said
    assert report["segments_inspected"] == report["segments_total"] > 0
    proven, inferred = {one["segment"] for one in report["inspections"]}, set(report["inferred"])
    assert proven | inferred == set(range(report["segments_total"]))
    if not unseen:
        assert len(report["inspections"]) == report["segments_total"]
        assert inferred == set()
    assert [one for one in wrongly_counted(flight.run, report) if one[1] not in inferred] == [], said
    assert report["min_separation_m"] >= LEAST_APART_M, said
    assert not any(line for line in said.splitlines() if "internal error" in line), said
    assert all(replan["feasible"] for replan in report["replans"]), said
    for name in down:
        assert flight.vehicle(name)["landed"], said
        assert not flight.heartbeats(name)[-1][1], f"{name} is still armed"
    for fault in report["faults"]:
        # What a vehicle does after its work was given away counts for nothing.
        for one in inspected_by(flight, fault["vehicle"]):
            assert one.inspected_s is not None
            assert one.inspected_s <= fault["detected_s"]


def inspected_by(flight: Flown, name: str) -> list[SegmentRecord]:
    """Return the segments that a vehicle inspected, by the records of the flight."""
    return [one for one in read_run(flight.run).segments if one.inspected_by == name]
