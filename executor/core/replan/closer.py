"""Coming down on the way: who inspects from its layer because another's way was there does so no longer than that.

What others may still fly becomes less with each leg. As soon as a vehicle may come down to a part of the line ahead of
it, it is given the same visits again with that part at the asked distance. Nothing depends on when anybody flies: until
then, and where the new mission does not come on board, it inspects from its layer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from executor.core.commands import Command, Level, Say, Solve, Survivor
from executor.core.context import Context
from executor.core.events import NewRoute, SolveEnded
from executor.core.hours import within_hours
from executor.core.replan import apart, replanning, survivors
from executor.core.replan.wording import listed
from executor.core.state import FleetState, Replan
from executor.core.vehicle import VehicleState
from missions import continue_path, estimate
from missions.asked import lies_lower
from planner import segment_of

Stepped = tuple[FleetState, tuple[Command, ...]]

LOOKED_S = 1.0
MOST_LOST = 0.05
"""Of a vehicle's frames: a mission that nobody needs is not sent over a link on which its upload may break off."""


def closer(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Give a vehicle the mission on which it comes down to more of the line, if there is one for whom that is free."""
    known = state.replanning
    if (
        not apart.leaves_layers(context)
        or known.replan is not None
        or known.urgent
        or known.ordered
        or known.orphans_since_s is not None
        or state.progress.recalled
        or state.progress.finished
        or state.progress.launched_s is None
        or state.listening.silent_since_s is not None
        or now_s < max(known.wait_until_s, known.closer_s + LOOKED_S)
        or apart.closing(context, state, now_s)
    ):
        return state, ()
    state = replace(state, replanning=replace(known, closer_s=now_s))
    found = next(_in_layers(context, state, now_s), None)
    if found is None:
        return state, ()
    return _looked_at(context, state, *found, now_s)


def _in_layers(context: Context, state: FleetState, now_s: float) -> Iterator[tuple[VehicleState, Survivor]]:
    """Yield who has something ahead that it inspects from its layer; each second another one comes first."""
    names = list(state.vehicles)
    stays, first = apart.stays_in_layer(context.vehicles), int(now_s) % len(names)
    for name in (*names[first:], *names[:first]):
        vehicle = state.vehicles[name]
        board, lost = vehicle.assignment.board, vehicle.link.quality.lost
        if board is None or name in stays or (lost is not None and lost > MOST_LOST):
            continue
        if not any(lies_lower(context.setup, name, segment_of(visit)) for visit in vehicle.remaining_visits()):
            continue
        offer = survivors.survivor(context, vehicle, now_s)
        if offer is None or not offer.airborne or not offer.tail:
            continue
        ahead = {segment_of(visit) for visit in offer.tail} - apart.low_on_board(vehicle, offer)
        if any(lies_lower(context.setup, name, segment) for segment in ahead):
            yield vehicle, within_hours(context, state, offer, now_s)


def _looked_at(context: Context, state: FleetState, vehicle: VehicleState, offer: Survivor, now_s: float) -> Stepped:
    name, before = vehicle.name, apart.low_on_board(vehicle, offer)
    [offer] = apart.kept_apart(context, state, [offer], (), now_s)
    revision = state.replanning.revision + 1
    solve = Solve(revision, tuple(sorted(map(segment_of, offer.tail))), (offer,), "", given=offer.tail)
    plan = Replan(solve, now_s, closer=True)
    low = apart.chosen(context, state, plan, {name: offer.tail}, now_s)[name]
    if not low > before or not _affords(context, vehicle, offer, low):
        return state, ()
    why = f"{name}: nobody else comes to {listed(context, low - before)} any more; new mission at the asked distance"
    plan = replace(plan, solve=replace(solve, trigger=why))
    state = replace(state, replanning=replace(state.replanning, revision=revision, replan=plan))
    answer = SolveEnded(revision, (NewRoute(name, offer.tail),), (), 0.0, "")
    state, commands = replanning.solved(context, state, answer, now_s)
    return state, (Say(Level.INFO, why), *commands)


def _affords(context: Context, vehicle: VehicleState, offer: Survivor, low: frozenset[int]) -> bool:
    """Return whether what is left of a vehicle's budget takes it down there and home."""
    board = vehicle.assignment.board
    if board is None:
        return False
    path = continue_path(apart.around(context, (offer,)), board.path, offer.kept, offer.tail, low)
    legs = estimate(path, context.pricing.models[vehicle.name]).legs[offer.kept :]
    return sum(leg.energy_pct for leg in legs) * offer.consumption <= offer.budget_pct
