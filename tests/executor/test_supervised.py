"""Background tasks of a flight: they are restarted when they fail, and the reason is reported once, in one line."""

from __future__ import annotations

import asyncio
import gc
import itertools
import threading
from pathlib import Path

import pytest

from executor.supervised import (
    AT_ONCE_S,
    FILE,
    STEADY_S,
    WAITS_S,
    call_safely,
    keep_going,
    run_beside,
    watch_internal_errors,
)

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]


def lived() -> float:
    return asyncio.get_running_loop().time()


async def test_what_dies_is_begun_again_with_longer_waits_and_said_once(tmp_path: Path) -> None:
    said, began = list[str](), list[float]()

    async def dies() -> None:
        began.append(round(lived(), 3))
        raise ValueError(f"number {len(began)}")

    with watch_internal_errors(said.append, tmp_path):
        async with run_beside("the page's stream", dies):
            await asyncio.sleep(sum(WAITS_S) + WAITS_S[-1] + 0.1)
    gaps = [round(after - before, 3) for before, after in itertools.pairwise(began)]
    assert gaps == [*WAITS_S, WAITS_S[-1]]
    assert said == ["internal error in the page's stream: ValueError: number 1"]
    trace = (tmp_path / FILE).read_text(encoding="utf-8")
    assert trace.count("Traceback") == 1
    assert "in dies" in trace


async def test_waits_are_reset_after_a_long_healthy_time(tmp_path: Path) -> None:
    began = list[float]()

    async def dies() -> None:
        began.append(lived())
        await asyncio.sleep(STEADY_S + 1.0)
        raise ValueError

    with watch_internal_errors(lambda _: None, tmp_path):
        async with run_beside("x", dies):
            await asyncio.sleep(3 * (STEADY_S + 1.0 + WAITS_S[0]) + 0.01)
    assert len(began) == 4


async def test_what_the_flight_stands_on_is_there_again_at_once(tmp_path: Path) -> None:
    began = list[float]()

    async def dies() -> None:
        began.append(lived())
        raise OSError("gone")

    with watch_internal_errors(lambda _: None, tmp_path):
        async with run_beside("the tick", dies, at_once=True):
            await asyncio.sleep(1.0)
    assert max(after - before for before, after in itertools.pairwise(began)) == pytest.approx(AT_ONCE_S)


async def test_what_ends_by_itself_is_not_begun_again() -> None:
    began = list[float]()

    async def ends() -> None:
        began.append(lived())

    await keep_going("x", ends)
    assert began == [0.0]


async def test_other_kinds_of_mistakes_are_reported_too(tmp_path: Path) -> None:
    said = list[str]()

    def first() -> None:
        raise ValueError("a")

    def second() -> None:
        raise KeyError("b")

    with watch_internal_errors(said.append, tmp_path):
        for work in (first, second, first):
            call_safely("a link", work)
    assert said == ["internal error in a link: ValueError: a", "internal error in a link: KeyError: 'b'"]


async def test_a_failed_background_task_leaves_a_line_and_no_traceback(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    said = list[str]()

    async def dies() -> None:
        raise ValueError("unseen")

    with watch_internal_errors(said.append, tmp_path):
        task = asyncio.create_task(dies(), name="keeping a plan")
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        del task
        gc.collect()
    assert said == ["internal error in keeping a plan: ValueError: unseen"]
    assert caplog.records == []
    assert "Traceback" not in capsys.readouterr().err


async def test_a_thread_that_dies_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = list[str]()

    def dies() -> None:
        raise ValueError("drawn wrongly")

    with watch_internal_errors(said.append, tmp_path):
        thread = threading.Thread(target=dies, name="drawing")
        thread.start()
        thread.join()
        await asyncio.sleep(0)
    assert said == ["internal error in the thread drawing: ValueError: drawn wrongly"]
    assert "Traceback" not in capsys.readouterr().err


async def test_a_terminal_or_a_disk_that_is_gone_does_not_matter(tmp_path: Path) -> None:
    def gone(_: str) -> None:
        raise OSError("input/output error")

    def dies() -> None:
        raise ValueError

    with watch_internal_errors(gone, tmp_path / "no such folder"):
        call_safely("x", dies)
