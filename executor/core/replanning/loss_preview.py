"""What the loss of a vehicle would mean now: the re-plan that would follow, as a problem for the solver."""

from __future__ import annotations

from executor.core.context import Context
from executor.core.interface.commands import Solve
from executor.core.replanning import replan_cycle, replan_separation, survivors
from executor.core.replanning.flying_hours import limit_to_hours
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, suppose_lost
from planner import segment_of


def select_vehicles_to_judge(state: FleetState) -> tuple[str, ...]:
    """Return the vehicles whose loss can be judged; none while the plan is about to change anyway."""
    if (
        state.replanning.replan is not None
        or state.replanning.urgent
        or state.replanning.ordered
        or state.progress.recalled
        or state.progress.launched_s is None
    ):
        return ()
    return tuple(vehicle.name for vehicle in state.mission_vehicles() if vehicle.stage is Stage.FLYING)


def build_judgement_key(state: FleetState) -> tuple[object, ...]:
    """Return what a judgement depends on: between two visits, and without a new plan, it stays as it is."""
    doing = tuple(
        (one.name, one.stage.value, one.orders.held_s is None, one.orders.excluded) for one in state.vehicles.values()
    )
    return (state.replanning.revision, len(state.coverage.inspected), len(state.coverage.given_up), doing)


def build_loss_problem(context: Context, state: FleetState, name: str, now_s: float) -> Solve | tuple[int, ...]:
    """Return the re-plan that the loss of a vehicle would ask for, or what would surely be left over.

    A held vehicle is taken to go on: the operator can let it.
    """
    state = state.put(suppose_lost(state.vehicles[name], now_s))
    alone = replan_cycle.find_orphan_segments(context, state)
    if not alone:
        return ()
    free = (vehicle.with_orders(held_s=None) for vehicle in state.vehicles.values())
    asked = (survivors.build_survivor(context, vehicle, now_s) for vehicle in free)
    offers = tuple(limit_to_hours(context, state, offer, now_s) for offer in asked if offer)
    if not offers:
        return tuple(sorted(alone))
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    wanted = tuple(sorted((alone | freed) - set(state.coverage.inspected) - state.coverage.left_over))
    offers = replan_separation.close_occupied_segments(context, state, offers, wanted, now_s)
    return Solve(state.replanning.revision, wanted, offers, f"what if {name} were lost")
