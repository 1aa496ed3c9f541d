"""What a simulated fleet and its ground station say to each other, so that neither's time outruns the other's.

Lines of text on a TCP connection within this computer, to the port number of the fleet's first vehicle. The fleet
greets, the ground station greets back; then the fleet says how far it has lived, and the ground station up to where it
has taken everything in.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

NAME = "faultline-time-1"
HERE = "127.0.0.1"
AHEAD_S = 0.1
"""Simulated seconds that the fleet lives at most beyond what the ground station has taken in: a radio's delay."""
LOOK_REAL_S = 0.5
"""A partner that says nothing for so long is looked at: one that was stopped on purpose is not waited for."""
PATIENCE_REAL_S = 10.0
"""One that is not stopped, and says nothing for so long, is gone on without."""
LONGEST_LINE = 200


@dataclass(frozen=True, slots=True)
class Greeting:
    """Who is there."""

    pid: int
    speedup: float
    lived_s: float = 0.0
    """How far the fleet has lived."""
    unix_s: float = 0.0
    """The date of that moment, on the fleet's clock."""

    def to_line(self) -> bytes:
        """Return it as it is sent."""
        return f"{NAME} {self.pid} {self.speedup!r} {self.lived_s!r} {self.unix_s!r}\n".encode()


def parse_greeting(line: bytes) -> Greeting | None:
    """Return the greeting in a line; None if it is something else."""
    try:
        name, pid, *figures = line.decode("ascii").split(" ")
        speedup, lived_s, unix_s = map(float, figures)
        return Greeting(int(pid), speedup, lived_s, unix_s) if name == NAME else None
    except ValueError:
        return None


def format_time_line(lived_s: float) -> bytes:
    """Return a simulated time as it is sent."""
    return f"{lived_s!r}\n".encode()


def parse_time_line(line: bytes) -> float | None:
    """Return the simulated time in a line; None if it is something else."""
    try:
        return float(line)
    except ValueError:
        return None


class LineBuffer:
    """Cuts what comes into lines."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, data: bytes) -> list[bytes]:
        """Return the lines that are complete now; something that is no line of ours is dropped."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) <= LONGEST_LINE else b""
        return lines


def is_process_stopped(pid: int) -> bool:
    """Return whether a process of this computer was stopped (SIGSTOP, Ctrl-Z, a debugger), where Linux can tell."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[:1] in (["T"], ["t"])


class ReplyWait:
    """How long a partner has owed a word, in real seconds."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._since_s: float | None = None
        self._looked_s = 0.0

    def begin(self, now_s: float) -> None:
        """It was told something, and has to answer."""
        if self._since_s is None:
            self._since_s = self._looked_s = now_s

    def end(self) -> None:
        """It did."""
        self._since_s = None

    def is_gone(self, now_s: float) -> bool:
        """Return whether it is no use to wait for it: it was stopped, or has owed its word for too long."""
        if self._since_s is None or now_s - self._looked_s < LOOK_REAL_S:
            return False
        self._looked_s = now_s
        return now_s - self._since_s >= PATIENCE_REAL_S or is_process_stopped(self._pid)
