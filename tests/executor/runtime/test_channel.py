"""Vehicles behind one radio: transfers take turns, one HEARTBEAT for all, no repeats on a full radio."""

from __future__ import annotations

import asyncio
from itertools import pairwise

import pytest

from executor.core.interface.messages import (
    Message,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
    Outgoing,
    Radio,
    SendCommand,
    SendFiller,
    SendHeartbeat,
    Traffic,
)
from executor.protocols import vehicle_commands
from executor.protocols.machine import RoundTrip
from executor.protocols.turns import STALLED_S, Rank
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime import procedures
from executor.runtime.channel import channel_of
from executor.runtime.dialogue import run_dialogue
from executor.runtime.flight_loop import send_heartbeats
from executor.runtime.procedures import UploadNeed
from missions import ARDUPILOT, PX4, Dialect
from tests.executor.runtime.test_procedures_put_on_board import Board
from tests.fakes.link import Air

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
SLOW = Air(delay_s=(0.2, 0.2))
FULL = Radio(200, 200, 50, 50, 3)


def behind_one_radio(count: int, dialect: Dialect = ARDUPILOT, air: Air = SLOW) -> list[Board]:
    boards = [Board(dialect, air) for _ in range(count)]
    for board in boards:
        board.link.radio = "the radio"
    return boards


def items_s(board: Board) -> tuple[float, float]:
    """Return when the first and the last item of its upload went out."""
    times_s = [at_s for at_s, _ in board.link.of_kind(MissionItemInt)]
    return times_s[0], times_s[-1]


async def put(board: Board, needed_s: float) -> bool:
    need = UploadNeed(Rank.IN_FLIGHT, needed_s)
    done = await procedures.upload_and_verify(board.link, board.clock, board.dialect, board.items, need=need)
    board.link.close()
    return done.accepted


@DIALECTS
async def test_one_upload_at_a_time_and_the_most_urgent_first(dialect: Dialect) -> None:
    boards = behind_one_radio(3, dialect)
    assert all(
        await asyncio.gather(*(put(one, needed_s) for one, needed_s in zip(boards, (5.0, 90.0, 30.0), strict=True)))
    )
    assert all(board.missing == () for board in boards)
    (_, first), (second, last), (third, fourth) = map(items_s, boards)
    assert first < third < fourth < second < last, "the first one had begun when the others came"


@DIALECTS
async def test_behind_a_radio_with_long_round_trips_two_uploads_run_at_once(dialect: Dialect) -> None:
    boards = behind_one_radio(3, dialect, Air(delay_s=(0.4, 0.4)))
    channel_of(boards[0].link).round_trip = RoundTrip(mean_s=0.8)
    assert all(await asyncio.gather(*(put(one, 5.0 + number) for number, one in enumerate(boards))))
    assert all(board.missing == () for board in boards)
    (first_s, _), (second_s, _), (third_s, _) = map(items_s, boards)
    assert first_s == pytest.approx(second_s)
    assert second_s < third_s


async def test_without_a_radio_they_go_side_by_side() -> None:
    boards = [Board(ARDUPILOT, SLOW) for _ in range(2)]
    assert all(await asyncio.gather(*(put(one, 5.0) for one in boards)))
    (begun_s, ended_s), other_s = map(items_s, boards)
    assert other_s == pytest.approx((begun_s, ended_s))
    assert ended_s - begun_s < 0.2 * 0.4 * len(boards[0].items), "and not one round trip for each item"


async def test_a_vehicle_that_does_not_answer_delays_no_other() -> None:
    mute, whole = behind_one_radio(2)
    mute.link.cut = True
    first = asyncio.ensure_future(put(mute, 1.0))
    await asyncio.sleep(0.1)
    assert await put(whole, 90.0)
    begun_s, _ = items_s(whole)
    assert STALLED_S <= begun_s <= STALLED_S + 1.0
    first.cancel()


async def test_a_transfer_that_is_given_up_frees_the_radio() -> None:
    one, other = behind_one_radio(2)
    first = asyncio.ensure_future(put(one, 1.0))
    await asyncio.sleep(0.7)
    first.cancel()
    assert await put(other, 90.0)
    assert items_s(other)[0] < 1.5
    assert not channel_of(other.link).under_way
    assert not channel_of(other.link).waiting


async def test_an_upload_that_is_not_wanted_any_more_when_its_turn_comes_is_not_begun() -> None:
    one, other = behind_one_radio(2)
    first = asyncio.ensure_future(put(one, 1.0))
    await asyncio.sleep(0.1)
    assert (await other.put(wanted=False)).reason == "it has left its mission"
    assert await first
    assert other.link.of_kind(MissionItemInt) == []


async def test_an_order_waits_for_no_transfer() -> None:
    one, other = behind_one_radio(2)
    upload = asyncio.ensure_future(put(one, 1.0))
    await asyncio.sleep(0.5)
    other.link.cut = True
    order = asyncio.ensure_future(run_dialogue(CommandDialogue(vehicle_commands.arm(), "arm"), other.link, other.clock))
    await asyncio.sleep(0.01)
    assert len(other.link.of_kind(SendCommand)) == 1
    order.cancel()
    assert await upload


