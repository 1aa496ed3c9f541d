"""What every reader makes of its file: poles, lines and single spans in WGS 84, before anybody asks what they mean.

And what of a file is wanted: layers, and lines by their attributes.
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
"""Latitude and longitude in degrees, and the third coordinate where there is one."""

MOST_VERTICES = 1_000_000
"""Of all lines together; what holds more is a country's, to be cut to what is flown."""
REASONS = 6
"""How many reasons a message names."""
NAMED = 3
"""How many of what is left out are named."""
_PLURAL = re.compile(r"(?= of )|$")
"""Where a name gets its s: 'lines of a substation'."""
DEGREE_M = 110_500.0
"""Of latitude; nowhere less."""
OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "=": operator.eq, "<": operator.lt, ">": operator.gt,
}  # fmt: skip
MOST_NAMED = 12
"""How many attributes or layers an error names."""
UNITS = ("v", "kv", "mv", "hz", "w", "kw", "mw", "mva", "m", "km", "mm", "cm", "ft", "%", "в", "кв")
"""What may stand behind a figure, without regard to case; the last two are Cyrillic."""
KILOVOLTS = ("kv", "кв")
MOST_KV = 2000.0
"""No line has more: a filter that asks for more of kilovolts means volts."""
_TERM = re.compile(
    r"""\s*(?:"(?P<quoted>[^"]+)"|(?P<name>[^\s<>=!'"]+))\s*(?P<op><=|>=|!=|==|=|<|>)\s*"""
    r"""(?:'(?P<text>[^']*)'|"(?P<text2>[^"]*)"|(?P<bare>[^\s<>=!'"]+))\s*"""
)
_AND = re.compile(r"and\b\s*", re.IGNORECASE)


class RemarkTopic(StrEnum):
    """What a finding is about."""

    WHOLE = "is it whole"
    """Said before all others: what is read may not be what its people see, or not all of it."""
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
    """One thing of a file that was mended, or left for people to look at."""

    matter: RemarkTopic
    asset: str
    """The line's, span's or pole's name."""
    text: str
    """What was found of it and what was done."""
    about: str = ""
    """The span that there is of it, where that has another name."""

    @property
    def words(self) -> str:
        """The whole line."""
        return f"{self.asset}: {self.text}"


def explain_empty_file(found: Iterable[Remark]) -> str:
    """Return why nothing remains of a file, to be put behind a message: what was left out, and how often."""
    counts = Counter(
        f"left out: {one.text}" if one.matter is RemarkTopic.LEFT_OUT else one.text
        for one in found
        if one.matter in {RemarkTopic.WHOLE, RemarkTopic.FILTER, RemarkTopic.LEFT_OUT}
    )
    words = [text if count == 1 else f"{count} times {text}" for text, count in counts.most_common(REASONS)]
    return "".join(f"; {one}" for one in words)


@dataclass(frozen=True, slots=True)
class Pole:
    """One structure as its file has it."""

    place: str
    """Where it stands in the file, for messages."""
    name: str
    """Empty where the file has none."""
    lat_deg: float
    lon_deg: float
    elevation_m: float | None = None
    height_m: float | None = None
    third_m: float | None = None
    line: str = ""
    """What tells it from another line's pole of the same name."""
    hinted: Mapping[str, str] = field(default_factory=dict)
    """Which of its heights count only if all poles have them, and what said them."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line as its file has it: of several parts where it is interrupted or branches."""

    place: str
    name: str
    parts: tuple[tuple[Vertex, ...], ...]


@dataclass(frozen=True, slots=True)
class Span:
    """A span that its file gives by the names of its two poles."""

    place: str
    name: str
    a: str
    b: str
    line: str = ""


