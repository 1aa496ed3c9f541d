"""Judge from recorded positions alone whether a segment was inspected.

A segment counts when it was flown from end to end in one run, inside the corridor around the planned track and no
faster than `SPEED_FACTOR` times the inspection speed. Mission indices do not count: both autopilots skip and overwrite
them, and ArduPilot flies a slow leg too fast after a pass-through corner. A position dead-reckoned after GPS loss
counts as none: up to `GAP_S` without a fix is tolerated, a longer time breaks the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from executor.core.lines import inspection
from missions.geometry import locate_on_leg

SPEED_FACTOR = 1.3
END_TOLERANCE_M = 5.0
"""Distance from a pylon within which a run may begin and end: acceptance radius 2 m, a GPS error, one sample at 4
Hz."""
GAP_S = 5.0
"""Longest gap between two positions that still proves what was flown between them."""
SLOWED_GAP_S = 9.0
"""Longest gap while a vehicle behind a telemetry radio receives a mission: ArduPilot then sends a position that it
sends five times a second at most every 8.8 s (four times the interval, and 2 s for a full buffer)."""
SPEED_WINDOW_S = 2.0
"""Shortest averaging time of the speed, so that noise in two fixes is no overspeed."""
NOISE_M = 1.0
"""Noise that two fixes may add to a run shorter than `SPEED_WINDOW_S`, over a segment of a few metres."""


@dataclass(frozen=True, slots=True)
class Track:
    """The planned line of one visit, in its direction, in local metres."""

    segment: int
    begin_m: tuple[float, float]
    end_m: tuple[float, float]
    by_pictures: bool = False
    """Whether pictures alone prove it, as for a pylon, which is circled."""

    @property
    def length_m(self) -> float:
        """Length of the track."""
        return math.dist(self.begin_m, self.end_m)

    def locate(self, place_m: tuple[float, float]) -> tuple[float, float]:
        """Return the distance of a place along the track, and its distance beside or beyond it."""
        return locate_on_leg(self.begin_m, self.end_m, place_m)

    def lateral_offset_m(self, place_m: tuple[float, float]) -> float:
        """Return the lateral distance of a place from the track or its extension."""
        along, away = self.locate(place_m)
        beyond = max(-along, along - self.length_m, 0.0)
        return math.sqrt(max(0.0, away**2 - beyond**2))


@dataclass(frozen=True, slots=True)
class PositionSample:
    """The vehicle's position at a time of its own clock."""

    boot_s: float
    place_m: tuple[float, float]
    speed_m_s: float | None = None
    """Reported ground speed; None if unknown."""


@dataclass(frozen=True, slots=True)
class SegmentPass:
    """The figures of a flown segment, from the positions that prove it."""

    mean_m_s: float
    """Along the track, from the first pylon to the last."""
    max_m_s: float | None
    """Highest reported ground speed; None if none was reported."""
    deviation_mean_m: float
    """Lateral, from the planned track."""
    deviation_max_m: float


@dataclass(frozen=True, slots=True)
class _RunStatistics:
    """Running statistics of a run."""

    began_s: float
    began_m: float
    fastest_m_s: float | None = None
    aside_sum_m: float = 0.0
    aside_max_m: float = 0.0
    samples: int = 0

    def with_sample(self, sample: PositionSample, aside_m: float) -> _RunStatistics:
        speeds = [speed for speed in (self.fastest_m_s, sample.speed_m_s) if speed is not None]
        return _RunStatistics(
            self.began_s,
            self.began_m,
            max(speeds, default=None),
            self.aside_sum_m + aside_m,
            max(self.aside_max_m, aside_m),
            self.samples + 1,
        )

    def to_segment_pass(self, ended_s: float, ended_m: float) -> SegmentPass:
        took_s = ended_s - self.began_s
        mean_m_s = (ended_m - self.began_m) / took_s if took_s > 0 else 0.0
        return SegmentPass(mean_m_s, self.fastest_m_s, self.aside_sum_m / self.samples, self.aside_max_m)


