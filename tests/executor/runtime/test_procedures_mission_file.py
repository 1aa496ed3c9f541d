"""A new mission in flight: ArduPilot is given its last part as a file, where it takes one."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import (
    FileRequest,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
)
from executor.protocols.turns import Rank
from executor.runtime import procedures
from executor.runtime.procedures import ProcedureResult, UploadNeed
from missions import ARDUPILOT, PX4, Dialect, MissionItem
from tests.executor.runtime.test_procedures_put_on_board import LOSSY, Board, mission
from tests.fakes.link import CLEAN, Air

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))


async def fly(dialect: Dialect, air: Air = CLEAN, *, files: bool = True, seed: int = 0) -> Board:
    """Return a vehicle that flies a short mission, whose longer one begins as that does."""
    board = Board(dialect, air, seed=seed)
    board.vehicle.missions.items = list(mission(dialect, (0, 2)))
    board.vehicle.missions.file.there_is_one = files
    return board


async def put(board: Board, *, alike: int = 4, rest: tuple[MissionItem, ...] = ()) -> ProcedureResult:
    need = UploadNeed(Rank.IN_FLIGHT, 10.0, alike, rest)
    done = await procedures.upload_and_verify(board.link, board.clock, board.dialect, board.items, need=need)
    board.link.close()
    return done


@DIALECTS
async def test_the_new_part_alone_is_sent_and_its_checksum_proves_it(dialect: Dialect) -> None:
    board = await fly(dialect)
    assert await put(board) == ProcedureResult(accepted=True)
    assert board.missing == ()
    is_file = bool(board.link.of_kind(FileRequest))
    assert is_file is (dialect is ARDUPILOT)
    if is_file:
        assert [one.seq for _, one in board.link.sent if isinstance(one, MissionRequest)] == [0], "its home alone"
        assert not board.link.of_kind(MissionItemInt)


@pytest.mark.parametrize("seed", range(10))
async def test_over_a_bad_link(seed: int) -> None:
    board = await fly(ARDUPILOT, LOSSY, seed=seed)
    done = await put(board)
    assert (done.accepted, done.mixed, board.missing) == (True, False, ())


FAR = Air(delay_s=(0.4, 0.4))


@pytest.mark.parametrize(("files", "read"), [(True, [0]), (False, [0, *range(25)])])
async def test_over_a_slow_link_a_checksum_proves_what_went_item_by_item(files: bool, read: list[int]) -> None:
    """A first mission behind a radio took as long to be read back as to be sent."""
    board = await fly(ARDUPILOT, FAR, files=files)
    assert (await put(board, alike=0)).accepted
    assert board.missing == ()
    asked = [one.seq for _, one in board.link.sent if isinstance(one, MissionRequest)]
    assert asked == read[: 1 + len(board.items)]
    assert len(board.link.of_kind(MissionRequestList)) == (not files)


async def test_what_the_checksum_does_not_prove_is_read_back() -> None:
    board = await fly(ARDUPILOT, FAR)
    board.vehicle.missions.spoils = 6
    assert (await put(board, alike=0)).reason.startswith("read-back differs: item 6")


async def test_a_firmware_without_mission_files_gets_its_items() -> None:
    board = await fly(ARDUPILOT, files=False)
    assert (await put(board)).accepted
    assert board.missing == ()
    assert len(board.link.of_kind(FileRequest)) <= 4
    assert len(board.link.of_kind(MissionItemInt)) == len(board.items)


@pytest.mark.parametrize(("air", "seed"), [(CLEAN, 0), *((LOSSY, seed) for seed in range(10))])
async def test_a_list_that_becomes_shorter_is_cut_off_behind_the_new_part(air: Air, seed: int) -> None:
    """The upload that cuts it off is ended by an item that no autopilot takes."""
    board = await fly(ARDUPILOT, air, seed=seed)
    before = mission(ARDUPILOT, (0, 2, 4, 6, 8, 10))
    board.vehicle.missions.items = [board.vehicle.missions._stored(one) for one in before]
    done = await put(board, rest=before[len(board.items) :])
    assert (done.accepted, done.mixed, board.missing) == (True, False, ())
    assert len(board.vehicle.missions.items) == len(board.items)
    if air is CLEAN:
        sent = [one for _, one in board.link.sent if isinstance(one, MissionCount | MissionItemInt)]
        assert sent == [MissionCount(len(board.items)), MissionItemInt(MissionItem(0, 0, 0))]


async def test_nothing_is_cut_off_behind_a_part_that_was_not_taken() -> None:
    """What the checksum does not prove is read: the old mission without its landing is not flown."""
    board = await fly(ARDUPILOT)
    before = mission(ARDUPILOT, (0, 2, 4, 6, 8, 10))
    board.vehicle.missions.items = [board.vehicle.missions._stored(one) for one in before]
    board.vehicle.missions.spoils = 6
    assert not (await put(board, rest=before[len(board.items) :])).accepted
    assert not board.link.of_kind(MissionCount)
    assert len(board.vehicle.missions.items) == len(before)


async def test_what_is_on_board_by_a_file_and_not_right_is_uploaded_again() -> None:
    board = await fly(ARDUPILOT)
    board.vehicle.missions.spoils = 6
    done = await put(board)
    assert not done.accepted
    assert done.reason.startswith("read-back differs: item 6")


async def test_a_link_that_is_lost_leaves_no_mixture() -> None:
    board = await fly(ARDUPILOT)
    before = tuple(board.vehicle.missions.items)

    class Silent:
        """From the third question on the vehicle is out of reach."""

        def __init__(self) -> None:
            self.heard = 0
            self.send = board.link.send

        def __call__(self, message: object) -> None:
            self.heard += 1
            board.link.cut = self.heard > 3
            self.send(message)  # type: ignore[arg-type]

    board.link.send = Silent()  # type: ignore[method-assign]
    done = await put(board)
    assert (done.accepted, done.mixed) == (False, False)
    assert tuple(board.vehicle.missions.items) == before
