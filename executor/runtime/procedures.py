"""What is done with one vehicle, as sequences of dialogues: mission on board, start, return, parameters, streams."""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TypeVar

from executor.core.interface.codes import Ending
from executor.core.interface.commands import Disarm, Hold, LandNow, Resume, SendHome
from executor.core.interface.messages import Heartbeat, Message, MessageInterval, SendCommand, SendParamSet, StatusText
from executor.core.interface.ports import Clock, Link
from executor.core.radio_budget import HEARTBEAT, HEARTBEAT_HZ, RadioShare
from executor.protocols import vehicle_commands
from executor.protocols.machine import MOST_AHEAD, DialogueMachine, Rejected, TimedOut
from executor.protocols.mission_file import MissionFileUpload
from executor.protocols.mission_transfer import DownloadDialogue, UploadDialogue
from executor.protocols.parameter_dialogue import ParameterDialogue
from executor.protocols.turns import Rank
from executor.protocols.vehicle_commands import CommandDialogue
from executor.runtime import dialogue
from executor.runtime.channel import channel_of
from missions import Dialect, MissionItem, MissionKind, StartStep, compute_list_checksum, find_mission_differences
from missions.autopilots.dialect import ModeNumber
from missions.fences import find_list_differences

M = TypeVar("M", bound=DialogueMachine)
AnyUpload = UploadDialogue | MissionFileUpload

UPLOAD_TRIES = 3
UPLOAD_PATIENCE_S = 60.0
"""Seconds for which a begun upload is retried; the mixture on board meanwhile stays in the vehicle's own layer."""
UPLOAD_PATIENCE_REAL_S = 8.0
"""The same in real seconds; half of it for an upload that has not begun, perhaps because the computer is busy."""
AGAIN_WAIT_S = 3.0
"""Pause before an upload is retried, in which another station's transfer may end."""
BUSY_TRIES = 4
"""Attempts on a vehicle that is busy with another transfer. From the second on they wait until a dead transfer has
timed out; on PX4 earlier requests keep it alive."""
BUSY = frozenset({Ending.ERROR, Ending.OTHER_STATION})
"""Endings of an announcement that mean busy."""
FREED_MARGIN_S = 1.0
READ_BACK_TRIES = 3
READ_WORTH_S = 2.0
"""Time to read a list above which only the part without other proof is read."""
SILENCE_MARGIN_S = 1.0
"""Margin above the vehicle's own time-out before an upload is abandoned."""
MODE_TIMEOUT_S = 5.0
PATIENCE_REAL_S = 3.0
"""Least real seconds before giving up, as a busy computer may delay answers in fast simulation. Measured: three PX4 at
four times real time left every question of one second unanswered on two busy cores."""
FENCE_DROPPED = "geofence invalid"
"""PX4: "Geofence invalid, doesn't contain Home position", "... current vehicle position"."""
DROPPED_S = 1.5
"""Seconds to wait for that text; it came half a second after the acknowledgement (measured)."""
ARM_PATIENCE_S = 30.0
ARM_AGAIN_S = 2.0


@dataclass(frozen=True, slots=True)
class ProcedureResult:
    """How a procedure ended."""

    accepted: bool
    reason: str = ""
    mixed: bool = False
    """Whether part of a new mission may be on board."""
    lost: bool = False
    """Whether no answer came."""
    refused: bool = False
    """Whether the answer was a refusal."""
    armed: bool = False
    """Whether the vehicle had acknowledged arming."""
    code: Ending | None = field(default=None, compare=False)
    """Reason why it was not accepted."""
    broken_off: bool = field(default=False, compare=False)
    """Whether an upload had begun with an unknown result."""


@dataclass(frozen=True, slots=True)
class UploadNeed:
    """How much of a radio an upload may take from others behind it."""

    rank: Rank = Rank.BEFORE_FLIGHT
    needed_s: float = math.inf
    """Seconds within which it should be complete; the most urgent goes first."""
    alike: int = 0
    """Number of leading items equal to those read from the vehicle before."""
    rest: tuple[MissionItem, ...] = ()
    """Items read then beyond the length of the new list."""


