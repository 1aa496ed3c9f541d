"""Uploads over a bad link: faultline's own code and MAVSDK's, to the same simulated vehicle, against the lower bound.

The vehicle loses and delays datagrams, each way. Without loss the minimum is one round trip per item, as the vehicle
requests each item after it has the previous one.
"""

from __future__ import annotations

import asyncio
import os
import platform
import statistics
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from itertools import product

from benchmarks.mavsdk_upload import open_uploader
from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.adapters.mavsdk.mavsdk_link import MOST_AT_ONCE
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.ports import LinkRequest
from executor.protocols.machine import Accepted
from executor.protocols.mission_transfer import DownloadDialogue
from executor.runtime import procedures
from executor.runtime.dialogue import run_dialogue
from missions import Command, Dialect, Frame, MissionItem, dialect_for, find_mission_differences
from simulator.config import AutopilotKind, SimVehicle
from simulator.testing import ANY_PORT, fleet

ITEMS, LOSSES, DELAYS_S = (10, 40, 200), (0.0, 0.05, 0.2), (0.0, 0.05, 0.3)
AT_ONCE = 48
"""Parallel uploads: over a slow or lossy link they mostly wait, so many can be measured at once."""
NAME, SYSID, LAT_E7, LON_E7 = "uav1", 11, 503_457_490, 133_252_440
FIND_S = 60.0
IDLE_S = 2.0
"""Time beyond the vehicle's time-out of a failed upload."""
PINGS = 9
WATCH_S = 0.02


HEAD = (
    "Seconds from the first message to the acknowledgement, median of the accepted uploads; after it the number of "
    "uploads out of {repeats} that were accepted. faultline and MAVSDK {mavsdk} (MissionRaw, default time-outs) upload "
    "to the same simulated vehicle in the same run. If every item was requested and the acknowledgement got lost, "
    "faultline reads the mission back, and its time includes that. Loss and delay are each way; the simulation "
    "delivers delayed datagrams in steps of 50 ms. The floor is one round trip for the count and for each item without "
    "loss: the delay, and the fastest answer measured without delay. All vehicles and both programs share one process."
)
TAIL = (
    "`faultline bench upload --seed {seed}`, {took_s} s; Python {python}, {cores} cores; the longest time for which "
    "the process could not run was {longest_stall_s} s."
)


@dataclass(frozen=True, slots=True)
class UploadCase:
    """Items of an upload, and its link."""

    autopilot: str
    items: int
    loss: float
    """Share of datagrams lost, each way."""
    delay_s: float
    """Delay of every datagram, each way; the simulation delivers in steps of 50 ms."""


@dataclass(frozen=True, slots=True)
class UploadTiming:
    """The uploads of one program in one cell."""

    accepted_s: tuple[float, ...]
    """Real seconds of accepted uploads, from the first message to the acknowledgement."""
    failures: tuple[str, ...]
    """Failure reasons of the others, in the program's words."""

    @property
    def median_s(self) -> float | None:
        """Median of the accepted uploads."""
        return statistics.median(self.accepted_s) if self.accepted_s else None


@dataclass(frozen=True, slots=True)
class Row:
    """One cell, measured."""

    cell: UploadCase
    round_trip_s: float
    """Delay in both directions, plus the fastest of several requests and answers without any delay."""
    native: UploadTiming
    mavsdk: UploadTiming

    @property
    def floor_s(self) -> float:
        """One round trip for the count and for each item."""
        return (self.cell.items + 1) * self.round_trip_s


@dataclass(frozen=True, slots=True)
class Attempt:
    """One upload."""

    seconds: float
    failure: str
    """Reason; empty if it was accepted."""


@dataclass(frozen=True, slots=True)
class Measured:
    """All cells."""

    rows: tuple[Row, ...]
    took_s: float
    longest_stall_s: float
    """Longest stall of the process, with all vehicles in it: the noise of these figures."""


def measure_cases(cells: Sequence[UploadCase], repeats: int, seed: int, said: Callable[[str], None]) -> Measured:
    """Measure every cell; `said` receives the progress."""
    return asyncio.run(_measure(cells, repeats, seed, said))


async def _measure(cells: Sequence[UploadCase], repeats: int, seed: int, said: Callable[[str], None]) -> Measured:
    began_s, stalls_s = time.perf_counter(), [0.0]
    watch = asyncio.create_task(_watch(stalls_s))
    try:
        rows = await _rows(cells, repeats, seed, said)
    finally:
        watch.cancel()
    return Measured(tuple(rows), time.perf_counter() - began_s, stalls_s[0])


async def _watch(longest_s: list[float]) -> None:
    while True:
        began_s = time.perf_counter()
        await asyncio.sleep(WATCH_S)
        longest_s[0] = max(longest_s[0], time.perf_counter() - began_s - WATCH_S)


