"""What is odd about a network that was put together: nothing of it is changed here, all of it is said."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import median

import numpy as np

from missions.geo import FloatArray
from missions.readers.nodes import Nodes
from missions.readers.planar import find_crossings, find_nearest_span
from missions.readers.raw_network import Remark, RemarkTopic

NEARLY_M = 10.0
"""Ends that are nearer than this to another line, and do not meet it, are worth a look."""
ASIDE_M = 20.0
"""A pole on no line that is nearer than this to one was meant for it."""
SHORT_M = 5.0
"""Lines whose spans are shorter than this by half are tracks rather than lines of poles."""
MOST_LOOKED_AT = 2000
"""Of one kind, for the time it takes; there is something wrong with all of the others, too."""


def _round_up_m(distance_m: float) -> str:
    """Return a figure for snap_m that is just more than a distance."""
    return f"{math.ceil(distance_m * 10 + 1e-6) / 10:g}"


def suggest_snap(away_m: float) -> str:
    """Return how far away something is, and what snap_m takes it for a line's."""
    return f"is {away_m:.1f} m away, snap_m = {_round_up_m(away_m)} takes it"


def find_oddities(
    nodes: Nodes,
    pairs: Sequence[tuple[int, int]],
    labels: Sequence[str],
    lines: Sequence[str],
    unused: Sequence[int],
    *,
    longest_m: float,
) -> Iterator[Remark]:
    """Yield what is odd about spans, given by the nodes at their ends."""
    if not pairs:
        return
    places_m = np.array([node.at_m for node in nodes.nodes], dtype=np.float64)
    ends = np.array(pairs, dtype=np.intp)
    ends_m = places_m[ends]
    yield from _check_lengths(ends_m, labels, lines, longest_m)
    yield from _check_crossings(nodes, ends_m, ends, labels)
    yield from _check_near_misses(nodes, places_m, ends_m, ends, labels)
    yield from _check_unused(nodes, places_m, ends_m, labels, unused)


def _check_lengths(
    ends_m: FloatArray, labels: Sequence[str], lines: Sequence[str], longest_m: float
) -> Iterator[Remark]:
    lengths_m = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T).tolist()
    by_line: dict[str, list[float]] = {}
    for length_m, label, line in zip(lengths_m, labels, lines, strict=True):
        by_line.setdefault(line, []).append(length_m)
        if length_m > longest_m:
            text = f"{length_m:.0f} m long: is a pole missing? max_span_m divides where a file has no poles"
            yield Remark(RemarkTopic.LONG, label, text)
    for line, own_m in by_line.items():
        if len(own_m) > 2 and median(own_m) < SHORT_M:
            yield Remark(
                RemarkTopic.SHORT, line, f"half of its spans are shorter than {median(own_m):.1f} m: are these poles?"
            )


def _check_crossings(nodes: Nodes, ends_m: FloatArray, ends: np.ndarray, labels: Sequence[str]) -> Iterator[Remark]:
    for count, (one, other, at_m) in enumerate(find_crossings(ends_m, ends)):
        if count == MOST_LOOKED_AT:
            return
        lat_deg, lon_deg = nodes.frame.to_wgs84_deg(*at_m)
        text = f"crosses {labels[other]} at {lat_deg:.6f}, {lon_deg:.6f} without a pole: two lines that do not meet"
        yield Remark(RemarkTopic.CROSSING, labels[one], text)


def _check_near_misses(
    nodes: Nodes, places_m: FloatArray, ends_m: FloatArray, ends: np.ndarray, labels: Sequence[str]
) -> Iterator[Remark]:
    degrees = np.bincount(ends.ravel(), minlength=len(places_m))
    beside: dict[int, list[int]] = {}
    for number, pair in enumerate(ends.tolist()):
        for end in pair:
            beside.setdefault(end, []).append(number)
    seen: set[frozenset[int]] = set()
    for node in np.flatnonzero(degrees == 1)[:MOST_LOOKED_AT].tolist():
        # The span before its own would be near wherever spans are short.
        (own,) = beside[node]
        mine = {number for end in ends[own].tolist() for number in beside[end]}
        if len(mine) == len(ends):
            continue
        span, away_m = find_nearest_span(places_m[node], ends_m, sorted(mine))
        if away_m > NEARLY_M:
            continue
        meets = next((end for end in ends[span].tolist() if math.dist(places_m[end], places_m[node]) <= NEARLY_M), None)
        pair = frozenset((node, meets if meets is not None else -1 - span))
        if pair not in seen:
            seen.add(pair)
            to = f"{nodes.nodes[meets].name!r} of {labels[span]}" if meets is not None else labels[span]
            gap_m = away_m if meets is None else math.dist(places_m[meets], places_m[node])
            text = f"{nodes.nodes[node].name!r} ends {gap_m:.1f} m from {to} and does not meet it; snap_m = "
            yield Remark(RemarkTopic.NEARLY, labels[own], f"{text}{_round_up_m(gap_m)} joins them")


def _check_unused(
    nodes: Nodes, places_m: FloatArray, ends_m: FloatArray, labels: Sequence[str], unused: Sequence[int]
) -> Iterator[Remark]:
    for count, index in enumerate(unused):
        text = "on no line: left out"
        if count < MOST_LOOKED_AT:
            span, away_m = find_nearest_span(places_m[index], ends_m)
            if away_m <= ASIDE_M:
                text += f"; {labels[span]} {suggest_snap(away_m)}"
        yield Remark(RemarkTopic.UNUSED, nodes.nodes[index].name, text)
