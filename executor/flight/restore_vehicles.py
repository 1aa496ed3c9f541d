"""Record what a flight changes on board (parameters.json, fences.json), and restore it."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Generic, Literal

from pydantic import BeforeValidator, Field

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink.joined_link import open_joined_links
from executor.adapters.run_directory import Document, Number, RunDirectory, Whole, YesNo, lock_run_directory
from executor.analysis.documents import ParameterRow
from executor.core.formatting import command_line
from executor.core.interface.commands import Level
from executor.core.interface.messages import Heartbeat, Message, SendParamRequest
from executor.core.interface.ports import Clock, Keyring, Link, OpenLink
from executor.core.preflight.parameter_changes import (
    UNASKED,
    Change,
    ChangeStage,
    Items,
    KeptList,
    KeptParameter,
    build_board_record,
    list_return_parameters,
)
from executor.errors import LogError, PreflightFailed
from executor.flight.open_links import follow_fleet_time, run_for_each
from executor.flight.run_start import Console
from executor.protocols import vehicle_commands
from executor.runtime import procedures
from executor.runtime.dialogue import listen_to
from executor.runtime.vehicle_preflight import read_parameters, upload_list
from executor.site.site_file import Site, read_signing_key, read_site
from executor.site.site_keys import AutopilotKey
from missions import Dialect, MissionItem, dialect_for
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
    expected = "what was changed on board"
    format: Literal["faultline-parameters/1"]
    parameters: tuple[_ParameterRow, ...]


_Parameter = Annotated[Number, BeforeValidator(lambda value: 0.0 if value != value else value)]
"""A fence parameter; PX4 sends NaN for unused ones, which JSON cannot hold."""


class _Item(Document):
    frame: Whole
    command: Whole
    param1: _Parameter
    param2: _Parameter
    param3: _Parameter
    param4: _Parameter
    x: Whole
    y: Whole
    z: _Parameter
    autocontinue: YesNo


class _ListRow(_Row):
    list: Literal["fence", "rally"]
    old: tuple[_Item, ...]
    new: Annotated[tuple[tuple[_Item, ...], ...], Field(min_length=1)]
    state: ChangeStage


class _ListFile(Document):
    expected = "fences and rally points that were replaced on board"
    format: Literal["faultline-fences/1"]
    lists: tuple[_ListRow, ...]


def _parse_items(rows: Iterable[_Item]) -> Items:
    return tuple(MissionItem(seq, **row.model_dump()) for seq, row in enumerate(rows))


def _parse_parameters(path: Path) -> tuple[KeptParameter, ...]:
    rows = _ParameterFile.read(path).parameters
    return tuple(KeptParameter(**{**row.model_dump(exclude={"state"}), "stage": row.state}) for row in rows)


def _build_parameter_file(kept: Iterable[KeptParameter]) -> Document:
    rows = tuple(_ParameterRow.build_from(one, state=one.stage) for one in kept)
    return _ParameterFile(format="faultline-parameters/1", parameters=rows)


def _parse_lists(path: Path) -> tuple[KeptList, ...]:
    made = []
    for row in _ListFile.read(path).lists:
        *earlier, new = (_parse_items(one) for one in row.new)
        about = (row.vehicle, row.sysid, row.autopilot, row.list)
        made.append(KeptList(*about, _parse_items(row.old), new, stage=row.state, earlier=tuple(earlier)))
    return tuple(made)


def _build_list_file(kept: Iterable[KeptList]) -> Document:
    rows = tuple(_ListRow.build_from(one, list=one.name, new=(*one.earlier, one.new), state=one.stage) for one in kept)
    return _ListFile(format="faultline-fences/1", lists=rows)


def build_parameter_rows(kept: Sequence[KeptParameter]) -> list[ParameterRow]:
    """Return a report's rows of the changed parameters."""
    return [
        ParameterRow(vehicle=one.vehicle, name=one.name, old=one.old, new=one.new, restored=not one.is_open)
        for one in kept
    ]


HEARD_S = 5.0
"""Seconds without a heartbeat after which a vehicle does not answer; heartbeats come once a second."""
ARMED_S = 3.0
"""Seconds of armed heartbeats after which a vehicle counts as armed."""
CALL_S = 1.0
ROUNDS = 4
"""Most rounds of reading and restoring."""
SETTLE_S = 1.0
"""Pause between two rounds, so that everything in transit, such as a repeated setting, has arrived."""


