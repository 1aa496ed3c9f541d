"""After an absence of the ground station: the requests to each vehicle, and how long the others wait."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from executor.core import fleet_step
from executor.core.interface.commands import Solve
from executor.core.interface.events import Found
from executor.core.interface.messages import (
    Heartbeat,
    Message,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
    Outgoing,
    SendCommand,
)
from executor.core.state.fleet_state import FleetState, NewMission, Replan
from executor.core.state.vehicle_state import Stage
from executor.runtime import vehicle_preflight
from missions import MissionItem, encode
from tests.executor.builders import fleet_of, with_facts
from tests.fakes.clock import LoopClock
from tests.fakes.link import CLEAN, Air, FakeLink

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

BAD = Air(loss=0.4)
READY = fleet_of({"uav1": (0, 2)})
BOARD = READY.boards["uav1"]
assert BOARD is not None
ITEMS = encode(BOARD.path, READY.context.vehicles["uav1"].dialect).items
MOST_S = (
    vehicle_preflight.READ_REAL_S
    + vehicle_preflight.READ_WAYPOINT_REAL_S * len(ITEMS)
    + vehicle_preflight.STREAMS_REAL_S
    + 1.5
)


class Speaker:
    """A vehicle that sends its HEARTBEAT and answers with the mission on board; nothing else."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        self.wake_s: float | None = 0.5
        self._items = items

    def hear(self, message: Outgoing, now_s: float) -> Sequence[Message]:
        match message:
            case MissionRequestList():
                return [MissionCount(len(self._items))]
            case MissionRequest(seq):
                return [MissionItemInt(self._items[seq])]
            case _:
                return ()

    def tick(self, now_s: float) -> Sequence[Message]:
        self.wake_s = now_s + 1.0
        return [Heartbeat(autopilot=3, custom_mode=3, armed=True, system_status=4)]


def known(stage: Stage) -> FleetState:
    state = fleet_step.build_initial_state(READY.boards)
    return state.put(with_facts(state.vehicles["uav1"], stage=stage))


async def asked(state: FleetState, air: Air) -> tuple[Found, float, FakeLink]:
    """Ask the one vehicle; returns what was found, how long it took, and the link."""
    clock = LoopClock()
    link = FakeLink(Speaker(ITEMS), clock, air, seed=5)
    [found] = (
        await vehicle_preflight.reconnect_vehicles(READY.context, lambda: state, {"uav1": link}, clock, 10.0)
    ).found
    link.close()
    return found, asyncio.get_running_loop().time(), link


@pytest.mark.parametrize("stage", [Stage.PILOT, Stage.RETURNING, Stage.LANDED])
async def test_the_mission_of_a_vehicle_that_does_not_fly_it_is_not_read(stage: Stage) -> None:
    found, _, link = await asked(known(stage), CLEAN)
    assert (found.heard, found.items) == (True, None)
    assert link.of_kind(MissionRequestList) == []


async def test_the_mission_of_a_vehicle_that_flies_it_is_read() -> None:
    found, took_s, _ = await asked(known(Stage.FLYING), CLEAN)
    assert found.items == len(ITEMS)
    assert [match.whole for match in found.matches] == [True]
    assert took_s < MOST_S


async def test_one_over_a_bad_link_keeps_the_others_waiting_only_so_long() -> None:
    found, took_s, _ = await asked(known(Stage.FLYING), BAD)
    assert (found.heard, found.items) == (True, None)
    assert took_s < MOST_S


async def test_half_a_new_mission_is_read_to_its_end_over_a_bad_link() -> None:
    assert BOARD is not None
    state = known(Stage.FLYING)
    new = NewMission(BOARD.path, (0, 2), fresh=False)
    plan = Replan(Solve(1, (), (), ""), 0.0, missions={"uav1": new}, pending=frozenset({"uav1"}))
    found, took_s, _ = await asked(with_facts(state, replan=plan), BAD)
    assert found.items == len(ITEMS)
    assert took_s > MOST_S


@pytest.mark.parametrize(("step", "interval_us"), [(0, 2e5), (2, 5e5), (3, 1e6)])
async def test_streams_stay_as_thin_as_they_were_decided_to_be_before_the_absence(
    step: int, interval_us: float
) -> None:
    state = known(Stage.FLYING)
    state = state.put(with_facts(state.vehicles["uav1"], stream_step=step))
    *_, link = await asked(state, CLEAN)
    asks = [one for _, one in link.of_kind(SendCommand) if isinstance(one, SendCommand) and one.params[0] == 33.0]
    assert asks
    assert {one.params[1] for one in asks} == {interval_us}
