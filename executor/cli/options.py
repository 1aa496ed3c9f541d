"""Define arguments and options shared by several commands."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import StrEnum
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from executor.errors import SiteError
from executor.site.site_planning import DEFAULT, WINDOW_UP_TO, PlanRequest, PlanSolver
from missions import AUTOPILOTS
from planner import Cost


def require_finite(value: float | None) -> float | None:
    """Refuse NaN and infinity: a bound lets NaN pass, and nothing ends at infinity."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"expected a finite number, got {value}.")
    return value


def number_option(text: str, low: float, high: float | None = None, *names: str, metavar: str | None = None) -> Any:  # noqa: ANN401 - as in typer
    """Return an option for a finite number between two bounds.

    Args:
        text: Help text.
        low: Lower bound.
        high: Upper bound.
        names: Option names, if not that of the parameter.
        metavar: Name of the value in the help.
    """
    return typer.Option(*names, min=low, max=high, callback=require_finite, metavar=metavar, help=text)


def flatten_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that takes each option separately in place of a dataclass of options."""
    hints, parameters, groups = get_type_hints(command, include_extras=True), list[Parameter](), dict[str, list[str]]()
    for one in signature(command).parameters.values():
        hint = hints[one.name]
        own = get_type_hints(hint, include_extras=True) if is_dataclass(hint) else {one.name: hint}
        defaults = {part.name: part.default for part in fields(hint)} if is_dataclass(hint) else {one.name: one.default}
        parameters += [Parameter(key, one.kind, default=defaults[key], annotation=own[key]) for key in defaults]
        groups |= {one.name: list(defaults)} if is_dataclass(hint) else {}

    @wraps(command)
    def flat(**given: object) -> None:
        made = {name: hints[name](**{key: given.pop(key) for key in keys}) for name, keys in groups.items()}
        command(**given, **made)

    flat.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    flat.__annotations__ = {one.name: one.annotation for one in parameters}
    return flat


class PlanCostName(StrEnum):
    """Objective of a first plan."""

    _ignore_ = "known"
    for known in Cost:
        vars()[known.name] = known.value
    WINDOW = "window"
    COVERAGE = "coverage"


class FormatName(StrEnum):
    """Formats of other programs."""

    QGC = "qgc"
    WAYPOINTS = "waypoints"
    KML = "kml"
    GEOJSON = "geojson"
    GPX = "gpx"


class AutopilotName(StrEnum):
    """Supported autopilots, by their names in site files."""

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
    Cost, typer.Option(help="What to minimise: minmax, the longest route; minsum, all routes together; mincomb, both.")
]
SecondsOption = Annotated[float, number_option("Time limit of the solver, in seconds.", 0.01, MOST_SECONDS)]
SeedOption = Annotated[
    int, typer.Option(min=0, max=MOST_SEED, help="Random seed; the same seed reproduces the result.")
]
PlanCostOption = Annotated[
    PlanCostName | None,
    typer.Option(
        help="What to optimise: minmax, the longest route; minsum, all routes together; mincomb, both; window, the "
        "re-plan window, so that the fleet can finish without any one vehicle from as early as possible; coverage, the "
        "probability that everything is inspected, with --mtbf. Without it "
        f"the window, or minmax for one vehicle, for more than {WINDOW_UP_TO} segments and for other solvers."
    ),
]
PlanMtbfOption = Annotated[
    float | None,
    number_option("With --cost coverage: mean flight hours between failures of one vehicle.", 0.01, metavar="HOURS"),
]
StartsOption = Annotated[int, typer.Option(min=0, max=256, help="Parallel searches; 0 for one per processor.")]
DEFAULT_REPLAN_COST = DEFAULT.cost or Cost.MINMAX
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
        "people: pilot=MODE, sticks, station=MODE, kill, disarm, pack[=80]. 'all' means every vehicle, "
        "uav1.2 the second of its links. WHEN is a time "
        "(300s), a share of the route (40%) or a height (2.5m in the climb, 20m-down in the descent), or landed.",
    ),
]
RadioOption = Annotated[
    str,
    typer.Option(
        metavar="PROFILE[:loss=SHARE][,...]",
        help="Put all vehicles behind one telemetry radio: sik (SiK at 64 kbit/s), sik-stock, sik-ecc, sik-ecc-mended, "
        "mlrs-19, mlrs-31, mlrs-50, mesh (RFD900x), lte, or lte-2, lte-8 and lte-20 with outages of 2, 8 and 20 s; a "
        "loss such as sik:loss=0.15 drops that share of packets in bursts. For vehicles with several links, one radio "
        "per link, separated by commas, with nothing for a link without one: sik,lte.",
    ),
]
AfterOption = Annotated[
    Path | None,
    typer.Option(
        "--after", metavar="DIR", help="Plan only the segments that the flight of that run directory left over."
    ),
]
FlownAfterOption = Annotated[
    Path | None,
    typer.Option(
        "--after",
        metavar="DIR",
        help="Plan only the segments that the flight of that run directory left over; with a day plan, fly its next "
        "day.",
    ),
]
LearnedOption = Annotated[
    Path | None,
    typer.Option(
        "--learned",
        metavar="DIR",
        help="Start from the pace and consumption of the same vehicles in the flight of that run directory.",
    ),
]
FlownPlanOption = Annotated[
    Path | None, typer.Option("--plan", metavar="PLAN", help="Fly exactly this plan; by default a new one is made.")
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


LossesOption = Annotated[
    int,
    typer.Option(
        min=1, max=2, metavar="N",
        help="The window against the loss of any one vehicle, or of any 2: one after the other, re-planned in between, "
        "or at once.",
    ),
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options of a first plan, shared by `plan`, `preflight` and `fly`."""

    cost: PlanCostOption = None
    solver: Annotated[
        PlanSolver,
        typer.Option(
            help="search, faultline's own; grasp, the paper's, as a baseline; exact, with a proof; for more than 18 "
            "segments it needs the extra proofs."
        ),
    ] = PlanSolver.SEARCH
    stretch: Annotated[
        float,
        number_option(
            "With --cost window: how much longer than the shortest possible the longest route may be, in percent. A "
            "larger window costs flight time.", 0, 1000, metavar="PCT",
        ),
    ] = 100 * DEFAULT.stretch  # fmt: skip
    mtbf: PlanMtbfOption = None
    losses: LossesOption = 1
    all_vehicles: Annotated[
        bool, typer.Option("--all-vehicles", help="Use every vehicle; keep none on the ground as a spare.")
    ] = False
    seconds: SecondsOption = DEFAULT.seconds
    seed: SeedOption = DEFAULT.seed
    starts: StartsOption = 0
    iterations: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="End the search after N iterations, within --seconds: the same plan on a busy computer.",
        ),
    ] = None

    def build_request(self) -> PlanRequest:
        """Return the plan request.

        Raises:
            PlanFileError: the solver does not support it.
            SiteError: as for `build_plan_request`.
        """
        wanted = build_plan_request(self.cost, self.mtbf)
        return replace(
            wanted, usual=wanted.usual and self.losses == 1, losses=self.losses,
            seconds=self.seconds, seed=self.seed, solver=self.solver,
            all_vehicles=self.all_vehicles, stretch=self.stretch / 100, starts=self.starts,
            iterations=self.iterations,
        )  # fmt: skip


def build_plan_request(cost: PlanCostName | None, mtbf: float | None = None) -> PlanRequest:
    """Return the plan request for a cost, or for none.

    Raises:
        PlanFileError: failures are given for a cost that has none.
        SiteError: --cost coverage has no --mtbf.
    """
    if cost is PlanCostName.COVERAGE and mtbf is None:
        raise SiteError("--mtbf: expected flight hours between failures with --cost coverage, got none")
    if cost is not PlanCostName.COVERAGE and mtbf is not None:
        raise SiteError("--mtbf: expected none without --cost coverage")
    chosen = None if cost in {None, PlanCostName.WINDOW, PlanCostName.COVERAGE} else Cost(cost)
    return replace(DEFAULT, cost=chosen, usual=cost is None, mtbf_h=mtbf)
