"""A wider fence goes on board before a new mission, and is never changed while a person has the vehicle."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from executor.core.context import FenceRules
from executor.core.interface.messages import MissionCount
from executor.core.state.vehicle_state import Stage
from missions import MissionKind, ModeNumber
from missions.fences import parse_outlines
from tests.executor.builders import Fleet, fleet_of
from tests.executor.runtime.test_flight_loop import LOSSY, Sky, flying
from tests.fakes.link import CLEAN, Air
from tests.fakes.vehicle import DENIED

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

FENCE = MissionKind.FENCE
STICKS = {"ardupilot": ModeNumber(5, 5), "px4": ModeNumber(3 << 16, 3)}
"""LOITER and POSCTL."""


def fenced(autopilot: str) -> Fleet:
    ready = fleet_of(autopilot=autopilot)
    return replace(ready, context=replace(ready.context, fencing=FenceRules(True, 20.0, 10.0, "keep", "pad")))


def uploads(sky: Sky, name: str, kind: MissionKind) -> list[int]:
    """Return where in all that was sent to a vehicle an upload was announced."""
    sent = enumerate(message for _, message in sky.links[name].sent)
    return [index for index, one in sent if isinstance(one, MissionCount) and one.kind is kind]


@pytest.mark.parametrize("air", [CLEAN, LOSSY], ids=["clean", "lossy"])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_the_fence_is_on_board_and_read_back_before_the_mission(autopilot: str, air: Air) -> None:
    async with flying(fenced(autopilot), air) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        first = {name: len(uploads(sky, name, MissionKind.MISSION)) for name in sky.links}
        sky.links["uav2"].cut = True
        await sky.until(lambda: bool(sky.state.replanning.records))
        for name in ("uav1", "uav3"):
            if not uploads(sky, name, FENCE):
                continue
            fence = sky.state.vehicles[name].assignment.fence
            assert fence is not None
            on_board = parse_outlines(sky.flyers[name].beside[FENCE].items, sky.flight.context.frame)
            assert [len(shape.corners_m) for shape in on_board] == [len(fence.corners_m)]
            assert uploads(sky, name, FENCE)[0] < uploads(sky, name, MissionKind.MISSION)[first[name] :][0]
        assert any(uploads(sky, name, FENCE) for name in ("uav1", "uav3"))
    assert set(sky.state.coverage.inspected) == set(range(6))


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_vehicle_that_refuses_its_fence_flies_its_old_mission(autopilot: str) -> None:
    async with flying(fenced(autopilot)) as (sky, _):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        first = {name: len(uploads(sky, name, MissionKind.MISSION)) for name in sky.links}
        for name in ("uav1", "uav3"):
            sky.flyers[name].beside[FENCE].refuses = DENIED + 90  # a result that nobody knows: a plain no
        sky.links["uav2"].cut = True
        await sky.until(lambda: any("its fence: fence refused" in line.text for line in sky.said))
        assert {name: len(uploads(sky, name, MissionKind.MISSION)) for name in sky.links} == first
        assert all(sky.state.vehicles[name].stage is Stage.FLYING for name in ("uav1", "uav3"))
    assert all(not sky.flyers[name].beside[FENCE].items for name in ("uav1", "uav3"))
    assert len(sky.faults()) == 1, "who flies its old mission inside its old fence is at no fault"


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_fence_is_broken_off_when_a_pilot_takes_the_vehicle(autopilot: str) -> None:
    async with flying(fenced(autopilot)) as (sky, task):
        await sky.until(lambda: len(sky.state.coverage.inspected) == 1)
        first = {name: len(uploads(sky, name, MissionKind.MISSION)) for name in sky.links}
        for flyer in sky.flyers.values():
            flyer.beside[FENCE].stops_at = 2
        sky.links["uav2"].cut = True
        await sky.until(lambda: any(uploads(sky, name, FENCE) for name in ("uav1", "uav3")))
        [name] = [name for name in ("uav1", "uav3") if uploads(sky, name, FENCE)][:1]
        sky.flyers[name].mode = STICKS[autopilot]
        await sky.until(lambda: sky.state.vehicles[name].stage is Stage.PILOT)
        sent = len(uploads(sky, name, FENCE))
        sky.flyers[name].beside[FENCE].stops_at = None
        await asyncio.sleep(60.0)
        assert len(uploads(sky, name, FENCE)) == sent
        assert len(uploads(sky, name, MissionKind.MISSION)) == first[name]
        assert sky.flyers[name].beside[FENCE].items == []
        sky.flight.stop_supervising()
        await task
