"""The commands about plans: plan, check, window, replan."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from executor.cli import options, plan_inputs
from executor.cli.console import TerminalConsole
from executor.core.formatting import command_line
from executor.errors import SiteError
from executor.flight import next_flight
from executor.site import plan_summary, site_model, site_planning
from executor.site.ground_view import GroundView, view_for
from executor.site.site_file import read_site
from executor.site.site_planning import PlanRequest
from missions import (
    DayPlanFile,
    PlanFile,
    build_plan_document,
    check_day_plan,
    check_plan,
    read_any_plan,
    read_plan,
    write_plan,
)
from missions.files import json_text
from planner import ReplanWindow, SearchParams, find_repairs_at, replan_window

SearchOption = Annotated[
    Path | None,
    typer.Option(
        "--search", metavar="FILE", help="Parameters of the search (TOML); what it leaves out keeps its default."
    ),
]
PlanPictureOption = Annotated[
    Path | None,
    typer.Option(
        metavar="PNG", help="Draw the plan on a map, the trade-offs of --front, or who flies when with --day."
    ),
]
FrontOption = Annotated[
    bool,
    typer.Option(
        "--front",
        help="Find the best trade-offs between longest route, energy and re-plan window, to choose from; -o is then a "
        "directory, with a plan file for each.",
    ),
]


@options.flatten_options
def plan(
    asked: typer.Context,
    site: options.SiteArgument,
    *,
    planning: options.PlanOptions,
    search: SearchOption = None,
    front: FrontOption = False,
    days: plan_inputs.DayOptions,
    after: options.AfterOption = None,
    learned: options.LearnedOption = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan to this file.")
    ] = None,
    picture: PlanPictureOption = None,
    profile: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Draw each vehicle's flight from the side, over the ground of [terrain]."),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a route for each vehicle within its budget; exit 1 if segments are left over.

    `fly --plan` flies exactly this plan; `preflight` and `fly` with the same options make one by the same rules.
    """
    _check_options_fit(asked, day=days.day)
    wanted = (replace(planning, cost=options.PlanCostName.WINDOW) if front else planning).build_request()
    if search is not None:
        wanted = replace(wanted, params=SearchParams.load(search))
    plan_inputs.check_can_write(None if front else output)
    plan_inputs.check_can_draw("--picture", picture)
    console = TerminalConsole(quiet=as_json, yes=True)
    ground = plan_inputs.load_site_with_learned(read_site(site), site.parent, learned, console)
    plan_inputs.check_can_draw("--profile", profile)
    if profile is not None and (front or ground.terrain is None):
        raise SiteError(f"--profile: expected one plan, without --front, of a site with [terrain], got {site}")
    left = None if after is None else next_flight.read_segments_left(after, ground)
    if days.day:
        seconds = planning.seconds if plan_inputs.is_option_given(asked, "seconds") else plan_inputs.DAY_SECONDS
        wanted = replace(wanted, seconds=seconds, objective=days.objective)
        plan_inputs.plan_day(ground, console, wanted, days, output, picture, left, as_json=as_json)
        return
    if front:
        _plan_front(ground, console, wanted, output, picture, as_json=as_json)
        return
    below = None if picture is None else view_for(ground, site.parent)
    content = plan_inputs.plan_and_report(ground, console, wanted, left)
    heights = _compute_heights(ground, content)
    if output is not None:
        plan_inputs.write_named_file(output, lambda: write_plan(output, content))
    _draw(ground, content, (picture, below), profile)
    _print_plan(content, as_json=as_json, heights=heights)
    if output is not None and not as_json:
        known = () if learned is None else ("--learned", learned)
        print(f"flown as it is by: {command_line('fly', site, '--plan', output, *known)}")
    if content.plan.uncovered or content.unreachable:
        raise typer.Exit(1)


def _compute_heights(ground: site_model.SiteModel, content: PlanFile) -> plan_summary.PlannedHeights:
    return plan_summary.compute_planned_heights(
        ground, [site_model.name_routes(ground, content.build_task(), content.plan)]
    )


def _draw(
    ground: site_model.SiteModel, content: PlanFile, chart: tuple[Path | None, GroundView | None], profile: Path | None
) -> None:
    picture, below = chart
    if picture is not None:
        from executor.analysis.pictures import draw_plan_figure, save_figure

        plan_inputs.write_named_file(picture, lambda: save_figure(draw_plan_figure(content, below), picture))
    if profile is not None:
        _draw_profile(ground, content, profile)


