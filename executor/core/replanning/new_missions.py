"""The missions of a re-plan's answer: made, sent, let go where they came too late, and the re-plan's end."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.inflight.homing import is_coming_down
from executor.core.interface.commands import Command, Compose, Say, Survivor, Upload
from executor.core.interface.events import MissionsWanted, NewRoute
from executor.core.lines import replanning
from executor.core.replanning import replan_separation, survivors
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState, NewMission, Replan, ReplanRecord, Stepped
from executor.core.state.onboard_fence import widen_fence
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState

RETRY_S = 5.0
OLD_NEED_S = 90.0
"""A need that nobody could answer for longer says nothing of the re-plan that came in the end."""
WAYS_AT_ONCE = 500
"""Of the missions that are made in one turn of the loop: ways to fly, times the pads that each may have to lead around.
Some 10 ms for fifty vehicles, whose missions together would take a third of a second."""


def apply_missions_wanted(context: Context, state: FleetState, event: MissionsWanted, now_s: float) -> Stepped:
    """Make some more missions of a re-plan."""
    plan = state.replanning.replan
    if plan is None or plan.solve.revision != event.revision:
        return state, ()
    return compose_missions(context, state, plan, now_s)


def compose_missions(context: Context, state: FleetState, plan: Replan, now_s: float) -> Stepped:
    """Make and send the next missions, with `WAYS_AT_ONCE` or one vehicle's; the others wait for their turn."""
    commands: list[Command] = []
    offers = {offer.vehicle: offer for offer in plan.solve.survivors}
    unmade, ways = list(plan.unmade), 0
    waiting: list[NewRoute] = []
    while unmade and ways < WAYS_AT_ONCE:
        route = unmade.pop(0)
        if route.vehicle not in plan.pending:
            continue  # its fault came first
        vehicle, offer = state.vehicles[route.vehicle], offers[route.vehicle]
        if not survivors.is_offer_valid(vehicle, offer):
            why = replanning.FLEW_ON if vehicle.custody.cause is ModeCause.OURS else replanning.LEFT_MISSION
            state, plan, said = drop_late_mission(state, plan, route.vehicle, why, now_s)
            commands.append(said)
            continue
        mission = _build_new_mission(context, vehicle, offer, route.visits, plan)
        if plan.low:
            waits, near = replan_separation.find_mission_conflicts(
                context, state, plan, route.vehicle, mission.path, now_s
            )
            if near:
                why = replanning.CONFLICTS.format(near=near[0])
                state, plan, said = drop_late_mission(state, plan, route.vehicle, why, now_s)
                state = state.with_replanning(wait_until_s=now_s + RETRY_S)
                commands.append(said)
                continue
            if waits:
                waiting.append(route)
                continue
        plan = replace(plan, missions=MappingProxyType({**plan.missions, route.vehicle: mission}))
        if plan.low and offer.airborne:
            state = state.put(vehicle.with_assignment(sent_path=mission.path))
        commands.append(Upload(route.vehicle, plan.solve.revision, mission.path, offer.airborne, mission.fence))
        ways += (len(route.visits) + 1) * len(context.vehicles)
    plan = replace(plan, unmade=(*waiting, *unmade))
    if unmade:
        commands.append(Compose(plan.solve.revision))
    state, ended = end_replan_if_done(state.with_replanning(replan=plan), now_s)
    return state, (*commands, *ended)


def build_all_missions(context: Context, state: FleetState, plan: Replan) -> Replan:
    """Make every mission of a re-plan at once, and send none."""
    offers = {offer.vehicle: offer for offer in plan.solve.survivors}
    missions = {
        route.vehicle: _build_new_mission(
            context, state.vehicles[route.vehicle], offers[route.vehicle], route.visits, plan
        )
        for route in plan.unmade
        if route.vehicle in plan.pending
    }
    return replace(plan, unmade=(), missions=MappingProxyType({**plan.missions, **missions}))


def drop_late_mission(
    state: FleetState, plan: Replan, name: str, why: str, now_s: float
) -> tuple[FleetState, Replan, Say]:
    """Let go of a part of a re-plan that came too late for one vehicle: what it would have flown is planned anew."""
    plan = replace(plan, pending=plan.pending - {name}, let_go=(*plan.let_go, name))
    vehicle = state.vehicles[name]
    state = state.put(vehicle.with_assignment(pending=None))
    state = state.with_replanning(replan=plan).want_replan(f"{name}: {why}", now_s)
    return state, plan, replanning.LATE.say(vehicle=name, why=why, revision=plan.solve.revision)


