"""Convert MAVLink's messages about a vehicle, field by field, for both links and telemetry logs.

A reader takes a pymavlink frame. Values that a vehicle marks as unknown become None. EVENT of MAVLink's common
messages, in which PX4 reports why a failsafe acts, is laid out here, as pymavlink's dialect lacks it.

STATUSTEXT is reassembled: a long text is sent in parts of 50 bytes, which may be duplicated, late or lost. Time-outs
count frames: at the rates that a flight requests (about ten frames a second), `PATIENCE_FRAMES` are a few seconds.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from types import MappingProxyType
from typing import Any

from pymavlink.generator.mavcrc import x25crc

from executor.adapters.mavlink.frame_layout import CHECKSUM, V2, payload_of
from executor.core import formatting
from executor.core.interface import messages
from executor.core.interface.recorded_log import MODE_COMMANDS
from missions import PX4, MissionItem
from missions.cameras import PictureProof

Frame = Any
"""A message's fields by MAVLink name; pymavlink's classes are generated and untyped."""
GCS_TYPE, NO_AUTOPILOT, ARMED = 6, 8, 128
"""MAV_TYPE, MAV_AUTOPILOT and MAV_MODE_FLAG of a HEARTBEAT."""
PREARM_CHECK = 0x10000000
POS_HORIZ_ABS, CONST_POS_MODE = 16, 128
"""Bits of EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS."""
NO_SATELLITES = 255
"""satellites_visible: unknown."""
NO_CHANNEL = 65535
"""Value of an unused channel in RC_CHANNELS and RC_CHANNELS_RAW."""
_CHANNELS, _RAW_CHANNELS = (attrgetter(*(f"chan{number}_raw" for number in range(1, most + 1))) for most in (18, 8))
DO_SET_MODE, SET_MODE = 176, 11
"""The command, and the id of the older message."""
MOST_MODES = 128
BREACHES = {0: messages.FenceStatus(False), 1: messages.FenceStatus(True)}
LANDED = {1: True, 2: False, 3: False, 4: False}
"""MAV_LANDED_STATE: whether it is on the ground."""
ACCEPTED = frozenset({0, 5})
"""MAV_RESULT: accepted, in progress."""


def read_heartbeat(frame: Frame) -> messages.Heartbeat | None:
    """Read an autopilot's HEARTBEAT; return None for a ground station, a camera or a gimbal."""
    if frame.type == GCS_TYPE or frame.autopilot == NO_AUTOPILOT:
        return None
    armed = bool(frame.base_mode & ARMED)
    return messages.Heartbeat(frame.autopilot, frame.custom_mode, armed, frame.system_status, frame.type)


def read_channels(frame: Frame) -> messages.RcChannels:
    """Read RC_CHANNELS, or RC_CHANNELS_RAW, which has the first eight channels and is ignored on a link."""
    values = _CHANNELS(frame)[: frame.chancount] if hasattr(frame, "chancount") else _RAW_CHANNELS(frame)
    return messages.RcChannels(tuple(0 if value == NO_CHANNEL else value for value in values))


def _to_percent(value: float) -> float | None:
    return value if 0 <= value <= 100 else None


def _read_position(frame: Frame) -> messages.Position:
    return messages.Position(
        boot_s=frame.time_boot_ms / 1e3,
        lat_deg=frame.lat / 1e7,
        lon_deg=frame.lon / 1e7,
        alt_msl_m=frame.alt / 1e3,
        alt_rel_m=frame.relative_alt / 1e3,
        north_m_s=frame.vx / 100,
        east_m_s=frame.vy / 100,
        down_m_s=frame.vz / 100,
        heading_deg=None if frame.hdg == 65535 else frame.hdg / 100,
    )


def _read_battery(frame: Frame) -> messages.Battery:
    cells = [cell for cell in frame.voltages if cell != 65535]
    cells += [cell for cell in frame.voltages_ext if cell not in {0, 65535}]
    return messages.Battery(
        battery=frame.id,
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=sum(cells) / 1e3 if cells else None,
        current_a=None if frame.current_battery < 0 else frame.current_battery / 100,
        consumed_ah=None if frame.current_consumed < 0 else frame.current_consumed / 1e3,
        charge_state=frame.charge_state,
        faults=frame.fault_bitmask,
        cells_v=tuple(cell / 1e3 for cell in cells) if len(cells) > 1 else (),
    )


