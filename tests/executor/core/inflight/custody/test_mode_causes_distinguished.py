"""The party in control of a vehicle: a person, its failsafe, or its mission."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.inflight.custody import mode_causes
from executor.core.interface.messages import Actor, Heartbeat, ModeChange, OrderSeen
from executor.core.state.fleet_state import GroundStationAbsence
from executor.core.state.vehicle_parts import ModeCause, SwitchMove
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import fleet_of, vehicle, with_facts
from tests.executor.core.steps import HOLD, LAND, TAKEN, Changes, beat, rounded
from tests.executor.core.vehicles import AUTO, DISARMED, FLEET, NOW_S, RTL, at, flying, pack, says

CONTEXT = FLEET.context
PX4_FLEET = fleet_of(autopilot="px4")
PX4_HOLD, PX4_MISSION, PX4_RTL, PX4_LAND = (number << 24 | 4 << 16 for number in (3, 4, 5, 6))


def caused(mode: int, before: VehicleState, **given: Any) -> str:
    """Return the cause of a mode that is new, and whether nothing can change that."""
    after = with_facts(before, **given, heartbeat=beat(mode), mode_since_s=NOW_S)
    judged = mode_causes.update_mode_cause(CONTEXT, (), before, after, NOW_S)
    return judged.custody.cause.value + (", for certain" if judged.custody.certain else "")


def ends(mode: int, **given: Any) -> str:
    """Return why a vehicle of PX4's is in a mode at the end of its mission."""
    before = vehicle(
        PX4_FLEET,
        "uav1",
        **{"stage": Stage.FLYING, "heartbeat": Heartbeat(12, PX4_MISSION, True, 4), "waypoint": 5, **given},
    )
    after = with_facts(before, heartbeat=Heartbeat(12, mode, True, 4), mode_since_s=NOW_S)
    return mode_causes.determine_mode_cause(PX4_FLEET.context, (), before, after, NOW_S).value


def missed(**given: Any) -> bool:
    """Return whether a change of mode ten seconds ago is explained by our absence."""
    absence = {"until_s": NOW_S - 5.0, "pause_s": 20.0, "restarted": False, "deaf": False}
    setup = replace(CONTEXT.vehicles["uav1"], failsafe_s=given.pop("failsafe_s", 5.0))
    one = flying(mode_since_s=given.pop("mode_since_s", NOW_S - 10.0), unseen_until_s=given.pop("unseen_until_s", None))
    context = replace(CONTEXT, vehicles={"uav1": setup})
    return mode_causes.is_gcs_absence_failsafe(context, (GroundStationAbsence(**absence | given),), one, NOW_S)


