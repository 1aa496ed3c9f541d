"""Three vehicles behind one radio of 2 kB/s: everything is asked, set and put on board that is so over a fast link."""

from __future__ import annotations

import asyncio
import random
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pytest

from benchmarks.virtual.loop import run_virtual
from benchmarks.virtual.radio import MemoryRadio
from benchmarks.virtual_flight import SilentConsole
from executor.adapters.clock import SystemClock
from executor.core.context import Context
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.preflight import onboard_failsafes
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.flight.preparation import (
    apply_changes,
    build_context_and_checklist,
    interview_vehicles,
    read_changes,
    upload_first_missions,
)
from executor.flight.run_start import FlightRequest
from executor.runtime.flight_loop import send_heartbeats
from executor.simulated.simulated_fleet import fleet_of
from missions import dialect_for
from simulator.config import AutopilotKind, SimVehicle
from simulator.fleet import Channel, LinkCondition, SimulatedVehicle
from simulator.params import defaults_for
from tests.benchmarks.virtual.short_line import shared, short_ground

STEP_S = 0.05
MISSION_ITEM_INT = 73
FAST, SLOW = LinkCondition(), LinkCondition(rate_bytes_s=2000.0, delay_s=0.3)
LOSSY = replace(SLOW, loss=0.2)
FENCES = {
    "ardupilot": {"FENCE_ENABLE": 1.0, "FENCE_RADIUS": 60.0, "FENCE_ALT_MAX": 25.0},
    "px4": {"GF_MAX_HOR_DIST": 60.0, "GF_MAX_VER_DIST": 25.0},
}
AUTOPILOTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])


class _Frame(bytes):
    """A datagram that knows which vehicle it is from, or for."""

    name: str
    up: bool

    @classmethod
    def of(cls, datagram: bytes, name: str, *, up: bool) -> _Frame:
        frame = cls(datagram)
        frame.name, frame.up = name, up
        return frame


class _End(MemoryRadio):
    """One vehicle's end of it."""

    def __init__(self, vehicle: SimulatedVehicle, sysid: int, send: Callable[[bytes], None]) -> None:
        self._send = send
        super().__init__(vehicle, sysid)

    def write(self, frame: bytes) -> bool:
        self._send(frame)
        return True


class SharedRadio:
    """One radio for everybody and both directions: what one says waits behind what the others say."""

    def __init__(self, vehicles: Mapping[str, tuple[SimulatedVehicle, int]], condition: LinkCondition) -> None:
        self.vehicles = {name: vehicle for name, (vehicle, _) in vehicles.items()}
        self._ends = {
            name: _End(vehicle, sysid, partial(self._send, name)) for name, (vehicle, sysid) in vehicles.items()
        }
        self.links = {name: end.link for name, end in self._ends.items()}
        self._air = Channel(condition, random.Random(7))
        self._now_s = 0.0
        self.items: Counter[tuple[str, int]] = Counter()
        """How often each item of a mission was sent."""
        for end in self._ends.values():
            end.stop_unread_streams()

    def _send(self, name: str, frame: bytes) -> None:
        if int.from_bytes(frame[7:10], "little") == MISSION_ITEM_INT:
            self.items[name, int.from_bytes(frame[38:40], "little")] += 1
        self._air.offer(_Frame.of(frame, name, up=True), self._now_s)

    def pass_on(self, now_s: float) -> None:
        """Live until now."""
        self._now_s = now_s
        for name, vehicle in self.vehicles.items():
            vehicle.advance(now_s)
            self._carry(name)
        for frame in self._air.take_due(now_s):
            assert isinstance(frame, _Frame)
            if frame.up:
                self.vehicles[frame.name].receive(frame)
                self._carry(frame.name)
            else:
                self._ends[frame.name].receive(frame)

    def _carry(self, name: str) -> None:
        for datagram in self.vehicles[name].drain():
            self._air.offer(_Frame.of(datagram, name, up=False), self._now_s)


@dataclass(frozen=True)
class Prepared:
    """All that is known before a take-off."""

    facts: Mapping[str, VehicleFacts]
    context: Context
    found: list[Check]
    radio: SharedRadio

    @property
    def stops(self) -> list[str]:
        return [check.text for check in self.found if check.severity is Severity.STOP]

    def lines(self, code: CheckCode) -> list[tuple[Severity, str, str]]:
        return [(check.severity, check.subject, check.text) for check in self.found if check.code is code]


