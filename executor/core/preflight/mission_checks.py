"""Check the missions for the checklist and the report: heights, distances to the line, areas."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import missions
from executor.core.formatting import format_count, join_first_names
from executor.core.interface.codes import Check, Severity
from executor.core.lines import checklist
from missions.area_rules import check_areas, describe_crossing, find_return_crossings
from missions.inspection_height import build_airway, check_inspection_airspace, segment_distances_m

RAISED_M = 0.5
"""Smallest height above the planned one at a pylon that is reported."""
SHOWN_FINDINGS = 3
"""Findings of one kind that are listed; more of them say the same."""
NAMED_SEGMENTS = 12
"""Segments named in a line; of more it gives the number, and `--json` names all."""
OFF_PAD_M = 20.0
"""Distance from the stated pad beyond which a vehicle stands somewhere else."""


def check_flight_heights(
    setup: missions.FlightSetup, paths: Sequence[missions.FlightPath], worth_a_look: Sequence[str] = ()
) -> list[Check]:
    """Return the checks of the heights: the reference they are flown by, and every reason not to fly.

    Args:
        setup: Heights and pads.
        paths: The missions.
        worth_a_look: Findings about the network's heights from reading it.
    """
    return [
        checklist.HEIGHTS.say("heights", heights=describe_heights(setup, paths)),
        *(checklist.HEIGHTS.say("heights", Severity.WARNING, heights=text) for text in worth_a_look),
        *(checklist.TOO_LOW.say("heights", found=text) for text in find_low_places(setup, paths)),
        *(checklist.TOO_HIGH.say("heights", found=text) for text in missions.check_ceiling(setup, paths)),
    ]


def find_low_places(setup: missions.FlightSetup, paths: Sequence[missions.FlightPath]) -> list[str]:
    """Return in words where a mission, or one of a later plan, comes too close to the ground or a line."""
    everywhere = missions.check_network_clearance(setup)
    more = (
        [checklist.MORE_PLACES.format(count=len(everywhere) - SHOWN_FINDINGS)]
        if len(everywhere) > SHOWN_FINDINGS
        else []
    )
    return [*missions.check_clearance(setup, paths), *everywhere[:SHOWN_FINDINGS], *more]


def describe_heights(setup: missions.FlightSetup, paths: Sequence[missions.FlightPath]) -> str:
    """Return the flight heights: "over the pylon tops, by 14.6 m or more; 41 to 82 m over the ground"."""
    text = f"over {setup.layers.reference.value}"
    if setup.network.flat:
        text += ", taken to be flat" if not setup.network.has_heights else ", on ground that is taken to be flat"
    least_m = missions.min_height_over_tops_m(setup, paths)
    if least_m is not None:
        text += f", by {least_m:.1f} m or more"
    heights = missions.find_height_extremes(setup, paths)
    if heights is not None:
        low, high = heights
        text += f"; {low.height_m:.0f} to {high.height_m:.0f} m over the ground"
        if setup.terrain is not None:
            known = setup.terrain.elevation
            text += (
                f", lowest {low.height_m:.0f} m, {low.vehicle} near {low.near}; ground +-{known.uncertainty_m:g} m by "
                f"{known.source}, and {setup.terrain.margin_m:g} m over that are kept"
            )
    raised = setup.layers.raised_m > RAISED_M
    if raised.any():
        most_m = float(setup.layers.raised_m.max())
        text += f"; {int(raised.sum())} of {len(raised)} pylons are passed up to {most_m:.0f} m higher than requested"
        text += ", because of the ground next to them"
    own_m = missions.find_max_return_height(setup).height_m
    return f"{text}, RTL up to {own_m:.0f} m; ceiling {setup.inspection.ceiling_m:g} m"


def build_heights_document(setup: missions.FlightSetup, paths: Sequence[missions.FlightPath]) -> dict[str, object]:
    """Return the same as plain data, in metres."""
    heights = missions.find_height_extremes(setup, paths)
    least_m = missions.min_height_over_tops_m(setup, paths)
    document: dict[str, object] = {
        "over": setup.layers.reference.value,
        "flat": setup.network.flat,
        "least_over_tops_m": None if least_m is None else round(least_m, 1),
        "least_over_ground_m": None if heights is None else round(heights[0].height_m, 1),
        "most_over_ground_m": None if heights is None else round(heights[1].height_m, 1),
        "return_over_ground_m": round(missions.find_max_return_height(setup).height_m, 1),
        "ceiling_m": setup.inspection.ceiling_m,
    }
    if setup.terrain is not None:
        known = setup.terrain.elevation
        document["terrain"] = {
            "source": known.source,
            "digest": known.digest,
            "vertical": known.vertical,
            "uncertainty_m": known.uncertainty_m,
            "margin_m": setup.terrain.margin_m,
            "most_raised_m": round(float(setup.layers.raised_m.max(initial=0.0)), 1),
        }
    return document


def describe_inspection_distances(asked_m: float, inspected: Iterable[tuple[str, str, float]]) -> str:
    """Return which segments are inspected at another distance than planned, and by which vehicles.

    Args:
        asked_m: The inspection distance of the site.
        inspected: Each segment's name, its vehicle, and its distance.
    """
    rows = list(inspected)
    high = sorted((row for row in rows if row[2] > asked_m), key=lambda row: (row[2], row[1]))
    text = f"{len(rows) - len(high)} of {len(rows)} segments are inspected at the requested {asked_m:g} m"
    if not high:
        return text
    named = join_first_names([f"{name} at {at_m:.0f} m by {vehicle}" for name, vehicle, at_m in high], NAMED_SEGMENTS)
    unless = "unless the others have left by then (flown again afterwards, as budgets allow)"
    return f"{text}; from their own layers, {unless}: {named}"


def check_inspection_distances(
    setup: missions.FlightSetup, paths: Sequence[missions.FlightPath], visits: Mapping[str, Sequence[int]]
) -> list[Check]:
    """Return the inspection distances, and vehicles too close to the airspace of another one's descent to the line.

    Empty if all vehicles inspect in their layers.

    Args:
        setup: Heights and pads.
        paths: The missions.
        visits: The visits of each mission, by the vehicle's name.
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
        checklist.DISTANCES.say("distance", distances=words),
        *(checklist.TOO_NEAR.say("separation", found=text) for text in near),
    ]


