"""Hold what every reader extracts from its file: poles, lines and single spans in WGS 84, not yet interpreted.

Also holds the selection of a file's content: layers, and lines by their attributes.
"""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from missions.errors import NetworkError
from missions.geo import LocalFrame
from missions.readers.attributes import normalise_key
from missions.readers.values import Attributes, is_blank, measure_of, parse_figure

Vertex = tuple[float, float, float | None]
"""Latitude and longitude in degrees, and the third coordinate if there is one."""

MOST_VERTICES = 1_000_000
"""Most vertices of all lines together; a larger file covers a country and must be cut to the area to be flown."""
REASONS = 6
"""Most reasons in a message."""
NAMED = 3
"""Most left-out features that are named."""
_PLURAL = re.compile(r"(?= of )|$")
"""Position of the plural s: 'lines of a substation'."""
DEGREE_M = 110_500.0
"""Least length of a degree of latitude."""
OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "=": operator.eq, "<": operator.lt, ">": operator.gt,
}  # fmt: skip
MOST_NAMED = 12
"""Most attributes or layers that an error names."""
UNITS = ("v", "kv", "mv", "hz", "w", "kw", "mw", "mva", "m", "km", "mm", "cm", "ft", "%", "в", "кв")
"""Valid units after a figure, ignoring case; the last two are Cyrillic."""
KILOVOLTS = ("kv", "кв")
MOST_KV = 2000.0
"""Greatest line voltage: a filter with more kilovolts means volts."""
_TERM = re.compile(
    r"""\s*(?:"(?P<quoted>[^"]+)"|(?P<name>[^\s<>=!'"]+))\s*(?P<op><=|>=|!=|==|=|<|>)\s*"""
    r"""(?:'(?P<text>[^']*)'|"(?P<text2>[^"]*)"|(?P<bare>[^\s<>=!'"]+))\s*"""
)
_AND = re.compile(r"and\b\s*", re.IGNORECASE)


class RemarkTopic(StrEnum):
    """Topic of a finding."""

    WHOLE = "is it whole"
    """Listed first: the data read may differ from what the user sees, or be incomplete."""
    FILTER = "the filter"
    SNAPPED = "ends joined"
    SPLIT = "lines split at poles"
    CUT = "long spans divided"
    MADE = "poles made"
    SAME_PLACE = "poles at one place"
    SAME_NAME = "poles of one name"
    DUPLICATE = "spans drawn twice"
    ZERO = "spans without length"
    UNUSED = "poles on no line"
    CROSSING = "crossings without a pole"
    NEARLY = "ends that nearly meet"
    LONG = "long spans"
    SHORT = "short spans"
    HEIGHTS = "heights"
    FILE = "the file itself"
    LEFT_OUT = "left out"


@dataclass(frozen=True, slots=True)
class Remark:
    """A finding: one thing that was mended, or should be checked."""

    matter: RemarkTopic
    asset: str
    """Name of the line, span or pole."""
    text: str
    """What was found and what was done."""
    about: str = ""
    """Name of its span, if that differs."""

    @property
    def words(self) -> str:
        """The whole line."""
        return f"{self.asset}: {self.text}"


def explain_empty_file(found: Iterable[Remark]) -> str:
    """Return the reason why nothing of a file remains, to append to a message: what was left out, and how often."""
    counts = Counter(
        f"left out: {one.text}" if one.matter is RemarkTopic.LEFT_OUT else one.text
        for one in found
        if one.matter in {RemarkTopic.WHOLE, RemarkTopic.FILTER, RemarkTopic.LEFT_OUT}
    )
    words = [text if count == 1 else f"{count} times {text}" for text, count in counts.most_common(REASONS)]
    return "".join(f"; {one}" for one in words)


@dataclass(frozen=True, slots=True)
class Pole:
    """One structure as in its file."""

    place: str
    """Its location in the file, for messages."""
    name: str
    """Empty if the file has none."""
    lat_deg: float
    lon_deg: float
    elevation_m: float | None = None
    height_m: float | None = None
    third_m: float | None = None
    line: str = ""
    """Distinguishes it from another line's pole of the same name."""
    hinted: Mapping[str, str] = field(default_factory=dict)
    """Heights that count only if all poles have them, and the attributes they come from."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line as in its file: in several parts if it is interrupted or branches."""

    place: str
    name: str
    parts: tuple[tuple[Vertex, ...], ...]


@dataclass(frozen=True, slots=True)
class Span:
    """A span defined in its file by the names of its two poles."""

    place: str
    name: str
    a: str
    b: str
    line: str = ""


