"""Programs that some tests need and pip does not bring: such a test is marked `needs("chromium")`.

Where the program is missing the test is skipped; with CI=true, as `.ci/run` sets it, it fails.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from shutil import which

import pytest

NAMES: Mapping[str, tuple[str, ...]] = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "mosquitto": ("mosquitto",),
}
"""What a program's file may be called."""
PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin"


def find_program(program: str) -> str | None:
    """Return a program's file; None if it is not installed."""
    return next((found for name in NAMES[program] if (found := which(name, path=PATH))), None)


def need(program: str) -> None:
    """End a test whose program is not installed."""
    if find_program(program) is None:
        leave_out(f"{program} is not installed (Debian: apt-get install {program})")


def leave_out(why: str) -> None:
    """End a test that cannot run here."""
    end = pytest.fail if os.environ.get("CI") == "true" else pytest.skip
    end(why)
