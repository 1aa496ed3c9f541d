"""Whether a segment was really inspected, judged by the recorded positions alone.

A segment counts when it was flown from one end to the other in one run, inside the corridor about the planned track and
not faster than `SPEED_FACTOR` times the inspection speed. Mission indices are not asked: both autopilots skip and
overwrite them, and ArduPilot flies a slow leg too fast after a pass-through corner. A position that is reckoned because
GPS is lost is none: up to `GAP_S` without a fix is tolerated, as without any position, and more breaks the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from executor.core.lines import inspection
from missions.geometry import locate_on_leg

SPEED_FACTOR = 1.3
END_TOLERANCE_M = 5.0
"""How near to a pylon a run may begin and end: an acceptance radius of 2 m, a GPS fix, and a sample's way at 4 Hz."""
GAP_S = 5.0
"""A longer silence between two positions proves nothing about what was flown between them."""
SLOWED_GAP_S = 9.0
"""The same while a vehicle behind a telemetry radio takes a mission of ours: ArduPilot then sends a position that comes
five times a second every 8.8 s at the most (four times the interval, with 2 s for a buffer that is full)."""
SPEED_WINDOW_S = 2.0
"""The speed is a mean over at least this time, so that the noise of two fixes is no overspeed."""
NOISE_M = 1.0
"""What two fixes may add to a run that is over before `SPEED_WINDOW_S`: a segment of a few metres."""


@dataclass(frozen=True, slots=True)
class Track:
    """The line to be flown for one visit, in its direction, in local metres."""

    segment: int
    begin_m: tuple[float, float]
    end_m: tuple[float, float]
    by_pictures: bool = False
    """Whether pictures alone prove it: a pylon, which is flown around."""

    @property
    def length_m(self) -> float:
        """Length of the track."""
        return math.dist(self.begin_m, self.end_m)

    def locate(self, place_m: tuple[float, float]) -> tuple[float, float]:
        """Return how far along the track a place lies, and how far beside or beyond it."""
        return locate_on_leg(self.begin_m, self.end_m, place_m)

    def lateral_offset_m(self, place_m: tuple[float, float]) -> float:
        """Return how far beside the track, or beside its continuation, a place lies."""
        along, away = self.locate(place_m)
        beyond = max(-along, along - self.length_m, 0.0)
        return math.sqrt(max(0.0, away**2 - beyond**2))


@dataclass(frozen=True, slots=True)
class PositionSample:
    """Where the vehicle was by its own clock."""

    boot_s: float
    place_m: tuple[float, float]
    speed_m_s: float | None = None
    """Over ground, as it reports it; None if it does not."""


@dataclass(frozen=True, slots=True)
class SegmentPass:
    """How a segment was flown, by the positions that prove it."""

    mean_m_s: float
    """Along the track, from the first pylon to the last."""
    max_m_s: float | None
    """The highest ground speed that was reported meanwhile; None if none was."""
    deviation_mean_m: float
    """From the planned track, sideways."""
    deviation_max_m: float


@dataclass(frozen=True, slots=True)
class _RunStatistics:
    """What a run was like so far."""

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
    """(boot_s, along_m) of the last seconds, the oldest first."""
    pace: _RunStatistics


def join_run(track: Track, sample: PositionSample, speed_m_s: float) -> InspectionRun:
    """Return the run of a vehicle that is found on a track, as if it had come from the first pylon at this speed.

    Nobody saw that; who says so has other evidence for it.
    """
    along, _ = track.locate(sample.place_m)
    pace = _RunStatistics(sample.boot_s - max(0.0, along) / speed_m_s, 0.0).with_sample(
        sample, track.lateral_offset_m(sample.place_m)
    )
    return InspectionRun(along, ((sample.boot_s, along),), pace)


@dataclass(frozen=True, slots=True)
class RunStep:
    """What one more position means for a visit."""

    run: InspectionRun | None
    flown: SegmentPass | None = None
    """How it was flown, once the run has come to the other pylon."""
    broken: str = ""
    """Why a run ended before the other pylon."""


def advance_run(  # noqa: PLR0911 - one return for each way in which a run goes on or ends
    run: InspectionRun | None,
    track: Track,
    sample: PositionSample,
    *,
    corridor_m: float,
    speed_m_s: float,
    longest_gap_s: float = GAP_S,
) -> RunStep:
    """Carry a run on by one position.

    Args:
        run: the run so far, None before the first pylon.
        track: the line, in the direction flown.
        sample: the new position; not older than the run's last.
        corridor_m: largest distance from the track.
        speed_m_s: the inspection speed asked for.
        longest_gap_s: after a longer silence nobody knows what was flown meanwhile.
    """
    along, beside = track.locate(sample.place_m)
    tolerance = min(END_TOLERANCE_M, track.length_m / 4)
    inside = beside <= corridor_m
    if inside and along <= tolerance and (run is None or run.furthest_m <= tolerance):
        # Still about the first pylon: the run begins when it leaves.
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
