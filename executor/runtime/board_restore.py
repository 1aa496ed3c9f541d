"""What a flight changes on a vehicle: parameters that are read and set for it, and what is given back after it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from typing import Generic

from executor.core.interface.messages import Heartbeat, Message, ParamValue, SendParamRequest
from executor.core.interface.ports import Clock, Link
from executor.core.preflight.board_changes import (
    Answers,
    Change,
    ChangeStage,
    KeptList,
    KeptParameter,
    Present,
    ValueOrigin,
    format_number,
    list_newer_return_parameters,
    list_return_parameters,
)
from executor.protocols.parameter_dialogue import ParameterReading
from executor.runtime import procedures
from executor.runtime.dialogue import run_dialogue
from missions import Dialect, MissionKind, dialect_for
from missions.fences import number_items

HEARD_S = 5.0
"""Without a heartbeat for so long a vehicle does not answer; they come once a second."""
ARMED_S = 3.0
"""A vehicle that is heard and armed for so long is armed."""
CALL_S = 1.0
ROUNDS = 4
"""Of looking at what is on board, while something is given back."""
SETTLE_S = 1.0
"""Between two rounds: what is under way by then, such as a setting that comes twice, has arrived."""


async def read_present(link: Link, clock: Clock, dialect: Dialect, beside: Iterable[str] = ()) -> Answers:
    """Return what a vehicle has of the parameters that its RTL goes by, and of some others."""
    return await read_parameters(
        link,
        clock,
        (*list_return_parameters(dialect), *beside),
        lambda present: list_newer_return_parameters(dialect, present),
    )


async def read_parameters(
    link: Link, clock: Clock, names: Iterable[str], others: Callable[[Present], Iterable[str]] = lambda _: ()
) -> Answers:
    """Read parameters at the pace of the link, until each is answered, or not there, or the link is silent.

    Args:
        link: To the vehicle.
        clock: The flight's.
        names: Which ones.
        others: Given what is there, the names that some have in other firmware.
    """
    answers = await _read(link, clock, names)
    more = () if answers.unread else tuple(others(answers.present))
    if not more:
        return answers
    # One that is there goes with them: beside it a silence can be told from the link's.
    found = await _read(link, clock, (*more, *tuple(answers.present)[:1]))
    return Answers({**answers.present, **found.present}, found.unread.difference(answers.present))


async def _read(link: Link, clock: Clock, names: Iterable[str]) -> Answers:
    present: dict[str, ParamValue] = {}
    began_s, unread = clock.now_s(), tuple(names)
    while unread:
        reading = await run_dialogue(ParameterReading.start(unread), link, clock)
        present |= {value.name: value for value in reading.values}
        unread = tuple(name for name in unread if name in reading.unread)
        if clock.now_s() - began_s >= procedures.PATIENCE_REAL_S * clock.speedup or reading.refused:
            break
    return Answers(present, frozenset(unread))


async def set_changes(link: Link, clock: Clock, changes: Iterable[KeptParameter]) -> dict[str, str]:
    """Set what a flight needs; returns by name why it is not as wanted, empty where the new value was read back."""
    ends = {}
    for change in changes:
        done = await procedures.set_parameter(link, clock, change.name, change.new, change.kind)
        ends[change.name] = "" if done.accepted else done.reason
    return ends


@dataclass(frozen=True, slots=True)
class RestoreResult(Generic[Change]):
    """What became of what was changed on one vehicle."""

    kept: tuple[Change, ...]
    """Each as it is on record now."""
    problems: tuple[str, ...] = ()
    """Why something stays; empty if all was given back."""


@dataclass(slots=True)
class RestingVehicle:
    """A vehicle that was waited for until it answers and is not armed; its heartbeats are followed."""

    problem: str = ""
    """What is in the way, in words; empty if nothing is."""
    heartbeat: Heartbeat | None = None
    """The last one."""
    came: asyncio.Event = field(default_factory=asyncio.Event)

    def update(self, message: Message) -> None:
        """Take over a heartbeat."""
        if isinstance(message, Heartbeat):
            self.heartbeat = message
            self.came.set()

    @property
    def is_at_rest(self) -> bool:
        """Whether it is not armed, by its last heartbeat."""
        return self.heartbeat is not None and not self.heartbeat.armed


@asynccontextmanager
async def wait_for_rest(
    link: Link, clock: Clock, autopilot: str, heard_s: float = HEARD_S
) -> AsyncIterator[RestingVehicle]:
    """Wait for a vehicle at rest, to give something back to it; it is listened to until the block ends.

    Once it is heard and armed it is waited for no longer than for a heartbeat that was under way. It is called
    meanwhile, as some only speak to who has spoken. What it answers is not looked at before its heartbeat has said
    which autopilot it is: they write integers in two ways.

    It hears no heartbeat from here: one that begins and ends would set off its ground-station failsafe.

    Args:
        link: To it.
        clock: The flight's.
        autopilot: Which it has to be, by its name in site files.
        heard_s: How long it is waited for, in its time.
    """
    dialect, vehicle = dialect_for(autopilot), RestingVehicle()
    stop_listening = link.listen(vehicle.update)
    try:
        began_s, least_s = clock.now_s(), procedures.PATIENCE_REAL_S * clock.speedup
        while not vehicle.is_at_rest:
            patience_s = max(heard_s if vehicle.heartbeat is None else ARMED_S, least_s)
            if clock.now_s() >= began_s + patience_s:
                break
            link.send(SendParamRequest(list_return_parameters(dialect)[0]))
            vehicle.came.clear()
            try:
                async with asyncio.timeout(CALL_S / clock.speedup):
                    await vehicle.came.wait()
            except TimeoutError:
                continue
        vehicle.problem = _find_restore_problem(vehicle, dialect)
        yield vehicle
    finally:
        stop_listening()


def _find_restore_problem(vehicle: RestingVehicle, dialect: Dialect) -> str:
    if vehicle.heartbeat is None:
        return "does not answer"
    if vehicle.heartbeat.armed:
        return "is armed"
    if vehicle.heartbeat.autopilot != dialect.number:
        return f"is another vehicle now: its autopilot is {vehicle.heartbeat.autopilot}, expected {dialect.name}"
    return ""


async def restore_parameters(
    link: Link, clock: Clock, kept: Sequence[KeptParameter], vehicle: RestingVehicle
) -> RestoreResult[KeptParameter]:
    """Give one vehicle its parameters back; what somebody else set since stays.

    Looks and sets until everything is as it was in a round after the one that set it.

    Args:
        link: To it.
        clock: The flight's.
        kept: What is on record of it, and open.
        vehicle: It at rest.
    """
    waiting = {one.name: one for one in kept}
    ended: dict[str, KeptParameter] = {}
    problems: list[str] = []
    said: Present = {}
    for turn in range(ROUNDS):
        if turn:
            await asyncio.sleep(SETTLE_S / clock.speedup)
        said = (await read_parameters(link, clock, waiting)).present
        for name, value in said.items():
            one = waiting[name]
            what = one.classify(value.value)
            if what is ValueOrigin.OTHER:
                ended[name] = replace(waiting.pop(name), stage=ChangeStage.LEFT)
                problems.append(f"{name} is {format_number(value.value)}, which somebody set since: left as it is")
            elif what is ValueOrigin.OLD and turn:
                ended[name] = replace(waiting.pop(name), stage=ChangeStage.RESTORED)
            elif what is ValueOrigin.OURS:
                if not vehicle.is_at_rest:
                    return _build_result(kept, ended, [*problems, "was armed meanwhile"])
                await procedures.set_parameter(link, clock, name, one.old, value.kind)
        if not (waiting and said):
            break
    for name in waiting:
        stays = f"stays {format_number(said[name].value)}" if name in said else "does not answer"
        problems.append(f"{name} {stays}")
    return _build_result(kept, ended, problems)


async def restore_lists(
    link: Link, clock: Clock, kept: Sequence[KeptList], vehicle: RestingVehicle
) -> RestoreResult[KeptList]:
    """Give one vehicle its fence and its rally points back; what somebody else put on board since stays.

    Args:
        link: To it.
        clock: The flight's.
        kept: What is on record of it, and open.
        vehicle: It at rest.
    """
    ended: dict[str, KeptList] = {}
    problems: list[str] = []
    for one in kept:
        if not vehicle.is_at_rest:
            problems.append("was armed meanwhile")
            break
        found = await procedures.read_list(link, clock, one.kind)
        if found is None:
            problems.append(f"{one.words_open} cannot be read")
            continue
        what = one.classify(found)
        if what is ValueOrigin.OTHER:
            ended[one.name] = replace(one, stage=ChangeStage.LEFT)
            problems.append(f"somebody has changed the {one.words_open} since: left as found")
            continue
        problem = "" if what is ValueOrigin.OLD else await _put_list_back(link, clock, one)
        if problem:
            problems.append(problem)
        else:
            ended[one.name] = replace(one, stage=ChangeStage.RESTORED)
    return _build_result(kept, ended, problems)


async def _put_list_back(link: Link, clock: Clock, one: KeptList) -> str:
    """Send a vehicle the fence, or the rally points, that it had; returns why it does not have them."""
    dialect, items = dialect_for(one.autopilot), number_items(one.old)
    if one.kind is MissionKind.FENCE:
        done = await procedures.upload_and_verify_fence(link, clock, dialect, items)
    else:
        done = await procedures.upload_and_verify(link, clock, dialect, items, kind=one.kind)
    return "" if done.accepted else done.reason


def _build_result(
    kept: Sequence[Change], ended: Mapping[str, Change], problems: Sequence[str]
) -> RestoreResult[Change]:
    return RestoreResult(tuple(ended.get(one.name, one) for one in kept), tuple(problems))
