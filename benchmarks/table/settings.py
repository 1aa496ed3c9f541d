"""Settings of a table: cells, seeds, and time of each solver."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from executor.site.site_planning import PlanSolver
from planner import Cost, Iterations, Seconds, StopRule

RADII_M = (500.0, 700.0, 1000.0, 1200.0, 2000.0)
TIGHTNESS = (0.78, 0.82, 0.86, 0.90)
PAIR_TIGHTNESS = (0.60, 0.70, 0.78)
"""Two survivors of four have to do the work of all: at the tightness of the other table little is left of a window."""
PAIR_RADII_M = (500.0, 700.0)
STRETCHES = (0.0, 0.05, 0.10, 0.20)
DRONE = "mavic2"
TRANSIT_M_S, INSPECTION_M_S = 5.0, 1.0
VEHICLES = 4
SOLVERS = (PlanSolver.GRASP, PlanSolver.SEARCH)
COSTS = (Cost.MINMAX, Cost.MINSUM, Cost.MINCOMB)


@dataclass(frozen=True, slots=True)
class TableSettings:
    """One table."""

    network: Path | None
    """A network file; None for the project's own network."""
    radii_m: tuple[float, ...] = RADII_M
    tightness: tuple[float, ...] = TIGHTNESS
    """Best MinMax found / budget, for each row."""
    seeds: int = 10
    """Plans for each solver and cost function, of which the best and the mean are shown."""
    seconds: float = 2.0
    """Time for each plan."""
    window_seconds: float = 30.0
    """Time for each plan chosen for its window."""
    iterations: int | None = None
    """Iterations that replace all times: the same table on every machine."""

    def stop(self) -> StopRule:
        """Return when a plan's search ends."""
        return Seconds(self.seconds) if self.iterations is None else Iterations(self.iterations)

    def window_stop(self) -> StopRule:
        """Return when the search on the window ends."""
        return Seconds(self.window_seconds) if self.iterations is None else Iterations(self.iterations)