@dataclass(frozen=True, slots=True)
class NearFilter:
    """The approximate area around a depot: everything else in a country's file is dropped."""

    frame: LocalFrame
    within_m: float

    def may_reach(self, places: Iterable[tuple[float, float]]) -> bool:
        """Return whether the bounding box of some places, by latitude and longitude, may overlap the area."""
        lats, lons = [], []
        for lat_deg, lon_deg in places:
            if not (abs(lat_deg) <= 90 and abs(lon_deg) <= 180):
                return True  # refused by name later
            lats.append(lat_deg - self.frame.lat_deg)
            lons.append((lon_deg - self.frame.lon_deg + 180.0) % 360.0 - 180.0)
        wide_deg = self.within_m / DEGREE_M
        across_deg = wide_deg / max(1e-3, math.cos(math.radians(min(89.9, abs(self.frame.lat_deg) + wide_deg))))
        if max(lons, default=0.0) - min(lons, default=0.0) > 180.0:  # it may cross the antimeridian
            across_deg = 360.0
        return not lats or not (
            min(lats) > wide_deg or max(lats) < -wide_deg or min(lons) > across_deg or max(lons) < -across_deg
        )


@dataclass(slots=True)
class RawNetwork:
    """All data read from a file."""

    source: str
    """The file's name, for messages."""
    format: str
    crs: str = "WGS 84"
    """Name of the coordinates' reference system."""
    poles: list[Pole] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    depot: Pole | None = None
    """Depot, if the file has one."""
    found: list[Remark] = field(default_factory=list)
    flat: bool = False
    """Whether the file states that its ground is level with the depot."""
    vertices: int = 0
    others: list[Pole] = field(default_factory=list)
    """Points that are not poles: a vehicle may stand at a substation."""
    left: dict[str, list[str]] = field(default_factory=dict)
    """Names of features that are neither line nor pole, by type."""
    near: NearFilter | None = None
    """Area filter: lines outside are dropped; None keeps all."""
    far: tuple[float, float] | None = None
    """A place of a dropped line."""

    def add_line(self, line: Line) -> None:
        """Add a line, if it is near enough.

        Raises:
            NetworkError: the limit on vertices is exceeded.
        """
        if self.near is not None and not self.near.may_reach(_places_of(line)):
            self.far = self.far or next(_places_of(line))
            return
        self.vertices += sum(map(len, line.parts))
        if self.vertices > MOST_VERTICES:
            raise NetworkError(
                f"{line.place}: expected at most {MOST_VERTICES} positions in all; layer, where, or a "
                "cut of the file choose what is flown"
            )
        self.lines.append(line)

    def leave_out(self, what: str, asset: str) -> None:
        """Note a feature that is neither line nor pole."""
        self.left.setdefault(what, []).append(asset)

    @property
    def remarks(self) -> list[Remark]:
        """Return all findings, and in one line what was left out: the number of each type, and the first names."""
        text = ", ".join(
            f"{len(names)} {_PLURAL.sub('s', what, count=1) if len(names) > 1 else what} "
            f"({', '.join(names[:NAMED])}{', ...' if len(names) > NAMED else ''})"
            for what, names in self.left.items()
        )
        return [*self.found, *([Remark(RemarkTopic.LEFT_OUT, self.format, text)] if text else [])]

    def keep_near(self) -> None:
        """Drop everything far away."""
        near, self.vertices = self.near, 0
        if near is None:
            return
        lines, self.lines = self.lines, []
        for line in lines:
            self.add_line(line)
        kept: list[Pole] = []
        gone: list[Pole] = []
        for pole in self.poles:
            (kept if near.may_reach([(pole.lat_deg, pole.lon_deg)]) else gone).append(pole)
        if gone:
            self.far = self.far or (gone[0].lat_deg, gone[0].lon_deg)
        self.poles, known = kept, {pole.name for pole in kept}
        lost = {pole.name for pole in gone} - known
        self.spans = [span for span in self.spans if span.a not in lost and span.b not in lost]


def _places_of(line: Line) -> Iterator[tuple[float, float]]:
    return ((lat_deg, lon_deg) for part in line.parts for lat_deg, lon_deg, _ in part)


