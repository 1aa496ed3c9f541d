"""Prices routes for column generation.

Labels grow visit by visit, each with its energy, its reduced cost and the segments that it must not visit again. A
route's reduced cost is ``weight`` times its energy minus the prizes of its segments. ng-routes (Baldacci, Mingozzi,
Roberti 2011, doi 10.1287/opre.1110.0975) forget a segment as soon as they visit one that does not have it in its
neighbourhood: they include all routes, so their least reduced cost is a lower bound, and are far fewer to distinguish.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from planner.kernels.arrays import Floats, Ints, IntTable, Table
from planner.kernels.compiling import inner, kernel

WORD = 62
"""Segments in one word of a set; a set has two."""
SAME_NODE = 0
"""A label is dominated by one at the same visit with no more energy and reduced cost, whatever either has visited."""
SAME_MEMORY = 1
"""... and whose forbidden segments are a subset."""
SAME_SET = 2
"""... and with the same forbidden segments: no two sets of segments are mixed up."""


class Priced(NamedTuple):
    """What is priced: the routes of one kind of vehicle over ``n`` segments."""

    start: Floats
    """(2n,): energy from the start to the end of a visit."""
    home: Floats
    """(2n,): energy from the end of a visit to the landing place."""
    move: Table
    """(2n, 2n): energy from the end of visit i to the end of visit j."""
    near: IntTable
    """(n, 2): neighbourhood of each segment, a set in two words."""
    budget: float
    """Limit on a route's energy."""
    width: float
    """Energy of one bucket: budget / number of buckets, rounded up."""
    rounds: int
    """1 if every move is longer than a bucket, otherwise the most visits of a route."""


class Labels(NamedTuple):
    """Labels, ``c`` at most, in lists: one for each of ``b`` buckets of energy and ``v`` visits."""

    energy: Annotated[Floats, "c"]
    cost: Annotated[Floats, "c"]
    """Reduced cost."""
    visit: Annotated[Ints, "c"]
    parent: Annotated[Ints, "c"]
    low: Annotated[Ints, "c"]
    """Forbidden segments, the first word."""
    high: Annotated[Ints, "c"]
    link: Annotated[Ints, "c"]
    """Next label of its list, -1 at the end."""
    waiting: Annotated[IntTable, "b v"]
    """First label that is to be extended, -1 without one."""
    kept: Annotated[IntTable, "v b"]
    """First label that was extended, -1 without one."""
    least: Annotated[Table, "v b"]
    """Least reduced cost of those."""


class Completions(NamedTuple):
    """Least reduced cost of what follows the end of a visit, by the bucket of the energy left."""

    first: Annotated[Table, "b v"]
    second: Annotated[Table, "b v"]
    """The least that does not continue with the segment ``after``."""
    after: Annotated[IntTable, "b v"]
    """Segment with which the first continues; -1 for the landing."""


@kernel()
def bound_completions(priced: Priced, weight: float, prize: Floats, bound: Completions) -> None:
    """Compute lower bounds on the reduced cost of completing a route, without loops over two segments.

    Energy is rounded in the route's favour, so every route costs at least this.

    Args:
        priced: the routes.
        weight: cost of one unit of energy.
        prize: (n,): of each segment.
        bound: set.
    """
    buckets, visits = bound.first.shape
    for bucket in range(buckets):
        left = (bucket + 1) * priced.width + 1e-9
        for visit in range(visits):
            home = priced.home[visit]
            bound.first[bucket, visit] = weight * home if home <= left else 1e300
            bound.second[bucket, visit] = 1e300
            bound.after[bucket, visit] = -1
        for _ in range(priced.rounds):
            changed = False
            for visit in range(visits):
                first, second = bound.first[bucket, visit], bound.second[bucket, visit]
                after = bound.after[bucket, visit]
                for onward in range(visits):
                    segment = onward >> 1
                    if segment == visit >> 1:
                        continue
                    move = priced.move[visit, onward]
                    if move > left:
                        continue
                    there = min(bucket, int((left - move) / priced.width))
                    rest = bound.first[there, onward]
                    if bound.after[there, onward] == visit >> 1:
                        rest = bound.second[there, onward]
                    cost = weight * move - prize[segment] + rest
                    if cost < first - 1e-12:
                        if segment != after:
                            second = first
                        first = cost
                        after = segment
                        changed = True
                    elif segment != after and cost < second - 1e-12:
                        second = cost
                        changed = True
                bound.first[bucket, visit], bound.second[bucket, visit] = first, second
                bound.after[bucket, visit] = after
            if not changed:
                break


@inner(inline=True)
def find_completion(bound: Completions, bucket: int, visit: int, low: int, high: int) -> float:
    """Return the least reduced cost of completing a label that must not visit some segments."""
    after = bound.after[bucket, visit]
    least: float = bound.first[bucket, visit]
    if after >= 0:
        forbidden = (low >> after) & 1 if after < WORD else (high >> (after - WORD)) & 1
        if forbidden == 1:
            least = bound.second[bucket, visit]
    return least


