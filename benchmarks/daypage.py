"""Output of `faultline bench day`, as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.machine import head, machine_line
from benchmarks.markdown import figure
from benchmarks.report import Report, Table
from benchmarks.store import Json

TITLE = "Days of many sorties"
EXACT = (
    "## Against proven optima\n\nRandom lines of 8 segments, 2 bases, 2 vehicles that may land at either base or be "
    "driven; the energy of a sortie covers only part of the line. HiGHS proves the earliest last landing, and for it "
    "the least time in the air; the search has 100,000 iterations. Of {count} instances {same} are the same; {without} "
    "have no plan that inspects everything, and both report this."
)
NETWORK = (
    "## The paper's network\n\nAll {segments} segments ({length_km:.0f} km of line) from {bases} bases with {vehicles} "
    "vehicles in days of {hours:g} hours, at 3 m/s along the line. The network is 130 km wide: the vehicles have a "
    "generator, with energy for about ten hours at that speed. The time includes everything: reading, pricing 11 "
    "million moves, the search."
)
FLEET = (
    "## Vehicles and packs against losses\n\nfaultline's own network, three vehicles from two bases in two hours, "
    "charging in an hour; vehicles fail at random and are lost with their pack, each loss is re-planned, with spares. "
    "{samples} times each. The rule of arXiv 2604.15890 is k = m (ceil(R) + 1) for m active vehicles, with R the "
    "recovery time divided by the active time. In that rule whole vehicles recover; here packs do, so the table "
    "compares it with the packs, summed over the bases. The rule is meant to suffice even if all are empty at the same "
    "time, and does not include permanent losses; the column before it is the number of packs that the plan without a "
    "loss uses at the same time."
)


def day_document(content: Json, command: str, samples: int) -> Json:
    """Return the content of day.json."""
    return {**head("day/1", command), "samples": samples, **content}


def report_day(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    exact, whole = content["exact"], content["network"]
    same = sum(row["same"] for row in exact)
    without = sum(row["optimum_s"] is None for row in exact)
    parts = (
        f"`{content['command']}`",
        machine_line(content["machine"]),
        EXACT.format(count=len(exact), same=same, without=without),
        Table(
            ("instance", "packs a base", "proven, s", "found, s", "sorties", "proof took, s", "search took, s"),
            [
                (
                    str(row["seed"]), figure(row["packs"], 0), figure(row["optimum_s"], 2), figure(row["found_s"], 2),
                    figure(row["sorties"], 0), figure(row["proof_s"], 1), figure(row["search_s"], 1),
                )
                for row in exact
            ],
        ),
        NETWORK.format_map(whole),
        Table(
            ("seconds", "left over", "days", "last landing", "sorties", "hours in the air", "packs", "memory, MB"),
            [(
                figure(whole["seconds"], 0), str(whole["uncovered"]), str(whole["days"]), _clock(whole["finish_s"]),
                str(whole["sorties"]), figure(whole["flight_h"], 1), str(sum(whole["packs"].values())),
                figure(whole["memory_mb"], 0),
            )],
        ),
        FLEET.format_map(content),
        Table(
            ("hours between failures", "vehicles", "finished", "95 % interval", "losses", "packs for 95 %", "for 99 %",
             "planned", "rule"),
            [
                (
                    f"{row['mtbf_h']:g}", str(row["vehicles"]), f"{100 * row['probability']:.1f} %",
                    f"{100 * row['low_95']:.1f} to {100 * row['high_95']:.1f} %", figure(row["losses"], 2),
                    *(str(count) for count in row["packs"]), str(row["planned_packs"]), str(row["rule_packs"]),
                )
                for row in content["fleet"]
            ],
        ),
    )  # fmt: skip
    return Report("day", TITLE, content, parts)


def _clock(seconds: float) -> str:
    minutes = int(seconds % 86_400 // 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"
