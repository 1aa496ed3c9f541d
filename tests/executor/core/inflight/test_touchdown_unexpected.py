"""Whether a vehicle is down, and whether it flies again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.inflight import touchdown
from executor.core.interface.messages import Attitude
from executor.core.state.vehicle_state import Stage
from tests.executor.core.steps import HOMEWARD, STILL, Changes, beat, over_pad, rounded
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, OUT_THERE, RTL, at, flying

CONTEXT = FLEET.context


def down_words(**given: Any) -> str:
    told: Changes = {**HOMEWARD, "fix": at(up_m=1.0), "anchor": at(up_m=1.0, age_s=30.0)}
    return touchdown.describe_unexpected_landing(CONTEXT, flying(**told | given), NOW_S)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "vehicles that are down",
        lambda: [
            down_words(**given)
            for given in (
                {},
                {"anchor": at(up_m=1.0, age_s=29.9)},
                {"left_s": NOW_S - 5.0},
                {"left_s": NOW_S - 4.9},
                {"left_s": None},
                {"anchor": None},
                {"fix": at(up_m=1.0, age_s=3.0), "anchor": at(up_m=1.0, age_s=33.0)},
                {"fix": at(up_m=1.0, age_s=3.1), "anchor": at(up_m=1.0, age_s=43.0)},
                {"heartbeat": beat(4)},
                {"heartbeat": beat(RTL, armed=False)},
                {"stage": Stage.FLYING},
                {"stage": Stage.LOST},
            )
        ],
        [
            f"does not move, down at {OUT_THERE}, armed: keep away",
            "",
            f"does not move, down at {OUT_THERE}, armed: keep away",
            "",
            "",
            "",
            f"does not move, down at {OUT_THERE}, armed: keep away",
            "",
            "",
            "",
            "",
            "",
        ],
    ),
    (
        "a vehicle that reports itself on the ground",
        lambda: [bool(down_words(on_ground=True, anchor=at(up_m=1.0, age_s=age_s))) for age_s in (4.9, 5.0)],
        [False, True],
    ),
    (
        "a vehicle that reports itself in the air",
        lambda: [
            bool(down_words(on_ground=False, fix=at(up_m=up_m), anchor=at(up_m=up_m, age_s=age_s)))
            for up_m, age_s in ((5.0, 30.0), (5.1, 149.0), (5.1, 150.0))
        ],
        [True, False, True],
    ),
    (
        "a vehicle over its pad",
        lambda: [
            bool(down_words(fix=over_pad(up_m), anchor=over_pad(up_m, age_s=age_s), on_ground=on_ground))
            for up_m, age_s, on_ground in ((2.0, 30.0, None), (2.1, 300.0, None), (0.0, 29.0, True), (0.0, 30.0, True))
        ],
        [True, False, False, True],
    ),
    (
        "a vehicle that does not report its mode",
        lambda: [
            down_words(heartbeat=beat(4), heartbeat_s=heartbeat_s, excused_s=excused_s)
            for heartbeat_s, excused_s in (
                (NOW_S - 10.0, 5.0),
                (NOW_S - 9.9, 5.0),
                (NOW_S - 90.0, NOW_S - 9.9),
                (None, 5.0),
            )
        ],
        [
            (f"does not move, down at {OUT_THERE}; no HEARTBEAT says that it is disarmed: keep away"),
            "",
            "",
            (f"does not move, down at {OUT_THERE}; no HEARTBEAT says that it is disarmed: keep away"),
        ],
    ),
    (
        "a tilted vehicle",
        lambda: [
            down_words(tilted_since_s=NOW_S - since_s, attitude=attitude, left_s=NOW_S)
            for since_s, attitude in (
                (2.9, Attitude(80.0, 0.0)),
                (3.0, Attitude(80.0, 0.0)),
                (3.0, Attitude(-80.0, 85.0)),
            )
        ],
        [
            "",
            f"leans by 80 degrees, down at {OUT_THERE}, armed: keep away",
            f"leans by 85 degrees, down at {OUT_THERE}, armed: keep away",
        ],
    ),
    (
        "a vehicle that flies again",
        lambda: [
            touchdown.is_flying_again(flying(**{"fix": STILL, "anchor": STILL, **given}))
            for given in (
                {},
                {"fix": replace(STILL, alt_rel_m=5.0)},
                {"fix": replace(STILL, alt_rel_m=5.1)},
                {"fix": replace(STILL, alt_rel_m=-5.1)},
                {"fix": replace(STILL, velocity_m_s=(1.5, 0.0, 0.0))},
                {"fix": replace(STILL, velocity_m_s=(1.0, 1.0, 1.0))},
                {"fix": at(), "heartbeat": DISARMED},
                {"fix": at(), "tilted_since_s": 5.0},
                {"fix": None},
                {"anchor": None},
            )
        ],
        [False, False, True, True, False, True, False, False, False, False],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
