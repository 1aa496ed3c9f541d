"""The watchpoints of a flight at their limits, one look at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.interface.messages import Heartbeat, OwnFailsafe
from executor.core.state.vehicle_parts import ModeCause
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import PX4
from tests.executor.core.inflight.faults.watch_views import PLANNED, look, warn
from tests.executor.core.steps import HOLD, STILL, Changes, beat, landed, over_pad, rounded
from tests.executor.core.vehicles import DISARMED, NOW_S, RTL, at, flying, pack

UNPLANNED = replace(PLANNED, planned=False)


def beside(given: Changes) -> VehicleState:
    return landed(**{"stage": Stage.FLYING, **given})


UNSEEN = {"heartbeat_s": NOW_S - 60.0, "fix": at(age_s=60.0)}
HAND: Changes = {"heartbeat": beat(RTL), "flew_mission": True, "mode_since_s": NOW_S - 60.0}

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "longest silence before link lost",
        lambda: [look("link", flying(heard_s=NOW_S - age_s)) for age_s in (9.9, 10.0)],
        ["ok", "link lost for 10.0 s, time-out 10 s"],
    ),
    (
        "no position or HEARTBEAT",
        lambda: [
            look("link", flying(**UNSEEN | given), setup)
            for given in (
                {},
                {"heartbeat_s": NOW_S - 59.9},
                {"fix": at(age_s=59.9)},
                {"fix": None},
                {"heartbeat_s": None},
                {"excused_s": NOW_S - 59.9},
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        ["neither HEARTBEAT nor position for 60 s", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok", "ok"],
    ),
    (
        "no position or HEARTBEAT, with a long time-out",
        lambda: [
            look("link", flying(**UNSEEN), replace(PLANNED, link_timeout_s=timeout_s)) for timeout_s in (60.0, 60.1)
        ],
        ["neither HEARTBEAT nor position for 60 s", "ok"],
    ),
    (
        "places to disarm",
        lambda: [look("off-pad", beside({"fix": over_pad(north_m=-north_m)})) for north_m in (15.0, 15.1)],
        ["ok", "disarmed 15 m from its pad, 0 m high"],
    ),
    (
        "heights to disarm",
        lambda: [look("off-pad", beside({"fix": over_pad(up_m)})) for up_m in (5.0, 5.1)],
        ["ok", "disarmed 5 m above its pad"],
    ),
    (
        "largest age of a height",
        lambda: [
            look("off-pad", beside({"fix": over_pad(9.0, age_s=age_s), "disarmed_s": NOW_S - 8.0}))
            for age_s in (1.5, 1.6, 3.1, 6.0)
        ],
        ["disarmed 9 m above its pad", "stale", "stale", "ok"],
    ),
    (
        "disarmed before its take-off",
        lambda: [
            look("off-pad", beside({"took_off": False, "stage": stage})) for stage in (Stage.FLYING, Stage.STARTING)
        ],
        ["disarmed on its pad before it took off", "ok"],
    ),
    (
        "disarmed in mid-mission",
        lambda: [
            look("off-pad", beside({"away_once": False, "waypoint": 2, "stage": stage}))
            for stage in (Stage.FLYING, Stage.RETURNING, Stage.PILOT)
        ],
        ["disarmed over its pad in mid-mission", "ok", "ok"],
    ),
    (
        "disarmed after a reboot",
        lambda: [
            look("off-pad", beside({"rebooted_s": 5.0, "alarm": ("Crash: Disarming", NOW_S - age_s)}))
            for age_s in (15.0, 15.1)
        ],
        [
            "its autopilot has rebooted, and it is disarmed; it says: Crash: Disarming",
            "its autopilot has rebooted, and it is disarmed",
        ],
    ),
    (
        "never armed, or still armed",
        lambda: [
            look("off-pad", flying(**given))
            for given in ({"armed_once": False, "heartbeat": DISARMED}, {}, {"heartbeat": None})
        ],
        ["ok", "ok", "stale"],
    ),
    (
        "a vehicle that may land anywhere must be at rest",
        lambda: [
            look("off-pad", flying(heartbeat=DISARMED, fix=fix, on_ground=on_ground), UNPLANNED)
            for fix, on_ground in (
                (at(up_m=5.1), None),
                (at(up_m=5.0), None),
                (at(), True),
                (at(), False),
                (at(age_s=3.0), None),
                (at(age_s=3.1), None),
                (STILL, None),
                (replace(at(), velocity_m_s=(1.0, 0.0, 0.0)), None),
                (None, None),
            )
        ],
        [
            "disarmed 5 m over its home at 3.0 m/s",
            "ok",
            "ok",
            "disarmed 20 m over its home at 3.0 m/s",
            "disarmed 20 m over its home at 3.0 m/s",
            "ok",
            "ok",
            "ok",
            "stale",
        ],
    ),
    (
        "flight termination",
        lambda: [
            look("terminated", flying(heartbeat=beat(armed=armed, status=status), alarm=("Crash", NOW_S - 15.0)))
            for armed in (True, False)
            for status in (5, 6, 7, 8)
        ],
        [
            "ok",
            "reports an emergency; it says: Crash",
            "ok",
            "reports that its flight is terminated; it says: Crash",
            "ok",
            "ok",
            "ok",
            "ok",
        ],
    ),
    (
        "fastest descent",
        lambda: [
            look("falling", flying(fix=at(climbs_m_s=climbs_m_s, age_s=age_s)))
            for climbs_m_s, age_s in ((-5.0, 0.0), (-5.1, 3.0), (-5.1, 3.1))
        ],
        ["ok", "falls at 5.1 m/s", "stale"],
    ),
    (
        "mission left by a failsafe",
        lambda: [
            look("mode", flying(heartbeat=beat(RTL, armed=armed), cause=cause, alarm=("Radio Failsafe", NOW_S)))
            for armed in (True, False)
            for cause in ModeCause
        ],
        ["ok", "ok", "RTL by its own failsafe; it says: Radio Failsafe", "ok", "ok", "ok", "ok", "ok"],
    ),
    (
        "unplanned mission left",
        lambda: [
            look("mode", flying(**HAND | given), UNPLANNED)
            for given in (
                {},
                {"heartbeat": beat()},
                {"heartbeat": beat(RTL, armed=False)},
                {"heartbeat": beat(HOLD)},
                {"flew_mission": False},
                {"heartbeat": None},
                {"critical_s": NOW_S - 60.0},
                {"failed": ((OwnFailsafe("gps", active=True, words="GPS failsafe"), NOW_S - 60.0),)},
            )
        ],
        [
            "RTL by an unknown source",
            "ok",
            "ok",
            "ok",
            "ok",
            "stale",
            "RTL by its own failsafe; its HEARTBEAT is critical",
            "RTL by its own failsafe; it says: GPS failsafe",
        ],
    ),
    (
        "unplanned mission left at its end",
        lambda: [
            look("mode", flying(**HAND | {"item": item}), UNPLANNED) != "ok"
            for item in ((9, 10), (8, 10), (9, None), (65534, 65535), None)
        ],
        [False, True, True, True, True],
    ),
    (
        "unplanned mission of PX4 left at its end",
        lambda: [
            look(
                "mode",
                flying(**HAND | {"heartbeat": Heartbeat(12, 5 << 24 | 4 << 16, True, 4), "item": item}),
                replace(UNPLANNED, dialect=PX4),
            )
            != "ok"
            for item in ((8, 10), (7, 10))
        ],
        [False, True],
    ),
    (
        "largest jump",
        lambda: [
            (look("position", flying(jump=jump)), warn("position", flying(jump=jump)))
            for jump in ((99.9, NOW_S), (100.0, NOW_S - 3.0), (100.0, NOW_S - 3.1), (9.9, NOW_S), (10.0, NOW_S - 3.0))
        ],
        [
            ("ok", "its position jumped by 100 m"),
            ("its position jumped by 100 m", "its position jumped by 100 m"),
            ("ok", ""),
            ("ok", ""),
            ("ok", "its position jumped by 10 m"),
        ],
    ),
    (
        "longest stop",
        lambda: [
            look("stall", flying(fix=at(age_s=age_s), anchor=at(age_s=age_s + stood_s), held_s=held_s), setup)
            for stood_s, age_s, held_s in (
                (89.9, 0.0, None),
                (90.0, 3.0, None),
                (90.0, 3.1, None),
                (90.0, 0.0, 5.0),
                (240.0, 0.0, None),
            )
            for setup in (PLANNED, UNPLANNED)
        ],
        [
            "ok",
            "ok",
            "has not moved for 90 s",
            "ok",
            "stale",
            "stale",
            "ok",
            "ok",
            "has not moved for 240 s",
            "has not moved for 240 s",
        ],
    ),
    (
        "stopped under manual control",
        lambda: look("stall", flying(anchor=at(age_s=900.0), heartbeat=beat(HOLD)), UNPLANNED),
        "ok",
    ),
    (
        "for how long a stream may be gone",
        lambda: [
            look(name, flying(**given))
            for name, given in (
                ("heartbeat", {"heartbeat_s": NOW_S - 19.9}),
                ("heartbeat", {"heartbeat_s": NOW_S - 20.0}),
                ("positions", {"fix": at(age_s=19.9)}),
                ("positions", {"fix": at(age_s=20.0)}),
                ("battery-reports", {"battery": pack(90.0, age_s=59.9)}),
                ("battery-reports", {"battery": pack(90.0, age_s=60.0)}),
                ("items", {"item_s": NOW_S - 19.9}),
                ("items", {"item_s": NOW_S - 20.0}),
            )
        ],
        [
            "ok",
            "no HEARTBEAT for 20 s, while other messages come",
            "ok",
            "no position for 20 s, while other messages come",
            "ok",
            "no battery report for 60 s, while other messages come",
            "ok",
            "no report of its current waypoint for 20 s, while other messages come",
        ],
    ),
    (
        "streams of who is not heard, or not planned, or never sent them",
        lambda: [
            look(name, flying(item_s=item_s, heard_s=heard_s), setup)
            for name, item_s, heard_s, setup in (
                ("items", NOW_S - 30.0, NOW_S - 3.0, PLANNED),
                ("items", NOW_S - 30.0, None, PLANNED),
                ("items", NOW_S - 30.0, NOW_S, UNPLANNED),
                ("items", None, NOW_S, PLANNED),
            )
        ],
        ["stale", "stale", "stale", "stale"],
    ),
    (
        "with a long time-out streams are waited for longer",
        lambda: [
            look("items", flying(item_s=NOW_S - 30.0), replace(PLANNED, link_timeout_s=timeout_s))
            for timeout_s in (30.0, 30.1)
        ],
        ["no report of its current waypoint for 30 s, while other messages come", "ok"],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
