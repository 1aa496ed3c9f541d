"""Types of the documents that a browser gets, for type checking the page's JavaScript."""

from __future__ import annotations

import inspect
import json
import sys
from collections.abc import Iterator
from enum import Enum
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

from executor.adapters.web.snapshot import BesideFleet, BesideVehicle, PageAssets, PageChart
from executor.analysis.report_map import ReportMap
from executor.core.fleet_view import FleetView
from executor.plan_page import api_answers as answers
from executor.site.ground_view import GroundDocument
from executor.site.site_schema import read_docstrings

TYPES = "../executor/adapters/web/documents.d.ts"
"""Next to the code that makes the documents."""
DOCUMENTS = (
    FleetView, BesideFleet, BesideVehicle, PageChart, PageAssets, GroundDocument, answers.WorkspaceAnswer,
    answers.NetworkAnswer, answers.GroundAnswer, answers.PlanPart, answers.LossAnswer, answers.ChangeAnswer,
    answers.TryAnswer, answers.FlightPart, ReportMap,
)  # fmt: skip
PLAIN: dict[object, str] = {
    Any: "any",
    NoneType: "null",
    bool: "boolean",
    int: "number",
    float: "number",
    str: "string",
}
HEAD = """\
// Made by ./scripts/reference from the program's documents (DOCUMENTS in scripts/pages/page_types.py).

/** East and north of the depot, in metres. */
export type Place = [number, number];

/** A vehicle as the page gets it. */
export type Vehicle = VehicleView & BesideVehicle;

/** The flight at one moment, as the page gets it. */
export type State = Omit<FleetView, "vehicles"> & BesideFleet & { vehicles: Vehicle[] };
"""


def page_types() -> str:
    """Return the file: an interface for each document, and for each part of one."""
    wanted: dict[type, None] = dict.fromkeys(DOCUMENTS)
    texts = [HEAD]
    while len(texts) <= len(wanted):
        texts.append("\n".join(_interface(list(wanted)[len(texts) - 1], wanted)))
    return "\n".join(texts)


def _interface(kind: type, wanted: dict[type, None]) -> Iterator[str]:
    """Yield the lines of an interface; types that its keys need are added to ``wanted``."""
    names = {base.__name__ for base in kind.__mro__}
    words = {key: text for name, key, text in read_docstrings(sys.modules[kind.__module__]) if name in names}
    yield f"/** {' '.join(inspect.cleandoc(kind.__doc__ or '').split())} */"
    yield f"export interface {kind.__name__} {{"
    for key, held in get_type_hints(kind).items():
        if get_origin(held) is ClassVar:
            continue
        if key in words:
            yield f"  /** {words[key]} */"
        yield f"  {key}: {_typed(held, wanted)};"
    yield "}\n"


def _typed(kind: object, wanted: dict[type, None]) -> str:
    """Return a type as in JSON.

    >>> _typed(tuple[int | None, ...], {}), _typed(tuple[float, str], {}), _typed(Literal["a", 2], {})
    ('(number | null)[]', '[number, string]', '"a" | 2')
    """
    if kind in PLAIN:
        return PLAIN[kind]
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Literal:
        return " | ".join(json.dumps(one) for one in parts)
    if origin in {Annotated, Union, UnionType}:
        return " | ".join(_typed(one, wanted) for one in (parts[:1] if origin is Annotated else parts))
    if origin is list or (origin is tuple and parts[-1] is ...):
        inner = _typed(parts[0], wanted)
        return f"({inner})[]" if " | " in inner else f"{inner}[]"
    if origin is dict:
        return f"Record<string, {_typed(parts[1], wanted)}>"
    if origin is tuple:
        return f"[{', '.join(_typed(one, wanted) for one in parts)}]"
    if not isinstance(kind, type):
        raise TypeError(f"{kind}: expected a type that JSON has")
    if issubclass(kind, Enum):
        return " | ".join(f'"{one.value}"' for one in kind)
    wanted[kind] = None
    return kind.__name__
