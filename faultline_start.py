"""Where the program and the library start: they see first that the packages that they are made of are their own.

The index has other projects' packages of these names. Installed beside faultline they lie over its files, and nothing
says so; none of them is loaded here before it is known whose it is.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("executor", "missions", "planner", "simulator")
MARK = "# Part of faultline."
"""The first line of each package."""
BAD_INPUT = 2


def main() -> None:
    """Run the command line, or say in one line which package is not ours."""
    if wrong := find_stranger():
        print(f"faultline: {wrong}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    from executor.cli.main import main as run

    run()


def find_stranger() -> str:
    """Return in words which package is not ours; empty if all are."""
    return next(filter(None, map(stranger, PACKAGES)), "")


def stranger(name: str) -> str:
    """Return in words that a package is missing or another project's; empty if it is ours. It is not loaded."""
    found = find_spec(name)
    place = "none" if found is None else found.origin or "a folder without its __init__.py"
    if found is not None and _read_source(found).startswith(MARK):
        return ""
    return (
        f"{name}: expected faultline's own package, got {place}: uninstall the other project that is called {name} "
        "(pip uninstall), and install faultline again"
    )


def _read_source(found: ModuleSpec) -> str:
    """Return a package's source. Not every loader has it: pytest's, of a package with a plugin, has not."""
    source = getattr(found.loader, "get_source", None)
    if source is not None:
        return source(found.name) or ""
    return Path(found.origin).read_text(encoding="utf-8") if found.origin and found.has_location else ""
