"""All sets of segments: the best route of one vehicle through each, and what several vehicles cover together.

A set of segments is a number whose bit s says whether segment s is in it. Held and Karp's dynamic program (1962) with
two visits for each segment: a few milliseconds for 14 segments, four times that for each two more.
"""

from __future__ import annotations

import numpy as np

from planner.kernels.arrays import Floats, Ints, Table
from planner.kernels.compiled import kernel


@kernel(counted=True)
def find_best_routes(start: Floats, home: Floats, move: Table, most: float, spent: Table, energy: Floats) -> None:
    """Find the least energy of a route through exactly the segments of each set.

    The figures are added in the order of ``evaluate.py``, so they are the same to the last bit.

    Args:
        start: (2n,) from the vehicle's start to the end of a visit.
        home: (2n,) from the end of a visit home.
        move: (2n, 2n) from the end of visit i to the end of visit j, with the vehicle's consumption.
        most: what a route may spend; routes beyond it are not looked for.
        spent: (2^n, 2n) set to what is spent at the end of visit j when it is the last of a set; inf without a route.
        energy: (2^n,) set to the energy of the best route, inf without one; entry 0, no visit, is left alone.
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
                # No move gives energy back, so what is beyond the limit now never leads to a route within it.
                if least <= most:
                    spent[chosen, visit] = least
                    shortest = min(shortest, least + home[visit])
        energy[chosen] = shortest if shortest <= most else np.inf


@kernel()
def join_sets(cost: Floats, own: Floats, longest: bool, complete: bool, together: Floats, part_of: Ints) -> None:
    """Find what some vehicles and one more cover together at the least cost: 3^n steps at most.

    Args:
        cost: (2^n,) of each set that the vehicles so far cover, infinite where they cannot.
        own: (2^n,) the same of the next vehicle.
        longest: whether the larger of the two counts instead of their sum.
        complete: whether the next vehicle takes all that is left: only the set of everything is looked at.
        together: (2^n,) all infinite; set to what it is together.
        part_of: (2^n,) set to the next vehicle's part, where they can.
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
