"""Checkpoints: with one of any place in the log a flight is what the whole log says, and a doubtful one is nothing."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from executor.adapters.eventlog import EventLog, LogPlace, from_plain
from executor.adapters.run_directory import RunDirectory
from executor.core import fleet_step
from executor.core.interface.commands import Solve
from executor.core.interface.events import Reopened, SolveEnded, Tick
from executor.core.interface.intents import Action
from executor.core.interface.messages import StationHeard
from executor.core.state.vehicle_state import Stage
from executor.flight import flight_recorder, resume_flight
from executor.flight.flight_recorder import Checkpoint, Checkpointer, InheritedRecord, Planned
from executor.flight.run_start import read_run_start
from tests.executor.builders import with_facts
from tests.executor.flight.test_resume_flight import Diary, launched, left, prepared
from tests.fakes.disk import room_for
from tests.fakes.flight import Story
from tests.patience import PATIENCE_S

FILES = tuple(file.name for file in RunDirectory(Path()).checkpoints)

LOG = "events.jsonl"


@dataclass(frozen=True, slots=True)
class Logged:
    """A flight as its ground station left it, and what a checkpoint would hold before each event of its log."""

    run: Path
    cuts: tuple[Checkpoint, ...]


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Logged:
    """A vehicle is lost, its work is planned anew and put on board another; the clock is set; a death and a return."""
    run = prepared(tmp_path_factory.mktemp("flight"))
    flight, diary = launched(run)
    flight.run(lambda: len(flight.state.coverage.inspected) == 1)
    flight.ask(Action.HOLD, "uav2", "wait")
    flight.pass_s(10.0)
    diary.note()
    diary.log.note(flight.now_s, clock_set_s=-3600.0)
    flight.ask(Action.RESUME, "uav2", "go on")
    flight.crafts["uav1"].mute = True
    flight.run(lambda: bool(flight.state.replanning.records))
    flight.happen(Reopened(0.0, 10.0, ("a note",)))
    flight.run(lambda: len(flight.state.coverage.inspected) == 3)
    diary.note()
    diary.log.close()
    return Logged(run, tuple(every_cut(run)))


def every_cut(run: Path) -> list[Checkpoint]:
    """Replay a log on our own, and keep what there is before every event from the launch on."""
    begun, content = read_run_start(run), (run / LOG).read_bytes().splitlines(keepends=True)
    state, at_s, size, set_s = begun.state, 0.0, 0, 0.0
    solves: dict[int, Solve] = {}
    planned: list[Planned] = []
    cuts = []
    for number, line in enumerate(content):
        entry = json.loads(line)
        if "event" in entry:
            if state.progress.launched_s is not None:
                digest = hashlib.sha256(content[0] + content[number - 1]).hexdigest()
                solve = solves[max(solves)] if solves else None
                legacy = InheritedRecord(tuple(planned), solve, set_s)
                cuts.append(Checkpoint(LogPlace(size, number, at_s, digest), state, legacy))
            event, at_s = from_plain(entry["event"]), entry["t_s"]
            if isinstance(event, SolveEnded) and event.routes is not None:
                planned.append((solves[event.revision], event))
            state, commands = fleet_step.step(begun.context, state, event, at_s)
            solves |= {one.revision: one for one in commands if isinstance(one, Solve)}
        set_s += entry.get("clock_set_s", 0.0)
        size += len(line)
    return cuts


def keep(run: Path, checkpoint: Checkpoint, name: str = FILES[0]) -> None:
    (run / name).write_bytes(flight_recorder.encode_checkpoint(checkpoint, (run / "plan-000.json").read_bytes()))


def copied(run: Path, folder: Path) -> Path:
    """The same flight in a directory of its own."""
    target = folder / "copy"
    target.mkdir()
    for path in run.iterdir():
        if path.name not in FILES:
            (target / path.name).write_bytes(path.read_bytes())
    return target


def alike(one: resume_flight.InterruptedRun, other: resume_flight.InterruptedRun) -> bool:
    """Whether nothing that is done with them could differ."""
    return (one.state, one.last_s, one.lines, one.undone, one.head) == (
        other.state, other.last_s, other.lines, other.undone, other.head,
    ) and replace(one.legacy, checkpoint="") == replace(other.legacy, checkpoint="")  # fmt: skip


def test_what_is_read_is_what_was_written_at_every_place_of_a_flight(logged: Logged, tmp_path: Path) -> None:
    run = copied(logged.run, tmp_path)
    assert len(logged.cuts) > 1000
    states = [cut.state for cut in logged.cuts]
    assert any(state.replanning.replan is not None and state.replanning.replan.missions for state in states)
    assert any(vehicle.stage is Stage.LOST for vehicle in states[-1].vehicles.values())
    assert states[-1].crew.intents
    for cut in logged.cuts:
        keep(run, cut)
        found = flight_recorder.find_newest_checkpoint(run, run / LOG)
        assert found.checkpoint == cut
        assert found.notes == ()


def test_checkpoint_and_rest_are_the_whole_log(logged: Logged, tmp_path: Path) -> None:
    """At places spread over the flight, and at each one in the second in which it was planned anew."""
    run = copied(logged.run, tmp_path)
    whole = left(run)
    assert whole.legacy.set_s == -3600.0
    assert whole.legacy.unkept
    assert whole.legacy.checkpoint == ""
    busy = [index for index, cut in enumerate(logged.cuts) if cut.state.replanning.replan is not None]
    for index in {*range(0, len(logged.cuts), 150), *busy, len(logged.cuts) - 1}:
        keep(run, logged.cuts[index])
        found = left(run)
        assert found.legacy.checkpoint == FILES[0]
        assert alike(found, whole), index
        assert found.notes == ()


def test_state_that_a_flight_seldom_has_is_kept(logged: Logged, tmp_path: Path) -> None:
    """Infinite times, sets of different things, mappings by number."""
    run, cut = copied(logged.run, tmp_path), logged.cuts[-1]
    vehicle = with_facts(
        cut.state.vehicles["uav2"], strangers=frozenset({StationHeard(254, 190)}), alarm=("é\n\u2028", 1.0)
    )
    state = with_facts(cut.state.put(vehicle), attempts={4: 2, 0: 1}, inferred=frozenset({3, 1}))
    keep(run, replace(cut, state=state))
    found = flight_recorder.find_newest_checkpoint(run, run / LOG).checkpoint
    assert found is not None
    assert found.state == state
    assert list(found.state.coverage.attempts) == [4, 0]
    assert found.state.replanning.wait_until_s == float("-inf")
    assert type(found.state.vehicles["uav2"].link.strangers) is frozenset
    with pytest.raises(TypeError):
        found.state.vehicles["uav3"] = vehicle  # type: ignore[index]


def spoilt(change: Callable[[Path, Checkpoint], object], logged: Logged, folder: Path) -> resume_flight.InterruptedRun:
    """Return what is read where the newer of two checkpoints, or what it is about, was changed."""
    run = copied(logged.run, folder)
    keep(run, logged.cuts[100], FILES[1])
    keep(run, logged.cuts[900], FILES[0])
    change(run, logged.cuts[900])
    return left(run)


def cut_short(by: float) -> Callable[[Path, Checkpoint], object]:
    return lambda run, _: os.truncate(run / FILES[0], round(by * (run / FILES[0]).stat().st_size))


def swapped(old: bytes, new: bytes) -> Callable[[Path, Checkpoint], object]:
    def swap(run: Path, _: Checkpoint) -> None:
        before = (run / FILES[0]).read_bytes()
        assert old in before
        (run / FILES[0]).write_bytes(before.replace(old, new, 1))

    return swap


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (cut_short(0.0), "EOF"),
        (cut_short(0.01), ""),
        (cut_short(0.6), "it is torn or damaged"),
        (swapped(b'"stage":"flying"', b'"stage":"landed"'), "it is torn or damaged"),
        (swapped(b"faultline-checkpoint/2", b"faultline-checkpoint/3"), "format: expected 'faultline-checkpoint/2'"),
        (swapped(b'"program":"', b'"program":"9'), "another version of the program wrote it"),
        (swapped(b'"plan":"', b'"plan":"9'), "it is of a flight with another plan"),
        (swapped(b'"digest":"', b'"digest":"9'), "the log does not reach as far, or is another one"),
        (swapped(b'{"format"', b'[{"format"'), ""),
        (lambda run, _: (run / FILES[0]).write_bytes(b"[" * 100_000), ""),
        (lambda run, _: (run / FILES[0]).write_bytes(b"\x80\x04\x95N."), ""),
    ],
)  # fmt: skip
def test_of_a_doubtful_one_nothing_is_believed(
    change: Callable[[Path, Checkpoint], object], why: str, logged: Logged, tmp_path: Path
) -> None:
    found = spoilt(change, logged, tmp_path)
    assert alike(found, left(logged.run))
    assert found.legacy.checkpoint == FILES[1]
    [note] = found.notes
    assert note.startswith("checkpoint-a.jsonl is not used: ")
    assert why in note
    assert "\n" not in note


def test_types_are_checked_where_the_digests_fit(logged: Logged, tmp_path: Path) -> None:
    """Somebody made it, with a digest of its own."""
    run, cut = copied(logged.run, tmp_path), logged.cuts[500]
    keep(run, cut)
    head, body = (run / FILES[0]).read_bytes().split(b"\n", 1)
    body = body.replace(b'"revision":0', b'"revision":"0"', 1)
    forged = json.loads(head) | {"body": hashlib.sha256(body).hexdigest()}
    (run / FILES[0]).write_bytes(json.dumps(forged).encode() + b"\n" + body)
    found = left(run)
    assert found.notes == (
        "checkpoint-a.jsonl is not used: state.replanning.revision: expected a whole number, got '0'",
        "without a checkpoint the whole log is read",
    )
    assert alike(found, left(logged.run))


def test_a_log_that_lost_its_tail_is_believed(logged: Logged, tmp_path: Path) -> None:
    """After a power loss the newer checkpoint knows more than the log, which goes on from where it ends."""
    run = copied(logged.run, tmp_path)
    old, new = logged.cuts[100], logged.cuts[900]
    keep(run, old, FILES[1])
    keep(run, new, FILES[0])
    os.truncate(run / LOG, logged.cuts[500].place.size)
    found = left(run)
    assert found.state == logged.cuts[500].state
    assert found.notes == ("checkpoint-a.jsonl is not used: the log does not reach as far, or is another one",)
    log = EventLog(run / LOG, lines=found.lines)
    at_s = found.last_s
    while (run / LOG).stat().st_size < new.place.size + 1000:
        at_s += 0.2
        log.write(Tick(), at_s)
    log.close()
    again = left(run)
    assert again.legacy.checkpoint == FILES[1]
    assert again.last_s == at_s
    for name in FILES:
        (run / name).unlink()
    assert alike(again, left(run))


def test_what_is_before_it_is_not_read(logged: Logged, tmp_path: Path) -> None:
    """All but the first line and the last before the checkpoint is unreadable, and nobody notices."""
    run, place = copied(logged.run, tmp_path), logged.cuts[900].place
    keep(run, logged.cuts[900])
    content = (run / LOG).read_bytes()
    first = content.index(b"\n") + 1
    last = content.rindex(b"\n", 0, place.size - 1) + 1
    (run / LOG).write_bytes(content[:first] + b"x" * (last - first - 1) + b"\n" + content[last:])
    found = left(run)
    assert alike(found, left(logged.run))
    assert found.notes == ()


def test_damage_behind_it_is_reported_with_its_line(logged: Logged, tmp_path: Path) -> None:
    run, place = copied(logged.run, tmp_path), logged.cuts[900].place
    lines = (run / LOG).read_bytes().splitlines(keepends=True)
    lines[place.lines + 3 : place.lines + 3] = [b'{"t_s":1.0,"lines_lost":7}\n', b"\xff\n"]
    (run / LOG).write_bytes(b"".join(lines) + b'{"t_s":')
    whole = left(run)
    keep(run, logged.cuts[900])
    found = left(run)
    assert found.notes == whole.notes
    assert found.notes == (
        f"line {place.lines + 4}: 7 lines could not be written here",
        f"line {place.lines + 5} cannot be read and was passed over",
        f"line {len(lines) + 1}, the last one, is torn and was dropped",
    )
    assert alike(found, whole)


def checkpoint_of(diary: Diary, flight: Story) -> Callable[[LogPlace], Checkpoint]:
    """What is to be written of a flight as it is now, none of whose plans is in a file."""
    diary.note()
    state, solves = flight.state, {solve.revision: solve for solve in flight.solves()}
    ends = [event for _, event in flight.events if isinstance(event, SolveEnded) and event.routes is not None]
    solve = solves[max(solves)] if solves else None
    planned = tuple((solves[end.revision], end) for end in ends)
    return lambda place: Checkpoint(place, state, InheritedRecord(planned, solve))


@pytest.mark.asyncio
async def test_a_flight_is_resumed_again_and_again(tmp_path: Path) -> None:
    """Each process writes checkpoints into the log that it goes on with; none reads what is before the last."""
    run = prepared(tmp_path)
    flight, diary = launched(run)
    for taken in ("", *itertools.islice(itertools.cycle(FILES), 4)):
        writer = Checkpointer(run, diary.log, 1.0, pytest.fail, taken)
        diary.note()
        assert writer.is_due(flight.state, flight.now_s)
        writer.begin(flight.now_s, checkpoint_of(diary, flight))
        assert not writer.is_due(flight.state, flight.now_s)
        flight.pass_s(20.0)  # the flight goes on while it is being written
        await writer.settle()
        assert not writer.is_due(flight.state, flight.now_s)
        diary.note()
        diary.log.close()
        with (run / LOG).open("ab") as file:
            file.write(b'{"t_s":9')
        found = left(run)
        assert found.state == flight.state
        assert found.undone == ()
        assert found.legacy.checkpoint == FILES[0 if taken in {"", FILES[1]} else 1]
        assert found.lines == (run / LOG).read_bytes().count(b"\n")
        diary.log = EventLog(run / LOG, lines=found.lines)
        flight.happen(Reopened(0.0, 0.0, found.notes))
    diary.note()
    diary.log.close()
    last = left(run)
    for name in FILES:
        (run / name).unlink()
    assert alike(last, left(run))


@pytest.mark.asyncio
async def test_a_full_disk_is_reported_once_and_the_flight_continues(tmp_path: Path) -> None:
    run, told = prepared(tmp_path), list[str]()
    flight, diary = launched(run)
    writer = Checkpointer(run, diary.log, 1.0, told.append)
    diary.note()
    full = (run / LOG).stat().st_size
    for _ in range(2):
        with room_for(full):
            flight.now_s += 60.0
            writer.begin(flight.now_s, checkpoint_of(diary, flight))
            await writer.settle()
    assert told == ["no checkpoint can be written: File too large; resume would take longer"]
    with room_for(full):
        flight.happen(Tick())
        writer.begin(flight.now_s, lambda _: pytest.fail("of a place that is in memory only"))
    flight.happen(Tick())
    writer.begin(flight.now_s, checkpoint_of(diary, flight))
    await writer.settle()
    assert told[1:] == ["checkpoints are written again"]
    diary.note()
    diary.log.close()
    assert left(run).state == flight.state
    assert left(run).legacy.checkpoint == FILES[0]


@pytest.mark.asyncio
async def test_a_disk_that_hangs_holds_up_one_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, works, began = prepared(tmp_path), threading.Event(), list[int]()
    flight, diary = launched(run)

    def hang(fd: int) -> None:
        began.append(fd)
        works.wait(PATIENCE_S)

    monkeypatch.setattr(os, "fsync", hang)
    monkeypatch.setattr("executor.flight.flight_recorder.DISK_S", 0.05)
    writer = Checkpointer(run, diary.log, 1.0, pytest.fail)
    try:
        for _ in range(3):
            writer.begin(flight.now_s, checkpoint_of(diary, flight))
            await writer.settle()
            flight.now_s += 60.0
            assert not writer.is_due(flight.state, flight.now_s)
        assert len(began) == 1
    finally:
        works.set()
    monkeypatch.setattr("executor.flight.flight_recorder.DISK_S", 60.0)
    await writer.settle()
    assert writer.is_due(flight.state, flight.now_s)
    diary.log.close()


def test_before_the_launch_nothing_is_due(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    log = EventLog(run / LOG, began_unix_s=0.0)
    assert not Checkpointer(run, log, 1.0, pytest.fail).is_due(read_run_start(run).state, 100.0)
    log.close()
