"""What a plan claims of its re-plan window, real autopilots keep."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.virtual_site import AMPLE_AH, dearest_route_pct, size_batteries, with_budgets, with_capacity
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest, plan_site
from planner import Cost
from planner.evaluate import completion_times_s
from tests.sitl.flights import VICTIM, Prepared, Story, flown
from tests.sitl.real import BOTH, Autopilot, RealVehicle
from tests.sitl.verdict import LEAST_APART_M

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1200)]

TIGHTNESS = 0.78
"""What the best MinMax plan's dearest route takes of the budget."""
TOLD_IN_PCT = 1.0
"""Both tell whole percents."""
DRAIN_S = 1200.0
PACK_AH = 10.0
PACKS = {
    "px4": {"SIM_BAT_DRAIN": DRAIN_S},
    "ardupilot": {"BATT_CAPACITY": 1000 * PACK_AH, "SIM_BATT_CAP_AH": PACK_AH},
}
PCT_PER_S = {"px4": 100 / DRAIN_S, "ardupilot": 0.0312 * 25 / PACK_AH}
"""What they take as they fly, by their parameters and measured (9.6 % of 25 Ah in 308 s)."""


def tight(autopilot: Autopilot, share: float) -> Story:
    """Return a story with batteries that just suffice, and a loss from t* on, while uav2 has segments to inspect."""

    def prepared(ground: SiteModel) -> Prepared:
        wanted = PlanRequest(Cost.MINMAX, 3.0, 1, all_vehicles=True)
        best = plan_site(with_budgets(with_capacity(ground, AMPLE_AH), 100.0), wanted)
        ground = size_batteries(ground, best, PCT_PER_S[autopilot.name] * max(best.durations_s))
        ground = with_budgets(ground, round(dearest_route_pct(ground, best) / TIGHTNESS, 1))
        plan = plan_site(ground, PlanRequest(None, 60.0, 1, iterations=200_000, all_vehicles=True))
        assert plan.window is not None
        assert plan.plan.uncovered == ()
        [route] = [one for one in plan.plan.routes if plan.vehicles[one.vehicle].name == VICTIM]
        from_s, to_s = plan.window.earliest_s, completion_times_s(plan.build_task().instance, route)[-1]
        print(f"t* {from_s:.0f} s, {VICTIM} inspects until {to_s:.0f} s, budget {ground.site.vehicle[0].budget_pct} %")
        assert from_s < to_s
        return Prepared(ground, plan, from_s + share * (to_s - from_s))

    return Story(RealVehicle.suspend, settings=PACKS[autopilot.name], radius_m=400.0, prepared=prepared)


@BOTH
@pytest.mark.parametrize("share", [0.02, 0.4, 0.8])
def test_a_loss_after_the_claimed_time_leaves_nothing_over(autopilot: Autopilot, share: float, tmp_path: Path) -> None:
    """Everything is inspected, and the others stand at home with no more than their budgets used.

    One that is about to land may be sent out again for it: then the first re-plan leaves something over.
    """
    flight = flown(autopilot, tight(autopilot, share), tmp_path)
    report = flight.report
    print(report["duration_s"], [(replan["solve_s"], replan["uncovered"]) for replan in report["replans"]])
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [(VICTIM, "link")], flight.said
    assert report["finished"], flight.said
    assert report["replans"], flight.said
    assert report["min_separation_m"] >= LEAST_APART_M, flight.said
    for name in ("uav1", "uav3"):
        used_pct = flight.vehicle(name)["energy_used_pct"]
        print(name, f"used {used_pct} of {flight.budget_pct} %")
        assert flight.vehicle(name)["landed"], flight.said
        assert used_pct <= flight.budget_pct + TOLD_IN_PCT, flight.said
