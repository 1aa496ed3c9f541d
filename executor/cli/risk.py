"""The command that estimates the chance of finishing: risk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.console import TerminalConsole
from executor.cli.options import DaskOption, JobsOption, JsonOption, PlanArgument, SeedOption, number_option
from executor.cli.plan_inputs import check_can_draw, write_named_file
from executor.site.campaigns import compute_campaign_risks, describe_policy, open_campaign_runner, sweep_mtbf
from missions import read_plan
from missions.files import json_text
from planner import RiskCampaign, RiskEstimate, build_risk_campaign, split_flights

MtbfOption = Annotated[
    float, number_option("Mean flight hours between failures of one vehicle.", 0.01, metavar="HOURS")
]
SpreadOption = Annotated[
    float,
    number_option(
        "Standard deviation of a vehicle's true consumption, in percent of the planned; re-plans count with the "
        "planned one.", 0, 50, metavar="PCT",
    ),
]  # fmt: skip
ReserveOption = Annotated[
    float,
    number_option(
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


def risk(
    plan: PlanArgument,
    mtbf: MtbfOption,
    battery_spread: SpreadOption = 0.0,
    reserve: ReserveOption = 15.0,
    samples: SamplesOption = 100_000,
    seed: SeedOption = 1,
    max_losses: LossesOption = 2,
    dask: DaskOption = None,
    jobs: JobsOption = None,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Estimate the probability of a complete inspection, as planned and with re-plans after losses.

    A vehicle in the air fails at random, once in HOURS flight hours on average, or when its battery is used up. The
    others take over what a lost vehicle has not finished, where a re-plan is found that inspects everything; without
    one it is left over. The same seed gives the same answer for any number of processes.
    """
    check_can_draw("--picture", picture)
    content = read_plan(plan)
    names = [vehicle.name for vehicle in content.vehicles]
    console = TerminalConsole(quiet=as_json, yes=True)
    swept: tuple[RiskEstimate, ...] = ()

    def done(flown: int, total: int) -> None:
        console.show_progress(f"{flown} of {total} flights")

    with open_campaign_runner(jobs=jobs, dask=dask) as fly:
        console.show_progress("checking each first loss")
        wanted = build_risk_campaign(
            content.build_instance(), content.plan, mtbf_h=(mtbf,), battery_spread_pct=battery_spread,
            reserve_pct=reserve,
            max_losses=max_losses, fly_again=content.fly_again,
        )  # fmt: skip
        (found,) = compute_campaign_risks(fly, wanted, split_flights(samples, seed), done)
        if picture is not None:
            swept = compute_campaign_risks(fly, *sweep_mtbf(wanted, seed, flights=samples), done)
    console.show_progress("")
    if picture is not None:
        from executor.analysis.pictures import draw_risk_figure, save_figure

        write_named_file(picture, lambda: save_figure(draw_risk_figure(swept, found), picture))
    if as_json:
        print(json_text(build_risk_document(wanted, found, names, seed)))
    else:
        _print_risk(found, names)


def build_risk_document(flown: RiskCampaign, found: RiskEstimate, names: Sequence[str], seed: int) -> dict[str, object]:
    """Return an answer as JSON has it."""
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


def _print_risk(found: RiskEstimate, names: Sequence[str]) -> None:
    print(f"everything inspected, {found.flights} flights, one failure in {found.mtbf_h:g} flight hours:")
    for replans, (chance, undone_m) in enumerate(zip(found.finished, found.undone_m, strict=True)):
        print(
            f"  {describe_policy(replans):<32}{100 * chance.estimate:7.2f} %  (95 %: {100 * chance.low:.2f} to "
            f"{100 * chance.high:.2f} %), {undone_m:.1f} m left on average"
        )
    none, one, more = (100 * share for share in found.losses_share)
    print(
        f"losses: {found.expected_losses:.3f} a flight; none in {none:.2f} % of the flights, one in {one:.2f} %, "
        f"more in {more:.2f} %"
    )
    if found.worst is None:
        print("every flight finished")
        return
    worst = found.worst
    shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in zip(names, found.blame_share, strict=True))
    print(f"losses without a re-plan: {shares}")
    print(
        f"most of them: {names[worst.vehicle]} between {worst.from_s:.0f} and {worst.to_s:.0f} s "
        f"({100 * worst.share:.0f} %)"
    )
