"""Prepare inputs shared by the commands that plan a flight or, with `--day`, working days."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import missions
from executor.adapters.extras import Extra, require_extra
from executor.adapters.run_directory import RunDirectory
from executor.cli.console import TerminalConsole
from executor.cli.exit_codes import ANSWER_IS_NO
from executor.cli.options import DaskOption, JobsOption, PlanOptions, number_option
from executor.core.formatting import format_count
from executor.core.interface.commands import Level
from executor.errors import SiteError
from executor.flight.next_flight import read_segments_left, select_next_day
from executor.site import day_plans, plan_summary, site_model, site_planning
from executor.site.campaigns import CampaignRunner, open_campaign_runner
from executor.site.day_plans import build_day_problem, list_spares, name_sortie_rounds, solve_day
from executor.site.learned_files import LearnedDocument, describe_learned
from executor.site.site_file import Site
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest
from missions.files import json_text
from planner import Instance, Progress, ReplanWindow, sorties, split_flights


def load_site_with_learned(
    site: Site, base: Path, learned: Path | None, console: TerminalConsole
) -> site_model.SiteModel:
    """Return the data known before any vehicle answers, with figures learned from the site's vehicles before.

    Args:
        site: Tables of the site file.
        base: Its folder.
        learned: Run directory of an earlier flight.
        console: Where the learned figures are reported.

    Raises:
        LogError: its learned.json is missing or cannot be used.
        MissionsError: the network cannot be used.
    """
    if learned is None:
        return site_model.load_site_model(site, base)
    path = RunDirectory(learned).learned
    document, drone = LearnedDocument.read(path), site_model.drone_of(site).name
    rows, known = {row.name: row for row in document.vehicles}, {}
    for vehicle in site.vehicle:
        row = rows.get(vehicle.name)
        if row is None:
            console.say(Level.INFO, f"{vehicle.name}: nothing learned in {path}; using the defaults")
        elif (row.autopilot, row.drone) != (vehicle.autopilot, drone):
            was = f"{row.autopilot} on a {row.drone}"
            console.say(Level.WARNING, f"{vehicle.name}: was {was} in {path}; using the defaults")
        else:
            known[vehicle.name] = document.known_by_name[vehicle.name]
            console.say(Level.INFO, f"{describe_learned(row)} ({document.date})")
    return site_model.load_site_model(site, base, known)


PLANNING = tuple(one.name for one in fields(PlanOptions))


def select_flown_plan(
    ground: site_model.SiteModel,
    console: TerminalConsole,
    asked: typer.Context,
    wanted: PlanRequest,
    *,
    plan: Path | None,
    after: Path | None = None,
) -> tuple[missions.DayPlanFile | None, missions.PlanFile]:
    """Return the plan of a flight: the given file, or else the plan that `plan` makes with the same options.

    Args:
        ground: The site.
        console: Where the choice is reported.
        asked: The command's context, with its arguments.
        wanted: Plan request without a file.
        plan: The file; of a plan of days its first day, or the next one after `after`.
        after: Run directory whose remainder is planned, or flown by the plan of days.

    Raises:
        PlanFileError: the file does not fit the site, or no day of it is left.
        SiteError: options of a new plan along with the file of another.
        typer.Exit: no sortie of a plan of days is left to fly.
    """
    if plan is None:
        left = None if after is None else read_segments_left(after, ground)
        return None, plan_and_report(ground, console, wanted, left)
    day = missions.read_day_plan(plan) if missions.is_day_plan(plan) else None
    refuse_options(
        asked, PLANNING if day is not None else (*PLANNING, "after"), "none with --plan, which is flown unchanged"
    )
    words = "the plan" if day is None else "the day"
    if day is not None and after is not None:
        day, words = _select_next_day(day, ground, console, asked, after)
    if day is None:
        content = missions.read_plan(plan)
        site_planning.check_plan_fits(content, ground, str(plan))
    else:
        content = day_plans.build_first_sorties_plan(day, ground)
    console.say(Level.INFO, f"{words} is that of {plan}")
    return day, content


def _select_next_day(
    content: missions.DayPlanFile, ground: SiteModel, console: TerminalConsole, asked: typer.Context, after: Path
) -> tuple[missions.DayPlanFile, str]:
    """Return the day of a plan that follows a flight, and its name."""
    day = select_next_day(content, after, ground, asked.params.get("of") or asked.params["site"])
    if day is None:
        console.say(Level.INFO, f"{content.source}: everything is inspected; nothing is left to fly")
        raise typer.Exit
    left = format_count(len(day.uncovered), "segment")
    return day, f"day {day.first_day} of {len(content.days)}, with {left} in no sortie yet,"


def is_option_given(asked: typer.Context, name: str) -> bool:
    """Return whether an option of a command was given explicitly."""
    source = asked.get_parameter_source(name)
    return source is not None and source.name != "DEFAULT"


def refuse_options(asked: typer.Context, names: Iterable[str], expected: str) -> None:
    """Refuse options of a command where they have no effect."""
    for name in names:
        if is_option_given(asked, name):
            raise SiteError(f"--{name.replace('_', '-')}: expected {expected}")


def plan_and_report(
    ground: site_model.SiteModel, console: TerminalConsole, wanted: PlanRequest, segments: Sequence[int] | None = None
) -> missions.PlanFile:
    """Plan a site, or some of its segments, and report progress and result.

    Raises:
        SiteError: the plan fails its check.
        planner.PlannerError: the solver cannot take this problem.
    """
    task = site_model.build_first_task(ground, segments)
    wanted = wanted.adapt_to_task(task)
    progressed = announce_planning(console, wanted, (len(task.segment_ids), len(ground.names)))
    content = site_planning.plan_site(ground, wanted, progressed, task)
    console.show_progress("")
    for line in missions.check_plan(content, search_window=False):
        raise SiteError(f"the plan of --solver {wanted.solver.value} is invalid: {line}")
    return content


def announce_planning(
    console: TerminalConsole, wanted: PlanRequest, sizes: tuple[int, int], chosen_by: str = "", where: str = ""
) -> Callable[[Progress], None]:
    """Report the start of planning, and return a callback for its progress.

    Args:
        console: Where it is shown.
        wanted: Plan request.
        sizes: Number of segments, and of vehicles.
        chosen_by: Objective of the plan, if not its cost.
        where: Starting place and time.
    """
    name = chosen_by or wanted.name
    unit = {"window": "earliest s", "coverage": "first loss without a re-plan"}.get(name, name)
    console.say(Level.INFO, f"planning {sizes[0]} segments for {sizes[1]} vehicles {where}({name}, {wanted.length})")

    def progressed(progress: Progress) -> None:
        known = f"{progress.iterations} iterations, {unit} {progress.value:.2f}, {progress.uncovered} left out"
        proven = (
            "" if progress.bound is None else f", proven: at least {progress.bound:.2f}, gap {progress.gap_pct:.2f} %"
        )
        console.show_progress(known + proven)

    return progressed


def bound_any_window_s(instance: Instance, found: ReplanWindow, *, as_json: bool) -> float:
    """Return a lower bound of the begin of any plan's window, and show the progress of its proof.

    Args:
        instance: The instance of the plan.
        found: The window of the plan.
        as_json: Whether the answer is JSON: then no progress is shown.
    """
    # Imported here because it loads numba.
    from planner.proofs import bound_earliest_window_s

    console = TerminalConsole(quiet=as_json, yes=True)

    def go_on(bound_s: float) -> bool:
        gap_pct = 100.0 * (1.0 - bound_s / found.earliest_s)
        console.show_progress(f"proven: no window of any plan begins before {bound_s:.0f} s, gap {gap_pct:.1f} %")
        return True

    bound_s = bound_earliest_window_s(instance, found.earliest_s, go_on=go_on)
    console.show_progress("")
    return bound_s


def write_named_file(path: Path | None, write: Callable[[Path], object]) -> None:
    """Write a file that the user named, if any.

    Raises:
        SiteError: it cannot be written.
    """
    try:
        if path is not None:
            write(path)
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error


def draw_named_file(path: Path | None, draw: Callable[[Any], Any]) -> None:
    """Draw a picture that the user named, if any; `draw` gets the drawing module, loaded only then.

    Raises:
        SiteError: it cannot be written.
    """
    if path is not None:
        from executor.analysis import pictures

        write_named_file(path, partial(pictures.save_figure, draw(pictures)))


def print_result(
    document: Callable[[], object], lines: Iterable[str], *, as_json: bool, answer_is_no: bool = False
) -> None:
    """Print a command's result: its document, or its lines for people; may exit the command."""
    for line in [json_text(document())] if as_json else lines:
        print(line)
    if answer_is_no:
        raise typer.Exit(ANSWER_IS_NO)


