"""`faultline plan --day`: the working days of a site, planned, drawn and kept; vehicles and packs that they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.console import TerminalConsole
from executor.cli.options import require_finite
from executor.cli.plan_inputs import announce_planning, write_named_file
from executor.errors import SiteError
from executor.site.campaign_runner import CampaignRunner
from executor.site.day_flight import name_sortie_rounds
from executor.site.day_problem import build_day_problem, list_spares, solve_day
from executor.site.day_summary import (
    compute_base_needs,
    compute_rule_packs,
    describe_day,
    describe_loss_windows,
    describe_spares,
    find_enough_spares,
)
from executor.site.plan_summary import find_left_over
from executor.site.planned_heights import compute_planned_heights
from executor.site.site_model import SiteModel
from executor.site.site_planning import PlanRequest
from missions import DayPlanFile, build_plan_document, check_day_plan, write_plan
from missions.files import json_text
from planner import Progress, split_flights
from planner.sorties import (
    DAYS_PER_CHUNK,
    Objective,
    SparesEstimate,
    SurvivalCampaign,
    add_spares,
    find_loss_windows,
    simulate_days,
    summarise_samples,
)

DAY_SECONDS = 20.0
"""Of a day's search where nobody said how long."""
MOST_SPARES = 5
DayOption = Annotated[
    bool,
    typer.Option(
        "--day", help="Plan working days of many sorties from the bases of the site; -o is then a day plan file."
    ),
]
ObjectiveOption = Annotated[
    Objective, typer.Option(help="Day plan objective: earliest finish, least flight time or fewest sorties.")
]
MtbfOption = Annotated[
    float | None,
    typer.Option(
        "--mtbf-hours", min=0.01, callback=require_finite, metavar="HOURS",
        help="With --day: mean flight hours between failures of one vehicle; says how many vehicles and packs it takes",
    ),
]  # fmt: skip
ProbabilityOption = Annotated[
    str,
    typer.Option(
        "--probability", metavar="PCT,PCT", help="With --mtbf-hours: the chances to finish that are asked for."
    ),
]
SamplesOption = Annotated[
    int, typer.Option(min=1, max=1_000_000, metavar="N", help="With --mtbf-hours: how many times the days are flown.")
]


@dataclass(frozen=True, slots=True)
class SurvivalOptions:
    """What is asked of days in which vehicles are lost."""

    mtbf_h: float | None
    probability: str
    samples: int
    fly: CampaignRunner