def _draw_profile(ground: site_model.SiteModel, content: PlanFile, path: Path) -> None:
    from executor.analysis.pictures import draw_profile_figure, save_figure
    from executor.analysis.pictures.chart_figures import build_profiles

    setup = site_model.build_flight_setup(ground)
    paths = site_model.build_paths(setup, site_model.name_routes(ground, content.build_task(), content.plan))
    flown = build_profiles(setup, paths.values())
    plan_inputs.write_named_file(path, lambda: save_figure(draw_profile_figure(flown), path))


NOT_BY_DAY = ("cost", "solver", "stretch", "all_vehicles", "search", "front", "profile")
ONLY_BY_DAY = ("objective", "mtbf_hours", "probability", "samples", "dask", "jobs")
ONLY_BY_LOSSES = ("dask", "jobs")


def _check_options_fit(asked: typer.Context, *, day: bool) -> None:
    for name in NOT_BY_DAY if day else ONLY_BY_DAY:
        if plan_inputs.is_option_given(asked, name):
            beside = "none beside --day" if day else "--day beside it"
            raise SiteError(f"--{name.replace('_', '-')}: expected {beside}")
    for name in ONLY_BY_LOSSES:
        if plan_inputs.is_option_given(asked, name) and not plan_inputs.is_option_given(asked, "mtbf_hours"):
            raise SiteError(f"--{name}: expected --mtbf-hours beside it")


def _plan_front(
    ground: site_model.SiteModel,
    console: TerminalConsole,
    wanted: PlanRequest,
    output: Path | None,
    picture: Path | None,
    *,
    as_json: bool,
) -> None:
    plans = site_planning.plan_front(
        ground, wanted, plan_inputs.announce_plan(ground, console, wanted, len(ground.network.segments))
    )
    console.show_progress("")
    heights = [_compute_heights(ground, content) for content in plans]
    if not plans:
        raise SiteError("--front: no plan covers every segment within the budgets, so there is nothing to choose from")
    if output is not None:
        plan_inputs.write_named_file(output, lambda: output.mkdir(parents=True, exist_ok=True))
        for number, content in enumerate(plans, start=1):
            plan_inputs.write_named_file(output, partial(write_plan, output / f"plan-{number:02d}.json", content))
    if as_json:
        print(json_text({"front": [build_plan_document(content) for content in plans]}))
    references = {} if as_json and picture is None else site_planning.plan_references(ground, wanted)
    if picture is not None:
        from executor.analysis.pictures import draw_front_figure, save_figure

        others = {name: content for name, content in references.items() if content.window is not None}
        plan_inputs.write_named_file(picture, lambda: save_figure(draw_front_figure(plans, others), picture))
    if not as_json:
        print("         longest route   all energy   any loss from   window")
        for number, content in enumerate(plans, start=1):
            _print_trade(str(number), content)
        for name, content in references.items():
            _print_trade(name, content)
        for line in dict.fromkeys(line for one in heights for line in one.warnings):
            print(f"warning: {line}")


def _print_trade(name: str, content: PlanFile) -> None:
    longest_s, energy_pct, found = max(content.durations_s), sum(content.energies_pct), content.window
    text = f"{name:>7}  {longest_s / 60:9.1f} min  {energy_pct:9.1f} %"
    print(text if found is None else f"{text}  {found.earliest_s / 60:10.1f} min  {found.window_pct:5.1f} %")


def check(plan: options.PlanArgument, as_json: options.JsonOption = False) -> None:
    """Recompute every figure of a plan file, or a day plan, from its own network and report errors."""
    content = read_any_plan(plan)
    wrong = check_day_plan(content) if isinstance(content, DayPlanFile) else check_plan(content)
    if as_json:
        print(json_text({"ok": not wrong, "wrong": wrong}))
    else:
        for line in wrong or ["every figure is right"]:
            print(line)
    if wrong:
        raise typer.Exit(1)


