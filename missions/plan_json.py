"""Read and write plan files: JSON, ``faultline-plan/2``, one document for a single flight and for days of many sorties.

Figures are written as Python prints a float, so that they read back unchanged. Files of version 1 can be read as well
(``plan_json_v1``).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from missions.errors import PlanFileError, SafetyError
from missions.files import find_object, read_text, write_document
from missions.plan_file import DayPlanFile, PlanFile
from missions.plan_json_v1 import upgrade_plan
from missions.plan_parts import COVERAGE_COST, WINDOW_COST
from missions.pricing import Pricing
from missions.validation import format_first_error
from planner import InstanceError, PlanError


@cache
def _find_adapter(has_days: bool) -> TypeAdapter[PlanFile | DayPlanFile]:
    """Build the converter on first use: every command imports this module, few read a plan."""
    return TypeAdapter(DayPlanFile if has_days else PlanFile)


def write_plan(path: Path | str, content: PlanFile | DayPlanFile) -> None:
    """Write a plan file atomically: a reader never sees a partial file.

    Raises:
        PlanFileError: a figure is NaN or infinite.
        OSError: the file cannot be written.
    """
    path = Path(path)
    write_document(path, build_plan_document(content, str(path)))


def build_plan_document(content: PlanFile | DayPlanFile, source: str | None = None) -> dict[str, Any]:
    """Return a plan file's content as JSON; an error names the plan's source, or the one given.

    Raises:
        PlanFileError: a figure is NaN or infinite.
    """
    adapter = _find_adapter(isinstance(content, DayPlanFile))
    plain: dict[str, Any] = adapter.dump_python(content, mode="json", by_alias=True, exclude_none=True)
    plain["segments"] = plain.pop("segments")  # last, because they are by far the longest
    _parse_plan(json.dumps(plain), source or content.source)
    return plain


def read_any_plan(path: Path | str) -> PlanFile | DayPlanFile:
    """Read a plan file, of a single flight or of days.

    Raises:
        PlanFileError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    return _parse_plan(upgrade_plan(read_text(path, "plan file", PlanFileError), str(path)), str(path))


def _parse_plan(text: str, source: str) -> PlanFile | DayPlanFile:
    try:
        adapter = _find_adapter("days" in find_object(text))
        content = replace(adapter.validate_json(text), source=source)
        for line in _find_errors(content):
            raise PlanFileError(f"{source}: {line}")
        content.plan  # noqa: B018 - refuses a segment that is in it twice
    except ValidationError as error:
        raise PlanFileError(f"{source}: {format_first_error(error)}") from error
    except InstanceError as error:
        raise PlanFileError(f"{source}: travel.{error}") from error
    except SafetyError as error:
        raise PlanFileError(f"{source}: model.kept_out: {error}") from error
    except PlanError as error:
        raise PlanFileError(f"{source}: routes: expected every segment at most once: {error}") from error
    return content


def _find_errors(content: PlanFile | DayPlanFile) -> Iterator[str]:
    """Yield inconsistencies: the key, and what was expected there."""
    yield from _find_wrong_names(content)
    model, names, count = content.pricing, content.names, len(content.segments)
    if model is not None and len(model.tracks_m) != count:
        yield f"model.tracks_m: expected {count}, got {len(model.tracks_m)}"
    if model is not None:
        yield from _find_wrong_locks(model, names, count)
    if model is not None and not set(model.bases) == set(model.models) == set(names):
        yield f"model: expected bases and models of {', '.join(names)}"
    if isinstance(content, DayPlanFile):
        yield from _find_wrong_counts(content)
        return
    if tuple(route.vehicle for route in content.routes) != names:
        yield f"routes: expected one each for {', '.join(names)}, in that order"
    if content.cost.name == WINDOW_COST and content.window is None:
        yield "window: expected the window that the plan was chosen by"
    if content.cost.name == COVERAGE_COST and content.coverage is None:
        yield "coverage: expected the probability that the plan was chosen by"


def _find_wrong_locks(model: Pricing, names: Sequence[str], count: int) -> Iterator[str]:
    for key, segments in (("locked", model.locked), ("directions", model.directions)):
        for segment in segments:
            if not 0 <= segment < count:
                yield f"model.{key}: expected positions below {count}, got {segment}"
    for segment, keeper in model.locked.items():
        if keeper not in names:
            yield f"model.locked.{segment}: expected one of {', '.join(names)}, got {keeper}"


def _find_wrong_names(content: PlanFile | DayPlanFile) -> Iterator[str]:
    ids, bases = tuple(segment.id for segment in content.segments), tuple(base.name for base in content.bases)
    for key, own in (("segments[{}].id", ids), ("vehicles[{}].name", content.names), ("bases[{}].name", bases)):
        if len(set(own)) < len(own):
            index, name = next((index, name) for index, name in enumerate(own) if name in own[:index])
            yield f"{key.format(index)}: expected one of its own, got {name}, which another has"
    known = {"vehicle": content.names, "base": bases, "lands": bases}
    for key, one in _list_names(content):
        if isinstance(one, str) and one not in (there := known[key.rpartition(".")[2]]):
            yield f"{key}: expected one of {', '.join(there)}, got {one}"
        if isinstance(one, int) and one not in content.positions:
            yield f"{key}: expected the id of a segment, got {one}"


def _find_wrong_counts(content: DayPlanFile) -> Iterator[str]:
    bases = len(content.bases)
    if [len(row) for row in content.transfers_s] != [bases] * bases:
        yield f"transfers_s: expected {bases} rows of {bases}"
    for index, vehicle in enumerate(content.vehicles):
        if len(vehicle.pads) != bases:
            yield f"vehicles[{index}].pads: expected {bases}, got {len(vehicle.pads)}"
    for index, route in enumerate(content.routes):
        if not route.visits:
            yield f"routes[{index}].visits: expected at least one visit"


def _list_names(content: PlanFile | DayPlanFile) -> Iterator[tuple[str, int | str]]:
    """Yield each place that names a vehicle, a base or a segment, and the name."""
    for row, route in enumerate(content.routes):
        yield from ((f"routes[{row}].{key}", getattr(route, key)) for key in ("vehicle", "base", "lands"))
        for index, visit in enumerate(route.visits):
            yield f"routes[{row}].visits[{index}].segment", visit.segment
    yield from (("uncovered", segment) for segment in content.uncovered)
    if isinstance(content, DayPlanFile):
        for row, vehicle in enumerate(content.vehicles):
            yield f"vehicles[{row}].base", vehicle.base
            yield from ((f"vehicles[{row}].lands", base) for base in vehicle.lands)
        yield from ((f"windows[{row}].vehicle", one.vehicle) for row, one in enumerate(content.windows))


def read_plan(path: Path | str) -> PlanFile:
    """Read the plan file of a single flight.

    Raises:
        PlanFileError: as for `read_any_plan`, or it is a day plan.
    """
    content = read_any_plan(path)
    if isinstance(content, DayPlanFile):
        raise PlanFileError(f"{path}: days: expected a plan for a single flight, got a day plan")
    return content


def read_day_plan(path: Path | str) -> DayPlanFile:
    """Read the plan file of days.

    Raises:
        PlanFileError: as for `read_any_plan`, or it is a plan of a single flight.
    """
    content = read_any_plan(path)
    if isinstance(content, PlanFile):
        raise PlanFileError(f"{path}: days: expected a day plan, got the plan of a single flight")
    return content


def is_day_plan(path: Path | str) -> bool:
    """Return whether a file is a day plan."""
    try:
        return "days" in find_object(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False  # the reader of the file reports the reason