async def test_what_is_known_of_the_round_trip_is_known_to_the_next_dialogue() -> None:
    one, other = behind_one_radio(2, air=Air(delay_s=(0.6, 0.6)))
    assert await put(one, 1.0)
    assert channel_of(other.link).round_trip.mean_s == pytest.approx(1.2, abs=0.2)
    other.link.cut = True
    ended = asyncio.ensure_future(run_dialogue(CommandDialogue(vehicle_commands.arm(), "arm"), other.link, other.clock))
    begun_s = other.clock.now_s()
    await asyncio.sleep(1.25)
    assert len(other.link.of_kind(SendCommand)) == 1, "an answer cannot have come yet"
    assert other.clock.now_s() - begun_s > vehicle_commands.PERIOD_S
    ended.cancel()


async def test_nothing_is_asked_again_while_the_radio_says_that_it_is_full() -> None:
    board = Board(PX4)
    board.link.cut = True
    reading = asyncio.ensure_future(procedures.read_list(board.link, board.clock))

    async def report() -> None:
        while board.clock.now_s() < 5.0:
            board.link._reached_us(FULL)
            await asyncio.sleep(1.0)

    await report()
    assert len(board.link.of_kind(MissionRequestList)) == 1
    await asyncio.sleep(4.0)
    assert len(board.link.of_kind(MissionRequestList)) > 1, "its last report is old"
    reading.cancel()


@DIALECTS
async def test_over_a_slow_link_only_what_nothing_proves_is_read(dialect: Dialect) -> None:
    board = Board(dialect, SLOW)
    need = UploadNeed(Rank.IN_FLIGHT, 10.0, alike=6)
    done = await procedures.upload_and_verify(board.link, board.clock, board.dialect, board.items, need=need)
    board.link.close()
    assert done.accepted
    asked = [message.seq for _, message in board.link.sent if isinstance(message, MissionRequest)]
    with_checksum = [0]  # its home, which is its own; this firmware has no mission files
    assert asked == ([] if dialect is PX4 else with_checksum + list(range(6, len(board.items))))


async def test_behind_one_radio_our_heartbeat_goes_out_once_for_all_about_twice_a_second() -> None:
    boards = [*behind_one_radio(3), Board(ARDUPILOT)]
    links = {f"uav{number}": board.link for number, board in enumerate(boards)}
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(60.5):
            await send_heartbeats(links, boards[0].clock)
    for link in links.values():
        link.close()
    beats = sorted(at_s for link in list(links.values())[:3] for at_s, _ in link.of_kind(SendHeartbeat))
    assert 119 <= len(beats) <= 123
    assert len(links["uav3"].of_kind(SendHeartbeat)) == len(beats)
    gaps = [after - before for before, after in pairwise(beats)]
    assert 0.25 < min(gaps) < max(gaps) < 0.75
    assert len({round(at_s % 1.0, 2) for at_s in beats}) > 20, "it keeps no rhythm with a vehicle's"


async def test_over_a_radio_that_loses_frames_heartbeats_go_out_twice_and_fillers_whenever_nothing_else_does() -> None:
    boards = behind_one_radio(2)
    links = {f"uav{number}": board.link for number, board in enumerate(boards)}

    def sent(kind: type[Outgoing]) -> int:
        return sum(len(board.link.of_kind(kind)) for board in boards)

    beat = asyncio.ensure_future(send_heartbeats(links, boards[0].clock))
    await asyncio.sleep(0.01)
    free = Radio(200, 200, 50, 50, 95)
    rows: list[tuple[list[Message], tuple[int, int], int]] = [
        ([Traffic(80, 20)], (0, 0), 1), ([free], (28, 45), 2), ([FULL], (0, 3), 2),
        ([free, *[Traffic(99, 1)] * 16], (0, 3), 1),
    ]  # fmt: skip
    for told, fillers, at_once in rows:
        for message in told:
            boards[0].link.say(message)
        before, beats = sent(SendFiller), sent(SendHeartbeat)
        await asyncio.sleep(5.0)
        assert fillers[0] <= sent(SendFiller) - before <= fillers[1], told
        assert 9 * at_once <= sent(SendHeartbeat) - beats <= 11 * at_once, "as often as ever"
    beat.cancel()


async def test_no_filler_goes_between_the_items_of_a_transfer_unless_it_stalls() -> None:
    boards = behind_one_radio(2)
    links = {f"uav{number}": board.link for number, board in enumerate(boards)}

    def sent() -> int:
        return sum(len(board.link.of_kind(SendFiller)) for board in boards)

    beat = asyncio.ensure_future(send_heartbeats(links, boards[0].clock))
    await asyncio.sleep(0.01)
    channel = channel_of(boards[0].link)
    async with channel.take_turn(Rank.IN_FLIGHT):
        for message in (Traffic(80, 20), Radio(200, 200, 50, 50, 95)):
            boards[0].link.say(message)
        for _ in range(10):
            channel.note_sent()
            await asyncio.sleep(0.5)
        assert sent() == 0
        await asyncio.sleep(3.0)
        assert sent() > 10
    beat.cancel()


async def test_a_round_trip_is_handed_on_once() -> None:
    one, *_ = behind_one_radio(1)
    assert channel_of(one.link).take_round_trip_s() is None
    assert await put(one, 1.0)
    assert channel_of(one.link).take_round_trip_s() == pytest.approx(0.4, abs=0.1)
    assert channel_of(one.link).take_round_trip_s() is None