@dataclass(frozen=True, slots=True)
class Comparison:
    """One comparison."""

    attribute: str
    op: str
    value: str

    def is_met_by(self, value: object) -> bool:
        """Return whether a value fulfils it; for a list like OpenStreetMap's ``110000;22000``, whether any part does.

        Two numbers are compared as numbers; ordering applies only to numbers. A missing value fulfils nothing.
        """
        compare = any if self.op != "!=" else all
        parts = parts_of(value, by_order=self.is_numeric_only)
        return bool(parts) and compare(self._is_met_by_part(part) for part in parts)

    @property
    def is_numeric_only(self) -> bool:
        """Whether it can compare numbers only."""
        return self.op not in {"=", "!="}

    def can_compare(self, value: object) -> bool:
        """Return whether a value can be compared; ordering needs a numeric part."""
        parts = parts_of(value, by_order=True)
        return not self.is_numeric_only or not any(parts) or any(parse_figure_with_unit(part) for part in parts)

    def _is_met_by_part(self, part: str) -> bool:
        mine, theirs = parse_figure_with_unit(self.value), parse_figure_with_unit(part)
        if mine is None or theirs is None:
            return not self.is_numeric_only and (part == self.value) is (self.op == "=")
        (asked, unit), (found, other) = mine, theirs
        if other in KILOVOLTS and (unit in {"v", "в"} or (not unit and asked > MOST_KV)):
            found *= 1000.0
        elif unit in KILOVOLTS and (other in {"v", "в"} or (not other and found > MOST_KV)):
            asked *= 1000.0
        return OPERATORS[self.op](found, asked)


def parts_of(value: object, *, by_order: bool) -> list[str]:
    """Return the parts of a value: of a list like ``110000;22000``, and for ordering those of ``132/33 kV`` too."""
    if not isinstance(value, str):
        return [] if value is None else [str(value)]
    parts = [part.strip() for part in value.split(";")]
    return [one for part in parts for one in _split_figures(part)] if by_order else parts


def _split_figures(part: str) -> list[str]:
    found = [parse_figure_with_unit(one) for one in part.split("/")]
    figures = [one for one in found if one is not None]
    if len(figures) < max(2, len(found)):
        return [part]
    return [f"{figure!r} {unit or figures[-1][1]}".strip() for figure, unit in figures]


def parse_figure_with_unit(text: str) -> tuple[float, str] | None:
    """Return a number and its unit, in lower case and possibly empty; None if it is not a number.

    >>> [parse_figure_with_unit(text) for text in ("132 kV", "132 000", "12A")]
    [(132.0, 'kv'), (132000.0, ''), None]
    """
    alone = parse_figure(text)
    found = measure_of(text) if alone is None else (alone, "")
    if found is None or not math.isfinite(found[0]):
        return None
    is_whole = alone is not None or (found[1] in UNITS and text.rstrip(" .").lower().endswith(found[1]))
    return found if is_whole else None


def parse_where(text: str) -> tuple[Comparison, ...]:
    """Return the comparisons of a filter, e.g. ``voltage >= 110000 and operator = 'CEPS'``.

    Raises:
        ValueError: the filter is invalid.
    """
    terms, at = [], 0
    while match := _TERM.match(text, at):
        op = "=" if match["op"] == "==" else match["op"]
        value = next(found for found in (match["text"], match["text2"], match["bare"]) if found is not None)
        terms.append(Comparison(match["quoted"] or match["name"], op, value))
        if terms[-1].is_numeric_only and parse_figure_with_unit(value) is None:
            raise ValueError(f"expected a number behind {op}, which compares by order")
        at = match.end()
        if at == len(text):
            return tuple(terms)
        following = _AND.match(text, at)
        if following is None:
            break
        at = following.end()
    raise ValueError("expected comparisons such as \"voltage >= 110000 and operator = 'CEPS'\", with = != < <= > >=")


