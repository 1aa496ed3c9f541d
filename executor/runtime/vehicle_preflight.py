"""Before the flight: who answers, where everybody stands, what is in the batteries; then the missions on board."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from executor.core.interface.messages import (
    Battery,
    DoubleHeard,
    Gps,
    Heartbeat,
    Message,
    Position,
    StationHeard,
    StatusText,
    SystemStatus,
    Version,
)
from executor.core.interface.ports import Clock, Link, LinkCounts, OpenLink
from executor.core.preflight import failsafe_parameters, vehicle_checks
from executor.core.preflight.board_changes import OnboardLists
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.duplicate_ids import DuplicateIdWatch, ReportedPosition, add_reported_position
from executor.core.telemetry.firmware import parse_banner_version
from executor.core.telemetry.foreign_systems import ForeignSystem, add_foreign_system
from executor.errors import ConnectionFailed, PreflightFailed, VehicleRefused
from executor.protocols import vehicle_commands
from executor.protocols.command import CommandDialogue
from executor.runtime import procedures, stream_requests
from executor.runtime.board_restore import read_parameters
from missions import Dialect, EncodedMission, MissionKind

STEADY_S = 3.0
ASK_WHY_S = 10.0
"""How often a vehicle that cannot be armed is asked for its reasons."""
BANNER_TIMEOUT_S = 3.0
TELL_S = 1.0
"""How often it is said what is waited for: a vehicle may give another reason every time."""
MOST_REASONS = 20
"""Of those why it cannot be armed the newest are kept."""


@dataclass(slots=True)
class _VehicleAnswers:
    """The latest of everything that a vehicle said before the flight."""

    clock: Clock
    heartbeat: Heartbeat | None = None
    position: Position | None = None
    remaining_pct: float | None = None
    battery: Battery | None = None
    status: SystemStatus | None = None
    gps: Gps | None = None
    version: Version | None = None
    reasons_s: dict[str, float] = field(default_factory=dict)
    """Why it cannot be armed, by its own report, and when it said so last."""
    strangers: frozenset[ForeignSystem] = frozenset()
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def update(self, message: Message) -> None:
        match message:
            case Heartbeat():
                self.heartbeat = message
            case Position():
                self.position = message
                told = ReportedPosition(self.clock.now_s(), message.boot_s, message.lat_deg, message.lon_deg)
                self.twins = add_reported_position(self.twins, told)
                if self.twins.are_two:
                    self.strangers = add_foreign_system(self.strangers, DoubleHeard(0, ()))
            case Battery(remaining_pct=remaining):
                self.remaining_pct = self.remaining_pct if remaining is None else remaining
                self.battery = message
            case SystemStatus():
                self.status = message
            case Gps():
                self.gps = message
            case Version():
                self.version = message
            case StationHeard() | DoubleHeard():
                self.strangers = add_foreign_system(self.strangers, message)
            case StatusText(_, text):
                self._note_prearm_text(text)
        self.changed.set()

    def _note_prearm_text(self, text: str) -> None:
        reason = vehicle_checks.parse_prearm_reason(text)
        if reason is not None:
            self.reasons_s.pop(reason, None)
            self.reasons_s[reason] = self.clock.now_s()
            if len(self.reasons_s) > MOST_REASONS:
                del self.reasons_s[next(iter(self.reasons_s))]
        if self.version is None:
            self.version = parse_banner_version(text)

    @property
    def best_remaining_pct(self) -> float | None:
        """What is left in the battery, by the better of the two messages."""
        if self.remaining_pct is not None:
            return self.remaining_pct
        return None if self.status is None else self.status.remaining_pct

    @property
    def voltage_v(self) -> float | None:
        """Of its pack, by the better of the two messages."""
        if self.battery is not None and self.battery.voltage_v is not None:
            return self.battery.voltage_v
        return None if self.status is None else self.status.voltage_v

    @property
    def is_unarmable(self) -> bool:
        """Whether its own checks fail."""
        return self.status is not None and self.status.prearm_ok is False

    def find_missing(self) -> str:
        """Return what is still not known, in words; empty when the vehicle is ready."""
        if self.position is None or (self.position.lat_deg == 0.0 and self.position.lon_deg == 0.0):
            return "no position"
        if self.best_remaining_pct is None:
            return "no battery state"
        if self.is_unarmable:
            return vehicle_checks.describe_prearm_failure(self.reasons_s, self.status, self.clock.now_s())
        return ""


async def wait_for_vehicle(
    name: str, connection: str, sysid: int, link: OpenLink, timeout_real_s: float, clock: Clock
) -> None:
    """Wait for the first heartbeat.

    Raises:
        ConnectionFailed: nobody answered.
    """
    seen = await procedures.wait_for(
        link, clock, lambda message: isinstance(message, Heartbeat), timeout_real_s * clock.speedup
    )
    if not seen:
        raise ConnectionFailed(
            f"{name}: no heartbeat of system {sysid} on {connection} within {timeout_real_s:g} s; "
            f"{_describe_other_senders(link.counts) or 'is it running, and does it send there?'}"
        )


def _describe_other_senders(counts: LinkCounts) -> str:
    """Return what came instead of the one that was waited for; empty if nothing did."""
    if counts.refused:
        refused = ", ".join(f"{count} {reason}" for reason, count in sorted(counts.refused.items()))
        return f"frames came that were refused: {refused}; does it hold the same signing key?"
    others = [f"system {system}" + (f" speaks from {place}" if place else " speaks") for system, place in sorted(
        counts.strangers.items())]  # fmt: skip
    return f"there {', '.join(others)}" if others else ""


async def interview_vehicle(
    name: str,
    link: Link,
    clock: Clock,
    dialect: Dialect,
    ready_timeout_s: float,
    waits: Callable[[str], None],
    more: Sequence[str] = (),
) -> VehicleFacts:
    """Ask one vehicle for its streams, and wait until it is ready to fly.

    Args:
        name: Of the vehicle.
        link: To it.
        clock: The flight's.
        dialect: What it should speak.
        ready_timeout_s: How long it may take to be ready, in its time.
        waits: Told what it is waited for, whenever that changes.
        more: Parameters that this site asks for beside the usual ones.

    Raises:
        PreflightFailed: it did not become ready in time.
    """
    heard = _VehicleAnswers(clock)
    stop_listening = link.listen(heard.update)
    try:
        await stream_requests.request_streams(link, clock, dialect)
        await procedures.send_order(
            link,
            clock,
            CommandDialogue(vehicle_commands.request_message(vehicle_commands.AUTOPILOT_VERSION), "version"),
        )
        try:
            async with asyncio.timeout(ready_timeout_s / clock.speedup):
                await _wait_until_ready(heard, link, clock, waits)
        except TimeoutError:
            raise PreflightFailed(f"{name}: not ready after {ready_timeout_s:g} s: {heard.find_missing()}") from None
        if heard.version is None:
            await _request_banner(heard, link, clock)
        answers = await read_parameters(
            link,
            clock,
            (*failsafe_parameters.list_preflight_parameters(dialect), *more),
            lambda present: failsafe_parameters.list_older_parameters(dialect, present),
        )
    finally:
        stop_listening()
    if heard.heartbeat is None or heard.position is None or heard.best_remaining_pct is None:
        raise PreflightFailed(f"{name}: link lost while its parameters were read")
    stations = [one for one in heard.strangers if isinstance(one, StationHeard)]
    return VehicleFacts(
        name,
        heard.heartbeat,
        heard.position,
        heard.best_remaining_pct,
        heard.version,
        {name: one.value for name, one in answers.present.items()},
        tuple(sorted(stations, key=lambda station: (station.system, station.component))),
        tuple(one for one in heard.strangers if isinstance(one, DoubleHeard)),
        heard.voltage_v,
        None if heard.battery is None else len(heard.battery.cells_v) or None,
        heard.gps,
        answers.unread,
    )


async def _wait_until_ready(heard: _VehicleAnswers, link: Link, clock: Clock, waits: Callable[[str], None]) -> None:
    """Wait until nothing was missing for a while: ArduPilot's pre-arm checks pass for a second and fail again."""
    since_s: float | None = None
    asked_s, told, told_s = float("-inf"), "", float("-inf")
    while True:
        missing = heard.find_missing()
        if missing or heard.heartbeat is None:
            since_s = None
        elif since_s is None:
            since_s = clock.now_s()
        elif clock.now_s() - since_s >= STEADY_S:
            return
        if heard.is_unarmable and clock.now_s() - asked_s >= ASK_WHY_S:
            asked_s = clock.now_s()
            link.send(vehicle_commands.run_prearm_checks())
        if missing and missing != told and clock.now_s() - told_s >= TELL_S:
            told, told_s = missing, clock.now_s()
            waits(missing)
        heard.changed.clear()
        await heard.changed.wait()


