"""At which base a vehicle stands, where its mission ends, and the pads of a flight as that has them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import Context, DayRules
from executor.core.state.bases import (
    base_of,
    find_planned_landing,
    is_at_closed_base,
    landing_base_of,
    place_vehicles,
    settle_at_base,
)
from executor.core.state.vehicle_parts import PlannedSortie
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Pad, build_flight_path
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import FLEET, flying

LOWER_M = 10.0


def day_between(context: Context) -> Context:
    """Return a day on which uav1 has a pad in the east as well, on lower ground."""
    west = context.setup.pad_of("uav1")
    east = Pad("uav1", west.east_m + 900.0, west.north_m, west.alt_m - LOWER_M)
    pads = {"uav1": {"west": west, "east": east}}
    rules = DayRules(0.0, dict.fromkeys(context.vehicles, "west"), {}, pads=pads)
    setup = replace(context.setup, day_pads=(west, east))
    one = context.vehicles["uav1"]
    places_m = ((west.east_m, west.north_m), (east.east_m, east.north_m))
    vehicles = {**context.vehicles, "uav1": replace(one, day_pads_m=places_m)}
    return replace(context, day=rules, setup=setup, vehicles=vehicles)


DAY = day_between(FLEET.context)
assert DAY.day is not None
WEST, EAST = (DAY.day.pads["uav1"][name] for name in ("west", "east"))


def standing(at: Pad, stage: Stage = Stage.LANDED, away_m: float = 0.0) -> VehicleState:
    vehicle = flying(stage=stage)
    assert vehicle.motion.fix is not None
    fix = replace(vehicle.motion.fix, place_m=(at.east_m + away_m, at.north_m))
    return vehicle.with_motion(fix=fix)


def test_without_other_bases_nothing_is_another() -> None:
    assert place_vehicles(FLEET.context, [flying()]) is FLEET.context
    assert place_vehicles(DAY, [flying()]) is DAY
    assert settle_at_base(FLEET.context, flying()) == flying()


@pytest.mark.parametrize(
    ("stage", "lands_at", "closed", "waits"),
    [
        (Stage.LANDED, "", "west", True),
        (Stage.LANDED, "", "east", False),
        # It was to land at a base that was closed then: where it stands it is sent out.
        (Stage.LANDED, "east", "east", False),
        (Stage.STARTING, "east", "east", False),
        (Stage.FLYING, "east", "east", True),
        (Stage.FLYING, "east", "west", False),
    ],
)
def test_a_vehicle_waits_for_the_base_that_it_takes_off_from_next(
    stage: Stage, lands_at: str, closed: str, waits: bool
) -> None:
    vehicle = flying(stage=stage).with_turn(lands_at=lands_at)
    state = flight_of(vehicle).with_crew(closed_bases=frozenset({closed}))
    assert is_at_closed_base(DAY, state, vehicle) is waits


def test_a_mission_begins_at_one_pad_and_ends_at_another() -> None:
    vehicle = flying(stage=Stage.STARTING).with_turn(lands_at="east")
    assert (base_of(DAY, vehicle), landing_base_of(DAY, vehicle)) == ("west", "east")
    setup = place_vehicles(DAY, [vehicle]).setup
    assert (setup.pad_of("uav1"), setup.landing_pad_of("uav1")) == (WEST, EAST)
    path = build_flight_path(setup, "uav1", (0,))
    ends = [DAY.frame.to_local_m(one.lat_deg, one.lon_deg) for one in (path.waypoints[0], path.waypoints[-1])]
    assert ends == [pytest.approx((pad.east_m, pad.north_m), abs=0.1) for pad in (WEST, EAST)]
    assert path.waypoints[-1].alt_rel_m == pytest.approx(-LOWER_M)
    pricing = place_vehicles(DAY, [vehicle]).pricing
    assert pricing.bases["uav1"].place_m[0] == EAST.east_m
    assert pricing.starts["uav1"].place_m[0] == WEST.east_m


def test_heights_count_from_where_it_was_armed() -> None:
    vehicle = flying().with_turn(base="east")
    context = place_vehicles(DAY, [vehicle])
    assert context.setup.pad_of("uav1") == EAST
    assert context.vehicles["uav1"].pad_m == (EAST.east_m, EAST.north_m)
    assert context.setup.up_m("uav1", 30.0) == pytest.approx(DAY.setup.up_m("uav1", 30.0) - LOWER_M)
    assert context.return_height_m("uav1") == pytest.approx(DAY.return_height_m("uav1") + LOWER_M)
    others = context.setup.obstacles_for("uav2").centres_m
    assert {(pad.east_m, pad.north_m) for pad in (WEST, EAST)} <= set(others)
    assert not {(pad.east_m, pad.north_m) for pad in (WEST, EAST)} & set(context.setup.obstacles_for("uav1").centres_m)


@pytest.mark.parametrize(
    ("at", "away_m", "base", "moved"),
    [(EAST, 0.0, "east", True), (WEST, 0.0, "west", False), (EAST, 200.0, "west", False)],
    ids=["at the other", "where it took off", "at none"],
)
def test_a_landed_vehicle_belongs_to_the_base_of_its_pad(at: Pad, away_m: float, base: str, moved: bool) -> None:
    turn = settle_at_base(DAY, standing(at, away_m=away_m).with_turn(lands_at="east")).turn
    assert (turn.base, turn.lands_at, turn.moved) == (base, "", moved)


def test_a_vehicle_without_segments_lands_at_its_own_base() -> None:
    idle = standing(WEST).with_turn(lands_at="east")
    assert landing_base_of(DAY, idle) == "west"
    assert landing_base_of(DAY, idle.with_turn(asked_s=1.0)) == "east"


def test_a_sortie_ends_as_planned_where_it_begins_as_planned() -> None:
    ahead = (PlannedSortie((0, 2), 0.0, "west", "east"), PlannedSortie((4,), 0.0, "east", "west"))
    vehicle = standing(WEST).with_turn(ahead=ahead)
    assert find_planned_landing(DAY, vehicle, (0, 2)) == "east"
    assert find_planned_landing(DAY, vehicle, (2,)) == "east"
    assert find_planned_landing(DAY, vehicle, (4,)) == "west"  # it stands elsewhere, and comes back
    assert find_planned_landing(DAY, vehicle.with_turn(base="east"), (4,)) == "west"
    assert find_planned_landing(DAY, vehicle, (8,)) == "west"
