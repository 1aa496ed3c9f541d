"""Asks, seldom and beside the flight, what the loss of each vehicle would mean."""

from __future__ import annotations

import asyncio

from executor.core.interface.events import LossJudged
from executor.core.interface.ports import LossJudge
from executor.core.replanning import replan_cycle
from executor.runtime.flight_loop import Flight

REST_S = 5.0
"""Real seconds between two rounds, at least."""
SHARE = 8.0
"""Times as long as a round took the next one is waited for: the computer is there for the flight."""


async def keep_judging(flight: Flight, judge: LossJudge) -> None:
    """Judge every vehicle's loss, whenever a plan has come or a visit has ended, for ever."""
    loop = asyncio.get_running_loop()
    judged: tuple[object, ...] | None = None
    while True:
        began_s = loop.time()
        moment = replan_cycle.build_judgement_key(flight.state)
        if moment != judged and await _judge_all(flight, judge):
            judged = moment
        await asyncio.sleep(max(REST_S, SHARE * (loop.time() - began_s)))


async def _judge_all(flight: Flight, judge: LossJudge) -> bool:
    """Judge everybody once; returns whether that came to its end."""
    names = replan_cycle.select_vehicles_to_judge(flight.state)
    for name in names:
        revision = flight.state.replanning.revision
        if name not in replan_cycle.select_vehicles_to_judge(flight.state):
            return False
        problem = replan_cycle.build_loss_problem(flight.context, flight.state, name, flight.now_s())
        uncovered = problem if isinstance(problem, tuple) else await judge.judge(problem, flight.context.pricing)
        if uncovered is None or revision != flight.state.replanning.revision:
            return False
        flight.apply(LossJudged(name, revision, uncovered))
    return bool(names)