@dialogue.count_awake_time
async def upload_and_verify(
    link: Link,
    clock: Clock,
    dialect: Dialect,
    items: tuple[MissionItem, ...],
    wanted: Callable[[bool], bool] = lambda _: True,
    tell: Callable[[str], None] = lambda _: None,
    kind: MissionKind = MissionKind.MISSION,
    need: UploadNeed | None = None,
) -> ProcedureResult:
    """Upload a mission, a fence or rally points, and read it back until both are the same, but not for ever.

    Args:
        link: To the vehicle.
        clock: The flight's.
        dialect: The vehicle's.
        items: All of it; none clears a fence or rally points.
        wanted: Asked before it is begun again, with whether a part of it may be on board.
        tell: Told once that the vehicle is busy, and for how long that is borne.
        kind: Which of the vehicle's lists.
        need: How soon it is needed, where other vehicles behind the same radio are given something too.
    """
    need = need or UploadNeed()
    reason, mixed, stalled, began_s = "", False, False, clock.now_s()
    busy, broken_off, real_began_s = 0, False, dialogue.underlying(clock).now_s()
    code: Ending | None = None
    for attempt in itertools.count():
        # Without a part of the new mission on board nothing is at stake but time: others can be given the work.
        real_s = UPLOAD_PATIENCE_REAL_S * (1.0 if mixed else 0.5) if stalled else 0.0
        patience_s = max(UPLOAD_PATIENCE_S if mixed else 0.0, real_s * clock.speedup)
        tries = UPLOAD_TRIES * dialogue.times_slower(clock, real_began_s, began_s)
        if attempt >= tries and not 0 < busy < BUSY_TRIES and clock.now_s() - began_s > patience_s:
            break
        if attempt:
            await asyncio.sleep((_transfer_release_s(dialect) if busy > 1 else AGAIN_WAIT_S) / clock.speedup)
        async with channel_of(link).take_turn(need.rank, need.needed_s) as waited:
            if (attempt or waited) and not wanted(mixed):
                return ProcedureResult(
                    accepted=False, reason="it has left its mission", mixed=mixed, code=Ending.LEFT_MISSION
                )
            if waited and not attempt:
                began_s, real_began_s = clock.now_s(), dialogue.underlying(clock).now_s()
            upload = await _upload_as_needed(link, clock, dialect, items, kind, need)
            proof = await _prove_on_board(link, clock, dialect, upload, need.alike)
        mixed = mixed or _may_leave_mixture(upload, dialect)
        # Item by item, what stands before the new part is sent again, too.
        need = replace(need, alike=0) if isinstance(upload, UploadDialogue) else need
        # A plain refusal does not become another answer by waiting.
        stalled |= upload.is_begun or not isinstance(upload.outcome, Rejected)
        broken_off = _is_broken_off(upload, broken=broken_off)
        if not upload.accepted:
            reason, code = upload.reason, upload.code
            busy = _count_busy(upload, code, busy, dialect, tell)
        if proof is None:
            continue
        if proof.accepted:
            return proof
        reason, code, broken_off = proof.reason, proof.code, broken_off or proof.lost
    return ProcedureResult(accepted=False, reason=reason, mixed=mixed, code=code, broken_off=broken_off)


_FILE_NUMBERS = itertools.count(step=4096)
"""Numbers of the first requests of mission files; an upload has fewer requests than the step."""


async def _upload_as_needed(
    link: Link, clock: Clock, dialect: Dialect, items: tuple[MissionItem, ...], kind: MissionKind, need: UploadNeed
) -> AnyUpload:
    """Upload once: the new part alone, as a file, to a vehicle that takes it so; everything else item by item."""
    if dialect.takes_mission_file and need.alike > 0:
        first, number = min(need.alike, len(items) - 1), next(_FILE_NUMBERS) & 0xFFFF
        file = await dialogue.run_dialogue(MissionFileUpload(items, first, number, need.rest), link, clock)
        if file.is_open:
            return file
    return await upload_once(link, clock, dialect, items, kind)


