"""What flights before this one came to, where it flies what they left: one report over all of them."""

from __future__ import annotations

from pathlib import Path

from executor.analysis.documents import EarlierRow, FlightReport, read_report
from executor.core.formatting import format_count


def read_earlier_flights(run: Path) -> tuple[EarlierRow, ...]:
    """Return the flights up to that of a run directory, by its report, the first one first.

    Raises:
        LogError: there is no report, or it cannot be used.
    """
    report = read_report(run)
    row = EarlierRow(
        run=run.resolve().name,
        segments=list_inspected_segments(report),
        sorties=len(report.sorties) or sum(1 for vehicle in report.vehicles if vehicle.energy_used_pct > 0.0),
        duration_s=report.duration_s,
        faults=tuple(dict.fromkeys(fault.vehicle for fault in report.faults)),
    )
    return (*report.earlier, row)


def list_inspected_segments(report: FlightReport) -> tuple[int, ...]:
    """Return the ids of the segments that a flight inspected."""
    return tuple(sorted(segment for vehicle in report.vehicles for segment in vehicle.segments))


def describe_total_inspected(report: FlightReport) -> str:
    """Return what this flight and those before it inspected together; empty where it is the first."""
    if not report.earlier:
        return ""
    done = {*list_inspected_segments(report), *(segment for row in report.earlier for segment in row.segments)}
    total = len(done | set(report.segments_uncovered))
    return f"with {format_count(len(report.earlier), 'flight')} before it {len(done)} of {total} segments are inspected"
