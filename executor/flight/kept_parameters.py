"""parameters.json of a run directory: every parameter that was changed on board, so that it can be given back."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from executor.adapters.document import Document, Number
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import ParameterRow
from executor.core.preflight.parameter_proposals import ChangeStage, KeptParameter
from executor.site.tables.aircraft import AutopilotKey


class _KeptRow(Document):
    vehicle: str
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey
    name: Annotated[str, Field(min_length=1, max_length=16)]
    old: Number
    new: Number
    kind: Annotated[int, Field(ge=1, le=10)]
    unit: str
    why: str
    earlier: tuple[Number, ...] = ()
    state: ChangeStage


class _File(Document):
    format: Literal["faultline-parameters/1"]
    parameters: tuple[_KeptRow, ...]


def read_kept_parameters(run: Path) -> tuple[KeptParameter, ...] | None:
    """Return what is on record of a flight; None if nothing was ever changed from there.

    Raises:
        LogError: the record cannot be read.
    """
    path = RunDirectory(run).parameters
    if not path.exists():
        return None
    content = _File.read(path, "what was changed on board")
    return tuple(
        KeptParameter(**{**row.model_dump(exclude={"state"}), "stage": row.state}) for row in content.parameters
    )


def write_kept_parameters(run: Path, kept: Iterable[KeptParameter]) -> None:
    """Write the record; once this returns it outlives a power loss.

    Raises:
        OSError: it cannot be written.
    """
    rows = (_KeptRow(**{**asdict(one), "state": one.stage}) for one in kept)
    _File(format="faultline-parameters/1", parameters=tuple(rows)).write(RunDirectory(run).parameters)


def build_parameter_rows(kept: Sequence[KeptParameter]) -> list[ParameterRow]:
    """Return what a report says of the parameters that were changed."""
    return [
        ParameterRow(vehicle=one.vehicle, name=one.name, old=one.old, new=one.new, restored=not one.open)
        for one in kept
    ]
