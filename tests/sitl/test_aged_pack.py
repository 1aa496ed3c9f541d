"""A pack with half of the planned capacity, on real autopilots: the lines about it, and when."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.virtual_site import AMPLE_AH, size_batteries, with_budgets, with_capacity
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest, plan_site
from planner import Cost
from tests.sitl.flights import NAMES, VICTIM, Flown, Prepared, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, Autopilot
from tests.sitl.test_window import DRAIN_S, PACK_AH, PCT_PER_S

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1500)]

COUNTED_AH, HELD_AH = 25.0, 12.5
BUDGET_PCT = 70.0
SHARE = 0.6
"""Of its planned flight: by then it must be known."""
PLANNED_AH, PLANNED_S = 7.0, 850.0
"""Such packs are planned with that half of one does not bring its vehicle home above its reserve."""
PACKS = {
    "px4": {"SIM_BAT_DRAIN": PLANNED_S, "SIM_BAT_MIN_PCT": 0.0},
    "ardupilot": {"BATT_CAPACITY": 1000 * PLANNED_AH, "SIM_BATT_CAP_AH": PLANNED_AH},
}


def test_what_it_counts_by_and_how_its_pack_rests(tmp_path: Path) -> None:
    """Full, its voltage says nothing of its capacity; that another one is planned with is said."""
    settings = {"BATT_CAPACITY": 1000 * COUNTED_AH, "BATT_LOW_VOLT": 10.5, "MOT_BAT_VOLT_MAX": 12.6}
    story = Story(settings=settings, packs_ah=dict.fromkeys(NAMES, HELD_AH), radius_m=400.0)
    flight = flown(ARDUPILOT, story, tmp_path)
    assert "it counts by a pack of 25 Ah, the plan by 5 Ah" in flight.said
    assert "its pack rests at 4.20 V a cell, about 100 %, and reports 100 % (3 cells)" in flight.said


@BOTH
def test_half_a_pack_is_known_before_sixty_percent_of_its_flight(autopilot: Autopilot, tmp_path: Path) -> None:
    """The others have what was planned with, and finish.

    ArduPilot counts what it takes, so that its percentage knows nothing of it, and only its voltage does; PX4's
    simulated pack has no current, and its percentage, which follows its voltage, falls twice as fast.
    """

    def prepared(ground: SiteModel) -> Prepared:
        wanted = PlanRequest(Cost.MINMAX, 3.0, 1, all_vehicles=True)
        best = plan_site(with_budgets(with_capacity(ground, AMPLE_AH), 100.0), wanted)
        scale = {"px4": DRAIN_S / PLANNED_S, "ardupilot": PACK_AH / PLANNED_AH}[autopilot.name]
        ground = size_batteries(ground, best, PCT_PER_S[autopilot.name] * scale * max(best.durations_s))
        ground = with_budgets(ground, BUDGET_PCT)
        return Prepared(ground, plan_site(ground, wanted), 0.0)

    aged = {"px4": {VICTIM: {"SIM_BAT_DRAIN": PLANNED_S / 2}}, "ardupilot": {}}[autopilot.name]
    packs_ah = {"px4": {}, "ardupilot": {VICTIM: PLANNED_AH / 2}}[autopilot.name]
    story = Story(
        settings=PACKS[autopilot.name], own=aged, packs_ah=packs_ah, radius_m=400.0, prepared=prepared,
    )  # fmt: skip
    flight = flown(autopilot, story, tmp_path)
    print(flight.said)
    assert flight.report["finished"], flight.said
    assert {fault["vehicle"] for fault in flight.report["faults"]} == {VICTIM}, flight.said
    # That it comes home with half of what it was planned with is not promised.
    assert all(flight.vehicle(name)["landed"] for name in NAMES if name != VICTIM), flight.said
    fault = flight.report["faults"][0]
    assert fault["kind"] == "battery", flight.said
    share = fault["detected_s"] / planned_s(flight, VICTIM)
    print(f"{fault['reason']}: after {fault['detected_s']:.0f} s, {100 * share:.0f} % of its planned flight")
    assert share < SHARE


def planned_s(flight: Flown, name: str) -> float:
    """Return how long a vehicle's route takes by the first plan."""
    plan = json.loads((flight.run / "plan-000.json").read_text())
    return next(float(route["duration_s"]) for route in plan["routes"] if route["vehicle"] == name)
