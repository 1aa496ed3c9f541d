"""The checklist on terrain following by the autopilot, and on pads that differ from the raster."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from executor.core.context import Context
from executor.core.interface.codes import Severity
from executor.core.preflight import vehicle_checks
from missions import ARDUPILOT, PX4, Pad
from tests.executor.core.preflight.test_vehicle_checks import said
from tests.terrain_judge import case_of


@pytest.mark.parametrize(("dialect", "changes", "severity", "text"), [
    (ARDUPILOT, {}, Severity.OK, "its missions and its RTL do not follow terrain"),
    (ARDUPILOT, {"RTL_ALT_TYPE": 0.0, "TERRAIN_ENABLE": 1.0}, Severity.OK,
     "its missions and its RTL do not follow terrain (TERRAIN_ENABLE 1 keeps a map that is not used)"),
    (ARDUPILOT, {"RTL_ALT_TYPE": 1.0, "TERRAIN_ENABLE": 1.0}, Severity.WARNING,
     "follows terrain automatically: RTL_ALT_TYPE 1: its RTL is not level, but over its own map"),
    (PX4, {"MPC_ALT_MODE": 0.0}, Severity.OK, "its missions and its RTL do not follow terrain"),
    (PX4, {"MPC_ALT_MODE": 1.0}, Severity.OK,
     "its missions and its RTL do not follow terrain (MPC_ALT_MODE 1 does so in the pilot's modes)"),
])  # fmt: skip
def test_the_crew_is_informed_of_terrain_following(
    dialect: object, changes: dict[str, float], severity: Severity, text: str
) -> None:
    known = ARDUPILOT if dialect is ARDUPILOT else PX4
    (found,) = vehicle_checks.check_terrain_following(said(known, **changes), known)
    assert (found.severity, found.text) == (severity, text)


def test_each_of_its_parameters_is_asked_for() -> None:
    assert {rule.parameter for rule in ARDUPILOT.terrain} >= {
        "RTL_ALT_TYPE",
        "TERRAIN_ENABLE",
        "WPNAV_RFND_USE",
    }
    assert [rule.parameter for rule in PX4.terrain] == ["MPC_ALT_MODE"]


def test_a_gps_that_is_too_high_flies_low_over_the_ground(tmp_path: Path) -> None:
    setup = case_of(3, tmp_path).setup
    known = setup.terrain
    assert known is not None
    (first, *others) = setup.pads
    ground_m = float(known.elevation.interpolate_m(setup.tracks_m[0, :1])[0])

    def found(by_m: float) -> list[tuple[Severity, str]]:
        east_m, north_m = setup.tracks_m[0, 0].tolist()
        pads = (Pad(first.vehicle, east_m, north_m, ground_m + by_m), *others)
        context = cast("Context", SimpleNamespace(setup=SimpleNamespace(terrain=known, pad_of=lambda _: pads[0])))
        checks = vehicle_checks.check_pad_ground(context, replace(said(), name=first.vehicle))
        return [(check.severity, check.text) for check in checks]

    assert found(2.0) == []
    ((severity, text),) = found(known.margin_m + 1.0)
    assert severity is Severity.STOP
    assert f"{known.margin_m + 1.0:.0f} m lower over the ground than planned if the raster is right" in text
    ((severity, text),) = found(-known.margin_m - 1.0)
    assert severity is Severity.WARNING
    assert "higher over the ground than planned" in text
