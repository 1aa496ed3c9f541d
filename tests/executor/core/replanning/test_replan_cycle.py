"""Re-plans: when they begin, when they are stale, and vehicles that cannot take part."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import CancelSolve, Compose, Finish, Level, Start
from executor.core.interface.events import IntentReceived, MissionsWanted, ReturnAllOrdered, SolveEnded, UploadEnded
from executor.core.interface.intents import Action, Intent
from executor.core.replanning import replan_cycle
from executor.core.state.vehicle_state import FaultKind, Stage
from missions import Phase
from tests.executor.builders import THREE, fleet_of, with_facts
from tests.executor.core.stories import EVERYTHING, story, under_way
from tests.fakes.flight import Story
from tests.fakes.solver import fail, leave_out, share_out


def test_a_fault_while_solving_cancels_and_plans_again() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": (12, 14)}, pylons=9))
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None)
    flight.crafts["uav3"].battery_pct -= 30.0
    flight.run(lambda: len(flight.solves()) == 2)
    assert flight.given(CancelSolve) == [CancelSolve(1)]
    first, second = flight.solves()
    assert {offer.vehicle for offer in first.survivors} == {"uav1", "uav3", "uav4"}
    assert {offer.vehicle for offer in second.survivors} == {"uav1", "uav4"}
    assert set(second.open_segments) > set(first.open_segments) - set(flight.state.coverage.inspected) - {4}
    assert flight.sent_home() == ["uav3"]
    flight.finish()
    assert set(flight.state.coverage.inspected) == set(range(8))
    assert [record.revision for record in flight.state.replanning.records] == [2]


def test_an_answer_to_an_older_question_is_dropped() -> None:
    flight = under_way()
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None)
    before = flight.state
    flight.happen(SolveEnded(0, (), (0, 1), 0.1, "stale"))
    assert flight.state == before


def test_an_answer_that_comes_too_late_is_planned_again() -> None:
    """uav3 passed what the solver had taken for its last kept waypoint: its path cannot be cut there any more."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.solve_s = 60.0
    lost_s = flight.run(lambda: flight.stage("uav2") is Stage.LOST)
    assert len(flight.solves()) == 1
    flight.solve_s = 0.4
    flight.run(lambda: len(flight.solves()) == 2)
    late = [line for line in flight.said() if "came too late" in line]
    assert len(late) == 1
    assert late[0].endswith("planning again")
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    [record] = flight.state.replanning.records
    assert record.begun_s == lost_s, "the need for it is as old as the fault"
    assert record.trigger.startswith("uav2: link")


def test_a_solver_that_dies_is_asked_again() -> None:
    flight = under_way()
    flight.answer = fail
    flight.crafts["uav2"].mute = True
    flight.run(lambda: "re-plan 1 failed: the solver's process died; trying again" in flight.said())
    failed_s = flight.now_s
    flight.answer = share_out
    again_s = flight.run(lambda: len(flight.solves()) == 2)
    assert again_s - failed_s == pytest.approx(5.0, abs=0.5)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def refused(name: str, revision: int, *, mixed: bool = False) -> UploadEnded:
    return UploadEnded(name, revision, accepted=False, mixed=mixed, reason="mission refused: denied")


def test_a_survivor_that_refuses_its_mission_is_planned_around() -> None:
    flight = under_way()
    flight.upload_results["uav3"] = [refused("uav3", 1)]
    flight.crafts["uav2"].mute = True
    flight.finish()
    first, second = flight.solves()
    assert {offer.vehicle for offer in first.survivors} == {"uav1", "uav3"}
    assert {offer.vehicle for offer in second.survivors} == {"uav1"}
    assert flight.vehicle("uav3").fault is None, "it flies its own mission to the end"
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert {4, 5} <= {segment for segment, by in flight.state.coverage.inspected.items() if by == "uav3"}
    assert "uav3: upload of its new mission failed (mission refused: denied); re-planning without it" in flight.said()


def test_a_vehicle_with_a_mixed_mission_is_sent_home() -> None:
    flight = under_way()
    flight.upload_results["uav3"] = [refused("uav3", 1, mixed=True)]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.stage("uav3") is Stage.RETURNING)
    fault = flight.vehicle("uav3").fault
    assert fault is not None
    assert (fault.kind, fault.reason) == (FaultKind.INTERRUPTION, "its mission on board is a mix of two")
    assert flight.sent_home() == ["uav3"]
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def landing_when_mixed(mixed: bool) -> Story:
    """Return a flight in which uav3's upload is given up while it comes down on its pad."""
    flight = under_way()
    flight.upload_s = 400.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.vehicle("uav3").assignment.pending is not None)
    flight.run(lambda: (leg := flight.vehicle("uav3").leg) is not None and leg.phase is Phase.LAND)
    assert not replan_cycle.may_retry_upload(flight.context, flight.vehicle("uav3"), mixed=mixed)
    flight.happen(UploadEnded("uav3", 1, accepted=False, mixed=mixed, reason="it has left its mission"))
    return flight


