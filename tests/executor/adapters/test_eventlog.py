"""The event log: what is written comes back, and applied again it gives the same commands."""

from __future__ import annotations

import asyncio
import dataclasses
import json
import os
import threading
import typing
from enum import Enum
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executor.adapters import eventlog
from executor.adapters.eventlog import FORMAT, EventLog, from_plain, read_events, to_plain
from executor.core import fleet_step
from executor.core.interface.commands import Command
from executor.core.interface.events import Event, Heard, NewRoute, SolveEnded, Tick, UploadEnded
from executor.core.interface.messages import FlightMessage, Heartbeat
from executor.errors import LogError
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import under_way
from tests.fakes.disk import room_for
from tests.fakes.flight import Story
from tests.patience import PATIENCE_S

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def built(kind: type) -> st.SearchStrategy[typing.Any]:
    """Return any value of a dataclass, its numbers finite."""
    hints = typing.get_type_hints(kind)
    return st.builds(kind, **{field.name: of(hints[field.name]) for field in dataclasses.fields(kind)})


def of(hint: typing.Any) -> st.SearchStrategy[typing.Any]:
    """Return any value of an annotation that events use."""
    simple: dict[typing.Any, st.SearchStrategy[typing.Any]] = {
        float: FINITE, int: st.integers(-(2**53), 2**53), bool: st.booleans(), str: st.text(), type(None): st.none(),
    }  # fmt: skip
    if hint in simple:
        return simple[hint]
    if isinstance(hint, type) and issubclass(hint, Enum):
        return st.sampled_from(list(hint))
    if dataclasses.is_dataclass(hint):
        return built(typing.cast("type", hint))
    if typing.get_origin(hint) is tuple:
        return st.lists(of(typing.get_args(hint)[0]), max_size=4).map(tuple)
    return st.one_of([of(part) for part in typing.get_args(hint)])


EVENTS = typing.get_args(Event)
MESSAGES = typing.get_args(FlightMessage)


def written(path: Path, events: list[tuple[float, Event]]) -> Path:
    """Write a log."""
    log = EventLog(path, began_unix_s=1.79e9, speedup=2.0)
    for now_s, event in events:
        log.write(event, now_s)
    log.close()
    assert log.lost == 0
    return path


@pytest.mark.parametrize("kind", EVENTS, ids=lambda kind: str(kind.__name__))
@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
def test_every_event_comes_back(kind: type, data: st.DataObject, tmp_path: Path) -> None:
    events = data.draw(st.lists(st.tuples(FINITE, built(kind)), min_size=1, max_size=3))
    path = tmp_path / "events.jsonl"
    path.unlink(missing_ok=True)
    assert list(read_events(written(path, events))) == events


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: str(kind.__name__))
@given(data=st.data())
def test_every_message_in_flight_comes_back(kind: type, data: st.DataObject) -> None:
    event = Heard("uav1", data.draw(built(kind)))
    assert from_plain(to_plain(event)) == event


def test_what_a_routes_tuples_are_stays_tuples(tmp_path: Path) -> None:
    event = SolveEnded(3, (NewRoute("uav1", (0, 5)), NewRoute("uav2", ())), (4,), 0.5, "settled")
    [(now_s, back)] = read_events(written(tmp_path / "events.jsonl", [(1.5, event)]))
    assert (now_s, back) == (1.5, event)


@pytest.mark.parametrize("keep", [1, 20, 40])
def test_a_torn_last_line_is_passed_over(tmp_path: Path, keep: int) -> None:
    path = written(tmp_path / "events.jsonl", [(1.0, Tick()), (2.0, UploadEnded("uav1", 1, True, False, ""))])
    whole = path.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    path.write_bytes(whole[: last + keep])
    assert list(read_events(path)) == [(1.0, Tick())]


def test_a_line_that_is_whole_but_for_its_end_is_torn_too(tmp_path: Path) -> None:
    path = written(tmp_path / "events.jsonl", [(1.0, Tick()), (2.0, Tick())])
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    assert list(read_events(path)) == [(1.0, Tick())]


