"""What a feature's attributes say: its name, its heights, its number on OpenStreetMap.

Attributes are compared by their names in small letters and with one kind of divider, as programs write them in any way:
'disused:power' and 'DISUSED_POWER' are the same, and so are 'Elevation (m)' and 'elevation_m'.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache

from missions.errors import NetworkError
from missions.files import is_figure, to_printable
from missions.readers.raw_network import Attributes
from missions.readers.values import METRES, NO_FIGURE, NO_HEIGHT_M, is_blank, metres_of

NAMES = (
    "name", "ref", "id", "label", "number", "code", "asset", "asset_id", "line", "line_id", "line_name", "pole",
    "pole_id", "pylon", "tower", "tower_id",
)  # fmt: skip
"""What is taken for a name, the first that is there."""
LINES = ("line", "line_id", "line_name", "circuit")
"""What says to which line a pole belongs."""
POLES = tuple(name for name in NAMES if name not in LINES)
"""What is taken for a pole's name."""
ELEVATION = ("elevation_m", "elevation_")
"""The second is what ten letters of a shapefile leave of the first."""
HEIGHT = ("height_m",)
LOOSE = {"elevation_m": ("ele", "elevation"), "height_m": ("height",)}
"""What says the same where a unit stands beside the figure, or where OpenStreetMap says that it is metres."""
NESTED = ("tags", "other_tags", "all_tags", "raw_tags", "osm_tags")
"""Attributes with attributes in them, of OpenStreetMap: a table, a text of one, or PostgreSQL's hstore."""
NODE, WAY, RELATION = "node", "way", "relation"
MAP_KINDS = {kind[0]: kind for kind in (NODE, WAY, RELATION)}

TYPES = ("@type", "osm_type", "type", "element")
"""What says which of them a feature is."""

_DIVIDER = re.compile(r"[^\w@]+")
_HSTORE = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*"((?:[^"\\]|\\.)*)"')
_MAP_ID = re.compile(r"(n|node|w|way|r|relation)/?(-?\d+)")


class PlainAttributes(dict[str, object]):
    """Attributes by their plain names, without those that say nothing."""


@lru_cache(maxsize=4096)
def normalise_key(key: str) -> str:
    """Return an attribute's name in small letters, with one kind of divider."""
    low = key.strip().lower()
    found = _DIVIDER.sub("_", low)
    return found if low.endswith("_") else found.strip("_")


def normalise_attributes(attributes: Attributes) -> PlainAttributes:
    """Return attributes by their plain names, without those that say nothing."""
    if isinstance(attributes, PlainAttributes):
        return attributes
    return PlainAttributes((normalise_key(key), value) for key, value in attributes.items() if not is_blank(value))


def flatten_attributes(attributes: Attributes) -> Attributes:
    """Return attributes with those that are nested in one of them beside it; its own win."""
    inner: dict[str, object] = {}
    prefixed: dict[str, object] = {}
    for key, value in attributes.items():
        low = normalise_key(key)
        if low in NESTED:
            inner |= _parse_nested(value)
        elif low.startswith("tags_"):  # 'tags.power', as tables make it of what is nested
            prefixed[key.strip()[len("tags_") :]] = value
    if not inner and not prefixed:
        return attributes
    own = {key: value for key, value in attributes.items() if not is_blank(value)}
    known = {normalise_key(key) for key in own}
    return {**{key: value for key, value in {**inner, **prefixed}.items() if normalise_key(key) not in known}, **own}


def _parse_nested(value: object) -> Mapping[str, object]:
    if isinstance(value, Mapping):
        return {str(key): own for key, own in value.items()}
    if not isinstance(value, str):
        return {}
    if value.lstrip().startswith("{"):
        try:
            found = json.loads(value)
        except (ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}
    return {_unescape(key): _unescape(own) for key, own in _HSTORE.findall(value)}


