"""The checklist before the flight: every check over what the vehicles said, in the order in which a crew reads it."""

from __future__ import annotations

from collections.abc import Mapping

from executor.core.context import Context
from executor.core.parts import OnBoard
from executor.core.preflight import areas, cameras, checks, distances, heights, packs, terrain
from executor.core.preflight.checks import Check, Facts
from executor.core.preflight.failsafes import LinkFailsafe
from executor.flight.flight_order import Order
from executor.site import dayflight
from executor.site.areas import places_of
from executor.site.plan_words import plan_checks


def checklist(
    order: Order,
    context: Context,
    facts: Mapping[str, Facts],
    own: Mapping[str, LinkFailsafe],
    boards: Mapping[str, OnBoard | None],
    free_bytes: int,
) -> list[Check]:
    """Return what was found.

    Args:
        order: What is to be flown.
        context: Of the flight.
        facts: What each vehicle said.
        own: What each vehicle does by itself when it does not hear us.
        boards: The first mission of each vehicle.
        free_bytes: On the disk that takes the record.
    """
    paths = {name: board.path for name, board in boards.items() if board is not None}
    site, plan = order.site, order.plan
    found = heights.checks(context.setup, list(paths.values()), order.ground.worth_a_look)
    bases_m = {} if order.day is None else dayflight.bases_m(order.day, context.frame)
    pads_m = {pad.vehicle: (pad.east_m, pad.north_m) for pad in places_of(site, context.frame)[0]}
    visits = {name: board.visits for name, board in boards.items() if board is not None}
    found += areas.area_checks(context.setup, list(paths.values()), visits, pads_m)
    links = {table.name: table.link for table in site.vehicle}
    found.append(checks.talkers(links, signed=site.signing is not None))
    found.append(checks.disk(free_bytes, paths, context))
    found += checks.separation(list(paths.values()), site.inspection.layer_m, context.setup.home_alt_m)
    found += distances.distance_checks(context.setup, list(paths.values()), visits)
    for name, fact in facts.items():
        setup, board = context.vehicles[name], boards[name]
        path = board.path if board is not None else None
        place_m = context.frame.to_local_m(fact.position.lat_deg, fact.position.lon_deg)
        found += checks.identity(fact, setup.dialect, place_m, pads_m.get(name, bases_m.get(name)))
        found += checks.pad_height(context, fact)
        found.append(checks.link(fact, own[name], waited_s=setup.link_timeout_s, wanted_s=site.faults.link_timeout_s))
        found += checks.stations(fact, setup.dialect)
        found += checks.battery_failsafes(fact, setup.dialect, checks.left_pct(context, path, fact.remaining_pct))
        if site.terrain is not None:
            found += terrain.following(fact, setup.dialect)
            found += terrain.pad_ground(context, fact)
        found += cameras.shutter(fact, setup.dialect, path)
        found += checks.fence(context, fact, path)
        found += packs.pack_checks(context, fact)
        found += checks.flight_times(fact, setup.dialect)
        found.append(checks.energy_for_flight(context, name, path, fact.remaining_pct))
    # Last, beside the question that follows: what is said yes to is what is seen.
    later = frozenset[int]() if order.day is None else dayflight.later_segments(order.day)
    return found + plan_checks(plan, len(context.setup.network.segments), later)
