"""Format times, positions and foreign texts alike for the terminal, the page and the report."""

from __future__ import annotations

import shlex
import unicodedata
from collections.abc import Iterable, Sequence

REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
"""Stands for a character that would move the cursor, colour the line or change its direction."""
_STATES = {"ground": "on the ground", "pilot": "with its pilot", "down": "down: keep away"}
_FIXES = {0: "no GPS", 1: "no fix", 2: "2D", 3: "3D", 4: "DGPS", 5: "RTK float", 6: "RTK"}
FOURTH_DECIMAL_M = 11.0
"""Metres in the fourth decimal of a degree of latitude."""
MINUTES_FROM_S = 120.0
"""Age from which it is given in minutes."""
_CONTROL_CATEGORIES = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def format_count(number: int, thing: str) -> str:
    """Return a count with its noun.

    >>> format_count(1, "segment"), format_count(0, "segment")
    ('1 segment', '0 segments')
    """
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def describe_unreachable(named: Iterable[tuple[str, str]], most: int) -> list[str]:
    """Return the segments that cannot be inspected, one line per reason, from their names and reasons.

    >>> describe_unreachable([("A1", "lies in area 'park'"), ("A2", "lies in area 'park'")], most=1)
    ["not reachable, lies in area 'park': A1, and 1 more"]
    """
    reasons: dict[str, list[str]] = {}
    for name, why in named:
        reasons.setdefault(why, []).append(name)
    return [f"not reachable, {why}: {join_first_names(names, most)}" for why, names in reasons.items()]


def join_first_names(names: Sequence[str], most: int) -> str:
    """Return names in a row; of many the first ones, and the number of the others."""
    shown_names = names if len(names) <= most else [*names[:most], f"and {len(names) - most} more"]
    return ", ".join(shown_names)


def command_line(*parts: object) -> str:
    """Return a command of this program quoted for a shell: a path with a space is one argument.

    >>> command_line("restore", "r A"), command_line("plan", "site.toml")
    ("faultline restore 'r A'", 'faultline plan site.toml')
    """
    return shlex.join(("faultline", *map(str, parts)))


def format_duration(seconds: float) -> str:
    """Return a time in minutes and seconds, and hours if any; fractions of a second are dropped.

    >>> format_duration(7.9), format_duration(754.2), format_duration(3725), format_duration(-3)
    ('0:07', '12:34', '1:02:05', '0:00')
    """
    whole = max(0, int(seconds))
    hours, rest = divmod(whole, 3600)
    above = f"{hours}:{rest // 60:02d}" if hours else f"{rest // 60}"
    return f"{above}:{rest % 60:02d}"


def format_flight_time(seconds: float | None) -> str:
    """Return a time since the take-off command; empty before it.

    >>> format_flight_time(754.2), format_flight_time(None)
    ('T+12:34', '')
    """
    return "" if seconds is None or seconds < 0.0 else f"T+{format_duration(seconds)}"


def place_decimals(accuracy_m: float | None) -> int:
    """Return the number of decimals of a degree that an accuracy supports: the sixth is a decimetre, the fifth a metre.

    >>> place_decimals(0.02), place_decimals(None), place_decimals(3.0), place_decimals(40.0), place_decimals(441.0)
    (6, 5, 5, 4, 3)
    """
    if accuracy_m is None or 1.0 <= accuracy_m < FOURTH_DECIMAL_M:
        return 5
    return 6 if accuracy_m < 1.0 else 4 if accuracy_m < 10 * FOURTH_DECIMAL_M else 3


def format_lat_lon(lat_deg: float, lon_deg: float, accuracy_m: float | None = None) -> str:
    """Return coordinates as people read and type them, with the decimals that their accuracy supports.

    >>> format_lat_lon(49.5984123, -15.6), format_lat_lon(49.5984123, -15.6, 0.3)
    ('49.59841, -15.60000', '49.598412, -15.600000')
    """
    decimals = place_decimals(accuracy_m)
    return f"{lat_deg:.{decimals}f}, {lon_deg:.{decimals}f}"


def format_known_place(lat_deg: float, lon_deg: float, known: str, accuracy_m: float | None) -> str:
    """Return coordinates with their source and accuracy; `known` is that of `PositionView.known`.

    >>> format_known_place(49.5984123, -15.6, "fix", 3.0), format_known_place(49.6, -15.6, "reckoned", 441.0)
    ('49.59841, -15.60000 (GPS, 3 m)', '49.600, -15.600 (reckoned without GPS, off by 441 m or more)')
    """
    coordinates = format_lat_lon(lat_deg, lon_deg, accuracy_m)
    if known == "reckoned":
        return f"{coordinates} (reckoned without GPS, off by {accuracy_m or 0.0:.0f} m or more)"
    if known == "unsaid":
        return f"{coordinates} (GPS not reported)"
    return f"{coordinates} (GPS, {accuracy_m or 0.0:.2g} m)" if known == "fix" else coordinates


def format_age(seconds: float) -> str:
    """Return an age.

    >>> format_age(4.2), format_age(754.2)
    ('4 s ago', '12:34 min ago')
    """
    return f"{seconds:.0f} s ago" if seconds < MINUTES_FROM_S else f"{format_duration(seconds)} min ago"


def escape_controls(text: str) -> str:
    r"""Return a text without what a terminal would obey: vehicles and files may say anything.

    >>> escape_controls("crash \x1b[2J of\tuav1\n") == f"crash {REPLACEMENT}[2J of uav1"
    True
    """
    if text.isprintable():
        return text
    words = " ".join(text.split())
    return "".join(REPLACEMENT if unicodedata.category(one) in _CONTROL_CATEGORIES else one for one in words)


def format_state_word(word: str) -> str:
    """Return a vehicle's state, as in `VehicleView.state`, for people.

    >>> format_state_word("flying"), format_state_word("pilot")
    ('flying', 'with its pilot')
    """
    return _STATES.get(word, word)


def format_gps_fix(fix: int | None, satellites: int | None) -> str:
    """Return GPS_FIX_TYPE and the number of satellites.

    >>> format_gps_fix(3, 14), format_gps_fix(1, None), format_gps_fix(None, None)
    ('3D, 14 sat', 'no fix', '?')
    """
    if fix is None:
        return "?"
    kind = _FIXES.get(fix, f"fix {fix}")
    return kind if satellites is None else f"{kind}, {satellites} sat"
