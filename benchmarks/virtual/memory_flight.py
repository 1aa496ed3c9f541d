"""Common code of all flights in virtual time: a fleet in memory, a ground station, and a record of both."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress

from benchmarks.virtual.radio import MemoryRadio, run_radios
from executor.adapters.clock import SystemClock
from executor.core.context import Context
from executor.core.interface.commands import Say
from executor.core.interface.events import Event, Reopened
from executor.core.interface.ports import EventSink, OpenLink, Solver
from executor.core.state.fleet_state import FleetState
from executor.runtime.flight_loop import Flight, Observer, send_heartbeats
from simulator.autopilot import STEP_S
from simulator.truth import Truth


class NullEventSink:
    """`ports.EventSink` that keeps nothing."""

    def write(self, event: Event, now_s: float) -> None:
        """Discard an event."""

    async def settle(self) -> None:
        """Do nothing: no event is pending."""


class MemoryFlight:
    """A ground station and its fleet in one process, by the running loop's time; subclasses add the events."""

    step_s = STEP_S
    """Simulation time between two reads of the vehicles' output."""

    def __init__(self, radios: Mapping[str, MemoryRadio], solver: Solver, sink: EventSink) -> None:
        """Prepare; the time begins with `live`.

        Args:
            radios: Link of every vehicle, by name.
            solver: Solver for re-plans.
            sink: Where events are written.
        """
        self.radios, self.solver, self.sink = radios, solver, sink
        self.clock = SystemClock(1.0, 0.0, 0.0, lambda: asyncio.get_running_loop().time(), (0.0, 0.0))
        self.flight: Flight | None = None
        """None before it begins, and while the ground station is away."""
        self.truths: list[Truth] = []
        """True events; times are seconds of the flight's clock."""
        self.said: list[tuple[float, Say]] = []
        """The lines for the crew, by the flight's clock."""
        self._heartbeats: asyncio.Task[None] | None = None

    @property
    def links(self) -> dict[str, OpenLink]:
        """The ground station's end of every radio."""
        return {name: radio.end for name, radio in self.radios.items()}

    @asynccontextmanager
    async def live(self) -> AsyncIterator[None]:
        """Run the vehicles and the ground station's reception inside the block; their errors are raised."""
        living = asyncio.create_task(run_radios(self.radios.values(), self._after_step, every_s=self.step_s))
        self._start_heartbeats()
        try:
            yield
        finally:
            self._stop_heartbeats()
            living.cancel()
            with suppress(asyncio.CancelledError):
                await living

    def _start_heartbeats(self) -> None:
        self._heartbeats = asyncio.create_task(send_heartbeats(self.links, self.clock))

    def _stop_heartbeats(self) -> None:
        if self._heartbeats is not None:
            self._heartbeats.cancel()

    def _after_step(self, now_s: float) -> None:  # noqa: ARG002 - subclasses go by it
        """Record true events of a step."""
        for radio in self.radios.values():
            self.truths += radio.drain_truths()

    def _begin_flight(
        self, context: Context, state: FleetState, applied: Callable[[Event, FleetState, float], None] = lambda *_: None
    ) -> Flight:
        """Return the flight loop over the present links."""
        observer = Observer(lambda line, at_s: self.said.append((at_s, line)), applied)
        self.flight = Flight(context, state, self.links, self.clock, self.sink, self.solver, observer)
        return self.flight


async def run_until(flight: Flight, until_s: float, reopened: Reopened | None = None, patience_s: float = 0.0) -> bool:
    """Supervise to the end, or stop at a time of the running loop; returns whether it ended regularly."""
    flying = asyncio.create_task(flight.run(reopened, patience_s))
    try:
        async with asyncio.timeout_at(until_s):
            await asyncio.shield(flying)
    except TimeoutError:
        flight.stop_supervising()
        with suppress(asyncio.CancelledError):
            await flying
        return False
    finally:
        flying.cancel()
    return True
