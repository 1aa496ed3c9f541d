"""Keep the site file on disk: every change is saved at once; changes by other programs are read, not overwritten.

A folder `.faultline` next to the site holds the record of its changes. The record is written first, then the whole site
file: whatever a killed server has confirmed is in one of them. If neither can be written, the changes stay in memory,
the error is reported, and the next check tries again.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Self

from executor.adapters.run_directory import hold_lock
from executor.errors import SiteError
from executor.plan_page.site_document import Edit
from executor.plan_page.site_history import History, read_lines, write_line, write_lines
from missions.files import decode_text, write_whole

WORK_FOLDER = ".faultline"
BY_OTHERS = "a change in another program"

Signature = tuple[int, int, int]
"""Inode, size and time, by which the file last written is recognised."""


def work_folder_of(site: Path) -> Path:
    """Return the folder of a site's record and plans."""
    return site.parent / WORK_FOLDER / site.name


class SiteStore:
    """A site file being edited; a context manager, used by one thread at a time."""

    def __init__(self, path: Path) -> None:
        """Set the site file; entering reads it, and the record of its changes."""
        self.path = path.absolute()
        self.folder = work_folder_of(self.path)
        self.history = History("")
        self.save_error: str | None = None
        """Reason why the last change is not on disk."""
        self._waiting: list[bytes] = []
        """Record lines that are not on disk yet."""
        self._written: str | None = None
        """Text of the site file as last read or written."""
        self._seen: Signature | None = None
        self._record: FileIO | None = None
        self._stack = ExitStack()

    @property
    def saved(self) -> bool:
        """Whether the site file matches the page."""
        return self._written == self.history.text and not self._waiting

    def __enter__(self) -> Self:
        """Read the site and its record; lock both.

        Raises:
            SiteError: the site file cannot be read.
            LogError: another plan page has it open.
        """
        text, self._seen = self._read()
        self._written = text
        with suppress(OSError):  # reported with the first change
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock()
        self.history = self._reconcile(text)
        self._waiting = [write_lines(self.history)]
        self.save()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Try once more to save, and unlock."""
        self.look()
        self._record = None
        self._stack.close()

    def edit(self, label: str, edits: Sequence[Edit]) -> None:
        """Apply edits as one step.

        Raises:
            SiteError: the file is not TOML.
            EditRefused: an edit cannot be done.
        """
        self._change(self.history.edit(label, edits), write_line("edit", label, edits=edits))

    def undo(self) -> None:
        """Undo the last step, if there is one."""
        if self.history.undo_label is not None:
            self._change(self.history.undo(), write_line("undo"))

    def redo(self) -> None:
        """Redo the last undone step, if there is one."""
        if self.history.redo_label is not None:
            self._change(self.history.redo(), write_line("redo"))

    def look(self) -> bool:
        """Read changes by other programs, and try again to save; return whether the site has changed."""
        before = self.history
        self.save()
        return self.history is not before

    def save(self) -> None:
        """Write what is not yet on disk; on failure keep it in memory, and report the error."""
        try:
            self._take_foreign_change()
            self._write_record()
            if self._written != self.history.text:
                write_whole(self.path, self.history.text.encode())
                self._written, self._seen = self.history.text, _sign(self.path)
                self._waiting.append(write_line("saved"))
                self._write_record()
        except OSError as error:
            words = f"{error.filename or self.path}: cannot be written: {error.strerror}"
            self.save_error = f"{words}; the change is kept in memory, and tried again"
        except SiteError as error:
            self.save_error = f"{error}; nothing is saved until it is"
        else:
            self.save_error = None

    def _change(self, history: History, line: bytes) -> None:
        self.history = history
        self._waiting.append(line)
        self.save()

    def _lock(self) -> None:
        with suppress(ImportError):  # a system without locks
            self._stack.enter_context(hold_lock(self.folder / "lock", f"{self.path}: is open in another plan page"))

    def _read(self) -> tuple[str, Signature | None]:
        signature = _sign(self.path)
        try:
            content = self.path.read_bytes()
        except FileNotFoundError:
            raise SiteError(f"{self.path}: no such file; expected a site file (TOML)") from None
        except OSError as error:
            raise SiteError(f"{self.path}: cannot be read: {error.strerror}") from error
        return decode_text(content, str(self.path), SiteError), signature

    def _reconcile(self, text: str) -> History:
        """Return the history that the site file continues."""
        try:
            known = read_lines((self.folder / "edits.jsonl").read_bytes())
        except (OSError, SiteError):
            known = None
        if known is None:
            return History(text)
        history, saved = known
        if history.text == text or (not saved and text in history.texts):
            return history  # or it was killed before the site file was written, which is done now
        return history.overwrite(BY_OTHERS, text)

    def _take_foreign_change(self) -> None:
        """Take another program's changes; undo leads back to our unsaved ones."""
        signature = _sign(self.path)
        if signature is None or signature == self._seen:
            return
        text, self._seen = self._read()
        if text not in {self._written, self.history.text}:
            self.history = self.history.overwrite(BY_OTHERS, text)
            self._waiting.append(write_line("overwrite", BY_OTHERS, text))
        self._written = text

    def _write_record(self) -> None:
        if not self._waiting:
            return
        if self._record is None:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(self.folder / "edits.jsonl", write_lines(self.history))
            self._record = self._stack.enter_context((self.folder / "edits.jsonl").open("ab", buffering=0))
            self._waiting.clear()
            return
        content, end = b"".join(self._waiting), os.fstat(self._record.fileno()).st_size
        try:
            while content:
                content = content[self._record.write(content) :]
            os.fsync(self._record.fileno())
        except OSError:
            with suppress(OSError):
                self._record.truncate(end)  # a torn line would hide all later ones
            raise
        self._waiting.clear()


def _sign(path: Path) -> Signature | None:
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_ino, stat.st_size, stat.st_mtime_ns
