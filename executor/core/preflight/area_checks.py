"""What the checklist says of areas: that the missions keep out of them, what is not reached, and own returns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from executor.core.formatting import format_count
from executor.core.interface.check_codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity
from missions import FlightPath, FlightSetup
from missions.area_check import check_areas, describe_crossing, find_return_crossings

SUBJECT = "areas"
OFF_PAD_M = 20.0
"""A vehicle that stands farther from the pad that the site states for it stands somewhere else."""


def check_missions_and_areas(
    setup: FlightSetup,
    paths: Sequence[FlightPath],
    routes: Mapping[str, Sequence[int]],
    stated_m: Mapping[str, tuple[float, float]],
) -> list[Check]:
    """Return what the checklist says of areas and named places; nothing of a site without any.

    Args:
        setup: Areas, heights, and pads as the vehicles really stand.
        paths: The missions.
        routes: Each vehicle's visits, by its name.
        stated_m: East and north of the pads that the site states, by the vehicle's name.
    """
    found = []
    for name, place_m in stated_m.items():
        pad = setup.pad_of(name)
        off_m = math.dist(place_m, (pad.east_m, pad.north_m))
        if off_m > OFF_PAD_M:
            text = f"it stands {off_m:.0f} m from the pad that the site states for it; it lands where it stands"
            found.append(Check(Severity.WARNING, name, text, CheckCode.AREAS))
    if setup.alternates:
        text = f"alternates: {', '.join(setup.alternates)}"
        found.append(Check(Severity.OK, SUBJECT, text, CheckCode.AREAS))
    if not setup.areas:
        return found
    wrong = check_areas(setup, paths)
    found += [Check(Severity.STOP, SUBJECT, text, CheckCode.AREAS) for text in wrong]
    if not wrong:
        text = f"{format_count(len(setup.areas), 'area')}; every leg keeps out of them"
        found.append(Check(Severity.OK, SUBJECT, text, CheckCode.AREAS))
    lines = describe_returns_through_areas(setup, paths, routes)
    return found + [Check(Severity.WARNING, SUBJECT, text, CheckCode.AREAS) for text in lines]


def describe_returns_through_areas(
    setup: FlightSetup, paths: Sequence[FlightPath], routes: Mapping[str, Sequence[int]]
) -> list[str]:  # fmt: skip
    """Return in words where a vehicle's own return would lead through an area."""
    return [describe_crossing(setup, one) for one in find_return_crossings(setup, paths, routes)]
