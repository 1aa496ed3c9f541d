"""What the decisions know before the flight."""

from __future__ import annotations

import pytest

from planner import pct_per_s
from tests.executor.builders import fleet_of


def test_the_model_draws_what_the_air_speed_costs() -> None:
    context = fleet_of(inspection={"wind_m_s": [3.0, 4.0]}).context
    assert context.draw_pct_per_s(3.0, 4.0) == pytest.approx(pct_per_s(context.drone, 0.0))
    assert context.draw_pct_per_s(-3.0, -4.0) == pytest.approx(pct_per_s(context.drone, 10.0))
    assert fleet_of().context.draw_pct_per_s(3.0, 4.0) == pytest.approx(pct_per_s(context.drone, 5.0))
