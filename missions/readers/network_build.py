"""Build a network from a drawing: join ends, split lines into spans at poles, and report oddities.

In a file with poles, lines are split where they pass a pole, and a pole is added only where a line bends or ends
without one. In a file without poles, every position of a line is a pole, and spans longer than requested are divided.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from missions.errors import NetworkError
from missions.geo import MAX_LATITUDE_DEG, FloatArray, LocalFrame
from missions.geometry import (
    find_bends,
    find_crossings,
    find_nearest_along,
    pair_with_ranges,
    place_distances_m,
)
from missions.network import SHORTEST_SEGMENT_M, Pylon, Segment, check_degrees
from missions.readers.raw_network import Line, Pole, RawNetwork, Remark, RemarkTopic, Vertex, explain_empty_file

SAME_POLE_M = 0.5
"""Distance below which two poles of a file are merged."""
SNAP_M = 0.5
STRAIGHT_M = 1.0
"""Distance from the straight line between its neighbours below which a position is not a pole."""
NEAR_M = 20.0
"""Greatest distance of the nearest pole that a finding names."""
LONG_M = 1000.0
"""Span length above which a finding is reported."""
MOST_SPANS = 100_000
NEARLY_M = 10.0
"""Distance between an end and another line, without contact, below which a finding is reported."""
ASIDE_M = 20.0
"""Distance from a line below which a pole on no line was probably meant for it."""
SHORT_M = 5.0
"""Median span length below which lines are probably tracks rather than lines of poles."""
MOST_LOOKED_AT = 2000
"""Most findings checked per kind, to limit the time; with more, all the rest are suspect, too."""


@dataclass(slots=True)
class Node:
    """A pole, or a place that may become one."""

    name: str
    lat_deg: float
    lon_deg: float
    at_m: tuple[float, float]
    elevation_m: float | None = None
    height_m: float | None = None
    third_m: float | None = None
    drawn: bool = True
    """Whether it is a pole in the file."""
    hinted: Mapping[str, str] = field(default_factory=dict)
    """Hinted heights, as in `Pole`."""

    @property
    def title(self) -> str:
        """Its name, or its position."""
        return self.name or f"{self.lat_deg:.6f}, {self.lon_deg:.6f}"


@dataclass(slots=True)
class Nodes:
    """All nodes, by name and by place: a grid whose cells are as wide as the join distance."""

    frame: LocalFrame
    snap_m: float
    nodes: list[Node] = field(default_factory=list)
    by_name: dict[str, int] = field(default_factory=dict)
    found: list[Remark] = field(default_factory=list)
    _cells: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def find_nearest(self, at_m: tuple[float, float], within_m: float) -> tuple[int | None, float]:
        """Return the nearest node within the join distance at most, and its distance."""
        row, column = self._cell_of(at_m)
        least_m, found = math.inf, None
        for cell in ((row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
            for index in self._cells.get(cell, ()):
                away_m = math.dist(at_m, self.nodes[index].at_m)
                if away_m < least_m:
                    least_m, found = away_m, index
        return (found, least_m) if least_m <= within_m else (None, least_m)

    def add_poles(self, poles: Iterable[Pole], named: frozenset[str]) -> None:
        """Add the file's poles; poles named by spans are kept unchanged, others at one place are merged."""
        for pole in poles:
            at_m = self.frame.to_local_m(pole.lat_deg, pole.lon_deg)
            index, away_m = (None, 0.0)
            if pole.name not in named:
                index, away_m = self.find_nearest(at_m, min(self.snap_m, SAME_POLE_M))
            if index is not None and self.nodes[index].name not in named:
                self._join(self.nodes[index], pole, away_m)
                continue
            name = self._choose_name(pole) if pole.name else ""
            heights = pole.elevation_m, pole.height_m, pole.third_m
            self._add(Node(name, pole.lat_deg, pole.lon_deg, at_m, *heights, hinted=pole.hinted))
        self.name_unnamed(range(len(self.nodes)))

    def find_or_add(self, vertex: Vertex, at_m: tuple[float, float]) -> tuple[int, float]:
        """Return the node of a line's vertex, a new one if none is near, and its distance."""
        lat_deg, lon_deg, third_m = vertex
        index, away_m = self.find_nearest(at_m, self.snap_m)
        if index is None:
            self._add(Node("", lat_deg, lon_deg, at_m, third_m=third_m, drawn=False))
            return len(self.nodes) - 1, 0.0
        if self.nodes[index].third_m is None:
            self.nodes[index].third_m = third_m
        return index, away_m

    def add_between(self, at_m: tuple[float, float]) -> int:
        """Add a place that is not in the file."""
        lat_deg, lon_deg = self.frame.to_wgs84_deg(*at_m)
        self._add(Node("", lat_deg, lon_deg, at_m, drawn=False))
        return len(self.nodes) - 1

    def name_unnamed(self, indices: Iterable[int]) -> None:
        """Name the unnamed nodes."""
        for index in indices:
            number = index + 1
            while not self.nodes[index].name:
                name, number = f"P{number}", number + len(self.nodes)
                if name not in self.by_name:
                    self.nodes[index].name = name
                    self.by_name[name] = index

    def _add(self, node: Node) -> None:
        if node.name:
            self.by_name[node.name] = len(self.nodes)
        self._cells.setdefault(self._cell_of(node.at_m), []).append(len(self.nodes))
        self.nodes.append(node)

    def _join(self, node: Node, pole: Pole, away_m: float) -> None:
        """Merge a pole into an existing one; values known to only one of them are kept."""
        node.hinted = {**{key: by for key, by in pole.hinted.items() if getattr(node, key) is None}, **node.hinted}
        node.elevation_m = pole.elevation_m if node.elevation_m is None else node.elevation_m
        node.height_m = pole.height_m if node.height_m is None else node.height_m
        node.third_m = pole.third_m if node.third_m is None else node.third_m
        if pole.name in {"", node.name} and pole.line:
            return  # a table lists a pole of two lines in the rows of both
        if pole.name != node.name:
            text = f"{away_m:.2f} m from {node.name or 'a pole without a name'!r}: taken for the same pole"
            self.found.append(Remark(RemarkTopic.SAME_PLACE, pole.name or pole.place, text))
            if pole.name and pole.name not in self.by_name:
                self.by_name[pole.name] = self.by_name.get(node.name, len(self.nodes))
        else:
            self.found.append(Remark(RemarkTopic.SAME_PLACE, pole.name or pole.place, "drawn twice: taken once"))

    def _choose_name(self, pole: Pole) -> str:
        if pole.name not in self.by_name:
            return pole.name
        name, number = f"{pole.line} {pole.name}" if pole.line else f"{pole.name} (2)", 2
        while name in self.by_name:
            number += 1
            name = f"{pole.name} ({number})"
        text = f"another pole has this name: it is called {name!r} here"
        self.found.append(Remark(RemarkTopic.SAME_NAME, pole.name, text))
        return name

    def _cell_of(self, at_m: tuple[float, float]) -> tuple[int, int]:
        wide_m = max(self.snap_m, SAME_POLE_M)
        return math.floor(at_m[0] / wide_m), math.floor(at_m[1] / wide_m)