def test_notes_are_passed_over(tmp_path: Path) -> None:
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    log.write(Tick(), 1.0)
    log.note(1.0, said="uav1: flies its mission", level="info")
    log.write(Tick(), 2.0)
    log.close()
    assert list(read_events(tmp_path / "events.jsonl")) == [(1.0, Tick()), (2.0, Tick())]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "line 1: expected a log of format"),
        (b'{"format":"something else"}\n', "line 1: expected a log of format"),
        (b"\x00\xff\xfe\x80 no text at all\n", "not a log"),
        (b'{"format":"' + FORMAT.encode() + b'"}\nnot JSON\n', "line 2: not JSON"),
        (b'{"format":"' + FORMAT.encode() + b'"}\n{"t_s":1,"event":{"kind":"Unheard"}}\n', "line 2: unknown event"),
        (b'{"format":"' + FORMAT.encode() + b'"}\n{"t_s":1,"event":{"kind":"Tick","x":1}}\n', "line 2: unknown event"),
        (b'{"format":"' + FORMAT.encode() + b'"}\n{"event":{"kind":"Tick"}}\n', "line 2: no time"),
        (b'{"format":"' + FORMAT.encode() + b'"}\n[1]\n', "line 2: expected an object"),
    ],
)
def test_what_is_no_log_is_named_with_its_line(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "events.jsonl"
    path.write_bytes(content)
    with pytest.raises(LogError, match=reason) as raised:
        list(read_events(path))
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)


def test_a_log_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be read: No such file"):
        list(read_events(tmp_path / "events.jsonl"))


def test_a_log_is_never_overwritten(tmp_path: Path) -> None:
    written(tmp_path / "events.jsonl", [])
    with pytest.raises(LogError, match="cannot be made: File exists"):
        EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)


def test_each_event_is_with_the_system_when_write_returns(tmp_path: Path) -> None:
    """The ground station may be killed at any instant: what was applied has been written."""
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    for second in range(3):
        log.write(Tick(), float(second))
        assert len(list(read_events(tmp_path / "events.jsonl"))) == second + 1
    log.close()


def test_what_cannot_be_written_is_counted(tmp_path: Path) -> None:
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    log.write(Tick(), float("nan"))
    log.write(Heard("uav1", Heartbeat(3, 3, True, 4)), 1.0)
    log.close()
    log.write(Tick(), 2.0)
    assert log.lost == 2
    assert len(list(read_events(tmp_path / "events.jsonl"))) == 1


def test_a_flight_from_its_log_gives_the_same_commands(tmp_path: Path) -> None:
    """The property that crash recovery and replay rest on; the flight has a loss, a refusal and a late answer."""
    ready = fleet_of({**THREE, "uav4": ()})
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    flight = Story(ready.context, dict(ready.boards), sink=log)
    flight.upload_results["uav3"] = [UploadEnded("uav3", 1, accepted=False, mixed=False, reason="denied")]
    flight.launch()
    flight.run(lambda: flight.inspecting("uav2", 2))
    flight.crafts["uav2"].mute = True
    flight.run(lambda: len(flight.solves()) == 2)
    flight.crafts["uav1"].battery_pct -= 30.0
    flight.finish()
    log.close()
    assert log.lost == 0
    assert len(flight.state.replanning.records) >= 2

    state = fleet_step.build_initial_state(dict(ready.boards))
    again: list[tuple[float, Command]] = []
    for now_s, event in read_events(tmp_path / "events.jsonl"):
        state, decided = fleet_step.step(ready.context, state, event, now_s)
        again.extend((now_s, command) for command in decided)
    assert again == flight.commands
    assert state == flight.state


def test_a_flight_resumed_from_its_log_decides_the_same(tmp_path: Path) -> None:
    """Killed in the midst: the state from the log is the state that was."""
    flight = under_way()
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0)
    for now_s, event in flight.events:
        log.write(event, now_s)
    state = fleet_step.build_initial_state(dict(flight.boards))
    for now_s, event in read_events(tmp_path / "events.jsonl"):
        state, _ = fleet_step.step(flight.context, state, event, now_s)
    log.close()
    assert state == flight.state


def test_a_full_disk_is_reported_once_and_what_happened_is_written_when_there_is_room(tmp_path: Path) -> None:
    path, told = tmp_path / "events.jsonl", list[str]()
    log = EventLog(path, began_unix_s=0.0, speedup=1.0, told=told.append)
    events: list[tuple[float, Event]] = [
        (float(second), Heard("uav1", Heartbeat(3, 3, True, 4))) for second in range(90)
    ]
    with room_for(2000):
        for now_s, event in events[:60]:
            log.write(event, now_s)
        assert path.stat().st_size == 2000
        assert len(told) == 1
        assert "is the disk full" in told[0]
    for now_s, event in events[60:]:
        log.write(event, now_s)
    log.close()
    assert told[1:] == ["the event log is written again"]
    assert log.lost == 0
    assert list(read_events(path)) == events
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert [line["told"] for line in lines if "told" in line] == told


