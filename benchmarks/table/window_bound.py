"""Lower bound of the begin of any plan's re-plan window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner import Instance, PlanError
from planner.bounds import compute_tree_bound_pct
from planner.evaluate import BUDGET_TOLERANCE_PCT


def earliest_window_bound_s(instance: Instance) -> float:
    """Return a lower bound of the begin of any plan's re-plan window, by the definition of ``replan_window``.

    If a vehicle is lost at t, its completed work is one open path of at most t, and the others cover the rest within
    their budgets, some in two flights. So t is at least what such paths and flights need beyond those budgets, divided
    by the lost vehicle's maximum consumption per second. Some vehicle flies when a window begins: the bound is the
    least over all vehicles.

    Raises:
        PlanError: there is one vehicle only.
    """
    fleet = len(instance.vehicles)
    if fleet == 1:
        raise PlanError(f"{instance.vehicles[0].name} is the only vehicle: nobody is left when it is lost")
    if instance.segments == 0:
        return 0.0
    kinds: dict[tuple[object, ...], float] = {}
    for lost, vehicle in enumerate(instance.vehicles):
        kind = (replace(vehicle, name=""), instance.profile[lost], instance.start_pct[lost].tobytes())
        if kind not in kinds:
            kinds[kind] = _earliest_loss_bound_s(instance, lost)
    return min(kinds.values())


def _earliest_loss_bound_s(instance: Instance, lost: int) -> float:
    """Return the earliest time at which the loss of one vehicle can be repaired, with any plan."""
    fleet = len(instance.vehicles)
    consumption = np.array([vehicle.consumption for vehicle in instance.vehicles])[:, np.newaxis]
    again = consumption * instance.depot_pct
    homes = instance.home_pct.copy()
    homes[lost] = 0.0  # its path is open
    others = sum(
        max(0.0, vehicle.budget_pct) + BUDGET_TOLERANCE_PCT
        for number, vehicle in enumerate(instance.vehicles)
        if number != lost
    )
    needed = compute_tree_bound_pct(
        instance, np.ones(fleet, dtype=np.bool_), starts=np.minimum(instance.start_pct, again), homes=homes,
        idle=np.zeros(fleet), enough=2.0 * others, once=lost,
    )  # fmt: skip
    return max(0.0, (needed - others) / _max_pct_per_s(instance, lost))


def _max_pct_per_s(instance: Instance, vehicle: int) -> float:
    every, profile = np.arange(2 * instance.segments), instance.profile[vehicle]
    pairs = (every[:, np.newaxis], every[np.newaxis])
    moves_s, moves_pct = instance.moves.seconds(profile, *pairs), instance.moves.pct(profile, *pairs)
    seconds = np.concatenate([instance.start_s[vehicle], moves_s.ravel()])
    used = np.concatenate([instance.start_pct[vehicle], instance.vehicles[vehicle].consumption * moves_pct.ravel()])
    timed = seconds > 0
    return float((used[timed] / seconds[timed]).max(initial=0.0)) or 1.0