@dataclass(slots=True)
class RestingVehicle:
    """Vehicle awaited until it answers and is disarmed; its heartbeats are followed."""

    dialect: Dialect
    heartbeat: Heartbeat | None = None
    """Last heartbeat."""

    def update(self, message: Message) -> None:
        """Take a heartbeat."""
        if isinstance(message, Heartbeat):
            self.heartbeat = message

    @property
    def problem(self) -> str:
        """Obstacle in words; empty if there is none."""
        if self.heartbeat is None:
            return "does not answer"
        if self.heartbeat.armed:
            return "is armed"
        number = self.heartbeat.autopilot
        if number == self.dialect.number:
            return ""
        return f"is another vehicle now: its autopilot is {number}, expected {self.dialect.name}"

    @property
    def is_at_rest(self) -> bool:
        """Whether it is disarmed, by its last heartbeat."""
        return self.heartbeat is not None and not self.heartbeat.armed


@asynccontextmanager
async def wait_for_rest(link: Link, clock: Clock, autopilot: str, heard_s: float) -> AsyncIterator[RestingVehicle]:
    """Wait for a disarmed vehicle in order to restore it; its heartbeats are followed until the block ends.

    Once it is heard and armed, the wait ends after the time of a heartbeat that was under way. It is called meanwhile,
    as some vehicles only answer a sender they have heard. Its answers are ignored until its heartbeat names the
    autopilot: the two encode integers differently.

    No heartbeat of ours is sent: one that begins and ends would trigger its GCS failsafe.

    Args:
        link: Link to the vehicle.
        clock: Clock of the flight.
        autopilot: Expected autopilot, by its name in site files.
        heard_s: Most time to wait for it, in vehicle time.
    """
    vehicle = RestingVehicle(dialect_for(autopilot))
    with listen_to(link, vehicle.update):
        began_s, least_s = clock.now_s(), procedures.PATIENCE_REAL_S * clock.speedup
        while not vehicle.is_at_rest:
            patience_s = max(heard_s if vehicle.heartbeat is None else ARMED_S, least_s)
            if clock.now_s() >= began_s + patience_s:
                break
            link.send(SendParamRequest(list_return_parameters(vehicle.dialect)[0]))
            await procedures.wait_for(link, clock, lambda message: isinstance(message, Heartbeat), CALL_S)
        yield vehicle


Links = Mapping[str, OpenLink]


@dataclass(frozen=True, slots=True)
class RecordFile(Generic[Change]):
    """One file of the record: its content, and how it is read from vehicles and restored."""

    path_in: Callable[[Path], Path]
    parse: Callable[[Path], tuple[Change, ...]]
    build_document: Callable[[Iterable[Change]], Document]
    read_board: Callable[[Link, Clock, Mapping[str, Change]], Coroutine[None, None, dict[str, Any]]]
    """Read present values by name, as far as the vehicle reports them."""
    put_back: Callable[[Link, Clock, Change], Coroutine[None, None, str]]
    """Restore the old value; returns the reason for a failure, if known at once."""

    def read(self, run: Path) -> tuple[Change, ...]:
        """Return the record of a flight; empty if the flight never changed anything.

        Raises:
            LogError: the record cannot be read.
        """
        path = self.path_in(run)
        return self.parse(path) if path.exists() else ()

    def write(self, run: Path, kept: Iterable[Change]) -> None:
        """Write the record; once this returns it survives a power loss.

        Raises:
            OSError: it cannot be written.
        """
        self.build_document(kept).write(self.path_in(run))


async def _read_parameter_values(link: Link, clock: Clock, wanted: Mapping[str, KeptParameter]) -> dict[str, float]:
    answers = await read_parameters(link, clock, [name for name in wanted if name != UNASKED])
    found = {name: one.value for name, one in answers.present.items()}
    if (streams := wanted.get(UNASKED)) is not None:
        sent = await procedures.is_stream_on(link, clock, next(iter(dialect_for(streams.autopilot).unasked_hz)))
        found |= {} if sent is None else {UNASKED: streams.old if sent else streams.new}
    return found


async def _put_parameter_back(link: Link, clock: Clock, change: KeptParameter) -> str:
    if change.name == UNASKED:
        off = dialect_for(change.autopilot).unasked_hz
        return await procedures.set_streams(link, clock, off, vehicle_commands.UNASKED_US)
    await procedures.set_parameter(link, clock, change.name, change.old, change.kind)
    return ""  # the next round's reading decides


async def _read_lists(link: Link, clock: Clock, wanted: Mapping[str, KeptList]) -> dict[str, Items]:
    lists = {name: await procedures.read_list(link, clock, one.kind) for name, one in wanted.items()}
    return {name: items for name, items in lists.items() if items is not None}