def _read_gps(frame: Frame, receiver: int = 0) -> messages.Gps:
    satellites, off_mm = frame.satellites_visible, getattr(frame, "h_acc", 0)
    return messages.Gps(
        frame.fix_type,
        None if satellites == NO_SATELLITES else satellites,
        accuracy_m=off_mm / 1e3 or None,
        measured_s=frame.time_usec / 1e6 or None,
        receiver=receiver,
    )


def _read_estimator(frame: Frame) -> messages.EstimatorStatus:
    """Read the flags that both autopilots number alike."""
    return messages.EstimatorStatus(frame.flags & (POS_HORIZ_ABS | CONST_POS_MODE) == POS_HORIZ_ABS)


def _read_wind_cov(frame: Frame) -> messages.Wind:
    """Convert the wind vector, the direction in which the air moves (north, east), to the direction it comes from."""
    north_m_s, east_m_s = frame.wind_x, frame.wind_y
    from_deg = math.degrees(math.atan2(-east_m_s, -north_m_s)) % 360
    return messages.Wind(math.hypot(north_m_s, east_m_s), from_deg)


def _read_mission_current(frame: Frame) -> messages.MissionCurrent:
    return messages.MissionCurrent(frame.seq, frame.total or None, _read_number_behind(frame.get_msgbuf(), 6))


def read_opaque_id(frame: Frame) -> int | None:
    """Read the checksum in MISSION_ACK and MISSION_COUNT; return None if there is none."""
    return _read_number_behind(frame.get_msgbuf(), 4 if frame.get_type() == "MISSION_ACK" else 5)


def _read_number_behind(frame: bytes | None, size: int) -> int | None:
    """Read the uint32 after the fields that pymavlink knows; MAVLink 2 omits trailing zeros."""
    if not frame or frame[0] != V2:
        return None
    return int.from_bytes(payload_of(frame, size + 4)[size:], "little") or None


def _read_system_status(frame: Frame) -> messages.SystemStatus:
    enabled, healthy = frame.onboard_control_sensors_enabled, frame.onboard_control_sensors_health
    present = bool(frame.onboard_control_sensors_present & PREARM_CHECK)
    return messages.SystemStatus(
        # Without a battery, PX4 reports 65535 V and -1 %; ArduPilot 0 V and -1 % in its first seconds.
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=None if frame.voltage_battery in {0, 65535} else frame.voltage_battery / 1e3,
        unhealthy=enabled & ~healthy,
        prearm_ok=bool(healthy & PREARM_CHECK) if present else None,
        current_a=None if frame.current_battery == -1 else max(0.0, frame.current_battery / 100),
    )


def _read_radio(frame: Frame) -> messages.Radio:
    values = (frame.rssi, frame.remrssi, frame.noise, frame.remnoise)
    rssi, remote, noise, remote_noise = (None if value == 255 else value for value in values)
    return messages.Radio(rssi, remote, noise, remote_noise, frame.txbuf if frame.txbuf <= 100 else None)


def read_mode_order(frame: Frame, autopilot: int | None) -> tuple[int, int | None] | None:
    """Return the command of COMMAND_LONG, COMMAND_INT or SET_MODE, and its mode if any; None for other commands.

    Args:
        frame: The frame sent.
        autopilot: MAV_AUTOPILOT of its target.
    """
    if not hasattr(frame, "command"):
        return DO_SET_MODE, frame.custom_mode
    main, sub = frame.param2, frame.param3
    if frame.command != DO_SET_MODE or not all(0 <= one < MOST_MODES for one in (main, sub)):
        return (frame.command, None) if frame.command in MODE_COMMANDS else None
    return DO_SET_MODE, int(main) << 16 | int(sub) << 24 if autopilot == PX4.number else int(main)


