"""The flights that real autopilots flew: every injected fault is declared for its right reason, and in time."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.recorded_truths import RecordedTruth, read_recorded_truths, truth_for
from benchmarks.tuning import few_lines
from executor.core.state.vehicle_state import FaultKind
from executor.replay.log_replay import build_replay_rules, replay_log
from executor.replay.open_log import open_log
from executor.replay.replay_result import LogReplay
from tests.recorded import LOGS, real_logs

TELEMETRY = sorted(LOGS.glob("*.tlog")) if LOGS.is_dir() else []
ON_BOARD = sorted([*LOGS.glob("*.BIN"), *LOGS.glob("*.ulg")]) if LOGS.is_dir() else []
SOON_S = 5.0
USUAL_PCT_S = {"px4": 100 / 1500, "ardupilot": 0.083}
"""What these vehicles use in ordinary flight, by their truths and by the healthy log."""


def test_the_recorded_flights_are_there() -> None:
    real_logs()
    assert TELEMETRY
    assert ON_BOARD


def replayed(path: Path) -> tuple[LogReplay, RecordedTruth]:
    opened = open_log(path)
    truth = truth_for(path, read_recorded_truths(path.parent))
    assert truth is not None
    return replay_log(opened, build_replay_rules(None)), truth


def extra_pct(found: LogReplay, truth: RecordedTruth, at_usec: int) -> float:
    """Return what was used beyond the usual between the fault and a moment, by the reports."""
    [vehicle] = found.vehicles
    assert truth.fault_usec is not None
    fault_s, at_s = ((usec - found.began_usec) / 1e6 for usec in (truth.fault_usec, at_usec))

    def remaining(moment_s: float) -> float:
        known = [one for one in vehicle.samples if one.estimate_pct is not None and one.at_s <= moment_s]
        return known[-1].remaining_pct or 0.0

    # A sample may be 3 s old: what is left of the rate is added.
    return remaining(fault_s) - remaining(at_s) - USUAL_PCT_S[vehicle.autopilot] * (at_s - fault_s)


@pytest.mark.parametrize("path", [*TELEMETRY, *ON_BOARD], ids=lambda path: str(path.name))
def test_every_fault_and_no_other(path: Path) -> None:
    found, truth = replayed(path)
    [vehicle] = found.vehicles
    declared = [(one.kind, one.t_usec) for one in vehicle.declarations]
    if truth.kind is None:
        assert declared == []
        return
    [(kind, at_usec)] = declared
    assert kind is truth.kind
    assert truth.fault_usec is not None
    late_s = (at_usec - truth.fault_usec) / 1e6
    assert late_s > 0
    if kind is FaultKind.LINK or vehicle.declarations[0].reason == "voltage-step":
        assert late_s <= SOON_S
    else:
        assert extra_pct(found, truth, at_usec) < 5.0


@pytest.mark.parametrize("path", [one for one in TELEMETRY if "link" in one.name], ids=lambda path: str(path.name))
def test_a_link_is_degraded_before_it_is_lost(path: Path) -> None:
    found, _ = replayed(path)
    [vehicle] = found.vehicles
    silent = next(one for one in vehicle.degraded if one.kind is FaultKind.LINK)
    assert silent.from_usec < vehicle.declarations[0].t_usec


@pytest.mark.parametrize("path", TELEMETRY, ids=lambda path: str(path.name))
def test_the_few_lines_find_links_and_miss_batteries(path: Path) -> None:
    """The difference: a threshold on the percentage sees a fast drain when most of the battery is gone."""
    declared, _ = few_lines(path)
    _, truth = replayed(path)
    right = [usec for usec, kind in declared if kind is truth.kind]
    if truth.kind is FaultKind.LINK:
        assert right
    elif truth.kind is FaultKind.BATTERY:
        assert truth.fault_usec is not None
        assert not right or (right[0] - truth.fault_usec) / 1e6 > 60.0
