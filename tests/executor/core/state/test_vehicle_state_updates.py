"""Parts of a state are replaced as `replace` would, and nothing else changes."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import PartUpdate, VehicleState

VEHICLE = VehicleState("uav1")
FLEET = FleetState({"uav1": VEHICLE})


def test_a_part_is_replaced_and_the_rest_is_the_same_object() -> None:
    held = VEHICLE.with_orders(held_s=3.0, excluded=True)
    assert held == replace(VEHICLE, orders=replace(VEHICLE.orders, held_s=3.0, excluded=True))
    others = [field.name for field in fields(VehicleState) if field.name != "orders"]
    assert all(getattr(held, name) is getattr(VEHICLE, name) for name in others)
    assert FLEET.with_crew(offers_over=True) == replace(FLEET, crew=replace(FLEET.crew, offers_over=True))


@pytest.mark.parametrize("whole", [VEHICLE, FLEET])
def test_every_method_names_a_part_with_defaults_for_its_fields(whole: VehicleState | FleetState) -> None:
    parts = [one.part for one in vars(type(whole)).values() if isinstance(one, PartUpdate)]
    assert parts
    for part in parts:
        assert getattr(whole, f"with_{part}")() == whole
        assert type(getattr(whole, part))() is not None


def test_a_field_that_a_part_does_not_have_is_a_mistake() -> None:
    with pytest.raises(TypeError):
        VEHICLE.with_orders(nonsense=1.0)  # type: ignore[call-arg]
