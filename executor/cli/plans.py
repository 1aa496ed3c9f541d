"""Define the commands about plans: plan, check, window, replan, risk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import missions
import planner
from executor.adapters.extras import Extra, require_extra
from executor.cli import options, plan_inputs
from executor.cli.console import TerminalConsole
from executor.cli.exit_codes import ANSWER_IS_NO
from executor.core.formatting import command_line
from executor.errors import SiteError
from executor.flight import next_flight
from executor.site import plan_summary, site_model, site_planning
from executor.site.campaigns import describe_policy, open_campaign_runner, sweep_mtbf
from executor.site.day_plans import preview_day_loss
from executor.site.flight_keys import MOST_DAYS
from executor.site.ground_view import view_for
from executor.site.site_file import read_site
from executor.site.site_planning import PlanRequest
from planner.risk import RESERVE_PCT

SearchOption = Annotated[
    Path | None,
    typer.Option(
        "--search", metavar="FILE", help="Parameters of the search (TOML); those that it omits keep their defaults."
    ),
]
PlanPictureOption = Annotated[
    Path | None,
    typer.Option(metavar="PNG", help="Draw the plan on a map, the trade-offs of --front, or the timetable of --day."),
]
FrontOption = Annotated[
    bool,
    typer.Option(
        "--front",
        help="Find the best trade-offs between longest route, energy and re-plan window, to choose from; -o is then a "
        "directory, with a plan file for each.",
    ),
]
MtbfOption = Annotated[
    float, options.number_option("Mean flight hours between failures of one vehicle.", 0.01, metavar="HOURS")
]
SpreadOption = Annotated[
    float,
    options.number_option(
        "Standard deviation of a vehicle's true consumption, in percent of the planned; re-plans use the planned "
        "one.", 0, 50, metavar="PCT",
    ),
]  # fmt: skip
ReserveOption = Annotated[
    float,
    options.number_option(
        "Reserve beyond the budget, in percent of a full battery; a vehicle that has used up both is lost.", 0, 100,
        metavar="PCT",
    ),
]  # fmt: skip
SamplesOption = Annotated[int, typer.Option(min=1, max=100_000_000, metavar="N", help="Number of simulated flights.")]
LossesOption = Annotated[
    int, typer.Option(min=1, max=50, metavar="K", help="Re-plan at most this many losses in one flight.")
]  # fmt: skip
PictureOption = Annotated[
    Path | None, typer.Option(metavar="PNG", help="Draw the chance over a range of mean times between failures.")
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
        wanted = replace(wanted, params=site_planning.read_search_params(search))
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
    heights = plan_summary.compute_planned_heights(ground, [content.network_routes])
    plan_inputs.write_named_file(output, lambda path: missions.write_plan(path, content))
    plan_inputs.draw_named_file(picture, lambda pictures: pictures.draw_plan_figure(content, below))
    plan_inputs.draw_named_file(
        profile, lambda pictures: pictures.draw_profile_figure(ground.setup, content.network_routes)
    )
    _print_plan(content, as_json=as_json, heights=heights, chosen=plan_summary.describe_site_choices(ground))
    if output is not None and not as_json:
        known = () if learned is None else ("--learned", learned)
        print(f"to fly exactly this plan: {command_line('fly', site, '--plan', output, *known)}")
    if content.uncovered or content.unreachable:
        raise typer.Exit(ANSWER_IS_NO)


NOT_BY_DAY = ("cost", "mtbf", "solver", "stretch", "losses", "all_vehicles", "search", "front", "profile")
ONLY_BY_DAY = ("objective", "mtbf_hours", "probability", "samples", "dask", "jobs")
ONLY_BY_LOSSES = ("dask", "jobs")


def _check_options_fit(asked: typer.Context, *, day: bool) -> None:
    beside = "none with --day" if day else "--day with it"
    plan_inputs.refuse_options(asked, NOT_BY_DAY if day else ONLY_BY_DAY, beside)
    if not plan_inputs.is_option_given(asked, "mtbf_hours"):
        plan_inputs.refuse_options(asked, ONLY_BY_LOSSES, "--mtbf-hours with it")


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
        ground,
        wanted,
        plan_inputs.announce_planning(
            console, wanted, (len(site_model.select_reachable(ground)[0]), len(ground.names))
        ),
    )
    console.show_progress("")
    heights = [plan_summary.compute_planned_heights(ground, [content.network_routes]) for content in plans]
    if not plans:
        raise SiteError("--front: no plan covers every segment within the budgets, so there is nothing to choose from")
    plan_inputs.write_named_file(output, lambda path: path.mkdir(parents=True, exist_ok=True))
    for number, content in enumerate(plans if output is not None else (), start=1):
        plan_inputs.write_named_file(output, partial(_write_numbered, number, content))
    references = {} if as_json and picture is None else site_planning.plan_references(ground, wanted)
    others = {name: content for name, content in references.items() if content.window is not None}
    plan_inputs.draw_named_file(picture, lambda pictures: pictures.draw_front_figure(plans, others))
    named = {**{str(number): content for number, content in enumerate(plans, start=1)}, **references}
    lines = ["         longest route   all energy   any loss from   window"]
    lines += [_describe_trade(name, content) for name, content in named.items()]
    lines += dict.fromkeys(f"warning: {line}" for one in heights for line in one.warnings)
    plan_inputs.print_result(
        lambda: {"front": [missions.build_plan_document(content) for content in plans]}, lines, as_json=as_json
    )


def _write_numbered(number: int, content: missions.PlanFile, folder: Path) -> None:
    missions.write_plan(folder / f"plan-{number:02d}.json", content)


def _describe_trade(name: str, content: missions.PlanFile) -> str:
    longest_s, energy_pct, found = max(content.durations_s), sum(content.energies_pct), content.window
    text = f"{name:>7}  {longest_s / 60:9.1f} min  {energy_pct:9.1f} %"
    return text if found is None else f"{text}  {found.earliest_s / 60:10.1f} min  {found.window_pct:5.1f} %"


def check(plan: options.PlanArgument, as_json: options.JsonOption = False) -> None:
    """Recompute every figure of a plan file, or a day plan, from its own network and report errors."""
    wrong = missions.check_plan(missions.read_any_plan(plan))
    lines = wrong or ["every figure is right"]
    plan_inputs.print_result(
        lambda: {"ok": not wrong, "wrong": wrong}, lines, as_json=as_json, answer_is_no=bool(wrong)
    )


def window(
    plan: options.PlanArgument,
    seed: options.SeedOption = 0,
    losses: options.LossesOption = 1,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="PNG", help="Draw battery consumption over time, with the re-plans of the earliest losses."
        ),
    ] = None,
    prove: Annotated[
        bool,
        typer.Option(
            "--prove",
            help="Decide more losses for certain, and bound the window of any plan, by column generation: up to "
            "minutes; needs the extra proofs.",
        ),
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Compute the time from which the fleet can finish without any one or two vehicles, and the loss that breaks this.

    The window is the share of the longest route's time, counted from its end, in which every single loss has a re-plan
    that was found and checked. The certified time is a bound: before it at least one loss certainly has none. For a day
    plan: the time from which each vehicle may be lost for good.
    """
    plan_inputs.check_can_draw("--picture", picture)
    content = missions.read_any_plan(plan)
    if losses == 2 and (picture is not None or isinstance(content, missions.DayPlanFile)):
        what = "a day plan" if picture is None else "--picture"
        raise SiteError(f"--losses: expected 1 with {what}, got 2")
    if isinstance(content, missions.DayPlanFile):
        if picture is not None:
            raise SiteError("--picture: expected none for a day plan; `plan --day --picture` draws its sorties")
        plan_inputs.print_loss_windows(content, seed, as_json=as_json)
        return
    if prove:
        require_extra(Extra.PROOFS, "--prove")
    instance, again = content.build_instance(), content.fly_again
    found = planner.replan_window(instance, content.plan, seed=seed, fly_again=again, losses=losses, prove=prove)
    least_s = plan_inputs.bound_any_window_s(instance, found, as_json=as_json) if prove else None
    if picture is not None:
        repairs = planner.find_repairs_at(instance, content.plan, found.earliest_s, seed=seed, fly_again=again)
        plan_inputs.draw_named_file(picture, lambda pictures: pictures.draw_window_figure(content, found, repairs))
    plan_inputs.print_result(
        lambda: _build_window_document(content, found, least_s),
        _describe_found_window(content, found, least_s),
        as_json=as_json,
    )


