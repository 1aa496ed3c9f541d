"""A run directory of a dead ground station: what is read from it, and what is refused."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
import tomlkit
from pymavlink.dialects.v20 import common

from executor.adapters import eventlog
from executor.adapters.clock import SystemClock
from executor.adapters.eventlog import EventLog, read_decisions, read_events, to_plain
from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.cli.main import main
from executor.core.battery.kalman import Prior
from executor.core.context import Context
from executor.core.interface.codes import Check
from executor.core.interface.commands import Level, Say, Start
from executor.core.interface.events import Event
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownSortie, Turnaround
from executor.core.state.vehicle_state import Stage
from executor.core.vehicle_learning import KnownVehicle, PaceEstimate
from executor.errors import LogError
from executor.flight import resume_flight
from executor.flight.run_start import FlightRequest, read_run_start
from executor.replay.run_replay import replay_run
from executor.site import site_model
from executor.site.learned_files import LearnedDocument, PacksDocument, build_learned_document, learn_from_flight
from executor.site.site_file import read_site
from missions import SolverRecord, make_plan_file, write_plan
from missions.files import write_document
from planner import Cost, Plan, Route
from tests.e2e.flights import site_file
from tests.fakes.flight import Story
from tests.patience import PATIENCE_S

SPEEDUP = 10.0


def prepared(folder: Path) -> Path:
    """A run directory before the launch: two vehicles over five segments."""
    path, _ = site_file(folder, pylons=6, vehicles=2, speedup=SPEEDUP)
    site, run = read_site(path), folder / "run"
    run.mkdir()
    ground = site_model.load_site_model(site, folder)
    plan = make_plan_file(
        ground.network, site_model.build_first_task(ground), ground.travel,
        Plan((Route(0, (0, 2)), Route(1, (4, 6, 8))), ()),
        Cost.MINMAX, SolverRecord("search", 1, 0.1), inspection=ground.inspection,
    )  # fmt: skip
    content = site.model_dump(exclude_none=True, mode="json")
    content["network"]["file"] = "network.yaml"
    (run / "network.yaml").write_bytes((folder / "line.yaml").read_bytes())
    (run / "site.toml").write_text(tomlkit.dumps(content))
    write_plan(run / "plan-000.json", plan)
    write_document(run / "vehicles.json", {"vehicles": []})
    return run


@dataclass(slots=True)
class Diary:
    """Writes as a flight does: an event, then what was decided, before it is carried out."""

    log: EventLog
    flight: Story | None = None
    noted: int = 0

    def write(self, event: Event, now_s: float) -> None:
        self.note()
        self.log.write(event, now_s)

    def note(self) -> None:
        for at_s, command in [] if self.flight is None else self.flight.commands[self.noted :]:
            self.noted += 1
            if isinstance(command, Say):
                self.log.note(at_s, said=command.text, level=command.level.value)
            else:
                self.log.note(at_s, command=to_plain(command))

    async def settle(self) -> None:
        """Nothing here outlives a power loss."""


def launched(run: Path) -> tuple[Story, Diary]:
    """A flight that has just been launched, and writes its log."""
    begun = read_run_start(run)
    diary = Diary(EventLog(run / "events.jsonl", began_unix_s=time.time() - 60.0, speedup=SPEEDUP))
    boards = {name: vehicle.assignment.board for name, vehicle in begun.state.vehicles.items()}
    flight = Story(begun.context, boards, sink=diary)
    diary.flight = flight
    flight.launch()
    return flight, diary


def left(run: Path) -> resume_flight.InterruptedRun:
    known = resume_flight.read_resume_plan(run)
    assert isinstance(known, resume_flight.ResumePlan)
    return resume_flight.replay_interrupted_run(run, known)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Call the command line with bad input: one line, exit code 2."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


def test_the_state_from_the_log_is_the_state_that_was(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.run(lambda: len(flight.state.coverage.inspected) == 1)
    diary.note()
    found = left(run)
    assert found.state == flight.state
    assert found.last_s == flight.now_s
    assert (found.notes, found.undone) == ((), ())
    assert (
        "with 1 of 5 segments inspected: uav1 flying, uav2 flying" in resume_flight.describe_interrupted_run(found)[-1]
    )


def test_what_was_learned_in_flight_is_learned_again_from_its_log(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.run(lambda: flight.state.progress.finished)
    diary.note()
    diary.log.close()
    learned = {name: one.assignment.learned for name, one in flight.state.vehicles.items()}
    assert all(one is not None and one.inspect.legs > 0 and one.transit.legs > 0 for one in learned.values())
    again = replay_run(run)
    assert {name: one.assignment.learned for name, one in again.state.vehicles.items()} == learned
    documents = [learn_from_flight(flight.context, state, {}, "2026-01-02") for state in (flight.state, again.state)]
    assert documents[0] == documents[1]
    assert [row.name for row in documents[0].vehicles] == ["uav1", "uav2"]


def test_a_report_that_is_made_up_for_comes_with_what_the_packs_flew(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    finished(run)
    ended = left(run)
    sorties = (FlownSortie(1, "P1", 100.0, 100.0, 16.8, (), 700.0, 40.0, 15.2, 4),)
    turned = replace(ended.state.vehicles["uav1"], turn=Turnaround(sorties=sorties, swaps=1))
    state = replace(ended.state, vehicles={**ended.state.vehicles, "uav1": turned})
    report = resume_flight.finish_report(run, replace(ended, state=state))
    assert report is not None
    assert "P1" in {row.pack for row in report.sorties}
    assert "P1" in {one.label for one in PacksDocument.read(RunDirectory(run).packs).flights}


@pytest.mark.asyncio
async def test_a_resumed_flight_keeps_what_it_learned(tmp_path: Path) -> None:
    """Against what it began with: the flight before said that uav1 is slow and thirsty."""
    run = prepared(tmp_path)
    slow, unsure = PaceEstimate(1.2, 0.02**2, 40), Prior(1.1, 0.05)
    known = KnownVehicle(slow, slow, unsure, 30.0, "ardupilot", "Mavic 3")
    build_learned_document({"uav1": known}, "2026-01-02").write(RunDirectory(run).learned_before)
    finished(run)
    assert not RunDirectory(run).learned.exists()
    assert (await resume_flight.resume_flight(run, Watchful())).finished
    kept = LearnedDocument.read(RunDirectory(run).learned)
    before = left(run)
    assert kept.vehicles == learn_from_flight(before.begun.context, before.state, {"uav1": known}, kept.date).vehicles
    rows = {row.name: row for row in kept.vehicles}
    # The legs of both flights; today it was not slow, which is believed as far as another day may be another one.
    assert rows["uav1"].inspect.legs == 40 + 2
    assert 1.02 < rows["uav1"].inspect.mean < 1.15
    # Made vehicles turn on the spot, where the model slows down for a corner: an eighth faster.
    assert rows["uav2"].inspect.mean == pytest.approx(0.88, abs=0.03)


def test_what_was_decided_and_not_carried_out_is_known(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    flight, _ = launched(run)
    found = left(run)
    assert found.state == flight.state
    assert found.undone == (Start("uav1"), Start("uav2"))
    assert all(vehicle.stage is Stage.STARTING for vehicle in found.state.vehicles.values())
    log = EventLog(run / "events.jsonl")
    for command in found.undone:
        resume_flight._note_undone_command(log, command, found.last_s)
    log.close()
    assert len(list(read_decisions(run / "events.jsonl"))) == 2
    assert left(run).undone == ()


def test_damage_is_reported_and_read_around(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.run(lambda: len(flight.state.coverage.inspected) == 1)
    diary.note()
    lines = (run / "events.jsonl").read_bytes().splitlines(keepends=True)
    lines[40] = lines[40][:20] + b"\xff\xfe\n"
    (run / "events.jsonl").write_bytes(b"".join(lines) + b'{"t_s":')
    found = left(run)
    assert found.notes == (
        "line 41 cannot be read and was passed over",
        f"line {len(lines) + 1}, the last one, is torn and was dropped",
    )
    assert set(found.state.coverage.inspected) == set(flight.state.coverage.inspected)


@pytest.mark.parametrize("content", [None, b"", b'{"format":"faultline-ev', b"head"])
def test_a_flight_that_was_never_launched_begins_from_its_beginning(tmp_path: Path, content: bytes | None) -> None:
    run = prepared(tmp_path)
    if content == b"head":
        EventLog(run / "events.jsonl", began_unix_s=0.0, speedup=SPEEDUP).close()
    elif content is not None:
        (run / "events.jsonl").write_bytes(content)
    found = resume_flight.read_resume_plan(run)
    assert isinstance(found, FlightRequest)
    assert found.ground.names == ("uav1", "uav2")


def test_a_flight_that_is_over_says_so_with_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It died between the end and the report: nobody needs to be asked."""
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.finish()
    diary.note()
    with pytest.raises(SystemExit) as ended:
        main(["resume", str(run), "--json"])
    assert ended.value.code == 0
    report = json.loads(capsys.readouterr().out)
    assert report["finished"]
    assert report == json.loads((run / "report.json").read_text())


