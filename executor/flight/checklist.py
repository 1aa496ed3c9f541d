"""The checklist before the flight: every check over what the vehicles said, in the order in which a crew reads it."""

from __future__ import annotations

from collections.abc import Mapping

from executor.core.context import Context
from executor.core.interface.check_codes import Check
from executor.core.preflight import mission_checks, vehicle_checks
from executor.core.preflight.failsafe_parameters import LinkFailsafe
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.vehicle_parts import OnboardMission
from executor.flight.flight_request import FlightRequest
from executor.site import day_flight
from executor.site.plan_summary import build_plan_checks
from executor.site.site_areas import build_places
from executor.site.site_bases import base_places_m


def build_checklist(
    order: FlightRequest,
    context: Context,
    facts: Mapping[str, VehicleFacts],
    own: Mapping[str, LinkFailsafe],
    boards: Mapping[str, OnboardMission | None],
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
    found = mission_checks.check_flight_heights(context.setup, list(paths.values()), order.ground.worth_a_look)
    stated_m = {pad.vehicle: (pad.east_m, pad.north_m) for pad in build_places(site, context.frame)[0]}
    pads_m = {**base_places_m(site, context.frame), **stated_m}
    visits = {name: board.visits for name, board in boards.items() if board is not None}
    found += mission_checks.check_missions_and_areas(context.setup, list(paths.values()), visits, stated_m)
    links = {table.name: table.link for table in site.vehicle}
    found.append(vehicle_checks.check_signing(links, signed=site.signing is not None))
    found.append(vehicle_checks.check_disk_space(free_bytes, paths, context))
    found += vehicle_checks.check_layer_separation(
        list(paths.values()), site.inspection.layer_m, context.setup.home_alt_m
    )
    found += mission_checks.check_inspection_distances(context.setup, list(paths.values()), visits)
    for name, fact in facts.items():
        setup, board = context.vehicles[name], boards[name]
        path = board.path if board is not None else None
        place_m = context.frame.to_local_m(fact.position.lat_deg, fact.position.lon_deg)
        found += vehicle_checks.check_identity(fact, setup.dialect, place_m, pads_m.get(name))
        found += vehicle_checks.check_pad_height(context, fact)
        found.append(
            vehicle_checks.check_link_failsafe(
                fact, own[name], waited_s=setup.link_timeout_s, wanted_s=site.faults.link_timeout_s
            )
        )
        found += vehicle_checks.check_ground_stations(fact, setup.dialect)
        found += vehicle_checks.check_battery_failsafe_settings(
            fact, setup.dialect, vehicle_checks.charge_after_flight_pct(context, path, fact.remaining_pct)
        )
        if site.terrain is not None:
            found += vehicle_checks.check_terrain_following(fact, setup.dialect)
            found += vehicle_checks.check_pad_ground(context, fact)
        found += vehicle_checks.check_shutter(fact, setup.dialect, path)
        found += vehicle_checks.check_own_geofence(context, fact, path)
        found += vehicle_checks.check_pack(context, fact)
        found += vehicle_checks.flight_times(fact, setup.dialect)
        found.append(vehicle_checks.check_energy(context, name, path, fact.remaining_pct))
    # Last, beside the question that follows: what is said yes to is what is seen.
    later = frozenset[int]() if order.day is None else day_flight.find_later_segments(order.day)
    return found + build_plan_checks(plan, len(context.setup.network.segments), later)
