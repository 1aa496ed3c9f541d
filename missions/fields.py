"""Typed reading of parsed JSON with the place in every complaint."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeGuard

from missions.errors import MissionsError

MOST = 2**53
"""A whole number beyond is a mistake: JSON's readers elsewhere do not keep it."""
MOST_FIGURE = 1e12
"""A figure beyond is a mistake, and sums and squares of it are no numbers any more."""


@dataclass(frozen=True, slots=True)
class Fields:
    """One JSON object of a file, and where in the file it is."""

    content: Mapping[str, object]
    source: str
    error: type[MissionsError]
    """What to raise."""
    prefix: str = ""

    def fail(self, key: str, expected: str) -> MissionsError:
        """Return the error for a key: one line with the file, the key and what was expected."""
        got = f", got {_short(self.content[key])}" if key in self.content else ", found none"
        return self.error(f"{self.source}: {self.prefix}{key}: expected {expected}{got}")

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self.content.get(key)
        if not is_figure(value):
            raise self.fail(key, "a finite number")
        return float(value)

    def optional_number(self, key: str) -> float | None:
        """Return a finite number, or None for null or no key."""
        return None if self.content.get(key) is None else self.number(key)

    def integer(self, key: str) -> int:
        """Return a whole number."""
        value = self.content.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or abs(value) > MOST:
            raise self.fail(key, "a whole number")
        return value

    def flag(self, key: str, default: bool | None = None) -> bool:
        """Return true or false."""
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            raise self.fail(key, "true or false")
        return value

    def text(self, key: str) -> str:
        """Return a text that is not empty."""
        value = self.content.get(key)
        if not isinstance(value, str) or not value:
            raise self.fail(key, "a text")
        return value

    def optional_text(self, key: str) -> str:
        """Return a text for people, or an empty one for null or no key."""
        return printable(self.text(key)) if self.content.get(key) else ""

    def numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        """Return finite numbers: exactly ``count``, or as many as there are."""
        value = self.content.get(key)
        if not isinstance(value, list) or count not in {None, len(value)} or not all(map(is_figure, value)):
            raise self.fail(key, "finite numbers" if count is None else f"{count} finite numbers")
        return tuple(float(number) for number in value)

    def optional_numbers(self, key: str, count: int) -> tuple[float | None, ...]:
        """Return ``count`` finite numbers or nulls; all None if there is no such key."""
        value = self.content.get(key, [None] * count)
        if not isinstance(value, list) or len(value) != count:
            raise self.fail(key, f"{count} numbers or nulls")
        if not all(number is None or is_figure(number) for number in value):
            raise self.fail(key, f"{count} finite numbers or nulls")
        return tuple(None if number is None else float(number) for number in value)

    def texts(self, key: str, count: int) -> tuple[str, ...]:
        """Return exactly ``count`` texts."""
        value = self.content.get(key)
        if not isinstance(value, list) or len(value) != count or not all(isinstance(text, str) for text in value):
            raise self.fail(key, f"{count} texts")
        return tuple(value)

    def integers(self, key: str) -> tuple[int, ...]:
        """Return a list of whole numbers."""
        value = self.content.get(key)
        if not isinstance(value, list) or not all(isinstance(n, int) and not isinstance(n, bool) for n in value):
            raise self.fail(key, "a list of whole numbers")
        return tuple(value)

    def inner(self, key: str) -> Fields:
        """Return an object."""
        value = self.content.get(key)
        if not isinstance(value, dict):
            raise self.fail(key, "an object")
        return Fields(value, self.source, self.error, f"{self.prefix}{key}.")

    def optional_inner(self, key: str) -> Fields | None:
        """Return an object, or None for null or no key."""
        return None if self.content.get(key) is None else self.inner(key)

    def each(self, key: str) -> Iterator[Fields]:
        """Yield the objects of a list."""
        value = self.content.get(key)
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            raise self.fail(key, "a list of objects")
        for index, entry in enumerate(value):
            yield Fields(entry, self.source, self.error, f"{self.prefix}{key}[{index}].")


def is_number(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a finite number; a boolean is none, nor is what no float can hold."""
    most = sys.float_info.max
    return isinstance(value, int | float) and not isinstance(value, bool) and -most <= value <= most


def is_figure(value: object) -> TypeGuard[int | float]:
    """Return whether a parsed JSON value is a number that a place, a time or a share can have."""
    return is_number(value) and abs(value) <= MOST_FIGURE


def printable(text: str) -> str:
    """Return a name for people: on one line, without what a terminal would not show."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
