"""Segments left over by the first plan: taken over only together with others, by vehicles with spare budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executor.adapters.eventlog import EventLog, read_events
from executor.analysis.report import build_report
from executor.core import fleet_step
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.commands import Finish, Level, Solve, Start
from executor.core.interface.events import Gain, NewRoute, SolveEnded
from executor.core.interface.intents import Action
from executor.core.replanning import replan_cycle
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import story
from tests.fakes.flight import Story
from tests.fakes.solver import leave_out, share_out

READY = fleet_of(THREE, pylons=9)
"""Eight segments; nobody has the last two."""
ASKED = fleet_of(THREE, pylons=9, flight={"fly_again": "ask", "offer_s": 60.0})
LEFT = {6, 7}
TAKES_UP = Gain(2, 200.0, 1, 100.4, 80.0, ())


def takes_up(problem: Solve) -> SolveEnded:
    """Deal the open segments out, and give the first of those that are left over to the last vehicle besides."""
    done = share_out(problem)
    assert done.routes
    last = done.routes[-1]
    more = NewRoute(last.vehicle, (*last.visits, 2 * problem.left_over[0]))
    return replace(done, routes=(*done.routes[:-1], more), gain=TAKES_UP)


def lost(answer: object = takes_up, ready: object = READY) -> Story:
    """Return a flight in which uav2 is lost in the midst of its first segment."""
    flight = story(ready)  # type: ignore[arg-type]
    flight.answer = answer  # type: ignore[assignment]
    flight.run(lambda: flight.inspecting("uav2", 2))
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.solves()))
    return flight


def test_it_is_known_from_the_take_off_and_starts_no_re_plan() -> None:
    flight = story(READY)
    assert flight.state.coverage.left_over == LEFT
    assert flight.state.coverage.given_up == set()
    assert replan_cycle.find_orphan_segments(READY.context, flight.state) == set()
    assert "planned for the next flight: segments 6, 7" in flight.said(Level.INFO)
    assert build_fleet_view(READY.context, flight.state, flight.now_s).uncovered == (6, 7)
    flight.finish()
    assert flight.solves() == []
    assert set(flight.state.coverage.inspected) == set(range(6))
    assert flight.given(Finish) == [Finish("2 segments not inspected, 2 of them planned for the next flight")]
    report = build_report(READY.context, flight.state, flight.now_s)
    assert (report.segments_uncovered, report.left_over, report.finished) == ((6, 7), (6, 7), False)


def test_a_re_plan_is_offered_it_beside_what_it_is_for() -> None:
    flight = lost()
    [problem] = flight.solves()
    assert set(problem.left_over) == LEFT
    assert not LEFT & set(problem.open_segments)
    assert "re-plan 1: 2 open segments" in next(line for line in flight.said() if "re-plan 1" in line)
    flight.run(lambda: bool(flight.state.replanning.records))
    assert replan_cycle.find_left_over_segments(flight.state) == {7}
    flight.finish()
    assert set(flight.state.coverage.inspected) == set(range(7))
    report = build_report(READY.context, flight.state, flight.now_s)
    assert report.left_over == (7,)
    [row] = report.replans
    assert (row.feasible, row.uncovered, row.gained, row.taken_up) == (True, (), 2, 1)
    assert (row.longest_route_s, row.carried_route_s, row.over_budget) == (100.4, 80.0, ())


def test_segments_taken_over_are_no_reason_for_a_re_plan_either() -> None:
    flight = lost()
    flight.run(lambda: replan_cycle.find_left_over_segments(flight.state) == {7})
    (name,) = [one.name for one in flight.state.mission_vehicles() if 12 in one.remaining_visits()]
    flight.run(lambda: flight.vehicle(name).remaining_visits() == (12,))
    flight.crafts[name].mute = True
    flight.run(lambda: flight.stage(name) is Stage.LOST)
    flight.finish()
    assert len(flight.solves()) == 1
    assert replan_cycle.find_left_over_segments(flight.state) == {6, 7}


def test_an_operator_may_ask_for_it() -> None:
    ready = fleet_of({"uav1": (0, 2, 4), "uav2": (6, 8, 10)}, pylons=9)
    flight = story(ready)
    flight.run(lambda: flight.inspecting("uav2", 3))
    flight.answer = takes_up
    flight.ask(Action.REPLAN)
    flight.run(lambda: bool(flight.solves()))
    [problem] = flight.solves()
    assert set(problem.left_over) == LEFT


def test_a_vehicle_with_a_new_battery_takes_it_over_after_confirmation() -> None:
    flight = story(ASKED)
    flight.run(lambda: flight.state.crew.offer is not None)
    assert flight.solves() == []
    flight.crafts["uav1"].battery_pct = 100.0
    flight.pass_s(3.0)
    flight.answer = takes_up
    record = flight.ask(Action.INCLUDE, "uav1", confirmed=True)
    assert record.text.endswith("re-planning with it")
    flight.run(lambda: bool(flight.solves()))
    [problem] = flight.solves()
    assert (problem.open_segments, set(problem.left_over)) == ((), LEFT)
    flight.run(lambda: 6 in flight.state.coverage.inspected)
    assert flight.given(Start).count(Start("uav1")) == 2


def test_no_offer_for_a_vehicle_that_has_used_its_budget() -> None:
    """Its battery has much left, but a route may not use it."""
    setups = {name: replace(setup, budget_pct=8.0) for name, setup in ASKED.context.vehicles.items()}
    flight = story(replace(ASKED, context=replace(ASKED.context, vehicles=setups)))
    flight.finish()
    assert not any("can take over" in line for line in flight.said())
    assert all(craft.battery_pct > 80.0 for craft in flight.crafts.values())


def test_a_landing_without_spare_budget_starts_no_re_plan() -> None:
    """Segment 3 is given up in the re-plan after the loss; nobody who lands then could fly it."""
    setups = {name: replace(setup, budget_pct=6.0) for name, setup in READY.context.vehicles.items()}
    flight = lost(leave_out(3), replace(READY, context=replace(READY.context, vehicles=setups)))
    flight.finish()
    assert len(flight.solves()) == 1


def test_a_log_holds_what_a_re_plan_gained(tmp_path: Path) -> None:
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    flight = lost()
    flight.finish()
    for now_s, event in flight.events:
        log.write(event, now_s)
    log.close()
    state = fleet_step.build_initial_state(dict(flight.boards))
    for now_s, event in read_events(tmp_path / "events.jsonl"):
        state, _ = fleet_step.step(flight.context, state, event, now_s)
    assert state == flight.state
    assert state.coverage.left_over == LEFT
    assert state.replanning.records[0].gain == TAKES_UP


def test_a_vehicle_with_too_little_budget_is_named() -> None:
    flight = lost(lambda problem: replace(share_out(problem), gain=replace(TAKES_UP, short=("uav3", "uav1"))))
    flight.run(lambda: bool(flight.state.replanning.records))
    assert "uav1, uav3: not enough battery for their whole missions" in flight.said(Level.WARNING)


def test_what_is_on_board_stays_where_nothing_is_better() -> None:
    def carried(problem: Solve) -> SolveEnded:
        routes = tuple(NewRoute(offer.vehicle, offer.tail) for offer in problem.survivors)
        return SolveEnded(problem.revision, routes, (2, 3), 0.1, "", Gain(0, 0.0, 0, 60.0, 60.0, ()))

    flight = lost(carried)
    flight.run(lambda: bool(flight.state.replanning.records))
    assert flight.uploads() == []
    assert (
        "re-plan 1 found in 0.10 s: no improvement over the missions on board; new missions for no vehicle"
        in flight.said()
    )
    assert "re-plan 1 ended; no mission has changed" in flight.said()
