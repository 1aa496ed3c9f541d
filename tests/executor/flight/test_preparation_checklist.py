"""The data of a flight after every vehicle was read."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.core.interface.messages import Heartbeat, Position, Version
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.flight.preparation import build_context_and_checklist
from executor.flight.run_start import FlightRequest
from tests.benchmarks.virtual.short_line import shared, short_ground


def test_a_pad_is_where_its_vehicle_really_stands(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 3, "ardupilot")
    request = FlightRequest(ground.site, tmp_path, ground, shared(ground), tmp_path, lambda _: ())
    frame = ground.network.frame
    facts = {
        name: VehicleFacts(
            name, Heartbeat(3, 0, False, 3, 2),
            Position(9.0, *frame.to_wgs84_deg(5.0 * number, -7.0), frame.alt_m + 4.0, 3.0, 0.0, 0.0, 0.0, None), 100.0,
            Version(4, 6, 1), {},
        )
        for number, name in enumerate(ground.names)
    }  # fmt: skip
    context, _, _ = build_context_and_checklist(request, facts)
    for number, name in enumerate(ground.names):
        pad = context.setup.pad_of(name)
        assert (pad.east_m, pad.north_m) == pytest.approx((5.0 * number, -7.0), abs=0.01)
        assert pad.alt_m == frame.alt_m + 1.0
