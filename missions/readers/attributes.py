"""What a feature's attributes say: its name, its heights. Their names are compared without regard to case."""

from __future__ import annotations

from collections.abc import Sequence

from missions.errors import NetworkError
from missions.files import is_figure, printable
from missions.readers.drawing import Attributes

NAMES = (
    "name", "ref", "id", "label", "number", "code", "asset", "asset_id", "line", "line_id", "line_name", "pole",
    "pole_id", "pylon", "tower", "tower_id",
)  # fmt: skip
"""What is taken for a name, the first that is there."""
LINES = ("line", "line_id", "line_name", "circuit")
"""What says to which line a pole belongs."""
ELEVATION = ("elevation_m", "elevation_")
"""The second is what ten letters of a shapefile leave of the first."""
HEIGHT = ("height_m",)


def said(attributes: Attributes, keys: Sequence[str]) -> object:
    """Return the value of the first of some attributes that is there and not empty."""
    lowered = {key.lower(): value for key, value in attributes.items()}
    return next((lowered[key] for key in keys if lowered.get(key) not in {None, ""}), None)


def name_of(attributes: Attributes, keys: Sequence[str] = NAMES) -> str:
    """Return what people call a feature; empty where nothing says so."""
    value = said({key: value for key, value in attributes.items() if isinstance(value, str | int | float)}, keys)
    if isinstance(value, bool) or value is None:
        return ""
    # Spreadsheets and old tables have whole numbers as 12.0.
    return printable(str(int(value) if isinstance(value, float) and value.is_integer() else value))


def heights_of(attributes: Attributes, place: str) -> tuple[float | None, float | None]:
    """Return the ground's elevation and the structure's height, where they are known.

    Raises:
        NetworkError: one is no number.
    """
    return metres(attributes, ELEVATION, place), metres(attributes, HEIGHT, place)


def metres(attributes: Attributes, keys: Sequence[str], place: str) -> float | None:
    """Return what one of some attributes says in metres.

    Raises:
        NetworkError: it is no number.
    """
    value = said(attributes, keys)
    found = figure_of(value) if isinstance(value, str) else value
    if found is None and value is None:
        return None
    if not is_figure(found):
        raise NetworkError(f"{place}: {keys[0]}: expected metres as a finite number, got {value!r}")
    return float(found)


def figure_of(text: str) -> float | None:
    """Return what a text says as a number; None where it is none."""
    try:
        return float(text)
    except ValueError:
        return None
