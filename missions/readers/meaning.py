"""What a feature is of a power line, by its attributes.

They are OpenStreetMap's tags in whatever format they come, and what utilities write instead. Cables, lines that are not
built or not there any more, and what is no pole are never flown.
"""

from __future__ import annotations

import re
import unicodedata
from enum import StrEnum

from missions.readers.attributes import NESTED, Plain
from missions.readers.drawing import Attributes
from missions.readers.values import is_blank


class Meaning(StrEnum):
    """What a feature is; the value is what people call it."""

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
    "proposed": Meaning.UNBUILT, "planned": Meaning.UNBUILT, "construction": Meaning.UNBUILT,
    "disused": Meaning.DISUSED, "abandoned": Meaning.DISUSED, "removed": Meaning.REMOVED,
    "demolished": Meaning.REMOVED, "dismantled": Meaning.REMOVED, "razed": Meaning.REMOVED,
    "destroyed": Meaning.REMOVED,
}  # fmt: skip
"""What OpenStreetMap says of what is not in use: disused=yes, disused:power=line, power=disused."""
KINDS = frozenset((*POWER_LINES, *CABLES, *INDOORS, *NO_LINES, "power"))
TEN = 10
"""Letters that a shapefile leaves of an attribute's name."""
FLAGS = {key: meaning for word, meaning in LIFE.items() for key in (word, word[:TEN])}
OF_POWER = {
    key: meaning
    for word, meaning in {**LIFE, "was": Meaning.REMOVED, "historic": Meaning.REMOVED}.items()
    for key in (f"{word}_power", f"{word}_power"[:TEN])
}
LIFE_KEYS = FLAGS.keys() | OF_POWER.keys()
STATUS_KEYS = frozenset((
    "status", "state", "lifecycle", "lifecycle_status", "life_cycle", "operational_status", "op_status",
    "operation_status", "service_status", "construction_status", "stage",
))  # fmt: skip
STATUS = LIFE | {
    "future": Meaning.UNBUILT, "under construction": Meaning.UNBUILT, "under const": Meaning.UNBUILT,
    "in construction": Meaning.UNBUILT, "not built": Meaning.UNBUILT, "projected": Meaning.UNBUILT,
    "not in service": Meaning.DISUSED, "out of service": Meaning.DISUSED, "inactive": Meaning.DISUSED,
    "decommissioned": Meaning.DISUSED, "retired": Meaning.DISUSED, "deleted": Meaning.REMOVED,
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
    Meaning.UNBUILT: Meaning.UNBUILT_POLE, Meaning.DISUSED: Meaning.DISUSED_POLE, Meaning.REMOVED: Meaning.REMOVED_POLE
}  # fmt: skip


def line_meaning(known: Plain, *, of_map: bool) -> tuple[Meaning, str]:
    """Return what a line is, and which attribute says so.

    Args:
        known: Its attributes.
        of_map: Whether all tags of OpenStreetMap are there: what is no power line by them is none.
    """
    if _is_deleted(known):
        return Meaning.DELETED, ""
    power = _words(known, "power")
    life = _life(known, power)
    if life is not None:
        return life
    if power & {*POWER_LINES}:
        if _words(known, "line") & {*INDOORS}:
            return Meaning.INDOORS, "line"
        return (Meaning.UNDERGROUND, "location") if _is_underground(known) else (Meaning.SPAN, "power")
    kinds = power or {word for key in known.keys() & TYPE_KEYS for word in _words(known, key)}
    if kinds & {*CABLES}:
        return Meaning.CABLE, "power"
    if _is_underground(known):
        return Meaning.UNDERGROUND, "location"
    return (_other(power), "power") if of_map or power & {*NO_LINES, *INDOORS} else (Meaning.SPAN, "")


