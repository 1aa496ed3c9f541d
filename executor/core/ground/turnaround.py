"""Manage a vehicle at its base between two sorties: pack change, checks, next sortie.

It waits for the crew's swap, which names the pack. Then it is checked as before a first flight: readiness, battery and
rest voltage, and parameters as the flight set them. If the checks pass, it gets its next sortie of the day, or open
segments without a day's plan, and starts once the mission is on board. If they fail, the clearance ends with one line;
no vehicle starts on an old one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

from executor.core.battery import account
from executor.core.battery.account import PercentRounding
from executor.core.battery.pack_condition import LEAST_SPARE_PCT, PackState, RestReading
from executor.core.battery.voltage import VoltageState
from executor.core.context import Context, VehicleSetup
from executor.core.formatting import format_count, format_duration
from executor.core.ground import pack_count
from executor.core.ground.out_of_service import (
    clear_for_takeoff,
    find_vehicles_at_base,
    return_to_service,
)
from executor.core.interface.commands import Command, Examine, Level, Solve
from executor.core.interface.events import Examined, SolveEnded
from executor.core.interface.intents import Intent, IntentReason, Outcome, Reason, fill_in
from executor.core.lines import operator, sorties
from executor.core.preflight import vehicle_checks
from executor.core.preflight.onboard_failsafes import read_link_failsafe
from executor.core.preflight.readiness import AWAY, OUT_OF_SERVICE, find_obstacles
from executor.core.replanning import replan_cycle, survivors
from executor.core.replanning.survivors import find_remaining_hours, min_draw_pct
from executor.core.state.bases import base_of, find_planned_landing, is_at_closed_base, place_vehicles, settle_at_base
from executor.core.state.fleet_state import FleetState, Replan, Stepped, step_each
from executor.core.state.vehicle_parts import CLEARED_S, PlannedSortie, PowerState
from executor.core.state.vehicle_state import VehicleState, current_setup_of
from missions import build_flight_path, estimate
from planner import segment_of

READY_S = 90.0
"""Time for a vehicle to become ready after the swap: it boots, gets a fix and settles."""
LATE_S = 30.0
"""Further time after which its checks count as failed."""
PLACELESS_S = 10.0
"""Time without a position after which it may have rebooted: ArduPilot then sends only HEARTBEATs until requested."""


def begin_turnaround(
    context: Context, state: FleetState, vehicle: VehicleState, intent: Intent, now_s: float
) -> Stepped:
    """Begin a turnaround on the crew's report that the pack is changed and the pad clear."""
    state, ready = return_to_service(state, vehicle)
    turned = settle_at_base(context, ready).with_turn(label=intent.pack, asked_s=now_s, intent=intent.id, ready_s=None)
    return state.put(turned), (Examine(vehicle.name),)


