"""Choose a log's reader by its content."""

from __future__ import annotations

import re
from pathlib import Path

from executor.adapters.extras import Extra, require_extra
from executor.core.interface.recorded_log import RecordedFile
from executor.errors import LogError

ULOG_MAGIC = b"ULog\x01\x12\x35"
DATAFLASH_MAGIC = b"\xa3\x95"
MARKS = frozenset({0xFD, 0xFE})
STAMP = 8
HEAD = 4096
KNOWN = {".tlog", ".bin", ".ulg"}
DESCRIBES = re.compile(rb"^ *FMT *, *\d+ *, *\d+ *, *[A-Z]", re.MULTILINE)
"""Line of a DataFlash log in text that describes its other lines."""


def open_log(path: Path, *, every_record: bool = False) -> RecordedFile:
    """Return a reader for a log; for damaged and empty files, by the name.

    Args:
        path: The log.
        every_record: Whether to read all records; else each kind as often as a watchpoint needs it.

    Raises:
        ExtraMissing: It is a ULog, and no reader for it is installed.
        LogError: It cannot be read, or is no log of a known kind.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    kind = _detect_format(head, path.suffix.lower())
    if kind == ".tlog":
        from executor.adapters.mavlink.tlog_reader import TelemetryFile

        return TelemetryFile(path, every_record=every_record)
    if kind in {".bin", ".log"}:
        from executor.adapters.logs.dataflash import DataFlashFile

        return DataFlashFile(path, text=kind == ".log", every_record=every_record)
    if kind == ".ulg":
        require_extra(Extra.LOGS, f"{path}: a ULog")
        from executor.adapters.logs.ulog import UlogFile

        return UlogFile(path, every_record=every_record)
    if kind == ".raw":
        raise LogError(f"{path}: holds MAVLink without times: expected the telemetry log (.tlog) next to it")
    raise LogError(
        f"{path}: expected a telemetry log (.tlog), a DataFlash log (.BIN, .log), a ULog (.ulg) or a run directory"
    )


def is_log(path: Path) -> bool:
    """Return whether a file in a folder is a log, by its name or content, as other files are called .log too."""
    if path.suffix.lower() != ".log" or not path.is_file():
        return path.suffix.lower() in KNOWN
    with path.open("rb") as file:
        return _detect_format(file.read(HEAD), "") not in {"", ".raw"}


def _detect_format(head: bytes, suffix: str) -> str:
    if head.startswith(ULOG_MAGIC):
        return ".ulg"
    if head.startswith(DATAFLASH_MAGIC):
        return ".bin"
    if len(head) > STAMP and head[STAMP] in MARKS:
        return ".tlog"
    if DESCRIBES.search(head):
        return ".log"
    if _is_raw(head):
        return ".raw"
    return suffix if suffix in KNOWN else ""


def _is_raw(head: bytes) -> bool:
    """Return whether frames follow each other without a time between them."""
    if len(head) < STAMP or head[0] not in MARKS:
        return False
    behind = head[1] + (12 if head[0] == 0xFD else 8)
    return len(head) > behind and head[behind] in MARKS
