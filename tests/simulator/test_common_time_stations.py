"""How far a fleet lives for the sake of a ground station that keeps its time."""

from __future__ import annotations

import asyncio
import math
import os
import signal
import subprocess
import sys

import pytest

from simulator.common_time import (
    AHEAD_S,
    LOOK_REAL_S,
    PATIENCE_REAL_S,
    Greeting,
    LineBuffer,
    Station,
    Stations,
    format_time_line,
    is_process_stopped,
    parse_greeting,
)
from simulator.testing import fleet
from tests.executor.adapters.test_clock_fleet_time import NOBODY, Real, Wire

SPEEDUP = 20.0
EVER = float("inf")


class Kept:
    """A fleet's stations, and the wire to one of them."""

    def __init__(self, pid: int = NOBODY) -> None:
        self.real, self.wire = Real(), Wire()
        self.stations = Stations(SPEEDUP, lambda at_s: 1.7e9 + at_s / SPEEDUP, self.real)
        self.stations.send_time(50.0)
        self.station = Station(self.stations)
        self.station.connection_made(self.wire)
        self.wire.said.clear()
        self.station.data_received(Greeting(pid, SPEEDUP).to_line())

    def takes(self, lived_s: float) -> None:
        self.station.data_received(format_time_line(lived_s))


def test_a_fleet_alone_lives_as_it_likes() -> None:
    assert Stations(SPEEDUP, float).safe_time_s() == EVER


def test_it_lives_no_further_than_can_be_followed() -> None:
    kept = Kept()
    assert kept.stations.safe_time_s() == 50.0 + AHEAD_S
    kept.stations.send_time(50.1)
    assert kept.wire.said == [format_time_line(50.1)]
    assert kept.stations.safe_time_s() == 50.0 + AHEAD_S
    kept.real.now_s += PATIENCE_REAL_S - LOOK_REAL_S
    assert kept.stations.safe_time_s() == 50.0 + AHEAD_S, "a busy computer"
    kept.takes(50.1)
    assert kept.stations.safe_time_s() == 50.1 + AHEAD_S


def test_no_client_receives_what_was_not_sent() -> None:
    kept = Kept()
    kept.takes(1e9)
    assert kept.stations.safe_time_s() == 50.0 + AHEAD_S


def test_one_that_says_nothing_for_long_is_a_silent_ground_station() -> None:
    kept = Kept()
    kept.stations.send_time(50.1)
    kept.real.now_s += PATIENCE_REAL_S
    assert kept.stations.safe_time_s() == EVER
    kept.stations.send_time(200.0)
    kept.takes(200.0)
    assert kept.stations.safe_time_s() == 200.0 + AHEAD_S, "it is waited for again"


def test_one_that_has_gone_is_not_waited_for() -> None:
    kept = Kept()
    kept.station.connection_lost(None)
    assert kept.stations.safe_time_s() == EVER
    assert kept.stations.moved.is_set()


def test_a_client_that_does_not_greet_is_not_waited_for() -> None:
    stations, wire = Stations(SPEEDUP, float), Wire()
    station = Station(stations)
    station.connection_made(wire)
    station.data_received(b"GET / HTTP/1.1\r\n\r\n")
    assert stations.safe_time_s() == EVER
    assert not wire.open


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells who is stopped")
def test_one_that_was_stopped_on_purpose_is_silent_at_once() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        kept = Kept(other.pid)
        kept.stations.send_time(50.1)
        kept.real.now_s += LOOK_REAL_S
        assert kept.stations.safe_time_s() == 50.0 + AHEAD_S
        os.kill(other.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, other.pid, os.WSTOPPED | os.WNOWAIT)
        assert is_process_stopped(other.pid)
        kept.real.now_s += LOOK_REAL_S
        assert kept.stations.safe_time_s() == EVER
        os.kill(other.pid, signal.SIGCONT)
        other.kill()


@pytest.mark.asyncio
@pytest.mark.parametrize("speedup", [1.0, SPEEDUP])
async def test_a_fleet_waits_at_its_first_port_unless_its_time_is_real(speedup: float) -> None:
    async with fleet(speedup=speedup) as living:
        port = living[0].port
        if speedup == 1.0:
            with pytest.raises(ConnectionRefusedError):
                await asyncio.open_connection("127.0.0.1", port)
            return
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        assert parse_greeting((await reader.readline()).strip()) is not None
        writer.write(Greeting(NOBODY, speedup).to_line())
        began_s, *more_s = await told(reader)
        assert more_s == [] or more_s[-1] - began_s <= AHEAD_S
        writer.write(format_time_line((began_s, *more_s)[-1]))
        again_s = await told(reader, until_s=(began_s, *more_s)[-1] + AHEAD_S / 2)
        assert AHEAD_S / 2 <= again_s[-1] - (began_s, *more_s)[-1] <= AHEAD_S + 1e-9
        writer.close()


async def told(reader: asyncio.StreamReader, until_s: float = -math.inf) -> list[float]:
    """Return the times that are said until one is reached, and then until the fleet waits."""
    times_s = [float(await reader.readline())]
    while times_s[-1] < until_s:
        times_s.append(float(await reader.readline()))
    try:
        async with asyncio.timeout(LOOK_REAL_S):
            while True:
                times_s.append(float(await reader.readline()))
    except TimeoutError:
        return times_s


def test_lines_without_an_end_are_dropped() -> None:
    lines = LineBuffer()
    assert lines.take(b"x" * 10_000) == []
    assert lines.take(b"1.0\n2.0\n3") == [b"1.0", b"2.0"]
