"""What a site says holds for a day of sorties as for a flight: the same reachability, the same prices of every move."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from executor.errors import ExecutorError, SiteError
from executor.site import site_model
from executor.site.day_plans import build_day_problem, build_first_sorties_plan
from executor.site.site_file import Site, check_site
from executor.site.site_model import SiteModel
from missions import DayPlanFile, MissionsError, Network, Task, check_plan, read_day_plan, write_plan
from missions.line_heights import add_ground_heights, add_structure_heights
from missions.terrain import Terrain
from planner import Cost, Plan, Route, evaluate, visit_of
from planner.sorties import Objective, evaluate_sorties
from tests.executor.builders import site_of
from tests.executor.site.test_terrain import MOUNTAIN, RASTER
from tests.mountains import write_raster
from tests.terrain_judge import lines_over

CLOSE = 1e-9
HOURS = {"begin": "08:00", "end": "20:00"}
CAMERAS = [{"name": "wide"}, {"name": "zoom", "vehicles": ["uav1"]}]


class Mountains:
    """A network that stands on ground which a raster knows, loaded once."""

    def __init__(self, folder: Path) -> None:
        write_raster(folder / RASTER, MOUNTAIN)
        self.folder = folder
        bare = lines_over(MOUNTAIN, np.random.default_rng(2), lines=2, pylons=3)
        site = self.site_of({"terrain": {"files": RASTER, "margin_m": 18}, "area": [box(bare, (0.0, 900.0), 30.0)]}, 1)
        network = add_structure_heights(bare, 25.0)
        terrain = site_model.load_terrain(site, folder, network)
        assert terrain is not None
        self.terrain: Terrain = terrain
        self.network = add_ground_heights(network, terrain.elevation, depot_known=True)[0]

    @staticmethod
    def site_of(tables: dict[str, Any], vehicles: int) -> Site:
        inspection = {"ceiling_m": 400, "return_ceiling_m": 800, **tables.pop("inspection", {})}
        names = tuple(f"uav{number}" for number in range(1, vehicles + 1))
        return site_of(names, "px4", **{"day": HOURS, "inspection": inspection, **tables})


@pytest.fixture(scope="module")
def mountains(tmp_path_factory: pytest.TempPathFactory) -> Mountains:
    return Mountains(tmp_path_factory.mktemp("mountains"))


def box(network: Network, middle_m: tuple[float, float], half_m: float, **more: object) -> dict[str, object]:
    (east_m, north_m), frame = middle_m, network.frame
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ring = [frame.to_wgs84_deg(east_m + a * half_m, north_m + b * half_m) for a, b in corners]
    return {"name": "quarry", "polygon": ring, **more}


@st.composite
def tables_over(draw: st.DrawFn, network: Network) -> dict[str, Any]:
    """Return any tables of a site that shape what its flights take."""
    found: dict[str, Any] = {"inspection": {"wind_m_s": draw(st.sampled_from(([0.0, 0.0], [3.0, -2.0])))}}
    if draw(st.booleans()):
        found["terrain"] = {"files": RASTER, "margin_m": 18}
    areas = draw(st.integers(0, 2))
    if areas:
        found["area"] = [
            box(
                network, (draw(st.floats(-400, 400)), draw(st.floats(-400, 400))), draw(st.floats(20, 90)),
                **draw(st.sampled_from(({}, {"margin_m": 20.0}, {"max_agl_m": 60.0}))),
            )
            for _ in range(areas)
        ]  # fmt: skip
    if draw(st.booleans()):
        found["inspection"]["same_distance"] = True
    looks = draw(st.sampled_from(((), ("spans",), ("pylons",), ("spans", "pylons"))))
    if looks:
        found["camera"] = CAMERAS
        found["look"] = [{"camera": "zoom", "every_m": 20, "segments": [f"{draw(st.sampled_from('ab'))}*", "segment 1"]}
                         for kind in looks if kind == "spans"]  # fmt: skip
        found["look"] += [{"camera": "wide", "of": "pylons", "bearings_deg": [45, 135], "pylons": ["P1", "P4"]}
                          for kind in looks if kind == "pylons"]  # fmt: skip
    if draw(st.booleans()):
        lat_deg, lon_deg = network.frame.to_wgs84_deg(draw(st.floats(-120, 120)), draw(st.floats(60, 120)))
        found["place"] = [{"name": "hill", "kind": "pad", "lat_deg": lat_deg, "lon_deg": lon_deg}]
    return found


def with_pad(site: Site) -> Site:
    """Return a site whose first vehicle stands on the pad that it names."""
    tables = site.model_dump(exclude_unset=True)
    first, *others = tables["vehicle"]
    return check_site({**tables, "vehicle": [{**first, "pad": "hill"}, *others]}, "test")


def ground_of(mountains: Mountains, tables: dict[str, Any], vehicles: int) -> SiteModel:
    site = mountains.site_of(tables, vehicles)
    site = with_pad(site) if site.place else site
    terrain = mountains.terrain if site.terrain is not None else None
    return site_model.build_site_model(site, mountains.network, (), mountains.folder, terrain)


def same_prices(task: Task, day: DayPlanFile) -> None:
    flight, sorties = task.instance, day.build_instance()
    every = np.arange(2 * flight.segments)
    for row, own in enumerate(sorties.vehicles):
        assert own.name == flight.vehicles[row].name
        np.testing.assert_allclose(sorties.out_s[row, own.base], flight.start_s[row], CLOSE, CLOSE)
        np.testing.assert_allclose(sorties.out_pct[row, own.base], flight.start_pct[row], CLOSE, CLOSE)
        np.testing.assert_allclose(sorties.home_s[row, :, own.base], flight.home_s[row], CLOSE, CLOSE)
        np.testing.assert_allclose(sorties.home_pct[row, :, own.base], flight.home_pct[row], CLOSE, CLOSE)
        for figures in ("seconds", "pct"):
            mine = getattr(sorties.moves, figures)(own.profile, every[:, np.newaxis], every)
            its = getattr(flight.moves, figures)(flight.profile[row], every[:, np.newaxis], every)
            np.testing.assert_allclose(mine, its, CLOSE, CLOSE)


def words_of(made: Callable[[], object]) -> str:
    """Return why something is refused; empty if it is not."""
    try:
        made()
    except SiteError as error:
        return str(error)
    return ""


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_day_of_one_sortie_each_takes_what_the_flight_takes(mountains: Mountains, data: st.DataObject) -> None:
    tables, vehicles = data.draw(tables_over(mountains.network)), data.draw(st.integers(1, 3))
    try:
        ground = ground_of(mountains, tables, vehicles)
    except (MissionsError, ExecutorError):
        assume(False)
        return
    refused = {words_of(lambda: site_model.build_first_task(ground)), words_of(lambda: build_day_problem(ground))}
    assert len(refused) == 1
    if refused != {""}:
        return
    task = site_model.build_first_task(ground)
    day = build_day_problem(ground)
    assert tuple(segment.id for segment in day.segments) == task.segment_ids
    assert day.unreachable == task.unreachable
    assert day.terrain == site_model.build_plan_terrain(ground)
    same_prices(task, day)
    barred = [day.pricing.barred.get(name, frozenset()) for name in ground.names]
    routes: list[list[int]] = [[] for _ in ground.names]
    for segment in data.draw(st.permutations(range(len(task.segment_ids)))):
        able = [row for row, own in enumerate(barred) if segment not in own]
        routes[data.draw(st.sampled_from(able))].append(visit_of(segment, data.draw(st.booleans())))
    plan = Plan(tuple(Route(row, tuple(own)) for row, own in enumerate(routes)))
    flight = evaluate(task.instance, plan, Cost.MINMAX)
    flown = Plan(tuple(Route(row, tuple(own), 0, 0, 3e4 + 60 * row) for row, own in enumerate(routes) if own))
    figures = evaluate_sorties(day.build_instance(), flown)
    assert figures.durations_s == pytest.approx([one for one in flight.durations_s if one], rel=CLOSE)
    assert figures.energies_pct == pytest.approx([one for one in flight.energies_pct if one], rel=CLOSE)
    day = day.with_plan(flown, figures, Objective.FINISH)
    path = mountains.folder / "day.json"
    write_plan(path, day)
    again = read_day_plan(path)
    same_prices(task, again)
    assert (again.unreachable, again.terrain, again.pricing.barred) == (
        day.unreachable,
        day.terrain,
        day.pricing.barred,
    )
    if any("its budget is" in line for line in check_plan(again)):
        return
    first = build_first_sorties_plan(again, ground)
    for said_s, planned_s in zip(first.durations_s, flight.durations_s, strict=True):
        # Who inspects in its layer after all is priced as if it came down: that takes longer.
        assert math.isclose(said_s, planned_s, rel_tol=CLOSE) or (
            ground.inspection.same_distance and said_s < planned_s
        )
