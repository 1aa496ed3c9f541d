"""At which distance the line is inspected, in words for the checklist and the plan."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from executor.core.formatting import join_first_names
from executor.core.interface.check_codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity
from missions import FlightPath, FlightSetup
from missions.inspection_height import build_airway, check_inspection_airspace, segment_distances_m

NAMED = 12
"""Segments that a line names; of more it says how many, and `--json` names all."""


def describe_inspection_distances(asked_m: float, inspected: Iterable[tuple[str, str, float]]) -> str:
    """Return who inspects what at another distance than asked.

    Args:
        asked_m: The distance that was asked for.
        inspected: Of each segment its name, by whom it is inspected and at what distance.
    """
    rows = list(inspected)
    high = sorted((row for row in rows if row[2] > asked_m), key=lambda row: (row[2], row[1]))
    text = f"{len(rows) - len(high)} of {len(rows)} segments are inspected at the asked {asked_m:g} m"
    if not high:
        return text
    named = join_first_names([f"{name} at {at_m:.0f} m by {vehicle}" for name, vehicle, at_m in high], NAMED)
    unless = "unless the others have left by then (flown again afterwards, as budgets allow)"
    return f"{text}; from their own layers, {unless}: {named}"


def check_inspection_distances(
    setup: FlightSetup, paths: Sequence[FlightPath], visits: Mapping[str, Sequence[int]]
) -> list[Check]:
    """Return at which distance is inspected, and who comes too near to the air in which another goes to the line.

    Nothing where everybody inspects in its layer anyway.

    Args:
        setup: Heights and pads.
        paths: The missions.
        visits: Of each of them, by the vehicle's name.
    """
    if not setup.inspection.same_distance:
        return []
    rows = [
        (setup.network.segment_name(segment), path.vehicle, at_m)
        for path in paths
        for segment, at_m in segment_distances_m(setup, path, visits[path.vehicle]).items()
    ]
    words = describe_inspection_distances(setup.inspection.height_m, rows)
    near = check_inspection_airspace(setup, [build_airway(setup, path) for path in paths])
    return [
        Check(Severity.OK, "distance", words, CheckCode.SEPARATION),
        *(Check(Severity.STOP, "separation", text, CheckCode.SEPARATION) for text in near),
    ]
