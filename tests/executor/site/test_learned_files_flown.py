"""packs.json of a flight: one entry a sortie, by the ids that the crew gave."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownSortie, Turnaround
from executor.core.state.vehicle_state import VehicleState
from executor.site.learned_files import build_flown_packs

FLOWN = FlownSortie(1, "P1", 100.0, 100.0, 16.8, (), 700.0, 40.0, 15.2, 4)


def test_a_pack_that_flies_twice_is_one_and_a_sortie_without_its_landing_is_none() -> None:
    sorties = (
        FLOWN,
        replace(FLOWN, number=2, pack="", began_s=900.0, ended_s=1200.0),
        replace(FLOWN, number=3, began_s=1500.0, ended_s=1800.0),
        replace(FLOWN, number=4, pack="P7", began_s=2000.0, ended_s=None),
    )
    turned = VehicleState("uav1", turn=Turnaround(sorties=sorties))
    found = build_flown_packs(FleetState(MappingProxyType({"uav1": turned})), "today", 1000.0)
    assert [(one.label, one.pack, one.minutes) for one in found.flights] == [
        ("P1", 1, 10.0),
        (None, 2, 5.0),
        ("P1", 1, 5.0),
    ]
    first = found.flights[0]
    assert (first.log, first.began_usec, first.rest_cell_v, first.end_cell_v) == ("today", 1_100_000_000, 4.2, 3.8)
    assert "id" not in found.to_plain()["flights"][1]  # type: ignore[index]
