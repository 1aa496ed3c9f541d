"""Moves that lead around others' pads cost what their missions do."""

from __future__ import annotations

import numpy as np
import pytest

from missions import Inspection, build_flight_path, dialect_for, estimate, plan_flight_setup
from missions.detours import DetourObstacles
from missions.flight_model import FlightModel
from missions.pads import Pad, column_radius_m, way_around_m
from missions.pricing import Pricing, build_priced_instance
from missions.setup import FlightSetup
from planner import Cost, Plan, Route, SteadyWind, evaluate
from tests.missions.builders import depot_vehicle, line_east

NAMES = ("uav1", "uav2")
POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))


def setup() -> FlightSetup:
    """Return a line to the east with uav2's pad in the middle of it, beside its second segment."""
    alt_m = plan_flight_setup(line_east(4), NAMES, Inspection()).pads[0].alt_m
    pads = [Pad("uav1", 0.0, -20.0, alt_m), Pad("uav2", 150.0, -8.0, alt_m)]
    return plan_flight_setup(line_east(4), NAMES, Inspection(), pads=pads)


def pricing(chosen: FlightSetup, autopilot: str, *, around: bool = True) -> Pricing:
    own = chosen.inspection
    model = FlightModel(dialect_for(autopilot).performance, POWER, own.transit_speed_m_s, own.speed_m_s)
    pads_m = tuple((pad.east_m, pad.north_m) for pad in chosen.pads)
    return Pricing(
        chosen.tracks_up_m, {name: chosen.base_of(name) for name in NAMES}, dict.fromkeys(NAMES, model), pads_m,
        column_radius_m(chosen.layers.layer_m) if around else 0.0,
    )  # fmt: skip


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_route_past_a_pad_is_priced_as_it_is_flown(autopilot: str) -> None:
    chosen = setup()
    priced = pricing(chosen, autopilot)
    fleet = [depot_vehicle(name, 80.0) for name in NAMES]
    plan = Plan((Route(0, (4, 0)), Route(1, (2,))))
    path = build_flight_path(chosen, "uav1", plan.routes[0].visits)
    flown = estimate(path, priced.models["uav1"])
    met = evaluate(build_priced_instance(priced, fleet), plan, Cost.MINMAX)
    assert met.durations_s[0] == pytest.approx(flown.duration_s, rel=1e-5)
    assert met.energies_pct[0] == pytest.approx(flown.energy_pct, rel=1e-5)
    straight = evaluate(build_priced_instance(pricing(chosen, autopilot, around=False), fleet), plan, Cost.MINMAX)
    assert straight.durations_s[0] < met.durations_s[0] - 0.5
    # Its own pad is in nobody's way: uav2 flies straight.
    assert straight.durations_s[1] == pytest.approx(met.durations_s[1])


def test_the_lost_ones_pad_stays_in_the_way() -> None:
    priced = pricing(setup(), "px4").select_segments([0, 2], ["uav1"])
    assert priced.build_vehicle_moves("uav1", around=True).columns.centres_m == ((150.0, -8.0),)


def test_no_detour_around_a_column_at_either_end() -> None:
    columns = DetourObstacles(((50.0, 0.0),), 7.0)
    from_m = np.array([[0.0, 0.0, 10.0], [0.0, 8.0, 10.0], [45.0, 0.0, 10.0], [0.0, 0.0, 10.0]])
    to_m = np.array([[100.0, 0.0, 20.0], [100.0, 8.0, 10.0], [100.0, 0.0, 10.0], [55.0, 0.0, 10.0]])
    assert columns.find_obstructed(from_m, to_m).tolist() == [0]
    ((which, ways_m),) = columns.iterate_ways(from_m, to_m)
    assert which.tolist() == [0]
    assert (ways_m[0, 0].tolist(), ways_m[0, -1].tolist()) == ([0.0, 0.0, 10.0], [100.0, 0.0, 20.0])
    # It rises evenly along the way, and keeps clear.
    assert np.all(np.diff(ways_m[0, :, 2]) > 0)
    assert np.all(np.hypot(ways_m[0, :, 0] - 50.0, ways_m[0, :, 1]) >= 7.0)


def test_the_path_back_is_the_path_out_and_cannot_be_changed_by_callers() -> None:
    columns = DetourObstacles(((0.0, 0.0), (9.0, 1.0)), 8.0)
    west_m, east_m = np.array([-40.0, 2.0]), np.array([40.0, -3.0])
    out_m, back_m = columns.way_m(west_m, east_m), columns.way_m(east_m, west_m)
    assert len(out_m) > 0
    np.testing.assert_array_equal(back_m, out_m[::-1])
    np.testing.assert_array_equal(out_m, way_around_m(west_m, east_m, np.array(columns.centres_m), columns.radius_m))
    with pytest.raises(ValueError, match="read-only"):
        out_m[0] = 0.0
