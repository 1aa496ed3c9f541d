"""A vehicle with two links: one dies while its mission is put on board, and the other one takes over."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import pytest

from benchmarks.virtual.radio import JoinedRadio, run_radios
from executor.adapters.clock import SystemClock
from executor.core.interface.commands import Say
from executor.core.interface.messages import DoubleHeard, Heartbeat, Message, Position
from executor.core.radio_budget import RadioShare
from executor.runtime import procedures
from executor.runtime.flight_loop import send_heartbeats
from executor.runtime.link_changes import SAYS_AGAIN_S, LinkChanges
from executor.runtime.procedures import UploadNeed, keep_asking_links
from missions import ARDUPILOT, PX4, Dialect, find_mission_differences
from missions.items import Command
from simulator.config import AutopilotKind, SimFleet
from simulator.fault_kinds import parse_fault
from simulator.fleet import build_vehicles
from simulator.streams import MESSAGE_NAMES
from simulator.virtual_loop import run_virtual
from tests.conformance.ways import route
from tests.simulator.harness import sim_vehicle

KINDS = {ARDUPILOT.name: AutopilotKind.ARDUPILOT, PX4.name: AutopilotKind.PX4}
DIALECTS = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
CONNECTIONS = ("udpin://127.0.0.1:20001", "udpin://127.0.0.1:20002")
LEGS = 40
SHARE = RadioShare(vehicles=4, is_radio=True, further=((CONNECTIONS[1], RadioShare()),))


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
        return [after - before for before, after in pairwise(at_s for at_s, one in self.heard if isinstance(one, kind))]


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
            await procedures.request_streams(sky.radio.end, clock, SHARE.choose_streams_hz(dialect, on_radio=False))
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
            sky.silence(link or 1 + CONNECTIONS.index(first))
        done = await upload
        assert done.accepted, done.reason
        took_s[0] = sky.clock.now_s() - began_s
        assert find_mission_differences(items, sky.radio.vehicle.autopilot.store.items, dialect) == ()

    over_two_links(dialect, radio, put)
    return took_s[0]


@DIALECTS
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("radio", ["sik,lte", "lte,sik-ecc-mended"])
def test_a_mission_is_on_board_soon_after_one_of_two_links_died_in_its_upload(
    dialect: Dialect, radio: str, share: float
) -> None:
    """PX4 keeps an upload that it waits for to itself for five seconds, and takes none over another link meanwhile."""
    whole_s = upload_s(dialect, radio)
    later_s = upload_s(dialect, radio, share * whole_s) - whole_s
    assert later_s < (3.0 if dialect is ARDUPILOT else 7.0)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_mission_file_continues_over_the_other_link(share: float) -> None:
    """To ArduPilot a file is the same whichever link its parts come over."""
    old = route(ARDUPILOT, LEGS)
    new = old[:10] + tuple(
        replace(item, z=item.z + 3.0) if item.command == Command.NAV_WAYPOINT else item for item in old[10:]
    )
    need, took_s = UploadNeed(alike=10), list[float]()

    async def put(sky: Sky, dies_s: float | None) -> None:
        link, clock = sky.radio.end, sky.clock
        assert (await procedures.upload_and_verify(link, clock, ARDUPILOT, old)).accepted
        began_s, first = clock.now_s(), sky.used
        upload = asyncio.ensure_future(procedures.upload_and_verify(link, clock, ARDUPILOT, new, need=need))
        if dies_s is not None:
            await asyncio.sleep(dies_s)
            sky.silence(1 + CONNECTIONS.index(first))
        assert (await upload).accepted
        took_s.append(clock.now_s() - began_s)
        assert find_mission_differences(new, sky.radio.vehicle.autopilot.store.items, ARDUPILOT) == ()

    over_two_links(ARDUPILOT, "sik,lte", partial(put, dies_s=None))
    over_two_links(ARDUPILOT, "sik,lte", partial(put, dies_s=share * took_s[0]))
    assert took_s[1] - took_s[0] < 3.0


@DIALECTS
def test_with_a_mesh_as_the_other_link_it_takes_as_long_as_over_that(dialect: Dialect) -> None:
    alone_s, whole_s = upload_s(dialect, "mesh,mesh"), upload_s(dialect, "lte,mesh")
    assert upload_s(dialect, "lte,mesh", 0.5 * whole_s) < alone_s + 10.0


@DIALECTS
def test_a_link_that_dies_is_no_silence(dialect: Dialect) -> None:
    async def lose(sky: Sky) -> None:
        first = sky.used
        sky.silence(1 + CONNECTIONS.index(first))
        await asyncio.sleep(2.0)
        assert sky.used != first
        await asyncio.sleep(20.0)
        assert sky.used != first

    sky = over_two_links(dialect, "sik,lte", lose)
    assert max(sky.gaps_s(Heartbeat)) < 3.0
    assert max(sky.gaps_s(Position)) < 0.6
    boots_s = [one.boot_s for _, one in sky.heard if isinstance(one, Position)]
    assert boots_s == sorted(boots_s)
    assert not any(isinstance(one, DoubleHeard) for _, one in sky.heard)


@DIALECTS
def test_each_link_is_asked_for_what_it_carries(dialect: Dialect) -> None:
    async def nothing(sky: Sky) -> None:
        radio, lte = sky.radio.vehicle.autopilot.schedules
        shares = (SHARE, SHARE.find_link_share(CONNECTIONS[1]))
        thin, full = (share.choose_streams_hz(dialect, on_radio=False) for share in shares)
        assert thin != full
        for schedule, asked_hz in ((radio, thin), (lte, full)):
            for message, rate_hz in asked_hz.items():
                if (name := MESSAGE_NAMES.get(message)) and sky.radio.vehicle.autopilot._build(name) is not None:
                    assert schedule.interval_s(name) == pytest.approx(1 / rate_hz)

    over_two_links(dialect, "", nothing)


@DIALECTS
def test_orders_and_questions_continue_over_the_other_link(dialect: Dialect) -> None:
    async def ask(sky: Sky) -> None:
        link, clock = sky.radio.end, sky.clock
        items = route(dialect, LEGS)
        assert (await procedures.upload_and_verify(link, clock, dialect, items)).accepted
        sky.silence(1 + CONNECTIONS.index(sky.used))
        read, found, began_s = asyncio.ensure_future(procedures.read_list(link, clock)), None, clock.now_s()
        rule = dialect.ground_station_failsafe
        found = await procedures.read_parameter(link, clock, rule.action)
        assert found.value is not None
        assert clock.now_s() - began_s < 4.0
        back = await read
        assert back is not None
        assert find_mission_differences(items, back, dialect) == ()

    over_two_links(dialect, "sik,lte", ask)


def test_the_crew_is_informed_once_and_not_at_every_change() -> None:
    said: list[tuple[float, Say]] = []

    async def lose(sky: Sky) -> None:
        changes = LinkChanges({"uav1": sky.radio.end})
        for step in range(900):
            if step % 60 == 0:
                number = 1 + CONNECTIONS.index(sky.used)
                sky.radio.vehicle.apply_injection(parse_fault(f"uav1.{number}:silent=4s@0s"))
            said.extend((sky.clock.now_s(), line) for line in changes.list_to_say(sky.clock.now_s()))
            await asyncio.sleep(0.1)

    over_two_links(PX4, "", lose)
    first, second = CONNECTIONS
    assert said[0][1].text == f"uav1: {first} silent, orders go over {second}"
    assert 2 <= len(said) <= 5
    assert all(after - before >= SAYS_AGAIN_S for before, after in pairwise(at_s for at_s, _ in said))
