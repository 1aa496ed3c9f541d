"""Convert frames to messages and back; the only user of pymavlink in the simulator.

pymavlink serves as a codec; its connections are not used. None of its dialects has MAVLink's newer mission identities
(MISSION_CURRENT.mission_id, MISSION_ACK.opaque_id, MISSION_COUNT.opaque_id), so they are appended here.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from missions.items import Frame, MissionItem
from simulator import messages
from simulator.config import Signing

AUTOPILOT_COMPONENT = 1
EVERYBODY = 0
GROUND_STATION = 6
"""MAV_TYPE_GCS."""
EVERY_MISSION_TYPE = 255
EXTENSIONS: Mapping[str, tuple[str, ...]] = {
    "MISSION_CURRENT": ("mission_id", "fence_id", "rally_points_id"),
    "MISSION_ACK": ("opaque_id",),
    "MISSION_COUNT": ("opaque_id",),
}
"""uint32 extension fields that pymavlink lacks."""
HEADER = struct.Struct("<BBBBBBBHB")
MAGIC = 0xFD


Fields = Any
"""A decoded message's fields by MAVLink name; pymavlink's classes are untyped."""


def _to_e7(degrees: float) -> int:
    return round(degrees * 1e7) if math.isfinite(degrees) else 0


def _parse_command(said: Fields, x: float, y: float, z: float, frame: int | None = None) -> messages.Command:
    params = (said.param1, said.param2, said.param3, said.param4, float(x), float(y), z)
    return messages.Command(said.command, params, frame)


def _parse_set_point(said: Fields, *, local: bool) -> messages.SetPoint:
    place = (said.x, said.y, said.z) if local else (said.lat_int, said.lon_int, said.alt)
    velocity = (said.vx, said.vy, said.vz)
    return messages.SetPoint(said.coordinate_frame, said.type_mask, place, velocity, local)


def _parse_item(said: Fields, *, integer: bool) -> messages.ItemReceived:
    to_whole = int if integer else _to_e7 if said.frame != Frame.MISSION else _to_whole
    item = MissionItem(
        said.seq, said.frame, said.command, said.param1, said.param2, said.param3, said.param4, to_whole(said.x),
        to_whole(said.y), said.z, bool(said.current), bool(said.autocontinue),
    )  # fmt: skip
    return messages.ItemReceived(item, said.mission_type, integer)


def _to_whole(value: float) -> int:
    return int(value) if math.isfinite(value) else 0


def _parse_clear(said: Fields) -> messages.MissionClearAll:
    return messages.MissionClearAll(0 if said.mission_type == EVERY_MISSION_TYPE else said.mission_type)


FILE_HEAD = struct.Struct("<HBBBBBxI")
"""MAVFTP header: number, session, opcode, size, opcode of the request, end of a burst, offset; then data."""


def _parse_file_request(said: Fields) -> messages.FileRequest:
    payload = bytes(said.payload)
    number, session, operation, size, _, _, offset = FILE_HEAD.unpack_from(payload)
    return messages.FileRequest(number, session, operation, offset, payload[FILE_HEAD.size :][:size], size)


READERS: Mapping[str, Callable[[Fields], messages.Body]] = {
    "HEARTBEAT": lambda said: messages.Heartbeat(said.type == GROUND_STATION),
    "COMMAND_LONG": lambda said: _parse_command(said, said.param5, said.param6, said.param7),
    "COMMAND_INT": lambda said: _parse_command(said, said.x, said.y, said.z, said.frame),
    "SET_POSITION_TARGET_GLOBAL_INT": lambda said: _parse_set_point(said, local=False),
    "SET_POSITION_TARGET_LOCAL_NED": lambda said: _parse_set_point(said, local=True),
    "SET_MODE": lambda said: messages.SetMode(said.custom_mode),
    "MISSION_COUNT": lambda said: messages.MissionCount(said.count, said.mission_type),
    "MISSION_WRITE_PARTIAL_LIST": lambda said: messages.MissionWritePartialList(
        said.start_index, said.end_index, said.mission_type
    ),
    "MISSION_ITEM_INT": lambda said: _parse_item(said, integer=True),
    "MISSION_ITEM": lambda said: _parse_item(said, integer=False),
    "MISSION_REQUEST_LIST": lambda said: messages.MissionRequestList(said.mission_type),
    "MISSION_REQUEST": lambda said: messages.MissionRequest(said.seq, said.mission_type, integer=False),
    "MISSION_REQUEST_INT": lambda said: messages.MissionRequest(said.seq, said.mission_type, integer=True),
    "MISSION_ACK": lambda said: messages.MissionAckReceived(said.type, said.mission_type),
    "MISSION_CLEAR_ALL": _parse_clear,
    "MISSION_SET_CURRENT": lambda said: messages.MissionSetCurrent(said.seq),
    "PARAM_REQUEST_LIST": lambda _: messages.ParamRequestList(),
    "PARAM_REQUEST_READ": lambda said: messages.ParamRequestRead(said.param_id, said.param_index),
    "PARAM_SET": lambda said: messages.ParamSet(said.param_id, said.param_value, said.param_type),
    "REQUEST_DATA_STREAM": lambda said: messages.RequestDataStream(
        said.req_stream_id, said.req_message_rate, bool(said.start_stop)
    ),
    "FILE_TRANSFER_PROTOCOL": _parse_file_request,
    "RADIO_STATUS": lambda said: messages.RadioStatus(said.txbuf),
    "TIMESYNC": lambda said: messages.Timesync(said.tc1, said.ts1),
    "PING": lambda said: messages.Ping(said.time_usec, said.seq, said.target_system),
}


class _Parser(dialect.MAVLink):  # type: ignore[misc]  # pymavlink has no types
    """Parser that takes a time from frames with a right signature alone, as MAVLink's C library does."""

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:  # noqa: N803
        known = dict(self.signing.stream_timestamps)
        right = bool(super().check_signature(msgbuf, srcSystem, srcComponent))
        if not right:
            self.signing.stream_timestamps = known
        return right


