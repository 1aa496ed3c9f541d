"""The judge sees what must not be, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Event, IntentReceived, LaunchOrdered
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from simulator.truth import Truth
from tests.stories.judge import Judge
from tests.stories.story import Story
from tests.stories.world import Flown, Shown

PAD = (49.6, 15.6)
AWAY = (49.602, 15.6)
"""220 m to the north."""
LAUNCH_S, END_S = 10.0, 400.0
LAUNCHED: tuple[tuple[float, Event], ...] = ((LAUNCH_S, LaunchOrdered()),)
BEGUN = ((10.5, "order command 400 1"), (10.6, "armed"), (11.0, "took_off"))
LOITERS = ((50.0, "pilot LOITER"), (50.0, "mode LOITER"))
ENDED = ((300.0, "descends"), (320.0, "landed"), (322.0, "disarmed"))


def truth(t_s: float, what: str, place: tuple[float, float] = PAD, charge_pct: float = 90.0) -> Truth:
    sender = 255 if what.startswith("order") else None
    return Truth("uav1", what, t_s, t_s, sender, *place, 0.0, charge_pct)


def flown(*happened: tuple[float, str], away: bool = False) -> Flown:
    """Return a flight of one vehicle with nothing to inspect in which this happened."""
    place = AWAY if away else PAD
    truths = (truth(0.0, "at"), *(truth(at_s, what, place if at_s > 20 else PAD) for at_s, what in happened))
    return Flown(
        Story("test", ()), "ardupilot", truths, LAUNCHED, (), (), (), LAUNCH_S, END_S, END_S, {"uav1": 1},
        {"uav1": PAD}, {}, {}, frozenset(), 20.0, 0,
    )  # fmt: skip


def rules(told: Flown) -> list[str]:
    return [finding.rule for finding in Judge(told).findings()]


def asked(told: Flown, at_s: float, action: Action, outcome: Outcome = Outcome.ACCEPTED) -> Flown:
    """Return the flight with something that its crew asked for."""
    intent = Intent(f"{action.value}-{at_s}", action, "uav1", "terminal", confirmed=True)
    log = (*told.log, (at_s, IntentReceived(intent)))
    return replace(told, log=log, intents=(*told.intents, IntentRecord(intent, outcome, "", at_s)))


def said(told: Flown, at_s: float, text: str, level: Level = Level.INFO) -> Flown:
    return replace(told, said=(*told.said, (at_s, Say(level, text))))


def test_a_flight_without_anything_in_it() -> None:
    assert rules(said(flown(*BEGUN, *ENDED), 323.0, "uav1: landed with 90 %")) == []


def test_a_flight_that_never_ends() -> None:
    assert rules(replace(flown(*BEGUN, *ENDED), ended_s=None)) == ["ends"]


def test_an_order_to_a_vehicle_that_its_pilot_has() -> None:
    taken = flown(*BEGUN, *LOITERS, (51.2, "order command 176 1 6"), *ENDED)
    assert rules(taken) == ["hands"]
    # A crew that wants it so is obeyed, and a question about a message is no order.
    assert rules(asked(taken, 51.0, Action.RETURN)) == []
    assert rules(asked(taken, 51.0, Action.RETURN, Outcome.REFUSED)) == ["hands"]
    assert rules(flown(*BEGUN, *LOITERS, (51.2, "order command 511 33"), *ENDED)) == []


def test_a_vehicle_is_its_pilots_until_it_is_returned_and_included() -> None:
    happened = (*BEGUN, *LOITERS, (80.0, "pilot AUTO"), (100.0, "order mission 9"), *ENDED)
    assert rules(flown(*happened)) == ["hands"]
    assert rules(asked(flown(*happened), 95.0, Action.INCLUDE)) == []


def test_an_upload_that_broke_off_is_made_whole_with_its_pilot_and_no_other_is_begun() -> None:
    half, again = (45.0, "order mission 9"), (57.0, "order mission 9")
    assert rules(flown(*BEGUN, half, *LOITERS, again, *ENDED)) == []
    assert rules(flown(*BEGUN, half, *LOITERS, (57.0, "order mission 8"), *ENDED)) == ["hands"]
    assert rules(flown(*BEGUN, half, *LOITERS, (75.0, "order mission 9"), *ENDED)) == ["hands"]
    assert rules(flown(*BEGUN, *LOITERS, again, *ENDED)) == ["hands"]


def test_an_order_in_a_landing_or_a_failsafe() -> None:
    assert rules(flown(*BEGUN, (300.0, "descends"), (310.0, "order command 176 1 6"), *ENDED[1:])) == ["emergency"]
    acting = (*BEGUN, (250.0, "failsafe battery"), (253.0, "order command 176 1 6"), *ENDED)
    assert rules(flown(*acting)) == ["emergency"]


def test_a_take_off_without_a_request() -> None:
    again = flown(*BEGUN, *ENDED, (340.0, "order command 400 1"), (340.1, "armed"), (380.0, "disarmed"))
    assert rules(again) == ["arming"]
    assert rules(asked(again, 335.0, Action.INCLUDE)) == []
    late = flown((200.0, "order command 400 1"), (200.1, "armed"), (201.0, "took_off"), *ENDED)
    assert rules(late) == ["arming"]


def test_a_landing_that_was_none() -> None:
    killed = flown(*BEGUN, (15.0, "kill"), (15.0, "disarmed"), (15.8, "fell"))
    assert rules(said(killed, 17.0, "uav1: landed with 99 %")) == ["line"]
    assert rules(said(flown(*BEGUN, *ENDED), 323.0, "uav1: landed with 40 %")) == ["line"]
    assert rules(said(flown(*BEGUN, *ENDED), 200.0, "uav1: landed with 90 %")) == ["line"]


def test_motors_that_stop_before_the_take_off_leave_it_on_its_pad() -> None:
    emptied = flown((8.0, "armed"), (13.4, "fault uav1:battery-step=36@0s"), (13.7, "fell"), (13.7, "disarmed"))
    assert rules(said(emptied, 14.0, "uav1: landed with 90 %")) == []


def test_a_vehicle_down_off_its_pad_is_announced_with_its_place() -> None:
    silent = flown(*BEGUN, *ENDED, away=True)
    assert rules(silent) == ["elsewhere"]
    told = said(silent, 325.0, "uav1: down at 49.60200, 15.60000: keep away", Level.FAULT)
    assert rules(told) == ["line"]  # it is a fault, and nothing had happened to it
    assert rules(said(silent, 325.0, "uav1: on the ground at 49.60200, 15.60000", Level.WARNING)) == []
    fault = (100.0, "fault uav1:ekf@40%")
    wrong = said(flown(*BEGUN, fault, *ENDED, away=True), 325.0, "uav1: down at 49.61200, 15.60000", Level.FAULT)
    assert rules(wrong) == ["line"]


@pytest.mark.parametrize(("at_s", "found"), [(323.4, []), (323.6, ["line"])])
def test_that_motors_have_stopped_is_known_with_the_next_heartbeat(at_s: float, found: list[str]) -> None:
    fault = (100.0, "fault uav1:emergency@40%")
    told = flown(*BEGUN, fault, *ENDED, away=True)
    line = "uav1: does not move, down at 49.60200, 15.60000, armed: keep away"
    assert rules(said(told, at_s, line, Level.FAULT)) == found


def test_a_fault_without_a_cause_and_a_takeover_without_a_pilot() -> None:
    calm = flown(*BEGUN, *ENDED)
    assert rules(said(calm, 100.0, "uav1: battery, below its reserve at landing with 100 %", Level.FAULT)) == [
        "line", "line",
    ]  # fmt: skip
    assert rules(said(calm, 100.0, "uav1: with its pilot")) == ["line"]
    assert rules(said(calm, 100.0, "uav1: no message for 3.2 s")) == ["line"]


def test_a_page_that_shows_what_is_not() -> None:
    taken = flown(*BEGUN, *LOITERS, *ENDED)
    assert rules(replace(taken, shown=(Shown(60.0, "uav1", "returning"),))) == ["page"]
    assert rules(replace(taken, shown=(Shown(60.0, "uav1", "pilot"), Shown(330.0, "uav1", "landed")))) == []


def test_a_segment_that_counts_and_was_never_flown() -> None:
    told = replace(flown(*BEGUN, *ENDED), segments={3: (PAD, AWAY)}, inspected={3: "uav1"}, wanted=frozenset({3}))
    assert rules(told) == ["inspected"]
    assert rules(replace(told, inspected={})) == ["completes"]


@pytest.mark.parametrize(("mode", "found"), [("LAND", []), ("RTL", ["line"])])
def test_a_pilots_request_for_the_failsafes_mode_is_not_the_cause(mode: str, found: list[str]) -> None:
    told = flown(*BEGUN, (100.0, "failsafe ekf"), (100.0, "mode LAND"), (101.0, f"pilot {mode}"), *ENDED)
    line = "uav1: interruption, LAND by its own failsafe; it says: EKF Failsafe; returning or landing by itself"
    assert rules(said(told, 101.3, line)) == found
