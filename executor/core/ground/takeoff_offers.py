"""Offer the crew vehicles on the ground that could take over segments; they start on its include, never by silence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executor.core.context import Context, RelaunchPolicy
from executor.core.formatting import format_count
from executor.core.interface.commands import Level
from executor.core.lines import operator, sorties
from executor.core.preflight.readiness import CHECKS_OUTDATED, find_obstacles
from executor.core.replanning import lower_to_inspection_height, replan_cycle, replan_separation, survivors
from executor.core.state.fleet_state import FleetState, Stepped, TakeoffOffer
from executor.core.state.vehicle_state import IN_THE_AIR, FaultKind, Stage, VehicleState
from missions import Phase, build_open_task
from planner import Vehicle, segment_of

LANDING_S = 180.0
"""Longest wait of an offer for vehicles about to land, to share the segments."""


def is_idle(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle is ready on its pad with nothing to do, and needs only the crew's include."""
    if not vehicle.is_on_base:
        return False
    found = find_obstacles(context, state, vehicle, now_s).keys() - _INCLUDE_ENDS
    returned = vehicle.stage is Stage.LANDED and vehicle.fault is not None and vehicle.fault.kind in MAY_FLY_AGAIN
    return not (found - {operator.AT_FAULT} if returned else found)


_INCLUDE_ENDS = CHECKS_OUTDATED | {operator.UNCLEARED, operator.WITH_PILOT}
"""Reasons that an include removes."""
MAY_FLY_AGAIN = frozenset({FaultKind.LINK, FaultKind.INTERRUPTION, FaultKind.FENCE})
"""Faults after which a vehicle that its failsafe brought back to its pad may fly again, only on the crew's include."""


def find_open_segments(context: Context, state: FleetState) -> frozenset[int]:
    """Return the segments without a vehicle that one could inspect."""
    hopeless = {segment for segment, tries in state.coverage.attempts.items() if tries > replan_cycle.ATTEMPTS}
    left = (
        replan_cycle.find_orphan_segments(context, state)
        | state.coverage.given_up
        | replan_cycle.find_left_over_segments(state)
    )
    return left - set(state.coverage.inspected) - hopeless


def find_reachable_segments(
    context: Context, fleet: FleetState, vehicle: VehicleState, segments: frozenset[int]
) -> frozenset[int]:
    """Return the segments that a vehicle could inspect one at a time, from its pad and back."""
    offer = survivors.build_pad_survivor(context, fleet, vehicle)
    segments -= survivors.find_locked_segments(context, fleet, vehicle)
    alone = Vehicle(offer.vehicle, offer.start_m, offer.budget_pct, offer.consumption)
    task = build_open_task(context.pricing, segments, (alone,))
    alone_pct = (task.instance.start_pct[0] + task.instance.home_pct[0]).reshape(-1, 2).min(axis=1)
    pairs = zip(task.segment_ids, alone_pct, strict=True)
    return frozenset(segment for segment, pct in pairs if pct <= alone.budget_pct)


