"""Fences and rally points of a flight: on record before they are sent, and always restored."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from executor.core.context import FenceRules
from executor.core.interface.commands import Upload
from executor.core.interface.messages import MissionCount
from executor.core.preflight.parameter_changes import ChangeStage, KeptList
from executor.core.state.onboard_fence import build_first_fences
from executor.errors import LogError, PreflightFailed, VehicleRefused
from executor.flight import preparation
from executor.flight.restore_vehicles import LISTS, restore_board
from missions import MissionItem, MissionKind, dialect_for
from missions.fences import Fence, build_fence_items, find_list_differences
from missions.items import PlaceCommand
from tests.executor.builders import fleet_of
from tests.executor.flight.test_preparation import Terminal
from tests.fakes.clock import LoopClock
from tests.fakes.disk import room_for
from tests.fakes.link import CLEAN, Air, FakeLink
from tests.fakes.vehicle import DENIED, FakeAutopilot

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

AUTOPILOTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
BAD = Air(loss=0.25, duplicate=0.3, delay_s=(0.01, 0.5))
FENCE, RALLY = MissionKind.FENCE, MissionKind.RALLY


def circle(radius_m: float) -> tuple[MissionItem, ...]:
    """Return a fence that somebody else has put on board."""
    return (MissionItem(0, 0, PlaceCommand.INCLUSION_CIRCLE, radius_m, x=496000000, y=156000000),)


class Pads:
    """A fleet on its pads with lists of its own on board, and a run directory."""

    def __init__(self, run: Path, autopilot: str, air: Air = CLEAN, *, seed: int = 0) -> None:
        ready = fleet_of({"uav1": (2,), "uav2": (4,)}, autopilot=autopilot)
        self.context = replace(ready.context, fencing=FenceRules(True, 20.0, 10.0, "keep", "pad"))
        self.boards, self.run, self.clock, self.console = ready.boards, run, LoopClock(), Terminal()
        self.first = build_first_fences(self.context, ready.boards)
        self.vehicles = {name: FakeAutopilot(dialect_for(autopilot)) for name in self.context.vehicles}
        for vehicle in self.vehicles.values():
            vehicle.beside[FENCE].items = list(circle(5000.0))
        self.links = {
            name: FakeLink(vehicle, self.clock, air, seed=seed + number)
            for number, (name, vehicle) in enumerate(self.vehicles.items())
        }

    async def put(self) -> None:
        found = await preparation.read_fences(self.context, self.links, self.clock)
        await preparation.upload_wanted_lists(
            self.run, self.context, self.links, self.clock, self.first, found, self.console
        )

    async def give_back(self) -> tuple[KeptList, ...]:
        _, lists = await restore_board(self.run, self.links, self.clock, self.console)
        return lists

    def close(self) -> None:
        for link in self.links.values():
            link.close()

    def fence_of(self, name: str) -> tuple[MissionItem, ...]:
        return tuple(self.vehicles[name].beside[FENCE].items)

    @property
    def as_before(self) -> bool:
        rally = all(not vehicle.beside[RALLY].items for vehicle in self.vehicles.values())
        return rally and all(not find_list_differences(circle(5000.0), self.fence_of(name)) for name in self.vehicles)


@AUTOPILOTS
async def test_every_vehicle_gets_a_fence_and_its_own_is_restored(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    await pads.put()
    for name, fence in pads.first.items():
        assert find_list_differences(build_fence_items(fence, pads.context.frame), pads.fence_of(name)) == ()
        assert len(pads.vehicles[name].beside[RALLY].items) == 1
    assert {one.stage for one in LISTS.read(tmp_path)} == {ChangeStage.SET}
    assert {one.stage for one in await pads.give_back()} == {ChangeStage.RESTORED}
    assert pads.as_before
    assert "info uav1: fence, rally points restored" in pads.console.lines
    assert await pads.give_back() == LISTS.read(tmp_path), "what is back is not asked for again"
    pads.close()


@AUTOPILOTS
@pytest.mark.parametrize("seed", range(5))
async def test_bad_links_lose_no_fence(autopilot: str, seed: int, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot, BAD, seed=seed)
    await pads.put()
    for _ in range(5):
        if not any(one.is_open for one in await pads.give_back()):
            break
    assert pads.as_before
    pads.close()


@AUTOPILOTS
async def test_a_fence_uploaded_by_another_party_since_then_is_left_unchanged(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    await pads.put()
    pads.vehicles["uav1"].beside[FENCE].items = list(circle(77.0))
    stages = {(one.vehicle, one.kind): one.stage for one in await pads.give_back()}
    assert stages["uav1", FENCE] is ChangeStage.LEFT
    assert stages["uav1", RALLY] is ChangeStage.RESTORED
    assert pads.fence_of("uav1") == circle(77.0)
    assert any(
        "uav1: fence not restored: another party has changed the fence since" in line for line in pads.console.lines
    )
    pads.close()


@AUTOPILOTS
async def test_an_armed_vehicle_is_left_alone(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    await pads.put()
    pads.vehicles["uav2"].armed = True
    sent = len(pads.links["uav2"].of_kind(MissionCount))
    open_ = {one.vehicle for one in await pads.give_back() if one.is_open}
    assert open_ == {"uav2"}
    assert len(pads.links["uav2"].of_kind(MissionCount)) == sent
    pads.vehicles["uav2"].armed = False
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_without_a_record_nothing_is_sent(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    with room_for(0), pytest.raises(PreflightFailed, match="no fence was put on board"):
        await pads.put()
    assert pads.as_before
    pads.close()


@AUTOPILOTS
async def test_a_vehicle_that_refuses_its_fence_is_not_flown(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    pads.vehicles["uav2"].beside[FENCE].refuses = DENIED
    with pytest.raises(VehicleRefused, match="uav2: the fence is not on board: fence refused: denied"):
        await pads.put()
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_a_second_attempt_gives_back_what_the_first_one_found(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot")
    await pads.put()
    pads.first = {
        name: fence.merge_with(Fence(((0, 900), (0, 0), (900, 0)), 60.0)) for name, fence in pads.first.items()
    }
    await pads.put()
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_a_fence_that_was_widened_in_flight_is_ours(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    await pads.put()
    board = pads.boards["uav1"]
    assert board is not None
    wider = pads.first["uav1"].merge_with(Fence(((0.0, 0.0), (900.0, 0.0), (0.0, 900.0)), 60.0))
    preparation.record_wider_fence(tmp_path, pads.context, Upload("uav1", 1, board.path, True, wider))
    preparation.record_wider_fence(tmp_path, pads.context, Upload("uav2", 1, board.path, True))
    pads.vehicles["uav1"].beside[FENCE].items = list(build_fence_items(wider, pads.context.frame))
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_a_record_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    (tmp_path / "fences.json").write_text('{"format": "faultline-fences/1", "lists": [{"vehicle": 3}]}')
    with pytest.raises(LogError, match=r"fences.json: lists\[0\]"):
        LISTS.read(tmp_path)


async def test_nothing_is_read_where_the_site_says_nothing_of_fences(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    pads.context = replace(pads.context, fencing=None)
    assert await preparation.read_fences(pads.context, pads.links, pads.clock) == {}
    assert all(link.sent == [] for link in pads.links.values())
    pads.close()
    await asyncio.sleep(0)
