"""What every reader makes of its file: poles, lines and single spans in WGS 84, before anybody asks what they mean."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from missions.errors import NetworkError
from missions.geo import LocalFrame

Vertex = tuple[float, float, float | None]
"""Latitude and longitude in degrees, and the third coordinate where there is one."""
Attributes = Mapping[str, object]

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
                f"{self.source}: {line.place}: expected at most {MOST_VERTICES} positions in all; layer, where, or a "
                "cut of the file choose what is flown"
            )
        self.lines.append(line)

    def leave_out(self, what: str, asset: str) -> None:
        """Note something that is no line and no pole."""
        self.left.setdefault(what, []).append(asset)

    @property
    def left_out_text(self) -> str:
        """What was left out: how many of each kind, and the first of them; empty if nothing was."""
        return ", ".join(
            f"{len(names)} {_PLURAL.sub('s', what, count=1) if len(names) > 1 else what} "
            f"({', '.join(names[:NAMED])}{', ...' if len(names) > NAMED else ''})"
            for what, names in self.left.items()
        )

    @property
    def remarks(self) -> list[Remark]:
        """What was found, and in one line what was left out."""
        left = [Remark(RemarkTopic.LEFT_OUT, self.format, self.left_out_text)] if self.left else []
        return [*self.found, *left]

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
    """Yield latitude and longitude of every position of a line."""
    return ((lat_deg, lon_deg) for part in line.parts for lat_deg, lon_deg, _ in part)
