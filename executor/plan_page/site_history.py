"""Keep the history of a site file: undo and redo, and the record of it that survives a killed server.

The record is a file of lines, each added before the site file itself is written: its last state is that of the site
file, or will be as soon as that can be written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from executor.plan_page.site_document import Edit, apply_edits

MOST_STEPS = 500
"""Most steps that undo keeps."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step of undo."""

    label: str
    edits: tuple[Edit, ...] | None
    """None if another program wrote the file."""
    text: str
    """Site file after the step."""


@dataclass(frozen=True, slots=True)
class History:
    """Site file and its edits."""

    base: str
    """Text before the first step."""
    steps: tuple[Step, ...] = ()
    done: int = 0
    """Number of steps in effect; those after it were undone."""

    @property
    def text(self) -> str:
        """Present text of the site file."""
        return self.steps[self.done - 1].text if self.done else self.base

    @property
    def texts(self) -> frozenset[str]:
        """All texts in the history."""
        return frozenset((self.base, *(step.text for step in self.steps)))

    @property
    def undo_label(self) -> str | None:
        """Label of the step that undo would revert."""
        return self.steps[self.done - 1].label if self.done else None

    @property
    def redo_label(self) -> str | None:
        """Label of the step that redo would repeat."""
        return self.steps[self.done].label if self.done < len(self.steps) else None

    def edit(self, label: str, edits: Sequence[Edit]) -> History:
        """Return the history with one more step; undone steps are dropped.

        Raises:
            SiteError: the file is not TOML.
            EditRefused: an edit cannot be done.
        """
        return self._add(Step(label, tuple(edits), apply_edits(self.text, edits)))

    def overwrite(self, label: str, text: str) -> History:
        """Return the history with a step in which another program has written the whole file."""
        return self._add(Step(label, None, text))

    def undo(self) -> History:
        """Return the history with one more step undone; unchanged if there is none."""
        return replace(self, done=max(0, self.done - 1))

    def redo(self) -> History:
        """Return the history with one more step redone; unchanged if there is none."""
        return replace(self, done=min(len(self.steps), self.done + 1))

    def _add(self, step: Step) -> History:
        steps = (*self.steps[: self.done], step)
        over = max(0, len(steps) - MOST_STEPS)
        base = steps[over - 1].text if over else self.base
        return History(base, steps[over:], len(steps) - over)


Done = Literal["base", "edit", "overwrite", "undo", "redo", "saved"]


class RecordLine(BaseModel):
    """One line of the record."""

    model_config = ConfigDict(extra="ignore")

    does: Done
    """`saved`: the site file matches the record."""
    label: str = ""
    text: str = ""
    edits: tuple[Edit, ...] = ()


def write_line(does: Done, label: str = "", text: str = "", edits: Sequence[Edit] = ()) -> bytes:
    """Return a line of the record."""
    line = RecordLine(does=does, label=label, text=text, edits=tuple(edits))
    return line.model_dump_json(exclude_defaults=True).encode() + b"\n"


def write_lines(history: History) -> bytes:
    """Return a whole record."""
    steps = (
        write_line("overwrite", one.label, one.text)
        if one.edits is None
        else write_line("edit", one.label, "", one.edits)
        for one in history.steps
    )
    undone = [write_line("undo")] * (len(history.steps) - history.done)
    return b"".join((write_line("base", text=history.base), *steps, *undone))


def read_lines(record: bytes) -> tuple[History, bool] | None:
    """Return the history of a record, and whether the site file was written after its last change; None if unusable.

    The last line may be torn: the server was killed while it wrote it, and had not confirmed it to a client yet.
    """
    history, saved = None, True
    for line in record.split(b"\n")[:-1]:
        try:
            said = RecordLine.model_validate_json(line)
        except ValidationError:
            break
        if history is None:
            if said.does != "base":
                return None
            history = History(said.text)
        else:
            saved = said.does == "saved"
            history = history if saved else _apply_line(history, said)
    return None if history is None else (history, saved)


def _apply_line(history: History, said: RecordLine) -> History:
    match said.does:
        case "edit":
            return history.edit(said.label, said.edits)
        case "overwrite":
            return history.overwrite(said.label, said.text)
        case "undo":
            return history.undo()
        case _:
            return history.redo()
