"""What the published table of MAVSDK's suites says to pass, passes."""

from __future__ import annotations

import pytest

from tests.patience import PATIENCE_S
from tests.peers.mavsdk_suites import AUTOPILOTS, SUITES, is_passed, read_passed

PASSED = [(autopilot, *one) for autopilot in AUTOPILOTS for one in read_passed(autopilot)]


def test_the_table_has_something_of_each_suite_that_is_supported() -> None:
    assert {suite for _, suite, _ in PASSED} >= {"action", "param", "geofence", "telemetry"}


@pytest.mark.asyncio
@pytest.mark.parametrize(("autopilot", "suite", "name"), PASSED)
async def test_a_case_of_the_table_passes(autopilot: str, suite: str, name: str) -> None:
    assert await is_passed(autopilot, SUITES[suite][name], PATIENCE_S)