def release_vehicle(state: FleetState, plan: Replan, name: str, why: str, now_s: float) -> Stepped:
    """Let go of one vehicle's part as above, and close the re-plan if it was the last."""
    state, _, said = drop_late_mission(state, plan, name, why, now_s)
    state, more = end_replan_if_done(state, now_s)
    return state, (said, *more)


def request_replan_again(state: FleetState, plan: Replan) -> FleetState:
    """Give a re-plan up; the next one has the same reason and is as old.

    A sortie that is given up is asked for again by its turnaround, as long as the crew's word holds.
    """
    if plan.solve.sortie:
        return state.with_replanning(replan=None)
    return state.with_replanning(replan=None, ordered=plan.ordered).want_replan(plan.solve.trigger, plan.begun_s)


def may_retry_upload(context: Context, vehicle: VehicleState, *, mixed: bool) -> bool:
    """Return whether the upload of a mission that failed is begun again.

    One of which a part is on board, `mixed`, is better whole, also with its pilot.
    """
    if has_left_mission(context, vehicle):
        return False  # it is left to its way home, and to its landing; who lies somewhere flies none
    return mixed or (not vehicle.orders.excluded and vehicle.stage not in {Stage.PILOT, Stage.LOST})


def estimate_need_s(state: FleetState, name: str) -> float:
    """Return in how many seconds a vehicle flies past the part of its mission that stays; infinite if it flies none."""
    plan, vehicle = state.replanning.replan, state.vehicles[name]
    offer = None if plan is None else next((one for one in plan.solve.survivors if one.vehicle == name), None)
    if offer is None or not offer.airborne or vehicle.assignment.board is None:
        return math.inf
    return legs.time_to_reach_s(vehicle, max(0, offer.kept - 1))


def has_left_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle does not fly what is on board any more: a mix of two missions does no harm then."""
    return vehicle.stage in {Stage.RETURNING, Stage.DOWN} or is_coming_down(context, vehicle)


def _build_new_mission(
    context: Context, vehicle: VehicleState, offer: Survivor, visits: tuple[int, ...], plan: Replan
) -> NewMission:
    """Return a survivor's whole new mission.

    In flight the beginning stays as it is, item for item, so that the autopilot's index keeps its meaning.
    """
    setup = replan_separation.build_closed_setup(context, plan.solve.survivors)
    low, board = frozenset(plan.low.get(vehicle.name, ())), vehicle.assignment.board
    path, fresh = replan_separation.build_new_path(setup, vehicle, offer, visits, low), True
    if offer.airborne and board is not None:
        kept = {waypoint.visit for waypoint in board.path.waypoints[: offer.kept]}
        stay = tuple(visit for index, visit in enumerate(board.visits) if index in kept)
        visits, fresh = (*stay, *visits), False
    return NewMission(path, visits, fresh, widen_fence(context, vehicle.name, vehicle.assignment.fence, path))


def end_replan_if_done(state: FleetState, now_s: float) -> Stepped:
    """Close the re-plan once every new mission is on board, or known not to come on board."""
    plan = state.replanning.replan
    if plan is None or plan.solve_s is None or plan.pending:
        return state, ()
    if plan.closer:  # nothing was planned
        return state.with_replanning(replan=None), ()
    record = ReplanRecord(
        revision=plan.solve.revision,
        trigger=plan.solve.trigger,
        feasible=not plan.uncovered,
        uncovered=plan.uncovered,
        solve_s=plan.solve_s,
        begun_s=plan.begun_s,
        ended_s=now_s,
        upload_s=now_s - plan.solved_s,
        gain=plan.gain,
        sortie=plan.solve.sortie,
    )
    state = state.with_replanning(replan=None, records=(*state.replanning.records, record), orphans_since_s=None)
    since_s = record.ended_s - record.begun_s
    named = replanning.SORTIE_PLAN if record.sortie else replanning.REPLAN
    line = replanning.ENDED_AFTER if since_s <= OLD_NEED_S else replanning.ENDED
    if plan.failed:
        line = replanning.ENDED_WITHOUT
    elif not plan.missions.keys() - set(plan.let_go):
        line = replanning.ENDED_SAME
    what = named.format(trigger=record.trigger, revision=record.revision)
    return state, (line.say(plan=what, since_s=since_s, vehicles=", ".join(plan.failed)),)
