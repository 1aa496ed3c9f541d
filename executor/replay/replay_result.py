"""What the replay of a recorded flight found, as plain data: what the table, the pictures and the pages show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from executor.core.interface.messages import Actor
from executor.core.interface.recorded_log import SkippedRecords
from executor.core.state.vehicle_state import FaultKind

TRACE_S = 3.0
MOST_SAMPLES = 4000


@dataclass(frozen=True, slots=True)
class ReplaySample:
    """One moment of a vehicle, for pictures."""

    at_s: float
    remaining_pct: float | None
    estimate_pct: float | None
    sd_pct: float | None
    landing_pct: float | None
    """What should be left at the landing."""
    voltage_v: float | None
    link_age_s: float
    heartbeat_age_s: float
    item: int | None
    height_m: float | None


@dataclass(slots=True)
class SampleTrace:
    """Samples of one vehicle; when they become many, every second one is dropped, so that memory stays constant."""

    samples: list[ReplaySample] = field(default_factory=list)
    every_s: float = TRACE_S

    def add(self, at_s: float, take: Callable[[], ReplaySample]) -> None:
        """Take a sample, unless the last one is young."""
        if self.samples and at_s - self.samples[-1].at_s < self.every_s:
            return
        self.samples.append(take())
        if len(self.samples) > MOST_SAMPLES:
            self.samples = self.samples[::2]
            self.every_s *= 2


@dataclass(frozen=True, slots=True)
class Declaration:
    """A fault, in the log's own time."""

    kind: FaultKind
    reason: str
    t_usec: int
    evidence: str


@dataclass(frozen=True, slots=True)
class ImpairedPeriod:
    """A time in which something was not well, in the log's own time."""

    kind: FaultKind
    reason: str
    from_usec: int
    to_usec: int
    evidence: str


@dataclass(frozen=True, slots=True)
class ModeTransition:
    """An armed vehicle's mode became another, in the log's own time."""

    t_usec: int
    mode: str
    by: Actor
    why: str
    """What in the log says who changed it; empty where nothing does."""


@dataclass(frozen=True, slots=True)
class PackFlight:
    """One flight of a pack."""

    began_s: float
    ended_s: float
    number: int
    """Which of the packs in this log it is, from 1."""
    cells: int
    began_cell_v: float | None
    """A cell at rest before the flight."""
    ended_cell_v: float
    """A cell at its end as it would rest."""
    began_pct: float
    ended_pct: float
    """What was reported at rest before, and at the end."""
    sag_cell_v: float | None
    """The most that a cell lost under the load."""
    ohm: float | None
    ohm_sd: float | None
    """Of the whole pack; None where no current was reported."""
    counted_ah: float | None
    """What its counter says was used."""
    set_ah: float | None
    """The capacity that its autopilot counts by."""
    capacity_ah: tuple[float, float] | None
    """What its voltage says of its capacity since it was put in: the least and the most, by the chemistries that it may
    have."""


@dataclass(frozen=True, slots=True)
class VehicleReplay:
    """One vehicle of a log."""

    sysid: int
    name: str
    autopilot: str
    declarations: tuple[Declaration, ...]
    degraded: tuple[ImpairedPeriod, ...]
    flown_s: float
    """Armed."""
    samples: tuple[ReplaySample, ...]
    modes: tuple[ModeTransition, ...] = ()
    packs: tuple[PackFlight, ...] = ()
    """What each flight says of its pack."""


@dataclass(frozen=True, slots=True)
class LogReplay:
    """A log, replayed."""

    path: Path
    vehicles: tuple[VehicleReplay, ...]
    skipped: SkippedRecords
    began_usec: int
    lasted_s: float
    notes: tuple[str, ...] = ()
