"""Output of `faultline bench pictures`: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.machine import head, machine_line
from benchmarks.markdown import Rows, figure
from benchmarks.pictures import CLOCK_S, EVERY_M, LOST_SHARE, VEHICLES, PicturesFlight, pictures_results
from benchmarks.report import Report, Table, list_lines
from benchmarks.store import Json

TITLE = "Flights with cameras"
INTRODUCTION = (
    "`{command}`: {flights} flights in virtual time of {least} to {most} vehicles over parts of faultline's own "
    "network, the dialects alternating, with a camera of the MAVLink protocol on a gimbal or, on ArduPilot, one that "
    "the autopilot triggers. Every span requires a picture each {every_m:g} m, some pylons require viewpoints around "
    "them; on half of the flights these lie 2 m above and 6 m below the tops, and on half of those the vehicle turns "
    "its nose to a region of interest. {lost:.0%} of all datagrams are lost each way; one or two vehicles crash, lose "
    "their link, are flown home, or their cameras, cards and gimbals fail. The cameras write JPEGs, half of the fleets "
    "without positions in them, with clocks that are wrong by up to {clock_min:g} minutes and by whole hours of a "
    "zone; all cameras have one name and number."
)
COLUMNS = ("what", "count")


def pictures_document(flights: Sequence[PicturesFlight], command: str, seed: int) -> Json:
    """Return the content of pictures.json."""
    return {**head("pictures/1", command), "seed": seed, **pictures_results(flights)}


def _rows(content: Mapping[str, Any]) -> Rows:
    told = (
        ("assets (spans, and pylons with viewpoints)", "assets"),
        ("of them seen, by pictures that were really taken along all of them", "seen"),
        ("not seen, and named as left over", "named"),
        ("pictures on the cards", "taken"),
        ("of them in the index", "indexed"),
        (
            "missing, of a vehicle or camera that was reported as failed, or reported once by a wired one",
            "excused",
        ),
        ("files matched to their own row of the index", "matched"),
    )
    return [(words, str(content[name])) for words, name in told]


def _summarize_flights(content: Mapping[str, Any]) -> str:
    wrong = len(content["wrong"]) + len(content["not_flown"])
    return (
        "Compared with the pictures that were really taken: no asset reported as seen that they do not show, none "
        "unseen and unnamed, no row for a picture that was not taken, none for one picture twice in one pass, no file "
        f"matched to another picture, none of a known picture omitted. {wrong or 'Nothing'} went wrong."
    )


def _list_failures(content: Mapping[str, Any]) -> list[str]:
    return [*content["wrong"], *(f"not flown: {line}" for line in content["not_flown"])]


def report_pictures(content: Mapping[str, Any]) -> Report:
    """Return the report."""
    about = INTRODUCTION.format(
        **content, least=VEHICLES[0], most=VEHICLES[1], every_m=EVERY_M, lost=LOST_SHARE, clock_min=CLOCK_S / 60.0
    )
    summary, failures = _summarize_flights(content), _list_failures(content)
    parts = (
        machine_line(content["machine"]),
        about,
        summary,
        Table(COLUMNS, _rows(content), TITLE),
        Table(("faults", "times"), [(kind, str(n)) for kind, n in content["faults"].items()]),
        *list_lines("## By name", failures),
        f"The flights lasted {figure(content['flown_s'] / 3600)} hours together.",
    )
    return Report("pictures", TITLE, content, parts, (summary, *failures))
