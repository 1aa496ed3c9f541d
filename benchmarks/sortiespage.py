"""Output of `faultline bench sorties`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.report import Report, Table, list_lines
from benchmarks.sorties import (
    APART_M,
    BAD_PCT,
    LOSSES,
    OWN,
    STANDS,
    VEHICLES,
    SortiesDay,
    SortiesOver,
    sorties_results,
    went_wrong,
)
from benchmarks.store import Json
from benchmarks.virtual_day import AWAY_S

TITLE = "Days of many sorties, flown"
INTRODUCTION = (
    "`{command}`: days planned as `plan --day` plans them and flown by the executor's own runtime in virtual time, the "
    "dialects alternating. {vehicles} vehicles stand at {bases} bases of {network}, with packs of {pack_ah:g} Ah, and "
    "inspect at {speed_m_s:g} m/s; a day has {hours} hours. A crew changes packs and reports it; two packs hold "
    "{poor:g} and {short:g} % although full ones are expected. {losses} vehicles crash at random times, and once the "
    "ground station dies for {away_s:g} s and resumes from its checkpoint. The result is compared with the simulator's "
    "true positions and charges."
)
COLUMNS = ("day", "autopilot", "sorties", "planned", "hours", "inspected", "named", "least charge (%)", "nearest (m)")
HAPPENED = ("day", "crashed", "ground station died after (s)", "packs that held too little")


def sorties_document(days: Sequence[SortiesDay], command: str, seed: int, over: SortiesOver = OWN) -> Json:
    """Return the content of sorties.json."""
    return {
        **head("sorties/1", command),
        "seed": seed,
        "over": {
            "network": None if over.network is None else over.network.name, "pack_ah": over.pack_ah,
            "speed_m_s": over.speed_m_s, "hours": over.hours,
        },
        **sorties_results(days),
        "wrong": [line for one in days for line in went_wrong(one)],
    }  # fmt: skip


def _days(content: Mapping[str, Any]) -> Rows:
    return [
        (
            str(day["number"] + 1), day["autopilot"], str(day["sorties"]), str(day["planned_sorties"]),
            figure(day["flown_s"] / 3600.0), f"{day['inspected']} of {day['segments']}", str(day["named"]),
            figure(day["least_pct"]), figure(day["nearest_m"]),
        )
        for day in content["days"]
    ]  # fmt: skip


def _build_loss_rows(content: Mapping[str, Any]) -> Rows:
    return [
        (
            str(day["number"] + 1), ", ".join(day["losses"]), ", ".join(f"{at_s:.0f}" for at_s in day["died_s"]),
            ", ".join(day["bad_packs"]),
        )
        for day in content["days"]
    ]  # fmt: skip


def _summarize_days(content: Mapping[str, Any]) -> str:
    wrong, days = len(content["wrong"]), content["days"]
    replans, swaps = (sum(day[what] for day in days) for what in ("replans", "swaps"))
    return (
        "The charge is the least at any landing, the distance that of the closest two vehicles in the air. Compared "
        "with the simulator: every counted segment flown end to end by the reported vehicle, no vehicle below the "
        f"reserve at a landing, any two at least {APART_M:g} m apart in the air, every vehicle on its own pad, every "
        f"segment inspected or named. {replans} re-plans, {swaps} packs changed. {wrong or 'Nothing'} went wrong."
    )


def report_sorties(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    over, summary = content["over"], _summarize_days(content)
    about = INTRODUCTION.format(
        command=content["command"], vehicles=VEHICLES, bases=len(STANDS), pack_ah=over["pack_ah"],
        speed_m_s=over["speed_m_s"], hours=over["hours"], network=over["network"] or "faultline's own network",
        poor=BAD_PCT[0], short=BAD_PCT[1], losses=LOSSES, away_s=AWAY_S,
    )  # fmt: skip
    parts = (
        machine_line(content["machine"]),
        about,
        summary,
        Table(COLUMNS, _days(content), TITLE),
        Table(HAPPENED, _build_loss_rows(content), "What happened"),
        *list_lines("## What went wrong", content["wrong"]),
    )
    return Report("sorties", TITLE, content, parts, (summary, *content["wrong"]))