@dataclass(frozen=True, slots=True)
class InspectionRun:
    """An inspection under way: the samples since the vehicle left the first pylon."""

    furthest_m: float
    recent: tuple[tuple[float, float], ...]
    """(boot_s, along_m) of the last seconds, oldest first."""
    pace: _RunStatistics


def join_run(track: Track, sample: PositionSample, speed_m_s: float) -> InspectionRun:
    """Return the run of a vehicle found on a track, as if flown from the first pylon at this speed.

    The positions do not show it; the caller has other evidence.
    """
    along, _ = track.locate(sample.place_m)
    pace = _RunStatistics(sample.boot_s - max(0.0, along) / speed_m_s, 0.0).with_sample(
        sample, track.lateral_offset_m(sample.place_m)
    )
    return InspectionRun(along, ((sample.boot_s, along),), pace)


@dataclass(frozen=True, slots=True)
class RunStep:
    """The effect of one more position on a visit."""

    run: InspectionRun | None
    flown: SegmentPass | None = None
    """The figures of the segment, once the run has reached the other pylon."""
    broken: str = ""
    """Why a run ended before the other pylon."""


def advance_run(  # noqa: PLR0911 - one return for each continuation or end of a run
    run: InspectionRun | None,
    track: Track,
    sample: PositionSample,
    *,
    corridor_m: float,
    speed_m_s: float,
    longest_gap_s: float = GAP_S,
) -> RunStep:
    """Advance a run by one position.

    Args:
        run: the run so far, None before the first pylon.
        track: the line, in the direction flown.
        sample: the new position; not older than the run's last.
        corridor_m: largest distance from the track.
        speed_m_s: the inspection speed of the plan.
        longest_gap_s: the longest gap between positions that keeps the run.
    """
    along, beside = track.locate(sample.place_m)
    tolerance = min(END_TOLERANCE_M, track.length_m / 4)
    inside = beside <= corridor_m
    if inside and along <= tolerance and (run is None or run.furthest_m <= tolerance):
        # Still at the first pylon: the run begins when the vehicle leaves it.
        begun = _RunStatistics(sample.boot_s, along).with_sample(sample, track.lateral_offset_m(sample.place_m))
        return RunStep(InspectionRun(along, ((sample.boot_s, along),), begun))
    if run is None:
        return RunStep(None)
    gap_s = sample.boot_s - run.recent[-1][0]
    if not inside:
        return RunStep(None, broken=inspection.BESIDE_LINE.format(beside_m=beside))
    if gap_s > longest_gap_s:
        return RunStep(None, broken=inspection.NO_POSITION.format(gap_s=gap_s))
    if along < run.furthest_m - corridor_m:
        return RunStep(None, broken=inspection.TURNED_BACK)
    recent = (*run.recent, (sample.boot_s, along))
    while len(recent) > 2 and sample.boot_s - recent[1][0] >= SPEED_WINDOW_S:
        recent = recent[1:]
    elapsed_s = sample.boot_s - recent[0][0]
    speed = (along - recent[0][1]) / elapsed_s if elapsed_s >= SPEED_WINDOW_S else 0.0
    if speed > SPEED_FACTOR * speed_m_s:
        return RunStep(None, broken=inspection.FLOWN_AT.format(speed_m_s=speed))
    furthest, pace = max(run.furthest_m, along), run.pace.with_sample(sample, track.lateral_offset_m(sample.place_m))
    if along >= track.length_m - tolerance:
        if along - recent[0][1] > SPEED_FACTOR * speed_m_s * elapsed_s + NOISE_M:
            return RunStep(None, broken=inspection.TOO_FAST)
        return RunStep(None, flown=pace.to_segment_pass(sample.boot_s, along))
    return RunStep(InspectionRun(furthest, recent, pace))
