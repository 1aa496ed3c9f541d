"""A flight resumed during a re-plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.interface.codes import Ending
from executor.core.interface.commands import Level, Say, SendHome
from executor.core.interface.events import Match, NewRoute, StartEnded, UploadEnded
from executor.core.state.fleet_state import ReplanRecord
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.resume.resumed_flight import CONTEXT, found, taken_up
from tests.executor.core.steps import (
    CREW,
    HOLD,
    LOW,
    SECOND,
    SENT_HOME,
    beat,
    new_mission,
    offer_of,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import DISARMED, NOW_S, RTL, flying

NEW = new_mission(4, 6)
GOING = plan_of(missions={"uav1": NEW}, pending=frozenset({"uav1"}))
FRESH = replace(GOING, missions={"uav1": new_mission(4, fresh=True)})
GETS = flying(pending=4)
OURS = Match(0, 10, whole=True)
THEIRS = Match(0, 4, whole=False)
WHOLE = Match(4, 12, whole=True)
HALF = Match(4, 6, whole=False)

UNHEARD = Say(Level.WARNING, "uav1: does not answer yet")
NOT_YET = "uav1: had not started when its new mission came"
AGAIN = {
    "urgent": True,
    "trigger_s": NOW_S,
    "replan": None,
    "records": (
        ReplanRecord(
            revision=4,
            trigger="uav3: gone",
            feasible=True,
            uncovered=(),
            solve_s=0.5,
            begun_s=NOW_S - 5.0,
            ended_s=NOW_S,
            upload_s=3.0,
        ),
    ),
}


def ended(*, mixed: bool) -> UploadEnded:
    return UploadEnded("uav1", 4, accepted=False, mixed=mixed, reason="it does not answer", code=Ending.NO_ANSWER)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "its new mission is on board",
        lambda: taken_up(GETS, found(WHOLE), replan=GOING),
        ([], (UploadEnded(vehicle="uav1", revision=4, accepted=True, mixed=False, reason=""),), (), {}, {}),
    ),
    (
        "its fresh mission is on board",
        lambda: taken_up(replace(GETS, stage=Stage.GROUND), found(WHOLE), replan=FRESH),
        ([], (UploadEnded(vehicle="uav1", revision=4, accepted=True, mixed=False, reason=""),), (), {}, {}),
    ),
    (
        "its old mission is on board, and the new one fits",
        lambda: taken_up(
            GETS,
            found(OURS, HALF, seq=4),
            replan=plan_of(offer_of(), missions={"uav1": NEW}, pending=frozenset({"uav1"})),
        ),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "its old mission is on board, and the new one does not fit any more",
        lambda: taken_up(with_facts(GETS, waypoint=5), found(OURS, HALF, seq=8), replan=GOING),
        (
            [
                Say(Level.INFO, "uav1: moved on before its new mission arrived; re-plan 4 is planned again for it"),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            (),
            (),
            {"uav1": {"waypoint": 4, "pending": None}},
            AGAIN | {"trigger": "uav1: moved on before its new mission arrived"},
        ),
    ),
    (
        "mission on board unknown",
        lambda: taken_up(GETS, found(seq=4), replan=GOING),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "its fresh mission is not on board",
        lambda: taken_up(replace(GETS, stage=Stage.GROUND), found(THEIRS), replan=FRESH),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 False",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "a mixture is on board, and it flies where both are alike",
        lambda: taken_up(GETS, found(THEIRS, HALF, seq=4), replan=GOING),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "a mixture is on board, and it flies beyond",
        lambda: [taken_up(GETS, found(THEIRS, HALF, seq=seq), replan=GOING)[1] for seq in (5, 6, None)],
        [
            (),
            (
                UploadEnded(
                    vehicle="uav1",
                    revision=4,
                    accepted=False,
                    mixed=True,
                    reason="its mission on board is a mix of two, and it is past the new part",
                    code=Ending.READ_BACK_DIFFERS,
                ),
            ),
            (
                UploadEnded(
                    vehicle="uav1",
                    revision=4,
                    accepted=False,
                    mixed=True,
                    reason="its mission on board is a mix of two, and it is past the new part",
                    code=Ending.READ_BACK_DIFFERS,
                ),
            ),
        ],
    ),
    (
        "a mixture is on board, and nobody knows which",
        lambda: taken_up(GETS, found(THEIRS, seq=4), replan=GOING),
        (
            [],
            (
                UploadEnded(
                    vehicle="uav1",
                    revision=4,
                    accepted=False,
                    mixed=True,
                    reason="its mission on board is a mix of two, and it is past the new part",
                    code=Ending.READ_BACK_DIFFERS,
                ),
            ),
            (),
            {},
            {},
        ),
    ),
    (
        "a mixture is on board of who was let go",
        lambda: taken_up(GETS, found(THEIRS, HALF), replan=replace(GOING, pending=frozenset({"uav2"}))),
        ([], (), (("uav1", "mission on board differs from the uploaded one from item 4 on"),), {}, {}),
    ),
    (
        "it stands at the end of what came on board",
        lambda: taken_up(GETS, found(THEIRS, HALF, seq=5, items=6), replan=GOING, beside=(SECOND,)),
        (
            [
                Say(Level.WARNING, "uav1: reached the end of its partly uploaded mission; it is brought home"),
                Say(Level.INFO, "re-plan 4 is on board after 5.0 s"),
                SendHome("uav1"),
            ],
            (),
            (),
            {"uav1": SENT_HOME | {"pending": None}},
            AGAIN | {"trigger": "uav1: reached the end of its partly uploaded mission"},
        ),
    ),
    (
        "current item at the end of its mission",
        lambda: [
            bool(taken_up(GETS, found(THEIRS, HALF, seq=seq, items=items), replan=GOING)[4].get("trigger"))
            for seq, items in ((4, 6), (5, 6), (6, 6), (0, 6), (None, 6), (5, 7))
        ],
        [False, True, True, True, False, False],
    ),
    (
        "it stands at the end of what came on board, coming home",
        lambda: taken_up(with_facts(GETS, heartbeat=beat(RTL)), found(THEIRS, HALF, seq=5, items=6), replan=GOING),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "others have flown a part of it meanwhile",
        lambda: taken_up(GETS, found(OURS, HALF, seq=4), replan=GOING, inspected={2: "uav2", 3: "uav1"}),
        (
            [
                Say(
                    Level.INFO,
                    ("uav1: others have flown segment 2 of its new mission by now; re-plan 4 is planned again for it"),
                ),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            (),
            (),
            {"uav1": {"pending": None}},
            AGAIN | {"trigger": "uav1: others have flown segment 2 of its new mission by now"},
        ),
    ),
    (
        "others have flown a part of it meanwhile, and it carries a mixture",
        lambda: taken_up(GETS, found(THEIRS, HALF, seq=4), replan=GOING, inspected={2: "uav2"}),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {},
        ),
    ),
    (
        "others have flown a part of what a vehicle on the ground should fly",
        lambda: taken_up(replace(GETS, stage=Stage.GROUND), found(THEIRS), replan=FRESH, inspected={2: "uav2"}),
        (
            [
                Say(
                    Level.INFO,
                    ("uav1: others have flown segment 2 of its new mission by now; re-plan 4 is planned again for it"),
                ),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            (),
            (),
            {"uav1": {"pending": None}},
            AGAIN | {"trigger": "uav1: others have flown segment 2 of its new mission by now"},
        ),
    ),
    (
        "it does not answer, on the ground",
        lambda: taken_up(replace(GETS, stage=Stage.GROUND), found(heard=False), replan=FRESH),
        ([UNHEARD], (ended(mixed=False),), (), {}, {}),
    ),
    (
        "it does not answer, in the air, and may carry a mixture",
        lambda: taken_up(GETS, found(heard=False), replan=GOING),
        ([UNHEARD], (ended(mixed=True),), (), {}, {}),
    ),
    (
        "it does not answer, in the air, and carries the whole of one of the two",
        lambda: taken_up(GETS, found(heard=False), replan=GOING, context=fleet_of(autopilot="px4").context),
        ([UNHEARD], (ended(mixed=False),), (), {}, {}),
    ),
    (
        "it does not answer, and is given nothing",
        lambda: taken_up(flying(), found(heard=False), replan=replace(GOING, pending=frozenset({"uav2"}))),
        ([UNHEARD], (), (), {}, {}),
    ),
    (
        "it was to start, and flies",
        lambda: taken_up(with_facts(GETS, stage=Stage.STARTING), found(WHOLE), replan=GOING),
        (
            [],
            (
                StartEnded("uav1", accepted=True, reason=""),
                UploadEnded(vehicle="uav1", revision=4, accepted=True, mixed=False, reason=""),
            ),
            (),
            {},
            {},
        ),
    ),
    *(
        (
            f"it was to start, and stands on its pad; {context.fly_again.value}",
            lambda context=context: taken_up(
                with_facts(GETS, stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, began_pct=93.0),
                found(WHOLE),
                replan=GOING,
                context=context,
            ),
            (
                [
                    Say(Level.WARNING, "uav1: had not started yet; it stays on the ground"),
                    Say(
                        Level.INFO, "uav1: had not started when its new mission came; re-plan 4 is planned again for it"
                    ),
                    Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
                ],
                (),
                (),
                {"uav1": {"stage": Stage.GROUND, "pending": None}},
                AGAIN | {"trigger": NOT_YET},
            ),
        )
        for context in (CONTEXT, CREW)
    ),
    (
        "it was to start, and has landed",
        lambda: taken_up(
            with_facts(GETS, stage=Stage.STARTING, heartbeat=DISARMED, began_pct=93.1), found(WHOLE), replan=GOING
        ),
        (
            [
                Say(Level.INFO, "uav1: its battery has lost 3 % since then: assumed to have flown and landed"),
                Say(Level.INFO, "uav1: landed when its new mission came; re-plan 4 is planned again for it"),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            (),
            (),
            {"uav1": {"stage": Stage.LANDED, "pending": None}},
            AGAIN | {"trigger": "uav1: landed when its new mission came"},
        ),
    ),
    (
        "it was to start, and stands armed on its pad",
        lambda: taken_up(
            with_facts(GETS, stage=Stage.STARTING, heartbeat=beat(HOLD), fix=LOW, took_off=False),
            found(WHOLE),
            replan=GOING,
        ),
        ([], (), (("uav1", "was armed and had not taken off when the ground station went offline"),), {}, {}),
    ),
    (
        "the solver died with us",
        lambda: taken_up(flying(), found(OURS), replan=plan_of(solve_s=None)),
        ([], (), (), {}, {"urgent": True, "trigger": "uav3: gone", "trigger_s": NOW_S - 5.0, "replan": None}),
    ),
    (
        "missions were still to be made",
        lambda: taken_up(
            GETS, found(OURS, seq=4), replan=plan_of(unmade=(NewRoute("uav1", (4,)),), pending=frozenset({"uav1"}))
        ),
        (
            [
                Say(Level.WARNING, "uav1: the new mission of re-plan 4 is incomplete on board; uploading it again"),
                "upload uav1 4 True",
            ],
            (),
            (),
            {},
            {"replan": (["uav1"], ["uav1"], ())},
        ),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
