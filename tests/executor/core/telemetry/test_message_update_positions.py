"""A position, and everything that it changes: places, falls, inspections."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.messages import Radio
from executor.core.state.link_quality import LinkQuality
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import Stage
from executor.core.telemetry import message_update
from tests.executor.builders import with_facts
from tests.executor.core.steps import HOLD, Changes, beat, over_pad, rounded
from tests.executor.core.telemetry.message_effects import CONTEXT, folded, moved, placed
from tests.executor.core.vehicles import (
    DISARMED,
    NOW_S,
    PAD_E,
    PAD_N,
    at,
    flying,
)


def inspects(*places: tuple[float, float], later: Changes | None = None, **given: Any) -> tuple[Any, ...]:
    """Return what came of places along the first segment, seen at (seconds, metres east of its pylon)."""
    one, found = flying(fix=None, **given), list[object]()
    for t_s, east_m in places:
        message = placed(100.0 - PAD_E + east_m, 15.0, boot_s=NOW_S + t_s, north_m=-5.0)
        step = message_update.apply_message(CONTEXT, one, message, NOW_S + t_s)
        one = with_facts(step.state, **(later or {})) if t_s > 16.0 else step.state
        found += [(t_s, step.inspected)] if step.inspected is not None else []
    return found, one.assignment.run_visit, one.assignment.runs_broken, one.assignment.owed


ALONG = tuple((4.0 * step, 12.0 * step - 1.0) for step in range(10))

REBOOTED = {"fix_waypoint": 2, "run_visit": 0, "rebooted_s": NOW_S, "away_once": True}

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a position",
        lambda: folded(flying(fix=at(age_s=1.0)), placed()),
        (
            {
                "fix": PositionFix(
                    at_s=NOW_S,
                    boot_s=NOW_S,
                    place_m=(261.50000000008964, 15.400000001049465),
                    alt_rel_m=20.0,
                    alt_msl_m=470.0,
                    velocity_m_s=(3.0, 0.0, 0.0),
                ),
                "last_fix": at(age_s=1.0),
                "battery": {"modelled_pct": 0.107924},
                "fix_waypoint": 2,
                "run_visit": 0,
                "away_once": True,
            },
        ),
    ),
    (
        "energy between two positions",
        lambda: [
            moved(flying(fix=at(age_s=age_s), heartbeat=heartbeat), placed(up_m=20.0)).get("battery")
            for age_s, heartbeat in ((1.0, beat()), (10.0, beat()), (599.0, beat()), (600.0, beat()), (1.0, DISARMED))
        ],
        [0.0359245, 0.359245, 21.5188, None, None],
    ),
    (
        "the first position",
        lambda: moved(flying(fix=None, anchor=None), placed()),
        {"anchor": NOW_S, "fix_waypoint": 2, "run_visit": 0, "away_once": True},
    ),
    (
        "a position that was overtaken",
        lambda: [
            folded(flying(fix=at(age_s=age_s)), placed(boot_s=NOW_S - back_s))
            for age_s, back_s in ((1.0, 1.0), (1.0, 60.9))
        ],
        [({},), ({},)],
    ),
    (
        "a position of a clock that began anew",
        lambda: [
            moved(flying(fix=at(age_s=age_s)), placed(boot_s=NOW_S - back_s))
            for age_s, back_s in ((1.0, 61.0), (3.0, 4.0), (2.9, 4.0))
        ],
        [
            REBOOTED | {"anchor": NOW_S - 61.0, "last_fix": at(age_s=1.0)},
            REBOOTED | {"anchor": NOW_S - 4.0, "last_fix": at(age_s=3.0)},
            {},
        ],
    ),
    (
        "a position near the last anchor",
        lambda: [
            moved(flying(fix=at(age_s=1.0), anchor=at(age_s=9.0)), placed(300.0 + away_m, 20.0 + up_m)).get("anchor")
            for away_m, up_m in ((2.9, 0.0), (3.1, 0.0), (0.0, 3.1), (2.2, 2.2))
        ],
        [None, NOW_S, NOW_S, NOW_S],
    ),
    (
        "a position of a clock before that of its anchor",
        lambda: moved(flying(fix=at(age_s=5.0), anchor=at(age_s=-50.0)), placed()).get("anchor"),
        NOW_S,
    ),
    (
        "a take-off",
        lambda: [
            moved(flying(fix=over_pad(age_s=1.0), took_off=False, heartbeat=heartbeat), placed(0.0, up_m)).get(
                "took_off"
            )
            for up_m, heartbeat in ((2.0, beat()), (2.1, beat()), (2.1, DISARMED))
        ],
        [None, True, None],
    ),
    (
        "away from its pad",
        lambda: [
            moved(flying(took_off=took_off, fix=over_pad(1.0, age_s=1.0)), placed(away_m, 1.0)).get("away_once")
            for away_m, took_off in ((14.9, True), (15.1, True), (15.1, False))
        ],
        [None, True, None],
    ),
    (
        "a fall",
        lambda: [
            moved(flying(fix=at(age_s=1.0), took_off=took_off), placed(up_m=1.0, climbs_m_s=-speed_m_s)).get("falls_s")
            for speed_m_s, took_off in ((5.0, True), (5.1, True), (5.1, False))
        ],
        [None, NOW_S, None],
    ),
    (
        "a jump",
        lambda: [
            moved(flying(fix=at(age_s=age_s)), placed(300.0 + away_m)).get("jump")
            for age_s, away_m in (
                (1.0, 12.9),
                (1.0, 13.1),
                (2.0, 25.9),
                (2.0, 26.1),
                (9.9, 200.0),
                (10.0, 200.0),
                (0.5, 11.6),
            )
        ],
        [None, (10.1, NOW_S), None, (20.1, NOW_S), (170.3, NOW_S), None, (10.1, NOW_S)],
    ),
    (
        "a jump to the side",
        lambda: moved(
            flying(fix=replace(at(age_s=2.0), velocity_m_s=(3.0, 4.0, 0.0))), placed(306.0, north_m=PAD_N + 30.0)
        ).get("jump"),
        (26.0, NOW_S),
    ),
    ("an inspection", lambda: inspects(*ALONG), ([(36.0, 0)], 0, (), None)),
    (
        "an inspection in another stage",
        lambda: [inspects(*ALONG, stage=stage)[0] for stage in Stage],
        [[], [], [(36.0, 0)], [], [(36.0, 0)], [], [], []],
    ),
    (
        "an inspection by a pilot in another mode",
        lambda: inspects(*ALONG, stage=Stage.PILOT, heartbeat=beat(HOLD))[0],
        [],
    ),
    ("an inspection of another mission", lambda: inspects(*ALONG, carried=MissionOwnership(foreign_s=5.0))[0], []),
    ("an inspection whose item is ahead", lambda: inspects(*ALONG, waypoint=3), ([], 1, (), None)),
    ("an inspection on the way home", lambda: inspects(*ALONG, waypoint=4), ([], None, (), None)),
    ("an inspection on the way to it", lambda: inspects(*ALONG, waypoint=1), ([(36.0, 0)], 0, (), None)),
    (
        "an inspection that breaks, with its pilot",
        lambda: inspects(*ALONG[:4], (60.0, 40.0), stage=Stage.PILOT),
        ([], 0, ((0, "no position for 48.0 s"),), (0, "no position for 48.0 s")),
    ),
    (
        "an inspection with a gap that is yet to be judged",
        lambda: inspects(*ALONG[:4], (60.0, 40.0)),
        ([], 0, (), None),
    ),
    (
        "an inspection whose item moves on to the way home",
        lambda: inspects(*ALONG, later={"waypoint": 4}),
        ([(36.0, 0)], 0, (), None),
    ),
]


SELDOM = tuple((8.0 * step, 24.2 * step - 1.0) for step in range(6))
BEHIND_RADIO = LinkQuality(radio=Radio(200, 200, 50, 50, 90))


def test_a_gap_that_our_own_upload_makes_over_a_radio_breaks_no_run() -> None:
    found, *_ = inspects(*SELDOM, pending=1, quality=BEHIND_RADIO)
    assert found == [(32.0, 0)]
    for given in ({"pending": 1}, {"quality": BEHIND_RADIO}):
        assert inspects(*SELDOM, **given)[0] == [], "nothing but an upload over a radio takes so long"


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
