"""What every reader makes of its file: poles, lines and single spans in WGS 84, before anybody asks what they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from missions.errors import NetworkError

Vertex = tuple[float, float, float | None]
"""Latitude and longitude in degrees, and the third coordinate where there is one."""
Attributes = Mapping[str, object]

MOST_VERTICES = 1_000_000
"""Of all lines together; what holds more is a country's, to be cut to what is flown."""
NAMED = 3
"""How many of what is left out are named."""


class Matter(StrEnum):
    """What a finding is about."""

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

    matter: Matter
    asset: str
    """The line's, span's or pole's name."""
    text: str
    """What was found of it and what was done."""

    @property
    def words(self) -> str:
        """The whole line."""
        return f"{self.asset}: {self.text}"


def why_nothing(found: Iterable[Remark]) -> str:
    """Return why nothing remains of a file, to be put behind a message."""
    return "".join(f"; left out: {one.text}" for one in found if one.matter is Matter.LEFT_OUT)


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
class Depot:
    """The depot, where the file has one."""

    place: str
    lat_deg: float
    lon_deg: float
    elevation_m: float | None


@dataclass(slots=True)
class Drawing:
    """All that was read of a file."""

    source: str
    """The file's name, for messages."""
    format: str
    crs: str = "WGS 84"
    """What its coordinates were, in words."""
    poles: list[Pole] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    depot: Depot | None = None
    found: list[Remark] = field(default_factory=list)
    flat: bool = False
    """Whether the file says that its ground is as high as the depot's everywhere."""
    vertices: int = 0
    others: list[Pole] = field(default_factory=list)
    """Points that are no poles: a vehicle may stand at a substation."""
    left: dict[str, list[str]] = field(default_factory=dict)
    """What is no line and no pole, by what it is: the names of each."""

    def draw(self, line: Line) -> None:
        """Add a line.

        Raises:
            NetworkError: there are too many vertices by now.
        """
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
    def left_words(self) -> str:
        """What was left out: how many of each kind, and the first of them; empty if nothing was."""
        return ", ".join(
            f"{len(names)} {what}{'s' if len(names) > 1 else ''} "
            f"({', '.join(names[:NAMED])}{', ...' if len(names) > NAMED else ''})"
            for what, names in self.left.items()
        )

    @property
    def remarks(self) -> list[Remark]:
        """What was found, and in one line what was left out."""
        left = [Remark(Matter.LEFT_OUT, self.format, self.left_words)] if self.left else []
        return [*self.found, *left]