def test_on_a_disk_that_stays_full_what_was_decided_is_kept_and_the_gap_is_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executor.adapters.eventlog.MOST_WAITING", 5)
    path, told = tmp_path / "events.jsonl", list[str]()
    log = EventLog(path, began_unix_s=0.0, speedup=1.0, told=told.append)
    ended = UploadEnded("uav1", 1, True, False, "")
    with room_for(path.stat().st_size):
        for second in range(20):
            log.write(Tick(), float(second))
        log.write(ended, 20.0)
    log.write(Tick(), 21.0)
    log.close()
    damage: list[str] = []
    back = list(read_events(path, damage.append))
    assert back == [*((float(second), Tick()) for second in range(4)), (20.0, ended), (21.0, Tick())]
    assert damage == ["line 7: 16 lines could not be written here"]
    assert told[1] == "the event log is written again; 16 lines are lost"


def test_a_log_continues_behind_its_last_whole_line(tmp_path: Path) -> None:
    path = written(tmp_path / "events.jsonl", [(1.0, Tick()), (2.0, Tick())])
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"t_s":3.0,"event":{"ki')
    damage: list[str] = []
    assert list(read_events(path, damage.append)) == [(1.0, Tick()), (2.0, Tick())]
    assert damage == ["line 4, the last one, is torn and was dropped"]
    log = EventLog(path)
    log.write(Tick(), 4.0)
    log.close()
    assert list(read_events(path)) == [(1.0, Tick()), (2.0, Tick()), (4.0, Tick())]


def test_what_is_damaged_or_missing_in_the_midst_is_reported(tmp_path: Path) -> None:
    path = written(tmp_path / "events.jsonl", [(float(second), Tick()) for second in (1, 2, 3, 80)])
    lines = path.read_bytes().splitlines(keepends=True)
    lines[2] = b"\xff\x00 garbage\n"
    path.write_bytes(b"".join(lines))
    damage: list[str] = []
    assert [now_s for now_s, _ in read_events(path, damage.append)] == [1.0, 3.0, 80.0]
    assert damage == ["line 3 cannot be read and was passed over", "line 5: nothing is on record from 3 to 80 s"]


def test_a_log_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text('{"format":"faultline-events/2","began_unix_s":0,"speedup":1}\n')
    with pytest.raises(
        LogError, match="expected a log of format faultline-events/1, got faultline-events/2, written by"
    ):
        list(read_events(path, lambda _: None))


@pytest.mark.parametrize("system", ["Linux", "macOS"])
@pytest.mark.asyncio
async def test_one_sync_covers_everything_written_before(
    system: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    if system == "macOS":
        monkeypatch.delattr(os, "fdatasync")
    monkeypatch.setattr(
        os, "fdatasync" if system == "Linux" else "fsync", lambda fd: synced.append(os.fstat(fd).st_size)
    )
    path = tmp_path / "events.jsonl"
    log = EventLog(path, began_unix_s=0.0, speedup=1.0)
    log.write(Tick(), 1.0)
    await asyncio.gather(log.settle(), log.settle())
    await log.settle()
    assert synced == [path.stat().st_size]
    log.write(Tick(), 2.0)
    await log.settle()
    assert synced[1:] == [path.stat().st_size]
    log.close()


@pytest.mark.asyncio
async def test_a_hanging_disk_delays_the_flight_only_briefly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    works, began, told = threading.Event(), list[int](), list[str]()

    def hang(fd: int) -> None:
        began.append(fd)
        works.wait(PATIENCE_S)

    monkeypatch.setattr(os, "fdatasync", hang)
    monkeypatch.setattr(eventlog, "DISK_S", 0.05)
    log = EventLog(tmp_path / "events.jsonl", began_unix_s=0.0, speedup=1.0, told=told.append)
    try:
        for now_s in (1.0, 2.0):
            log.write(Tick(), now_s)
            await log.settle()
        assert len(began) == 1  # only one thread hangs with it
        assert told == ["the disk takes longer than 0.05 s to write the event log: orders no longer wait for it"]
    finally:
        works.set()
    monkeypatch.setattr(eventlog, "DISK_S", 60.0)
    await log.settle()
    assert told[1:] == ["the disk writes the event log in time again"]
    log.close()
