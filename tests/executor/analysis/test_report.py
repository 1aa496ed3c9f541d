"""What report.json and vehicles.json say of a flight."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.analysis.report import build_report, build_vehicle_answers
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.interface.messages import Heartbeat, Position, StationHeard, Version
from executor.core.preflight.parameter_changes import ChangeStage, KeptParameter
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.vehicle_position import is_over_pad
from executor.flight.restore_vehicles import build_parameter_rows
from tests.executor.core.stories import FLEET, under_way

POSITION = Position(60.0, 49.6, 15.6, 450.0, 0.0, 0.0, 0.0, 0.0, None)
SAID = build_vehicle_answers(
    FLEET.context,
    {
        "uav1": VehicleFacts(
            "uav1", Heartbeat(3, 0, False, 3, 2), POSITION, 98.0, Version(4, 7, 0, "dev"), {"FS_GCS_ENABLE": 1.0},
            (StationHeard(254, 190),),
        ),
        "uav2": VehicleFacts("uav2", Heartbeat(3, 0, False, 3, 13), POSITION, 97.0, None, {}),
    },
    [Check(Severity.WARNING, "uav2", "no battery failsafe", CheckCode.BATTERY_FAILSAFE)],
)  # fmt: skip


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    """Return the report of a flight in which uav2 falls silent, as JSON holds it."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.finish()
    content: dict[str, Any] = build_report(FLEET.context, flight.state, flight.now_s, said=SAID).to_plain()
    return content


def test_every_inspection_has_its_speeds(report: dict[str, Any]) -> None:
    rows = {row["segment"]: row for row in report["inspections"]}
    assert sorted(rows) == list(range(6))
    by = {segment: vehicle["name"] for vehicle in report["vehicles"] for segment in vehicle["segments"]}
    assert {segment: row["vehicle"] for segment, row in rows.items()} == by
    asked = report["inspection_speed_m_s"]
    for row in rows.values():
        assert row["speed_mean_m_s"] == pytest.approx(asked, rel=0.1)
        assert row["speed_max_m_s"] == pytest.approx(asked, rel=0.05)
        assert row["deviation_mean_m"] <= row["deviation_max_m"] < 0.5


def test_the_last_position_of_every_vehicle_is_kept(report: dict[str, Any]) -> None:
    states = {row["name"]: row["state"] for row in report["vehicles"]}
    assert states == {"uav1": "landed", "uav2": "lost", "uav3": "landed"}
    lost = report["vehicles"][1]["last_position"]
    assert set(lost) == {"lat_deg", "lon_deg", "alt_rel_m", "at_s", "known", "accuracy_m", "last_fix"}
    assert (lost["known"], lost["accuracy_m"], lost["last_fix"]) == ("unsaid", None, None)
    assert FLEET.context.frame.to_local_m(lost["lat_deg"], lost["lon_deg"])[0] > 200.0
    assert 0.0 < lost["at_s"] < report["faults"][0]["detected_s"]
    assert report["segment_names"] == {str(segment): f"segment {segment}" for segment in range(6)}


def test_a_vehicle_that_loses_gps_on_its_pad_has_landed() -> None:
    flight = under_way()
    flight.finish()
    vehicle = flight.state.vehicles["uav1"]
    assert vehicle.motion.fix is not None
    fixed = replace(vehicle.motion.fix, boot_s=vehicle.motion.fix.boot_s - 50.0)
    lost = replace(vehicle.sensors.positioning, lost_s=fixed.at_s - 50.0, fixed=fixed)
    blind = replace(vehicle, sensors=replace(vehicle.sensors, positioning=lost)).with_motion(
        fix=replace(vehicle.motion.fix, reckoned=True)
    )
    assert not is_over_pad(FLEET.context, blind)
    rows = build_report(FLEET.context, flight.state.put(blind), flight.now_s, said=SAID).vehicles
    assert [row.landed for row in rows] == [True, True, True]


def test_the_vehicles_are_known_by_what_they_said(report: dict[str, Any]) -> None:
    first, second, third = report["vehicles"]
    assert (first["type"], first["autopilot"], first["firmware"]) == ("quadrotor", "ArduPilot", "4.7.0-dev")
    assert (second["type"], second["firmware"]) == ("hexarotor", None)
    assert (third["type"], third["firmware"]) == (None, None)
    assert report["checks"] == [
        {"severity": "warning", "code": "battery_failsafe", "subject": "uav2", "text": "no battery failsafe"}
    ]


def test_what_was_asked_before_the_flight_is_kept() -> None:
    content: dict[str, Any] = SAID.to_plain()
    first = content["vehicles"][0]
    assert content["format"] == "faultline-vehicles/1"
    assert (first["name"], first["sysid"], first["remaining_pct"]) == ("uav1", 1, 98.0)
    assert first["parameters"] == {"FS_GCS_ENABLE": 1.0}
    assert first["link_timeout_s"] == FLEET.context.vehicles["uav1"].link_timeout_s
    assert first["stations"] == [[254, 190]]


def test_what_was_changed_on_board_is_named_with_what_became_of_it() -> None:
    flight = under_way()
    rows = build_parameter_rows([
        KeptParameter("uav1", 1, "ardupilot", "RTL_ALT", 1500.0, 2700.0, 6, "cm", "", stage=ChangeStage.RESTORED),
        KeptParameter("uav2", 2, "ardupilot", "RTL_ALT", 1217.0, 3200.0, 6, "cm", "", stage=ChangeStage.SET),
    ])  # fmt: skip
    content = build_report(FLEET.context, flight.state, flight.now_s, said=SAID, parameters=rows)
    assert content.to_plain()["parameters"] == [
        {"vehicle": "uav1", "name": "RTL_ALT", "old": 1500.0, "new": 2700.0, "restored": True},
        {"vehicle": "uav2", "name": "RTL_ALT", "old": 1217.0, "new": 3200.0, "restored": False},
    ]
