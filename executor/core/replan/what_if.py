"""What the loss of a vehicle would mean now: the re-plan that would follow, as a problem for the solver."""

from __future__ import annotations

from executor.core.changed import changed
from executor.core.commands import Solve
from executor.core.context import Context
from executor.core.replan import replanning
from executor.core.state import FleetState
from executor.core.vehicle import Fault, FaultCode, FaultKind, Stage
from planner import segment_of


def worth_judging(state: FleetState) -> tuple[str, ...]:
    """Return the vehicles whose loss can be judged; none while the plan is about to change anyway."""
    if state.replan is not None or state.urgent or state.ordered or state.recalled or state.launched_s is None:
        return ()
    return tuple(vehicle.name for vehicle in state.on_mission() if vehicle.stage is Stage.FLYING)


def moment(state: FleetState) -> tuple[object, ...]:
    """Return what a judgement depends on: between two visits, and without a new plan, it stays as it is."""
    doing = tuple((one.name, one.stage.value, one.held_s is None, one.excluded) for one in state.vehicles.values())
    return (state.revision, len(state.inspected), len(state.given_up), doing)


def if_lost(context: Context, state: FleetState, name: str, now_s: float) -> Solve | tuple[int, ...]:
    """Return the re-plan that the loss of a vehicle would ask for, or what would surely be left over.

    A held vehicle is taken to go on: the operator can let it.
    """
    lost = changed(
        state.vehicles[name], stage=Stage.LOST, fault=Fault(FaultKind.LINK, "what if", now_s, FaultCode.LINK_LOST)
    )
    state = state.put(lost)
    alone = replanning.orphans(context, state)
    if not alone:
        return ()
    free = (changed(vehicle, held_s=None) for vehicle in state.vehicles.values())
    offers = tuple(offer for vehicle in free if (offer := replanning.survivor(context, vehicle, now_s)))
    if not offers:
        return tuple(sorted(alone))
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    wanted = tuple(sorted((alone | freed) - set(state.inspected)))
    return Solve(state.revision, wanted, offers, f"what if {name} were lost")