async def _prove_on_board(
    link: Link, clock: Clock, dialect: Dialect, upload: AnyUpload, alike: int
) -> ProcedureResult | None:
    """See that what was uploaded is on board; None where not all of it was even sent.

    It is read back, where that is soon done, and otherwise as far as it needs to be: a vehicle that says the checksum
    of what it has received and stored has proven it, and of a mission that begins as the one before, which was read,
    the rest is read. Where every item was sent, perhaps only the acknowledgement got lost: what is on board decides.
    """
    items, trip = upload.items, upload.round_trip
    if isinstance(upload, MissionFileUpload) and upload.is_proven:
        return ProcedureResult(accepted=True)
    if not upload.accepted and items and not upload.is_all_sent:
        return None
    reading = DownloadDialogue(upload.kind, ahead=MOST_AHEAD if dialect.reads_in_any_order else 1)
    if len(items) * (trip.mean_s or 0.0) > READ_WORTH_S:
        known = compute_list_checksum(items) if dialect.says_checksum and items else None
        if known is not None and upload.accepted and upload.checksum == known:
            return ProcedureResult(accepted=True)
        if dialect.takes_mission_file and isinstance(upload, UploadDialogue) and upload.kind is MissionKind.MISSION:
            asking = MissionFileUpload(items, len(items), next(_FILE_NUMBERS) & 0xFFFF)
            if (await dialogue.run_dialogue(asking, link, clock)).is_proven:
                return ProcedureResult(accepted=True)
        reading = replace(reading, checksum=known, first=min(alike, len(items) - 1))
    waits_s = max(reading.round_trip.waits_s, trip.waits_s)
    reading = replace(reading, round_trip=replace(reading.round_trip, waits_s=waits_s))
    for _ in range(READ_BACK_TRIES if upload.accepted else 1):
        download = await dialogue.run_dialogue(reading, link, clock)
        if download.accepted:
            break
    if not download.accepted:
        lost = isinstance(download.outcome, TimedOut)
        return ProcedureResult(accepted=False, reason=download.reason, code=download.code, lost=lost)
    return _compare(upload, download, dialect)


def _may_leave_mixture(upload: AnyUpload, dialect: Dialect) -> bool:
    """Return whether a part of a new mission may be on board; fences and rally points are taken as a whole."""
    one_by_one = isinstance(upload, UploadDialogue) and not dialect.upload_is_atomic
    return one_by_one and upload.is_begun and upload.kind is MissionKind.MISSION


def _compare(upload: AnyUpload, download: DownloadDialogue, dialect: Dialect) -> ProcedureResult:
    items = upload.items[download.first :]
    different = (
        find_mission_differences(items, download.items, dialect)
        if upload.kind is MissionKind.MISSION
        else find_list_differences(items, download.items)
    )
    if download.proven or not different:
        return ProcedureResult(accepted=True)
    return ProcedureResult(accepted=False, reason=f"read-back differs: {different[0]}", code=Ending.READ_BACK_DIFFERS)


def _is_broken_off(upload: AnyUpload, *, broken: bool) -> bool:
    """Return whether an upload has come to no end since one began: who does not answer any more has ended nothing."""
    if upload.is_begun:
        return isinstance(upload.outcome, TimedOut | Rejected)
    unheard = isinstance(upload.outcome, TimedOut) or upload.code in BUSY
    return broken and unheard


def _count_busy(
    upload: AnyUpload, code: Ending | None, busy: int, dialect: Dialect, tell: Callable[[str], None]
) -> int:
    """Return how often in a row the vehicle was busy; the first time is told."""
    if upload.is_begun or code not in BUSY:
        return 0
    if busy == 0:
        tell(f"busy with another mission transfer; uploading again for up to {busy_patience_s(dialect):g} s")
    return busy + 1


def busy_patience_s(dialect: Dialect) -> float:
    """Return how long a vehicle may be busy with another transfer before its mission is given up."""
    return AGAIN_WAIT_S + (BUSY_TRIES - 2) * _transfer_release_s(dialect)


def _transfer_release_s(dialect: Dialect) -> float:
    return dialect.transfer_freed_s + FREED_MARGIN_S


async def read_list(
    link: Link, clock: Clock, kind: MissionKind = MissionKind.MISSION
) -> tuple[MissionItem, ...] | None:
    """Read one of a vehicle's lists, by default its mission; None if it does not let it be read."""
    download = await dialogue.run_dialogue(DownloadDialogue(kind), link, clock)  # at the pace of any autopilot
    return download.items if download.accepted else None


async def upload_and_verify_fence(
    link: Link,
    clock: Clock,
    dialect: Dialect,
    items: tuple[MissionItem, ...],
    wanted: Callable[[bool], bool] = lambda _: True,
) -> ProcedureResult:
    """Upload a fence and read it back; a vehicle that drops it says so in a text alone, and a moment later.

    Args:
        link: To the vehicle.
        clock: The flight's.
        dialect: The vehicle's.
        items: The fence.
        wanted: Asked before it is begun, and begun again.
    """
    if not wanted(False):
        return ProcedureResult(accepted=False, reason="it has left its mission", code=Ending.LEFT_MISSION)
    with dialogue.collect(link, StatusText) as said:
        done = await upload_and_verify(link, clock, dialect, items, wanted, kind=MissionKind.FENCE)
        if done.accepted and items and dialect.geofence.checked_on_load:
            await asyncio.sleep(DROPPED_S / clock.speedup)
    dropped = [one.text for one in said if FENCE_DROPPED in one.text.lower()]
    if done.accepted and dropped:
        return ProcedureResult(accepted=False, reason=f"dropped: {dropped[-1]}", code=Ending.FENCE_DROPPED)
    return done


