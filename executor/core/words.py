"""How times, positions and texts of others are shown: the same in the terminal, on the page, in the report."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence

UNSHOWN = "\N{REPLACEMENT CHARACTER}"
"""What stands for a character that would move the cursor, colour the line or turn its direction."""
_STATES = {"ground": "on the ground", "pilot": "with its pilot", "down": "down: keep away"}
_FIXES = {0: "no GPS", 1: "no fix", 2: "2D", 3: "3D", 4: "DGPS", 5: "RTK float", 6: "RTK"}
_UNSHOWN_KINDS = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def count_of(number: int, thing: str) -> str:
    """Return how many there are of something.

    >>> count_of(1, "segment"), count_of(0, "segment")
    ('1 segment', '0 segments')
    """
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def not_reachable(named: Iterable[tuple[str, str]], most: int) -> list[str]:
    """Return which segments cannot be inspected, a line for each reason, from their names and why that is so.

    >>> not_reachable([("A1", "lies in area 'park'"), ("A2", "lies in area 'park'")], most=1)
    ["not reachable, lies in area 'park': A1, and 1 more"]
    """
    reasons: dict[str, list[str]] = {}
    for name, why in named:
        reasons.setdefault(why, []).append(name)
    return [f"not reachable, {why}: {first_of(names, most)}" for why, names in reasons.items()]


def first_of(names: Sequence[str], most: int) -> str:
    """Return names in a row; of many the first, and how many more there are."""
    shown_names = names if len(names) <= most else [*names[:most], f"and {len(names) - most} more"]
    return ", ".join(shown_names)


def minutes(seconds: float) -> str:
    """Return a time as minutes and seconds, with hours where there are some; a part of a second does not count.

    >>> minutes(7.9), minutes(754.2), minutes(3725), minutes(-3)
    ('0:07', '12:34', '1:02:05', '0:00')
    """
    whole = max(0, int(seconds))
    hours, rest = divmod(whole, 3600)
    above = f"{hours}:{rest // 60:02d}" if hours else f"{rest // 60}"
    return f"{above}:{rest % 60:02d}"


def since_take_off(seconds: float | None) -> str:
    """Return a time since the order to take off; nothing for what was before it.

    >>> since_take_off(754.2), since_take_off(None)
    ('T+12:34', '')
    """
    return "" if seconds is None or seconds < 0.0 else f"T+{minutes(seconds)}"


def place(lat_deg: float, lon_deg: float) -> str:
    """Return coordinates as people read them out and type them in: to a tenth of a metre.

    >>> place(49.5984123, -15.6)
    '49.598412, -15.600000'
    """
    return f"{lat_deg:.6f}, {lon_deg:.6f}"


def shown(text: str) -> str:
    r"""Return a text without what a terminal would obey: vehicles and files may say anything.

    >>> shown("crash \x1b[2J of\tuav1\n") == f"crash {UNSHOWN}[2J of uav1"
    True
    """
    if text.isprintable():
        return text
    words = " ".join(text.split())
    return "".join(UNSHOWN if unicodedata.category(one) in _UNSHOWN_KINDS else one for one in words)


def state(word: str) -> str:
    """Return what a vehicle does, as `VehicleView.state` has it, for people.

    >>> state("flying"), state("pilot")
    ('flying', 'with its pilot')
    """
    return _STATES.get(word, word)


def gps(fix: int | None, satellites: int | None) -> str:
    """Return GPS_FIX_TYPE and the number of satellites.

    >>> gps(3, 14), gps(1, None), gps(None, None)
    ('3D, 14 sat', 'no fix', '?')
    """
    if fix is None:
        return "?"
    kind = _FIXES.get(fix, f"fix {fix}")
    return kind if satellites is None else f"{kind}, {satellites} sat"