def find_nearest_span(place_m: FloatArray, ends_m: FloatArray, but: Sequence[int] = ()) -> tuple[int, float]:
    """Return the nearest of (n, 2, 2) spans to a place and its distance, ignoring those in ``but``."""
    distances_m = place_distances_m(ends_m, place_m[np.newaxis])[0]
    distances_m[list(but)] = np.inf
    nearest = int(np.argmin(distances_m))
    return nearest, float(distances_m[nearest])


@dataclass(frozen=True, slots=True)
class MendingLimits:
    """Limits for mending a file."""

    snap_m: float = SNAP_M
    """Distance below which ends of lines, and lines and poles, are joined."""
    max_span_m: float | None = None
    """Span length above which spans are divided if the file has no poles."""


@dataclass(frozen=True, slots=True)
class UnplacedNetwork:
    """A network without its depot."""

    pylons: tuple[Pylon, ...]
    segments: tuple[Segment, ...]
    lines: dict[str, str]
    """Line name of each segment, by the segment's label."""
    found: tuple[Remark, ...]


@dataclass(slots=True)
class _Spans:
    """The spans found so far, each pair of nodes once."""

    nodes: Nodes
    pairs: list[tuple[int, int]] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    known: dict[frozenset[int], int] = field(default_factory=dict)
    used_labels: set[str] = field(default_factory=set)
    found: list[Remark] = field(default_factory=list)

    def add(self, a: int, b: int, label: str, line: str) -> None:
        self.nodes.name_unnamed((a, b))
        between = f"{self.nodes.nodes[a].name}-{self.nodes.nodes[b].name}"
        # Two lines may have the same name; labels must be unambiguous for the crew.
        label = f"{label} ({between})" if label in self.used_labels else label or between
        self.used_labels.add(label)
        self.known.setdefault(frozenset((a, b)), len(self.pairs))
        self.pairs.append((a, b))
        self.labels.append(label)
        self.lines.append(line)


