"""Logs of the autopilots themselves, made for tests: DataFlash with its formats, ULog with its topics."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

_FORMATS = {
    "a": "64s", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "n": "4s", "N": "16s", "Z": "64s",
    "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "d": "d", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
_SCALES = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10_000_000}
Value = float | str


@dataclass(slots=True)
class DataFlashWriter:
    """A .BIN: every kind says its own format once, before its first record."""

    parts: list[bytes] = field(default_factory=list)
    kinds: dict[str, tuple[int, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._declare("FMT", 128, "BBnNZ", "Type,Length,Name,Format,Columns")

    def _declare(self, name: str, number: int, layout: str, columns: str) -> None:
        size = struct.calcsize("<" + "".join(_FORMATS[one] for one in layout)) + 3
        self.kinds[name] = (number, layout)
        fmt = struct.pack("<BB4s16s64s", number, size, name.encode(), layout.encode(), columns.encode())
        self.parts.append(b"\xa3\x95\x80" + fmt)

    def say(self, name: str, layout: str, columns: str, *values: Value) -> None:
        """Write a record; the format is written with the first of its kind."""
        if name not in self.kinds:
            self._declare(name, 128 + len(self.kinds), layout, columns)
        number, layout = self.kinds[name]
        stored = [
            value.encode() if isinstance(value, str) else round(value * _SCALES[one]) if one in _SCALES else value
            for one, value in zip(layout, values, strict=True)
        ]
        packed = struct.pack("<" + "".join(_FORMATS[one] for one in layout), *stored)
        self.parts.append(bytes((0xA3, 0x95, number)) + packed)

    def data(self) -> bytes:
        return b"".join(self.parts)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.data())
        return path


_ULOG_TYPES = {"uint64_t": "Q", "uint32_t": "I", "uint16_t": "H", "uint8_t": "B", "int32_t": "i", "float": "f"}
Topic = Sequence[tuple[str, str]]
"""Names and types of a topic's fields, after its time."""


@dataclass(slots=True)
class UlogWriter:
    """A .ulg; what is told of topics that were not described is described when it is written."""

    topics: Mapping[str, Topic]
    parameters: Mapping[str, float] = field(default_factory=dict)
    said: list[tuple[int, bytes]] = field(default_factory=list)

    def say(self, t_usec: int, topic: str, instance: int = 0, **values: float) -> None:
        """Write a row; fields that are not named are 0."""
        number = 10 * list(self.topics).index(topic) + instance
        fields = self.topics[topic]
        stored = [values.get(name, 0) for name, _ in fields]
        layout = "<HQ" + "".join(_ULOG_TYPES[kind] for _, kind in fields)
        self.said.append((t_usec, _message("D", struct.pack(layout, number, t_usec, *stored))))

    def text(self, t_usec: int, words: str, level: int = 4) -> None:
        self.said.append((t_usec, _message("L", struct.pack("<BQ", 48 + level, t_usec) + words.encode())))

    def data(self) -> bytes:
        head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)
        parts = [head, _message("B", bytes(40))]
        for topic, fields in self.topics.items():
            described = "".join(f"{kind} {name};" for name, kind in (("timestamp", "uint64_t"), *fields))
            parts.append(_message("F", f"{topic}:{described}".encode()))
        for name, value in self.parameters.items():
            key = f"float {name}".encode()
            parts.append(_message("P", bytes((len(key),)) + key + struct.pack("<f", value)))
        for number, topic in enumerate(self.topics):
            for instance in range(2):
                added = struct.pack("<BH", instance, 10 * number + instance) + topic.encode()
                parts.append(_message("A", added))
        return b"".join([*parts, *(one for _, one in sorted(self.said, key=lambda one: one[0]))])

    def write(self, path: Path) -> Path:
        path.write_bytes(self.data())
        return path


def _message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content
