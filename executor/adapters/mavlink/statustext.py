"""STATUSTEXT put together: a long text comes in parts of 50 bytes, and parts come twice, late, or never.

A machine without I/O and without a clock: its measure of time is how many frames came since. At the rates that a flight
asks for (about ten frames a second) `PATIENCE_FRAMES` are a few seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from executor.core import formatting
from executor.core.interface.messages import StatusText

PART_BYTES = 50
"""Of the text field; a part that does not fill it is the last one (common.xml)."""
PATIENCE_FRAMES = 40
"""Frames after its newest part until a text is shown as far as it came."""
MEMORY_FRAMES = 400
"""Frames for which late and repeated parts of a text that was shown are recognised."""
GAP = "[...]"
"""Stands for parts that never came."""
MOST_LETTERS = 300
"""Of a text; its numbers have room for 12800 bytes, both autopilots' longest are below 256."""
MOST_SPEAKERS = 64
"""Who is remembered; of more, the one that was silent for longest is forgotten."""

Source = tuple[int, int]
"""System and component of who speaks."""


@dataclass(slots=True)
class _PartialText:
    """One text under way, or shown already."""

    severity: int
    parts: dict[int, bytes] = field(default_factory=dict)
    newest: int = 0
    """The frame that brought the newest part."""
    shown: bool = False

    @property
    def is_whole(self) -> bool:
        last = max(self.parts)
        return len(self.parts) == last + 1 and len(self.parts[last]) < PART_BYTES

    def assemble(self) -> str:
        """Return what came, with a mark for each gap; a full last part may have been the end or not."""
        last = max(self.parts)
        pieces: list[bytes] = []
        for number in range(last + 1):
            if number in self.parts:
                pieces.append(self.parts[number])
            elif number - 1 in self.parts or number == 0:
                pieces.append(GAP.encode())
        return clean_text(b"".join(pieces))


def clean_text(raw: bytes) -> str:
    r"""Return a text that may be shown anywhere, without the zeros that fill its field and without PX4's trailing tab.

    >>> clean(b"Takeoff detected\t")
    'Takeoff detected'
    """
    said = formatting.escape_controls(raw.decode("utf-8", errors="replace").strip("\x00 \t\r\n"))
    return said if len(said) <= MOST_LETTERS else said[: MOST_LETTERS - len(GAP)] + GAP


class StatusTextAssembler:
    """The texts of everybody behind one endpoint."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._texts: dict[Source, dict[int, _PartialText]] = {}
        self._frames: dict[Source, int] = {}

    def count_frame(self, source: Source, frames: int = 1) -> list[StatusText]:
        """Count frames of any kind; returns their source's texts that were waited for in vain, as far as they came."""
        frame = self._frames[source] = self._frames.pop(source, 0) + frames
        if len(self._frames) > MOST_SPEAKERS:
            silent = next(iter(self._frames))
            del self._frames[silent]
            self._texts.pop(silent, None)
        texts = self._texts.get(source, {})
        given_up = []
        for number, text in list(texts.items()):
            age = frame - text.newest
            if text.shown and age > MEMORY_FRAMES:
                del texts[number]
            elif not text.shown and age > PATIENCE_FRAMES:
                text.shown = True
                given_up.append(StatusText(text.severity, text.assemble()))
        return given_up

    def list_unfinished_texts(self) -> list[tuple[Source, StatusText]]:
        """Return whose texts are still waited for, as far as they came, once nothing more comes."""
        return [
            (source, StatusText(text.severity, text.assemble()))
            for source, texts in self._texts.items()
            for text in texts.values()
            if not text.shown
        ]

    def add_part(self, source: Source, severity: int, raw: bytes, number: int, part: int) -> list[StatusText]:
        """Take one part; returns the texts that it ends.

        Args:
            source: Who speaks.
            severity: MAV_SEVERITY.
            raw: The text field, filled up with zeros or not.
            number: The id of the text; 0 is a text in one part.
            part: The number of the part, from 0.
        """
        raw = raw.split(b"\x00", 1)[0]
        if number == 0:
            return [StatusText(severity, clean_text(raw))]
        found: list[StatusText] = []
        texts = self._texts.setdefault(source, {})
        text = texts.get(number)
        if text is not None and text.parts.get(part, raw) != raw:
            # The same id with other words: the vehicle restarted, and counts its texts from the beginning again.
            if not text.shown:
                found.append(StatusText(text.severity, text.assemble()))
            text = None
        if text is None:
            text = texts[number] = _PartialText(severity)
        text.newest = self._frames.get(source, 0)
        if text.shown:
            return found
        text.parts[part] = raw
        if text.is_whole:
            text.shown = True
            found.append(StatusText(text.severity, text.assemble()))
        return found
