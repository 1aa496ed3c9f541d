"""Run a re-plan from its need to its end, and pose the problem of the next loss.

An answer that still fits is accepted; its missions are built, uploaded, and dropped where they come too late.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from types import MappingProxyType

from executor.core.context import Context, RelaunchPolicy
from executor.core.formatting import format_count
from executor.core.inflight.homing import is_coming_down
from executor.core.interface.commands import Command, Compose, Say, Solve, Survivor, Upload
from executor.core.interface.events import Gain, MissionsWanted, NewRoute, SolveEnded
from executor.core.lines import link, replanning
from executor.core.replanning import replan_separation, survivors
from executor.core.replanning.replan_separation import find_low_tail_segments
from executor.core.state import legs
from executor.core.state.fleet_state import Coverage, FleetState, NewMission, Replan, ReplanRecord, Stepped
from executor.core.state.onboard_fence import widen_fence
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState, suppose_lost
from planner import segment_of

PROOF_GRACE_S = 5.0
"""Wait for the proof of a passed segment: the index may advance before the last position arrives."""
SELDOM, MOST_SELDOM_S = 4.0, 240.0
"""Factor on the last upload time, and longest wait, to collect unproven segments over a radio."""
ATTEMPTS = 2
"""Repetitions of a segment whose inspection could not be proven."""
RETRY_S = 5.0
OLD_NEED_S = 90.0
"""Age of a need beyond which it says nothing about the re-plan's speed."""
WAYS_AT_ONCE = 500
"""Limit of missions built per turn, as legs times pads to avoid; some 10 ms for fifty vehicles, whose missions together
would take a third of a second."""


def find_orphan_segments(context: Context, state: FleetState) -> frozenset[int]:
    """Return the segments not inspected, given up, left for the next flight or on any route."""
    wanted = context.wanted - set(state.coverage.inspected) - state.coverage.given_up - state.coverage.left_over
    wanted -= set(state.coverage.unseen)  # their pictures are awaited
    wanted -= state.later_segments()
    for vehicle in state.mission_vehicles():
        wanted -= {segment_of(visit) for visit in vehicle.remaining_visits()} - survivors.find_barred_segments(
            context, state, vehicle
        )
    return frozenset(wanted)


def find_left_over_segments(state: FleetState) -> frozenset[int]:
    """Return the segments that the first plan left over and no route has taken up."""
    left = state.coverage.left_over - set(state.coverage.inspected) - state.later_segments()
    if left:
        for vehicle in state.mission_vehicles():
            left -= {segment_of(visit) for visit in vehicle.remaining_visits()}
    return left


