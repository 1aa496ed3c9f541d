"""What a replay keeps of a log that is hours long."""

from __future__ import annotations

from functools import partial

from executor.core.interface.recorded_log import SkippedRecords
from executor.replay.replay_result import MOST_SAMPLES, ReplaySample, SampleTrace


def at(second: float) -> ReplaySample:
    return ReplaySample(second, None, None, None, None, None, 0.0, 0.0, None, None)


def test_a_sample_is_kept_every_three_seconds() -> None:
    trace = SampleTrace()
    for tenth in range(100):
        trace.add(tenth / 10.0, partial(at, tenth / 10.0))
    assert [one.at_s for one in trace.samples] == [0.0, 3.0, 6.0, 9.0]


def test_a_long_log_is_kept_in_coarser_steps_and_never_in_more_samples() -> None:
    trace = SampleTrace()
    for number in range(3 * MOST_SAMPLES):
        trace.add(3.0 * number, partial(at, 3.0 * number))
        assert len(trace.samples) <= MOST_SAMPLES
    steps_s = {after.at_s - before.at_s for before, after in zip(trace.samples, trace.samples[1:], strict=False)}
    assert steps_s == {12.0}
    assert trace.samples[0].at_s == 0.0


def test_nothing_was_skipped_until_something_was() -> None:
    fresh = SkippedRecords()
    assert not fresh
    assert set(fresh.counts().values()) == {0}
    for name in fresh.counts():
        assert SkippedRecords(**{name: 1}).counts()[name] == 1
        assert SkippedRecords(**{name: 1})
