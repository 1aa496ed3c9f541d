"""Compare sent with read-back items, allowing what each autopilot rewrites."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from missions.autopilots.dialect import Dialect
from missions.items import PLAIN_FRAMES, Command, Frame, MissionItem

_PLACE = frozenset((Command.NAV_WAYPOINT, Command.NAV_LAND, Command.NAV_TAKEOFF, Command.DO_SET_ROI_LOCATION))

E7_TOLERANCE = 1
"""Tolerance in 1e-7 degrees; PX4 stores degrees as float64 and multiplies them back."""


def find_mission_differences(
    sent: Sequence[MissionItem], read_back: Sequence[MissionItem], dialect: Dialect
) -> tuple[str, ...]:
    """Return messages on how the stored mission differs from the one sent; empty if it will fly the same.

    ``current`` is never compared: ArduPilot answers 0 everywhere, PX4 with its current item.

    Args:
        sent: In order of seq.
        read_back: In order of seq.
        dialect: Defines the allowed rewriting: home slot, frames, float32, height steps, a landing's yaw.
    """
    if len(sent) != len(read_back):
        return (f"{len(sent)} items sent, {len(read_back)} read back",)
    return tuple(
        f"item {ours.seq} ({_command_name(ours.command)}): {key} sent {was}, read back {now}"
        for ours, theirs in zip(sent, read_back, strict=True)
        for key, was, now in _find_item_differences(ours, theirs, dialect)
    )


def count_common_items(sent: Sequence[MissionItem], read_back: Sequence[MissionItem], dialect: Dialect) -> int:
    """Return how many leading items two missions have in common, compared as in `find_mission_differences`."""
    count = 0
    for ours, theirs in zip(sent, read_back, strict=False):
        if any(True for _ in _find_item_differences(ours, theirs, dialect)):
            break
        count += 1
    return count


def _find_item_differences(
    ours: MissionItem, theirs: MissionItem, dialect: Dialect
) -> Iterator[tuple[str, object, object]]:
    if ours.seq != theirs.seq:
        yield "seq", ours.seq, theirs.seq
    if ours.seq == 0 and not dialect.home_reads_back:
        return
    if ours.command != theirs.command:
        yield "command", ours.command, theirs.command
        return
    yaw_is_rewritten = ours.command == Command.NAV_LAND and not dialect.land_yaw_kept
    same = {
        "frame": _is_same_frame(ours, theirs, dialect),
        "autocontinue": ours.autocontinue == theirs.autocontinue,
        "param1": _is_same_float32(ours.param1, theirs.param1),
        "param2": _is_same_float32(ours.param2, theirs.param2),
        "param3": _is_same_float32(ours.param3, theirs.param3),
        "param4": yaw_is_rewritten or _is_same_float32(ours.param4, theirs.param4),
        "x": abs(ours.x - theirs.x) <= E7_TOLERANCE,
        "y": abs(ours.y - theirs.y) <= E7_TOLERANCE,
        # A stored height may have been truncated, not rounded, to its step: allow one whole step, plus float32 error.
        "z": _is_same_float32(ours.z, theirs.z) or abs(ours.z - theirs.z) <= 1.01 * dialect.height_step_m,
    }
    yield from ((key, getattr(ours, key), getattr(theirs, key)) for key, is_same in same.items() if not is_same)


def _is_same_frame(ours: MissionItem, theirs: MissionItem, dialect: Dialect) -> bool:
    if ours.command not in _PLACE and dialect.commands_lose_frame and theirs.frame == Frame.GLOBAL:
        return True
    return PLAIN_FRAMES.get(ours.frame, ours.frame) == PLAIN_FRAMES.get(theirs.frame, theirs.frame)


def _is_same_float32(a: float, b: float) -> bool:
    """Return whether two numbers are equal within two steps of float32; NaN equals NaN."""
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    return abs(a - b) <= 2.0 * float(np.spacing(np.float32(max(abs(a), abs(b)))))


def _command_name(command: int) -> str:
    return Command(command).name if command in set(Command) else str(command)
