"""parameters.json and fences.json of a run directory: all that was changed on board, so that it can be given back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Generic, Literal

from pydantic import Field

from executor.adapters.document import Document, Number, Whole, YesNo
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import ParameterRow
from executor.core.interface.commands import Level
from executor.core.preflight.board_changes import Change, ChangeStage, Items, KeptList, KeptParameter
from executor.errors import PreflightFailed
from executor.flight.flight_request import Console
from executor.site.site_tables import AutopilotKey
from missions import MissionItem, MissionKind


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