async def _rows(cells: Sequence[UploadCase], repeats: int, seed: int, said: Callable[[str], None]) -> list[Row]:
    answers_s = {kind: await _answer_s(kind, seed) for kind in dict.fromkeys(cell.autopilot for cell in cells)}
    room = asyncio.Semaphore(MOST_AT_ONCE)
    ended: dict[UploadCase, list[tuple[Attempt, Attempt]]] = {cell: [] for cell in cells}
    fast = [cell for cell in cells if not cell.loss and not cell.delay_s]
    slow = sorted((cell for cell in cells if cell not in fast), key=_expected_s, reverse=True)
    for cell in fast:  # depends on the computer's speed: one at a time
        for repeat in range(repeats):
            ended[cell].append(await _upload_with_both(cell, repeat, seed, room))
    gate = asyncio.Semaphore(AT_ONCE)

    async def one(cell: UploadCase, repeat: int) -> None:
        async with gate:
            ended[cell].append(await _upload_with_both(cell, repeat, seed, room))
        said(f"{sum(map(len, ended.values()))} of {len(cells) * repeats}")

    async with asyncio.TaskGroup() as tasks:
        for cell, repeat in product(slow, range(repeats)):
            tasks.create_task(one(cell, repeat))
    return [
        Row(
            cell,
            2 * cell.delay_s + answers_s[cell.autopilot],
            _timing([native for native, _ in ended[cell]]),
            _timing([mavsdk for _, mavsdk in ended[cell]]),
        )
        for cell in cells
    ]


def _expected_s(cell: UploadCase) -> float:
    return cell.items * (cell.delay_s + cell.loss)


def _timing(attempts: Sequence[Attempt]) -> UploadTiming:
    return UploadTiming(
        tuple(attempt.seconds for attempt in attempts if not attempt.failure),
        tuple(attempt.failure for attempt in attempts if attempt.failure),
    )


async def _upload_with_both(
    cell: UploadCase, repeat: int, seed: int, room: asyncio.Semaphore
) -> tuple[Attempt, Attempt]:
    """Upload with both programs to one vehicle, alternating which is first."""
    dialect = dialect_for(cell.autopilot)
    async with _vehicle(cell.autopilot, cell.loss, cell.delay_s, seed + repeat) as connection:
        attempts: dict[str, Attempt] = {}
        for name in ("native", "mavsdk") if repeat % 2 == 0 else ("mavsdk", "native"):
            # Different content each time: PX4 would ignore identical content.
            mission = _mission(dialect, cell.items, height_m=20.0 + len(attempts))
            if name == "native":
                attempts[name] = await _upload_with_own(connection, dialect, mission)
            else:
                async with room:
                    attempts[name] = await _upload_with_mavsdk(connection, mission)
            if attempts[name].failure:
                await asyncio.sleep(dialect.upload_silence_s + IDLE_S)
    return attempts["native"], attempts["mavsdk"]


async def _upload_with_own(connection: Connection, dialect: Dialect, items: tuple[MissionItem, ...]) -> Attempt:
    async with endpoints.open_mavlink_links({NAME: LinkRequest(connection, SYSID)}) as links:
        began_s = time.perf_counter()
        clock = SystemClock(1.0)
        ended = await procedures.upload_once(links[NAME], clock, dialect, items)
        failure = ended.reason
        if failure and ended.furthest == len(items) - 1:
            # As in flight: perhaps only the acknowledgement was lost, so the mission on board decides.
            back = await run_dialogue(DownloadDialogue(), links[NAME], clock)
            failure = failure if find_mission_differences(items, back.items, dialect) else ""
        return Attempt(time.perf_counter() - began_s, failure)


async def _upload_with_mavsdk(connection: Connection, items: tuple[MissionItem, ...]) -> Attempt:
    async with open_uploader(connection, SYSID, FIND_S) as uploader:
        began_s = time.perf_counter()
        failure = await uploader.upload(items)
        return Attempt(time.perf_counter() - began_s, failure)


async def _answer_s(autopilot: str, seed: int) -> float:
    """Return the minimum time of a request and its answer on a perfect link."""
    name, clock, taken_s = dialect_for(autopilot).ground_station_failsafe.timeout, SystemClock(1.0), list[float]()
    async with (
        _vehicle(autopilot, 0.0, 0.0, seed) as connection,
        endpoints.open_mavlink_links({NAME: LinkRequest(connection, SYSID)}) as links,
    ):
        while len(taken_s) < PINGS:
            began_s = time.perf_counter()
            ended = await procedures.read_parameter(links[NAME], clock, name)
            if isinstance(ended.outcome, Accepted) and ended.tries == 1:
                taken_s.append(time.perf_counter() - began_s)
    return min(taken_s)


