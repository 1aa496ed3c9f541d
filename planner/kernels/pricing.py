"""Prices routes for column generation.

Labels grow visit by visit, each with its energy, its reduced cost and the segments that it must not visit again. A
route's reduced cost is ``weight`` times its energy minus the prizes of its segments. ng-routes (Baldacci, Mingozzi,
Roberti 2011, doi 10.1287/opre.1110.0975) forget a segment as soon as they visit one that does not have it in its
neighbourhood: they include all routes, so their least reduced cost is a lower bound, and are far fewer to distinguish.

A subset-row cut is on three segments: a route counts once for each two visits to them. With limited memory (Pecin,
Pessoa, Poggi, Uchoa 2017, doi 10.1007/s12532-016-0108-8) a route forgets its first visit as soon as it visits a segment
that the cut does not remember. Each count adds the cut's price to the reduced cost.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from planner.kernels.arrays import Floats, Ints, IntTable, Table
from planner.kernels.compiling import inner, kernel

WORD = 62
"""Segments in one word of a set; a set has two."""
SAME_NODE = 0
"""A label is dominated by one at the same visit, in no higher bucket, of no more reduced cost: quick, not complete."""
SAME_MEMORY = 1
"""... with no more energy and reduced cost, whose forbidden segments are a subset."""
SAME_SET = 2
"""... with no more energy and the same forbidden segments: no two sets of segments are mixed up."""


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


class Cuts(NamedTuple):
    """Subset-row cuts over ``n`` segments, a set of them in two words."""

    member: Annotated[IntTable, "n 2"]
    """Cuts that are on each segment."""
    memory: Annotated[IntTable, "n 2"]
    """Cuts that remember an earlier visit when a route visits the segment."""
    price: Annotated[Table, "16 256"]
    """Sum of the prices of the cuts in each byte of a set."""


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
    odd_low: Annotated[Ints, "c"]
    """Cuts that remember one visit, the first word."""
    odd_high: Annotated[Ints, "c"]
    link: Annotated[Ints, "c"]
    """Next label of its list, -1 at the end."""
    unused: Annotated[Ints, "1"]
    """First of the dominated labels, which are used again."""
    waiting: Annotated[IntTable, "b v"]
    """First label that is to be extended, -1 without one."""
    kept: Annotated[IntTable, "v b"]
    """First label that was extended, -1 without one; for SAME_SET by a hash of its set instead of its bucket."""
    least: Annotated[Table, "v b"]
    """Least reduced cost of those."""


class Completions(NamedTuple):
    """Least reduced cost of what follows the end of a visit, by the bucket of the energy left."""

    first: Annotated[Table, "b v"]
    second: Annotated[Table, "b v"]
    """The least that does not continue with the segment ``after``."""
    after: Annotated[IntTable, "b v"]
    """Segment with which the first continues; -1 for the landing."""


class Choosable(NamedTuple):
    """Routes to choose from, ordered by their lowest segment, then by reduced cost."""

    sets: IntTable
    """(r, 2): segments of each route, a set in two words."""
    reduced: Floats
    """Reduced cost beyond the least of its kind."""
    cost: Floats
    kind: Ints
    begin: Ints
    """(n+1,): first route with each lowest segment."""


class Partial(NamedTuple):
    """Choice of up to ``k`` routes, one at each depth, and what those before it sum to."""

    route: Annotated[Ints, "k"]
    segment: Annotated[Ints, "k"]
    """Lowest segment that they leave."""
    low: Annotated[Ints, "k"]
    """Segments that they visit, the first word."""
    high: Annotated[Ints, "k"]
    reduced: Annotated[Floats, "k"]
    cost: Annotated[Floats, "k"]


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
def sum_cut_prices(cuts: Cuts, low: int, high: int) -> float:
    """Return the sum of the prices of a set of cuts."""
    total, byte = 0.0, 0
    while low != 0:
        total += cuts.price[byte, low & 255]
        low >>= 8
        byte += 1
    byte = 8
    while high != 0:
        total += cuts.price[byte, high & 255]
        high >>= 8
        byte += 1
    return total


@inner(inline=True)
def hash_set(low: int, high: int) -> int:
    """Return a number from 0 for a set of segments."""
    return (((low ^ (high << 1)) * 2654435761) >> 20) & 0xFFFF


@inner()
def is_dominated(cuts: Cuts, labels: Labels, label: int, bucket: int, rule: int) -> bool:
    """Return whether a label is dominated by one that was extended, even if that one pays for all its cuts."""
    visit, energy, cost = labels.visit[label], labels.energy[label], labels.cost[label]
    low, high = labels.low[label], labels.high[label]
    odd_low, odd_high = labels.odd_low[label], labels.odd_high[label]
    if rule == SAME_NODE:
        for earlier in range(bucket):
            if labels.least[visit, earlier] <= cost:
                return True
        better: bool = labels.least[visit, bucket] < cost
        return better
    if rule == SAME_SET:
        other = labels.kept[visit, hash_set(low, high) % labels.kept.shape[1]]
        while other >= 0:
            if labels.low[other] == low and labels.high[other] == high and labels.energy[other] <= energy + 1e-12:
                return True
            other = labels.link[other]
        return False
    for earlier in range(bucket, -1, -1):
        if labels.least[visit, earlier] > cost + 1e-12:
            continue
        other = labels.kept[visit, earlier]
        while other >= 0:
            is_less = labels.cost[other] <= cost + 1e-12 and labels.energy[other] <= energy + 1e-12
            if is_less and labels.low[other] & ~low == 0 and labels.high[other] & ~high == 0:
                owed = sum_cut_prices(cuts, labels.odd_low[other] & ~odd_low, labels.odd_high[other] & ~odd_high)
                if labels.cost[other] + owed <= cost + 1e-12:
                    return True
            other = labels.link[other]
    return False


@inner()
def add_label(
    cuts: Cuts, labels: Labels, count: int, parent: int, visit: int, energy: float, cost: float, low: int, high: int,
    bucket: int, rule: int,
) -> int:  # fmt: skip
    """Store a label in the list of those that are to be extended, and return the new number of labels, -1 without room.

    Its segment is forbidden from now on, and its cuts count the visit.
    """
    segment = visit >> 1
    odd_low, odd_high = 0, 0
    if parent >= 0:
        odd_low = labels.odd_low[parent] & cuts.memory[segment, 0]
        odd_high = labels.odd_high[parent] & cuts.memory[segment, 1]
        cost += sum_cut_prices(cuts, odd_low & cuts.member[segment, 0], odd_high & cuts.member[segment, 1])
    if rule == SAME_NODE:
        if cost >= labels.least[visit, bucket]:
            return count
        labels.least[visit, bucket] = cost
    label = labels.unused[0]
    if label >= 0:
        labels.unused[0] = labels.link[label]
    elif count == len(labels.energy):
        return -1
    else:
        label = count
        count += 1
    if segment < WORD:
        low |= 1 << segment
    else:
        high |= 1 << (segment - WORD)
    labels.odd_low[label] = odd_low ^ cuts.member[segment, 0]
    labels.odd_high[label] = odd_high ^ cuts.member[segment, 1]
    labels.energy[label], labels.cost[label] = energy, cost
    labels.visit[label], labels.parent[label] = visit, parent
    labels.low[label], labels.high[label] = low, high
    labels.link[label] = labels.waiting[bucket, visit]
    labels.waiting[bucket, visit] = label
    return count


@inner()
def start_labels(
    priced: Priced, weight: float, prize: Floats, cuts: Cuts, bound: Completions, most: float, rule: int, labels: Labels
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
        into = min(buckets - 1, int(energy / priced.width))
        count = add_label(cuts, labels, count, -1, visit, energy, cost, 0, 0, into, rule)
    return count


@inner()
def extend_label(
    priced: Priced, weight: float, prize: Floats, cuts: Cuts, bound: Completions, most: float, rule: int,
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
        into = min(buckets - 1, int(spent / priced.width))
        count = add_label(cuts, labels, count, label, onward, spent, grown, next_low, next_high, into, rule)
        if count < 0:
            return -1
    return count


@kernel()
def count_cuts(visits: Ints, ends: Ints, member: IntTable, memory: IntTable, counts: IntTable) -> None:
    """Count how often routes pay for cuts.

    Args:
        visits: the visits of all routes, one after the other.
        ends: (r,), the end of each route in ``visits``.
        member: (c, n), 1 where a cut is on a segment.
        memory: (c, n), 1 where it remembers an earlier visit.
        counts: (c, r), set.
    """
    for cut in range(len(member)):
        begin = 0
        for route in range(len(ends)):
            odd, count = 0, 0
            for place in range(begin, ends[route]):
                segment = visits[place] >> 1
                odd = (odd & memory[cut, segment]) + member[cut, segment]
                if odd == 2:
                    odd = 0
                    count += 1
            counts[cut, route] = count
            begin = ends[route]


@kernel()
def price_routes(
    priced: Priced, weight: float, prize: Floats, cuts: Cuts, bound: Completions, most: float, rule: int,
    labels: Labels, found: Ints,
) -> tuple[int, int]:  # fmt: skip
    """Return the number of labels and of routes found whose reduced cost is less than ``most``.

    It returns -1 labels if there is no room for all: what was found are routes, but others may be missing.

    Args:
        priced: the routes.
        weight: cost of one unit of energy.
        prize: (n,): of each segment.
        cuts: the subset-row cuts.
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
    labels.unused[0] = -1
    count = start_labels(priced, weight, prize, cuts, bound, most, rule, labels)
    for bucket in range(buckets):
        again = True
        while again:
            for visit in range(visits):
                label = labels.waiting[bucket, visit]
                labels.waiting[bucket, visit] = -1
                while label >= 0:
                    following = labels.link[label]
                    if is_dominated(cuts, labels, label, bucket, rule):
                        labels.link[label] = labels.unused[0]
                        labels.unused[0] = label
                        label = following
                        continue
                    place = bucket
                    if rule == SAME_SET:
                        place = hash_set(labels.low[label], labels.high[label]) % buckets
                    labels.link[label] = labels.kept[visit, place]
                    labels.kept[visit, place] = label
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
                    count = extend_label(priced, weight, prize, cuts, bound, most, rule, labels, label, count)
                    if count < 0:
                        return -1, routes
                    label = following
            # A move shorter than a bucket leads to the same one.
            again = False
            for visit in range(visits):
                again = again or labels.waiting[bucket, visit] >= 0
    return count, routes


