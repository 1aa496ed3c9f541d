"""parameters.json of a run directory: every parameter that was changed on board, so that it can be given back."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from executor.adapters.run_directory import RunDirectory, write_json
from executor.core.preflight.parameters import ChangeStage, Kept
from executor.errors import LogError
from executor.site.config import AutopilotKey

FORMAT = "faultline-parameters/1"
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True)


class _KeptRow(_Row):
    vehicle: str
    sysid: Annotated[int, Field(ge=1, le=254)]
    autopilot: AutopilotKey
    name: Annotated[str, Field(min_length=1, max_length=16)]
    old: Number
    new: Number
    kind: Annotated[int, Field(ge=1, le=10)]
    unit: str
    why: str
    state: ChangeStage
    earlier: tuple[Number, ...] = ()


class _File(_Row):
    format: Literal["faultline-parameters/1"]
    parameters: tuple[_KeptRow, ...]


def read_kept(run: Path) -> tuple[Kept, ...] | None:
    """Return what is on record of a flight; None if nothing was ever changed from there.

    Raises:
        LogError: the record cannot be read.
    """
    path = RunDirectory(run).parameters
    try:
        content = _File.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "the file"
        raise LogError(f"{path}: {key}: expected what was changed on board: {first['msg']}") from error
    return tuple(_kept(row) for row in content.parameters)


def _kept(row: _KeptRow) -> Kept:
    return Kept(**{**row.model_dump(exclude={"state"}), "stage": row.state})


def write_kept(run: Path, kept: Iterable[Kept]) -> None:
    """Write the record; once this returns it outlives a power loss.

    Raises:
        OSError: it cannot be written.
    """
    write_json(RunDirectory(run).parameters, {"format": FORMAT, "parameters": [_plain(one) for one in kept]})


def _plain(one: Kept) -> dict[str, object]:
    row = {key: getattr(one, key) for key in _KeptRow.model_fields if key != "state"}
    return {**row, "state": one.stage.value}


def parameters_report(kept: Sequence[Kept]) -> list[dict[str, object]]:
    """Return what a report says of the parameters that were changed."""
    return [
        {"vehicle": one.vehicle, "name": one.name, "old": one.old, "new": one.new, "restored": not one.open}
        for one in kept
    ]
