"""Health checks of the services: exit code 0 is healthy.

``healthy.py port PORT``: somebody listens on this UDP port of this computer.
``healthy.py run DIR``: the newest run in the directory is alive: it is before its flight, or its events go on.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

SOCKETS = (Path("/proc/net/udp"), Path("/proc/net/udp6"))
"""Linux's tables of its UDP sockets."""
QUIET_S = 30.0
"""Events come several times a second in a flight."""


def listens(port: int) -> bool:
    """Return whether a UDP port is taken.

    It is read, not tried: a port that is taken for a moment to see whether it is free is not free for who starts then.
    """
    rows = [row.split() for table in SOCKETS if table.exists() for row in table.read_text("ascii").splitlines()[1:]]
    return any(int(local.rpartition(":")[2], 16) == port for _, local, *_ in rows)


def alive(runs: Path) -> bool:
    """Return whether the newest run in a directory goes on."""
    newest = max(runs.glob("*/site.toml"), key=lambda path: path.stat().st_mtime, default=None)
    if newest is None:
        return False
    events = newest.with_name("events.jsonl")
    return not events.exists() or time.time() - events.stat().st_mtime < QUIET_S


def main() -> int:
    """Return 0 for healthy."""
    match sys.argv[1:]:
        case ["port", port]:
            return 0 if listens(int(port)) else 1
        case ["run", folder]:
            return 0 if alive(Path(folder)) else 1
        case _:
            print(__doc__, file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
