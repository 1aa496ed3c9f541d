"""Query every vehicle before a flight and before each sortie of a day: answer, position, battery.

After an absence of the ground station: which vehicles answer, what is on board, and each vehicle's current mission
item.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field

from executor.core.context import Context
from executor.core.interface import messages
from executor.core.interface.codes import Severity
from executor.core.interface.events import Examined, Found, Resumed
from executor.core.interface.ports import Clock, Link, LinkCounts, OpenLink
from executor.core.preflight import fence_changes, onboard_failsafes, parameter_changes, vehicle_checks
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.radio_budget import ALONE, LinkMeasures, RadioShare, list_streams_hz
from executor.core.resume.reconciliation import compare_onboard_mission
from executor.core.state.fleet_state import FleetState
from executor.core.state.link_quality import DuplicateIdWatch, ReportedPosition, add_reported_position
from executor.core.state.radio_channel import choose_streams_hz
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.telemetry.vehicle_identity import ForeignSystem, add_foreign_system, parse_banner_version
from executor.errors import ConnectionFailed, PreflightFailed, VehicleRefused
from executor.protocols import vehicle_commands
from executor.protocols.parameter_dialogue import ParameterReading
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime import procedures
from executor.runtime.channel import channel_of
from executor.runtime.dialogue import listen_to, run_dialogue
from executor.runtime.procedures import ProcedureResult
from missions import Dialect, EncodedMission, MissionItem, MissionKind, dialect_for, list_other_names

STEADY_S = 3.0
ASK_WHY_S = 10.0
"""Seconds between two requests to a vehicle for its reasons against arming."""
BANNER_TIMEOUT_S = 3.0
TELL_S = 1.0
"""Seconds between progress lines; a vehicle may report another reason each time."""
MOST_REASONS = 20
"""Most reasons against arming to keep: the newest."""


@dataclass(slots=True)
class _VehicleAnswers:
    """Latest message of each kind from a vehicle before the flight."""

    clock: Clock
    heartbeat: messages.Heartbeat | None = None
    position: messages.Position | None = None
    remaining_pct: float | None = None
    battery: messages.Battery | None = None
    status: messages.SystemStatus | None = None
    gps: messages.Gps | None = None
    version: messages.Version | None = None
    radio: messages.Radio | None = None
    lost: float | None = None
    """Share of its frames that were lost."""
    reasons_s: dict[str, float] = field(default_factory=dict)
    """Reported reasons against arming, with the time of the last report."""
    strangers: frozenset[ForeignSystem] = frozenset()
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def update(self, message: messages.Message) -> None:
        match message:
            case messages.Heartbeat():
                self.heartbeat = message
            case messages.Position():
                self._note_position(message)
            case messages.Battery(remaining_pct=remaining):
                self.remaining_pct = self.remaining_pct if remaining is None else remaining
                self.battery = message
            case messages.SystemStatus():
                self.status = message
            case messages.Gps():
                self.gps = message
            case messages.Version():
                self.version = message
            case messages.Radio() | messages.Traffic():
                self._note_link(message)
            case messages.StationHeard() | messages.StationActed() | messages.DoubleHeard():
                self.strangers = add_foreign_system(self.strangers, message)
            case messages.StatusText(_, text):
                self._note_prearm_text(text)
        self.changed.set()

    def _note_position(self, position: messages.Position) -> None:
        self.position = position
        told = ReportedPosition(self.clock.now_s(), position.boot_s, position.lat_deg, position.lon_deg)
        stands = self.heartbeat is not None and not self.heartbeat.armed  # a resumed flight queries in the air
        self.twins = add_reported_position(self.twins, told, stands=stands)
        if self.twins.are_two:
            self.strangers = add_foreign_system(self.strangers, messages.DoubleHeard(0, ()))

    def _note_link(self, message: messages.Radio | messages.Traffic) -> None:
        if isinstance(message, messages.Radio):
            self.radio = message
        else:
            self.lost = message.missing / max(1, message.received + message.missing)

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
        """Remaining battery in percent, from the better of the two messages."""
        if self.remaining_pct is not None:
            return self.remaining_pct
        return None if self.status is None else self.status.remaining_pct

    @property
    def voltage_v(self) -> float | None:
        """Pack voltage, from the better of the two messages."""
        if self.battery is not None and self.battery.voltage_v is not None:
            return self.battery.voltage_v
        return None if self.status is None else self.status.voltage_v

    @property
    def is_unarmable(self) -> bool:
        return self.status is not None and self.status.prearm_ok is False

    def find_missing(self) -> str:
        """Return what is still missing, in words; empty when the vehicle is ready."""
        found = vehicle_checks.find_missing_before_takeoff(self.position, self.best_remaining_pct)
        if not found and self.is_unarmable:
            return vehicle_checks.describe_prearm_failure(self.reasons_s, self.status, self.clock.now_s())
        return found


async def wait_for_vehicle(
    name: str, connection: str, sysid: int, link: OpenLink, timeout_real_s: float, clock: Clock
) -> None:
    """Wait for the first heartbeat.

    Raises:
        ConnectionFailed: no vehicle answered.
    """
    seen = await procedures.wait_for(
        link, clock, lambda message: isinstance(message, messages.Heartbeat), timeout_real_s * clock.speedup
    )
    if not seen:
        raise ConnectionFailed(
            f"{name}: no heartbeat of system {sysid} on {connection} within {timeout_real_s:g} s; "
            f"{_describe_other_senders(link.counts) or 'is it running, and does it send there?'}"
        )


def _describe_other_senders(counts: LinkCounts) -> str:
    """Return which other senders were heard instead; empty if there were none."""
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
    share: RadioShare = ALONE,
) -> VehicleFacts:
    """Request one vehicle's streams, and wait until it is ready to fly.

    Args:
        name: Name of the vehicle.
        link: Link to the vehicle.
        clock: Clock of the flight.
        dialect: Expected dialect.
        ready_timeout_s: Time limit to become ready, in vehicle time.
        waits: Called with what is still missing, on every change.
        more: Parameters that this site needs in addition to the usual ones.
        share: The vehicle's share of its radio.

    Raises:
        PreflightFailed: it did not become ready in time.
    """
    heard = _VehicleAnswers(clock)
    with listen_to(link, heard.update):
        share = share.find_link_share(link.connection)
        step = share.choose_step(dialect, on_radio=False)
        await procedures.request_streams(link, clock, list_streams_hz(dialect, step))
        await procedures.send_order(
            link,
            clock,
            CommandDialogue(vehicle_commands.request_message(vehicle_commands.AUTOPILOT_VERSION), "version"),
        )
        if (thinned := share.choose_step(dialect, on_radio=heard.radio is not None)) != step:
            await procedures.request_streams(link, clock, list_streams_hz(dialect, thinned))
        try:
            async with asyncio.timeout(ready_timeout_s / clock.speedup):
                await _wait_until_ready(heard, link, clock, waits)
        except TimeoutError:
            raise PreflightFailed(f"{name}: not ready after {ready_timeout_s:g} s: {heard.find_missing()}") from None
        if heard.version is None:
            await _request_banner(heard, link, clock)
        asked = (*onboard_failsafes.list_preflight_parameters(dialect), *more)
        answers = await read_parameters(link, clock, asked, dialect)
    if heard.heartbeat is None or heard.position is None or heard.best_remaining_pct is None:
        raise PreflightFailed(f"{name}: link lost while its parameters were read")
    stations = [one for one in heard.strangers if isinstance(one, messages.StationHeard)]
    return VehicleFacts(
        name,
        heard.heartbeat,
        heard.position,
        heard.best_remaining_pct,
        heard.version,
        {name: one.value for name, one in answers.present.items()},
        tuple(sorted(stations, key=lambda station: (station.system, station.component))),
        tuple(one for one in heard.strangers if isinstance(one, messages.DoubleHeard)),
        heard.voltage_v,
        None if heard.battery is None else len(heard.battery.cells_v) or None,
        heard.gps,
        answers.unread,
        LinkMeasures(heard.radio, channel_of(link).round_trip.mean_s, heard.lost),
        acts=tuple(one for one in heard.strangers if isinstance(one, messages.StationActed)),
        links=link.describe_links(),
    )


async def _wait_until_ready(heard: _VehicleAnswers, link: Link, clock: Clock, waits: Callable[[str], None]) -> None:
    """Wait until nothing has been missing for a while: ArduPilot's pre-arm checks may pass for a second, then fail."""
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
    """Request the start-up texts, which name the version of firmware that has no message for it."""
    await procedures.send_order(link, clock, CommandDialogue(vehicle_commands.send_banner(), "banner"))
    if heard.version is None:
        await procedures.wait_for(link, clock, lambda _: heard.version is not None, BANNER_TIMEOUT_S)


