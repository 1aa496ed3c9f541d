"""A fence and rally points put on board over bad links: the mission is another list, and nothing is half there."""

from __future__ import annotations

import asyncio

import pytest

from executor.core.interface.codes import Ending
from executor.core.interface.messages import MissionCount, StatusText
from executor.runtime import procedures
from executor.runtime.procedures import ProcedureResult
from missions import ARDUPILOT, PX4, Dialect, LocalFrame, MissionKind
from missions.fences import build_fence, build_fence_items, build_rally_items, find_list_differences
from tests.fakes.clock import LoopClock
from tests.fakes.link import CLEAN, Air, FakeLink
from tests.fakes.vehicle import DENIED, FakeAutopilot

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
LOSSY = Air(loss=0.2, duplicate=0.2, delay_s=(0.01, 0.4))
FRAME = LocalFrame(49.6, 15.6, 460.0)
OLD = build_fence_items(build_fence([(0.0, 0.0)], 20.0, 60.0), FRAME)
NEW = build_fence_items(build_fence([(0.0, 0.0), (200.0, 40.0), (90.0, 300.0)], 20.0, 60.0), FRAME)


class Board:
    """One vehicle with a fence on board, and its link."""

    def __init__(self, dialect: Dialect, air: Air = CLEAN, *, seed: int = 0) -> None:
        self.clock = LoopClock()
        self.vehicle = FakeAutopilot(dialect)
        self.dialect = dialect
        self.fence = self.vehicle.beside[MissionKind.FENCE]
        self.fence.items = list(OLD)
        self.link = FakeLink(self.vehicle, self.clock, air, seed=seed)

    async def put(self, *, wanted: bool = True) -> ProcedureResult:
        done = await procedures.upload_and_verify_fence(self.link, self.clock, self.dialect, NEW, lambda _: wanted)
        self.link.close()
        return done


@DIALECTS
async def test_the_fence_alone_is_replaced(dialect: Dialect) -> None:
    board = Board(dialect)
    assert await board.put() == ProcedureResult(accepted=True)
    assert find_list_differences(NEW, board.fence.items) == ()
    assert board.vehicle.missions.items == []
    assert board.vehicle.beside[MissionKind.RALLY].items == []


@DIALECTS
@pytest.mark.parametrize("seed", range(25))
async def test_a_fifth_lost_and_a_fifth_doubled_each_way(dialect: Dialect, seed: int) -> None:
    board = Board(dialect, LOSSY, seed=seed)
    assert await board.put() == ProcedureResult(accepted=True)
    assert find_list_differences(NEW, board.fence.items) == ()


@DIALECTS
async def test_what_is_refused_leaves_the_old_fence_whole(dialect: Dialect) -> None:
    board = Board(dialect)
    board.fence.refuses = DENIED
    done = await board.put()
    assert (done.accepted, done.mixed, done.code) == (False, False, Ending.OTHER_STATION)
    assert done.reason.startswith("fence refused: denied")
    assert tuple(board.fence.items) == OLD


@DIALECTS
async def test_an_interrupted_fence_upload_keeps_the_whole_old_fence(dialect: Dialect) -> None:
    board = Board(dialect)
    board.fence.stops_at = 4
    done = await board.put()
    assert (done.accepted, done.mixed) == (False, False)
    assert tuple(board.fence.items) == OLD


@DIALECTS
async def test_no_command_to_a_vehicle_with_its_pilot(dialect: Dialect) -> None:
    board = Board(dialect)
    done = await board.put(wanted=False)
    assert (done.accepted, done.code) == (False, Ending.LEFT_MISSION)
    assert board.link.of_kind(MissionCount) == []
    assert tuple(board.fence.items) == OLD


@DIALECTS
async def test_a_fence_that_was_broken_off_is_the_old_one(dialect: Dialect) -> None:
    board = Board(dialect, Air(delay_s=(0.2, 0.2)))
    putting = asyncio.ensure_future(board.put())
    await asyncio.sleep(0.5)
    putting.cancel()
    await asyncio.gather(putting, return_exceptions=True)
    await asyncio.sleep(30.0)
    board.link.close()
    assert tuple(board.fence.items) == OLD


@pytest.mark.parametrize(("dialect", "taken"), [(PX4, False), (ARDUPILOT, True)], ids=["px4", "ardupilot"])
async def test_a_fence_that_px4_drops_with_a_text_is_not_on_board(dialect: Dialect, taken: bool) -> None:
    board = Board(dialect)
    putting = asyncio.ensure_future(board.put())
    await asyncio.sleep(0.5)
    board.link.say(StatusText(2, "Geofence invalid, doesn't contain current vehicle position"))
    done = await putting
    assert done.accepted is taken
    assert (done.code is Ending.FENCE_DROPPED) is not taken


@DIALECTS
async def test_a_list_of_nothing_clears_what_is_there(dialect: Dialect) -> None:
    board = Board(dialect)
    rally = board.vehicle.beside[MissionKind.RALLY]
    rally.items = list(build_rally_items([(3.0, 4.0)], FRAME))
    board.fence.items = []
    assert (await procedures.upload_and_verify(board.link, board.clock, dialect, (), kind=MissionKind.RALLY)).accepted
    assert await procedures.read_list(board.link, board.clock, MissionKind.RALLY) == ()
    board.link.close()
