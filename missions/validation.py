"""Report in one line why a document does not fit its model: the key, and what was expected there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Annotated, Any, get_origin

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetPydanticSchema,
    PlainSerializer,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from missions.files import MOST_FIGURE, to_printable

MOST_SHOWN = 60
"""Most characters shown of a wrong value."""

Figure = Annotated[float, Field(strict=True, ge=-MOST_FIGURE, le=MOST_FIGURE, allow_inf_nan=False)]
"""A plausible number for a place, a time or a share: no text, boolean, NaN or infinity."""
Text = Annotated[str, Field(min_length=1)]
Printable = Annotated[Text, AfterValidator(to_printable)]
"""A text for display, on one line."""
Flag = Annotated[bool, Field(strict=True)]
Id = Annotated[int, Field(strict=True, ge=0, le=2**53)]
"""Upper limit: JSON parsers elsewhere lose the precision of larger integers."""
Pair = tuple[Figure, Figure]
Place = tuple[Figure, Figure, Figure]
Known = tuple[Figure | None, Figure | None]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")]
"""Vehicle name, as in the site file."""
Above0 = Annotated[Figure, Field(gt=0)]
From0 = Annotated[Figure, Field(ge=0)]
IdSet = Annotated[frozenset[Id], PlainSerializer(sorted, return_type=list[Id])]
NameSet = Annotated[frozenset[str], PlainSerializer(sorted, return_type=list[str])]

_KINDS = {
    "bool_parsing": "true or false", "bool_type": "true or false", "dataclass_type": "keys with values",
    "dict_type": "keys with values", "float_parsing": "a number", "float_type": "a number",
    "int_from_float": "a whole number", "int_parsing": "a whole number", "int_type": "a whole number",
    "model_type": "keys with values", "string_type": "a text", "string_unicode": "a text", "tuple_type": "a list",
}  # fmt: skip
"""Replacements for pydantic error messages that only programmers understand."""


def array_of(lists: object) -> GetPydanticSchema:
    """Return the document type of a float64 field: nested lists in the document, an array here.

    Args:
        lists: Their type, e.g. `tuple[Place, ...]`.
    """

    def build_schema(_kind: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        back = core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist)
        return core_schema.no_info_after_validator_function(
            _to_array, handler.generate_schema(lists), serialization=back
        )

    return GetPydanticSchema(build_schema, lambda schema, handler: handler(schema["schema"]))


def _to_array(lists: object) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        return np.array(lists, dtype=np.float64)
    except ValueError as error:
        raise ValueError("rows: expected as many figures in each") from error


def one_of(names: Iterable[str]) -> GetPydanticSchema:
    """Return the document type of a text that must be one of some names."""
    known = list(names)
    return GetPydanticSchema(lambda *_: core_schema.literal_schema(known))


def document_of(kind: type[object]) -> GetPydanticSchema:
    """Return the document type of an object or list already written and checked by a type, for schemas."""
    schema = core_schema.list_schema() if get_origin(kind) is tuple else core_schema.dict_schema()
    return GetPydanticSchema(
        lambda _kind, _handler: schema,
        lambda _schema, handler: handler(TypeAdapter(kind).core_schema),
    )


def is_none(value: object) -> bool:
    """Return whether to omit a key when its model is written."""
    return value is None


def format_first_error(error: ValidationError, *, page: str = "the documents", shown: bool = True) -> str:
    """Return the first validation error of a model: `key.path[3]: expected ..., got ...`.

    Args:
        error: What the model raised.
        page: Page that documents the keys.
        shown: Whether to show the wrong value; it may be a secret.
    """
    return format_error(error.errors(include_url=False)[0], page=page, shown=shown)


def format_error(first: ErrorDetails, *, page: str = "the documents", shown: bool = True) -> str:
    """Return a model's validation error in the format of `format_first_error`."""
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    context = first.get("ctx", {})
    match first["type"]:
        case "missing":
            reason = "expected this key, but it is missing"
            if isinstance(first["loc"][-1], int):
                reason = "expected one more value"
        case "extra_forbidden":
            reason = f"unknown key; expected one that {page} names"
        case "value_error":
            # A check of several keys names its own; the prefix is the object's.
            return to_printable(f"{place}.{context['error']}").removeprefix(".")
        case "json_invalid":
            reason = f"expected JSON: {context['error']}"
        case "too_short" if context["actual_length"] == 0:
            reason = f"expected at least one {str(first['loc'][-1]).removesuffix('s')}"
        case kind:
            said = _KINDS.get(kind) or re.sub(r"^(expected |\w+ should (be |have )?(a valid )?)", "", first["msg"])
            text = repr(first["input"])
            got = text if len(text) <= MOST_SHOWN else text[: MOST_SHOWN - 3] + "..."
            reason = f"expected {said}{f', got {got}' if shown else ''}"
    return to_printable(f"{place or 'content'}: {reason}")