@asynccontextmanager
async def _vehicle(autopilot: str, loss: float, delay_s: float, seed: int) -> AsyncIterator[Connection]:
    """Run a simulated vehicle on its pad behind a bad link; yields its connection."""
    vehicle = SimVehicle(NAME, SYSID, AutopilotKind(autopilot), ANY_PORT, LAT_E7 / 1e7, LON_E7 / 1e7, 300.0, seed=seed)
    async with fleet([vehicle], faults=[f"all:loss={loss}@0s", f"all:delay={delay_s}@0s"]) as living:
        yield Connection(Scheme.UDP_OUT, "127.0.0.1", living[0].port)


def _mission(dialect: Dialect, count: int, height_m: float) -> tuple[MissionItem, ...]:
    home = [MissionItem(0, Frame.GLOBAL, Command.NAV_WAYPOINT, x=LAT_E7, y=LON_E7)] if dialect.home_item else []
    takeoff = MissionItem(len(home), dialect.position_frame, Command.NAV_TAKEOFF, x=LAT_E7, y=LON_E7, z=height_m)
    places = [
        MissionItem(seq, dialect.position_frame, Command.NAV_WAYPOINT, x=LAT_E7 + 100 * seq, y=LON_E7, z=height_m)
        for seq in range(len(home) + 1, count - 1)
    ]
    land = MissionItem(count - 1, dialect.position_frame, Command.NAV_LAND, x=LAT_E7, y=LON_E7)
    return (*home, takeoff, *places, land)


def content_of(measured: Measured, repeats: int, seed: int) -> dict[str, object]:
    """Return the content of upload.json."""
    return {
        "format": "faultline-bench-upload/1",
        "repeats": repeats,
        "seed": seed,
        "took_s": round(measured.took_s, 1),
        "longest_stall_s": round(measured.longest_stall_s, 3),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "mavsdk": version("mavsdk"),
        "rows": [
            asdict(row) | {"floor_s": row.floor_s, "native_s": row.native.median_s, "mavsdk_s": row.mavsdk.median_s}
            for row in measured.rows
        ],
    }


def markdown_of(rows: Sequence[Row], content: dict[str, object]) -> str:
    """Return the content of upload.md."""
    lines = [
        "# Mission upload over a bad link",
        "",
        HEAD.format(**content),
        "",
        TAIL.format(**content),
    ]
    for autopilot in dict.fromkeys(row.cell.autopilot for row in rows):
        lines += [
            "", f"## {autopilot}", "",
            "| items | delay (ms) | loss (%) | floor (s) | faultline (s) | MAVSDK (s) | MAVSDK failures |",
            "| ---: | ---: | ---: | ---: | ---: | ---: | --- |",
        ]  # fmt: skip
        lines += [_line(row) for row in rows if row.cell.autopilot == autopilot]
    ours = [f"- {row.cell}: {reason}" for row in rows for reason in row.native.failures]
    return "\n".join([*lines, "", *(["faultline's own failures:", "", *ours, ""] if ours else [])])


def _line(row: Row) -> str:
    cell, reasons = row.cell, Counter(row.mavsdk.failures)
    why = ", ".join(f"{reason} ({times})" for reason, times in sorted(reasons.items()))
    case = f"| {cell.items} | {1e3 * cell.delay_s:.0f} | {100 * cell.loss:.0f} | {row.floor_s:.2f} |"
    return f"{case} {_format_timing(row.native)} | {_format_timing(row.mavsdk)} | {why} |"


def _format_timing(timing: UploadTiming) -> str:
    times = len(timing.accepted_s) + len(timing.failures)
    median = "-" if timing.median_s is None else f"{timing.median_s:.2f}"
    return f"{median} ({len(timing.accepted_s)}/{times})"


def measure_uploads(
    items: Sequence[int], losses: Sequence[float], delays_s: Sequence[float], *, repeats: int, seed: int
) -> tuple[dict[str, object], str]:
    """Measure every combination on both autopilots; returns the content of upload.json and of upload.md.

    Args:
        items: Numbers of items of a mission.
        losses: Shares of datagrams lost, each way.
        delays_s: Delays of every datagram, each way.
        repeats: Uploads of each program in each case.
        seed: Seed of the losses.
    """
    cells = [UploadCase(kind.value, *case) for kind in AutopilotKind for case in product(items, losses, delays_s)]
    measured = measure_cases(
        cells, repeats, seed, lambda text: print(f"\r{text} ", end="", file=sys.stderr, flush=True)
    )
    print(file=sys.stderr)
    content = content_of(measured, repeats, seed)
    return content, markdown_of(measured.rows, content)
