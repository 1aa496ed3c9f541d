"""What every link must do with every vehicle; the links are the same to whoever uses them."""

from __future__ import annotations

import asyncio

import pytest

from executor.core import radio_budget
from executor.core.interface.commands import SendHome
from executor.core.interface.messages import Heartbeat, Position, SendCommand
from executor.protocols import vehicle_commands
from executor.protocols.machine import Accepted
from executor.protocols.mission_transfer import DownloadDialogue
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime import procedures, vehicle_preflight
from executor.runtime.dialogue import run_dialogue
from missions import find_mission_differences
from tests.conformance.ways import WAYS, Ground, Way, route, station
from tests.patience import PATIENCE_S
from tests.ports import free_port
from tests.simulator.harness import LAT_DEG, LON_DEG

pytestmark = pytest.mark.asyncio
every_way = pytest.mark.parametrize("way", WAYS, ids=str)
LOSSY = [way for way in WAYS if way.vehicles.lossy]
ONE = 11
SEVERAL = (11, 12, 13)
NO_COMMAND = 31_999


async def heard(ground: Ground, sysid: int = ONE, *, within_real_s: float = PATIENCE_S) -> bool:
    return await procedures.wait_for(
        ground.links[sysid],
        ground.clock,
        lambda message: isinstance(message, Heartbeat),
        within_real_s * ground.clock.speedup,
    )


@every_way
async def test_a_vehicle_is_heard_and_interviewed(way: Way) -> None:
    port = free_port()
    async with way.vehicles.start(port, [ONE], []), station(way, port, [ONE]) as ground:
        link = ground.links[ONE]
        await vehicle_preflight.wait_for_vehicle(
            "uav", f"udpin://127.0.0.1:{port}", ONE, link, PATIENCE_S, ground.clock
        )
        facts = await vehicle_preflight.interview_vehicle(
            "uav", link, ground.clock, way.vehicles.dialect, 100.0, lambda _: None
        )
        assert (facts.heartbeat.autopilot, facts.heartbeat.vehicle_type) == (way.vehicles.autopilot, way.vehicles.kind)
        assert (facts.position.lat_deg, facts.position.lon_deg) == pytest.approx((LAT_DEG, LON_DEG), abs=1e-6)
        assert 99 <= facts.remaining_pct <= 100
        rule = way.vehicles.dialect.ground_station_failsafe
        assert facts.parameters[rule.action] == rule.action_return
        assert facts.parameters[rule.timeout] == pytest.approx(rule.timeout_s, abs=0.5)
        assert link.counts.received > 5
        assert not link.counts.missing


@every_way
async def test_a_mission_reads_back_as_it_was_sent_and_so_does_the_next(way: Way) -> None:
    port, dialect = free_port(), way.vehicles.dialect
    async with way.vehicles.start(port, [ONE], []), station(way, port, [ONE]) as ground:
        assert await heard(ground)
        for legs in (9, 3, 3):
            items = route(dialect, legs)
            done = await procedures.upload_and_verify(ground.links[ONE], ground.clock, dialect, items)
            assert done.accepted, done.reason
            back = await run_dialogue(DownloadDialogue(), ground.links[ONE], ground.clock)
            assert isinstance(back.outcome, Accepted)
            assert find_mission_differences(items, back.items, dialect) == ()


@every_way
async def test_parameters_are_read_and_set_exactly(way: Way) -> None:
    port = free_port()
    async with way.vehicles.start(port, [ONE], []), station(way, port, [ONE]) as ground:
        assert await heard(ground)
        link, clock = ground.links[ONE], ground.clock
        for name, wanted, kind in way.vehicles.parameters:
            before = await procedures.read_parameter(link, clock, name)
            assert before.value is not None
            assert before.value.value not in {0.0, wanted}
            done = await procedures.set_parameter(link, clock, name, wanted, before.value.kind)
            assert done.accepted, done.reason
            after = await procedures.read_parameter(link, clock, name)
            assert after.value is not None
            assert (after.value.value, after.value.kind in {6, 9}) == (wanted, kind in {6, 9})