async def read_present(context: Context, name: str, link: Link, clock: Clock) -> parameter_changes.Answers:
    """Read a vehicle's values of the parameters that a flight may change."""
    dialect = context.vehicles[name].dialect
    names = (*parameter_changes.list_return_parameters(dialect), *fence_changes.list_fence_parameters(context, name))
    return await read_parameters(link, clock, names, dialect)


async def read_parameters(
    link: Link, clock: Clock, names: Sequence[str], dialect: Dialect | None = None
) -> parameter_changes.Answers:
    """Read parameters at the pace of the link, until each is answered or absent, or the link is silent.

    Args:
        link: Link to the vehicle.
        clock: Clock of the flight.
        names: Names of the parameters.
        dialect: Source of the names that absent parameters have in other firmware; None to skip these.
    """
    answers = await _read_at_pace(link, clock, names)
    more = () if answers.unread or dialect is None else list_other_names(dialect, names, answers.present)
    if not more:
        return answers
    # One present parameter is read along: with it a missing parameter can be told from a silent link.
    found = await _read_at_pace(link, clock, (*more, *tuple(answers.present)[:1]))
    return parameter_changes.Answers({**answers.present, **found.present}, found.unread.difference(answers.present))


async def _read_at_pace(link: Link, clock: Clock, names: Iterable[str]) -> parameter_changes.Answers:
    present: dict[str, messages.ParamValue] = {}
    began_s, unread = clock.now_s(), tuple(names)
    while unread:
        reading = await run_dialogue(ParameterReading.start(unread), link, clock)
        present |= {value.name: value for value in reading.values}
        unread = tuple(name for name in unread if name in reading.unread)
        if clock.now_s() - began_s >= procedures.PATIENCE_REAL_S * clock.speedup or reading.refused:
            break
    return parameter_changes.Answers(present, frozenset(unread))