def prepared(
    folder: Path, autopilot: str, condition: LinkCondition, parameters: Mapping[str, float], *lacks: str
) -> Prepared:
    """Return three vehicles after their checklist, with their RTL heights set and their missions on board."""
    ground = short_ground(folder, 3, autopilot)
    order = FlightRequest(ground.site, folder, ground, shared(ground), folder, lambda _: ())

    async def prepare() -> Prepared:
        clock = SystemClock(1.0, 0.0, 0.0, asyncio.get_running_loop().time, (0.0, 0.0))
        fleet = fleet_of(ground, speedup=1.0, faults=(), seed=1, wind=1.0, failsafe=True)
        vehicles = {}
        for one in fleet.vehicles:
            vehicle = SimulatedVehicle(replace(one, parameters={**one.parameters, **parameters}))
            vehicle.autopilot.params.hidden |= {*lacks}
            vehicles[one.name] = (vehicle, one.sysid)
        radio = SharedRadio(vehicles, replace(condition))
        tasks = [asyncio.create_task(_live(radio)), asyncio.create_task(send_heartbeats(radio.links, clock))]
        try:
            facts = await interview_vehicles(order, radio.links, clock, SilentConsole())
            context, boards, found = build_context_and_checklist(order, facts)
            proposal = await read_changes(context, radio.links, clock)
            found += proposal.checks
            if not any(check.severity is Severity.STOP for check in found):
                found += await apply_changes(folder, proposal, context, radio.links, clock, SilentConsole())
                await upload_first_missions(context, radio.links, clock, boards, SilentConsole())
            return Prepared(facts, context, found, radio)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return run_virtual(prepare)


async def _live(radio: SharedRadio) -> None:
    loop, step = asyncio.get_running_loop(), 0
    while True:
        step += 1
        radio.pass_on(step * STEP_S)
        await asyncio.sleep(max(0.0, (step + 1) * STEP_S - loop.time()))


@AUTOPILOTS
@pytest.mark.parametrize("condition", [SLOW, LOSSY], ids=["slow", "slow and lossy"])
def test_everything_is_known_and_set_and_on_board(autopilot: str, condition: LinkCondition, tmp_path: Path) -> None:
    fast, slow = (prepared(tmp_path, autopilot, one, FENCES[autopilot]) for one in (FAST, condition))
    assert slow.stops == []
    for name, facts in slow.facts.items():
        assert not facts.unread
        assert facts.parameters == fast.facts[name].parameters
        rule, wanted_m = dialect_for(autopilot).return_parameters, slow.context.return_height_m(name)
        assert slow.radio.vehicles[name].autopilot.params[rule.height] * rule.unit_m == pytest.approx(wanted_m, abs=0.1)
    assert slow.lines(CheckCode.GEOFENCE) == fast.lines(CheckCode.GEOFENCE)
    assert len(slow.lines(CheckCode.GEOFENCE)) == 6
    assert max(fast.radio.items.values()) == 1
    if condition is SLOW:
        assert max(slow.radio.items.values()) <= 2


@AUTOPILOTS
def test_what_is_not_there_is_told_from_what_is_lost(autopilot: str, tmp_path: Path) -> None:
    absent = {"ardupilot": "FENCE_AUTOENABLE", "px4": "COM_FLTT_LOW_ACT"}[autopilot]
    slow = prepared(tmp_path, autopilot, SLOW, {}, absent)
    assert slow.stops == []
    assert all(not facts.unread and absent not in facts.parameters for facts in slow.facts.values())


@AUTOPILOTS
def test_who_answers_no_question_does_not_fly(autopilot: str, tmp_path: Path) -> None:
    """Nobody knows whether it is the radio: what its failsafes do, what fences it has, and where its RTL leads."""
    names = defaults_for(SimVehicle("uav1", 1, AutopilotKind(autopilot), "udpin://127.0.0.1:1", 49.6, 15.6, 450.0), 5e3)
    mute = prepared(tmp_path, autopilot, SLOW, {}, *names)
    asked = len(onboard_failsafes.list_preflight_parameters(dialect_for(autopilot)))
    assert all((len(facts.unread), facts.parameters) == (asked, {}) for facts in mute.facts.values())
    codes = {check.code for check in mute.found if check.severity is Severity.STOP}
    assert {CheckCode.LINK_FAILSAFE, CheckCode.BATTERY_FAILSAFE, CheckCode.GEOFENCE, CheckCode.RTL_ALTITUDE} <= codes
    assert not mute.radio.items, "nothing is put on board"
