"""The checklist on pictures triggered by the autopilot."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.codes import CheckCode, Severity
from executor.core.preflight import vehicle_checks
from missions import ARDUPILOT, PX4, Dialect, FlightPath, Inspection, build_flight_path, plan_flight_setup
from missions.cameras import Camera, CameraTasks, SpanCameraTask, Trigger
from tests.executor.core.preflight.test_vehicle_checks import said
from tests.missions.builders import line_east

TAKES = "its autopilot takes pictures"
WITHOUT = "TRIG_MODE 4 and the TRIG_INTERFACE of its camera, 3 for MAVLink, and a restart"
BY_DISTANCE = "its autopilot takes no pictures by distance and no single ones"


def path_with(trigger: Trigger | None) -> FlightPath:
    setup = plan_flight_setup(line_east(3), ("uav1",), Inspection(flat=True))
    if trigger is not None:
        looks = CameraTasks({"rgb": Camera("rgb", 1)}, {}, {0: (SpanCameraTask("rgb", trigger, 9.0),)})
        setup = replace(setup, looks=looks)
    return build_flight_path(setup, "uav1", (0,))


@pytest.mark.parametrize(("dialect", "value", "severity", "text"), [
    (ARDUPILOT, 1.0, Severity.OK, f"{TAKES} (CAM1_TYPE 1)"),
    (ARDUPILOT, 0.0, Severity.WARNING,
     "CAM1_TYPE 0: its autopilot takes no pictures at all; expected the CAM1_TYPE of its camera, and a restart"),
    (PX4, 4.0, Severity.OK, f"{TAKES} (TRIG_MODE 4)"),
    (PX4, 0.0, Severity.WARNING, f"TRIG_MODE 0: {BY_DISTANCE}; expected {WITHOUT}"),
    (PX4, None, Severity.WARNING, f"does not say TRIG_MODE: {BY_DISTANCE}; expected {WITHOUT}"),
])  # fmt: skip
def test_the_crew_is_informed_before_a_flight_that_would_see_nothing(
    dialect: Dialect, value: float | None, severity: Severity, text: str
) -> None:
    facts = said(dialect, **({} if value is None else {dialect.shutter.parameter: value}))
    (found,) = vehicle_checks.check_shutter(facts, dialect, path_with(Trigger.DISTANCE))
    assert (found.severity, found.text, found.code) == (severity, text, CheckCode.CAMERA)


@pytest.mark.parametrize("trigger", [None, Trigger.INTERVAL, Trigger.VIDEO])
def test_nothing_is_reported_of_what_px4_passes_on_to_the_camera(trigger: Trigger | None) -> None:
    assert vehicle_checks.check_shutter(said(PX4, TRIG_MODE=0.0), PX4, path_with(trigger)) == []
    assert vehicle_checks.check_shutter(said(PX4, TRIG_MODE=0.0), PX4, None) == []


def test_the_parameter_is_asked_for() -> None:
    assert [PX4.shutter.parameter, ARDUPILOT.shutter.parameter] == ["TRIG_MODE", "CAM1_TYPE"]
