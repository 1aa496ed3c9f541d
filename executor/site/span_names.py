"""Resolve a crew's span names: which spans are flown, by which vehicle, and from which pylon."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cached_property

from executor.errors import SiteError
from executor.site.site_file import Site
from missions import Network
from missions.files import to_printable

RANGE = ".."
"""Separator of the first and the last span of a range."""


class SpanError(SiteError):
    """Name without a span, or spans that cannot be combined, in one line for a terminal."""

    def __init__(self, words: str) -> None:
        super().__init__(to_printable(words))


class SpanNames:
    """Names of a network's spans."""

    def __init__(self, network: Network) -> None:
        self._number = {network.segment_name(one.id): one.id for one in network.segments}

    @cached_property
    def _lines(self) -> Mapping[str, Mapping[int, int]]:
        """Spans whose names differ only in their last number, by the text before it and by that number."""
        found: dict[str, dict[int, int]] = {}
        for name, segment in self._number.items():
            if parts := re.fullmatch(r"(.*\D)(\d+)", name):
                found.setdefault(parts[1], {})[int(parts[2])] = segment
        return found

    def find(self, entries: Sequence[str], key: str) -> frozenset[int]:
        """Return the spans that a list of a site file names: by names, ranges, lines and patterns.

        Raises:
            SiteError: one line that names the entry and what was expected.
        """
        return frozenset().union(*(self._find_entry(entry, f"{key}[{at}]") for at, entry in enumerate(entries)))

    def _find_entry(self, entry: str, key: str) -> frozenset[int]:
        if entry in self._number:
            return frozenset({self._number[entry]})
        first, _, last = entry.partition(RANGE)
        between = self._find_range(first.strip(), last.strip())
        line = self._lines.get(f"{entry}.", {}).values()
        if found := frozenset(between or line or self._match(entry)):
            return found
        known = [*self._number, *(one.removesuffix(".") for one in self._lines if one.endswith("."))]
        parts = [part.strip() for part in (first, last)] if last else [entry]
        wrong = next((part for part in parts if part not in self._number), None)
        raise SpanError(
            f"{key}: expected a span such as '{known[0]}', a range FIRST..LAST of one line, a line or a pattern, got "
            f"'{entry}'{name_nearest(wrong, known)}"
        )

    def _find_range(self, first: str, last: str) -> Iterable[int]:
        for numbers in self._lines.values() if {first, last} <= self._number.keys() else ():
            ends = [
                number for number, segment in numbers.items() if segment in {self._number[first], self._number[last]}
            ]
            if len(ends) == len({first, last}):
                return [segment for number, segment in numbers.items() if min(ends) <= number <= max(ends)]
        return ()

    def _match(self, pattern: str) -> Iterable[int]:
        return (segment for name, segment in self._number.items() if fnmatchcase(name, pattern))


def name_nearest(wrong: str | None, known: Sequence[str]) -> str:
    """Return in words the known name most similar to a wrong one; empty if none is wrong, or none is similar."""
    nearest = [] if wrong is None else difflib.get_close_matches(wrong, known, n=1, cutoff=0.4)
    return f"; the nearest is '{nearest[0]}'" if nearest else ""


def find_left_out(site: Site, network: Network, carried_by: Mapping[int, int]) -> frozenset[int]:
    """Return the spans that a site does not want inspected; the network keeps them, as the line is there.

    Args:
        site: Tables of the site file.
        network: Its network, with an asset for each pylon with viewpoints.
        carried_by: The pylon of each of these assets: one that is not named goes with the spans that the pylon carries.

    Raises:
        SiteError: a name matches no span, or nothing is left to fly.
    """
    table, names, everything = site.network, SpanNames(network), frozenset(range(len(network.segments)))
    if not (table.only or table.leave_out):
        return frozenset()
    only, out = names.find(table.only, "network.only"), names.find(table.leave_out, "network.leave_out")
    spans = everything - carried_by.keys()
    flown = (spans & only if table.only else spans) - out
    carrying = {end for span in flown for end in (network.segments[span].a, network.segments[span].b)}
    pylons = {asset for asset, pylon in carried_by.items() if pylon in carrying or asset in only}
    left_out = everything - flown - (pylons - out)
    if left_out == everything:
        key = "leave_out" if table.leave_out else "only"
        raise SpanError(f"network.{key}: expected a span that is left to fly, got none of {len(everything)}")
    return left_out


def find_locks(site: Site, network: Network, left_out: Collection[int]) -> tuple[Mapping[int, str], Mapping[int, bool]]:
    """Return the only vehicle allowed to fly each locked span, and whether a locked span is flown reversed.

    Raises:
        SiteError: a name matches no span or pylon, or two locks contradict each other.
    """
    names, vehicles, ways = SpanNames(network), dict[int, tuple[int, str]](), dict[int, tuple[int, bool]]()
    for index, lock in enumerate(site.lock):
        spans, place = names.find(lock.segments, f"lock[{index}].segments"), f"lock[{index}]"
        turned = {} if lock.begin is None else _direct_spans(network, spans, lock.begin, f"{place}.from")
        for span in sorted(spans):
            name = network.segment_name(span)
            if lock.vehicle is not None:
                first, vehicle = vehicles.setdefault(span, (index, lock.vehicle))
                if vehicle != lock.vehicle:
                    expected = f"'{vehicle}' for {name}, as lock[{first}] has it, got '{lock.vehicle}'"
                    raise SpanError(f"{place}.vehicle: expected {expected}")
            if span in turned:
                first, way = ways.setdefault(span, (index, turned[span]))
                if way != turned[span]:
                    raise SpanError(
                        f"{place}.from: expected the direction of lock[{first}] for {name}, got the other one"
                    )
    locked = {span: vehicle for span, (_, vehicle) in vehicles.items() if span not in left_out}
    directions = {span: way for span, (_, way) in ways.items() if span not in left_out}
    return locked, directions


def _direct_spans(network: Network, spans: Collection[int], begin: str, key: str) -> dict[int, bool]:
    """Return whether spans are flown reversed if they are flown in sequence away from a pylon."""
    at: dict[int, list[int]] = {}
    for span in sorted(spans):
        for end in (network.segments[span].a, network.segments[span].b):
            at.setdefault(end, []).append(span)
    ends = [network.pylons[end].id for end in at]
    front, turned = [end for end in at if network.pylons[end].id == begin], dict[int, bool]()
    if not front:
        shown = ", ".join(ends[:4]) + (" ..." if len(ends) > 4 else "")
        raise SpanError(
            f"{key}: expected a pylon at an end of its spans, {shown}, got '{begin}'{name_nearest(begin, ends)}"
        )
    while front:
        end = front.pop(0)
        for span in at[end]:
            if span not in turned:
                turned[span] = network.segments[span].b == end
                front.append(network.segments[span].a if turned[span] else network.segments[span].b)
    for span in sorted(spans):
        if span not in turned:
            raise SpanError(
                f"{key}: expected spans that hang together from {begin} on, got {network.segment_name(span)}"
            )
    return turned
