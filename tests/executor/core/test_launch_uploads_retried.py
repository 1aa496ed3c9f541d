"""A vehicle that could not be given its new mission is offered one again when it answers."""

from __future__ import annotations

import pytest

from executor.core import launch
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Level, ReadMission, Upload
from executor.core.interface.events import UploadEnded
from executor.core.interface.intents import Action
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import fleet_of
from tests.executor.core.stories import story
from tests.fakes.flight import Story
from tests.fakes.solver import leave_out, share_out

LONG = {"uav1": (0, 2, 4, 6), "uav2": (8, 10, 12), "uav3": (14, 16, 18, 20)}
EVERYTHING = set(range(11))
AROUND = "uav3: upload of its new mission failed (busy); re-planning without it"
AGAIN = "uav3: answers again; re-planning with it"


def unfit(revision: int, code: Ending | None = Ending.ERROR, *, mixed: bool = False) -> UploadEnded:
    return UploadEnded("uav3", revision, accepted=False, mixed=mixed, reason="busy", code=code)


def losing(*failed: UploadEnded, autopilot: str = "ardupilot") -> Story:
    """Return a flight that loses uav2, and in which the next uploads to uav3 end so."""
    flight = story(fleet_of(LONG, pylons=12, autopilot=autopilot))
    flight.run(lambda: flight.inspecting("uav2", 4))
    flight.upload_results["uav3"] = list(failed)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.vehicle("uav3").assignment.stubborn)
    return flight


def uploads(flight: Story) -> list[int]:
    """Return the revisions that were sent to uav3."""
    return [one.revision for one in flight.given(Upload) if isinstance(one, Upload) and one.vehicle == "uav3"]


def planned_with(flight: Story) -> list[set[str]]:
    return [{offer.vehicle for offer in solve.survivors} for solve in flight.solves()]


@pytest.mark.parametrize(
    ("autopilot", "code"),
    [("ardupilot", Ending.ERROR), ("ardupilot", Ending.NO_ANSWER), ("px4", Ending.OTHER_STATION)],
)
def test_a_busy_vehicle_is_offered_a_mission_when_it_answers(autopilot: str, code: Ending) -> None:
    flight = losing(unfit(1, code), autopilot=autopilot)
    failed_s = flight.now_s
    assert f"{AROUND} until it answers again" in flight.said(Level.WARNING)
    again_s = flight.run(lambda: AGAIN in flight.said())
    assert again_s - failed_s == pytest.approx(launch.AGAIN_S, abs=2.0)
    assert flight.given(ReadMission) == [ReadMission("uav3")]
    flight.run(lambda: len(uploads(flight)) == 2)
    assert planned_with(flight)[:3] == [{"uav1", "uav3"}, {"uav1"}, {"uav1", "uav3"}]
    assert flight.solves()[2].trigger == "uav3: answers again"
    flight.finish()
    assert flight.vehicle("uav3").assignment.declined is None
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert not any("reported a new mission" in line for line in flight.said())


def test_it_is_not_offered_before_it_is_heard_again() -> None:
    flight = losing(unfit(1, Ending.NO_ANSWER))
    flight.crafts["uav3"].mute = True
    flight.pass_s(8.0)
    assert flight.stage("uav3") is Stage.FLYING
    flight.crafts["uav3"].mute = False
    flight.run(lambda: AGAIN in flight.said())
    assert flight.vehicle("uav3").assignment.before is None, "what it flew is judged first"
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_that_accepts_none_is_left_out_of_the_plan() -> None:
    flight = losing(*(unfit(revision) for revision in (1, 3, 5, 7, 9)))
    flight.finish()
    assert len(uploads(flight)) == launch.OFFERS
    assert [line for line in flight.said() if line.startswith(AROUND)] == [
        *[f"{AROUND} until it answers again"] * (launch.OFFERS - 1),
        f"{AROUND} for the rest of the flight",
    ]
    assert flight.said().count(AGAIN) == launch.OFFERS - 1
    assert flight.vehicle("uav3").assignment.stubborn
    assert set(flight.state.coverage.inspected) == EVERYTHING


@pytest.mark.parametrize("code", [Ending.NO_SPACE, Ending.READ_BACK_DIFFERS])
def test_a_plain_refusal_stays_one(code: Ending) -> None:
    flight = losing(unfit(1, code))
    assert AROUND in flight.said(Level.WARNING)
    flight.finish()
    assert (len(uploads(flight)), AGAIN in flight.said()) == (1, False)
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_with_its_pilot_is_offered_nothing() -> None:
    flight = losing(unfit(1))
    flight.crafts["uav3"].mode = 5  # LOITER, by its pilot
    flight.run(lambda: flight.stage("uav3") is Stage.PILOT)
    flight.pass_s(2 * launch.AGAIN_S)
    assert (len(uploads(flight)), flight.given(ReadMission)) == (1, [])


def test_a_vehicle_on_hold_is_offered_its_mission_when_it_resumes() -> None:
    flight = losing(unfit(1))
    flight.ask(Action.HOLD, "uav3")
    flight.pass_s(2 * launch.AGAIN_S)
    assert len(uploads(flight)) == 1
    flight.ask(Action.RESUME, "uav3")
    flight.run(lambda: len(uploads(flight)) == 2)


def test_a_vehicle_with_an_unreadable_mission_is_offered_none() -> None:
    flight = losing(unfit(1))
    flight.crafts["uav3"].unreadable = True
    flight.finish()
    assert len(uploads(flight)) == 1
    assert len(flight.given(ReadMission)) == launch.OFFERS - 1
    assert flight.vehicle("uav3").fault is None
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_mission_with_a_lost_acknowledgement_is_found_on_board() -> None:
    """PX4 swaps missions with the last item: only its acknowledgement, and the read-back, did not come."""
    flight = story(fleet_of(LONG, pylons=12, autopilot="px4"))
    flight.run(lambda: flight.inspecting("uav2", 4))
    flight.upload_results["uav3"] = [unfit(1, Ending.NO_ANSWER)]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: uploads(flight) == [1])
    [sent] = [one for one in flight.given(Upload) if isinstance(one, Upload) and one.vehicle == "uav3"]
    flight.crafts["uav3"].load(sent.path)
    flight.run(lambda: AGAIN in flight.said())
    found = "uav3: its new mission of re-plan 1 is on board after all, verified by read-back"
    assert found in flight.said()
    board = flight.vehicle("uav3").assignment.board
    assert board is not None
    assert board.path == sent.path
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.vehicle("uav3").fault is None


def test_another_stations_mission_that_is_found_then_is_left_to_it() -> None:
    flight = losing(unfit(1))
    flight.crafts["uav3"].alike = 2
    flight.run(lambda: flight.stage("uav3") is Stage.PILOT)
    assert len(uploads(flight)) == 1


def test_a_vehicle_on_the_ground_is_offered_its_mission_again() -> None:
    flight = story(fleet_of({**LONG, "uav4": ()}, pylons=12))
    flight.run(lambda: flight.inspecting("uav2", 4))
    busy = UploadEnded("uav4", 1, accepted=False, mixed=True, reason="busy", code=Ending.ERROR)
    flight.upload_results["uav4"] = [busy]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: "uav4: answers again; re-planning with it" in flight.said())
    flight.finish()
    assert "uav4" in flight.state.coverage.inspected.values()
    assert flight.given(ReadMission) == []
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_segments_left_over_by_then_are_planned_with_it() -> None:
    flight = losing(unfit(1))
    flight.answer = leave_out(4)
    flight.run(lambda: bool(flight.state.coverage.given_up & {4}))
    flight.answer = share_out
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
