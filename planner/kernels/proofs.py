"""Proofs for small instances and re-plans: all subsets of segments, and a lower bound on the energy of plans.

A subset is a number whose bit s is set if it holds segment s. Held and Karp's dynamic program (1962), with two visits
for each segment, finds one vehicle's best route through each subset: a few milliseconds for 14 segments, four times
that for each two more. Their spanning trees with potentials (1971) give the bound.
"""

from __future__ import annotations

import numpy as np

from planner.kernels.arrays import Floats, Ints, Table
from planner.kernels.compiling import kernel


@kernel(counted=True)
def find_best_routes(start: Floats, home: Floats, move: Table, most: float, spent: Table, energy: Floats) -> None:
    """Compute the least energy of a route through exactly the segments of each subset.

    Figures are added in the order of ``evaluate.py``, so results match it to the last bit.

    Args:
        start: (2n,) energy from the vehicle's start to the end of a visit.
        home: (2n,) energy from the end of a visit to the landing place.
        move: (2n, 2n) energy from the end of visit i to the end of visit j, with the vehicle's consumption.
        most: energy limit of a route; routes beyond it are not searched.
        spent: (2^n, 2n) set to the energy spent at the end of visit j when it is the last of a subset; inf without a
            route.
        energy: (2^n,) set to the energy of the best route, inf without one; entry 0, no visit, is left unchanged.
    """
    visits = len(start)
    members = np.empty(visits // 2, dtype=np.int64)
    spent[0, :] = np.inf
    for chosen in range(1, len(energy)):
        count = 0
        for segment in range(visits // 2):
            if chosen >> segment & 1:
                members[count] = segment
                count += 1
        spent[chosen, :] = np.inf
        shortest = np.inf
        for place in range(count):
            segment = members[place]
            before = chosen ^ (1 << segment)
            for visit in range(2 * segment, 2 * segment + 2):
                least = np.inf
                if before == 0:
                    least = start[visit]
                for other in range(count):
                    if other != place:
                        last = 2 * members[other]
                        least = min(least, spent[before, last] + move[last, visit])
                        least = min(least, spent[before, last + 1] + move[last + 1, visit])
                # Moves never return energy, so a partial route beyond the limit cannot lead to a route within it.
                if least <= most:
                    spent[chosen, visit] = least
                    shortest = min(shortest, least + home[visit])
        energy[chosen] = shortest if shortest <= most else np.inf


@kernel()
def join_sets(cost: Floats, own: Floats, longest: bool, complete: bool, together: Floats, part_of: Ints) -> None:
    """Compute the least cost at which some vehicles and one more cover each subset together: at most 3^n steps.

    Args:
        cost: (2^n,) cost of each subset for the vehicles so far, infinite if infeasible.
        own: (2^n,) the same for the next vehicle.
        longest: whether the larger of the two costs counts instead of their sum.
        complete: whether the next vehicle takes all that is left: only the full set is evaluated.
        together: (2^n,) all infinite; set to the joint cost.
        part_of: (2^n,) set to the next vehicle's part where the subset is feasible.
    """
    everything = len(cost) - 1
    for chosen in range(len(cost)):
        before = cost[chosen]
        if before == np.inf:
            continue
        free = everything ^ chosen
        part = free
        while True:
            joined = max(before, own[part]) if longest else before + own[part]
            if joined < together[chosen | part]:
                together[chosen | part] = joined
                part_of[chosen | part] = part
            if part == 0 or complete:
                break
            part = (part - 1) & free


@kernel(counted=True)
def grow_tree(
    links: Table, potential: Floats, distance: Floats, inner: Ints, outer: Ints,
    degree: Floats, used: Floats, last: Ints,
) -> float:  # fmt: skip
    """Return the cost of the minimum spanning tree (Prim); count the end points and the vehicles that it uses.

    Args:
        links: as for ``compute_tree_bound``.
        potential: (2m,), added to the cost of each edge at an end point.
        distance: (m,), the least cost of entering a segment from the root; changed.
        inner: (m,), the end point where it is entered; changed.
        outer: (m,), the end point it is entered from, or -1 - r for the start of vehicle r; changed.
        degree: (2m,), incremented.
        used: (r,), incremented.
        last: (r,), the end point from which a used vehicle returns.
    """
    segments = len(distance)
    points = 2 * segments
    reached = np.zeros(segments, dtype=np.bool_)
    total = 0.0
    for _ in range(segments):
        nearest = -1
        least = np.inf
        for segment in range(segments):
            if not reached[segment] and distance[segment] < least:
                least = distance[segment]
                nearest = segment
        total += least
        reached[nearest] = True
        degree[inner[nearest]] += 1.0
        if outer[nearest] >= 0:
            degree[outer[nearest]] += 1.0
        else:
            vehicle = -1 - outer[nearest]
            used[vehicle] += 1.0
            degree[last[vehicle]] += 1.0
        for point in range(2 * nearest, 2 * nearest + 2):
            for other in range(points):
                if reached[other >> 1]:
                    continue
                cost = links[point, other] + potential[point] + potential[other]
                if cost < distance[other >> 1]:
                    distance[other >> 1] = cost
                    inner[other >> 1] = other
                    outer[other >> 1] = point
    return total


@kernel(counted=True)
def compute_tree_bound(
    links: Table, starts: Table, homes: Table, idle: Floats, once: Ints, enough: float,
    iterations: int,
) -> float:  # fmt: skip
    """Return a lower bound on the cost of visiting ``m`` segments with ``r`` vehicles.

    Every segment is entered once, from another segment or from a start, so the entries form a spanning tree of the
    segments and one root. Every end point has one transit or return leg. Potentials of the end points, and of the
    vehicles that start at most once, penalise trees that violate this; any potentials give a bound, subgradient ascent
    gives a good one.

    Args:
        links: (2m, 2m), the least cost of a transit between end points in either direction; symmetric.
        starts: (r, 2m), cost of entering a segment at an end point from a vehicle's start.
        homes: (r, 2m), cost of the return leg from an end point.
        idle: (r,), cost of an unused vehicle.
        once: (r,), 1 for vehicles that start at most once.
        enough: stop when the bound exceeds this.
        iterations: maximum number of ascent iterations.
    """
    points = len(links)
    segments = points // 2
    fleet = len(starts)
    potential = np.zeros(points)
    price = np.zeros(fleet)
    for vehicle in range(fleet):
        if once[vehicle] == 1:  # the saving from landing elsewhere counts once
            price[vehicle] = max(0.0, idle[vehicle] - homes[vehicle].min())
    best = -np.inf
    step = 1.0
    stalled = 0
    distance = np.empty(segments)
    inner = np.empty(segments, dtype=np.int64)
    outer = np.empty(segments, dtype=np.int64)
    for _ in range(iterations):
        degree = np.full(points, -1.0)
        used = np.full(fleet, -1.0)
        last = np.empty(fleet, dtype=np.int64)
        total = idle.sum() - potential.sum() - price.sum()
        distance[:] = np.inf
        for vehicle in range(fleet):
            way_home = homes[vehicle] + potential
            last[vehicle] = np.argmin(way_home)
            extra = way_home[last[vehicle]] - idle[vehicle] + price[vehicle]
            for point in range(points):
                cost = starts[vehicle, point] + potential[point] + extra
                if cost < distance[point >> 1]:
                    distance[point >> 1] = cost
                    inner[point >> 1] = point
                    outer[point >> 1] = -1 - vehicle
        total += grow_tree(links, potential, distance, inner, outer, degree, used, last)
        if total > best:
            best = total
            stalled = 0
        else:
            stalled += 1
            if stalled >= 8:
                step *= 0.7
                stalled = 0
        if best > enough:
            return best
        norm = np.sum(degree * degree)
        for vehicle in range(fleet):
            if once[vehicle] == 1 and (used[vehicle] > 0.0 or price[vehicle] > 0.0):
                norm += used[vehicle] * used[vehicle]
        if norm <= 0.0:
            return best
        length = step * (1.02 * abs(enough) + 1e-9 - total + 0.02 * abs(total)) / norm
        if length <= 0.0:
            length = step * 0.02 * abs(total) / norm
        potential += length * degree
        for vehicle in range(fleet):
            if once[vehicle] == 1:
                price[vehicle] = max(0.0, price[vehicle] + length * used[vehicle])
    return best