@every_way
async def test_a_command_is_acknowledged_and_an_unknown_one_is_not_accepted(way: Way) -> None:
    port = free_port()
    async with way.vehicles.start(port, [ONE], []), station(way, port, [ONE]) as ground:
        assert await heard(ground)
        link, clock = ground.links[ONE], ground.clock
        interval = vehicle_commands.set_message_interval(radio_budget.GLOBAL_POSITION_INT, 200_000.0)
        assert (await procedures.send_order(link, clock, CommandDialogue(interval, "stream"))).accepted
        refused = await procedures.send_order(link, clock, CommandDialogue(SendCommand(NO_COMMAND), "nonsense"))
        assert not refused.accepted
        assert refused.reason.startswith("nonsense: ")


@pytest.mark.parametrize("way", LOSSY, ids=str)
async def test_a_mission_is_started_and_flown(way: Way) -> None:
    port, dialect = free_port(), way.vehicles.dialect
    async with way.vehicles.start(port, [ONE], []), station(way, port, [ONE]) as ground:
        assert await heard(ground)
        link, clock = ground.links[ONE], ground.clock
        interval = vehicle_commands.set_message_interval(radio_budget.GLOBAL_POSITION_INT, 200_000.0)
        assert (await procedures.send_order(link, clock, CommandDialogue(interval, "stream"))).accepted
        assert (await procedures.upload_and_verify(link, clock, dialect, route(dialect))).accepted
        done = await procedures.arm_and_start(link, clock, dialect)
        assert done.accepted, done.reason
        assert await procedures.wait_for(
            link, clock, lambda message: isinstance(message, Position) and message.alt_rel_m > 5.0, 60.0
        )
        assert (await procedures.give_order(link, clock, dialect, SendHome("uav1"))).accepted


@every_way
async def test_a_link_that_is_lost_is_silent_and_comes_back_by_itself(way: Way) -> None:
    port = free_port()
    # MAVSDK calls a system disconnected after 3 s.
    lost_real_s = 3.5 if way.link == "mavsdk" else 1.0
    async with station(way, port, [ONE]) as ground:
        async with way.vehicles.start(port, [ONE], []):
            assert await heard(ground)
        await heard(ground, within_real_s=0.2)  # what was under way arrives
        assert not await heard(ground, within_real_s=lost_real_s)
        async with way.vehicles.start(port, [ONE], []):
            assert await heard(ground)
            done = await procedures.upload_and_verify(
                ground.links[ONE], ground.clock, way.vehicles.dialect, route(way.vehicles.dialect)
            )
            assert done.accepted, done.reason


@every_way
async def test_several_vehicles_on_one_port_get_each_its_own_mission(way: Way) -> None:
    port, dialect = free_port(), way.vehicles.dialect
    async with way.vehicles.start(port, SEVERAL, []), station(way, port, SEVERAL) as ground:
        missions = {sysid: route(dialect, 4 * number) for number, sysid in enumerate(SEVERAL, start=1)}

        async def one(sysid: int) -> procedures.ProcedureResult:
            assert await heard(ground, sysid)
            return await procedures.upload_and_verify(ground.links[sysid], ground.clock, dialect, missions[sysid])

        done = await asyncio.gather(*(one(sysid) for sysid in SEVERAL))
        assert [one.accepted for one in done] == [True] * len(SEVERAL), done
        for sysid in SEVERAL:
            back = await run_dialogue(DownloadDialogue(), ground.links[sysid], ground.clock)
            assert len(back.items) == len(missions[sysid])
        assert [ground.links[sysid].counts.foreign for sysid in SEVERAL] == [0, 0, 0]


@pytest.mark.parametrize("faults", [["loss=0.2"], ["duplicate=0.5"], ["reorder=0.3", "delay=0.1"]], ids=" ".join)
@pytest.mark.parametrize("way", LOSSY, ids=str)
async def test_a_mission_gets_on_board_over_a_bad_link(way: Way, faults: list[str]) -> None:
    port, dialect = free_port(), way.vehicles.dialect
    specs = [f"all:{fault}@0s" for fault in faults]
    async with way.vehicles.start(port, [ONE], specs), station(way, port, [ONE]) as ground:
        assert await heard(ground)
        done = await procedures.upload_and_verify(ground.links[ONE], ground.clock, dialect, route(dialect, 4))
        assert done.accepted, done.reason