async def _request_banner(heard: _VehicleAnswers, link: Link, clock: Clock) -> None:
    """Ask for the start-up texts, which name the version of a firmware that has no message for it."""
    await procedures.send_order(link, clock, CommandDialogue(vehicle_commands.send_banner(), "banner"))
    until_s = clock.now_s() + BANNER_TIMEOUT_S
    while heard.version is None and clock.now_s() < until_s:
        heard.changed.clear()
        try:
            async with asyncio.timeout((until_s - clock.now_s()) / clock.speedup):
                await heard.changed.wait()
        except TimeoutError:
            return


async def load_mission(
    name: str,
    link: Link,
    clock: Clock,
    dialect: Dialect,
    mission: EncodedMission,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Put the first mission on board.

    Nothing moves yet, so an upload that was broken off costs only time: all of it is tried again.

    Args:
        name: Of the vehicle.
        link: To it.
        clock: The flight's.
        dialect: The vehicle's.
        mission: The mission.
        tell: Told in a line what is waited for.

    Raises:
        VehicleRefused: what is on board is not what was sent.
    """

    def told(text: str) -> None:
        tell(f"{name}: {text}")

    done = await procedures.upload_and_verify(link, clock, dialect, mission.items, tell=told)
    if done.broken_off:
        told(f"the upload was broken off ({done.reason}); uploading again")
        done = await procedures.upload_and_verify(link, clock, dialect, mission.items, tell=told)
    if not done.accepted:
        raise VehicleRefused(f"{name}: the mission is not on board: {done.reason}")


async def read_lists(link: Link, clock: Clock) -> OnboardLists:
    """Read what a vehicle carries beside its mission."""
    return OnboardLists(
        await procedures.read_list(link, clock, MissionKind.FENCE),
        await procedures.read_list(link, clock, MissionKind.RALLY),
    )


async def load_lists(name: str, link: Link, clock: Clock, dialect: Dialect, wanted: OnboardLists) -> None:
    """Put a fence and rally points on board; None of either leaves what is there.

    Raises:
        VehicleRefused: what is on board is not what was sent.
    """
    if wanted.fence is not None:
        done = await procedures.upload_and_verify_fence(link, clock, dialect, wanted.fence)
        if not done.accepted:
            raise VehicleRefused(f"{name}: the fence is not on board: {done.reason}")
    if wanted.rally is not None:
        done = await procedures.upload_and_verify(link, clock, dialect, wanted.rally, kind=MissionKind.RALLY)
        if not done.accepted:
            raise VehicleRefused(f"{name}: the rally points are not on board: {done.reason}")