@dataclass(frozen=True, slots=True)
class NearFilter:
    """What lies about a depot, roughly: all else of a country's file need not be kept."""

    frame: LocalFrame
    within_m: float

    def may_reach(self, places: Iterable[tuple[float, float]]) -> bool:
        """Return whether the box around some places, by latitude and longitude, may reach so near."""
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
    """All that was read of a file."""

    source: str
    """The file's name, for messages."""
    format: str
    crs: str = "WGS 84"
    """What its coordinates were, in words."""
    poles: list[Pole] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    depot: Pole | None = None
    """Where the file has one."""
    found: list[Remark] = field(default_factory=list)
    flat: bool = False
    """Whether the file says that its ground is as high as the depot's everywhere."""
    vertices: int = 0
    others: list[Pole] = field(default_factory=list)
    """Points that are no poles: a vehicle may stand at a substation."""
    left: dict[str, list[str]] = field(default_factory=dict)
    """What is no line and no pole, by what it is: the names of each."""
    near: NearFilter | None = None
    """Lines that reach nowhere near are not kept; None keeps all."""
    far: tuple[float, float] | None = None
    """A place of a line that was not kept."""

    def add_line(self, line: Line) -> None:
        """Add a line, if it is near enough.

        Raises:
            NetworkError: there are too many vertices by now.
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
        """Note something that is no line and no pole."""
        self.left.setdefault(what, []).append(asset)

    @property
    def remarks(self) -> list[Remark]:
        """What was found, and in one line what was left out: how many of each kind, and the first of them."""
        text = ", ".join(
            f"{len(names)} {_PLURAL.sub('s', what, count=1) if len(names) > 1 else what} "
            f"({', '.join(names[:NAMED])}{', ...' if len(names) > NAMED else ''})"
            for what, names in self.left.items()
        )
        return [*self.found, *([Remark(RemarkTopic.LEFT_OUT, self.format, text)] if text else [])]

    def keep_near(self) -> None:
        """Leave out what is far away."""
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
        """Return whether it holds of a value; of a list such as OpenStreetMap's ``110000;22000``, of any part.

        As numbers where both are; by order only numbers are compared. What is not there fulfils nothing.
        """
        compare = any if self.op != "!=" else all
        parts = parts_of(value, by_order=self.is_numeric_only)
        return bool(parts) and compare(self._is_met_by_part(part) for part in parts)

    @property
    def is_numeric_only(self) -> bool:
        """Whether numbers alone can be compared so."""
        return self.op not in {"=", "!="}

    def can_compare(self, value: object) -> bool:
        """Return whether a value that is there can be compared; by order it cannot where no part of it is a number."""
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
    """Return the parts of a value: of a list such as ``110000;22000`` each, by order those of ``132/33 kV`` too."""
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
    """Return a number and the unit behind it, in small letters and empty where there is none; None if it is no number.

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
    """Return the comparisons of a filter such as ``voltage >= 110000 and operator = 'CEPS'``.

    Raises:
        ValueError: it is none.
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
    """What a caller wants of a file, and what was seen while it was looked for."""

    source: str
    """The file's name."""
    layers: tuple[str, ...] = ()
    """By their names; all that fit if empty."""
    where: tuple[Comparison, ...] = ()
    crs: str | None = None
    """Of files that do not say theirs."""
    encoding: str | None = None
    """Of tables in text and of shapefiles' names; None to try."""
    near: NearFilter | None = None
    """What is wanted of a country's file; None: all of it."""
    depot: LocalFrame | None = None
    """Of who asks, where it is known."""
    anywhere: bool = False
    """Whether it may be missing."""
    seen: set[str] = field(default_factory=set)
    passed: int = 0
    looked: int = 0
    uncompared: Counter[tuple[str, str]] = field(default_factory=Counter)
    """By the attribute and its value, where that is why something is not wanted."""
    nameless: Counter[str] = field(default_factory=Counter)
    """The same where the attribute is not there, or empty."""
    with_unit: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Figures with a unit behind, by the attribute and one of them."""

    def create_raw_network(self, kind: str, crs: str = "WGS 84", *, flat: bool = False) -> RawNetwork:
        """Return what a file of some format is drawn into."""
        return RawNetwork(self.source, kind, crs, flat=flat, near=self.near)

    def is_wanted(self, attributes: Attributes) -> bool:
        """Return whether a feature is wanted."""
        self.looked += 1
        lowered = {key.lower(): value for key, value in attributes.items()}
        if self.where:
            self.seen.update(attributes)
        values = [lowered.get(term.attribute.lower()) for term in self.where]
        wrong = [(term, value) for term, value in zip(self.where, values, strict=True) if not term.is_met_by(value)]
        if all(is_blank(value) or not term.can_compare(value) for term, value in wrong):
            # Nothing speaks against it but what cannot be read.
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
        """Return whether a comparison is of an attribute, given by its plain name."""
        return any(normalise_key(term.attribute) == attribute for term in self.where)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What people must know of a filter: what it could not compare, and how figures with a unit were."""
        found = [(name, f"{count} without a value: left out") for name, count in self.nameless.items()]
        found += [(name, words) for name, words in _describe_by_name(self.uncompared, "are no numbers: left out")]
        found += [(name, words) for name, words in _describe_by_name(self.with_unit, "are read as figures with a unit")]
        return tuple(Remark(RemarkTopic.FILTER, name, words) for name, words in found)

    def check_where(self) -> None:
        """Refuse a filter that nothing of the file answers to.

        Raises:
            NetworkError: an attribute that no line has, or nothing fulfils it all.
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
        """Return the layers that are asked for, of those that there are; all if none is asked for.

        Raises:
            NetworkError: one is not there.
        """
        for layer in self.layers:
            if layer not in known:
                raise NetworkError(f"layer: expected a {kind} of the file, {quote_names(known)}, got {layer!r}")
        return self.layers or tuple(known)

    def refuse_layers(self, what: str) -> None:
        """Refuse layers for a format without them.

        Raises:
            NetworkError: one is asked for.
        """
        if self.layers:
            raise NetworkError(f"layer: expected none for {what}, which has no layers; got {self.layers[0]!r}")

    def refuse_crs(self, what: str) -> None:
        """Refuse another grid for a format that is WGS 84 always.

        Raises:
            NetworkError: one is asked for.
        """
        if self.crs is not None:
            raise NetworkError(f"crs: expected none for {what}, which is always WGS 84; got {self.crs!r}")


def _describe_by_name(counts: Mapping[tuple[str, str], int], words: str) -> Iterable[tuple[str, str]]:
    """Yield a line for each attribute: how many values, and one of them."""
    for name in dict.fromkeys(name for name, _ in counts):
        own = [(value, count) for (one, value), count in counts.items() if one == name]
        yield name, f"{sum(count for _, count in own)} such as {own[0][0][:40]!r} {words}"


def quote_names(names: Iterable[str]) -> str:
    """Return names for a message: the first few in quotes."""
    every = list(names)
    more = ", ..." if len(every) > MOST_NAMED else ""
    return ", ".join(map(repr, every[:MOST_NAMED])) + more or "which has none"
