"""fences.json of a run directory: fences and rally points that were replaced on board, to be given back."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from executor.adapters.document import Document, Number, Whole, YesNo
from executor.adapters.run_directory import RunDirectory
from executor.core.preflight.fence_checks import OnboardLists
from executor.site.tables.aircraft import AutopilotKey
from missions import MissionItem, MissionKind
from missions.fences import find_list_differences


class ListStage(Enum):
    """How far a list has come."""

    PLANNED = "planned"
    """Ours may be on board: this is written before it is sent."""
    SET = "set"
    """Ours was read back."""
    RESTORED = "restored"
    """What was there before was read back."""
    LEFT = "left"
    """Something else was found on board, which somebody put there since: it was left as it is."""


Items = tuple[MissionItem, ...]


@dataclass(frozen=True, slots=True)
class KeptList:
    """What is on record of one vehicle's fence, or of its rally points."""

    vehicle: str
    sysid: int
    autopilot: str
    kind: MissionKind
    old: Items
    """What was there before anybody here put anything on board."""
    new: tuple[Items, ...]
    """What was put there from here, the last one last."""
    stage: ListStage = ListStage.PLANNED

    @property
    def is_open(self) -> bool:
        """Whether it has still to be given back."""
        return self.stage is not ListStage.RESTORED

    @property
    def list_name(self) -> str:
        """Which list, in words."""
        return "fence" if self.kind is MissionKind.FENCE else "rally points"

    @property
    def description(self) -> str:
        """What is restored, for the crew to confirm."""
        items = f"{len(self.old)} item{'s' if len(self.old) != 1 else ''}" if self.old else "none"
        return f"{self.vehicle}: {self.list_name} -> {items}, as before the flight"

    def is_ours(self, items: Sequence[MissionItem]) -> bool:
        """Return whether what is on board was put there from here."""
        return any(not find_list_differences(one, items) for one in self.new)


def build_planned_lists(
    before: Sequence[KeptList], name: str, about: tuple[int, str], found: OnboardLists, wanted: OnboardLists
) -> list[KeptList]:
    """Return what is on record of one vehicle before anything is sent.

    What an earlier attempt at the same flight found is what is given back, unless somebody put something else on board
    since.
    """
    known = {one.kind: one for one in before if one.vehicle == name and one.is_open}
    made = []
    for kind, old, new in (
        (MissionKind.FENCE, found.fence, wanted.fence),
        (MissionKind.RALLY, found.rally, wanted.rally),
    ):
        if old is None or new is None:
            continue
        earlier = known.get(kind)
        if earlier is not None and (earlier.is_ours(old) or not find_list_differences(earlier.old, old)):
            made.append(replace(earlier, new=(*earlier.new, new), stage=ListStage.PLANNED))
        else:
            made.append(KeptList(name, *about, kind, old, (new,)))
    return made


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


class _ListRow(Document):
    vehicle: str
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey
    list: Literal["fence", "rally"]
    old: tuple[_Item, ...]
    new: tuple[tuple[_Item, ...], ...]
    state: ListStage


class _File(Document):
    format: Literal["faultline-fences/1"]
    lists: tuple[_ListRow, ...]


_NAMES = {MissionKind.FENCE: "fence", MissionKind.RALLY: "rally"}
_KINDS = {name: kind for kind, name in _NAMES.items()}


def read_kept_lists(run: Path) -> tuple[KeptList, ...]:
    """Return what is on record of a flight; nothing if it never changed a fence or rally points.

    Raises:
        LogError: the record cannot be read.
    """
    path = RunDirectory(run).fences
    if not path.exists():
        return ()
    return tuple(
        KeptList(
            row.vehicle, row.sysid, row.autopilot, _KINDS[row.list], _parse_items(row.old),
            tuple(_parse_items(one) for one in row.new), row.state,
        )
        for row in _File.read(path, "fences and rally points that were replaced on board").lists
    )  # fmt: skip


def write_kept_lists(run: Path, kept: Iterable[KeptList]) -> None:
    """Write the record; once this returns it outlives a power loss.

    Raises:
        OSError: it cannot be written.
    """
    rows = tuple(
        _ListRow(
            vehicle=one.vehicle, sysid=one.sysid, autopilot=one.autopilot, list=_NAMES[one.kind],
            old=_build_rows(one.old),
            new=tuple(_build_rows(items) for items in one.new), state=one.stage,
        )
        for one in kept
    )  # fmt: skip
    _File(format="faultline-fences/1", lists=rows).write(RunDirectory(run).fences)


def _parse_items(rows: Iterable[_Item]) -> Items:
    return tuple(MissionItem(seq, **row.model_dump()) for seq, row in enumerate(rows))


def _build_rows(items: Iterable[MissionItem]) -> tuple[_Item, ...]:
    keys = _Item.model_fields
    # PX4 answers NaN for what means nothing in a fence, and JSON has none.
    return tuple(
        _Item(**{key: 0.0 if value != value else value for key, value in asdict(one).items() if key in keys})
        for one in items
    )