async def upload_once(
    link: Link,
    clock: Clock,
    dialect: Dialect,
    items: tuple[MissionItem, ...],
    kind: MissionKind = MissionKind.MISSION,
) -> UploadDialogue:
    """Upload a mission, a fence or rally points once."""
    silence_s = dialect.upload_silence_s + SILENCE_MARGIN_S
    upload = UploadDialogue(items, silence_s, dialect.upload_warnings, kind)
    return await dialogue.run_dialogue(upload, link, clock)


async def send_order(link: Link, clock: Clock, command: CommandDialogue) -> ProcedureResult:
    """Give one command."""
    return _build_result(await _run_patiently(command, link, clock))


def _build_result(ended: DialogueMachine) -> ProcedureResult:
    lost, refused = isinstance(ended.outcome, TimedOut), isinstance(ended.outcome, Rejected)
    return ProcedureResult(ended.accepted, ended.reason, lost=lost, refused=refused, code=ended.code)


async def arm_and_start(link: Link, clock: Clock, dialect: Dialect) -> ProcedureResult:
    """Arm and start the mission on board, in the way that the autopilot wants it.

    The crew's word is for now: if this computer stands still meanwhile, nothing more is ordered.
    """
    armed = False
    with dialogue.awake(clock) as able, dialogue.collect(link, StatusText) as texts:
        has_paused = able.watch_pauses()
        for step in dialect.start:
            if has_paused():
                return ProcedureResult(accepted=False, reason=SLEPT, armed=armed, code=Ending.STOOD_STILL)
            done = await _start_step(link, clock, dialect, step, has_paused)
            armed = armed or done.armed
            if not done.accepted:
                said = [one.text for one in texts if one.severity <= 4]
                why = f"{done.reason}; it says: {said[-1]}" if said else done.reason
                return ProcedureResult(accepted=False, reason=why, armed=armed, code=done.code)
    return ProcedureResult(accepted=True)


SLEPT = "this ground station had stalled"


async def _start_step(
    link: Link, clock: Clock, dialect: Dialect, step: StartStep, has_paused: Callable[[], bool]
) -> ProcedureResult:
    match step:
        case StartStep.GUIDED:
            return await switch_mode(link, clock, dialect.modes.guided)
        case StartStep.ARM:
            done = await _arm(link, clock, has_paused)
            if not done.accepted:
                return done
            seen = await _wait_for_confirmation(
                link, clock, lambda heard: heard.armed, "does not report that it is armed"
            )
            return replace(seen, armed=True)
        case StartStep.MISSION_START:
            order, mode = vehicle_commands.start_mission(), dialect.modes.mission.custom_mode

            def flies(heard: Heartbeat) -> bool:
                return heard.armed and heard.custom_mode == mode

            # One that waited too long for this order has disarmed by itself, and takes off no more.
            return await _order_and_see(link, clock, order, "start the mission", flies, "is not armed in mission mode")
        case StartStep.MISSION_MODE:
            return await switch_mode(link, clock, dialect.modes.mission)


@dialogue.count_awake_time
async def _arm(link: Link, clock: Clock, has_paused: Callable[[], bool]) -> ProcedureResult:
    """Arm, with patience: a check that fails may pass a few seconds later, while the estimator settles.

    Who changes its mode meanwhile wants something else of it.
    """
    until_s = clock.now_s() + ARM_PATIENCE_S
    modes: set[int] = set()
    with dialogue.listen_to(
        link, lambda message: modes.add(message.custom_mode) if isinstance(message, Heartbeat) else None
    ):
        while len(modes) < 2:
            done = await send_order(link, clock, CommandDialogue(vehicle_commands.arm(), "arm"))
            if len(modes) < 2 and (done.accepted or clock.now_s() >= until_s):
                return done
            await asyncio.sleep(ARM_AGAIN_S / clock.speedup)
            if has_paused():
                return ProcedureResult(accepted=False, reason=SLEPT, code=Ending.STOOD_STILL)
        return ProcedureResult(
            accepted=False, reason="another party changed its mode", armed=done.accepted, code=Ending.MODE_CHANGED
        )


