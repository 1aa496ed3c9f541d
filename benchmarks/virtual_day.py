"""A day of several sorties in virtual time: its crew swaps packs, vehicles crash, the ground station dies."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.pad_crew import Packs, PadCrew
from benchmarks.virtual.memory_flight import run_until
from benchmarks.virtual_flight import STEP_S, VirtualRun
from executor.core.context import Context
from executor.core.interface.events import Reopened
from executor.core.state.fleet_state import FleetState
from executor.flight.flight_recorder import InheritedRecord, decode_body, encode_body
from executor.runtime.flight_loop import Flight
from missions import DayPlanFile
from simulator.fault_kinds import parse_fault

AWAY_S = 15.0
"""Time for which a dead ground station is away."""
PATIENCE_S = 10.0
"""Time for which it waits for the first answer after its return."""
FALLS_FROM_M = 10.0


def round_trip_state(state: FleetState) -> FleetState:
    """Return a state after a round trip through a checkpoint."""
    return decode_body(encode_body(state, InheritedRecord()))[0]


@dataclass(frozen=True, slots=True)
class DayScenario:
    """A day of several sorties: plan, crew and failures."""

    day: DayPlanFile
    packs: Packs
    """Packs that the crew installs, in order."""
    losses: Sequence[tuple[float, str]] = ()
    """Flight time in seconds, and the vehicle that then crashes, as soon as it is in the air."""
    away_s: Sequence[float] = ()
    """Times at which the ground station dies, between re-plans."""


class VirtualDay(VirtualRun):
    """A day in progress: `fly_virtual` makes it with `make=partial(VirtualDay, scenario)`."""

    def __init__(self, scenario: DayScenario, *flight: Any) -> None:  # noqa: ANN401 - those of any other run
        """Prepare the day, and its crew."""
        super().__init__(*flight, day=scenario.day)
        self._scenario = scenario
        self._crew = PadCrew(self._vehicles, scenario.packs)
        self._losses = sorted(scenario.losses)

    async def _supervise(self, context: Context, state: FleetState, until_s: float) -> tuple[Flight, bool]:
        flight, reopened = self._begin_loop(context, state), None
        for away_s in sorted(self._scenario.away_s):
            if await self._run_until_absence(flight, self._launched_s + away_s, reopened):
                return flight, True
            self.flight, reopened = None, Reopened(0.0, AWAY_S, ())
            self._stop_heartbeats()
            await asyncio.sleep(AWAY_S)
            self._start_heartbeats()
            flight = self._begin_loop(context, round_trip_state(flight.state))
        return flight, await run_until(flight, until_s, reopened, PATIENCE_S)

    async def _run_until_absence(self, flight: Flight, at_s: float, reopened: Reopened | None) -> bool:
        """Supervise until the ground station dies; returns whether the day ended before."""
        flying = asyncio.create_task(flight.run(reopened, PATIENCE_S))
        try:
            await asyncio.wait({flying}, timeout=at_s - asyncio.get_running_loop().time())
            while not flying.done() and flight.state.replanning.replan is not None:
                await asyncio.wait({flying}, timeout=STEP_S)
            return flying.done()
        finally:
            flying.cancel()
            await asyncio.gather(flying, return_exceptions=True)

    def _after_step(self, now_s: float) -> None:
        super()._after_step(now_s)
        if self.flight is not None and self._launched_s:
            self._crew.attend(self.flight, now_s)
        if self._losses and self._launched_s and now_s - self._launched_s >= self._losses[0][0]:
            self._crash_vehicle(self._losses[0][1])

    def _crash_vehicle(self, name: str) -> None:
        """Crash a vehicle, once it is well in the air."""
        frame = self._vehicles[name].autopilot.frame
        if frame.crashed_s is None and frame.body.up_m > FALLS_FROM_M:
            del self._losses[0]
            self._vehicles[name].apply_injection(parse_fault(f"{name}:crash@0s"))