def apply_examination(context: Context, state: FleetState, event: Examined, now_s: float) -> Stepped:
    """Apply the checks of a vehicle: it may fly, with which budget, or stays."""
    vehicle = state.vehicles[event.vehicle]
    if vehicle.turn.asked_s is None or vehicle.turn.ready_s is not None:
        return state, ()
    rebooted = vehicle.sortie.rebooted_s is not None
    if event.ready and event.changed and not event.sets and (rebooted or vehicle.turn.moved):
        # Lost at a reboot, or for the heights of another pad; any other change was intended.
        line = sorties.PARAMETERS_SET if rebooted else sorties.PARAMETERS_MOVED
        said = line.say(vehicle=vehicle.name, changes="; ".join(event.changed))
        return state, (said, Examine(vehicle.name, sets=True))
    if why := _describe_unreadiness(context, state, vehicle, event, now_s):
        return end_turnaround(state, vehicle, IntentReason.NOT_READY, why, now_s)
    claimed_pct, parameters = event.remaining_pct or 0.0, dict(event.parameters)
    setup = context.vehicles[vehicle.name].with_pack(vehicle.turn.label)
    found = vehicle_checks.assess_pack_at_rest(setup, claimed_pct, event.voltage_v, event.cells, parameters)
    held_pct = claimed_pct if found is None else found.held_pct
    vehicle = _install_pack(setup, vehicle, event, held_pct, now_s)
    state = state.put(vehicle)
    named = sorties.NAMED_PACK.format(label=vehicle.turn.label) if vehicle.turn.label else sorties.ITS_PACK
    pack = named + (sorties.REPORTS.format(left_pct=claimed_pct) if found is None else f" {found.standing.words}")
    if held_pct < setup.reserve_pct + LEAST_SPARE_PCT:
        why = sorties.PACK_POOR.format(pack=pack, reserve_pct=setup.reserve_pct)
        return end_turnaround(state, vehicle, IntentReason.PACK_POOR, why, now_s)
    line, budget_pct, more = sorties.CHECKS_PASSED, survivors.build_pad_survivor(context, state, vehicle).budget_pct, ""
    if known := vehicle_checks.describe_pack_history(setup, context.drone.capacity_ah):
        more = f"; {sorties.NAMED_PACK.format(label=vehicle.turn.label)}{known}"
    if budget_pct < setup.budget_pct - survivors.QUANTUM_PCT:
        line = line.with_level(Level.WARNING)
        more += sorties.BUDGET.format(budget_pct=budget_pct, planned_pct=setup.budget_pct)
    if context.day is not None:
        state = state.put(vehicle.with_turn(ready_s=now_s, moved=False))
    else:
        state = clear_for_takeoff(state, vehicle.with_turn(asked_s=None), now_s)
        state = _close_intent(state, vehicle, Outcome.DONE, (None, sorties.PASSED_REPLANNING), now_s)
        more += sorties.REPLANNING_WITH_IT
    return state, (line.say(vehicle=vehicle.name, pack=pack, more=more),)


