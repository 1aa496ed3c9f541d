"""Ground truth of the simulated vehicles, to check the ground station's view against."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Truth:
    """One event."""

    vehicle: str
    what: str
    """``armed``, ``mission_started``, ``took_off``, ``descends`` (a landing begins), ``landed``, ``disarmed``, ``fell``
    (down without harm), ``wreck``, ``crash``, ``on_pad`` (put there); ``mode NAME``; ``failsafe WHY`` when one acts;
    ``pilot MODE``, ``kill`` and ``station MODE`` when a pilot or another station acts; ``fault SPEC`` when a fault was
    injected; and with a sender ``order WHAT``, for every command."""
    t_s: float
    """Simulated seconds since the simulation began."""
    unix_s: float
    """Unix time of the same moment."""
    sender: int | None = None
    """System that sent the command."""
    lat_deg: float | None = None
    """Latitude, with longitude below."""
    lon_deg: float | None = None
    up_m: float | None = None
    """Height above its pad."""
    charge_pct: float | None = None
    """True charge of its battery."""


class TruthWriter:
    """Append each truth as one JSON line; the file is complete after every line."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", encoding="utf-8")

    def __call__(self, truth: Truth) -> None:
        """Append one line."""
        self._file.write(json.dumps(asdict(truth)) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_truths(path: Path) -> tuple[Truth, ...]:
    """Return what a writer wrote; a last line cut off by the writer's death is left out."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return tuple(Truth(**json.loads(line)) for line in lines if line.endswith("\n"))