def _unescape(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


def find_first_value(attributes: Attributes, keys: Sequence[str]) -> object:
    """Return the value of the first of some attributes that is there and says something."""
    known = normalise_attributes(attributes)
    return next((known[key] for key in keys if key in known), None)


def name_of(attributes: Attributes, keys: Sequence[str] = NAMES) -> str:
    """Return what people call a feature; empty where nothing says so."""
    known = normalise_attributes(attributes)
    for key in keys:
        value = known.get(key)
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            # Spreadsheets and old tables have whole numbers as 12.0.
            text = str(int(value) if isinstance(value, float) and value.is_integer() else value)
            return to_printable(unicodedata.normalize("NFC", text))
    return ""


def osm_id_of(attributes: Attributes, own_id: object, kind: str) -> tuple[str, str] | None:
    """Return whether a feature is a node, a way or a relation of OpenStreetMap, and its number; else None.

    Args:
        attributes: Of the feature.
        own_id: What its file says beside them, as GeoJSON does.
        kind: What it is where its number is there alone: a point is a node.
    """
    known = normalise_attributes(attributes)
    for value in (known.get("@id"), known.get("full_id"), known.get("id"), own_id):
        match = _MAP_ID.fullmatch(value.strip()) if isinstance(value, str) else None
        if match is not None and (len(match[1]) > 1 or value is not known.get("id")):
            return MAP_KINDS[match[1][0]], match[2]
    of = next((known[key] for key in TYPES if known.get(key) in (NODE, WAY, RELATION)), None)
    keys = ("osm_id", "osmid", "@osm_id", "osm_way_id") + (("@id", "id") if of is not None else ())
    number = name_of(known, keys)
    return (str(of or kind), number) if number.removeprefix("-").isdigit() else None


def osm_name_of(attributes: Attributes, place: tuple[str, str]) -> str:
    """Return what a feature of OpenStreetMap is called: a pole by its ref, a line by its name first."""
    kind, number = place
    if kind == NODE:
        return name_of(attributes, ("ref",)) or f"n{number}"
    return name_of(attributes, ("name", "ref")) or f"{kind} {number}"


def heights_of(attributes: Attributes, place: str, mark: str | None = None) -> tuple[float | None, float | None]:
    """Return the ground's elevation and the structure's height, where they are known.

    Args:
        attributes: Of the pole.
        place: The file and the feature, for messages.
        mark: The file's decimal mark, where it shows one.

    Raises:
        NetworkError: one is no length.
    """
    return read_metres(attributes, ELEVATION, place, mark), read_metres(attributes, HEIGHT, place, mark)


def read_metres(attributes: Attributes, keys: Sequence[str], place: str, mark: str | None = None) -> float | None:
    """Return what one of some attributes says in metres; None where it says that it is not known.

    Raises:
        NetworkError: it is no length.
    """
    known = normalise_attributes(attributes)
    value, factor = find_first_value(known, keys), 1.0
    if value is None and keys[0].endswith("_m"):
        value, factor = find_first_value(known, (f"{keys[0].removesuffix('_m')}_ft",)), METRES["ft"]
    if value is None or (isinstance(value, str) and value.strip().lower() in NO_FIGURE):
        return None
    found = metres_of(value, mark)
    if found is not None and found <= NO_HEIGHT_M:
        return None
    if not is_figure(found):
        raise NetworkError(f"{place}: {keys[0]}: expected metres as a finite number, got {value!r}")
    return found * factor


def read_loose_metres(attributes: Attributes, key: str, *, of_map: bool) -> tuple[float | None, str]:
    """Return what 'height' says of `height_m`, and the like, and which attribute it was.

    A figure alone is one of nobody knows what, unless OpenStreetMap has it.
    """
    known = normalise_attributes(attributes)
    for other in LOOSE[key]:
        value = known.get(other)
        text = value if isinstance(value, str) else ""
        if value is None or (not of_map and not any(letter.isalpha() or letter in "'’′" for letter in text)):
            continue
        found = metres_of(value)
        if is_figure(found) and found > NO_HEIGHT_M:
            return found, other
    return None, ""
