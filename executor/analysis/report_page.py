"""report.html: one file that says what became of a flight, to be read on a screen, on paper, or next year.

It needs no network, no script and no other file: the pictures are inside.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from html import escape
from pathlib import Path

from executor.adapters.document import Document
from executor.analysis.documents import FlightReport
from executor.analysis.earlier_flights import describe_total_inspected
from executor.analysis.flight_record import FlightRecord, find_abandoned_segments
from executor.core import formatting as words
from executor.core.interface.commands import Level
from executor.core.preflight.vehicle_checks import Severity
from missions.files import write_whole

PICTURES = {
    "map.png": "The first plan, and what was flown",
    "profile.png": "The first plan from the side, over the ground of the raster",
    "battery.png": "Battery consumption over time, planned and measured",
}
"""Files beside the page, and what they show."""

FAULTS = ("vehicle", "kind", "reason", "happened", "detected", "delay (s)")
DECISIONS = ("at", "level", "what")
SEGMENTS = ("segment", "length (m)", "planned for", "inspected by", "at")
REPLANS = {
    "revision": "number",
    "trigger": "because of",
    "feasible": "covers all",
    "solve_s": "solving (real s)",
    "upload_s": "upload (s)",
    "total_s": "fault to on board (s)",
    "gained": "more segments than on board",
    "longest_route_s": "longest route (s)",
    "uncovered": "segments not covered",
}
"""What the report calls it, and what the page does; as in the next four."""
VEHICLES = {
    "name": "name",
    "state": "at the end",
    "landed": "at home",
    "segments": "segments inspected",
    "energy_used_pct": "battery used (%)",
    "min_reserve_pct": "least left (%)",
    "autopilot": "autopilot",
    "firmware": "firmware",
}
AWAY = ("vehicle", "state", "last GPS fix", "last heard at", "height (m)", "when")
CHECKS = {"subject": "about", "severity": "finding", "text": "what"}
DISTANCE = {"inspected_at_m": "at a distance of (m)"}
INSPECTIONS = {
    "segment": "segment",
    "vehicle": "by",
    "speed_mean_m_s": "mean speed (m/s)",
    "speed_max_m_s": "highest speed (m/s)",
    "deviation_mean_m": "beside the track, mean (m)",
    "deviation_max_m": "at most (m)",
}
ROUTES = (
    "vehicle", "mission", "legs", "planned", "flown", "error (%)",
    "planned (% of battery)", "flown (%)", "error (%)",
)  # fmt: skip
LEGS = ("leg", "for", "segment", "planned (s)", "flown (s)", "planned (% of battery)", "flown (%)")
SEEN = {
    "name": "asset",
    "camera": "camera",
    "take": "asked",
    "state": "state",
    "vehicle": "by",
    "pictures": "pictures",
    "missing": "missing",
}
SORTIES = {
    "vehicle": "vehicle",
    "number": "sortie",
    "pack": "pack",
    "began_s": "took off (s)",
    "ended_s": "landed (s)",
    "began_pct": "battery at take-off (%)",
    "ended_pct": "at landing (%)",
    "rest_v": "at rest before (V)",
    "segments": "inspected",
}
EARLIER = {
    "run": "flight",
    "segments": "inspected",
    "sorties": "sorties",
    "duration_s": "lasted (s)",
    "faults": "at fault",
}
NOT_COUNTED = {"vehicle": "vehicle", "segment": "segment", "reason": "reason"}

_CLASSES = {Level.INFO: "", Level.WARNING: "warning", Level.FAULT: "fault"}
_STYLE = """
:root { color-scheme: light dark; --ink: #1c1c1c; --paper: #ffffff; --rule: #cccccc; --soft: #f3f3f3; --faint: #5f5f5f;
  --good: #0b6b3a; --bad: #b01010; --warn: #7a5200; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8e8e8; --paper: #16181b; --rule: #44484e; --soft: #23262b; --faint: #a6a6a6;
    --good: #6fd39b; --bad: #ff8a80; --warn: #e9b872; } }
@media print {
  :root { color-scheme: light; --ink: #000000; --paper: #ffffff; --rule: #aaaaaa; --soft: #ffffff; --faint: #444444;
    --good: #0b6b3a; --bad: #b01010; --warn: #7a5200; }
  figure, tr { break-inside: avoid; } h2 { break-after: avoid; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 72rem;
  margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .5rem; }
h1.good { color: var(--good); } h1.bad { color: var(--bad); }
h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; border-bottom: 1px solid var(--rule); }
p.facts { color: var(--faint); margin: 0 0 1rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--rule); }
th { font-weight: 600; vertical-align: bottom; } td.number { text-align: right; }
tr.fault td { color: var(--bad); font-weight: 600; } tr.warning td { color: var(--warn); }
figure { margin: 1rem 0; }
figure img { display: block; width: 100%; height: auto; background: #ffffff; border-radius: 4px; }
summary { cursor: pointer; margin: .5rem 0; }
figcaption { color: var(--faint); font-size: .9rem; }
"""


def write_report_page(record: FlightRecord, report: FlightReport, path: Path) -> None:
    """Write the page of a flight; the pictures that lie beside it go into it.

    Args:
        record: The flight.
        report: The content of report.json.
        path: The file.

    Raises:
        OSError: the file cannot be written, or a picture cannot be read.
    """
    text = render_report_page(record, report, _read_pictures(path.parent))
    # A vehicle's words may hold half a surrogate pair; that must not cost the page.
    write_whole(path, text.encode("utf-8", errors="xmlcharrefreplace"))


def render_report_page(record: FlightRecord, report: FlightReport, pictures: Mapping[str, bytes]) -> str:
    """Return the page.

    Args:
        record: The flight.
        report: The content of report.json.
        pictures: PNG files by what they show.
    """
    sentence = describe_outcome(record)
    flown = INSPECTIONS | (DISTANCE if any(row.inspected_at_m is not None for row in report.inspections) else {})
    seen = SEEN | (DISTANCE if any(row.inspected_at_m is not None for row in report.seen) else {})
    parts = [
        f'<h1 class="{"bad" if record.uncovered_segments or record.never else "good"}">{escape(sentence)}</h1>',
        f'<p class="facts">{escape(_describe_facts(record, report))}</p>',
        *(_render_picture(words, content) for words, content in pictures.items()),
        _render_section("Faults", FAULTS, _build_fault_rows(record)),
        _render_section("Re-plans", REPLANS.values(), _build_rows(report, report.replans, REPLANS)),
        _render_section("Vehicles", VEHICLES.values(), _build_rows(report, report.vehicles, VEHICLES)),
        _render_section("Flights before this one", EARLIER.values(), _build_rows(report, report.earlier, EARLIER)),
        _render_section("Sorties", SORTIES.values(), _build_rows(report, report.sorties, SORTIES)),
        _render_section("Not at home: where to look", AWAY, _build_away_rows(report)),
        _render_section(
            "Before the flight",
            CHECKS.values(),
            _build_rows(report, report.checks, CHECKS),
            _build_check_classes(report),
        ),
        _render_section("How the segments were flown", flown.values(), _build_rows(report, report.inspections, flown)),
        _render_section(
            "What was seen", seen.values(), _build_rows(report, report.seen, seen), _build_seen_classes(report)
        ),
        _render_section(
            "Flown, but not counted", NOT_COUNTED.values(), _build_rows(report, report.not_counted, NOT_COUNTED)
        ),
        _render_section("Planned and flown", ROUTES, _build_route_rows(report)) + "".join(_render_legs(report)),
        _render_section(
            "Decisions", DECISIONS, _build_decision_rows(record), [_CLASSES[one.level] for one in record.decisions]
        ),
        _render_section("Segments", SEGMENTS, _build_segment_rows(record)),
    ]
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(sentence)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def describe_outcome(record: FlightRecord) -> str:
    """Return in one sentence what became of the flight."""
    total, missing = (count + len(record.never) for count in (len(record.segments), len(record.uncovered_segments)))
    lost = " and ".join(vehicle.name for vehicle, _ in record.losses)
    if missing == 0:
        done = f"All {total} segments were inspected in {_format_duration(record.duration_s)}"
        if not lost:
            return f"{done}."
        handed = len(find_abandoned_segments(record))
        others = f"; the others took over {handed} of them" if handed else ""
        return f"{done}, although {lost} {'was' if len(record.losses) == 1 else 'were'} lost{others}."
    reason = f" after {lost} {'was' if len(record.losses) == 1 else 'were'} lost" if lost else ""
    were = "was" if missing == 1 else "were"
    flown = _format_duration(record.duration_s)
    return f"{missing} of {total} segments {were} not inspected{reason}; the flight took {flown}."


def _describe_facts(record: FlightRecord, report: FlightReport) -> str:
    facts = [
        words.format_count(len(record.vehicles), "vehicle"),
        words.format_count(len(record.revisions) - 1, "re-plan"),
    ]
    if report.min_separation_m is not None:
        facts.append(f"any two vehicles stayed at least {format_value(report.min_separation_m)} m apart")
    facts += [together] if (together := describe_total_inspected(report)) else []
    facts += _describe_speeds(report)
    if record.uncovered_segments:
        facts.append("not inspected: " + ", ".join(segment.display_name for segment in record.uncovered_segments))
    if report.left_over:
        names = [report.segment_names.get(str(segment), str(segment)) for segment in report.left_over]
        facts.append(f"of these, planned for the next sortie: {', '.join(names)}")
    facts += words.describe_unreachable(record.never, len(record.never))
    return "; ".join(facts) + ". Times are minutes and seconds since the order to take off (T+)."


def _build_check_classes(report: FlightReport) -> list[str]:
    return ["" if check.severity is Severity.OK else "warning" for check in report.checks]


def _build_seen_classes(report: FlightReport) -> list[str]:
    return ["" if row.state == "seen" else "fault" for row in report.seen]


def _describe_speeds(report: FlightReport) -> list[str]:
    """Return in words how fast and how near to the track the segments were flown; nothing if no run is on record."""
    rows = report.inspections
    highest = [row.speed_max_m_s for row in rows if row.speed_max_m_s is not None]
    if not highest:
        return []
    text = (
        f"segments were flown at {format_value(sum(row.speed_mean_m_s for row in rows) / len(rows))} m/s on average "
        f"({format_value(report.inspection_speed_m_s)} m/s were asked for), "
        f"at most {format_value(max(highest))} m/s and at most "
        f"{format_value(max(row.deviation_max_m for row in rows))} m beside the track"
    )
    return [text]


def _build_fault_rows(record: FlightRecord) -> Iterator[Sequence[object]]:
    for vehicle, fault in record.losses:
        delay_s = None if fault.happened_s is None else fault.detected_s - fault.happened_s
        yield (
            vehicle.name,
            fault.kind.value,
            fault.reason,
            _format_time(fault.happened_s),
            _format_time(fault.detected_s),
            delay_s,
        )


def _build_decision_rows(record: FlightRecord) -> Iterator[Sequence[object]]:
    for decision in record.decisions:
        yield _format_time(decision.t_s), decision.level.value, decision.text


def _build_segment_rows(record: FlightRecord) -> Iterator[Sequence[object]]:
    planned = {segment: route.vehicle for route in record.revisions[0].routes for segment in route.segments}
    for segment in record.segments:
        by = segment.inspected_by or "no vehicle"
        yield (
            segment.display_name,
            math.dist(segment.a_m, segment.b_m),
            planned.get(segment.id),
            by,
            _format_time(segment.inspected_s),
        )


def _build_rows(report: FlightReport, rows: Iterable[Document], columns: Iterable[str]) -> list[Sequence[object]]:
    return [
        [_replace_with_names(report.segment_names, column, getattr(row, column)) for column in columns] for row in rows
    ]


def _replace_with_names(names: Mapping[str, str], column: str, value: object) -> object:
    """Return a value with segments by the names of their assets."""
    if column not in {"segment", "segments", "uncovered"}:
        return value
    if isinstance(value, tuple):
        return [names.get(str(one), one) for one in value]
    return names.get(str(value), value)


def _build_away_rows(report: FlightReport) -> Iterator[Sequence[object]]:
    for row in report.vehicles:
        at = row.last_position
        if not row.landed and at is not None:
            place = words.format_known_place(at.lat_deg, at.lon_deg, at.known, at.accuracy_m)
            by_gps = (
                ""
                if (fix := at.last_fix) is None
                else (
                    f"{words.format_lat_lon(fix.lat_deg, fix.lon_deg, fix.accuracy_m)}, {_format_time(fix.at_s)}, "
                    f"at {fix.ground_speed_m_s:.0f} m/s"
                )
            )
            yield (
                row.name,
                words.format_state_word(row.state),
                by_gps or "the same",
                place,
                at.alt_rel_m,
                _format_time(at.at_s),
            )


def _build_route_rows(report: FlightReport) -> Iterator[Sequence[object]]:
    for row in report.routes:
        legs = len(row.legs) if row.whole else f"{len(row.legs)}, not from take-off to landing"
        yield (
            row.vehicle, row.revision, legs, _format_duration(row.planned_s), _format_duration(row.flown_s),
            row.time_error_pct,
            row.planned_pct, row.flown_pct, row.energy_error_pct,
        )  # fmt: skip


def _render_legs(report: FlightReport) -> Iterator[str]:
    """Yield the legs of every vehicle, folded: there may be hundreds."""
    for name in dict.fromkeys(row.vehicle for row in report.routes):
        rows = [
            (
                f"{row.revision}.{leg.waypoint}", leg.phase, "" if leg.segment is None else report.segment_names.get(
                str(leg.segment), leg.segment), leg.planned_s, leg.flown_s, leg.planned_pct, leg.flown_pct,
            )
            for row in report.routes if row.vehicle == name for leg in row.legs
        ]  # fmt: skip
        summary = f"{name}: {words.format_count(len(rows), 'leg')}, by mission and waypoint"
        yield f"<details>\n<summary>{escape(summary)}</summary>\n{_render_table(LEGS, rows)}\n</details>\n"


def _format_time(t_s: float | None) -> str | None:
    """Return a time as the terminal and the page show it; what was before the take-off has none."""
    return None if t_s is None else words.format_flight_time(t_s) or "before"


def _render_section(
    title: str, headings: Collection[str], rows: Iterable[Sequence[object]], classes: Sequence[str] = ()
) -> str:
    """Return a table under a heading, each row with its class if there are any; nothing if there is no row."""
    table = _render_table(headings, rows, classes)
    return f"<section>\n<h2>{escape(title)}</h2>\n{table}\n</section>" if table else ""


def _render_table(headings: Collection[str], rows: Iterable[Sequence[object]], classes: Sequence[str] = ()) -> str:
    lines = []
    for index, row in enumerate(rows):
        kind = f' class="{classes[index]}"' if classes and classes[index] else ""
        lines.append(f"<tr{kind}>{''.join(map(_render_cell, row))}</tr>")
    if not lines:
        return ""
    head = "".join(f'<th scope="col">{escape(heading)}</th>' for heading in headings)
    table = f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n" + "\n".join(lines) + "\n</tbody>\n</table>"
    return f'<div class="wide">\n{table}\n</div>'


def _render_cell(value: object) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    opening = '<td class="number">' if number else "<td>"
    return f"{opening}{escape(format_value(value))}</td>"


def format_value(value: object) -> str:
    """Return a value of a report in words.

    >>> said(None), said(True), said([3, 4]), said(211.44)
    ('unknown', 'yes', '3, 4', '211.4')
    """
    match value:
        case None:
            return "unknown"
        case Enum():
            return str(value.value)
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
        case list() | tuple():
            return ", ".join(map(format_value, value)) or "none"
        case _:
            return str(value)


def _format_duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _render_picture(words: str, content: bytes) -> str:
    source = "data:image/png;base64," + b64encode(content).decode("ascii")
    return f'<figure><img src="{source}" alt="{escape(words)}"><figcaption>{escape(words)}</figcaption></figure>'


def _read_pictures(folder: Path) -> dict[str, bytes]:
    return {words: (folder / name).read_bytes() for name, words in PICTURES.items() if (folder / name).exists()}