def check_missions_and_areas(
    setup: missions.FlightSetup,
    paths: Sequence[missions.FlightPath],
    routes: Mapping[str, Sequence[int]],
    stated_m: Mapping[str, tuple[float, float]],
) -> list[Check]:
    """Return the checks of areas and stated pads; empty for a site without any.

    Args:
        setup: Areas, heights, and the pads as measured.
        paths: The missions.
        routes: Each vehicle's visits, by its name.
        stated_m: East and north of the pads stated in the site, by the vehicle's name.
    """
    found = []
    for name, place_m in stated_m.items():
        pad = setup.pad_of(name)
        off_m = math.dist(place_m, (pad.east_m, pad.north_m))
        if off_m > OFF_PAD_M:
            found.append(checklist.OFF_STATED_PAD.say(name, off_m=off_m))
    if setup.alternates:
        found.append(checklist.ALTERNATES.say("areas", names=", ".join(setup.alternates)))
    if not setup.areas:
        return found
    wrong = check_areas(setup, paths)
    found += [checklist.AREAS_ENTERED.say("areas", found=text) for text in wrong]
    if not wrong:
        found.append(checklist.AREAS_KEPT.say("areas", areas=format_count(len(setup.areas), "area")))
    crossed = find_return_crossings(setup, paths, routes)
    return found + [checklist.RETURNS_THROUGH.say("areas", found=describe_crossing(setup, one)) for one in crossed]
