"""Kinds of vehicles, autopilots and versions in words."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.telemetry import vehicle_identity
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "kinds of vehicles in words",
        lambda: {number: vehicle_identity.describe_vehicle_type(number) for number in range(36)},
        {
            0: "generic vehicle",
            1: "fixed wing",
            2: "quadrotor",
            3: "coaxial helicopter",
            4: "helicopter",
            5: "antenna tracker",
            6: "vehicle of type 6",
            7: "airship",
            8: "balloon",
            9: "vehicle of type 9",
            10: "ground rover",
            11: "boat",
            12: "submarine",
            13: "hexarotor",
            14: "octorotor",
            15: "tricopter",
            16: "flapping wing",
            17: "vehicle of type 17",
            18: "vehicle of type 18",
            19: "tail-sitter",
            20: "tail-sitter",
            21: "tilt-rotor",
            22: "VTOL",
            23: "tail-sitter",
            24: "tilt-wing",
            25: "VTOL",
            26: "vehicle of type 26",
            27: "vehicle of type 27",
            28: "vehicle of type 28",
            29: "dodecarotor",
            30: "vehicle of type 30",
            31: "vehicle of type 31",
            32: "vehicle of type 32",
            33: "vehicle of type 33",
            34: "vehicle of type 34",
            35: "decarotor",
        },
    ),
    (
        "vehicles without a kind, autopilots, versions",
        lambda: [
            vehicle_identity.describe_vehicle_type(None),
            *map(vehicle_identity.describe_autopilot, (3, 8, 12, 4)),
            *(
                str(vehicle_identity.parse_banner_version(text))
                for text in (
                    "ArduCopter V4.7",
                    "ArduCopter V4.7.2-rc1",
                    "PX4 v1.15.4",
                    "APM:Copter V3.3.3",
                    "Rover V4.5",
                )
            ),
        ],
        [
            "vehicle of unknown type",
            "ArduPilot",
            "no autopilot",
            "PX4",
            "autopilot 4",
            "4.7.0",
            "4.7.2-rc",
            "1.15.4",
            "3.3.3",
            "None",
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