def read_accepted_order(ack: Frame) -> int | None:
    """Return the accepted command of COMMAND_ACK if it changes a mode. ArduPilot 3 names the older message."""
    command: int = DO_SET_MODE if ack.command == SET_MODE else ack.command
    return command if command in MODE_COMMANDS and ack.result in ACCEPTED else None


def read_mission_item(frame: Frame) -> MissionItem:
    """Read MISSION_ITEM_INT, or MISSION_ITEM, whose coordinates are degrees."""
    x, y = (round(at * 1e7) if isinstance(at, float) else at for at in (frame.x, frame.y))
    return MissionItem(
        frame.seq, frame.frame, frame.command, frame.param1, frame.param2, frame.param3, frame.param4,
        x, y, frame.z, bool(frame.current), bool(frame.autocontinue),
    )  # fmt: skip


FIRST_UNIX_S = 1e9
"""Times before 2001 count from the vehicle's boot."""
IN_EARTH, IN_VEHICLE, YAW_LOCK = 64, 32, 16
"""GIMBAL_DEVICE_FLAGS: reference of its yaw; the third decides if neither of the first two is set."""


def angles_deg(q: Sequence[float]) -> tuple[float | None, float | None, float | None]:
    """Return roll, pitch and yaw of an attitude w, x, y, z; None if unknown, which MAVLink sends as zeros or NaN."""
    w, x, y, z = q
    if not all(map(math.isfinite, q)) or not 0.5 < w * w + x * x + y * y + z * z < 1.5:
        return None, None, None
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw) % 360


def _split_time(usec: int) -> tuple[float | None, float | None]:
    """Return the time since boot, and the Unix time: a field holds either."""
    seconds = usec / 1e6
    if not seconds:
        return None, None
    return (None, seconds) if seconds > FIRST_UNIX_S else (seconds, None)


def _read_image_captured(frame: Frame) -> messages.PictureTaken:
    roll, pitch, yaw = angles_deg(frame.q)
    placed = (frame.lat, frame.lon) != (0, 0)
    return messages.PictureTaken(
        PictureProof.CAPTURED,
        frame.get_srcComponent(),
        frame.camera_id,
        frame.image_index,
        ok=frame.capture_result == 1,
        boot_s=frame.time_boot_ms / 1e3 if frame.time_boot_ms else None,
        unix_s=frame.time_utc / 1e6 if frame.time_utc / 1e6 > FIRST_UNIX_S else None,
        lat_deg=frame.lat / 1e7 if placed else None,
        lon_deg=frame.lon / 1e7 if placed else None,
        alt_msl_m=frame.alt / 1e3 if placed else None,
        alt_rel_m=frame.relative_alt / 1e3 if placed else None,
        roll_deg=roll,
        pitch_deg=pitch,
        yaw_deg=yaw,
        file=formatting.escape_controls(frame.file_url),
    )


def _read_camera_feedback(frame: Frame) -> messages.PictureTaken:
    boot_s, unix_s = _split_time(frame.time_usec)
    return messages.PictureTaken(
        PictureProof.FEEDBACK,
        frame.get_srcComponent(),
        frame.cam_idx + 1,
        frame.img_idx,
        ok=True,
        boot_s=boot_s,
        unix_s=unix_s,
        lat_deg=frame.lat / 1e7,
        lon_deg=frame.lng / 1e7,
        alt_msl_m=frame.alt_msl,
        alt_rel_m=frame.alt_rel,
        roll_deg=frame.roll,
        pitch_deg=frame.pitch,
        yaw_deg=frame.yaw,
    )


def _read_camera_trigger(frame: Frame) -> messages.PictureTaken:
    boot_s, unix_s = _split_time(frame.time_usec)
    return messages.PictureTaken(
        PictureProof.TRIGGER, frame.get_srcComponent(), 0, frame.seq, ok=True, boot_s=boot_s, unix_s=unix_s
    )


def _read_capture_status(frame: Frame) -> messages.CameraStatus:
    free_mib = frame.available_capacity if math.isfinite(frame.available_capacity) else None
    return messages.CameraStatus(frame.get_srcComponent(), frame.video_status == 1, frame.image_count, free_mib)


