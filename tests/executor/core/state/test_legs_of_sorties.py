"""What is noted of a sortie when it has ended."""

from __future__ import annotations

import pytest

from executor.core.state import legs
from executor.core.state.vehicle_parts import FlownSortie
from tests.executor.builders import with_facts
from tests.executor.core.steps import landed
from tests.executor.core.vehicles import CONTEXT, NOW_S, pack


@pytest.mark.parametrize(("age_s", "ended_pct"), [(2.0, 69.0), (60.0, None)])
def test_what_its_pack_ended_with_is_noted_where_it_was_reported_then(age_s: float, ended_pct: float | None) -> None:
    """What a pack held before a silence would tell its book that the flight had cost nothing."""
    began = FlownSortie(1, "P1", NOW_S - 300.0, 70.0, 16.8)
    vehicle = with_facts(landed(battery=pack(70.0, 69.0, age_s=age_s), took_off=True), sorties=(began,), aloft_pct=69.0)
    [sortie] = legs.end_sortie(CONTEXT, vehicle, NOW_S).turn.sorties
    assert (sortie.ended_s, sortie.ended_pct) == (NOW_S, ended_pct)
