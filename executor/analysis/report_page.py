"""Write report.html: one file with the result of a flight, for screen, print or archive.

It needs no network and no other file: pictures and the script that draws the map are inside. Its content security
policy allows no other script.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType

from executor.adapters.run_directory import Document
from executor.adapters.templates import encode_data_url, format_value, render_template, write_page
from executor.analysis.documents import FlightReport, InspectionRow, RadioRow, SeenRow, describe_total_inspected
from executor.analysis.flight_record import FlightRecord, find_abandoned_segments
from executor.analysis.report_map import LOOKS, build_report_map
from executor.core import formatting
from executor.core.interface.codes import Severity
from executor.core.interface.commands import Level
from executor.site.ground_view import DOCUMENT
from executor.site.site_model import SiteModel

PICTURES = {
    "profile.png": "The {first} from the side, over the ground of the raster",
    "battery.png": "Battery consumption over time, planned and measured",
}
"""Pictures next to the page, with their captions."""


def write_report_page(
    record: FlightRecord,
    report: FlightReport,
    path: Path,
    ground: SiteModel | None = None,
    below: Mapping[str, bytes] = MappingProxyType({}),
) -> None:
    """Write the page of a flight, with its pictures embedded.

    Args:
        record: The flight.
        report: Content of report.json.
        path: The file.
        ground: Its site, whose network includes segments that the flight left out; without it the map lacks them.
        below: Background files; empty if there is none.

    Raises:
        OSError: the file cannot be written, or a picture cannot be read.
    """
    beside = {words.format(first=record.first_words): path.parent / name for name, words in PICTURES.items()}
    pictures = {words: file.read_bytes() for words, file in beside.items() if file.exists()}
    write_page(path, render_report_page(record, report, pictures, ground, below))


def render_report_page(
    record: FlightRecord,
    report: FlightReport,
    pictures: Mapping[str, bytes],
    ground: SiteModel | None = None,
    below: Mapping[str, bytes] = MappingProxyType({}),
) -> str:
    """Return the page.

    Args:
        record: The flight.
        report: Content of report.json.
        pictures: PNG files by caption.
        ground: Its site, as in `write_report_page`.
        below: Background files.
    """
    images = {name: content for name, content in below.items() if name != DOCUMENT}
    return render_template(
        "report.html",
        outcome=describe_outcome(record),
        complete=not record.uncovered_segments and not record.never,
        facts=_describe_facts(record, report),
        pictures=pictures,
        map=build_report_map(record, report, ground),
        looks=LOOKS,
        ground=json.loads(below[DOCUMENT]) if DOCUMENT in below else None,
        images={name: encode_data_url(file, f"image/{Path(name).suffix[1:]}") for name, file in images.items()},
        record=record,
        report=report,
        planned=record.planned_for,
        named=partial(_get_named_values, report.segment_names),
        distance=_add_distance_column,
        length_m=math.dist,
        time=_format_time,
        duration=_format_duration,
        formatting=formatting,
        ok=Severity.OK,
        info=Level.INFO,
    )


def describe_outcome(record: FlightRecord) -> str:
    """Return the result of the flight in one sentence."""
    total, missing = (count + len(record.never) for count in (len(record.segments), len(record.uncovered_segments)))
    lost = " and ".join(vehicle.name for vehicle, _ in record.losses)
    if not record.uncovered_segments:
        which = f"All {total} segments" if not missing else f"All {len(record.segments)} segments within reach"
        done = f"{which} were inspected in {_format_duration(record.duration_s)}"
        never = f"; {missing} more {'is' if missing == 1 else 'are'} out of reach" if missing else ""
        if not lost:
            return f"{done}{never}."
        handed = len(find_abandoned_segments(record))
        others = f"; the others took over {handed} of them" if handed else ""
        return f"{done}, although {lost} {'was' if len(record.losses) == 1 else 'were'} lost{others}{never}."
    reason = f" after {lost} {'was' if len(record.losses) == 1 else 'were'} lost" if lost else ""
    were = "was" if missing == 1 else "were"
    flown = _format_duration(record.duration_s)
    return f"{missing} of {total} segments {were} not inspected{reason}; the flight took {flown}."


def _describe_facts(record: FlightRecord, report: FlightReport) -> str:
    facts = [
        formatting.format_count(len(record.vehicles), "vehicle"),
        formatting.format_count(len(record.revisions) - 1, "re-plan"),
    ]
    if report.min_separation_m is not None:
        facts.append(f"any two vehicles stayed at least {format_value(report.min_separation_m)} m apart")
    facts += [_describe_radio(row) for row in report.radios]
    facts += [together] if (together := describe_total_inspected(report)) else []
    facts += _describe_speeds(report)
    if record.uncovered_segments:
        facts.append("not inspected: " + ", ".join(segment.display_name for segment in record.uncovered_segments))
    if report.left_over:
        names = [report.segment_names.get(str(segment), str(segment)) for segment in report.left_over]
        facts.append(f"of these, planned for the next flight: {', '.join(names)}")
    facts += formatting.describe_unreachable(record.never, len(record.never))
    return "; ".join(facts) + ". Times are minutes and seconds since the order to take off (T+)."


def _describe_radio(row: RadioRow) -> str:
    said = [f"{row.bytes_s / 1e3:.1f} of {row.capacity_bytes_s / 1e3:.1f} kB/s on average"]
    said += [] if row.round_trip_s is None else [f"round trip at most {row.round_trip_s:.1f} s"]
    said.append(f"{100 * row.lost:.0f} % lost")
    said += [
        f"{word} for {time_s:.0f} s"
        for word, time_s in (("congested", row.congested_s), ("weak", row.weak_s))
        if time_s
    ]
    return f"radio of {', '.join(row.vehicles)}: {', '.join(said)}, positions at {row.positions_hz:g} Hz or more"


def _describe_speeds(report: FlightReport) -> list[str]:
    """Return the speeds and deviations of the inspections in words; empty if no run is recorded."""
    rows = report.inspections
    highest = [row.speed_max_m_s for row in rows if row.speed_max_m_s is not None]
    if not highest:
        return []
    text = (
        f"segments were flown at {format_value(sum(row.speed_mean_m_s for row in rows) / len(rows))} m/s on average "
        f"({format_value(report.inspection_speed_m_s)} m/s were requested), at most {format_value(max(highest))} m/s "
        f"and at most {format_value(max(row.deviation_max_m for row in rows))} m off the track"
    )
    return [text]


def _get_named_values(names: Mapping[str, str], row: Document, columns: Iterable[str]) -> list[object]:
    """Return the values of some columns, with asset names for segments."""

    def named(value: object) -> object:
        return [names.get(str(one), one) for one in value] if isinstance(value, tuple) else names.get(str(value), value)

    values = ((column, getattr(row, column)) for column in columns)
    return [named(value) if column in {"segment", "segments", "uncovered"} else value for column, value in values]


def _add_distance_column(rows: Iterable[InspectionRow | SeenRow]) -> dict[str, str]:
    known = any(row.inspected_at_m is not None for row in rows)
    return {"inspected_at_m": "at a distance of (m)"} if known else {}


def _format_time(t_s: float | None) -> str | None:
    """Return a time as the terminal and the page show it; None before the take-off."""
    return None if t_s is None else formatting.format_flight_time(t_s) or "before"


def _format_duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
