"""After the ground station was away: who is asked what, and how long the others wait for it."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from executor.core import fleet
from executor.core.messages import Heartbeat, Message, Outgoing, SendMissionRequestList
from executor.core.vehicle import Stage
from executor.runtime import reunion
from tests.executor.builders import fleet_of, with_facts
from tests.fakes.clock import LoopClock
from tests.fakes.link import FakeLink

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]


class Mumbler:
    """A vehicle that sends its HEARTBEAT and answers nothing."""

    def __init__(self) -> None:
        self.wake_s: float | None = 0.5

    def hear(self, message: Outgoing, now_s: float) -> Sequence[Message]:
        return ()

    def tick(self, now_s: float) -> Sequence[Message]:
        self.wake_s = now_s + 1.0
        return [Heartbeat(autopilot=3, custom_mode=3, armed=True, system_status=4)]


@pytest.mark.parametrize(
    ("stage", "reads"),
    [(Stage.PILOT, False), (Stage.RETURNING, False), (Stage.LANDED, False), (Stage.FLYING, True)],
)
async def test_the_others_wait_only_for_what_somebody_carries_who_flies_by_it(stage: Stage, reads: bool) -> None:
    ready, clock = fleet_of({"uav1": (0, 2)}), LoopClock()
    state = fleet.initial(ready.boards)
    state = state.put(with_facts(state.vehicles["uav1"], stage=stage))
    link = FakeLink(Mumbler(), clock)
    began_s = asyncio.get_running_loop().time()
    resumed = await reunion.asked(ready.context, lambda: state, {"uav1": link}, clock, 10.0)
    link.close()
    assert [found.heard for found in resumed.found] == [True]
    assert bool(link.of_kind(SendMissionRequestList)) is reads
    took_s = asyncio.get_running_loop().time() - began_s
    assert (took_s > 7.0) is reads, "a stream is asked for in three seconds at most"