@kernel()
def choose_partition(
    routes: Choosable, segments: int, left: Ints, gap: float, ceiling: float, any_plan: bool, most_checks: int,
    work: Partial, chosen: Ints,
) -> tuple[float, bool]:  # fmt: skip
    """Return the least cost, at most ``ceiling``, of routes that visit each segment once; whether all were tried.

    The lowest segment left is visited next, so no choice is tried in two orders.

    Args:
        routes: the routes to choose from.
        segments: number of segments.
        left: number of routes of each kind that may be chosen; changed.
        gap: a choice whose reduced costs sum to more is not cheaper than the ceiling.
        ceiling: cost to beat.
        any_plan: end with the first choice below the ceiling.
        most_checks: end after so many routes.
        work: work space.
        chosen: set to the best choice, -1 after its last route; unchanged without one.
    """
    depth, checks = 0, 0
    work.segment[0], work.route[0] = 0, routes.begin[0]
    work.low[0], work.high[0], work.reduced[0], work.cost[0] = 0, 0, 0.0, 0.0
    while True:
        route = work.route[depth]
        is_last = route == routes.begin[work.segment[depth] + 1]
        if is_last or work.reduced[depth] + routes.reduced[route] > gap:
            if depth == 0:
                return ceiling, True
            depth -= 1
            left[routes.kind[work.route[depth]]] += 1
            work.route[depth] += 1
            continue
        checks += 1
        if checks > most_checks:
            return ceiling, False
        low, high = routes.sets[route, 0], routes.sets[route, 1]
        if low & work.low[depth] != 0 or high & work.high[depth] != 0 or left[routes.kind[route]] == 0:
            work.route[depth] += 1
            continue
        low |= work.low[depth]
        high |= work.high[depth]
        cost = work.cost[depth] + routes.cost[route]
        segment = work.segment[depth] + 1
        while segment < segments:
            visited = (low >> segment) & 1 if segment < WORD else (high >> (segment - WORD)) & 1
            if visited == 0:
                break
            segment += 1
        if segment < segments and depth + 1 < len(chosen):
            left[routes.kind[route]] -= 1
            reduced = work.reduced[depth] + routes.reduced[route]
            depth += 1
            work.segment[depth], work.route[depth] = segment, routes.begin[segment]
            work.low[depth], work.high[depth], work.reduced[depth], work.cost[depth] = low, high, reduced, cost
            continue
        if segment == segments and cost < ceiling:
            gap -= ceiling - cost
            ceiling = cost
            for place in range(len(chosen)):
                chosen[place] = work.route[place] if place <= depth else -1
            if any_plan:
                return ceiling, False
        work.route[depth] += 1