async def _put_list_back(link: Link, clock: Clock, change: KeptList) -> str:
    done = await upload_list(link, clock, dialect_for(change.autopilot), change.kind, number_items(change.old))
    return "" if done.accepted else done.reason


PARAMETERS = RecordFile(
    lambda run: RunDirectory(run).parameters, _parse_parameters, _build_parameter_file, _read_parameter_values,
    _put_parameter_back,
)  # fmt: skip
LISTS = RecordFile(lambda run: RunDirectory(run).fences, _parse_lists, _build_list_file, _read_lists, _put_list_back)


@dataclass(slots=True)
class BoardRecord(Generic[Change]):
    """One file of a run directory's record, kept up to date."""

    file: RecordFile[Change]
    run: Path
    console: Console
    kept: tuple[Change, ...]
    told: bool = False

    @classmethod
    def open(
        cls, file: RecordFile[Change], run: Path, console: Console, planned: Iterable[Change] = ()
    ) -> BoardRecord[Change]:
        """Open the record of a run directory; nothing is written yet.

        Args:
            file: Which record.
            run: The directory.
            console: Where write errors are shown.
            planned: Changes about to be made.

        Raises:
            LogError: there is a record of an earlier attempt, and it cannot be read.
        """
        return cls(file, run, console, tuple(build_board_record(planned, file.read(run))))

    def write_first(self, nothing: str) -> None:
        """Write the record before anything is sent.

        Args:
            nothing: Consequence if it cannot be written, in words.

        Raises:
            PreflightFailed: it cannot be written.
        """
        try:
            self.file.write(self.run, self.kept)
        except OSError as error:
            text = f"{self.file.path_in(self.run)}: cannot be written: {error.strerror}; {nothing}"
            raise PreflightFailed(text) from error

    def update(self, changed: Iterable[Change]) -> None:
        """Take changes, and write them if there is room.

        An older record restores everything as well; it only takes more queries.
        """
        known = {one.key: one for one in changed}
        self.kept = tuple(known.get(one.key, one) for one in self.kept)
        try:
            self.file.write(self.run, self.kept)
        except OSError as error:
            if not self.told:
                self.told = True
                self.console.say(Level.WARNING, f"{self.file.path_in(self.run)}: cannot be written: {error.strerror}")

    def set_stage(self, vehicle: str, names: Iterable[str], stage: ChangeStage) -> None:
        """Record the stage of a vehicle's changes."""
        known = set(names)
        self.update([replace(one, stage=stage) for one in self.kept if one.vehicle == vehicle and one.name in known])

    async def restore(self, links: Links, clock: Clock, heard_s: float) -> None:
        """Restore all open changes of every vehicle that answers and is disarmed."""
        waiting: dict[str, list[Change]] = defaultdict(list)
        for change in self.kept:
            if change.is_open:
                waiting[change.vehicle].append(change)

        async def one(name: str) -> None:
            kept, problems = waiting[name], ["is not in the site file"]
            if name in links:
                async with wait_for_rest(links[name], clock, kept[0].autopilot, heard_s) as rest:
                    problems = [rest.problem]
                    if not rest.problem:
                        problems = await self._restore_vehicle(links[name], clock, kept, rest)
            self._report(waiting.pop(name), problems)

        try:
            await run_for_each(waiting, one)
        except asyncio.CancelledError:
            for kept in waiting.values():
                self._report(kept, ["interrupted"])
            raise

    async def _restore_vehicle(
        self, link: Link, clock: Clock, kept: Sequence[Change], vehicle: RestingVehicle
    ) -> list[str]:
        """Restore one vehicle, and return the reasons for what stays; values set by another station since do stay.

        Reads and sets until everything is as it was, in a round after the one that set it.
        """
        waiting, ended = {one.name: one for one in kept}, list[Change]()
        problems, refused, found = list[str](), dict[str, str](), dict[str, Any]()
        for turn in range(ROUNDS):
            if turn:
                await asyncio.sleep(SETTLE_S / clock.speedup)
            found = await self.file.read_board(link, clock, waiting)
            for name, value in found.items():
                change = waiting[name]
                origin = change.classify(value)
                if origin == "other":
                    ended.append(replace(waiting.pop(name), stage=ChangeStage.LEFT))
                    problems.append(change.describe_other(value))
                elif origin == "old" and turn:
                    ended.append(replace(waiting.pop(name), stage=ChangeStage.RESTORED))
                elif origin == "ours" and not vehicle.is_at_rest:
                    self.update(ended)
                    return [*problems, "was armed in the meantime"]
                elif origin == "ours":
                    refused[name] = await self.file.put_back(link, clock, change)
            if not (waiting and found):
                break
        self.update(ended)
        stay = (refused.get(name) or one.describe_stay(found.get(name)) for name, one in waiting.items())
        return [*problems, *stay]

    def _report(self, asked: Iterable[Change], problems: Iterable[str]) -> None:
        """Report what one vehicle has restored of the requested changes, and what stays."""
        keys = {one.key for one in asked}
        back = [one.words_back for one in self.kept if one.key in keys and not one.is_open]
        stays = [one.words_open for one in self.kept if one.key in keys and one.is_open]
        [name] = {vehicle for vehicle, _ in keys}
        if back:
            self.console.say(Level.INFO, f"{name}: {', '.join(back)} restored")
        if stays:
            self.console.say(Level.WARNING, f"{name}: {', '.join(stays)} not restored: {'; '.join(problems)}")
            self.console.say(Level.WARNING, f"{name}: to restore them: {command_line('restore', self.run)}")


