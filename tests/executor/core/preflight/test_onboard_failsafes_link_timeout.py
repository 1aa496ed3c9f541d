"""After which silence a vehicle is lost: never before its own failsafe has acted."""

from __future__ import annotations

from executor.core.interface.codes import Severity
from executor.core.preflight import onboard_failsafes
from missions import ARDUPILOT, PX4
from tests.executor.core.preflight.test_vehicle_checks import link, said, waited_s


def test_a_lost_vehicles_segments_are_not_reassigned_before_its_failsafe_acts() -> None:
    slow = said(PX4, COM_DL_LOSS_T=30.0)
    assert waited_s(slow, PX4) == 37.0 + onboard_failsafes.LINK_MARGIN_S
    assert waited_s(slow, PX4, 12.0) == 37.0 + onboard_failsafes.LINK_MARGIN_S
    assert waited_s(slow, PX4, 45.0) == 45.0
    check = link(slow, PX4, 12.0)
    assert check.severity is Severity.WARNING
    assert "faults.link_timeout_s 12 is shorter" in check.text
    assert check.text.endswith("declared lost after 40 s instead")


def test_a_vehicle_without_a_failsafe_is_waited_for_as_the_site_says() -> None:
    assert waited_s(said(FS_GCS_ENABLE=0.0), ARDUPILOT, 4.0) == 4.0
    assert waited_s(said(FS_GCS_ENABLE=0.0), ARDUPILOT) == onboard_failsafes.LEAST_LINK_TIMEOUT_S


def test_a_fast_simulation_is_waited_for_no_less_than_a_busy_computer_needs() -> None:
    assert waited_s(said(), ARDUPILOT, speedup=30.0) == 60.0 + onboard_failsafes.LINK_MARGIN_S
    assert waited_s(said(FS_GCS_TIMEOUT=80.0), ARDUPILOT, speedup=30.0) == 80.0 + onboard_failsafes.LINK_MARGIN_S
