"""The record of what a flight changed on board, parameters.json and fences.json, and how vehicles get it back."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Generic, Literal

from pydantic import Field

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.adapters.run_directory import Document, Number, RunDirectory, Whole, YesNo, lock_run_directory
from executor.analysis.documents import ParameterRow
from executor.core.formatting import command_line
from executor.core.interface.commands import Level
from executor.core.interface.messages import Heartbeat, Message, SendParamRequest
from executor.core.interface.ports import Clock, Keyring, Link, LinkRequest, OpenLink
from executor.core.preflight import fence_changes, parameter_changes
from executor.core.preflight.fence_changes import Items, KeptList
from executor.core.preflight.parameter_changes import (
    Change,
    ChangeStage,
    KeptParameter,
    Present,
    list_return_parameters,
)
from executor.errors import LogError, PreflightFailed
from executor.flight.open_links import AT_ONCE, follow_fleet_time
from executor.flight.run_start import Console
from executor.runtime import procedures
from executor.runtime.dialogue import listen_to
from executor.runtime.vehicle_preflight import read_parameters
from executor.site.site_file import Site, read_signing_key, read_site
from executor.site.site_keys import AutopilotKey
from missions import Dialect, MissionItem, MissionKind, dialect_for
from missions.fences import number_items


class _Row(Document):
    vehicle: str
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey


class _ParameterRow(_Row):
    name: Annotated[str, Field(min_length=1, max_length=16)]
    old: Number
    new: Number
    kind: Annotated[int, Field(ge=1, le=10)]
    unit: str
    why: str
    earlier: tuple[Number, ...] = ()
    state: ChangeStage


class _ParameterFile(Document):
    format: Literal["faultline-parameters/1"]
    parameters: tuple[_ParameterRow, ...]


class _Item(Document):
    frame: Whole
    command: Whole
    param1: Number
    param2: Number
    param3: Number
    param4: Number
    x: Whole
    y: Whole
    z: Number
    autocontinue: YesNo


class _ListRow(_Row):
    list: Literal["fence", "rally"]
    old: tuple[_Item, ...]
    new: Annotated[tuple[tuple[_Item, ...], ...], Field(min_length=1)]
    state: ChangeStage


class _ListFile(Document):
    format: Literal["faultline-fences/1"]
    lists: tuple[_ListRow, ...]


def read_kept_parameters(run: Path) -> tuple[KeptParameter, ...] | None:
    """Return what is on record of a flight's parameters; None if none was ever changed from there.

    Raises:
        LogError: the record cannot be read.
    """
    path = RunDirectory(run).parameters
    if not path.exists():
        return None
    content = _ParameterFile.read(path, "what was changed on board")
    return tuple(
        KeptParameter(**{**row.model_dump(exclude={"state"}), "stage": row.state}) for row in content.parameters
    )


def read_kept_lists(run: Path) -> tuple[KeptList, ...]:
    """Return what is on record of a flight's fences and rally points; nothing if it never changed one.

    Raises:
        LogError: the record cannot be read.
    """
    path = RunDirectory(run).fences
    if not path.exists():
        return ()
    made = []
    for row in _ListFile.read(path, "fences and rally points that were replaced on board").lists:
        *earlier, new = (_parse_items(one) for one in row.new)
        about = (row.vehicle, row.sysid, row.autopilot, row.list)
        made.append(KeptList(*about, _parse_items(row.old), new, stage=row.state, earlier=tuple(earlier)))
    return tuple(made)


def write_kept_parameters(run: Path, kept: Iterable[KeptParameter]) -> None:
    """Write the record of parameters; once this returns it outlives a power loss.

    Raises:
        OSError: it cannot be written.
    """
    rows = (_ParameterRow(**{**asdict(one), "state": one.stage}) for one in kept)
    _ParameterFile(format="faultline-parameters/1", parameters=tuple(rows)).write(RunDirectory(run).parameters)


def write_kept_lists(run: Path, kept: Iterable[KeptList]) -> None:
    """Write the record of fences and rally points; once this returns it outlives a power loss.

    Raises:
        OSError: it cannot be written.
    """
    rows = tuple(
        _ListRow(
            vehicle=one.vehicle, sysid=one.sysid, autopilot=one.autopilot,
            list="fence" if one.kind is MissionKind.FENCE else "rally", old=_build_rows(one.old),
            new=tuple(_build_rows(items) for items in (*one.earlier, one.new)), state=one.stage,
        )
        for one in kept
    )  # fmt: skip
    _ListFile(format="faultline-fences/1", lists=rows).write(RunDirectory(run).fences)


def _parse_items(rows: Iterable[_Item]) -> Items:
    return tuple(MissionItem(seq, **row.model_dump()) for seq, row in enumerate(rows))


def _build_rows(items: Iterable[MissionItem]) -> tuple[_Item, ...]:
    keys = _Item.model_fields
    # PX4 answers NaN for what means nothing in a fence, and JSON has none.
    return tuple(
        _Item(**{key: 0.0 if value != value else value for key, value in asdict(one).items() if key in keys})
        for one in items
    )


def build_parameter_rows(kept: Sequence[KeptParameter]) -> list[ParameterRow]:
    """Return what a report says of the parameters that were changed."""
    return [
        ParameterRow(vehicle=one.vehicle, name=one.name, old=one.old, new=one.new, restored=not one.is_open)
        for one in kept
    ]


@dataclass(slots=True)
class BoardRecord(Generic[Change]):
    """What is on record, and where."""

    path: Path
    write_changes: Callable[[Sequence[Change]], None]
    console: Console
    kept: list[Change]
    told: bool = False

    def write_first(self, nothing: str) -> None:
        """Write it down before anything is sent.

        Args:
            nothing: What was not done if it cannot be written, in words.

        Raises:
            PreflightFailed: it cannot be written.
        """
        try:
            self.write_changes(self.kept)
        except OSError as error:
            raise PreflightFailed(f"{self.path}: cannot be written: {error.strerror}; {nothing}") from error

    def update(self, changed: Iterable[Change]) -> None:
        """Take over what has changed, and write it down where there is room.

        An older record gives everything back as well, it only asks again.
        """
        known = {one.key: one for one in changed}
        self.kept = [known.get(one.key, one) for one in self.kept]
        try:
            self.write_changes(self.kept)
        except OSError as error:
            if not self.told:
                self.told = True
                self.console.say(Level.WARNING, f"{self.path}: cannot be written: {error.strerror}")

    def set_stage(self, vehicle: str, names: Iterable[str], stage: ChangeStage) -> None:
        """Note how far a vehicle's changes have come."""
        known = set(names)
        self.update([replace(one, stage=stage) for one in self.kept if one.vehicle == vehicle and one.name in known])


