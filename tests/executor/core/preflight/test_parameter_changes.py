"""The record of a change on board: the oldest value is restored, and only faultline's own changes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.preflight.parameter_changes import (
    ChangeStage,
    KeptList,
    KeptParameter,
    build_board_record,
    format_number,
)
from missions import MissionItem, MissionKind
from missions.items import PlaceCommand

KEPT = KeptParameter("uav1", 1, "ardupilot", "RTL_ALT", 3000.0, 1500.0, 4, "cm", "why")
CORNERS = tuple(MissionItem(seq, 0, PlaceCommand.INCLUSION_CIRCLE, 50.0 + seq) for seq in range(3))


def planned(old: float, new: float) -> KeptParameter:
    return KeptParameter("uav1", 1, "ardupilot", "RTL_ALT", old, new, 6, "cm", "keeps its RTL in its own layer")


def record(old: float, new: float, before: KeptParameter | None = None) -> KeptParameter:
    [one] = build_board_record([planned(old, new)], [] if before is None else [before])
    return one


def test_the_oldest_value_is_restored() -> None:
    first = record(1500.0, 2700.0)
    second = record(2700.0, 3200.0, replace(first, stage=ChangeStage.SET))
    third = record(3200.0, 2700.0, second)
    assert [one.old for one in (first, second, third)] == [1500.0, 1500.0, 1500.0]
    assert [second.classify(value) for value in (1500.0, 2700.0, 3200.0)] == ["old", "ours", "ours"]
    assert all(one.stage is ChangeStage.PLANNED for one in (first, second, third))
    assert third.earlier == (3200.0,)


def test_what_was_planned_and_never_sent_is_no_older_value() -> None:
    assert record(1500.0, 3200.0, record(1500.0, 2700.0)).old == 1500.0


def test_a_value_set_since_then_counts_as_the_old_one() -> None:
    assert record(4000.0, 2700.0, record(1500.0, 3200.0)).old == 4000.0
    assert record(1500.0, 3200.0).classify(4000.0) == "other"
    given_back = replace(record(1500.0, 2700.0), stage=ChangeStage.RESTORED)
    assert record(2700.0, 3200.0, given_back).old == 2700.0, "it was given back, so somebody else set that"


def test_what_is_not_set_again_stays_on_record() -> None:
    before = [record(1500.0, 2700.0), replace(record(3.0, 0.0), name="RTL_CONE_SLOPE", stage=ChangeStage.SET)]
    now = build_board_record([planned(2700.0, 3200.0)], before)
    assert [(one.name, one.old, one.new, one.stage) for one in now] == [
        ("RTL_ALT", 1500.0, 3200.0, ChangeStage.PLANNED),
        ("RTL_CONE_SLOPE", 3.0, 0.0, ChangeStage.SET),
    ]


@pytest.mark.parametrize(
    ("old", "before", "expected"),
    [
        (3000.0, None, KEPT),
        (1500.0, KEPT, KEPT),
        (2000.0, KEPT, replace(KEPT, old=2000.0)),
        (3000.0, replace(KEPT, new=1400.0), replace(KEPT, earlier=(1400.0,))),
        (
            1300.0,
            replace(KEPT, new=1400.0, earlier=(1300.0, 1500.0)),
            replace(KEPT, earlier=(1300.0, 1400.0)),
        ),
        (3000.0, replace(KEPT, stage=ChangeStage.RESTORED, old=2500.0), KEPT),
    ],
)
def test_a_second_attempt_follows_the_first(old: float, before: KeptParameter | None, expected: KeptParameter) -> None:
    assert build_board_record([replace(KEPT, old=old)], [] if before is None else [before]) == [expected]


def test_the_whole_record_keeps_its_order() -> None:
    cone = replace(KEPT, name="RTL_CONE_SLOPE")
    before = [cone, replace(KEPT, old=2500.0, new=3000.0)]
    assert build_board_record([KEPT], before) == [cone, replace(KEPT, old=2500.0, earlier=(3000.0,))]


def test_a_value_on_board_is_old_or_ours_or_foreign() -> None:
    assert [KEPT.classify(value) for value in (3000.0, 1500.0, 1400.0)] == ["old", "ours", "other"]


def test_all_but_what_is_back_is_still_open() -> None:
    assert [stage.value for stage in ChangeStage if replace(KEPT, stage=stage).is_open] == ["planned", "set", "left"]


def test_values_are_the_same_but_for_what_a_float_loses() -> None:
    pairs = ((1500.0, 1500.014), (1500.0, 1500.016), (0.0, 9e-7), (0.0, 1.1e-6))
    assert [KeptParameter.is_same(one, other) for one, other in pairs] == [True, False, True, False]


def test_a_parameter_in_words() -> None:
    assert [format_number(value) for value in (1500.0, 27.299999, 0.0, -1.5)] == ["1500", "27.3", "0", "-1.5"]
    assert [KEPT.words, replace(KEPT, unit="").words] == [
        "uav1: RTL_ALT 1500 -> 3000 cm",
        "uav1: RTL_ALT 1500 -> 3000",
    ]
    assert (KEPT.words_back, KEPT.words_open) == ("RTL_ALT 3000", "RTL_ALT (was 3000)")


def test_a_list_in_words() -> None:
    fence = KeptList("uav1", 1, "px4", "fence", CORNERS, ())
    rally = KeptList("uav1", 1, "px4", "rally", (), CORNERS)
    assert (fence.kind, rally.kind) == (MissionKind.FENCE, MissionKind.RALLY)
    assert fence.words == "uav1: fence -> 3 items, as before the flight"
    assert replace(fence, old=CORNERS[:1]).words == "uav1: fence -> 1 item, as before the flight"
    assert rally.words == "uav1: rally points -> none, as before the flight"
    assert [rally.classify(items) for items in ((), CORNERS, CORNERS[:2])] == ["old", "ours", "other"]