@inner()
def is_dominated(labels: Labels, label: int, bucket: int, rule: int) -> bool:
    """Return whether a label is dominated by one that was extended."""
    visit, energy, cost = labels.visit[label], labels.energy[label], labels.cost[label]
    low, high = labels.low[label], labels.high[label]
    for earlier in range(bucket, -1, -1):
        if labels.least[visit, earlier] > cost + 1e-12:
            continue
        other = labels.kept[visit, earlier]
        while other >= 0:
            if labels.cost[other] <= cost + 1e-12 and labels.energy[other] <= energy + 1e-12:
                if rule == SAME_NODE:
                    return True
                if rule == SAME_MEMORY and labels.low[other] & ~low == 0 and labels.high[other] & ~high == 0:
                    return True
                if rule == SAME_SET and labels.low[other] == low and labels.high[other] == high:
                    return True
            other = labels.link[other]
    return False


@inner()
def add_label(
    labels: Labels, label: int, parent: int, visit: int, energy: float, cost: float, low: int, high: int, bucket: int
) -> None:
    """Store a label in the list of those that are to be extended; its segment is forbidden from now on."""
    segment = visit >> 1
    if segment < WORD:
        low |= 1 << segment
    else:
        high |= 1 << (segment - WORD)
    labels.energy[label], labels.cost[label] = energy, cost
    labels.visit[label], labels.parent[label] = visit, parent
    labels.low[label], labels.high[label] = low, high
    labels.link[label] = labels.waiting[bucket, visit]
    labels.waiting[bucket, visit] = label


@inner()
def start_labels(
    priced: Priced, weight: float, prize: Floats, bound: Completions, most: float, labels: Labels
) -> int:  # fmt: skip
    """Store a label for each first visit, and return their number."""
    buckets, visits = bound.first.shape
    count = 0
    for visit in range(visits):
        energy = priced.start[visit]
        left = priced.budget - energy
        if left < 0.0:
            continue
        cost = weight * energy - prize[visit >> 1]
        if cost + bound.first[min(buckets - 1, int(left / priced.width)), visit] >= most:
            continue
        add_label(labels, count, -1, visit, energy, cost, 0, 0, min(buckets - 1, int(energy / priced.width)))
        count += 1
    return count


@inner()
def extend_label(
    priced: Priced, weight: float, prize: Floats, bound: Completions, most: float,
    labels: Labels, label: int, count: int,
) -> int:  # fmt: skip
    """Store the labels that continue one by another visit, and return the new number of labels, -1 without room."""
    buckets, visits = bound.first.shape
    visit, energy, cost = labels.visit[label], labels.energy[label], labels.cost[label]
    low, high = labels.low[label], labels.high[label]
    for onward in range(visits):
        segment = onward >> 1
        forbidden = (low >> segment) & 1 if segment < WORD else (high >> (segment - WORD)) & 1
        spent = energy + priced.move[visit, onward]
        left = priced.budget - spent
        if forbidden == 1 or left < 0.0:
            continue
        next_low, next_high = low & priced.near[segment, 0], high & priced.near[segment, 1]
        grown = cost + weight * priced.move[visit, onward] - prize[segment]
        there = min(buckets - 1, int(left / priced.width))
        if grown + find_completion(bound, there, onward, next_low, next_high) >= most:
            continue
        if count == len(labels.energy):
            return -1
        into = min(buckets - 1, int(spent / priced.width))
        add_label(labels, count, label, onward, spent, grown, next_low, next_high, into)
        count += 1
    return count


@kernel()
def price_routes(
    priced: Priced, weight: float, prize: Floats, bound: Completions, most: float, rule: int,
    labels: Labels, found: Ints,
) -> tuple[int, int]:  # fmt: skip
    """Return the number of labels and of routes found whose reduced cost is less than ``most``.

    It returns -1 labels if there is no room for all: what was found are routes, but others may be missing.

    Args:
        priced: the routes.
        weight: cost of one unit of energy.
        prize: (n,): of each segment.
        bound: as ``bound_completions`` sets it for the same prizes.
        most: routes of this reduced cost or more are not searched.
        rule: when a label is dominated: SAME_NODE, SAME_MEMORY or SAME_SET.
        labels: work space.
        found: set to the last labels of routes; for all rules but SAME_SET the best one for each last visit, and
            unchanged for visits without one.
    """
    buckets, visits = bound.first.shape
    routes = 0
    labels.waiting[:] = -1
    labels.kept[:] = -1
    labels.least[:] = 1e300
    count = start_labels(priced, weight, prize, bound, most, labels)
    for bucket in range(buckets):
        again = True
        while again:
            for visit in range(visits):
                label = labels.waiting[bucket, visit]
                labels.waiting[bucket, visit] = -1
                while label >= 0:
                    following = labels.link[label]
                    if is_dominated(labels, label, bucket, rule):
                        label = following
                        continue
                    labels.link[label] = labels.kept[visit, bucket]
                    labels.kept[visit, bucket] = label
                    labels.least[visit, bucket] = min(labels.least[visit, bucket], labels.cost[label])
                    total = labels.cost[label] + weight * priced.home[visit]
                    if labels.energy[label] + priced.home[visit] <= priced.budget and total < most:
                        if rule == SAME_SET:
                            if routes == len(found):
                                return -1, routes
                            found[routes] = label
                            routes += 1
                        elif found[visit] < 0 or labels.cost[label] < labels.cost[found[visit]]:
                            found[visit] = label
                    count = extend_label(priced, weight, prize, bound, most, labels, label, count)
                    if count < 0:
                        return -1, routes
                    label = following
            # A move shorter than a bucket leads to the same one.
            again = False
            for visit in range(visits):
                again = again or labels.waiting[bucket, visit] >= 0
    return count, routes