@pytest.mark.parametrize("mixed", [False, True])
def test_an_upload_that_its_landing_ends_is_no_fault(mixed: bool) -> None:
    flight = landing_when_mixed(mixed)
    assert flight.vehicle("uav3").fault is None
    assert not flight.vehicle("uav3").assignment.stubborn
    flight.run(lambda: flight.stage("uav3") is Stage.LANDED)
    assert flight.sent_home() == []


@pytest.mark.parametrize("mixed", [False, True])
def test_an_upload_is_begun_again_while_its_vehicle_flies_its_mission(mixed: bool) -> None:
    flight = under_way()
    flying = flight.vehicle("uav2")
    assert replan_cycle.may_retry_upload(flight.context, flying, mixed=mixed)
    assert replan_cycle.may_retry_upload(flight.context, replace(flying, stage=Stage.PILOT), mixed=mixed) is mixed
    assert not replan_cycle.may_retry_upload(flight.context, replace(flying, stage=Stage.RETURNING), mixed=mixed)
    assert not replan_cycle.may_retry_upload(flight.context, replace(flying, stage=Stage.DOWN), mixed=mixed)
    excluded = with_facts(flying, stage=Stage.GROUND, excluded=True)
    assert replan_cycle.may_retry_upload(flight.context, excluded, mixed=False) is False


def test_a_segment_under_way_is_removed_from_another_vehicles_mission() -> None:
    flight = under_way()
    under_way_now = flight.vehicle("uav2").remaining_visits()[0]
    both = with_facts(flight.vehicle("uav1"), board=flight.vehicle("uav2").assignment.board, waypoint=0)
    flight.state = flight.state.put(both)
    flight.ask(Action.REPLAN)
    flight.run(lambda: bool(flight.solves()))
    assert under_way_now >> 1 not in flight.solves()[0].open_segments


def test_a_mixed_mission_on_the_ground_is_only_not_started() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    flight.upload_results["uav4"] = [refused("uav4", 1, mixed=True)]
    flight.crafts["uav2"].mute = True
    flight.run(lambda: len(flight.solves()) == 2)
    assert flight.stage("uav4") is Stage.GROUND
    assert "uav4" not in {offer.vehicle for offer in flight.solves()[1].survivors}
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert Start("uav4") not in flight.given(Start)


def test_a_spare_on_the_ground_takes_over() -> None:
    flight = under_way(fleet_of({**THREE, "uav4": ()}))
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert Start("uav4") in flight.given(Start)
    assert "uav4" in flight.state.coverage.inspected.values()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_survivor_that_has_landed_flies_again() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}))
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert flight.given(Start).count(Start("uav1")) == 2
    assert {2, 3, 4, 5} & {segment for segment, by in flight.state.coverage.inspected.items() if by == "uav1"}
    assert flight.stage("uav1") is Stage.LANDED


def test_a_survivor_that_has_landed_stays_where_it_may_not_fly_again() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}, flight={"fly_again": "never"}))
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert flight.given(Start).count(Start("uav1")) == 1
    assert flight.solves() == []
    assert flight.said(Level.WARNING)[-1].startswith("no vehicle in the air can take over segment")


def test_what_the_budgets_do_not_cover_is_named() -> None:
    flight = under_way()
    flight.answer = leave_out(3)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING - {3}
    assert "remaining battery does not cover segment 3" in flight.said(Level.WARNING)
    [record] = flight.state.replanning.records
    assert (record.feasible, record.uncovered) == (False, (3,))
    assert flight.given(Finish) == [Finish("1 segment not inspected")]


