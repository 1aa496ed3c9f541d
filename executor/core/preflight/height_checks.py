"""Which heights a flight is flown by, in words for the checklist and as data for the report."""

from __future__ import annotations

from collections.abc import Sequence

from executor.core.interface.check_codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity
from missions import (
    FlightPath,
    FlightSetup,
    check_ceiling,
    check_clearance,
    check_network_clearance,
    find_height_extremes,
    find_max_return_height,
    min_height_over_tops_m,
)
from missions.terrain import Terrain

SUBJECT = "heights"
RAISED_M = 0.5
"""Pylons that are passed higher than asked by less are not worth a word."""
SHOWN = 3
"""Findings of one kind; more of them say the same."""


def check_flight_heights(
    setup: FlightSetup, paths: Sequence[FlightPath], worth_a_look: Sequence[str] = ()
) -> list[Check]:
    """Return what the checklist says of the heights: by which they are flown, and every reason not to fly.

    Args:
        setup: Heights and pads.
        paths: The missions.
        worth_a_look: What was found about the network's heights when it was read.
    """
    found = [Check(Severity.OK, SUBJECT, describe_heights(setup, paths), CheckCode.HEIGHTS)]
    found += [Check(Severity.WARNING, SUBJECT, text, CheckCode.HEIGHTS) for text in worth_a_look]
    found += [Check(Severity.STOP, SUBJECT, text, CheckCode.CLEARANCE) for text in find_low_places(setup, paths)]
    found += [Check(Severity.STOP, SUBJECT, text, CheckCode.CEILING) for text in check_ceiling(setup, paths)]
    return found


def find_low_places(setup: FlightSetup, paths: Sequence[FlightPath]) -> list[str]:
    """Return in words where a flight, or one of a later plan, comes too near to the ground or to a line."""
    everywhere = check_network_clearance(setup)
    more = [f"{len(everywhere) - SHOWN} more places like these"] if len(everywhere) > SHOWN else []
    return [*check_clearance(setup, paths), *everywhere[:SHOWN], *more]


def describe_heights(setup: FlightSetup, paths: Sequence[FlightPath]) -> str:
    """Return by which heights is flown: "over the pylon tops, by 14.6 m or more; 41 to 82 m over the ground"."""
    text = f"over {setup.layers.reference.value}"
    if setup.network.flat:
        text += ", taken to be flat" if not setup.network.has_heights else ", on ground that is taken to be flat"
    least_m = min_height_over_tops_m(setup, paths)
    if least_m is not None:
        text += f", by {least_m:.1f} m or more"
    heights = find_height_extremes(setup, paths)
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
        text += f"; {int(raised.sum())} of {len(raised)} pylons are passed up to {most_m:.0f} m higher than asked"
        text += ", for the ground beside them"
    own_m = find_max_return_height(setup).height_m
    return f"{text}, RTL up to {own_m:.0f} m; ceiling {setup.inspection.ceiling_m:g} m"


def build_heights_document(setup: FlightSetup, paths: Sequence[FlightPath]) -> dict[str, object]:
    """Return the same as plain data, in metres."""
    heights = find_height_extremes(setup, paths)
    least_m = min_height_over_tops_m(setup, paths)
    return {
        "over": setup.layers.reference.value,
        "flat": setup.network.flat,
        "least_over_tops_m": None if least_m is None else round(least_m, 1),
        "least_over_ground_m": None if heights is None else round(heights[0].height_m, 1),
        "most_over_ground_m": None if heights is None else round(heights[1].height_m, 1),
        "return_over_ground_m": round(find_max_return_height(setup).height_m, 1),
        "ceiling_m": setup.inspection.ceiling_m,
        **({} if setup.terrain is None else {"terrain": _build_terrain_document(setup, setup.terrain)}),
    }


def _build_terrain_document(setup: FlightSetup, terrain: Terrain) -> dict[str, object]:
    known = terrain.elevation
    return {
        "source": known.source,
        "digest": known.digest,
        "vertical": known.vertical,
        "uncertainty_m": known.uncertainty_m,
        "margin_m": terrain.margin_m,
        "most_raised_m": round(float(setup.layers.raised_m.max(initial=0.0)), 1),
    }