def open_parameter_record(run: Path, console: Console, kept: Iterable[KeptParameter]) -> BoardRecord[KeptParameter]:
    """Return the record of parameters that a run directory keeps from now on; nothing is written yet."""
    path = RunDirectory(run).parameters
    return BoardRecord(path, lambda rows: write_kept_parameters(run, rows), console, list(kept))


def open_list_record(run: Path, console: Console, kept: Iterable[KeptList]) -> BoardRecord[KeptList]:
    """Return the record of fences and rally points that a run directory keeps from now on; nothing is written yet."""
    return BoardRecord(RunDirectory(run).fences, lambda rows: write_kept_lists(run, rows), console, list(kept))


HEARD_S = 5.0
"""Without a heartbeat for so long a vehicle does not answer; they come once a second."""
ARMED_S = 3.0
"""A vehicle that is heard and armed for so long is armed."""
CALL_S = 1.0
ROUNDS = 4
"""Of looking at what is on board, while something is given back."""
SETTLE_S = 1.0
"""Between two rounds: what is under way by then, such as a setting that comes twice, has arrived."""


@dataclass(frozen=True, slots=True)
class RestoreResult(Generic[parameter_changes.Change]):
    """What became of what was changed on one vehicle."""

    kept: tuple[parameter_changes.Change, ...]
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
    with listen_to(link, vehicle.update):
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


def _find_restore_problem(vehicle: RestingVehicle, dialect: Dialect) -> str:
    if vehicle.heartbeat is None:
        return "does not answer"
    if vehicle.heartbeat.armed:
        return "is armed"
    if vehicle.heartbeat.autopilot != dialect.number:
        return f"is another vehicle now: its autopilot is {vehicle.heartbeat.autopilot}, expected {dialect.name}"
    return ""


