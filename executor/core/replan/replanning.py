"""Who can take over what, and what becomes of the answer."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from executor.core import projection
from executor.core.battery import account
from executor.core.commands import Command, Compose, Level, Say, Solve, Survivor, Upload
from executor.core.context import Context, FlyAgain
from executor.core.events import MissionsWanted, NewRoute, SolveEnded
from executor.core.fencing import wider_fence
from executor.core.homing.homeward import comes_down
from executor.core.replan.wording import flown_past, found_words, listed, short_words, unasked
from executor.core.state import FleetState, NewMission, Replan, ReplanRecord
from executor.core.vehicle import Stage, VehicleState
from executor.core.words import count_of
from missions import Phase, continue_path, flight_path
from missions.autopilots.modes import is_mission_mode
from missions.pace import AS_MODELLED
from planner import segment_of

CLEARED_S = 60.0
"""After this the crew's word that a pad is clear is too old to plan with."""
PROOF_GRACE_S = 5.0
"""The vehicle's index may move on before the position that proves the inspection has arrived."""
ATTEMPTS = 2
"""How often a segment is flown again because its inspection could not be proven."""
QUANTUM_PCT = 1.0
"""Batteries report whole percents: what is reported may be this much more than what is there."""
RETRY_S = 5.0
OLD_NEED_S = 90.0
"""A need that nobody could answer for longer says nothing of the re-plan that came in the end."""
FLEW_ON = "flew on before its new mission came"
WAYS_AT_ONCE = 500
"""Of the missions that are made in one turn of the loop: ways to fly, times the pads that each may have to lead around.
Some 10 ms for fifty vehicles, whose missions together would take a third of a second."""


def orphans(context: Context, state: FleetState) -> frozenset[int]:
    """Return the segments that are not inspected, not given up, not the next sortie's, and on nobody's way."""
    wanted = context.wanted - set(state.coverage.inspected) - state.coverage.given_up - state.coverage.left_over
    wanted -= set(state.coverage.unseen)  # their pictures are waited for
    for vehicle in state.on_mission():
        wanted -= {segment_of(visit) for visit in vehicle.remaining_visits()} - barred(context, vehicle)
    return frozenset(wanted)


def barred(context: Context, vehicle: VehicleState) -> frozenset[int]:
    """Return the segments that a vehicle cannot see: it has no camera that does what they ask for."""
    return context.setup.looks.barred(vehicle.name, vehicle.payload.broken_names())


def left_over(state: FleetState) -> frozenset[int]:
    """Return what the first plan left for the next sortie, and nobody has taken up since."""
    left = state.coverage.left_over - set(state.coverage.inspected)
    if left:
        for vehicle in state.on_mission():
            left -= {segment_of(visit) for visit in vehicle.remaining_visits()}
    return left


def survivor(context: Context, state: VehicleState, now_s: float) -> Survivor | None:
    """Return what a vehicle can offer to a re-plan; None if it cannot be given anything now."""
    # Who is silent now may be lost in a moment: a part of the plan that is given to it would be planned twice.
    heard = (
        state.link.heard_s is not None
        and not state.link.stale
        and now_s - state.link.heard_s < context.limits.link_stale_s
    )
    out = (
        state.fault is not None or state.assignment.stubborn or state.orders.excluded or state.orders.held_s is not None
    )
    out = out or state.assignment.carried.doubted()
    if out or not heard or state.power.battery.remaining_pct is None:
        return None
    if state.stage in {Stage.GROUND, Stage.LANDED}:
        if state.sensors.tilted_since_s is not None:
            return None  # it lies on its side
        if context.fly_again is not FlyAgain.AUTO and not _cleared(state, now_s):
            return None
        return from_its_pad(context, state)
    if state.stage not in {Stage.FLYING, Stage.STARTING} or state.assignment.board is None or state.motion.fix is None:
        return None
    if not _on_its_mission(context, state, now_s):
        return None
    kept = _kept(context, state)
    if kept is None:
        return None
    if kept > state.assignment.waypoint:
        place, spent = state.assignment.board.places_m[kept - 1], projection.modelled_to_reach_pct(state, kept - 1)
        alt_rel_m = state.assignment.board.path.waypoints[kept - 1].alt_rel_m
    else:
        place, alt_rel_m, spent = state.motion.fix.place_m, state.motion.fix.alt_rel_m, 0.0
    offer = _offer(context, state, place, spent * account.factor(state.power.battery), airborne=True, kept=kept)
    facing_m = (0.0, 0.0)
    if kept > 1:  # along the last leg that stays, or the one before that which is replaced while it is flown
        (east_m, north_m), before_m = (
            state.assignment.board.places_m[kept - 1],
            state.assignment.board.places_m[kept - 2],
        )
        facing_m = (east_m - before_m[0], north_m - before_m[1])
    return replace(offer, start_up_m=context.setup.lowest_layer_up_m(state.name, alt_rel_m), facing_m=facing_m)


