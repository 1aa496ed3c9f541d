"""The commands `faultline bench prediction`, `window` and `distance`: whole flights in virtual time."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from benchmarks.options import AutopilotsOption, make_output_option
from executor.cli.options import (
    FIRST_AUTOPILOT,
    AutopilotName,
    AutopilotOption,
    JsonOption,
    NetworkOption,
    SecondsOption,
    SeedOption,
)
from missions.files import json_text

if TYPE_CHECKING:
    from benchmarks.report import Report
    from benchmarks.store import Json

C = TypeVar("C")
F = TypeVar("F")
USUAL_RADIUS_M = 700.0
TIGHTNESS = 0.85
RadiiOption = Annotated[
    list[float] | None,
    typer.Option(
        min=1,
        metavar="M",
        help="Only segments within M metres of the depot; by default 700. Each radius makes one plan.",
    ),
]
SharesOption = Annotated[
    list[float] | None,
    typer.Option(
        min=0.01,
        max=1,
        metavar="SHARE",
        help="Share of the budget that the most expensive route of the best MinMax plan uses; by default 0.85. With "
        "several, plans use them in turn.",
    ),
]
JobsOption = Annotated[int | None, typer.Option(min=1, help="Processes; by default one per processor.")]


def prediction(
    autopilot: AutopilotsOption = None,
    routes: Annotated[int, typer.Option(min=0, help="Random routes, in flights of 1 to 4 vehicles.")] = 100,
    varied: Annotated[
        int,
        typer.Option(
            min=0,
            help="More random routes, with vehicles that differ from their models: how often the predicted band held.",
        ),
    ] = 0,
    seed: SeedOption = 1,
    network: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="A network in addition to faultline's own; may be repeated."),
    ] = None,
    run: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="Measure the recorded flight of a run directory instead; may be repeated."),
    ] = None,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("prediction.md and prediction.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure how well time and energy of routes are predicted: planned against flown.

    Random routes of 5 to 40 segments, in wind and over hills, are flown nominally by the executor against simulated
    vehicles in virtual time. The same seed gives the same figures for any number of processes. Results that a run does
    not measure, with 0 routes, stay in the files of `--out`. Exit 1 if a flight was not nominal: its routes are not
    counted.
    """
    from benchmarks.band import band_cases, fly_band
    from benchmarks.prediction import cases, fly_case, read_recorded_routes
    from benchmarks.predictionpage import keep_prediction, prediction_document, report_prediction

    if run:
        command = shlex.join(["faultline", "bench", "prediction", *(f"--run={one.name}" for one in run)])
        content = prediction_document(read_recorded_routes(run), command)
    else:
        autopilots, asked = _select_autopilots(autopilot)
        flown = _flown(fly_case, cases(routes, seed, autopilots, [None, *(network or ())]), jobs)
        beside = _flown(fly_band, band_cases(varied, seed, autopilots), jobs, "varied flights")
        asked += [part for one in network or () for part in ("--network", one.name)]
        command = shlex.join([
            "faultline", "bench", "prediction", *asked, "--routes", str(routes),
            *(["--varied", str(varied)] if varied else []), "--seed", str(seed),
        ])  # fmt: skip
        names = ["faultline's own network", *(one.name for one in network or ())]
        found = [route for flight in flown for route in flight.routes]
        content = prediction_document(found, command, seed=seed, flights=flown, networks=names, varied=beside)
    if out is not None:
        keep_prediction(content, out)
    finish_command(content, report_prediction, None, as_json=as_json, failed=bool(content["not_nominal"]))


