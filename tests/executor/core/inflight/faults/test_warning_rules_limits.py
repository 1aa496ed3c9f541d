"""Warnings at their limits, one look at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.inflight.faults import warning_rules
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.messages import Radio
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.core.inflight.faults.watch_views import CONTEXT, PLANNED, warn
from tests.executor.core.steps import HOMEWARD, beat, rounded
from tests.executor.core.vehicles import DISARMED, NOW_S, OUT_THERE, at, flying, pack, says

UNPLANNED = replace(PLANNED, planned=False)

FALLS = Fault(FaultKind.INTERRUPTION, "falls", NOW_S - 9.0, FaultCode.FALLING)
ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "messages missing while others arrive",
        lambda: [
            warn(name, flying(**given))
            for name, given in (
                ("heartbeat", {"heartbeat_s": NOW_S - 3.4}),
                ("heartbeat", {"heartbeat_s": NOW_S - 3.5}),
                ("heartbeat", {"heartbeat_s": NOW_S - 3.5, "heard_s": NOW_S - 0.1}),
                ("heartbeat", {"heartbeat_s": NOW_S - 6.0, "heard_s": NOW_S - 2.5}),
                ("heartbeat", {"heartbeat_s": NOW_S - 6.0, "heard_s": NOW_S - 2.6}),
                ("items", {"item_s": NOW_S - 9.0}),
                ("items", {"item_s": NOW_S - 9.0, "stage": Stage.RETURNING}),
                ("battery-silent", {"battery": pack(90.0, age_s=7.0)}),
                ("silent", {"heard_s": NOW_S - 2.9}),
                ("silent", {"heard_s": NOW_S - 3.0}),
                ("silent", {"heard_s": None}),
            )
        ],
        [
            "",
            "no HEARTBEAT for 4 s, while other messages come",
            "",
            "no HEARTBEAT for 6 s, while other messages come",
            "",
            "no report of its current waypoint for 9 s, while other messages come",
            "",
            "no battery report for 7 s, while other messages come",
            "",
            "no message for 3.0 s",
            "",
        ],
    ),
    (
        "a battery that fails besides",
        lambda: (
            [
                warn("battery-besides", flying(stage=Stage.RETURNING, fault=fault, **given))
                for fault in (None, replace(FALLS, kind=FaultKind.BATTERY), FALLS)
                for given in (says("Battery Failsafe", heartbeat=beat(status=5)),)
            ]
            + [
                warn("battery-besides", flying(stage=Stage.RETURNING, fault=FALLS, **given))
                for given in (
                    {"battery": pack(20.0, charge_state=3)},
                    {"battery": pack(20.0, charge_state=2)},
                    {"battery": pack(20.0, charge_state=3), "heartbeat": beat(armed=False)},
                )
            ]
        ),
        [
            "",
            "",
            "besides, it says: Battery Failsafe",
            "besides, the autopilot reports its battery critical",
            "",
            "",
        ],
    ),
    (
        "a lossy link",
        lambda: [
            warn("loss", flying(quality=LinkQuality(lost=lost, usual=usual)))
            for lost, usual in ((None, 0.1), (0.32, 0.1), (0.33, 0.1), (0.5, None), (0.3, 0.0))
        ],
        [
            "",
            "",
            "33 % of its frames are lost, where 10 % is usual",
            "",
            "30 % of its frames are lost, where 0 % is usual",
        ],
    ),
    (
        "a weak radio",
        lambda: [
            warn("radio", flying(quality=LinkQuality(radio=Radio(20, 60, 20, 20, 90), radio_s=NOW_S - age_s)))
            for age_s in (5.0, 5.1)
        ],
        ["radio signal 20 over noise 20 here", ""],
    ),
    (
        "a low battery",
        lambda: [
            warn("battery-low", flying(**given))
            for given in (
                {},
                {"battery": pack(90.0, charge_state=2)},
                {"unhealthy": 0x2000000},
                {"unhealthy": 0x1000000},
            )
        ],
        ["", "the autopilot reports its battery low", "the autopilot reports its battery not healthy", ""],
    ),
    (
        "a doubtful reserve",
        lambda: [
            warn("reserve", flying(battery=pack(percent), **given), setup)
            for percent, given in (
                (18.0, {}),
                (16.0, {}),
                (15.0, {}),
                (15.0, {"waypoint": 5}),
                (15.0, {"waypoint": 4}),
                (15.0, {"heartbeat": DISARMED}),
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        [
            "",
            "",
            "below its reserve at landing with 99 % probability",
            "below its reserve at landing with 99 % probability",
            "below its reserve at landing with 100 % probability",
            "below its reserve at landing with 100 % probability",
            "",
            "",
            "",
            "",
            "",
            "below its reserve at landing with 100 % probability",
        ],
    ),
    (
        "stopped on its way home",
        lambda: [
            warn("stands", flying(**{**HOMEWARD, "fix": at(up_m=2.0), "anchor": at(age_s=20.0), **given}))
            for given in (
                {},
                {"anchor": at(age_s=19.9)},
                {"fix": at(up_m=1.9)},
                {"fix": at(age_s=3.0), "anchor": at(age_s=23.0)},
                {"fix": at(age_s=3.1), "anchor": at(age_s=33.0)},
                {"stage": Stage.FLYING},
                {"heartbeat": DISARMED},
                {"anchor": None},
                {"fix": None},
            )
        ],
        [
            f"has not moved for 20 s on its return, {OUT_THERE}, 2 m over its home",
            "",
            "",
            f"has not moved for 20 s on its return, {OUT_THERE}, 20 m over its home",
            "",
            "",
            "",
            "",
            "",
        ],
    ),
    (
        "a refuted HEARTBEAT",
        lambda: [bool(warn("disarmed", flying(doubted=doubted))) for doubted in (None, (DISARMED, NOW_S))],
        [False, True],
    ),
    (
        "vehicles without warnings",
        lambda: [
            len(
                warning_rules.find_warnings(
                    WatchView(CONTEXT, PLANNED, flying(stage=stage, fix=at(age_s=9.0)), False, NOW_S)
                )
            )
            for stage in Stage
        ],
        [0, 1, 1, 1, 1, 0, 0, 1],
    ),
    (
        "a warning is repeated after a while",
        lambda: [
            warning_rules.find_new_warnings(
                WatchView(CONTEXT, PLANNED, flying(fix=at(age_s=9.0)), False, NOW_S),
                (("positions", NOW_S - age_s), ("items", NOW_S - 29.0)),
            )
            for age_s in (29.9, 30.0)
        ],
        [
            ((("positions", NOW_S), ("items", NOW_S - 29.0)), ()),
            (
                (("items", NOW_S - 29.0), ("positions", NOW_S)),
                ("uav1: no position for 9 s, while other messages come",),
            ),
        ],
    ),
    (
        "a warning is forgotten",
        lambda: [
            warning_rules.find_new_warnings(WatchView(CONTEXT, PLANNED, flying(), False, NOW_S), told)
            for told in (
                (),
                (("items", NOW_S - 30.0),),
                (("items", NOW_S - 29.9),),
            )
        ],
        [((), ()), ((), ()), ((("items", NOW_S - 29.9),), ())],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
