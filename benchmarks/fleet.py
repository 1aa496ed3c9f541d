"""Cost of a fleet for the ground station: one flight per number of vehicles, the executor held to one processor.

Each flight runs the whole executor as `faultline fly` does, in its own process on one processor; the simulated vehicles
have the others. The measurement covers receiving, deciding and recording; with a fault also re-planning for a fleet.
"""

from __future__ import annotations

import asyncio
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.browser import browser, oldest_shown_s
from benchmarks.codec_cost import measure_bare_codec_s
from benchmarks.errors import BenchError
from benchmarks.fleetsite import site_of, write_network
from benchmarks.garbage import FRAMES_S, Flood
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import figure, markdown_page, markdown_table
from benchmarks.store import keep_result
from benchmarks.virtual_flight import SilentConsole
from executor.adapters import clock
from executor.adapters.eventlog import LogHeader, read_head
from executor.adapters.interrupts import start_worker_pool
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport
from executor.core.interface.commands import Level
from executor.errors import ExecutorError
from executor.flight import run_flight as flying
from executor.flight.run_start import FlightRequest, write_run_start
from executor.simulated.simulated_fleet import run_simulated_fleet
from executor.site import site_model
from executor.site.site_file import Site, check_site
from executor.site.site_planning import DEFAULT, plan_site

COUNTS = (1, 10, 20, 50, 100)
PLAN_S = 5.0
WATCH_S = 0.005
"""Sleep of the loop's monitor: any lateness beyond it is time for which the loop was blocked."""
ENDS_S = 10.0
"""Real seconds in which a browser must report after the page has ended."""
LOOKS = 12
"""Number of memory samples, spread over a flight."""


@dataclass(frozen=True, slots=True)
class Burden:
    """Additional load of a flight."""

    faults: tuple[str, ...] = ()
    """As for `faultline simulate`."""
    garbage: float = 0.0
    """Foreign datagrams for each frame of the fleet's telemetry."""
    browsers: int = 0
    """Number of browsers that follow the page."""


NOTHING = Burden()


