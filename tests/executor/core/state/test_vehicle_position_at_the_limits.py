"""Whether a vehicle fell, sank or rests, and where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.state import vehicle_position
from executor.core.state.vehicle_state import Stage
from tests.executor.core.steps import STILL, beat, landed, over_pad, rounded
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, ON_PAD, OUT_THERE, RTL, flying

CONTEXT = FLEET.context

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "vehicles that fell",
        lambda: [
            vehicle_position.has_fallen(CONTEXT, landed(**given))
            for given in (
                {},
                {"alarm": ("Kill engaged", NOW_S - 17.0)},
                {"alarm": ("Kill engaged", NOW_S - 17.1)},
                {"alarm": ("RC: Motors Emergency Stopped", NOW_S + 13.0)},
                {"fix": over_pad(5.0)},
                {"fix": over_pad(5.1)},
                {"fix": None},
            )
        ],
        [False, True, False, True, False, True, False],
    ),
    (
        "vehicles that sank",
        lambda: [
            vehicle_position.has_sinking_fix(landed(fix=over_pad(up_m, climbs_m_s=climbs_m_s)))
            for up_m, climbs_m_s in ((1.0, -1.2), (1.0, -1.3), (1.1, -0.3), (1.1, -0.4))
        ],
        [False, True, False, True],
    ),
    (
        "vehicles at rest",
        lambda: [
            vehicle_position.is_at_rest(
                flying(
                    fix=replace(STILL, at_s=NOW_S - age_s, velocity_m_s=(0.0, speed_m_s, 0.0)),
                    disarmed_s=NOW_S - since_s,
                ),
                NOW_S,
            )
            for age_s, speed_m_s, since_s in ((1.5, 0.4, 3.0), (1.6, 0.4, 3.0), (1.5, 0.5, 3.0), (1.5, 0.4, 2.9))
        ],
        [True, False, False, False],
    ),
    (
        "vehicles whose mission has ended",
        lambda: [
            vehicle_position.has_mission_ended(CONTEXT, flying(**{"heartbeat": DISARMED, **given}))
            for given in (
                {},
                {"rebooted_s": 5.0, "waypoint": 5},
                {"away_once": True},
                {"stage": Stage.RETURNING},
                {"waypoint": 4},
                {"waypoint": 5},
                {"waypoint": 6},
                {"unseen_until_s": NOW_S},
                {"unseen_until_s": NOW_S - 1.0},
                {"heartbeat": beat(RTL, armed=False)},
                {"heartbeat": None},
            )
        ],
        [False, False, True, True, True, True, True, True, False, True, False],
    ),
    (
        "a place in words",
        lambda: [
            vehicle_position.describe_last_position(CONTEXT, flying(), NOW_S),
            vehicle_position.describe_last_position(CONTEXT, flying(fix=None), NOW_S),
            vehicle_position.describe_position(CONTEXT, flying(fix=None)),
            vehicle_position.describe_down_place(CONTEXT, flying()),
            vehicle_position.describe_down_place(CONTEXT, landed()),
        ],
        [
            f"last position {OUT_THERE}, 20 m over its home, 0 s ago",
            "its position is not known",
            "an unknown place",
            f"down at {OUT_THERE}, armed: keep away",
            f"down at {ON_PAD}, disarmed",
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
