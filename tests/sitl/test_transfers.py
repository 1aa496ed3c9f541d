"""Items ahead of the requests, the checksum of a list, questions in any order: on real autopilots over a radio."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from pathlib import Path

import pytest

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.messages import Heartbeat, Message
from executor.core.interface.ports import Link, LinkRequest
from executor.protocols import vehicle_commands
from executor.protocols.machine import MOST_AHEAD, Accepted
from executor.protocols.mission_file import MissionFileUpload
from executor.protocols.mission_transfer import DownloadDialogue, UploadDialogue
from executor.runtime import procedures
from executor.runtime.dialogue import run_dialogue
from missions import (
    Dialect,
    Inspection,
    MissionItem,
    build_flight_path,
    compute_list_checksum,
    dialect_for,
    encode,
    find_mission_differences,
    plan_flight_setup,
)
from tests.missions.builders import line_east
from tests.sitl.radio import RadioRelay, slowed
from tests.sitl.real import BOTH, PX4, RELAYED, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

PROFILE = "sik-ecc-mended"
SETUP = plan_flight_setup(line_east(16), ["uav1"], Inspection())
PATIENCE_S = 60.0
STANDBY = 3
"""MAV_STATE."""


def mission(dialect: Dialect, visits: int) -> tuple[MissionItem, ...]:
    return encode(build_flight_path(SETUP, "uav1", tuple(range(0, 2 * visits, 2))), dialect).items


@BOTH
def test_a_mission_goes_out_ahead_and_is_proven(autopilot: Autopilot, tmp_path: Path) -> None:
    if autopilot.binary is None:
        pytest.skip(f"{autopilot.variable}: expected the path of a real {autopilot.name}")
    wanted = Wanted({pad.vehicle: pad for pad in SETUP.pads}, SETUP.frame, 1.0, {}, frozenset())
    ports = range(autopilot.port, autopilot.port + 1)
    radio = RadioRelay(ports, range(ports.start + RELAYED, ports.stop + RELAYED), PROFILE)
    with radio.running(), running(autopilot, Path(autopilot.binary), tmp_path / "work", wanted):
        if autopilot is PX4:
            slowed(0, tmp_path / "work" / "uav1")
        asyncio.run(_transfer(autopilot, ports.start + RELAYED, radio))


async def _transfer(autopilot: Autopilot, port: int, radio: RadioRelay) -> None:
    clock, dialect = SystemClock(1.0), dialect_for(autopilot.name)
    request = LinkRequest(Connection(Scheme.UDP_IN, "127.0.0.1", port), 1)
    async with endpoints.open_mavlink_links({"uav1": request}) as links:
        link: Link = links["uav1"]
        assert await procedures.wait_for(link, clock, _is_started, PATIENCE_S)
        radio.items.clear()
        for visits in (10, 15):
            items, began_s = mission(dialect, visits), time.monotonic()
            upload = await procedures.upload_once(link, clock, dialect, items)
            took_s, sent = time.monotonic() - began_s, dict(radio.items)
            times = f"{sum(sent.values())} sent, at most {max(sent.values(), default=0)} times"
            print(f"{autopilot.name}: {len(items)} items in {took_s:.1f} s, {upload.round_trip}, {times}")
            assert upload.accepted
            _look(upload, dialect)
            assert took_s < 0.7 * len(items) * (upload.round_trip.mean_s or 0.0), "not one round trip for each"
            began_s = time.monotonic()
            ahead = MOST_AHEAD if dialect.reads_in_any_order else 1
            read = await run_dialogue(DownloadDialogue(ahead=ahead), link, clock)
            print(f"{autopilot.name}: read in {time.monotonic() - began_s:.1f} s")
            assert read.accepted
            assert find_mission_differences(items, read.items, dialect) == ()
            if dialect.takes_mission_file:
                await _replace_part(link, clock, dialect, items)
            if dialect.says_checksum:
                proven = await run_dialogue(DownloadDialogue(checksum=compute_list_checksum(items)), link, clock)
                assert (proven.accepted, proven.proven, proven.items) == (True, True, ())
                other = await run_dialogue(DownloadDialogue(checksum=1), link, clock)
                assert (other.proven, len(other.items)) == (False, len(items))


async def _replace_part(link: Link, clock: SystemClock, dialect: Dialect, items: tuple[MissionItem, ...]) -> None:
    """Put other items in the place of the last ones, and more behind them, as a file; then a list that ends there."""
    first = len(items) - 4
    higher = (replace(item, z=item.z + 1.37 if item.z else 0.0) for item in mission(dialect, 15)[first:])
    newer = (*items[:first], *higher)
    began_s = time.monotonic()
    upload = await run_dialogue(MissionFileUpload(newer, first, first * 4096), link, clock)
    took_s = time.monotonic() - began_s
    print(f"{dialect.name}: the last {len(newer) - first} of {len(newer)} items as a file in {took_s:.1f} s")
    assert (upload.outcome, upload.is_proven) == (Accepted(), True)
    read = await run_dialogue(DownloadDialogue(ahead=MOST_AHEAD), link, clock)
    assert find_mission_differences(newer, read.items, dialect) == ()
    shorter, began_s = (*newer[:first], replace(newer[-1], seq=first)), time.monotonic()
    upload = await run_dialogue(MissionFileUpload(shorter, first, first * 4096 + 2048, newer[first + 1 :]), link, clock)
    print(f"{dialect.name}: {len(newer)} items cut to {len(shorter)} in {time.monotonic() - began_s:.1f} s")
    assert (upload.outcome, upload.is_proven) == (Accepted(), True)
    read = await run_dialogue(DownloadDialogue(ahead=MOST_AHEAD), link, clock)
    assert find_mission_differences(shorter, read.items, dialect) == ()


def _is_started(said: Message) -> bool:
    return isinstance(said, Heartbeat) and said.system_status >= STANDBY


def _look(upload: UploadDialogue, dialect: Dialect) -> None:
    expected = compute_list_checksum(upload.items) if dialect.says_checksum else None
    assert upload.checksum == expected


def test_unasked_streams_are_off_and_restored(tmp_path: Path) -> None:
    if PX4.binary is None:
        pytest.skip(f"{PX4.variable}: expected the path of a real {PX4.name}")
    wanted = Wanted({pad.vehicle: pad for pad in SETUP.pads}, SETUP.frame, 1.0, {}, frozenset())
    with running(PX4, Path(PX4.binary), tmp_path / "work", wanted):
        asyncio.run(_switch_streams(PX4.port))


async def _switch_streams(port: int) -> None:
    clock, unasked = SystemClock(1.0), dialect_for("px4").unasked_hz
    request = LinkRequest(Connection(Scheme.UDP_IN, "127.0.0.1", port), 1)
    async with endpoints.open_mavlink_links({"uav1": request}) as links:
        link = links["uav1"]
        assert await procedures.wait_for(link, clock, _is_started, PATIENCE_S)

        async def find_on() -> set[int]:
            return {message for message in unasked if await procedures.is_stream_on(link, clock, message)}

        async def count_frames() -> int:
            before = link.counts.received
            await asyncio.sleep(5.0)
            return link.counts.received - before

        first, frames = await find_on(), await count_frames()
        assert next(iter(unasked)) in first, "it is looked at to know whether they are off"
        assert await procedures.set_streams(link, clock, unasked, vehicle_commands.NEVER_US) == ""
        assert await find_on() == set()
        fewer = await count_frames()
        assert await procedures.set_streams(link, clock, unasked, vehicle_commands.UNASKED_US) == ""
        assert await find_on() == first
        print(f"px4: {sorted(first)} were on, {frames / 5.0:.0f} frames a second, {fewer / 5.0:.0f} without them")
        assert fewer < 0.8 * frames
        assert await count_frames() > 0.8 * frames
