"""What was answered to a step, in a form that can be compared: timing folded away, telemetry left out."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

OFTEN = 4
"""So many repetitions have a rate."""
LATE_S = 2.0
"""An answer that came so long after the last that was said, or heard, has its time written behind it."""


@dataclass(frozen=True)
class Heard:
    """One message that is no telemetry."""

    at_s: float
    since_s: float
    """Since the station last said something or heard an answer."""
    text: str
    seq: int | None = None
    """Of a request, which may be the next of a row."""


@dataclass(frozen=True)
class Answer:
    """What came of one step."""

    says: tuple[str, ...]
    texts: tuple[str, ...]
    state: str

    def lines(self) -> tuple[str, ...]:
        return (*self.says, *(f'"{text}"' for text in self.texts), *((f"= {self.state}",) if self.state else ()))


def extension(message: Any, offset: int) -> int:
    """Return the uint32 at an offset of the payload: MAVLink has such fields, this dialect of pymavlink has not."""
    frame = bytes(message.get_msgbuf())
    payload = frame[10 : 10 + frame[1]].ljust(offset + 4, b"\0")
    return int(struct.unpack_from("<I", payload, offset)[0])


def fold(heard: Sequence[Heard]) -> tuple[str, ...]:
    """Write rows of requests and repeated questions as one line each; what came late carries its time."""
    lines: list[str] = []
    position = 0
    while position < len(heard):
        one = heard[position]
        same = next(list(row) for _, row in itertools.groupby(heard[position:], key=lambda other: other.text))
        position += len(same)
        # Asked twice for what then came: the station was late, no more.
        late = len(same) < OFTEN and position < len(heard) and heard[position].seq == (one.seq or 0) + 1
        if len(same) > 1 and one.seq is not None and not late:
            mean_s = (same[-1].at_s - one.at_s) / (len(same) - 1)
            often = f" every {round(4 * mean_s) / 4:g} s" if len(same) >= OFTEN else ""
            lines.append(f"{one.text}, again{often}")
        elif one.seq is not None and lines and (row := _continues(lines[-1], one.text, one.seq)):
            lines[-1] = row
        else:
            after = f" after {round(one.since_s)} s" if one.since_s >= LATE_S else ""
            times = f", {len(same)} times" if len(same) > 1 and one.seq is None else ""
            lines.append(f"{one.text}{times}{after}")
    return tuple(lines)


def _continues(line: str, text: str, seq: int) -> str | None:
    """Return the line with one more request in its row, or None."""
    name = text.rpartition(" ")[0]
    begun, _, last = line.rpartition("..") if ".." in line else (line, "", line.rpartition(" ")[2])
    if not line.startswith(f"{name} ") or not last.isdigit() or int(last) != seq - 1:
        return None
    return f"{begun}..{seq}"
