"""Before the flight: who answers, where everybody stands, what is in the batteries; then the missions on board."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass, field

from executor.core.messages import Battery, Heartbeat, Message, Position, StatusText, SystemStatus, Version
from executor.core.ports import Clock, Link
from executor.core.preflight import Facts
from executor.errors import ConnectionFailed, PreflightFailed
from executor.protocols import orders
from executor.protocols.command import CommandDialogue
from executor.protocols.machine import Accepted
from executor.runtime import procedures
from missions import Dialect, EncodedMission

STREAMS_HZ = {
    orders.GLOBAL_POSITION_INT: 5.0,
    orders.SYS_STATUS: 1.0,
    orders.BATTERY_STATUS: 1.0,
    orders.MISSION_CURRENT: 2.0,
    orders.EXTENDED_SYS_STATE: 1.0,
}
"""What we follow; ArduPilot sends none of it unasked, PX4's battery comes only every 2 s."""
STEADY_S = 3.0


@dataclass(slots=True)
class _Heard:
    """The latest of everything that a vehicle said before the flight."""

    heartbeat: Heartbeat | None = None
    position: Position | None = None
    remaining_pct: float | None = None
    status: SystemStatus | None = None
    version: Version | None = None
    texts: list[str] = field(default_factory=list)
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def take(self, message: Message) -> None:
        match message:
            case Heartbeat():
                self.heartbeat = message
            case Position():
                self.position = message
            case Battery(remaining_pct=remaining) if remaining is not None:
                self.remaining_pct = remaining
            case SystemStatus():
                self.status = message
            case Version():
                self.version = message
            case StatusText(severity, text) if severity <= 4:
                self.texts.append(text)
        self.changed.set()

    @property
    def remaining(self) -> float | None:
        """What is left in the battery, by the better of the two messages."""
        if self.remaining_pct is not None:
            return self.remaining_pct
        return None if self.status is None else self.status.remaining_pct

    def missing(self) -> str:
        """Return what is still not known, in words; empty when the vehicle is ready."""
        if self.position is None or (self.position.lat_deg == 0.0 and self.position.lon_deg == 0.0):
            return "no position"
        if self.remaining is None:
            return "no battery state"
        if self.status is not None and self.status.prearm_ok is False:
            return "its own pre-arm checks fail" + (f": {self.texts[-1]}" if self.texts else "")
        return ""


async def answer(name: str, connection: str, sysid: int, link: Link, timeout_real_s: float, clock: Clock) -> None:
    """Wait for the first heartbeat.

    Raises:
        ConnectionFailed: nobody answered.
    """
    seen = await procedures.wait_for(
        link, clock, lambda message: isinstance(message, Heartbeat), timeout_real_s * clock.speedup
    )
    if not seen:
        raise ConnectionFailed(
            f"{name}: no heartbeat of system {sysid} on {connection} within {timeout_real_s:g} s; is it running, and "
            "does it send there?"
        )


async def interview(name: str, link: Link, clock: Clock, dialect: Dialect, ready_timeout_s: float) -> Facts:
    """Ask one vehicle for its streams, and wait until it is ready to fly.

    Raises:
        PreflightFailed: it did not become ready in time.
    """
    heard = _Heard()
    stop_listening = link.listen(heard.take)
    try:
        for message, rate_hz in STREAMS_HZ.items():
            await procedures.order(link, clock, CommandDialogue(orders.message_interval(message, rate_hz), "stream"))
        await procedures.order(
            link, clock, CommandDialogue(orders.request_message(orders.AUTOPILOT_VERSION), "version")
        )
        try:
            async with asyncio.timeout(ready_timeout_s / clock.speedup):
                await _steadily_ready(heard, clock)
        except TimeoutError:
            raise PreflightFailed(f"{name}: not ready after {ready_timeout_s:g} s: {heard.missing()}") from None
        rule = dialect.ground_station_failsafe
        action = await _parameter(link, clock, rule.action)
        timeout_s = await _parameter(link, clock, rule.timeout)
    finally:
        stop_listening()
    if heard.heartbeat is None or heard.position is None or heard.remaining is None:
        raise PreflightFailed(f"{name}: fell silent while it was asked")
    said = heard.version
    text = "unknown version" if said is None else f"{said.major}.{said.minor}.{said.patch}"
    return Facts(name, heard.heartbeat, heard.position, heard.remaining, text, action, timeout_s)


async def _steadily_ready(heard: _Heard, clock: Clock) -> None:
    """Wait until nothing was missing for a while: ArduPilot's pre-arm checks pass for a second and fail again."""
    since_s: float | None = None
    while True:
        if heard.missing() or heard.heartbeat is None:
            since_s = None
        elif since_s is None:
            since_s = clock.now_s()
        elif clock.now_s() - since_s >= STEADY_S:
            return
        heard.changed.clear()
        await heard.changed.wait()


async def prepare_return(name: str, link: Link, clock: Clock, dialect: Dialect, height_m: float) -> str:
    """Set the height of the vehicle's own return to its layer; returns what could not be done, in words."""
    rule = dialect.return_parameters
    height = await procedures.read_parameter(link, clock, rule.height)
    key, value = rule.height, height_m / rule.unit_m
    if height.value is None and rule.newer_height is not None:
        height = await procedures.read_parameter(link, clock, rule.newer_height)
        key, value = rule.newer_height, height_m
    if height.value is None:
        return f"{name}: {key} does not answer, so the height of its own return is not known"
    problems = []
    done = await procedures.set_parameter(link, clock, key, float(math.ceil(value)), height.value.kind)
    if not done.accepted:
        problems.append(done.reason)
    for other, wanted in ((rule.descend_height, height_m), (rule.cone, rule.cone_off)):
        if other is None:
            continue
        known = await procedures.read_parameter(link, clock, other)
        if known.value is None:
            continue
        done = await procedures.set_parameter(link, clock, other, wanted, known.value.kind)
        if not done.accepted:
            problems.append(done.reason)
    return f"{name}: height of its own return: {'; '.join(problems)}" if problems else ""


async def load(name: str, link: Link, clock: Clock, dialect: Dialect, mission: EncodedMission) -> None:
    """Put the first mission on board.

    Raises:
        PreflightFailed: what is on board is not what was sent.
    """
    done = await procedures.put_on_board(link, clock, dialect, mission.items)
    if not done.accepted:
        raise PreflightFailed(f"{name}: the mission is not on board: {done.reason}")


async def _parameter(link: Link, clock: Clock, name: str) -> float | None:
    ended = await procedures.read_parameter(link, clock, name)
    return ended.value.value if isinstance(ended.outcome, Accepted) and ended.value is not None else None