async def restore_parameters(
    link: Link, clock: Clock, kept: Sequence[parameter_changes.KeptParameter], vehicle: RestingVehicle
) -> RestoreResult[parameter_changes.KeptParameter]:
    """Give one vehicle its parameters back; what somebody else set since stays.

    Looks and sets until everything is as it was in a round after the one that set it.

    Args:
        link: To it.
        clock: The flight's.
        kept: What is on record of it, and open.
        vehicle: It at rest.
    """
    waiting = {one.name: one for one in kept}
    ended: dict[str, parameter_changes.KeptParameter] = {}
    problems: list[str] = []
    said: Present = {}
    for turn in range(ROUNDS):
        if turn:
            await asyncio.sleep(SETTLE_S / clock.speedup)
        said = (await read_parameters(link, clock, waiting)).present
        for name, value in said.items():
            one = waiting[name]
            what = one.classify(value.value)
            if what is parameter_changes.ValueOrigin.OTHER:
                ended[name] = replace(waiting.pop(name), stage=parameter_changes.ChangeStage.LEFT)
                problems.append(
                    f"{name} is {parameter_changes.format_number(value.value)}, which somebody set since: left as it is"
                )
            elif what is parameter_changes.ValueOrigin.OLD and turn:
                ended[name] = replace(waiting.pop(name), stage=parameter_changes.ChangeStage.RESTORED)
            elif what is parameter_changes.ValueOrigin.OURS:
                if not vehicle.is_at_rest:
                    return _build_result(kept, ended, [*problems, "was armed meanwhile"])
                await procedures.set_parameter(link, clock, name, one.old, value.kind)
        if not (waiting and said):
            break
    for name in waiting:
        stays = f"stays {parameter_changes.format_number(said[name].value)}" if name in said else "does not answer"
        problems.append(f"{name} {stays}")
    return _build_result(kept, ended, problems)


async def restore_lists(
    link: Link, clock: Clock, kept: Sequence[fence_changes.KeptList], vehicle: RestingVehicle
) -> RestoreResult[fence_changes.KeptList]:
    """Give one vehicle its fence and its rally points back; what somebody else put on board since stays.

    Args:
        link: To it.
        clock: The flight's.
        kept: What is on record of it, and open.
        vehicle: It at rest.
    """
    ended: dict[str, fence_changes.KeptList] = {}
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
        if what is parameter_changes.ValueOrigin.OTHER:
            ended[one.name] = replace(one, stage=parameter_changes.ChangeStage.LEFT)
            problems.append(f"somebody has changed the {one.words_open} since: left as found")
            continue
        problem = "" if what is parameter_changes.ValueOrigin.OLD else await _put_list_back(link, clock, one)
        if problem:
            problems.append(problem)
        else:
            ended[one.name] = replace(one, stage=parameter_changes.ChangeStage.RESTORED)
    return _build_result(kept, ended, problems)


async def _put_list_back(link: Link, clock: Clock, one: fence_changes.KeptList) -> str:
    """Send a vehicle the fence, or the rally points, that it had; returns why it does not have them."""
    dialect, items = dialect_for(one.autopilot), number_items(one.old)
    if one.kind is MissionKind.FENCE:
        done = await procedures.upload_and_verify_fence(link, clock, dialect, items)
    else:
        done = await procedures.upload_and_verify(link, clock, dialect, items, kind=one.kind)
    return "" if done.accepted else done.reason


def _build_result(
    kept: Sequence[parameter_changes.Change], ended: Mapping[str, parameter_changes.Change], problems: Sequence[str]
) -> RestoreResult[parameter_changes.Change]:
    return RestoreResult(tuple(ended.get(one.name, one) for one in kept), tuple(problems))


Links = Mapping[str, OpenLink]
Restore = Callable[[Link, Clock, Sequence[Change], RestingVehicle], Coroutine[None, None, RestoreResult[Change]]]


def read_open_changes(run: Path) -> tuple[Site, list[KeptParameter], list[KeptList]]:
    """Return the site of a flight, and which parameters, fences and rally points have still to be given back.

    Raises:
        LogError: the directory holds no record, or one that cannot be read.
        SiteError: site.toml cannot be used.
    """
    kept, lists = read_kept_parameters(run), read_kept_lists(run)
    if kept is None and not lists:
        raise LogError(f"{run}: expected a run directory with parameters.json; no parameter was changed from here")
    still = [one for one in kept or () if one.is_open]
    return read_site(RunDirectory(run).site), still, [one for one in lists if one.is_open]


def find_open_parameters(run: Path) -> list[KeptParameter]:
    """Return which parameters are not given back; a record that cannot be read is left to `restore` to say."""
    with suppress(LogError):
        return [one for one in read_kept_parameters(run) or () if one.is_open]
    return []


