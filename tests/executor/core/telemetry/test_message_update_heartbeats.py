"""A HEARTBEAT, and everything that it changes of what is known of a vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from tests.executor.core.steps import HOLD, beat, over_pad, rounded
from tests.executor.core.telemetry.message_effects import CONTEXT, folded, moved, placed
from tests.executor.core.vehicles import (
    AUTO,
    DISARMED,
    NOW_S,
    at,
    flying,
)

UNPLANNED = replace(CONTEXT, vehicles={"uav1": replace(CONTEXT.vehicles["uav1"], planned=False)})

ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a HEARTBEAT like the last", lambda: folded(flying(), beat()), ({"flew_mission": True, "beat_boot_s": NOW_S},)),
    (
        "a HEARTBEAT of another mode",
        lambda: folded(flying(), beat(HOLD)),
        (
            {
                "heartbeat": beat(HOLD),
                "mode_since_s": NOW_S,
                "mode_before_s": NOW_S,
                "mode_before": 3,
                "beat_boot_s": NOW_S,
            },
        ),
    ),
    (
        "a HEARTBEAT of an autopilot that starts anew",
        lambda: [
            folded(
                flying(heartbeat=beat(HOLD, armed=False, status=status), armed_once=False),
                beat(HOLD, armed=False, status=1),
            )[0].get("rebooted_s")
            for status in (3, 1, 0)
        ],
        [NOW_S, None, None],
    ),
    (
        "the first HEARTBEAT",
        lambda: folded(flying(heartbeat=None, heartbeat_s=None, armed_once=False), beat()),
        (
            {
                "heartbeat": beat(),
                "mode_since_s": NOW_S,
                "armed_once": True,
                "heartbeat_s": NOW_S,
                "flew_mission": True,
                "beat_boot_s": NOW_S,
            },
        ),
    ),
    (
        "a HEARTBEAT after a silence",
        lambda: [
            folded(flying(heard_s=NOW_S - age_s, spoke_s=NOW_S - age_s, beat_boot_s=7.0), beat())
            for age_s in (2.9, 3.0)
        ],
        [
            ({"flew_mission": True, "beat_boot_s": NOW_S},),
            (
                {
                    "flew_mission": True,
                    "regained_s": NOW_S,
                    "unseen_until_s": NOW_S,
                    "unseen_from_boot_s": 7.0,
                    "beat_boot_s": NOW_S,
                },
            ),
        ],
    ),
    (
        "a HEARTBEAT after others were heard again",
        lambda: [
            folded(flying(heartbeat_s=NOW_S - 5.0, regained_s=regained_s, beat_boot_s=7.0), beat())
            for regained_s in (NOW_S - 5.0, NOW_S - 4.9)
        ],
        [
            ({"heartbeat_s": NOW_S, "flew_mission": True, "beat_boot_s": NOW_S},),
            (
                {
                    "heartbeat_s": NOW_S,
                    "flew_mission": True,
                    "unseen_until_s": NOW_S,
                    "unseen_from_boot_s": 7.0,
                    "beat_boot_s": NOW_S,
                },
            ),
        ],
    ),
    (
        "a HEARTBEAT that says that it stands, and it flies",
        lambda: folded(flying(), beat(armed=False)),
        ({"doubted": (beat(armed=False), NOW_S)},),
    ),
    (
        "a second one",
        lambda: [folded(flying(doubted=(DISARMED, NOW_S - age_s)), beat(armed=False)) for age_s in (2.4, 2.5)],
        [({},), ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S, "doubted": None},)],
    ),
    (
        "a HEARTBEAT that refutes it",
        lambda: folded(flying(doubted=(DISARMED, NOW_S - 1.0)), beat()),
        ({"flew_mission": True, "beat_boot_s": NOW_S, "doubted": None},),
    ),
    (
        "a HEARTBEAT that reports it disarmed and is not doubted",
        lambda: [
            "doubted" in folded(flying(**given), beat(armed=False))[0]
            for given in (
                {},
                {"took_off": False},
                {"fix": None},
                {"fix": at(age_s=1.5)},
                {"fix": at(age_s=1.6)},
                {"on_ground": True},
                {"on_ground": False},
                {"alarm": ("Crash: Disarming", NOW_S - 5.0)},
                {"alarm": ("Crash: Disarming", NOW_S - 5.1)},
                {"alarm": ("Battery Failsafe", NOW_S)},
                {"heartbeat_s": NOW_S - 3.4},
                {"heartbeat_s": NOW_S - 3.5},
                {"heartbeat_s": None},
                {"fix": over_pad(2.0)},
                {"fix": over_pad(2.1)},
                {"fix": over_pad(climbs_m_s=1.0)},
                {"fix": over_pad(climbs_m_s=1.1)},
                {"heartbeat": DISARMED},
            )
        ],
        [
            True,
            False,
            False,
            True,
            False,
            False,
            True,
            False,
            True,
            True,
            True,
            False,
            False,
            False,
            True,
            False,
            True,
            False,
        ],
    ),
    (
        "a HEARTBEAT that says that it stands where nobody knows its plan",
        lambda: folded(flying(), beat(armed=False), UNPLANNED),
        ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S},),
    ),
    (
        "a position of the same time after a silence",
        lambda: moved(flying(fix=at(age_s=3.0)), placed(350.0, boot_s=NOW_S - 3.0)).get("jump"),
        None,
    ),
    (
        "a HEARTBEAT in its mission's mode in the air",
        lambda: [
            folded(flying(flew_mission=False, took_off=took_off), beat(mode, armed=armed))[0].get("flew_mission")
            for took_off, mode, armed in (
                (True, AUTO, True),
                (True, HOLD, True),
                (False, AUTO, True),
                (True, AUTO, False),
            )
        ],
        [True, None, None, None],
    ),
    (
        "a HEARTBEAT that says that it stands where it stands",
        lambda: folded(flying(fix=over_pad()), beat(armed=False)),
        ({"heartbeat": beat(armed=False), "disarmed_s": NOW_S, "beat_boot_s": NOW_S},),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
