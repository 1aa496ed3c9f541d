"""Parse figures in cells, attributes and tags, the same way for every format.

Handles decimal commas, thousands separators, degrees with minutes and seconds, units, and pole numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from missions.files import is_number

Attributes = Mapping[str, object]
"""Attributes of a feature, by their names in the file."""
BLANK = {"", "nan", "null", "(null)", "<null>", "none", "n/a", "#n/a", "nil", "not available"}
"""Texts that programs write for an empty value."""
NO_FIGURE = BLANK | {"-", "--", "?", "na", "unknown"}
NO_HEIGHT_M = -9999.0
"""Heights below this mean unknown: -9999, -32768, -1e38."""
NORTH_SOUTH, EAST_WEST = "NS", "EW"
METRES: Mapping[str, float] = {
    "": 1.0, "m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "mtr": 1.0, "mtrs": 1.0,
    "masl": 1.0, "mamsl": 1.0, "ft": 0.3048, "feet": 0.3048, "foot": 0.3048, "'": 0.3048, "km": 1000.0,
}  # fmt: skip
FEET = ("ft", "feet", "foot", "'")
INCH_M = 0.0254
GRID_UNITS = ("", "m", "e", "n", "me", "mn")
"""Valid suffixes of an easting or a northing, which is in the grid's own unit."""

