"""Time without a ground station when it dies after many hours of flight and is resumed.

A simulated fleet flies for some minutes and the ground station is killed when its last checkpoint is oldest. Then hours
are inserted before the flight: its own messages, with earlier times. The measurement is `faultline resume` as called by
a crew, from the call on.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from benchmarks.errors import BenchError
from benchmarks.fleetsite import site_of, write_network
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import figure, markdown_page, markdown_table
from benchmarks.store import keep_result
from executor.adapters.eventlog import count_lines_after, read_events, read_last_event_s
from executor.adapters.run_directory import RunDirectory
from executor.core.interface.events import Heard
from executor.flight import resume_flight
from executor.flight.flight_recorder import EVERY_S, Checkpoint, encode_checkpoint, find_newest_checkpoint
from executor.flight.run_start import FlightRequest, write_run_start
from executor.simulated.simulated_fleet import run_simulated_fleet
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_planning import DEFAULT, plan_site

PLAN_S = 2.0
PATIENCE_S = 300.0
LOOK_S = 0.002
"""Interval for checking the log and the loop."""
SELDOM_S = 0.2
"""Interval for checking whether the flight is old enough: each check reads a checkpoint."""
WRITES = 20
"""Checkpoints written to measure the event loop's delay meanwhile."""
PLAN = "plan-000.json"


@dataclass(frozen=True, slots=True)
class ResumedFlight:
    """One resumed flight."""

    vehicles: int
    hours: float
    log_mb: float
    lines: int
    lines_after: int
    """Log lines after the checkpoint."""
    checkpoint_kb: float
    write_ms: float
    """Processor time of a thread for writing one, without the disk's time."""
    late_ms: float
    """Maximum delay of the event loop meanwhile."""
    heartbeat_s: float
    """From the call until the links are open and the GCS heartbeat is sent."""
    charge_s: float
    """Until the state is loaded and supervision continues."""
    cpu_s: float
    """Processor time of the process until then, including loading the program."""
    asked_s: float
    """Until every vehicle's mission on board has been requested."""
    ms_per_line: float
    """Time for reading one line of a log without a checkpoint."""

    @property
    def whole_s(self) -> float:
        """Estimated time for reading the whole log."""
        return 1e-3 * self.ms_per_line * self.lines


def measure_resume(vehicles: int, *, minutes: float, hours: float, speedup: float, seed: int) -> ResumedFlight:
    """Fly, kill, and resume.

    Raises:
        BenchError: an expected event did not occur.
    """
    with tempfile.TemporaryDirectory(prefix="faultline-resume-") as folder:
        base, run = Path(folder), Path(folder) / "run"
        run.mkdir()
        write_network(base / "network.graph", vehicles, minutes + 10.0, seed)
        ground = site_model.load_site_model(
            check_site(site_of("network.graph", vehicles, speedup), "bench resume"), base
        )
        plan = plan_site(ground, replace(DEFAULT, seconds=PLAN_S, seed=seed, all_vehicles=True), lambda _: None)
        write_run_start(FlightRequest(ground.site, base, ground, plan, run, lambda _: ()))
        with run_simulated_fleet(run, (), seed):
            with _run_resume(run):
                _wait_for(
                    lambda: _is_old(run, 60.0 * minutes),
                    60.0 * minutes / speedup + PATIENCE_S,
                    "a flight with a checkpoint",
                    SELDOM_S,
                )
            per_line_ms = _per_line_ms(run)
            _put_before(run, hours)
            found = find_newest_checkpoint(run, RunDirectory(run).events).checkpoint
            if found is None:
                raise BenchError("resume: expected a checkpoint that fits")
            size, lines = RunDirectory(run).events.stat().st_size, count_lines_after(RunDirectory(run).events, None)
            rest = count_lines_after(RunDirectory(run).events, found.place)
            content, write_ms, late_ms = asyncio.run(_measure_write(found, (run / PLAN).read_bytes()))
            began_s = time.perf_counter()
            with _run_resume(run) as process:
                heartbeat_s = _wait_for_line(process, "hear our heartbeat") - began_s
                _wait_for(lambda: _is_logged_after(run, size, b'"Reopened"'), PATIENCE_S, "supervision")
                charge_s, cpu_s = time.perf_counter() - began_s, _cpu_s(process.pid)
                _wait_for(lambda: _is_logged_after(run, size, b'"Resumed"'), PATIENCE_S, "the vehicles' answers")
                asked_s = time.perf_counter() - began_s
    return ResumedFlight(
        vehicles, hours, 1e-6 * size, lines, rest, 1e-3 * len(content), write_ms, late_ms, heartbeat_s, charge_s,
        cpu_s, asked_s, per_line_ms,
    )  # fmt: skip


