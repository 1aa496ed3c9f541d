"""Predict how ArduPilot stores a mission item, and so how it reads back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from missions.items import PAYLOAD, PLAIN_FRAMES, Command, Frame, MissionItem


def predict_stored_item(item: MissionItem) -> MissionItem:
    """Return an item as ArduPilot will return it.

    Measured: `current` is always 0, DO_CHANGE_SPEED and RTL return frame 0 and no place. From AP_Mission.cpp: frames
    with and without _INT are equivalent, heights are truncated to centimetres, the hold to whole seconds, and of a
    landing's param4 only the sign is kept.
    """
    is_relative = PLAIN_FRAMES.get(item.frame, item.frame) == Frame.GLOBAL_RELATIVE_ALT
    stored = replace(item, current=False, frame=Frame.GLOBAL_RELATIVE_ALT if is_relative else Frame.GLOBAL)
    if item.command == Command.DO_CHANGE_SPEED:
        return replace(stored, frame=Frame.GLOBAL, param4=0.0, x=0, y=0, z=0.0)
    if item.command == Command.NAV_RETURN_TO_LAUNCH:
        return MissionItem(item.seq, Frame.GLOBAL, item.command, autocontinue=item.autocontinue)
    if item.command in PAYLOAD - {Command.DO_SET_ROI_LOCATION}:
        return _predict_payload(replace(stored, frame=Frame.GLOBAL))
    height_cm = np.trunc(np.float32(item.z) * np.float32(100.0))
    stored = replace(stored, z=float(np.float32(height_cm) * np.float32(0.01)))
    if item.command == Command.NAV_LAND:
        return replace(stored, param4=-1.0 if item.param4 < 0 else 1.0)
    if item.command == Command.NAV_WAYPOINT:
        return replace(stored, param1=float(int(item.param1)))
    return stored


def _predict_payload(item: MissionItem) -> MissionItem:
    """Return a camera or gimbal item as AP_Mission stores it, by its source: fields without storage become 0."""
    match item.command:
        case Command.DO_SET_CAM_TRIGG_DIST:
            return replace(item, param2=0.0, param4=0.0, x=0, y=0, z=0.0)
        case Command.DO_GIMBAL_MANAGER_PITCHYAW:
            rates = (0.0 if math.isnan(rate) else float(int(rate)) for rate in (item.param3, item.param4))
            return replace(
                item, param1=float(int(item.param1)), param2=float(int(item.param2)), param3=next(rates),
                param4=next(rates), y=0,
            )  # fmt: skip
        case Command.DO_DIGICAM_CONTROL:
            return replace(item, y=0)
        case Command.IMAGE_START_CAPTURE:
            return replace(item, param3=float(int(item.param3)), param4=float(int(item.param4)), x=0, y=0, z=0.0)
        case _:
            return replace(item, param2=0.0, param3=0.0, param4=0.0, x=0, y=0, z=0.0)
