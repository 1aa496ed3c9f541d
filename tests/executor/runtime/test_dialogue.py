"""How a machine is driven: deadlines on the flight's clock, one outcome, a last word when it is given up."""

from __future__ import annotations

import asyncio

import pytest

from executor.core.interface.messages import (
    CommandAck,
    Heartbeat,
    MissionAck,
    MissionCount,
    Outgoing,
    SendCommand,
)
from executor.protocols.machine import Accepted, TimedOut
from executor.protocols.mission_transfer import UploadDialogue
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime.dialogue import INBOX, run_dialogue
from missions import PX4, MissionItem
from tests.fakes.clock import LoopClock
from tests.fakes.link import FakeLink
from tests.fakes.vehicle import FakeAutopilot

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

ARM = CommandDialogue(SendCommand(400), "arm")


def link_of(speedup: float = 1.0) -> tuple[FakeLink, LoopClock]:
    clock = LoopClock(speedup)
    return FakeLink(FakeAutopilot(PX4), clock), clock


async def test_an_answer_ends_it() -> None:
    link, clock = link_of()
    assert (await run_dialogue(ARM, link, clock)).outcome == Accepted()
    link.close()


@pytest.mark.parametrize("speedup", [1.0, 10.0])
async def test_deadlines_run_on_the_flights_clock(speedup: float) -> None:
    link, clock = link_of(speedup)
    link.cut = True
    began_s, loop = clock.now_s(), asyncio.get_running_loop()
    began_real_s = loop.time()
    ended = await run_dialogue(ARM, link, clock)
    assert ended.outcome == TimedOut("arm: no acknowledgement")
    assert clock.now_s() - began_s == pytest.approx(5.0, abs=0.1)
    assert loop.time() - began_real_s == pytest.approx(5.0 / speedup, abs=0.1)
    assert [at_s for at_s, _ in link.sent] == pytest.approx([began_s + second for second in range(5)], abs=0.1)
    link.close()


async def test_deadlines_leave_a_busy_computer_half_a_second() -> None:
    link, clock = link_of(100.0)
    link.cut = True
    began_real_s = asyncio.get_running_loop().time()
    await run_dialogue(ARM, link, clock)
    assert asyncio.get_running_loop().time() - began_real_s == pytest.approx(0.5, abs=0.05)
    link.close()


async def test_no_messages_are_read_after_the_end() -> None:
    link, clock = link_of()
    await run_dialogue(ARM, link, clock)
    sent = len(link.sent)
    link.say(CommandAck(400, 4))
    async with asyncio.timeout(5):
        heard = asyncio.Event()
        link.listen(lambda _: heard.set())
        await heard.wait()
    assert len(link.sent) == sent
    link.close()


async def test_a_dialogue_that_is_given_up_tells_the_vehicle() -> None:
    link, clock = link_of()
    link.cut = True
    upload = asyncio.create_task(run_dialogue(UploadDialogue((MissionItem(0, 3, 16),), 6.0, frozenset()), link, clock))
    await link.spoken_to.wait()
    upload.cancel()
    with pytest.raises(asyncio.CancelledError):
        await upload
    said: list[Outgoing] = [message for _, message in link.sent]
    assert said == [MissionCount(1), MissionAck(15)]
    link.close()


async def test_a_flood_of_telemetry_does_not_hold_it_up() -> None:
    link, clock = link_of()
    link.vehicle.results[400] = [5, 0]  # type: ignore[attr-defined]
    dialogue = asyncio.create_task(run_dialogue(ARM, link, clock))
    await link.spoken_to.wait()
    for _ in range(3 * INBOX):
        link.say(Heartbeat(12, 0, armed=False, system_status=3))
    assert (await dialogue).outcome == Accepted()
    link.close()
