"""Assets as an intent names them, from whichever side it comes."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from executor.core.interface.intents import LONGEST_NAME, MOST_ASSETS


def _check_asset(value: Any) -> int | str:  # noqa: ANN401 - whatever somebody sent
    """Return a name or a number; a union's own complaint would name the types of Python."""
    if isinstance(value, str) and 0 < len(value) <= LONGEST_NAME:
        return value
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    raise PydanticCustomError("asset", "expected the name of an asset or the number of a segment")


_SCHEMA = {
    "anyOf": [
        {"type": "string", "minLength": 1, "maxLength": LONGEST_NAME},
        {"type": "integer", "minimum": 0},
    ]
}
Asset = Annotated[int | str, PlainValidator(_check_asset), WithJsonSchema(_SCHEMA)]
NamedAssets = Annotated[tuple[Asset, ...], Field(min_length=1, max_length=MOST_ASSETS)]
"""One at least: a list that came out empty does not stand for all of them."""
