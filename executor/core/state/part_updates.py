"""A vehicle, or the whole flight, with other fields in one of its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Generic, ParamSpec, TypeVar

Whole = TypeVar("Whole")
Fields = ParamSpec("Fields")


class PartUpdate(Generic[Fields]):
    """A method of a dataclass that replaces fields of one of its parts, as `replace` twice.

    `with_orders = PartUpdate(Orders)` makes `vehicle.with_orders(held_s=None)`; every field of the part has a default.
    """

    def __init__(self, part: Callable[Fields, object]) -> None:
        """Take the dataclass that the part is: its fields are the arguments, and type checkers hold callers to them."""

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name of the part from the name of the method."""
        self.part = name.removeprefix("with_")

    def __get__(self, whole: Whole, owner: type | None = None) -> Callable[Fields, Whole]:
        """Return the method of one object."""

        def update(*_: Fields.args, **fields: Fields.kwargs) -> Whole:
            part = replace(getattr(whole, self.part), **fields)
            changed: Whole = replace(whole, **{self.part: part})  # type: ignore[type-var]
            return changed

        return update
