"""What a model says of a document that does not fit it, in one line: the key, and what was expected there."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import Field, ValidationError

from missions.files import MOST_FIGURE, to_printable

MOST_SHOWN = 60
"""Letters of a wrong value that are shown."""

Figure = Annotated[float, Field(strict=True, ge=-MOST_FIGURE, le=MOST_FIGURE, allow_inf_nan=False)]
"""A number that a place, a time or a share can have: no text, no boolean, nothing without end."""
Text = Annotated[str, Field(min_length=1)]
Flag = Annotated[bool, Field(strict=True)]
Id = Annotated[int, Field(strict=True, ge=0, le=2**53)]
"""JSON's readers elsewhere do not keep a greater number."""
Pair = tuple[Figure, Figure]
Place = tuple[Figure, Figure, Figure]
Known = tuple[Figure | None, Figure | None]

_KINDS = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "keys with values",
    "float_parsing": "a number",
    "float_type": "a number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_type": "a whole number",
    "model_type": "keys with values",
    "string_type": "a text",
    "string_unicode": "a text",
    "tuple_type": "a list",
}
"""What pydantic calls an error, where its own words are a programmer's."""


def is_none(value: object) -> bool:
    """Return whether a key is left out when its model is written."""
    return value is None


def format_first_error(error: ValidationError, *, page: str = "the documents", shown: bool = True) -> str:
    """Return the first of a model's complaints: `key.path[3]: expected ..., got ...`.

    Args:
        error: What the model raised.
        page: That names the keys there are.
        shown: Whether the wrong value is named; it may be a secret.
    """
    first = error.errors(include_url=False)[0]
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
            # A check of several keys names its own; the place before it is the object's.
            return to_printable(f"{place}.{context['error']}").removeprefix(".")
        case "json_invalid":
            reason = f"expected JSON: {context['error']}"
        case "too_short" if context["actual_length"] == 0:
            reason = f"expected at least one {str(first['loc'][-1]).removesuffix('s')}"
        case kind:
            said = _KINDS.get(kind) or re.sub(r"^(expected |\w+ should (be |have )?(a valid )?)", "", first["msg"])
            reason = f"expected {said}{_describe_value(first['input']) if shown else ''}"
    return to_printable(f"{place or 'content'}: {reason}")


def _describe_value(value: Any) -> str:  # noqa: ANN401 - whatever a file held
    text = repr(value)
    return f", got {text if len(text) <= MOST_SHOWN else text[: MOST_SHOWN - 3] + '...'}"
