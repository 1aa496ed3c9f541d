"""What may be true of each report, at the limits."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    Attitude,
    Battery,
    Gps,
    MissionCurrent,
    MissionReached,
    Position,
    SystemStatus,
    Wind,
)
from executor.core.telemetry import plausibility
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import NOW_S

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "plausible positions",
        lambda: [
            plausibility.filter_implausible(
                Position(1.0, lat_deg, lon_deg, alt_m, rel_m, speed_m_s, 0.0, 0.0, heading_deg)
            )
            is not None
            for lat_deg, lon_deg, alt_m, rel_m, speed_m_s, heading_deg in (
                (90.0, 180.0, -1000.0, 20000.0, 150.0, 360.0),
                (90.1, 0.0, 0.0, 0.0, 0.0, None),
                (0.0, 180.1, 0.0, 0.0, 0.0, None),
                (1.0, 0.0, -1000.1, 0.0, 0.0, None),
                (1.0, 0.0, 0.0, 20000.1, 0.0, None),
                (0.0, 1.0, 0.0, 0.0, -150.1, None),
            )
        ],
        [True, False, False, False, False, False],
    ),
    (
        "plausible headings",
        lambda: [
            getattr(
                plausibility.filter_implausible(Position(1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, heading_deg)),
                "heading_deg",
                None,
            )
            for heading_deg in (0.0, -0.1, 360.0, 360.1)
        ],
        [0.0, None, 360.0, None],
    ),
    (
        "plausible battery reports",
        lambda: [
            plausibility.filter_implausible(Battery(0, percent, volts_v, current_a, consumed_ah, 1, 0, cells_v))
            for percent, volts_v, current_a, consumed_ah, cells_v in (
                (0.0, 1.0, 0.0, 0.0, (0.5,)),
                (100.0, 500.0, 1000.0, 1000.0, (4.9,)),
                (-0.1, 0.9, -0.1, -0.1, (0.4,)),
                (100.1, 500.1, 1000.1, 1000.1, (5.0,)),
            )
        ],
        [
            Battery(
                battery=0,
                remaining_pct=0.0,
                voltage_v=1.0,
                current_a=0.0,
                consumed_ah=0.0,
                charge_state=1,
                faults=0,
                cells_v=(0.5,),
            ),
            Battery(
                battery=0,
                remaining_pct=100.0,
                voltage_v=500.0,
                current_a=NOW_S,
                consumed_ah=NOW_S,
                charge_state=1,
                faults=0,
                cells_v=(4.9,),
            ),
            Battery(
                battery=0,
                remaining_pct=None,
                voltage_v=None,
                current_a=None,
                consumed_ah=None,
                charge_state=1,
                faults=0,
            ),
            Battery(
                battery=0,
                remaining_pct=None,
                voltage_v=None,
                current_a=None,
                consumed_ah=None,
                charge_state=1,
                faults=0,
            ),
        ],
    ),
    (
        "plausible status reports",
        lambda: [
            plausibility.filter_implausible(SystemStatus(percent, volts_v, 0, None))
            for percent, volts_v in ((0.0, 1.0), (100.0, 500.0), (-0.1, 0.9), (100.1, 1.0), (1.0, 500.1))
        ],
        [
            SystemStatus(remaining_pct=0.0, voltage_v=1.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=100.0, voltage_v=500.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=None, voltage_v=None, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=None, voltage_v=1.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=1.0, voltage_v=None, unhealthy=0, prearm_ok=None),
        ],
    ),
    (
        "plausible attitudes",
        lambda: [
            plausibility.filter_implausible(Attitude(roll_deg, pitch_deg)) is not None
            for roll_deg, pitch_deg in ((360.0, -360.0), (360.1, 0.0), (0.0, -360.1))
        ],
        [True, False, False],
    ),
    (
        "other plausible reports",
        lambda: [
            plausibility.filter_implausible(one) is not None
            for one in (
                Gps(0, None),
                Gps(8, None),
                Gps(9, None),
                Gps(-1, None),
                Wind(0.0, 0.0),
                Wind(150.0, 360.0),
                Wind(150.1, 0.0),
                Wind(-0.1, 0.0),
                Wind(1.0, 360.1),
                Wind(1.0, -0.1),
                MissionCurrent(0, None),
                MissionCurrent(65534, None),
                MissionCurrent(65535, None),
                MissionCurrent(-1, None),
                MissionReached(0),
                MissionReached(65534),
                MissionReached(65535),
                MissionReached(-1),
            )
        ],
        [
            True,
            True,
            False,
            False,
            True,
            True,
            False,
            False,
            False,
            False,
            True,
            True,
            False,
            False,
            True,
            True,
            False,
            False,
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