def window(
    network: NetworkOption = None,
    radius: RadiiOption = None,
    losses: Annotated[int, typer.Option(min=0, help="Losses after the claimed times, each a flight.")] = 50,
    before: Annotated[
        int, typer.Option(min=0, help="Losses before the claimed times: segments left over must be named.")
    ] = 0,
    seed: SeedOption = 1,
    autopilot: AutopilotOption = FIRST_AUTOPILOT,
    vehicles: Annotated[int, typer.Option(min=2, max=50, help="Number of vehicles.")] = 4,
    tightness: SharesOption = None,
    budget: Annotated[
        float, typer.Option(min=1, max=100, metavar="PCT", help="Budget of each vehicle, in percent of a full battery.")
    ] = 28.0,
    seconds: SecondsOption = 20.0,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("window.md and window.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Lose vehicles after the claimed time of a plan's re-plan window, and fly each loss to its end in virtual time.

    A flight keeps the claim if every segment was inspected and every other vehicle stands on its pad above its reserve.
    Exit 1 if a flight does not, or if a segment that is left over after a loss before the claimed time is not named.
    """
    from benchmarks.machine import cores
    from benchmarks.progress import ShownProgress
    from benchmarks.window import WindowSettings, results, try_plans
    from benchmarks.windowpage import report_window, window_document

    count, radius, tightness = jobs or cores(), radius or [USUAL_RADIUS_M], tightness or [TIGHTNESS]
    plans = [
        WindowSettings(
            network,
            within_m,
            autopilot.value,
            vehicles,
            tightness[number % len(tightness)],
            budget,
            seconds,
            seed,
            count,
        )
        for number, within_m in enumerate(radius)
    ]
    with ShownProgress() as shown:
        trials = try_plans(plans, losses, before, count, partial(shown.show_stage, "plans"))
    command = shlex.join([
        "faultline", "bench", "window", *([] if network is None else ["--network", network.name]),
        *_repeat_option("--radius", radius), "--losses", str(losses), "--before", str(before), "--seed", str(seed),
        "--autopilot", autopilot.value, "--vehicles", str(vehicles), *_repeat_option("--tightness", tightness),
        "--budget", f"{budget:g}",
    ])  # fmt: skip
    content = window_document(plans[0], command, results(trials))
    kept = content["finished_after"] == content["losses_after"] and content["unnamed_before"] == 0
    finish_command(content, report_window, out, as_json=as_json, failed=not kept)


def distance(
    flights: Annotated[int, typer.Option(min=1, help="Flights of 3 to 8 vehicles.")] = 100,
    seed: SeedOption = 1,
    uses: Annotated[
        float,
        typer.Option(min=5, max=60, help="Percent of a battery that the most expensive route uses; the budget is 75."),
    ] = 45.0,
    autopilot: AutopilotsOption = None,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("distance.md and distance.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly fleets at the requested distance with faults, and measure their true inspection distance and separation.

    The site sets `same_distance`; vehicles are late, crash, lose their link and are flown home by pilots, in virtual
    time. The same seed gives the same figures for any number of processes. Exit 1 if two vehicles came closer than
    promised, if a segment was inspected at a different distance from the stated one, or if a flight could not be flown.
    """
    from benchmarks.distance import USES_PCT, fly_distance
    from benchmarks.distancepage import distance_document, report_distance
    from benchmarks.parallel_flights import make_flight_cases

    autopilots, asked = _select_autopilots(autopilot)
    flown = _flown(partial(fly_distance, uses_pct=uses), make_flight_cases(flights, seed, autopilots), jobs)
    used = [] if uses == USES_PCT else ["--uses", f"{uses:g}"]
    command = shlex.join([
        "faultline", "bench", "distance", *asked, "--flights", str(flights), "--seed", str(seed), *used
    ])  # fmt: skip
    content = distance_document(flown, command, seed, uses)
    failed = content["too_near"] or content["off"] or content["not_flown"]
    finish_command(content, report_distance, out, as_json=as_json, failed=bool(failed))


def pictures(
    flights: Annotated[int, typer.Option(min=1, help="Flights of 2 to 4 vehicles.")] = 20,
    seed: SeedOption = 1,
    autopilot: AutopilotsOption = None,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("pictures.md and pictures.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly fleets with cameras through faults and lost datagrams; compare index and cards with the pictures taken.

    Simulated cameras with wrong clocks write JPEGs, which `faultline images` then matches. A flight takes about ten
    seconds of a core. The same seed gives the same figures for any number of processes. Exit 1 if an asset is wrongly
    reported as seen, if an unseen one is not named, if a picture is duplicated, or if a file is matched to the wrong
    picture.
    """
    from benchmarks.parallel_flights import make_flight_cases
    from benchmarks.pictures import fly_pictures
    from benchmarks.picturespage import pictures_document, report_pictures

    autopilots, asked = _select_autopilots(autopilot)
    flown = _flown(fly_pictures, make_flight_cases(flights, seed, autopilots), jobs)
    command = shlex.join(["faultline", "bench", "pictures", *asked, "--flights", str(flights), "--seed", str(seed)])
    content = pictures_document(flown, command, seed)
    failed = content["wrong"] or content["not_flown"]
    finish_command(content, report_pictures, out, as_json=as_json, failed=bool(failed))


def sorties(
    days: Annotated[int, typer.Option(min=1, help="Days of six vehicles from four bases.")] = 2,
    radius: Annotated[
        float | None,
        typer.Option(
            min=1.0, metavar="M", help="Only segments within M metres of the network's centre; by default all."
        ),
    ] = None,
    network: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            dir_okay=False,
            metavar="FILE",
            help="Another network: eight hours from the four places with the most segments within 5 km, packs for "
            "about 50 minutes.",
        ),
    ] = None,
    seed: SeedOption = 1,
    iterations: Annotated[int, typer.Option(min=1, help="Iterations of the search for each day's plan.")] = 20_000,
    autopilot: AutopilotsOption = None,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("sorties.md and sorties.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly days of about fifty sorties with losses, bad packs and a ground station that dies; judge by ground truth.

    Each day is planned as `plan --day` does and flown in virtual time: a crew changes packs at four bases, three
    vehicles crash, the ground station is killed once. A day takes about two minutes of a core. The same seed gives the
    same figures for any number of processes. Exit 1 if a counted segment was not flown, if a vehicle landed below its
    reserve or off its pad, if two vehicles came too close, or if a day did not finish.
    """
    from benchmarks.sorties import SortiesCase, fly_sorties, sorties_over
    from benchmarks.sortiespage import report_sorties, sorties_document

    autopilots, asked = _select_autopilots(autopilot)
    over = sorties_over(network, radius)
    cases = [
        SortiesCase(number, seed, autopilots[number % len(autopilots)], iterations, over) for number in range(days)
    ]
    flown = _flown(fly_sorties, cases, jobs, "days")
    asked += [] if radius is None else _repeat_option("--radius", [radius])
    asked += [] if network is None else ["--network", network.name]
    figures = ["--days", str(days), "--seed", str(seed), "--iterations", str(iterations)]
    content = sorties_document(flown, shlex.join(["faultline", "bench", "sorties", *asked, *figures]), seed, over)
    finish_command(content, report_sorties, out, as_json=as_json, failed=bool(content["wrong"]))


def radio(
    radio: Annotated[
        list[str] | None,
        typer.Option(
            "--radio",
            "--profile",
            metavar="PROFILE",
            help="A profile of `simulate --radio`; may be repeated. By default six of them.",
        ),
    ] = None,
    vehicles: Annotated[
        list[int] | None, typer.Option(min=2, max=8, help="Vehicles behind the radio; may be repeated. By default 4.")
    ] = None,
    flights: Annotated[int, typer.Option(min=1, help="Flights of each kind, each with the next seed.")] = 1,
    seed: SeedOption = 1,
    autopilot: AutopilotsOption = None,
    signed: Annotated[bool, typer.Option("--signed", help="Fly each also with signed frames.")] = False,
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Keep each result there as soon as it is flown, and fly only what is not there yet: a campaign that "
            "can be interrupted.",
        ),
    ] = None,
    jobs: JobsOption = None,
    out: Annotated[Path | None, make_output_option("radio.md and radio.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a fleet behind one telemetry radio and lose a vehicle: when are missions and re-plans on board?

    The radio is emulated, and flights are in virtual time; a flight takes about half a minute of a core. The same seed
    gives the same figures for any number of processes. Exit 1 if a healthy vehicle was declared lost, if a proof broke,
    if not everything was inspected, or if a flight could not be flown.
    """
    from benchmarks.radio import (
        RADIOS,
        fly_and_keep,
        fly_over_radio,
        make_radio_cases,
        radio_document,
        report_radio,
    )

    autopilots, asked = _select_autopilots(autopilot)
    signs = [False, True] if signed else [False]
    cases = make_radio_cases(radio or RADIOS, vehicles or [4], autopilots, flights, seed, signs)
    flown = _flown(fly_over_radio if into is None else partial(fly_and_keep, folder=into), cases, jobs)
    asked += [part for one in radio or () for part in ("--radio", one)]
    asked += ["--signed"] if signed else []
    asked += [part for one in vehicles or [4] for part in ("--vehicles", str(one))]
    figures = ["--flights", str(flights), "--seed", str(seed)]
    content = radio_document(flown, shlex.join(["faultline", "bench", "radio", *asked, *figures]), seed)
    finish_command(content, report_radio, out, as_json=as_json, failed=bool(content["wrong"]))


def _select_autopilots(autopilot: AutopilotName | None) -> tuple[list[str], list[str]]:
    """Return the selected autopilots, and the option that selects them."""
    if autopilot is None:
        return [one.value for one in AutopilotName], []
    return [autopilot.value], ["--autopilot", autopilot.value]


def _flown(fly: Callable[[C], F], cases: Sequence[C], jobs: int | None, stage: str = "flights") -> list[F]:
    """Fly all cases, and show progress; the results do not depend on the number of processes."""
    from benchmarks.machine import cores
    from benchmarks.parallel_flights import map_in_processes
    from benchmarks.progress import ShownProgress

    with ShownProgress() as shown:
        return map_in_processes(fly, cases, jobs=jobs or cores(), told=partial(shown.show_stage, stage))


def finish_command(
    content: Json, report: Callable[[Json], Report], out: Path | None, *, as_json: bool, failed: bool
) -> None:
    """Keep and show the measurement, and exit.

    Raises:
        typer.Exit: always; with 1 if it failed.
    """
    if out is not None:
        report(content).keep(out)
    if as_json:
        print(json_text(content))
    else:
        report(content).show()
    raise typer.Exit(1 if failed else 0)


def _repeat_option(option: str, values: Sequence[float]) -> list[str]:
    return [part for value in values for part in (option, f"{value:g}")]
