"""Foreign systems on a link: which are named, and how many."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    DoubleHeard,
    StationHeard,
)
from executor.core.telemetry import vehicle_identity
from tests.executor.core.steps import rounded

STATIONS = frozenset(StationHeard(number, 190) for number in range(1, 8))

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "strangers are named until they are many",
        lambda: [
            len(vehicle_identity.add_foreign_system(STATIONS, one))
            for one in (StationHeard(1, 190), StationHeard(9, 190), DoubleHeard(3, ("a", "b")))
        ],
        [7, 8, 8],
    ),
    (
        "the last stranger that is named",
        lambda: [
            sorted(
                vehicle_identity.describe_new_foreign_systems(
                    known, vehicle_identity.add_foreign_system(known, StationHeard(9, 190))
                )
            )
            for known in (STATIONS, STATIONS - {StationHeard(1, 190)}, STATIONS | {StationHeard(8, 190)})
        ],
        [
            [("another ground station is on its link, system 9 component 190; further ones are not listed")],
            ["another ground station is on its link, system 9 component 190"],
            [],
        ],
    ),
    (
        "two with one number",
        lambda: list(
            vehicle_identity.describe_new_foreign_systems(frozenset(), frozenset({DoubleHeard(3, ("a", "b"))}))
        ),
        ["sysid 3 is used at a and b: duplicate system id"],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