def advance_turnarounds(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Send out ready vehicles, end overdue turnarounds, and open the later sorties of lost vehicles."""

    def advance(state: FleetState, name: str) -> Stepped:
        state, told = _release_later_sorties(context, state, state.vehicles[name])
        state, more = _advance_turnaround(context, state, state.vehicles[name], now_s)
        return state, (*told, *more)

    state, told = _release_packless_sorties(context, state, now_s)
    state, more = step_each(state, state.vehicles, advance)
    return state, (*told, *more)


def apply_sortie_solution(context: Context, state: FleetState, event: SolveEnded, now_s: float) -> Stepped:
    """Apply the solver's answer; without a route for the sortie the clearance ends."""
    plan = state.replanning.replan
    state, commands = replan_cycle.apply_solution(context, state, event, now_s)
    if plan is None or not plan.solve.sortie or event.routes is None or state.replanning.replan is not None:
        return state, commands
    vehicle, offer = state.vehicles[plan.solve.sortie], plan.solve.survivors[0]
    if vehicle.turn.asked_s is None or any(route.visits for route in event.routes):
        return state, commands
    asked = frozenset((*plan.solve.open_segments, *plan.solve.left_over))
    left_s, later_s = find_remaining_hours(context, state, vehicle.name, now_s, ahead_s=CLEARED_S)
    full_pct, in_time_pct = current_setup_of(context, vehicle).budget_pct, min_draw_pct(context, left_s)
    if later_s is None:  # no later hours
        full_pct = min(full_pct, in_time_pct)
    good = offer.budget_pct >= full_pct - 2.0 * survivors.QUANTUM_PCT
    turn = replace(vehicle.turn, beyond=vehicle.turn.beyond | asked if good else vehicle.turn.beyond)
    if good and turn.ahead:
        turn = replace(turn, ahead=turn.ahead[1:])
    why = sorties.NOT_IN_BUDGET
    if in_time_pct < survivors.build_pad_survivor(context, state, vehicle).budget_pct:
        why = sorties.NOT_IN_HOURS
    why = why.format(budget_pct=offer.budget_pct, left="" if math.isinf(left_s) else format_duration(left_s))
    state, more = end_turnaround(state, replace(vehicle, turn=turn), IntentReason.NOTHING_TO_PLAN, why, now_s)
    return state, (*commands, *more)


def queue_first_sorties(context: Context, state: FleetState, now_s: float) -> FleetState:
    """Return the state at a day's launch: the confirmation clears every first sortie that may begin now."""
    for vehicle in state.vehicles.values():
        stays = vehicle.armed or sorties.REBOOTED in find_obstacles(context, state, vehicle, now_s)
        flies = find_next_sortie(state, vehicle) and not stays
        if flies and not describe_hours_conflict(context, state, vehicle, now_s):
            state = state.put(vehicle.with_turn(asked_s=now_s, ready_s=now_s))
    return state


def record_sortie_start(state: FleetState, name: str, now_s: float) -> FleetState:
    """Return the state with a vehicle's next sortie on board and commanded to start."""
    vehicle = state.vehicles[name]
    state = state.put(vehicle.with_turn(asked_s=None, ready_s=None, ahead=vehicle.turn.ahead[1:]))
    return _close_intent(state, vehicle, Outcome.DONE, (None, sorties.ON_BOARD), now_s)


def end_turnarounds_after_absence(state: FleetState, now_s: float) -> Stepped:
    """End clearances from before an absence of the ground station: a person may be at the pad by now."""
    pending = frozenset[str]() if state.replanning.replan is None else state.replanning.replan.pending
    turned = [one for one in state.vehicles.values() if one.name not in pending]
    code, why = IntentReason.OVERTAKEN, sorties.AWAY_MEANWHILE
    return step_each(state, turned, lambda state, one: end_turnaround(state, one, code, why, now_s))


def find_awaited_vehicles(context: Context, state: FleetState, now_s: float) -> tuple[str, ...]:
    """Return the vehicles at their bases in turnaround, or with a sortie to follow one."""
    day, launched_s = context.day, state.progress.launched_s
    if launched_s is None or state.progress.recalled:
        return ()
    over = day is None or now_s - launched_s >= day.ends_s
    open_ = frozenset[int]() if over else find_unplanned_segments(context, state)

    def has_more(vehicle: VehicleState) -> bool:
        stock = pack_count.count_packs(context, state, vehicle.name, now_s)
        if stock is not None and stock.exhausted:
            return False
        work = bool(find_next_sortie(state, vehicle) or open_ - vehicle.turn.beyond)
        serves = work and is_in_service(context, state, vehicle, now_s)
        return serves and not _is_done_for_day(context, state, vehicle, now_s)

    return tuple(
        name
        for name, vehicle in state.vehicles.items()
        if vehicle.turn.asked_s is not None or (not over and has_more(vehicle))
    )


def _is_done_for_day(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> bool:
    left_s, later_s = find_remaining_hours(context, state, vehicle.name, now_s, ahead_s=CLEARED_S)
    return later_s is None and min_draw_pct(context, left_s) < LEAST_SPARE_PCT


def is_in_service(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle at its base needs only a pack, or its base opened, for another sortie."""
    return not find_obstacles(context, state, vehicle, now_s).keys() & OUT_OF_SERVICE


def find_unplanned_segments(context: Context, state: FleetState) -> frozenset[int]:
    """Return the open segments in no sortie."""
    return replan_cycle.find_left_over_segments(state) | replan_cycle.find_orphan_segments(context, state)


def find_next_sortie(state: FleetState, vehicle: VehicleState) -> tuple[int, ...]:
    """Return the open visits of a vehicle's next sortie that has any."""
    others = frozenset(
        segment_of(visit)
        for one in state.mission_vehicles()
        if one.name != vehicle.name
        for visit in one.remaining_visits()
    )  # fmt: skip
    return next(iter(_list_open_sorties(state, vehicle, others)), ())


def describe_awaited_sortie(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:
    """Return what a vehicle at its base waits for; empty if the day has nothing for it."""
    if context.day is None or state.progress.launched_s is None or not is_in_service(context, state, vehicle, now_s):
        return ""
    if is_at_closed_base(context, state, vehicle):
        return sorties.BASE_CLOSED[1]
    if _is_done_for_day(context, state, vehicle, now_s):
        return ""
    visits = find_next_sortie(state, vehicle)
    open_ = len(visits) or len(find_unplanned_segments(context, state) - vehicle.turn.beyond)
    if not open_:
        return ""
    awaited = sorties.AWAITED if visits else sorties.AWAITED_OPEN
    waits = awaited.format(number=len(vehicle.turn.sorties) + 1, segments=format_count(open_, "segment"))
    packs = pack_count.describe_packs(pack_count.count_packs(context, state, vehicle.name, now_s))
    return sorties.WITH_PACKS.format(waits=waits, packs=packs) if packs else waits


def describe_hours_conflict(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:
    """Return why a vehicle's next sortie does not fit its hours; empty if it does, or there are none.

    In its last hours part of the sortie is flown, as far as time permits.
    """
    left_s, later_s = find_remaining_hours(context, state, vehicle.name, now_s, ahead_s=CLEARED_S)
    visits = find_next_visits(context, state, vehicle, now_s)
    lasts_s = _estimate_sortie(context, vehicle, visits)[0] if visits and math.isfinite(left_s) else 0.0
    part = later_s is None and min_draw_pct(context, left_s) >= LEAST_SPARE_PCT
    if part or 0.0 < lasts_s <= left_s or (not lasts_s and left_s > 0.0):
        return ""
    lasts = format_duration(lasts_s)
    if later_s is None:
        return sorties.NO_HOURS.format(lasts=lasts)
    return sorties.NOT_IN_NEXT_HOURS.format(lasts=lasts, later=format_duration(later_s))


def _describe_unreadiness(
    context: Context, state: FleetState, vehicle: VehicleState, event: Examined, now_s: float
) -> str:
    """Return why a vehicle may not fly with any pack; empty if it may."""
    setup, obstacles = context.vehicles[vehicle.name], find_obstacles(context, state, vehicle, now_s)
    if not event.ready or event.remaining_pct is None:
        return event.reason or sorties.NO_BATTERY_STATE
    for line in (operator.OFF_PAD, operator.TILTED):
        if line in obstacles:
            return obstacles[line][1]
    if event.changed:
        return sorties.PARAMETERS_DIFFER.format(change=event.changed[0])
    own = read_link_failsafe(setup.dialect, dict(event.parameters))
    if own.acts is not None and (own.after_s if own.acts else None) != setup.failsafe_s:
        return sorties.FAILSAFE_DIFFERS.format(failsafe=own.words)
    return ""


def _install_pack(
    setup: VehicleSetup, vehicle: VehicleState, event: Examined, held_pct: float, now_s: float
) -> VehicleState:
    """Return a vehicle with its battery account restarted; its learned figures stay."""
    known, claimed_pct = vehicle.power, event.remaining_pct or 0.0
    prior = account.derive_prior(known.battery, setup.prior)
    battery = account.restart_account(known.battery, claimed_pct, 0, now_s, prior, setup.dialect.percent_middle)
    facts = vehicle_checks.pack_facts_from_parameters(dict(event.parameters))
    rest = None if event.voltage_v is None else RestReading(event.voltage_v, claimed_pct, now_s)
    power = PowerState(
        battery=battery,
        roundings=PercentRounding(),
        volts=VoltageState(set_cells=facts.override_with(setup.pack).cells),
        pack=PackState(known.pack.facts.override_with(facts), rest=rest, resting=rest is not None),
        began_pct=known.began_pct,
    )
    turn = replace(vehicle.turn, swaps=vehicle.turn.swaps + 1, overstated_pct=max(0.0, claimed_pct - held_pct))
    return replace(vehicle, power=power, turn=turn)


def _release_later_sorties(context: Context, state: FleetState, vehicle: VehicleState) -> Stepped:
    """Open the later sorties of a vehicle that is out of the plan to others."""
    stays = vehicle.is_pulled_out or is_at_closed_base(context, state, vehicle)
    if not vehicle.turn.ahead or not stays:
        return state, ()
    state, left = _open_later_sorties(context, state, (vehicle,))
    said = sorties.OPENED.say(vehicle=vehicle.name, segments=format_count(left, "segment"))
    return state, (said,) if left else ()


def _release_packless_sorties(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Open the later sorties of vehicles whose base has no more packs for the day.

    A vehicle in turnaround may leave its pack to another one.
    """
    commands: list[Command] = []
    for base in () if context.day is None else context.day.packs:
        vehicles = find_vehicles_at_base(context, state, base)
        turned = any(vehicle.turn.asked_s is not None for vehicle in vehicles)
        waiting = () if turned else tuple(vehicle for vehicle in vehicles if vehicle.turn.ahead)
        stock = pack_count.count_packs(context, state, waiting[0].name, now_s) if waiting else None
        if stock is not None and stock.exhausted:
            state, left = _open_later_sorties(context, state, waiting)
            segments, packs = format_count(left, "segment"), pack_count.describe_packs(stock)
            commands += [sorties.PACKS_GONE.say(packs=packs, segments=segments)] if left else []
    return state, tuple(commands)


def _open_later_sorties(
    context: Context, state: FleetState, vehicles: tuple[VehicleState, ...]
) -> tuple[FleetState, int]:
    """Open the later sorties of vehicles; return the state and the number of segments."""
    visits = {segment_of(visit) for own in vehicles for sortie in own.turn.ahead for visit in sortie.visits}
    left = visits - set(state.coverage.inspected)
    for vehicle in vehicles:
        state = state.put(vehicle.with_turn(ahead=()))
    return replace(state, coverage=replan_cycle.set_aside_segments(context, state.coverage, left)), len(left)


def _advance_turnaround(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    turn, plan = vehicle.turn, state.replanning.replan
    if turn.asked_s is None or (plan is not None and vehicle.name in plan.pending):
        return state, ()
    if over := _find_end_reason(context, state, vehicle, now_s):
        return end_turnaround(state, vehicle, *over, now_s)
    # The first reports after launch arrive within a moment.
    placed = _last_position_s(vehicle) >= now_s - context.limits.link_stale_s
    unknown = vehicle.power.battery.remaining_pct is None or not placed
    busy = plan is not None or now_s < state.replanning.wait_until_s or unknown
    if turn.ready_s is None or busy or not _is_slot_free(context, state, vehicle, now_s):
        return state, ()
    return _assign_next_sortie(context, state, vehicle, turn.ready_s, now_s)


def _find_end_reason(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Reason | None:
    """Return why the clearance of a vehicle no longer holds; None if it does."""
    turn, obstacles = vehicle.turn, find_obstacles(context, state, vehicle, now_s)
    if operator.ABORTED in obstacles:
        return operator.ABORTED
    if operator.BASE_CLOSED in obstacles:
        return sorties.BASE_CLOSED
    if obstacles.keys() & (AWAY | {operator.WITH_PILOT, operator.OUT_OF_PLAN}):
        return fill_in(sorties.ELSEWHERE, stage=vehicle.stage.value)
    if turn.ready_s is None:
        late = now_s - (turn.asked_s or now_s) > READY_S + LATE_S
        return sorties.UNFINISHED if late else None
    if sorties.REBOOTED in obstacles:
        return sorties.REBOOTED
    if now_s - max(turn.ready_s, _last_position_s(vehicle)) > PLACELESS_S:
        return fill_in(sorties.PLACELESS, placeless_s=PLACELESS_S)
    expired = now_s - turn.ready_s > CLEARED_S
    return fill_in(sorties.EXPIRED_CLEARANCE, cleared_s=CLEARED_S) if expired else None


def _last_position_s(vehicle: VehicleState) -> float:
    return -math.inf if vehicle.motion.fix is None else vehicle.motion.fix.at_s


def _is_slot_free(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether no other vehicle has just taken off from the same base."""
    day = context.day
    if day is None:
        return True
    base = base_of(context, vehicle)
    began = (
        one.turn.sorties[-1].began_s
        for one in state.vehicles.values()
        if one.name != vehicle.name and one.turn.sorties
        and (one.turn.sorties[-1].base or day.bases.get(one.name, "")) == base
    )  # fmt: skip
    return now_s - max(began, default=-math.inf) >= day.stagger_s


def _assign_next_sortie(
    context: Context, state: FleetState, vehicle: VehicleState, ready_s: float, now_s: float
) -> Stepped:
    """Assign a vehicle its next sortie: as planned, or planned again from open segments within its budget."""
    offer, pool = survivors.build_pad_survivor(context, state, vehicle), find_unplanned_segments(context, state)
    visits, said = find_next_sortie(state, vehicle), list[Command]()
    pool -= set(offer.barred) | vehicle.turn.beyond
    if not visits and not pool and (found := find_sortie_to_take_over(context, state, vehicle, now_s)):
        giver, visits = found
        ahead = state.vehicles[giver].turn.ahead
        kept = tuple(sortie for sortie in ahead if not set(visits) & set(sortie.visits))
        vehicle = vehicle.with_turn(ahead=(PlannedSortie(visits, 0.0),))
        state = state.put(state.vehicles[giver].with_turn(ahead=kept)).put(vehicle)
        count = format_count(len(visits), "segment")
        said.append(sorties.TAKES_OVER.say(vehicle=vehicle.name, giver=giver, segments=count))
    if not visits and not pool:
        return end_turnaround(state, vehicle, IntentReason.NOTHING_TO_PLAN, sorties.NO_SEGMENT, now_s)
    ahead = vehicle.turn.ahead  # from the first sortie with an open visit
    while ahead and not set(visits) & set(ahead[0].visits):
        ahead = ahead[1:]
    vehicle = vehicle.with_turn(ahead=ahead or (PlannedSortie((), 0.0),)).with_orders(cleared_s=ready_s)
    planned, stands = vehicle.turn.ahead[0], base_of(context, vehicle)
    in_place = planned.base in {"", stands} and planned.lands not in state.crew.closed_bases
    lands = planned.lands if visits and in_place and planned.lands != stands else ""
    vehicle = vehicle.with_turn(lands_at=lands)
    whole = bool(visits) and visits == planned.visits and not pool and in_place
    lasts_s, costs_pct = _estimate_sortie(context, vehicle, visits) if whole else (0.0, 0.0)
    left_s, _ = find_remaining_hours(context, state, vehicle.name, now_s, ahead_s=CLEARED_S)
    as_planned = whole and costs_pct * offer.consumption <= offer.budget_pct and lasts_s <= left_s
    if not as_planned:  # it lands within its hours, whatever the route
        most_pct = min_draw_pct(context, left_s)
        offer = replace(offer, budget_pct=min(offer.budget_pct, most_pct), most_pct=min(offer.most_pct, most_pct))
    revision = state.replanning.revision + 1
    own = frozenset(segment_of(visit) for visit in visits)
    trigger = sorties.SORTIE.format(vehicle=vehicle.name, number=len(vehicle.turn.sorties) + 1)
    solve = Solve(
        revision, tuple(sorted(own)), (offer,), trigger, tuple(sorted(pool - own)), vehicle.name,
        visits if as_planned else (),
    )  # fmt: skip
    state = state.put(vehicle).with_replanning(revision=revision, replan=Replan(solve, now_s))
    line, count = sorties.AS_PLANNED if as_planned else sorties.REPLANNED, format_count(len(visits), "segment")
    to = sorties.TO_BASE.format(base=lands) if lands else ""
    return state, (*said, line.say(trigger=trigger, segments=count, to=to), solve)


def find_next_visits(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> tuple[int, ...]:
    """Return the planned visits a vehicle would fly next: its own sortie, or one it takes over."""
    visits = find_next_sortie(state, vehicle)
    if visits or context.day is None:
        return visits
    found = find_sortie_to_take_over(context, state, vehicle, now_s)
    return () if found is None else found[1]


def find_sortie_to_take_over(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> tuple[str, tuple[int, ...]] | None:
    """Return a sortie that a vehicle without one can take over: its owner, the one with most ahead, and open visits.

    The next sortie of a vehicle waiting at its base stays its own.
    """
    givers = [(_list_open_sorties(state, one), one) for one in state.vehicles.values() if one.name != vehicle.name]
    offer, setup = survivors.build_pad_survivor(context, state, vehicle), current_setup_of(context, vehicle)
    full_pct = max(offer.budget_pct, setup.budget_pct)
    for ahead, giver in sorted(givers, key=lambda row: (-len(row[0]), row[1].name)):
        if len(ahead) <= is_in_service(context, state, giver, now_s):
            continue
        visits = ahead[-1]
        barred = {segment_of(visit) for visit in visits} & set(offer.barred)
        if not barred and _estimate_sortie(context, vehicle, visits)[1] * offer.consumption <= full_pct:
            return giver.name, visits
    return None


def _list_open_sorties(
    state: FleetState, vehicle: VehicleState, others: frozenset[int] = frozenset()
) -> list[tuple[int, ...]]:
    """Return the open visits of each later sortie of a vehicle, without those others fly now."""
    gone = others | set(state.coverage.inspected) | set(state.coverage.unseen) | state.coverage.given_up
    sorties = (tuple(one for one in sortie.visits if segment_of(one) not in gone) for sortie in vehicle.turn.ahead)
    return [visits for visits in sorties if visits]


def _estimate_sortie(context: Context, vehicle: VehicleState, visits: tuple[int, ...]) -> tuple[float, float]:
    """Return the time of a sortie, and its modelled energy in percent of a full battery."""
    lands = find_planned_landing(context, vehicle, visits)
    on_its_way = vehicle.with_turn(lands_at=lands, asked_s=vehicle.turn.asked_s or 0.0)
    setup = place_vehicles(context, (on_its_way,)).setup
    found = estimate(build_flight_path(setup, vehicle.name, visits), context.pricing.models[vehicle.name])
    return found.duration_s, found.energy_pct


def end_turnaround(state: FleetState, vehicle: VehicleState, code: IntentReason, why: str, now_s: float) -> Stepped:
    """End a clearance without a start: the crew has to give it again."""
    if vehicle.turn.asked_s is None:
        return state, ()
    state = state.put(vehicle.with_turn(asked_s=None, ready_s=None, lands_at="").with_orders(cleared_s=None))
    state = _close_intent(state, vehicle, Outcome.FAILED, (code, why), now_s)
    return state, (sorties.NOT_CLEARED.say(vehicle=vehicle.name, why=why),)


def _close_intent(
    state: FleetState, vehicle: VehicleState, outcome: Outcome, why: tuple[IntentReason | None, str], now_s: float
) -> FleetState:
    intents, (code, text) = state.crew.intents, why
    record = intents.get(vehicle.turn.intent)
    if record is None or record.ended_s is not None:
        return state
    ended = record.end(outcome, text, now_s, code)
    return state.with_crew(intents=MappingProxyType({**intents, vehicle.turn.intent: ended}))