Order = SendHome | Hold | LandNow | Disarm | Resume


async def give_order(link: Link, clock: Clock, dialect: Dialect, order: Order) -> ProcedureResult:
    """Order a return, a stop in place, a landing, the motors to stop or to go on, and see that the vehicle does it."""
    modes = dialect.modes
    match order:
        case SendHome():
            return await switch_mode(link, clock, modes.return_home, modes.land)
        case Hold():
            return await switch_mode(link, clock, modes.hold)
        case LandNow():
            return await switch_mode(link, clock, modes.land)
        case Resume(_, speed_m_s):
            return await _resume_mission(link, clock, dialect, speed_m_s)
        case Disarm(_, force):
            command, otherwise = vehicle_commands.disarm(force=force), "still reports that it is armed"
            return await _order_and_see(link, clock, command, "disarm", lambda heard: not heard.armed, otherwise)


async def _resume_mission(link: Link, clock: Clock, dialect: Dialect, speed_m_s: float) -> ProcedureResult:
    """Let a vehicle that holds go on to the waypoint that it was flying to, at the speed of that leg.

    Both autopilots keep the index and forget the speed when the mode changes (measured), and gather more within a
    second or two. So mode and speed go out together, before anybody waits for an answer; what got lost is made good
    by the dialogues that follow, as both orders may be given again. The last one is for PX4, which acknowledges a mode
    before it changes.
    """
    mode_order, speed_order = vehicle_commands.set_mode(dialect.modes.mission), vehicle_commands.change_speed(speed_m_s)
    link.send(mode_order)
    link.send(speed_order)
    done = await send_order(link, clock, CommandDialogue(mode_order, "change of mode"))
    if not done.accepted:
        return done
    speed = CommandDialogue(speed_order, "speed of the leg")
    await send_order(link, clock, speed)
    mode = dialect.modes.mission.custom_mode
    done = await _wait_for_confirmation(link, clock, lambda heard: heard.custom_mode == mode, "is not in mission mode")
    if not done.accepted:
        return done
    told = await send_order(link, clock, speed)
    return ProcedureResult(
        accepted=True, reason="" if told.accepted else f"{told.reason}; it may fly too fast to inspect"
    )


async def switch_mode(link: Link, clock: Clock, mode: ModeNumber, *follows: ModeNumber) -> ProcedureResult:
    """Order a mode, and see in the heartbeat that it is flown.

    Args:
        link: To the vehicle.
        clock: The flight's.
        mode: What is ordered.
        follows: What the vehicle may be in by then instead.
    """
    order, accepted = vehicle_commands.set_mode(mode), {one.custom_mode for one in (mode, *follows)}

    def flies(heard: Heartbeat) -> bool:
        return heard.custom_mode in accepted

    return await _order_and_see(link, clock, order, "change of mode", flies, "does not report the new mode")


async def _order_and_see(
    link: Link, clock: Clock, order: SendCommand, words: str, wanted: Callable[[Heartbeat], bool], otherwise: str
) -> ProcedureResult:
    """Give a command, and see in the heartbeat that it is followed: an acknowledgement only means 'will try'."""
    done = await send_order(link, clock, CommandDialogue(order, words))
    return await _wait_for_confirmation(link, clock, wanted, otherwise) if done.accepted else done


async def _wait_for_confirmation(
    link: Link, clock: Clock, wanted: Callable[[Heartbeat], bool], otherwise: str
) -> ProcedureResult:
    """Wait for a heartbeat that shows it; ask for one before the vehicle is judged, as all may have been lost."""
    patience_s = max(MODE_TIMEOUT_S, PATIENCE_REAL_S * clock.speedup)
    seen = await wait_for(link, clock, lambda message: isinstance(message, Heartbeat) and wanted(message), patience_s)
    if not seen:
        with dialogue.collect(link, Heartbeat) as beats:
            await send_order(link, clock, CommandDialogue(vehicle_commands.request_message(HEARTBEAT), "heartbeat"))
            if not beats:
                await wait_for(link, clock, lambda message: isinstance(message, Heartbeat), patience_s)
        seen = any(map(wanted, beats))
    return ProcedureResult(seen, "" if seen else otherwise, code=None if seen else Ending.NOT_CONFIRMED)