def from_its_pad(context: Context, state: VehicleState) -> Survivor:
    """Return what a vehicle on the ground can offer, once it may take off."""
    return _offer(context, state, (0.0, 0.0), 0.0, airborne=False, kept=0)


def _on_its_mission(context: Context, state: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle in the air says that it flies its mission: after an absence of ours it may not."""
    beat, beat_s = state.telemetry.heartbeat, state.link.heartbeat_s
    if beat is None or beat_s is None or now_s - beat_s >= context.limits.heartbeat_stale_s:
        return False
    return state.stage is Stage.STARTING or is_mission_mode(context.vehicles[state.name].dialect, beat.custom_mode)


def heard_again(state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    """Plan anew for a vehicle that was silent at the last re-plan, if that left something over which it may reach."""
    left = (
        frozenset(state.replanning.records[-1].uncovered) & state.coverage.given_up
        if state.replanning.records
        else frozenset()
    )
    out = vehicle.fault is not None or vehicle.stage is not Stage.FLYING or vehicle.name in state.replanning.considered
    if out or not left or state.progress.recalled:
        return state
    trigger = f"{vehicle.name}: link regained"
    return replace(
        state,
        coverage=replace(state.coverage, given_up=state.coverage.given_up - left),
        replanning=replace(state.replanning, urgent=True, trigger=trigger, trigger_s=now_s),
    )


def _cleared(state: VehicleState, now_s: float) -> bool:
    """Return whether the crew has said that it may take off, just now."""
    return state.orders.cleared_s is not None and now_s - state.orders.cleared_s <= CLEARED_S


def _kept(context: Context, state: VehicleState) -> int | None:
    """Return how many waypoints must stay: the visit under way or flown to, and what is over before the upload is."""
    board = state.assignment.board
    if board is None:
        return None
    waypoints = board.path.waypoints
    kept = state.assignment.waypoint
    while kept < len(waypoints):
        if waypoints[kept].phase in {Phase.TAKEOFF, Phase.TRANSIT, Phase.INSPECT}:
            # A visit is finished once it is flown to. After its end the next leg may be replaced while it is flown.
            while waypoints[kept].phase is not Phase.INSPECT:
                kept += 1
                if waypoints[kept].phase in {Phase.RETURN, Phase.LAND}:
                    break
            else:
                kept += 1
        if waypoints[kept].phase is Phase.LAND:
            return None
        if projection.time_to_reach_s(state, kept) > context.horizon_s:
            return kept
        if waypoints[kept].phase is Phase.RETURN:
            return None
    return None


def _offer(
    context: Context, state: VehicleState, start_m: tuple[float, float], spent_pct: float, *, airborne: bool, kept: int
) -> Survivor:
    setup = context.vehicles[state.name]
    remaining = state.power.battery.remaining_pct or 0.0
    # What is never touched is the reserve, so that it is the one that a rounded report is held against.
    left = min(
        remaining - QUANTUM_PCT - setup.reserve_pct, setup.budget_pct - account.drawn_so_far_pct(state.power.battery)
    )
    budget = left - spent_pct
    tail: tuple[int, ...] = ()
    if state.assignment.board is not None and airborne:
        ahead = {waypoint.visit for waypoint in state.assignment.board.path.waypoints[kept:]}
        tail = tuple(visit for index, visit in enumerate(state.assignment.board.visits) if index in ahead)
    blind = barred(context, state)
    most = remaining - setup.reserve_pct - spent_pct
    learned = state.assignment.learned
    return Survivor(
        state.name, start_m, max(0.0, budget), account.factor(state.power.battery), airborne, tail, kept,
        max(0.0, most), pace=AS_MODELLED if learned is None else learned.pace, barred=tuple(sorted(blind)),
    )  # fmt: skip


def begin(context: Context, state: FleetState, now_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Begin a re-plan if there is a need for one and somebody to do it."""
    alone = orphans(context, state)
    if (
        state.replanning.replan is not None
        or state.progress.recalled
        or state.progress.launched_s is None
        or state.listening.silent_since_s is not None
    ):
        return state, ()
    if not alone and not state.replanning.ordered:
        return replace(state, replanning=replace(state.replanning, orphans_since_s=None, urgent=False)), ()
    since = now_s if state.replanning.orphans_since_s is None else state.replanning.orphans_since_s
    state = replace(state, replanning=replace(state.replanning, orphans_since_s=since))
    if now_s < state.replanning.wait_until_s or (
        not state.replanning.urgent and not state.replanning.ordered and now_s - since < PROOF_GRACE_S
    ):
        return state, ()
    offers = tuple(offer for vehicle in state.vehicles.values() if (offer := survivor(context, vehicle, now_s)))
    if not offers:
        return _nobody(context, replace(state, replanning=replace(state.replanning, ordered=False)), alone)
    if not state.replanning.urgent and not state.replanning.ordered:
        state, alone = _count_attempts(state, alone)
        if not alone:
            return state, (Say(Level.WARNING, "some segments could not be proven to be inspected; left for later"),)
    freed = {segment_of(visit) for offer in offers for visit in offer.tail} - _under_way(state, offers)
    to_spare = left_over(state) | (freed & state.coverage.left_over)
    if not alone and not freed and not to_spare:
        return replace(state, replanning=replace(state.replanning, ordered=False)), ()
    trigger = (
        state.replanning.trigger
        if state.replanning.urgent or state.replanning.ordered
        else unasked(context, state, alone)
    )
    revision = state.replanning.revision + 1
    done = set(state.coverage.inspected)
    own = tuple(sorted((alone | freed) - to_spare - done))
    solve = Solve(revision, own, offers, trigger, tuple(sorted(to_spare - done)))
    begun_s = state.replanning.trigger_s if state.replanning.urgent or state.replanning.ordered else now_s
    state = replace(
        state,
        replanning=replace(
            state.replanning,
            revision=revision,
            replan=Replan(solve, begun_s, ordered=state.replanning.ordered),
            urgent=False,
            ordered=False,
            considered=frozenset(offer.vehicle for offer in offers),
        ),
    )
    names = ", ".join(offer.vehicle for offer in offers)
    text = f"re-plan {revision}: {count_of(len(alone), 'segment')} without a vehicle ({trigger}); planning for {names}"
    return state, (Say(Level.INFO, text), solve)


def _under_way(state: FleetState, offers: tuple[Survivor, ...]) -> frozenset[int]:
    """Return what somebody flies, or flies to, and keeps: another that carries it as well need not fly it again."""
    return frozenset(
        segment_of(visit)
        for offer in offers
        if offer.airborne
        for visit in state.vehicles[offer.vehicle].remaining_visits()
        if visit not in offer.tail
    )


def _count_attempts(state: FleetState, alone: frozenset[int]) -> tuple[FleetState, frozenset[int]]:
    """Count how often what is without a vehicle was flown in vain; what nobody flew past was not."""
    flown = alone & flown_past(state)
    attempts = {
        **state.coverage.attempts,
        **{segment: state.coverage.attempts.get(segment, 0) + 1 for segment in flown},
    }
    hopeless = frozenset(segment for segment in flown if attempts[segment] > ATTEMPTS)
    state = replace(
        state,
        coverage=replace(
            state.coverage, attempts=MappingProxyType(attempts), given_up=state.coverage.given_up | hopeless
        ),
    )
    return state, alone - hopeless


def _nobody(context: Context, state: FleetState, alone: frozenset[int]) -> tuple[FleetState, tuple[Command, ...]]:
    back = any(
        one.stage is Stage.RETURNING and one.fault is None and not one.orders.excluded
        for one in state.vehicles.values()
    )
    if state.on_mission() or not alone:
        return state, ()  # somebody is landing, or about to: it may fly again
    if back and context.fly_again is FlyAgain.AUTO:
        return state, ()
    state = replace(
        state,
        coverage=replace(state.coverage, given_up=state.coverage.given_up | alone),
        replanning=replace(state.replanning, urgent=False),
    )
    waiting = any(
        one.stage in {Stage.GROUND, Stage.LANDED} and one.fault is None and not one.orders.excluded
        for one in state.vehicles.values()
    )
    who = "no vehicle in the air can take over" if waiting else "no vehicle is left to inspect"
    return state, (Say(Level.WARNING, f"{who} {listed(context, alone)}"),)


def solved(
    context: Context, state: FleetState, event: SolveEnded, now_s: float
) -> tuple[FleetState, tuple[Command, ...]]:
    """Take the solver's answer: check that it still fits, then upload."""
    plan = state.replanning.replan
    if plan is None or event.revision != plan.solve.revision or plan.solve_s is not None:
        return state, ()  # made stale by a newer fault
    if event.routes is None:
        state = wanted_again(state, plan)
        state = replace(state, replanning=replace(state.replanning, wait_until_s=now_s + RETRY_S))
        return state, (Say(Level.WARNING, f"re-plan {event.revision} failed: {event.reason}; trying again"),)
    late = [offer.vehicle for offer in plan.solve.survivors if not still_fits(state.vehicles[offer.vehicle], offer)]
    if late:
        state = wanted_again(state, plan)
        return state, (
            Say(Level.INFO, f"re-plan {event.revision} came too late for {', '.join(late)}; planning again"),
        )
    routes = {route.vehicle: route.visits for route in event.routes}
    unmade = tuple(
        NewRoute(offer.vehicle, visits)
        for offer in plan.solve.survivors
        if (visits := routes.get(offer.vehicle, ())) != offer.tail
    )
    for route in unmade:
        vehicle = state.vehicles[route.vehicle]
        state = state.put(replace(vehicle, assignment=replace(vehicle.assignment, pending=event.revision)))
    lines: list[Command] = [Say(Level.INFO, found_words(event, [route.vehicle for route in unmade]))]
    if event.gain is not None and event.gain.short:
        lines.append(Say(Level.WARNING, short_words(event.gain)))
    if event.uncovered:
        what = f"the budgets that are left do not cover {listed(context, event.uncovered)}"
        lines.append(Say(Level.WARNING, what))
    plan = replace(
        plan,
        solve_s=event.solve_s,
        solved_s=now_s,
        uncovered=event.uncovered,
        gain=event.gain,
        unmade=unmade,
        pending=frozenset(route.vehicle for route in unmade),
    )
    given_up = state.coverage.given_up | set(event.uncovered)
    state, commands = _compose(
        context,
        replace(
            state,
            replanning=replace(state.replanning, replan=plan),
            coverage=replace(state.coverage, given_up=given_up),
        ),
        plan,
        now_s,
    )
    return state, (*lines, *commands)


def composed(
    context: Context, state: FleetState, event: MissionsWanted, now_s: float
) -> tuple[FleetState, tuple[Command, ...]]:
    """Make some more missions of a re-plan."""
    plan = state.replanning.replan
    if plan is None or plan.solve.revision != event.revision:
        return state, ()
    return _compose(context, state, plan, now_s)


def _compose(context: Context, state: FleetState, plan: Replan, now_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Make and send the next missions, with `WAYS_AT_ONCE` or one vehicle's; the others wait for their turn."""
    commands: list[Command] = []
    offers = {offer.vehicle: offer for offer in plan.solve.survivors}
    unmade, ways = list(plan.unmade), 0
    while unmade and ways < WAYS_AT_ONCE:
        route = unmade.pop(0)
        if route.vehicle not in plan.pending:
            continue  # its fault came first
        vehicle, offer = state.vehicles[route.vehicle], offers[route.vehicle]
        if not still_fits(vehicle, offer):
            state, plan, said = let_go(state, plan, route.vehicle, FLEW_ON, now_s)
            commands.append(said)
            continue
        mission = _new_mission(context, vehicle, offer, route.visits)
        plan = replace(plan, missions=MappingProxyType({**plan.missions, route.vehicle: mission}))
        commands.append(Upload(route.vehicle, plan.solve.revision, mission.path, offer.airborne, mission.fence))
        ways += (len(route.visits) + 1) * len(context.vehicles)
    plan = replace(plan, unmade=tuple(unmade))
    if unmade:
        commands.append(Compose(plan.solve.revision))
    state, ended = ended_if_done(replace(state, replanning=replace(state.replanning, replan=plan)), now_s)
    return state, (*commands, *ended)


def all_made(context: Context, state: FleetState, plan: Replan) -> Replan:
    """Make every mission of a re-plan at once, and send none."""
    offers = {offer.vehicle: offer for offer in plan.solve.survivors}
    missions = {
        route.vehicle: _new_mission(context, state.vehicles[route.vehicle], offers[route.vehicle], route.visits)
        for route in plan.unmade
        if route.vehicle in plan.pending
    }
    return replace(plan, unmade=(), missions=MappingProxyType({**plan.missions, **missions}))


def let_go(state: FleetState, plan: Replan, name: str, why: str, now_s: float) -> tuple[FleetState, Replan, Say]:
    """Let go of a part of a re-plan that came too late for one vehicle: what it would have flown is planned anew."""
    plan = replace(plan, pending=plan.pending - {name}, let_go=(*plan.let_go, name))
    vehicle = state.vehicles[name]
    state = state.put(replace(vehicle, assignment=replace(vehicle.assignment, pending=None)))
    state = replace(
        state, replanning=replace(state.replanning, replan=plan, urgent=True, trigger=f"{name}: {why}", trigger_s=now_s)
    )
    return state, plan, Say(Level.INFO, f"{name}: {why}; re-plan {plan.solve.revision} is planned again for it")


def wanted_again(state: FleetState, plan: Replan) -> FleetState:
    """Give a re-plan up; the next one has the same reason and is as old."""
    wanted = replace(
        state,
        replanning=replace(
            state.replanning, replan=None, urgent=True, trigger=plan.solve.trigger, trigger_s=plan.begun_s
        ),
    )
    return replace(wanted, replanning=replace(wanted.replanning, ordered=plan.ordered))


def still_fits(vehicle: VehicleState, offer: Survivor) -> bool:
    """Return whether a vehicle has not flown past what it offered."""
    if vehicle.fault is not None or vehicle.orders.excluded or vehicle.orders.held_s is not None:
        return False
    if not offer.airborne:
        return vehicle.stage in {Stage.GROUND, Stage.LANDED}
    return vehicle.stage in {Stage.FLYING, Stage.STARTING} and vehicle.assignment.waypoint <= offer.kept


def may_be_given(context: Context, vehicle: VehicleState, *, mixed: bool) -> bool:
    """Return whether the upload of a mission that failed is begun again.

    Args:
        context: Of the flight.
        vehicle: Who is given it.
        mixed: Whether a part of it is on board: then it is better whole, also with its pilot.
    """
    if vehicle.stage is Stage.RETURNING or comes_down(context, vehicle):
        return False  # it is left to its way home, and to its landing
    return mixed or (not vehicle.orders.excluded and vehicle.stage not in {Stage.PILOT, Stage.DOWN, Stage.LOST})


def _new_mission(context: Context, vehicle: VehicleState, offer: Survivor, visits: tuple[int, ...]) -> NewMission:
    """Return a survivor's whole new mission.

    In flight the beginning stays as it is, item for item, so that the autopilot's index keeps its meaning.
    """
    if not offer.airborne or vehicle.assignment.board is None:
        path = flight_path(context.setup, vehicle.name, visits)
        return NewMission(path, visits, True, wider_fence(context, vehicle.name, vehicle.assignment.fence, path))
    kept = {waypoint.visit for waypoint in vehicle.assignment.board.path.waypoints[: offer.kept]}
    stay = tuple(visit for index, visit in enumerate(vehicle.assignment.board.visits) if index in kept)
    path = continue_path(context.setup, vehicle.assignment.board.path, offer.kept, visits)
    fence = wider_fence(context, vehicle.name, vehicle.assignment.fence, path)
    return NewMission(path, (*stay, *visits), False, fence)


def ended_if_done(state: FleetState, now_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Close the re-plan once every new mission is on board, or known not to come on board."""
    plan = state.replanning.replan
    if plan is None or plan.solve_s is None or plan.pending:
        return state, ()
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
    )
    state = replace(
        state,
        replanning=replace(
            state.replanning, replan=None, records=(*state.replanning.records, record), orphans_since_s=None
        ),
    )
    since_s = record.ended_s - record.begun_s
    text = f"re-plan {record.revision} is on board" + (
        f", {since_s:.1f} s after it was needed" if since_s <= OLD_NEED_S else ""
    )
    if plan.failed:
        text = f"re-plan {record.revision} ended; not uploaded to {', '.join(plan.failed)}"
    elif not plan.missions.keys() - set(plan.let_go):
        text = f"re-plan {record.revision} ended; no mission has changed"
    return state, (Say(Level.INFO, text),)
