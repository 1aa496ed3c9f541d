"""Why a vehicle does not arm, as far as it says so."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    SystemStatus,
)
from executor.core.preflight import vehicle_checks
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "reasons not to arm",
        lambda: [
            vehicle_checks.describe_prearm_failure(reasons_s, status, 100.0)
            for reasons_s, status in (
                ({}, None),
                ({"a": 65.0}, None),
                ({"a": 64.9}, None),
                ({"a": 99.0, "b": 99.0, "c": 99.0}, None),
                ({"a": 99.0, "b": 99.0, "c": 99.0, "d": 99.0, "e": 99.0}, None),
            )
        ],
        [
            "its own pre-arm checks fail, no reason reported",
            "its own pre-arm checks fail: a",
            "its own pre-arm checks fail, no reason reported",
            "its own pre-arm checks fail: a; b; c",
            "its own pre-arm checks fail: a; b; c; 2 more",
        ],
    ),
    (
        "unhealthy sensors",
        lambda: [
            vehicle_checks.describe_prearm_failure({}, SystemStatus(None, None, bit, None), 100.0)
            for bit in (0, *vehicle_checks.PREARM_SENSORS, 0x40, 0x3)
        ],
        [
            "its own pre-arm checks fail, no reason reported",
            "its own pre-arm checks fail: not healthy: gyroscope",
            "its own pre-arm checks fail: not healthy: accelerometer",
            "its own pre-arm checks fail: not healthy: compass",
            "its own pre-arm checks fail: not healthy: barometer",
            "its own pre-arm checks fail: not healthy: GPS",
            "its own pre-arm checks fail: not healthy: remote control",
            "its own pre-arm checks fail: not healthy: geofence",
            "its own pre-arm checks fail: not healthy: attitude estimate",
            "its own pre-arm checks fail: not healthy: logging",
            "its own pre-arm checks fail: not healthy: battery",
            "its own pre-arm checks fail: not healthy: motors",
            "its own pre-arm checks fail, no reason reported",
            "its own pre-arm checks fail: not healthy: gyroscope, accelerometer",
        ],
    ),
    (
        "known sensors",
        lambda: sorted(vehicle_checks.PREARM_SENSORS),
        [1, 2, 4, 8, 32, 65536, 1048576, 2097152, 16777216, 33554432, 1073741824],
    ),
    (
        "texts that give a reason",
        lambda: [
            vehicle_checks.parse_prearm_reason(text)
            for text in (
                "PreArm: a",
                "Arm: b",
                "Preflight Fail: c",
                "Arming denied: d",
                "Arming denied! e",
                "PreArm:",
                "EKF3 active",
            )
        ],
        ["a", "b", "c", "d", "e", None, None],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
