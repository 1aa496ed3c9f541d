"""Draws the pictures of the documents that show pages: `python -m tests.e2e.docs_pictures docs/pictures RUN`.

RUN is the run directory of a demo, `./scripts/demo --run RUN`: of its report are the map and the battery. The tutorial
is planned, and the operator's page flown by a story, as the tests do it.
"""

from __future__ import annotations

import asyncio
import shutil
import sys
import time
from dataclasses import replace
from pathlib import Path

import httpx

from executor.adapters.solver import SolverSetup, solve_for_survivors
from executor.core.fleet_view import LossView, VehicleView
from executor.core.interface.intents import Action
from executor.core.state.vehicle_state import build_onboard_mission
from executor.simulated.simulated_fleet import USUAL_RADIUS_M, USUAL_VEHICLES, build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_planning import PlanRequest, plan_site
from missions import Window, build_flight_path
from tests.e2e.browser import browsing
from tests.e2e.gallery import Scene, Shown, fitted
from tests.e2e.plan_scenes import draw_plan_scene
from tests.fakes.flight import Story

TUTORIAL = ("plan-dropped", "plan-planned", "plan-lost", "plan-by-hand")
BEGUN_S, SILENT_S = 240, 24
"""So long into the flight the link is lost, and so long it is silent until somebody looks."""


def fly_story() -> tuple[list[Scene], Window | None]:
    """Return the demo's fleet from second to second, until uav2 is lost, uav1 holds and the others have the rest."""
    table = build_demo_site(
        network=None, radius_m=USUAL_RADIUS_M, vehicles=USUAL_VEHICLES, speedup=1.0, autopilot="ardupilot",
        ports=range(14550, 14550 + USUAL_VEHICLES),
    )  # fmt: skip
    ground = site_model.load_site_model(check_site(table, "demo"), Path())
    plan = plan_site(ground, PlanRequest(None, 60.0, 1, iterations=100_000, starts=1))
    context = site_model.build_context(ground, ground.setup, site_model.build_first_task(ground))
    boards = {
        name: build_onboard_mission(context, name, 0, build_flight_path(ground.setup, name, visits), visits)
        for name, visits in plan.network_routes.items()
    }
    solver = SolverSetup(limit_s=5.0, seed=1)
    story = Story(
        context, dict(boards), lambda problem: solve_for_survivors(solver, problem, context.pricing, lambda: False)
    )
    scenes: list[Scene] = []

    def pass_s(seconds: int) -> None:
        for _ in range(seconds):
            story.pass_s(1.0)
            scenes.append(
                Scene(context, fitted(story.state), story.now_s, {}, dict.fromkeys(boards, _finished_by_others))
            )

    story.launch()
    pass_s(BEGUN_S)
    story.crafts["uav2"].mute = True
    pass_s(SILENT_S)
    story.ask(Action.HOLD, "uav1")
    pass_s(12)
    return scenes, plan.window


def _finished_by_others(vehicle: VehicleView) -> VehicleView:
    return vehicle if vehicle.fault else replace(vehicle, loss=LossView(True, (), 4.0))


async def draw_operator_page(folder: Path) -> None:
    """Write the picture of the page to fly by."""
    scenes, window = fly_story()
    shown = Shown(scenes[0])
    with shown.serving(window=window) as address:
        async with httpx.AsyncClient(base_url=address) as client:
            for shown.scene in scenes:  # so the page knows where everybody has flown
                (await client.get("state")).raise_for_status()
        shown.began_s = time.monotonic()
        async with browsing(address) as page:
            await page.locator(".strip").nth(USUAL_VEHICLES - 1).wait_for()
            await page.keyboard.press("1")
            await page.wait_for_timeout(900.0)
            await page.screenshot(path=str(folder / "page.png"))


async def draw_report(folder: Path, run: Path) -> None:
    """Write the map of a flight's report, and its battery picture."""
    async with browsing((run / "report.html").absolute().as_uri(), (1100, 900)) as page:
        await page.wait_for_timeout(700.0)
        await page.locator("#mapped").screenshot(path=str(folder / "demo-map.png"))
    shutil.copy(run / "battery.png", folder / "demo-battery.png")


async def draw_all(folder: Path, run: Path) -> None:
    """Write all of them."""
    await draw_report(folder, run)
    await draw_operator_page(folder)
    for name in TUTORIAL:
        await draw_plan_scene(folder, name, in_tutorial=True)


if __name__ == "__main__":
    asyncio.run(draw_all(*map(Path, sys.argv[1:3])))