def _read_storage(frame: Frame) -> messages.CameraStatus:
    ready = frame.status == 2  # STORAGE_STATUS_READY: only then its figures are valid
    return messages.CameraStatus(frame.get_srcComponent(), None, None, frame.available_capacity if ready else None)


def _read_gimbal_attitude(frame: Frame) -> messages.GimbalAttitude | None:
    _, pitch, yaw = angles_deg(frame.q)
    if pitch is None or yaw is None:
        return None
    said = frame.flags & (IN_EARTH | IN_VEHICLE)
    from_north = bool(said & IN_EARTH) if said else bool(frame.flags & YAW_LOCK)
    return messages.GimbalAttitude(pitch, yaw, from_north, failed=frame.failure_flags != 0)


def _read_mount_status(frame: Frame) -> messages.GimbalAttitude | None:
    known = math.isfinite(frame.pitch) and math.isfinite(frame.yaw)
    return messages.GimbalAttitude(frame.pitch, frame.yaw, from_north=False) if known else None


READERS: Mapping[str, Any] = MappingProxyType({
    "RADIO_STATUS": _read_radio,
    "HEARTBEAT": read_heartbeat,
    "GLOBAL_POSITION_INT": _read_position,
    "BATTERY_STATUS": _read_battery,
    "SYS_STATUS": _read_system_status,
    "EXTENDED_SYS_STATE": lambda frame: messages.LandedState(LANDED.get(frame.landed_state)),
    "ATTITUDE": lambda frame: messages.Attitude(math.degrees(frame.roll), math.degrees(frame.pitch)),
    "NAV_CONTROLLER_OUTPUT": lambda frame: messages.HeightTarget(frame.alt_error),
    "GPS_RAW_INT": _read_gps,
    "GPS2_RAW": lambda frame: _read_gps(frame, 1),
    "EKF_STATUS_REPORT": _read_estimator,
    "ESTIMATOR_STATUS": _read_estimator,
    "WIND_COV": _read_wind_cov,
    "WIND": lambda frame: messages.Wind(frame.speed, frame.direction % 360),
    "FENCE_STATUS": lambda frame: BREACHES.get(frame.breach_status),
    "HOME_POSITION": lambda frame: messages.Home(frame.latitude / 1e7, frame.longitude / 1e7, frame.altitude / 1e3),
    "MISSION_CURRENT": _read_mission_current,
    "MISSION_ITEM_REACHED": lambda frame: messages.MissionReached(frame.seq),
    "RC_CHANNELS": read_channels,
    "CAMERA_IMAGE_CAPTURED": _read_image_captured,
    "CAMERA_FEEDBACK": _read_camera_feedback,
    "CAMERA_TRIGGER": _read_camera_trigger,
    "CAMERA_CAPTURE_STATUS": _read_capture_status,
    "STORAGE_INFORMATION": _read_storage,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": _read_gimbal_attitude,
    "MOUNT_ORIENTATION": _read_mount_status,
})  # fmt: skip
"""Readers by MAVLink name of the message."""

EVENT = 410
EVENT_NAME = "EVENT"
EVENT_EXTRA = 160
"""CRC_EXTRA of EVENT, part of its checksum."""
EVENT_LAYOUT = struct.Struct("<IIHBBB40s")
"""EVENT's fields: id, vehicle's clock in ms, sequence number, target component and system, levels, arguments."""
_NUMBERS = ("id", "event_time_boot_ms", "sequence", "destination_component", "destination_system", "log_levels")


def build_event_frame(fields: Mapping[str, object], sysid: int, compid: int) -> bytes | None:
    """Return the frame of an event that another parser decoded; None if its fields do not fit."""
    arguments = fields.get("arguments")
    try:
        payload = EVENT_LAYOUT.pack(
            *(fields[name] for name in _NUMBERS), bytes(arguments if isinstance(arguments, list) else ())
        )
    except (KeyError, TypeError, ValueError, struct.error):
        return None
    frame = bytes((V2, len(payload), 0, 0, 0, sysid, compid, *EVENT.to_bytes(3, "little"))) + payload
    return frame + int(x25crc(frame[1:] + bytes((EVENT_EXTRA,))).crc).to_bytes(CHECKSUM, "little")