def test_a_segment_flown_too_fast_is_flown_again() -> None:
    flight = under_way()
    flight.crafts["uav2"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav2").assignment.runs_broken))
    flight.crafts["uav2"].speed = 1.0
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert any("uav2: segment 2 is not proven: flown at" in line for line in flight.said(Level.WARNING))
    assert flight.solves()[0].trigger == "inspection not proven: segment 2"
    assert flight.state.replanning.records[0].ended_s - flight.state.replanning.records[0].begun_s < 5.0


def test_a_segment_that_was_flown_too_fast_last_of_all_is_flown_again() -> None:
    """On its way home it is too near for a new mission; that nobody could take it then is no attempt."""
    ready = fleet_of({"uav1": (0, 2)}, pylons=3)
    flight = story(replace(ready, context=replace(ready.context, horizon_s=60.0)))
    flight.run(lambda: set(flight.state.coverage.inspected) == {0})
    flight.crafts["uav1"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav1").assignment.runs_broken))
    flight.crafts["uav1"].speed = 1.0
    flight.finish()
    assert set(flight.state.coverage.inspected) == {0, 1}
    assert [problem.open_segments for problem in flight.solves()] == [(1,)]
    assert not any("left for later" in line for line in flight.said())


def test_a_segment_that_cannot_be_proven_is_left_at_the_end() -> None:
    flight = story()
    for craft in flight.crafts.values():
        craft.speed = 2.0
    flight.finish()
    assert set(flight.state.coverage.inspected) == set()
    assert "inspection of some segments not proven; left for later" in flight.said(Level.WARNING)
    assert flight.given(Finish) == [Finish("6 segments not inspected")]


def test_a_late_answer_to_an_unproven_segment_keeps_its_reason() -> None:
    flight = under_way()
    flight.crafts["uav2"].speed = 2.0
    flight.run(lambda: bool(flight.vehicle("uav2").assignment.runs_broken))
    flight.crafts["uav2"].speed = 1.0
    flight.solve_s = 60.0
    flight.run(lambda: len(flight.solves()) == 1)
    needed_s = flight.now_s
    flight.solve_s = 0.4
    flight.run(lambda: len(flight.solves()) == 2)
    assert [problem.trigger for problem in flight.solves()] == ["inspection not proven: segment 2"] * 2
    flight.run(lambda: bool(flight.state.replanning.records))
    assert flight.state.replanning.records[0].begun_s == needed_s


def test_the_operator_aborts_during_a_solve() -> None:
    flight = under_way()
    flight.solve_s = 5.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None)
    flight.happen(ReturnAllOrdered())
    assert flight.given(CancelSolve) == [CancelSolve(1)]
    flight.finish()
    assert flight.uploads() == []


def test_a_vehicle_landing_when_the_plan_was_made_may_fly_what_was_left() -> None:
    flight = story(fleet_of({"uav1": (0,), "uav2": (2, 4, 6, 8, 10)}))
    flight.run(lambda: flight.stage("uav1") is Stage.FLYING and flight.vehicle("uav1").power.battery.given_pct > 0)
    board = flight.vehicle("uav1").assignment.board
    assert board is not None
    flight.run(lambda: flight.crafts["uav1"].leg == len(board.path.waypoints) - 1)
    flight.crafts["uav2"].mute = True
    flight.finish()
    assert {3, 4, 5} <= {segment for segment, by in flight.state.coverage.inspected.items() if by == "uav1"}


def composing(monkeypatch: pytest.MonkeyPatch) -> Story:
    """A flight of four in which uav2 is lost, and of the survivors' missions one has been made."""
    monkeypatch.setattr(replan_cycle, "WAYS_AT_ONCE", 1)
    flight = under_way(fleet_of({**THREE, "uav4": (12, 14)}, pylons=9))
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None and bool(flight.state.replanning.replan.unmade))
    return flight


def test_a_large_fleets_missions_are_made_in_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = composing(monkeypatch)
    plan = flight.state.replanning.replan
    assert plan is not None
    [first] = flight.uploads()
    assert plan.pending == {first.vehicle, *(route.vehicle for route in plan.unmade)}
    assert set(plan.missions) == {first.vehicle}
    flight.finish()
    assert {upload.vehicle for upload in flight.uploads()} == plan.pending
    assert len(flight.given(Compose)) == len(plan.pending) - 1
    assert set(flight.state.coverage.inspected) == set(range(8))
    assert len(flight.state.replanning.records) == 1


def test_a_vehicle_lost_before_its_upload_is_left_out_of_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = composing(monkeypatch)
    assert flight.state.replanning.replan is not None
    last = flight.state.replanning.replan.unmade[-1].vehicle
    flight.happen(IntentReceived(Intent("w1", Action.EXCLUDE, last, "page")))
    flight.finish()
    assert last not in {upload.vehicle for upload in flight.uploads()}
    assert len(flight.state.replanning.records) == 2
    assert set(flight.state.coverage.inspected) == set(range(8))


def test_a_vehicle_that_flew_on_before_its_upload_keeps_its_mission(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = composing(monkeypatch)
    plan = flight.state.replanning.replan
    assert plan is not None
    last = plan.unmade[-1].vehicle
    [offer] = [offer for offer in plan.solve.survivors if offer.vehicle == last]
    flight.state = flight.state.put(with_facts(flight.vehicle(last), waypoint=offer.kept + 1))
    for _ in plan.unmade:
        flight.happen(MissionsWanted(plan.solve.revision))
    assert last not in {upload.vehicle for upload in flight.uploads()}
    assert flight.vehicle(last).assignment.pending is None
    assert any(f"{last}: moved on before its new mission arrived" in line for line in flight.said())
    assert flight.state.replanning.urgent


def test_nothing_more_is_made_of_a_plan_that_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = composing(monkeypatch)
    flight.happen(ReturnAllOrdered())
    sent = len(flight.uploads())
    flight.finish()
    assert len(flight.uploads()) == sent