def check_can_draw(option: str, path: Path | None) -> None:
    """Check before the work that a picture can be written and drawn; None if none was requested.

    Raises:
        ExtraMissing: no library to draw with is installed.
        SiteError: as `check_can_write`.
    """
    if path is not None:
        require_extra(Extra.PICTURES, option)
        check_can_write(path)


def check_can_write(*paths: Path | None) -> None:
    """Check before the work that its results can be written; None for those not requested.

    Raises:
        SiteError: one is a directory, or its folder is missing or cannot be written to.
    """
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise SiteError(f"{path}: cannot be written: expected a file's name, it is a directory")
        if not path.parent.is_dir():
            raise SiteError(f"{path}: cannot be written: there is no directory {path.parent}")
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise SiteError(f"{path}: cannot be written: permission denied")


DAY_SECONDS = 20.0
"""Default search time for days."""
MOST_SPARES = 5
ObjectiveOption = Annotated[
    sorties.Objective, typer.Option(help="Day plan objective: earliest finish, least flight time or fewest sorties.")
]


@dataclass(frozen=True, slots=True)
class DayOptions:
    """Options of days of many sorties, and of days with lost vehicles."""

    day: Annotated[
        bool,
        typer.Option(
            "--day", help="Plan working days of many sorties from the bases of the site; -o is then a day plan file."
        ),
    ] = False
    objective: ObjectiveOption = sorties.Objective.FINISH
    mtbf_hours: Annotated[
        float | None,
        number_option(
            "With --day: mean flight hours between failures of one vehicle; computes the vehicles and packs needed",
            0.01, metavar="HOURS",
        ),
    ] = None  # fmt: skip
    probability: Annotated[
        str, typer.Option(metavar="PCT,PCT", help="With --mtbf-hours: the required probabilities to finish.")
    ] = "95,99"
    samples: Annotated[
        int,
        typer.Option(
            min=1, max=1_000_000, metavar="N", help="With --mtbf-hours: how many times the days are simulated."
        ),
    ] = 300
    dask: DaskOption = None
    jobs: JobsOption = None