def parse_shares(text: str) -> list[float]:
    """Return the chances of `--probability` as shares.

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
    survival: SurvivalOptions,
    output: Path | None,
    picture: Path | None,
    left: Sequence[int] | None,
    *,
    as_json: bool,
) -> None:
    """Plan the days of a site and tell; exit 1 if segments are left over.

    Raises:
        SiteError: the site or an option cannot be used.
        ExecutorError: a process or a worker was lost.
    """
    shares, mtbf_h = parse_shares(survival.probability), survival.mtbf_h
    content = plan_day_and_report(ground, console, wanted, left)
    spares = _evaluate_spares(content, console, survival, wanted.seed, shares)
    console.show_progress("")
    heights = compute_planned_heights(ground, name_sortie_rounds(content))
    if output is not None:
        write_named_file(output, lambda: write_plan(output, content))
    if picture is not None:
        from executor.analysis.pictures import draw_gantt_figure, save_figure

        write_named_file(picture, lambda: save_figure(draw_gantt_figure(content), picture))
    if as_json:
        document = build_plan_document(content)
        # What plans of days called these before there was one format.
        document |= {"objective": content.objective.value, "sorties": document["routes"]}
        more = build_day_document(content, spares, shares, mtbf_h)
        print(json_text({**document, **more, **heights.to_json()}))
    else:
        for line in (*describe_day(content), *heights.lines):
            print(line)
        if spares:
            print(f"one failure in {mtbf_h:g} flight hours, re-planned; a lower bound of what can be reached:")
            for line in describe_spares(content, spares, shares):
                print(line)
    if content.plan.uncovered or content.unreachable:
        raise typer.Exit(1)


def plan_day_and_report(
    ground: SiteModel, console: TerminalConsole, wanted: PlanRequest, segments: Sequence[int] | None = None
) -> DayPlanFile:
    """Plan the days of a site, or of some of its segments, and say how it goes.

    Raises:
        SiteError: the site or an option cannot be used, or the plan does not hold what it must.
    """
    content, name = build_day_problem(ground, segments), wanted.objective.value
    what = f"from {len(content.bases)} bases on {len(content.days)} days at most "
    told = announce_planning(console, (len(content.segments), len(content.vehicles)), name, name, wanted.length, what)

    def progressed(progress: Progress) -> None:
        told(progress if wanted.objective is Objective.SWAPS else replace(progress, value=progress.value / 3600))

    content = solve_day(content, wanted, list_spares(ground), progressed)
    for line in check_day_plan(content):
        raise SiteError(f"the day plan is invalid: {line}")
    return add_loss_windows(content, console, wanted.seed)


def add_loss_windows(content: DayPlanFile, console: TerminalConsole, seed: int) -> DayPlanFile:
    """Return a day plan with the time from which on each vehicle may be lost, where everything is inspected."""
    if content.plan.uncovered or not content.evaluation.count:
        return content

    def told(done: int, of: int) -> None:
        console.show_progress(f"losses checked: {done} of {of}")

    return replace(content, windows=find_loss_windows(content.build_instance(), content.plan, seed=seed, told=told))


def print_loss_windows(content: DayPlanFile, seed: int, *, as_json: bool) -> None:
    """Search anew for the time from which on each vehicle of days may be lost, and print it."""
    console = TerminalConsole(quiet=as_json, yes=True)
    found = add_loss_windows(replace(content, windows=()), console, seed)
    console.show_progress("")
    if as_json:
        print(json_text({"windows": build_plan_document(found)["windows"]}))
        return
    for line in list(describe_loss_windows(found)) or ["no window: segments are left over, or nothing is flown"]:
        print(line)


def _evaluate_spares(
    content: DayPlanFile, console: TerminalConsole, asked: SurvivalOptions, seed: int, shares: Sequence[float]
) -> list[SparesEstimate]:
    """Return what each number of spares comes to, up to the first that is enough; none where nobody asked for it."""
    if asked.mtbf_h is None:
        return []
    instance, found = content.build_instance(), list[SparesEstimate]()
    busy_s = [sum(own) for own in content.evaluation.lasts_s]
    order = sorted(range(len(busy_s)), key=lambda row: -busy_s[row])
    for count in range(MOST_SPARES + 1):

        def told(done: int, of: int, count: int = count) -> None:
            console.show_progress(f"{count} spares: {done} of {of} times flown")

        chosen = tuple(order[number % len(order)] for number in range(count))
        campaign = SurvivalCampaign(add_spares(instance, chosen), content.plan, asked.mtbf_h, seed)
        parts = split_flights(asked.samples, 0, per_chunk=DAYS_PER_CHUNK)
        lives = summarise_samples(asked.fly(simulate_days, campaign, parts, told))
        found.append(SparesEstimate(chosen, lives))
        if lives.finished.estimate >= max(shares):
            break
    return found


def build_day_document(
    content: DayPlanFile, spares: list[SparesEstimate], shares: list[float], mtbf_h: float | None
) -> dict[str, object]:
    """Return what `--json` says beside the day plan itself."""
    document: dict[str, object] = {
        "needs": [asdict(one) for one in compute_base_needs(content)],
        "left_over": [asdict(one) for one in find_left_over(content)],
    }
    if mtbf_h is None:
        return document
    fleet = sum(1 for own in content.plan.sorties if own)
    document["mtbf_h"] = mtbf_h
    document["rule_packs"] = {
        place.name: compute_rule_packs(content, number) for number, place in enumerate(content.bases)
    }
    document["fleets"] = [
        {
            "vehicles": fleet + len(one.spares), "spares": [content.vehicles[row].name for row in one.spares],
            "probability": one.lives.finished.estimate, "low_95": one.lives.finished.low,
            "high_95": one.lives.finished.high, "expected_losses": one.lives.losses, "samples": one.lives.samples,
        }
        for one in spares
    ]  # fmt: skip
    enough = [(share, find_enough_spares(spares, share)) for share in shares]
    document["needed"] = [
        {
            "probability": share,
            "vehicles": None if one is None else fleet + len(one.spares),
            "packs": None if one is None else dict(
                zip((place.name for place in content.bases), one.lives.packs_for_share(share), strict=True)
            ),
        }
        for share, one in enough
    ]  # fmt: skip
    return document
