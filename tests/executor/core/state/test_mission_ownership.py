"""Another station's mission on board is noticed by what the vehicle says of it, within a second."""

from __future__ import annotations

import pytest

from executor.core.interface.commands import HandsOff, Level, ReadMission
from executor.core.interface.events import Found, Heard, MissionRead
from executor.core.interface.intents import Action, Outcome
from executor.core.interface.messages import NO_ITEM, MissionCurrent, StatusText
from executor.core.state import mission_ownership
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import fleet_of
from tests.executor.core.stories import EVERYTHING, under_way
from tests.fakes.flight import Story

DIALECTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])


def honest(autopilot: str = "ardupilot") -> Story:
    """Return a flight whose vehicles say how many items they carry, as those on board."""
    flight = under_way(fleet_of(autopilot=autopilot))
    for name, craft in flight.crafts.items():
        board = flight.vehicle(name).assignment.board
        assert board is not None
        craft.counts, leg = True, craft.leg
        craft.load(board.path)
        assert (craft.leg, craft.total) == (
            leg,
            mission_ownership.compute_expected_total(flight.context, name, len(board.waypoint_of)),
        )
        craft.mission_id = 4711 if autopilot == "px4" else None
    flight.pass_s(8.0)
    return flight


@DIALECTS
def test_our_own_mission_is_ours(autopilot: str) -> None:
    flight = honest(autopilot)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == []


@DIALECTS
def test_a_mission_of_another_length_is_another_stations(autopilot: str) -> None:
    flight = honest(autopilot)
    craft = flight.crafts["uav2"]
    craft.foreign = 4
    since_s = flight.now_s
    found_s = flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    assert found_s - since_s < 2.5, "two reports, a second apart"
    assert HandsOff("uav2") in flight.given(HandsOff)
    [line] = flight.said(Level.FAULT)
    assert line.startswith("uav2: has a foreign mission on board (4 items where ours has ")
    flight.pass_s(60.0)
    assert flight.sent_home() == []
    assert 2 not in flight.state.coverage.inspected or flight.state.coverage.inspected[2] != "uav2"


def test_its_segments_are_kept_for_a_while_though_its_mode_is_as_old_as_the_flight() -> None:
    flight = honest()
    grace_s = flight.context.pilot_grace_s
    flight.pass_s(grace_s)
    flight.crafts["uav2"].foreign = 4
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    began_s = flight.now_s
    freed_s = flight.run(lambda: any("are released to the others" in line for line in flight.said(Level.WARNING)))
    assert freed_s - began_s == pytest.approx(grace_s, abs=2.0)
    assert any(line.startswith("uav2: on another station's mission for ") for line in flight.said(Level.WARNING))


def test_other_items_of_the_same_number_are_another_stations_on_px4() -> None:
    flight = honest("px4")
    flight.crafts["uav2"].mission_id = 815
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT, limit_s=3.0)
    assert "(as many items as ours, but others)" in flight.said(Level.FAULT)[0]


TEXTS = pytest.mark.parametrize("text", ["Flight plan received", "Auto mission changed, restarted command"])


@TEXTS
def test_an_unknown_mission_is_read_and_is_another_stations(text: str) -> None:
    flight = honest()
    flight.crafts["uav2"].alike = 3
    flight.happen(Heard("uav2", StatusText(6, text)))
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT, limit_s=3.0)
    assert "(read-back differs from item 3 on)" in flight.said(Level.FAULT)[0]
    flight.pass_s(20.0)
    assert flight.stage("uav2") is Stage.PILOT, "as many items as ours are no sign that they are"


@TEXTS
def test_a_text_alone_takes_no_vehicle(text: str) -> None:
    """Anybody can send one."""
    flight = honest()
    flight.happen(Heard("uav2", StatusText(6, text)))
    flight.pass_s(3.0)
    assert flight.given(ReadMission) == [ReadMission("uav2")]
    assert "uav2: reported a new mission; verified by read-back, it is ours" in flight.said(Level.WARNING)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == []


def test_a_flood_of_such_texts_is_looked_up_now_and_then() -> None:
    flight = honest()
    for _ in range(20):
        flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
        flight.pass_s(1.0)
    assert 3 <= len(flight.given(ReadMission)) <= 5
    assert flight.stage("uav2") is Stage.FLYING


def test_no_upload_until_the_mission_on_board_is_identified() -> None:
    flight = honest()
    flight.crafts["uav2"].alike = 3
    flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
    flight.crafts["uav1"].mute = True
    flight.run(lambda: bool(flight.uploads()))
    flight.pass_s(5.0)
    assert "uav2" not in {upload.vehicle for upload in flight.uploads()}


def test_a_vehicle_with_an_unreadable_mission_is_left_alone() -> None:
    flight = honest()
    flight.crafts["uav2"].unreadable = True
    flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT, limit_s=3.0)
    assert "cannot be read" in flight.said(Level.FAULT)[0]


def test_a_request_during_a_link_gap_is_no_fault() -> None:
    flight = honest()
    craft = flight.crafts["uav2"]
    craft.unreadable = True
    flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
    craft.mute = True
    flight.run(lambda: flight.vehicle("uav2").link.stale)
    flight.happen(MissionRead(Found("uav2", heard=True, seq=None, items=None, matches=())))
    assert flight.vehicle("uav2").assignment.carried.foreign_s is None
    craft.mute = craft.unreadable = False
    flight.run(lambda: any("verified by read-back, it is ours" in line for line in flight.said(Level.WARNING)))


def test_it_is_back_once_ours_is_read_again() -> None:
    flight = honest()
    craft = flight.crafts["uav2"]
    craft.alike = 3
    flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    craft.alike = None
    flight.pass_s(10.0)
    flight.happen(Heard("uav2", StatusText(6, "Flight plan received")))
    flight.pass_s(5.0)
    assert flight.ask(Action.INCLUDE, "uav2", "again").outcome is Outcome.DONE


def test_one_report_alone_says_nothing() -> None:
    flight = honest()
    flight.happen(Heard("uav2", MissionCurrent(3, 4)))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.said(Level.FAULT) == []


def test_our_own_upload_is_not_foreign() -> None:
    """What it reports while it is given a mission, and the text about it, is of that."""
    flight = honest()
    flight.crafts["uav1"].mute = True
    flight.run(lambda: bool(flight.uploads()))
    name = flight.uploads()[0].vehicle
    flight.happen(Heard(name, MissionCurrent(3, 2)))
    flight.run(lambda: flight.vehicle(name).assignment.pending is None)
    flight.happen(Heard(name, StatusText(6, "Flight plan received")))
    flight.pass_s(3.0)
    assert flight.stage(name) is Stage.FLYING


def test_it_is_back_once_it_carries_ours_and_the_operator_says_so() -> None:
    flight = honest()
    craft = flight.crafts["uav2"]
    craft.foreign = 4
    flight.run(lambda: flight.stage("uav2") is Stage.PILOT)
    flight.pass_s(5.0)
    assert flight.ask(Action.INCLUDE, "uav2", "early").outcome is Outcome.REFUSED
    craft.foreign = None
    flight.pass_s(5.0)
    assert flight.ask(Action.INCLUDE, "uav2", "then").outcome is Outcome.DONE
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_no_mission_at_all_is_not_ours_either() -> None:
    known = mission_ownership.apply_mission_report(MissionOwnership(), MissionCurrent(0, NO_ITEM), 12, 100.0)
    assert known.words == "none at all"
    assert not known.is_surely_foreign(100.5)
    assert known.is_surely_foreign(101.0)


@pytest.mark.parametrize("total", [None, 0])
def test_a_report_without_a_count_says_nothing(total: int | None) -> None:
    assert (
        mission_ownership.apply_mission_report(MissionOwnership(), MissionCurrent(3, total), 12, 100.0)
        == MissionOwnership()
    )