def test_what_is_no_run_directory_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "expected a run directory" in refused(capsys, "resume", str(tmp_path))
    run = prepared(tmp_path)
    (run / "events.jsonl").write_text('{"format":"faultline-events/9","began_unix_s":0,"speedup":1}\n')
    assert "got faultline-events/9, written by a newer version" in refused(capsys, "resume", str(run))


def test_without_confirmation_no_vehicle_is_contacted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.pass_s(5.0)
    diary.note()
    size = (run / "events.jsonl").stat().st_size
    assert "nothing was sent to any vehicle" in refused(capsys, "resume", str(run), "--json")
    assert (run / "events.jsonl").stat().st_size == size


def test_a_flight_that_goes_on_is_not_asked_about(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = prepared(tmp_path)
    launched(run)
    with lock_run_directory(run):
        assert "another faultline flies this directory already" in refused(capsys, "resume", str(run), "--json")


def test_the_log_of_a_checklist_under_way_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In another process, which has launched nothing yet."""
    run = prepared(tmp_path)
    EventLog(run / "events.jsonl", began_unix_s=0.0, speedup=SPEEDUP).close()
    with lock_run_directory(run):
        assert "another faultline flies this directory already" in refused(capsys, "resume", str(run), "--json")
    assert (run / "events.jsonl").exists()


def test_one_process_flies_a_directory(tmp_path: Path) -> None:
    with (
        lock_run_directory(tmp_path),
        pytest.raises(LogError, match="another faultline flies this directory already"),
        lock_run_directory(tmp_path),
    ):
        pass
    with lock_run_directory(tmp_path):
        pass


@pytest.mark.parametrize(("began_ago_s", "last_s", "expected_s"), [(60.0, 100.0, 600.0), (-3600.0, 100.0, 100.0)])
def test_time_advances_and_never_goes_back(began_ago_s: float, last_s: float, expected_s: float) -> None:
    """At ten times real time; the second clock was set back by an hour while the ground station was dead."""
    clock = SystemClock.resume(SPEEDUP, time.time() - began_ago_s, last_s)
    assert clock.now_s() == pytest.approx(expected_s, abs=20.0)
    assert clock.now_s() >= last_s
    assert clock.steady_unix_s() * 1e6 >= (time.time() - began_ago_s) * 1e6


def test_a_clock_that_was_set_in_the_flight_is_reckoned_with(tmp_path: Path) -> None:
    """Set back by an hour in the flight, a minute after its beginning: an hour has not yet to pass."""
    run = prepared(tmp_path)
    _, diary = launched(run)
    diary.log.note(5.0, clock_set_s=-3600.0)
    found = left(run)
    assert found.legacy.set_s == -3600.0
    clock = SystemClock.resume(SPEEDUP, time.time() - 60.0 + 3600.0, found.last_s, found.legacy.set_s)
    assert clock.now_s() == pytest.approx(600.0, abs=20.0)


class Watchful:
    """An operator who has said yes."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        self.said.append(text)

    def show_checks(self, found: Sequence[Check]) -> None:
        """Nothing is checked here."""

    async def ask(self, question: str) -> bool:
        return True

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Nobody looks."""

    def stop_drawing(self) -> None:
        """Nothing is drawn."""


@pytest.mark.asyncio
@pytest.mark.parametrize("at_work", [1, 2])
async def test_the_vehicles_hear_our_heartbeat_before_the_log_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_work: int
) -> None:
    """A disk that gives the log only when both vehicles have heard us; the second time nobody waits for it any more."""
    run = prepared(tmp_path)
    flight, diary = launched(run)
    flight.pass_s(5.0)
    diary.note()
    diary.log.close()
    heard, ended = threading.Event(), threading.Event()
    whole, given = len(list(read_events(run / "events.jsonl"))), list[float]()

    def slow(path: Path, *rest: object) -> Iterator[tuple[float, Event]]:
        heard.wait()
        try:
            for timed in read_events(path):
                given.append(timed[0])
                yield timed
                if at_work == 2:
                    time.sleep(0.05)
            raise LogError("this disk ends here")
        finally:
            ended.set()

    monkeypatch.setattr(eventlog, "read_events", slow)
    ports = [table.link.number for table in read_site(run / "site.toml").vehicle]
    async with AsyncExitStack() as stack:
        peers = [await stack.enter_async_context(peer(port, sysid)) for sysid, port in enumerate(ports, start=1)]
        console = Watchful()
        taking = asyncio.create_task(resume_flight.resume_flight(run, console))
        async with asyncio.timeout(PATIENCE_S):
            await asyncio.gather(*(one.answered.wait() for one in peers))
        assert not taking.done()
        heard.set()
        if at_work == 2:
            taking.cancel()
            with pytest.raises(asyncio.CancelledError):
                await taking
            assert await asyncio.to_thread(ended.wait, PATIENCE_S)
            assert len(given) < whole, "the rest of the log is not read"
        else:
            with pytest.raises(LogError, match="this disk ends here"):
                await taking
    assert any("the vehicles hear our heartbeat again" in line for line in console.said)


def finished(run: Path) -> None:
    """A flight of which nothing is left but its report."""
    flight, diary = launched(run)
    flight.run(lambda: flight.state.progress.finished)
    diary.note()
    diary.log.close()


def test_a_flight_without_pictures_has_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = prepared(tmp_path)
    finished(run)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SystemExit) as ended:
        main(["resume", str(run), "--json"])
    assert ended.value.code == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["finished"]
    assert said.err == "faultline: a picture of the flight needs the extra pictures: pip install matplotlib\n"
    assert (run / "report.html").exists()
    assert list(run.glob("*.png")) == []


class Peer(asyncio.DatagramProtocol):
    """A vehicle that says that it is there, and hears whether somebody else is."""

    def __init__(self, sysid: int) -> None:
        self._words = common.MAVLink(None, srcSystem=sysid, srcComponent=1)
        self.answered = asyncio.Event()

    def heartbeat(self) -> bytes:
        return bytes(self._words.heartbeat_encode(2, 3, 0, 0, 4).pack(self._words))

    def datagram_received(self, data: bytes, addr: object) -> None:
        frames = common.MAVLink(None).parse_buffer(data) or []
        if any(frame.get_type() == "HEARTBEAT" and frame.get_srcSystem() == 255 for frame in frames):
            self.answered.set()


@asynccontextmanager
async def peer(port: int, sysid: int) -> AsyncIterator[Peer]:
    transport, one = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: Peer(sysid), remote_addr=("127.0.0.1", port)
    )

    async def speak() -> None:
        while True:
            transport.sendto(one.heartbeat())
            await asyncio.sleep(0.05)

    speaking = asyncio.create_task(speak())
    try:
        yield one
    finally:
        speaking.cancel()
        transport.close()
        await asyncio.gather(speaking, return_exceptions=True)
        await asyncio.sleep(0)