def check_run(run: Path, site: Site) -> None:
    """Refuse to fly from a directory whose record is of vehicles that the site file does not have: it would be lost.

    Raises:
        LogError: it is so, or the record cannot be read.
    """
    systems = {table.name: table.sysid for table in site.vehicle}
    for one in read_kept_parameters(run) or ():
        if one.is_open and systems.get(one.vehicle) != one.sysid:
            record = RunDirectory(run).parameters
            raise LogError(
                f"{record}: {one.vehicle} (system {one.sysid}) has not got its {one.name} back, and is not in the "
                f"site file; expected a new directory, or {command_line('restore', run)} before"
            )


async def restore_from_run(run: Path, console: Console) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Give back what is on record; returns both records as they are then.

    Nobody hears a heartbeat from here: a vehicle that somebody flies would take its end for a lost ground station.

    Raises:
        LogError: another process flies from this directory, or it holds no record.
        SiteError: site.toml cannot be used, or the signing key is missing.
        ConnectionFailed: a connection cannot be opened.
    """
    with lock_run_directory(run):
        site, waiting, lists = read_open_changes(run)  # now that nobody else writes to it
        names = {one.vehicle for one in waiting} | {one.vehicle for one in lists}
        async with follow_fleet_time(site, console) as fleet:
            clock = SystemClock.start_on(site.flight.speedup, fleet.steady_s)
            key = read_signing_key(site, run)
            keyring = None if key is None else Keyring(key, clock.steady_unix_s)
            # One way for all: it is the same connection, whichever software spoke to the vehicle in flight.
            wanted = {table.name: LinkRequest(table.link, table.sysid) for table in site.vehicle if table.name in names}
            async with endpoints.open_mavlink_links(wanted, keyring) as links:
                return await restore_board(run, links, clock, console, site.flight.connect_timeout_s * clock.speedup)


async def restore_board(
    run: Path, links: Links, clock: Clock, console: Console, heard_s: float = HEARD_S
) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Give back what was changed to every vehicle that answers and is not armed; say of each what became of it.

    Fences go before the parameters that say how they are kept to.

    Args:
        run: Where the record is.
        links: To the vehicles.
        clock: The flight's.
        console: Where it is said.
        heard_s: How long a vehicle is waited for, in its time.

    Returns:
        The records of parameters and of lists as they are now; empty if nothing was ever changed, or one cannot be
        read.
    """
    about = (run, links, clock, console, heard_s)
    lists = await _restore_record(lambda: open_list_record(run, console, read_kept_lists(run)), restore_lists, *about)
    parameters = await _restore_record(
        lambda: open_parameter_record(run, console, read_kept_parameters(run) or ()), restore_parameters, *about
    )
    return parameters, lists


async def _restore_record(
    open_record: Callable[[], BoardRecord[Change]],
    restore: Restore[Change],
    run: Path,
    links: Links,
    clock: Clock,
    console: Console,
    heard_s: float,
) -> tuple[Change, ...]:
    """Give back all that is open on one record."""
    try:
        record = open_record()
    except LogError as error:
        console.say(Level.WARNING, str(error))
        return ()
    waiting: dict[str, list[Change]] = defaultdict(list)
    for change in record.kept:
        if change.is_open:
            waiting[change.vehicle].append(change)
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str, kept: Sequence[Change]) -> None:
        if name not in links:
            given = RestoreResult(tuple(kept), ("is not in the site file",))
        else:
            async with turn, wait_for_rest(links[name], clock, kept[0].autopilot, heard_s) as rest:
                given = RestoreResult(tuple(kept), (rest.problem,))
                if not rest.problem:
                    given = await restore(links[name], clock, kept, rest)
        record.update(given.kept)
        waiting.pop(name)
        _report_restored(run, console, name, given)

    try:
        async with asyncio.TaskGroup() as tasks:
            for name, kept in tuple(waiting.items()):
                tasks.create_task(one(name, kept))
    except asyncio.CancelledError:
        for name, kept in waiting.items():
            _report_restored(run, console, name, RestoreResult(tuple(kept), ("interrupted",)))
        raise
    return tuple(record.kept)


def _report_restored(run: Path, console: Console, name: str, given: RestoreResult[Change]) -> None:
    """Say of one vehicle what it has again, and what stays."""
    back = [one.words_back for one in given.kept if not one.is_open]
    if back:
        console.say(Level.INFO, f"{name}: {', '.join(back)} restored")
    stays = [one.words_open for one in given.kept if one.is_open]
    if stays:
        console.say(Level.WARNING, f"{name}: {', '.join(stays)} not restored: {'; '.join(given.problems)}")
        console.say(Level.WARNING, f"{name}: to restore them: {command_line('restore', run)}")
