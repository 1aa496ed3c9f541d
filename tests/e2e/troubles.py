"""`faultline` on a computer whose time of day is set back while it flies.

Called as a program, with the file whose appearance sets the clock back by an hour, and the command line behind it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

HOUR_S = 3600.0


def set_back_when(marker: Path) -> None:
    """Let the time of day be an hour earlier from the moment on when a file is there."""
    true_s = time.time

    def told_s() -> float:
        return true_s() - (HOUR_S if marker.exists() else 0.0)

    time.time = told_s


if __name__ == "__main__":
    set_back_when(Path(sys.argv[1]))
    from executor.cli.main import main

    main(sys.argv[2:])
