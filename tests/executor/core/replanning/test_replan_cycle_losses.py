"""The preview of a loss: the problem, its time and its vehicle."""

from __future__ import annotations

import asyncio
from types import MappingProxyType

import pytest

from executor.core.fleet_view import build_fleet_view
from executor.core.interface.commands import Solve
from executor.core.interface.events import LossJudged
from executor.core.interface.intents import Action
from executor.core.replanning import replan_cycle
from executor.runtime.flight_loop import keep_judging
from missions import Pricing
from tests.executor.builders import THREE, with_facts
from tests.executor.core.stories import under_way
from tests.fakes.flight import Story


def test_the_question_is_the_re_plan_that_would_follow() -> None:
    flight = under_way()
    assert replan_cycle.select_vehicles_to_judge(flight.state) == tuple(THREE)
    problem = replan_cycle.build_loss_problem(flight.context, flight.state, "uav2", flight.now_s)
    assert isinstance(problem, Solve)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.solves()))
    real = flight.solves()[0]
    assert (
        {offer.vehicle for offer in problem.survivors}
        == {offer.vehicle for offer in real.survivors}
        == {"uav1", "uav3"}
    )
    assert {2, 3} <= set(problem.open_segments)
    assert set(real.open_segments) <= set(problem.open_segments)


def test_a_vehicle_on_hold_is_assumed_to_continue() -> None:
    flight = under_way()
    flight.ask(Action.HOLD, "uav3")
    problem = replan_cycle.build_loss_problem(flight.context, flight.state, "uav2", flight.now_s)
    assert isinstance(problem, Solve)
    assert {offer.vehicle for offer in problem.survivors} == {"uav1", "uav3"}


def test_without_another_vehicle_everything_is_left_over() -> None:
    flight = under_way()
    for name in ("uav1", "uav3"):
        flight.crafts[name].mute = True
        state = flight.state.put(with_facts(flight.vehicle(name), excluded=True))
        flight.state = state
    assert replan_cycle.build_loss_problem(flight.context, flight.state, "uav2", flight.now_s) == (2, 3)


def test_while_the_plan_changes_no_preview_is_requested() -> None:
    flight = under_way()
    before = replan_cycle.build_judgement_key(flight.state)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: flight.state.replanning.replan is not None)
    assert replan_cycle.select_vehicles_to_judge(flight.state) == ()
    assert replan_cycle.build_judgement_key(flight.state) != before


class Beside:
    """As much of the flight as the judging sees, and a judge."""

    def __init__(self, story: Story, answer: tuple[int, ...] | None) -> None:
        self.story, self.answer = story, answer
        self.context_now = story.context
        self.asked: list[Solve] = []

    @property
    def state(self) -> object:
        return self.story.state

    def now_s(self) -> float:
        return self.story.now_s

    def apply(self, event: LossJudged) -> None:
        self.story.happen(event)

    async def judge(self, problem: Solve, pricing: Pricing) -> tuple[int, ...] | None:
        assert pricing is self.context_now.pricing
        self.asked.append(problem)
        await asyncio.sleep(0.5)
        return self.answer


async def judged(beside: Beside, seconds: float) -> None:
    task = asyncio.create_task(keep_judging(beside, beside.judge))  # type: ignore[arg-type]
    await asyncio.sleep(seconds)
    task.cancel()


@pytest.mark.asyncio
@pytest.mark.looptime
async def test_every_loss_is_judged_once_for_each_moment() -> None:
    beside = Beside(under_way(), (3,))
    await judged(beside, 100.0)
    assert len(beside.asked) == 3
    view = build_fleet_view(beside.context_now, beside.story.state, beside.story.now_s)
    assert [vehicle.loss is not None and vehicle.loss.uncovered for vehicle in view.vehicles] == [(3,)] * 3
    assert not any(vehicle.loss.inside_window for vehicle in view.vehicles if vehicle.loss is not None)
    beside.story.state = with_facts(beside.story.state, inspected=MappingProxyType({9: "uav1"}))
    await judged(beside, 100.0)
    assert len(beside.asked) == 6


@pytest.mark.asyncio
@pytest.mark.looptime
async def test_a_judgement_that_gave_way_is_asked_again_later() -> None:
    beside = Beside(under_way(), None)
    await judged(beside, 60.0)
    assert 5 <= len(beside.asked) <= 12
    assert beside.story.state.replanning.outlook == {}


def test_a_judgement_of_an_older_plan_is_not_kept() -> None:
    flight = under_way()
    flight.happen(LossJudged("uav1", flight.state.replanning.revision + 1, ()))
    assert flight.state.replanning.outlook == {}