def parse_shares(text: str) -> list[float]:
    """Return the percentages of `--probability` as shares.

    Raises:
        SiteError: it is not a list of percentages.
    """
    try:
        shares = [float(part) / 100 for part in text.split(",")]
    except ValueError:
        shares = []
    if not shares or not all(0 < share < 1 for share in shares):
        raise SiteError(f"--probability: expected percentages between 0 and 100 such as 95,99, got '{text}'")
    return shares


def plan_day(
    ground: SiteModel,
    console: TerminalConsole,
    wanted: PlanRequest,
    asked: DayOptions,
    output: Path | None,
    picture: Path | None,
    left: Sequence[int] | None,
    *,
    as_json: bool,
) -> None:
    """Plan the days of a site and report; exit 1 if segments are left over.

    Raises:
        SiteError: the site or an option cannot be used.
        ExecutorError: a process or a worker was lost.
    """
    shares, mtbf_h = parse_shares(asked.probability), asked.mtbf_hours
    with open_campaign_runner(jobs=asked.jobs, dask=asked.dask) as fly:
        content = plan_day_and_report(ground, console, wanted, left)
        spares = _evaluate_spares(content, console, asked, fly, wanted.seed, shares)
    console.show_progress("")
    heights = plan_summary.compute_planned_heights(ground, name_sortie_rounds(content))
    write_named_file(output, lambda path: missions.write_plan(path, content))
    draw_named_file(picture, lambda pictures: pictures.draw_gantt_figure(content))
    lines = [*plan_summary.describe_day(content), *heights.lines, *plan_summary.describe_site_choices(ground)]
    if spares:
        lines.append(f"one failure in {mtbf_h:g} flight hours, re-planned; a lower bound of what can be reached:")
        lines += plan_summary.describe_spares(content, spares, shares)

    def document() -> dict[str, object]:
        return build_day_document(content, spares, shares, mtbf_h) | heights.to_json()

    print_result(document, lines, as_json=as_json, answer_is_no=bool(content.uncovered or content.unreachable))


