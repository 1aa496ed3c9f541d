"""Stories with cameras: what was asked to be seen, what came onto the cards, and what the ground knows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from executor.core.interface.commands import Solve
from executor.core.interface.events import NewRoute, SolveEnded
from executor.core.payload.camera_state import Picture
from missions import Network
from simulator.camera import CapturedImage
from simulator.config import SimCamera, SimVehicle
from tests.fakes.solver import FakeSolver
from tests.missions.builders import line_east, tall_line_east
from tests.stories.story import Story
from tests.stories.world import Sky

Table = Mapping[str, object]
MAVLINK: Table = {"name": "rgb", "id": 100, "gimbal": True}
"""A camera that speaks for itself, on a gimbal."""
WIRED: Table = {"name": "rgb", "id": 1}
"""One that the autopilot triggers by a pin."""
EVERY_10_M: Table = {"camera": "rgb", "every_m": 10}


def by_sight(problem: Solve) -> SolveEnded:
    """Deal the open segments out to those who can see them, each to whoever has the fewest so far."""
    visits: dict[str, list[int]] = {offer.vehicle: [] for offer in problem.survivors}
    barred = {offer.vehicle: set(offer.barred) for offer in problem.survivors}
    left = []
    for segment in problem.open_segments:
        able = [name for name in visits if segment not in barred[name]]
        if able:
            visits[min(able, key=lambda name: len(visits[name]))].append(2 * segment)
        else:
            left.append(segment)
    routes = tuple(NewRoute(name, tuple(given)) for name, given in visits.items())
    return SolveEnded(problem.revision, routes, tuple(left), 0.25, "dealt out")


class Eyes(Sky):
    """A story on its way, with cameras on board."""

    def __init__(
        self,
        story: Story,
        autopilot: str,
        cameras: Sequence[Table] = (MAVLINK,),
        looks: Sequence[Table] = (EVERY_10_M,),
        *,
        pylons: int | None = None,
        tall: bool = False,
    ) -> None:
        tables: dict[str, object] = {**story.tables, "camera": list(cameras), "look": list(looks)}
        self._cameras = cameras
        self._tall = tall
        self._pylons = story.pylons if pylons is None else pylons
        self.shots: dict[str, list[CapturedImage]] = {}
        super().__init__(replace(story, tables=tables), autopilot)  # type: ignore[arg-type]
        self.solver = FakeSolver(by_sight, takes_s=story.solve_s)

    def _network(self) -> Network:
        return tall_line_east(self._pylons) if self._tall else line_east(self._pylons)

    def _craft(self, name: str, sysid: int) -> SimVehicle:
        self.shots[name] = []
        carried = tuple(
            SimCamera(str(one["name"]), int(str(one.get("id", 0))), gimbal=bool(one.get("gimbal")))
            for one in self._cameras
            if name in (one.get("vehicles") or [name])  # type: ignore[operator]
        )
        return replace(super()._craft(name, sysid), cameras=carried)

    def _after_step(self, now_s: float) -> None:
        super()._after_step(now_s)
        for name, radio in self.radios.items():
            self.shots[name] += radio.vehicle.drain_shots()

    def pictures(self, vehicle: str) -> tuple[Picture, ...]:
        """Return what the ground knows of a vehicle's pictures."""
        return self.state.vehicles[vehicle].payload.pictures
