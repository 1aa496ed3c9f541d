"""Arguments and options that several commands share."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from executor.site.site_planning import DEFAULT, WINDOW_UP_TO, PlanSolver
from missions import AUTOPILOTS
from planner import Cost


def require_finite(value: float | None) -> float | None:
    """Refuse what is no number: a bound lets nan pass, and nothing ends at infinity."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"expected a finite number, got {value}.")
    return value


class PlanCostName(StrEnum):
    """What a first plan is chosen by."""

    _ignore_ = "known"
    for known in Cost:
        vars()[known.name] = known.value
    WINDOW = "window"


class FormatName(StrEnum):
    """What other programs read."""

    QGC = "qgc"
    WAYPOINTS = "waypoints"
    KML = "kml"
    GEOJSON = "geojson"
    GPX = "gpx"


class AutopilotName(StrEnum):
    """The autopilots that are known, as site files call them."""

    _ignore_ = "known"
    for known in AUTOPILOTS:
        vars()[known.name.upper()] = known.name


FIRST_AUTOPILOT = AutopilotName(AUTOPILOTS[0].name)
MOST_SECONDS = 86_400.0
MOST_SEED = 2**31 - 1

SiteArgument = Annotated[Path, typer.Argument(metavar="SITE", help="The site file (TOML).")]
PlanArgument = Annotated[Path, typer.Argument(metavar="PLAN", help="A plan file, as `faultline plan -o` writes it.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="Print only the result, and questions that need an answer.")]
CostOption = Annotated[
    Cost,
    typer.Option(help="What to minimise: minmax, the longest route; minsum, all routes together; mincomb, both."),
]
SecondsOption = Annotated[
    float,
    typer.Option(min=0.01, max=MOST_SECONDS, callback=require_finite, help="Time limit of the solver, in seconds."),
]
SeedOption = Annotated[
    int, typer.Option(min=0, max=MOST_SEED, help="Random seed; the same seed reproduces the result.")
]
PlanCostOption = Annotated[
    PlanCostName | None,
    typer.Option(
        help="What to optimise: minmax, the longest route; minsum, all routes together; mincomb, both; window, the "
        "re-plan window, so that the fleet can finish without any one vehicle from as early as possible. Without it "
        f"the window, or minmax for one vehicle, for more than {WINDOW_UP_TO} segments and for other solvers."
    ),
]
SolverOption = Annotated[
    PlanSolver,
    typer.Option(
        help="search, faultline's own; grasp, the paper's, as a baseline; exact, proven optima up to 18 segments."
    ),
]
StretchOption = Annotated[
    float,
    typer.Option(
        min=0,
        max=1000,
        callback=require_finite,
        metavar="PCT",
        help="With --cost window: how much longer than the shortest possible the longest route may be, in percent. A "
        "larger window costs flight time.",
    ),
]
EverybodyOption = Annotated[
    bool, typer.Option("--all-vehicles", help="Use every vehicle; keep none on the ground as a spare.")
]
StartsOption = Annotated[int, typer.Option(min=0, max=256, help="Parallel searches; 0 for one per processor.")]
DEFAULT_REPLAN_COST = DEFAULT.cost or Cost.MINMAX
DEFAULT_STRETCH_PCT = 100 * DEFAULT.stretch
AutopilotOption = Annotated[AutopilotName, typer.Option(help="Autopilot that the simulated vehicles behave like.")]
NetworkOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="GeoJSON or a graph file; by default faultline's own network.")
]
FaultOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SPEC",
        help="VEHICLE:KIND[=VALUE]@WHEN, such as uav2:silent@40% or uav3:battery-step=30@300s; may be repeated. Kinds: "
        "silent[=20s], battery-step=30, drain=3, crash, weak=0.7, reboot[=pad], refuse-upload, half-upload, loss=0.2, "
        "delay=0.3, duplicate=0.1, reorder=0.1, rate=2000, wreck, fence, emergency[=RTL], ekf, gps[=20s]; acts of "
        "people: pilot=MODE, sticks, station=MODE, kill, disarm, pack[=80]. 'all' means every vehicle. WHEN is a time "
        "(300s), a share of the route (40%) or a height (2.5m in the climb, 20m-down in the descent), or landed.",
    ),
]
AfterOption = Annotated[
    Path | None,
    typer.Option(
        "--after", metavar="DIR", help="Plan only what the flight of that run directory left over: the next sortie."
    ),
]
LearnedOption = Annotated[
    Path | None,
    typer.Option(
        "--learned",
        metavar="DIR",
        help="Start from what the flight of that run directory taught about the same vehicles: pace and consumption.",
    ),
]
FlownPlanOption = Annotated[
    Path | None, typer.Option("--plan", metavar="PLAN", help="Fly exactly this plan; without it a new one is made.")
]
RunOption = Annotated[
    Path | None,
    typer.Option("--run", metavar="DIR", help="The run directory, new or empty; by default a dated one in runs/."),
]
DaskOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Run on the Dask cluster whose scheduler is at ADDRESS.")
]  # fmt: skip
JobsOption = Annotated[
    int | None, typer.Option(min=1, metavar="N", help="Processes on this computer; by default one per processor.")
]
