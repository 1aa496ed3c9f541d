"""A plan as the page shows it: the plan's own figures, and ways from where they begin."""

from __future__ import annotations

import pytest

from executor.plan_page.plan_view import describe_plan, list_sorties, summarise
from executor.site import site_planning
from executor.site.site_planning import PlanRequest
from missions import PlanFile
from planner import Cost
from tests.executor.builders import ground_for, site_of
from tests.executor.site.two_bases import between_bases
from tests.missions.builders import line_east


def test_routes_take_what_the_plan_says() -> None:
    ground = ground_for(site_of(("uav1", "uav2", "uav3")), line_east(13))
    wanted = PlanRequest(Cost.MINMAX, 600.0, 1, iterations=300, starts=1)
    plan = site_planning.plan_site(ground, wanted, lambda _: None)
    assert isinstance(plan, PlanFile)
    shown = describe_plan(plan, ground)["vehicles"]
    ways = [way for one in shown for way in one["routes"]]
    assert max(way["duration_s"] for way in ways) == summarise(plan)["longest_s"]
    for way, route in zip(ways, plan.routes, strict=True):
        assert (way["duration_s"], way["energy_pct"]) == (route.duration_s, route.energy_pct)
        assert way["track"][-1][0] == pytest.approx(route.duration_s, abs=0.1)
        assert way["track"][-1][4] == pytest.approx(100.0 - route.energy_pct, abs=0.01)


def test_a_sortie_between_bases_is_drawn_from_the_one_to_the_other() -> None:
    ground, day = between_bases()
    [ways, _] = (one["routes"] for one in describe_plan(day, ground)["vehicles"])
    own = {**ground.day_pads["uav1"], "west": ground.setup.pad_of("uav1")}
    for sortie, way in zip(list_sorties(day), ways, strict=True):
        for base, (_, *place, up_m, _) in ((sortie.base, way["track"][0]), (sortie.lands, way["track"][-1])):
            pad = own[base]
            assert ground.setup.frame.to_local_m(*place) == pytest.approx((pad.east_m, pad.north_m), abs=0.05)
            assert up_m == pytest.approx(ground.setup.frame.up_m(pad.alt_m), abs=0.1)
        assert way["track"][-1][0] == pytest.approx(sortie.start_s + way["duration_s"], abs=0.1)