def read_open_changes(run: Path) -> tuple[Site, list[KeptParameter], list[KeptList]]:
    """Return the site of a flight, and its parameters, fences and rally points that are still to be restored.

    Raises:
        LogError: the directory holds no record, or one that cannot be read.
        SiteError: site.toml cannot be used.
    """
    kept, lists = PARAMETERS.read(run), LISTS.read(run)
    if not lists and not PARAMETERS.path_in(run).exists():
        raise LogError(f"{run}: expected a run directory with parameters.json; no parameter was changed from here")
    return (
        read_site(RunDirectory(run).site),
        [one for one in kept if one.is_open],
        [one for one in lists if one.is_open],
    )


def find_open_parameters(run: Path) -> list[KeptParameter]:
    """Return the parameters that are not restored; an unreadable record is left for `restore` to report."""
    with suppress(LogError):
        return [one for one in PARAMETERS.read(run) if one.is_open]
    return []


def check_run(run: Path, site: Site) -> None:
    """Refuse to fly from a directory whose record has vehicles that the site file lacks: it would be lost.

    Raises:
        LogError: it has such vehicles, or the record cannot be read.
    """
    systems = {table.name: table.sysid for table in site.vehicle}
    for one in PARAMETERS.read(run):
        if one.is_open and systems.get(one.vehicle) != one.sysid:
            record = RunDirectory(run).parameters
            raise LogError(
                f"{record}: {one.vehicle} (system {one.sysid}) has not got its {one.name} back, and is not in the "
                f"site file; expected a new directory, or {command_line('restore', run)} before"
            )


async def restore_from_run(run: Path, console: Console) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Restore what is on record; return both records as they are then.

    No heartbeat of ours is sent: a vehicle flown by another station would take its end for a lost ground station.

    Raises:
        LogError: another process flies from this directory, or it holds no record.
        SiteError: site.toml cannot be used, or the signing key is missing.
        ConnectionFailed: a connection cannot be opened.
    """
    with lock_run_directory(run):
        site, waiting, lists = read_open_changes(run)  # no other process writes to it from here on
        names = {one.vehicle for one in waiting} | {one.vehicle for one in lists}
        async with follow_fleet_time(site, console) as fleet:
            clock = SystemClock.start_on(site.flight.speedup, fleet.steady_s)
            key = read_signing_key(site, run)
            keyring = None if key is None else Keyring(key, clock.steady_unix_s)
            # One backend for all: it is the same connection, whichever software was used in flight.
            wanted = {
                table.name: replace(table.requests[0], more=table.requests[1:])
                for table in site.vehicle
                if table.name in names
            }
            station = site.link.station
            async with open_joined_links(wanted, clock.now_s, keyring, may_be_absent=True, station=station) as links:
                return await restore_board(run, links, clock, console, site.flight.connect_timeout_s * clock.speedup)


async def restore_board(
    run: Path, links: Links, clock: Clock, console: Console, heard_s: float = HEARD_S
) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Restore every vehicle that answers and is disarmed; report the result of each.

    Fences go before the parameters that control them.

    Args:
        run: Directory of the record.
        links: Links to the vehicles.
        clock: Clock of the flight.
        console: Where results are shown.
        heard_s: Most time to wait for a vehicle, in vehicle time.

    Returns:
        The records of parameters and of lists as they are now; empty if nothing was ever changed, or one cannot be
        read.
    """

    async def restore(file: RecordFile[Change]) -> tuple[Change, ...]:
        try:
            record = BoardRecord.open(file, run, console)
        except LogError as error:
            console.say(Level.WARNING, str(error))
            return ()
        await record.restore(links, clock, heard_s)
        return record.kept

    lists = await restore(LISTS)
    return await restore(PARAMETERS), lists