def plan_day_and_report(
    ground: SiteModel, console: TerminalConsole, wanted: PlanRequest, segments: Sequence[int] | None = None
) -> missions.DayPlanFile:
    """Plan the days of a site, or of some of its segments, and report progress and result.

    Raises:
        SiteError: the site or an option cannot be used, or the plan fails its check.
    """
    content, name = build_day_problem(ground, segments), wanted.objective.value
    what = f"from {len(content.bases)} bases on {len(content.days)} days at most "
    told = announce_planning(console, wanted, (len(content.segments), len(content.vehicles)), name, what)

    def progressed(progress: Progress) -> None:
        told(
            progress if wanted.objective is sorties.Objective.SWAPS else replace(progress, value=progress.value / 3600)
        )

    content = solve_day(content, wanted, list_spares(ground), progressed)
    for line in missions.check_plan(content):
        raise SiteError(f"the day plan is invalid: {line}")
    return add_loss_windows(content, console, wanted.seed)


def add_loss_windows(content: missions.DayPlanFile, console: TerminalConsole, seed: int) -> missions.DayPlanFile:
    """Return a day plan with the time from which each vehicle may be lost, if everything is inspected."""
    if content.uncovered or not content.routes:
        return content

    def told(done: int, of: int) -> None:
        console.show_progress(f"losses checked: {done} of {of}")

    return replace(
        content, windows=sorties.find_loss_windows(content.build_instance(), content.plan, seed=seed, told=told)
    )


def print_loss_windows(content: missions.DayPlanFile, seed: int, *, as_json: bool) -> None:
    """Recompute the time from which each vehicle of days may be lost, and print it."""
    console = TerminalConsole(quiet=as_json, yes=True)
    found = add_loss_windows(replace(content, windows=()), console, seed)
    console.show_progress("")
    lines = list(plan_summary.describe_loss_windows(found))
    print_result(
        lambda: {"windows": missions.build_plan_document(found)["windows"]},
        lines or ["no window: segments are left over, or nothing is flown"],
        as_json=as_json,
    )


def _evaluate_spares(
    content: missions.DayPlanFile,
    console: TerminalConsole,
    asked: DayOptions,
    fly: CampaignRunner,
    seed: int,
    shares: Sequence[float],
) -> list[sorties.SparesEstimate]:
    """Return the result of each number of spares, up to the first that is enough; empty if not requested."""
    if asked.mtbf_hours is None:
        return []
    instance, found = content.build_instance(), list[sorties.SparesEstimate]()
    busy_s = [sum(one.duration_s for one in content.routes_of(name)) for name in content.names]
    order = sorted(range(len(busy_s)), key=lambda row: -busy_s[row])
    for count in range(MOST_SPARES + 1):

        def told(done: int, of: int, count: int = count) -> None:
            console.show_progress(f"{count} spares: {done} of {of} times flown")

        chosen = tuple(order[number % len(order)] for number in range(count))
        campaign = sorties.SurvivalCampaign(sorties.add_spares(instance, chosen), content.plan, asked.mtbf_hours, seed)
        parts = split_flights(asked.samples, 0, per_chunk=sorties.DAYS_PER_CHUNK)
        lives = sorties.summarise_samples(fly(sorties.simulate_days, campaign, parts, told))
        found.append(sorties.SparesEstimate(chosen, lives))
        if lives.finished.estimate >= max(shares):
            break
    return found


def build_day_document(
    content: missions.DayPlanFile, spares: list[sorties.SparesEstimate], shares: list[float], mtbf_h: float | None
) -> dict[str, object]:
    """Return days for `--json`: their plan, and what it requires."""
    document = missions.build_plan_document(content)
    # Names of these fields in day plans before there was one format.
    document |= {"objective": content.cost.name, "sorties": document["routes"]}
    document["needs"] = [asdict(one) for one in plan_summary.compute_base_needs(content)]
    document["left_over"] = [asdict(one) for one in plan_summary.find_left_over(content)]
    if mtbf_h is None:
        return document
    fleet = content.flying
    document["mtbf_h"] = mtbf_h
    document["rule_packs"] = {place.name: plan_summary.compute_rule_packs(content, place) for place in content.bases}
    document["fleets"] = [
        {
            "vehicles": fleet + len(one.spares), "spares": [content.names[row] for row in one.spares],
            "probability": one.lives.finished.estimate, "low_95": one.lives.finished.low,
            "high_95": one.lives.finished.high, "expected_losses": one.lives.losses, "samples": one.lives.samples,
        }
        for one in spares
    ]  # fmt: skip
    enough = [(share, plan_summary.find_enough_spares(spares, share)) for share in shares]
    document["needed"] = [
        {
            "probability": share,
            "vehicles": None if one is None else fleet + len(one.spares),
            "packs": None if one is None else dict(
                zip(content.base_names, one.lives.packs_for_share(share), strict=True)
            ),
        }
        for share, one in enough
    ]  # fmt: skip
    return document
