"""Run one protocol machine over a link, and count its time-outs only in time in which this program could run.

On an overloaded computer a program has to wait. Meanwhile a vehicle's answers lie unread, and by the clock every
time-out expires. So a beat runs alongside the dialogues, and of a late beat only `MOST_REAL_S` counts: this program's
own time-outs use this time only.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from executor.core.interface.messages import Message, Outgoing, Radio
from executor.core.interface.ports import Clock, Link
from executor.protocols.machine import DialogueMachine, TimedOut
from executor.protocols.turns import HOLD_S, MOST_HELD_S, Rank
from executor.runtime.channel import Channel, channel_of

BEAT_REAL_S = 0.1
STANDS_STILL_S = 5.0
"""Seconds without a beat after which this computer counts as having stood still; since the crew's yes, unobserved, a
person may have stepped to a pad."""
LEAST_WAIT_S = 1e-6
"""Least remaining time-out that counts; less is a rounding error of a sum."""
MOST_REAL_S = 0.25
"""Most real seconds counted between two beats; a program that is always this late does not count as slow yet."""

T = TypeVar("T")
P = ParamSpec("P")


@dataclass(slots=True)
class _Beat:
    """Beat of one event loop; runs while any dialogue needs it."""

    loop: asyncio.AbstractEventLoop
    clock: Clock
    users: int = 0
    at_s: float = 0.0
    """Time of the last beat, in real seconds of the clock."""
    lost_s: float = 0.0
    """Time before it in which this program could not run."""
    stood_still_s: float = float("-inf")
    """Time at which this computer was last found to have stood still."""
    next: asyncio.TimerHandle | None = None

    def begin(self) -> None:
        self.users += 1
        if self.users == 1:
            self.at_s = self.now_s()
            self.next = self.loop.call_later(BEAT_REAL_S, self._beat)

    def end(self) -> None:
        self.users -= 1
        if self.users == 0 and self.next is not None:
            self.lost_s = self.total_lost_real_s()
            self.next.cancel()

    def total_lost_real_s(self) -> float:
        """Return the real seconds that this program has lost so far."""
        return self.lost_s + max(0.0, self.now_s() - self.at_s - MOST_REAL_S)

    def has_stood_still(self, since_s: float) -> bool:
        """Return whether this computer stood still since a time, such as a laptop whose lid was closed."""
        if self.now_s() - self.at_s > STANDS_STILL_S:
            self.stood_still_s = self.now_s()
        return self.stood_still_s > since_s

    def now_s(self) -> float:
        return self.clock.now_s() / self.clock.speedup

    def _beat(self) -> None:
        self.has_stood_still(self.at_s)
        self.lost_s, self.at_s = self.total_lost_real_s(), self.now_s()
        self.next = self.loop.call_later(BEAT_REAL_S, self._beat)


_BEATS: WeakKeyDictionary[asyncio.AbstractEventLoop, _Beat] = WeakKeyDictionary()


@dataclass(frozen=True, slots=True)
class AwakeClock:
    """Clock that stands still while this program cannot run; it never goes back."""

    clock: Clock
    beat: _Beat = field(repr=False)

    @property
    def speedup(self) -> float:
        """Flight seconds per real second."""
        return self.clock.speedup

    def now_s(self) -> float:
        """Return the flight seconds in which this program could run."""
        return self.clock.now_s() - self.beat.total_lost_real_s() * self.clock.speedup

    def watch_pauses(self) -> Callable[[], bool]:
        """Return a function that reports whether this computer has stood still since this call."""
        return partial(self.beat.has_stood_still, self.beat.now_s())


@contextmanager
def awake(clock: Clock) -> Iterator[AwakeClock]:
    """Yield the clock of this program's own time-outs, valid inside the block."""
    if isinstance(clock, AwakeClock):
        yield clock
        return
    loop = asyncio.get_running_loop()
    beat = _BEATS.get(loop)
    if beat is None or (beat.users == 0 and beat.clock is not clock):
        beat = _BEATS[loop] = _Beat(loop, clock)
    beat.begin()
    try:
        yield AwakeClock(clock, beat)
    finally:
        beat.end()


