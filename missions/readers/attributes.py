"""Interpret a feature's attributes: its name, heights, OpenStreetMap number, and role in a power line.

Attribute names are compared in lower case and with one kind of separator, because programs write them in many forms:
'disused:power' equals 'DISUSED_POWER', and 'Elevation (m)' equals 'elevation_m'. Known are OpenStreetMap's tags in any
format, and what utilities write instead. Cables, lines not yet built or already removed, and points that are no poles
are never flown.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import lru_cache

from missions.errors import NetworkError
from missions.files import find_object, is_figure, to_printable
from missions.readers.values import METRES, NO_FIGURE, NO_HEIGHT_M, Attributes, is_blank, metres_of

NAMES = (
    "name", "ref", "id", "label", "number", "code", "asset", "asset_id", "line", "line_id", "line_name", "pole",
    "pole_id", "pylon", "tower", "tower_id",
)  # fmt: skip
"""Attributes that hold a name; the first present is used."""
LINES = ("line", "line_id", "line_name", "circuit")
"""Attributes that assign a pole to a line."""
POLES = tuple(name for name in NAMES if name not in LINES)
"""Attributes that hold a pole's name."""
ELEVATION = ("elevation_m", "elevation_")
"""The second is the first truncated to a shapefile's ten letters."""
HEIGHT = ("height_m",)
LOOSE = {"elevation_m": ("ele", "elevation"), "height_m": ("height",)}
"""Attributes with the same meaning if the figure has a unit, or if OpenStreetMap defines it as metres."""
NESTED = ("tags", "other_tags", "all_tags", "raw_tags", "osm_tags")
"""Attributes that contain attributes, as in OpenStreetMap data: a table, its text form, or PostgreSQL's hstore."""
NODE, WAY, RELATION = "node", "way", "relation"
MAP_KINDS = {kind[0]: kind for kind in (NODE, WAY, RELATION)}

TYPES = ("@type", "osm_type", "type", "element")
"""Attributes that hold the OpenStreetMap element type."""

_DIVIDER = re.compile(r"[^\w@]+")
_HSTORE = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*"((?:[^"\\]|\\.)*)"')
_MAP_ID = re.compile(r"(n|node|w|way|r|relation)/?(-?\d+)")


class PlainAttributes(dict[str, object]):
    """Attributes by their normalised names, without empty ones."""


@lru_cache(maxsize=4096)
def normalise_key(key: str) -> str:
    """Return an attribute's name in lower case, with one kind of separator."""
    low = key.strip().lower()
    found = _DIVIDER.sub("_", low)
    return found if low.endswith("_") else found.strip("_")


def normalise_attributes(attributes: Attributes) -> PlainAttributes:
    """Return attributes by their normalised names, without empty ones."""
    if isinstance(attributes, PlainAttributes):
        return attributes
    return PlainAttributes((normalise_key(key), value) for key, value in attributes.items() if not is_blank(value))


def flatten_attributes(attributes: Attributes) -> Attributes:
    """Return attributes with nested ones added at the top level; top-level ones take precedence."""
    inner: dict[str, object] = {}
    prefixed: dict[str, object] = {}
    for key, value in attributes.items():
        low = normalise_key(key)
        if low in NESTED:
            inner |= _parse_nested(value)
        elif low.startswith("tags_"):  # 'tags.power', as written by tables for nested attributes
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
        return find_object(value)
    return {_unescape(key): _unescape(own) for key, own in _HSTORE.findall(value)}