def window(
    plan: options.PlanArgument,
    seed: options.SeedOption = 0,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="PNG", help="Draw battery consumption over time, with the re-plans of the earliest losses."
        ),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Compute from when on the fleet can finish without any one vehicle, and which loss breaks it before.

    The window is the share of the longest route's time, counted from its end, in which every single loss has a re-plan
    that was found and checked. The certified time is a bound: before it at least one loss certainly has none. Of a plan
    of days: from when on each vehicle may be lost for good.
    """
    plan_inputs.check_can_draw("--picture", picture)
    content = read_any_plan(plan)
    if isinstance(content, DayPlanFile):
        if picture is not None:
            raise SiteError("--picture: expected none for a plan of days; `plan --day --picture` draws its sorties")
        plan_inputs.print_loss_windows(content, seed, as_json=as_json)
        return
    found = replan_window(content.build_instance(), content.plan, seed=seed, fly_again=content.fly_again)
    if picture is not None:
        from executor.analysis.pictures import draw_window_figure, save_figure

        again = content.fly_again
        repairs = find_repairs_at(content.build_instance(), content.plan, found.earliest_s, seed=seed, fly_again=again)
        plan_inputs.write_named_file(picture, lambda: save_figure(draw_window_figure(content, found, repairs), picture))
    _print_window(content, found, as_json=as_json)


def replan(
    plan: options.PlanArgument,
    lost: Annotated[str, typer.Option(metavar="NAME", help="The vehicle that is lost.")],
    at: Annotated[
        float,
        options.number_option(
            "Time of the loss, from the start of the plan.", 0, options.MOST_SECONDS, metavar="SECONDS"
        ),
    ],
    cost: options.CostOption = options.DEFAULT_REPLAN_COST,
    seconds: options.SecondsOption = 2.0,
    seed: options.SeedOption = 1,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the new plan to this file.")
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Plan the response to the loss of one vehicle at a given time; exit 1 if segments are left over."""
    plan_inputs.check_can_write(output)
    result = site_planning.preview_loss(read_plan(plan), lost, at, cost=cost, seconds=seconds, seed=seed)
    if output is not None:
        plan_inputs.write_named_file(output, lambda: write_plan(output, result.plan))
    _print_plan(result.plan, as_json=as_json)
    if not result.feasible:
        raise typer.Exit(1)


def _print_window(content: PlanFile, found: ReplanWindow, *, as_json: bool) -> None:
    breaking = found.breaking
    if as_json:
        print(
            json_text({
                "window_pct": found.window_pct,
                "earliest_s": found.earliest_s,
                "certified_earliest_s": found.certified_earliest_s,
                "certified_window_pct": found.certified_window_pct,
                "longest_route_s": found.longest_route_s,
                "breaking": None if breaking is None else {
                    "vehicle": content.vehicles[breaking.vehicle].name,
                    "from_s": breaking.from_s,
                    "to_s": breaking.to_s,
                },
            })
        )  # fmt: skip
        return
    print(
        f"re-plan window {found.window_pct:.1f} %: from {found.earliest_s:.0f} s the fleet can absorb the loss of "
        f"any one vehicle{plan_summary.but_left_over(content)} (longest route {found.longest_route_s:.0f} s)"
    )
    if breaking is not None:
        name = content.vehicles[breaking.vehicle].name
        print(
            f"worst case before: no re-plan was found for a loss of {name} between {breaking.from_s:.0f} s and "
            f"{breaking.to_s:.0f} s"
        )
        print(
            f"certified: not every loss can be re-planned before {found.certified_earliest_s:.0f} s, so no window of "
            f"this plan is larger than {found.certified_window_pct:.1f} %"
        )


def _print_plan(content: PlanFile, *, as_json: bool, heights: plan_summary.PlannedHeights | None = None) -> None:
    if as_json:
        more = {} if heights is None else heights.to_json()
        left = {"left_over": [asdict(one) for one in plan_summary.find_left_over(content)]}
        print(json_text({**build_plan_document(content), **left, **more}))
        return
    for line in (*plan_summary.describe_routes(content), plan_summary.summarise_plan(content)):
        print(line)
    print(f"{content.cost_name} {content.cost_value:.3f}, found in {content.solved.seconds:.1f} s")
    for line in (*plan_summary.describe_window(content), *plan_summary.describe_distances(content)):
        print(line)
    for line in (*(() if heights is None else heights.lines), *plan_summary.describe_left_over(content)):
        print(line)
