"""A vehicle with two links: one dies while its mission is put on board, and the other one takes over."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

import pytest

from benchmarks.virtual.loop import run_virtual
from benchmarks.virtual.radio import JoinedRadio, run_radios
from executor.adapters.clock import SystemClock
from executor.core.interface.messages import DoubleHeard, Heartbeat, Message, Position, StatusText
from executor.core.radio_budget import RadioShare
from executor.runtime import procedures
from executor.runtime.flight_loop import send_heartbeats
from executor.runtime.procedures import keep_asking_links
from missions import ARDUPILOT, PX4, Dialect, find_mission_differences
from simulator.config import AutopilotKind, SimFleet
from simulator.fault_kinds import parse_fault
from simulator.fleet import build_vehicles
from tests.conformance.ways import route
from tests.simulator.harness import sim_vehicle

KINDS = {ARDUPILOT.name: AutopilotKind.ARDUPILOT, PX4.name: AutopilotKind.PX4}
DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
CONNECTIONS = ("udpin://127.0.0.1:20001", "udpin://127.0.0.1:20002")
LEGS = 40
SHARE = RadioShare(is_radio=True, others=(("link 2", RadioShare()),))


@dataclass
class Sky:
    """One vehicle, its two links, and what was heard of it."""

    radio: JoinedRadio
    clock: SystemClock
    heard: list[tuple[float, Message]] = field(default_factory=list)

    @property
    def used(self) -> str:
        return self.radio.end.connection

    def silence(self, link: int) -> None:
        self.radio.vehicle.apply_injection(parse_fault(f"uav1.{link}:silent@0s"))

    def gaps_s(self, kind: type[Message]) -> list[float]:
        times_s = [at_s for at_s, message in self.heard if isinstance(message, kind)]
        return [later_s - at_s for at_s, later_s in zip(times_s, times_s[1:], strict=False)]


def over_two_links(dialect: Dialect, radio: str, work: Callable[[Sky], Awaitable[None]]) -> Sky:
    """Do something with a vehicle that has been heard over both links for ten seconds."""

    async def fly() -> Sky:
        clock = SystemClock(1.0, 0.0, 0.0, asyncio.get_running_loop().time, (0.0, 0.0))
        config = sim_vehicle(KINDS[dialect.name], connection=CONNECTIONS, ready_after_s=1.0)
        [vehicle] = build_vehicles(SimFleet((config,), 1.0, (), radio))
        sky = Sky(JoinedRadio(vehicle, config.sysid), clock)
        sky.radio.end.listen(lambda message: sky.heard.append((clock.now_s(), message)))
        links = {"uav1": sky.radio.end}
        tasks = [
            asyncio.ensure_future(one)
            for one in (
                run_radios([sky.radio], lambda _: None),
                send_heartbeats(links, clock),
                keep_asking_links(links, clock, {"uav1": (dialect, SHARE)}),
            )
        ]
        try:
            await procedures.wait_for(sky.radio.end, clock, lambda one: isinstance(one, Heartbeat), 10.0)
            await procedures.request_streams(sky.radio.end, clock, dialect, SHARE)
            await asyncio.sleep(10.0)
            await work(sky)
            return sky
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return run_virtual(fly)


def upload_s(dialect: Dialect, radio: str, dies_s: float | None = None, link: int | None = None) -> float:
    """Return how long a mission takes to be on board and proven; the link in use, or that one, dies meanwhile."""
    took_s = [0.0]
    items = route(dialect, LEGS)

    async def put(sky: Sky) -> None:
        began_s, first = sky.clock.now_s(), sky.used
        upload = asyncio.ensure_future(procedures.upload_and_verify(sky.radio.end, sky.clock, dialect, items))
        if dies_s is not None:
            await asyncio.sleep(dies_s)
            assert not upload.done()
            sky.silence(link or int(first[-1]))
        done = await upload
        assert done.accepted, done.reason
        took_s[0] = sky.clock.now_s() - began_s
        assert find_mission_differences(items, sky.radio.vehicle.autopilot.store.items, dialect) == ()

    over_two_links(dialect, radio, put)
    return took_s[0]


if __name__ == "__main__":

    async def note(sky: Sky) -> None:
        print(
            "   used",
            sky.used,
            [(m.connection, m.heard_age_s, m.loss) for m in sky.radio.end.describe_links()],
            "beat gap",
            max(sky.gaps_s(Heartbeat)),
            "pos gap",
            max(sky.gaps_s(Position)),
            "double",
            [m for _, m in sky.heard if isinstance(m, DoubleHeard)],
        )
        boots = [m.boot_s for _, m in sky.heard if isinstance(m, Position)]
        print("   back", sum(b < a for a, b in zip(boots, boots[1:])), len(boots), sky.radio.end._measures)
        sky.silence(1)
        t = sky.clock.now_s()
        n = len(sky.heard)
        await asyncio.sleep(10.0)
        sky.heard[:n] = []
        print(
            "   after",
            sky.used,
            "gap",
            max(b - a for (a, _), (b, _) in zip([(t, 0)] + sky.heard, sky.heard)),
            "beat",
            max(sky.gaps_s(Heartbeat)),
        )

    for dialect in (ARDUPILOT, PX4):
        for radio in ("mesh", "sik-ecc-mended", "sik", "lte"):
            alone = upload_s(dialect, f"{radio},{radio}")
            print(dialect.name, radio, "both", round(alone, 2))
        for radio in ("sik,lte", "sik-ecc-mended,mesh", "mesh,lte"):
            print(dialect.name, radio)
            over_two_links(dialect, radio, note)
