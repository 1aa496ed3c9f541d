"""Output of `faultline bench prediction`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.band import (
    CAPACITY_SD,
    CONSUMPTION_SD,
    MARGIN_PCT,
    MOST_SD,
    SEGMENTS,
    SLOWER,
    WIND_SD_M_S,
    BandFlight,
    band_held,
)
from benchmarks.machine import head, machine, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.prediction import Flown, FlownRoute, phases, prediction_errors
from benchmarks.report import Report, Table
from benchmarks.store import Json

TITLE = "Planned and flown"
INTRODUCTION = (
    "`{command}`: {routes} routes of 5 to 40 segments over {networks}, flown by the executor against simulated "
    "vehicles in virtual time; half of the flights in a wind of 1 to 6 m/s, half of those over a network that knows "
    "its heights over made-up hills of 10 to 60 m. Time is from arming to disarming, energy is the true discharge of "
    "the simulated battery. Planned is the estimate of every leg of the mission on board. An error is the size of "
    "flown / planned - 1. The planner's own figures, which plan files hold, are shown next to it."
)
VARIED = (
    "`{command}`: {routes} more routes, of {segments} segments, with vehicles that differ from their data, each drawn "
    "at random from the seed: the consumption is normal about the energy model's figure with {consumption:g} % (cut "
    "off at {most:g} standard deviations), the pack's capacity about the data sheet's with {capacity:g} %; it flies up "
    "to {slower:g} % slower than commanded, uniformly; each component of the wind is normal about the site's figure "
    "with {wind:g} m/s, and the site says 0 to 6 m/s; it starts with 90 to 100 % and reports whole percents, rounded "
    "by PX4 and cut off by ArduPilot. The band is the one shown with the landing percentage, which should hold in nine "
    "flights of ten; it is compared with the true charge of the simulated battery when the motors stop. Each tenth of "
    "the route is judged at the first end of a leg in it."
)
SAYINGS = (
    "The reserve lies {low:g} to {high:g} points below the landing percentage that the plan promises, uniformly. "
    "Counted are the messages of the ground station at any time of a flight: its warning, and the reason that would be "
    "a fault; in this measurement no vehicle acts on them."
)
RECORDED = "`{command}`: whole routes of recorded flights, as their reports have them."
WORST = 10
"""Number of routes listed as having the largest errors."""


def prediction_document(
    routes: Sequence[FlownRoute], command: str, *, seed: int | None = None, flights: Sequence[Flown] = (),
    networks: Sequence[str] = (), varied: Sequence[BandFlight] = (),
) -> Json:  # fmt: skip
    """Return the content of prediction.json."""
    flown_s, took_s = sum(one.flown_s for one in flights), sum(one.took_s for one in flights)
    return {
        **head("prediction/1", command),
        "seed": seed,
        "networks": list(networks),
        **prediction_errors(routes),
        "by_autopilot": {
            name: prediction_errors([one for one in routes if one.autopilot == name])
            for name in sorted({one.autopilot for one in routes} - {""})
        },
        "phases": phases(routes),
        "not_nominal": [one.wrong for one in flights if one.wrong],
        "flown_s": round(flown_s, 1),
        "flown_s_per_s": round(flown_s / took_s, 1) if took_s else None,
        "rows": [_row(one) for one in routes],
        "band": {"machine": machine(), "command": command, **band_held(varied)} if varied else None,
    }


def _row(route: FlownRoute) -> Json:
    figures = route.figures
    energy = figures.energy_error_pct
    return {
        "flight": route.flight,
        "vehicle": route.vehicle,
        "autopilot": route.autopilot or None,
        "segments": route.segments,
        "relief_m": None if route.relief_m is None else round(route.relief_m, 1),
        "wind_m_s": None if route.wind_m_s is None else round(route.wind_m_s, 1),
        "planned_s": round(figures.planned_s, 1),
        "flown_s": round(figures.flown_s, 1),
        "planned_pct": round(figures.planned_pct, 2),
        "flown_pct": None if figures.flown_pct is None else round(figures.flown_pct, 2),
        "time_error_pct": round(figures.time_error_pct, 2),
        "energy_error_pct": None if energy is None else round(energy, 2),
    }


def keep_prediction(content: Mapping[str, Any], folder: Path) -> None:
    """Write prediction.json and prediction.md, merged with another run's measurements."""
    path = folder / "prediction.json"
    if path.exists():
        content = join_content(json.loads(path.read_text(encoding="utf-8")), content)
    report_prediction(content).keep(folder)


def join_content(before: Mapping[str, Any], content: Mapping[str, Any]) -> Json:
    """Return a page's content, with measurements of another run that this one lacks."""
    if content["routes"] == 0 and before["routes"]:
        return {**before, "band": content["band"]}
    return {**content, "band": content["band"] or before.get("band")}


