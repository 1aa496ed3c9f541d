"""What counts as inspected: positions alone decide."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable, Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.state.inspection_proof import (
    GAP_S,
    SPEED_FACTOR,
    InspectionRun,
    PositionSample,
    RunStep,
    SegmentPass,
    Track,
    advance_run,
)

SPEED_M_S = 3.0
CORRIDOR_M = 10.0
Place = tuple[float, float]


def line(length_m: float = 60.0) -> Track:
    """Return a track due east from the origin."""
    return Track(7, (0.0, 0.0), (length_m, 0.0))


def flown(
    places_m: Sequence[Place], speed_m_s: float = SPEED_M_S, *, hz: float = 5.0, hold_s: float = 1.0
) -> list[PositionSample]:
    """Return the fixes of a flight along places at a constant speed, with a stop of `hold_s` at its beginning."""
    samples = [PositionSample(index / hz, places_m[0]) for index in range(round(hold_s * hz))]
    now_s = len(samples) / hz
    left_s = 0.0
    for begin, end in itertools.pairwise(places_m):
        takes_s = math.dist(begin, end) / speed_m_s
        while left_s <= takes_s:
            share = left_s / takes_s if takes_s else 0.0
            samples.append(
                PositionSample(now_s, (begin[0] + (end[0] - begin[0]) * share, begin[1] + (end[1] - begin[1]) * share))
            )
            left_s += 1 / hz
            now_s += 1 / hz
        left_s -= takes_s
    return [*samples, PositionSample(now_s, places_m[-1]), PositionSample(now_s + 1 / hz, places_m[-1])]


def judged(track: Track, samples: Iterable[PositionSample]) -> list[str]:
    """Return what became of the run: 'done', or why it was broken, in the order in which it happened."""
    run: InspectionRun | None = None
    found = []
    for sample in samples:
        step: RunStep = advance_run(run, track, sample, corridor_m=CORRIDOR_M, speed_m_s=SPEED_M_S)
        run = step.run
        if step.flown or step.broken:
            assert run is None, "a run that has ended is over"
            found.append("done" if step.flown else step.broken)
    return found


@pytest.mark.parametrize("length_m", [0.5, 2.0, 6.0, 12.0, 60.0, 400.0])
def test_a_full_run_counts_once(length_m: float) -> None:
    assert judged(line(length_m), flown([(0, 0), (length_m, 0)])) == ["done"]


def test_the_other_direction_is_another_visit() -> None:
    back = flown([(60, 0), (0, 0)])
    assert judged(line(), back) == []
    assert judged(Track(7, (60.0, 0.0), (0.0, 0.0)), back) == ["done"]


def test_half_a_run_does_not_count() -> None:
    assert judged(line(), flown([(0, 0), (30, 0)])) == []


def test_a_run_from_the_middle_does_not_count() -> None:
    assert judged(line(), flown([(30, 0), (60, 0)])) == []


def test_a_run_that_stops_short_of_the_pylon_does_not_count() -> None:
    assert judged(line(), flown([(0, 0), (54, 0)])) == []
    assert judged(line(), flown([(0, 0), (55.5, 0)])) == ["done"]


@pytest.mark.parametrize(
    ("length_m", "factor", "counts"),
    [
        (60.0, 0.5, True), (60.0, 1.25, True), (60.0, 1.4, False), (60.0, 2.7, False),
        (20.0, 1.25, True), (20.0, 1.4, False), (12.0, 1.25, True), (12.0, 2.0, False),
        (6.0, 1.25, True), (6.0, 2.7, False),
    ],
)  # fmt: skip
def test_not_faster_than_it_may_be(length_m: float, factor: float, counts: bool) -> None:
    found = judged(line(length_m), flown([(0, 0), (length_m, 0)], factor * SPEED_M_S, hz=10))
    assert ("done" in found) is counts
    assert counts or found[0].startswith("flown ")


def test_too_fast_for_a_moment_in_the_middle() -> None:
    places = [(3.0 * second, 0.0) for second in range(8)] + [(21.0 + 6.0 * second, 0.0) for second in range(1, 5)]
    samples = [
        PositionSample(float(second), place)
        for second, place in enumerate([*places, *((45.0 + 3 * n, 0.0) for n in range(1, 6))])
    ]
    assert judged(line(), samples) == ["flown at 4.5 m/s"]


@pytest.mark.parametrize(("beside_m", "counts"), [(0.0, True), (9.5, True), (10.5, False), (-10.5, False)])
def test_the_corridor(beside_m: float, counts: bool) -> None:
    found = judged(line(), flown([(0, beside_m), (60, beside_m)]))
    assert found == (["done"] if counts else [])


def test_leaving_the_corridor_breaks_the_run() -> None:
    assert judged(line(), flown([(0, 0), (30, 0), (30, 12), (40, 0), (60, 0)])) == ["10 m off the line"]


def test_turning_back_breaks_the_run() -> None:
    assert judged(line(), flown([(0, 0), (40, 0), (28, 0), (60, 0)])) == ["turned back"]


def test_a_small_step_back_is_the_wind() -> None:
    assert judged(line(), flown([(0, 0), (40, 0), (35, 0), (60, 0)])) == ["done"]


def test_beginning_again_after_turning_back_to_the_first_pylon_counts() -> None:
    assert judged(line(), flown([(0, 0), (40, 0), (0, 0), (60, 0)])) == ["turned back", "done"]


@pytest.mark.parametrize(("gap_s", "found"), [(GAP_S - 0.5, ["done"]), (GAP_S + 1.0, ["no position for 6.2 s"])])
def test_a_silence_proves_nothing(gap_s: float, found: list[str]) -> None:
    samples = flown([(0, 0), (60, 0)])
    cut = next(index for index, sample in enumerate(samples) if sample.place_m[0] > 25)
    resumes_s = samples[cut - 1].boot_s + gap_s
    assert judged(line(), [*samples[:cut], *(s for s in samples[cut:] if s.boot_s >= resumes_s)]) == found


def test_waiting_at_the_first_pylon_is_no_silence_of_the_run() -> None:
    waiting = [PositionSample(float(second), (1.0, 0.5)) for second in range(60)]
    after = [PositionSample(sample.boot_s + 60, sample.place_m) for sample in flown([(1.0, 0.5), (60, 0)])]
    assert judged(line(), [*waiting, *after]) == ["done"]


def test_passing_the_first_pylon_at_transit_speed_does_not_count() -> None:
    assert [found[:8] for found in judged(line(), flown([(-40, 0), (60, 0)], 8.0))] == ["flown at"]


@given(
    length_m=st.floats(3.0, 150.0),
    factor=st.floats(0.4, 1.1),
    hz=st.sampled_from([2.0, 4.0, 5.0, 10.0]),
    seed=st.integers(0, 1000),
)
def test_the_noise_of_fixes_breaks_no_honest_run(length_m: float, factor: float, hz: float, seed: int) -> None:
    rng = random.Random(seed)
    samples = [
        PositionSample(
            sample.boot_s, (sample.place_m[0] + rng.uniform(-0.15, 0.15), sample.place_m[1] + rng.uniform(-0.5, 0.5))
        )
        for sample in flown([(0, 0), (length_m, 0)], factor * SPEED_M_S, hz=hz)
    ]
    assert judged(line(length_m), samples) == ["done"]


@given(length_m=st.floats(10.0, 150.0), factor=st.floats(SPEED_FACTOR * 1.3, 5.0), hz=st.sampled_from([4.0, 10.0]))
def test_nothing_flown_too_fast_counts(length_m: float, factor: float, hz: float) -> None:
    assert "done" not in judged(line(length_m), flown([(0, 0), (length_m, 0)], factor * SPEED_M_S, hz=hz))


@given(
    places=st.lists(st.tuples(st.floats(-80, 140), st.floats(-30, 30)), min_size=2, max_size=6), speed=st.floats(1, 12)
)
def test_whatever_is_flown_only_a_whole_run_counts(places: list[Place], speed: float) -> None:
    """Never done without having been at both pylons, in that order."""
    samples = flown(places, speed)
    if "done" in judged(line(), samples):
        at_first = [sample.boot_s for sample in samples if math.dist(sample.place_m, (0, 0)) <= CORRIDOR_M + 5]
        at_last = [sample.boot_s for sample in samples if math.dist(sample.place_m, (60, 0)) <= CORRIDOR_M + 5]
        assert at_first
        assert at_last
        assert at_last[-1] - at_first[0] >= 50 / (SPEED_FACTOR * SPEED_M_S)


def test_a_place_is_located_along_and_beside() -> None:
    track = Track(0, (10.0, 10.0), (10.0, 50.0))
    assert track.locate((13.0, 30.0)) == pytest.approx((20.0, 3.0))
    assert track.locate((10.0, 55.0)) == pytest.approx((45.0, 5.0))


def shown(samples: Iterable[PositionSample], track: Track) -> SegmentPass:
    """Return how the one run in a flight was flown."""
    run, found = None, list[SegmentPass]()
    for sample in samples:
        step = advance_run(run, track, sample, corridor_m=CORRIDOR_M, speed_m_s=SPEED_M_S)
        run = step.run
        found += [step.flown] if step.flown is not None else []
    [flown_as] = found
    return flown_as


def test_how_a_segment_was_flown() -> None:
    """60 m at 3 m/s, 2 m beside the line on its second half, and once reported at 3.6 m/s."""
    samples = [
        replace(sample, speed_m_s=3.6 if index == 60 else 3.0)
        for index, sample in enumerate(flown([(0.0, 0.0), (30.0, 0.0), (30.0, 2.0), (60.0, 2.0)]))
    ]
    measured = shown(samples, line())
    assert measured.mean_m_s == pytest.approx(3.0, abs=0.15)
    assert measured.max_m_s == 3.6
    assert measured.deviation_max_m == pytest.approx(2.0)
    assert 0.8 < measured.deviation_mean_m < 1.2


def test_a_vehicle_that_does_not_report_its_speed_has_no_highest_one() -> None:
    assert shown(flown([(0.0, 0.0), (60.0, 0.0)]), line()).max_m_s is None


def test_a_wait_at_the_first_pylon_is_no_part_of_the_run() -> None:
    waited = shown(flown([(0.0, 0.0), (60.0, 0.0)], hold_s=60.0), line())
    assert waited.mean_m_s == pytest.approx(SPEED_M_S, abs=0.1)


def test_a_run_past_the_last_pylon_is_not_beside_the_track() -> None:
    coarse = [PositionSample(float(second), (3.0 * second, 0.0)) for second in range(30)]
    assert shown(coarse, line(58.0)).deviation_max_m == pytest.approx(0.0, abs=1e-9)


@given(speed=st.floats(0.5, 3.5), aside=st.floats(0.0, 9.0), length=st.floats(20.0, 300.0))
def test_the_measures_are_those_of_the_flight(speed: float, aside: float, length: float) -> None:
    samples = [replace(one, speed_m_s=speed) for one in flown([(0.0, aside), (length, aside)], speed)]
    measured = shown(samples, line(length))
    assert measured.mean_m_s == pytest.approx(speed, rel=0.1)
    assert measured.max_m_s == speed
    assert measured.deviation_mean_m == pytest.approx(aside, abs=1e-3)
    assert measured.deviation_max_m == pytest.approx(aside, abs=1e-3)