def build_unplaced_network(drawing: RawNetwork, mending: MendingLimits) -> UnplacedNetwork:
    """Return the network of a drawing.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    _check_ends(drawing)
    frame = _frame_of(drawing)
    nodes = Nodes(frame, mending.snap_m)
    nodes.add_poles(drawing.poles, frozenset(end for span in drawing.spans for end in (span.a, span.b)))
    spans = _Spans(nodes)
    for span in drawing.spans:
        spans.add(nodes.by_name[span.a], nodes.by_name[span.b], span.name, span.line)
    has_poles = bool(nodes.nodes)
    chains = list(_build_chains(drawing, nodes, has_poles=has_poles, found=spans.found))
    chains = _split_at_nodes(chains, nodes, spans.found)
    if has_poles:
        chains = _remove_straight_nodes(chains, nodes, spans.found)
    _lay_spans(chains, spans, None if has_poles else mending.max_span_m)
    if len(spans.pairs) > MOST_SPANS:
        raise NetworkError(
            f"segments: expected at most {MOST_SPANS}, found {len(spans.pairs)}; layer, where, or a "
            "cut of the file choose what is flown"
        )
    return _assemble_network(drawing, nodes, spans, mending)


@dataclass(frozen=True, slots=True)
class _Chain:
    """A part of a line as the nodes that it passes."""

    line: Line
    nodes: list[int]

    @property
    def asset(self) -> str:
        return self.line.name or self.line.place


def _check_ends(drawing: RawNetwork) -> None:
    names = {pole.name for pole in drawing.poles}
    for span in drawing.spans:
        for key, end in (("a", span.a), ("b", span.b)):
            if end not in names:
                raise NetworkError(f"{span.place}.{key}: expected the id of a pylon, got unknown {end!r}")


def _frame_of(drawing: RawNetwork) -> LocalFrame:
    """Return a plane about the first position, after checking that every position is on the Earth."""
    first = None
    for place, lat_deg, lon_deg in _iterate_positions(drawing):
        check_degrees(place, lat_deg, lon_deg, "; are latitude and longitude swapped, or is it a grid's?")
        first = first or (max(min(lat_deg, MAX_LATITUDE_DEG), -MAX_LATITUDE_DEG), lon_deg)
    if first is None:
        why = f"neither lines nor poles{explain_empty_file(drawing.remarks)}"
        raise NetworkError(f"segments: expected at least one, found none: {why}")
    return LocalFrame(*first)


def _iterate_positions(drawing: RawNetwork) -> Iterator[tuple[str, float, float]]:
    for pole in drawing.poles:
        yield f"pylon {pole.name!r}" if pole.name else pole.place, pole.lat_deg, pole.lon_deg
    for line in drawing.lines:
        for vertex in itertools.chain.from_iterable(line.parts):
            yield line.place, vertex[0], vertex[1]


def _build_chains(drawing: RawNetwork, nodes: Nodes, *, has_poles: bool, found: list[Remark]) -> Iterator[_Chain]:
    for line in drawing.lines:
        asset = line.name or line.place
        for part in line.parts:
            places_m = nodes.frame.many_to_local_m(np.array([vertex[:2] for vertex in part], dtype=np.float64))
            chain: list[int] = []
            for vertex, at_m in zip(part, places_m.tolist(), strict=True):
                index, away_m = nodes.find_or_add(vertex, (at_m[0], at_m[1]))
                if not has_poles:  # then every position is a pole
                    nodes.name_unnamed((index,))
                if chain and chain[-1] == index:
                    text = f"two positions at one place ({vertex[0]:.6f}, {vertex[1]:.6f}): taken once"
                    found.append(Remark(RemarkTopic.ZERO, asset, text))
                    continue
                if away_m > (SAME_POLE_M if has_poles else SHORTEST_SEGMENT_M):
                    to = repr(nodes.nodes[index].name) if nodes.nodes[index].name else "another line's position"
                    found.append(Remark(RemarkTopic.SNAPPED, asset, f"joined to {to}, {away_m:.2f} m away"))
                chain.append(index)
            if len(chain) > 1:
                yield _Chain(line, chain)
            else:
                found.append(Remark(RemarkTopic.ZERO, asset, "a part without length: left out"))


def _split_at_nodes(chains: Sequence[_Chain], nodes: Nodes, found: list[Remark]) -> list[_Chain]:
    """Route lines over every node that they pass."""
    if not chains:
        return []
    beside, split = _find_nodes_beside(chains, nodes), []
    for chain in chains:
        full, passed = [chain.nodes[0]], []
        for a, b in itertools.pairwise(chain.nodes):
            between = [one for one in beside.get((a, b), ()) if one not in {a, b}]
            passed += between
            full += [*between, b]
        if passed:
            names = ", ".join(nodes.nodes[index].title for index in passed[:3])
            more = ", ..." if len(passed) > 3 else ""
            found.append(Remark(RemarkTopic.SPLIT, chain.asset, f"split at {len(passed)} on its way: {names}{more}"))
        split.append(_Chain(chain.line, [index for index, _ in itertools.groupby(full)]))
    return split


def _find_nodes_beside(chains: Sequence[_Chain], nodes: Nodes) -> dict[tuple[int, int], list[int]]:
    """Return the nodes that each leg of some lines passes, in its direction, its own ends included."""
    legs = list(dict.fromkeys(pair for chain in chains for pair in itertools.pairwise(chain.nodes)))
    places_m = np.array([node.at_m for node in nodes.nodes], dtype=np.float64)
    begins_m, ends_m = np.moveaxis(places_m[legs], 1, 0)
    axis = int(np.argmax(np.ptp(places_m, axis=0)))
    order = np.argsort(places_m[:, axis], kind="stable")
    sorted_m = places_m[order, axis]
    lows, highs = np.minimum(begins_m, ends_m) - nodes.snap_m, np.maximum(begins_m, ends_m) + nodes.snap_m
    beside: dict[tuple[int, int], list[int]] = {}
    for rows, places in pair_with_ranges(
        np.searchsorted(sorted_m, lows[:, axis]), np.searchsorted(sorted_m, highs[:, axis])
    ):
        one, other = rows, order[places]
        inside = ((places_m[other] >= lows[one]) & (places_m[other] <= highs[one])).all(axis=1)
        one, other = one[inside], other[inside]
        away_m, shares = find_nearest_along(places_m[other] - begins_m[one], ends_m[one] - begins_m[one])
        near = np.flatnonzero(away_m <= nodes.snap_m)
        near = near[np.lexsort((shares[near], one[near]))]
        for leg, node in zip(one[near].tolist(), other[near].tolist(), strict=True):
            beside.setdefault(legs[leg], []).append(node)
    return beside


def _remove_straight_nodes(chains: Sequence[_Chain], nodes: Nodes, found: list[Remark]) -> list[_Chain]:
    """Keep positions without a pole only where a line ends, bends or meets another."""
    uses = Counter(index for chain in chains for index in set(chain.nodes))
    known_m = np.array([node.at_m for node in nodes.nodes if node.drawn], dtype=np.float64)
    names = [node.name for node in nodes.nodes if node.drawn]
    made: set[int] = set()
    kept_chains = []
    for chain in chains:
        order = chain.nodes
        fixed = [
            at for at, index in enumerate(order) if nodes.nodes[index].drawn or uses[index] > 1
            or at in {0, len(order) - 1}
        ]  # fmt: skip
        kept = set(fixed)
        for first, last in itertools.pairwise(fixed):
            if last - first > 1:
                places_m = np.array([nodes.nodes[index].at_m for index in order[first : last + 1]])
                kept |= {first + at for at in find_bends(places_m, STRAIGHT_M)}
        if len(kept) < len(order):
            text = f"{len(order) - len(kept)} positions on the straight between poles: no poles are made there"
            found.append(Remark(RemarkTopic.LEFT_OUT, chain.asset, text))
        for at in sorted(kept):
            if not nodes.nodes[order[at]].drawn and order[at] not in made:
                made.add(order[at])
                nodes.name_unnamed((order[at],))
                how = "ends" if at in {0, len(order) - 1} else "bends or meets another"
                found.append(_build_made_remark(nodes, order[at], chain.asset, how, known_m, names))
        kept_chains.append(_Chain(chain.line, [order[at] for at in sorted(kept)]))
    return kept_chains


def _build_made_remark(
    nodes: Nodes, index: int, asset: str, how: str, known_m: np.ndarray, names: Sequence[str]
) -> Remark:
    node = nodes.nodes[index]
    text = f"{how} at {node.lat_deg:.6f}, {node.lon_deg:.6f} without a pole of the file: {node.name!r} is made there"
    away_m = np.hypot(*(known_m - np.array(node.at_m)).T)
    nearest = int(np.argmin(away_m))
    if away_m[nearest] <= NEAR_M:
        text += f"; {names[nearest]!r} {_suggest_snap(away_m[nearest])}"
    return Remark(RemarkTopic.MADE, asset, text)


def _lay_spans(chains: Sequence[_Chain], spans: _Spans, max_span_m: float | None) -> None:
    numbers: Counter[int] = Counter()
    for chain in chains:
        for a, b in itertools.pairwise(chain.nodes):
            for one, other in itertools.pairwise(_divide_span(a, b, spans, chain.asset, max_span_m)):
                numbers[id(chain.line)] += 1
                label = f"{chain.line.name}.{numbers[id(chain.line)]}" if chain.line.name else ""
                twin = spans.known.get(frozenset((one, other)))
                if twin is None:
                    spans.add(one, other, label, chain.line.name or chain.line.place)
                else:
                    text = f"runs over the same poles as {spans.labels[twin]}: inspected once"
                    spans.found.append(Remark(RemarkTopic.DUPLICATE, label or chain.asset, text, spans.labels[twin]))


def _divide_span(a: int, b: int, spans: _Spans, asset: str, max_span_m: float | None) -> list[int]:
    nodes = spans.nodes
    nodes.name_unnamed((a, b))
    from_m, to_m = nodes.nodes[a].at_m, nodes.nodes[b].at_m
    length_m = math.dist(from_m, to_m)
    count = 1 if max_span_m is None else math.ceil(length_m / max_span_m - 1e-9)
    if count <= 1:
        return [a, b]
    if len(spans.pairs) + count > MOST_SPANS:
        raise NetworkError(
            f"{asset}: max_span_m: expected at most {MOST_SPANS} spans, {length_m:.0f} m by {max_span_m:g} m are more"
        )
    text = f"{length_m:.0f} m without a pole: divided into {count} spans of {length_m / count:.0f} m"
    spans.found.append(Remark(RemarkTopic.CUT, asset, text))
    ways = [number / count for number in range(1, count)]
    places = [(from_m[0] + w * (to_m[0] - from_m[0]), from_m[1] + w * (to_m[1] - from_m[1])) for w in ways]
    return [a, *(nodes.add_between(place) for place in places), b]


def _assemble_network(drawing: RawNetwork, nodes: Nodes, spans: _Spans, mending: MendingLimits) -> UnplacedNetwork:
    used = sorted({end for pair in spans.pairs for end in pair})
    new_index = {old: new for new, old in enumerate(used)}
    # Files whose spans name their poles may have further poles that were never on a line.
    unused: Sequence[int] = [index for index, node in enumerate(nodes.nodes) if node.drawn and index not in new_index]
    # Hinted heights count only if all poles on lines have them.
    poles = [nodes.nodes[index] for index in used if nodes.nodes[index].drawn]
    for key in ("elevation_m", "height_m"):
        hinted = [node for node in poles if key in node.hinted]
        known = sum(getattr(node, key) is not None for node in poles)
        if hinted and known < len(poles):
            text = f"{hinted[0].hinted[key]} is known of {known} of {len(poles)} poles: not used"
            nodes.found.append(Remark(RemarkTopic.HEIGHTS, drawing.format, text))
        for node in hinted if known < len(poles) else ():
            setattr(node, key, None)
    found = [*drawing.remarks, *nodes.found, *spans.found,
             *_find_oddities(spans, unused, mending.max_span_m or LONG_M)]  # fmt: skip
    pylons = (nodes.nodes[old] for old in used)
    return UnplacedNetwork(
        tuple(Pylon(n.name, n.lat_deg, n.lon_deg, n.elevation_m, n.height_m, n.third_m) for n in pylons),
        tuple(
            Segment(number, new_index[a], new_index[b], label)
            for number, ((a, b), label) in enumerate(zip(spans.pairs, spans.labels, strict=True))
        ),
        dict(zip(spans.labels, spans.lines, strict=True)),
        tuple(found),
    )


def _round_up_m(distance_m: float) -> str:
    """Return a figure for snap_m just above a distance."""
    return f"{math.ceil(distance_m * 10 + 1e-6) / 10:g}"


def _suggest_snap(away_m: float) -> str:
    """Return a distance, and the snap_m that would join it to a line."""
    return f"is {away_m:.1f} m away, snap_m = {_round_up_m(away_m)} takes it"


def _find_oddities(spans: _Spans, unused: Sequence[int], longest_m: float) -> Iterator[Remark]:
    """Yield the oddities of spans; they are reported, not changed."""
    if not spans.pairs:
        return
    places_m = np.array([node.at_m for node in spans.nodes.nodes], dtype=np.float64)
    ends = np.array(spans.pairs, dtype=np.intp)
    ends_m = places_m[ends]
    lengths_m = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T).tolist()
    by_line: dict[str, list[float]] = {}
    for length_m, label, line in zip(lengths_m, spans.labels, spans.lines, strict=True):
        by_line.setdefault(line, []).append(length_m)
        if length_m > longest_m:
            text = f"{length_m:.0f} m long: is a pole missing? max_span_m divides where a file has no poles"
            yield Remark(RemarkTopic.LONG, label, text)
    for line, own_m in by_line.items():
        if len(own_m) > 2 and median(own_m) < SHORT_M:
            yield Remark(
                RemarkTopic.SHORT, line, f"half of its spans are shorter than {median(own_m):.1f} m: are these poles?"
            )
    yield from _check_crossings(spans, ends_m, ends)
    yield from _check_near_misses(spans, places_m, ends_m, ends)
    yield from _check_unused(spans, places_m, ends_m, unused)


def _check_crossings(spans: _Spans, ends_m: FloatArray, ends: np.ndarray) -> Iterator[Remark]:
    for count, (one, other, at_m) in enumerate(find_crossings(ends_m, ends)):
        if count == MOST_LOOKED_AT:
            return
        lat_deg, lon_deg = spans.nodes.frame.to_wgs84_deg(*at_m)
        text = (
            f"crosses {spans.labels[other]} at {lat_deg:.6f}, {lon_deg:.6f} without a pole: two lines that do not meet"
        )
        yield Remark(RemarkTopic.CROSSING, spans.labels[one], text)


def _check_near_misses(spans: _Spans, places_m: FloatArray, ends_m: FloatArray, ends: np.ndarray) -> Iterator[Remark]:
    nodes, labels = spans.nodes.nodes, spans.labels
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
            to = f"{nodes[meets].name!r} of {labels[span]}" if meets is not None else labels[span]
            gap_m = away_m if meets is None else math.dist(places_m[meets], places_m[node])
            text = f"{nodes[node].name!r} ends {gap_m:.1f} m from {to} and does not meet it; snap_m = "
            yield Remark(RemarkTopic.NEARLY, labels[own], f"{text}{_round_up_m(gap_m)} joins them")


def _check_unused(spans: _Spans, places_m: FloatArray, ends_m: FloatArray, unused: Sequence[int]) -> Iterator[Remark]:
    for count, index in enumerate(unused):
        text = "on no line: left out"
        if count < MOST_LOOKED_AT:
            span, away_m = find_nearest_span(places_m[index], ends_m)
            if away_m <= ASIDE_M:
                text += f"; {spans.labels[span]} {_suggest_snap(away_m)}"
        yield Remark(RemarkTopic.UNUSED, spans.nodes.nodes[index].name, text)
