"""The decisions of a flight compared with those of its replay."""

from __future__ import annotations

import pytest

from executor.replay.run_replay import compare_decisions

SOLVE = {"kind": "Solve", "revision": 1, "trigger": "uav2: link, silent for 23.0 s"}
REWORDED = SOLVE | {"trigger": "uav2: link lost for 23.0 s"}


def test_a_log_with_the_words_of_another_version_is_decided_the_same() -> None:
    logged = [(1.0, "uav2: heard again"), (2.0, SOLVE)]
    found = compare_decisions(logged, [(1.0, "uav2: link regained"), (2.0, REWORDED)])
    assert found.is_same
    assert found.reworded == "decision 0 at 1.00 s was 'uav2: heard again', is 'uav2: link regained'"
    assert compare_decisions(logged, [*logged]).reworded == ""


def test_a_field_that_is_newer_than_the_log_and_says_nothing_is_no_difference() -> None:
    logged = [(2.0, {"kind": "AskStreams", "vehicle": "uav1"})]
    assert compare_decisions(logged, [(2.0, {"kind": "AskStreams", "vehicle": "uav1", "messages": ()})]).is_same
    assert not compare_decisions(logged, [(2.0, {"kind": "AskStreams", "vehicle": "uav1", "messages": (33,)})]).is_same


@pytest.mark.parametrize(
    "made",
    [
        [(1.5, "uav2: link regained"), (2.0, SOLVE)],
        [(1.0, {"kind": "Start", "vehicle": "uav2"}), (2.0, SOLVE)],
        [(1.0, "uav2: heard again"), (2.0, SOLVE | {"revision": 2})],
        [(1.0, "uav2: heard again")],
    ],
)
def test_another_decision_is_another_one_in_whatever_words(made: list[tuple[float, object]]) -> None:
    assert not compare_decisions([(1.0, "uav2: heard again"), (2.0, SOLVE)], made).is_same
