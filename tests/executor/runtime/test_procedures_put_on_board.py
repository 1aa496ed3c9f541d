"""A mission put on board over bad links, on autopilots that behave as the real ones do."""

from __future__ import annotations

import asyncio

import pytest

from executor.core.interface.messages import (
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestList,
)
from executor.runtime import procedures
from executor.runtime.procedures import ProcedureResult
from missions import (
    ARDUPILOT,
    PX4,
    Dialect,
    Inspection,
    MissionItem,
    build_flight_path,
    encode,
    find_mission_differences,
    plan_flight_setup,
)
from tests.fakes.clock import LoopClock
from tests.fakes.link import CLEAN, Air, FakeLink
from tests.fakes.vehicle import FakeAutopilot
from tests.missions.builders import line_east

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
SETUP = plan_flight_setup(line_east(8), ["uav1", "uav2"], Inspection())
LOSSY = Air(loss=0.2, duplicate=0.2, delay_s=(0.01, 0.4))
"""A fifth is lost and a fifth comes twice, each way; a message may be overtaken by several that come after it."""


def mission(dialect: Dialect, visits: tuple[int, ...] = (0, 2, 4, 6)) -> tuple[MissionItem, ...]:
    return encode(build_flight_path(SETUP, "uav1", visits), dialect).items


class Board:
    """One vehicle, its link, and a mission to put on board."""

    def __init__(self, dialect: Dialect, air: Air = CLEAN, *, seed: int = 0, speedup: float = 1.0) -> None:
        self.clock = LoopClock(speedup)
        self.vehicle = FakeAutopilot(dialect, items=mission(dialect, (10, 12)))
        self.link = FakeLink(self.vehicle, self.clock, air, seed=seed)
        self.dialect = dialect
        self.items = mission(dialect)

    async def put(self, *, wanted: bool = True) -> ProcedureResult:
        done = await procedures.upload_and_verify(self.link, self.clock, self.dialect, self.items, lambda _: wanted)
        self.link.close()
        return done

    @property
    def missing(self) -> tuple[str, ...]:
        """How the mission in the vehicle's memory differs from the one that was sent."""
        return find_mission_differences(self.items, self.vehicle.missions.items, self.dialect)


@DIALECTS
async def test_a_clean_link(dialect: Dialect) -> None:
    board = Board(dialect)
    assert await board.put() == ProcedureResult(accepted=True)
    assert board.missing == ()
    assert len(board.link.of_kind(MissionItemInt)) == len(board.items), "every item is sent once"


@DIALECTS
@pytest.mark.parametrize("seed", [*range(25), 93])
async def test_a_fifth_lost_and_a_fifth_doubled_each_way(dialect: Dialect, seed: int) -> None:
    board = Board(dialect, LOSSY, seed=seed)
    assert await board.put() == ProcedureResult(accepted=True)
    assert board.missing == ()


@DIALECTS
async def test_a_link_slower_than_the_vehicle_asks_again(dialect: Dialect) -> None:
    board = Board(dialect, Air(delay_s=(0.45, 0.45)))
    assert (await board.put()).accepted
    assert board.missing == ()


@DIALECTS
async def test_an_old_acknowledgement_does_not_pass_for_the_present_one(dialect: Dialect) -> None:
    board = Board(dialect, Air(delay_s=(0.05, 0.05)))
    board.link.say(MissionAck(0))
    board.link.say(MissionAck(15))
    assert (await board.put()).accepted
    assert board.missing == ()
    assert len(board.link.of_kind(MissionCount)) == 1


@DIALECTS
async def test_a_dead_link_has_begun_nothing(dialect: Dialect) -> None:
    board = Board(dialect)
    board.link.cut = True
    done = await board.put()
    assert done == ProcedureResult(accepted=False, reason="the vehicle did not ask for the first item", mixed=False)


@DIALECTS
async def test_a_mission_that_is_not_wanted_any_more_is_not_begun_again(dialect: Dialect) -> None:
    board = Board(dialect)
    board.link.cut = True
    done = await board.put(wanted=False)
    assert (done.accepted, done.mixed, done.reason) == (False, False, "it has left its mission")
    once = Board(dialect)
    assert (await once.put(wanted=False)).accepted, "what is begun is brought to its end"


async def test_a_partial_upload_is_reported_at_once_and_at_the_end() -> None:
    asked: list[bool] = []
    board = Board(ARDUPILOT, Air(delay_s=(0.2, 0.2)))

    def wanted(mixed: bool) -> bool:
        asked.append(mixed)
        return False

    def cut(_: Message) -> None:
        board.link.cut |= len(board.link.of_kind(MissionItemInt)) >= 3

    board.link.listen(cut)
    done = await procedures.upload_and_verify(board.link, board.clock, board.dialect, board.items, wanted)
    board.link.close()
    assert asked == [True]
    assert (done.accepted, done.mixed, done.reason) == (False, True, "it has left its mission")