def underlying(clock: Clock) -> Clock:
    """Return the flight's clock behind a clock that may be an `AwakeClock`."""
    return clock.clock if isinstance(clock, AwakeClock) else clock


def times_slower(clock: Clock, began_s: float, able_began_s: float) -> float:
    """Return elapsed time over the time in which this program could run; 1 on an idle computer.

    Args:
        clock: The `AwakeClock`.
        began_s: Start on the flight's clock.
        able_began_s: Start on `clock`.
    """
    took_s, able_s = underlying(clock).now_s() - began_s, clock.now_s() - able_began_s
    return max(1.0, took_s / able_s) if able_s > 0.0 else 1.0


def count_awake_time(work: Callable[P, Coroutine[Any, Any, T]]) -> Callable[P, Coroutine[Any, Any, T]]:
    """Make a procedure count its time-outs in the time in which this program could run."""
    signature = inspect.signature(work)

    @wraps(work)
    async def done(*args: P.args, **kwargs: P.kwargs) -> T:
        given = signature.bind(*args, **kwargs)
        with awake(given.arguments["clock"]) as able:
            given.arguments["clock"] = able
            return await work(*given.args, **given.kwargs)

    return done


SLOW_SHARE = 0.3
"""Share of lost time above which a program is too slow for its flight."""
LOOKS_S = 10.0
SAYS_AGAIN_S = 60.0


class Lateness:
    """Time that a flight loses from tick to tick, and when to report it."""

    def __init__(self, able: AwakeClock, clock: Clock) -> None:
        """Start comparing two clocks: the `AwakeClock` and the flight's."""
        self._able, self._clock = able, clock
        self._behind_s = self._looked_behind_s = clock.now_s() - able.now_s()
        self._looked_s, self._said_s = clock.now_s(), float("-inf")

    def take_lost_s(self) -> float:
        """Return the time lost since the last call."""
        before_s, self._behind_s = self._behind_s, self._clock.now_s() - self._able.now_s()
        return round(max(0.0, self._behind_s - before_s), 3)

    def to_be_said(self) -> str:
        """Return the warning that this computer is too slow, at intervals; empty if it is not."""
        now_s = self._clock.now_s()
        passed_s = now_s - self._looked_s
        if passed_s < LOOKS_S:
            return ""
        lost_s, self._looked_s = self._behind_s - self._looked_behind_s, now_s
        self._looked_behind_s = self._behind_s
        if lost_s < SLOW_SHARE * passed_s or now_s - self._said_s < SAYS_AGAIN_S:
            return ""
        self._said_s = now_s
        return (
            f"this computer is too busy: the ground station lost {lost_s:.0f} of the last {passed_s:.0f} s; "
            "its time-outs wait that long"
        )


M = TypeVar("M", bound=DialogueMachine)

INBOX = 256
"""Most messages that wait for a dialogue; telemetry beyond it is dropped, protocols request the rest again."""


AGAIN_S = 1.0
"""Seconds between two repeats of a machine's last request, where this program lost time."""
MOST_SPEEDUP = 10.0
"""Most speedup that a dialogue's time-outs follow: on a busy computer a fifteenth of a second is too short."""


@dataclass(frozen=True, slots=True)
class _DialogueClock:
    """Dialogue time: the flight's, but at most `MOST_SPEEDUP` times real time."""

    clock: Clock

    @property
    def speedup(self) -> float:
        return min(self.clock.speedup, MOST_SPEEDUP)

    def now_s(self) -> float:
        return self.clock.now_s() / self.clock.speedup * self.speedup