def update_offers(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Make, change or withdraw the offer to the crew."""
    crew, known, flight = state.crew, state.replanning, state.progress
    # On a day a landed vehicle waits for its pack.
    never = context.fly_again is RelaunchPolicy.AUTO or context.day is not None
    if never or flight.finished or not flight.is_under_way:
        return _withdraw_offer(state), ()
    if crew.offers_over or known.is_changing or now_s < known.wait_until_s:
        return state, ()
    ready = [
        one for one in state.vehicles.values() if is_idle(context, state, one, now_s) and one.orders.cleared_s is None
    ]
    wanted = find_open_segments(context, state)
    again = not wanted and lower_to_inspection_height.is_fleet_down(state)
    able = {
        one.name: reach for one in ready if wanted and (reach := find_reachable_segments(context, state, one, wanted))
    }
    if again:
        able = _find_reinspections(context, state, ready, now_s)
    if not able or (not again and _has_other_candidate(context, state, now_s)):
        return _withdraw_offer(state), ()
    wanted_s = crew.offer_wanted_s or now_s
    if crew.offer is None and _is_landing_expected(state) and now_s - wanted_s < LANDING_S:
        return state.with_crew(offer_wanted_s=wanted_s), ()
    segments = tuple(sorted(frozenset[int]().union(*able.values())))
    if crew.offer is not None and (crew.offer.vehicles, crew.offer.again) == (tuple(able), again):
        return _expire_offer(context, state.with_crew(offer=replace(crew.offer, segments=segments)), now_s)
    offer = TakeoffOffer(tuple(able), segments, now_s, again)
    line = sorties.OFFER.with_level(Level.WARNING) if again else sorties.OFFER  # refusing it leaves no segment open
    return state.with_crew(offer=offer, offer_wanted_s=wanted_s), (line.say(offer=describe_offer(context, offer)),)


def _find_reinspections(
    context: Context, state: FleetState, ready: Sequence[VehicleState], now_s: float
) -> dict[str, frozenset[int]]:
    """Return the vehicles that could inspect again what counts from too far, and those segments."""
    if not replan_separation.may_leave_layers(context):
        return {}
    known = state.crew.offer
    if known is not None and known.again:  # with all vehicles down only the ready ones change
        return {one.name: frozenset(known.segments) for one in ready if one.name in known.vehicles}
    found = {}
    for one in ready:
        if one.fault is not None or one.assignment.board is None:
            continue
        plan = lower_to_inspection_height.plan_reinspection(
            context, state, survivors.build_pad_survivor(context, state, one), now_s
        )
        if plan is not None:
            found[one.name] = frozenset(map(segment_of, plan.solve.given))
    return found


def is_offered_reinspection(state: FleetState, vehicle: VehicleState) -> bool:
    """Return whether a vehicle is offered for segments that count from too far."""
    return state.crew.offer is not None and state.crew.offer.again and vehicle.name in state.crew.offer.vehicles


def describe_offer(context: Context, offer: TakeoffOffer) -> str:
    """Return an offer in words."""
    names = [context.segment_name(segment) for segment in offer.segments[:6]]
    names += ["..."] if len(offer.segments) > 6 else []
    work = sorties.RE_INSPECT if offer.again else sorties.TAKE_OVER
    return sorties.OFFERED.format(
        vehicles=" and ".join(offer.vehicles),
        work=work.format(segments=format_count(len(offer.segments), "segment")),
        names=", ".join(names),
        pads=sorties.PADS if len(offer.vehicles) > 1 else sorties.ONE_PAD,
    )


def _withdraw_offer(state: FleetState) -> FleetState:
    if state.crew.offer is None and state.crew.offer_wanted_s is None:
        return state
    return state.with_crew(offer=None, offer_wanted_s=None)


def _has_other_candidate(context: Context, state: FleetState, now_s: float) -> bool:
    """Return whether a vehicle in the air, or cleared, is about to get the open segments."""
    return bool(replan_cycle.find_orphan_segments(context, state)) and any(
        survivors.build_survivor(context, state, vehicle, now_s) is not None for vehicle in state.vehicles.values()
    )


def _is_landing_expected(state: FleetState) -> bool:

    def comes_home(vehicle: VehicleState) -> bool:
        leg = vehicle.leg if vehicle.stage is Stage.FLYING else None
        return vehicle.stage is Stage.RETURNING or (leg is not None and leg.phase in {Phase.RETURN, Phase.LAND})

    return any(
        comes_home(one) and not one.orders.excluded and (one.fault is None or one.fault.kind in MAY_FLY_AGAIN)
        for one in state.vehicles.values()
    )


def _expire_offer(context: Context, state: FleetState, now_s: float) -> Stepped:
    """End an unanswered offer once nothing else is awaited."""
    offer = state.crew.offer
    aloft = any(one.stage in IN_THE_AIR or one.stage is Stage.STARTING for one in state.vehicles.values())
    if offer is None or aloft:
        return state if offer is None else state.with_crew(offer=replace(offer, alone_since_s=None)), ()
    if offer.alone_since_s is None:
        return state.with_crew(offer=replace(offer, alone_since_s=now_s)), ()
    if now_s - offer.alone_since_s < context.offer_s:
        return state, ()
    left, state = find_open_segments(context, state), state.with_crew(offer=None, offers_over=True)
    if offer.again:
        line, was = sorties.EXPIRED.with_level(Level.INFO), "was" if len(offer.segments) == 1 else "were"
        distant = sorties.DISTANT.format(segments=format_count(len(offer.segments), "segment"), was=was)
        return state, (line.say(offer_s=context.offer_s, left=distant),)
    state = state.with_coverage(given_up=state.coverage.given_up | (left - state.coverage.left_over))
    is_ = "is" if len(left) == 1 else "are"
    over = sorties.LEFT_OVER.format(segments=format_count(len(left), "segment"), is_=is_)
    return state, (sorties.EXPIRED.say(offer_s=context.offer_s, left=over),)