@dataclass(slots=True)
class ReadOptions:
    """The caller's selection of a file's content, and observations made while applying it."""

    source: str
    """The file's name."""
    layers: tuple[str, ...] = ()
    """Names of the layers to read; if empty all suitable ones."""
    where: tuple[Comparison, ...] = ()
    crs: str | None = None
    """Reference system for files without their own."""
    encoding: str | None = None
    """Encoding of text tables and of shapefiles' names; None to detect it."""
    near: NearFilter | None = None
    """Area filter for a country's file; None: all of it."""
    depot: LocalFrame | None = None
    """The caller's depot, if known."""
    anywhere: bool = False
    """Whether the depot may be missing."""
    seen: set[str] = field(default_factory=set)
    passed: int = 0
    looked: int = 0
    uncompared: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Values that could not be compared, by attribute and value, where that is why a feature was not selected."""
    nameless: Counter[str] = field(default_factory=Counter)
    """The same for missing or empty attributes."""
    with_unit: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Figures with a unit, by attribute, with one example."""

    def create_raw_network(self, kind: str, crs: str = "WGS 84", *, flat: bool = False) -> RawNetwork:
        """Return an empty network for the content of a format."""
        return RawNetwork(self.source, kind, crs, flat=flat, near=self.near)

    def is_wanted(self, attributes: Attributes) -> bool:
        """Return whether a feature is selected."""
        self.looked += 1
        lowered = {key.lower(): value for key, value in attributes.items()}
        if self.where:
            self.seen.update(attributes)
        values = [lowered.get(term.attribute.lower()) for term in self.where]
        wrong = [(term, value) for term, value in zip(self.where, values, strict=True) if not term.is_met_by(value)]
        if all(is_blank(value) or not term.can_compare(value) for term, value in wrong):
            # The only obstacle is a value that cannot be compared.
            self.nameless.update({term.attribute for term, value in wrong if is_blank(value) and term.is_numeric_only})
            self.uncompared.update((term.attribute, str(value)) for term, value in wrong if not is_blank(value))
        for term, value in zip(self.where, values, strict=True):
            parts = parts_of(value, by_order=True) if parse_figure_with_unit(term.value) else []
            if any(found[1] for found in map(parse_figure_with_unit, parts) if found):
                self.with_unit[term.attribute, str(value)] += 1
        if wrong:
            return False
        self.passed += 1
        return True

    def has_comparison_of(self, attribute: str) -> bool:
        """Return whether a comparison refers to an attribute, given by its normalised name."""
        return any(normalise_key(term.attribute) == attribute for term in self.where)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Return remarks on a filter: values that it could not compare, and how figures with a unit were compared."""
        found = [(name, f"{count} without a value: left out") for name, count in self.nameless.items()]
        found += [(name, words) for name, words in _describe_by_name(self.uncompared, "are no numbers: left out")]
        found += [(name, words) for name, words in _describe_by_name(self.with_unit, "are read as figures with a unit")]
        return tuple(Remark(RemarkTopic.FILTER, name, words) for name, words in found)

    def check_where(self) -> None:
        """Refuse a filter that matches nothing in the file.

        Raises:
            NetworkError: no line has an attribute, or nothing fulfils all of it.
        """
        if not self.where or not self.looked:
            return
        known = {key.lower() for key in self.seen}
        for term in self.where:
            if term.attribute.lower() not in known:
                raise NetworkError(
                    f"where: expected an attribute of the lines, {quote_names(sorted(self.seen))}, "
                    f"got {term.attribute!r}"
                )
        if not self.passed:
            words = " and ".join(f"{term.attribute} {term.op} {term.value}" for term in self.where)
            why = "".join(f"; {one.words}" for one in self.remarks)
            raise NetworkError(f"where: expected lines of which {words} holds, found none of {self.looked}{why}")

    def select_layers(self, known: Sequence[str], kind: str = "layer") -> tuple[str, ...]:
        """Return the requested layers; all if none is requested.

        Raises:
            NetworkError: one does not exist.
        """
        for layer in self.layers:
            if layer not in known:
                raise NetworkError(f"layer: expected a {kind} of the file, {quote_names(known)}, got {layer!r}")
        return self.layers or tuple(known)

    def refuse_layers(self, what: str) -> None:
        """Refuse layers for a format without layers.

        Raises:
            NetworkError: one is requested.
        """
        if self.layers:
            raise NetworkError(f"layer: expected none for {what}, which has no layers; got {self.layers[0]!r}")

    def refuse_crs(self, what: str) -> None:
        """Refuse another grid for a format that is always WGS 84.

        Raises:
            NetworkError: one is requested.
        """
        if self.crs is not None:
            raise NetworkError(f"crs: expected none for {what}, which is always WGS 84; got {self.crs!r}")


def _describe_by_name(counts: Mapping[tuple[str, str], int], words: str) -> Iterable[tuple[str, str]]:
    """Yield a line for each attribute: the number of values, and an example."""
    for name in dict.fromkeys(name for name, _ in counts):
        own = [(value, count) for (one, value), count in counts.items() if one == name]
        yield name, f"{sum(count for _, count in own)} such as {own[0][0][:40]!r} {words}"


def quote_names(names: Iterable[str]) -> str:
    """Return names for a message: the first few in quotes."""
    every = list(names)
    more = ", ..." if len(every) > MOST_NAMED else ""
    return ", ".join(map(repr, every[:MOST_NAMED])) + more or "which has none"
