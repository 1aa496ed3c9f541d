"""Optional extras of the package, and the message when one is missing.

Code that needs an extra checks here before its work and imports it only then; an installation without it does all the
rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from importlib.util import find_spec

from executor.errors import ExtraMissing


class Extra(Enum):
    """Extras that a feature may require, as named in pyproject.toml, with the modules of each."""

    PICTURES = "pictures", "matplotlib"
    IMAGES = "images", "PIL"
    MAVSDK = "mavsdk", "mavsdk"
    LOGS = "logs", "pyulog"
    DASK = "dask", "distributed"
    GEO = "geo", "openpyxl", "shapefile"
    MAPS = "maps", "rasterio", "PIL", "contourpy"
    TERRAIN = "terrain", "rasterio"
    PROOFS = "proofs", "highspy"

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the modules of the extra."""
        return tuple(map(str, self.value[1:]))


INSTALLED_BY: Mapping[str, str] = {"PIL": "pillow", "shapefile": "pyshp"}
"""Package name of a module, if it differs."""


def describe_missing_extra(extra: Extra, wanted_by: str) -> str:
    """Return what to install if an extra is missing; empty if it is installed. Loads nothing.

    Args:
        extra: The extra.
        wanted_by: The feature that needs it, in the user's words.
    """
    if all(find_spec(name) is not None for name in extra.modules):
        return ""
    # Name the libraries: a checkout is not installed from the index.
    return f"{wanted_by} needs the extra {extra.value[0]}: pip install {' '.join(packages_of(extra))}"


def packages_of(extra: Extra) -> tuple[str, ...]:
    """Return the packages that an extra needs."""
    return tuple(INSTALLED_BY.get(module, module) for module in extra.modules)


def require_extra(extra: Extra, wanted_by: str) -> None:
    """Check that an extra is installed.

    Raises:
        ExtraMissing: It is not; the text is that of `describe_missing_extra`.
    """
    line = describe_missing_extra(extra, wanted_by)
    if line:
        raise ExtraMissing(line)