_LETTERS = str.maketrans({
    "−": "-", "‐": "-", "‑": "-", "–": "-", "—": "-", "’": "'", "‘": "'", "ʹ": "'", "ʼ": "'", "´": "'", "`": "'",
    "′": "'", "″": '"', "”": '"', "“": '"', "ʺ": '"', "º": "°", "˚": "°",
})  # fmt: skip
_FIGURE = re.compile(r"([+-]?)(\d[\d .,']*|[.,]\d+)(e[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)
_PLAIN = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_GROUPED = {mark: re.compile(rf"\d{{1,3}}(?:{re.escape(mark)}\d{{3}})+", re.ASCII) for mark in " '.,"}
_MEASURE = re.compile(r"([+-]?[\d.,][\d .,']*?) ?(?<=[\d.,' ])([^\W\d]\S*|['%])?(?: (\D*))?", re.ASCII)
_FEET = re.compile(r"(\d+)' ?(\d+(?:\.\d+)?)\"", re.ASCII)
_PARTS = re.compile(
    r"""(\d{1,3}(?:\.\d+)?)\ ?(?:°|d|deg|:|-|\ )?\ ?
        (?:(\d{1,2}(?:\.\d+)?)\ ?(?:'|:|-|m|min|\ )?\ ?
        (?:(\d{1,2}(?:\.\d+)?)\ ?(?:"|'')?)?)?""",
    re.ASCII | re.IGNORECASE | re.VERBOSE,
)
_PACKED = re.compile(r"(\d{2,3})(\d{2})(?:(\d{2})(\.\d+)?|(\.\d+))?", re.ASCII)
_NUMBERED = re.compile(r"(\D*)(\d+)(.*)", re.ASCII | re.DOTALL)
_PIECE = re.compile(r"\d+|[^\d\s./\-]+", re.ASCII)


def is_blank(value: object) -> bool:
    """Return whether a value is empty."""
    if isinstance(value, str):
        return value.strip().lower() in BLANK
    return value is None or (isinstance(value, float) and math.isnan(value))


def _normalise_text(text: str) -> str:
    """Return a text with normalised spaces, dashes and quotation marks."""
    return " ".join(text.translate(_LETTERS).split())


def parse_figure(text: str, mark: str | None = None) -> float | None:
    """Return the number in a text; None if it is not a number, or is ambiguous.

    Thousands separators may be spaces, apostrophes, dots or commas.

    Args:
        text: For example '543 355,1' or '1,345.5'.
        mark: The file's decimal mark, if known: without it '1,345' is ambiguous.
    """
    if mark != "," and _PLAIN.fullmatch(text):  # fast path for nearly all figures, as a file has many
        return float(text)
    match = _FIGURE.fullmatch(_normalise_text(text))
    if match is None:
        return None
    sign, digits, exponent = match[1], match[2], match[3] or ""
    decimal = _find_decimal_mark(digits, mark)
    if decimal is None:
        return None
    whole, _, rest = digits.partition(decimal) if decimal else (digits, "", "")
    between = {letter for letter in whole if not letter.isdigit()}
    if between and (len(between) > 1 or not _GROUPED[between.pop()].fullmatch(whole)):
        return None
    if rest and not rest.isdigit():
        return None
    return float(f"{sign}{''.join(filter(str.isdigit, whole)) or '0'}.{rest or '0'}{exponent}")


def _find_decimal_mark(digits: str, mark: str | None) -> str | None:
    """Return the decimal mark in a figure: empty if it has none, None if ambiguous."""
    marks = [letter for letter in digits if letter in ".,"]
    if len(set(marks)) == 2:
        return marks[-1]
    if len(marks) != 1:
        return ""
    (own,) = marks
    may_group = bool(_GROUPED[own].fullmatch(digits)) and not digits.startswith("0")
    if not may_group or own == mark:
        return own
    if mark is not None:
        return ""
    return own if own == "." else None


def decimal_mark_of(texts: Iterable[str]) -> str | None:
    """Return the decimal mark of a file's figures, if all unambiguous ones agree."""
    shown: set[str] = set()
    for text in texts:
        match = _FIGURE.fullmatch(_normalise_text(text))
        marks = [letter for letter in match[2] if letter in ".,"] if match else []
        if match is None or not marks:
            continue
        if len(set(marks)) == 2:
            shown.add(marks[-1])
        elif len(marks) > 1:
            shown.add("," if marks[0] == "." else ".")
        elif not _GROUPED[marks[0]].fullmatch(match[2]) or match[2].startswith("0"):
            shown.add(marks[0])
    return shown.pop() if len(shown) == 1 else None


def parse_number(value: object) -> float | None:
    """Return the number in a cell or tag; None if it is not a number."""
    if isinstance(value, str):
        return parse_figure(value)
    return float(value) if is_number(value) else None


def degrees_of(value: object, letters: str) -> float | None:
    """Return a latitude or a longitude; None if it is neither.

    Args:
        value: A number; or a text, e.g. '49.6', '49,6', '49°35′57.4″N', 'N 49 35.957', '493557N'.
        letters: Valid hemisphere letters: `NORTH_SOUTH` or `EAST_WEST`.
    """
    if not isinstance(value, str):
        return parse_number(value)
    text = _normalise_text(value).upper()
    figure = parse_figure(text, "," if "," in text else ".")
    if figure is not None:
        return figure
    side = next((letter for letter in letters if text.endswith(letter) or text.startswith(letter)), "")
    text = (text.removesuffix(side) if text.endswith(side) else text.removeprefix(side)).strip() if side else text
    negative, text = text.startswith("-"), text.lstrip("+-").strip().replace(",", ".")
    degrees = _parse_packed(text) if side else None
    if degrees is None:
        degrees = _parse_sexagesimal(text)
    if degrees is None or (negative and side):
        return None
    return -degrees if negative or side in {"S", "W"} else degrees


def _parse_sexagesimal(text: str) -> float | None:
    match = _PARTS.fullmatch(text)
    if match is None:
        return None
    parts = [part for part in match.groups() if part is not None]
    figures = [float(part) for part in parts]
    # Only the last of degrees, minutes and seconds may have decimals; 59.99 may be rounded to 60.
    if any("." in part for part in parts[:-1]) or any(figure > 60 for figure in figures[1:]):
        return None
    return sum(figure / unit for figure, unit in zip(figures, (1.0, 60.0, 3600.0), strict=False))


def _parse_packed(text: str) -> float | None:
    """Return degrees from packed figures without separators, as in aeronautical data: 493557.4."""
    match = _PACKED.fullmatch(text)
    if match is None:
        return None
    degrees, minutes, seconds, after, broken = match.groups()
    figures = float(degrees), float(minutes + (broken or "")), float((seconds or "0") + (after or ""))
    return None if max(figures[1:]) > 60 else figures[0] + figures[1] / 60 + figures[2] / 3600


def measure_of(text: str, mark: str | None = None) -> tuple[float, str] | None:
    """Return a figure and its unit in lower case: '132 kV' is 132 and 'kv'; None if it is not a figure."""
    alone = parse_figure(text, mark)
    match = None if alone is not None else _MEASURE.fullmatch(_normalise_text(text))
    figure = parse_figure(match[1], mark) if match else alone
    return None if figure is None else (figure, (match[2] or "").rstrip(".").lower() if match else "")


def metres_of(value: object, mark: str | None = None) -> float | None:
    """Return a length in metres, the default unit; None if it is not a length."""
    if not isinstance(value, str):
        return parse_number(value)
    feet = _FEET.fullmatch(_normalise_text(value))
    if feet is not None:
        return float(feet[1]) * METRES["ft"] + float(feet[2]) * INCH_M
    # With feet, the comma is a thousands separator.
    found = measure_of(value, mark) or measure_of(value, ".")
    if found is None or found[1] not in METRES or (measure_of(value, mark) is None and found[1] not in FEET):
        return None
    return found[0] * METRES[found[1]]


def grid_figure_of(value: object, mark: str | None = None) -> float | None:
    """Return an easting or a northing, also from '543 355,1 m E'; None if it is neither."""
    if not isinstance(value, str):
        return parse_number(value)
    found = measure_of(value, mark)
    return None if found is None or found[1] not in GRID_UNITS else found[0]


@dataclass(frozen=True, slots=True)
class PoleRank:
    """A pole's position in its line, from its number and the letters around it: '12A' is between 12 and 13."""

    text: str
    before: str
    number: float
    after: tuple[tuple[int, float, str], ...]


def parse_pole_rank(value: object) -> PoleRank | None:
    """Return the position in a line given by a pole's number; None if it has no digit."""
    text = str(value).strip()
    figure = parse_number(value) if not (isinstance(value, str) and "e" in value.lower()) else None
    if figure is not None:
        return PoleRank(f"{figure:g}", "", figure, ()) if math.isfinite(figure) else None
    match = _NUMBERED.fullmatch(_normalise_text(value)) if isinstance(value, str) else None
    if match is None:
        return None
    pieces = _PIECE.findall(match[3].lower())
    after = tuple((0, float(piece), "") if piece.isdigit() else (1, 0.0, piece) for piece in pieces)
    return PoleRank(text, match[1].strip(" ./-_").lower(), float(match[2]), after)


RankKey = tuple[str, float, tuple[tuple[int, float, str], ...]]


def build_rank_keys(ranks: Sequence[PoleRank]) -> list[RankKey]:
    """Return sort keys for the poles of one line.

    Letters before the number divide a line into parts, B1 after A9; if some poles have none, a letter marks a pole
    inserted later: A12 is between 12 and 13, as 12A is.
    """
    if all(rank.before for rank in ranks):
        return [(rank.before, rank.number, rank.after) for rank in ranks]
    return [("", rank.number, (((1, 0.0, rank.before),) if rank.before else ()) + rank.after) for rank in ranks]