def replan_for_regained_link(state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Request a re-plan for a vehicle without contact at the last one, if segments it may reach were left over."""
    left = state.list_uncovered_last() & state.coverage.given_up
    out = vehicle.fault is not None or vehicle.stage is not Stage.FLYING or vehicle.name in state.replanning.considered
    if out or not left or state.progress.recalled:
        return state
    state = state.with_coverage(given_up=state.coverage.given_up - left)
    return state.want_replan(link.LOST_REGAINED.words.format(vehicle=vehicle.name), now_s)


def begin_replan(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Begin a re-plan if one is needed and possible, or continue a waiting one."""
    plan = state.replanning.replan
    if plan is not None and plan.low and plan.unmade:
        return compose_missions(context, state, plan, now_s)  # a vehicle waits for another's new mission
    if replan_separation.is_line_occupied(context, state, now_s):
        return state, ()
    return _begin_new_replan(context, state, now_s)


def _begin_new_replan(context: Context, state: FleetState, now_s: float) -> Stepped:
    alone, known = find_orphan_segments(context, state), state.replanning
    silent = state.listening.silent_since_s is not None
    if known.replan is not None or silent or not state.progress.is_under_way:
        return state, ()
    if not alone and not known.ordered:
        return state.with_replanning(orphans_since_s=None, urgent=False), ()
    since_s = now_s if known.orphans_since_s is None else known.orphans_since_s
    state, asked = state.with_replanning(orphans_since_s=since_s), known.urgent or known.ordered
    if now_s < known.wait_until_s or (not asked and now_s - since_s < _find_proof_grace_s(state, since_s)):
        return state, ()
    offers = survivors.build_survivors(context, state, now_s)
    if not offers:
        return _give_up_without_vehicle(context, state.with_replanning(ordered=False), alone)
    if not asked:
        state, alone = _count_attempts(state, alone)
        if not alone:
            return state, (replanning.PROOF_LEFT.say(),)
    freed = {segment_of(visit) for offer in offers for visit in offer.tail} - _find_segments_under_way(state, offers)
    to_spare = find_left_over_segments(state) | (freed & state.coverage.left_over)
    if not alone and not freed and not to_spare:
        return state.with_replanning(ordered=False), ()
    trigger = known.trigger if asked else explain_orphan_segments(context, state, alone)
    revision, done = known.revision + 1, set(state.coverage.inspected)
    own = tuple(sorted((alone | freed) - to_spare - done))
    offers = replan_separation.close_occupied_segments(context, state, offers, (*own, *to_spare), now_s)
    solve = Solve(revision, own, offers, trigger, tuple(sorted(to_spare - done)))
    state = state.with_replanning(
        revision=revision,
        replan=Replan(solve, known.trigger_s if asked else now_s, ordered=known.ordered),
        urgent=False,
        ordered=False,
        considered=frozenset(offer.vehicle for offer in offers),
    )
    names, count = ", ".join(offer.vehicle for offer in offers), format_count(len(alone), "open segment")
    return state, (replanning.BEGINS.say(revision=revision, segments=count, trigger=trigger, vehicles=names), solve)


def _find_proof_grace_s(state: FleetState, since_s: float) -> float:
    """Return how long unproven segments wait for a re-plan.

    Over a telemetry radio uploads take long, and segments flown meanwhile may lack proof as well: uploads get a fifth
    of the time at most, and unproven segments are collected while a vehicle flies for long enough.
    """
    records = [record for record in state.replanning.records if not record.sortie]
    if not state.channels or not records:
        return PROOF_GRACE_S
    waits_s = min(SELDOM * records[-1].upload_s, MOST_SELDOM_S)
    ahead_s = [
        legs.time_to_reach_s(vehicle, len(vehicle.assignment.board.legs) - 1)
        for vehicle in state.vehicles.values()
        if vehicle.stage is Stage.FLYING and vehicle.assignment.board is not None
    ]
    if max(ahead_s, default=0.0) < 2 * waits_s:
        return PROOF_GRACE_S
    return max(PROOF_GRACE_S, records[-1].ended_s + waits_s - since_s)


def _find_segments_under_way(state: FleetState, offers: tuple[Survivor, ...]) -> frozenset[int]:
    """Return the segments that vehicles are flying and keep: another carrier need not fly them again."""
    return frozenset(
        segment_of(visit)
        for offer in offers
        if offer.airborne
        for visit in state.vehicles[offer.vehicle].remaining_visits()
        if visit not in offer.tail
    )


def _count_attempts(state: FleetState, alone: frozenset[int]) -> tuple[FleetState, frozenset[int]]:
    """Count the failed attempts of orphan segments that a vehicle has flown past."""
    flown = alone & find_passed_segments(state)
    attempts = {
        **state.coverage.attempts,
        **{segment: state.coverage.attempts.get(segment, 0) + 1 for segment in flown},
    }
    hopeless = frozenset(segment for segment in flown if attempts[segment] > ATTEMPTS)
    state = state.with_coverage(attempts=MappingProxyType(attempts), given_up=state.coverage.given_up | hopeless)
    return state, alone - hopeless


def set_aside_segments(context: Context, coverage: Coverage, segments: Iterable[int]) -> Coverage:
    """Return the coverage without segments no airborne vehicle can inspect: on a day later sorties can."""
    if context.day is not None:
        return replace(coverage, left_over=coverage.left_over | set(segments))
    return replace(coverage, given_up=coverage.given_up | set(segments))


def _give_up_without_vehicle(context: Context, state: FleetState, alone: frozenset[int]) -> Stepped:
    stages = {one.stage for one in state.vehicles.values() if not one.is_pulled_out}
    if state.mission_vehicles() or not alone:
        return state, ()  # a vehicle is landing, or about to: it may fly again
    if Stage.RETURNING in stages and context.fly_again is RelaunchPolicy.AUTO:
        return state, ()
    state = replace(state, coverage=set_aside_segments(context, state.coverage, alone)).with_replanning(urgent=False)
    line = replanning.NOBODY_ALOFT if stages & {Stage.GROUND, Stage.LANDED} else replanning.NOBODY_LEFT
    return state, (line.say(segments=format_segments(context, alone)),)


def apply_solution(context: Context, state: FleetState, event: SolveEnded, now_s: float) -> Stepped:
    """Apply the solver's answer: check that it still fits, then upload."""
    plan = state.replanning.replan
    if plan is None or event.revision != plan.solve.revision or plan.solve_s is not None:
        return state, ()  # stale after a newer fault
    if event.routes is None:
        state = request_replan_again(state, plan)
        state = state.with_replanning(wait_until_s=now_s + RETRY_S)
        return state, (replanning.FAILED.say(revision=event.revision, reason=event.reason),)
    offers = plan.solve.survivors
    late = [offer.vehicle for offer in offers if not survivors.is_offer_valid(state.vehicles[offer.vehicle], offer)]
    if late:
        said = replanning.TOO_LATE.say(revision=event.revision, vehicles=", ".join(late))
        return request_replan_again(state, plan), (said,)
    found = {route.vehicle: route.visits for route in event.routes}
    routes = {offer.vehicle: found.get(offer.vehicle, ()) for offer in offers}
    if replan_separation.may_leave_layers(context):
        low = replan_separation.choose_low_segments(context, state, plan, routes, now_s)
        plan = replace(plan, low=MappingProxyType({name: tuple(sorted(low[name])) for name in routes}))
    unmade = tuple(
        NewRoute(offer.vehicle, routes[offer.vehicle])
        for offer in offers
        if routes[offer.vehicle] != offer.tail
        # A tail that stays may be inspected at another distance: another vehicle may be there now.
        or (plan.low and {*plan.low[offer.vehicle]} != find_low_tail_segments(state.vehicles[offer.vehicle], offer))
    )
    if plan.low:  # from the highest layer down: a lower vehicle may have to wait for a higher one
        unmade = tuple(sorted(unmade, key=lambda one: -context.setup.layers.vehicles.index(one.vehicle)))
    for route in unmade:
        state = state.put(state.vehicles[route.vehicle].with_assignment(pending=event.revision))
    lines: list[Command] = []
    if not plan.solve.given:
        lines.append(announce_solution(event, [route.vehicle for route in unmade]))
    if event.gain is not None and event.gain.short:
        lines.append(announce_short_budgets(event.gain))
    if event.uncovered:
        lines.append(replanning.NOT_COVERED.say(segments=format_segments(context, event.uncovered)))
    plan = replace(
        plan,
        solve_s=event.solve_s,
        solved_s=now_s,
        uncovered=event.uncovered,
        gain=event.gain,
        unmade=unmade,
        pending=frozenset(route.vehicle for route in unmade),
    )
    state = replace(state, coverage=set_aside_segments(context, state.coverage, event.uncovered))
    state, commands = compose_missions(context, state.with_replanning(replan=plan), plan, now_s)
    return state, (*lines, *commands)


def apply_missions_wanted(context: Context, state: FleetState, event: MissionsWanted, now_s: float) -> Stepped:
    """Build more of a re-plan's missions."""
    plan = state.replanning.replan
    if plan is None or plan.solve.revision != event.revision:
        return state, ()
    return compose_missions(context, state, plan, now_s)


def compose_missions(context: Context, state: FleetState, plan: Replan, now_s: float) -> Stepped:
    """Build and send the next missions, up to `WAYS_AT_ONCE` or one vehicle's; the others wait for their turn."""
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
    """Build all missions of a re-plan at once, without sending any."""
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
    """Drop a part of a re-plan that came too late for one vehicle; its segments are planned again."""
    plan = replace(plan, pending=plan.pending - {name}, let_go=(*plan.let_go, name))
    vehicle = state.vehicles[name]
    state = state.put(vehicle.with_assignment(pending=None))
    state = state.with_replanning(replan=plan).want_replan(f"{name}: {why}", now_s)
    return state, plan, replanning.LATE.say(vehicle=name, why=why, revision=plan.solve.revision)


def release_vehicle(state: FleetState, plan: Replan, name: str, why: str, now_s: float) -> Stepped:
    """Drop one vehicle's part likewise, and close the re-plan if it was the last."""
    state, _, said = drop_late_mission(state, plan, name, why, now_s)
    state, more = end_replan_if_done(state, now_s)
    return state, (said, *more)


def request_replan_again(state: FleetState, plan: Replan) -> FleetState:
    """Abandon a re-plan; the next one has the same reason and age.

    A sortie's turnaround requests it again, while the crew's clearance holds.
    """
    if plan.solve.sortie:
        return state.with_replanning(replan=None)
    return state.with_replanning(replan=None, ordered=plan.ordered).want_replan(plan.solve.trigger, plan.begun_s)


def may_retry_upload(context: Context, vehicle: VehicleState, *, mixed: bool) -> bool:
    """Return whether a failed upload is repeated.

    A `mixed` mission, with part of a new one on board, is completed even for a vehicle with its pilot.
    """
    if has_left_mission(context, vehicle):
        return False  # it is left to its return and landing; one that is down flies none
    return mixed or (not vehicle.orders.excluded and vehicle.stage not in {Stage.PILOT, Stage.LOST})


def estimate_need_s(state: FleetState, name: str) -> float:
    """Return the time until a vehicle flies past the kept part of its mission; infinite if it flies none."""
    plan, vehicle = state.replanning.replan, state.vehicles[name]
    offer = None if plan is None else next((one for one in plan.solve.survivors if one.vehicle == name), None)
    if offer is None or not offer.airborne or vehicle.assignment.board is None:
        return math.inf
    return legs.time_to_reach_s(vehicle, max(0, offer.kept - 1))


def has_left_mission(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle no longer flies the mission on board, so that a mix of two does no harm."""
    return vehicle.stage in {Stage.RETURNING, Stage.DOWN} or is_coming_down(context, vehicle)


def _build_new_mission(
    context: Context, vehicle: VehicleState, offer: Survivor, visits: tuple[int, ...], plan: Replan
) -> NewMission:
    """Return a survivor's whole new mission.

    In flight its beginning stays unchanged, item for item, so that the autopilot's index keeps its meaning.
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
    """Close the re-plan once every new mission is on board, or certain not to be."""
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


def select_vehicles_to_judge(state: FleetState) -> tuple[str, ...]:
    """Return the vehicles whose loss can be judged; none while the plan is about to change."""
    if state.replanning.is_changing or not state.progress.is_under_way:
        return ()
    return tuple(vehicle.name for vehicle in state.mission_vehicles() if vehicle.stage is Stage.FLYING)


def build_judgement_key(state: FleetState) -> tuple[object, ...]:
    """Return the inputs of a judgement: between visits, and without a new plan, it stays valid."""
    doing = tuple(
        (one.name, one.stage.value, one.orders.held_s is None, one.orders.excluded) for one in state.vehicles.values()
    )
    return (state.replanning.revision, len(state.coverage.inspected), len(state.coverage.given_up), doing)


def build_loss_problem(context: Context, state: FleetState, name: str, now_s: float) -> Solve | tuple[int, ...]:
    """Return the re-plan that a vehicle's loss would need, or the segments certain to be left over.

    A held vehicle counts as flying: the operator can resume it.
    """
    state = state.put(suppose_lost(state.vehicles[name], now_s))
    alone = find_orphan_segments(context, state)
    if not alone:
        return ()
    free = {name: vehicle.with_orders(held_s=None) for name, vehicle in state.vehicles.items()}
    offers = survivors.build_survivors(context, replace(state, vehicles=free), now_s)
    if not offers:
        return tuple(sorted(alone))
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    wanted = tuple(sorted((alone | freed) - set(state.coverage.inspected) - state.coverage.left_over))
    offers = replan_separation.close_occupied_segments(context, state, offers, wanted, now_s)
    return Solve(state.replanning.revision, wanted, offers, f"what if {name} were lost")


def format_segments(context: Context, segments: frozenset[int] | tuple[int, ...]) -> str:
    """Return segments in words, by the names of their assets if any."""
    names = {segment: context.segment_name(segment) for segment in sorted(segments)}
    if len(names) > 1 and all(name == f"segment {segment}" for segment, name in names.items()):
        return f"segments {', '.join(map(str, names))}"
    return ", ".join(names.values())


def find_passed_segments(state: FleetState) -> frozenset[int]:
    """Return the segments that a vehicle has flown past on its mission, proven or not."""
    past: set[int] = set()
    for vehicle in state.vehicles.values():
        past |= {segment for segment, _ in vehicle.assignment.runs_broken}
        if vehicle.assignment.board is not None:
            ahead = {segment_of(visit) for visit in vehicle.remaining_visits()}
            past |= {segment_of(visit) for visit in vehicle.assignment.board.visits} - ahead
    return frozenset(past)


def explain_orphan_segments(context: Context, state: FleetState, alone: frozenset[int]) -> str:
    """Return why segments are without a vehicle, other than by a fault."""
    past = find_passed_segments(state)
    reasons = {replanning.NOT_PROVEN: alone & past, replanning.WITHOUT_VEHICLE: alone - past}
    found = ((why, format_segments(context, segments)) for why, segments in reasons.items() if segments)
    return "; ".join(why.format(segments=segments) for why, segments in found)


def announce_solution(event: SolveEnded, names: list[str]) -> Say:
    """Report a re-plan's result: its improvement, and the vehicles with a new mission."""
    gained = "" if event.gain is None else f": {_describe_gain(event.gain, changed=bool(names))}"
    given = ", ".join(sorted(names)) or replanning.NO_VEHICLE
    return replanning.FOUND.say(revision=event.revision, solve_s=event.solve_s, gained=gained, vehicles=given)


def _describe_gain(gain: Gain, *, changed: bool) -> str:
    if not changed:
        return replanning.NO_GAIN
    longest = replanning.LONGEST.format(longest_s=gain.longest_s)
    shorter = round(gain.longest_s) < round(gain.carried_s)
    covered = []
    if gain.segments:
        covered.append(replanning.RECOVERED.format(segments=format_count(gain.segments, "segment")))
    elif gain.length_m >= 1.0 and not shorter:
        covered.append(replanning.LENGTH_RECOVERED.format(length_m=gain.length_m))
    if gain.left_over:
        moved = replanning.TAKEN_OVER if gain.left_over > 0 else replanning.MOVED_BACK
        covered.append(moved.format(segments=format_count(abs(gain.left_over), "segment")))
    if covered:
        return f"{', '.join(covered)}; {longest}"
    why = replanning.LIMITED if gain.short else replanning.SHORTER if shorter else replanning.NO_DUPLICATES
    return why.format(longest=longest, carried_s=gain.carried_s)


def announce_short_budgets(gain: Gain) -> Say:
    """Report the vehicles whose budget does not cover the mission on board."""
    line = replanning.BUDGET_SHORT if len(gain.short) == 1 else replanning.BUDGETS_SHORT
    return line.say(vehicles=", ".join(sorted(gain.short)))
