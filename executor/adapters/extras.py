"""What is installed only where it is wanted: the package's extras, and the line that is said where one is missing.

Who needs one asks here before the work, and imports it only then: an installation without it does all the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from importlib.util import find_spec

from executor.errors import ExtraMissing


class Extra(Enum):
    """The extras that something is refused without, as pyproject.toml names them, and what is imported of each."""

    PICTURES = "pictures", "matplotlib"
    IMAGES = "images", "PIL"
    MAVSDK = "mavsdk", "mavsdk"
    LOGS = "logs", "pyulog"
    DASK = "dask", "distributed"
    GEO = "geo", "openpyxl", "shapefile"
    MAPS = "maps", "rasterio", "PIL", "contourpy"
    TERRAIN = "terrain", "rasterio"

    @property
    def modules(self) -> tuple[str, ...]:
        """What is imported of it."""
        return tuple(map(str, self.value[1:]))


INSTALLED_BY: Mapping[str, str] = {"PIL": "pillow", "shapefile": "pyshp"}
"""Package name of a module, where it differs."""


def describe_missing_extra(extra: Extra, wanted_by: str) -> str:
    """Return what to install where an extra is missing; empty where it is there. Nothing is loaded for that.

    Args:
        extra: The extra.
        wanted_by: What cannot be done without it, in the words that the user wrote.
    """
    if all(find_spec(name) is not None for name in extra.modules):
        return ""
    # The libraries by their names: whoever runs a checkout has installed nothing of the index.
    return f"{wanted_by} needs the extra {extra.value[0]}: pip install {' '.join(packages_of(extra))}"


def packages_of(extra: Extra) -> tuple[str, ...]:
    """Return what an extra is installed by."""
    return tuple(INSTALLED_BY.get(module, module) for module in extra.modules)


def require_extra(extra: Extra, wanted_by: str) -> None:
    """Go on only where an extra is there.

    Raises:
        ExtraMissing: it is not; the text is that of `describe_missing_extra`.
    """
    line = describe_missing_extra(extra, wanted_by)
    if line:
        raise ExtraMissing(line)
