"""After the ground station was away: who answers, what everybody carries, and which item everybody flies to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from executor.core.context import Context
from executor.core.interface.events import Found, Resumed
from executor.core.interface.messages import Heartbeat, Message, MissionCurrent
from executor.core.interface.ports import Clock, Link
from executor.core.resume.reconciliation import compare_onboard_mission
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.errors import ConnectionFailed
from executor.runtime import procedures
from missions import Dialect, MissionItem

ONE_REAL_S = 5.0
"""How long one vehicle that should be heard is waited for; supervision of the others waits meanwhile."""
READ_REAL_S = 6.0
READ_TRIES = 3
"""How often a mission that may be half of a new one is read: over a bad link one reading may be given up."""
READ_WAYPOINT_REAL_S = 0.25
"""How long a mission is read at most, and more for each waypoint that it should have. Who cannot be read in that time
is taken at its word, as one that refuses; only half of a new mission is worth any time."""
STREAMS_REAL_S = 3.0
"""A vehicle keeps its streams; only one that was restarted needs to be asked again, and the link may be slow."""


@dataclass(slots=True)
class _Answer:
    """What one vehicle says of itself; filled in while it speaks."""

    heard: asyncio.Event = field(default_factory=asyncio.Event)
    seq: int | None = None
    items: tuple[MissionItem, ...] | None = None

    def update(self, message: Message) -> None:
        match message:
            case Heartbeat():
                self.heard.set()
            case MissionCurrent(seq):
                self.seq = seq


async def reconnect_vehicles(
    context: Context, state: Callable[[], FleetState], links: Mapping[str, Link], clock: Clock, patience_real_s: float
) -> Resumed:
    """Ask every vehicle what it carries.

    Args:
        context: Of the flight.
        state: The flight as it is known, asked at the end: it goes on while vehicles answer.
        links: To the vehicles.
        clock: The flight's.
        patience_real_s: How long to wait for the first answer of anybody.

    Raises:
        ConnectionFailed: nobody answers.
    """
    answers = {name: _Answer() for name in links}
    stops = [link.listen(answers[name].update) for name, link in links.items()]
    try:
        await _wait_for_first_answer(answers, patience_real_s)
        expected = [name for name, vehicle in state().vehicles.items() if _must_wait_for(state(), vehicle)]
        await _wait_for_expected(answers, expected)
        async with asyncio.TaskGroup() as tasks:
            for name, answer in answers.items():
                if answer.heard.is_set():
                    patience_s = _patience_real_s(state(), state().vehicles[name])
                    asks = _query_vehicle(links[name], clock, context.vehicles[name].dialect, answer, patience_s)
                    tasks.create_task(asks, name=name)
        found = [
            compare_onboard_mission(context, state(), name, answer.items, answer.seq)
            if answer.heard.is_set()
            else Found(name, heard=False, seq=None, items=None, matches=())
            for name, answer in answers.items()
        ]
    finally:
        for stop in stops:
            stop()
    return Resumed(tuple(found))


def _must_wait_for(state: FleetState, vehicle: VehicleState) -> bool:
    """Return whether a vehicle matters so much that the others wait for it."""
    return _is_pending(state, vehicle) or vehicle.stage in {Stage.STARTING, Stage.FLYING, Stage.RETURNING}


def _is_pending(state: FleetState, vehicle: VehicleState) -> bool:
    return state.replanning.replan is not None and vehicle.name in state.replanning.replan.pending


def _patience_real_s(state: FleetState, vehicle: VehicleState) -> float | None:
    """Return how long a vehicle's mission is read: not at all unless it flies by it, to the end if half may be there.

    Over a bad link reading takes long, and nobody watches the others meanwhile.
    """
    if _is_pending(state, vehicle):
        return None
    if vehicle.stage not in {Stage.STARTING, Stage.FLYING} or vehicle.assignment.board is None:
        return 0.0
    return READ_REAL_S + READ_WAYPOINT_REAL_S * len(vehicle.assignment.board.path.waypoints)


async def _wait_for_first_answer(answers: Mapping[str, _Answer], patience_real_s: float) -> None:
    waits = [asyncio.ensure_future(answer.heard.wait()) for answer in answers.values()]
    try:
        done, _ = await asyncio.wait(waits, timeout=patience_real_s, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for one in waits:
            one.cancel()
    if not done:
        raise ConnectionFailed(
            f"no vehicle answers within {patience_real_s:g} s; is the radio plugged in, and is this the computer that "
            "they send to?"
        )


async def _wait_for_expected(answers: Mapping[str, _Answer], expected: list[str]) -> None:
    with suppress(TimeoutError):
        async with asyncio.timeout(ONE_REAL_S):
            for name in expected:
                await answers[name].heard.wait()


async def _query_vehicle(link: Link, clock: Clock, dialect: Dialect, answer: _Answer, patience_s: float | None) -> None:
    if patience_s != 0.0:
        with suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                for _ in range(1 if patience_s is not None else READ_TRIES):
                    answer.items = await procedures.read_mission(link, clock)
                    if answer.items is not None:
                        break
    with suppress(TimeoutError):
        async with asyncio.timeout(STREAMS_REAL_S):
            await procedures.request_streams(link, clock, dialect)
