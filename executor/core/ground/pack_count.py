"""Count the charged packs of each base from the sorties flown, by the rules of the day's plan.

All packs of a base are charged at launch. Each take-off uses the one charged first. A pack can fly again `recharge_s`
after its landing, at the base where it landed, and never where packs charge overnight or when it is lost with its
vehicle. A vehicle in turnaround has its pack. The crew knows better: the pack it inserts is flown, and its own count
replaces this one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from executor.core.context import Context
from executor.core.formatting import format_count, format_duration
from executor.core.ground.out_of_service import find_vehicles_at_base
from executor.core.lines import sorties
from executor.core.state.bases import base_of, landing_base_of
from executor.core.state.fleet_state import CountedPacks, FleetState
from executor.core.state.vehicle_state import Stage

_IN_FLIGHT = frozenset({Stage.STARTING, Stage.FLYING, Stage.RETURNING, Stage.PILOT})


@dataclass(frozen=True, slots=True)
class PackStock:
    """The packs at a base."""

    base: str
    charged: int
    """Packs ready now."""
    next_s: float | None
    """Time after launch when the next one is charged; None if none is charging."""
    exhausted: bool
    """Whether none is charged, and none will be within the day's hours."""


def count_packs(context: Context, state: FleetState, name: str, now_s: float) -> PackStock | None:
    """Return the packs at a vehicle's base; None before launch, or where the plan does not count packs."""
    day, launched_s = context.day, state.progress.launched_s
    base = landing_base_of(context, state.vehicles[name])
    rules = None if day is None else day.packs.get(base)
    if day is None or rules is None or launched_s is None:
        return None
    vehicles, counted = find_vehicles_at_base(context, state, base), state.crew.counted_packs.get(base)
    pool, owed = [launched_s] * rules.count, counted
    taken = set[str]() if counted is None else set(counted.in_vehicles)
    for (at_s, _, name), back_s in sorted(_list_pack_moves(context, state, base, rules.recharge_s)):
        if owed is not None and at_s > owed.at_s:
            pool, owed = _apply_count(pool, owed), None
        if back_s is None and owed is None and name in taken:
            taken.remove(name)  # it had its pack before the crew counted
            continue
        if back_s is not None:
            pool.append(back_s)
        elif pool:  # with none charged, the crew charges faster or has a pack more than the plan
            pool.remove(min(pool))
    pool = pool if owed is None else _apply_count(pool, owed)
    charged, last_s = sum(ready_s <= now_s for ready_s in pool), launched_s + day.ends_s
    next_s = min((ready_s for ready_s in pool if ready_s > now_s), default=math.inf)
    used = any(vehicle.stage in _IN_FLIGHT or vehicle.turn.asked_s is not None for vehicle in vehicles)
    landing_s = now_s + rules.recharge_s if used and rules.recharge_s is not None else math.inf
    exhausted = not charged and min(next_s, landing_s) >= last_s
    return PackStock(base, charged, next_s - launched_s if math.isfinite(next_s) else None, exhausted)


def _apply_count(pool: list[float], counted: CountedPacks) -> list[float]:
    """Return when each pack is charged, after a count by the crew, which excludes packs still charging."""
    return [counted.at_s] * counted.charged + [ready_s for ready_s in pool if ready_s > counted.at_s]


def _list_pack_moves(
    context: Context, state: FleetState, base: str, recharge_s: float | None
) -> list[tuple[tuple[float, bool, str], float | None]]:
    """Return when packs leave the charged ones, and for returned packs when each can fly again."""
    moves: list[tuple[tuple[float, bool, str], float | None]] = []
    for vehicle in state.vehicles.values():
        turn, unflown = vehicle.turn, False
        own = "" if context.day is None else context.day.bases.get(vehicle.name, "")
        for sortie in turn.sorties:
            begins = sortie.base or own
            if begins == base:
                moves.append(((sortie.began_s, True, vehicle.name), None))
            if sortie.ended_s is not None and recharge_s is not None and (sortie.lands or begins) == base:
                moves.append(((sortie.ended_s, False, vehicle.name), sortie.ended_s + recharge_s))
            unflown = sortie.ended_s is None and not vehicle.sortie.took_off
        if turn.asked_s is not None and not unflown and base_of(context, vehicle) == base:
            moves.append(((turn.asked_s, True, vehicle.name), None))
    return moves


def describe_packs(stock: PackStock | None) -> str:
    """Return in words how many packs of a base are left; empty where they are not counted."""
    if stock is None:
        return ""
    if stock.charged:
        return sorties.PACKS_LEFT.format(packs=format_count(stock.charged, "charged pack"), base=stock.base)
    line = sorties.NO_PACK_YET
    if stock.exhausted:
        line = sorties.NO_PACK_LEFT
    elif stock.next_s is not None:
        line = sorties.NO_PACK_UNTIL
    return line.format(base=stock.base, until=format_duration(stock.next_s or 0.0))