PART_BYTES = 50
"""Bytes of the text field; a part that does not fill it is the last one (common.xml)."""
PATIENCE_FRAMES = 40
"""Frames after its newest part until an incomplete text is shown."""
MEMORY_FRAMES = 400
"""Frames for which late and repeated parts of a shown text are recognised."""
GAP = "[...]"
"""Placeholder for parts that never arrived."""
MOST_LETTERS = 300
"""Most characters of a text; part numbers allow 12800 bytes, both autopilots' longest texts are below 256."""
MOST_SPEAKERS = 64
"""Most senders remembered; beyond, the one silent for longest is dropped."""

Source = tuple[int, int]
"""System and component id of a sender."""


@dataclass(slots=True)
class _PartialText:
    """A text in progress, or already shown."""

    severity: int
    parts: dict[int, bytes] = field(default_factory=dict)
    newest: int = 0
    """Frame count at its newest part."""
    shown: bool = False

    @property
    def is_whole(self) -> bool:
        last = max(self.parts)
        return len(self.parts) == last + 1 and len(self.parts[last]) < PART_BYTES

    def assemble(self) -> str:
        """Return the parts received, with a mark for each gap; a full last part may or may not be the end."""
        last = max(self.parts)
        pieces: list[bytes] = []
        for number in range(last + 1):
            if number in self.parts:
                pieces.append(self.parts[number])
            elif number - 1 in self.parts or number == 0:
                pieces.append(GAP.encode())
        return clean_text(b"".join(pieces))


def clean_text(raw: bytes) -> str:
    r"""Return a text that is safe to show, without its zero padding and PX4's trailing tab.

    >>> clean_text(b"Takeoff detected\t")
    'Takeoff detected'
    """
    said = formatting.escape_controls(raw.decode("utf-8", errors="replace").strip("\x00 \t\r\n"))
    return said if len(said) <= MOST_LETTERS else said[: MOST_LETTERS - len(GAP)] + GAP


class StatusTextAssembler:
    """Assemble the texts of all senders behind one endpoint."""

    def __init__(self) -> None:
        self._texts: dict[Source, dict[int, _PartialText]] = {}
        self._frames: dict[Source, int] = {}

    def count_frame(self, source: Source, frames: int = 1) -> list[messages.StatusText]:
        """Count frames of any kind; return the source's incomplete texts that have timed out."""
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
                given_up.append(messages.StatusText(text.severity, text.assemble()))
        return given_up

    def list_unfinished_texts(self) -> list[tuple[Source, messages.StatusText]]:
        """Return the incomplete texts and their sources, when nothing more will arrive."""
        return [
            (source, messages.StatusText(text.severity, text.assemble()))
            for source, texts in self._texts.items()
            for text in texts.values()
            if not text.shown
        ]

    def add_part(self, source: Source, severity: int, raw: bytes, number: int, part: int) -> list[messages.StatusText]:
        """Take one part; return the texts that it completes.

        Args:
            source: The sender.
            severity: MAV_SEVERITY.
            raw: The text field, padded with zeros or not.
            number: Id of the text; 0 is a text in one part.
            part: Number of the part, from 0.
        """
        raw = raw.split(b"\x00", 1)[0]
        if number == 0:
            return [messages.StatusText(severity, clean_text(raw))]
        found: list[messages.StatusText] = []
        texts = self._texts.setdefault(source, {})
        text = texts.get(number)
        if text is not None and text.parts.get(part, raw) != raw:
            # The same id with other words: the vehicle rebooted, and restarts its text ids.
            if not text.shown:
                found.append(messages.StatusText(text.severity, text.assemble()))
            text = None
        if text is None:
            text = texts[number] = _PartialText(severity)
        text.newest = self._frames.get(source, 0)
        if text.shown:
            return found
        text.parts[part] = raw
        if text.is_whole:
            text.shown = True
            found.append(messages.StatusText(text.severity, text.assemble()))
        return found