@dataclass(frozen=True, slots=True)
class FleetFlight:
    """One flight, measured from the take-off to the end of supervision."""

    vehicles: int
    minutes: float
    """Flight time."""
    speedup: float
    frames: int
    """Received from all vehicles."""
    missing: int
    """Frames sent according to the sequence numbers that never arrived."""
    events: int
    """In the event log."""
    faults: int
    """Declared faults."""
    replans: int
    cpu_s: float
    """Processor time of the executor's process."""
    codec_s: float
    """Processor time of pymavlink alone for decoding the same frames, in the same process."""
    blocked_ms: tuple[float, float, float]
    """Lateness of the monitor: 99 %, 99.99 % and maximum."""
    memory_mib: tuple[float, ...]
    """Resident memory, evenly spread over the flight."""
    garbage: int = 0
    """Foreign datagrams sent to the vehicles' ports."""
    shown_s: float | None = None
    """Maximum age of a state in a browser before the next one, in real seconds; None without browsers."""

    @property
    def cpu_ms(self) -> float:
        """Processor time per vehicle and second of flight, in milliseconds."""
        return 1e3 * self.cpu_s / (60.0 * self.minutes * self.vehicles)

    @property
    def growth_mib(self) -> float:
        """Growth of memory from the end of the first quarter to the end."""
        return self.memory_mib[-1] - self.memory_mib[len(self.memory_mib) // 4]


def measure_fleet(
    counts: Sequence[int], *, minutes: float, speedup: float, seed: int, burden: Burden = NOTHING
) -> list[FleetFlight]:
    """Fly once for each number of vehicles.

    A flight that could not begin is reported and left out.

    Raises:
        BenchError: none could.
    """
    flights = []
    for count in counts:
        print(f"{count} vehicles, {minutes:g} minutes at {speedup:g} times real time", file=sys.stderr, flush=True)
        # One process per flight, so that leftovers of one do not affect the next one's figures.
        with start_worker_pool(1) as pool:
            try:
                flights.append(pool.submit(fly_one, count, minutes, speedup, seed, burden).result())
            except ExecutorError as error:
                print(f"{count} vehicles: {error}", file=sys.stderr)
    if not flights:
        raise BenchError("fleet: expected at least one flight that could begin")
    return flights


def fly_one(vehicles: int, minutes: float, speedup: float, seed: int, burden: Burden = NOTHING) -> FleetFlight:
    """Fly one fleet; this runs in its own process."""
    with tempfile.TemporaryDirectory(prefix="faultline-fleet-") as folder:
        base, run = Path(folder), Path(folder) / "run"
        run.mkdir()
        write_network(base / "network.graph", vehicles, minutes, seed)
        site = check_site(site_of("network.graph", vehicles, speedup), "bench fleet")
        ground = site_model.load_site_model(site, base)
        plan = plan_site(ground, replace(DEFAULT, seconds=PLAN_S, seed=seed, all_vehicles=True), lambda _: None)
        order = FlightRequest(ground.site, base, ground, plan, run, lambda _: ())
        write_run_start(order)
        ours, others = _processors()
        watch = _Watch(minutes * 60.0 / speedup, ours)
        # The simulation and the planner's process start here, and stay off the executor's processor.
        os.sched_setaffinity(0, others)
        with run_simulated_fleet(run, burden.faults, seed), _borne(site, burden, watch.flood, seed) as browsers:
            # Lateness is measured, so the loop follows the computer's time, at any speed.
            flown = clock.run_on_fair_loop(
                _fly_watched(order, watch), lambda: asyncio.SelectorEventLoop(clock.FairSelector())
            )
            seen = [told.recv() for told in browsers if told.poll(ENDS_S)]
        head, launched_s, events = _read_launch(RunDirectory(run).events)
        began_usec = 1e6 * (head.began_unix_s + launched_s)
        rows = flown.vehicles
        return FleetFlight(
            vehicles=vehicles,
            minutes=watch.taken_s * speedup / 60.0,
            speedup=speedup,
            frames=sum(row.frames_received or 0 for row in rows),
            missing=sum(row.frames_missing or 0 for row in rows),
            events=events,
            faults=len(flown.faults),
            replans=len(flown.replans),
            cpu_s=watch.cpu_s,
            codec_s=measure_bare_codec_s(sorted(run.glob("*.tlog")), began_usec),
            blocked_ms=watch.find_blocked_ms(),
            memory_mib=tuple(watch.memory_mib),
            garbage=watch.garbage,
            shown_s=max((oldest_shown_s(one, head.began_unix_s, speedup, launched_s) for one in seen), default=None),
        )


@contextmanager
def _borne(site: Site, burden: Burden, flood: Flood, seed: int) -> Iterator[list[Connection]]:
    """Prepare a flood, and open browsers; yields their report connections."""
    with ExitStack() as stack:
        if burden.garbage > 0:
            a_second = burden.garbage * FRAMES_S * site.flight.speedup * len(site.vehicle)
            stack.enter_context(flood.ready([one.link.number for one in site.vehicle], a_second, seed))
        yield [stack.enter_context(browser(site.web.port)) for _ in range(burden.browsers)]


def _processors() -> tuple[set[int], set[int]]:
    """Return one processor for the executor and those for everything else."""
    every = sorted(os.sched_getaffinity(0))
    return {every[0]}, set(every[1:]) or {every[0]}


async def _fly_watched(order: FlightRequest, watch: _Watch) -> FlightReport:
    watching = asyncio.create_task(watch.run())
    try:
        return await flying.run_flight(order, watch)
    finally:
        watching.cancel()


class _Watch(SilentConsole):
    """An operator that confirms everything, watches the clock, and leaves when the time is over."""

    def __init__(self, lasts_real_s: float, processor: set[int]) -> None:
        self._lasts_s = lasts_real_s
        self._processor = processor
        self._began_s: float | None = None
        self._cpu_began_s = 0.0
        self._late_ms: list[float] = []
        self._left = False
        self._ended = False
        self.taken_s = 0.0
        self.cpu_s = 0.0
        self.flood = Flood()
        """Begins with the flight."""
        self.garbage = 0
        self.memory_mib: list[float] = []

    def find_blocked_ms(self) -> tuple[float, float, float]:
        """Return the monitor's lateness: 99 %, 99.99 % and maximum."""
        late = sorted(self._late_ms)
        return late[int(0.99 * len(late))], late[int(0.9999 * len(late))], late[-1]

    async def run(self) -> None:
        while True:
            asked_s = time.perf_counter()
            await asyncio.sleep(WATCH_S)
            # Blocking before the operator's confirmation is not part of the flight.
            if self._began_s is not None and asked_s >= self._began_s and not self._ended:
                now_s = time.perf_counter()
                self._late_ms.append(1e3 * (now_s - asked_s - WATCH_S))
                self._look(now_s - self._began_s)

    def _look(self, passed_s: float) -> None:
        while len(self.memory_mib) < LOOKS and passed_s >= (len(self.memory_mib) + 1) * self._lasts_s / LOOKS:
            self.memory_mib.append(_resident_mib())
        if passed_s >= self._lasts_s and not self._left:
            self._left = True
            os.kill(os.getpid(), signal.SIGINT)

    async def ask(self, question: str) -> bool:
        """Confirm; measurement begins with the last question."""
        return self.confirm(question) if "Take off" in question else True

    def confirm(self, question: str) -> bool:  # noqa: ARG002 - the console's signature
        for thread in Path("/proc/self/task").iterdir():  # the page's too
            os.sched_setaffinity(int(thread.name), self._processor)
        self._began_s, self._cpu_began_s = time.perf_counter(), time.process_time()
        self.flood.begin()
        return True

    def stop_drawing(self) -> None:
        if self._began_s is not None and not self._ended:
            self._ended = True
            self.taken_s = time.perf_counter() - self._began_s
            self.cpu_s = time.process_time() - self._cpu_began_s
            self.garbage = self.flood.count_sent()
            self.memory_mib.append(_resident_mib())

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        if level is Level.FAULT:
            print(f"{at_s or 0.0:8.1f} s  {text}", file=sys.stderr, flush=True)


def _resident_mib() -> float:
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return pages * resource.getpagesize() / 2**20


def _read_launch(log: Path) -> tuple[LogHeader, float, int]:
    """Return the log's header, the launch time, and the number of events since."""
    launched_s, events = 0.0, 0
    with log.open("rb") as file:
        for line in file:
            if b'"LaunchOrdered"' in line[:100]:
                launched_s, events = json.loads(line)["t_s"], 0
            events += b'"event":' in line[:60]
    return read_head(log), launched_s, events


COLUMNS = (
    "vehicles", "minutes", "faults", "re-plans", "frames a second", "frames lost", "events", "ms a vehicle and second",
    "times pymavlink alone", "of one core, %", "blocked at most, ms", "99.99 %, ms", "memory at a quarter, MiB",
    "at the end, MiB", "garbage a second", "state shown at most, s old",
)  # fmt: skip


def fleet_report(flights: Sequence[FleetFlight], content: dict[str, object]) -> str:
    """Return the page."""
    rows = [
        (
            one.vehicles, figure(one.minutes), one.faults, one.replans, figure(one.frames / (60 * one.minutes), 0),
            one.missing, one.events,
            figure(one.cpu_ms, 2), figure(one.cpu_s / one.codec_s, 1), figure(0.1 * one.cpu_ms * one.vehicles),
            figure(one.blocked_ms[2], 0), figure(one.blocked_ms[1], 0),
            figure(one.memory_mib[len(one.memory_mib) // 4], 0), figure(one.memory_mib[-1], 0),
            figure(one.garbage / (60 * one.minutes), 0), "" if one.shown_s is None else figure(one.shown_s, 2),
        )
        for one in flights
    ]  # fmt: skip
    said = (
        "One flight for each number of simulated ArduPilot vehicles, from take-off on, with everything that "
        "`faultline fly` does except the terminal display. The executor may use one core; the simulation and the "
        f"planner's process use the others. At {flights[0].speedup:g} times real time, so a second of computer time "
        "holds that many seconds of flight; the share of a core is for real time. `times pymavlink alone` is the "
        "executor's processor time divided by the time that pymavlink needs just to decode the same frames. `Blocked` "
        f"is the delay in waking a task that sleeps for {1e3 * WATCH_S:g} ms at a time, in computer time: it includes "
        "the time taken by other programs. `Garbage` is datagrams with noise, damaged frames and foreign frames, a "
        "third each, sent by a separate process to the vehicles' ports; `state shown` is the age of the state in a "
        "browser, in computer time, when the next one arrived."
    )
    parts = [machine_line(content), said, markdown_table(COLUMNS, rows)]
    if len(flights) > 1:
        parts.append("![Processor time, delays of the event loop and memory over the number of vehicles](fleet.png)")
    return markdown_page("A fleet and its ground station", *parts)


def make_fleet(
    counts: Sequence[int], out: Path | None, *, minutes: float, speedup: float, seed: int, burden: Burden = NOTHING
) -> tuple[dict[str, object], str]:
    """Measure, and write fleet.md and fleet.json, with a picture of several, if requested; returns their content."""
    flights = measure_fleet(counts, minutes=minutes, speedup=speedup, seed=seed, burden=burden)
    rows = [asdict(one) | {"cpu_ms": one.cpu_ms, "growth_mib": one.growth_mib} for one in flights]
    content: dict[str, object] = {
        "format": "faultline-bench-fleet/1",
        "machine": machine(),
        "seed": seed,
        "ordered": list(burden.faults),
        "garbage": burden.garbage,
        "browsers": burden.browsers,
        "rows": rows,
    }
    text = fleet_report(flights, machine())
    if out is not None:
        keep_result("fleet", content, text, out)
        if len(flights) > 1:
            draw_growth(flights, out / "fleet.png")
    return content, text


def draw_growth(flights: Sequence[FleetFlight], path: Path) -> None:
    """Draw processor time, the loop's delays and memory over the number of vehicles."""
    from matplotlib.figure import Figure

    from executor.analysis.pictures import save_figure
    from executor.analysis.pictures.style import COLOURS, FAINT, MARKERS, PAPER

    figure = Figure(figsize=(12.0, 3.8), facecolor=PAPER, layout="constrained")
    counts = [one.vehicles for one in flights]
    rows = (
        ("of one core at real time, %", {"": [0.1 * one.cpu_ms * one.vehicles for one in flights]}),
        ("the event loop blocked, ms", {
            "at most": [one.blocked_ms[2] for one in flights], "99.99 %": [one.blocked_ms[1] for one in flights],
            "99 %": [one.blocked_ms[0] for one in flights],
        }),
        ("resident memory at the end, MiB", {"": [one.memory_mib[-1] for one in flights]}),
    )  # fmt: skip
    for axes, (label, lines) in zip(figure.subplots(1, 3), rows, strict=True):
        for place, (name, values) in enumerate(lines.items()):
            axes.plot(counts, values, color=COLOURS[place], marker=MARKERS[place], label=name)
        axes.set(xlabel="vehicles", ylabel=label)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.grid(color=FAINT, alpha=0.3, lw=0.5)
        if len(lines) > 1:
            axes.legend(frameon=False)
    save_figure(figure, path)
