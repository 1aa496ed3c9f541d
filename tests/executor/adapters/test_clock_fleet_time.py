"""The fleet's time as a flight goes by it: with clocks that the test sets, and a connection that keeps what is said."""

from __future__ import annotations

import asyncio
import os
from dataclasses import dataclass

import pytest

from executor.adapters.clock import BUSY_REAL_S, FleetTime, SystemClock
from simulator.common_time import (
    AHEAD_S,
    LOOK_REAL_S,
    NAME,
    PATIENCE_REAL_S,
    Greeting,
    format_time_line,
    parse_greeting,
    parse_time_line,
)

SPEEDUP = 20.0
NOBODY = 2**22 + 1
"""A process that cannot be: above the most that Linux numbers."""


class Wire(asyncio.Transport):
    """Keeps what was said."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[bytes] = []
        self.open = True

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.said.append(bytes(data))

    def abort(self) -> None:
        self.open = False

    def get_write_buffer_size(self) -> int:
        return 0


@dataclass
class Real:
    """This computer's clock."""

    now_s: float = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Pair:
    """A flight's time, and the fleet at the other end of the connection."""

    def __init__(self, *, pid: int = NOBODY, speedup: float = SPEEDUP) -> None:
        self.real, self.wire = Real(), Wire()
        self.time = FleetTime(SPEEDUP, self.real, self.real)
        self.time.connection_made(self.wire)
        self.time.data_received(Greeting(pid, speedup, 100.0, 1.7e9).to_line())

    def lives(self, lived_s: float) -> None:
        self.time.data_received(format_time_line(lived_s))

    @property
    def acknowledged(self) -> list[float | None]:
        return [parse_time_line(line) for line in self.wire.said[1:]]


def test_it_greets_back_and_resumes_where_it_stopped() -> None:
    pair = Pair()
    greeting = parse_greeting(pair.wire.said[0].strip())
    assert greeting is not None
    assert (greeting.pid, greeting.speedup) == (os.getpid(), SPEEDUP)
    assert pair.time.is_synchronised
    assert pair.time.steady_s() == 1000.0
    pair.real.now_s += 5.0
    assert pair.time.steady_s() == 1000.0, "the fleet has not lived on"


def test_time_advances_with_the_fleet_once_everything_before_is_done() -> None:
    pair = Pair()
    pair.lives(100.1)
    assert pair.time.steady_s() == 1000.0
    assert pair.acknowledged == []
    assert pair.time.note_idle()
    assert pair.time.steady_s() == pytest.approx(1000.0 + 0.1 / SPEEDUP)
    assert pair.acknowledged == [], "the deadlines of this moment are still to come"
    assert not pair.time.note_idle()
    assert not pair.time.note_idle()
    assert pair.acknowledged == [100.1], "once"


def test_lines_come_in_any_pieces() -> None:
    pair = Pair()
    for byte in format_time_line(100.05) + format_time_line(100.1):
        pair.time.data_received(bytes([byte]))
    pair.time.note_idle()
    assert pair.time.steady_s() == pytest.approx(1000.0 + 0.1 / SPEEDUP)


def test_what_the_fleet_lived_without_us_has_passed_at_once() -> None:
    """A ground station that was stopped hears what waited as late as it is."""
    pair = Pair()
    pair.lives(130.0)
    assert pair.time.steady_s() == pytest.approx(1000.0 + 30.0 / SPEEDUP)


def test_a_flood_slows_time_and_does_not_end_it() -> None:
    pair = Pair()
    pair.lives(100.0 + AHEAD_S)
    pair.time.note_busy()
    assert pair.time.steady_s() == 1000.0
    pair.real.now_s += BUSY_REAL_S
    pair.time.note_busy()
    assert pair.time.steady_s() > 1000.0
    assert pair.acknowledged == [100.0 + AHEAD_S]


def test_a_fleet_that_says_nothing_for_long_is_gone_on_without_and_found_again() -> None:
    pair = Pair()
    pair.lives(100.1)
    pair.time.note_idle()
    pair.time.note_idle()
    pair.real.now_s += PATIENCE_REAL_S - LOOK_REAL_S
    pair.time.note_silence()
    assert pair.time.is_synchronised
    pair.real.now_s += LOOK_REAL_S
    pair.time.note_silence()
    assert not pair.time.is_synchronised
    alone_s = pair.time.steady_s()
    assert alone_s == pytest.approx(1000.0 + 0.1 / SPEEDUP)
    pair.real.now_s += 1.0
    assert pair.time.steady_s() == pytest.approx(alone_s + 1.0)
    pair.lives(100.2)
    assert pair.time.is_synchronised
    assert pair.time.steady_s() == pytest.approx(alone_s + 1.0), "time neither jumps nor goes back"


def test_a_fleet_that_has_ended_leaves_us_the_computers_time() -> None:
    pair = Pair()
    pair.time.connection_lost(None)
    assert not pair.time.is_connected
    pair.real.now_s += 2.0
    assert pair.time.steady_s() == 1002.0


@pytest.mark.parametrize("line", [b"220 smtp.example.org ESMTP\n", f"{NAME} 1\n".encode(), b"\xff\xfe\n"])
def test_a_stranger_at_the_port_is_left_alone(line: bytes) -> None:
    time = FleetTime(SPEEDUP, Real(), Real())
    wire = Wire()
    time.connection_made(wire)
    time.data_received(line)
    assert (time.is_synchronised, wire.said, wire.open) == (False, [], False)


def test_a_fleet_at_another_speed_keeps_its_own_time() -> None:
    pair = Pair(speedup=10.0)
    assert (pair.time.is_synchronised, pair.wire.said) == (False, [])


def test_a_flight_is_resumed_at_the_date_of_its_fleet() -> None:
    """The flight began at 1.7e9 - 10 s by the fleet's date, and the computer kept half of its speed since."""
    pair = Pair()
    pair.lives(120.0)
    pair.time.note_idle()
    clock = SystemClock.resume(SPEEDUP, 1.7e9 - 10.0, 3.0, 0.0, pair.time.steady_s, pair.time.date_unix_s())
    assert clock.now_s() == pytest.approx((10.0 + 1.0) * SPEEDUP)
    assert clock.steady_unix_s() == pytest.approx(1.7e9 + 1.0)


def test_a_flight_that_is_slower_than_asked_for_has_not_set_the_computers_clock() -> None:
    pair = Pair()
    clock = SystemClock.start_on(SPEEDUP, pair.time.steady_s)
    pair.real.now_s += 60.0
    assert clock.now_s() == 0.0
    assert clock.clock_step_s() == pytest.approx(0.0, abs=0.5)