def unseen(failsafe_s: float | None = None, **given: Any) -> bool:
    """Return whether a hold that was found after a silence is a person's."""
    told: Changes = {
        "heartbeat": beat(HOLD),
        "mode_since_s": NOW_S - 2.0,
        "unseen_until_s": NOW_S - 2.0,
        "unseen_from_boot_s": NOW_S - 17.0,
    }
    context = replace(CONTEXT, vehicles={"uav1": replace(CONTEXT.vehicles["uav1"], failsafe_s=failsafe_s)})
    return mode_causes.is_unseen_hold(context, flying(**told | given))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a stick's mode", lambda: caused(0, flying()), "person"),
    (
        "an ordered mode",
        lambda: [
            caused(HOLD, flying(ordered_modes=frozenset({HOLD}), ordered_mode_s=NOW_S - age_s))
            for age_s in (120.0, 120.1)
        ],
        ["ours", "person"],
    ),
    (
        "a return that its pilot's switch explains better than a text, and one that another station ordered",
        lambda: [
            caused(RTL, flying(**says("Radio Failsafe")), **given)
            for given in (
                {},
                {"switched": (SwitchMove(5, 1430, 1682, NOW_S - 1.5, NOW_S - 1.0),)},
                {"switched": (SwitchMove(5, 1430, 1682, NOW_S - 9.5, NOW_S - 9.0),)},
                {"others_orders": ((OrderSeen(176, RTL, 254), NOW_S - 1.0),)},
                {"others_orders": ((OrderSeen(176, AUTO, 254), NOW_S - 1.0),)},
            )
        ],
        ["failsafe", "person, for certain", "failsafe", "person, for certain", "failsafe"],
    ),
    (
        "a hold that its pilot's sticks explain better than a text, by its own word of about then",
        lambda: [
            caused(HOLD, flying(**says("Radio Failsafe")), recorded=(ModeChange(None, by), NOW_S - age_s))
            for by, age_s in ((Actor.PILOT, 2.0), (Actor.PILOT, 2.1), (Actor.MISSION, 0.0))
        ],
        ["person, for certain", "failsafe", "failsafe"],
    ),
    (
        "an order of ours is ours, whoever else gave it",
        lambda: caused(
            RTL,
            flying(ordered_modes=frozenset({RTL}), ordered_mode_s=NOW_S - 1.0),
            others_orders=((OrderSeen(176, RTL, 254), NOW_S - 1.0),),
        ),
        "ours",
    ),
    (
        "a switch that is heard of after the mode that it chose",
        lambda: (
            mode_causes.review_mode_cause(
                CONTEXT,
                (),
                flying(
                    heartbeat=beat(RTL),
                    mode_since_s=NOW_S - 1.0,
                    cause=ModeCause.FAILSAFE,
                    switched=(SwitchMove(5, 1430, 1682, NOW_S - 1.5, NOW_S),),
                ),
                NOW_S,
            ).custody.cause
        ),
        ModeCause.PERSON,
    ),
    (
        "its mission's mode",
        lambda: [caused(AUTO, flying(heartbeat=beat(4), stage=stage)) for stage in Stage],
        ["person", "ours", "ours", "person", "person", "person", "person", "ours"],
    ),
    (
        "a return that is broken off for a landing at home",
        lambda: [caused(LAND, flying(heartbeat=beat(RTL), cause=cause, fix=at(east_m=0.0))) for cause in ModeCause],
        ["person", "person", "person", "person, for certain"],
    ),
    (
        "a return that is broken off for a landing elsewhere",
        lambda: [caused(LAND, flying(heartbeat=beat(RTL), cause=cause, fix=at(east_m=300.0))) for cause in ModeCause],
        ["person", "person", "person", "person, for certain"],
    ),
    (
        "a mode in which it is still",
        lambda: caused(HOLD, flying(heartbeat=beat(HOLD), cause=ModeCause.MISSION)),
        "mission",
    ),
    (
        "a mode that it was armed in",
        lambda: [
            caused(HOLD, flying(stage=stage, heartbeat=beat(HOLD, armed=False), cause=ModeCause.FAILSAFE))
            for stage in (Stage.STARTING, Stage.FLYING, Stage.GROUND)
        ],
        ["ours", "person", "person"],
    ),
    ("the first mode that is heard", lambda: caused(HOLD, flying(heartbeat=None, cause=ModeCause.FAILSAFE)), "ours"),
    (
        "a disarmed vehicle is under nobody's control",
        lambda: (
            mode_causes.update_mode_cause(
                CONTEXT, (), flying(), flying(heartbeat=DISARMED, cause=ModeCause.PERSON), NOW_S
            ).custody.cause
        ),
        ModeCause.OURS,
    ),
    (
        "mode unknown",
        lambda: (
            mode_causes.update_mode_cause(
                CONTEXT, (), flying(), flying(heartbeat=None, cause=ModeCause.PERSON), NOW_S
            ).custody.cause
        ),
        ModeCause.PERSON,
    ),
    (
        "mode changes explained by a failsafe's text",
        lambda: [
            caused(mode, flying(), **says(text, NOW_S - age_s))
            for mode in (RTL, HOLD, 4)
            for text, age_s in (
                ("Radio Failsafe", 15.0),
                ("Radio Failsafe", 15.1),
                ("Failsafe cleared", 0.0),
                ("Low battery", 0.0),
            )
        ],
        [
            "failsafe",
            "person",
            "person",
            "failsafe",
            "failsafe",
            "person",
            "person",
            "failsafe",
            "person",
            "person",
            "person",
            "person",
        ],
    ),
    (
        "mode changes explained by a failsafe otherwise",
        lambda: [
            caused(RTL, flying(), **given)
            for given in (
                {"fence_breached": True},
                {"battery": pack(90.0, charge_state=4)},
                {"battery": pack(90.0, charge_state=3)},
                {"unseen_until_s": NOW_S},
                {"unseen_until_s": NOW_S - 1.0},
            )
        ],
        ["failsafe", "failsafe", "person", "failsafe", "person"],
    ),
    (
        "mode changes explained by its state",
        lambda: [
            mode_causes.update_mode_cause(
                CONTEXT, (), flying(), flying(heartbeat=beat(RTL, status=status), mode_since_s=NOW_S), NOW_S
            ).custody.cause
            for status in (4, 5, 6)
        ],
        [ModeCause.PERSON, ModeCause.FAILSAFE, ModeCause.FAILSAFE],
    ),
    (
        "a person's still",
        lambda: [
            caused(
                RTL,
                flying(heartbeat=beat(0), cause=ModeCause.PERSON, mode_since_s=NOW_S - 9.0),
                **says(text, NOW_S - age_s),
            )
            for text, age_s in (
                ("", 0.0),
                ("Radio Failsafe", 8.9),
                ("Radio Failsafe", 9.0),
                ("Radio Failsafe", 9.1),
                ("hello", 0.0),
            )
        ],
        ["person, for certain", "failsafe", "failsafe", "person, for certain", "person, for certain"],
    ),
    (
        "no failsafe holds after it returned",
        lambda: [
            caused(HOLD, flying(heartbeat=beat(RTL), cause=cause), fence_breached=True)
            for cause in (ModeCause.FAILSAFE, ModeCause.OURS)
        ],
        ["person, for certain", "failsafe"],
    ),
    (
        "an order that was followed and left",
        lambda: [
            sorted(
                mode_causes.update_mode_cause(
                    CONTEXT,
                    (),
                    flying(heartbeat=beat(before), ordered_modes=frozenset({RTL, LAND})),
                    flying(heartbeat=beat(after), ordered_modes=frozenset({RTL, LAND})),
                    NOW_S,
                ).orders.ordered_modes
            )
            for before, after in ((RTL, HOLD), (RTL, LAND), (AUTO, HOLD), (AUTO, RTL))
        ],
        [[], [6, 9], [6, 9], [6, 9]],
    ),
    (
        "the end of a mission of PX4's",
        lambda: [
            ends(mode, **given)
            for mode in (PX4_HOLD, PX4_RTL, PX4_LAND)
            for given in (
                {},
                {"waypoint": 4},
                {"fix": at(up_m=2.0)},
                {"fix": at(up_m=2.1)},
                {"stage": Stage.RETURNING, "fix": at(up_m=1.0)},
                {"waypoint": 6},
            )
        ],
        [
            "person",
            "person",
            "mission",
            "person",
            "person",
            "person",
            "mission",
            "person",
            "mission",
            "mission",
            "person",
            "person",
            "mission",
            "person",
            "mission",
            "mission",
            "person",
            "person",
        ],
    ),
    (
        "vehicles that never landed",
        lambda: [
            mode_causes.has_never_landed(CONTEXT, flying(**{"stage": Stage.LANDED, **given}))
            for given in (
                {},
                {"fix": at(up_m=5.0)},
                {"fix": at(up_m=5.1)},
                {"fix": at(age_s=0.9)},
                {"fix": at(age_s=1.0)},
                {"heartbeat": DISARMED},
                {"took_off": False},
                {"fix": None},
                {"stage": Stage.GROUND},
                {"heartbeat_s": None},
            )
        ],
        [True, False, True, True, False, False, False, False, False, False],
    ),
    (
        "GCS failsafe acts on our absence",
        lambda: [
            missed(**given)
            for given in (
                {},
                {"pause_s": 4.0, "mode_since_s": NOW_S},
                {"pause_s": 3.9, "mode_since_s": NOW_S},
                {"failsafe_s": None},
                {"failsafe_s": None, "deaf": True},
                {"failsafe_s": None, "deaf": True, "unseen_until_s": NOW_S - 10.0},
                {"mode_since_s": NOW_S - 25.0},
                {"mode_since_s": NOW_S - 25.1},
                {"until_s": NOW_S - 30.0},
                {"until_s": NOW_S - 30.1, "mode_since_s": NOW_S},
            )
        ],
        [True, True, False, False, False, True, True, False, False, False],
    ),
    (
        "GCS failsafe acts on the last absence only",
        lambda: [
            mode_causes.is_gcs_absence_failsafe(
                replace(CONTEXT, vehicles={"uav1": replace(CONTEXT.vehicles["uav1"], failsafe_s=5.0)}),
                absences,
                flying(mode_since_s=NOW_S - 10.0),
                NOW_S,
            )
            for old, last in (
                (
                    GroundStationAbsence(100.0, 20.0, restarted=False),
                    GroundStationAbsence(NOW_S - 5.0, 20.0, restarted=False),
                ),
            )
            for absences in ((old, last), (last, old))
        ],
        [True, False],
    ),
    ("no absence", lambda: mode_causes.is_gcs_absence_failsafe(CONTEXT, (), flying(), NOW_S), False),
    (
        "a hold that no failsafe explains",
        lambda: [
            unseen(**given)
            for given in (
                {},
                {"unseen_from_boot_s": NOW_S - 16.9},
                {"failsafe_s": 10.0},
                {"failsafe_s": 10.1},
                {"failsafe_s": 9.9},
                {"heartbeat": beat(RTL)},
                {"fix": None},
                {"unseen_from_boot_s": None},
                {"unseen_until_s": None},
                {"fix": at(age_s=2.0)},
                {"fix": at(age_s=2.1)},
                {"heartbeat": None},
            )
        ],
        [True, False, True, False, True, False, False, False, False, True, False, False],
    ),
    ("a hold, by its own clock", lambda: unseen(fix=replace(at(), boot_s=NOW_S - 1.0)), False),
    (
        "vehicles under foreign control",
        lambda: [
            flying(**given).is_under_foreign_control
            for given in (
                {},
                {"taken": TAKEN},
                {"cause": ModeCause.PERSON},
                {"cause": ModeCause.PERSON, "heartbeat": DISARMED},
            )
        ],
        [False, True, True, False],
    ),
    (
        "vehicles certainly taken over",
        lambda: [
            mode_causes.is_taken_over(flying(mode_since_s=NOW_S - since_s, **given), NOW_S)
            for since_s, given in (
                (1.0, {}),
                (1.0, {"cause": ModeCause.PERSON}),
                (0.9, {"cause": ModeCause.PERSON}),
                (1.0, {"cause": ModeCause.PERSON, "heartbeat": DISARMED}),
            )
        ],
        [False, True, False, False],
    ),
    (
        "a change of mode is looked at again",
        lambda: [
            mode_causes.review_mode_cause(
                CONTEXT,
                (),
                flying(
                    heartbeat=beat(RTL),
                    cause=ModeCause.PERSON,
                    mode_since_s=NOW_S - since_s,
                    **says("Radio Failsafe", NOW_S),
                    certain=certain,
                ),
                NOW_S,
            ).custody.cause
            for since_s, certain in ((4.0, False), (4.1, False), (1.0, True))
        ],
        [ModeCause.FAILSAFE, ModeCause.PERSON, ModeCause.PERSON],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