def report_prediction(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    parts = (*(_nominal(content) if content["routes"] else ()), *_band(content["band"]))
    wrong = content["not_nominal"] if content["routes"] else ()
    return Report("prediction", TITLE, content, parts, tuple(f"not nominal, not counted: {one}" for one in wrong))


def _nominal(content: Mapping[str, Any]) -> tuple[str | Table, ...]:
    recorded = content["seed"] is None
    said = RECORDED if recorded else INTRODUCTION
    wrong = content["not_nominal"]
    return (
        machine_line(content["machine"]),
        said.format(command=content["command"], routes=content["routes"], networks=", ".join(content["networks"])),
        Table(ERRORS, _errors(content), f"{TITLE}: {content['routes']} routes"),
        "## By purpose of a leg",
        "Sums over all routes, as the ground station observed legs begin and end; battery as reported.",
        Table(PHASES, _phases(content), "By purpose of a leg"),
        "## The largest errors",
        Table(ROUTES, _worst(content), "The largest errors"),
        f"**{len(wrong)} flights were not nominal, and are not counted: {'; '.join(wrong)}.**" if wrong else "",
        "" if recorded else f"{figure(content['flown_s'] / 3600)} hours were flown, {content['flown_s_per_s']} s of "
        "flight in a second of each process.",
    )  # fmt: skip


def _band(band: Mapping[str, Any] | None) -> tuple[str | Table, ...]:
    if band is None:
        return ()
    wrong = band["not_counted"]
    return (
        "## Whether the band of the landing percentage holds",
        machine_line(band["machine"]),
        VARIED.format(
            command=band["command"], routes=band["routes"], segments=f"{SEGMENTS[0]} to {SEGMENTS[1]}",
            consumption=100 * CONSUMPTION_SD, capacity=100 * CAPACITY_SD, most=MOST_SD, slower=100 * SLOWER,
            wind=WIND_SD_M_S,
        ),
        Table(TENTHS, _tenths(band), "Whether the band of the landing percentage holds"),
        '## "Below its reserve"',
        SAYINGS.format(low=MARGIN_PCT[0], high=MARGIN_PCT[1]),
        Table(SAID, _build_band_rows(band), '"Below its reserve"'),
        f"{len(wrong)} flights did not end as planned, and are not counted: {'; '.join(wrong)}." if wrong else "",
    )  # fmt: skip


ERRORS = ("error of", "median (%)", "largest (%)", "median with its sign (%)")
PHASES = ("legs", "planned (s)", "flown (s)", "time error (%)", "energy error (%)")
TENTHS = ("of the route flown", "routes", "band held (%)", "band, median (+- points)", "off, median (points)",
          "off with its sign, median (points)")  # fmt: skip
SAID = ("flights that landed", "flights", "warned", "would be a fault", "warned (%)", "fault (%)")
ROUTES = ("route", "segments", "hills (m)", "wind (m/s)", "planned (s)", "flown (s)", "error (%)", "planned (%)",
          "flown (%)", "error (%)")  # fmt: skip


def _errors(content: Mapping[str, Any]) -> Rows:
    parts = {"": content, **{f", {name}": part for name, part in content["by_autopilot"].items()}}
    if content["plan_file"] is not None:
        parts[", by the planner's own figures"] = content["plan_file"]
    rows: Rows = []
    for what, key in (("time", "time_error_pct"), ("energy", "energy_error_pct")):
        for name, part in parts.items():
            found = part[key] or {}
            rows.append((what + name, *(figure(found.get(word), 2) for word in ("median", "max", "median_signed"))))
    return rows


def _phases(content: Mapping[str, Any]) -> Rows:
    return [
        (
            phase, figure(row["planned_s"], 0), figure(row["flown_s"], 0), figure(row["time_error_pct"], 2),
            figure(row["energy_error_pct"], 2),
        )
        for phase, row in content["phases"].items()
    ]  # fmt: skip


def _tenths(band: Mapping[str, Any]) -> Rows:
    return [
        (
            f"{row['tenth']}/10", str(row["routes"]), figure(None if row["held"] is None else 100 * row["held"]),
            figure(row["band_pct"], 2), figure(row["error_pct"], 2), figure(row["bias_pct"], 2),
        )
        for row in band["tenths"]
    ]  # fmt: skip


def _build_band_rows(band: Mapping[str, Any]) -> Rows:
    rows: Rows = []
    for name, part in (("above their reserve", band["above"]), ("below it", band["below"])):
        counts = (part["warned"], part["faults"])
        shares = (figure(100 * count / part["routes"]) if part["routes"] else "" for count in counts)
        rows.append((name, str(part["routes"]), *map(str, counts), *shares))
    return rows


def _worst(content: Mapping[str, Any]) -> Rows:
    def size(row: Mapping[str, Any]) -> float:
        return max(abs(float(row[key] or 0.0)) for key in ("time_error_pct", "energy_error_pct"))

    return [
        (
            " ".join(filter(None, (row["flight"], row["vehicle"], row["autopilot"]))), str(row["segments"]),
            figure(row["relief_m"], 0), figure(row["wind_m_s"]), figure(row["planned_s"], 0), figure(row["flown_s"], 0),
            figure(row["time_error_pct"], 2), figure(row["planned_pct"]), figure(row["flown_pct"]),
            figure(row["energy_error_pct"], 2),
        )
        for row in sorted(content["rows"], key=size, reverse=True)[:WORST]
    ]  # fmt: skip
