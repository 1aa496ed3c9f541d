"""Entry points of the program and the library: check first that the packages they import are faultline's own.

PyPI has other projects' packages with these names. Installed next to faultline they overwrite its files without a
warning, so no package is imported before its origin is known.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("executor", "missions", "planner", "simulator")
MARK = "# Part of faultline."
"""First line of each of faultline's packages."""
BAD_INPUT = 2


def main() -> None:
    """Run the command line, or print one line that names the foreign package."""
    if wrong := find_stranger():
        print(f"faultline: {wrong}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    from executor.cli.main import main as run

    run()


def find_stranger() -> str:
    """Return a message that names a foreign package; empty if there is none."""
    return next(filter(None, map(stranger, PACKAGES)), "")


def stranger(name: str) -> str:
    """Return a message if a package is missing or foreign; empty if it is ours. The package is not imported."""
    found = find_spec(name)
    place = "none" if found is None else found.origin or "a folder without its __init__.py"
    if found is not None and _read_source(found).startswith(MARK):
        return ""
    return (
        f"{name}: expected faultline's own package, got {place}: uninstall the other project that is called {name} "
        "(pip uninstall), and install faultline again"
    )


def _read_source(found: ModuleSpec) -> str:
    """Return a package's source. Some loaders do not provide it, such as pytest's for a package with a plugin."""
    source = getattr(found.loader, "get_source", None)
    if source is not None:
        return source(found.name) or ""
    return Path(found.origin).read_text(encoding="utf-8") if found.origin and found.has_location else ""