def _unescape(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


def find_first_value(attributes: Attributes, keys: Sequence[str]) -> object:
    """Return the first non-empty value of some attributes."""
    known = normalise_attributes(attributes)
    return next((known[key] for key in keys if key in known), None)


def name_of(attributes: Attributes, keys: Sequence[str] = NAMES) -> str:
    """Return a feature's name; empty if it has none."""
    known = normalise_attributes(attributes)
    for key in keys:
        value = known.get(key)
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            # Spreadsheets and old tables store whole numbers as 12.0.
            text = str(int(value) if isinstance(value, float) and value.is_integer() else value)
            return to_printable(unicodedata.normalize("NFC", text))
    return ""


def osm_id_of(attributes: Attributes, own_id: object, kind: str) -> tuple[str, str] | None:
    """Return whether a feature is an OpenStreetMap node, way or relation, and its number; else None.

    Args:
        attributes: The feature's attributes.
        own_id: The id that its file stores outside of them, as GeoJSON does.
        kind: Its type if only the number is given: a point is a node.
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
    """Return the name of an OpenStreetMap feature: a pole's ref first, a line's name first."""
    kind, number = place
    if kind == NODE:
        return name_of(attributes, ("ref",)) or f"n{number}"
    return name_of(attributes, ("name", "ref")) or f"{kind} {number}"


def heights_of(attributes: Attributes, place: str, mark: str | None = None) -> tuple[float | None, float | None]:
    """Return the ground elevation and the structure height, where known.

    Args:
        attributes: The pole's attributes.
        place: The file and the feature, for messages.
        mark: The file's decimal mark, if it can be detected.

    Raises:
        NetworkError: one is not a length.
    """
    return read_metres(attributes, ELEVATION, place, mark), read_metres(attributes, HEIGHT, place, mark)


def read_metres(attributes: Attributes, keys: Sequence[str], place: str, mark: str | None = None) -> float | None:
    """Return the value of one of some attributes in metres; None if it is marked as unknown.

    Raises:
        NetworkError: it is not a length.
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
    """Return the value of 'height' as `height_m`, and similar, and the attribute's name.

    A figure without a unit is ambiguous, except in OpenStreetMap data.
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


class PowerFeature(StrEnum):
    """A feature's type; the value is its name in messages."""

    SPAN = "span"
    CABLE = "cable"
    UNDERGROUND = "underground line"
    INDOORS = "line of a substation"
    UNBUILT = "planned line"
    DISUSED = "disused line"
    REMOVED = "removed line"
    POLE = "pole"
    UNBUILT_POLE = "planned pole"
    DISUSED_POLE = "disused pole"
    REMOVED_POLE = "removed pole"
    GENERATOR = "generator"
    SUBSTATION = "substation"
    DELETED = "deleted feature"
    OTHER = "feature of another kind"


POWER_LINES = ("line", "minor_line")
CABLES = ("cable", "cables", "minor_cable", "power_cable", "underground_cable", "minor_underground_cable")
GENERATORS = ("generator", "plant", "power_plant", "power_station", "solar_farm", "wind_farm", "heliostat")
SUBSTATIONS = ("substation", "sub_station", "station", "electrical_substation", "switchgear", "switching_station",
               "converter", "converter_station", "compensator", "cable_distribution_cabinet", "battery")  # fmt: skip
SUPPORTS = frozenset(("tower", "pole", "portal", "terminal", "catenary_mast", "insulator"))
NO_LINES = (*SUPPORTS, "switch", "transformer", "connection", "outlet", "circuit", *GENERATORS, *SUBSTATIONS)
NO_POLES = (*POWER_LINES, *CABLES, "marker", "bay", "busbar", "outlet", "circuit")
INDOORS = ("bay", "busbar")

LIFE = {
    "proposed": PowerFeature.UNBUILT, "planned": PowerFeature.UNBUILT, "construction": PowerFeature.UNBUILT,
    "disused": PowerFeature.DISUSED, "abandoned": PowerFeature.DISUSED, "removed": PowerFeature.REMOVED,
    "demolished": PowerFeature.REMOVED, "dismantled": PowerFeature.REMOVED, "razed": PowerFeature.REMOVED,
    "destroyed": PowerFeature.REMOVED,
}  # fmt: skip
"""OpenStreetMap's tags for features not in use: disused=yes, disused:power=line, power=disused."""
KINDS = frozenset((*POWER_LINES, *CABLES, *INDOORS, *NO_LINES, "power"))
TEN = 10
"""Length to which a shapefile truncates attribute names."""
FLAGS = {key: meaning for word, meaning in LIFE.items() for key in (word, word[:TEN])}
OF_POWER = {
    key: meaning
    for word, meaning in {**LIFE, "was": PowerFeature.REMOVED, "historic": PowerFeature.REMOVED}.items()
    for key in (f"{word}_power", f"{word}_power"[:TEN])
}
LIFE_KEYS = FLAGS.keys() | OF_POWER.keys()
STATUS_KEYS = frozenset((
    "status", "state", "lifecycle", "lifecycle_status", "life_cycle", "operational_status", "op_status",
    "operation_status", "service_status", "construction_status", "stage",
))  # fmt: skip
STATUS = LIFE | {
    "future": PowerFeature.UNBUILT, "under construction": PowerFeature.UNBUILT, "under const": PowerFeature.UNBUILT,
    "in construction": PowerFeature.UNBUILT, "not built": PowerFeature.UNBUILT, "projected": PowerFeature.UNBUILT,
    "not in service": PowerFeature.DISUSED, "out of service": PowerFeature.DISUSED, "inactive": PowerFeature.DISUSED,
    "decommissioned": PowerFeature.DISUSED, "retired": PowerFeature.DISUSED, "deleted": PowerFeature.REMOVED,
}  # fmt: skip
TYPE_KEYS = frozenset((
    "type", "line_type", "linetype", "subtype", "sub_type", "class", "category", "kind", "feature_type",
    "asset_type", "power_type", "conductor_type", "structure_type", "fclass",
))  # fmt: skip
LAID_KEYS = frozenset((
    "location", "installation", "install_type", "placement", "position", "laying", "construction",
    "construction_type", "overhead_underground", "oh_ug", "ohug", "ug_oh", "ugoh", *TYPE_KEYS,
))  # fmt: skip
UNDER = frozenset(("underground", "underwater", "submarine", "undersea", "subsea", "buried", "ug", "ugc", "erdkabel",
                   "unterirdisch", "souterrain", "souterraine", "podzemni", "podziemna", "subterranea", "subterraneo",
                   "interrata", "ondergronds"))  # fmt: skip
OVER = frozenset(("overhead", "overground", "aerial", "oh", "ohl", "ohc", "freileitung", "aerien", "aerienne",
                  "nadzemni", "napowietrzna", "aerea", "aereo", "bovengronds"))  # fmt: skip
YES, NO = frozenset(("yes", "true", "1", "t", "y")), frozenset(("no", "false", "0", "f", "n"))
BURIED_KEYS, AIR_KEYS = ("underground", "is_underground"), ("overhead", "is_overhead")
OF_POLES = {
    PowerFeature.UNBUILT: PowerFeature.UNBUILT_POLE, PowerFeature.DISUSED: PowerFeature.DISUSED_POLE,
    PowerFeature.REMOVED: PowerFeature.REMOVED_POLE
}  # fmt: skip


def classify_line(known: PlainAttributes, *, of_map: bool) -> tuple[PowerFeature, str]:
    """Return a line's type, and the attribute that defines it.

    Args:
        known: Its attributes.
        of_map: Whether all tags of OpenStreetMap are present: without a power tag it is then not a power line.
    """
    if _is_deleted(known):
        return PowerFeature.DELETED, ""
    power = _split_values(known, "power")
    life = _find_lifecycle(known, power)
    if life is not None:
        return life
    if power & {*POWER_LINES}:
        if _split_values(known, "line") & {*INDOORS}:
            return PowerFeature.INDOORS, "line"
        return (PowerFeature.UNDERGROUND, "location") if _is_underground(known) else (PowerFeature.SPAN, "power")
    kinds = power or {word for key in known.keys() & TYPE_KEYS for word in _split_values(known, key)}
    if kinds & {*CABLES}:
        return PowerFeature.CABLE, "power"
    if _is_underground(known):
        return PowerFeature.UNDERGROUND, "location"
    return (_classify_other(power), "power") if of_map or power & {*NO_LINES, *INDOORS} else (PowerFeature.SPAN, "")


def classify_point(known: PlainAttributes, *, of_map: bool) -> tuple[PowerFeature, str]:
    """Return a point's type, and the attribute that defines it; without one it is a pole.

    Args:
        known: Its attributes.
        of_map: Whether all tags of OpenStreetMap are present: without a power tag it is then not a pole.
    """
    if _is_deleted(known):
        return PowerFeature.DELETED, ""
    power = _split_values(known, "power")
    found = _find_lifecycle(known, power)
    # A disused pole is still an obstacle.
    if found is not None and not (found[0] is PowerFeature.DISUSED and power and power <= {*NO_LINES}):
        return OF_POLES[found[0]], found[1]
    if power & SUPPORTS:
        return PowerFeature.POLE, "power"
    # A type may be a pole's own: 'line' for a straight-line pole, 'cable' for one where the wires go underground.
    types = set() if power else {word for key in known.keys() & TYPE_KEYS for word in _split_values(known, key)}
    if power & {*NO_POLES} or (power | types) & {*GENERATORS, *SUBSTATIONS}:
        return _classify_other(power | types), "power"
    return (PowerFeature.OTHER, "power") if of_map and not power else (PowerFeature.POLE, "power")


def classify_row(known: PlainAttributes) -> tuple[PowerFeature, PowerFeature, str]:
    """Return a table row's type as a pole, the type of its line, and the attribute that defines them.

    Its attributes may be those of its line.
    """
    line, key = classify_line(known, of_map=False)
    of_line = _split_values(known, "power") & {*POWER_LINES, *CABLES, *INDOORS}
    own = PlainAttributes((name, value) for name, value in known.items() if name != "power" or not of_line)
    return classify_point(own, of_map=False)[0], line, key


def has_power_tag(known: PlainAttributes) -> bool:
    """Return whether a map element has any power tag."""
    return "power" in known or _find_lifecycle(known, set()) is not None


def has_all_tags(attributes: Attributes) -> bool:
    """Return whether a map feature has a column for its power tag, so that an empty one means no tag."""
    return any(key.strip().lower() in {"power", "@id", *NESTED} for key in attributes)


def _classify_other(kinds: set[str]) -> PowerFeature:
    if kinds & {*GENERATORS}:
        return PowerFeature.GENERATOR
    if kinds & {*CABLES}:
        return PowerFeature.CABLE
    if kinds & {*INDOORS}:
        return PowerFeature.INDOORS
    return PowerFeature.SUBSTATION if kinds & {*SUBSTATIONS} else PowerFeature.OTHER


def _is_deleted(known: PlainAttributes) -> bool:
    visible, action = (_normalise_text(known.get(key, known.get(f"@{key}"))) for key in ("visible", "action"))
    return visible in NO or action == "delete"


def _find_lifecycle(known: PlainAttributes, power: set[str]) -> tuple[PowerFeature, str] | None:
    """Return whether a feature is not yet, or no longer, in use, and the attribute that says so."""
    for word in sorted(re.split("[:_]", value)[0] for value in power):  # also of 'abandoned:line'
        if word in LIFE:
            return LIFE[word], "power"
    for key in sorted(known.keys() & LIFE_KEYS):
        value = _split_values(known, key)
        if key in OF_POWER and not power and value & (KINDS | YES):
            return OF_POWER[key], key
        if key in FLAGS and value & (YES | {*POWER_LINES, *CABLES, "power", "tower", "pole", "portal"}):
            return FLAGS[key], key
    for key in sorted(known.keys() & STATUS_KEYS):
        for part in re.split(r"[;,/]", _normalise_text(known.get(key))):
            if (found := STATUS.get(part.strip().replace("_", " ").replace("-", " "))) is not None:
                return found, key
    return None


def _is_underground(known: PlainAttributes) -> bool:
    if any(_normalise_text(known.get(key)) in YES for key in BURIED_KEYS) or any(
        _normalise_text(known.get(key)) in NO for key in AIR_KEYS
    ):
        return True
    if _normalise_text(known.get("tunnel")) not in {"", *NO}:
        return True
    words = {word for key in known.keys() & LAID_KEYS for word in re.findall(r"[a-z]+", _normalise_text(known[key]))}
    indoor = _normalise_text(known.get("location")) in {"indoor", "indoors"}
    return (indoor or bool(words & UNDER)) and not words & OVER


def _split_values(known: PlainAttributes, key: str) -> set[str]:
    """Return the values of a list like 'line;cable', in lower case with underscores."""
    if key not in known:
        return set()
    parts = (
        part.strip().replace(" ", "_").replace("-", "_") for part in re.split("[;,]", _normalise_text(known.get(key)))
    )
    return {part for part in parts if part}


def _normalise_text(value: object) -> str:
    """Return a value in lower case without accents."""
    if is_blank(value):
        return ""
    text = str(value).strip().lower()
    if text.isascii():
        return text
    letters = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in letters if not unicodedata.combining(letter))
