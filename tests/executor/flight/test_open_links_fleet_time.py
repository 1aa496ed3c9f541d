"""A flight and its simulated fleet, on a computer that makes one of them wait."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from executor.adapters import clock
from executor.adapters.clock import SystemClock, steady_s
from executor.adapters.mavlink.endpoints import open_mavlink_links
from executor.core.interface.commands import Level
from executor.core.interface.messages import Heartbeat, Message
from executor.core.interface.ports import LinkRequest
from executor.flight import open_links
from executor.flight.open_links import describe_slow_host, follow_fleet_time
from executor.runtime.procedures import wait_for
from executor.simulated.simulated_fleet import build_demo_site, fleet_of
from executor.site import site_model
from executor.site.site_file import Site, check_site
from simulator.testing import Fleet

SPEEDUP = 20.0
STALL_REAL_S = 0.4
"""Eight seconds of the flight."""


@dataclass
class Lines:
    """What the operator was told."""

    lines: list[str] = field(default_factory=list)

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        assert (level, at_s) == (Level.INFO, None)
        self.lines.append(text)


def site_at(speedup: float) -> Site:
    content = build_demo_site(network=None, radius_m=400, vehicles=2, speedup=speedup, autopilot="ardupilot")
    return check_site(content, "demo")


@contextmanager
def simulated(site: Site) -> Iterator[list[float]]:
    """Fly the site's fleet in a thread of its own; yields pauses that it is to make, in real seconds."""
    ground = site_model.load_site_model(site, Path())
    fleet = fleet_of(ground, speedup=site.flight.speedup, faults=(), seed=0, wind=1.0, failsafe=True)
    pauses: list[float] = []
    with Fleet(fleet, watch=lambda _: time.sleep(pauses.pop() if pauses else 0.0)):
        yield pauses


@dataclass
class Seen:
    """What a stall came to, in seconds of the flight."""

    passed_s: list[float] = field(default_factory=list)
    """Over a stall of one of the two."""
    silences_s: list[float] = field(default_factory=list)
    """Between two HEARTBEATs of a vehicle."""


async def stalled(site: Site, lines: Lines, pauses: list[float]) -> Seen:
    """Fly beside the fleet, and stand still three times: twice ourselves, once the fleet."""
    seen, last_s = Seen(), list[float]()
    async with follow_fleet_time(site, lines) as found:
        clock = SystemClock.start_on(site.flight.speedup, found.steady_s)
        order = LinkRequest(site.vehicle[0].link, site.vehicle[0].sysid)
        async with open_mavlink_links({"uav1": order}) as links:

            def heard(message: Message) -> None:
                if isinstance(message, Heartbeat):
                    last_s.append(clock.now_s())

            links["uav1"].listen(heard)
            assert await wait_for(links["uav1"], clock, lambda message: isinstance(message, Heartbeat), 200.0)
            await asyncio.sleep(0.5)
            del last_s[:-1]
            for ours in (True, False, True):
                before_s = clock.now_s()
                if ours:
                    time.sleep(STALL_REAL_S)  # noqa: ASYNC251 - the computer keeps this process waiting
                else:
                    pauses.append(STALL_REAL_S)
                    await asyncio.to_thread(time.sleep, STALL_REAL_S)
                seen.passed_s.append(clock.now_s() - before_s)
                await asyncio.sleep(4.0 / site.flight.speedup)
    seen.silences_s = [after_s - before_s for before_s, after_s in itertools.pairwise(last_s)]
    return seen


def test_a_stall_of_either_is_no_time_of_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(open_links, "WINDOW_S", 0.3)
    site, lines = site_at(SPEEDUP), Lines()
    with simulated(site) as pauses:
        seen = clock.run_on_fair_loop(stalled(site, lines, pauses))
    assert max(seen.passed_s) < 1.0, "of eight seconds each"
    assert max(seen.silences_s) < 2.0, "a HEARTBEAT a second"
    assert len(lines.lines) == 1
    assert lines.lines[0].endswith(" instead of 20x real time; results are unaffected")


def test_without_a_common_time_the_same_stalls_are_silences() -> None:
    """The yardstick of the test above: a ground station of another kind, as any loop but ours is."""
    site, lines = site_at(SPEEDUP), Lines()
    with simulated(site) as pauses:
        seen = asyncio.run(stalled(site, lines, pauses))
    assert max(seen.passed_s) > 5.0
    assert max(seen.silences_s) > 5.0
    assert lines.lines == []


def test_real_time_is_the_computers() -> None:
    async def look() -> None:
        async with follow_fleet_time(site_at(1.0), Lines()) as found:
            assert found.steady_s() == pytest.approx(steady_s(), abs=0.5)
            assert found.date_unix_s() is None

    clock.run_on_fair_loop(look())


def test_without_a_fleet_of_ours_the_time_is_the_computers() -> None:
    """A real autopilot in a simulation, or nobody yet."""

    async def look() -> None:
        async with follow_fleet_time(site_at(SPEEDUP), Lines()) as found:
            before_s, least_s, most_s = steady_s(), *(found.steady_s() for _ in range(2))
            after_s = steady_s()
            # Read between two looks at the computer's own, as slow as it may be.
            assert before_s <= least_s <= most_s <= after_s
            assert found.date_unix_s() is None

    clock.run_on_fair_loop(look())


def test_a_fleet_that_comes_later_and_ends_is_found_and_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(open_links, "CALL_AGAIN_S", 0.02)
    site = site_at(SPEEDUP)

    async def look() -> None:
        async with follow_fleet_time(site, Lines()) as found:
            for _ in range(2):
                with simulated(site):
                    await until(lambda: found.date_unix_s() is not None)
                    before_s = found.steady_s()
                    await asyncio.sleep(0.05)
                    assert found.steady_s() > before_s
                await until(lambda: found.date_unix_s() is None)

    clock.run_on_fair_loop(look())


async def until(so: Callable[[], bool]) -> None:
    while not so():  # noqa: ASYNC110 - nobody tells when
        await asyncio.sleep(0.01)


def test_the_lines_for_the_crew() -> None:
    assert (
        describe_slow_host(7.34, 20.0)
        == "host too slow: running at 7.3x instead of 20x real time; results are unaffected"
    )