@dataclass(slots=True)
class _Patience:
    """Silence of a vehicle: what to repeat, and when to give up."""

    able: Clock
    paced: _DialogueClock
    since_s: float = 0.0
    able_since_s: float = 0.0
    granted_s: float | None = None
    """Time-out that the machine would have used."""
    repeat: tuple[Outgoing, ...] = ()
    """Messages of the last repeat."""

    def begin(self) -> None:
        """Restart the count: the vehicle has answered."""
        self.since_s, self.able_since_s = self.paced.now_s(), self.able.now_s()
        self.granted_s, self.repeat = None, ()

    def pass_deadline(self, machine: M, *, full: bool = False) -> tuple[M, tuple[Outgoing, ...]]:
        """Pass a machine's deadline; give up only after that much time in which this program could receive.

        Repeats follow the flight's clock all the same: a vehicle's own time-outs do not wait for us. Nothing is
        repeated into a radio with a full buffer: the request may still be in it.
        """
        now_s = self.paced.now_s()
        if full and now_s - self.since_s < MOST_HELD_S:
            return replace(machine, deadline_s=now_s + HOLD_S), ()
        after, send = machine.on_deadline(now_s)
        if isinstance(after.outcome, TimedOut):
            self.granted_s = now_s - self.since_s if self.granted_s is None else self.granted_s
            waited_s = (self.able.now_s() - self.able_since_s) / self.able.speedup * self.paced.speedup
            if waited_s < self.granted_s - LEAST_WAIT_S:
                return replace(machine, deadline_s=now_s + AGAIN_S), self.repeat
        self.repeat = send or self.repeat
        return after, send


@contextmanager
def listen_to(link: Link, listener: Callable[[Message], None]) -> Iterator[None]:
    """Pass every message of a vehicle to a listener inside the block."""
    stop_listening = link.listen(listener)
    try:
        yield
    finally:
        stop_listening()


K = TypeVar("K", bound=Message)


@contextmanager
def collect(link: Link, kind: type[K]) -> Iterator[list[K]]:
    """Collect every message of one kind from a vehicle inside the block."""
    heard: list[K] = []
    with listen_to(link, lambda message: heard.append(message) if isinstance(message, kind) else None):
        yield heard


@count_awake_time
async def run_dialogue(machine: M, link: Link, clock: Clock) -> M:
    """Run a dialogue to its outcome.

    If the task is cancelled, cancel the transfer with the vehicle where the protocol allows it.
    """
    opens, unmeasured = type(machine).begin, machine.round_trip
    while True:
        way, channel = link.ways[0], channel_of(link)
        async with channel.take_turn(Rank.BEFORE_FLIGHT) if machine.is_transfer else nullcontext():
            if link.ways[0] is way:
                trip = unmeasured.adopt(channel.round_trip)
                machine = replace(machine, round_trip=trip, most_ahead=channel.most_ahead)
                machine = await _run_on_one_link(machine, opens, link, channel, clock)
                opens = type(machine).move
        if machine.outcome is not None:
            return machine


async def _run_on_one_link(
    machine: M, opens: Callable[[M, float], tuple[M, tuple[Outgoing, ...]]], link: Link, channel: Channel, clock: Clock
) -> M:
    """Run a dialogue to its end, or until commands switch to another link of the vehicle."""
    way, paced = link.ways[0], _DialogueClock(underlying(clock))
    inbox: asyncio.Queue[Message] = asyncio.Queue(INBOX)
    patience = _Patience(clock, paced)
    with listen_to(link, partial(_put_into, inbox, channel, paced)):
        try:
            machine, send = opens(machine, paced.now_s())
            patience.begin()
            while True:
                _send_all(link, send)
                if send:
                    channel.note_sent()
                if machine.outcome is not None:
                    return machine
                heard = await _receive_within(inbox, (machine.deadline_s - paced.now_s()) / paced.speedup)
                before = machine
                if heard is not None:
                    machine, send = machine.on_message(heard, paced.now_s())
                if machine.outcome is None and link.ways[0] is not way:
                    return machine
                if heard is None:
                    machine, send = patience.pass_deadline(machine, full=channel.is_full(paced.now_s()))
                elif machine is not before:
                    patience.begin()
                    channel.note_progress()
        except asyncio.CancelledError:
            _send_all(link, machine.cancel()[1])
            raise
        finally:
            channel.learn(machine.round_trip)


def _put_into(inbox: asyncio.Queue[Message], channel: Channel, paced: _DialogueClock, message: Message) -> None:
    if isinstance(message, Radio):
        channel.hear(message, paced.now_s())
    elif not inbox.full():
        inbox.put_nowait(message)


def _send_all(link: Link, messages: Iterable[Outgoing]) -> None:
    for message in messages:
        link.send(message)


async def _receive_within(inbox: asyncio.Queue[Message], real_s: float) -> Message | None:
    try:
        async with asyncio.timeout(max(0.0, real_s)):
            return await inbox.get()
    except TimeoutError:
        return None