class Codec:
    """Pack and unpack for one vehicle."""

    def __init__(
        self,
        sysid: int,
        *,
        every_component: bool = False,
        signing: Signing | None = None,
        component: int = AUTOPILOT_COMPONENT,
        others: frozenset[int] = frozenset(),
    ) -> None:
        self._sysid = sysid
        self._every_component = every_component
        """Whether it accepts messages for another component; ArduPilot does if it knows none with that id."""
        self._others = others
        """Other addressable components of the vehicle."""
        self._packer = dialect.MAVLink(None, srcSystem=sysid, srcComponent=component)
        self._began_ticks, self._ticks_per_s = 0, 0.0
        if signing is not None:
            self._began_ticks = self._packer.signing.timestamp = signing.began_ticks
            self._ticks_per_s = signing.ticks_per_s
            self._packer.signing.secret_key = signing.key
            self._packer.signing.sign_outgoing = True

    def encode(self, message: messages.Outbound, now_s: float = 0.0) -> bytes:
        """Return a MAVLink 2 frame; `now_s` since the start of the simulation dates its signature.

        Raises:
            AttributeError, TypeError, struct.error: MAVLink has no such message, field or value.
        """
        signing = self._packer.signing
        signing.timestamp = max(signing.timestamp, self._began_ticks + round(now_s * self._ticks_per_s))
        fields = dict(message.fields)
        tail = b"".join(struct.pack("<I", fields.pop(name, 0)) for name in EXTENSIONS.get(message.name, ()))
        packed = getattr(dialect, f"MAVLink_{message.name.lower()}_message")(**fields)
        frame = bytes(packed.pack(self._packer))
        if any(tail):
            frame = self._append_extension_fields(packed, tail)
        self._packer.seq = (self._packer.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[messages.Received]:
        """Return a datagram's messages for this vehicle; damaged and unknown ones are left out."""
        # One parser per datagram: a cut-off frame must not swallow the start of the next one.
        parser = _Parser(None)
        parser.robust_parsing = True
        parser.signing = self._packer.signing  # known signing streams, and their times
        received = []
        for message in parser.parse_buffer(datagram) or []:
            reader = READERS.get(message.get_type())
            if reader is None:
                continue
            if getattr(message, "target_system", EVERYBODY) not in {EVERYBODY, self._sysid}:
                continue
            target = getattr(message, "target_component", EVERYBODY)
            elsewhere = target not in {EVERYBODY, AUTOPILOT_COMPONENT, *self._others}
            if elsewhere and not self._every_component:
                continue
            sender = messages.Peer(message.get_srcSystem(), message.get_srcComponent())
            received.append(messages.Received(sender, reader(message), target))
        return received

    def _append_extension_fields(self, packed: dialect.MAVLink_message, tail: bytes) -> bytes:
        payload = bytes(packed.get_payload()).ljust(struct.calcsize(packed.unpacker.format), b"\0") + tail
        payload = payload.rstrip(b"\0")
        number, signing = packed.get_msgId(), self._packer.signing
        head = HEADER.pack(
            MAGIC, len(payload), int(signing.sign_outgoing), 0, self._packer.seq, self._sysid, AUTOPILOT_COMPONENT,
            number & 0xFFFF, number >> 16,
        )  # fmt: skip
        checksum = dialect.x25crc(head[1:] + payload + bytes([packed.crc_extra])).crc
        frame = head + payload + struct.pack("<H", checksum)
        if not signing.sign_outgoing:
            return frame
        frame += struct.pack("<BQ", signing.link_id, signing.timestamp)[:7]
        signing.timestamp += 1
        return frame + hashlib.sha256(signing.secret_key + frame).digest()[:6]