async def set_changes(link: Link, clock: Clock, changes: Iterable[parameter_changes.KeptParameter]) -> dict[str, str]:
    """Set the parameters that a flight needs; return failures by name, empty where the new value was read back."""
    ends = {}
    for change in changes:
        if change.name == parameter_changes.UNASKED:
            off = dialect_for(change.autopilot).unasked_hz
            ends[change.name] = await procedures.set_streams(link, clock, off, vehicle_commands.NEVER_US)
            continue
        done = await procedures.set_parameter(link, clock, change.name, change.new, change.kind)
        ends[change.name] = "" if done.accepted else done.reason
    return ends


async def load_mission(
    name: str,
    link: Link,
    clock: Clock,
    dialect: Dialect,
    mission: EncodedMission,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Upload the first mission.

    Nothing moves yet, so an interrupted upload costs only time: it is retried from the start.

    Args:
        name: Name of the vehicle.
        link: Link to the vehicle.
        clock: Clock of the flight.
        dialect: The vehicle's dialect.
        mission: The mission.
        tell: Called with progress lines.

    Raises:
        VehicleRefused: the mission on board differs from the one sent.
    """

    def told(text: str) -> None:
        tell(f"{name}: {text}")

    done = await procedures.upload_and_verify(link, clock, dialect, mission.items, tell=told)
    if done.broken_off:
        told(f"the upload was broken off ({done.reason}); uploading again")
        done = await procedures.upload_and_verify(link, clock, dialect, mission.items, tell=told)
    if not done.accepted:
        raise VehicleRefused(f"{name}: the mission is not on board: {done.reason}")


async def upload_list(
    link: Link, clock: Clock, dialect: Dialect, kind: MissionKind, items: tuple[MissionItem, ...]
) -> ProcedureResult:
    """Upload a fence or rally points, and read them back."""
    if kind is MissionKind.FENCE:
        return await procedures.upload_and_verify_fence(link, clock, dialect, items)
    return await procedures.upload_and_verify(link, clock, dialect, items, kind=kind)


async def load_lists(name: str, link: Link, clock: Clock, dialect: Dialect, wanted: fence_changes.WantedLists) -> None:
    """Upload a fence and rally points.

    Raises:
        VehicleRefused: what is on board differs from what was sent.
    """
    for kind, items in wanted.items():
        done = await upload_list(link, clock, dialect, kind, items)
        if not done.accepted:
            what = "the fence is" if kind is MissionKind.FENCE else "the rally points are"
            raise VehicleRefused(f"{name}: {what} not on board: {done.reason}")


async def examine_vehicle(
    context: Context,
    name: str,
    link: Link,
    clock: Clock,
    within_s: float,
    *,
    sets: bool = False,
    share: RadioShare = ALONE,
) -> Examined:
    """Wait until a vehicle is ready, and read its battery and parameters.

    It may just be booting: earlier reports do not count.

    Args:
        context: Context of the flight.
        name: Name of the vehicle.
        link: Link to the vehicle.
        clock: Clock of the flight.
        within_s: Time limit to become ready, in vehicle time.
        sets: Whether to set parameters again that differ from what the flight had set.
        share: The vehicle's share of its radio.
    """
    dialect, began_s = context.vehicles[name].dialect, clock.now_s()
    seen = await procedures.wait_for(link, clock, lambda message: isinstance(message, messages.Heartbeat), within_s)
    if not seen:
        return Examined(name, ready=False, reason=f"no HEARTBEAT for {within_s:g} s")
    left_s = within_s - (clock.now_s() - began_s)
    try:
        facts = await interview_vehicle(name, link, clock, dialect, left_s, lambda _: None, share=share)
        off = share.list_unwanted(dialect, on_radio=facts.link.radio is not None)
        await procedures.set_streams(link, clock, off, vehicle_commands.NEVER_US)  # a reboot restores them
        # Nothing to set where the values are as the flight has set them.
        proposal = fence_changes.propose_changes(context, {name: await read_present(context, name, link, clock)})
        if sets and (lacks := proposal.changes_of(name)):
            await set_changes(link, clock, lacks)
            proposal = fence_changes.propose_changes(context, {name: await read_present(context, name, link, clock)})
    except PreflightFailed as error:
        return Examined(name, ready=False, reason=str(error).removeprefix(f"{name}: "))
    refused = [check.text for check in proposal.checks if check.severity is Severity.STOP]
    if facts.unread:
        refused.insert(0, onboard_failsafes.describe_unread_parameters(facts.unread))
    if reason := _find_mismatch(context, facts) or next(iter(refused), ""):
        return Examined(name, ready=False, reason=reason)
    return Examined(
        name,
        ready=True,
        reason="",
        remaining_pct=facts.remaining_pct,
        voltage_v=facts.voltage_v,
        cells=facts.cells,
        parameters=tuple(sorted(facts.parameters.items())),
        changed=tuple(change.words_set for change in proposal.changes_of(name)),
        sets=sets,
    )


def _find_mismatch(context: Context, facts: VehicleFacts) -> str:
    """Return why it is another vehicle than before, or not at rest; empty if it is the same and at rest."""
    dialect = context.vehicles[facts.name].dialect
    if facts.heartbeat.autopilot != dialect.number:
        return f"HEARTBEAT autopilot is {facts.heartbeat.autopilot}, expected {dialect.name} ({dialect.number})"
    return "it is armed" if facts.heartbeat.armed else ""


ONE_REAL_S = 5.0
"""Real seconds to wait for one expected vehicle; supervision of the others waits meanwhile."""
READ_REAL_S = 6.0
READ_TRIES = 3
"""Attempts to read a mission that may be half updated; over a bad link one attempt may fail."""
READ_WAYPOINT_REAL_S = 0.25
"""Real seconds per expected waypoint to read a mission. After that the vehicle's own report is trusted, unless half of
a new mission may be on board."""
STREAMS_REAL_S = 3.0
"""Real seconds to wait for streams before requesting them again; only a rebooted vehicle needs that."""


@dataclass(slots=True)
class _Answer:
    """Reports of one vehicle, filled in as they arrive."""

    anybody: asyncio.Event
    """Set once any vehicle is heard."""
    heard: asyncio.Event = field(default_factory=asyncio.Event)
    seq: int | None = None
    items: tuple[MissionItem, ...] | None = None

    def update(self, message: messages.Message) -> None:
        match message:
            case messages.Heartbeat():
                self.heard.set()
                self.anybody.set()
            case messages.MissionCurrent(seq):
                self.seq = seq


async def reconnect_vehicles(
    context: Context, state: Callable[[], FleetState], links: Mapping[str, Link], clock: Clock, patience_real_s: float
) -> Resumed:
    """Ask every vehicle for its mission and state.

    Args:
        context: Context of the flight.
        state: Returns the known state; called at the end, since the flight goes on while vehicles answer.
        links: Links to the vehicles.
        clock: Clock of the flight.
        patience_real_s: Real seconds to wait for the first answer of any vehicle.

    Raises:
        ConnectionFailed: no vehicle answers.
    """
    anybody = asyncio.Event()
    answers = {name: _Answer(anybody) for name in links}
    with ExitStack() as stack:
        for name, link in links.items():
            stack.enter_context(listen_to(link, answers[name].update))
        try:
            async with asyncio.timeout(patience_real_s):
                await anybody.wait()
        except TimeoutError:
            raise ConnectionFailed(
                f"no vehicle answers within {patience_real_s:g} s; is the radio plugged in, and is this the computer "
                "that they send to?"
            ) from None
        moving = {Stage.STARTING, Stage.FLYING, Stage.RETURNING}
        expected = [name for name, one in state().vehicles.items() if _is_pending(state(), one) or one.stage in moving]
        with suppress(TimeoutError):
            async with asyncio.timeout(ONE_REAL_S):
                for name in expected:
                    await answers[name].heard.wait()
        async with asyncio.TaskGroup() as tasks:
            for name, answer in answers.items():
                if answer.heard.is_set():
                    patience_s = _patience_real_s(state(), state().vehicles[name])
                    streams_hz = choose_streams_hz(context.vehicles[name], state().vehicles[name])
                    asks = _query_vehicle(links[name], clock, streams_hz, answer, patience_s)
                    tasks.create_task(asks, name=name)
    found = [
        compare_onboard_mission(context, state(), name, answer.items, answer.seq)
        if answer.heard.is_set()
        else Found(name, heard=False, seq=None, items=None, matches=())
        for name, answer in answers.items()
    ]
    return Resumed(tuple(found))


def _is_pending(state: FleetState, vehicle: VehicleState) -> bool:
    return state.replanning.replan is not None and vehicle.name in state.replanning.replan.pending


def _patience_real_s(state: FleetState, vehicle: VehicleState) -> float | None:
    """Return the time limit to read a vehicle's mission: none if not flown, unlimited if possibly half updated.

    Over a bad link reading takes long, and the other vehicles are unsupervised meanwhile.
    """
    if _is_pending(state, vehicle):
        return None
    if vehicle.stage not in {Stage.STARTING, Stage.FLYING} or vehicle.assignment.board is None:
        return 0.0
    return READ_REAL_S + READ_WAYPOINT_REAL_S * len(vehicle.assignment.board.path.waypoints)


async def _query_vehicle(
    link: Link, clock: Clock, streams_hz: Mapping[int, float], answer: _Answer, patience_s: float | None
) -> None:
    if patience_s != 0.0:
        with suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                for _ in range(1 if patience_s is not None else READ_TRIES):
                    answer.items = await procedures.read_list(link, clock)
                    if answer.items is not None:
                        break
    with suppress(TimeoutError):
        async with asyncio.timeout(STREAMS_REAL_S):
            await procedures.request_streams(link, clock, streams_hz)
