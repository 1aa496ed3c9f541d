"""Telemetry logs made for tests, frame by frame, with pymavlink's own codec; and where the real ones lie."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mav

LOGS = Path(__file__).resolve().parents[2] / "shared" / "logs"
BEGAN_USEC = 1_800_000_000_000_000
AUTO = 3


def real_logs() -> Path:
    """Return the folder of the recorded flights; skip without it."""
    if not LOGS.is_dir():
        pytest.skip("the recorded flights are not beside the project (../shared/logs)")
    return LOGS


@dataclass(slots=True)
class Writer:
    """Frames of several systems with their own sequence numbers."""

    senders: dict[int, Any] = field(default_factory=dict)
    records: list[tuple[float, bytes]] = field(default_factory=list)

    def frame(self, system: int, message: Any) -> bytes:
        sender = self.senders.setdefault(system, mav.MAVLink(None, srcSystem=system, srcComponent=1))
        packed = bytes(message.pack(sender))
        sender.seq = (sender.seq + 1) % 256
        return packed

    def say(self, at_s: float, system: int, message: Any) -> None:
        self.records.append((at_s, self.frame(system, message)))

    def data(self) -> bytes:
        ordered = sorted(self.records, key=lambda one: one[0])
        return b"".join(struct.pack(">Q", BEGAN_USEC + round(at_s * 1e6)) + frame for at_s, frame in ordered)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.data())
        return path


def heartbeat(*, armed: bool = True, mode: int = AUTO, status: int = 4, autopilot: int = 3, kind: int = 2) -> Any:
    return mav.MAVLink_heartbeat_message(kind, autopilot, 128 if armed else 0, mode, status, 3)


def station() -> Any:
    return mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def position(at_s: float, east_m: float = 0.0, up_m: float = 20.0) -> Any:
    lon = round((13.3 + east_m / 71_000) * 1e7)
    return mav.MAVLink_global_position_int_message(
        round(1000 * (at_s + 60)), 503000000, lon, 300000, round(1000 * up_m), 0, 300, 0, 0
    )


def battery(percent: float, volts: float = 11.8, amperes: float = 30.0, consumed_mah: int = -1, state: int = 1) -> Any:
    cells = [round(1000 * volts), *[65535] * 9]
    return mav.MAVLink_battery_status_message(
        0, 0, 0, 32767, cells, round(100 * amperes), consumed_mah, -1, round(percent), 0, state
    )


def text(words: str, severity: int = 4) -> Any:
    return mav.MAVLink_statustext_message(severity, words.encode(), 0, 0)


def flight(
    writer: Writer, system: int, seconds: Iterable[int], *, drain_pct_s: float = 0.08, silent: range = range(0)
) -> None:
    """Write an ordinary flight of one vehicle, but for the seconds in which nothing of it is heard."""
    for second in seconds:
        if second in silent:
            continue
        used = drain_pct_s * second
        writer.say(second + 0.1, system, heartbeat())
        writer.say(second + 0.3, system, position(second, 3.0 * second))
        writer.say(second + 0.5, system, battery(100 - used, consumed_mah=round(50 * used)))