def point_meaning(known: Plain, *, of_map: bool) -> tuple[Meaning, str]:
    """Return what a point is, and which attribute says so; what nothing is said of is a pole.

    Args:
        known: Its attributes.
        of_map: Whether all tags of OpenStreetMap are there: what is no pole by them is none.
    """
    if _is_deleted(known):
        return Meaning.DELETED, ""
    power = _words(known, "power")
    found = _life(known, power)
    # What is out of use stands there all the same.
    if found is not None and not (found[0] is Meaning.DISUSED and power and power <= {*NO_LINES}):
        return OF_POLES[found[0]], found[1]
    if power & SUPPORTS:
        return Meaning.POLE, "power"
    # A type may be a pole's own: 'line' is one that the wires pass straight, 'cable' one where they go down.
    types = set() if power else {word for key in known.keys() & TYPE_KEYS for word in _words(known, key)}
    if power & {*NO_POLES} or (power | types) & {*GENERATORS, *SUBSTATIONS}:
        return _other(power | types), "power"
    return (Meaning.OTHER, "power") if of_map and not power else (Meaning.POLE, "power")


def row_meaning(known: Plain) -> tuple[Meaning, Meaning, str]:
    """Return what a row of a table is as a pole, what the line at it is, and which attribute says that.

    Its attributes may be those of its line.
    """
    line, key = line_meaning(known, of_map=False)
    of_line = _words(known, "power") & {*POWER_LINES, *CABLES, *INDOORS}
    own = Plain((name, value) for name, value in known.items() if name != "power" or not of_line)
    return point_meaning(own, of_map=False)[0], line, key


def speaks_of_power(known: Plain) -> bool:
    """Return whether an element of a map has to do with power at all."""
    return "power" in known or _life(known, set()) is not None


def has_all_tags(attributes: Attributes) -> bool:
    """Return whether a feature of a map has a place for its power tag, so that it has none if that is empty."""
    return any(key.strip().lower() in {"power", "@id", *NESTED} for key in attributes)


def _other(kinds: set[str]) -> Meaning:
    if kinds & {*GENERATORS}:
        return Meaning.GENERATOR
    if kinds & {*CABLES}:
        return Meaning.CABLE
    if kinds & {*INDOORS}:
        return Meaning.INDOORS
    return Meaning.SUBSTATION if kinds & {*SUBSTATIONS} else Meaning.OTHER


def _is_deleted(known: Plain) -> bool:
    visible, action = (_text(known.get(key, known.get(f"@{key}"))) for key in ("visible", "action"))
    return visible in NO or action == "delete"


def _life(known: Plain, power: set[str]) -> tuple[Meaning, str] | None:
    """Return whether something is not in use yet, or not any more, and which attribute says so."""
    for word in sorted(re.split("[:_]", value)[0] for value in power):  # of 'abandoned:line' too
        if word in LIFE:
            return LIFE[word], "power"
    for key in sorted(known.keys() & LIFE_KEYS):
        value = _words(known, key)
        if key in OF_POWER and not power and value & (KINDS | YES):
            return OF_POWER[key], key
        if key in FLAGS and value & (YES | {*POWER_LINES, *CABLES, "power", "tower", "pole", "portal"}):
            return FLAGS[key], key
    for key in sorted(known.keys() & STATUS_KEYS):
        for part in re.split(r"[;,/]", _text(known.get(key))):
            if (found := STATUS.get(part.strip().replace("_", " ").replace("-", " "))) is not None:
                return found, key
    return None


def _is_underground(known: Plain) -> bool:
    if any(_text(known.get(key)) in YES for key in BURIED_KEYS) or any(_text(known.get(key)) in NO for key in AIR_KEYS):
        return True
    if _text(known.get("tunnel")) not in {"", *NO}:
        return True
    words = {word for key in known.keys() & LAID_KEYS for word in re.findall(r"[a-z]+", _text(known[key]))}
    indoor = _text(known.get("location")) in {"indoor", "indoors"}
    return (indoor or bool(words & UNDER)) and not words & OVER


def _words(known: Plain, key: str) -> set[str]:
    """Return the values of a list such as 'line;cable', in small letters with underscores."""
    if key not in known:
        return set()
    parts = (part.strip().replace(" ", "_").replace("-", "_") for part in re.split("[;,]", _text(known.get(key))))
    return {part for part in parts if part}


def _text(value: object) -> str:
    """Return a value in small letters without accents."""
    if is_blank(value):
        return ""
    text = str(value).strip().lower()
    if text.isascii():
        return text
    letters = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in letters if not unicodedata.combining(letter))