def replan(
    asked: typer.Context,
    plan: options.PlanArgument,
    lost: Annotated[str, typer.Option(metavar="NAME", help="The vehicle that is lost.")],
    at: Annotated[
        float,
        options.number_option(
            "Time of the loss, from the start of the plan; in a day plan from its first midnight.",
            0,
            MOST_DAYS * options.MOST_SECONDS,
            metavar="SECONDS",
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
    """Plan the response to the loss of one vehicle at a given time; exit 1 if segments are left over.

    In a day plan the vehicle is lost for good. Sorties under way are flown to their end, then the others take over,
    including spares; the new plan holds the sorties before and after the loss.
    """
    plan_inputs.check_can_write(output)
    known = missions.read_any_plan(plan)
    content: missions.PlanFile | missions.DayPlanFile
    if isinstance(known, missions.DayPlanFile):
        plan_inputs.refuse_options(asked, ("cost", "seconds"), "none for a day plan")
        content, is_feasible = preview_day_loss(known, lost, at, seed=seed)
    else:
        content, is_feasible = site_planning.preview_loss(known, lost, at, cost=cost, seconds=seconds, seed=seed)
    plan_inputs.write_named_file(output, lambda path: missions.write_plan(path, content))
    if isinstance(content, missions.DayPlanFile):
        days = content
        plan_inputs.print_result(
            lambda: plan_inputs.build_day_document(days, [], [], None), plan_summary.describe_day(days), as_json=as_json
        )
    else:
        _print_plan(content, as_json=as_json)
    if not is_feasible:
        raise typer.Exit(ANSWER_IS_NO)


def _build_window_document(
    content: missions.PlanFile, found: planner.ReplanWindow, least_s: float | None
) -> dict[str, object]:
    figures = ("window_pct", "earliest_s", "certified_earliest_s", "certified_window_pct", "longest_route_s", "losses")
    return {key: getattr(found, key) for key in figures} | {
        key: None if loss is None else {
            "vehicle": content.names[loss.vehicle], "from_s": loss.from_s, "to_s": loss.to_s,
        }
        for key, loss in (("breaking", found.breaking), ("then", found.then))
    } | ({} if least_s is None else {"any_plan_earliest_s": least_s})  # fmt: skip


def _describe_found_window(
    content: missions.PlanFile, found: planner.ReplanWindow, least_s: float | None
) -> Iterator[str]:
    breaking = found.breaking
    absorbs = plan_summary.describe_absorbed_losses(found.earliest_s, found.losses)
    yield (
        f"re-plan window {found.window_pct:.1f} %: {absorbs}{plan_summary.but_left_over(content)} "
        f"(longest route {found.longest_route_s:.0f} s)"
    )
    if breaking is not None:
        name = content.names[breaking.vehicle]
        after = "" if (then := found.then) is None else (
            f", then of {content.names[then.vehicle]} between {then.from_s:.0f} s and {then.to_s:.0f} s"
        )  # fmt: skip
        yield (
            f"worst case before: no re-plan was found for a loss of {name} between {breaking.from_s:.0f} s and "
            f"{breaking.to_s:.0f} s{after}"
        )
    if found.certified_earliest_s > 0:
        yield (
            f"certified: not every loss can be re-planned before {found.certified_earliest_s:.0f} s, so no window of "
            f"this plan is larger than {found.certified_window_pct:.1f} %"
        )
    if least_s is not None:
        yield f"certified: with these budgets no window of any plan begins before {least_s:.0f} s"


def _print_plan(
    content: missions.PlanFile,
    *,
    as_json: bool,
    heights: plan_summary.PlannedHeights | None = None,
    chosen: Sequence[str] = (),
) -> None:
    def document() -> dict[str, object]:
        left = {"left_over": [asdict(one) for one in plan_summary.find_left_over(content)]}
        return {**missions.build_plan_document(content), **left, **({} if heights is None else heights.to_json())}

    lines = (
        *plan_summary.describe_routes(content), plan_summary.summarise_plan(content),
        f"{content.cost.name} {content.cost.value:.3f}, found in {content.seconds:.1f} s",
        *plan_summary.describe_window(content), *plan_summary.describe_distances(content),
        *(() if heights is None else heights.lines), *chosen, *plan_summary.describe_left_over(content),
    )  # fmt: skip
    plan_inputs.print_result(document, lines, as_json=as_json)


def risk(
    plan: options.PlanArgument,
    mtbf: MtbfOption,
    battery_spread: SpreadOption = 0.0,
    reserve: ReserveOption = RESERVE_PCT,
    samples: SamplesOption = 100_000,
    seed: options.SeedOption = 1,
    max_losses: LossesOption = 2,
    dask: options.DaskOption = None,
    jobs: options.JobsOption = None,
    picture: PictureOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate the probability of a complete inspection, as planned and with re-plans after losses.

    A vehicle in the air fails at random, once in HOURS flight hours on average, or when its battery is used up. The
    others take over the open segments of a lost vehicle if a re-plan is found that inspects every segment; otherwise
    they are left over. The same seed gives the same answer for any number of processes.
    """
    plan_inputs.check_can_draw("--picture", picture)
    content = missions.read_plan(plan)
    names = content.names
    console = TerminalConsole(quiet=as_json, yes=True)
    swept: tuple[planner.RiskEstimate, ...] = ()

    def done(flown: int, total: int) -> None:
        console.show_progress(f"{flown} of {total} flights")

    with open_campaign_runner(jobs=jobs, dask=dask) as fly:
        console.show_progress("checking each first loss")
        wanted = planner.build_risk_campaign(
            content.build_instance(), content.plan, mtbf_h=(mtbf,), battery_spread_pct=battery_spread,
            reserve_pct=reserve,
            max_losses=max_losses, fly_again=content.fly_again,
        )  # fmt: skip
        (found,) = planner.estimate_risks(
            wanted, fly(planner.simulate_chunk, wanted, planner.split_flights(samples, seed), done)
        )
        if picture is not None:
            sweep, chunks = sweep_mtbf(wanted, seed, flights=samples)
            swept = planner.estimate_risks(sweep, fly(planner.simulate_chunk, sweep, chunks, done))
    console.show_progress("")
    plan_inputs.draw_named_file(picture, lambda pictures: pictures.draw_risk_figure(swept, found))
    plan_inputs.print_result(
        lambda: build_risk_document(wanted, found, names, seed), _describe_risk(found, names), as_json=as_json
    )


def build_risk_document(
    flown: planner.RiskCampaign, found: planner.RiskEstimate, names: Sequence[str], seed: int
) -> dict[str, object]:
    """Return a risk estimate for JSON."""
    worst = found.worst
    return {
        "mtbf_h": found.mtbf_h,
        "battery_spread_pct": flown.battery_spread_pct,
        "reserve_pct": flown.reserve_pct,
        "flights": found.flights,
        "seed": seed,
        "finishing": [
            {
                "losses_replanned": replans,
                "probability": chance.estimate,
                "low_95": chance.low,
                "high_95": chance.high,
                "expected_uninspected_m": undone_m,
            }
            for replans, (chance, undone_m) in enumerate(zip(found.finished, found.undone_m, strict=True))
        ],
        "expected_losses": found.expected_losses,
        "flights_with_losses": dict(zip(("none", "one", "two_or_more"), found.losses_share, strict=True)),
        "failures": {
            "share_by_vehicle": dict(zip(names, found.blame_share, strict=True)),
            "most": None
            if worst is None
            else {
                "vehicle": names[worst.vehicle], "from_s": worst.from_s, "to_s": worst.to_s, "share": worst.share,
            },
        },
    }  # fmt: skip


def _describe_risk(found: planner.RiskEstimate, names: Sequence[str]) -> Iterator[str]:
    yield f"everything inspected, {found.flights} flights, one failure in {found.mtbf_h:g} flight hours:"
    for replans, (chance, undone_m) in enumerate(zip(found.finished, found.undone_m, strict=True)):
        yield (
            f"  {describe_policy(replans):<32}{100 * chance.estimate:7.2f} %  (95 %: {100 * chance.low:.2f} to "
            f"{100 * chance.high:.2f} %), {undone_m:.1f} m left on average"
        )
    none, one, more = (100 * share for share in found.losses_share)
    yield (
        f"losses: {found.expected_losses:.3f} a flight; none in {none:.2f} % of the flights, one in {one:.2f} %, "
        f"more in {more:.2f} %"
    )
    if found.worst is None:
        yield "every flight finished"
        return
    worst = found.worst
    shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in zip(names, found.blame_share, strict=True))
    yield f"losses without a re-plan: {shares}"
    yield (
        f"most of them: {names[worst.vehicle]} between {worst.from_s:.0f} and {worst.to_s:.0f} s "
        f"({100 * worst.share:.0f} %)"
    )
