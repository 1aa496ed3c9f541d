"""Where the program starts: it sees first that the four packages that it is made of are its own.

The index has other projects' packages of these names. Installed beside faultline they lie over its files, and nothing
says so; none of them is loaded here before it is known whose it is.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec

PACKAGES = ("executor", "missions", "planner", "simulator")
MARK = "# Part of faultline."
"""The first line of each package."""
BAD_INPUT = 2


def main() -> None:
    """Run the command line, or say in one line which package is not ours."""
    if wrong := next(filter(None, map(stranger, PACKAGES)), ""):
        print(f"faultline: {wrong}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    from executor.cli.main import main as run

    run()


def stranger(name: str) -> str:
    """Return in words that a package is missing or another project's; empty if it is ours. It is not loaded."""
    found = find_spec(name)
    place = "none" if found is None else found.origin or "a folder without its __init__.py"
    source = getattr(None if found is None else found.loader, "get_source", None)
    if source is not None and (source(name) or "").startswith(MARK):
        return ""
    return (
        f"{name}: expected faultline's own package, got {place}: uninstall the other project that is called {name} "
        "(pip uninstall), and install faultline again"
    )
