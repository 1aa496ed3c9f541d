"""Which component speaks for a system of several."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    Heartbeat,
)
from executor.core.telemetry import vehicle_identity
from executor.core.telemetry.vehicle_identity import AutopilotComponent
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "component that represents a system",
        lambda: [
            vehicle_identity.update_autopilot_component(known, component, Heartbeat(autopilot, 0, False, 4, kind))
            for known in (
                AutopilotComponent(),
                AutopilotComponent(1, heard=True),
                AutopilotComponent(5),
                AutopilotComponent(5, heard=True),
            )
            for component, autopilot, kind in ((1, 3, 2), (5, 3, 2), (7, 12, 13), (7, 8, 26), (7, 3, 26), (7, 0, 2))
        ],
        [
            AutopilotComponent(heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=7, heard=True),
            AutopilotComponent(),
            AutopilotComponent(),
            AutopilotComponent(),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=7, heard=True),
            AutopilotComponent(component=5),
            AutopilotComponent(component=5),
            AutopilotComponent(component=5),
            AutopilotComponent(heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=5, heard=True),
            AutopilotComponent(component=5, heard=True),
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
