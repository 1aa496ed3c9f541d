"""A loss in mid-flight on real autopilots: FAULTLINE_ARDUCOPTER and FAULTLINE_PX4 name their binaries.

Three vehicles fly the default network; one process is suspended for good while it inspects.
"""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from executor import app, build, planning
from executor.config import check_site
from executor.core.commands import Level
from executor.core.context import Context
from executor.core.preflight import Check
from executor.core.state import FleetState
from executor.core.vehicle import VehicleState
from missions import LocalFrame, Pad
from planner import Cost
from tests.e2e.judge import wrongly_counted
from tests.sitl.real import RealVehicle, copters, px4s

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

Launcher = Callable[[Path, Path, Mapping[str, Pad], LocalFrame, float], AbstractContextManager[dict[str, RealVehicle]]]
SPEEDUP = 4.0


class WatchfulConsole:
    """Suspends a vehicle as soon as it inspects its second segment."""

    def __init__(self, victim: str) -> None:
        self.lines: list[str] = []
        self.running: dict[str, RealVehicle] = {}
        self._victim = victim
        self._suspended = False

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        self.lines.append(f"{at_s} {level.value} {text}")

    def checks(self, found: Sequence[Check]) -> None:
        self.lines += [f"{check.severity.value} {check.subject}: {check.text}" for check in found]

    def confirm(self, question: str) -> bool:
        return bool(question)

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        vehicle: VehicleState = state.vehicles[self._victim]
        if not self._suspended and self._victim in state.inspected.values() and vehicle.run is not None:
            self._suspended = True
            self.running[self._victim].suspend()

    def done(self) -> None:
        self.lines.append("done")


@pytest.mark.parametrize(
    ("autopilot", "variable", "port", "launch"),
    [("ardupilot", "FAULTLINE_ARDUCOPTER", 16000, copters), ("px4", "FAULTLINE_PX4", 14540, px4s)],
)
def test_three_fly_one_falls_silent(autopilot: str, variable: str, port: int, launch: Launcher, tmp_path: Path) -> None:
    binary = os.environ.get(variable)
    if not binary:
        pytest.skip(f"{variable} does not name a simulator of {autopilot}")
    site = check_site(
        {
            "network": {"file": "default", "radius_m": 400},
            "flight": {"speedup": SPEEDUP, "connect_timeout_s": 90.0, "ready_timeout_s": 240.0},
            "vehicle": [
                {
                    "name": f"uav{number}",
                    "connection": f"udpin://127.0.0.1:{port + number - 1}",
                    "sysid": number,
                    "autopilot": autopilot,
                }
                for number in (1, 2, 3)
            ],
        },
        "test",
    )
    ground = build.ground_of(site, tmp_path)
    plan = planning.first_plan(ground, planning.Wanted(Cost.MINMAX, 3.0, 1, all_vehicles=True))
    order = app.Order(site, tmp_path, ground, plan, tmp_path / "run", lambda _: ())
    order.run.mkdir()
    app.keep(order)
    console = WatchfulConsole("uav2")
    pads = {pad.vehicle: pad for pad in build.setup_of(ground).pads}
    with launch(Path(binary), tmp_path / "sim", pads, ground.network.frame, SPEEDUP) as console.running:
        asyncio.run(app.fly(order, console))
    report = json.loads((order.run / "report.json").read_text())

    said = "\n".join(console.lines)
    assert report["finished"], said
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [("uav2", "link")], said
    assert len(report["replans"]) == 1, said
    assert report["min_separation_m"] >= 5.0
    assert wrongly_counted(order.run, report) == []
    assert all(vehicle["landed"] for vehicle in report["vehicles"] if vehicle["name"] != "uav2")