@dialogue.count_awake_time
async def wait_for(link: Link, clock: Clock, wanted: Callable[[Message], bool], timeout_s: float) -> bool:
    """Wait for a message; returns whether it came."""
    came, until_s = asyncio.Event(), clock.now_s() + timeout_s
    with dialogue.listen_to(link, lambda message: came.set() if wanted(message) else None):
        while not came.is_set() and (left_s := until_s - clock.now_s()) > dialogue.LEAST_WAIT_S:
            with suppress(TimeoutError):
                async with asyncio.timeout(left_s / clock.speedup):
                    await came.wait()
    return came.is_set()


async def read_parameter(link: Link, clock: Clock, name: str) -> ParameterDialogue:
    """Ask for a parameter."""
    return await _run_patiently(ParameterDialogue(name), link, clock)


async def set_parameter(link: Link, clock: Clock, name: str, value: float, kind: int) -> ProcedureResult:
    """Set a parameter and see the new value."""
    return _build_result(await _run_patiently(ParameterDialogue(name, SendParamSet(name, value, kind)), link, clock))


@dialogue.count_awake_time
async def _run_patiently(question: M, link: Link, clock: Clock) -> M:
    """Ask, and ask again while a busy computer may be why nobody answers."""
    began_s = clock.now_s()
    while True:
        ended = await dialogue.run_dialogue(question, link, clock)
        waited_s = clock.now_s() - began_s
        if not isinstance(ended.outcome, TimedOut) or waited_s >= PATIENCE_REAL_S * clock.speedup:
            return ended


async def set_streams(link: Link, clock: Clock, messages: Iterable[int], interval_us: float) -> str:
    """Ask for each of some messages every so often; returns why not, if the vehicle does not answer."""
    silent = ""
    for message in messages:
        order = vehicle_commands.set_message_interval(message, interval_us)
        done = await send_order(link, clock, CommandDialogue(order, "stream"))
        silent = done.reason if done.lost else ""
    return silent


async def is_stream_on(link: Link, clock: Clock, message: int) -> bool | None:
    """Return whether a vehicle sends a message by itself; None where it does not say so."""
    with dialogue.collect(link, MessageInterval) as told:
        await send_order(link, clock, CommandDialogue(vehicle_commands.ask_interval(message), "stream"))
    return next((one.sent for one in reversed(told) if one.message == message), None)


async def request_streams(link: Link, clock: Clock, streams_hz: Mapping[int, float], *, again: bool = False) -> None:
    """Ask a vehicle for everything that we follow.

    Args:
        link: To it.
        clock: The flight's.
        streams_hz: What, and how often.
        again: Whether something does not come any more: HEARTBEAT comes unasked, until it does not.
    """
    beat_hz = {HEARTBEAT: HEARTBEAT_HZ} if again else {}
    for message, rate_hz in (beat_hz | dict(streams_hz)).items():
        await set_streams(link, clock, [message], 1e6 / rate_hz)


def choose_link_streams_hz(
    link: Link, dialect: Dialect, share: RadioShare, first_hz: Mapping[int, float]
) -> Mapping[int, float]:
    """Return what is asked for over one of a vehicle's links: `first_hz` over the first, else what that one carries."""
    own = dict(share.further).get(link.connection)
    return first_hz if own is None else own.choose_streams_hz(dialect, on_radio=channel_of(link).radio is not None)


LOOK_S = 1.0


async def keep_asking_links(
    links: Mapping[str, Link], clock: Clock, setups: Mapping[str, tuple[Dialect, RadioShare]]
) -> None:
    """Ask vehicles with several links for their streams over each, when it is first heard and after every silence.

    Both autopilots keep apart what they are asked for over each. The first link is asked in the interview.
    """
    asked: set[Link] = set()
    while True:
        for name, link in links.items():
            for way in link.ways if len(link.ways) > 1 else ():
                if not way.is_alive:
                    asked.discard(way)
                elif way not in asked:
                    first = way is link.ways[0] and asked.isdisjoint(link.ways)
                    asked.add(way)
                    if not first:
                        dialect, share = setups[name]
                        first_hz = share.choose_streams_hz(dialect, on_radio=channel_of(way).radio is not None)
                        await request_streams(way, clock, choose_link_streams_hz(way, dialect, share, first_hz))
        await asyncio.sleep(LOOK_S / clock.speedup)