@contextmanager
def _run_resume(run: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run `faultline resume`, and kill it in the end."""
    command = [sys.executable, "-m", "executor", "resume", str(run), "--yes"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def _wait_for_line(process: subprocess.Popen[bytes], words: str) -> float:
    """Return when a line was printed."""
    for line in process.stderr or ():
        if words.encode() in line:
            return time.perf_counter()
    raise BenchError(f"resume: expected it to say '{words}'")


def _wait_for(happened: Callable[[], bool], patience_s: float, what: str, every_s: float = LOOK_S) -> None:
    ends_s = time.perf_counter() + patience_s
    while not happened():
        if time.perf_counter() > ends_s:
            raise BenchError(f"resume: waited {patience_s:.0f} s for {what}")
        time.sleep(every_s)


def _is_old(run: Path, least_s: float) -> bool:
    """Return whether a flight is long enough, and its last checkpoint as old as possible."""
    if not RunDirectory(run).events.exists():
        return False
    last_s, found = (
        read_last_event_s(RunDirectory(run).events),
        find_newest_checkpoint(run, RunDirectory(run).events).checkpoint,
    )
    if last_s is None or found is None or found.state.progress.launched_s is None:
        return False
    return last_s - found.state.progress.launched_s > least_s and last_s - found.place.at_s > 0.9 * EVERY_S


def _cpu_s(pid: int) -> float:
    """Return the processor time used by a process, from Linux; 0 if unavailable."""
    with suppress(OSError):
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(") ")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # user and system
    return 0.0


def _is_logged_after(run: Path, size: int, words: bytes) -> bool:
    with RunDirectory(run).events.open("rb") as file:
        file.seek(size)
        return words in file.read()


def _per_line_ms(run: Path) -> float:
    """Return the time per line of reading a log without a checkpoint."""
    known = resume_flight.read_resume_plan(run)
    if not isinstance(known, resume_flight.ResumePlan):
        raise BenchError("resume: expected a flight that was launched")
    began_s = time.process_time()
    left = resume_flight.replay_interrupted_run(run, replace(known, found=replace(known.found, checkpoint=None)))
    return 1e3 * (time.process_time() - began_s) / left.lines


def _put_before(run: Path, hours: float) -> None:
    """Insert hours before a flight's log: its own messages, repeated; its checkpoints stay valid after them."""
    path = RunDirectory(run).events
    whole = path.read_bytes()
    head, body = whole.split(b"\n", 1)
    heard = [(at_s, event) for at_s, event in read_events(path) if isinstance(event, Heard)]
    lines = [line for line in body.splitlines(keepends=True) if b'"kind":"Heard"' in line[:70]]
    lasts_s, rows = heard[-1][0] - heard[0][0], [line.partition(b",")[2] for line in lines]
    times_s = [at_s - heard[0][0] for at_s, _ in heard]
    size = count = 0
    draft = path.with_name("longer.jsonl")
    with draft.open("wb") as file:
        file.write(head + b"\n")
        for turn in itertools.count():
            begins_s = turn * lasts_s - 3600.0 * hours
            if begins_s + lasts_s > 0.0:
                break
            piece = b"".join(
                b'{"t_s":%.6f,%b' % (begins_s + at_s, row) for at_s, row in zip(times_s, rows, strict=True)
            )
            size, count = size + file.write(piece), count + len(rows)
        file.write(body)
    draft.replace(path)
    for checkpoint in run.glob("checkpoint-*.jsonl"):
        first, rest = checkpoint.read_bytes().split(b"\n", 1)
        found = json.loads(first)
        found["place"]["size"] += size
        found["place"]["lines"] += count
        checkpoint.write_bytes(json.dumps(found).encode() + b"\n" + rest)


async def _measure_write(checkpoint: Checkpoint, plan: bytes) -> tuple[bytes, float, float]:
    """Return a checkpoint's file, the milliseconds a thread needs for it, and the loop's delay meanwhile."""
    late_ms = [0.0]

    def timed() -> tuple[bytes, float]:
        began_s = time.thread_time()
        return encode_checkpoint(checkpoint, plan), 1e3 * (time.thread_time() - began_s)

    async def watch() -> None:
        while True:
            asked_s = time.perf_counter()
            await asyncio.sleep(LOOK_S)
            late_ms.append(1e3 * (time.perf_counter() - asked_s - LOOK_S))

    await asyncio.to_thread(timed)  # one-time work
    watching = asyncio.create_task(watch())
    made = [await asyncio.to_thread(timed) for _ in range(WRITES)]
    watching.cancel()
    return made[0][0], sorted(took_ms for _, took_ms in made)[WRITES // 2], max(late_ms)


COLUMNS = (
    "vehicles", "log, h", "log, MB", "lines", "lines behind the checkpoint", "checkpoint, kB", "written in, ms",
    "loop late at most, ms", "heartbeat, s", "in charge, s",
    "processor until then, s", "all asked, s", "reading it whole, s",
)  # fmt: skip


def resume_report(rows: list[ResumedFlight], content: dict[str, object]) -> str:
    """Return the page."""
    said = (
        "Seconds from the call of `faultline resume DIR --yes` until its HEARTBEAT is sent, until the state is "
        "restored and supervision continues, and until every simulated vehicle was asked for its mission (which takes "
        "at least one HEARTBEAT from it). The ground station was killed just before a new checkpoint was due; the "
        "simulation continues at the same time. `Written in` is the processor time of the thread that makes a "
        f"checkpoint, without the disk; at the same time a task slept for {1e3 * LOOK_S:g} ms at a time. `Reading it "
        "whole` is the processor time without a checkpoint, estimated from the time per line in the minutes flown. "
        "The hours of log are the flight's own messages, repeated before it."
    )
    shown = [
        (
            one.vehicles, figure(one.hours), figure(one.log_mb, 0), one.lines, one.lines_after,
            figure(one.checkpoint_kb, 0), figure(one.write_ms), figure(one.late_ms), figure(one.heartbeat_s, 2),
            figure(one.charge_s, 2), figure(one.cpu_s, 2), figure(one.asked_s, 2), figure(one.whole_s, 0),
        )
        for one in rows
    ]  # fmt: skip
    return markdown_page("A flight resumed after hours", machine_line(content), said, markdown_table(COLUMNS, shown))


def make_resume(
    counts: list[int], out: Path | None, *, minutes: float, hours: float, speedup: float, seed: int
) -> tuple[dict[str, object], str]:
    """Measure, and write resume.md and resume.json if requested; returns their content.

    Raises:
        BenchError: an expected event did not occur.
    """
    rows = [measure_resume(count, minutes=minutes, hours=hours, speedup=speedup, seed=seed) for count in counts]
    content: dict[str, object] = {
        "format": "faultline-bench-resume/1",
        "machine": machine(),
        "seed": seed,
        "rows": [asdict(one) | {"whole_s": one.whole_s} for one in rows],
    }
    text = resume_report(rows, machine())
    if out is not None:
        keep_result("resume", content, text, out)
    return content, text