@DIALECTS
@pytest.mark.parametrize("sent", [0, 5], ids=["before", "during"])
async def test_a_computer_that_stands_still_faster_than_real_time(dialect: Dialect, sent: int) -> None:
    """At thirty times real time, two seconds without an answer are a minute of the flight, and nobody's fault."""
    board = Board(dialect, Air(delay_s=(0.01, 0.01)), speedup=30.0)
    upload = asyncio.ensure_future(board.put())
    while len(board.link.of_kind(MissionItemInt)) < sent:
        board.link.spoken_to.clear()
        await board.link.spoken_to.wait()
    board.link.cut = True
    await asyncio.sleep(2.0)
    board.link.cut = False
    assert (await upload).accepted
    assert board.missing == ()


@DIALECTS
async def test_a_refusal_is_believed_at_any_speed(dialect: Dialect) -> None:
    board = Board(dialect, speedup=30.0)
    board.vehicle.missions.refuses = 4
    assert not (await board.put()).accepted
    assert len(board.link.of_kind(MissionCount)) == procedures.UPLOAD_TRIES


@DIALECTS
async def test_a_refusal_has_begun_nothing(dialect: Dialect) -> None:
    board = Board(dialect)
    board.vehicle.missions.refuses = 4
    done = await board.put()
    assert done == ProcedureResult(accepted=False, reason="mission refused: no space", mixed=False)
    assert len(board.link.of_kind(MissionCount)) == procedures.UPLOAD_TRIES


@DIALECTS
async def test_a_vehicle_that_stops_asking_may_carry_a_mixture(dialect: Dialect) -> None:
    """ArduPilot replaces its mission item by item; PX4 keeps the old one until the new one is whole."""
    board = Board(dialect)
    before = list(board.vehicle.missions.items)
    board.vehicle.missions.stops_at = 5
    done = await board.put()
    assert not done.accepted
    assert done.mixed is (dialect is ARDUPILOT)
    assert (board.vehicle.missions.items == before) is (dialect is PX4)


@DIALECTS
async def test_what_reads_back_differently_is_not_flown(dialect: Dialect) -> None:
    board = Board(dialect)
    board.vehicle.missions.spoils = 3
    done = await board.put()
    assert not done.accepted
    assert done.reason.startswith("read-back differs: item 3 ")


@DIALECTS
async def test_a_lost_final_acknowledgement_is_no_failure(dialect: Dialect) -> None:
    """PX4 says it again for the last item; ArduPilot calls that an error, and the read-back decides."""
    board = Board(dialect)
    board.vehicle.missions.swallows_ack = True
    assert (await board.put()).accepted
    assert len(board.link.of_kind(MissionCount)) == 1
    assert board.clock.now_s() < 3.0


@DIALECTS
@pytest.mark.parametrize("dead_s", [1.0, 5.0, 8.0, 9.0])
async def test_a_transfer_that_another_station_left_is_outwaited(dialect: Dialect, dead_s: float) -> None:
    """ArduPilot frees it after eight seconds; PX4 after five in which nobody asked, not even in vain."""
    board, told = Board(dialect), list[str]()
    board.vehicle.missions.other_until_s = dead_s
    done = await procedures.upload_and_verify(board.link, board.clock, dialect, board.items, tell=told.append)
    board.link.close()
    assert done == ProcedureResult(accepted=True)
    assert board.missing == ()
    assert told == [
        f"busy with another mission transfer; uploading again for up to {procedures.busy_patience_s(dialect):g} s"
    ]


@DIALECTS
async def test_a_transfer_that_never_ends_is_reported_and_believed(dialect: Dialect) -> None:
    board = Board(dialect)
    board.vehicle.missions.other_until_s = float("inf")
    done = await board.put()
    why = "error, or busy with another transfer" if dialect is PX4 else "denied: another ground station is uploading"
    assert done == ProcedureResult(accepted=False, reason=f"mission refused: {why}", mixed=False)
    assert board.clock.now_s() == pytest.approx(procedures.busy_patience_s(dialect), abs=1.0)


async def test_the_next_upload_waits_until_a_transfer_that_was_left_is_over() -> None:
    """PX4 calls itself busy for five seconds after a download whose end it did not hear."""
    board = Board(PX4)
    board.vehicle.missions.hear(MissionRequestList(), 0.0)
    assert (await board.put()).accepted
    assert len(board.link.of_kind(MissionCount)) == 3
